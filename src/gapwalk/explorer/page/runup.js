// What asks for a run-up: the range of the speed, how long it takes, and the direction.

import { unitOf } from "./dom.js";

const $ = (id) => document.getElementById(id);

export class RunUpControls {
  /** `act(action)` starts it; `start()` and `values()` say from which motion, and with which changed values. */
  constructor(page, { act, start, values, tell }) {
    Object.assign(this, { page, act, start, values, tell, file: null });
    $("run-up").addEventListener("click", () => this.run());
    $("run-up-part").addEventListener("toggle", () => this.show());
  }

  /** Propose the range of the file where it is over the speed, else half to one and a half of its value. */
  show() {
    const { about } = this.page;
    if (!about || this.file === about.file) return;
    this.file = about.file;
    const { name, words, value } = about.parameters[0], range = about.x === name && about.range.length ? about.range : [0.5 * value, 1.5 * value];
    [$("run-up-low").value, $("run-up-high").value] = [Math.min(...range), Math.max(...range)].map((v) => Number(v.toPrecision(4)));
    const unit = unitOf(words);
    $("run-up-hint").textContent = `${name === "frequency" && !unit ? "Excitation frequency Ω" : `${name}${unit}`}, from the motion that settles at its first value.${unit ? "" : " Ω = 1 is heard at 90 Hz."}`;
  }

  run() {
    const [low, high, seconds] = ["low", "high", "seconds"].map((name) => $(`run-up-${name}`).valueAsNumber);
    if (!Number.isFinite(low + high + seconds)) return this.tell(new Error("Enter the range of the speed, and how many seconds the run-up takes, as in 10."));
    this.act({ do: "runup", start: this.start(), values: this.values(), low, high, seconds, way: $("run-up-way").value });
  }
}
