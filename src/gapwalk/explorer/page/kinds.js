// The kinds of lines: how stable the motions of a branch are, and what happens on a locus.

export const STABILITY = ["stable", "below", "above", "pair"];
const LOCI = ["fold", "flip", "neimark-sacker", "grazing"];

/** All of them in the order of the labels that the server sends. */
export const KINDS = [...STABILITY, ...LOCI];

/** Loci are explained in the legend where there are such on the diagram. */
export function showLegend(legend, curves) {
  const there = new Set([...curves].flatMap(({ label }) => (label.length ? KINDS[label[0]] : [])));
  for (const line of legend.querySelectorAll(".of-plane")) line.hidden = !there.has(line.dataset.kind);
}
