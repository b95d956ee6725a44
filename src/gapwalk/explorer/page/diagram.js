// The diagram: Plotly draws it, and this says what is drawn and which point a click meets.

import { zoom } from "./chart.js";
import { crossings, describeCluster, letters, opened, placing, RADIUS, sorted } from "./clusters.js";
import { unitOf } from "./dom.js";
import { Lines } from "./lines.js";
import { kindOf } from "./table.js";
import { arrowsOf, cellTraces, labelsOf, shapesOf, tracesOf } from "./overlay.js";

const SYMBOLS = {
  fold: ["circle", "--above", 8], flip: ["diamond", "--below", 9], "neimark-sacker": ["star", "--pair", 12],
  "branch-point": ["cross", "--cross", 10], grazing: ["line-ns-open", "--stop", 9], "held-stop": ["y-left-open", "--stop", 9],
  "crossing-sliding": ["x-thin-open", "--cross", 8], "switching-sliding": ["y-down-open", "--cross", 9], "grazing-sliding": ["y-up-open", "--cross", 9],
  "adding-sliding": ["cross-thin-open", "--cross", 8], "slip-onset": ["hexagon", "--cross", 8],
};
// points of codimension two, in the symbols of the pictures for print
const CODIM2 = {
  cusp: "triangle-up", "fold-flip": "diamond", "fold-neimark-sacker": "cross", "flip-neimark-sacker": "x", "generalised-flip": "triangle-down",
  "1:1": "square", "1:2": "square-dot", "1:3": "pentagon", "1:4": "hexagon", "degenerate-grazing": "diamond-tall",
};
/** The colours of special points, as variables of the style sheet. */
export const SHADES = Object.fromEntries(Object.entries(SYMBOLS).map(([kind, [, shade]]) => [kind, shade]));
const BESIDE = 68, ABOVE = 52; // pixels beside and above the window, for the numbers and the titles of the axes
const MANY = 20_000; // vertices of the lines beyond which labels do not mind them
const LETTER = 8.5; // pixels of the title of an axis that one takes
const REACH = 16; // pixels within which a click means a point
const NEAR = 40; // pixels within which the pointer means a curve

export class Diagram {
  constructor(place, curves, chosen) {
    this.place = place.querySelector(".plot");
    this.lines = new Lines(place.querySelector("canvas"));
    this.curves = curves;
    this.chosen = chosen; // called with { curve, index } after a click, or { settled }
    this.ring = Object.assign(document.createElement("div"), { className: "ring", hidden: true }); // about the chosen point
    this.dot = Object.assign(document.createElement("div"), { className: "ring dot", hidden: true }); // at the point below the pointer
    this.place.before(this.ring, this.dot); // below the numbers of clusters
    this.box = false; // a drag marks a box to show, in place of moving the picture
    this.mark = null;
    this.names = { x: "", y: "" };
    this.over = null; // what an answer adds, as `onAxes` in overlay.js returns it
    this.clusters = []; // of special points that would lie on one another
    this.tip = place.querySelector(".tip");
    this.arrows = []; // from a special point to where a changed parameter moves it
    this.extra = () => ({ over: null, arrows: [] }); // returns both
    this.drawn = () => {}; // called after each drawing
    this.settledAt = () => {}; // called with the number of a settled motion that is clicked
    this.pale = () => {}; // called after a click on the quick response, whose points have no motions
    this.painted = () => {}; // called with Plotly's axes whenever they have moved
    this.watchClicks();
    document.getElementById("box").addEventListener("click", ({ target }) => {
      this.box = !this.box;
      target.setAttribute("aria-pressed", this.box);
      this.draw();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.ready && this.later()).observe(place);
  }

  /** The place of the chosen point, [x, y], or null. */
  get mark() {
    return this.marked;
  }

  set mark(place) {
    this.marked = place;
    this.moveRing();
  }

  /** Put the ring about the chosen point, where Plotly's axes are now; Plotly itself would draw everything again for it. */
  moveRing(ring = this.ring, marked = this.marked) {
    const { xaxis, yaxis } = this.place._fullLayout ?? {};
    if (!marked || !xaxis) return (ring.hidden = true);
    const [[x0, x1], [y0, y1]] = [xaxis.range, yaxis.range]; // while it is dragged, its scale is that of before
    const across = ((marked[0] - x0) / (x1 - x0)) * xaxis._length, down = ((y1 - marked[1]) / (y1 - y0)) * yaxis._length;
    ring.hidden = !(across >= -1 && across <= xaxis._length + 1 && down >= -1 && down <= yaxis._length + 1);
    ring.style.transform = `translate(${xaxis._offset + across}px, ${yaxis._offset + down}px)`;
  }

  /** Show everything. */
  fit() {
    this.range = null;
    this.draw();
  }

  /** Show less (factor < 1) or more, about the chosen point or the middle. */
  zoom(factor) {
    if (!this.ready) return;
    const { xaxis, yaxis } = this.place._fullLayout;
    const about = ([low, high], v) => {
      const middle = v > low && v < high ? v : (low + high) / 2;
      return [middle - (middle - low) * factor, middle + (high - middle) * factor];
    };
    this.range = { x: about(xaxis.range, this.mark?.[0]), y: about(yaxis.range, this.mark?.[1]) };
    this.draw();
  }

  /** Draw again within the next frame, once. */
  later() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const started = performance.now();
    Object.assign(this, this.extra());
    const view = this.range ?? this.extent();
    const all = this.curves.drawn();
    this.lines.thin(all, view, this.place.clientWidth || 600, this.place.clientHeight || 400);
    this.programmatic = true;
    window.Plotly.react(this.place, this.marks(all, view), this.layout(view), {
      responsive: false, scrollZoom: true, displayModeBar: false, doubleClick: false, showTips: false,
    });
    this.programmatic = false;
    this.ready = true;
    this.watchView();
    this.paint();
    this.drawn();
    this.drawTime = performance.now() - started;
  }

  paint(moving = false) {
    this.lines.behind = this.over;
    this.lines.paint(this.place._fullLayout, color, moving);
    this.moveRing();
    this.painted(this.place._fullLayout);
  }

  /** Draw again after the arrows have changed, if there is a drawing. */
  redecorate() {
    if (!this.ready) return;
    this.draw();
  }

  /** Arrows where their labels cross the curves least. */
  laidArrows(view, width, height) {
    const lines = this.arrows.length && this.lines.vertices < MANY ? this.lines.thinned : [];
    return arrowsOf(this.arrows, view, width - BESIDE, height - ABOVE, color, crossings(lines, placing(view, width - BESIDE, height - ABOVE)));
  }

  /** Arrows and labels, for a layout. */
  decoration(view, width = this.place.clientWidth || 600, height = this.place.clientHeight || 400) {
    const { shapes, labels } = this.laidArrows(view, width, height);
    return { shapes, annotations: [...(this.over ? labelsOf(this.over, view, width - BESIDE, color) : []), ...labels] };
  }

  /** The traces that an answer adds. */
  added(view) {
    const placed = (place) => place && this.placeOf(place);
    return this.over ? tracesOf(this.over, view, placed, color) : [];
  }

  placeOfSettled(k) {
    const { settled } = this.over;
    return [settled.x[k], settled.y[k]];
  }

  /** Where a special point of the shown answer is: [x, y], or null. */
  placeOf({ branch, special }) {
    const found = this.curves.all.get(`${this.over?.key ?? ""}/${branch}`)?.special[special];
    return found ? [found.x, found.y] : null;
  }

  marks(all, view, width = this.place.clientWidth || 600, height = this.place.clientHeight || 400) {
    const special = all.flatMap((curve) => curve.special.filter((s) => !s.again).map((s) => ({ ...s, branch: curve.name, pale: Boolean(curve.earlier), label: s.kind === "grazing" || curve.earlier ? "" : s.label, size: sizeOf(s.kind) })));
    const { single, clusters } = sorted(special, view, width - BESIDE, height - ABOVE, this.lines.vertices < MANY ? this.lines.thinned : [], this.laidArrows(view, width, height).boxes);
    this.clusters = clusters;
    return [...this.added(view), ...this.specialPoints(single), this.codim2Points(single), this.settledPoints(), this.clusterPoints()];
  }

  layout(view, width = this.place.clientWidth || 600, height = this.place.clientHeight || 400) {
    const axis = (title, range, room) => ({
      title: { text: shortened(title, room), standoff: 6 }, range, showgrid: false, zeroline: false, exponentformat: "power", linecolor: color("--line"),
      tickcolor: color("--line"), showline: true, ticks: "outside", automargin: true,
    });
    return {
      autosize: true, showlegend: false, dragmode: this.box ? "zoom" : "pan", hovermode: "closest",
      margin: { l: 56, r: 12, t: this.over?.lines.some(({ upright, text }) => upright && text) ? 24 : 8, b: 44 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: color("--ink"), size: Math.round(13 * zoom()), family: "system-ui, sans-serif" },
      xaxis: axis(this.names.x, view.x, width - BESIDE), yaxis: axis(this.names.y, view.y, height - 76),
      hoverlabel: { bgcolor: color("--card"), bordercolor: color("--line"), font: { color: color("--ink") }, align: "left" },
      ...this.decoration(view, width, height),
    };
  }

  /** Put the mark at a node of a curve, or at a place. */
  choose(curve, index, place = null) {
    this.mark = place ?? (curve ? [curve.x[index], curve.y[index]] : null);
  }

  /** The diagram as a file: the lines become Plotly's own. */
  async picture(format) {
    const { xaxis, yaxis } = this.place._fullLayout, view = { x: [...xaxis.range], y: [...yaxis.range] };
    const traces = this.lines.each(([x, y], kind, opacity, { shade, dashes, width }) => ({
      type: "scatter", mode: "lines", name: kind, x, y, opacity,
      line: { color: color(shade), dash: dashes.map((dash) => `${dash}px`).join(",") || "solid", width, simplify: false },
    }));
    const layout = { ...this.layout(view, 1200, 720), autosize: false, width: 1200, height: 720, paper_bgcolor: color("--card") };
    for (const name of ["xaxis", "yaxis"]) Object.assign(layout[name], { showgrid: true, gridcolor: color("--grid") });
    if (this.over) layout.shapes = [...shapesOf(this.over, color), ...layout.shapes];
    const figure = { data: [...(this.over ? cellTraces(this.over, color) : []), ...traces, ...this.marks([...this.curves.all.values()], view, 1200, 720), this.markTrace()], layout };
    const url = await window.Plotly.toImage(figure, { format, width: 1200, height: 720, scale: format === "png" ? 2 : 1 });
    const [head, body] = [url.slice(5, url.indexOf(",")), url.slice(url.indexOf(",") + 1)];
    const bytes = head.endsWith(";base64") ? Uint8Array.from(atob(body), (c) => c.charCodeAt(0)) : decodeURIComponent(body);
    return new Blob([bytes], { type: head.split(";")[0] });
  }

  extent() {
    let [a, b, c, d] = [Infinity, -Infinity, Infinity, -Infinity];
    const take = (x, y) => { if (!Number.isFinite(x) || !Number.isFinite(y)) return; a = Math.min(a, x); b = Math.max(b, x); c = Math.min(c, y); d = Math.max(d, y); };
    for (const curve of this.curves.subject()) for (let i = 0; i < curve.x.length; i++) take(curve.x[i], curve.y[i]);
    if (!this.curves.hasLoci) for (const { place } of this.curves.settled.values()) take(...place);
    for (const { x, y } of this.over?.layers ?? []) x.forEach((v, i) => { if (v !== null && y[i] !== null) take(v, y[i]); });
    const { x: across, y: up } = this.over?.within ?? {};
    if (across) [a, b] = [Math.min(a, ...across), Math.max(b, ...across)];
    if (up) [c, d] = [Math.min(c, ...up), Math.max(d, ...up)];
    if (!(a <= b)) return { x: this.names.range ?? [0, 1], y: [0, 1] };
    if (!(c <= d)) [c, d] = [0, 1];
    const share = this.curves.hasLoci && !across ? 0.15 : 0.04;
    const pad = (low, high, error = 1e-9) => {
      const size = Math.max(Math.abs(low), Math.abs(high)); // values that differ by their error only have no range of their own
      const p = share * (high - low > error * size ? high - low : size || 1);
      return [low - p, high + p];
    };
    return { x: pad(a, b), y: pad(c, d, this.curves.quick ? 0.01 : undefined) };
  }

  specialPoints(special) {
    return Object.entries(SYMBOLS).map(([kind, [symbol, shade, size]]) => {
      const found = special.filter((s) => s.kind === kind);
      return {
        type: "scatter", mode: kind === "grazing" ? "markers" : "markers+text", name: kind,
        x: found.map((s) => s.x), y: found.map((s) => s.y),
        text: found.map((s) => s.label), textposition: found.map((s) => s.position), textfont: { size: letters(), color: color("--soft") },
        customdata: found.map(describe), hovertemplate: "%{customdata}<extra></extra>",
        marker: { symbol, size, opacity: found.map(({ pale }) => (pale ? this.lines.pale : 1)), color: color(shade), line: { width: kind === "grazing" ? 1.6 : 1, color: color(kind === "grazing" ? "--stop" : "--ink") } },
      };
    });
  }

  codim2Points(special) {
    const found = special.filter((s) => s.kind.startsWith("codim2 "));
    const symbols = found.map((s) => CODIM2[s.kind.slice(7)]);
    return {
      type: "scatter", mode: "markers+text", name: "codimension two", x: found.map((s) => s.x), y: found.map((s) => s.y),
      text: found.map((s) => s.label), textposition: found.map((s) => s.position), textfont: { size: letters(), color: color("--ink") },
      customdata: found.map(describe), hovertemplate: "%{customdata}<extra></extra>",
      marker: {
        symbol: symbols.map((symbol) => symbol ?? "circle"), size: found.map((s) => s.size),
        color: symbols.map((symbol) => (symbol ? color("--card") : color("--stop"))), line: { width: 1.6, color: color("--ink") },
      },
    };
  }

  settledPoints() {
    const found = [...this.curves.settled.values()];
    return {
      type: "scatter", mode: "markers", name: "settled", x: found.map((s) => s.place[0]), y: found.map((s) => s.place[1]),
      text: found.map((s) => escaped(s.title)), hovertemplate: "%{text}<extra></extra>",
      marker: { symbol: "x", size: 10, opacity: found.map(({ earlier }) => (earlier ? this.lines.pale : 1)), color: color("--chosen"), line: { width: 1, color: color("--card") } },
    };
  }

  /** Marks with the number of points that would lie on one another. */
  clusterPoints() {
    const { clusters } = this;
    return {
      type: "scatter", mode: "markers+text", name: "clusters", x: clusters.map(({ x }) => x), y: clusters.map(({ y }) => y),
      text: clusters.map(({ points }) => String(points.length)), textposition: "middle center", textfont: { size: 10.5, color: color("--ink") },
      customdata: clusters.map(describeCluster), hovertemplate: "%{customdata}<extra></extra>",
      marker: { symbol: "circle", size: 2 * RADIUS, color: color("--card"), line: { width: 1.4, color: color("--soft") } },
    };
  }

  /** Show what lies below the pointer, in a corner where it covers neither that nor the chosen point nor the curves. */
  showTip(html, px, py) {
    const { tip } = this, { xaxis, yaxis } = this.place._fullLayout;
    tip.innerHTML = html;
    tip.hidden = false;
    const [wide, high] = [tip.offsetWidth, tip.offsetHeight], right = xaxis._offset + xaxis._length, bottom = yaxis._offset + yaxis._length, gap = 6;
    const corners = [[right - wide - gap, yaxis._offset + gap], [xaxis._offset + gap, yaxis._offset + gap], [right - wide - gap, bottom - high - gap], [xaxis._offset + gap, bottom - high - gap]];
    const around = (x, y, left, top) => x > left - 14 && x < left + wide + 14 && y > top - 14 && y < top + high + 14;
    const cost = ([left, top]) => {
      let found = around(px, py, left, top) ? 1e9 : 0;
      if (this.mark && around(xaxis._offset + xaxis.l2p(this.mark[0]), yaxis._offset + yaxis.l2p(this.mark[1]), left, top)) found += 1e6;
      for (const [xs, ys] of this.lines.thinned) for (let i = 0; i < xs.length; i++) if (xs[i] !== null && around(xaxis._offset + xaxis.l2p(xs[i]), yaxis._offset + yaxis.l2p(ys[i]), left, top)) found += 1;
      return found;
    };
    const costs = corners.map(cost), [left, top] = corners[costs.indexOf(Math.min(...costs))];
    Object.assign(tip.style, { left: `${left}px`, top: `${top}px` });
  }

  /** The chosen point in a picture that is saved. */
  markTrace() {
    return {
      type: "scatter", mode: "markers", name: "chosen", hoverinfo: "skip", x: this.mark ? [this.mark[0]] : [], y: this.mark ? [this.mark[1]] : [],
      marker: { symbol: "circle-open", size: 17, color: color("--chosen"), line: { width: 3 } },
    };
  }

  /** A press and release at one place is a click; anything else is a drag, which Plotly minds. */
  watchClicks() {
    let down = null;
    this.place.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; }, true);
    window.addEventListener("pointerup", (event) => {
      const from = down;
      down = null;
      if (!from || !this.ready || Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 4) return;
      const { xaxis, yaxis } = this.place._fullLayout, box = this.place.getBoundingClientRect();
      const px = event.clientX - box.left - xaxis._offset, py = event.clientY - box.top - yaxis._offset;
      if (px < 0 || py < 0 || px > xaxis._length || py > yaxis._length) return;
      const toX = (v) => xaxis.l2p(v), toY = (v) => yaxis.l2p(v);
      for (const [key, { place }] of this.curves.settled) {
        if (Math.hypot(toX(place[0]) - px, toY(place[1]) - py) < 9) return this.chosen({ settled: key });
      }
      for (const cluster of this.clusters) {
        if (Math.hypot(toX(cluster.x) - px, toY(cluster.y) - py) > RADIUS) continue;
        const range = opened(cluster, { x: xaxis.range, y: yaxis.range });
        if (!range) break; // points at one place: the first of them is chosen below
        this.tip.hidden = true;
        this.range = range;
        return this.draw();
      }
      const found = this.curves.nearest(px, py, toX, toY, REACH);
      const marks = found ? [] : (this.over?.layers ?? []).filter(({ mark }) => mark === "dots" || mark === "crosses");
      const met = marks.flatMap(({ x, y }) => x.map((value, k) => [Math.hypot(toX(value) - px, toY(y[k]) - py), value])).sort(([a], [b]) => a - b)[0];
      const settled = found ? -1 : this.nearestSettled(px, py, toX, toY, REACH);
      if (found) this.chosen(found);
      else if (settled >= 0) this.settledAt(settled);
      else if (met?.[0] < REACH) this.sampled?.(met[1]);
      else if (this.curves.nearest(px, py, toX, toY, REACH, this.curves.drawn())) this.pale();
    });
  }

  /** The number of the settled motion nearest to a place on the screen, from its least to its largest value; or -1. */
  nearestSettled(px, py, toX, toY, reach) {
    const { settled } = this.over ?? {};
    let [best, found] = [reach, -1];
    settled?.x.forEach((x, k) => {
      const ends = [settled.y[k], settled.low[k] ?? settled.y[k], settled.high[k] ?? settled.y[k]].map(toY);
      const away = Math.hypot(toX(x) - px, Math.max(0, Math.min(...ends) - py, py - Math.max(...ends)));
      if (away < best) [best, found] = [away, k];
    });
    return found;
  }

  /** A settled motion in lines: what it is, its values over the axes, and what separates. */
  settledLines(k) {
    const { settled } = this.over, { low: { [k]: low }, high: { [k]: high } } = settled;
    const values = [settled.x[k], settled.y[k]].map((value, axis) => valueOf([this.names.x, this.names.y][axis], value));
    const ends = low === undefined ? [] : [`from ${Number(low.toPrecision(6))} to ${Number(high.toPrecision(6))}`];
    return [settled.kinds[k], ...values, ...ends, `separations in a forcing period: ${settled.contacts[k]}`];
  }

  /** Say the values of the nearest curve while the pointer moves along it. */
  watchPointer() {
    this.place.addEventListener("pointermove", (event) => {
      if (!this.ready || this.isOver || event.buttons) return;
      const { xaxis, yaxis } = this.place._fullLayout, box = this.place.getBoundingClientRect(), px = event.clientX - box.left, py = event.clientY - box.top;
      const where = [px - xaxis._offset, py - yaxis._offset, (v) => xaxis.l2p(v), (v) => yaxis.l2p(v), NEAR];
      const found = this.curves.nearest(...where, this.curves.drawn()), settled = found ? -1 : this.nearestSettled(...where);
      this.moveRing(this.dot, found ? [found.curve.x[found.index], found.curve.y[found.index]] : settled >= 0 && this.placeOfSettled(settled));
      if (found) this.showTip(this.valuesAt(found), px, py);
      else if (settled >= 0) this.showTip(this.settledLines(settled).map(escaped).join("<br>"), px, py);
      else this.tip.hidden = true;
    });
    this.place.addEventListener("pointerleave", () => { this.tip.hidden = this.dot.hidden = true; });
  }

  /** A node of a curve with its values, in HTML. */
  valuesAt({ curve, index }) {
    const special = curve.node[index] < 0 ? curve.special[-1 - curve.node[index]] : null;
    if (special) return describe({ ...special, branch: curve.name });
    return [`<b>${escaped(curve.name)}</b>, ${kindOf(curve, index)}`, escaped(valueOf(this.names.x, curve.x[index])), escaped(valueOf(this.names.y, curve.y[index]))].join("<br>");
  }

  /** After a zoom, lines are thinned for the new window. */
  watchView() {
    if (this.watched) return;
    this.watched = true;
    this.watchPointer();
    this.place.on("plotly_hover", ({ points: [found], event }) => {
      const words = found.customdata ?? found.text, box = this.place.getBoundingClientRect();
      this.isOver = Boolean(words);
      this.dot.hidden ||= this.isOver;
      if (words) this.showTip(words, event.clientX - box.left, event.clientY - box.top);
    });
    this.place.on("plotly_unhover", () => { this.tip.hidden = true; this.isOver = false; });
    this.place.on("plotly_relayouting", () => { this.tip.hidden = this.dot.hidden = true; this.paint(true); });
    this.place.on("plotly_relayout", () => {
      if (this.programmatic) return;
      this.tip.hidden = this.dot.hidden = true; // what they were at has moved
      const { xaxis, yaxis } = this.place._fullLayout;
      this.range = { x: [...xaxis.range], y: [...yaxis.range] };
      this.paint(true);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.draw(), 120); // for the new window: lines, labels, clusters
    });
  }
}

/** A value with the words of its axis and its unit. */
function valueOf(title, value) {
  const unit = unitOf(title);
  return `${title.slice(0, title.length - unit.length).replace(/ \(.*\)/, "")} = ${Number(value.toPrecision(6))}${unit.replace(/[[\]]/g, "")}`;
}

function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** The pixels of the symbol of a kind of special points. */
function sizeOf(kind) {
  return SYMBOLS[kind]?.[2] ?? (CODIM2[kind.slice(7)] ? 11 : 6);
}

export function describe(special) {
  const title = `<b>${escaped(special.text)}</b> on ${escaped(special.branch)}`;
  return [title, ...special.lines.filter(Boolean).map(escaped)].join("<br>");
}

function escaped(text) {
  return text.replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);
}

/** The title of an axis; where there is no room for all of it, without what stands in parentheses, and in several lines. */
function shortened(title, room) {
  const most = Math.max(8, Math.floor(room / (LETTER * zoom()))), short = title.length > most ? title.replace(/ \(.*?\)/, "") : title;
  const lines = [""];
  for (const word of short.split(" ")) {
    if (lines.at(-1) && lines.at(-1).length + word.length >= most) lines.push("");
    lines.push(`${lines.pop()} ${word}`.trim());
  }
  return lines.join("<br>");
}
