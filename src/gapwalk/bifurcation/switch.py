"""Branch switching: the beginnings of the branches that begin or cross at a special point.

A period-doubled branch begins with motions whose two halves differ, and ends where that difference vanishes.

Method: docs/numerics/switching.md
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.branch_start import BranchStart
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.walk_options import Range, check_range
from gapwalk.continuation.walk_scales import scales_of
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation

_SINGULAR = 1e-8  # singular value that is zero up to rounding
_BESIDE = 1e-5  # scaled distance along the parent of the first step of the secant method
_ITERATIONS, _SETTLED = 12, 1e-13  # of inverse iteration, and the change of a unit vector at which it ends
_STEPS = 6  # largest number of steps of the secant method
_FAR = 0.05  # scaled distance beyond which a branch point does not belong to the flip
MERGED = 1e-7
"""Relative difference between the halves of an orbit below which it has half the period."""
_CLOSE = 1e-2  # relative difference between the halves below which an orbit is close to one of half the period


class DoubledStart(NamedTuple):
    """Branch point of the equation of twice the period near a flip.

    Attributes
    ----------
    unknowns : shape (N + 1,)
        Its unknowns and the parameter, not scaled.
    across : shape (N,)
        Scaled null vector at a fixed parameter.
    place
        Scaled distance from the flip along the parent, as in `Doubled.along`.
    """

    unknowns: NDArray[np.float64]
    across: NDArray[np.float64]
    place: float


def switch(
    special: SpecialPoint, parameter: str, to: tuple[float, float], method: Method | None = None
) -> list[BranchStart]:
    """Return the beginnings of the other branches at a special point.

    At a flip there is one, on the branch of twice the period: the opposite direction gives the same motions, shifted by
    one period. At a branch point there are two, in both directions of the crossing branch.

    Parameters
    ----------
    special
        A flip or a branch point.
    parameter
        Name of the parameter to follow.
    to
        Range of the parameter.
    method
        Discretisation of the orbits.

    Raises
    ------
    ModelError
        If no other branch begins at a special point of this kind, or the range does not contain it.
    """
    within = check_range(special.value, to).along(parameter, special.orbit.system)
    within = replace(within, natural=abs(special.value) or within.width)  # slopes are infinite at a special point
    return special.kind.beginnings(special, parameter, within, chosen(method))


def from_flip(special: SpecialPoint, parameter: str, within: Range, method: Method) -> BranchStart:
    """Return the beginning of the branch of twice the period at a flip."""
    doubled = Doubled(special, parameter, within, method)
    start, across, _ = doubled.start()
    return BranchStart(
        doubled.corrector, _first(doubled.corrector, start, np.append(across, 0.0)), within, singular=True
    )


class Doubled:
    """Equation of twice the period near a flip; the motions of the parent solve it too.

    Parameters
    ----------
    special
        The flip.
    parameter
        Name of the parameter to follow.
    within
        Range of the parameter.
    method
        Discretisation of the orbits.

    Attributes
    ----------
    corrector, parent
        Correctors for the doubled equation and for the parent.
    special
        The flip.
    """

    def __init__(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> None:
        found, equation = _posed(special, parameter, 2 * special.orbit.period, method)
        self.special = special
        self.corrector = Corrector(equation, scales_of(equation, special.orbit, within))
        self.parent = Corrector(found, scales_of(found, special.orbit, within))

    def start(self) -> DoubledStart:
        """Locate the branch point of the doubled equation.

        In shooting this is the flip. In harmonic balance the multipliers of a motion are more accurate than its
        truncated equation, which has its own flip nearby: the secant method along the parent locates it.
        """
        start = self._doubled(self.special.orbit)
        left, least, right = least_singular(self._jacobian(start))
        way = np.sign(right[np.argmax(np.abs(right))])
        across = right * way
        if least < _SINGULAR:
            return DoubledStart(start, across, 0.0)
        borders = left * way, across
        places, sizes, best = [0.0, _BESIDE], [least], 0.0
        try:
            for _ in range(_STEPS):
                beside = self.along(places[-1])
                size, vector = self._singular(beside, *borders)
                sizes.append(size)
                if abs(size) < least:
                    least, start, across, best = abs(size), beside, vector, places[-1]
                rise = sizes[-1] - sizes[-2]
                if least < _SINGULAR or rise == 0.0:
                    break
                places.append(places[-1] - size * (places[-1] - places[-2]) / rise)
                if abs(places[-1]) > _FAR:
                    break
        except (NumericalError, np.linalg.LinAlgError):
            pass  # use the nearest place so far
        return DoubledStart(start, across, best)

    def _singular(
        self, start: NDArray[np.float64], left: NDArray[np.float64], right: NDArray[np.float64]
    ) -> tuple[float, NDArray[np.float64]]:
        """Return the signed distance of the Jacobian from singularity, and its null vector there.

        Bordered by the null vectors of a place nearby, it stays regular (Govaerts 2000, section 3.2):

            [ J        left ] [ v  ]     [ 0 ]
            [ right^T       ] [ -s ]  =  [ 1 ]

        Where J is singular, s changes sign and v is its null vector; nearby s is about the smallest singular value.
        """
        size = len(left)
        matrix, unit = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1, :-1] = self._jacobian(start), left, right
        unit[-1] = 1.0
        solution = np.linalg.solve(matrix, unit)
        return -float(solution[-1]), solution[:-1] / np.linalg.norm(solution[:-1])

    def _jacobian(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the Jacobian of the doubled equation with respect to the scaled unknowns."""
        evaluation = self.corrector.equation.evaluate(start[:-1], float(start[-1]))
        return evaluation.by_unknowns * self.corrector.scales[:-1]

    def along(self, step: float) -> NDArray[np.float64]:
        """Return the unknowns of the doubled equation and the parameter at a scaled distance along the parent.

        Raises
        ------
        NumericalError
            If the parent could not be followed there.
        """
        x, tangent = self._flip
        correction = self.parent.correct(x + step * tangent, tangent)
        if correction is None:
            raise ConvergenceError("the branch with the flip could not be followed in its neighbourhood")
        value = float(correction.x[-1] * self.parent.scales[-1])
        unknowns = correction.x[:-1] * self.parent.scales[:-1]
        return self._doubled(self.parent.equation.orbit(unknowns, value, correction.evaluation))

    @cached_property
    def _flip(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Scaled variables of the parent at the flip, and its tangent there, towards larger parameters."""
        parent, value = self.parent, self.special.value
        x = np.append(parent.equation.unknowns(self.special.orbit), value) / parent.scales
        evaluation = parent.equation.evaluate(x[:-1] * parent.scales[:-1], value)
        return x, parent.tangent(evaluation, np.append(np.zeros(len(x) - 1), 1.0)).tangent

    def _doubled(self, orbit: Orbit) -> NDArray[np.float64]:
        equation = self.corrector.equation
        unknowns = equation.unknowns(replace(orbit, period=2 * orbit.period))
        return np.append(unknowns, orbit.system[equation.parameter or ""])


def _posed(special: SpecialPoint, parameter: str, period: int, method: Method) -> tuple[OrbitEquation, OrbitEquation]:
    """Return the equation with which a special point was found, and one of the same resolution for another period."""
    found, equation = (method.pose(special.orbit.system, parameter, m) for m in (special.orbit.period, period))
    while len(found.scales(1.0)) < len(special.point.x) - 1:
        finer, other = equation.finer(), found.finer()
        if finer is None or other is None:
            break
        equation, found = finer, other
    return found, equation


def least_singular(
    matrix: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Return the smallest singular value of a matrix, between its left and right singular vectors.

    Inverse iteration with one factorisation takes a tenth of the time of a full singular value decomposition if the
    matrix is large because of many harmonics. Its errors fall with the square of the ratio of the two smallest values.
    """
    factors, pivots, exact_zero = lapack.dgetrf(matrix)
    right = np.full(len(matrix), len(matrix) ** -0.5)
    for _ in range(_ITERATIONS if not exact_zero else 0):
        left = lapack.dgetrs(factors, pivots, right, trans=1)[0]
        left /= np.linalg.norm(left)
        following = lapack.dgetrs(factors, pivots, left)[0]
        size = 1.0 / float(np.linalg.norm(following))
        following *= size
        change, right = float(np.linalg.norm(following - right)), following
        if change < _SETTLED:
            return left, size, right
    left_vectors, values, right_vectors = np.linalg.svd(matrix)
    return left_vectors[:, -1], float(values[-1]), right_vectors[-1]


def _first(corrector: Corrector, start: NDArray[np.float64], tangent: NDArray[np.float64]) -> BranchPoint:
    return corrector.uncorrected(start / corrector.scales, tangent, 0.0)


def from_crossing(special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
    """Return the beginnings in both directions of the branch that crosses at a branch point."""
    _, equation = _posed(special, parameter, special.orbit.period, method)
    corrector = Corrector(equation, scales_of(equation, special.orbit, within))
    start = np.append(equation.unknowns(special.orbit), special.value)
    evaluation = corrector.equation.evaluate(start[:-1], float(start[-1]))
    assert evaluation.by_parameter is not None
    jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
    # both branches lie in the plane of the two smallest singular vectors; the other one is normal to the known tangent
    plane = np.linalg.svd(jacobian)[2][-2:]
    known = plane @ _rescaled(special.point, start, corrector)
    across = np.array([-known[1], known[0]]) @ plane
    across /= np.linalg.norm(across)
    across *= np.sign(across[np.argmax(np.abs(across))])
    return [
        BranchStart(corrector, _first(corrector, start, way * across), within, singular=True) for way in (1.0, -1.0)
    ]


def _rescaled(point: BranchPoint, start: NDArray[np.float64], corrector: Corrector) -> NDArray[np.float64]:
    """Return the tangent of a point found with other scales, in the scales of the corrector."""
    if len(point.x) != len(start):
        raise ModelError(
            "switch with the method, and the number of segments or harmonics, with which the branch point was found"
        )
    scales = np.divide(start, point.x, out=corrector.scales.copy(), where=point.x != 0.0)
    rescaled = point.tangent * scales / corrector.scales
    return rescaled / np.linalg.norm(rescaled)


def has_merged(point: BranchPoint) -> bool:
    """Return whether the orbit of a point has half its period, so that it lies on the parent branch."""
    return float(np.abs(_apart(point)).max()) < MERGED


def _apart(point: BranchPoint) -> NDArray[np.float64]:
    known = point.memo.get("halves apart")
    if known is None:
        known = point.memo["halves apart"] = halves_apart(point.orbit)
    return known


def halves_apart(orbit: Orbit) -> NDArray[np.float64]:
    """Return the state after half the period minus the initial state, shape (2n,), relative to the size of the state.

    It is zero on an orbit of half the period, and changes sign through zero where a period-doubled branch passes
    through its parent.
    """
    half = orbit.strobes(orbit.period // 2 + 1)[-1]
    return (half - orbit.state) / magnitude(orbit.state, orbit.system)


def is_close(point: BranchPoint) -> bool:
    """Return whether the orbit of a point nearly repeats after half its period."""
    return float(np.abs(_apart(point)).max()) < _CLOSE


def passes_parent(first: BranchPoint, last: BranchPoint) -> bool:
    """Return whether the halves of the orbit exchange places between two neighbouring points."""
    a, b = _apart(first), _apart(last)
    return float(a @ b) < 0.0 and min(float(np.abs(a).max()), float(np.abs(b).max())) < 10 * _CLOSE


def value_between(first: BranchPoint, last: BranchPoint, scale: float) -> float:
    """Return the parameter at which the halves coincide between two points, by the cubic through them."""
    a, b = _size(first), _size(last)
    return float(hermite(first, last, a / (a + b))[-1]) * scale


def _size(point: BranchPoint) -> float:
    return float(np.linalg.norm(_apart(point)))


def value_ahead(before: BranchPoint, last: BranchPoint) -> float:
    """Return the parameter at which the halves will coincide, just beyond two points.

    The branch turns back there: the difference of the halves is linear in arclength, and the parameter quadratic in it.
    """
    a, b = _size(before) ** 2, _size(last) ** 2
    return last.value if a <= b else (a * last.value - b * before.value) / (a - b)
