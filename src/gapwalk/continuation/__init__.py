"""A family: the walk along a branch of orbits, and its records."""

from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.range import Range
from gapwalk.continuation.walk import End, EndReason, Walk

__all__ = ["BranchPoint", "End", "EndReason", "Range", "Walk", "WalkOptions"]
