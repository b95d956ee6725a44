"""Error of a branch of a reduced system and of its special points, compared with the full system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.reduction.paired_branch import PairedBranch, find_special, test_of
from gapwalk.reduction.paired_equations import Pair, method_for

if TYPE_CHECKING:
    from gapwalk.reduction.reduction import Reduction

_POINTS = 12  # ordinary points of the branch that are checked as well
_MARGIN = 1.1  # factor on estimates in reports: the truncation of harmonics changes the difference slightly
_ROUNDING = 1e-10  # error of a located value, in ranges of the parameter
_OTHER = 1.0  # change of a motion, relative to its size, above which it counts as another motion


@dataclass(frozen=True)
class SpecialCheck:
    """The special point of the full system that corresponds to one of the reduced system.

    Attributes
    ----------
    special
        The special point of the reduced system.
    shift
        Correction to be added to its parameter value; nan if the full system has no such point nearby.
    error
        Estimated error of its parameter value; inf if the full system has no such point nearby.
    motion
        Difference of the two motions, as in `OrbitCheck.error`.
    """

    special: SpecialPoint
    shift: float
    error: float
    motion: float

    @property
    def corrected(self) -> float:
        """The parameter value of the special point in the full system."""
        return self.special.value + self.shift

    def __repr__(self) -> str:
        what = f"{self.special.kind.value} at {self.special.value:.8g}"
        if not np.isfinite(self.error):
            return f"SpecialCheck({what}: not found nearby in the full system)"
        return f"SpecialCheck({what}, within {self.error:.1e} of that of the full system)"


@dataclass(frozen=True)
class BranchCheck:
    """The comparison of a branch of the reduced system with the full system's equation.

    Attributes
    ----------
    branch
        The branch.
    special
        Checks of its special points.
    motions
        Estimated errors of the motions at some points of the branch, as in `OrbitCheck.error`.
    harmonics
        Number of harmonics of the check.
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
            text += f", {lost} not found nearby in the full system"
        return f"BranchCheck({text}; motions within {self.motion:.2g}, with {self.harmonics} harmonics)"


def check_branch(reduction: Reduction, branch: Branch, method: Balance | None = None) -> BranchCheck:
    """Check a branch; see `Reduction.check`."""
    if not isinstance(branch, Branch):
        raise ModelError(f"{branch!r} cannot be checked; give an orbit or a branch of reduction.system")
    first = branch.points[0].orbit
    pair = Pair(reduction, first.system, branch.parameter, branch.period, method_for(first, method))
    width = float(np.ptp(branch.values)) or abs(branch.values[0]) or 1.0
    paired = PairedBranch(pair, first, width)
    _ = paired.offset  # raises an error if the system is not the reduced one
    chosen = np.unique(np.linspace(0, len(branch.points) - 1, _POINTS).astype(int))
    motions = tuple(_motion(paired, branch.points[place]) for place in chosen.tolist())
    special = tuple(_special(paired, each) for each in branch.special_points)
    return BranchCheck(branch, special, motions, pair.full.harmonics)


def _motion(paired: PairedBranch, point: BranchPoint) -> float:
    """Return the error of the motion at one point."""
    start = paired.start(point.orbit, point)
    image = None if start is None else paired.image(start)
    if start is None or image is None:
        return float("inf")
    return _MARGIN * paired.change(start, image)


def _special(paired: PairedBranch, special: SpecialPoint) -> SpecialCheck:
    lost = SpecialCheck(special, float("nan"), float("inf"), float("inf"))
    start = paired.start(special.orbit, special.point)
    test = None if start is None else test_of(special, start)
    if start is None or test is None:
        return lost
    ours = find_special(paired.reduced, start.x, start.tangent, test, special.kind)
    if ours is None:
        return lost
    theirs = find_special(paired.full, paired.shifted(ours[0].x), start.tangent, test, special.kind)
    if theirs is None:
        return lost
    shift = theirs[0].value - paired.offset - ours[0].value
    motion = _MARGIN * paired.change(ours[0], theirs[0])
    if motion > _OTHER:
        return lost
    # Both are located again, and the truncation is common to both, so the error of the point itself does not enter.
    rest = (_ROUNDING + ours[1] + theirs[1]) * float(paired.scales[-1])
    return SpecialCheck(special, shift, _MARGIN * abs(shift) + rest, motion)
