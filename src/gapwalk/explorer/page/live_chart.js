// The live response of the text in the editor: it grows while it is walked; the one before stays, pale, until it is whole.

import { drawPanel } from "./panels.js";

const LOOKS = ["stable", "below", "above", "pair", "neutral", "neutral"]; // the last one is what settles

export class LiveChart {
  constructor(place, note) {
    Object.assign(this, { place, note, curve: null, before: null });
    new ResizeObserver(() => this.draw()).observe(place);
  }

  /** Forget what is shown. */
  clear(words = "") {
    [this.curve, this.before] = [null, null];
    this.place.replaceChildren();
    this.note.textContent = words;
  }

  /** A new walk begins: its curve takes the place of the old one once it has points. */
  begin({ across, up, range }) {
    if (this.curve?.whole) this.before = this.curve;
    const same = this.before?.across === across && this.before?.up === up;
    if (!same) this.before = null;
    this.curve = { across, up, range, x: [], y: [], label: [], whole: false };
    this.began = performance.now();
    this.note.textContent = "walking…";
  }

  /** Take more points; `end` says in words why the walk ended, and is empty at the end of the range. */
  add({ x = [], y = [], label = [], end, failed }) {
    const { curve } = this;
    if (!curve) {
      if (end) this.clear(end);
      return;
    }
    curve.x.push(...x);
    curve.y.push(...y);
    curve.label.push(...label);
    if (end !== undefined) {
      curve.whole = curve.x.length > 0;
      if (curve.whole) this.before = null;
      this.note.textContent = end || "A quick walk to one hundredth; Compute finds special points.";
    }
    this.note.classList.toggle("failed", Boolean(failed));
    this.draw();
  }

  draw() {
    const shown = this.curve?.x.length ? this.curve : this.before;
    if (!shown) return;
    const { across, up, range } = shown, [low, high] = [Math.min(...range), Math.max(...range)];
    const series = [...(this.before && this.before !== shown ? pieces(this.before, "ghost") : []), ...pieces(shown)];
    drawPanel(this.place, { title: up, across, series }, { range: [low, high], left: 52, right: 24, height: Math.max(150, Math.min(340, 0.38 * this.place.clientWidth)) });
    this.place.dataset.points = shown.x.length;
  }
}

/** The pieces of a curve of one kind of stability, each up to the first point of the next. */
function pieces({ x, y, label }, look = "") {
  const found = [];
  for (let i = 0; i < x.length; i++) {
    const last = found.at(-1);
    if (!last || last.label !== label[i]) {
      found.push({ label: label[i], x: [x[i]], y: [y[i]], mark: "line", look: look || LOOKS[label[i]] });
      if (last && label[i] < LOOKS.length - 1) { last.x.push(x[i]); last.y.push(y[i]); } // what settles does not follow
    } else {
      last.x.push(x[i]);
      last.y.push(y[i]);
    }
  }
  return found;
}
