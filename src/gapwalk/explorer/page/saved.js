// A saved page: the diagram and the motions of a result in one file, without a server.

import { Answer } from "./answer.js";
import { nearestStored, open, unzipped } from "./api.js";
import { Choice } from "./choice.js";
import { Curves, takeLoci } from "./curves.js";
import { Depth } from "./depth.js";
import { Diagram } from "./diagram.js";
import { fill, save } from "./dom.js";
import { Extras } from "./extras.js";
import { Heard } from "./heard.js";
import { Keyboard } from "./keyboard.js";
import { MotionView } from "./motion.js";
import { Movers } from "./movers.js";
import { Next } from "./next.js";
import { CurveTable } from "./table.js";

const $ = (id) => document.getElementById(id);

const page = { about: null, chosen: null };
const curves = new Curves();

begin().catch(tell);

async function begin() {
  if (!("DecompressionStream" in window)) throw new Error("This page needs a browser of 2023 or newer.");
  const plotly = document.createElement("script");
  plotly.textContent = new TextDecoder().decode(await unzipped("plotly"));
  document.head.append(plotly);
  const about = (page.about = await open());
  $("title").textContent = $("title").title = about.title;
  $("note").textContent = about.note;
  const names = about.quantities.map(({ name, words }) => [name, words]);
  fill($("x"), names);
  fill($("y"), names);
  fill($("signal"), about.signals);
  [$("x").value, $("y").value, $("signal").value] = [about.x, about.y, about.signal];
  const motion = (page.motion = new MotionView(tell));
  document.body.classList.toggle("alone", Boolean(about.motion));
  window.gapwalk = { page, curves, motion }; // for the curious, and for the tests
  motion.rest(about.machine);
  if (about.motion) return motion.show({}, about.title, about.verdict);
  const diagram = (window.gapwalk.diagram = new Diagram($("diagram"), curves, chooseStored));
  const keyboard = (page.keyboard = new Keyboard($("diagram"), curves, chooseStored, {
    "+": () => diagram.zoom(0.5), "-": () => diagram.zoom(2), 0: () => diagram.fit(),
  }));
  const answer = new Answer({ changed: () => show(diagram), chosen: (end, key) => extras.chooseEnd(end, key, page.choice) });
  answer.heard = new Heard({ diagram, tell, changed: () => diagram.draw() });
  const movers = new Movers({ changed: () => extras.drawArrows() });
  const extras = (page.extras = new Extras($("legend"), curves, diagram, answer, movers));
  const depth = new Depth({ page, curves, diagram, answer, tell, changed: () => show(diagram), choose: chooseStored });
  const table = (page.table = new CurveTable(page, curves, diagram, { choose: chooseStored, name: () => "curve", tell }));
  diagram.settledAt = (index) => {
    page.choice.clear();
    page.settled = index;
    diagram.mark = diagram.placeOfSettled(index);
    table.draw();
    $("note").textContent = `${diagram.settledLines(index).join("; ")}.`;
  };
  diagram.sampled = (value) => tell({ message: `The motions at ${$("x").value} = ${Number(value.toPrecision(7))} were settled by equal steps. This file holds their measures, which are drawn, but not the motions. To see them, open the model with gapwalk explore and press Settle at this value.`, isHint: true });
  const next = new Next({ hear: () => motion.hear(), pin: () => motion.pin() }, tell);
  page.choice = new Choice(page, { curves, diagram, keyboard, motion }, {
    changed: () => { page.settled = null; next.expect(page.chosen); movers.expect(page.chosen); table.draw(); if (page.chosen) answer.makeRoom(); },
    shown: () => { const { chosen } = page; next.ask("", chosen, () => page.chosen === chosen); movers.ask("", chosen, () => page.chosen === chosen); },
  });
  Object.assign(window.gapwalk, { answer, movers, depth });
  takeLoci(about.loci, $("legend"));
  document.body.classList.toggle("unmoved", !about.branches.length);
  if (about.answer) await answer.show("", { key: "", answer: {} });
  for (const id of ["x", "y"]) $(id).addEventListener("change", () => show(diagram));
  $("fit").addEventListener("click", () => diagram.fit());
  $("nearer").addEventListener("click", () => diagram.zoom(0.5));
  $("farther").addEventListener("click", () => diagram.zoom(2));
  for (const format of ["svg", "png"]) {
    $(`save-${format}`).addEventListener("click", () => diagram.picture(format).then((blob) => save(blob, `diagram.${format}`), tell));
  }
  await show(diagram);
}

/** Draw the branches over the chosen axes; the chosen point stays chosen. */
async function show(diagram) {
  const axes = { x: $("x").value, y: $("y").value };
  const branches = page.about.branches.map(({ name, period, count, second }) => ({ name, period, second, points: count }));
  const { parameters } = page.about, plane = parameters.includes(axes.x) && [axes.y, $("z").value].some((name) => parameters.includes(name));
  curves.clear();
  await curves.update("", axes, plane, [{ key: "", version: 0, state: "done", settled: false, branches }]);
  diagram.names = { x: $("x").selectedOptions[0].textContent, y: $("y").selectedOptions[0].textContent };
  const before = new Set(page.about.branches.flatMap(({ earlier }, number) => (earlier ? [`/${number}`] : [])));
  for (const curve of curves.all.values()) Object.assign(curve, { earlier: before.has(curve.key), why: "before the change" });
  page.choice.keep();
  diagram.fit();
  page.extras.showLegend();
  page.extras.showPale();
  page.table.draw();
  $("empty").hidden = true;
  document.body.dataset.branches = curves.all.size;
}

/** Choose the nearest point whose motion is stored; a step by key goes to the next one. */
function chooseStored({ curve, index }) {
  const { choice, keyboard } = page;
  const index0 = keyboard.at === curve.key ? keyboard.index : index;
  const way = Math.abs(index - index0) === 1 || Math.abs(index - index0) === 10 ? Math.sign(index - index0) : 0;
  choice.choose({ curve, index: nearestStored(curve, index, way) });
}

function tell(error) {
  $("error").hidden = false;
  $("error").classList.toggle("hint-only", Boolean(error.isHint));
  $("error").querySelector("p").textContent = error.message;
}

$("error").querySelector("button").addEventListener("click", () => { $("error").hidden = true; });
$("help-open").addEventListener("click", () => $("help").showModal());
