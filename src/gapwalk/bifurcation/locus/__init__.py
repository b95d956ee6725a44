"""Loci: folds, flips, Neimark-Sacker and grazing points followed in two parameters."""

from gapwalk.bifurcation.locus.departure import LocusDeparture, depart_locus
from gapwalk.bifurcation.locus.follow import follow_locus, join_locus
from gapwalk.bifurcation.locus.locus import Codim2, Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.locus.trail import LocusState, LocusStep, LocusTrail

__all__ = [
    "Codim2",
    "Codim2Point",
    "Locus",
    "LocusDeparture",
    "LocusEnd",
    "LocusEndReason",
    "LocusPoint",
    "LocusState",
    "LocusStep",
    "LocusTrail",
    "depart_locus",
    "follow_locus",
    "join_locus",
]
