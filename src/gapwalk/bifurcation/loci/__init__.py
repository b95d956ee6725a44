"""Loci: folds, flips, Neimark-Sacker and grazing points followed in two parameters."""

from gapwalk.bifurcation.loci.follow_locus import LocusStart, LocusStep, LocusTracer, follow_locus, start_locus
from gapwalk.bifurcation.loci.locus import Codim2, Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint

__all__ = [
    "Codim2",
    "Codim2Point",
    "Locus",
    "LocusEnd",
    "LocusEndReason",
    "LocusPoint",
    "LocusStart",
    "LocusStep",
    "LocusTracer",
    "follow_locus",
    "start_locus",
]
