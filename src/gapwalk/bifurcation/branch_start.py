"""Beginning of a walk: an orbit on its branch, and a direction along a parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.walk_options import Range, check_range
from gapwalk.continuation.walk_scales import scales_of, with_natural_change
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit, true_period
from gapwalk.orbit.orbit_equation import OrbitEquation, solve


@dataclass(frozen=True)
class BranchStart:
    """Point and direction from which a branch can be walked.

    Attributes
    ----------
    corrector
        Corrector for the branch; it holds the equation and the scales.
    first
        The point; its tangent gives the direction.
    within
        Range of the parameter.
    singular
        True if the branch begins here, at a bifurcation of another one.
    """

    corrector: Corrector
    first: BranchPoint
    within: Range
    singular: bool = False

    @property
    def equation(self) -> OrbitEquation:
        """Equation whose solutions form the branch."""
        return cast("OrbitEquation", self.corrector.equation)  # loci use correctors too, but begin differently


def start_branch(
    orbit: Orbit,
    parameter: str,
    to: float | tuple[float, float],
    direction: int,
    method: Method | None = None,
) -> BranchStart:
    """Begin a branch at an orbit, towards larger (+1) or smaller (-1) values of a parameter.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not contain the orbit, or one that contains invalid systems.
    ConvergenceError
        If the orbit is not periodic to the tolerance of the method, or repeats a motion of a shorter period.
    """
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
    lifted = lift(first, corrector, equation)
    return None if lifted is None else replace(beginning, corrector=corrector, first=lifted)


def lift(point: BranchPoint, corrector: Corrector, equation: OrbitEquation) -> BranchPoint | None:
    """Return a point of a branch, posed by a finer equation of the same branch; None if Newton's method fails."""
    x = np.append(equation.unknowns(point.orbit), point.value) / corrector.scales
    along = np.zeros(len(x))
    along[-1] = np.sign(point.tangent[-1]) or 1.0
    evaluation = equation.evaluate(x[:-1] * corrector.scales[:-1], point.value)
    tangent = corrector.tangent(evaluation, along).tangent
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
