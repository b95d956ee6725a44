"""Continuation of a branch of orbits: corrector, predictor, step size, and the records of the walk."""

from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import End, EndReason, Walk
from gapwalk.continuation.walk_scales import Range

__all__ = ["BranchPoint", "End", "EndReason", "Range", "Walk", "WalkOptions"]
