// What an answer and the movers of a point add to the diagram and to its legend, on both pages.

import { showLegend } from "./curves.js";
import { legendOf } from "./overlay.js";

const $ = (id) => document.getElementById(id);

export class Extras {
  constructor(legend, curves, diagram, answer, movers) {
    Object.assign(this, { legend, curves, diagram, answer, movers });
    diagram.extra = () => ({ over: answer.over($("x").value, $("y").value), arrows: movers.arrows($("x").value, $("y").value) });
    diagram.drawn = () => this.showLegend();
    diagram.painted = (axes) => answer.follow(axes, $("x").value);
  }

  showLegend() {
    const { legend, diagram } = this, panels = this.answer.own("below").filter(({ over }) => over === $("x").value);
    showLegend(legend, this.curves.drawn(), $("diagram").classList.contains("deep") ? [] : diagram.clusters);
    const settled = this.curves.settled.size ? [{ text: "settled motion", mark: "crosses", look: "settled" }] : [];
    legendOf(legend, diagram.over, [...settled, ...panels.flatMap(({ series }) => series)], diagram.arrows.length > 0);
  }

  /** Draw the arrows of what moves the chosen point. */
  drawArrows() {
    const before = this.diagram.arrows.length;
    this.diagram.redecorate();
    if (before + this.diagram.arrows.length) this.showLegend();
  }

  /** Say in the legend what pale curves are; each has the reason in `why`. */
  showPale() {
    const pale = [...this.curves.drawn(), ...this.curves.settled.values()].filter((curve) => curve.earlier), entry = this.legend.querySelector(".of-earlier");
    entry.hidden = !pale.length;
    entry.lastElementChild.textContent = [...new Set(pale.map(({ why }) => why))].join(", ");
  }

  /** Choose a special point of the answer: on its branch, or at its place, if it is on none. */
  chooseEnd(end, key, choice) {
    const curve = this.curves.all.get(`${key}/${end.branch}`);
    if (curve || end.place) this.movers.open();
    if (curve) return choice.choose({ curve, index: curve.node.indexOf(-1 - end.special) });
    if (!end.place) return;
    choice.clear();
    this.movers.show(end.gradient, () => { const at = [end.place[$("x").value], end.place[$("y").value]]; return at.includes(undefined) ? null : at; });
  }
}
