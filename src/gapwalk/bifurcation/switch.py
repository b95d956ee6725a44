"""Switch branches: leave a special point along the branches that begin or cross there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.departure import Departure
from gapwalk.continuation.branch import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import Range, check_range, scales_of
from gapwalk.errors import ModelError
from gapwalk.orbit.equation import Method, OrbitEquation
from gapwalk.orbit.shooting import Shooting


def switch(
    special: SpecialPoint, parameter: str, to: tuple[float, float], method: Method | None = None
) -> list[Departure]:
    """The departures along the other branches at a special point.

    At a flip there is one, on the branch of twice the period: the other direction is the same motion, one period
    later. At a branch point there are two, in both directions of the branch that crosses.

    Parameters
    ----------
    special
        A flip or a branch point.
    parameter
        Name of the parameter to follow.
    to
        Range of the parameter.
    method
        How orbits are posed.

    Raises
    ------
    ModelError
        If no other branch leaves a special point of this kind, or the range does not hold it.
    """
    within = check_range(special.value, to)
    if special.kind is Kind.FLIP:
        return [_from_flip(special, parameter, within, method or Shooting())]
    if special.kind is Kind.BRANCH_POINT:
        return _from_crossing(special, parameter, within, method or Shooting())
    raise ModelError(
        f"no other branch of periodic motions leaves a {special.kind.value}; switch at a flip or at a branch point"
    )


def _from_flip(special: SpecialPoint, parameter: str, within: Range, method: Method) -> Departure:
    orbit = special.orbit
    equation = _posed(special, parameter, 2 * orbit.period, method)
    corrector = Corrector(equation, scales_of(equation, orbit, within))
    start = np.append(equation.unknowns(replace(orbit, period=2 * orbit.period)), special.value)
    return Departure(corrector, _first(corrector, start, _flip_direction(corrector, start)), within, singular=True)


def _flip_direction(corrector: Corrector, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """The null vector of the doubled equation at a flip, with the parameter held: it exists to second order only."""
    evaluation = corrector.equation.evaluate(start[:-1], float(start[-1]))
    scaled = evaluation.by_unknowns * corrector.scales[:-1]
    vector = np.linalg.svd(scaled)[2][-1]
    vector *= np.sign(vector[np.argmax(np.abs(vector))])  # the same one each time
    return np.append(vector, 0.0)


def _from_crossing(special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[Departure]:
    equation = _posed(special, parameter, special.orbit.period, method)
    corrector = Corrector(equation, scales_of(equation, special.orbit, within))
    start = np.append(equation.unknowns(special.orbit), special.value)
    evaluation = corrector.equation.evaluate(start[:-1], float(start[-1]))
    assert evaluation.by_parameter is not None
    jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
    # both branches lie in the plane of the two smallest singular vectors; the other one is across the known tangent
    plane = np.linalg.svd(jacobian)[2][-2:]
    known = plane @ _rescaled(special.point, start, corrector)
    across = np.array([-known[1], known[0]]) @ plane
    across /= np.linalg.norm(across)
    across *= np.sign(across[np.argmax(np.abs(across))])
    return [Departure(corrector, _first(corrector, start, way * across), within, singular=True) for way in (1.0, -1.0)]


def _rescaled(point: BranchPoint, start: NDArray[np.float64], corrector: Corrector) -> NDArray[np.float64]:
    """The tangent of a point that was found with other scales, in those of the corrector."""
    if len(point.x) != len(start):
        raise ModelError("switch with the method, and its segments or harmonics, with which the branch point was found")
    scales = np.divide(start, point.x, out=corrector.scales.copy(), where=point.x != 0.0)
    rescaled = point.tangent * scales / corrector.scales
    return rescaled / np.linalg.norm(rescaled)


def _posed(special: SpecialPoint, parameter: str, period: int, method: Method) -> OrbitEquation:
    """The equation for a period, as finely resolved as that with which the special point was found."""
    found, equation = (method.pose(special.orbit.system, parameter, m) for m in (special.orbit.period, period))
    while len(found.scales(1.0)) < len(special.point.x) - 1:
        finer, other = equation.finer(), found.finer()
        if finer is None or other is None:
            break
        equation, found = finer, other
    return equation


def _first(corrector: Corrector, start: NDArray[np.float64], tangent: NDArray[np.float64]) -> BranchPoint:
    return corrector.uncorrected(start / corrector.scales, tangent, 0.0)
