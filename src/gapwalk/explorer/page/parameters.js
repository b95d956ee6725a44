// The values of the system: a slider and a field for each named parameter.

import { breakable, unitOf } from "./dom.js";

export class Parameters {
  constructor(list, filter) {
    this.edited = new Set(); // names of the fields that were written into since a point was chosen
    this.list = list;
    filter.addEventListener("input", () => {
      const wanted = filter.value.toLowerCase();
      for (const row of list.children) row.hidden = !row.title.toLowerCase().includes(wanted) && !row.dataset.name.toLowerCase().includes(wanted);
    });
  }

  /** Show parameters: [{ name, value, words }]; `values` are those of the file, of all parameters if they are not too many. */
  show(parameters, values) {
    this.file = new Map([...parameters.map(({ name, value }) => [name, value]), ...Object.entries(values)]);
    this.base = new Map(this.file);
    this.rows = new Map();
    this.list.replaceChildren(...parameters.map((parameter) => this.row(parameter)));
  }

  /** Show other values: those of the chosen point, or of the file; but not in the fields of the names to keep. */
  take(values, keep = new Set()) {
    for (const [name, value] of Object.entries(values)) {
      this.base.set(name, value);
      if (this.rows.has(name) && !keep.has(name)) this.set(name, value);
    }
  }

  /** Write another value into the field of a parameter, as if it was typed. */
  turn(name, value) {
    if (!this.rows.has(name)) return;
    this.set(name, value);
    this.edited.add(name);
  }

  /** Return a function that brings back what stands in the fields now. */
  snapshot() {
    const values = new Map([...this.rows.keys()].map((name) => [name, this.value(name)])), edited = [...this.edited];
    return () => {
      for (const [name, value] of values) if (this.rows.has(name) && this.value(name) !== value) this.set(name, value);
      for (const name of edited) this.edited.add(name);
    };
  }

  /** Show the values of the file. */
  showFile() {
    for (const name of this.rows.keys()) this.set(name, this.file.get(name));
  }

  /** Other values of the file; fields that show those of a point, or were written into, stay as they are. */
  refile(values) {
    for (const [name, value] of Object.entries(values)) {
      const before = this.file.get(name);
      this.file.set(name, value);
      if (this.value(name) === before) this.take({ [name]: value });
    }
    for (const name of this.rows.keys()) this.mark(name);
  }

  /** What is shown for a parameter: what stands in its field. */
  value(name) {
    const { field, size = 1, shown } = this.rows.get(name) ?? {}, text = field?.value ?? "", value = Number(text) * size;
    if (shown?.text === text) return shown.value; // not converted forth and back
    return text !== "" && Number.isFinite(value) ? value : this.base.get(name);
  }

  /** What differs from the chosen point. */
  get changes() {
    return this.differences(this.base);
  }

  /** What differs from the file, but for the parameters that a study walks. */
  changesOfFile(walks = []) {
    const found = this.differences(this.file);
    for (const name of walks) delete found[name];
    return found;
  }

  differences(others) {
    return Object.fromEntries([...this.file.keys()].map((name) => [name, this.value(name)]).filter(([name, value]) => value !== others.get(name)));
  }

  /** Mark a row whose value is not that of the file. */
  mark(name) {
    const { row, field, words, size } = this.rows.get(name), other = this.value(name) !== this.file.get(name);
    field.title = field.value; // it may have more digits than there is room for
    row.classList.toggle("changed", other);
    row.title = other ? `${words}; ${inUnit(this.file.get(name), size)} in the file` : words;
  }

  set(name, value) {
    const known = this.rows.get(name), { field, slider } = known, written = inUnit(value, known.size);
    const reach = Math.abs(written) || 1;
    Object.assign(slider, { min: written - reach, max: written + reach, step: reach / 200 });
    slider.value = written;
    field.value = written;
    known.shown = { text: field.value, value };
    this.mark(name);
  }

  row({ name, value, words: title, written: words = title, size = 1 }) {
    const row = Object.assign(document.createElement("div"), { className: "parameter", title: words });
    row.dataset.name = name;
    const label = document.createElement("span");
    label.append(...breakable(name === "frequency" ? words.replace("excitation ", "") : `${name}${unitOf(words)}`));
    const field = Object.assign(document.createElement("input"), { type: "number", step: "any" });
    const slider = Object.assign(document.createElement("input"), { type: "range" });
    field.setAttribute("aria-label", words);
    slider.setAttribute("aria-label", `${words}, slider`);
    const changed = () => this.mark(name);
    slider.addEventListener("input", () => { field.value = Number(Number(slider.value).toPrecision(6)); this.edited.add(name); changed(); });
    field.addEventListener("input", () => { slider.value = field.value; this.edited.add(name); changed(); });
    row.append(label, field, slider);
    this.rows.set(name, { field, slider, row, words, size });
    this.set(name, value);
    return row;
  }
}

/** A value of results in the unit of the file, one of which is `size` units of results. */
function inUnit(value, size) {
  return size === 1 ? value : Number((value / size).toPrecision(12));
}
