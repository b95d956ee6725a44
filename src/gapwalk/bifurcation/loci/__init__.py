"""Loci: folds, flips, Neimark-Sacker and grazing points followed in two parameters."""

from gapwalk.bifurcation.loci.follow_locus import follow_locus, join_locus
from gapwalk.bifurcation.loci.locus import Codim2, Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.loci.locus_start import LocusStart, start_locus
from gapwalk.bifurcation.loci.locus_tracer import LocusState, LocusStep, LocusTracer

__all__ = [
    "Codim2",
    "Codim2Point",
    "Locus",
    "LocusEnd",
    "LocusEndReason",
    "LocusPoint",
    "LocusStart",
    "LocusState",
    "LocusStep",
    "LocusTracer",
    "follow_locus",
    "join_locus",
    "start_locus",
]
