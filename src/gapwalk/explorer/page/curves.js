// The branches that the page holds: typed arrays, merged as they grow, thinned to what the screen can show.

import { get } from "./api.js";
import { element } from "./chart.js";

/** Lines by kind, in the order of the labels that the server sends: first those of stability, then those of loci. */
export const LINES = new Map([
  ["stable", { shade: "--stable", dashes: [], width: 2 }],
  ["below", { shade: "--below", dashes: [8, 4], width: 1.7 }],
  ["above", { shade: "--above", dashes: [2, 3], width: 1.7 }],
  ["pair", { shade: "--pair", dashes: [9, 3, 2, 3], width: 1.7 }],
  ["neutral", { shade: "--neutral", dashes: [], width: 1.7 }],
]);
const STABILITY = LINES.size;
const SHADES = { blue: "--above", vermillion: "--below", green: "--pair", purple: "--cross", grey: "--stop" };
const SCALE = 1.6; // pixels of a point of the pictures for print

/** Take the lines of loci, as the server describes them, and make their entries of the legend, which are hidden. */
export function takeLoci(loci, list) {
  for (const { kind, text, color, dashes, width } of loci) {
    if (LINES.has(kind)) continue;
    const line = { shade: SHADES[color] ?? "--ink", dashes: dashes.map((dash) => dash * width * SCALE), width: width * SCALE };
    LINES.set(kind, line);
    const entry = document.createElement("li"), svg = element("svg", { viewBox: "0 0 34 8" });
    Object.assign(entry, { className: "of-plane", hidden: true }).dataset.kind = kind;
    svg.append(element("path", { d: "M1 4H33", stroke: `var(${line.shade})`, "stroke-width": line.width, "stroke-dasharray": line.dashes.join(" ") || "none" }));
    entry.append(svg, `locus of ${plural(text)}`);
    list.append(entry);
  }
}

/** The words of a legend: folds and flips are countable. */
function plural(text) {
  return /^(fold|flip)$/.test(text) ? `${text}s` : text;
}

// symbols of special points, in a square of 12; those that have letters are filled
const SIGNS = {
  fold: "M6 2A4 4 0 1 1 5.99 2Z", flip: "M6 1L11 6L6 11L1 6Z", "neimark-sacker": "M6 .5L7.5 4.4L11.6 4.6L8.4 7.2L9.5 11.2L6 8.9L2.5 11.2L3.6 7.2L.4 4.6L4.5 4.4Z",
  "branch-point": "M4.3 1H7.7V4.3H11V7.7H7.7V11H4.3V7.7H1V4.3H4.3Z",
  grazing: "M6 1V11", "held-stop": "M6 6H1M6 6L9.5 1.5M6 6L9.5 10.5", "crossing-sliding": "M2.5 2.5L9.5 9.5M2.5 9.5L9.5 2.5", "switching-sliding": "M6 6V1M6 6L2 10M6 6L10 10",
  "grazing-sliding": "M6 6V11M6 6L2 2M6 6L10 2", "adding-sliding": "M6 1.5V10.5M1.5 6H10.5", "slip-onset": "M6 1.5L10 3.8V8.2L6 10.5L2 8.2V3.8Z",
};
// points of codimension two; others are grey dots
const CODIM2 = {
  cusp: "M6 1.5L11 10.5H1Z", "1:1": "M1.5 1.5H10.5V10.5H1.5Z", "1:2": "M1.5 1.5H10.5V10.5H1.5ZM5.5 6H6.5", "1:3": "M6 1L11 4.6L9 10.5H3L1 4.6Z", "1:4": "M6 .8L10.5 3.4V8.6L6 11.2L1.5 8.6V3.4Z",
  "fold-flip": "M6 1L11 6L6 11L1 6Z", "generalised-flip": "M6 10.5L11 1.5H1Z", "degenerate-grazing": "M6 .5L9 6L6 11.5L3 6Z",
  "fold-neimark-sacker": "M4.3 1H7.7V4.3H11V7.7H7.7V11H4.3V7.7H1V4.3H4.3Z", "flip-neimark-sacker": "M3 1L6 4L9 1L11 3L8 6L11 9L9 11L6 8L3 11L1 9L4 6L1 3Z",
};
const DOT = "M6 3A3 3 0 1 1 5.99 3Z";
const FILLED = new Set(["fold", "flip", "neimark-sacker", "branch-point"]);
const TOGETHER = "M6 .8A5.2 5.2 0 1 1 5.99 .8Z";

/** Show in the legend which loci are on the diagram, which special points with their letters, and what clusters are. */
export function showLegend(legend, curves, clusters = []) {
  const all = [...curves], kinds = [...LINES.keys()], there = new Set(all.flatMap(({ label }) => (label.length ? kinds[label[0]] : [])));
  for (const line of legend.querySelectorAll(".of-plane")) line.hidden = !there.has(line.dataset.kind);
  const used = new Set(all.flatMap(({ label }) => [...new Set(label)].map((each) => kinds[each])));
  for (const kind of kinds.slice(0, STABILITY)) {
    const line = legend.querySelector(`li:not([class]) path.${kind}`)?.closest("li");
    const pale = kind === "stable" && all.every(({ earlier }) => earlier); // another entry shows that line
    if (line) line.hidden = !used.has(kind) || pale;
    if (kind === "neutral") line.lastChild.textContent = all.some(({ settles }) => settles) ? "settled, no orbit followed" : "neutral: a disturbance neither grows nor decays";
  }
  const points = new Map(all.flatMap(({ special }) => special).filter(({ kind }) => kind in SIGNS).map(({ kind, text }) => [kind, text]));
  for (const old of legend.querySelectorAll(".of-point")) old.remove();
  const add = (sign, look, words) => {
    const entry = Object.assign(document.createElement("li"), { className: "of-point" }), svg = element("svg", { viewBox: "0 0 12 12" });
    svg.append(element("path", { d: sign, class: look }));
    entry.append(svg, words);
    legend.append(entry);
  };
  for (const [kind, sign] of Object.entries(SIGNS)) {
    if (points.has(kind)) add(sign, FILLED.has(kind) ? `filled of-${kind}` : ["grazing", "held-stop"].includes(kind) ? "of-stop" : "of-sliding", points.get(kind));
  }
  const plane = new Map(all.flatMap(({ special }) => special).filter(({ kind }) => kind.startsWith("codim2 ")).map(({ kind, text, label }) => [label && !text.includes(`(${label})`) && !text.startsWith(label) ? `${text} (${label})` : text, CODIM2[kind.slice(7)]]));
  for (const [words, sign] of plane) add(sign ?? DOT, sign ? "filled of-cluster" : "filled of-grey", words);
  if (clusters.length) add(TOGETHER, "filled of-cluster", "number of special points: click to open");
}

const TOLERANCE = 0.2; // pixels by which a thinned line may be off

/** A branch as the server sends it. */
export function unpack(packed) {
  if (packed.x instanceof Float64Array) return packed; // of a saved page
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  return {
    count: packed.count, name: packed.name, period: packed.period, special: packed.special,
    x: new Float64Array(bytes(packed.x)), y: new Float64Array(bytes(packed.y)),
    node: new Int32Array(bytes(packed.node)), label: new Uint8Array(bytes(packed.label)),
  };
}

/** The branch with its new points after those that it had. */
function merge(old, more) {
  let keep = old.node.lastIndexOf(old.count - 1);
  if (keep < 0) keep = old.node.length;
  const join = (a, b) => { const c = new a.constructor(keep + b.length); c.set(a.subarray(0, keep)); c.set(b, keep); return c; };
  return { ...more, x: join(old.x, more.x), y: join(old.y, more.y), node: join(old.node, more.node), label: join(old.label, more.label) };
}

export class Curves {
  constructor() {
    this.all = new Map(); // "result/branch" -> curve
    this.quick = null; // drawn while there is none
    this.settled = new Map(); // result -> { place, title }
    this.versions = new Map();
    this.generation = 0;
  }

  /** The curves that are drawn: all, or the quick response of a file of which nothing is computed. */
  drawn() {
    return this.all.size || !this.quick ? [...this.all.values()] : [this.quick];
  }

  /** True if loci are shown. */
  get hasLoci() {
    return this.subject().some(({ label }) => label[0] >= STABILITY);
  }

  /** The curves that determine the window: the loci, or all curves if there are none. */
  subject() {
    const all = this.drawn(), loci = all.filter(({ label }) => label[0] >= STABILITY);
    return loci.length ? loci : all;
  }

  /** Remove all curves, for another file or other axes. */
  clear() {
    this.all.clear();
    this.settled.clear();
    this.versions.clear();
    this.generation += 1;
  }

  /** Fetch changed results and drop those that are gone; return true if there were any. Loci are shown where both axes are parameters. */
  async update(file, axes, plane, results) {
    const generation = this.generation, wanted = [], there = new Set(results.map(({ key }) => key)), before = this.all.size + this.settled.size;
    for (const [key, { result }] of this.all) if (!there.has(result)) this.all.delete(key);
    for (const held of [this.settled, this.versions]) for (const key of held.keys()) if (!there.has(key)) held.delete(key);
    const isLess = this.all.size + this.settled.size < before;
    for (const result of results) {
      if (this.versions.get(result.key) === result.version) continue;
      this.versions.set(result.key, result.version);
      const query = { file, result: result.key, ...axes };
      if (result.settled) {
        wanted.push(get("/api/curve", query).then(({ settled }) => {
          if (generation === this.generation && settled) this.settled.set(result.key, { place: settled, title: result.title, result: result.key });
        }));
      }
      for (const key of [...this.all.keys()]) if (this.all.get(key).result === result.key && this.all.get(key).branch >= result.branches.length) this.all.delete(key);
      result.branches.forEach((branch, number) => {
        if (branch.second && !plane) return; // a locus is shown in the plane of two parameters
        const key = `${result.key}/${number}`, old = this.all.get(key);
        const grows = old && result.state === "running" && branch.points > old.count;
        if (old && !grows && branch.points === old.count && result.state === "running") return;
        const from = grows ? old.count - 1 : 0;
        wanted.push(get("/api/curve", { ...query, branch: number, from }).then((packed) => {
          if (generation !== this.generation || packed.gone) return;
          const found = unpack(packed);
          this.all.set(key, { ...(grows ? merge(old, found) : found), key, result: result.key, branch: number, counts: axes.y.startsWith("impacts.") });
        }));
      });
    }
    await Promise.all(wanted);
    return (isLess || wanted.length > 0) && generation === this.generation;
  }

  /** Return the node of all branches nearest to a place on the screen: { curve, index }, or null. */
  nearest(px, py, toX, toY, reach, curves = this.all.values()) {
    let best = reach * reach, found = null;
    for (const curve of curves) {
      for (let i = 0; i < curve.x.length; i++) {
        const dx = toX(curve.x[i]) - px;
        if (dx * dx > best) continue;
        const dy = toY(curve.y[i]) - py;
        // special points are hard to hit between their neighbours
        const distance = (dx * dx + dy * dy) * (curve.node[i] < 0 ? 0.35 : 1);
        if (distance < best) { best = distance; found = { curve, index: i }; }
      }
    }
    return found;
  }
}

/**
 * The lines of all branches by kind of stability, thinned to the pixels of a window.
 *
 * Returns, for each kind, [xs, ys] with nulls between the pieces.
 */
export function thinned(curves, kinds, window, scaleX, scaleY) {
  const lines = Array.from({ length: kinds }, () => [[], []]);
  for (const { x, y, label, node, counts } of curves) {
    const jumps = (i) => counts && (node[i] < 0 || node[i - 1] < 0) && Math.abs(y[i] - y[i - 1]) > 0.05 * Math.max(y[i], y[i - 1]);
    let start = 0;
    for (let i = 1; i <= x.length; i++) {
      if (i < x.length && !jumps(i) && label[i] === label[start] && Number.isFinite(y[start]) && Number.isFinite(y[i])) continue;
      const end = i < x.length && !jumps(i) && Number.isFinite(y[i]) ? i : i - 1; // not all quantities are finite everywhere
      if (end > start && Number.isFinite(y[start])) piece(x, y, start, end, lines[label[start]], window, scaleX, scaleY);
      start = i;
    }
  }
  return lines;
}

/** Thin one piece (Douglas and Peucker); parts outside of the window are left out. */
function piece(x, y, first, last, [xs, ys], [low, high], scaleX, scaleY) {
  let i = first;
  while (i < last) {
    while (i < last && ((x[i] < low && x[i + 1] < low) || (x[i] > high && x[i + 1] > high))) i++;
    let j = i;
    while (j < last && !((x[j] < low && x[j + 1] < low) || (x[j] > high && x[j + 1] > high))) j++;
    if (j > i) {
      const kept = simplify(x, y, i, j, scaleX, scaleY);
      for (const k of kept) { xs.push(x[k]); ys.push(y[k]); }
      xs.push(null);
      ys.push(null);
    }
    i = j + (j === i ? 1 : 0);
  }
}

function simplify(x, y, first, last, scaleX, scaleY) {
  const keep = new Uint8Array(last - first + 1), stack = [first, last];
  keep[0] = keep[last - first] = 1;
  while (stack.length) {
    const b = stack.pop(), a = stack.pop();
    const ux = (x[b] - x[a]) * scaleX, uy = (y[b] - y[a]) * scaleY, length = ux * ux + uy * uy;
    let worst = TOLERANCE * TOLERANCE, at = -1;
    for (let k = a + 1; k < b; k++) {
      const vx = (x[k] - x[a]) * scaleX, vy = (y[k] - y[a]) * scaleY;
      const t = length ? Math.max(0, Math.min(1, (vx * ux + vy * uy) / length)) : 0;
      const distance = (vx - t * ux) ** 2 + (vy - t * uy) ** 2;
      if (distance > worst) { worst = distance; at = k; }
    }
    if (at >= 0) {
      keep[at - first] = 1;
      stack.push(a, at, at, b);
    }
  }
  const kept = [];
  for (let k = first; k <= last; k++) if (keep[k - first]) kept.push(k);
  return kept;
}
