// Panels of series over a parameter, in SVG: below the diagram with its range across, or alone with their own.

import { element, inside as within, short, ticks, zoom } from "./chart.js";

const TOP = 18, BOTTOM = 34, LOW = 20; // below a panel with and without the name of its axis
let count = 0;

/**
 * Draw a panel: { title, across, series: [{ x, y, mark, look }], fitted }.
 *
 * `range`: the values at its left and right end; `left`, `right`: pixels beside it; `shades`: [{ low, high, tint }];
 * `lines`: [{ at, exact }]; `named`: with the name of the axis.
 */
export function drawPanel(place, { title, across, series, fitted = false }, { range = null, left = 44, right = 8, height = 118, shades = [], lines = [], named = true } = {}) {
  const larger = zoom();
  [left, right] = [left / larger, right / larger];
  const width = Math.max(160, Math.round(place.clientWidth / larger) || 300), bottom = height - (named ? BOTTOM : LOW), clip = `clip-${(count += 1)}`;
  const [x0, x1] = range ?? extent(series, "x"), [y0, y1] = extent(series, "y", fitted);
  const px = (v) => left + ((v - x0) / (x1 - x0)) * (width - left - right), py = (v) => bottom - ((v - y0) / (y1 - y0)) * (bottom - TOP);
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": `${title} over ${across}` });
  const clipping = element("clipPath", { id: clip });
  clipping.append(element("rect", { x: left, y: TOP, width: width - left - right, height: bottom - TOP }));
  const inside = element("g", { "clip-path": `url(#${clip})` });
  svg.append(clipping);
  for (const { low, high, tint } of shades) inside.append(element("rect", { class: `tint ${tint}`, x: px(low), width: Math.max(0, px(high) - px(low)), y: TOP, height: bottom - TOP }));
  for (const tick of ticks(x0, x1, Math.max(3, Math.round(width / 90)))) {
    inside.append(element("line", { class: "grid", x1: px(tick), x2: px(tick), y1: TOP, y2: bottom }));
    svg.append(element("text", { x: within(px(tick), short(tick, x1 - x0), width), y: bottom + 16, "text-anchor": "middle" }, short(tick, x1 - x0)));
  }
  for (const tick of ticks(y0, y1, 4)) {
    inside.append(element("line", { class: "grid", x1: left, x2: width - right, y1: py(tick), y2: py(tick) }));
    svg.append(element("text", { x: left - 4, y: py(tick) + 3.5, "text-anchor": "end" }, short(tick)));
  }
  for (const { at, exact } of lines) inside.append(element("line", { class: exact ? "border" : "stop", x1: px(at), x2: px(at), y1: TOP, y2: bottom }));
  for (const each of series) inside.append(...drawn(each, px, py, py(0)));
  svg.append(inside, element("rect", { class: "frame", x: left, y: TOP, width: width - left - right, height: bottom - TOP }));
  if (named) svg.append(element("text", { class: "title", x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, across));
  svg.append(element("text", { class: "title", x: left, y: TOP - 5 }, title));
  place.replaceChildren(svg);
}

/** The elements of one series. */
function drawn({ x, y, mark, look }, px, py, zero) {
  if (mark === "line" || mark === "area") {
    let path = "", on = false;
    x.forEach((v, i) => {
      if (v === null || y[i] === null) { on = false; return; }
      path += `${on ? "L" : "M"}${px(v).toFixed(1)} ${py(y[i]).toFixed(1)}`;
      on = true;
    });
    if (mark === "area" && x.length) path += `V${zero.toFixed(1)}H${px(x[0]).toFixed(1)}Z`;
    return path ? [element("path", { class: `series ${mark} ${look}`, d: path })] : [];
  }
  const shapes = { dots: () => "", crosses: (a, b) => `M${a - 3} ${b - 3}L${a + 3} ${b + 3}M${a - 3} ${b + 3}L${a + 3} ${b - 3}`, stars: star };
  return x.flatMap((v, i) => {
    if (v === null || y[i] === null) return [];
    const [a, b] = [px(v), py(y[i])], data = { "data-at": v };
    return [mark === "dots" ? element("circle", { class: `series dots ${look}`, cx: a.toFixed(1), cy: b.toFixed(1), r: x.length > 300 ? 1.2 : 2.2, ...data }) : element("path", { class: `series ${mark} ${look}`, d: shapes[mark](a, b), ...data })];
  });
}

function star(a, b) {
  return `M${Array.from({ length: 10 }, (_, k) => {
    const r = k % 2 ? 3 : 7, t = (k * Math.PI) / 5;
    return `${(a + r * Math.sin(t)).toFixed(1)} ${(b - r * Math.cos(t)).toFixed(1)}`;
  }).join("L")}Z`;
}

/** The range of all series; from zero where nothing is negative, unless it is fitted. */
function extent(series, axis, fitted = false) {
  let low = Infinity, high = -Infinity;
  for (const each of series) for (const v of each[axis]) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(low <= high)) return [0, 1];
  if (axis === "y" && low >= 0 && !fitted) return [0, high * 1.1 || 1];
  const pad = 0.05 * (high - low || Math.abs(high) || 1);
  return [low - pad, high + pad];
}
