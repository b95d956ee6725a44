// Labels of special points that can be read: where they would lie over one another, the first keeps its own.

const WIDE = 22, HIGH = 13; // pixels that a label of two or three letters needs

/** The same points with a `label` where there is room for it, and "" elsewhere, in a window of some pixels. */
export function legible(points, view, width, height) {
  const taken = new Map();
  const scale = ({ x, y }) => [
    (x - view.x[0]) / (view.x[1] - view.x[0]) * width, (y - view.y[0]) / (view.y[1] - view.y[0]) * height,
  ];
  return points.map((point) => {
    const [px, py] = scale(point), column = Math.floor(px / WIDE), row = Math.floor(py / HIGH);
    for (let i = column - 1; i <= column + 1; i++) for (let j = row - 1; j <= row + 1; j++) {
      for (const [ox, oy] of taken.get(`${i} ${j}`) ?? []) {
        if (Math.abs(ox - px) < WIDE && Math.abs(oy - py) < HIGH) return { ...point, label: "" };
      }
    }
    if (point.label) taken.set(`${column} ${row}`, [...(taken.get(`${column} ${row}`) ?? []), [px, py]]);
    return point;
  });
}
