// The kinds of lines: how stable the motions of a branch are, and what happens on a locus.

export const STABILITY = ["stable", "below", "above", "pair"];
const LOCI = ["fold", "flip", "neimark-sacker", "grazing"];

/** All of them in the order of the labels that the server sends. */
export const KINDS = [...STABILITY, ...LOCI];
