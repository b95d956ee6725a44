// An answer: its sentence above the diagram, panels below it, and its numbers beside it.

import { get } from "./api.js";
import { element } from "./chart.js";
import { onAxes } from "./overlay.js";
import { drawPanel } from "./panels.js";

const LONG = 24; // letters of a cell from which it takes several lines
export const GROWING = ["running", "paused", "queued"]; // states of a job, of which there may be an answer before its end
const $ = (id) => document.getElementById(id);

export class Answer {
  /** `changed` is called when the diagram must be drawn again; `chosen` with an end, `sampled` with a value, when it is clicked. */
  constructor({ changed, chosen, sampled = () => {} }) {
    Object.assign(this, { changed, chosen, key: null, content: null, reading: -1, heard: null }); // heard: as in heard.js
    $("answer-contact").addEventListener("change", () => this.turn());
    $("answer-close").addEventListener("click", () => { this.clear(); this.changed(); });
    $("below").addEventListener("click", ({ target: { dataset: { at } } }) => { if (at) sampled(Number(at)); });
    $("answer-details").addEventListener("toggle", () => this.drawCharts());
    new ResizeObserver(() => this.drawCharts()).observe($("answer-numbers"));
    new ResizeObserver(() => this.offerWhole()).observe($("answer-text"));
    $("answer-more").addEventListener("click", () => { $("answer-text").classList.toggle("whole"); this.offerWhole(); });
  }

  /** Show the answer of a result, or what is stored of it so far, perhaps again; return it. */
  async show(file, { key, state, answer: { reading } }, isAgain = false) {
    const asked = {}; // results of two files may have one key
    Object.assign(this, { file, key, reading, asked, grows: GROWING.includes(state) });
    const content = await get("/api/answer", { file, result: key });
    if (this.asked !== asked) return null;
    if (this.grows) Object.assign(content, { notes: [], pictures: [] }); // those that tell of its end
    const { contact } = this, isKept = isAgain && content.contacts.includes(contact);
    Object.assign(this, { content, hadRoom: isAgain && this.hadRoom });
    if (!isAgain) $("answer-details").open = true;
    $("answer").hidden = $("answer-details").hidden = false;
    $("answer-contact").replaceChildren(...content.contacts.map((name) => new Option(name)));
    if (isKept) $("answer-contact").value = contact;
    $("answer-contact").parentElement.hidden = content.contacts.length < 2;
    this.tell(isKept && content.sentences.length === content.contacts.length ? content.contacts.indexOf(contact) : 0);
    this.drawDetails();
    this.heard?.show(file, key, content);
    return content;
  }

  /** Write its sentences, that of the chosen contact first. */
  tell(first = 0) {
    const { sentences, complete } = this.content, own = sentences.slice(first, first + 1);
    $("answer-text").replaceChildren(...[...own, ...sentences.filter((text) => text !== own[0])].map((words) => text("span", "", `${this.grows ? "So far: " : ""}${words}${complete || this.grows ? "" : " (incomplete)"}`)));
    $("answer-text").classList.remove("whole");
    this.offerWhole();
  }

  /** Mark it as one of before, in words; empty if it is not. */
  mark(words) {
    Object.assign($("answer-note"), { hidden: !words, textContent: words });
    $("answer").classList.toggle("earlier", Boolean(words));
  }

  /** A text that is cut, with an ellipsis, can be shown whole. */
  offerWhole() {
    const place = $("answer-text"), isWhole = place.classList.contains("whole");
    place.title = isWhole ? "" : place.innerText;
    Object.assign($("answer-more"), { hidden: !isWhole && place.scrollHeight <= place.clientHeight + 1, textContent: isWhole ? "Less" : "Whole text", ariaExpanded: String(isWhole) });
  }

  /** Choose the contact whose motion is on the axis. */
  turnTo(measure) {
    const [contact] = Object.entries(this.content.measures ?? {}).find(([, each]) => each === measure) ?? [];
    if (!contact || contact === this.contact) return;
    $("answer-contact").value = contact;
    this.turn();
  }

  /** Another contact is chosen: its sentence, its motion in the diagram, its panels. */
  turn() {
    const { contacts, measures = {}, sentences } = this.content, measure = measures[this.contact];
    if (sentences.length === contacts.length) this.tell(contacts.indexOf(this.contact));
    this.drawDetails();
    if (!Object.values(measures).includes($("y").value) || ![...$("y").options].some(({ value }) => value === measure)) return this.changed();
    $("y").value = measure;
    $("y").dispatchEvent(new Event("change"));
    this.changed();
  }

  clear() {
    Object.assign(this, { key: null, content: null, asked: null });
    $("answer").hidden = $("answer-details").hidden = true;
    $("below").replaceChildren();
    this.heard?.clear();
  }

  get contact() {
    return $("answer-contact").value;
  }

  /** Entries of a list of the answer that belong to the chosen contact. */
  own(list) {
    const more = list === "layers" ? this.heard?.layers ?? [] : [];
    return [...(this.content?.[list] ?? []), ...more].filter(({ of }) => !of || of === this.contact);
  }

  /** The settled motions of a response over two axes, with least and largest values; null where they are not known. */
  settled(x, y) {
    const { settled, layers = [] } = this.content ?? {};
    if (!settled || !layers.length) return null;
    const [parameter, first] = layers[0].axes;
    // each run of them has three layers of a measure: the least values, the largest, and the measure itself
    const runs = (name, k) => layers.filter(({ axes }) => axes[1] === name).filter((_, n) => n % 3 === k);
    const values = (name) => {
      if (name === parameter || name in settled.fixed) return runs(first, 2).map((run) => run.x.map((value) => (name === parameter ? value : settled.fixed[name])));
      return runs(name, 2).map((run) => run.y);
    };
    const [across, up, low, high] = [values(x), values(y), ...[0, 1].map((k) => runs(y, k).map((run) => run.y))];
    if (!across.length || !up.length) return null;
    return { ...settled, across, up, x: across.flat(), y: up.flat(), low: low.flat(), high: high.flat(), parameter, at: values(parameter).flat() };
  }

  /** True if it has settled motions of which a quantity on the axes is not stored. */
  lacks(x, y) {
    return Boolean(this.content?.settled) && !this.settled(x, y);
  }

  /** What the diagram shows of it over two axes. */
  over(x, y) {
    return this.content ? onAxes(this, x, y) : null;
  }

  /** The panels below the diagram: with its range across, where it is over the same parameter. */
  follow(axes, x) {
    const { xaxis } = axes;
    const panels = this.own("below").filter(({ over }) => over === x);
    while ($("below").children.length > panels.length) $("below").lastChild.remove();
    while ($("below").children.length < panels.length) $("below").append(document.createElement("div"));
    this.followPanels(panels, xaxis, x);
    this.heard?.follow(axes, x);
  }

  followPanels(panels, xaxis, x) {
    if (!panels.length) return;
    const same = (list) => this.own(list).filter(({ over }) => over === x), width = $("below").clientWidth;
    const right = width - xaxis._offset - xaxis._length;
    panels.forEach((panel, k) => drawPanel($("below").children[k], panel, {
      range: xaxis.range, left: xaxis._offset, right, named: false, height: panels.length > 2 ? 84 : 104, shades: same("shades"), lines: same("lines"),
    }));
  }

  /** Draw buttons of its special points, bars, charts, tables and notes. */
  drawDetails() {
    const { content } = this;
    if (!content) return;
    const place = $("answer-numbers");
    place.replaceChildren();
    $("answer-ends").replaceChildren(...this.own("ends").map((end) => this.end(end)));
    if (content.bars) place.append(bars(content.bars));
    if (content.shares) place.append(shares(content.shares));
    for (const chart of this.own("charts")) place.append(Object.assign(document.createElement("div"), { className: "free", chart }));
    let other = false; // a table of another contact follows its heading
    const of = (part) => content.contacts.find((name) => part.startsWith(`${name}: `)) ?? this.contact;
    for (const part of content.parts) if (!(other = typeof part === "string" ? of(part) !== this.contact : other)) place.append(typeof part === "string" ? text("p", "line", part) : table(this.ownRows(part)));
    for (const note of content.notes) place.append(text("p", "hint", `Note: ${note}`));
    for (const [number, words] of (content.pictures ?? []).entries()) place.append(this.picture(number, words));
    this.drawCharts();
  }

  /** A table of bands: the rows of the chosen contact, those of equal bands once. */
  ownRows(part) {
    if (part.head[0][0] !== "gap" || part.head[1][0] !== "met" || this.content.contacts.length < 2) return part;
    const bands = part.groups.map((last, k) => part.rows.slice(k ? part.groups[k - 1] + 1 : 0, last + 1)).filter(([[gap]]) => gap === this.contact);
    const alike = new Map();
    for (const [[gap, met, ...first], ...others] of bands) {
      const key = JSON.stringify([first, others]), known = alike.get(key);
      if (known) known[0][1] += `, ${met}`;
      else alike.set(key, [[gap, met, ...first], ...others]);
    }
    const kept = [...alike.values()];
    return { ...part, rows: kept.flat(), groups: kept.map((_, k) => kept.slice(0, k + 1).flat().length - 1) };
  }

  /** A picture of the answer, which is asked for when it is opened; the first one is open. */
  picture(number, words) {
    const made = Object.assign(document.createElement("details"), { className: "drawn", open: number === 0 });
    const { file, key } = this, image = Object.assign(document.createElement("img"), { alt: words }), state = text("p", "hint", "It is drawn \u2026");
    const fetchOnce = async () => {
      if (!made.open || made.asked) return;
      made.asked = true;
      try {
        const { form, content } = await get("/api/picture", { file, result: key, number });
        image.src = form === "svg" ? `data:image/svg+xml,${encodeURIComponent(content)}` : `data:image/${form};base64,${content}`;
        state.replaceWith(image);
      } catch (error) {
        made.asked = false;
        state.textContent = error.message;
      }
    };
    made.append(text("summary", "", words), state);
    made.addEventListener("toggle", fetchOnce);
    fetchOnce();
    return made;
  }

  drawCharts() {
    for (const place of $("answer-numbers").querySelectorAll(".free")) if (place.clientWidth) drawPanel(place, place.chart, { height: 170 });
    for (const frame of $("answer-numbers").querySelectorAll(".frame")) {
      frame.classList.remove("stacked"); // a table that is too wide has one block for each row
      frame.classList.toggle("stacked", frame.clientWidth > 0 && frame.scrollWidth > frame.clientWidth + 1);
    }
  }

  /** A button that chooses a special point of the answer. */
  end(end) {
    const button = Object.assign(document.createElement("button"), { type: "button" });
    button.append(`${end.kind} `, text("b", "", end.text));
    button.title = `What moves it: ${end.most ?? "choose it"}`;
    button.addEventListener("click", () => this.chosen(end, this.key));
    const line = document.createElement("li");
    line.append(button);
    return line;
  }

  /** The numbers make room for the motion at a point, unless the user has opened them again. */
  makeRoom() {
    if (this.hadRoom || !this.content) return;
    this.hadRoom = true;
    $("answer-details").open = false;
  }
}

function text(name, kind, content) {
  return Object.assign(document.createElement(name), { className: kind, textContent: content });
}

/** A table of texts; a gap follows the rows of each group. */
function table({ head, rows, groups, left_out: more }) {
  const frame = text("div", "frame", ""), made = document.createElement("table"), last = new Set(groups);
  const line = made.createTHead().insertRow(), body = made.createTBody();
  for (const [words, right] of head) line.append(text("th", right ? "right" : "", words));
  rows.forEach((row, number) => {
    const cells = body.insertRow();
    cells.className = last.has(number) && number < rows.length - 1 ? "last" : "";
    row.forEach((cell, k) => {
      const made = text("td", head[k][1] ? "right" : cell.length > LONG ? "long" : "", cell);
      if (head[k][0]) made.dataset.head = head[k][0];
      cells.append(made);
    });
  });
  frame.tabIndex = 0;
  frame.append(made);
  if (more) frame.append(text("p", "hint", `and ${more} more rows, in the table to save`));
  return frame;
}

/** The changes of a design in percent, as bars over what the limits allow. */
function bars(changes) {
  const made = element("svg", { viewBox: `0 0 360 ${34 * changes.length}`, class: "chart bars", role: "img", "aria-label": changes.map(({ name, text: words }) => `${name}: ${words}`).join("; ") });
  const reach = Math.max(1e-9, ...changes.flatMap(({ low, high, moved }) => [low, high, moved].map(Math.abs))), px = (v) => 180 + (v / reach) * 174;
  changes.forEach(({ name, low, high, moved, text: words }, k) => {
    const top = 34 * k;
    made.append(element("text", { class: "title", x: 4, y: top + 12 }, name), element("text", { x: 356, y: top + 12, "text-anchor": "end" }, words));
    made.append(element("rect", { class: "limits", x: px(low), width: px(high) - px(low), y: top + 17, height: 12 }));
    made.append(element("rect", { class: "moved", x: Math.min(px(0), px(moved)), width: Math.max(1, Math.abs(px(moved) - px(0))), y: top + 19, height: 8 }));
    made.append(element("line", { class: "zero", x1: px(0), x2: px(0), y1: top + 15, y2: top + 31 }));
  });
  return made;
}

/** Shares of starts as bars, with their confidence limits as thin lines. */
export function shares(all, most = Math.max(1e-9, ...all.map(({ high }) => high))) {
  const made = element("svg", { viewBox: `0 0 360 ${34 * all.length}`, class: "chart bars", role: "img", "aria-label": all.map(({ name, text: words }) => `${name}: ${words}`).join("; ") });
  const px = (v) => 4 + (v / most) * 350;
  all.forEach(({ name, share, low, high, text: words, color }, k) => {
    const top = 34 * k;
    made.append(element("text", { class: "title", x: 4, y: top + 12 }, name), element("text", { x: 356, y: top + 12, "text-anchor": "end" }, words));
    made.append(element("rect", { x: px(0), width: Math.max(1, px(share) - px(0)), y: top + 18, height: 10, fill: color }));
    made.append(element("path", { class: "limit", d: `M${px(low)} ${top + 23}H${px(high)}M${px(low)} ${top + 19}V${top + 27}M${px(high)} ${top + 19}V${top + 27}` }));
  });
  return made;
}
