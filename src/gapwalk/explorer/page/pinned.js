// A pinned motion, with which others are compared: it is drawn behind them in the panels.

const $ = (id) => document.getElementById(id);

export class Pinned {
  /** `changed` is called when another motion is pinned, or none. */
  constructor(changed) {
    Object.assign(this, { changed, motion: null, title: "" });
    $("pinned-away").addEventListener("click", () => this.pin(null));
  }

  /** Pin a motion, or none. */
  pin(motion, title = "", details = null) {
    Object.assign(this, { motion, title, details });
    $("pinned").hidden = !motion;
    $("pinned").querySelector("span").textContent = title;
    this.changed();
  }

  /** The lines of its spectrum and the points of its section behind those of another motion, where both are of one signal. */
  lines({ signal, section }) {
    const own = this.details?.signal === signal && !this.details.missing ? this.details : null;
    const lines = own && [own.orders.slice(1), own.amplitudes.slice(1)], many = lines?.[0].length > 90, same = this.details?.section.of === section.of;
    return {
      behind: many ? [lines] : [], barsBehind: many ? null : lines,
      dots: same ? this.details.section.q.map((q, i) => [q, this.details.section.v[i], "pinned"]) : [],
    };
  }

  /** The curves of the pinned motion behind those of another: { history, phase, loop, force }, each a list of curves. */
  behind(motion, { name, dashes, contact, shown }) {
    const { motion: own } = this;
    if (!own || own === motion) return { history: [], phase: [], loop: [], force: [] };
    const of = (each) => own.contacts.find((other) => other.name === each?.name);
    const force = contact && of(contact), values = contact ? force?.force : [own.q, own.v, own.a][dashes]?.[name];
    const loop = of(shown);
    return {
      history: values ? [[own.theta, values]] : [],
      phase: own.q[name] ? [[own.q[name], own.v[name]]] : [],
      force: loop ? [[own.theta, loop.force]] : [],
      loop: loop ? [[loop.deflection, loop.force]] : [],
    };
  }
}
