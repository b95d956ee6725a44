// The lines of the branches, on a canvas under Plotly's axes: they follow a drag frame by frame, however many they are.

import { LINES, thinned } from "./curves.js";
import { paintBehind } from "./overlay.js";

const MANY = 5000; // vertices beyond which a drag shows the last picture, moved, and a new one now and then
const NOW_AND_THEN = 250; // milliseconds

export class Lines {
  constructor(canvas) {
    this.canvas = canvas;
    this.last = { picture: document.createElement("canvas"), time: -Infinity };
    this.behind = null; // what an answer has behind the lines
    this.pale = 0.35; // opacity of pale curves
    this.groups = []; // the thinned lines of curves of one look, by kind: pale ones first, because they lie below
  }

  /** Thin the curves for a view, and as much again on either side, so that a drag has something to show. */
  thin(curves, view, width, height) {
    const room = view.x[1] - view.x[0];
    const around = [view.x[0] - room, view.x[1] + room];
    const groups = new Map();
    for (const curve of curves) {
      const pale = Boolean(curve.earlier), shade = curve.shade ?? "", name = `${pale ? 0 : 1}${shade}`;
      if (!groups.has(name)) groups.set(name, { pale, shade, own: [] });
      groups.get(name).own.push(curve);
    }
    this.groups = [...groups.keys()].sort().map((name) => {
      const { own, ...look } = groups.get(name);
      return { ...look, kinds: thinned(own, LINES.size, around, width / room, height / (view.y[1] - view.y[0])) };
    });
  }

  /** Call a function with the lines of each kind, the name of the kind, their opacity and their style. */
  each(call) {
    const styles = [...LINES];
    return this.groups.flatMap(({ pale, shade, kinds }) => kinds.map((line, place) => {
      const [kind, style] = styles[place];
      return call(line, kind, pale ? this.pale : 1, shade ? { ...style, shade } : style);
    }));
  }

  /** All thinned lines, [xs, ys] each. */
  get thinned() {
    return this.groups.flatMap(({ kinds }) => kinds);
  }

  get vertices() {
    return this.thinned.reduce((sum, [xs]) => sum + xs.length, 0);
  }

  /** Draw them where Plotly's axes are now; `moving`: in the midst of a drag, when it must be quick. */
  paint({ xaxis, yaxis }, color, moving = false) {
    const { canvas } = this, ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const draw = canvas.getContext("2d");
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    const [left, top, right, bottom] = [xaxis._offset, yaxis._offset, xaxis._offset + xaxis._length, yaxis._offset + yaxis._length];
    // while it is dragged, an axis has its new range but not yet its new scale
    const [x0, x1] = xaxis.range, [y0, y1] = yaxis.range;
    const [kx, ky] = [xaxis._length / (x1 - x0), yaxis._length / (y1 - y0)];
    const { last } = this;
    if (moving && this.vertices > MANY && performance.now() - last.time < NOW_AND_THEN) {
      const { from } = last, scaleX = kx / from.kx, scaleY = ky / from.ky;
      draw.beginPath();
      draw.rect(left, top, right - left, bottom - top);
      draw.save();
      draw.clip();
      draw.drawImage(
        last.picture, from.left * ratio, from.top * ratio, (from.right - from.left) * ratio, (from.bottom - from.top) * ratio,
        left + (from.x0 - x0) * kx, bottom - (from.y1 - y0) * ky, (from.right - from.left) * scaleX, (from.bottom - from.top) * scaleY,
      );
      draw.restore();
      return;
    }
    draw.save();
    draw.beginPath();
    draw.rect(left, top, right - left, bottom - top);
    draw.clip();
    if (this.behind) paintBehind(draw, this.behind, (v) => left + (v - x0) * kx, (v) => bottom - (v - y0) * ky, [left, top, right, bottom], color);
    draw.strokeStyle = color("--grid");
    draw.lineWidth = 1;
    draw.beginPath();
    for (const { x } of xaxis._vals ?? []) { const p = Math.round(left + (x - x0) * kx) + 0.5; draw.moveTo(p, top); draw.lineTo(p, bottom); }
    for (const { x } of yaxis._vals ?? []) { const p = Math.round(bottom - (x - y0) * ky) + 0.5; draw.moveTo(left, p); draw.lineTo(right, p); }
    draw.stroke();
    draw.lineJoin = "round";
    this.each(([xs, ys], kind, opacity, { shade, dashes, width }) => {
      draw.globalAlpha = opacity;
      draw.strokeStyle = color(shade);
      draw.lineWidth = width;
      draw.setLineDash(dashes);
      let on = false;
      for (let i = 0; i < xs.length; i++) {
        if (xs[i] === null) {
          draw.stroke(); // piece by piece: one path of all would take four times as long
          on = false;
          continue;
        }
        const px = left + (xs[i] - x0) * kx, py = bottom - (ys[i] - y0) * ky;
        if (!on) draw.beginPath();
        if (on) draw.lineTo(px, py);
        else draw.moveTo(px, py);
        on = true;
      }
    });
    draw.restore();
    if (this.vertices > MANY) {
      Object.assign(last.picture, { width, height });
      last.picture.getContext("2d").drawImage(canvas, 0, 0);
      Object.assign(last, { time: performance.now(), from: { left, top, right, bottom, x0, y0, x1, y1, kx, ky } });
    }
  }
}
