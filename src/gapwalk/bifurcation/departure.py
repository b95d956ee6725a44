"""Where a walk can begin: an orbit on its branch, heading one way along a parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.range import Range, check_range
from gapwalk.continuation.scales import scales_of, with_natural_change
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.orbit.equation import OrbitEquation
from gapwalk.orbit.identity import true_period
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.newton import solve
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True)
class Departure:
    """A point and a direction from which a branch can be walked.

    Attributes
    ----------
    corrector
        Corrects onto the branch; it holds the equation and the scales.
    first
        The point; its tangent gives the direction.
    within
        Range of the parameter.
    singular
        Whether the branch begins here, at a bifurcation of another one.
    """

    corrector: Corrector
    first: BranchPoint
    within: Range
    singular: bool = False

    @property
    def equation(self) -> OrbitEquation:
        """The equation whose solutions form the branch."""
        return cast("OrbitEquation", self.corrector.equation)  # a corrector serves loci as well, which depart otherwise


def depart(
    orbit: Orbit,
    parameter: str,
    to: float | tuple[float, float],
    direction: int,
    method: Method | None = None,
) -> Departure:
    """Leave an orbit along a parameter, towards larger (+1) or smaller (-1) values.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not hold the orbit, or one that leads where no system is.
    ConvergenceError
        If the orbit is none, to the tolerance of the method, or one of a shorter period gone round several times.
    """
    start = orbit.system[parameter]
    _check_period(orbit, parameter)
    within = check_range(start, to).along(parameter, orbit.system)
    for bound in (within.low, within.high):
        orbit.system.at({parameter: bound})
    equation = chosen(method).pose(orbit.system, parameter, orbit.period)
    return _leave(equation, orbit, with_natural_change(within, equation, orbit), direction)


def _check_period(orbit: Orbit, parameter: str) -> None:
    """A ConvergenceError for a motion of a shorter period: walked so, its flips would be branch points."""
    shortest = true_period(orbit)
    periods = "1 forcing period" if shortest == 1 else f"{shortest} forcing periods"
    if shortest < orbit.period:
        raise ConvergenceError(
            f"the motion at {parameter} = {orbit.system[parameter]:.10g} repeats after {periods}, so it is none "
            f"of period {orbit.period}; write period = {shortest}, or a start on a motion of period {orbit.period}: "
            'one leaves each flip of half of it, gw.follow(flip, ...) in Python and kind = "diagram" in a file'
        )


def _leave(equation: OrbitEquation, orbit: Orbit, within: Range, direction: int) -> Departure:
    """The departure from an orbit, as finely resolved as it takes."""
    start = orbit.system[equation.parameter or ""]
    corrector = Corrector(equation, scales_of(equation, orbit, within))
    x = np.append(equation.unknowns(orbit), start) / corrector.scales
    correction = corrector.at_value(x, start)
    if correction is None:
        raise ConvergenceError(f"the start is no period-{orbit.period} orbit at {equation.parameter} = {start:.10g}")
    ahead = np.zeros(len(x))
    ahead[-1] = direction
    first = corrector.point(correction, ahead, 0.0)
    doubt = equation.doubt(first.orbit)
    if not doubt:
        return Departure(corrector, first, within)
    finer = equation.finer()
    if finer is None:
        raise ConvergenceError(doubt)
    return _leave(finer, first.orbit, within, direction)


def refined(departure: Departure) -> Departure | None:
    """The same departure with the next finer resolution of its equation; None where there is none."""
    equation = departure.equation.finer()
    if equation is None:
        return None
    first = departure.first
    corrector = Corrector(equation, scales_of(equation, first.orbit, departure.within))
    lifted = lift(first, corrector, equation)
    return None if lifted is None else replace(departure, corrector=corrector, first=lifted)


def lift(point: BranchPoint, corrector: Corrector, equation: OrbitEquation) -> BranchPoint | None:
    """A point of a branch as one of the same branch posed by a finer equation; None if Newton's method fails."""
    x = np.append(equation.unknowns(point.orbit), point.value) / corrector.scales
    along = np.zeros(len(x))
    along[-1] = np.sign(point.tangent[-1]) or 1.0
    evaluation = equation.evaluate(x[:-1] * corrector.scales[:-1], point.value)
    tangent = corrector.tangent(evaluation, along).tangent
    correction = corrector.correct(x, tangent)
    if correction is None:  # the finer equation is far from solved: damped steps, with the parameter held
        try:
            unknowns, _ = solve(equation, x[:-1] * corrector.scales[:-1], point.value)
        except NumericalError:
            return None
        correction = corrector.at_value(np.append(unknowns, point.value) / corrector.scales, point.value)
        if correction is None:
            return None
    return corrector.point(correction, tangent, point.arclength)


def directions(start: float, to: float | tuple[float, float]) -> tuple[int, ...]:
    """The directions, +1 or -1, in which a branch leaves its start to cover the range."""
    within = check_range(start, to)
    if isinstance(to, int | float):
        return (1,) if to > start else (-1,)
    return tuple(sign for sign, bound in ((-1, within.low), (1, within.high)) if bound != start)
