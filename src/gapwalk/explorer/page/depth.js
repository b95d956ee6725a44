// The diagram in three dimensions: a third quantity into the depth, for families of branches and for loci.

import { get } from "./api.js";
import { LINES, unpack } from "./curves.js";
import { describe, SHADES } from "./diagram.js";
import { fill } from "./dom.js";
import { rangeOf, Space, START } from "./space.js";

const $ = (id) => document.getElementById(id);
const OWN = "of the family"; // the depth that the answer gives

export class Depth {
  /** `choose` is called with { curve, index }; `changed` when another depth is chosen: loci may be shown then, or not. */
  constructor({ page, curves, diagram, answer, choose, changed, tell }) {
    Object.assign(this, { page, curves, diagram, answer, tell, found: new Map() });
    this.space = new Space($("space"), { label: "Diagram in three dimensions", chosen: ({ of, index }) => choose({ curve: of, index }) });
    $("z").addEventListener("change", () => changed());
    const before = diagram.drawn, picture = diagram.picture.bind(diagram), mark = diagram.choose.bind(diagram);
    diagram.drawn = () => { before(); this.draw().catch(tell); };
    diagram.choose = (...point) => { mark(...point); if (this.isOn) this.draw().catch(tell); };
    const [zoom, fit] = ["zoom", "fit"].map((name) => diagram[name].bind(diagram));
    diagram.zoom = (factor) => (this.isOn ? this.space.turn({ zoom: this.space.view.zoom / factor ** 0.4 }) : zoom(factor));
    diagram.fit = () => { if (this.isOn) this.space.turn(START); fit(); };
    diagram.picture = (format) => (this.isOn ? this.picture(format) : picture(format));
  }

  get isOn() {
    return Boolean($("z").value);
  }

  /** The quantities into the depth: none, that of the family, and those of the axis across. */
  refill() {
    const own = this.answer.content?.space, names = [...$("x").options].map(({ value, text, title }) => [value, text, title]);
    const all = [["", "none (flat)"], ...(own ? [[OWN, own.words, own.words]] : []), ...names], said = JSON.stringify(all);
    if ($("z").dataset.said === said) return;
    const { value } = $("z");
    fill($("z"), all);
    $("z").dataset.said = said;
    $("z").value = all.some(([name]) => name === value) ? value : "";
  }

  async draw() {
    this.refill();
    const { value } = $("z"), on = this.isOn;
    $("diagram").classList.toggle("deep", on);
    $("space").hidden = !on;
    if (!on) return;
    const asked = (this.asked = {}), all = [...this.curves.all.values()].filter((curve) => value !== OWN || this.hasOwn(curve));
    const depths = await Promise.all(all.map((curve) => this.depthOf(curve, value)));
    if (this.asked !== asked || !this.isOn) return;
    this.space.show(this.content(all, depths));
  }

  /** Return true for a curve of the answer to which this gives a depth: of one that grows, its last curves may have none yet. */
  hasOwn(curve) {
    return curve.result === this.answer.key && this.answer.content?.space?.values[curve.branch] !== undefined;
  }

  /** The depth of each vertex of a curve. */
  async depthOf(curve, name) {
    if (name === OWN) return new Float64Array(curve.x.length).fill(this.answer.content.space.values[curve.branch]);
    const key = `${this.page.about.file}/${curve.key}/${name}`, known = this.found.get(key);
    if (known?.length === curve.x.length) return known;
    const found = unpack(await get("/api/curve", { file: this.page.about.file ?? "", result: curve.result, branch: curve.branch, from: 0, x: name, y: name })).x;
    this.found.set(key, found);
    return found.length === curve.x.length ? found : found.slice(0, curve.x.length); // it may have grown meanwhile
  }

  content(all, depths) {
    const lines = [], dots = [], styles = [...LINES.values()];
    all.forEach((curve, number) => {
      const zs = depths[number], pale = curve.earlier ? 0.35 : 1;
      for (let start = 0, i = 1; i <= curve.x.length; i++) {
        if (i < curve.x.length && curve.label[i] === curve.label[start]) continue;
        const end = Math.min(i + 1, curve.x.length), { shade, dashes, width } = styles[curve.label[start]];
        const points = [curve.x, zs, curve.y].map((values) => values.subarray(start, end));
        lines.push({ points, shade: curve.shade || shade, dashes, width, opacity: pale, of: curve, first: start, special: (k) => curve.node[start + k] < 0 });
        start = i;
      }
      curve.node.forEach((node, k) => {
        if (node >= 0) return;
        const special = curve.special[-1 - node], small = special.kind === "grazing";
        dots.push({ at: [curve.x[k], zs[k], curve.y[k]], shade: SHADES[special.kind] ?? "--ink", size: small ? 2.2 : 4.2, bare: small, text: describe({ ...special, branch: curve.name }) });
      });
    });
    lines.push(...this.ribs(all, depths));
    const name = (id) => $(id).selectedOptions[0]?.title || $(id).selectedOptions[0]?.text;
    const ranges = [all.map(({ x }) => x), depths, all.map(({ y }) => y)].map(rangeOf), { chosen } = this.page;
    const own = all.indexOf(chosen?.curve), mark = own >= 0 && chosen.index >= 0 ? [all[own].x, depths[own], all[own].y].map((values) => values[chosen.index]) : null;
    return { axes: ["x", "z", "y"].map((id, k) => ({ words: name(id), range: ranges[k] })), lines, dots, mark };
  }

  /** The special points of a family, joined from one member to the next. */
  ribs(all, depths) {
    return (this.answer.content?.ribs ?? []).flatMap(({ kind, exact, points }) => {
      const places = points.map(([branch, special]) => {
        const number = all.findIndex((curve) => curve.result === this.answer.key && curve.branch === branch), k = number < 0 ? -1 : all[number].node.indexOf(-1 - special);
        return k < 0 ? null : [all[number].x[k], depths[number][k], all[number].y[k]];
      });
      if (places.includes(null)) return [];
      return [{ points: [0, 1, 2].map((k) => places.map((place) => place[k])), shade: SHADES[kind] ?? "--ink", dashes: exact ? [] : [2, 4], width: 1.1, opacity: 0.8 }];
    });
  }

  /** What is seen, as a file. */
  async picture(format) {
    if (format !== "png") throw new Error("Three dimensions are saved as PNG: press PNG, or choose “none (flat)” as depth for SVG.");
    return new Promise((done) => this.space.canvas.toBlob(done, "image/png"));
  }
}
