// The text of a model file: lines with numbers, comments in another colour, marks at errors, undo. The text is the user's.

const PAUSE = 600; // milliseconds without a letter after which Undo takes a step of its own
const MOST = 300; // steps of Undo
const TOKENS = /("""[\s\S]*?"""|'''[\s\S]*?'''|"(?:\\.|[^"\\\n])*"|'[^'\n]*')|(#[^\n]*)|(^[ \t]*\[\[?[^\]\n]*\]?\]?)/gm;
const KINDS = ["string", "comment", "table"];

export class ModelText {
  /** `changed(why)` is called after each change of the text, `moved(line)` when the caret is in another line. */
  constructor(place, { changed, moved }) {
    Object.assign(this, { place, changed, moved, past: [], future: [], last: { time: -Infinity, kind: "" }, line: 1 });
    [this.gutter, this.shade, this.field] = [".gutter", ".shade", "textarea"].map((name) => place.querySelector(name));
    this.field.addEventListener("scroll", () => this.scrolled());
    this.field.addEventListener("beforeinput", (event) => {
      const undoes = { historyUndo: () => this.undo(), historyRedo: () => this.redo() }[event.inputType];
      if (!undoes) return this.remember(event.inputType);
      event.preventDefault();
      undoes();
    });
    this.field.addEventListener("input", () => this.written("typed"));
    this.field.addEventListener("keydown", (event) => {
      const key = event.key.toLowerCase(), other = event.shiftKey || key === "y";
      if (!(event.ctrlKey || event.metaKey) || event.altKey || !["z", "y"].includes(key)) return;
      event.preventDefault();
      if (other) this.redo();
      else this.undo();
    });
    document.addEventListener("selectionchange", () => { if (document.activeElement === this.field) this.look(); });
  }

  get text() {
    return this.field.value;
  }

  /** Show another text, of a file or a beginning: Undo does not go back beyond it. */
  show(text) {
    [this.past, this.future] = [[], []];
    this.field.value = text;
    this.field.setSelectionRange(0, 0);
    this.field.scrollTop = 0;
    this.written("shown");
  }

  /** Replace the digits of a number; the steps of one slider are one step of Undo. */
  replace(begin, end, digits, kind) {
    this.remember(kind);
    const { scrollTop, scrollLeft } = this.field;
    this.field.setRangeText(digits, begin, end, "preserve");
    Object.assign(this.field, { scrollTop, scrollLeft });
    this.written(kind);
  }

  undo() {
    this.step(this.past, this.future);
  }

  redo() {
    this.step(this.future, this.past);
  }

  step(from, to) {
    const state = from.pop();
    if (!state) return;
    to.push(this.state());
    this.field.value = state.text;
    this.field.setSelectionRange(...state.at);
    this.last.time = -Infinity;
    this.written("undone");
  }

  state() {
    return { text: this.text, at: [this.field.selectionStart, this.field.selectionEnd] };
  }

  /** Keep the text as it is before a change, unless the change goes on with the last one. */
  remember(kind) {
    const now = performance.now(), goesOn = kind === this.last.kind && now - this.last.time < PAUSE;
    this.last = { time: now, kind };
    if (goesOn) return;
    this.past.push(this.state());
    if (this.past.length > MOST) this.past.shift();
    this.future = [];
  }

  written(why) {
    const { text } = this, count = text.split("\n").length;
    if (this.count !== count) {
      this.count = count;
      this.gutter.replaceChildren(...Array.from({ length: count }, (_, i) => Object.assign(document.createElement("span"), { textContent: `${i + 1}\n` })));
      this.mark(this.marked ?? []);
    }
    this.colour(text);
    this.scrolled();
    this.look();
    this.changed(why);
  }

  /** Draw the text once more below the field, in colours. */
  colour(text) {
    const parts = [];
    let at = 0;
    for (const match of text.matchAll(TOKENS)) {
      if (match.index > at) parts.push(text.slice(at, match.index));
      const kind = KINDS[match.slice(1).findIndex((each) => each !== undefined)];
      parts.push(Object.assign(document.createElement("span"), { className: kind, textContent: match[0] }));
      at = match.index + match[0].length;
    }
    this.shade.firstElementChild.replaceChildren(...parts, `${text.slice(at)}\n`);
  }

  /** Mark the lines of errors: [{ line, text }]. */
  mark(problems) {
    this.marked = problems;
    const lines = new Map();
    for (const { line, text } of problems) if (line) lines.set(line, [...(lines.get(line) ?? []), text]);
    [...this.gutter.children].forEach((each, i) => each.classList.toggle("bad", lines.has(i + 1)));
    this.shade.querySelectorAll("i").forEach((each) => each.remove());
    for (const line of lines.keys()) {
      const bar = document.createElement("i");
      bar.style.top = `calc(${line - 1} * 1lh)`;
      this.shade.append(bar);
    }
  }

  /** Put the caret at the beginning of a line, and show it. */
  go(line) {
    const lines = this.text.split("\n"), at = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    this.field.focus();
    this.field.setSelectionRange(at, at + (lines[line - 1] ?? "").length);
    const height = parseFloat(getComputedStyle(this.field).lineHeight);
    this.field.scrollTop = Math.max(0, (line - 1) * height - this.field.clientHeight / 3);
    this.look();
  }

  /** Tell in which line the caret is, if it has changed. */
  look() {
    const line = this.text.slice(0, this.field.selectionStart).split("\n").length;
    if (line === this.line) return;
    this.line = line;
    this.moved(line);
  }

  scrolled() {
    const { scrollTop, scrollLeft } = this.field;
    this.gutter.scrollTop = scrollTop;
    this.shade.style.transform = `translate(${-scrollLeft}px, ${-scrollTop}px)`;
  }
}
