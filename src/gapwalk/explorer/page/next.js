// What the chosen point means for the machine, and buttons for what can be done next from there.

import { get } from "./api.js";

const TAB = crypto.randomUUID?.() ?? String(Math.random());
const $ = (id) => document.getElementById(id);

export class Next {
  /** `steps`: a function for each kind of step, which is called with the values of the step; those without one are left out. */
  constructor(steps, tell) {
    Object.assign(this, { steps, tell });
  }

  /** Show what comes next at a chosen point; `isStill` returns true while it is chosen. */
  async ask(file, chosen, isStill) {
    try {
      this.request = new AbortController();
      const found = await get("/api/next", { file, ...chosen.start, tab: TAB }, this.request.signal);
      if (!isStill() || !found) return;
      this.show(found);
    } catch (error) {
      if (error.name === "AbortError" || !isStill()) return;
      this.clear();
      this.tell(error);
    }
  }

  /** A point was chosen, or none: what was said of another one no longer holds. */
  expect(chosen) {
    this.request?.abort();
    if (!chosen) return this.clear();
    $("next-text").textContent = "";
    for (const button of $("next-steps").children) button.disabled = true;
  }

  show({ text, steps }) {
    $("next").hidden = false;
    $("next-text").textContent = text;
    $("next-steps").replaceChildren(...steps.filter(({ do: word }) => word in this.steps).map(({ do: word, label, values }) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: label });
      button.dataset.step = word;
      button.addEventListener("click", () => this.steps[word](values));
      return button;
    }));
  }

  clear() {
    $("next").hidden = true;
  }
}
