// The values of the system: a slider and a field for each named parameter.

export class Parameters {
  constructor(list, filter) {
    this.list = list;
    filter.addEventListener("input", () => {
      const wanted = filter.value.toLowerCase();
      for (const row of list.children) row.hidden = !row.title.toLowerCase().includes(wanted) && !row.dataset.name.toLowerCase().includes(wanted);
    });
  }

  /** Show parameters: [{ name, value, words }]. */
  show(parameters) {
    this.base = new Map(parameters.map(({ name, value }) => [name, value]));
    this.rows = new Map();
    this.list.replaceChildren(...parameters.map((parameter) => this.row(parameter)));
  }

  /** Take other values as those from which changes count: those of the chosen point. */
  take(values) {
    for (const [name, value] of Object.entries(values)) {
      if (!this.rows.has(name)) continue;
      this.base.set(name, value);
      this.set(name, value);
    }
  }

  /** What differs from the values of the chosen point. */
  get changes() {
    const changes = {};
    for (const [name, { field }] of this.rows) {
      const value = Number(field.value);
      if (field.value !== "" && Number.isFinite(value) && value !== Number(this.base.get(name))) changes[name] = value;
    }
    return changes;
  }

  set(name, value) {
    const { field, slider, row } = this.rows.get(name);
    const reach = Math.abs(value) || 1;
    Object.assign(slider, { min: value - reach, max: value + reach, step: reach / 200 });
    slider.value = value;
    field.value = value;
    row.classList.remove("changed");
  }

  row({ name, value, words }) {
    const row = Object.assign(document.createElement("div"), { className: "parameter", title: words });
    row.dataset.name = name;
    const label = Object.assign(document.createElement("span"), { textContent: name === "frequency" ? "frequency Ω" : name });
    const field = Object.assign(document.createElement("input"), { type: "number", step: "any" });
    const slider = Object.assign(document.createElement("input"), { type: "range" });
    field.setAttribute("aria-label", words);
    slider.setAttribute("aria-label", `${words}, slider`);
    const changed = () => row.classList.toggle("changed", name in this.changes);
    slider.addEventListener("input", () => { field.value = Number(Number(slider.value).toPrecision(6)); changed(); });
    field.addEventListener("input", () => { slider.value = field.value; changed(); });
    row.append(label, field, slider);
    this.rows.set(name, { field, slider, row });
    this.set(name, value);
    return row;
  }
}
