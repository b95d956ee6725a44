// What can be undone: a stack of steps back, a button, and Ctrl+Z outside of text fields.

const MOST = 100; // steps that are kept

export class Undo {
  /** `button` undoes the last step; `tell` shows an error. */
  constructor(button, tell) {
    Object.assign(this, { button, tell, steps: [], going: Promise.resolve() });
    button.addEventListener("click", () => this.back());
    document.addEventListener("keydown", (event) => {
      const isKey = (event.ctrlKey || event.metaKey) && !event.shiftKey && event.key.toLowerCase() === "z";
      if (!isKey || event.target.matches?.("input:not([type=range], [type=checkbox]), textarea")) return;
      event.preventDefault();
      this.back();
    });
    this.draw();
  }

  /** Remember how to undo something: a function, and what it undoes, as in "the deletion of …". */
  push(words, step) {
    this.steps = [...this.steps.slice(1 - MOST), { words, step }];
    this.draw();
  }

  /** Undo the last step, after those before it: of requests at once one may overtake another. */
  back() {
    const last = this.steps.pop();
    this.draw();
    this.going = this.going.then(() => last?.step()).catch((error) => this.tell(error));
  }

  /** Forget all steps, for another file. */
  clear() {
    this.steps = [];
    this.draw();
  }

  draw() {
    const last = this.steps.at(-1);
    this.button.disabled = !last;
    this.button.title = last ? `Undo ${last.words} (Ctrl+Z)` : "Nothing to undo";
  }
}
