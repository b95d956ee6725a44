// What an answer adds to the diagram over two axes: shades and cells behind the lines, series and clouds above them.

import { letters, placing } from "./clusters.js";

/** Tints of shades and cells, as variables of the style sheet. */
const TINTS = { one: "--tint-one", both: "--tint-both", quiet: "--tint-quiet", goal: "--tint-goal", closed: "--tint-closed", open: "--tint-open", none: "--stop", undone: "--page" };
const LOOKS = {
  run: "--stop", main: "--accent", first: "--first", second: "--second", third: "--third", fourth: "--fourth", middle: "--first", most: "--third", largest: "--second", worst: "--ink", rising: "--first", falling: "--second", measured: "--ink", other: "--third",
  torus: "--pair", "torus-unstable": "--pair",
  "kind-fold": "--above", "kind-flip": "--below", "kind-neimark-sacker": "--pair", "kind-grazing": "--stop",
};
const MANY = 600; // dots that are drawn small, as in the clouds of a sweep

/** The parts of an answer that have a place over the axes. */
export function onAxes(answer, x, y) {
  const isOver = ({ over }) => over === x || over === y, turned = ({ axes }) => axes[0] === y && axes[1] === x;
  const lies = (each) => (each.axes[0] === x && each.axes[1] === y) || turned(each), within = answer.content.within ?? {};
  const layers = answer.own("layers").filter(lies).map((each) => (turned(each) ? { ...each, x: each.y, y: each.x } : each)), settled = answer.settled(x, y);
  if (settled && !layers.length) layers.push(...settled.across.map((run, k) => ({ x: run, y: settled.up[k], mark: "line", look: "main", text: k ? "" : "settled, no orbit followed" })));
  return {
    key: answer.key,
    shades: answer.own("shades").filter(isOver).map((each) => ({ ...each, upright: each.over === x })),
    lines: answer.own("lines").filter(isOver).map((each) => ({ ...each, upright: each.over === x })),
    cells: answer.own("cells").filter(lies).map((each) => ({ ...each, turned: turned(each) }))[0] ?? null,
    layers,
    settled,
    clouds: answer.own("clouds").filter(isOver).map((each) => ({ ...each, upright: each.over === x })),
    within: { x: within[x], y: within[y] },
  };
}

/** The range of the other axis over which a shade was studied; undefined if it holds for all of that axis. */
const across = ({ within }, upright) => within[upright ? "y" : "x"];

/** Draw shades, cells and lines on a canvas; px and py are the pixels of values, and box [left, top, right, bottom]. */
export function paintBehind(draw, over, px, py, [left, top, right, bottom], color) {
  if (over.cells) paintCells(draw, over.cells, px, py, color);
  for (const { low, high, tint, upright } of over.shades) {
    draw.fillStyle = color(TINTS[tint]);
    const [first, last] = across(over, upright)?.map(upright ? py : px) ?? (upright ? [bottom, top] : [left, right]);
    if (upright) draw.fillRect(px(low), last, px(high) - px(low), first - last);
    else draw.fillRect(first, py(high), last - first, py(low) - py(high));
  }
  draw.strokeStyle = color("--stop");
  for (const { at, exact, upright } of over.lines) {
    draw.lineWidth = 1;
    draw.setLineDash(exact ? [] : [2, 3]);
    draw.beginPath();
    if (upright) { draw.moveTo(px(at), top); draw.lineTo(px(at), bottom); }
    else { draw.moveTo(left, py(at)); draw.lineTo(right, py(at)); }
    draw.stroke();
  }
  draw.setLineDash([]);
}

function paintCells(draw, { rows, entries, within, turned }, px, py, color) {
  const [[a0, a1], [b0, b1]] = within, height = rows.length, width = rows[0].length;
  const colors = entries.map((entry) => cellColor(entry, color));
  const x = (k) => a0 + (k / width) * (a1 - a0), y = (k) => b0 + (k / height) * (b1 - b0);
  rows.forEach((row, j) => row.forEach((kind, i) => {
    draw.fillStyle = colors[kind];
    const [p0, p1, q0, q1] = turned ? [px(y(j)), px(y(j + 1)), py(x(i)), py(x(i + 1))] : [px(x(i)), px(x(i + 1)), py(y(j)), py(y(j + 1))];
    draw.fillRect(Math.min(p0, p1), Math.min(q0, q1), Math.abs(p1 - p0) + 0.6, Math.abs(q1 - q0) + 0.6);
  }));
}

function cellColor({ tint, wild, color: own }, color) {
  if (own) return own;
  return color(wild ? `${TINTS[tint]}-wild` : TINTS[tint]);
}

/** The shades and lines as shapes of Plotly, for a file. */
export function shapesOf(over, color) {
  const along = (upright, low, high, [first, last] = [0, 1], ref = "paper") => (upright ? { x0: low, x1: high, y0: first, y1: last, xref: "x", yref: ref } : { x0: first, x1: last, y0: low, y1: high, xref: ref, yref: "y" });
  const shaded = ({ low, high, upright }) => along(upright, low, high, ...(across(over, upright) ? [across(over, upright), upright ? "y" : "x"] : []));
  return [
    ...over.shades.map((shade) => ({ type: "rect", layer: "below", fillcolor: color(TINTS[shade.tint]), line: { width: 0 }, ...shaded(shade) })),
    ...over.lines.map(({ at, exact, upright }) => ({ type: "line", layer: "below", line: { color: color("--stop"), width: 1, dash: exact ? "solid" : "dot" }, ...along(upright, at, at) })),
  ];
}

/** The cells as a trace of Plotly, for a file. */
export function cellTraces({ cells }, color) {
  if (!cells) return [];
  const { rows, entries, within, turned } = cells, count = entries.length;
  const middle = ([low, high], n) => Array.from({ length: n }, (_, k) => low + ((k + 0.5) / n) * (high - low));
  const [xs, ys] = [middle(within[0], rows[0].length), middle(within[1], rows.length)];
  const flat = entries.flatMap((entry, k) => [[k / count, cellColor(entry, color)], [(k + 1) / count, cellColor(entry, color)]]);
  const z = turned ? xs.map((_, i) => rows.map((row) => row[i])) : rows;
  return [{ type: "heatmap", x: turned ? ys : xs, y: turned ? xs : ys, z, zmin: -0.5, zmax: count - 0.5, colorscale: flat, showscale: false, hoverinfo: "skip" }];
}

/** Series and clouds as traces of Plotly; `placed` returns where a special point is: [x, y], or null. */
export function tracesOf(over, view, placed, color) {
  const marks = { dots: "circle", crosses: "x-thin-open", stars: "star" };
  const layers = over.layers.map(({ x, y, mark, look, text, notes }) => {
    const named = mark === "line" && notes; // texts beside its points
    const shade = color(LOOKS[look] ?? "--accent"), starred = mark === "stars";
    return {
      type: "scatter", mode: mark !== "line" ? "markers" : named ? "lines+text" : "lines", name: text || look, x, y,
      hoverinfo: text && !named ? "text" : "skip", text: named || text, textposition: "top left", textfont: { size: letters(), color: shade },
      line: { color: shade, width: 1.6, dash: ["most", "falling", "torus-unstable"].includes(look) ? "6px,3px" : "solid" },
      marker: { symbol: marks[mark], size: starred ? 15 : mark === "crosses" ? 7 : x.length > MANY ? 2.4 : 4.5, color: starred ? color("--worst") : shade, line: { width: x.length > MANY ? 0 : 1.2, color: starred ? color("--ink") : shade } },
    };
  });
  return [...layers, ...over.clouds.flatMap((cloud) => cloudTraces(cloud, view, placed, color))];
}

function escaped(text) {
  return text.replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);
}

/** One cloud: dots beside the nominal point, the middle 90 % as a bar, and the median. */
function cloudTraces({ x: values, y: heights, upright, quantiles, title, lines, kind, place }, view, placed, color) {
  const at = placed(place);
  if (!at) return [];
  const axis = upright ? view.y : view.x, level = at[upright ? 1 : 0], spread = 0.035 * (axis[1] - axis[0]);
  const beside = heights ?? values.map((_, k) => level + spread * (((k * 0.6180339887) % 1) - 0.5)); // without chance: the same at each drawing
  const shade = color(LOOKS[`kind-${kind}`] ?? "--cross"), words = [`<b>${escaped(title)}</b>`, ...lines.map(escaped)].join("<br>");
  const turn = (across, up) => (upright ? { x: across, y: up } : { x: up, y: across });
  const dots = { type: "scatter", mode: "markers", name: "cloud", hoverinfo: "skip", ...turn(values, beside), marker: { size: 3.4, color: shade, opacity: 0.35, line: { width: 0 } } };
  if (quantiles.length < 3) return [dots];
  const [low, middle, high] = quantiles;
  return [dots, {
    type: "scatter", mode: "lines+markers", name: "middle 90 %", hovertemplate: "%{text}<extra></extra>", text: [words, words, words], ...turn([low, middle, high], [level, level, level]),
    line: { color: color("--ink"), width: 2 }, marker: { symbol: upright ? "line-ns-open" : "line-ew-open", size: [8, 13, 8], color: color("--ink"), line: { width: 2 } },
  }];
}

/** Labels of the lines above the diagram, where they do not touch each other. */
export function labelsOf(over, view, width, color) {
  const found = [], room = view.x[1] - view.x[0];
  let last = -Infinity;
  for (const { at, text, upright } of [...over.lines].sort((a, b) => a.at - b.at)) {
    const px = ((at - view.x[0]) / room) * width;
    if (!upright || !text || at < view.x[0] || at > view.x[1] || px - last < 8 * text.length) continue;
    last = px;
    found.push({ x: at, xref: "x", y: 1, yref: "paper", yanchor: "bottom", text, showarrow: false, font: { size: 11.5, color: color("--ink") } });
  }
  return found;
}

const APART = 15, FIRST = 20, LETTER = 6.4; // pixels between arrows, from the point to the first, and of a letter

/**
 * Arrows as shapes, and their labels with the `boxes` in pixels: across below or above the point, or upright beside it.
 *
 * A label is beside the tail or the tip of its arrow. Of the sides and places with room those are taken where the labels
 * are `crossed` least, by a function of a box.
 */
export function arrowsOf(arrows, view, width, height, color, crossed = () => 0) {
  const place = placing(view, width, height), pixels = ([x, y]) => place({ x, y });
  const laid = (side) => {
    const all = { shapes: [], labels: [], boxes: [], cost: 0 };
    arrows.forEach(({ from, to, text, chosen }, k) => {
      const upright = from[0] === to[0], shift = upright ? to[1] - from[1] : to[0] - from[0], away = Math.sign(shift);
      const unit = upright ? (view.y[1] - view.y[0]) / height : (view.x[1] - view.x[0]) / width, head = away * Math.min(7 * unit, Math.abs(shift));
      const off = side * (FIRST + APART * k), shade = color(chosen ? "--chosen" : "--accent"), wide = LETTER * text.length;
      const [a, b] = upright ? [from[1], to[1]] : [from[0], to[0]];
      const point = (along, across) => (upright ? `${across},${along}` : `${along},${across}`);
      const path = `M${point(a, off - 4)}L${point(a, off + 4)}M${point(a, off)}L${point(b, off)}M${point(b - head, off - 4)}L${point(b, off)}L${point(b - head, off + 4)}`;
      const fixed = upright ? { xsizemode: "pixel", xanchor: from[0] } : { ysizemode: "pixel", yanchor: from[1] };
      all.shapes.push({ type: "path", path, xref: "x", yref: "y", ...fixed, line: { color: shade, width: chosen ? 2.6 : 1.8 } });
      const [tail, tip] = [[from, -away], [to, away]].map(([at, back]) => {
        const [px, py] = pixels(at);
        const box = upright
          ? [px + off - 7, py - 8 * back - (back < 0 ? 0 : wide), px + off + 7, py - 8 * back + (back < 0 ? wide : 0)]
          : [px + 6 * back - (back < 0 ? wide : 0), py - off - 7, px + 6 * back + (back < 0 ? 0 : wide), py - off + 7];
        const fits = upright ? box[1] > 0 && box[3] < height : box[0] > 0 && box[2] < width;
        const beside = upright ? { xshift: off, yshift: 8 * back, textangle: -90, yanchor: back < 0 ? "top" : "bottom" } : { yshift: off, xshift: 6 * back, xanchor: back < 0 ? "right" : "left" };
        return { at, box, beside, cost: fits ? crossed(box) : Infinity };
      });
      const { at: [x, y], box, beside, cost } = tail.cost < Infinity && tail.cost <= tip.cost ? tail : tip;
      all.labels.push({ x, y, xref: "x", yref: "y", text, showarrow: false, font: { size: 11, color: shade }, bgcolor: color("--card"), opacity: 0.9, borderpad: 0, ...beside });
      all.boxes.push(box);
      all.cost += Math.min(cost, 1e6);
    });
    return all;
  };
  if (!arrows.length) return { shapes: [], labels: [], boxes: [] };
  const [px, py] = pixels(arrows[0].from), upright = arrows[0].from[0] === arrows[0].to[0], need = FIRST + APART * (arrows.length + 1);
  const sides = [[-1, upright ? px : height - py], [1, upright ? width - px : py]].filter(([, room]) => room > need).map(([side]) => side);
  return (sides.length ? sides : [1]).map(laid).reduce((best, other) => (other.cost < best.cost ? other : best));
}

/** Show in the legend what an answer adds; `arrows` is true if there are any. */
export function legendOf(list, over, below, arrows) {
  for (const old of list.querySelectorAll(".of-answer")) old.remove();
  const seen = new Set(), add = (words, mark) => {
    if (!words || seen.has(words)) return;
    seen.add(words);
    const entry = Object.assign(document.createElement("li"), { className: "of-answer" });
    entry.append(mark, words);
    list.append(entry);
  };
  const swatch = (kind) => Object.assign(document.createElement("i"), { className: kind });
  for (const { text, tint } of over?.shades ?? []) add(text, swatch(`swatch ${tint}`));
  for (const { text, tint, wild, color: own = "" } of over?.cells?.entries ?? []) add(text, Object.assign(swatch(`swatch cell ${tint}${wild ? " wild" : ""}`), { style: own && `background: ${own}` }));
  for (const { text, mark, look } of [...(over?.layers ?? []), ...below]) add(text, swatch(`mark ${mark} ${look}`));
  if (over?.clouds.length) add("dots: parts, spread upwards only to be seen; bar: middle 90 % of them", swatch(`mark dots kind-${over.clouds[0].kind}`));
  if (arrows) add("arrow: how far a parameter moves the point", swatch("mark line main"));
}
