// The curve of the chosen point as a table beside the diagram, to look at, to copy, and to save.

import { LINES } from "./curves.js";
import { save } from "./dom.js";

const $ = (id) => document.getElementById(id);
const WORDS = { below: "unstable, beyond −1", above: "unstable, beyond +1", pair: "unstable, complex pair" };

/** What kind of line a point is on, in words. */
export function kindOf(curve, index) {
  const kind = [...LINES.keys()][curve.label[index]] ?? "";
  return WORDS[kind] ?? kind;
}

export class CurveTable {
  /** `choose` is called with { curve, index } of a clicked row; `name` returns that of a file. */
  constructor(page, curves, diagram, { choose, name, tell }) {
    Object.assign(this, { page, curves, diagram, name, shown: null });
    $("table-open").addEventListener("click", () => this.toggle());
    $("table-csv").addEventListener("click", () => save(new Blob([this.text(",")], { type: "text/csv" }), `${name()}.csv`));
    $("table-copy").addEventListener("click", () => navigator.clipboard.writeText(this.text("\t")).then(() => { $("table-copy").textContent = "Copied"; }, tell));
    $("table-rows").addEventListener("click", ({ target }) => {
      const row = target.closest("tr[data-index]");
      const index = Number(row?.dataset.index), count = this.shown?.x.length ?? 0;
      if (row && index < count) choose({ curve: this.shown, index });
      else if (row) diagram.settledAt(index - count);
    });
  }

  toggle() {
    const open = $("table").hidden;
    $("table").hidden = !open;
    $("table-open").setAttribute("aria-pressed", open);
    this.shown = null;
    this.draw();
  }

  /** The curve of the chosen point, else the first one. */
  get curve() {
    return this.page.chosen?.curve ?? this.curves.drawn()[0] ?? null;
  }

  /** The points of the curve, and the settled motions where no orbit is followed; without both, the points of an answer. */
  rows(curve) {
    const rows = Array.from(curve?.x ?? [], (x, i) => [x, curve.y[i], curve.node[i] < 0 ? curve.special[-1 - curve.node[i]].text : kindOf(curve, i)]);
    const { settled, layers = [] } = this.diagram.over ?? {}, named = {};
    if (settled) return [...rows.map((row) => [...row, "", "", ""]), ...settled.x.map((x, k) => [x, settled.y[k], settled.kinds[k], settled.low[k] ?? "", settled.high[k] ?? "", settled.contacts[k]])];
    for (const { x, y, look, text } of curve ? [] : layers) {
      named[look] ||= text;
      rows.push(...x.map((value, k) => [value, y[k], text || named[look] || look]).filter(([value, up]) => value !== null && up !== null));
    }
    return rows;
  }

  get titles() {
    const { x, y } = this.diagram.names;
    return [x, y, "kind", ...(this.diagram.over?.settled ? ["least", "largest", "separations in a forcing period"] : [])];
  }

  /** The table with its heading; numbers have all their digits. */
  text(between) {
    const { curve } = this, cell = (text) => (between === "," && /[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    return [this.titles, ...this.rows(curve)].map((row) => row.map((each) => cell(String(each))).join(between)).join("\n") + "\n";
  }

  draw() {
    if ($("table").hidden) return;
    const { curve, titles, diagram: { over } } = this, made = document.createElement("table"), { chosen } = this.page;
    const of = [...titles, over?.key, over?.settled?.x.length, over?.layers.length].join();
    if (curve !== this.shown || this.of !== of) {
      [this.shown, this.of] = [curve, of];
      const rows = this.rows(curve), count = (curve?.x.length ?? 0) + (over?.settled?.x.length ?? 0);
      const parts = [curve && `${curve.name}, ${curve.node.filter((node) => node >= 0).length} points${curve.special.length ? " and the special points" : ""}`, over?.settled && `${over.settled.x.length} settled motions`].filter(Boolean);
      $("table-copy").textContent = "Copy";
      $("table-name").textContent = parts.join("; ") || (rows.length ? `${rows.length} points of the picture` : "no curve over these axes");
      const head = made.createTHead().insertRow(), body = made.createTBody();
      for (const words of titles) head.append(Object.assign(document.createElement("th"), { textContent: words, scope: "col" }));
      rows.forEach((cells, index) => {
        const row = body.insertRow();
        if (index < count) row.dataset.index = index;
        for (const each of cells) row.insertCell().textContent = typeof each === "number" ? Number(each.toPrecision(8)) : each;
      });
      $("table-rows").replaceChildren(made);
    }
    for (const old of $("table-rows").querySelectorAll(".chosen")) old.classList.remove("chosen");
    const index = chosen ? chosen.curve === curve && chosen.index : (curve?.x.length ?? 0) + (this.page.settled ?? NaN);
    const row = $("table-rows").querySelector(`[data-index="${index}"]`);
    row?.classList.add("chosen");
    if (row) $("table-rows").scrollTop = row.offsetTop - $("table-rows").clientHeight / 2;
  }
}
