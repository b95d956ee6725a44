// The quick response of a file of which nothing is computed yet: pale, to one hundredth, as the model editor walks it.

import { post, stream } from "./api.js";

const NEUTRAL = 4; // the look of what is settled rather than followed

export class Quick {
  /** `begun` is called with the axes of a response before its first points, and `changed` after points. */
  constructor({ begun, changed }) {
    Object.assign(this, { begun, changed, curve: null, axes: [], note: "" });
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
        if (news.axes) await this.begin(news);
        else if (news.x || news.end) this.add(news);
      }
    } catch (error) {
      if (error.name === "AbortError") return;
      this.note = error.message; // the diagram then says how to begin
      this.changed();
    }
  }

  /** It is asked for, and has neither a point nor an end: the first on a machine also compiles the code. */
  get isAwaited() {
    return Boolean(this.request) && !this.curve && !this.note;
  }

  async begin({ axes }) {
    this.axes = axes;
    await this.begun(axes);
    this.rows = { x: [], y: [], label: [] };
  }

  add({ x = [], y = [], label = [], end = "" }) {
    const { rows } = this;
    this.note = end;
    if (rows) {
      x.forEach((value, k) => {
        const look = Math.min(label[k], NEUTRAL), jumps = label[k] > NEUTRAL && rows.label.length && rows.label.at(-1) !== NEUTRAL;
        rows.x.push(...(jumps ? [value, value] : [value])); // a gap before what settles beyond the end of the walk
        rows.y.push(...(jumps ? [NaN, y[k]] : [y[k]]));
        rows.label.push(...(jumps ? [look, look] : [look]));
      });
      this.curve = {
        key: "quick", result: "quick", branch: 0, name: "quick response", special: [], earlier: true, why: "quick, to one hundredth", count: rows.x.length,
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
    Object.assign(this, { request: null, curve: null, rows: null, axes: [], note: "" });
  }
}
