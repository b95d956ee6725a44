"""Records that other records hold, and that functions return: each is described here, none is made by hand."""

from gapwalk.attractors.attractor import AttractorKind
from gapwalk.attractors.attractor_catalogue import Effort
from gapwalk.attractors.basins import BasinCheck, Share
from gapwalk.attractors.box import Box, Window
from gapwalk.attractors.regimes import RegimeCheck
from gapwalk.attractors.rotation import Rotation
from gapwalk.bifurcation.branch import Unexplained
from gapwalk.bifurcation.branch_comparison import Comparison, Match
from gapwalk.bifurcation.diagram import Cascade, DiagramBranch, Origin
from gapwalk.bifurcation.follow import BranchWalk
from gapwalk.bifurcation.isolated import FoundOrbit, SearchResult, Tally
from gapwalk.bifurcation.loci import Codim2, Codim2Point, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.flow.motion import ContactRecord, Motion
from gapwalk.flow.switching import ContactEvent
from gapwalk.model.equilibria import ContactRest, Equilibrium, Rest
from gapwalk.model.modes import Modes
from gapwalk.orbit import Instability
from gapwalk.orbit.measures import Survey, Turns
from gapwalk.reduction.basis import Basis
from gapwalk.reduction.reduction_error import OrbitCheck
from gapwalk.studies.family import Connection, Member, SpecialPointPath
from gapwalk.studies.map import MapSection
from gapwalk.studies.sweep import Lane
from gapwalk.studies.sweep_segment import Band
from gapwalk.summary import Table, Tree
from gapwalk.verification import Check, Figure, Summary

__all__ = [
    "AttractorKind",
    "Band",
    "BasinCheck",
    "Basis",
    "Box",
    "BranchPoint",
    "BranchWalk",
    "Cascade",
    "Check",
    "Codim2",
    "Codim2Point",
    "Comparison",
    "Connection",
    "ContactEvent",
    "ContactRecord",
    "ContactRest",
    "DiagramBranch",
    "Effort",
    "End",
    "EndReason",
    "Equilibrium",
    "Figure",
    "FoundOrbit",
    "Instability",
    "Lane",
    "LocusEnd",
    "LocusEndReason",
    "LocusPoint",
    "MapSection",
    "Match",
    "Member",
    "Modes",
    "Motion",
    "OrbitCheck",
    "Origin",
    "RegimeCheck",
    "Rest",
    "Rotation",
    "SearchResult",
    "Share",
    "SpecialPointPath",
    "Summary",
    "Survey",
    "Table",
    "Tally",
    "Tree",
    "Turns",
    "Unexplained",
    "Window",
]
