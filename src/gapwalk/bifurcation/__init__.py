"""Where it changes: special points found and located along a branch."""

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.departure import Departure, depart, directions
from gapwalk.bifurcation.detect import Detector
from gapwalk.bifurcation.follow import follow, join, walk_out
from gapwalk.bifurcation.kinds import Event, Kind
from gapwalk.bifurcation.switch import switch
from gapwalk.bifurcation.trail import Trail, TrailState, resumed_trail

__all__ = [
    "Branch",
    "Departure",
    "Detector",
    "Event",
    "Kind",
    "SpecialPoint",
    "Trail",
    "TrailState",
    "depart",
    "directions",
    "follow",
    "join",
    "resumed_trail",
    "switch",
    "walk_out",
]
