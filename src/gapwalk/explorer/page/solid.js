// A motion in three of its signals: the path of a torus, and its section, seen from any side.

import { fill, signalWords } from "./dom.js";
import { rangeOf, Space } from "./space.js";

const $ = (id) => document.getElementById(id);
const PHASE = "cos θ"; // of the excitation: the third coordinate of a single one

export class Solid {
  constructor() {
    this.space = new Space($("solid"), { label: "Motion in three dimensions" });
    for (const id of IDS) $(id).addEventListener("change", () => this.draw());
    $("solid-figure").addEventListener("toggle", () => this.draw());
  }

  /** Show a motion; the section comes later. */
  show(motion, coordinate) {
    const names = Object.keys(motion.q), all = [...names.flatMap((name) => [name, `${name}'`]), PHASE], said = all.join();
    const other = names.find((name) => name !== coordinate) ?? PHASE;
    if (this.said !== said || this.coordinate !== coordinate) {
      for (const id of IDS) fill($(id), all.map((name) => [name, name === PHASE ? PHASE : signalWords(name)]));
      [coordinate, `${coordinate}'`, other].forEach((name, k) => { $(IDS[k]).value = name; });
    }
    if (motion !== this.motion) this.states = null;
    Object.assign(this, { motion, said, coordinate });
    this.draw();
  }

  /** The states at the start of each forcing period. */
  section({ section }) {
    this.states = section.states ?? null;
    this.draw();
  }

  values(name) {
    const { motion } = this;
    if (name === PHASE) return motion.theta.map((theta) => Math.cos(2 * Math.PI * theta));
    return name.endsWith("'") ? motion.v[name.slice(0, -1)] : motion.q[name];
  }

  /** The section in a signal; the phase of the excitation is always the same there. */
  cut(name) {
    return name === PHASE ? Object.values(this.states)[0].map(() => 1) : this.states[name];
  }

  draw() {
    if (!this.motion || !$("solid-figure").open) return;
    const names = IDS.map((id) => $(id).value), points = names.map((name) => this.values(name));
    const cuts = this.states ? names.map((name) => this.cut(name)) : [], has = cuts.length && cuts.every(Boolean), settled = !this.motion.period;
    const dots = has ? cuts[0].map((_, k) => ({ at: cuts.map((values) => values[k]), shade: "--chosen", size: settled ? 2.2 : 4.5, bare: settled })) : [];
    const axes = names.map((name, k) => ({ words: name === PHASE ? PHASE : signalWords(name), range: rangeOf([points[k], ...(has ? [cuts[k]] : [])]) }));
    this.points = points;
    this.space.show({ axes, lines: [{ points, shade: "--accent", width: settled ? 0.8 : 1.6, opacity: settled ? 0.75 : 1 }], dots, mark: null });
  }

  /** Move the mark with the animation. */
  follow(sample) {
    if ($("solid-figure").open && this.points) this.space.pointAt(this.points.map((values) => values[sample]));
  }
}

const IDS = ["solid-x", "solid-z", "solid-y"];
