// The chosen point of the diagram: what follows once a click (`diagram.js`) or a key (`keyboard.js`) has met a point.

import { unitOf } from "./dom.js";

const $ = (id) => document.getElementById(id);

/** Chooses points: each is marked in the diagram, and its motion is shown. `page.chosen` is the chosen one. */
export class Choice {
  /** `changed` is called after each choice, and `shown` with the motion of the chosen point once it is there. */
  constructor(page, { curves, diagram, keyboard, motion }, { changed = () => {}, shown = () => {} } = {}) {
    Object.assign(this, { page, curves, diagram, keyboard, motion, changed, shown });
    $("motion-go").addEventListener("click", () => $("motion").scrollIntoView());
  }

  /** Choose a point: { curve, index }, or { settled: result }. */
  choose(found) {
    const { page } = this;
    if (!page.about) return;
    if (found.settled !== undefined) {
      const { place } = this.curves.settled.get(found.settled) ?? {}, result = page.results?.find(({ key }) => key === found.settled);
      page.chosen = { start: { result: found.settled }, title: result?.title ?? found.settled, verdict: result?.verdict };
      this.diagram.choose(null, 0, place ?? null);
    } else {
      page.chosen = pointAt(found, $("x").value);
      this.keyboard.select(found.curve, found.index);
      this.diagram.choose(found.curve, found.index);
    }
    $("motion-go").hidden = false;
    $("motion-title").title = $("chosen").title = found.curve ? nameWords(found.curve.name) : "";
    this.changed();
    const { chosen } = page;
    this.motion.show({ file: page.about.file, ...chosen.start }, chosen.title, chosen.verdict).then((motion) => {
      if (motion && page.chosen === chosen) this.shown(motion);
    });
  }

  /** Choose nothing. */
  clear() {
    this.motion.clear();
    $("motion-go").hidden = true;
    this.page.chosen = null;
    this.diagram.mark = null;
    this.changed();
  }

  /** Find the chosen point on the curves of now. It stays chosen where its curve is not among them, or not yet. */
  keep() {
    const { chosen } = this.page, curve = this.curves.all.get(chosen?.key), index = curve ? curve.node.indexOf(chosen.node) : -1;
    if (chosen?.key) [chosen.curve, chosen.index] = index < 0 ? [null, -1] : [curve, index];
    const settled = this.curves.settled.get(chosen?.start.result)?.place ?? null;
    this.diagram.mark = index < 0 ? settled : [curve.x[index], curve.y[index]];
  }
}

/** What the name of a branch says, as P2-1. */
function nameWords(name) {
  const [, period, number] = /^P(\d+)-(\d+)/.exec(name) ?? [];
  return period ? `P${period}-${number}: branch ${number} of the motions that repeat after ${period} forcing period${period === "1" ? "" : "s"}` : "";
}

/**
 * A node of a curve: its place in the results, and its name; `x` is the name of what the diagram is over.
 *
 * `key` and `node` say which point it is whatever the axes are; `curve` and `index` say where it is over those of now.
 */
function pointAt({ curve, index }, x) {
  const node = curve.node[index], special = node < 0 ? curve.special[-1 - node] : null;
  const start = { result: curve.result, branch: curve.branch, ...(special ? { special: -1 - node } : { point: node }) };
  const words = $("x").selectedOptions[0]?.title ?? "", unit = unitOf(words).replace(/^ \[|\]$/g, " ").trimEnd();
  const at = `${/Ω$/.test(words) ? "Ω" : x.replace(/^measure:/, "")} = ${curve.x[index].toPrecision(8)}${unit}`;
  return { start, special, key: curve.key, node, curve, index, title: `${curve.name}${special ? `, ${special.text}` : ""}, ${at}` };
}
