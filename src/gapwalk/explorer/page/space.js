// Lines and points in three dimensions on a canvas, turned by dragging and by the arrow keys; near lines cross over far ones.

import { short, ticks } from "./chart.js";

/** The first view. */
export const START = { turn: -0.62, tilt: 0.38, zoom: 1 };
const STEP = Math.PI / 36; // of an arrow key
const PIECE = 10; // vertices of a line that are drawn at once: farther pieces first
const REACH = 14; // pixels within which the pointer means a point
const SHAPE = [1, 1, 0.72]; // half the lengths of the box: across, into the depth, up
const ROOM = 50; // pixels beside the box for numbers and names

export class Space {
  /** `chosen(item)` is called with the `of` of the line or dot that was clicked and its `index`; `words(dot)` is a tip. */
  constructor(place, { chosen = () => {}, label = "Three dimensions" } = {}) {
    Object.assign(this, { place, chosen, view: { ...START }, content: null });
    this.canvas = document.createElement("canvas");
    Object.assign(this.canvas, { tabIndex: 0 });
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `${label}. The arrow keys turn it, plus and minus zoom, 0 brings the first view back.`);
    this.tip = Object.assign(document.createElement("div"), { className: "tip", hidden: true });
    place.replaceChildren(this.canvas, this.tip);
    this.listen();
    new ResizeObserver(() => this.draw()).observe(place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /**
   * Show { axes: [{ words, range }] of across, depth and up; lines; dots; mark }.
   *
   * A line has `points`, three arrays, and a look: `shade` (a variable of the style sheet), `dashes`, `width`, `opacity`,
   * and `of`; a dot has `at`, `shade`, `size` and `text`. Values that are not finite break a line.
   */
  show(content) {
    this.content = content;
    this.draw();
  }

  listen() {
    const { canvas } = this;
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = { x: event.clientX, y: event.clientY, ...this.view, moved: false };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return this.hover(event);
      const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
      from.moved ||= Math.hypot(dx, dy) > 4;
      if (from.moved) this.turn({ turn: from.turn + dx / 160, tilt: from.tilt + dy / 160 });
    });
    canvas.addEventListener("pointerup", (event) => {
      if (from && !from.moved) this.click(event);
      from = null;
    });
    canvas.addEventListener("pointercancel", () => { from = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.turn({ zoom: this.view.zoom * Math.exp(-event.deltaY / 600) });
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.turn(START));
    canvas.addEventListener("keydown", (event) => {
      const { turn, tilt, zoom } = this.view;
      const moves = { ArrowLeft: { turn: turn - STEP }, ArrowRight: { turn: turn + STEP }, ArrowUp: { tilt: tilt + STEP }, ArrowDown: { tilt: tilt - STEP }, "+": { zoom: zoom * 1.2 }, "-": { zoom: zoom / 1.2 }, 0: START };
      if (!(event.key in moves) || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      event.stopPropagation(); // the diagram around it moves the choice by the same keys
      this.turn(moves[event.key]);
    });
  }

  turn(changes) {
    Object.assign(this.view, changes);
    this.view.tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.view.tilt));
    this.view.zoom = Math.max(0.3, Math.min(8, this.view.zoom));
    this.draw();
  }

  /** The place of a point of the box (from -1 to 1 each): [x, y, depth] in pixels, the depth growing away from the eye. */
  project(a, b, c) {
    const { cosines: [ct, st, cp, sp], scale, middle } = this;
    const [x, z, y] = [a * SHAPE[0], b * SHAPE[1], c * SHAPE[2]];
    const across = ct * x + st * z, into = -st * x + ct * z;
    return [middle[0] + scale * across, middle[1] - scale * (cp * y + sp * into), cp * into - sp * y];
  }

  prepare() {
    const { canvas, view, place } = this, ratio = window.devicePixelRatio || 1;
    const [width, height] = [place.clientWidth || 300, place.clientHeight || 200];
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    this.cosines = [Math.cos(view.turn), Math.sin(view.turn), Math.cos(view.tilt), Math.sin(view.tilt)];
    Object.assign(this, { scale: 1, middle: [0, 0] });
    const corners = [-1, 1].flatMap((a) => [-1, 1].flatMap((b) => [-1, 1].map((c) => this.project(a, b, c))));
    const reach = [0, 1].map((k) => Math.max(...corners.map((corner) => Math.abs(corner[k]))));
    this.scale = view.zoom * Math.max(10, Math.min((width / 2 - ROOM) / reach[0], (height / 2 - ROOM * 0.62) / reach[1]));
    this.middle = [width / 2 + 8, height / 2 - 4];
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return pen;
  }

  draw() {
    if (!this.content || !this.place.clientWidth) return;
    const pen = this.prepare(), { axes, lines, dots } = this.content;
    this.into = axes.map(({ range: [low, high] }) => (v) => (2 * (v - low)) / (high - low || 1) - 1);
    this.drawBox(pen, axes);
    const pieces = lines.flatMap((line) => this.pieces(line)).sort((a, b) => b.depth - a.depth);
    pen.lineJoin = pen.lineCap = "round";
    for (const piece of pieces) this.drawPiece(pen, piece);
    this.spots = dots.map((dot) => ({ dot, at: this.place3(dot.at) })).filter(({ at }) => at.every(Number.isFinite)).sort((a, b) => b.at[2] - a.at[2]);
    for (const { dot, at } of this.spots) circle(pen, at, dot.size ?? 4, colour(dot.shade), dot.bare ? null : colour("--card"));
    if (this.content.mark) circle(pen, this.place3(this.content.mark), 8, null, colour("--chosen"), 3);
    this.pointAt(this.now);
  }

  place3([a, b, c]) {
    return this.project(this.into[0](a), this.into[1](b), this.into[2](c));
  }

  /** A moving point, drawn over the rest in an element of its own. */
  pointAt(at) {
    this.now = at;
    this.dot ??= Object.assign(document.createElement("i"), { className: "now" });
    if (!at || !this.into) return this.dot.remove();
    const [x, y] = this.place3(at);
    Object.assign(this.dot.style, { left: `${x}px`, top: `${y}px` });
    if (!this.dot.isConnected) this.place.append(this.dot);
  }

  /** The pieces of a line with their mean depths; each begins where the one before ends. */
  pieces(line) {
    const [xs, zs, ys] = line.points, found = [];
    let own = [], length = 0, begun = 0;
    const end = (again) => {
      if (own.length > 1) found.push({ line, own, begun, depth: own.reduce((sum, p) => sum + p[2], 0) / own.length });
      own = again ? [own.at(-1)] : [];
      begun = length;
    };
    for (let i = 0; i < xs.length; i++) {
      const point = this.place3([xs[i], zs[i], ys[i]]);
      if (!point.every(Number.isFinite)) { end(false); continue; }
      if (own.length) length += Math.hypot(point[0] - own.at(-1)[0], point[1] - own.at(-1)[1]);
      own.push(point);
      if (own.length > PIECE) end(true);
    }
    end(false);
    return found;
  }

  drawPiece(pen, { line: { shade, dashes = [], width = 1.7, opacity = 1 }, own, begun }) {
    pen.beginPath();
    own.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.globalAlpha = 1;
    pen.setLineDash([]);
    pen.strokeStyle = colour("--card"); // a rim, so that a near line is seen to cross over a far one
    pen.lineWidth = width + 2.4;
    pen.lineCap = "butt";
    pen.stroke();
    pen.globalAlpha = opacity;
    pen.setLineDash(dashes);
    pen.lineDashOffset = begun;
    pen.strokeStyle = colour(shade);
    pen.lineWidth = width;
    pen.stroke();
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  /** The far sides of the box with their grids, and three edges with numbers and names. */
  drawBox(pen, axes) {
    const far = [0, 1, 2].map((axis) => {
      const side = (s) => this.project(...[0, 1, 2].map((k) => (k === axis ? s : 0)))[2];
      return side(1) >= side(-1) ? 1 : -1;
    });
    const marks = axes.map(({ range: [low, high] }) => ticks(low, high, 5).filter((tick) => tick >= low && tick <= high));
    pen.lineWidth = 1;
    for (let axis = 0; axis < 3; axis++) {
      const [one, other] = [0, 1, 2].filter((k) => k !== axis);
      const at = (u, v) => { const p = [0, 0, 0]; p[axis] = far[axis]; p[one] = u; p[other] = v; return this.project(...p); };
      pen.strokeStyle = colour("--grid");
      for (const tick of marks[one]) segment(pen, at(this.into[one](tick), -1), at(this.into[one](tick), 1));
      for (const tick of marks[other]) segment(pen, at(-1, this.into[other](tick)), at(1, this.into[other](tick)));
      pen.strokeStyle = colour("--line");
      for (const s of [-1, 1]) { segment(pen, at(s, -1), at(s, 1)); segment(pen, at(-1, s), at(1, s)); }
    }
    this.texts = []; // the boxes of numbers and names: none covers another
    const low = far[2] === 1 && this.view.tilt < 0 ? 1 : -1; // the edge nearest to the lower border of the picture
    const uprights = [[far[0], -far[1]], [-far[0], far[1]]].sort(([a, b], [c, d]) => this.project(a, b, 0)[0] - this.project(c, d, 0)[0]);
    const edges = [(t) => [t, -far[1], low], (t) => [-far[0], t, low], (t) => [...uprights[0], t]];
    for (const names of [true, false]) edges.forEach((at, axis) => this.drawEdge(pen, axes[axis], marks[axis], axis, at, names));
  }

  /** The name of an edge, or its numbers; numbers give way to names, and to the numbers of edges before. */
  drawEdge(pen, { words }, marks, axis, at, isName) {
    const [a, b] = [at(-1), at(1)].map((p) => this.project(...p)), long = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (long < 24) return; // it points at the eye
    // away from the middle of the box, and across the edge
    let away = [-(b[1] - a[1]) / long, (b[0] - a[0]) / long];
    const middle = [(a[0] + b[0]) / 2 - this.middle[0], (a[1] + b[1]) / 2 - this.middle[1]];
    if (away[0] * middle[0] + away[1] * middle[1] < 0) away = away.map((v) => -v);
    pen.textBaseline = "middle";
    pen.font = "10.5px system-ui, sans-serif";
    const texts = marks.map((tick) => short(tick, marks.at(-1) - marks[0])), widths = texts.map((text) => pen.measureText(text).width);
    if (isName) return this.drawName(pen, words, a, b, away, 16 + Math.abs(away[0]) * (Math.max(0, ...widths) + 6) + Math.abs(away[1]) * 8);
    pen.textAlign = away[0] < -0.5 ? "right" : away[0] > 0.5 ? "left" : "center";
    pen.fillStyle = colour("--soft");
    marks.forEach((tick, k) => {
      const [x, y] = this.project(...at(this.into[axis](tick))), [px, py] = [x + 8 * away[0], y + 8 * away[1]];
      const left = { right: px - widths[k], left: px, center: px - widths[k] / 2 }[pen.textAlign];
      if (this.claim([[left - 2, py - 6, left + widths[k] + 2, py + 6]])) pen.fillText(texts[k], px, py);
    });
  }

  drawName(pen, words, a, b, away, first) {
    const long = Math.hypot(b[0] - a[0], b[1] - a[1]);
    pen.fillStyle = colour("--ink");
    pen.font = "12px system-ui, sans-serif";
    let angle = Math.atan2(b[1] - a[1], b[0] - a[0]);
    if (Math.abs(angle) > Math.PI / 2 + 1e-6) angle -= Math.sign(angle) * Math.PI;
    const text = clipped(pen, words, Math.max(long * 1.15, 90)), half = pen.measureText(text).width / 2;
    const count = Math.max(1, Math.ceil(half / 6)), parts = Array.from({ length: count }, (_, k) => ((2 * k + 1) / count - 1) * half);
    for (let off = first, k = 0; k < 5; k++, off += 8) {
      const [x, y] = [(a[0] + b[0]) / 2 + off * away[0], (a[1] + b[1]) / 2 + off * away[1]];
      const boxes = parts.map((along) => [x + along * Math.cos(angle), y + along * Math.sin(angle)]).map(([u, v]) => [u - 7, v - 7, u + 7, v + 7]);
      if (!this.claim(boxes) && k < 4) continue;
      pen.save();
      pen.translate(x, y);
      pen.rotate(angle);
      pen.textAlign = "center";
      pen.fillText(text, 0, 0);
      pen.restore();
      return;
    }
  }

  /** Take room for a text, which is covered by some boxes; false if another one has it. */
  claim(boxes) {
    const meets = (box) => this.texts.some((text) => text.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]));
    if (boxes.some(meets)) return false;
    this.texts.push(boxes);
    return true;
  }

  offset({ clientX, clientY }) {
    const box = this.canvas.getBoundingClientRect();
    return [clientX - box.left, clientY - box.top];
  }

  hover(event) {
    const [px, py] = this.offset(event);
    const found = (this.spots ?? []).filter(({ dot }) => dot.text).map((spot) => ({ ...spot, away: Math.hypot(spot.at[0] - px, spot.at[1] - py) })).filter(({ away }) => away < REACH).sort((a, b) => a.away - b.away)[0];
    this.tip.hidden = !found;
    if (!found) return;
    this.tip.innerHTML = found.dot.text;
    Object.assign(this.tip.style, px > this.place.clientWidth / 2 ? { left: "6px", right: "auto" } : { left: "auto", right: "6px" });
    Object.assign(this.tip.style, py > this.place.clientHeight / 2 ? { top: "6px", bottom: "auto" } : { top: "auto", bottom: "6px" });
  }

  /** Choose the nearest vertex of a line that can be chosen. */
  click(event) {
    const [px, py] = this.offset(event);
    let best = REACH, found = null;
    for (const line of this.content?.lines ?? []) {
      if (!line.of) continue;
      const [xs, zs, ys] = line.points;
      for (let i = 0; i < xs.length; i++) {
        const [x, y] = this.place3([xs[i], zs[i], ys[i]]), away = Math.hypot(x - px, y - py) * (line.special?.(i) ? 0.6 : 1);
        if (away < best) [best, found] = [away, { of: line.of, index: line.first + i }];
      }
    }
    if (found) this.chosen(found);
  }
}

/** The range of values with a little room; of one value, about it. */
export function rangeOf(lists) {
  let low = Infinity, high = -Infinity;
  for (const list of lists) for (const v of list) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(low <= high)) return [0, 1];
  const pad = (high - low || Math.abs(high) || 1) * 0.03;
  return [low - pad, high + pad];
}

function segment(pen, [x, y], [u, v]) {
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(u, v);
  pen.stroke();
}

function circle(pen, [x, y], radius, fill, rim, width = 1) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (rim) { pen.strokeStyle = rim; pen.lineWidth = width; pen.stroke(); }
}

function clipped(pen, words, room) {
  let text = words.replace(/ \(.*?\)/, "");
  if (pen.measureText(text).width <= room) return text;
  while (text.length > 4 && pen.measureText(`${text}…`).width > room) text = text.slice(0, -1);
  return `${text}…`;
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
