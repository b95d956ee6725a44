// The model editor: a text with its errors, the machine that it describes, its numbers as sliders, and its response.

import { post, stream } from "./api.js";
import { save } from "./dom.js";
import { LiveChart, LiveShares } from "./live_chart.js";
import { MachineView, stillOf } from "./machine.js";
import { ModelText } from "./model_text.js";
import { Sliders } from "./sliders.js";

const $ = (id) => document.getElementById(id);
const BETWEEN = 250; // milliseconds from one check to the next while one types: at most four a second
const MOVING = 50; // the same while a slider moves, and the curve with it
const PATIENCE = 1000; // milliseconds that a walk may take before another step of a slider begins the next one

export class Editor {
  /** `saved(name, compute)` is called after a save, `closed()` when the results are wanted again, `files()` returns names. */
  constructor({ saved, closed, files }) {
    Object.assign(this, { saved, closed, files, name: "", stamp: "", kept: "", checks: 0, last: -Infinity });
    this.drafts = new Map(); // texts that were left without being saved, by the names of their files
    this.text = new ModelText($("edit-text"), { changed: (why) => this.later(why), moved: (line) => this.sliders?.mark(line) });
    this.sliders = new Sliders($("edit-values"), $("edit-filter"), { replace: (...change) => this.replace(...change) });
    this.chart = new LiveChart($("edit-response"), $("edit-response-note"), (curve) => this.drawn(curve));
    const locus = new LiveChart($("edit-locus"), $("edit-locus-note"), "Followed exactly, with its points of codimension two as stars.");
    const shares = new LiveShares($("edit-shares"), $("edit-shares-note"), { field: $("edit-at"), box: $("edit-shares-box") });
    this.live = { response: this.chart, locus, shares };
    for (const kind of ["locus", "shares"]) $(`edit-${kind}-more`).addEventListener("toggle", () => this.choosePlace(this.at));
    $("edit-at").addEventListener("change", () => this.choosePlace($("edit-at").valueAsNumber));
    $("edit-response").addEventListener("click", (event) => { if ($("edit-shares-more").open) this.choosePlace(this.chart.valueAt(event)); });
    this.machine = new MachineView($("edit-machine"), { moved: () => {}, chosen: (part) => this.text.go(this.lineOf(part)), canChoose: (part) => this.lineOf(part) > 0 });
    const click = (id, act) => $(id).addEventListener("click", () => Promise.resolve(act()).catch((error) => this.say(error.message, true)));
    click("edit-save", () => this.save());
    click("edit-run", () => this.save({ compute: true }));
    click("edit-replace", () => this.save({ ...this.wanted, over: true }));
    click("edit-new", () => this.choose());
    click("edit-undo", () => this.text.undo());
    click("edit-redo", () => this.text.redo());
    click("edit-export", () => save(new Blob([this.text.text], { type: "application/toml" }), this.fullName()));
    click("edit-close", () => this.close());
    $("edit-name").addEventListener("input", () => { this.conflict = ""; this.tell(); });
    $("editor").addEventListener("keydown", (event) => {
      if (event.key === "Escape" && !$("edit-starts").hidden) return this.back();
      if (!(event.ctrlKey || event.metaKey) || !["s", "Enter"].includes(event.key)) return;
      event.preventDefault();
      $(event.key === "s" ? "edit-save" : "edit-run").click();
    });
    window.addEventListener("beforeunload", (event) => { if ((this.isOpen && this.isChanged) || this.drafts.size) event.preventDefault(); });
  }

  get isOpen() {
    return !$("editor").hidden;
  }

  get isChanged() {
    return this.text.text !== this.kept;
  }

  /** Edit a file; a text of it that was left without being saved is there again. */
  async open(name) {
    const draft = this.drafts.get(name), found = draft ?? (await post("/api/edit/open", { file: name }));
    this.show();
    this.take(found.text, name, found.stamp, found.kept);
  }

  /** Choose what a new model begins with. */
  async choose() {
    const { starts } = await post("/api/edit/starts", {});
    if (this.isOpen) this.leave();
    this.show();
    $("edit-starts").hidden = false;
    $("editor").classList.add("choosing");
    const drafts = [...this.drafts.keys()].map((name) => ({ name, title: name, text: "your text that is not saved", isDraft: true }));
    $("edit-starts-list").replaceChildren(...[...drafts, ...starts].map(({ name, title, text, machine, isDraft }) => {
      const card = Object.assign(document.createElement("button"), { type: "button" }), item = document.createElement("li");
      card.append(...[["b", title], ["span", text]].map(([tag, words]) => Object.assign(document.createElement(tag), { textContent: words })));
      if (machine) card.append(stillOf(machine, 230));
      card.dataset.start = name;
      card.addEventListener("click", () => (isDraft ? this.open(name) : this.start(name)).catch((error) => this.say(error.message, true)));
      item.append(card);
      return item;
    }));
    $("edit-starts-list").querySelector("button").focus();
  }

  /** Begin a new model; its text is not kept anywhere before it is saved. */
  async start(start) {
    const { text } = await post("/api/edit/start", { file: "", start });
    const names = new Set(this.files()), stem = start === "template" ? "model" : start;
    let name = `${stem}.toml`;
    for (let i = 2; names.has(name) || this.drafts.has(name); i++) name = `${stem}-${i}.toml`;
    this.take(text, name, "");
    this.text.field.focus();
  }

  /** Go back to where a new model was asked for: the text, or the results. */
  back() {
    if (!this.name) return this.close();
    this.drafts.delete(this.name);
    this.endChoice();
    this.text.field.focus();
  }

  /** Choose the value at which random starts are sorted; null for that of the model. */
  choosePlace(value) {
    this.at = Number.isFinite(value) ? value : null;
    if (this.isOpen && this.found?.system) this.later("shown");
  }

  /** The kinds of live answers that are shown; that a text has no locus is known only after its check. */
  get kinds() {
    return Object.keys(this.live).filter((kind) => kind === "response" || $(`edit-${kind}-more`).open);
  }

  /** What the chart of the response shows, and what Compute does. */
  drawn({ looks }) {
    const settled = looks.filter((look) => look === "settled").length, runs = `Compute runs: ${this.found?.plans[0] ?? "the study"}.`;
    if (!settled) return `A quick walk to one hundredth, with its special points. ${runs}`;
    const walked = settled < looks.length ? " where no periodic motion could be followed; the rest is a quick walk to one hundredth" : "";
    return `Grey: settled motions, simulated at steps of the range${walked}. ${runs}`;
  }

  endChoice() {
    $("edit-starts").hidden = true;
    $("editor").classList.remove("choosing");
  }

  take(text, name, stamp, kept = text) {
    this.drafts.delete(name);
    this.endChoice();
    [this.name, this.stamp, this.kept, this.conflict, this.found] = [name, stamp, kept, "", null];
    $("edit-name").value = name;
    this.sliders.show([]);
    for (const each of Object.values(this.live)) each.clear();
    this.at = null;
    this.text.show(text);
    this.tell();
  }

  show() {
    $("editor").hidden = false;
    document.body.classList.add("editing");
    $("edit-open").setAttribute("aria-pressed", true);
  }

  close() {
    this.hide();
    this.closed();
  }

  /** Keep a text that is not saved, as long as the page is open. */
  leave() {
    const { text } = this.text;
    if (text && this.isChanged) this.drafts.set(this.name, { text, stamp: this.stamp, kept: this.kept });
  }

  hide() {
    this.leave();
    this.request?.abort();
    clearTimeout(this.timer);
    this.timer = undefined;
    $("editor").hidden = true;
    document.body.classList.remove("editing");
    $("edit-open").setAttribute("aria-pressed", false);
  }

  fullName() {
    const name = $("edit-name").value.trim() || "model";
    return name.endsWith(".toml") ? name : `${name}.toml`;
  }

  /** Save the text, also one with errors; `over`: replace whatever is there. */
  async save({ compute = false, over = false } = {}) {
    const name = this.fullName(), text = this.text.text, stamp = over ? "*" : name === this.name ? this.stamp : "";
    if (compute && this.found?.problems.length) return this.say("Correct the problems first; Save keeps the text as it is.", true);
    this.wanted = { compute };
    const found = await post("/api/edit/save", { file: name, text, stamp });
    this.conflict = found.conflict ?? "";
    if (this.conflict) return this.tell();
    [this.name, this.stamp, this.kept] = [name, found.stamp, text];
    $("edit-name").value = name;
    this.tell();
    if (compute) this.hide();
    await this.saved(name, compute);
  }

  /** Change the digits of a number, if they are where the last check has found them. */
  replace(number, digits) {
    if (this.text.text.slice(number.begin, number.end) !== number.digits) return false;
    this.text.replace(number.begin, number.end, digits, number.name);
    return true;
  }

  /** Check the text soon, at most four times a second; while a slider moves, as often as the curve has moved too. */
  later(why) {
    this.tell();
    $("edit-undo").disabled = !this.text.past.length;
    $("edit-redo").disabled = !this.text.future.length;
    this.isHasty = ["typed", "shown", "undone"].includes(why);
    const check = () => {
      const isEarly = this.isBusy && !this.isHasty && performance.now() < this.last + PATIENCE;
      this.timer = isEarly ? setTimeout(check, 20) : undefined;
      if (!isEarly) this.check().catch((error) => this.say(error.message, true));
    };
    this.timer ??= setTimeout(check, Math.max(0, this.last + (this.isHasty ? BETWEEN : MOVING) - performance.now()));
  }

  /** Check the text, and show its response as it grows; an earlier check is given up. */
  async check() {
    this.last = performance.now();
    this.request?.abort();
    const request = (this.request = new AbortController()), { text } = this.text;
    let isFirst = true, hasMoved = false;
    this.isBusy = true;
    try {
      for await (const news of stream("/api/edit/check", { file: this.fullName(), text, live: this.kinds, at: this.at }, request.signal)) {
        if (request.signal.aborted) return;
        hasMoved ||= Boolean(news.moved);
        if (isFirst) this.showCheck(news, text);
        else if (news.coarse) { if (hasMoved) this.isBusy = false; }
        else this.live[news.of].take(news);
        if (news.of === "shares" && news.title) { this.chart.at = news.title.at; this.chart.draw(); }
        isFirst = false;
        if (news.of === "response" && "end" in news) document.body.dataset.walked = ++this.checks;
      }
    } catch (error) {
      if (error.name !== "AbortError") throw error;
    } finally {
      if (this.request === request) this.isBusy = false;
    }
  }

  showCheck(found, text) {
    const { problems, numbers, machine, lines } = found;
    this.found = found;
    this.text.mark(problems);
    if (!problems.length) $("edit-locus-more").parentElement.hidden = !found.locus;
    if (!$("edit-shares-more").open) this.chart.at = null;
    $("edit-problems").replaceChildren(...problems.map(({ line, text: words }) => this.problem(line, words)));
    if (lines) this.lines = lines;
    if (numbers && text === this.text.text) {
      const known = new Set(this.sliders.numbers.map(({ name }) => name)); // while the model has errors, those of before
      const own = found.system ? numbers : numbers.filter(({ name }) => known.has(name));
      this.sliders.show(own.map((each) => ({ ...each, digits: text.slice(each.begin, each.end), words: found.system ? each.words : this.wordsOf(each) })));
    }
    this.sliders.disable(!numbers);
    if (machine) this.machine.rest(machine);
    $("edit-machine-figure").classList.toggle("stale", !machine);
    for (const each of problems.length ? Object.values(this.live) : []) {
      each.place.classList.add("stale");
      each.note.textContent = `${each.place.childElementCount ? "Of an earlier text; it" : "It"} is computed again once the text has no errors.`;
    }
    $("edit-plan").textContent = [...found.plans, ...found.warnings.map((each) => `Warning: ${each}.`)].join("\n");
    this.tell();
    document.body.dataset.checked = Number(document.body.dataset.checked ?? 0) + 1;
  }

  wordsOf({ name }) {
    return this.sliders.numbers.find((each) => each.name === name)?.words ?? name;
  }

  problem(line, words) {
    const item = document.createElement("li");
    if (line) {
      const button = Object.assign(document.createElement("button"), { type: "button", className: "quiet", textContent: `line ${line}` });
      button.addEventListener("click", () => this.text.go(line));
      item.append(button, " ");
    }
    item.append(words);
    return item;
  }

  /** The line of the table of a part of the drawing; 0 if it has none. */
  lineOf({ name = "", contact, kind, words }) {
    const { lines } = this;
    if (!lines) return 0;
    const own = [contact, name, name.split(/[ ,.]/)[0], words.split(/[ ,:;]/)[0]].find((each) => each && each in lines);
    return lines[own] ?? lines[{ spring: "stiffness", damper: "damping", body: "coordinates" }[kind]] ?? 0;
  }

  /** Say how the text is: its errors, and whether it is saved, or why not. */
  tell() {
    $("edit-replace").hidden = !this.conflict;
    if (this.conflict) return this.say(this.conflict, true);
    const count = this.found?.problems.length ?? 0;
    const state = count ? `${count} ${count === 1 ? "problem" : "problems"}` : this.found ? "No errors" : "";
    const kept = !this.stamp ? "not saved yet" : this.isChanged ? "not saved since the last change" : "saved";
    this.say([state, kept].filter(Boolean).join(", ") + ".", count > 0);
  }

  say(words, bad = false) {
    $("edit-status").textContent = words;
    $("edit-status").classList.toggle("failed", bad);
  }
}
