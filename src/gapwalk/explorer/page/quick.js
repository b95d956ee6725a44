// The quick response of a file of which nothing is computed yet: pale, to one hundredth, as the model editor walks it.

import { post, stream } from "./api.js";

const LABELS = ["stable", "below", "above", "pair", "neutral", "settled"];
const NEUTRAL = 4; // the look of what is settled rather than followed

export class Quick {
  /** `begun` is called with the axes of a response before its first points, and `changed` after points. */
  constructor({ begun, changed }) {
    Object.assign(this, { begun, changed, curve: null, axes: [], note: "", failed: false });
  }

  /** Walk the response of a file; it is given up by `clear`. */
  async show(file) {
    this.clear();
    const request = (this.request = new AbortController());
    this.changed();
    try {
      const { text } = await post("/api/edit/open", { file });
      if (request.signal.aborted) return;
      for await (const news of stream("/api/edit/check", { file, text }, request.signal)) {
        if (request.signal.aborted) return;
        if (news.title?.axes) await this.begin(news.title);
        else if (news.x || news.end) this.add({ ...news, label: news.looks?.map((look) => LABELS.indexOf(look)) });
      }
    } catch (error) {
      if (error.name === "AbortError") return;
      Object.assign(this, { note: error.message, failed: true }); // the diagram then says how to begin
      this.changed();
    }
  }

  /** What becomes of it where it has no point: it is awaited (the first on a machine also compiles the code), or refused. */
  get words() {
    if (this.failed) return ` There is no quick response: ${this.note}. A motion that does not repeat is shown by Settle, and a study of kind rattle says which gaps part where.`.replace("..", ".");
    if (!this.request || this.note) return this.note ? ` (${this.note})` : "";
    return this.axes.length ? ` A quick response is on its way: the first motion over ${this.axes[0]} is sought.` : " A quick response is on its way; the first one of an installation takes up to a minute longer.";
  }

  async begin({ axes }) {
    this.axes = axes;
    await this.begun(axes);
    this.changed();
    this.rows = { x: [], y: [], label: [] };
  }

  add({ x = [], y = [], label = [], end = "", failed = false }) {
    const { rows } = this;
    Object.assign(this, { note: end, failed });
    if (rows) {
      rows.settles ||= label.some((each) => each > NEUTRAL); // a part where no orbit can be followed
      x.forEach((value, k) => {
        const look = Math.min(label[k], NEUTRAL), jumps = label[k] > NEUTRAL && rows.label.length && rows.label.at(-1) !== NEUTRAL;
        rows.x.push(...(jumps ? [value, value] : [value])); // a gap before what settles beyond the end of the walk
        rows.y.push(...(jumps ? [NaN, y[k]] : [y[k]]));
        rows.label.push(...(jumps ? [look, look] : [look]));
      });
      this.curve = {
        key: "quick", result: "quick", branch: 0, name: "quick response", special: [], earlier: true, why: "quick, to one hundredth", settles: rows.settles, count: rows.x.length,
        x: Float64Array.from(rows.x), y: Float64Array.from(rows.y), label: Uint8Array.from(rows.label), node: Int32Array.from(rows.x.keys()),
      };
    }
    this.changed();
  }

  /** The curve over two axes, if it has points and is over these. */
  over(x, y) {
    return this.curve?.count && this.axes[0] === x && this.axes[1] === y ? this.curve : null;
  }

  clear() {
    this.request?.abort();
    Object.assign(this, { request: null, curve: null, rows: null, axes: [], note: "", failed: false });
  }
}
