// The keys of the diagram: the arrow keys choose other points, letters act on the chosen one.

/** Moves the choice by keyboard: along a branch with the left and right arrow keys, to other branches with up and down. */
export class Keyboard {
  /** `choose` is called with { curve, index }; `actions` by letter. */
  constructor(place, curves, choose, actions) {
    this.curves = curves;
    this.choose = choose;
    this.actions = actions;
    place.addEventListener("keydown", (event) => this.key(event));
  }

  /** Set the chosen point, which was chosen by other means. */
  select(curve, index) {
    [this.at, this.index] = [curve.key, index];
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const action = this.actions[event.key.toLowerCase()];
    if (action) return action();
    const keys = [...this.curves.all.keys()].sort(); // they have come in any order
    if (!keys.length) return;
    const curve = this.curves.all.get(this.at);
    if (!curve) {
      if (!/^(Arrow|Home|End|s$)/i.test(event.key)) return;
      event.preventDefault();
      return this.go(this.curves.all.get(keys[0]), 0);
    }
    const step = event.shiftKey ? 10 : 1, last = curve.x.length - 1, place = keys.indexOf(this.at);
    // the right arrow goes to the right, whichever way the branch was walked
    const way = curve.x[last] < curve.x[0] ? -1 : 1;
    const moves = {
      ArrowRight: () => this.go(curve, clamp(this.index + way * step, last)),
      ArrowLeft: () => this.go(curve, clamp(this.index - way * step, last)),
      Home: () => this.go(curve, 0),
      End: () => this.go(curve, last),
      ArrowUp: () => this.other(keys[(place + 1) % keys.length], curve),
      ArrowDown: () => this.other(keys[(place + keys.length - 1) % keys.length], curve),
      s: () => this.special(curve, way),
      S: () => this.special(curve, -way),
    };
    if (!(event.key in moves)) return;
    event.preventDefault();
    moves[event.key]();
  }

  go(curve, index) {
    this.choose({ curve, index });
  }

  /** Another branch, at the place nearest across. */
  other(key, from) {
    const curve = this.curves.all.get(key), x = from.x[this.index];
    let best = 0;
    for (let i = 1; i < curve.x.length; i++) if (Math.abs(curve.x[i] - x) < Math.abs(curve.x[best] - x)) best = i;
    this.go(curve, best);
  }

  /** The next special point but for grazing, round the branch. */
  special(curve, way) {
    const count = curve.x.length;
    for (let k = 1; k <= count; k++) {
      const i = (((this.index + way * k) % count) + count) % count, node = curve.node[i];
      if (node < 0 && curve.special[-1 - node].kind !== "grazing") return this.go(curve, i);
    }
  }
}

function clamp(index, last) {
  return Math.max(0, Math.min(last, index));
}
