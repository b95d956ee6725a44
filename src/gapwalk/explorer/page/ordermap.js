// An order map: amplitudes over the speed and over orders, or over frequencies, in one colour scale.

import { element, short, ticks } from "./chart.js";

const TOP = 4, BOTTOM = 18;
// stops of a scale of even steps for the eye, from loud to quiet: dark on paper, bright on a dark page
const SCALE = [[0, 0, 4], [28, 16, 68], [79, 18, 123], [129, 37, 129], [181, 54, 122], [229, 80, 100], [251, 135, 97], [254, 194, 135], [252, 253, 191]];

/** The colours for 256 levels, [r, g, b] each; the quietest is that of the page. */
export function colours(page, dark) {
  const stops = dark ? [page, ...SCALE.slice(1)] : [page, ...[...SCALE].reverse()];
  return Array.from({ length: 256 }, (_, level) => {
    const at = (level / 255) * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(at)), part = at - k;
    return stops[k].map((c, i) => Math.round(c * (1 - part) + stops[k + 1][i] * part));
  });
}

/** The colour of the cards of the page as [r, g, b]. */
export function cardColour() {
  const pen = document.createElement("canvas").getContext("2d");
  pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--card").trim();
  pen.fillRect(0, 0, 1, 1);
  return [...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}

/** The levels of a map as numbers, sorted by speed: { x, rows }. */
function levels(map) {
  if (map.levels) return map.levels;
  const rows = map.cells.map((text) => Uint8Array.from({ length: text.length / 2 }, (_, k) => parseInt(text.slice(2 * k, 2 * k + 2), 16)));
  const order = [...map.x.keys()].sort((a, b) => map.x[a] - map.x[b]);
  map.levels = { x: order.map((k) => map.x[k]), rows: order.map((k) => rows[k]) };
  return map.levels;
}

/**
 * Draw a map into a place.
 *
 * `range`: speeds at its left and right end; `left`, `right`: pixels beside it; `scale`: colours; `over`: "orders" or
 * "frequencies"; `pitch`: hertz of the excitation at speed 1; `turns`: periods of it in a turn, as orders count;
 * `top`, `depth`, `unit`: the largest amplitude of the colours, their range in dB, and the unit: read at the cursor.
 */
export function drawMap(place, map, { range, left, right, height, scale, over, pitch, turns, across, label, top: loudest = 1, depth = 60, unit = "" }) {
  const width = Math.max(160, Math.round(place.clientWidth) || 300), wide = Math.max(1, Math.round(width - left - right)), high = height - TOP - BOTTOM;
  const top = map.orders.at(-1), is = over === "frequencies", most = is ? (top / turns) * pitch * Math.max(...map.x) : top;
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [wide, high];
  const pen = picture.getContext("2d"), image = pen.createImageData(wide, high), { x, rows } = levels(map);
  const step = map.orders[0], half = x.length > 1 ? (x.at(-1) - x[0]) / (x.length - 1) : 1;
  for (let i = 0, k = 0; i < wide; i++) {
    const speed = range[0] + ((i + 0.5) / wide) * (range[1] - range[0]);
    while (k < x.length - 1 && Math.abs(x[k + 1] - speed) <= Math.abs(x[k] - speed)) k++;
    if (Math.abs(x[k] - speed) > Math.max(half, 1.5 * Math.abs((x[k + 1] ?? x[k]) - (x[k - 1] ?? x[k])))) continue;
    for (let j = 0; j < high; j++) {
      const value = ((high - j - 0.5) / high) * most, order = is ? (value / (speed * pitch)) * turns : value;
      const at = order / step - 1, low = Math.floor(at), part = at - low;
      if (at > rows[k].length - 1) continue;
      const level = Math.round((rows[k][low] ?? 0) * (1 - part) + (rows[k][low + 1] ?? rows[k][low] ?? 0) * part), [r, g, b] = scale[level];
      image.data.set([r, g, b, 255], 4 * (j * wide + i));
    }
  }
  pen.putImageData(image, 0, 0);
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": label });
  const px = (v) => left + ((v - range[0]) / (range[1] - range[0])) * wide, py = (v) => TOP + high - (v / most) * high;
  svg.append(element("image", { href: picture.toDataURL(), x: left, y: TOP, width: wide, height: high, preserveAspectRatio: "none" }));
  for (const tick of ticks(range[0], range[1], Math.max(3, Math.round(width / 90)))) {
    svg.append(element("line", { class: "tick", x1: px(tick), x2: px(tick), y1: TOP + high, y2: TOP + high + 3 }));
    svg.append(element("text", { x: px(tick), y: height - 5, "text-anchor": "middle" }, short(tick, range[1] - range[0])));
  }
  for (const tick of ticks(0, most, 5)) svg.append(element("text", { x: left - 4, y: Math.max(TOP + 8, py(tick) + 3.5), "text-anchor": "end" }, short(tick)));
  svg.append(element("rect", { class: "frame", x: left, y: TOP, width: wide, height: high }));
  const middle = TOP + high / 2, words = is ? "frequency [Hz]" : across;
  svg.append(element("text", { class: "title", x: 9, y: middle, "text-anchor": "middle", transform: `rotate(-90 9 ${middle})` }, words));
  const read = element("text", { x: left + wide - 4, y: TOP + 12, "text-anchor": "end", class: "read" });
  svg.append(read);
  svg.addEventListener("pointerleave", () => { read.textContent = ""; });
  svg.addEventListener("pointermove", ({ offsetX, offsetY }) => {
    const speed = range[0] + ((offsetX - left) / wide) * (range[1] - range[0]), value = ((TOP + high - offsetY) / high) * most;
    const order = is ? (value / (speed * pitch)) * turns : value, k = nearest(x, speed), level = rows[k]?.[Math.round(order / step) - 1];
    const inside = offsetX >= left && offsetX <= left + wide && offsetY >= TOP && offsetY <= TOP + high && level !== undefined;
    const down = depth * (level / 255 - 1), size = level ? `${Number((loudest * 10 ** (down / 20)).toPrecision(3))} ${unit}, ${down.toFixed(1)} dB` : `below ${-depth} dB`;
    read.textContent = inside ? `${Number(speed.toPrecision(4))}, order ${Number(order.toPrecision(3))}, ${Number(((order / turns) * pitch * speed).toPrecision(3))} Hz: ${size}` : "";
  });
  place.replaceChildren(svg);
}

/** The index of the number nearest to another one. */
function nearest(numbers, wanted) {
  return numbers.reduce((best, value, k) => (Math.abs(value - wanted) < Math.abs(numbers[best] - wanted) ? k : best), 0);
}
