// The page: the chosen file, axes and point; the server holds everything else.

import { Answer, GROWING } from "./answer.js";
import { download, get, post } from "./api.js";
import { Choice } from "./choice.js";
import { Curves, takeLoci } from "./curves.js";
import { Depth } from "./depth.js";
import { Diagram } from "./diagram.js";
import { fill, save, unitOf } from "./dom.js";
import { editing } from "./editing.js";
import { Extras } from "./extras.js";
import { Heard } from "./heard.js";
import { Keyboard } from "./keyboard.js";
import { Looks } from "./looks.js";
import { MotionView } from "./motion.js";
import { Movers } from "./movers.js";
import { Next } from "./next.js";
import { Parameters } from "./parameters.js";
import { Quick } from "./quick.js";
import { isEarlier, ResultList, showDeleted, WORDS } from "./results.js";
import { RunUpControls } from "./runup.js";
import { CurveTable } from "./table.js";
import { Undo } from "./undo.js";

const $ = (id) => document.getElementById(id);

const page = { about: null, results: [], chosen: null, wanted: null }; // wanted: the result to show at its end
const curves = new Curves();
let updated = null; // the end of what is being fetched: for all who wait for it
const diagram = new Diagram($("diagram"), curves, (found) => choice.choose(found));
const motion = new MotionView(tell);
const parameters = new Parameters($("parameters"), $("filter"));
const keyboard = new Keyboard($("diagram"), curves, (found) => choice.choose(found), {
  w: walk, b: switchBranch, t: settle, l: followLocus, o: search, "+": () => diagram.zoom(0.5), "-": () => diagram.zoom(2), 0: () => diagram.fit(),
});
const answer = new Answer({ changed: drawDiagram, chosen: chooseEnd, sampled: (value) => diagram.sampled(value) });
answer.heard = new Heard({ diagram, tell, changed: drawDiagram, saved: (query) => download("/api/wav", query).catch(tell) });
const runUp = new RunUpControls(page, { act, tell, start: () => page.chosen?.start ?? null, values: () => parameters.changes });
const movers = new Movers({ changed: () => extras.drawArrows(), turn: turnKnob });
const next = new Next({ switch: switchBranch, locus: openLocus, settle: settleBeside, hear: () => motion.hear(), pin: () => motion.pin() }, tell);
const choice = new Choice(page, { curves, diagram, keyboard, motion }, { changed: showChosen, shown: showMotion });
const undo = new Undo($("undo"), tell);
const list = new ResultList($("results"), { act: actOn, change: changeResult });
const looks = new Looks(curves, diagram.lines, drawDiagram);
const editor = editing(page, { open, compute: () => compute(), redraw: () => diagram.ready && diagram.later(), tell });
const table = new CurveTable(page, curves, diagram, {
  choose: (found) => choice.choose(found), name: () => `${page.about?.file ?? "curve"}`.replace(/\.\w+$/, ""), tell,
});
const quick = new Quick({ begun: showQuickAxes, changed: drawDiagram });
diagram.pale = () => tell({ message: "The pale curve is a quick response: its points have no motions. Press Compute; then a click on the curve shows the motion there.", isHint: true });
diagram.settledAt = (index) => {
  const { parameter, at } = diagram.over.settled;
  choice.clear();
  page.settled = index;
  diagram.mark = diagram.placeOfSettled(index);
  table.draw();
  turnKnob(parameter, at[index]);
  tell({ message: `${diagram.settledLines(index).join("; ")}. Settle computes this motion from rest, with its history, spectrum and section.`, isHint: true });
};
diagram.sampled = (value) => {
  choice.clear();
  turnKnob($("x").value, value);
  const place = `${$("x").value} = ${Number(value.toPrecision(7))}`;
  if (page.sampling === place) return; // the second press of a double click
  page.sampling = place;
  setTimeout(() => { page.sampling = null; }, 1500);
  if ($("settle").disabled || page.about.problem || !page.names.has($("x").value) || page.names.has($("y").value)) return tell({ message: `The motions at ${place} are not stored. Click Settle to compute this motion, from rest (some seconds).`, isHint: true });
  settle();
  tell({ message: `The motions at ${place} are not stored: the one from rest, with the values on the left, is computed (as by Settle: some seconds), and is then shown.`, isHint: true });
};
const extras = new Extras($("legend"), curves, diagram, answer, movers);
const depth = new Depth({ page, curves, diagram, answer, tell, changed: changeAxes, choose: (found) => choice.choose(found) });

begin().catch(tell);

async function begin() {
  connect();
  const { files, first } = await get("/api/files");
  if (!files.length) return editor.choose();
  fill($("file"), files.map((name) => [name, name]));
  const { file, where } = addressed();
  $("file").value = files.includes(file) ? file : first && files.includes(first) ? first : files[0];
  await open($("file").value, where);
}

/** The file, axes and point of the address. */
function addressed() {
  const [file, where] = location.hash.slice(1).split("?");
  return { file: decodeURIComponent(file), where: new URLSearchParams(where) };
}

/** Write the file, the axes and the chosen point into the address, so that it opens with them. */
function address() {
  const { about, chosen } = page, where = new URLSearchParams();
  if (!about) return;
  for (const id of ["x", "y"]) if ($(id).value !== about[id]) where.set(id, $(id).value);
  if (chosen) where.set("at", chosen.key ? `${chosen.key}/${chosen.node}` : chosen.start.result);
  history.replaceState(null, "", `#${encodeURIComponent(about.file)}${where.size ? `?${where}` : ""}`);
}

/** Choose the point of an address: the key of its curve and its node, or the result of a settled motion. */
function chooseAddressed(at) {
  const end = at.lastIndexOf("/"), curve = curves.all.get(at.slice(0, end)), index = curve?.node.indexOf(Number(at.slice(end + 1))) ?? -1;
  if (index >= 0) choice.choose({ curve, index });
  else if (page.results.some(({ key, settled }) => key === at && settled)) choice.choose({ settled: at });
}

async function open(file, where = new URLSearchParams()) {
  page.about = null;
  quick.clear();
  forget();
  const about = await get("/api/about", { file });
  page.about = about;
  takeLoci(about.loci, $("legend"));
  showProblem();
  $("title").textContent = about.title;
  document.title = `${about.title} – gapwalk`;
  const names = about.parameters.map(({ name, words }) => [name, name === "frequency" ? words.replace("excitation ", "") : `${name}${unitOf(words)}`, words]);
  const measures = about.measures.map(({ name, words }) => [name, words.replace(/ \(.*\)/, ""), words]);
  fill($("x"), [...names, ...measures]);
  fill($("y"), [...measures, ...names]);
  fill($("walk-parameter"), names);
  fill($("locus-parameter"), names);
  fill($("signal"), about.signals);
  $("signal").value = about.signal;
  fill($("study"), about.studies.map(({ name, plan }) => [name, name || plan.split(" ")[0]]));
  $("study-row").hidden = about.studies.length < 2;
  page.names = new Set(names.map(([name]) => name));
  [$("x").value, $("y").value, $("walk-parameter").value] = [about.x, about.y, about.x];
  const others = names.map(([name]) => name).filter((name) => name !== about.x); // a load or a gap before an entry of a matrix
  $("locus-parameter").value = others.find((name) => /\.(amplitude|clearance)$/.test(name)) ?? others[0] ?? "";
  showPlan();
  motion.rest(about.machine);
  parameters.show(about.parameters, about.values);
  showWalkRange();
  showLocusRange();
  if ($("run-up-part").open) runUp.show();
  diagram.range = null;
  for (const id of ["x", "y"]) if ([...$(id).options].some(({ value }) => value === where.get(id))) $(id).value = where.get(id);
  address();
  await show(about.results, about.deleted);
  if (page.about?.file !== file) return;
  const last = about.results.findLast(({ answer, branches, state }) => (state === "done" && branches.length) || (answer && ["done", ...GROWING].includes(state))); // a settled motion lies over it
  if (last?.answer) await showAnswer(last, !where.size);
  if (where.has("at")) chooseAddressed(where.get("at"));
  if (!about.results.some(isDrawn) && !about.problem && file.endsWith(".toml")) quick.show(file);
}

/** A result has something to show: one that was stopped early has nothing. */
function isDrawn({ branches, answer, settled }) {
  return branches.length || answer || settled;
}

/** Open a file; one that cannot be opened leaves an empty page with the reason. */
function openOrTell(file, where) {
  return open(file, where).catch((error) => { drawDiagram(); list.show([], ""); tell(error); });
}

/** Show the quick response over its own axes. */
async function showQuickAxes(names) {
  if (names.every((name, k) => [...$(["x", "y"][k]).options].some(({ value }) => value === name))) await showAxes(...names);
}

/** Read the file again after an edit or a restart of the server; what is shown and chosen stays. */
async function refresh() {
  const { file, server } = page.about;
  const about = await get("/api/about", { file });
  if (page.about?.file !== file) return;
  page.about = about;
  if (about.server !== server) curves.versions.clear();
  const { value } = $("study");
  fill($("study"), about.studies.map(({ name, plan }) => [name, name || plan.split(" ")[0]]));
  if (about.studies.some(({ name }) => name === value)) $("study").value = value;
  $("study-row").hidden = about.studies.length < 2;
  if (!about.problem) parameters.refile(about.values);
  showPlan();
  showProblem();
  await show(about.results, about.deleted);
}

/** Show the errors of the file as long as it has any. */
function showProblem() {
  const { problem } = page.about;
  if (problem) tell(new Error(`${problem}\n\nEarlier results are shown; correct the file to compute more.`));
  else hideError();
}

function forget() {
  motion.pinned.pin(null);
  undo.clear();
  answer.clear();
  curves.clear();
  choice.clear();
}

/** Say how far a job is, for how long it has been computed, and how long the rest takes at the pace since it is seen. */
function showStatus(job, reached) {
  const [words, clock] = $("status").children;
  if (job?.key !== page.job) Object.assign(page, { job: job?.key, since: performance.now(), first: job?.share });
  clearInterval(page.ticking);
  words.textContent = job ? reached : "";
  $("status").title = job?.title ?? "";
  Object.assign($("status-stop"), { hidden: !job, title: `Stop ${job?.title}; what it has found is stored`, onclick: () => actOn("stop", job) });
  const tick = () => {
    const seconds = (performance.now() - page.since) / 1000, left = seconds * (1 - job?.share) / (job?.share - page.first);
    clock.textContent = job ? `${minutes(seconds)}${Number.isFinite(left) && left > 0 ? `, about ${minutes(left)} left` : ""}` : "";
  };
  tick();
  if (job) page.ticking = setInterval(tick, 1000);
}

function minutes(seconds) {
  return `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
}

/** Show the results; fetch the curves that have changed. */
async function show(results, deleted = page.deleted ?? []) {
  Object.assign(page, { results, deleted });
  if (results.some(isDrawn)) quick.clear();
  list.show(results, page.about?.model ?? "");
  showDeleted($("deleted"), deleted, restore, clean);
  const busy = results.filter((r) => ["running", "queued", "paused"].includes(r.state));
  const [first] = busy, points = first?.branches.reduce((s, b) => s + b.points, 0);
  showStatus(first, first?.done[1] && (!points || first.answer) ? `${Math.floor(100 * first.share)} % of the work` : `${points} points`);
  page.again = true;
  if (!page.updating) updated = update();
  await updated;
  enable();
  await showAnswers().catch(tell);
  markAnswer();
}

/** Fetch curves, over the axes of now, until there is nothing new. */
async function update() {
  page.updating = true;
  try {
    while (page.again) {
      page.again = false;
      const file = page.about?.file;
      if (!file) break;
      const fresh = await curves.update(file, axes(), isPlane(), looks.drawn(page.results));
      if (page.about?.file !== file) continue; // another file was opened meanwhile, and shows itself
      const turned = looks.mark(page.results, page.about.model);
      if (fresh) choice.keep();
      if (fresh || turned || !diagram.ready) drawDiagram();
      showEmpty();
    }
  } catch (error) {
    tell(error);
  } finally {
    page.updating = false;
  }
}

/** Show the answer that was asked for once it is there, and the shown one again if it has changed. */
async function showAnswers() {
  if (!page.about) return;
  const over = page.results.filter((r) => r.answer && r.state !== "failed");
  const wanted = over.find(({ key }) => key === page.wanted);
  const shown = over.find(({ key, state, answer: { reading } }) => key === answer.key && (reading !== answer.reading || GROWING.includes(state) !== answer.grows));
  const settled = page.results.find(({ key, settled, state }) => key === page.wanted && settled && state === "done");
  if (wanted || settled) page.wanted = null;
  if (settled) {
    if ($("error").classList.contains("hint-only")) hideError(); // that it is computed
    return choice.choose({ settled: settled.key }); // it opens with its motion
  }
  if (wanted) await showResult(wanted);
  else if (shown) await showAnswer(shown, false);
  else if (answer.key !== null && !page.results.some(({ key }) => key === answer.key)) answer.clear();
}

function drawDiagram() {
  const name = (id) => $(id).selectedOptions[0]?.title ?? "";
  diagram.names = { x: name("x"), y: name("y"), range: page.about?.range.length ? [...page.about.range].sort((a, b) => a - b) : null };
  looks.mark(page.results, page.about?.model ?? "");
  curves.quick = quick.over($("x").value, $("y").value);
  showEmpty(); // its lines leave the diagram less room
  diagram.draw();
  if (Number.isInteger(page.settled)) diagram.mark = diagram.over?.settled ? diagram.placeOfSettled(page.settled) : null;
  table.draw();
  extras.showLegend();
  extras.showPale();
  document.body.dataset.branches = curves.all.size;
}

/** Say of the shown answer that it is of an earlier model, and that another one is being computed. */
function markAnswer() {
  const own = page.results.find(({ key }) => key === answer.key), isOld = Boolean(own) && isEarlier(own, page.about?.model);
  const next = own && page.results.find(({ key, state }) => key === page.computed && key !== own.key && ["running", "queued", "paused"].includes(state));
  answer.mark([isOld && `of an earlier model (${own.model})`, next && `${next.title} ${WORDS[next.state]}, and will take its place`].filter(Boolean).join("; "));
}

/** Explain an empty diagram. */
function showEmpty() {
  const lacks = answer.lacks(...Object.values(axes()));
  $("empty").hidden = !page.about || !lacks && (curves.all.size + curves.settled.size > 0 || Boolean(answer.content));
  $("empty").classList.toggle("above", Boolean(curves.quick) || lacks);
  if (!$("empty").hidden) $("empty").replaceChildren(...whyEmpty());
}

function whyEmpty() {
  const over = page.results.filter(({ state }) => ["done", "stopped", "failed"].includes(state));
  const bold = (word) => Object.assign(document.createElement("b"), { textContent: word });
  if (answer.content) return ["Of settled motions, only amplitude, maximum, minimum and mean of the coordinates are stored: choose one of them, or a parameter."];
  const [refused] = over.every(({ state }) => state === "failed") ? over.slice(-1) : [];
  if (refused) return [bold(refused.title), ` has failed: ${refused.message}. `, pressed("Settle", "settle"), " shows the motion of the file at its values, be it periodic or not.", curves.quick ? " Pale: the quick response." : ""];
  const busy = page.results.find(({ state }) => ["running", "queued", "paused"].includes(state));
  if (busy && !over.length) return [bold(busy.title), ` ${WORDS[busy.state]}. `, curves.quick ? "Pale: a quick response, to one hundredth." : ""];
  const stored = storedBeside(), first = stored.length ? ["Stored results of this file: ", ...stored.flatMap(openLink), ". "] : ["Nothing is computed yet. "];
  if (curves.quick) return [...first, "Pale: a quick response, to one hundredth. ", pressed("Compute", "compute"), ` ${willDo()}.`, quick.note ? ` (${quick.note})` : ""];
  if (!over.length) return [...first, bold("Compute"), ` ${willDo()}.`, stored.length ? "" : quick.words];
  if (over.some(({ settled }) => settled)) return ["A motion that does not repeat itself has no place in the diagram. ", bold("Show"), ", in the list of results, shows it."];
  return ["Nothing of what was computed has a place over these axes; the list of results says what was found."];
}

/** What Compute does, in words: it runs the chosen study; a response is walked as far as there are orbits to follow. */
function willDo() {
  const { name, plan } = page.about.studies.find(({ name }) => name === $("study").value) ?? {};
  if (!plan) return "begins";
  if (!/^response/.test(plan)) return `runs the study${name ? ` ${name}` : ""}: ${plan}`;
  const walk = "follows the periodic motions exactly, with their special points";
  return curves.quick?.settles ? `${walk}, and where none can be followed it settles the motion at steps of the range` : walk;
}

/** A button that presses another one. */
function pressed(words, id) {
  const made = Object.assign(document.createElement("button"), { type: "button", className: "quiet", textContent: words });
  made.addEventListener("click", () => $(id).click());
  return made;
}

/** Results of `gapwalk run` beside the model: model.gapwalk, or model-study.gapwalk. */
function storedBeside() {
  const stem = page.about?.file.replace(/\.toml$/, "");
  return [...$("file").options].map(({ value }) => value).filter((name) => name === `${stem}.gapwalk` || (name.startsWith(`${stem}-`) && name.endsWith(".gapwalk")));
}

/** A link that opens a file in place of the model, after a comma if it is not the first. */
function openLink(name, index) {
  const link = Object.assign(document.createElement("a"), { href: `#${encodeURIComponent(name)}`, textContent: name });
  link.addEventListener("click", (event) => {
    event.preventDefault();
    $("file").value = name;
    $("file").dispatchEvent(new Event("change"));
  });
  return index ? [", ", link] : [link];
}

const axes = () => ({ x: $("x").value, y: $("y").value });
const isPlane = () => Boolean(page.names?.has($("x").value) && ["y", "z"].some((id) => page.names.has($(id).value)));

/** Show the name of the chosen point, and enable what can be done with it. */
function showChosen() {
  const { chosen } = page;
  page.settled = null;
  next.expect(chosen);
  if (chosen) {
    $("chosen").textContent = chosen.title;
    if (chosen.special?.has_locus) $("locus-part").open = true;
    parameters.edited.clear();
    answer.makeRoom();
  }
  movers.expect(chosen);
  table.draw();
  address();
  enable();
}

/** The motion of the chosen point is there: show the values of its parameters, and what moves the point. */
function showMotion(shown) {
  const { chosen } = page;
  showValues(shown);
  next.ask(page.about.file, chosen, () => page.chosen === chosen);
  movers.ask(page.about.file, chosen, () => page.chosen === chosen);
}

/** Write the turned value of a parameter into its field. */
function turnKnob(name, value) {
  $("values-part").open = true;
  undo.push("the values", parameters.snapshot());
  parameters.turn(name, value);
}

/** Choose a special point of the answer. */
async function chooseEnd(end, key) {
  if (!end.place && !curves.all.has(`${key}/${end.branch}`)) await showResult(page.results.find((each) => each.key === key));
  extras.chooseEnd(end, key, choice);
}

/** Show the values of the parameters of a chosen motion; what was written meanwhile stays. */
function showValues(shown) {
  parameters.take(shown.parameters, parameters.edited);
  showLocusRange({ keep: true });
  const { value } = $("walk-to");
  showWalkRange();
  if (value) $("walk-to").value = value; // what the user has written stays
}

/** Enable the buttons that apply to the chosen point. */
function enable() {
  const { chosen } = page, start = chosen?.start;
  const over = start && ["done", "stopped", "failed"].includes(page.results.find((r) => r.key === start.result)?.state);
  $("walk").disabled = !over;
  $("settle").disabled = !page.about || (start && !over);
  $("switch").disabled = !over || !chosen.special?.switches;
  $("locus").disabled = !over || !chosen.special?.has_locus;
  $("locus-hint").hidden = Boolean(chosen?.special?.has_locus);
  const usable = page.about && !page.about.problem;
  $("search").disabled = !usable || (start && !over);
  $("compute").disabled = $("compute-values").disabled = !usable;
  const refused = page.about?.run_up ?? "", button = $("run-up-open");
  button.dataset.title ??= button.title;
  for (const each of [button, $("run-up")]) Object.assign(each, { disabled: !page.about || Boolean(refused), title: refused ? `No run-up of this system: ${refused}.` : button.dataset.title });
  if (chosen) return;
  $("chosen").textContent = "Choose a point of a branch: click it, or move to it with the arrow keys.";
  $("walk-from").textContent = ""; // that of the point before
}

async function act(action) {
  try {
    hideError();
    const { key } = await post("/api/act", { file: page.about.file, ...action });
    page.wanted = key;
    return key;
  } catch (error) {
    tell(error);
  }
}

async function compute(values = {}) {
  page.computed = await act({ do: "compute", study: $("study").value, values });
}

/** The parameters along which the chosen study runs: their values follow from its range. */
function walks() {
  return page.about.studies.find(({ name }) => name === $("study").value)?.walks ?? [];
}

async function walk() {
  if ($("walk").disabled) return;
  const to = $("walk-to").valueAsNumber;
  if (!Number.isFinite(to)) return tell(new Error("Enter the last value of the branch in the field “to”, as in 0.5."));
  const parameter = $("walk-parameter").value, key = await act({ do: "walk", start: page.chosen.start, parameter, to });
  if (key !== undefined) await showAxes(parameter, page.names.has($("y").value) ? page.about.y : $("y").value);
}

/** The end of a walk along the chosen parameter: that of the file, or of the branch, or one and a half of its value. */
function showWalkRange() {
  const name = $("walk-parameter").value, { about, chosen } = page, value = Number(parameters.base?.get(name) ?? about.values[name] ?? 0);
  const branch = chosen && page.results.find((r) => r.key === chosen.start.result)?.branches[chosen.start.branch];
  const range = name === about.x ? about.range : branch?.parameter === name ? branch.range : [];
  $("walk-to").value = range.at(-1) ?? Number((1.5 * value || 1).toPrecision(4));
  const unit = ($("walk-unit").textContent = unitIn("walk-parameter"));
  $("walk-from").textContent = chosen ? `from ${Number(value.toPrecision(8))} ${unit}`.trim() : "";
}

/** The unit of the parameter that a select has chosen, without brackets. */
function unitIn(id) {
  return unitOf($(id).selectedOptions[0]?.title ?? "").replace(/[ [\]]+$|^ \[/g, "");
}

function switchBranch() {
  if ($("switch").disabled) return;
  const { start } = page.chosen, result = page.results.find((r) => r.key === start.result);
  const [low, high] = result.branches[start.branch].range;
  act({ do: "switch", start, low, high });
}

/** The range of a search or a locus: that of the branch of the chosen point, or of the file. */
function rangeAround() {
  const start = page.chosen?.start, branch = start && page.results.find((r) => r.key === start.result)?.branches[start.branch];
  const [parameter, range] = branch ? [branch.parameter, branch.range] : [page.about.x, page.about.range];
  const [low, high] = [Math.min(...range), Math.max(...range)];
  return { parameter, low, high };
}

function search() {
  if ($("search").disabled) return;
  const count = $("search-count").valueAsNumber, { parameter, low, high } = rangeAround();
  if (!Number.isInteger(count)) return tell(new Error("Enter the number of values at which to search in the field “at … values”, as in 60."));
  if (!Number.isFinite(low)) return tell(new Error("Choose a point of a branch first: the search covers the range of its parameter."));
  const known = page.results.filter((r) => r.branches.length && ["done", "stopped", "failed"].includes(r.state)).map((r) => r.key);
  act({ do: "search", start: page.chosen?.start ?? null, parameter, low, high, count, known });
}

async function followLocus() {
  if ($("locus").disabled) return;
  const second = $("locus-parameter").value, { parameter, low, high } = rangeAround();
  const [from, to] = [$("locus-low").valueAsNumber, $("locus-high").valueAsNumber];
  if (!Number.isFinite(from + to)) return tell(new Error("Enter the range of the second parameter in the fields “from” and “to”."));
  const key = await act({ do: "locus", start: page.chosen.start, low, high, second, second_low: from, second_high: to });
  if (key !== undefined) await showAxes(parameter, second);
}

/** The second parameter of a locus, by default from half to one and a half of its value; a range that holds it stays. */
function showLocusRange({ keep = false } = {}) {
  const name = $("locus-parameter").value, value = Number(parameters.base.get(name) ?? 0), reach = Math.abs(value) / 2 || 1;
  $("locus-unit").textContent = unitIn("locus-parameter");
  if (keep && $("locus-low").valueAsNumber <= value && value <= $("locus-high").valueAsNumber) return;
  [$("locus-low").value, $("locus-high").value] = [value - reach, value + reach].map((v) => Number(v.toPrecision(4)));
}

function settle() {
  if ($("settle").disabled) return;
  act({ do: "settle", start: page.chosen?.start ?? null, values: page.chosen ? parameters.changes : parameters.changesOfFile() });
}

/** Let a motion settle beside the chosen point. */
function settleBeside(values) {
  act({ do: "settle", start: page.chosen.start, values });
}

/** Open what asks for the second parameter of a locus. */
function openLocus() {
  $("locus-part").open = true;
  $("locus-part").scrollIntoView({ block: "nearest" });
  $("locus-parameter").focus();
  tell({ message: "On the left, choose the second parameter and its range; then Follow locus traces the point in the plane of both.", isHint: true });
}

/** A button of a result. */
async function actOn(word, result) {
  const file = page.about.file;
  try {
    hideError();
    if (word === "show") return await showResult(result);
    if (["pause", "continue", "stop", "resume"].includes(word)) return await post(`/api/job/${word}`, { file, result: result.key });
    const query = { file, result: result.key };
    if (word === "model") {
      if (!page.chosen) throw new Error("Choose a point first: the model file walks from it.");
      Object.assign(query, page.chosen.start, { parameter: $("walk-parameter").value, to: $("walk-to").value, y: $("y").value });
    }
    await download(`/api/export/${word}`, query);
  } catch (error) {
    tell(error);
  }
}

/** Give a result another name or look, or delete it; this can be undone. */
async function changeResult(result, changes) {
  const { file } = page.about, send = (values) => post("/api/result/change", { file, result: result.key, ...values });
  try {
    hideError();
    const { before } = await send(changes);
    const words = { name: "the name", deleted: "the deletion", drawn: "how it is drawn:", colour: "the colour" };
    undo.push(`${words[Object.keys(changes)[0]]} of ${result.title}`.replace(": of", ":"), () => send(before));
  } catch (error) {
    tell(error);
  }
}

function restore({ key, title }) {
  return changeResult({ key, title }, { deleted: false });
}

/** Remove the deleted results for good. */
async function clean() {
  try {
    const { removed } = await post("/api/result/clean", { file: page.about.file });
    undo.clear();
    if (removed < page.deleted.length) throw new Error("Results from which others start are kept, because those could not be repeated without them; delete the others first.");
  } catch (error) {
    tell(error);
  }
}

/** Listen to the server; after a pause the browser connects again by itself. */
function connect() {
  const events = new EventSource("/api/events");
  events.onmessage = (event) => {
    const { server, explorations } = JSON.parse(event.data), { about } = page;
    if (!about) return;
    const exploration = explorations[about.file];
    // after a restart the server does not know the file yet
    if (server !== about.server || (exploration && exploration.stamp !== about.stamp)) refreshOnce();
    else if (exploration) show(exploration.results, exploration.deleted);
  };
  events.onerror = () => { $("status").firstElementChild.textContent = "The server does not answer; waiting for it."; };
  events.onopen = () => { $("status").firstElementChild.textContent = ""; };
}

function refreshOnce() {
  page.refreshing ??= refresh().catch(tell).finally(() => { page.refreshing = null; });
}

function showPlan() {
  $("plan").textContent = page.about.studies.find(({ name }) => name === $("study").value)?.plan ?? "";
}

function tell(error) {
  $("error").hidden = false;
  $("error").classList.toggle("hint-only", Boolean(error.isHint));
  $("error").querySelector("p").textContent = error.message;
  if (!error.message) throw error;
}

function hideError() {
  $("error").hidden = true;
}

/** Show a result over its own axes: the plane of its locus, or its parameter and the measure of the file. */
async function showResult(result) {
  if (result.settled) return choice.choose({ settled: result.key });
  if (result.answer) return await showAnswer(result);
  const locus = result.branches.find(({ second }) => second), shown = locus ?? result.branches[0];
  await showAxes(shown.parameter || page.about.x, locus ? locus.second : page.about.y);
}

/** Show an answer over its own axes, or again over those of now, with what is chosen there. */
async function showAnswer(result, isOverOwn = true) {
  const { about } = page, content = await answer.show(about.file, result, !isOverOwn && answer.key === result.key);
  if (!content || page.about?.file !== about.file) return; // the same file may have been read again
  const [x, y] = (isOverOwn && content.axes) || [$("x").value, $("y").value];
  const known = new Set([...$("y").options].map(({ value }) => value));
  for (const { name, words } of content.quantities ?? []) if (!known.has(name)) for (const id of ["x", "y"]) $(id).append(Object.assign(new Option(words.replace(/ \[.*\]$/, ""), name), { title: words }));
  for (const [id, name] of [["x", x], ["y", y]]) if (![...$(id).options].some(({ value }) => value === name)) $(id).append(new Option(name));
  await showAxes(x, y);
  answer.turnTo(y);
  markAnswer();
  if (isOverOwn) diagram.range = null;
  drawDiagram();
  showEmpty();
}

async function showAxes(x, y) {
  if ($("x").value === x && $("y").value === y) return;
  [$("x").value, $("y").value] = [x, y];
  await changeAxes();
}

/** Other axes: the chosen point stays chosen, also where its curve has no place. */
async function changeAxes() {
  curves.clear();
  choice.keep();
  diagram.range = null;
  diagram.tip.hidden = diagram.dot.hidden = true; // over the axes of before
  address();
  await show(page.results);
  drawDiagram(); // where there is no curve, nothing was fetched that would have it drawn
}

window.addEventListener("hashchange", () => {
  const { file, where } = addressed();
  if (![...$("file").options].some(({ value }) => value === file)) return;
  $("file").value = file;
  openOrTell(file, where);
});
$("file").addEventListener("change", () => openOrTell($("file").value));
$("x").addEventListener("change", changeAxes);
$("y").addEventListener("change", changeAxes);
$("study").addEventListener("change", showPlan);
$("compute").addEventListener("click", () => compute());
$("compute-values").addEventListener("click", () => compute(parameters.changesOfFile(walks())));
$("walk").addEventListener("click", walk);
$("switch").addEventListener("click", switchBranch);
$("settle").addEventListener("click", settle);
$("search").addEventListener("click", search);
$("locus").addEventListener("click", followLocus);
$("locus-parameter").addEventListener("change", () => showLocusRange());
$("walk-parameter").addEventListener("change", showWalkRange);
for (const [id, set] of [["reset", () => parameters.take(Object.fromEntries(parameters.base))], ["reset-file", () => parameters.showFile()]]) {
  $(id).addEventListener("click", () => { undo.push("the values", parameters.snapshot()); set(); });
}
$("run-up-open").addEventListener("click", () => {
  if (editor.isOpen) editor.close();
  $("run-up-part").open = true;
  $("run-up-part").scrollIntoView({ block: "nearest" });
  $("run-up-low").focus();
});
$("fit").addEventListener("click", () => diagram.fit());
$("nearer").addEventListener("click", () => diagram.zoom(0.5));
$("farther").addEventListener("click", () => diagram.zoom(2));
for (const format of ["svg", "png"]) {
  $(`save-${format}`).addEventListener("click", async () => {
    try {
      save(await diagram.picture(format), `${(page.about?.file ?? "diagram").replace(/\.\w+$/, "")}.${format}`);
    } catch (error) {
      tell(error);
    }
  });
}
$("error").querySelector("button").addEventListener("click", hideError);
$("help-open").addEventListener("click", () => $("help").showModal());

window.gapwalk = { page, curves, diagram, motion, answer, movers, looks, depth, editor, table }; // for the curious, and for the tests
