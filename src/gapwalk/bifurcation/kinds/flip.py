"""Flips: a multiplier passes -1, and a branch of twice the period begins.

A flip is supercritical if the doubled motions lie on the side where the parent has lost stability. That is determined
in the limit towards the flip, from the cubic coefficient of its normal form, because the doubled branch may soon turn
back if a contact grazes close to the flip. The doubled branch itself then shows up to which amplitude it continues in
its initial direction.

Method: docs/numerics/switching.md
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.bifurcation.branch_start import BranchStart, posed_for
from gapwalk.bifurcation.kinds.defining_functions import (
    Criticality,
    bounded_product,
    nearest,
    offsets_from,
    smallest_singular_value,
)
from gapwalk.bifurcation.special_point import REACH, Kind, SpecialPoint, Symbol
from gapwalk.continuation.corrector import Corrector, Range, check_range, scales_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, NumericalError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.equations import magnitude
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation
from gapwalk.orbit.shooting import Shooting, ShootingEquation

_DISPLACEMENTS = (6e-5, 6e-6)  # in units of the unknowns: longer ones show curvature, shorter ones rounding
_ALIKE = 0.05  # relative change of an impact velocity within which displaced orbits make the same contact
_PLACES = (-2.0, -1.0, 1.0, 2.0)
_FIRST = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0  # fourth-order differences at those places
_SECOND = np.array([-1.0, 16.0, 16.0, -1.0]) / 12.0
_SECOND_HERE = -30.0 / 12.0

_STEPS = (6e-5, 6e-6, 6e-7, 6e-8, 6e-9, 6e-10)
"""Displacements, in units of the unknowns, for the cubic coefficient: the longest without a graze is used.

Near the flips of the paper's figure 15, contacts graze at amplitudes from 1e-3 down to 1e-8.
"""
_SINGULAR = 1e-8  # singular value that is zero up to rounding
_BESIDE = 1e-5  # scaled distance along the parent of the first step of the secant method
_SECANTS = 6  # largest number of steps of the secant method
_FAR = 0.05  # scaled distance beyond which a branch point does not belong to the flip
_ITERATIONS, _SETTLED = 12, 1e-13  # of inverse iteration, and the change of a unit vector at which it ends
_SURE = 0.05  # relative error of the cubic coefficient up to which its sign counts
_STEPS_ALONG = 16  # largest number of steps along the doubled branch
_LONGER, _SHORTER = 4.0, 0.4  # ratio of the next step to the present one after success and after failure
_CAREFUL = 1.5  # factor by which that ratio grows again after a failure, from 1
_NARROW, _BEFORE = 0.15, 0.9  # step, as a share of the way, within which the turn is interpolated; aim just before it
_LEAST, _NEARLY = 0.01, 0.8  # shortest step, as a share of the way from the flip; share of the amplitude that is enough
_CORRECTIONS, _SLOW = 5, 0.7  # Newton steps for one point, and the ratio of two of them at which it is given up
_CLOSE, _CLOSER = 0.1, 1e-6  # the last of them, in steps along the branch; the same where the branch seems to turn
_ASIDE = 0.3  # distance from a guess, in steps, beyond which a motion may lie on another branch
Matrix = tuple[NDArray[np.float64], Sequence[ContactEvent]]
"""Derivative of a map or of an equation at a point, in units of its unknowns, and the contacts of the motion there."""


class Flip(Kind):
    """Period doubling: the product of ``mu + 1`` over all multipliers is zero."""

    symbol = Symbol("flip (PD)", "PD", "D", 4.3, "vermillion", (0.0, (4.5, 1.4)))
    target = -1.0
    ways, times = 1, 2
    sign_change = "a flip is passed"

    def function(self, point: BranchPoint) -> float:
        """Return the product of ``mu + 1``."""
        return bounded_product(nearest(point.orbit.free_multipliers + 1.0))

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the distances of the multipliers from -1, positive below."""
        return offsets_from(-1.0, multipliers)

    def judged(self, special: SpecialPoint, parameter: str, method: Method | None) -> SpecialPoint:
        """Return the flip with `nature` and `judged`; unchanged if the criticality cannot be determined."""
        gained = special.after.total - special.before.total
        if abs(gained) != 1:
            return special
        width = abs(special.value) + 1.0
        within = check_range(special.value, (special.value - width, special.value + width))
        within = within.along(parameter, special.orbit.system)
        method = chosen(method)
        try:
            single = _map_of(special, parameter, method)
            fine = method if single is None else _in_segments(method, special.orbit.period)
            doubled = Doubled(special, parameter, within, fine)
            start = doubled.start()
            limit = _limit(doubled, start, single)
        except (NumericalError, np.linalg.LinAlgError):
            return special
        if limit is None:
            return special
        # two multipliers that meet in the same step do not matter: only one at -1 changes the number of unstable ones
        unstable = gained * np.sign(special.point.tangent[-1])
        return replace(
            special,
            nature="supercritical" if limit.way == unstable else "subcritical",
            judged=_amplitude(doubled, start, limit),
        )

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return one beginning, on the branch of twice the period: the other direction gives the same motions."""
        doubled = Doubled(special, parameter, within, method)
        start, across, _ = doubled.start()
        return [BranchStart.uncorrected(doubled.corrector, start, np.append(across, 0.0), within)]

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the distance of a multiplier from -1."""
        return smallest_singular_value(monodromy + np.eye(len(monodromy)))


class Cubic(NamedTuple):
    """Cubic coefficient of a flip."""

    value: float  #: The coefficient; nan if contacts graze within every displacement that was tried.
    #: Difference from the coefficient by second-order differences: the effect of curvature or of rounding.
    error: float


class _Limit(NamedTuple):
    """Doubled motions of vanishing amplitude."""

    way: int  #: +1 if they lie at larger values of the parameter than the flip, -1 if at smaller ones.
    #: size, amplitude: Displacement over which that was measured: scaled, and in units of the state.
    size: float
    amplitude: float


def _in_segments(method: Method, period: int) -> Method:
    """Return the method with which a flip of a period is judged: if it is shooting, a segment is two forcing periods.

    In one segment of 16 forcing periods, a small displacement grows beyond the next graze, and only short steps lead
    along the doubled branch.
    """
    return replace(method, segments=max(method.segments, period)) if isinstance(method, Shooting) else method


def _map_of(special: SpecialPoint, parameter: str, method: Method) -> OrbitEquation | None:
    """Return the equation whose derivatives are those of the map over the period of a flip, less the identity.

    It takes half the time of the doubled equation. None for other methods than shooting in one segment, and where
    friction or rigid stops make it another equation.
    """
    structure = special.orbit.system.structure
    if not isinstance(method, Shooting) or method.segments > 1 or structure.friction or structure.reactions:
        return None
    return method.pose(special.orbit.system, parameter, special.orbit.period)


def _limit(doubled: Doubled, start: DoubledStart, single: OrbitEquation | None) -> _Limit | None:
    """Return the side on which doubled motions of vanishing amplitude lie; None if it cannot be determined.

    With s the amplitude along the critical vector v, and p the distance along the parent, the doubled equation is

        s (alpha p + c s^2 + ...) = 0,    alpha = w^T (dF'/dp) v

    (the reduction of Lyapunov and Schmidt), so that the doubled motions have p = -c / alpha s^2. At such amplitudes
    the doubled motions themselves cannot be distinguished from the parent: rounding gives their parameter an error of
    about 1e-15 / s.

    With the map P over the period of the flip instead of the equation, c and alpha are half as large, and both have the
    other sign.
    """
    equation, value = single or doubled.corrector.equation, float(start.unknowns[-1])
    size = len(doubled.special.orbit.state) if single else len(start.unknowns) - 1
    unknowns, units = start.unknowns[:size], doubled.corrector.scales[:size]

    def motion_at(unknowns: NDArray[np.float64], value: float = value) -> tuple[NDArray[np.float64], Orbit]:
        evaluation = equation.evaluate(unknowns, value)
        return evaluation.by_unknowns * units, equation.orbit(unknowns, value, evaluation)

    orbits: list[Orbit] = []

    def matrix_at(unknowns: NDArray[np.float64]) -> Matrix:
        matrix, orbit = motion_at(unknowns)
        orbits.append(orbit)
        return matrix, orbit.events

    here = matrix_at(unknowns)
    left, _, right = least_singular(here[0] + np.diag(2.0 * units) if single else here[0])
    response = -here[0] if single else -(here[0] + np.outer(left, right))  # -F' for motions of half the period
    for step in _STEPS:
        cubic = flip_coefficient(matrix_at, here, unknowns, units, (right, left), response, (step,))
        if not cubic.error <= _SURE * abs(cubic.value):
            continue
        beside = doubled.along(start.place + step)
        alpha = left @ (motion_at(beside[:size], float(beside[-1]))[0] - here[0]) @ right
        amplitude = float(np.abs(orbits[-1].state - orbits[0].state).max())  # the last orbit was two steps away
        along = 2.0 * step / np.linalg.norm(start.across[:size] * units) * np.linalg.norm(right * units)
        return _Limit(-int(np.sign(cubic.value * alpha)), float(along), amplitude)
    return None


def flip_coefficient(
    matrix_at: Callable[[NDArray[np.float64]], Matrix],
    here: Matrix,
    unknowns: NDArray[np.float64],
    units: NDArray[np.float64],
    critical: tuple[NDArray[np.float64], NDArray[np.float64]],
    response: NDArray[np.float64],
    steps: Sequence[float] = _DISPLACEMENTS,
) -> Cubic:
    """Compute the cubic coefficient at a flip, times ``w^T v``, which makes it smooth along the flip locus.

    With the map over m periods P, its critical vectors ``B v = -v`` and ``w^T B = -w^T`` (Kuznetsov, Elements of
    Applied Bifurcation Theory, section 5.4):

        w^T [ P'''(v, v, v) / 6 + P''(v, R^-1 P''(v, v)) / 2 ],    R = 1 - B

    An equation ``F = 0`` of the doubled motions, with ``F' v = 0`` and ``w^T F' = 0``, has the same coefficient with F
    in place of P, and ``R = -F'`` on the motions of half the period (the reduction of Lyapunov and Schmidt).

    The derivatives along v are differences of exact matrices P' or F', over the longest of the steps within which no
    contact grazes: beyond a grazing point the map, and hence its derivatives, are different ones.

    Shapes: `unknowns`, `units` (N,); `response` (N, N).
    """
    v, w = critical
    for step in steps:
        matrices = []
        for place in _PLACES:
            matrix, contacts = matrix_at(unknowns + place * step * units * v)
            if not _alike(contacts, here[1]):
                break
            matrices.append(matrix)
        else:

            def coefficient(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
                bent = np.linalg.solve(response, first @ v)
                return float(w @ (second @ v / 6.0 + first @ bent / 2.0))

            first = np.tensordot(_FIRST, matrices, 1) / step
            second = (np.tensordot(_SECOND, matrices, 1) + _SECOND_HERE * here[0]) / step**2
            value = coefficient(first, second)
            _, before, after, _ = matrices
            coarser = coefficient((after - before) / (2.0 * step), (after + before - 2.0 * here[0]) / step**2)
            return Cubic(value, abs(coarser - value))
    return Cubic(float("nan"), float("inf"))


def _alike(some: Sequence[ContactEvent], others: Sequence[ContactEvent]) -> bool:
    """Return True if two motions make the same contacts, at nearly the same velocities."""
    return len(some) == len(others) and all(
        a.switch == b.switch and a.enters is b.enters and abs(a.velocity - b.velocity) < _ALIKE * abs(b.velocity)
        for a, b in zip(some, others, strict=True)
    )


def _amplitude(doubled: Doubled, start: DoubledStart, limit: _Limit) -> float:
    """Return the amplitude, in units of the state, up to which the doubled branch keeps its initial direction.

    Its points are left as inaccurate as this question allows. Where a step fails, shorter ones show whether the branch
    turns back, or was only lost at a graze.
    """
    corrector, flip = doubled.corrector, doubled.special.orbit
    x, across = start.unknowns / corrector.scales, np.append(start.across, 0.0)
    first = across[: len(flip.state)]  # of the two phases of the doubled motion, the one that begins a branch there
    across *= np.sign(first[np.argmax(np.abs(first))])
    here = _Place(x, across, np.zeros(len(x)), flip.state)
    amplitude, enough = limit.amplitude, REACH * magnitude(flip.state, flip.system)
    step, growth, size = _LONGER * limit.size, _LONGER, limit.size  # size of the doubled motion, scaled
    for _ in range(_STEPS_ALONG):
        there = _one_step(corrector, here, step, limit.way)
        if there is None:
            step, growth = _SHORTER * step, 1.0
            if step < _LEAST * size:
                break
            continue
        reached = float(np.abs(there.state - flip.state).max())
        if np.sign(there.tangent[-1]) != limit.way:  # it turns back in between
            rates = float(here.tangent[-1]), float(there.tangent[-1])
            share = rates[0] / (rates[0] - rates[1])
            if step < _NARROW * size:
                return amplitude + share * (reached - amplitude)
            step, growth = min(max(_BEFORE * share, _SHORTER), _BEFORE) * step, 1.0
            continue
        here, size, amplitude = there, size + step, reached
        if amplitude >= _NEARLY * enough:
            break
        step = min(growth * step, max(enough / amplitude - 1.0, 1.0 - _NEARLY) * size)
        growth = min(_CAREFUL * growth, _LONGER)
    return amplitude


class _Place(NamedTuple):
    """Point of the doubled branch, in scaled variables, its unit tangent, the change of that per length, its state."""

    x: NDArray[np.float64]
    tangent: NDArray[np.float64]
    bend: NDArray[np.float64]
    state: NDArray[np.float64]


def _one_step(corrector: Corrector, here: _Place, step: float, way: int) -> _Place | None:
    """Return the place one step ahead; None if Newton's method does not find it.

    The place is accurate to a small share of the step, as is its tangent: a tangent that points back is computed again
    with a smaller error before it counts.
    """
    bent = 0.5 * step**2 * here.bend
    x = here.x + step * here.tangent
    if float(np.linalg.norm(bent)) < _ASIDE * step:
        x += bent - (bent @ here.tangent) * here.tangent
    guess, before = x, np.inf
    for _ in range(_CORRECTIONS):
        try:
            evaluation = corrector.evaluate(x)
            change, tangent = _newton(corrector, evaluation, here.tangent)
        except (NumericalError, np.linalg.LinAlgError):
            return None
        x, size = x + change, float(np.linalg.norm(change))
        if not size < _SLOW * before or float(np.linalg.norm(x - guess)) > _ASIDE * step:
            return None
        goes_on = np.sign(tangent[-1]) == way
        if size < (_CLOSE if goes_on else _CLOSER) * step:
            return _Place(x, tangent, (tangent - here.tangent) / step, _state(corrector, x, evaluation))
        before = size
    return None


def _state(corrector: Corrector, x: NDArray[np.float64], evaluation: Evaluation) -> NDArray[np.float64]:
    """Return the state at theta = 0 of a point; of shooting it is among the unknowns, and no multipliers are needed."""
    unknowns, equation = x[:-1] * corrector.scales[:-1], corrector.equation
    if isinstance(equation, ShootingEquation):
        return unknowns[: equation.system.state_size]
    return equation.orbit(unknowns, float(x[-1] * corrector.scales[-1]), evaluation).state


def _newton(
    corrector: Corrector, evaluation: Evaluation, normal: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the Newton step from a point across a normal, and the unit tangent of the branch there."""
    right = np.zeros((len(normal), 2))
    assert evaluation.by_parameter is not None
    jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
    right[:-1, 0], right[-1, 1] = -evaluation.residual, 1.0
    change, along = np.linalg.solve(np.vstack((jacobian, normal)), right).T
    return change, along / np.linalg.norm(along)


class DoubledStart(NamedTuple):
    """Branch point of the equation of twice the period near a flip."""

    unknowns: NDArray[np.float64]  #: shape (N + 1,): Its unknowns and the parameter, not scaled.
    across: NDArray[np.float64]  #: shape (N,): Scaled null vector at a fixed parameter.
    place: float  #: Scaled distance from the flip along the parent, as in `Doubled.along`.


class Doubled:
    """Equation of twice the period near a flip; the motions of the parent solve it too.

    Attributes
    ----------
    corrector, parent
        Correctors for the doubled equation and for the parent.
    """

    def __init__(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> None:
        found, equation = posed_for(special, parameter, 2 * special.orbit.period, method)
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
            for _ in range(_SECANTS):
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
        """Return the unknowns of the doubled equation and the parameter at a scaled distance along the parent."""
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
        return x, parent.tangent(parent.evaluate(x), np.append(np.zeros(len(x) - 1), 1.0)).tangent

    def _doubled(self, orbit: Orbit) -> NDArray[np.float64]:
        equation = self.corrector.equation
        unknowns = equation.unknowns(orbit.repeated(2))
        return np.append(unknowns, orbit.system[equation.parameter or ""])


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
