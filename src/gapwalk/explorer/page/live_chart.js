// Live answers to the text in the editor: curves that grow while they are computed, and shares of starts as bars.
// While a slider moves, the points of the curve before are moved at once, and are shown until the new one is whole.

import { shares } from "./answer.js";
import { drawPanel } from "./panels.js";

const LOOKS = { fold: "above", flip: "below", "neimark-sacker": "pair", grazing: "neutral", settled: "neutral" }; // of loci, and of what settles
const LINES = { stable: "solid", below: "dashed", above: "dotted", pair: "dash-dotted", neutral: "grey" };
const MEANINGS = { below: "unstable, beyond −1", above: "unstable, beyond +1", pair: "unstable, complex pair", neutral: "neutral or unknown" };
const REST = 1000; // milliseconds without a change after which the next one is another change
const MARGINS = { left: 52, right: 24 };

export class LiveChart {
  /** `words`: what is shown, once it is whole; or a function that says so of a curve. */
  constructor(place, note, words) {
    const said = typeof words === "string" ? () => words : words;
    Object.assign(this, { place, note, words: said, curve: null, last: null, before: null, begun: 0, at: null });
    this.legend = Object.assign(document.createElement("p"), { className: "hint" });
    place.after(this.legend);
    new ResizeObserver(() => this.draw()).observe(place);
  }

  /** Forget what is shown. */
  clear(words = "") {
    [this.curve, this.last, this.before, this.moved] = [null, null, null, null];
    this.place.replaceChildren();
    [this.legend.textContent, this.note.textContent] = ["", words];
  }

  /** Take news: a title, the points of the curve before that were moved, or new points. */
  take(news) {
    if (news.title) this.begin(news.title);
    else if (news.moved) this.move(news.moved);
    else this.add(news);
  }

  /** A new curve begins: it takes the place of the old one once it has points. */
  begin({ across, up, range }) {
    const isNext = performance.now() > this.begun + REST; // while a slider moves, the one before it moved stays
    if (this.curve?.whole) [this.last, this.before] = [this.curve, isNext ? this.curve : this.before ?? this.curve];
    this.begun = performance.now();
    if (this.last?.across !== across || this.last?.up !== up) [this.last, this.before] = [null, null];
    if (!this.last) this.place.classList.add("stale");
    this.curve = { across, up, range, x: [], y: [], looks: [], marks: [], whole: false };
    this.moved = null;
    this.note.textContent = "walking…";
  }

  /** Take the points of the curve before, moved to new numbers. */
  move(points) {
    this.moved = { ...this.curve, ...points };
    this.note.textContent = "moving… Coarse until it rests: it may lack a pair of folds.";
    this.place.dataset.moved = Number(this.place.dataset.moved ?? 0) + 1;
    this.draw();
  }

  /** Take more points; `end` says in words why there are no more, and is empty if nothing is left out. */
  add({ x = [], y = [], looks = [], marks = [], end, failed }) {
    const { curve } = this;
    if (!curve) {
      if (end) this.clear(end);
      return;
    }
    curve.x.push(...x);
    curve.y.push(...y);
    curve.looks.push(...looks);
    curve.marks.push(...marks);
    if (end !== undefined) {
      curve.whole = curve.x.length > 0;
      if (curve.whole) this.moved = null;
      this.note.textContent = end && (failed || !curve.whole) ? end : [end, this.words(curve)].filter(Boolean).join(". ");
    }
    this.note.classList.toggle("failed", Boolean(failed));
    this.draw();
  }

  /** The value across at a place of the pointer; null without a curve. */
  valueAt(event) {
    const { left, width } = this.place.getBoundingClientRect(), share = (event.clientX - left - MARGINS.left) / (width - MARGINS.left - MARGINS.right);
    if (!this.curve) return null;
    const [low, high] = [Math.min(...this.curve.range), Math.max(...this.curve.range)];
    return Number((low + Math.min(1, Math.max(0, share)) * (high - low)).toPrecision(4));
  }

  draw() {
    const shown = this.moved ?? (this.curve?.x.length ? this.curve : this.last);
    if (!shown) return;
    this.place.classList.toggle("stale", false);
    const { across, up, range } = shown, [low, high] = [Math.min(...range), Math.max(...range)];
    const ghosts = this.before && this.before !== shown ? pieces(this.before, "ghost") : [], series = [...ghosts, ...pieces(shown), ...special(shown)];
    drawPanel(this.place, { title: up, across, series }, { range: [low, high], ...MARGINS, lines: this.at === null ? [] : [{ at: this.at, exact: true }], height: Math.max(150, Math.min(340, 0.38 * this.place.clientWidth)) });
    this.place.dataset.points = shown.x.length;
    this.legend.textContent = legend(shown, ghosts.length > 0);
  }
}

/** The special points of a curve: folds and grazes as dots, flips and Neimark-Sacker points as crosses, of a locus stars. */
function special({ marks = [] }) {
  const found = (mark, kinds) => {
    const own = marks.filter(([kind]) => kinds.includes(kind));
    return { mark, look: "special", x: own.map(([, x]) => x), y: own.map(([, , y]) => y) };
  };
  const others = marks.map(([kind]) => kind).filter((kind) => !["fold", "grazing", "flip", "neimark-sacker"].includes(kind));
  return [found("dots", ["fold", "grazing"]), found("crosses", ["flip", "neimark-sacker"]), found("stars", others)].filter(({ x }) => x.length);
}

/** What the marks and lines of a curve are, of those that are drawn. */
function legend({ marks, looks }, hasGhost) {
  const of = (mark, kinds) => [mark, kinds.filter((each) => marks.some(([kind]) => kind === each)).join(" or ")];
  const lines = [...new Set(looks)].filter((look) => look !== null).map((look) => [LINES[LOOKS[look] ?? look], MEANINGS[look] ?? look]);
  const all = [...lines, of("dot", ["fold", "grazing"]), of("cross", ["flip", "neimark-sacker"]), ["pale", hasGhost ? "before" : ""]];
  return all.filter(([, words]) => words).map((each) => each.join(": ")).join("; ");
}

/** The pieces of a curve of one kind of stability, each up to the first point of the next. */
function pieces({ x, y, looks }, look = "") {
  const found = [];
  for (let i = 0; i < x.length; i++) {
    const last = found.at(-1);
    if (last?.label !== looks[i]) {
      found.push({ label: looks[i], x: [x[i]], y: [y[i]], mark: "line", look: look || LOOKS[looks[i]] || looks[i] });
      if (last && looks[i] !== "settled") { last.x.push(x[i]); last.y.push(y[i]); } // what settles does not follow
    } else {
      last.x.push(x[i]);
      last.y.push(y[i]);
    }
  }
  return found;
}

/** Shares of random starts that lead to each motion. */
export class LiveShares {
  constructor(place, note, { field, box }) {
    Object.assign(this, { place, note, field, box });
  }

  clear(words = "") {
    this.place.replaceChildren();
    this.note.textContent = words;
  }

  take({ title, moved, bars, starts, end, failed }) {
    if (title) {
      this.field.parentElement.hidden = title.at === null;
      this.field.previousSibling.textContent = `${title.across} `;
      if (document.activeElement !== this.field) this.field.value = title.at;
      this.box.textContent = `Starts: ${title.box}.`;
      this.note.textContent = "computing…";
    }
    if (moved) this.place.dataset.moved = Number(this.place.dataset.moved ?? 0) + 1;
    const found = moved?.bars ?? bars;
    if (found?.length) this.place.replaceChildren(shares(found, 1));
    const [count] = moved?.starts ?? starts ?? [];
    if (count) this.note.textContent = moved ? `moving… ${count} starts, sorted by the motions of before` : `${count} random starts, those between two motions computed exactly. Thin lines: with 95 % confidence, the true share is between their ends.`;
    if (end) this.note.textContent = end;
    this.note.classList.toggle("failed", Boolean(failed));
    if (end !== undefined) this.place.dataset.whole = Number(this.place.dataset.whole ?? 0) + 1;
  }
}
