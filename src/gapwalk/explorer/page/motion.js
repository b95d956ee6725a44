// The motion at the chosen point, panel by panel; it is dropped when another point is chosen.

import { get } from "./api.js";
import { chart, measure } from "./chart.js";
import { signalWords, unitOf } from "./dom.js";
import { Elements, legend, rests, showEnergy, strip } from "./friction.js";
import { MachineView } from "./machine.js";
import { Pinned } from "./pinned.js";
import { Solid } from "./solid.js";
import { loudness, Sound } from "./sound.js";

const $ = (id) => document.getElementById(id);
const TAB = crypto.randomUUID?.() ?? String(Math.random()); // the former only where the address is safe

export class MotionView {
  constructor(tell) {
    this.tell = tell;
    this.sound = new Sound();
    this.elements = new Elements();
    this.solid = new Solid();
    this.pinned = new Pinned(() => this.motion && this.redraw());
    this.machine = new MachineView($("machine"), {
      moved: (sample) => this.follow(sample), chosen: (part) => this.choose(part), canChoose: (part) => canChoose(part),
    });
    $("log-of").querySelector("button").addEventListener("click", () => this.showLog(""));
    $("play").textContent = this.machine.playing ? "Pause" : "Play";
    $("play").addEventListener("click", () => {
      const playing = this.machine.toggle();
      $("play").textContent = playing ? "Pause" : "Play";
      $("play").setAttribute("aria-pressed", playing);
    });
    $("sound").addEventListener("click", () => {
      const on = this.sound.toggle(this.motion, this.coordinate);
      $("sound").textContent = on ? "Silence" : "Listen";
      $("sound").setAttribute("aria-pressed", on);
    });
    $("volume").addEventListener("input", ({ target }) => loudness.turn(target.valueAsNumber / 100));
    for (const id of ["panels", "machine"]) this.watch(id);
    $("signal").addEventListener("change", () => {
      this.wanted = "";
      if (this.place) this.show(this.place, this.title, this.verdict);
    });
  }

  /** Draw again for another width of a place. */
  watch(id) {
    let width = 0;
    new ResizeObserver(([{ contentRect }]) => {
      const isOther = Math.abs(contentRect.width - width) > 2;
      width = contentRect.width;
      if (isOther && this.motion) this.redraw();
      else if (isOther && id === "machine" && this.machine.scenes) this.machine.draw();
    }).observe($(id));
  }

  /** Show the machine of a file at rest, until a motion is shown. */
  rest(scenes) {
    $("machine-figure").hidden = false;
    $("machine-note").textContent = HOW;
    this.scenes = scenes;
    this.machine.rest(scenes);
  }

  /** Show what a part of the machine does: the force of a spring, the impacts in a gap, the loop of friction, a motion. */
  choose(part) {
    const { motion } = this, contact = motion?.contacts.find(({ name }) => name === part.contact);
    const names = [...$("signal").options].map(({ value }) => value);
    if (contact && contact.is !== "spring") this.elements.choose(contact.name);
    if (contact?.is === "spring") {
      this.wanted = contact.name;
      this.draw();
    } else if (!contact && names.includes(part.signal)) {
      $("signal").value = part.signal;
      $("signal").dispatchEvent(new Event("change"));
    }
    if (part.kind === "gap") this.showLog(part.contact);
    const place = part.kind === "gap" ? "log" : !contact ? "history" : contact.is === "spring" ? "loop" : "element-loop";
    if (motion) reveal($(place).closest("figure"));
  }

  /** Show the contact log of one contact, or of all. */
  showLog(name) {
    const { log } = this.motion ?? { log: [] };
    this.logged = name;
    $("log-of").hidden = !name;
    $("log-of").querySelector("span").textContent = name;
    const own = log.filter(({ contact }) => !name || contact.replace(/ [+-]$/, "") === name || contact.startsWith(`${name}.`));
    $("log").replaceChildren(table(own, unitOf(signalWords(`${this.coordinate}'`))));
  }

  /** Draw this motion behind those that are chosen from now on. */
  pin() {
    this.pinned.pin(this.motion, this.title, this.details);
  }

  /** Play the sound, unless it plays already. */
  hear() {
    if (!this.sound.on) $("sound").click();
    $("sound").scrollIntoView({ block: "nearest" });
  }

  get signal() {
    return $("signal").value;
  }

  get coordinate() {
    const base = this.signal.replace(/'+$/, "");
    return base in (this.motion?.q ?? {}) ? base : Object.keys(this.motion?.q ?? {})[0];
  }

  clear() {
    this.request?.abort();
    this.place = this.motion = this.details = null;
    $("panels").hidden = true;
    this.wanted = this.logged = "";
    if (this.scenes) this.rest(this.scenes);
    $("motion-title").textContent = "The motion";
    $("motion-verdict").textContent = "";
    $("motion-text").textContent = "It is shown here once a point is chosen.";
  }

  /** Show the motion at a place; cancel an earlier request. `verdict` says in a few words what a settled motion is. */
  async show(place, title, verdict = "") {
    const started = performance.now();
    this.request?.abort();
    const request = (this.request = new AbortController());
    [this.place, this.title, this.verdict] = [place, title, verdict];
    $("motion-title").textContent = title;
    const query = { ...place, signal: this.signal, tab: TAB };
    try {
      this.motion = await get("/api/motion", query, request.signal);
      if (request.signal.aborted) return null;
      this.details = null;
      this.draw();
      this.shownAfter = performance.now() - started;
      document.body.dataset.shown = `${Number(document.body.dataset.shown ?? 0) + 1}`;
      document.body.dataset.shownAfter = this.shownAfter.toFixed(1);
      this.sound.play(this.motion, this.coordinate);
      const details = await get("/api/details", query, request.signal);
      if (details && this.pinned.motion === this.motion) this.pinned.details = details;
      if (details && !request.signal.aborted) this.drawDetails(details);
    } catch (error) {
      if (error.name !== "AbortError" && !/superseded/.test(error.message)) this.tell(error);
    }
    return this.motion;
  }

  draw() {
    const { motion } = this, name = this.coordinate, signal = this.signal;
    $("panels").hidden = false;
    $("motion-verdict").textContent = motion.text.startsWith(this.verdict) ? "" : this.verdict;
    $("motion-text").textContent = motion.text;
    $("machine-figure").hidden = false;
    this.machine.show(motion);
    $("machine-note").textContent = [this.machine.note, HOW].join(" ");
    const dashes = signal.length - name.length, own = signal.replace(/'+$/, "") === name;
    const contact = motion.contacts.find((c) => c.signal === signal);
    const other = motion.others?.[signal] ?? motion.q[name];
    this.values = contact ? contact.force : own ? [motion.q, motion.v, motion.a][dashes][name] : other;
    const stops = !contact && own && dashes === 0 ? motion.contacts.filter((c) => same(c.deflection, motion.q[name])).flatMap((c) => c.stops) : [];
    const near = stops.filter((s) => s <= Math.max(...this.values) * 1.3 + 0.3 && s >= Math.min(...this.values) * 1.3 - 0.3);
    const springs = motion.contacts.filter((c) => c.is === "spring"), alone = !springs.length && motion.contacts.length > 0;
    $("loop-figure").hidden = alone; // friction and rigid stops have a panel of their own
    $("phase").parentElement.classList.toggle("alone", alone);
    const wanted = motion.contacts.find((c) => c.name === this.wanted);
    const shown = [wanted, contact, motion.contacts.find((c) => own && c.name === name), motion.contacts[motion.shown], springs[0]].find((c) => c?.is === "spring");
    const struck = contact?.struck ?? (own && dashes === 2 && motion.struck?.[name]) ?? null; // impulses, of no finite value
    const [bars, words] = struck?.[0]?.length ? [struck, `${signalWords(signal)}; bars: its impulses`] : [null, signalWords(signal || name)];
    const behind = this.pinned.behind(motion, { name, dashes: own ? dashes : -1, contact, shown });
    measure(["history", "force", "phase", "loop", "element-loop", "multipliers"].map($));
    this.marks = {
      history: chart($("history"), { behind: behind.history, curves: [[motion.theta, this.values]], bars, across: near, shades: rests(motion), below: strip(motion), x: periods(motion), y: words, height: 150 }),
      phase: chart($("phase"), { behind: behind.phase, curves: [[motion.q[name], motion.v[name]]], x: signalWords(name), y: signalWords(`${name}'`), padded: true }),
    };
    $("force").hidden = !shown || shown === contact;
    if (!$("force").hidden) this.marks.force = chart($("force"), { behind: behind.force, curves: [[motion.theta, shown.force]], x: "", y: shown.up, label: `Force of ${shown.name} over time`, height: 92 });
    $("modes").replaceChildren(...legend(motion));
    this.shownContact = shown;
    if (shown) this.marks.loop = chart($("loop"), { behind: behind.loop, curves: [[shown.deflection, shown.force]], down: shown.stops.filter((s) => reaches(shown.deflection, s)), x: shown.across, y: shown.up, padded: true });
    else $("loop").textContent = "no contact";
    this.elements.show(motion, signal);
    this.solid.show(motion, name);
    showEnergy($("energy"), motion.energy, motion.period);
    const dots = motion.multipliers.map(([re, im]) => [re, im, re * re + im * im > 1 ? "out" : ""]);
    if (dots.length) chart($("multipliers"), { dots, x: "real part", y: "imaginary part", square: true, label: `Multipliers: ${motion.multipliers.map(complex).join(", ")}` });
    else $("multipliers").textContent = "none: this motion is not periodic";
    this.showLog(this.logged ?? "");
  }

  /** Draw again for another width. */
  redraw() {
    this.draw();
    if (this.details) this.drawDetails(this.details);
  }

  drawDetails(details) {
    const { section } = details;
    this.details = details;
    this.solid.section(details);
    this.elements.book(details.energy);
    showEnergy($("energy"), details.energy, this.motion.period);
    measure(["spectrum", "section"].map($));
    // the mean would hide the vibration; close lines are drawn as a curve
    if (details.missing) $("spectrum").textContent = details.missing;
    const lines = [details.orders.slice(1), details.amplitudes.slice(1)], many = lines[0].length > 90;
    const { behind, barsBehind, dots } = this.pinned.details === details ? NONE : this.pinned.lines(details);
    if (!details.missing) chart($("spectrum"), { behind, barsBehind, [many ? "curves" : "bars"]: many ? [lines] : lines, x: details.across, y: signalWords(details.signal), height: 150, depth: 1e-4 });
    chart($("section"), { dots: [...dots, ...section.q.map((q, i) => [q, section.v[i]])], x: `${signalWords(section.of)}, each period`, y: signalWords(`${section.of}'`) });
  }

  /** Move the marks of the panels with the animation. */
  follow(sample) {
    const { motion, marks } = this, name = this.coordinate;
    if (!motion || !marks) return;
    marks.history(motion.theta[sample], this.values[sample]);
    marks.phase(motion.q[name][sample], motion.v[name][sample]);
    marks.force?.(motion.theta[sample], this.shownContact.force[sample]);
    marks.loop?.(this.shownContact.deflection[sample], this.shownContact.force[sample]);
    this.elements.follow(sample);
    this.solid.follow(sample);
  }
}

const NONE = { behind: [], barsBehind: null, dots: [] }; // of no other motion
const HOW = "Click a spring or friction to see its force, a gap to see its impacts, a body to see its motion.";

/** A part can be chosen if a panel or a signal shows it. */
function canChoose({ contact, signal }) {
  return Boolean(contact) || [...$("signal").options].some(({ value }) => value === signal);
}

/** The title of the axis of time: forcing periods, and how long one lasts where there are units. */
function periods({ has_units: units, seconds }) {
  if (!units) return "forcing periods";
  const [number, unit] = seconds < 1 ? [seconds * 1000, "ms"] : [seconds, "s"];
  return `forcing periods (one lasts ${Number(number.toPrecision(4))} ${unit})`;
}

/** Bring a panel into view, and mark it for a moment. */
function reveal(panel) {
  panel.scrollIntoView({ block: "nearest" });
  panel.classList.remove("revealed");
  requestAnimationFrame(() => panel.classList.add("revealed"));
}

function complex([re, im]) {
  return im ? `${re.toPrecision(4)} ${im < 0 ? "−" : "+"} ${Math.abs(im).toPrecision(4)}i` : re.toPrecision(4);
}

function same(a, b) {
  return a.every((value, i) => Math.abs(value - b[i]) < 1e-9 * (1 + Math.abs(value)));
}

function reaches(values, stop) {
  const size = Math.max(...values.map(Math.abs));
  return Math.abs(stop) < 1.5 * size;
}

function table(log, unit) {
  if (!log.length) return document.createTextNode("Nothing opens, closes, slips or sticks.");
  const made = document.createElement("table");
  const row = (cells, name) => {
    const line = made.insertRow();
    for (const text of cells) line.append(Object.assign(document.createElement(name), { textContent: text }));
  };
  row(["periods", "contact", "what", `rate${unit}`], "th");
  for (const e of log) row([e.periods.toFixed(4), e.contact.replace(/ -$/, " −"), e.what.replace(/ -$/, " −"), e.velocity === null ? "" : e.velocity.toPrecision(3)], "td");
  return made;
}
