"""Continuation of a branch of orbits: corrector, predictor, step size, and the records of the walk."""

from gapwalk.continuation.corrector import Range
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkOptions

__all__ = ["BranchPoint", "End", "EndReason", "Range", "Walk", "WalkOptions"]
