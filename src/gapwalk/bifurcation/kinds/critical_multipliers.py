"""Kinds of points where a multiplier is critical: folds, flips, Neimark-Sacker and branch points; their functions.

Some of these functions are products over multipliers: smooth along a branch, and zero where one of the factors is.
Factors larger than 1 in absolute value are reduced to 1, so that a large multiplier cannot dominate the critical one.
(Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import BranchStart, posed_for
from gapwalk.bifurcation.normal_form import FIRST, PLACES, SECOND, SECOND_HERE, alike
from gapwalk.bifurcation.special_point import (
    REACH,
    ROUNDING,
    SAFETY,
    ErrorEstimator,
    Kind,
    Search,
    SpecialPoint,
    StepInterval,
    Symbol,
    Zero,
)
from gapwalk.continuation.corrector import Corrector, Range, check_range, scales_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.equations import magnitude
from gapwalk.late_scipy import lapack
from gapwalk.orbit.floquet import REAL, multipliers
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation
from gapwalk.orbit.shooting import Shooting, ShootingEquation

_REAL = 1e-9  # relative imaginary part below which a sum or product of two multipliers counts as real
COMPLEX = 1e-6
"""Relative imaginary part up to which a pair may be two real multipliers that rounding has split."""
_MANY = 8  # number of multipliers above which a product over all of them, or over all pairs, becomes too small
_FEW = 4


class Criticality(NamedTuple):
    """Signed distance of a monodromy matrix from one with a critical multiplier, and the derivative of this distance.

    Examples
    --------
    >>> found = gw.Kind.named("flip").condition(np.diag([-1.2, -0.5]))
    >>> found.directions.shape
    (1, 2)
    """

    value: float  #: The distance; it passes zero with a change of sign where a multiplier is critical.
    #: shape (k, state_size): Unit vectors: only products of the matrix's derivative with these are needed.
    directions: NDArray[np.float64]
    #: shape (k, state_size): A change dB of the matrix changes `value` by the sum over j of ``covectors[j] @ dB @
    #: directions[j]``.
    covectors: NDArray[np.float64]


def pair_on_circle(monodromy: NDArray[np.float64]) -> Criticality:
    """Compute the product minus 1 of the pair of multipliers for which it is nearest to zero."""
    # The pair is split off as a 2 x 2 matrix, ``left^T B right`` with ``left^T right = 1``. Its determinant is smooth
    # in B even where the pair meets on the real axis, at the strong resonances 1:1 and 1:2.
    values = multipliers([monodromy])
    pair = values[list(critical_pair(values))]
    quadratic = monodromy @ monodromy - float(pair.sum().real) * monodromy
    quadratic.flat[:: len(monodromy) + 1] += float(pair.prod().real)
    left_vectors, _, right_vectors = np.linalg.svd(quadratic)
    right, left = right_vectors[-2:].T, left_vectors[:, -2:]
    left = left @ np.linalg.inv(right.T @ left)
    (a, b), (c, d) = left.T @ monodromy @ right
    adjugate = np.array([[d, -b], [-c, a]])
    return Criticality(float(a * d - b * c) - 1.0, right.T, adjugate @ left.T)


def critical_pair(values: NDArray[np.complex128]) -> tuple[int, int]:
    """Return the indices of the two multipliers, conjugate or both real, whose product is nearest to 1."""
    first, second = np.triu_indices(len(values), 1)
    sums, products = values[first] + values[second], values[first] * values[second]
    sizes = 1.0 + np.abs(values[first]) + np.abs(values[second])
    distances = np.abs(products - 1.0) / np.maximum(1.0, np.abs(products))
    distances[(np.abs(sums.imag) > _REAL * sizes) | (np.abs(products.imag) > _REAL * sizes)] = np.inf
    nearest = int(np.argmin(distances))
    return int(first[nearest]), int(second[nearest])


def offsets_from(target: float, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the distances of multipliers from +1 or -1: positive beyond it, negative of complex ones."""
    # A pair that rounding has split from a double multiplier counts as real.
    is_real = np.abs(multipliers.imag) <= COMPLEX * np.abs(multipliers)
    return np.where(is_real, target * multipliers.real - 1.0, -np.abs(multipliers - target))


def nearest(factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the few factors nearest to zero, and the phase of the others, since a product of many would vanish."""
    if len(factors) <= _MANY:
        return factors
    order = np.argsort(np.abs(factors))
    rest = factors[order[_FEW:]]
    return np.array([*factors[order[:_FEW]], np.prod(rest / np.abs(rest))], dtype=np.complex128)


def smallest_singular_value(matrix: NDArray[np.float64]) -> Criticality:
    """Compute the smallest singular value of a matrix A, with the sign of ``det A``, which makes it smooth."""
    # It is the ``g`` of the bordered system (Govaerts 2000, Numerical Methods for Bifurcations, chapter 3)
    #
    #     [ A    b ] [ v ]     [ 0 ]
    #     [ c^T  0 ] [ g ]  =  [ 1 ]
    #
    # for the best choice of borders, the singular vectors themselves; so borders need not be updated along a locus.
    left, values, right = np.linalg.svd(matrix)
    sign = 1.0 if np.linalg.det(left @ right) > 0.0 else -1.0  # both are orthogonal
    return Criticality(sign * float(values[-1]), right[-1:], sign * left[:, -1:].T)


def bounded_product(factors: NDArray[np.complex128]) -> float:
    """Return the product of factors, each limited to 1 in absolute value."""
    product = 1.0 + 0.0j
    for factor in factors.tolist():
        product *= factor / max(1.0, abs(factor))
    return product.real


def pair_factors(multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return ``mu_i mu_j - 1`` over all pairs; if there are many, ``1 - |mu|^2`` over the conjugate pairs alone."""
    # Among many multipliers, two unrelated ones nearly always have a product near 1.
    if len(multipliers) <= _MANY:
        first, second = _pairs(len(multipliers))
        return multipliers[first] * multipliers[second] - 1.0
    pairs = multipliers[multipliers.imag > REAL * np.abs(multipliers)]
    return nearest((1.0 - np.abs(pairs) ** 2).astype(complex))


@lru_cache(maxsize=16)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)


# Folds: the branch turns back, and a multiplier passes +1.

_VERTEX = 1e-6  # arclength from a crossing within which a fold is its vertex
# arclength, component of the tangent, and change of the parameter along a part of a branch that runs straight across
_STRAIGHT, _ACROSS, _SAME = 1e-5, 1e-7, 1e-12
_LEVEL = 1e-10  # component of the tangent that is zero but for rounding, halfway to the next special point


class Fold(Kind):
    """Fold, where two motions merge and vanish: the parameter component of the tangent is zero."""

    symbol = Symbol("fold (LP)", "LP", "o", 4.8, "blue", "-", 1.7)
    target = 1.0
    moves_through_one = True
    is_turning = True
    order = 2
    sign_change = "the branch turns back"
    noise = 1e-5

    def function(self, point: BranchPoint) -> float:
        """Return the parameter component of the tangent."""
        return float(point.tangent[-1])

    def hides(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Return True if the parameter, as a cubic between two points, turns back twice."""
        first, last = self.function(a), self.function(b)
        mean = float(b.x[-1] - a.x[-1]) / (b.arclength - a.arclength)
        bend = first + last - 2.0 * mean
        lowest = (first + last - 3.0 * mean) ** 2 - first * last  # discriminant of the slope of the cubic
        place = (2.0 * first + last - 3.0 * mean) / (3.0 * bend) if bend else 0.0
        return first * last > 0.0 and lowest > 0.0 and first * bend > 0.0 and 0.0 < place < 1.0

    def points_in(self, search: Search) -> list[Zero]:
        """Return all folds except the vertex of a pitchfork, which is a branch point."""
        # A branch may run straight across the parameter: at a flip of a motion that stays linear, the doubled motion
        # has any size at the same value. There the component is zero throughout, and its sign is rounding.
        #
        # The vertex lies where the branch is interpolated through the crossing. Outside that interval orbits can be
        # corrected, and a fold is a separate one however near it is: if a contact grazes near the vertex, the branch
        # may turn back again at once.
        crossings = search.interval.crossings
        return [
            zero
            for zero in search.zeros(self)
            if all(abs(zero.point.arclength - each.arclength) >= min(_VERTEX, each.radius) for each in crossings)
            and not self._runs_across(search, zero.point)
        ]

    def _runs_across(self, search: Search, point: BranchPoint) -> bool:
        """Return True if the parameter does not change from a point to one of the ends of its step."""
        return any(
            abs(end.arclength - point.arclength) > _STRAIGHT
            and abs(self.function(end)) < _ACROSS
            and abs(end.value - point.value) < _SAME * abs(point.value)
            for end in (search.interval.points[0], search.interval.points[-1])
        )

    def nature(self, before: BranchPoint, after: BranchPoint) -> str | None:
        """Return the side to which the fold opens; None if the direction does not change: the zero is only rounding."""
        # It follows from the motions up to the next special points: farther away another fold may have turned the
        # branch.
        ways = [float(point.tangent[-1]) for point in (before, after)]
        if ways[0] * ways[1] >= 0.0 or min(map(abs, ways)) < _LEVEL:
            return None
        return f"opens to {'higher' if ways[1] > 0.0 else 'lower'} values"

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error of a double fold as that of the crossing with other branches."""
        if zero.multiplicity > 1:
            return Kind.BRANCH_POINT.error(search, zero, second)
        return super().error(search, zero, second)

    def examined(
        self, special: SpecialPoint, before: BranchPoint, after: BranchPoint
    ) -> tuple[list[str], Callable[[BranchPoint], float] | None]:
        """Compare a double fold with points on both sides by its multipliers."""
        if special.multiplicity > 1:
            return Kind.BRANCH_POINT.examined(special, before, after)
        return super().examined(special, before, after)

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return the beginnings of the branch that crosses at a double fold."""
        if special.multiplicity > 1:
            return Kind.BRANCH_POINT.beginnings(special, parameter, within, method)
        return super().beginnings(special, parameter, within, method)

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the distance of a multiplier from +1."""
        return smallest_singular_value(monodromy - np.eye(len(monodromy)))


# Flips: a multiplier passes -1, and a branch of twice the period begins.
#
# A flip is supercritical if the doubled motions lie on the side where the parent has lost stability. That is
# determined in the limit towards the flip, from the cubic coefficient of its normal form, because the doubled branch
# may soon turn back if a contact grazes close to the flip. The doubled branch itself then shows up to which amplitude
# it continues in its initial direction.
#
# Method: docs/numerics/notes/continuation.md

_DISPLACEMENTS = (6e-5, 6e-6)  # in units of the unknowns: longer ones show curvature, shorter ones rounding

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
    ways, times, order = 1, 2, 3
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
    """Return the equation whose derivatives are those of the map over the period of a flip, less the identity."""
    # It takes half the time of the doubled equation. None for other methods than shooting in one segment, and where
    # friction or rigid stops make it another equation.
    structure = special.orbit.system.structure
    if not isinstance(method, Shooting) or method.segments > 1 or structure.friction or structure.reactions:
        return None
    return method.pose(special.orbit.system, parameter, special.orbit.period)


def _limit(doubled: Doubled, start: DoubledStart, single: OrbitEquation | None) -> _Limit | None:
    """Return the side on which doubled motions of vanishing amplitude lie; None if it cannot be determined."""
    # With s the amplitude along the critical vector v, and p the distance along the parent, the doubled equation is
    #
    #     s (alpha p + c s^2 + ...) = 0,    alpha = w^T (dF'/dp) v
    #
    # (the reduction of Lyapunov and Schmidt), so that the doubled motions have p = -c / alpha s^2. At such amplitudes
    # the doubled motions themselves cannot be distinguished from the parent: rounding gives their parameter an error of
    # about 1e-15 / s.
    #
    # With the map P over the period of the flip instead of the equation, c and alpha are half as large, and both have
    # the other sign.
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
    """Compute the cubic coefficient at a flip, times ``w^T v``, which makes it smooth along the flip locus."""
    # With the map over m periods P, its critical vectors ``B v = -v`` and ``w^T B = -w^T`` (Kuznetsov, Elements of
    # Applied Bifurcation Theory, section 5.4):
    #
    #     w^T [ P'''(v, v, v) / 6 + P''(v, R^-1 P''(v, v)) / 2 ],    R = 1 - B
    #
    # An equation ``F = 0`` of the doubled motions, with ``F' v = 0`` and ``w^T F' = 0``, has the same coefficient with
    # F in place of P, and ``R = -F'`` on the motions of half the period (the reduction of Lyapunov and Schmidt).
    #
    # The derivatives along v are differences of exact matrices P' or F', over the longest of the steps within which no
    # contact grazes: beyond a grazing point the map, and hence its derivatives, are different ones.
    #
    # Shapes: `unknowns`, `units` (N,); `response` (N, N).
    v, w = critical
    for step in steps:
        matrices = []
        for place in PLACES:
            matrix, contacts = matrix_at(unknowns + place * step * units * v)
            if not alike(contacts, here[1]):
                break
            matrices.append(matrix)
        else:

            def coefficient(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
                bent = np.linalg.solve(response, first @ v)
                return float(w @ (second @ v / 6.0 + first @ bent / 2.0))

            first = np.tensordot(FIRST, matrices, 1) / step
            second = (np.tensordot(SECOND, matrices, 1) + SECOND_HERE * here[0]) / step**2
            value = coefficient(first, second)
            _, before, after, _ = matrices
            coarser = coefficient((after - before) / (2.0 * step), (after + before - 2.0 * here[0]) / step**2)
            return Cubic(value, abs(coarser - value))
    return Cubic(float("nan"), float("inf"))


def _amplitude(doubled: Doubled, start: DoubledStart, limit: _Limit) -> float:
    """Return the amplitude, in units of the state, up to which the doubled branch keeps its initial direction."""
    # Its points are left as inaccurate as this question allows. Where a step fails, shorter ones show whether the
    # branch turns back, or was only lost at a graze.
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
    """Return the place one step ahead; None if Newton's method does not find it."""
    # The place is accurate to a small share of the step, as is its tangent: a tangent that points back is computed
    # again with a smaller error before it counts.
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
        """Locate the branch point of the doubled equation."""
        # In shooting this is the flip. In harmonic balance the multipliers of a motion are more accurate than its
        # truncated equation, which has its own flip nearby: the secant method along the parent locates it.
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
        """Return the signed distance of the Jacobian from singularity, and its null vector there."""
        # Bordered by the null vectors of a place nearby, it stays regular (Govaerts 2000, section 3.2):
        #
        #     [ J        left ] [ v  ]     [ 0 ]
        #     [ right^T       ] [ -s ]  =  [ 1 ]
        #
        # Where J is singular, s changes sign and v is its null vector; nearby s is about the smallest singular value.
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


def least_singular(matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Return the smallest singular value of a matrix, between its left and right singular vectors."""
    # Inverse iteration with one factorisation takes a tenth of the time of a full singular value decomposition if the
    # matrix is large because of many harmonics. Its errors fall with the square of the ratio of the two smallest
    # values.
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


# Neimark-Sacker points: a complex pair of multipliers passes the unit circle, and a torus begins.


class NeimarkSacker(Kind):
    """Neimark-Sacker point, where the motion becomes quasi-periodic: the product of ``mu_i mu_j - 1`` is zero.

    The product over all pairs is also zero at neutral saddles, where two real multipliers have the product 1. Neutral
    saddles are not bifurcations.
    """

    symbol = Symbol("Neimark–Sacker (NS)", "NS", "*", 8.0, "green", (0.0, (6.0, 1.3, 1.2, 1.3)))
    order = 3

    def function(self, point: BranchPoint) -> float:
        """Return the product of ``mu_i mu_j - 1``."""
        return bounded_product(pair_factors(point.orbit.free_multipliers))

    def is_genuine(self, point: BranchPoint, near: float = 1e-6) -> bool:
        """Return True if a complex pair is on the unit circle: at a neutral saddle none is."""
        multipliers = point.orbit.free_multipliers
        complex_ones = multipliers[np.abs(multipliers.imag) > COMPLEX * np.abs(multipliers)]
        return bool(np.any(np.abs(np.abs(complex_ones) - 1.0) < near))

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the distances of the pairs from the unit circle, positive outside."""
        return np.abs(multipliers[multipliers.imag > COMPLEX * np.abs(multipliers)]) - 1.0

    def critical(self, multipliers: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the indices of the two multipliers nearest to the unit circle, larger imaginary part first."""
        order = np.argsort(np.abs(np.abs(multipliers) - 1.0), kind="stable")[:2]
        return order[np.argsort(-multipliers[order].imag, kind="stable")]

    def critical_multiplier(self, multipliers: NDArray[np.complex128]) -> complex:
        """Return the complex multiplier above the real axis that is nearest to the unit circle."""
        off = np.abs(np.abs(multipliers) - 1.0) + np.where(multipliers.imag > 0.0, 0.0, 1e3)
        return complex(multipliers[np.argmin(off)])

    def angle(self, multipliers: NDArray[np.complex128]) -> float:
        """Return the argument of the pair whose product is nearest to 1, real or not."""
        pair = multipliers[list(critical_pair(multipliers))]
        return float(np.arccos(np.clip(0.5 * pair.sum().real, -1.0, 1.0)))

    def condition(self, monodromy: NDArray[np.float64]) -> Criticality:
        """Evaluate the product of a pair of multipliers minus 1."""
        return pair_on_circle(monodromy)


# Branch points: two branches cross, because one of them breaks a symmetry.
#
# They are located by interpolation, since Newton's method is ill-conditioned where branches cross.

_AROUND = 5e-3  # arclength within which a second computation searches for the branch point
_REACHES = (1.0, 0.2, 0.04, 0.01)  # shares of it: if a contact grazes nearby, the branch is smooth only in small ones
_SHARP = 1e-10  # error, in scales of the parameter, below which no smaller window is tried
_NODES = 7
_FEWEST = 5
_NEAR = 0.08  # share of the window around the crossing from which no node is taken
_NARROW_WINDOW = 0.2  # length of each window, relative to the one before; the first is the whole step
_WINDOWS = 3  # largest number of windows after the first
_ROUGH = 0.1  # spread of the zero, in windows, below which one window determines the centre of the next
_SURE_CROSSING = 1e-6  # spread of the zero, in windows, above which the neighbourhood is not smooth enough
_TURNS = 1e-5  # component of the tangent of a fold but for the error of the crossing
_ROUGH_BRANCH = "the branch is not smooth where it seems to cross another"


class BranchPointKind(Kind):
    """Kind of point at which two branches cross: the Jacobian bordered by the tangent is singular."""

    turn = 1
    symbol = Symbol("branch point (BP)", "BP", "P", 6.5, "purple")
    target = 1.0
    ways = 2
    moves_through_one = True
    sign_change = "another branch crosses"

    def function(self, point: BranchPoint) -> float:
        """Return the determinant of the bordered Jacobian, scaled."""
        return point.determinant

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the distances of the multipliers from +1, positive above."""
        return offsets_from(1.0, multipliers)

    def prepare(self, search: Search) -> None:
        """Locate the crossing first, so that the search for other kinds steps over it."""
        search.several(self)
        if search.first.determinant * search.last.determinant < 0.0:
            _crossing(search, search.first, search.last)

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """Locate the crossing by interpolation: Newton's method is ill-conditioned where branches cross."""
        crossing = _crossing(search, a, b)
        return crossing and Zero(self, search.interval.at(crossing.arclength), crossing.spread, self.at)

    def locate_several(self, search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int]) -> Zero | None:
        """Locate the crossing with several branches by interpolation."""
        crossing = _crossing(search, a, b, ranks)
        if crossing is None:
            return None
        zero = search.several_at(self, search.interval.at(crossing.arclength), crossing.spread, ranks)
        # equal parts turn back together: one multiplier is that of the fold, and the others are those of the crossing
        turns = zero and a.tangent[-1] * b.tangent[-1] < 0.0 and abs(float(zero.point.tangent[-1])) < _TURNS
        return replace(zero, kind=Kind.FOLD) if zero and turns else zero

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error from the bracket, and from the shift of the crossing in a second computation."""
        point, scale = zero.point, float(search.corrector.scales[-1])
        ends = [abs(each.arclength - point.arclength) for each in (search.first, search.last)]
        # where the crossing lies at an end of the step, the branch is taken beyond that end too
        reaches = [share * min(_AROUND, end) for end in sorted(ends) for share in _REACHES]
        off = math.inf
        for number, reach in enumerate(reaches):
            if off < (_SHARP * scale if number < len(_REACHES) else math.inf):
                break
            with suppress(NumericalError):  # the branch is not smooth within that reach
                off = min(off, abs(second.crossing(point, reach, zero.function) - point.value))
        if off == math.inf:
            return math.inf
        bracket = abs(float(point.tangent[-1])) * scale * zero.spread
        return float(bracket + SAFETY * off + ROUNDING * (abs(point.value) + scale))

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return two beginnings, in both directions of the crossing branch."""
        _, equation = posed_for(special, parameter, special.orbit.period, method)
        corrector = Corrector(equation, scales_of(equation, special.orbit, within))
        start = np.append(equation.unknowns(special.orbit), special.value)
        # both branches lie in the plane of the two smallest singular vectors, and the other is normal to this one
        plane = np.linalg.svd(corrector.jacobian(start / corrector.scales))[2][-2:]
        known = plane @ _rescaled(special.point, start, corrector)
        across = np.array([-known[1], known[0]]) @ plane
        across /= np.linalg.norm(across)
        across *= np.sign(across[np.argmax(np.abs(across))])
        return [BranchStart.uncorrected(corrector, start, way * across, within) for way in (1.0, -1.0)]

    @property
    def no_locus(self) -> str:
        """Reason why branch points have no locus in two parameters."""
        return (
            "a branch point has no locus in two parameters: it exists by a symmetry, and vanishes or persists with it; "
            "follow a fold, a flip, a neimark-sacker or a grazing point, or one of sliding"
        )


def _crossing(search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int] = (0, 1)) -> Crossing | None:
    """Return the crossing with other branches between two points; None if the branch is not smooth enough."""
    # Once a crossing is found, points near it are interpolated, because no orbit can be corrected there.
    crossings = search.interval.crossings
    for crossing in crossings:
        if a.arclength < crossing.arclength < b.arclength:
            return crossing
    try:
        crossings.append(locate_crossing(search.interval, a, b, ranks))
    except NumericalError:
        return None
    return crossings[-1]


def _rescaled(point: BranchPoint, start: NDArray[np.float64], corrector: Corrector) -> NDArray[np.float64]:
    """Return the tangent of a point found with other scales, in the scales of the corrector."""
    if len(point.x) != len(start):
        raise ModelError("method has other segments or harmonics than that of the branch point; write the same one")
    scales = np.divide(start, point.x, out=corrector.scales.copy(), where=point.x != 0.0)
    rescaled = point.tangent * scales / corrector.scales
    return rescaled / np.linalg.norm(rescaled)


@dataclass(frozen=True)
class Crossing:
    """Branch near a point where it crosses another, as polynomials in the arclength from that point."""

    arclength: float  #: Arclength of the crossing.
    radius: float  #: Distance from the crossing within which the polynomials represent the branch.
    spread: float  #: Uncertainty of the arclength.
    curve: tuple[Polynomial, ...]  #: One polynomial for each scaled variable.
    count: int = 1  #: Number of multipliers that pass +1 there.

    def __contains__(self, arclength: object) -> bool:
        return isinstance(arclength, float) and abs(arclength - self.arclength) <= self.radius

    def x(self, arclength: float) -> NDArray[np.float64]:
        """Return the scaled unknowns and parameter at an arclength."""
        return np.array([component(arclength - self.arclength) for component in self.curve])

    def tangent(self, arclength: float) -> NDArray[np.float64]:
        """Return the unit tangent at an arclength."""
        slope = np.array([component(arclength - self.arclength) for component in self._slopes])
        return slope / np.linalg.norm(slope)

    @cached_property
    def _slopes(self) -> tuple[Polynomial, ...]:
        return tuple(component.deriv() for component in self.curve)


def locate_crossing(
    interval: StepInterval, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int] = (0, 1)
) -> Crossing:
    """Locate the zero of the determinant of the bordered Jacobian between `a` and `b`."""
    # Where several multipliers pass +1 at once, their mean takes its place, which changes its sign in any case.
    #
    # Near a crossing the Jacobian is singular along the other branch: a residual of 1e-10 leaves an error of its square
    # root or worse. The branch itself is smooth. Newton's method is accurate at points some distance away on both
    # sides, and interpolation between them gives the zero of the determinant and the orbits near it.
    window = b.arclength - a.arclength
    count = ranks[1] - ranks[0]
    function = _determinant if count == 1 else partial(Kind.BRANCH_POINT.mean_offset, ranks=ranks)
    ends = abs(function(a)), abs(function(b))
    crossing = _fit_window(interval, a, b, a.arclength + window * ends[0] / sum(ends), window, function)
    for _ in range(_WINDOWS):
        window *= _NARROW_WINDOW
        crossing = _fit_window(interval, a, b, crossing.arclength, window, function)
        if crossing.spread < _SURE_CROSSING * window:
            return replace(crossing, count=count)
    raise NumericalError(_ROUGH_BRANCH)


def _determinant(point: BranchPoint) -> float:
    return point.determinant


def _fit_window(
    interval: StepInterval,
    a: BranchPoint,
    b: BranchPoint,
    middle: float,
    window: float,
    function: Callable[[BranchPoint], float],
) -> Crossing:
    low = min(max(a.arclength, middle - 0.5 * window), b.arclength - window)
    nodes = _nodes(interval, low, window, middle)
    # abscissa of the points along the chord: the branch is smooth in it, but not in the arclength labels
    chord = (b.x - a.x) / (b.arclength - a.arclength)
    along = np.array([float((node.x - a.x) @ chord) for node in nodes]) / float(chord @ chord)
    places = (a.arclength + along - middle) / window
    values = [function(node) for node in nodes]
    zero = _zero(places, values)
    spread = abs(_zero(places[1:-1], values[1:-1]) - zero)
    if not spread < _ROUGH:
        raise NumericalError(_ROUGH_BRANCH)
    away = (places - zero) * window
    curve = tuple(_polynomial(away, [node.x[i] for node in nodes]) for i in range(len(a.x)))
    return Crossing(middle + zero * window, 0.3 * window, spread * window, curve)


def _nodes(interval: StepInterval, low: float, window: float, centre: float) -> list[BranchPoint]:
    """Return exact points of a window, denser towards its ends, none too near to the expected crossing."""
    nodes = []
    shares = 0.5 * (1.0 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1)))
    ends = (interval.points[0].arclength, interval.points[-1].arclength)
    for place in np.clip(low + window * shares, *ends):  # rounding must not lead beyond the ends
        if abs(place - centre) > _NEAR * window:
            try:
                node = interval.at(float(place))
                nodes.append(interval.corrector.exact_point(node.x, node.tangent, node.arclength))
            except NumericalError:  # it happens to lie on the crossing
                continue
    if len(nodes) < _FEWEST:
        raise NumericalError("too few orbits can be found where the branch seems to cross another")
    return nodes


def _zero(places: NDArray[np.float64], values: list[float]) -> float:
    """Return the zero of the interpolating polynomial that is nearest to the middle of the sign change."""
    # If all places lie on one side of the zero, return the one nearest to 0, where the zero is expected.
    change = next((i for i in range(len(values) - 1) if values[i] * values[i + 1] <= 0.0), None)
    middle = 0.0 if change is None else 0.5 * (places[change] + places[change + 1])
    roots: NDArray[np.complex128] = np.array(_polynomial(places, values).roots(), dtype=np.complex128)
    real = roots[np.abs(roots.imag) < 1e-6].real
    return float(real[np.argmin(np.abs(real - middle))]) if len(real) else float("nan")


def _polynomial(places: NDArray[np.float64], values: list[float]) -> Polynomial:
    low, high = float(places.min()), float(places.max())
    return Polynomial.fit(places, values, len(places) - 1, domain=[low, high])
