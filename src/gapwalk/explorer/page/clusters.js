// Many special points on the screen: those that would lie on one another become one mark with their number, and the
// others have letters where there is room, the important kinds first.

import { zoom } from "./chart.js";

/** The kinds in the order in which they get letters; the others come after them. */
const FIRST = ["fold", "flip", "neimark-sacker", "branch-point", "held-stop"];
const SINGLE = 11, MIXED = 17, CLUSTERS = 23; // pixels between the middles of marks that do not hide each other
const LEAST = 3; // points of a cluster: two beside each other can be told apart
const TICK = 5; // half the height of a tick
const HALF = 7.5; // half the width of the largest symbol
const ROOM = 1; // pixels between a label and what is beside it
const PLACES = [["top center", 0, -1], ["bottom center", 0, 1], ["middle right", 1, 0], ["middle left", -1, 0],
  ["top right", 1, -1], ["bottom right", 1, 1], ["bottom left", -1, 1], ["top left", -1, -1]];
export const RADIUS = 10; // pixels of the mark of a cluster

/**
 * Sort special points for a window of some pixels: { single, clusters }; `covered` are boxes of other texts.
 *
 * `single` are the points to be drawn on their own, each with its `label`, which is "" where there is no room for it, and
 * with the `position` of the label: that of the free ones which crosses the `lines` least; the `size` of its symbol says how
 * far off that is. A cluster has its middle { x, y }, its `points`, and `box`, the range that they cover.
 */
export function sorted(points, view, width, height, lines = [], covered = []) {
  const place = placing(view, width, height);
  const rank = ({ kind }) => { const k = FIRST.indexOf(kind); return k < 0 ? FIRST.length + (kind === "grazing") : k; };
  const there = points.map((point) => ({ point, at: place(point) })).filter(({ at: [px, py] }) => px >= -RADIUS && py >= -RADIUS && px <= width + RADIUS && py <= height + RADIUS);
  // ticks at grazing points hide nothing: there may be hundreds, and they would hide the others in a cluster; a cluster
  // takes those that its mark covers
  const groups = merged(there.filter(({ point }) => point.kind !== "grazing")), large = groups.filter(({ own }) => own.length >= LEAST), ticks = [];
  for (const tick of there.filter(({ point }) => point.kind === "grazing")) {
    const over = large.find(({ at }) => Math.hypot(at[0] - tick.at[0], at[1] - tick.at[1]) < RADIUS);
    (over?.own ?? ticks).push(tick);
  }
  const clusters = groups.filter(({ own }) => own.length >= LEAST).map(clusterOf);
  const single = groups.filter(({ own }) => own.length < LEAST).flatMap(({ own }) => own).concat(ticks).sort((a, b) => rank(a.point) - rank(b.point));
  return { single: labelled(single, [...clusters.map((each) => square(place(each), RADIUS)), ...covered], width, height, crossings(lines, place)), clusters };
}

/** A function of a point: where it is in a window of some pixels. */
export function placing(view, width, height) {
  return ({ x, y }) => [((x - view.x[0]) / (view.x[1] - view.x[0])) * width, ((view.y[1] - y) / (view.y[1] - view.y[0])) * height];
}

/** Merge what would lie on one another until nothing does. */
function merged(there) {
  let groups = there.map((each) => ({ own: [each], at: each.at }));
  for (let before = Infinity; groups.length < before;) {
    before = groups.length;
    const cells = new Map(), kept = [];
    for (const group of groups) {
      const found = near(group, cells);
      if (!found) {
        kept.push(group);
        add(group, cells);
        continue;
      }
      remove(found, cells);
      const [n, m] = [found.own.length, group.own.length];
      found.at = [0, 1].map((k) => (n * found.at[k] + m * group.at[k]) / (n + m));
      found.own = [...found.own, ...group.own];
      add(found, cells);
    }
    groups = kept;
  }
  return groups;
}

const cell = ([px, py]) => [Math.floor(px / CLUSTERS), Math.floor(py / CLUSTERS)];

function add(group, cells) {
  const name = cell(group.at).join(" ");
  cells.set(name, [...(cells.get(name) ?? []), group]);
}

function remove(group, cells) {
  const name = cell(group.at).join(" ");
  cells.set(name, cells.get(name).filter((each) => each !== group));
}

/** A group whose mark hides that of another. */
function near(group, cells) {
  const [i, j] = cell(group.at);
  for (let a = i - 1; a <= i + 1; a++) for (let b = j - 1; b <= j + 1; b++) for (const other of cells.get(`${a} ${b}`) ?? []) {
    const large = (group.own.length >= LEAST) + (other.own.length >= LEAST), apart = [SINGLE, MIXED, CLUSTERS][large];
    if (Math.hypot(group.at[0] - other.at[0], group.at[1] - other.at[1]) < apart) return other;
  }
  return null;
}

function clusterOf({ own }) {
  const points = own.map(({ point }) => point), mean = (name) => points.reduce((sum, point) => sum + point[name], 0) / points.length;
  const box = ["x", "y"].map((name) => [Math.min(...points.map((point) => point[name])), Math.max(...points.map((point) => point[name]))]);
  return { x: mean("x"), y: mean("y"), points, box };
}

function square([px, py], half) {
  return [px - half, py - half, px + half, py + half];
}

/** Pixels of the letters of labels. */
export function letters() {
  return Math.round(11 * zoom());
}

const measured = new Map(); // the widths of labels, and how far their font reaches above and below its line
const pen = document.createElement("canvas").getContext("2d");

function measure(label) {
  const name = `${letters()} ${label}`;
  if (!measured.has(name)) {
    pen.font = `${letters()}px system-ui, sans-serif`;
    const { width, fontBoundingBoxAscent, fontBoundingBoxDescent } = pen.measureText(label);
    measured.set(name, { width, above: fontBoundingBoxAscent, below: fontBoundingBoxDescent });
  }
  return measured.get(name);
}

/** The box of a label beside a symbol of some pixels, where Plotly puts it (its `textPointPosition`). */
function boxOf(label, size, [px, py], across, down) {
  const { width, above, below } = measure(label), reach = size / 2 / 0.8 + 1;
  const left = px + across * reach + ((across - 1) * width) / 2;
  const line = py + down * reach + 0.75 * letters() + ((down - 1) * letters()) / 2;
  return [left - ROOM, line - above - ROOM, left + width + ROOM, line + below + ROOM];
}

/** Give labels to points, in their order, where they cover neither each other nor a symbol. */
function labelled(single, covered, width, height, crossed) {
  const taken = [
    ...single.filter(({ point }) => point.kind !== "grazing").map(({ point, at }) => Object.assign(square(at, HALF), { point })), ...covered,
  ];
  const free = (box, own) => box[0] >= 0 && box[1] >= 0 && box[2] <= width && box[3] <= height && !taken.some((other) => other.point !== own && box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]);
  const ticks = single.filter(({ point }) => point.kind === "grazing").map(({ at }) => square(at, TICK));
  const struck = (box) => ticks.filter((tick) => box[0] < tick[2] && tick[0] < box[2] && box[1] < tick[3] && tick[1] < box[3]).length;
  return single.map(({ point, at }) => {
    let best = null;
    for (const [position, across, down] of point.label ? PLACES : []) {
      const box = boxOf(point.label, point.size, at, across, down);
      const cost = free(box, point) ? crossed(box) + 9 * struck(box) : Infinity;
      if (cost < (best?.cost ?? Infinity)) best = { cost, box, position };
      if (cost === 0) break;
    }
    if (best) {
      taken.push(best.box);
      return { ...point, position: best.position };
    }
    return { ...point, label: "", position: "top center" };
  });
}

/** A function of a box in pixels: how many pieces of lines cross it. */
export function crossings(lines, place) {
  const pieces = new Map(); // by cells of CLUSTERS pixels that they may touch
  for (const [xs, ys] of lines) {
    let last = null;
    for (let k = 0; k < xs.length; k++) {
      const now = xs[k] === null ? null : place({ x: xs[k], y: ys[k] });
      if (last && now) {
        const steps = Math.min(200, Math.ceil(Math.hypot(now[0] - last[0], now[1] - last[1]) / 3) || 1);
        for (let i = 0; i <= steps; i++) {
          const at = [0, 1].map((c) => last[c] + (i / steps) * (now[c] - last[c])), name = cell(at).join(" ");
          if (!pieces.has(name)) pieces.set(name, []);
          pieces.get(name).push(at);
        }
      }
      last = now;
    }
  }
  return ([x0, y0, x1, y1]) => {
    const [i0, j0] = cell([x0, y0]), [i1, j1] = cell([x1, y1]);
    let found = 0;
    for (let i = i0; i <= i1; i++) for (let j = j0; j <= j1; j++) for (const [px, py] of pieces.get(`${i} ${j}`) ?? []) found += px >= x0 && px <= x1 && py >= y0 && py <= y1;
    return found;
  };
}

/** How many points of each kind a cluster has, in words, and how it opens. */
export function describeCluster({ points }) {
  const counts = new Map();
  for (const { text } of points) counts.set(text, (counts.get(text) ?? 0) + 1);
  return [`<b>${points.length} special points</b>`, ...[...counts].sort((a, b) => b[1] - a[1]).map(([text, count]) => `${count} × ${text}`), "click to open"].join("<br>");
}

/** The range that opens a cluster; null if its points are at one place, so that no zoom tells them apart. */
export function opened({ box }, view) {
  const [wide, high] = box.map(([low, high]) => high - low), [across, up] = [view.x, view.y].map(([low, high]) => high - low);
  const share = Math.max(wide / across, high / up);
  if (share < 1e-9) return null;
  const range = ([low, high], whole) => { const room = Math.max((high - low) * 0.25, 0.25 * share * whole); return [low - room, high + room]; };
  return { x: range(box[0], across), y: range(box[1], up) };
}
