// What moves a special point most: a table in percent per percent, a knob to turn, and arrows in the diagram.

import { get } from "./api.js";

const TAB = crypto.randomUUID?.() ?? String(Math.random());
const $ = (id) => document.getElementById(id);
const ARROWS = 4; // drawn at once, besides that of the chosen parameter
const LISTED = 14; // rows before the others are asked for

export class Movers {
  /** `changed` is called when the arrows are others; `turn` with the name and the new value of a turned parameter. */
  constructor({ changed = () => {}, turn = null } = {}) {
    Object.assign(this, { changed, turn, found: null, place: null, name: "", all: false });
    $("movers-percent").addEventListener("input", () => this.draw());
    $("movers-set").addEventListener("click", () => this.turnKnob());
    $("movers").addEventListener("toggle", () => (this.isOpen && this.wanted ? this.ask(...this.wanted) : this.changed()));
    $("movers-all").addEventListener("click", () => { this.all = true; this.draw(); });
  }

  /** Switched on: only then is anything computed, and drawn into the diagram. */
  get isOpen() {
    return $("movers").open;
  }

  open() {
    $("movers").open = true;
  }

  get percent() {
    const value = $("movers-percent").valueAsNumber;
    return Number.isFinite(value) ? value : 1;
  }

  /** Show the gradient of a point; `place` returns where it is in the diagram: [x, y], or null. */
  show(found, place) {
    Object.assign(this, { found, place, all: false, name: found.rows?.[0]?.name ?? "" });
    this.draw();
  }

  /** Make room for a chosen point, if it can have a gradient. */
  expect(chosen) {
    this.request?.abort();
    this.wanted = null;
    if (!chosen) return this.clear();
    this.found = null;
    $("movers").hidden = false;
    $("panels").classList.remove("bare");
    $("movers-text").textContent = chosen.special?.has_locus ? "It is being computed …" : "Of a special point it is listed here: a fold, a flip, a graze.";
    $("movers-knob").hidden = $("movers-all").hidden = true;
    $("movers-table").replaceChildren();
    this.changed();
  }

  /** Compute and show the gradient of a chosen point, if it can have one. */
  async ask(file, chosen, isStill) {
    if (!chosen?.special?.has_locus) return;
    this.wanted = this.isOpen ? null : [file, chosen, isStill];
    if (!this.isOpen) return;
    let found;
    try {
      this.request = new AbortController();
      found = await get("/api/gradient", { file, ...chosen.start, tab: TAB }, this.request.signal);
    } catch (error) {
      if (error.name === "AbortError") return;
      found = { reason: error.message };
    }
    if (!isStill()) return;
    if (!found) return this.clear();
    this.show(found, () => { const at = chosen.curve?.special[chosen.start.special]; return at ? [at.x, at.y] : null; });
  }

  clear() {
    if ($("movers").hidden && !this.found) return;
    this.found = null;
    $("movers").hidden = true;
    $("panels").classList.remove("bare");
    this.changed();
  }

  draw() {
    const { found } = this;
    if (!found) return;
    $("movers").hidden = false;
    if ($("panels").hidden) { // a point of an answer that is on no branch, without a motion
      $("panels").hidden = false;
      $("panels").classList.add("bare");
    }
    $("movers-knob").hidden = Boolean(found.reason);
    $("movers-text").textContent = found.reason ?? `${found.symbol} = ${short(found.at)} ${found.unit}`.trim();
    $("movers-set").hidden = !this.turn || found.rows?.find(({ name }) => name === this.name)?.value === null;
    $("movers-table").replaceChildren(...(found.reason ? [] : [this.table()]));
    $("movers-all").hidden = Boolean(found.reason) || this.all || found.rows.length <= LISTED;
    this.changed();
  }

  table() {
    const { found, percent } = this, made = document.createElement("table"), head = made.createTHead().insertRow(), body = made.createTBody();
    for (const text of ["parameter", "% per %", `${signed(percent)} % moves it by${found.unit ? ` [${found.unit}]` : ""}`]) head.append(Object.assign(document.createElement("th"), { textContent: text }));
    const largest = Math.abs(found.rows[0]?.share ?? 0) || 1;
    for (const row of this.all ? found.rows : found.rows.slice(0, LISTED)) {
      const line = body.insertRow(), pick = Object.assign(document.createElement("button"), { type: "button", className: "quiet" });
      pick.append(...row.name.split(/(?<=[._])/).flatMap((part) => [part, document.createElement("wbr")]));
      line.dataset.name = row.name;
      line.className = row.name === this.name ? "chosen" : "";
      pick.setAttribute("aria-pressed", row.name === this.name);
      pick.title = row.value === null ? row.words : `${row.words}: ${short(row.value)} ${row.unit}`.trim();
      pick.addEventListener("click", () => this.choose(row.name));
      line.insertCell().append(pick);
      const share = line.insertCell(), bar = Object.assign(document.createElement("i"), { className: row.share < 0 ? "less" : "more" });
      bar.style.width = `${(36 * Math.abs(row.share ?? 0)) / largest}px`;
      share.append(row.share === null ? "–" : signed(row.share, 3), bar);
      line.insertCell().textContent = signed(this.shift(row), 4);
      if (row.doubtful) line.title = "not accurate to four digits: a contact grazes near the point";
    }
    return made;
  }

  choose(name) {
    this.name = name;
    this.draw();
    $("movers-table").querySelector(`[data-name="${CSS.escape(name)}"] button`)?.focus();
  }

  /** By how much the chosen percentage of a parameter moves the point. */
  shift(row) {
    return ((row.move ?? row.slope * row.value) * this.percent) / 100;
  }

  turnKnob() {
    const row = this.found?.rows.find(({ name }) => name === this.name);
    if (row) this.turn(row.name, row.value * (1 + this.percent / 100));
  }

  /** The arrows over the axes x and y: [{ from: [x, y], to: [x, y], text, chosen }]; none if neither is the parameter. */
  arrows(x, y) {
    const { found } = this, at = found && !found.reason && this.isOpen ? this.place?.() : null;
    if (!at || (x !== found.parameter && y !== found.parameter)) return [];
    const moving = found.rows.filter(({ share }) => share), shown = moving.filter((row, k) => k < ARROWS || row.name === this.name);
    return shown.map((row) => {
      const shift = this.shift(row), to = [x, y].map((name, k) => at[k] + (name === found.parameter ? shift : 0));
      return { from: at, to, text: `${clipped(row.name)} ${signed(this.percent)} %`, chosen: row.name === this.name };
    });
  }
}

/** A long name with its parts cut short, for a label in the diagram; the table has all of it. */
function clipped(name) {
  return name.length > 24 ? name.split(".").map((part) => (part.length > 11 ? `${part.slice(0, 10)}…` : part)).join(".") : name;
}

function signed(value, digits = 4) {
  const text = short(value, digits);
  return value > 0 ? `+${text}` : text.replace("-", "−");
}

function short(value, digits = 7) {
  if (value !== 0 && (Math.abs(value) >= 1e7 || Math.abs(value) < 1e-4)) return value.toExponential(2);
  return String(Number(value.toPrecision(digits)));
}
