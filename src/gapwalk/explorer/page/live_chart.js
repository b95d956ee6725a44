// The live response of the text in the editor: it grows while it is walked; the one before stays, pale, until it is whole.
// While a slider moves, the points of the one before are moved at once, and are shown until the walk is whole.

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
    this.curve = { across, up, range, x: [], y: [], label: [], marks: [], whole: false };
    this.moved = null;
    this.began = performance.now();
    this.note.textContent = "walking…";
  }

  /** Take the points of the curve before, moved to new numbers. */
  move(points) {
    this.moved = { ...this.curve, ...points };
    this.note.textContent = "moving…";
    this.place.dataset.moved = Number(this.place.dataset.moved ?? 0) + 1;
    this.draw();
  }

  /** Take more points; `end` says in words why the walk ended, and is empty at the end of the range. */
  add({ x = [], y = [], label = [], marks = [], end, failed }) {
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
      curve.marks = marks;
      if (curve.whole) [this.before, this.moved] = [null, null];
      this.note.textContent = end || "A quick walk to one hundredth, with its special points; Compute locates them.";
    }
    this.note.classList.toggle("failed", Boolean(failed));
    this.draw();
  }

  draw() {
    const shown = this.moved ?? (this.curve?.x.length ? this.curve : this.before);
    if (!shown) return;
    const { across, up, range } = shown, [low, high] = [Math.min(...range), Math.max(...range)];
    const series = [...(this.before && !this.moved && this.before !== shown ? pieces(this.before, "ghost") : []), ...pieces(shown), ...special(shown)];
    drawPanel(this.place, { title: up, across, series }, { range: [low, high], left: 52, right: 24, height: Math.max(150, Math.min(340, 0.38 * this.place.clientWidth)) });
    this.place.dataset.points = shown.x.length;
  }
}

/** The special points of a curve: folds and grazes as dots, flips and Neimark-Sacker points as crosses. */
function special({ marks = [] }) {
  const found = (mark, kinds) => {
    const own = marks.filter(([kind]) => kinds.includes(kind));
    return { mark, look: "special", x: own.map(([, x]) => x), y: own.map(([, , y]) => y) };
  };
  return [found("dots", ["fold", "grazing"]), found("crosses", ["flip", "neimark-sacker"])].filter(({ x }) => x.length);
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
