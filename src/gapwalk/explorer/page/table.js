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
  /** `choose` is called with { curve, index } of a clicked row; `titles` returns those of the axes; `name` that of a file. */
  constructor(page, curves, { choose, titles, name, tell }) {
    Object.assign(this, { page, curves, titles, name, shown: null });
    $("table-open").addEventListener("click", () => this.toggle());
    $("table-csv").addEventListener("click", () => save(new Blob([this.text(",")], { type: "text/csv" }), `${name()}.csv`));
    $("table-copy").addEventListener("click", () => navigator.clipboard.writeText(this.text("\t")).then(() => { $("table-copy").textContent = "Copied"; }, tell));
    $("table-rows").addEventListener("click", ({ target }) => {
      const row = target.closest("tr[data-index]");
      if (row) choose({ curve: this.shown, index: Number(row.dataset.index) });
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

  rows(curve) {
    return Array.from(curve.x, (x, i) => [x, curve.y[i], curve.node[i] < 0 ? curve.special[-1 - curve.node[i]].text : kindOf(curve, i)]);
  }

  /** The table with its heading; numbers have all their digits. */
  text(between) {
    const { curve } = this, cell = (text) => (between === "," && /[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    return [[...this.titles(), "kind"], ...(curve ? this.rows(curve) : [])].map((row) => row.map((each) => cell(String(each))).join(between)).join("\n") + "\n";
  }

  draw() {
    if ($("table").hidden) return;
    const { curve } = this, made = document.createElement("table"), { chosen } = this.page;
    if (curve !== this.shown || this.of !== this.titles().join()) {
      [this.shown, this.of] = [curve, this.titles().join()];
      $("table-copy").textContent = "Copy";
      $("table-name").textContent = curve ? `${curve.name}, ${curve.node.filter((node) => node >= 0).length} points${curve.special.length ? " and the special points" : ""}` : "no curve over these axes";
      const head = made.createTHead().insertRow(), body = made.createTBody();
      for (const words of [...this.titles(), "kind"]) head.append(Object.assign(document.createElement("th"), { textContent: words, scope: "col" }));
      (curve ? this.rows(curve) : []).forEach(([x, y, kind], index) => {
        const row = body.insertRow();
        row.dataset.index = index;
        for (const each of [x, y]) row.insertCell().textContent = Number(each.toPrecision(8));
        row.insertCell().textContent = kind;
      });
      $("table-rows").replaceChildren(made);
    }
    for (const old of $("table-rows").querySelectorAll(".chosen")) old.classList.remove("chosen");
    const row = chosen?.curve === curve ? $("table-rows").querySelector(`[data-index="${chosen?.index}"]`) : null;
    row?.classList.add("chosen");
    if (row) $("table-rows").scrollTop = row.offsetTop - $("table-rows").clientHeight / 2;
  }
}
