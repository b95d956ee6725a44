// The numbers of a model text that are parameters: a slider and a field for each, which change its digits in the text.

import { breakable, unitOf } from "./dom.js";

const FEW = 8; // rows up to which nothing need be found among them

export class Sliders {
  /** `replace(number, digits)` changes the digits of a number in the text; it returns false if they are elsewhere by now. */
  constructor(list, filter, { replace }) {
    Object.assign(this, { list, filter, replace, rows: new Map(), numbers: [] });
    filter.addEventListener("input", () => this.find());
  }

  /** Show numbers: [{ name, words, value, unit, line, begin, end }]; rows that stay keep their focus. */
  show(numbers) {
    numbers = this.numbers = [...numbers].sort((a, b) => isDirection(a) - isDirection(b)); // they are rarely changed
    const names = new Set(numbers.map(({ name }) => name));
    for (const [name, { row }] of this.rows) if (!names.has(name)) { row.remove(); this.rows.delete(name); }
    numbers.forEach((number, place) => {
      if (!this.rows.has(number.name)) this.rows.set(number.name, this.row(number.name));
      const found = this.rows.get(number.name), { row } = found;
      if (this.list.children[place] !== row) this.list.insertBefore(row, this.list.children[place] ?? null);
      const before = found.number;
      found.number = number;
      found.label.replaceChildren(...breakable(/^frequency$|^speed$/.test(number.name) ? number.words : `${number.name}${unitOf(number.words)}`));
      found.home ??= number.value;
      row.title = number.words;
      found.field.setAttribute("aria-label", number.words);
      found.slider.setAttribute("aria-label", `${number.words}, slider`);
      if (before?.value !== number.value) this.set(found);
    });
    this.filter.parentElement.hidden = numbers.length <= FEW;
    this.find();
  }

  /** Take sliders away from use while the text has no numbers that could be found. */
  disable(isDisabled) {
    for (const { field, slider } of this.rows.values()) field.disabled = slider.disabled = isDisabled;
  }

  find() {
    const wanted = this.filter.value.toLowerCase();
    for (const { row, number } of this.rows.values()) row.hidden = !`${number.name} ${number.words}`.toLowerCase().includes(wanted);
  }

  /** Mark the rows of the numbers of a line, and bring them into view. */
  mark(line) {
    let first = null;
    for (const { row, number } of this.rows.values()) {
      row.classList.toggle("here", number?.line === line);
      if (number?.line === line) first ??= row;
    }
    if (!first || first.hidden) return;
    const { list } = this, top = first.offsetTop - list.offsetTop;
    if (top < list.scrollTop || top + first.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top - 8;
  }

  set({ field, slider, home, number: { value } }) {
    if (document.activeElement !== field || Number(field.value) !== value) field.value = value;
    if (document.activeElement === slider && Number(slider.value) === value) return; // it is being moved
    this.reach(slider, value, home);
  }

  /** Centre the range of a slider at a value, and widen it up to the value that the file had. */
  reach(slider, value, home) {
    const step = (Math.abs(value) || 1) / 200, to = (way) => step * Math.max(200, Math.ceil(way / step));
    Object.assign(slider, { min: value - to(value - home), max: value + to(home - value), step });
    slider.value = value;
  }

  row(name) {
    const row = Object.assign(document.createElement("div"), { className: "parameter" });
    row.dataset.name = name;
    const label = document.createElement("span");
    const field = Object.assign(document.createElement("input"), { type: "number", step: "any" });
    const slider = Object.assign(document.createElement("input"), { type: "range" });
    slider.addEventListener("input", () => this.write(name, Number(Number(slider.value).toPrecision(4)), field));
    // not at each "change": an arrow key makes one, and a step must stay the same
    for (const end of ["blur", "pointerup"]) slider.addEventListener(end, () => this.reach(slider, Number(field.value), this.rows.get(name).home));
    field.addEventListener("input", () => { if (Number.isFinite(field.valueAsNumber)) this.write(name, field.valueAsNumber, slider); });
    row.append(label, field, slider);
    return { row, label, field, slider, number: null };
  }

  /** Write a value into the text, and shift the places of the numbers behind it. */
  write(name, value, other) {
    const { number } = this.rows.get(name), digits = written(value, number.digits);
    if (!this.replace(number, digits)) return;
    const more = digits.length - (number.end - number.begin);
    for (const each of this.numbers) if (each.begin > number.begin) { each.begin += more; each.end += more; }
    Object.assign(number, { end: number.end + more, digits, value });
    other.value = value;
  }
}

/** A number says along what something acts. */
function isDirection({ name }) {
  return /\.(deflection|force|acts_on)\.[^.]+$/.test(name);
}

/** A number as it stands in a text: with a point if it had one. */
function written(value, before) {
  const text = String(value).replace("e+", "e");
  return /[.eE]/.test(before) && !/[.e]/.test(text) ? `${text}.0` : text;
}
