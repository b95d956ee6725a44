"""Error of an orbit or a branch of a reduced system, with its special points, compared with the full system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import solve
from gapwalk.reduction.paired_equations import Pair, PairedBranch, find_special, method_for, test_of

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


@dataclass(frozen=True)
class OrbitCheck:
    """The comparison of an orbit of the reduced system with the full system's equation.

    Attributes
    ----------
    orbit
        The orbit.
    error
        Estimated error of the deflections of the contacts: the largest sum of the errors of the amplitudes of all
        harmonics, relative to the largest sum of amplitudes. inf if the full system has no such motion nearby.
    harmonics
        Number of harmonics of the check.
    """

    orbit: Orbit
    error: float
    harmonics: int

    def __repr__(self) -> str:
        return f"OrbitCheck(deflections within {self.error:.2g} of the full system's, with {self.harmonics} harmonics)"


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


def check_orbit(reduction: Reduction, orbit: Orbit, method: Balance | None = None) -> OrbitCheck:
    """Check an orbit; see `Reduction.check`."""
    pair = Pair(reduction, orbit.system, None, orbit.period, method_for(orbit, method))
    full = pair.full  # raises an error if the system is not the reduced one
    unknowns, _ = solve(pair.reduced, pair.reduced.unknowns(orbit), 0.0)
    try:
        error = pair.correct(unknowns).change
    except (NumericalError, np.linalg.LinAlgError):
        error = float("inf")
    return OrbitCheck(orbit, error, full.harmonics)
