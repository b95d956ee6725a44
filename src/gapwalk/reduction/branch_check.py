"""How far a branch of a reduced system, and its special points, are from those of the full one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.orbit.balance import Balance
from gapwalk.reduction.pair import Pair, method_for
from gapwalk.reduction.twin import Twin, find_special, test_of

if TYPE_CHECKING:
    from gapwalk.reduction.reduction import Reduction

_POINTS = 12  # of the branch that are checked besides
_MARGIN = 1.1  # what is estimated is told with a tenth more: the truncation changes the difference a little
_ROUNDING = 1e-10  # of a located value, in ranges of the parameter
_OTHER = 1.0  # change of a motion, relative to its size, from which it is another one


@dataclass(frozen=True)
class SpecialCheck:
    """Where the full system has a special point of the reduced one.

    Attributes
    ----------
    special
        The special point of the reduced system.
    shift
        What is to be added to its parameter value; nan if the full system has no such point near by.
    error
        Estimated error of its parameter value; inf if the full system has no such point near by.
    motion
        How far the motions there are apart, as `OrbitCheck.error`.
    """

    special: SpecialPoint
    shift: float
    error: float
    motion: float

    @property
    def corrected(self) -> float:
        """The parameter value that the full system has it at."""
        return self.special.value + self.shift

    def __repr__(self) -> str:
        what = f"{self.special.kind.value} at {self.special.value:.8g}"
        if not np.isfinite(self.error):
            return f"SpecialCheck({what}: none was found near by in the full system)"
        return f"SpecialCheck({what}, within {self.error:.1e} of the full system's)"


@dataclass(frozen=True)
class BranchCheck:
    """What the full system's equation says of a branch of the reduced one.

    Attributes
    ----------
    branch
        The branch.
    special
        Its special points.
    motions
        Estimated errors of the motions at some points of the branch, as `OrbitCheck.error`.
    harmonics
        Harmonics with which it was checked.
    """

    branch: Branch
    special: tuple[SpecialCheck, ...]
    motions: tuple[float, ...]
    harmonics: int

    @property
    def error(self) -> float:
        """Largest estimated error of the parameter value of a special point; 0 if there is none."""
        return max((each.error for each in self.special), default=0.0)

    @property
    def motion(self) -> float:
        """Largest estimated error of a motion."""
        return max((*self.motions, *(each.motion for each in self.special)), default=0.0)

    def __repr__(self) -> str:
        lost = sum(not np.isfinite(each.error) for each in self.special)
        found = [each.error for each in self.special if np.isfinite(each.error)]
        text = f"{len(found)} special points within {max(found, default=0.0):.1e}"
        if lost:
            text += f", {lost} not found near by in the full system"
        return f"BranchCheck({text}; motions within {self.motion:.2g}, by {self.harmonics} harmonics)"


def check_branch(reduction: Reduction, branch: Branch, method: Balance | None = None) -> BranchCheck:
    """Check a branch; see `Reduction.check`."""
    if not isinstance(branch, Branch):
        raise ModelError(f"{branch!r} can not be checked; give an orbit or a branch of reduction.system")
    first = branch.points[0].orbit
    pair = Pair(reduction, first.system, branch.parameter, branch.period, method_for(first, method))
    width = float(np.ptp(branch.values)) or abs(branch.values[0]) or 1.0
    twin = Twin(pair, first, width)
    _ = twin.offset  # a system that is none of the reduction's is refused here
    chosen = np.unique(np.linspace(0, len(branch.points) - 1, _POINTS).astype(int))
    motions = tuple(_motion(twin, branch.points[place]) for place in chosen.tolist())
    special = tuple(_special(twin, each) for each in branch.special_points)
    return BranchCheck(branch, special, motions, pair.full.harmonics)


def _motion(twin: Twin, point: BranchPoint) -> float:
    """The error of the motion at one point."""
    start = twin.start(point.orbit, point)
    image = None if start is None else twin.image(start)
    if start is None or image is None:
        return float("inf")
    return _MARGIN * twin.change(start, image)


def _special(twin: Twin, special: SpecialPoint) -> SpecialCheck:
    lost = SpecialCheck(special, float("nan"), float("inf"), float("inf"))
    start = twin.start(special.orbit, special.point)
    test = None if start is None else test_of(special, start)
    if start is None or test is None:
        return lost
    ours = find_special(twin.reduced, start.x, start.tangent, test, special.kind)
    if ours is None:
        return lost
    theirs = find_special(twin.full, twin.shifted(ours[0].x), start.tangent, test, special.kind)
    if theirs is None:
        return lost
    shift = theirs[0].value - twin.offset - ours[0].value
    motion = _MARGIN * twin.change(ours[0], theirs[0])
    if motion > _OTHER:
        return lost
    # both are located anew, and what is neglected is common to both, so the point's own error is no part of this
    rest = (_ROUNDING + ours[1] + theirs[1]) * float(twin.scales[-1])
    return SpecialCheck(special, shift, _MARGIN * abs(shift) + rest, motion)
