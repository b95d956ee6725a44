"""Bifurcations: detection and location of special points along a branch, branch switching, loci and diagrams."""

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import BranchStart, directions, start_branch, switch
from gapwalk.bifurcation.detector import Detector
from gapwalk.bifurcation.follow import BranchTracer, BranchTracerState, follow, join, walk_out
from gapwalk.bifurcation.kinds import Event, Kind
from gapwalk.bifurcation.special_point import SpecialPoint

__all__ = [
    "Branch",
    "BranchStart",
    "BranchTracer",
    "BranchTracerState",
    "Detector",
    "Event",
    "Kind",
    "SpecialPoint",
    "directions",
    "follow",
    "join",
    "start_branch",
    "switch",
    "walk_out",
]
