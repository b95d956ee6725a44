// A run-up, heard and seen: its sound, while a line moves over the diagram, the order map and the amplitude of an order.

import { get, samples } from "./api.js";
import { fill } from "./dom.js";
import { cardColour, colours, drawMap } from "./ordermap.js";
import { drawPanel } from "./panels.js";
import { decibels, levelOf, loudness, short } from "./sound.js";

const $ = (id) => document.getElementById(id);
const HEIGHTS = { map: 150, track: 92 };

export class Heard {
  /** `changed` is called when the diagram must be drawn again; `saved(query)` saves the WAV file. */
  constructor({ diagram, tell, changed = () => {}, saved = () => {} }) {
    Object.assign(this, { diagram, tell, changed, saved, content: null, found: null, axes: null, source: null, at: 0 });
    $("heard-play").addEventListener("click", () => this.toggle().catch(tell));
    $("heard-at").addEventListener("input", ({ target }) => this.seek(target.valueAsNumber));
    for (const id of ["heard-signal", "heard-record"]) $(id).addEventListener("change", () => this.load().catch(tell));
    for (const id of ["heard-map", "heard-over", "heard-order"]) $(id).addEventListener("change", () => this.draw());
    $("heard-volume").addEventListener("input", ({ target }) => loudness.turn(target.valueAsNumber / 100));
    $("heard-wav").addEventListener("click", () => this.saved({ ...this.query, scale: this.scale ?? "" }));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Show the run-up of an answer, if it is one. */
  show(file, key, content) {
    const { heard } = content;
    this.clear();
    if (!heard) return;
    Object.assign(this, { file, key, content: heard, answer: content });
    fill($("heard-signal"), heard.signals);
    $("heard").hidden = $("heard-panels").hidden = false;
    $("heard-at").max = this.lasts;
    this.seek(0);
    this.load().catch(this.tell);
    this.listRecords().catch(this.tell);
  }

  clear() {
    this.stop();
    Object.assign(this, { content: null, found: null, values: null, scale: null });
    for (const id of ["heard", "heard-panels", "heard-line", "heard-dot"]) $(id).hidden = true;
    $("heard-note").textContent = "";
  }

  get query() {
    return { file: this.file, result: this.key, signal: $("heard-signal").value };
  }

  get lasts() {
    return this.content.seconds.at(-1);
  }

  async listRecords() {
    const { records } = (await get("/api/records", { file: this.file })) ?? { records: [] };
    fill($("heard-record"), [["", records.length ? "none" : "none (no file)", "Put a CSV file with columns of time, speed and a signal into the folder, and show the run-up again"], ...records.map((name) => [name, name])]);
  }

  /** Fetch maps of the chosen signal, with the record to lay over; the sound is fetched when it is played. */
  async load() {
    const asked = (this.asked = {}), playing = Boolean(this.source);
    this.stop();
    this.values = null;
    const record = $("heard-record").value;
    let found;
    try {
      found = await get("/api/heard", { ...this.query, record });
    } catch (error) {
      if (record) $("heard-record").value = "";
      throw error;
    }
    if (this.asked !== asked || !this.content) return;
    this.found = found;
    fill($("heard-map"), found.maps.map(({ text }, k) => [k, text]));
    fill($("heard-order"), found.tracks.map(({ title }, k) => [k, title.split(" of ")[0]]));
    $("heard-scale").textContent = found.maps.length ? `to ${`${short(found.top)} ${found.unit}`.trim()}, over ${found.depth} dB` : found.why;
    this.changed();
    this.draw();
    if (playing) await this.toggle();
  }

  /** What the diagram shows of a measured record. */
  get layers() {
    return this.found?.layers ?? [];
  }

  /** Draw with the range of the diagram. */
  follow(axes, x) {
    Object.assign(this, { axes, x });
    this.draw();
  }

  get isOver() {
    return Boolean(this.content && this.axes && this.x === this.answer.axes[0] && !$("diagram").classList.contains("deep"));
  }

  draw() {
    if (!this.content || !this.axes) return;
    const { found, axes } = this, there = this.isOver && Boolean(found?.maps.length);
    $("heard-panels").hidden = !this.isOver;
    for (const id of ["heard-picture", "heard-track"]) $(id).hidden = !there;
    if (there) {
      const map = found.maps[Number($("heard-map").value) || 0], track = found.tracks[Number($("heard-order").value) || 0];
      const range = axes.xaxis.range, left = axes.xaxis._offset, right = Math.max(0, $("heard-picture").clientWidth - left - axes.xaxis._length);
      const more = { range, left, right, over: $("heard-over").value, pitch: this.content.pitch, turns: found.turns, top: found.top, depth: found.depth, unit: found.unit, across: /^order/.test(found.across) ? "order" : "multiple of Ω" };
      const scale = colours(cardColour(), isDark());
      document.querySelector("#heard-panels .head i").style.background = `linear-gradient(to right, ${[0, 64, 128, 192, 255].map((k) => `rgb(${scale[k].join()})`).join()})`;
      drawMap($("heard-picture"), map, { ...more, height: HEIGHTS.map, scale, label: `Order map of ${$("heard-signal").value}, ${map.text}` });
      if (track) drawPanel($("heard-track"), track, { range, left, right, named: false, height: HEIGHTS.track });
    }
    this.point();
  }

  /** Play, or pause. */
  async toggle() {
    if (this.source) return this.stop();
    const { audio } = loudness;
    $("heard-play").textContent = "Wait";
    try {
      await audio.resume();
      this.values ??= await samples("/api/sound", this.query);
    } finally {
      $("heard-play").textContent = "Play";
    }
    if (!this.content) return;
    const { rate, values } = this.values, mean = values.reduce((sum, v) => sum + v, 0) / values.length, own = values.map((v) => v - mean);
    const signal = $("heard-signal").value, { scale, said } = loudness.fit(signal, own, this.found?.unit);
    const buffer = audio.createBuffer(1, own.length, rate), wave = buffer.getChannelData(0);
    for (let i = 0; i < own.length; i++) wave[i] = own[i] / scale;
    Object.assign(this, { own, scale });
    $("heard-note").textContent = said;
    if (this.at >= this.lasts - 0.05) this.at = 0;
    this.source = new AudioBufferSourceNode(audio, { buffer });
    this.source.connect(loudness.output);
    this.began = audio.currentTime - this.at;
    this.source.start(0, this.at);
    $("heard-play").textContent = "Pause";
    this.run();
  }

  stop() {
    this.source?.stop();
    this.source = null;
    cancelAnimationFrame(this.frame);
    $("heard-play").textContent = "Play";
  }

  run() {
    if (!this.source) return;
    this.at = Math.min(this.lasts, loudness.audio.currentTime - this.began);
    $("heard-at").value = this.at;
    this.point();
    if (this.at >= this.lasts) return this.stop();
    this.frame = requestAnimationFrame(() => this.run());
  }

  seek(at) {
    const playing = Boolean(this.source);
    this.stop();
    this.at = at;
    $("heard-at").value = at;
    this.point();
    if (playing) this.toggle().catch(this.tell);
  }

  /** The speed at a time, and whether it rises. */
  speedAt(at) {
    const { seconds, speeds } = this.content;
    let k = 0;
    while (k < seconds.length - 2 && seconds[k + 1] <= at) k++;
    const part = Math.min(1, (at - seconds[k]) / (seconds[k + 1] - seconds[k]));
    return [speeds[k] + part * (speeds[k + 1] - speeds[k]), speeds[k + 1] >= speeds[k]];
  }

  /** Show where the run-up is: in words, as a line over the pictures, and as a dot on the amplitudes. */
  point() {
    if (!this.content) return;
    const [speed, rises] = this.speedAt(this.at), unit = /\[(.*)\]/.exec($("x").selectedOptions[0]?.title ?? "")?.[1] ?? "";
    const way = rises ? "rising" : "falling", level = this.level();
    $("heard-now").textContent = `${this.at.toFixed(1)} s of ${this.lasts.toFixed(1)} · ${`${Number(speed.toPrecision(4))} ${this.isOver ? unit : ""}`.trim()}, ${way}${level}`;
    $("heard-at").setAttribute("aria-valuetext", $("heard-now").textContent);
    const line = $("heard-line"), dot = $("heard-dot"), { axes } = this;
    const left = this.isOver ? axes.xaxis._offset + axes.xaxis.l2p(speed) : -1, inside = left >= axes?.xaxis._offset && left <= axes.xaxis._offset + axes.xaxis._length;
    line.hidden = !inside;
    dot.hidden = true;
    if (!inside) return;
    const diagram = $("diagram"), panels = $("below").childElementCount ? $("below") : $("heard-panels");
    Object.assign(line.style, { left: `${diagram.offsetLeft + left}px`, top: `${diagram.offsetTop + axes.yaxis._offset}px`, height: `${panels.offsetTop + panels.offsetHeight - 18 - diagram.offsetTop - axes.yaxis._offset}px` });
    const height = this.amplitude(speed, way);
    if (height !== null) Object.assign(dot.style, { left: `${left}px`, top: `${axes.yaxis._offset + axes.yaxis.l2p(height)}px` });
    dot.hidden = height === null;
    this.showMap(rises);
  }

  /** The map of the leg that is heard, unless a measured one is shown. */
  showMap(rises) {
    const { maps } = this.found ?? { maps: [] }, shown = maps[Number($("heard-map").value) || 0];
    if (!this.source || !shown || shown.measured || shown.rises === rises) return;
    const other = maps.findIndex((map) => !map.measured && map.rises === rises);
    if (other < 0) return;
    $("heard-map").value = other;
    this.draw();
  }

  /** The level of the last tenth of a second against the loudest one. */
  level() {
    if (!this.own) return "";
    const { rate } = this.values, end = Math.round(this.at * rate), part = this.own.subarray(Math.max(0, end - rate / 10), Math.max(1, end));
    this.most ??= new Map();
    if (this.most.of !== this.own) Object.assign(this.most, { of: this.own, level: loudestOf(this.own, rate) });
    const now = levelOf(part);
    return now > 0 ? ` · −${decibels(this.most.level / now).replace("-", "")}` : "";
  }

  /** The amplitude in the period at a speed, over the axes of the diagram; null if they show none. */
  amplitude(speed, way) {
    const layer = (this.answer.layers ?? []).find(({ axes: [x, y], look }) => x === this.x && y === $("y").value && look === way);
    if (!layer) return null;
    let best = null, away = Infinity;
    layer.x.forEach((v, k) => { if (Math.abs(v - speed) < away) [away, best] = [Math.abs(v - speed), layer.y[k]]; });
    return best;
  }
}

/** The largest level of all tenths of a second. */
function loudestOf(values, rate) {
  let most = 0;
  for (let k = 0; k < values.length; k += rate / 10) most = Math.max(most, levelOf(values.subarray(k, k + rate / 10)));
  return most || 1;
}

function isDark() {
  return matchMedia("(prefers-color-scheme: dark)").matches;
}
