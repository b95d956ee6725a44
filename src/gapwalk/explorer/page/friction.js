// Friction and rigid stops: a strip of their modes, their loops, what each is doing, and where the energy goes.

import { chart, element } from "./chart.js";
import { signalWords, unitOf } from "./dom.js";

const $ = (id) => document.getElementById(id);

/** Modes in the words of the page; their heights in a row of the strip tell them apart without colour. */
export const MODES = {
  "slip +": { words: "slips +", kind: "slips-forth", top: 0, height: 4 },
  "slip -": { words: "slips −", kind: "slips-back", top: 6, height: 4 },
  stick: { words: "sticks", kind: "sticks", top: 3, height: 4 },
  held: { words: "held", kind: "held", top: 0, height: 10 },
};
const ROW = 26, NAME = 12; // pixels of a row of the strip, and of the name in it
const MOMENT = 0.03; // forcing periods for which an impact is shown

/** The phases in which something sticks or is held, as intervals to be shaded. */
export function rests({ elements }) {
  return (elements?.phases ?? []).filter(([, mode]) => mode === "stick" || mode === "held").map(([, , from, to]) => [from, to]);
}

/** A strip of modes below a time history: a row for each element, and a bar across it for each impact. */
export function strip({ elements, theta }) {
  if (!elements) return null;
  const { names, phases, strikes } = elements;
  return {
    height: ROW * names.length + 6,
    draw(svg, px, top) {
      const bars = (row) => top + 4 + row * ROW + NAME;
      names.forEach((name, row) => {
        svg.append(element("text", { x: px.low, y: bars(row) - 3 }, name));
        svg.append(element("line", { class: "grid", x1: px(theta[0]), x2: px(theta[theta.length - 1]), y1: bars(row) + 5, y2: bars(row) + 5 }));
      });
      for (const [row, mode, from, to] of phases) {
        const { kind, top: above, height } = MODES[mode];
        svg.append(element("rect", { class: `mode ${kind}`, x: px(from), width: Math.max(0.6, px(to) - px(from)), y: bars(row) + above, height }));
      }
      for (const [row, at] of strikes) svg.append(element("line", { class: "strike", x1: px(at), x2: px(at), y1: bars(row) - 1, y2: bars(row) + 11 }));
    },
  };
}

/** The modes that occur, as entries of a legend. */
export function legend({ elements }) {
  const used = new Set(elements?.phases.map(([, mode]) => mode));
  const entry = (mark, words) => {
    const svg = element("svg", { viewBox: "0 0 22 12", class: "chart", "aria-hidden": "true" }), line = document.createElement("li");
    svg.append(mark);
    line.append(svg, words);
    return line;
  };
  const entries = Object.entries(MODES).filter(([mode]) => used.has(mode)).map(([, { words, kind, top, height }]) => (
    entry(element("rect", { class: `mode ${kind}`, x: 1, width: 20, y: 1 + top, height }), words)
  ));
  if (elements?.strikes.length) entries.push(entry(element("line", { class: "strike", x1: 11, x2: 11, y1: 0, y2: 12 }), "impact"));
  return entries;
}

/** What each element is doing at an instant: a function of a name and of forcing periods; null if it has no mode then. */
export function doing({ elements }) {
  if (!elements) return () => null;
  const of = new Map(elements.names.map((name, row) => [name, {
    phases: elements.phases.filter(([own]) => own === row), strikes: elements.strikes.filter(([own]) => own === row),
  }]));
  return (name, at) => {
    const own = of.get(name), struck = own?.strikes.some(([, when]) => at >= when - 1e-9 && at < when + MOMENT);
    if (struck) return { words: "impact", kind: "struck" };
    const phase = own?.phases.findLast(([, , from]) => from <= at + 1e-12) ?? null;
    return phase && at <= phase[3] ? MODES[phase[1]] : null;
  };
}

/** The panel of one element: its loop, what it dissipates, and how long it sticks; the element can be chosen. */
export class Elements {
  constructor() {
    this.choice = $("element");
    this.choice.addEventListener("change", () => this.draw());
  }

  /** Show the elements of a motion; that of the signal is chosen, or else the one that was. */
  show(motion, signal) {
    this.motion = motion;
    this.energy = motion.energy ?? null;
    const names = motion.elements?.names.filter((name) => motion.contacts.some((each) => each.name === name)) ?? [];
    $("element-figure").hidden = !names.length;
    this.mark = this.contact = null;
    if (!names.length) return;
    const before = this.choice.value, named = motion.contacts.find((each) => each.signal === signal && names.includes(each.name));
    this.choice.replaceChildren(...names.map((name) => new Option(name, name)));
    this.choice.value = named && signal !== this.signal ? named.name : names.includes(before) ? before : names[0];
    this.choice.disabled = names.length < 2;
    this.signal = signal;
    this.draw();
  }

  /** Show another element. */
  choose(name) {
    this.choice.value = name;
    this.draw();
  }

  /** Take the energy, which comes later than the motion. */
  book(energy) {
    this.energy = energy;
    if (this.contact) this.say();
  }

  draw() {
    const { motion } = this, contact = (this.contact = motion.contacts.find(({ name }) => name === this.choice.value));
    const stop = contact.is === "stop";
    $("element-figure").querySelector("figcaption").textContent = stop ? "Rigid stop" : "Hysteresis loop";
    this.values = stop ? contact.rate : contact.force;
    this.mark = chart($("element-loop"), {
      curves: [[contact.deflection, this.values]], down: contact.stops.filter((s) => Math.abs(s) < 1.5 * Math.max(...contact.deflection.map(Math.abs))),
      x: contact.across, y: stop ? `rate of ${contact.name}${unitOf(signalWords(`${Object.keys(motion.q)[0]}'`))}` : contact.up, height: 170, padded: true,
    });
    this.say();
  }

  /** Say in words what the element does in a period. */
  say() {
    const { contact, motion, energy } = this, row = motion.elements.names.indexOf(contact.name), rows = [];
    if (energy && !energy.reason) {
      const lost = energy.losses.filter(([name, kind]) => name === contact.name && (kind === "friction" || kind === "impacts"));
      const sum = (place) => lost.reduce((total, item) => total + item[place], 0);
      rows.push([motion.period === 1 ? "In one period" : `In ${motion.period} periods`]);
      rows.push([`dissipates${energy.unit && ` [${energy.unit}]`}`, number(sum(2))], ["of the work", percent(sum(3))]);
    }
    const shares = Object.entries(motion.elements.shares[row]);
    if (shares.length) rows.push(["Share of the time"], ...shares.map(([mode, share]) => [MODES[mode].words, percent(share)]));
    if (contact.is === "stop") {
      const rates = motion.elements.strikes.filter(([own]) => own === row).map(([, , rate]) => Math.abs(rate));
      rows.push(["Impacts"], ["number", String(rates.length)]);
      if (rates.length) rows.push([`fastest${unitOf(signalWords(`${Object.keys(motion.q)[0]}'`))}`, number(Math.max(...rates))]);
    }
    $("element-facts").replaceChildren(...rows.flatMap(([term, words]) => [
      Object.assign(document.createElement("dt"), { textContent: term, className: words === undefined ? "head" : "" }),
      ...(words === undefined ? [] : [Object.assign(document.createElement("dd"), { textContent: words })]),
    ]));
  }

  /** Move the mark of the loop with the animation. */
  follow(sample) {
    this.mark?.(this.contact.deflection[sample], this.values[sample]);
  }
}

/** Show work and losses, element by element, in a place; `energy` is null until it has come. */
export function showEnergy(place, energy, period) {
  if (!energy) return place.replaceChildren();
  if (energy.reason) return place.replaceChildren(Object.assign(document.createElement("p"), { className: "hint", textContent: `Not known: ${energy.reason}.` }));
  const made = document.createElement("table");
  const row = (cells, kind = "td") => {
    const line = made.insertRow();
    for (const text of cells) line.append(Object.assign(document.createElement(kind), { textContent: text }));
  };
  for (const [words, items] of [["work of", energy.work], ["loss in", energy.losses]]) {
    row([words, "by", energy.unit ? `energy [${energy.unit}]` : "energy", "share"], "th");
    for (const [name, kind, value, share] of items) row([name, kind, number(value), percent(share)]);
  }
  const cycle = period === 1 ? "In one period of the excitation" : `In ${period} periods of the excitation`;
  const note = Object.assign(document.createElement("p"), { className: "hint", textContent: `${cycle}; work less losses: ${energy.imbalance ? energy.imbalance.toExponential(0).replaceAll("-", "−") : "none"} of the work.` });
  place.replaceChildren(made, note);
}

function number(value) {
  return value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3) ? value.toExponential(3) : String(Number(value.toPrecision(4)));
}

function percent(share) {
  return `${(100 * share).toFixed(Math.abs(share) < 0.0995 ? 2 : 1)} %`;
}
