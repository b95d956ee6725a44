"""Where a walk can begin: an orbit on its branch, heading one way along a parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import Range, check_range, scales_of
from gapwalk.errors import ConvergenceError
from gapwalk.orbit.equation import Equation
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation


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
    def equation(self) -> Equation:
        """The equation whose solutions form the branch."""
        return self.corrector.equation


def depart(
    orbit: Orbit,
    parameter: str,
    to: float | tuple[float, float],
    direction: int,
    shooting: Shooting | None = None,
) -> Departure:
    """Leave an orbit along a parameter, towards larger (+1) or smaller (-1) values.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not hold the orbit, or one that leads where no system is.
    ConvergenceError
        If the orbit is none, to the tolerance of the method.
    """
    start = orbit.system[parameter]
    within = check_range(start, to)
    for bound in (within.low, within.high):
        orbit.system.at({parameter: bound})
    equation = ShootingEquation(orbit.system, parameter, orbit.period, shooting or Shooting())
    corrector = Corrector(equation, scales_of(equation, orbit, within))
    x = np.append(equation.unknowns(orbit), start) / corrector.scales
    correction = corrector.at_value(x, start)
    if correction is None:
        raise ConvergenceError(f"the start is no period-{orbit.period} orbit at {parameter} = {start:.10g}")
    ahead = np.zeros(len(x))
    ahead[-1] = direction
    return Departure(corrector, corrector.point(correction, ahead, 0.0), within)


def directions(start: float, to: float | tuple[float, float]) -> tuple[int, ...]:
    """The directions, +1 or -1, in which a branch leaves its start to cover the range."""
    within = check_range(start, to)
    if isinstance(to, int | float):
        return (1,) if to > start else (-1,)
    return tuple(sign for sign, bound in ((-1, within.low), (1, within.high)) if bound != start)
