// A small chart in SVG: drawn within a millisecond or two, in the colours of the page.

const SVG = "http://www.w3.org/2000/svg";
const LEFT = 44, DIGIT = 6.3, LETTER = 6, RIGHT = 8, TOP = 8, BOTTOM = 32;

/** How much larger than elsewhere charts are drawn: on very large screens without scaling, as all letters there. */
export function zoom() {
  return matchMedia("(min-width: 2400px)").matches ? 1.35 : 1;
}

const widths = new WeakMap(); // of places that were measured together

/** Measure places before charts are drawn into them: each width read after a change would lay out the page again. */
export function measure(places) {
  for (const place of places) widths.set(place, place.clientWidth);
}

/** The width of a place, as it was measured just now, or as it is. */
function widthOf(place) {
  const width = widths.get(place) || place.clientWidth;
  widths.delete(place);
  return width;
}

export function element(name, attributes = {}, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  return made;
}

/**
 * Draw a chart into a place.
 *
 * `curves`: lists of [xs, ys]; `dots`: [[x, y, class]]; `bars`: [xs, ys] from the zero line; `across`, `down`: values of
 * dashed lines; `x`, `y`: names of the axes; `square`: both axes with one scale, and the unit circle; `shades`: intervals
 * of x; `padded`: with room beside the curves; `below`: { height, draw } of a strip between the curves and the numbers:
 * `draw` is called with the chart, px (whose least value is px.low) and the top of the strip; `behind`, `barsBehind`:
 * curves and bars of another motion, which are drawn pale; `depth`: a logarithmic scale, down to this share of the largest.
 * Returns a function that moves a mark to a point.
 */
export function chart(place, { curves = [], dots = [], bars = null, across = [], down = [], x, y, square = false, height = 190, label, shades = [], below = null, padded = false, behind = [], barsBehind = null, depth = 0 }) {
  let [floor, named] = [0, short];
  if (depth) { // everything is drawn by the logarithms of its values
    const all = [...curves, ...behind, ...[bars, barsBehind].filter(Boolean)], most = Math.max(...all.flatMap(([, ys]) => ys.map(Math.abs))) || 1;
    const level = ([xs, ys]) => [xs, ys.map((v) => Math.log10(Math.max(Math.abs(v), depth * most)))];
    [curves, behind, bars, barsBehind] = [curves.map(level), behind.map(level), bars && level(bars), barsBehind && level(barsBehind)];
    [floor, named] = [Math.log10(depth * most), (v) => (Number.isInteger(v) ? decade(v) : "")];
  }
  const width = Math.max(150, Math.round(widthOf(place) / zoom()) || 300), room = below?.height ?? 0;
  if (square) height = Math.min(width, 230);
  height += room;
  const bottom = height - BOTTOM - room; // of the curves
  const lines = [...behind, ...curves];
  const xs = [...lines.map((c) => c[0]), dots.map((d) => d[0]), bars?.[0] ?? [], barsBehind?.[0] ?? [], down];
  const ys = [...lines.map((c) => c[1]), dots.map((d) => d[1]), bars ? [floor, ...bars[1]] : [], barsBehind?.[1] ?? [], across];
  let [x0, x1] = extent(xs, !square && !padded && !dots.length && !down.length && !bars), [y0, y1] = extent(ys, false);
  if (square) {
    const reach = Math.max(1.15, ...[x0, x1, y0, y1].map(Math.abs));
    const ratio = (width - LEFT - RIGHT) / (bottom - TOP);
    [x0, x1, y0, y1] = [-reach * Math.max(1, ratio), reach * Math.max(1, ratio), -reach / Math.min(1, ratio), reach / Math.min(1, ratio)];
  }
  // numbers keep off the title, which stands on its end beside them
  const left = Math.max(LEFT, 21 + DIGIT * Math.max(...ticks(y0, y1, bottom - TOP < 60 ? 3 : 5).map((tick) => named(tick).length)));
  const px = (v) => left + ((v - x0) / (x1 - x0)) * (width - left - RIGHT);
  px.low = left;
  const py = (v) => bottom - ((v - y0) / (y1 - y0)) * (bottom - TOP);
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": label ?? `${y} over ${x}` });
  for (const [from, to] of shades) svg.append(element("rect", { class: "rest", x: px(from), width: Math.max(0, px(to) - px(from)), y: TOP, height: bottom - TOP }));
  for (const tick of spaced(x0, x1, width - left - RIGHT)) {
    svg.append(element("line", { class: "grid", x1: px(tick), x2: px(tick), y1: TOP, y2: height - BOTTOM }));
    svg.append(element("text", { x: inside(px(tick), short(tick), width), y: height - BOTTOM + 12, "text-anchor": "middle" }, short(tick)));
  }
  for (const tick of ticks(y0, y1, bottom - TOP < 60 ? 3 : 5)) {
    svg.append(element("line", { class: "grid", x1: left, x2: width - RIGHT, y1: py(tick), y2: py(tick) }));
    svg.append(element("text", { x: left - 4, y: Math.min(py(tick) + 3.5, height - BOTTOM), "text-anchor": "end" }, named(tick)));
  }
  if (square) svg.append(element("ellipse", { class: "stop", fill: "none", cx: px(0), cy: py(0), rx: px(1) - px(0), ry: py(0) - py(1) }));
  for (const v of across) svg.append(element("line", { class: "stop", x1: left, x2: width - RIGHT, y1: py(v), y2: py(v) }));
  for (const v of down) svg.append(element("line", { class: "stop", x1: px(v), x2: px(v), y1: TOP, y2: bottom }));
  lines.forEach(([cx, cy], number) => {
    let path = "";
    for (let i = 0; i < cx.length; i++) path += `${i ? "L" : "M"}${px(cx[i]).toFixed(1)} ${py(cy[i]).toFixed(1)}`;
    svg.append(element("path", { class: number < behind.length ? "curve pinned" : "curve", d: path }));
  });
  barsBehind?.[0].forEach((v, i) => svg.append(element("line", { class: "bar pinned", x1: px(v), x2: px(v), y1: py(floor), y2: py(barsBehind[1][i]) })));
  bars?.[0].forEach((v, i) => svg.append(element("line", { class: "bar", x1: px(v), x2: px(v), y1: py(floor), y2: py(bars[1][i]) })));
  for (const [dx, dy, kind = ""] of dots) svg.append(element("circle", { class: `dot ${kind}`, cx: px(dx), cy: py(dy), r: dots.length > 60 ? 1.6 : 4 }));
  svg.append(element("rect", { class: "frame", x: left, y: TOP, width: width - left - RIGHT, height: bottom - TOP }));
  if (below) below.draw(svg, px, bottom);
  const [across0, across1] = fitted(x, (left + width - RIGHT) / 2, width), [middle, squeezed] = fitted(y, (TOP + bottom) / 2, height);
  svg.append(element("text", { class: "title", x: across0, y: height - 5, "text-anchor": "middle", ...across1 }, x));
  svg.append(element("text", { class: "title", x: 9, y: middle, "text-anchor": "middle", transform: `rotate(-90 9 ${middle})`, ...squeezed }, y));
  const mark = element("circle", { class: "now", r: 4.5, visibility: "hidden" });
  svg.append(mark);
  place.replaceChildren(svg);
  return (vx, vy) => {
    mark.setAttribute("visibility", "visible");
    mark.setAttribute("cx", px(vx));
    mark.setAttribute("cy", py(vy));
  };
}

/** The middle of a title that keeps within a length, and how it is squeezed if it is longer. */
function fitted(title, middle, length) {
  const half = 0.5 * LETTER * title.length + 2, room = length - 4;
  if (2 * half > room) return [length / 2, { textLength: room, lengthAdjust: "spacingAndGlyphs" }];
  return [Math.min(Math.max(middle, half), length - half), {}];
}

/** The middle of a number that keeps within the right end of a chart. */
export function inside(middle, number, width) {
  return Math.min(middle, width - 0.5 * DIGIT * number.length - 1);
}

/** A power of ten: in digits where they are few. */
function decade(power) {
  return power < -3 || power > 4 ? `1e${power}` : String(10 ** power).slice(0, 6);
}

function extent(lists, exact) {
  let low = Infinity, high = -Infinity;
  for (const list of lists) for (const v of list) { if (v < low) low = v; if (v > high) high = v; }
  if (!(low <= high)) [low, high] = [0, 1];
  if (exact && high > low) return [low, high];
  const pad = (high - low || Math.max(Math.abs(high), 1) * 0.2) * 0.08;
  return [low - pad, high + pad];
}

export function ticks(low, high, count) {
  const raw = (high - low) / count, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((s) => s * size >= raw) * size;
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + step * 1e-9; k++) found.push(Number((k * step).toPrecision(12)));
  return found;
}

/** As many ticks, at most about five, as have room for their numbers beside each other; two in any case. */
function spaced(low, high, room) {
  let found = ticks(low, high, 5);
  const isTight = () => ((found[1] - found[0]) / (high - low)) * room < DIGIT * Math.max(...found.map((tick) => short(tick).length)) + 3;
  for (let count = 4; count > 1 && isTight(); count--) {
    const fewer = ticks(low, high, count);
    if (fewer.length > 1) found = fewer;
  }
  return found;
}

export function short(value, range = Infinity) {
  if (Math.abs(value) > 1000 * range) return String(value); // neighbours would have the same digits
  return value !== 0 && (Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3) ? value.toExponential(0) : String(Number(value.toPrecision(4)));
}
