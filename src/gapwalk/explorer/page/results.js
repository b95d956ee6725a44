// The list of results: what each one is, how it is drawn, its buttons, and its files.

export const WORDS = { queued: "waits", running: "is being computed", paused: "is paused", done: "", stopped: "was stopped", failed: "failed" };
const OVER = ["done", "stopped", "failed"];
const SAVES = [
  ["table", "CSV", "Save the points as a table"],
  ["bands", "CSV of settled", "Save the settled motions as a table"],
  ["script", "Python", "Save the Python script that repeats it"],
  ["model", "Model", "Save a model file that walks from the chosen point"],
  ["result", "Result", "Save the result file"],
];
const DRAWN = [["full", "drawn"], ["pale", "pale"], ["hidden", "hidden"]];
const COLOURS = [["", "by stability"], ...["blue", "orange", "green", "purple", "red", "grey"].map((name) => [name, name])];

/** True if a result belongs to an earlier state of the file. */
export function isEarlier(result, model) {
  return Boolean(model && result.model && result.model !== model);
}

export class ResultList {
  /** `act(word, result)` is called by the buttons, `change(result, changes)` when a result gets another name or look. */
  constructor(list, { act, change }) {
    Object.assign(this, { list, act, change, items: new Map(), renamed: null });
  }

  /** Show the results; `model` is the mark of the file as it is now. What has not changed stays, with its focus. */
  show(results, model) {
    const there = new Set(results.map(({ key }) => key)), focused = document.activeElement?.dataset?.action;
    for (const [key, { li }] of this.items) if (!there.has(key)) { li.remove(); this.items.delete(key); }
    results.forEach((result, place) => {
      const text = JSON.stringify([result, model]), old = this.items.get(result.key);
      let li = old?.li;
      if (old?.text !== text && this.renamed !== result.key) {
        li = merged(old?.li, this.item(result, model));
        this.items.set(result.key, { text, li, result });
      }
      if (this.list.children[place] !== li) this.list.insertBefore(li, this.list.children[place] ?? null);
    });
    if (focused && document.activeElement?.dataset?.action !== focused) this.list.querySelector(`[data-action="${CSS.escape(focused)}"]`)?.focus();
  }

  item(result, model) {
    const li = document.createElement("li"), { key, state } = result;
    Object.assign(li.dataset, { key, state, drawn: result.drawn });
    const title = text("div", "name", result.title);
    title.title = result.automatic;
    li.append(title);
    if (result.verdict) li.append(text("div", "verdict", result.verdict));
    const told = [WORDS[state], counts(result.branches), state === "running" && result.doing].filter(Boolean).join(": ");
    if (told) li.append(text("div", `state ${state}`, told));
    if (isEarlier(result, model)) {
      const note = text("div", "earlier", `of an earlier model (${result.model})`);
      note.title = "The file has been edited since. The Python script and the result file have the model as it was.";
      li.append(note);
    }
    if (result.message) li.append(Object.assign(text("div", `message ${state}`, result.message), { title: result.message }));
    if (state === "running") {
      const bar = document.createElement("progress");
      bar.setAttribute("aria-label", `progress of ${result.title}`);
      if (result.done[1]) bar.value = result.share;
      li.append(bar);
    }
    li.append(...this.rows(result));
    return li;
  }

  /** The rows of buttons of a result. */
  rows(result) {
    const { state } = result, buttons = text("div", "buttons", ""), saves = text("div", "saves", "");
    const add = (place, word, label, about, act = () => this.act(word, this.items.get(result.key).result)) => {
      const button = text("button", "quiet", label);
      Object.assign(button, { type: "button", title: about });
      button.dataset.action = `${result.key} ${word}`;
      button.addEventListener("click", act);
      place.append(button);
    };
    if (state === "running") add(buttons, "pause", "Pause", "Pause it; it can continue later");
    if (state === "paused") add(buttons, "continue", "Continue", "Continue it");
    if (["running", "paused", "queued"].includes(state)) add(buttons, "stop", "Stop", "Stop it; what it has found is stored");
    if (result.can_resume && state === "stopped") add(buttons, "resume", "Resume", "Continue where it was stopped");
    const has = result.settled || result.answer || result.branches.length;
    if (result.answer && ["running", "paused"].includes(state)) add(buttons, "show", "Show", "Show what is known of the answer");
    if (["done", "stopped"].includes(state)) {
      if (has) add(buttons, "show", "Show", result.settled ? "Show the settled motion" : result.answer ? "Show the answer, with its picture" : "Show the diagram, or the plane, of this result");
      for (const [word, ...labels] of SAVES) if (result.saves.includes(word)) add(saves, word, ...labels);
    }
    if (OVER.includes(state) && result.kind !== "opened") {
      add(buttons, "rename", "Rename", "Give it another name", () => this.rename(this.items.get(result.key)));
      add(buttons, "delete", "Delete", "Delete it; this can be undone", () => this.change(result, { deleted: true }));
    }
    const look = text("div", "look", "");
    if (has) look.append(this.select(result, "drawn", "How it is drawn", DRAWN), this.select(result, "colour", "Colour", COLOURS));
    return [buttons, look, saves].filter((row) => row.childElementCount);
  }

  select(result, name, label, options) {
    const made = document.createElement("select");
    made.append(...options.map(([value, words]) => new Option(words, value)));
    made.value = result[name];
    Object.assign(made.dataset, { action: `${result.key} ${name}`, value: result[name] });
    made.setAttribute("aria-label", `${label}: ${result.title}`);
    if (name === "colour") made.dataset.colour = result.colour;
    made.addEventListener("change", () => this.change(result, { [name]: made.value }));
    return made;
  }

  /** Have the name written in place of the title; nothing brings the automatic title back. */
  rename({ result, li }) {
    const title = li.querySelector(".name");
    const field = Object.assign(document.createElement("input"), { value: result.title, maxLength: 120, placeholder: result.automatic });
    field.setAttribute("aria-label", `Name of ${result.title}; empty for the automatic title`);
    this.renamed = result.key;
    let isOver = false;
    const end = (keep) => {
      if (isOver) return;
      isOver = true;
      this.renamed = null;
      field.replaceWith(title);
      const given = field.value.trim(), name = given === result.automatic ? "" : given;
      if (keep && (name || result.automatic) !== result.title) this.change(result, { name });
      this.items.get(result.key)?.li.querySelector(`[data-action$=" rename"]`)?.focus();
    };
    field.addEventListener("keydown", (event) => {
      if (!["Enter", "Escape"].includes(event.key)) return;
      event.preventDefault(); // it would press the button that has the focus next
      end(event.key === "Enter");
    });
    field.addEventListener("blur", () => end(true));
    title.replaceWith(field);
    field.select();
    field.focus();
  }
}

/** Take the parts of a new item that differ into the old one: a button that is being pressed stays. */
function merged(old, fresh) {
  if (!old) return fresh;
  if (old.childElementCount !== fresh.childElementCount) {
    old.replaceWith(fresh);
    return fresh;
  }
  Object.assign(old.dataset, fresh.dataset);
  [...fresh.children].forEach((part, place) => {
    if (old.children[place].outerHTML !== part.outerHTML) old.children[place].replaceWith(part);
  });
  return old;
}

/** Show what was deleted: `restore(each)` and `clean()` are called by the buttons. */
export function showDeleted(place, deleted, restore, clean) {
  place.hidden = !deleted.length;
  const said = JSON.stringify(deleted);
  if (place.dataset.said === said) return;
  place.dataset.said = said;
  place.querySelector("summary").textContent = `${deleted.length} deleted`;
  place.querySelector("ul").replaceChildren(...deleted.map((each) => {
    const li = document.createElement("li"), button = text("button", "quiet", "Restore");
    Object.assign(button, { type: "button", title: `Restore ${each.title}` }).addEventListener("click", () => restore(each));
    li.append(text("span", "", each.title), button);
    return li;
  }));
  place.querySelector("button.clean").onclick = clean;
}

/** The numbers of branches, loci and points. */
function counts(all) {
  const points = all.reduce((sum, branch) => sum + branch.points, 0);
  const loci = all.filter(({ second }) => second).length, parts = [[all.length - loci, "branch", "branches"], [loci, "locus", "loci"], [points, "point", "points"]];
  return parts.filter(([number]) => number).map(([number, one, many]) => `${number} ${number === 1 ? one : many}`).join(", ");
}

function text(name, kind, content) {
  return Object.assign(document.createElement(name), { className: kind, textContent: content });
}
