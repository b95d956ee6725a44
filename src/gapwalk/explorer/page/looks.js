// How the lines of each result are drawn: in their own colour, pale, or not at all.

import { isEarlier } from "./results.js";

const $ = (id) => document.getElementById(id);
export const COLOURS = ["blue", "orange", "green", "purple", "red", "grey"];

/** The variable of the style sheet for the colour of a result; empty for the colours of stability. */
export const shadeOf = (colour) => (COLOURS.includes(colour) ? `--result-${colour}` : "");

export class Looks {
  /** `changed` is called when the diagram must be drawn again: with true if curves have to be fetched. */
  constructor(curves, lines, changed) {
    Object.assign(this, { curves, lines });
    $("ghosts-older").addEventListener("change", () => changed());
    $("ghosts-strength").addEventListener("input", () => { this.strengthen(); changed(); });
    this.strengthen();
  }

  /** Take the opacity of pale lines from the slider. */
  strengthen() {
    this.lines.pale = $("ghosts-strength").valueAsNumber / 100;
  }

  /** The results whose lines are drawn. */
  drawn(results) {
    return results.filter(({ drawn }) => drawn !== "hidden");
  }

  /** Mark the curves that are pale or have a colour of their own; return true if a mark has changed. */
  mark(results, model) {
    const drawn = this.drawn(results), last = drawn.filter(({ branches, settled }) => branches.length || settled).at(-1);
    const older = $("ghosts-older").checked, of = new Map(drawn.map((result) => [result.key, result]));
    let turned = false;
    for (const curve of [...this.curves.all.values(), ...this.curves.settled.values()]) {
      const result = of.get(curve.result);
      if (!result) continue;
      const isBefore = Boolean(result.branches[curve.branch]?.earlier), isOld = isEarlier(result, model);
      const isPale = isBefore || isOld || result.drawn === "pale" || (older && result !== last), shade = shadeOf(result.colour);
      turned ||= Boolean(curve.earlier) !== isPale || (curve.shade ?? "") !== shade;
      Object.assign(curve, { earlier: isPale, shade, why: isBefore ? "before the change" : isOld ? "of an earlier model" : "made pale" });
    }
    this.show(drawn);
    return turned;
  }

  /** Say in the legend which result has which colour, and show the slider where something is pale. */
  show(drawn) {
    const there = new Set([...this.curves.all.values()].map(({ result }) => result)), all = [...this.curves.all.values(), ...this.curves.settled.values()];
    $("ghosts").hidden = there.size < 2 && !all.some(({ earlier }) => earlier);
    for (const old of $("legend").querySelectorAll(".of-result")) old.remove();
    for (const { key, title, colour } of drawn) {
      if (!colour || !there.has(key)) continue;
      const entry = Object.assign(document.createElement("li"), { className: "of-result", title }), mark = document.createElement("i");
      mark.style.borderColor = `var(${shadeOf(colour)})`;
      entry.append(mark, Object.assign(document.createElement("span"), { textContent: title }));
      $("legend").append(entry);
    }
  }
}
