"""Beginnings of branches: at an orbit, or at a special point where another branch begins or crosses.

A period-doubled branch begins with motions whose two halves differ, and ends where that difference vanishes.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, Range, check_range, hermite, scales_of, with_natural_change
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit, returns, true_period
from gapwalk.orbit.orbit_equation import OrbitEquation, solve

if TYPE_CHECKING:
    from gapwalk.bifurcation.special_point import SpecialPoint

_MERGED = 1e-7  # relative difference between the parts of an orbit below which its period is that of a part
_OWN = 1e-9  # share of the range from which the size of a value of the parameter is a unit of it
_CLOSE = 1e-2  # relative difference between the halves below which an orbit is close to one of half the period
_PARENT = 2.0  # distance of the parent from the mean of the halves, in their difference, up to which it is the parent


@dataclass(frozen=True)
class BranchStart:
    """Point and direction from which a branch can be walked."""

    corrector: Corrector  #: Corrector for the branch; it holds the equation and the scales.
    first: BranchPoint  #: The point; its tangent gives the direction.
    within: Range  #: Range of the parameter.
    singular: bool = False  #: True if the branch begins here, at a bifurcation of another one.

    @property
    def equation(self) -> OrbitEquation:
        """Equation whose solutions form the branch."""
        return cast("OrbitEquation", self.corrector.equation)  # loci use correctors too, but begin differently

    @classmethod
    def uncorrected(
        cls, corrector: Corrector, start: NDArray[np.float64], tangent: NDArray[np.float64], within: Range
    ) -> BranchStart:
        """Return the beginning of a branch at a special point: its unknowns and parameter, and the scaled tangent."""
        return cls(corrector, corrector.uncorrected(start / corrector.scales, tangent, 0.0), within, singular=True)


def start_branch(
    orbit: Orbit, parameter: str, to: float | tuple[float, float], direction: int, method: Method | None = None
) -> BranchStart:
    """Begin a branch at an orbit, towards larger (+1) or smaller (-1) values of a parameter."""
    start = orbit.system[parameter]
    _check_period(orbit, parameter)
    within = check_range(start, to).along(parameter, orbit.system)
    for bound in (within.low, within.high):
        orbit.system.at({parameter: bound})
    equation = chosen(method).pose(orbit.system, parameter, orbit.period)
    return _leave(equation, orbit, with_natural_change(within, equation, orbit), direction)


def _check_period(orbit: Orbit, parameter: str) -> None:
    """Raise a ConvergenceError for a motion of a shorter period: its flips would appear as branch points."""
    shortest = true_period(orbit)
    periods = "1 forcing period" if shortest == 1 else f"{shortest} forcing periods"
    if shortest < orbit.period:
        raise ConvergenceError(
            f"the motion at {parameter} = {orbit.system[parameter]:.10g} repeats after {periods}, so it is not a "
            f"motion of period {orbit.period}; write period = {shortest}, or start on a motion of period "
            f"{orbit.period}: one begins at each flip of half of it, gw.follow(flip, ...) in Python and "
            'kind = "diagram" in a file'
        )


def _leave(equation: OrbitEquation, orbit: Orbit, within: Range, direction: int) -> BranchStart:
    """Return the beginning at an orbit, refining the equation until the orbit is resolved."""
    start = orbit.system[equation.parameter or ""]
    corrector = Corrector(equation, scales_of(equation, orbit, within))
    x = np.append(equation.unknowns(orbit), start) / corrector.scales
    correction = corrector.at_value(x, start)
    if correction is None:
        finer = equation.finer() if len(orbit.restarts) else None  # it was found in more segments
        if finer is not None:
            return _leave(finer, orbit, within, direction)
        raise ConvergenceError(f"the start is not a period-{orbit.period} orbit at {equation.parameter} = {start:.10g}")
    ahead = np.zeros(len(x))
    ahead[-1] = direction
    first = corrector.point(correction, ahead, 0.0)
    inaccuracy = equation.inaccuracy(first.orbit)
    if not inaccuracy:
        return BranchStart(corrector, first, within)
    finer = equation.finer()
    if finer is None:
        raise ConvergenceError(inaccuracy)
    return _leave(finer, first.orbit, within, direction)


def refined(beginning: BranchStart) -> BranchStart | None:
    """Return the beginning with the next finer resolution of its equation; None if there is none."""
    equation = beginning.equation.finer()
    if equation is None:
        return None
    first = beginning.first
    corrector = Corrector(equation, scales_of(equation, first.orbit, beginning.within))
    lifted = lift(first, corrector)
    if lifted is None and beginning.singular:  # Newton's method may fail where two branches meet
        x = np.append(equation.unknowns(first.orbit), first.value) / corrector.scales
        lifted = corrector.uncorrected(x, np.eye(len(x))[-1], first.arclength)
    return None if lifted is None else replace(beginning, corrector=corrector, first=lifted)


def lift(point: BranchPoint, corrector: Corrector) -> BranchPoint | None:
    """Return a point of a branch, corrected for a finer equation of the branch; None if Newton's method fails."""
    equation = cast("OrbitEquation", corrector.equation)
    x = np.append(equation.unknowns(point.orbit), point.value) / corrector.scales
    along = np.zeros(len(x))
    along[-1] = np.sign(point.tangent[-1]) or 1.0
    tangent = corrector.tangent(corrector.evaluate(x), along).tangent
    correction = corrector.correct(x, tangent)
    if correction is None:  # the point is far from solving the finer equation: damped steps at a fixed parameter
        try:
            unknowns, _ = solve(equation, x[:-1] * corrector.scales[:-1], point.value)
        except NumericalError:
            return None
        correction = corrector.at_value(np.append(unknowns, point.value) / corrector.scales, point.value)
        if correction is None:
            return None
    return corrector.point(correction, tangent, point.arclength)


def directions(start: float, to: float | tuple[float, float]) -> tuple[int, ...]:
    """Return the directions, +1 or -1, in which a branch must leave its start to cover the range."""
    within = check_range(start, to)
    if isinstance(to, int | float):
        return (1,) if to > start else (-1,)
    return tuple(sign for sign, bound in ((-1, within.low), (1, within.high)) if bound != start)


def switch(
    special: SpecialPoint, parameter: str, to: tuple[float, float], method: Method | None = None
) -> list[BranchStart]:
    """Return the beginnings of the other branches at a special point."""
    # At a flip there is one, on the branch of twice the period: the opposite direction gives the same motions, shifted
    # by one period. At a branch point there are two, in both directions of the crossing branch.
    within = check_range(special.value, to).along(parameter, special.orbit.system)
    if special.multiplicity > (2 if special.kind.is_turning else 1):
        raise ConvergenceError(
            f"{special.multiplicity} multipliers become critical at once at the {special.kind_words} at "
            f"{special.value:.10g}, so that the directions of the other branches are not determined; make the parts a "
            "little unequal, or start on a motion of such a branch: gw.find_orbit with another start, or gw.search"
        )
    # slopes are infinite at a special point; a value that is zero but for its error is no unit of the parameter
    own = abs(special.value)
    within = replace(within, natural=own if own > _OWN * within.width else within.width)
    return special.kind.beginnings(special, parameter, within, chosen(method))


def posed_for(
    special: SpecialPoint, parameter: str, period: int, method: Method
) -> tuple[OrbitEquation, OrbitEquation]:
    """Return the equation with which a special point was found, and one of the same resolution for another period."""
    found, equation = (method.pose(special.orbit.system, parameter, m) for m in (special.orbit.period, period))
    while len(found.scales(1.0)) < len(special.point.x) - 1:
        finer, other = equation.finer(), found.finer()
        if finer is None or other is None:
            break
        equation, found = finer, other
    return found, equation


def halves_apart(point: BranchPoint) -> NDArray[np.float64]:
    """Return the state after half the period minus the initial state, relative to the size of the state."""
    # It is zero on an orbit of half the period, and changes sign through zero where a period-doubled branch passes
    # through its parent.
    return _apart(point)[point.orbit.period // 2]


def _apart(point: BranchPoint) -> NDArray[np.float64]:
    """Return the states up to half the period minus the initial state, relative to its size, one row per period."""
    known = point.memo.get(_apart)
    if known is None:
        orbit = point.orbit
        states = returns(orbit, orbit.period // 2 + 1)
        known = point.memo[_apart] = (states - orbit.state) / magnitude(orbit.state, orbit.system)
    return known


def period_of(point: BranchPoint) -> int:
    """Return the number of forcing periods after which the motion of a point repeats, which divides its period."""
    period = point.orbit.period
    parts = [k for k in range(1, period // 2 + 1) if period % k == 0]
    return next((k for k in parts if float(np.abs(_apart(point)[k]).max()) < _MERGED), period)


def has_merged(point: BranchPoint) -> bool:
    """Return True if the motion of a point is one of a shorter period: it lies on another branch."""
    # Of a branch that has begun at a flip that is its parent, or the parent of that.
    return period_of(point) < point.orbit.period


def is_close(point: BranchPoint) -> bool:
    """Return True if the orbit of a point nearly repeats after half its period."""
    return float(np.abs(halves_apart(point)).max()) < _CLOSE


def value_between(first: BranchPoint, last: BranchPoint, scale: float) -> float | None:
    """Return the parameter between two points at which both halves of the orbit coincide; None if they do not."""
    # It follows from the cubic through the two points.
    a, b = halves_apart(first), halves_apart(last)
    if float(a @ b) >= 0.0 or min(float(np.abs(a).max()), float(np.abs(b).max())) >= 10 * _CLOSE:
        return None
    before, after = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    return float(hermite(first, last, before / (before + after))[-1]) * scale


def value_ahead(before: BranchPoint, last: BranchPoint, scale: float) -> float | None:
    """Return the parameter at which the halves will coincide, just beyond two points; None if they do not approach."""
    # The difference of the halves is linear in arclength. The parameter is quadratic in it at a flip, where the branch
    # turns back, and linear where the motion of the parent changes its sequence; the tangent tells how it goes on.
    a, b = (float(np.linalg.norm(halves_apart(point))) for point in (before, last))
    step = last.arclength - before.arclength
    if a <= b or not step:
        return None
    slope, mean = float(last.tangent[-1]) * scale, (last.value - before.value) / step
    ahead = step * b / (a - b)
    return last.value + ahead * (slope + ahead * (slope - mean) / step)


def has_parent(point: BranchPoint, equation: OrbitEquation, value: float) -> bool:
    """Return True if there is a motion of half the period at a value of the parameter, between the halves of a point.

    Beside a graze the halves of a doubled motion may be close, and a step fail, where no other branch is. Where a force
    jumps, a motion with touches that vanish at the graze is not twice the one without them.
    """
    orbit, half = point.orbit, point.orbit.period // 2
    system = orbit.system.at({equation.parameter or "": value})
    start = 0.5 * (orbit.state + returns(orbit, half + 1)[half])
    try:
        found = find_orbit(system, half, start, method=equation.options)
    except NumericalError:
        return False
    if any(2 * found.closings[each] != orbit.closings[each] for each in jumping_switches(system, friction=False)):
        return False
    apart = float(np.abs(halves_apart(point)).max())
    return float(np.abs(found.state - start).max()) < _PARENT * apart * magnitude(orbit.state, orbit.system)
