// The moving parts: inertias that turn, or masses that slide, and the gaps that open and close.

import { element } from "./chart.js";
import { doing } from "./friction.js";

const ROW = 74, GAP = 34;
const SECONDS = 2; // that a forcing period lasts on the screen

export class Bodies {
  constructor(place, moved) {
    this.place = place;
    this.moved = moved; // called with the number of the sample that is shown
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    requestAnimationFrame((time) => this.frame(time));
  }

  show(motion) {
    this.motion = motion;
    this.began = undefined;
    const width = Math.max(260, this.place.clientWidth || 340);
    const { parts, turning } = motion.bodies;
    const columns = Math.max(1, Math.min(parts.length, Math.floor(width / 84)));
    const rows = Math.ceil(parts.length / columns), height = rows * ROW + motion.contacts.length * GAP + 4;
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": "Moving parts and gaps" });
    const largest = Math.max(1e-300, ...parts.map((part) => spread(part.moved)));
    this.updates = parts.map((part, i) => {
      const x = ((i % columns) + 0.5) * (width / columns), y = Math.floor(i / columns) * ROW + 28;
      svg.append(element("text", { x, y: y + 38, "text-anchor": "middle" }, part.name));
      const middle = (Math.max(...part.moved) + Math.min(...part.moved)) / 2, scale = 1 / largest;
      return turning ? disc(svg, x, y, part, middle, scale * 70) : block(svg, x, y, part, middle, scale * 24, width / columns);
    });
    const now = doing(motion);
    motion.contacts.forEach((contact, i) => this.updates.push(gauge(svg, rows * ROW + i * GAP, width, contact, (k) => now(contact.name, motion.theta[k]))));
    this.place.replaceChildren(svg);
    this.at(0);
  }

  toggle() {
    this.playing = !this.playing;
    this.began = undefined;
    return this.playing;
  }

  frame(time) {
    if (this.motion && this.playing && !document.hidden) {
      this.began ??= time;
      const { theta } = this.motion, first = theta[0], periods = theta[theta.length - 1] - first;
      this.at(nearest(theta, first + (((time - this.began) / 1000 / SECONDS) % periods)));
    }
    requestAnimationFrame((next) => this.frame(next));
  }

  at(sample) {
    for (const update of this.updates) update(sample);
    this.moved(sample);
  }
}

/** The index of the last sample that is not after an instant. */
function nearest(theta, at) {
  let low = 0, high = theta.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (theta[middle] <= at) low = middle;
    else high = middle - 1;
  }
  return low;
}

function spread(values) {
  return (Math.max(...values) - Math.min(...values)) / 2;
}

function disc(svg, x, y, part, middle, scale) {
  const group = element("g");
  group.append(element("circle", { class: "body", cx: 0, cy: 0, r: 22 }));
  for (const angle of [0, 120, 240]) group.append(element("line", { class: "spoke", x1: 0, y1: 0, x2: 0, y2: -17, transform: `rotate(${angle})`, opacity: angle ? 0.35 : 1 }));
  svg.append(group);
  return (i) => group.setAttribute("transform", `translate(${x} ${y}) rotate(${((part.moved[i] - middle) * scale).toFixed(2)})`);
}

function block(svg, x, y, part, middle, scale, room) {
  svg.append(element("line", { class: "rail", x1: x - room / 2 + 6, x2: x + room / 2 - 6, y1: y + 14, y2: y + 14 }));
  const group = element("g");
  group.append(element("rect", { class: "body", x: -14, y: -14, width: 28, height: 27, rx: 3 }));
  group.append(element("line", { class: "spoke", x1: 0, y1: -7, x2: 0, y2: 7 }));
  svg.append(group);
  return (i) => group.setAttribute("transform", `translate(${(x + (part.moved[i] - middle) * scale).toFixed(2)} ${y})`);
}

/** A contact: a bead between its stops; for friction and rigid stops, what it is doing, in words and by its mark. */
function gauge(svg, top, width, contact, doingAt) {
  const { deflection, stops, slider } = contact, y = top + 20;
  const reach = 1.1 * Math.max(1e-300, ...deflection.map(Math.abs), ...stops.map(Math.abs), ...(slider ?? []).map(Math.abs));
  const px = (v) => width / 2 + (v / reach) * (width / 2 - 14);
  svg.append(element("text", { x: 8, y: top + 9 }, `${contact.is === "friction" ? "friction" : "gap"} of ${contact.name}`));
  const state = element("text", { class: "state", x: width - 8, y: top + 9, "text-anchor": "end" });
  svg.append(state, element("line", { class: "rail", x1: 10, x2: width - 10, y1: y, y2: y }));
  const walls = stops.map((stop) => {
    const wall = element("rect", { class: "wall", x: px(stop) - (stop < 0 ? 5 : 0), y: y - 8, width: 5, height: 16 });
    svg.append(wall);
    return [stop, wall];
  });
  const pad = slider && element("rect", { class: "pad", y: y - 8, width: 4, height: 16 });
  if (pad) svg.append(pad);
  // a square sticks or is held, a circle moves
  const bead = element("rect", { class: "bead", y: y - 6, width: 12, height: 12 });
  svg.append(bead);
  return (i) => {
    const d = deflection[i], now = doingAt(i), rests = now?.kind === "sticks" || now?.kind === "held";
    bead.setAttribute("x", px(d) - 6);
    bead.setAttribute("rx", rests ? 1 : 6);
    bead.setAttribute("class", `bead ${now?.kind ?? ""}`);
    pad?.setAttribute("x", px(slider[i]) - 2);
    state.textContent = now?.words ?? "";
    for (const [stop, wall] of walls) {
      const near = stops.length < 2 || stop < 0 === d < 0, rigid = contact.is === "stop";
      const hit = rigid ? now && near : stop < 0 ? d < stop : d > stop;
      wall.setAttribute("class", hit ? `wall hit ${now?.kind ?? ""}` : "wall");
    }
  };
}
