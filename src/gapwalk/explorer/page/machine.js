// The machine: its drawing moves with the motion, says what touches, sticks and slips, and is the way to choose.

import { element, zoom } from "./chart.js";
import { doing } from "./friction.js";

const SECONDS = 2; // that a forcing period lasts on the screen
const REACH = 10; // pixels that the body with the largest motion moves to either side
const FREE = 9; // pixels that a tongue moves to the side on which there is no stop

/** A small drawing of a machine at rest, for a room of some pixels. */
export function stillOf(scenes, room) {
  const scene = scenes.findLast(({ width }) => width <= room) ?? scenes[0];
  const svg = element("svg", { viewBox: `0 0 ${scene.width} ${scene.height}`, class: "machine still", "aria-hidden": true });
  svg.append(...scene.shapes.map(shapeOf));
  return svg;
}

export class MachineView {
  /** `moved` is called with the number of the sample that is shown; `chosen` with a part; `canChoose` tells which may be. */
  constructor(place, { moved, chosen, canChoose }) {
    Object.assign(this, { place, moved, chosen, canChoose });
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    place.addEventListener("click", (event) => this.choose(event.target.closest?.("[role=button]")));
    place.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      this.choose(event.target.closest("[role=button]"));
    });
  }

  /** Show a machine at rest: its drawings, from narrow to wide. */
  rest(scenes) {
    this.motion = null;
    this.scenes = scenes;
    this.draw();
  }

  /** Show a machine in motion. */
  show(motion) {
    const { place } = this, focused = place.contains(document.activeElement) ? document.activeElement.dataset.part : null;
    this.motion = motion;
    this.scenes = motion.machine.scenes;
    this.began = undefined;
    this.draw();
    if (focused !== null) place.querySelector(`[data-part="${focused}"]`)?.focus({ preventScroll: true });
    this.at(0);
    this.run();
  }

  toggle() {
    this.playing = !this.playing;
    this.began = undefined;
    this.run();
    return this.playing;
  }

  /** Let it move from the next frame on; while it stands still, no frames are asked for: each costs the browser time. */
  run() {
    if (this.motion && this.playing) this.next ??= requestAnimationFrame((time) => this.frame(time));
  }

  frame(time) {
    this.next = undefined;
    if (!this.motion || !this.playing) return;
    this.began ??= time;
    const { theta } = this.motion, first = theta[0], periods = theta[theta.length - 1] - first;
    this.at(nearest(theta, first + (((time - this.began) / 1000 / SECONDS) % periods)));
    this.run();
  }

  /** Show the instant of a sample. */
  at(sample) {
    if (!this.motion) return;
    const moved = this.movers.map((mover) => mover(sample));
    for (const move of this.moves) move(moved);
    for (const say of this.states) say(sample);
    this.moved(sample);
  }

  /** Choose the part of an element of the page. */
  choose(found) {
    const part = found && this.scene.parts[found.dataset.part];
    if (!part) return;
    for (const each of this.place.querySelectorAll("[role=button]")) each.setAttribute("aria-pressed", each === found);
    this.pressed = part.words;
    this.chosen(part);
  }

  draw() {
    const room = this.place.clientWidth || 340;
    const scene = (this.scene = this.scenes.findLast(({ width }) => width <= room * 1.02) ?? this.scenes[0]);
    const { width, height } = scene;
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, class: "machine", role: "group", "aria-label": scene.words });
    svg.style.maxWidth = `${1.3 * zoom() * width}px`;
    this.moves = [];
    const groups = new Map([[-1, svg]]), states = new Map(), tongues = new Map();
    for (const shape of scene.shapes) {
      if (!groups.has(shape.part)) {
        groups.set(shape.part, this.group(scene.parts[shape.part], shape.part));
        svg.append(groups.get(shape.part));
      }
      const drawn = shapeOf(shape);
      const group = groups.get(shape.part), moves = shape.points[0][2];
      if (scene.parts[shape.part]?.kind === "body" && moves.length && !group.dataset.moves) {
        group.dataset.moves = true; // what shows that it is chosen moves along with it
        this.moves.push(moving({ points: [[0, 0, moves]] }, group.querySelector(".touch")));
      }
      group.append(drawn);
      if (shape.look === "state") states.set(shape.part, drawn);
      for (const [, , moves] of shape.points) for (const [mover] of moves) if (scene.movers[mover].kind !== "body") tongues.set(shape.part, mover);
      if (shape.points.some(([, , moves]) => moves.length)) this.moves.push(moving(shape, drawn));
    }
    this.states = [];
    if (this.motion) {
      this.setMovers(scene);
      const now = doing(this.motion);
      for (const [part, text] of states) this.states.push(this.state(scene.parts[part], groups.get(part), text, tongues.get(part), now));
    }
    this.place.replaceChildren(svg);
  }

  /** The group of a part; one that can be chosen is a button. */
  group(part, number) {
    const can = this.canChoose(part);
    const group = element("g", { class: `part ${part.kind}`, "data-part": number, "data-words": part.words, role: can ? "button" : "img" });
    if (can) {
      group.setAttribute("tabindex", 0);
      group.setAttribute("aria-pressed", part.words === this.pressed);
    }
    const [x0, y0, x1, y1] = part.box;
    group.append(element("title", {}, part.words), element("rect", { class: "touch", x: x0, y: y0, width: x1 - x0, height: y1 - y0, rx: 4 }));
    return group;
  }

  /** Make a function of the sample for each mover: its displacement in pixels. */
  setMovers(scene) {
    const { moved, stops } = this.motion.machine, contacts = new Map(this.motion.contacts.map((each) => [each.name, each]));
    const middles = moved.map((values) => (most(values) + least(values)) / 2);
    const reach = Math.max(0, ...moved.map((values, i) => most(values) - middles[i]));
    const of = (mover) => [0, 1].map((side) => (stops[mover] ?? [])[side] ?? null);
    const gaps = scene.movers.flatMap((mover, i) => (mover.kind === "gap" ? of(i).map((stop, side) => [stop, mover.widths[side]]) : []));
    const wide = gaps.filter(([stop]) => stop).sort((a, b) => b[0] - a[0])[0], ofGaps = wide && wide[1] / wide[0];
    const fits = ofGaps && ofGaps * reach <= 1.25 * REACH && ofGaps * reach >= 2;
    const scale = fits ? ofGaps : REACH / (reach || 1);
    this.note = !ofGaps || !reach ? "" : fits ? "Motion and gaps are drawn to one scale." : `Motion is drawn ${(scale / ofGaps).toPrecision(2)} times as large as the gaps.`;
    let body = 0;
    this.movers = scene.movers.map((mover, number) => {
      const { kind, contact, sign, widths } = mover;
      if (kind === "body") {
        const values = moved[body], middle = middles[body++];
        return (i) => (values[i] - middle) * scale;
      }
      const found = contacts.get(contact);
      if (kind === "slider") {
        if (!found?.slider) return () => 0;
        const middle = (most(found.slider) + least(found.slider)) / 2;
        return (i) => sign * Math.max(-FREE, Math.min(FREE, (found.slider[i] - middle) * scale));
      }
      if (!found) return () => 0;
      const own = of(number), rates = own.map((stop, side) => (stop ? widths[side] / stop : null));
      return (i) => {
        const x = found.deflection[i], side = x < 0 ? 0 : 1, size = Math.abs(x);
        if (own[side] === null) return sign * Math.sign(x) * Math.min(FREE, size * (rates[1 - side] ?? scale));
        return sign * Math.sign(x) * Math.min(widths[side], size * (rates[side] ?? 0));
      };
    });
  }

  /** Make a function of the sample that says what a contact is doing, in words and by its style. */
  state(part, group, text, mover, now) {
    const contact = this.motion.contacts.find(({ name }) => name === part.contact);
    const style = group.getAttribute("class"), rest = text.textContent;
    if (!contact) return () => {};
    const [low, high] = this.motion.machine.stops[mover] ?? [null, null];
    let last = null;
    return (i) => {
      const d = contact.deflection[i], mode = now(part.contact, this.motion.theta[i]);
      const above = high !== null && d > high, below = low !== null && d < -low;
      const near = low === null || (high !== null && d >= 0) ? "high" : "low";
      let words = rest, kind = "";
      if (mode) [words, kind] = [mode.words, `${mode.kind}${part.kind === "gap" ? ` at-${near}` : ""}`];
      else if (part.kind === "gap") [words, kind] = above ? ["touches +", "touches at-high"] : below ? ["touches −", "touches at-low"] : ["open", ""];
      if (words + kind === last) return;
      last = words + kind;
      text.textContent = words;
      group.setAttribute("class", `${style} ${kind}`);
    };
  }
}

const TAGS = { line: "polyline", area: "polygon", circle: "circle", text: "text" };

function shapeOf({ kind, look, points, text, anchor, radius }) {
  const [[x, y]] = points, style = look.split(" ").map((name, i) => (i ? name : `m-${name}`)).join(" ");
  const where = kind === "circle" ? { cx: x, cy: y, r: radius } : kind === "text" ? { x, y, "text-anchor": anchor } : { points: points.map(([px, py]) => `${px},${py}`).join(" ") };
  return element(TAGS[kind], { class: style, ...where }, text);
}

/** A function of the displacements of all movers that moves a shape: as a whole, or point by point. */
function moving({ points }, drawn) {
  const first = JSON.stringify(points[0][2]);
  const by = (moves, moved) => moves.reduce((sum, [mover, share]) => sum + share * moved[mover], 0);
  if (points.every(([, , moves]) => JSON.stringify(moves) === first)) {
    return (moved) => drawn.setAttribute("transform", `translate(${by(points[0][2], moved).toFixed(2)} 0)`);
  }
  return (moved) => drawn.setAttribute("points", points.map(([x, y, moves]) => `${(x + by(moves, moved)).toFixed(2)},${y}`).join(" "));
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

function most(values) {
  return values.reduce((a, b) => Math.max(a, b), -Infinity);
}

function least(values) {
  return values.reduce((a, b) => Math.min(a, b), Infinity);
}
