// The list of results: state of each, its buttons, and its files.

const WORDS = { queued: "waits", running: "is being computed", paused: "is paused", done: "", stopped: "was stopped", failed: "failed" };
const SAVES = [
  ["table", "CSV", "Save the points as a table"],
  ["script", "Python", "Save the Python script that repeats it"],
  ["model", "Model", "Save a model file that walks from the chosen point"],
  ["result", "Result", "Save the result file"],
];

/** Show the results; `act(word, result)` is called by the buttons; `model` is the mark of the file as it is now. */
export function showResults(list, results, act, model) {
  const focused = document.activeElement?.dataset?.action;
  list.replaceChildren(...results.map((result) => item(result, act, model)));
  if (focused) list.querySelector(`[data-action="${CSS.escape(focused)}"]`)?.focus();
}

/** True if a result belongs to an earlier state of the file. */
export function isEarlier(result, model) {
  return Boolean(model && result.model && result.model !== model);
}

function item(result, act, model) {
  const li = document.createElement("li");
  li.dataset.key = result.key;
  li.dataset.state = result.state;
  const points = result.branches.reduce((sum, branch) => sum + branch.points, 0);
  const loci = result.branches.filter(({ second }) => second).length, branches = result.branches.length - loci;
  const parts = [[branches, "branch", "branches"], [loci, "locus", "loci"], [points, "point", "points"]];
  const counts = parts.filter(([number]) => number).map((part) => count(...part)).join(", ");
  const state = [WORDS[result.state], counts].filter(Boolean).join(": ");
  li.append(text("div", "", result.title), text("div", `state ${result.state}`, state));
  if (isEarlier(result, model)) {
    const note = text("div", "earlier", `of an earlier model (${result.model})`);
    note.title = "The file has been edited since. The Python script and the result file have the model as it was.";
    li.append(note);
  }
  if (result.message) li.append(text("div", `message ${result.state}`, result.message));
  if (result.state === "running") {
    const bar = document.createElement("progress");
    bar.setAttribute("aria-label", `progress of ${result.title}`);
    if (result.done[1]) [bar.value, bar.max] = result.done;
    li.append(bar);
  }
  const buttons = document.createElement("div");
  const add = (word, label, about) => {
    const button = text("button", "quiet", label);
    Object.assign(button, { type: "button", title: about });
    button.dataset.action = `${result.key} ${word}`;
    button.addEventListener("click", () => act(word, result));
    buttons.append(button);
  };
  if (result.state === "running") add("pause", "Pause", "Pause it; it can continue later");
  if (result.state === "paused") add("continue", "Continue", "Continue it");
  if (["running", "paused", "queued"].includes(result.state)) add("stop", "Stop", "Stop it; what it has found is stored");
  if (result.can_resume && result.state === "stopped") add("resume", "Resume", "Continue where it was stopped");
  if (["done", "stopped"].includes(result.state)) {
    if (result.settled || result.answer || result.branches.length) add("show", "Show", result.settled ? "Show the settled motion" : result.answer ? "Show the answer, with its picture" : "Show the diagram, or the plane, of this result");
    for (const [word, ...labels] of SAVES) if (result.saves.includes(word)) add(word, ...labels);
  }
  li.append(buttons);
  return li;
}

function text(name, kind, content) {
  return Object.assign(document.createElement(name), { className: kind, textContent: content });
}

function count(number, one, many) {
  return `${number} ${number === 1 ? one : many}`;
}
