"""Prediction of the next point of a branch, and its correction onto the branch.

The predictor extrapolates the cubic through two points and their tangents, which also interpolates between them. The
corrector is Newton's method on the bordered system, which also gives the tangent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import truediv
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit_equation import Equation, Evaluation

TRUST = 1e-7
"""Residual below which the next Newton step, with exact derivatives, is accurate to rounding."""

_LOST = 2.0  # growth of the residual from one iteration to the next at which the corrector gives up
_CONTRACTION = 0.5  # largest ratio of successive steps that converge; at a graze the ratio is about a third
_EXACT = 1e-14  # residual, relative to the unknowns, that is only rounding if another step does not reduce it
_ROUNDING = 1e-13  # length of a step that rounding alone can cause
_POLISH = 1e-5  # longest last step once the residual is within tolerance: a longer one means a nearly singular Jacobian
_SHALLOW = 1e-3  # share of the depth of the shallowest contact: after a longer step the multipliers are others
_LOGARITHM = 300.0 * math.log(10.0)  # of the largest determinant that is returned with its true size
_ACROSS = 0.3  # cosine of the angle to the direction of travel below which the tangent is solved for again
_ALONG = 0.5  # cosine of the angle between tangents up to which points are interpolated along one of them
_AGREES = 0.3  # distance of the quintic from the cubic, as a share of that of the cubic from the tangent
_FEW, _KEPT = 50, 32  # unknowns up to which evaluations are kept, and how many of them
_TRUSTED = 1e-7  # longest step if only `trust` is met: by a crossing the tangent turns by 0.1 rad in 1e-6


class Course(NamedTuple):
    """Direction in which a branch continues."""

    tangent: NDArray[np.float64]  #: shape (N + 1,): Unit tangent of the branch, in scaled variables.
    #: Determinant of the Jacobian bordered by the tangent, for unscaled unknowns. With scaled unknowns it would depend
    #: on the units, and it would overflow when there are many unknowns.
    determinant: float


class Correction(NamedTuple):
    """Corrected point, and how it was reached."""

    x: NDArray[np.float64]  #: shape (N + 1,): The point, in scaled variables.
    evaluation: Evaluation  #: The equation evaluated there.
    iterations: int  #: Newton steps taken.
    distance: float  #: Distance from the predicted to the corrected point.
    last: float  #: Length of the last Newton step.
    course: Course | None = None  #: Direction in which the branch continues there; None if it was not computed.


class Corrector:
    """Newton corrector for the branch of one equation, in scaled variables.

    Shapes: `scales` (N + 1,).
    """

    def __init__(self, equation: Equation, scales: NDArray[np.float64], iterations: int = 7) -> None:
        self.equation, self.scales, self.iterations = equation, scales, iterations
        self._unknown_scales, self._last_scale = scales[:-1], float(scales[-1])
        # residuals are lengths: a frequency among the unknowns says nothing of their size
        self._lengths = slice(len(scales) - 1 - getattr(equation, "frequencies", 0))
        self._smallest = min(1.0, _largest(self._unknown_scales[self._lengths]))  # smaller unknowns count as zero
        self._column_scales = [*self._unknown_scales.tolist(), 1.0]
        self._recent: dict[bytes, Evaluation] = {}  # of the last points, if they have few unknowns

    def correct(
        self,
        guess: NDArray[np.float64],
        normal: NDArray[np.float64],
        trust: float = 0.0,
        near: float = math.inf,
    ) -> Correction | None:
        """Return the point of the branch in the plane through `guess` with that `normal`; None if Newton fails.

        Once the residual is within the tolerance (or within `trust`, if that is larger), one more short step is taken
        without a further evaluation. It leaves about the square of the residual, so the point is accurate to rounding,
        while the evaluation belongs to a point one such step away. `trust` is for multipliers that need few digits.
        A step longer than `near`, or not much shorter than the step before, is always evaluated: where the branch
        bends within 1e-10, a residual of 1e-10 says little, and the error after the step is not its square.

        Each step solves the bordered system

            [ G_u     G_a  ] [ du ]     [ -G ]
            [ normal^T     ] [ da ]  =  [  0 ]
        """
        x, last, before = guess, 0.0, np.inf
        for iteration in range(self.iterations + 1):
            unknowns = x[:-1] * self._unknown_scales
            try:
                evaluation = self.equation.evaluate(unknowns, x.item(-1) * self._last_scale)
            except NumericalError:
                return None
            size, scale = _largest(evaluation.residual), max(self._smallest, _largest(unknowns[self._lengths]))
            solved = size <= self.equation.tolerance * scale
            if not solved and not size <= _LOST * before:
                return None
            # the second right-hand side gives the tangent of the branch
            right = np.zeros((len(x), 2), order="F")
            np.negative(evaluation.residual, out=right[:-1, 0])
            right[-1, 1] = 1.0
            factors, pivots, steps, singular = lapack.dgesv(self._bordered(evaluation, normal), right, 1, 1)
            step = steps[:, 0]
            length = np.inf if singular else length_of(step)
            near_enough = near if not last else min(near, _CONTRACTION * last)
            shallow = max(_SHALLOW * evaluation.reach / self._unknown_scales.item(0), _ROUNDING)
            exact = _CONTRACTION * before < size <= _EXACT * scale  # the residual is only rounding
            if solved and (length <= min(max(near_enough, _ROUNDING), shallow) or exact):
                x = x + step if length < _POLISH else x
                course = None if singular else self._course(factors, pivots, steps[:, 1])
                return Correction(x, evaluation, iteration, length_of(x - guess), last, course)
            if singular:
                return None
            x, last, before = x + step, length, size
            if size <= trust * scale and length < min(_TRUSTED, near_enough, shallow):
                course = self._course(factors, pivots, steps[:, 1])
                return Correction(x, evaluation, iteration + 1, length_of(x - guess), last, course)
        return None

    def exact_point(self, x: NDArray[np.float64], along: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point at a corrected `x`, evaluated exactly there and oriented along `along`."""
        return self.point(Correction(x, self.evaluate(x), 0, 0.0, 0.0), along, arclength)

    def evaluate(self, x: NDArray[np.float64]) -> Evaluation:
        """Evaluate the equation at scaled variables; errors as `Equation.evaluate`."""
        return self.equation.evaluate(x[:-1] * self._unknown_scales, float(x[-1] * self.scales[-1]))

    def evaluated_near(self, x: NDArray[np.float64]) -> Evaluation:
        """Return the evaluation at a point, or at most a last Newton step away from it, where its derivatives do too.

        Errors as `Equation.evaluate`.
        """
        known = self._recent.get(x.tobytes())
        return self.evaluate(x) if known is None else known

    def forget(self) -> None:
        """Forget the evaluations of earlier points, so that a step does not depend on whether the walk was resumed."""
        self._recent.clear()

    def tangent(self, evaluation: Evaluation, along: NDArray[np.float64]) -> Course:
        """Return the unit tangent at a point, oriented along `along`, and the determinant bordered by it."""
        matrix = self._bordered(evaluation, along)
        right = np.zeros((len(along), 1))
        right[-1] = 1.0
        factors, pivots, solution, singular = lapack.dgesv(matrix, right)
        if not singular:
            return self._course(factors, pivots, solution[:, 0])
        tangent = np.linalg.svd(matrix[:-1])[2][-1]
        tangent *= np.sign(tangent @ along) or 1.0
        return Course(tangent, self._determinant(evaluation, tangent))

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residual by all scaled variables at `x`, shape (N, N + 1)."""
        evaluation = self.evaluate(x)
        assert evaluation.by_parameter is not None
        return np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * self.scales

    def uncorrected(self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point at `x` without correction, for places where Newton's method is ill-posed."""
        return self.evaluated(x, self.evaluate(x), tangent, arclength)

    def crossed(
        self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float, count: int = 1
    ) -> BranchPoint:
        """Return the branch point near `x` where others cross, in the plane of `count` directions.

        The point is corrected in all directions except those of the other branches. In them the bordered Jacobian is
        singular, and `x` is known more accurately than Newton's method could determine it.
        """
        evaluation = self.evaluate(x)
        left, sizes, ways = np.linalg.svd(self._bordered(evaluation, tangent))
        off = left.T @ np.append(-evaluation.residual, 0.0)
        return self.uncorrected(x + ways[:-count].T @ (off[:-count] / sizes[:-count]), tangent, arclength)

    def evaluated(
        self, x: NDArray[np.float64], evaluation: Evaluation, tangent: NDArray[np.float64], arclength: float
    ) -> BranchPoint:
        """Return the branch point at `x`, given its evaluation and tangent."""
        course = Course(tangent, self._determinant(evaluation, tangent))
        return self._placed(x, evaluation, course, arclength)

    def _placed(self, x: NDArray[np.float64], evaluation: Evaluation, course: Course, arclength: float) -> BranchPoint:
        value = x.item(-1) * self._last_scale
        if len(x) <= _FEW:
            if len(self._recent) >= _KEPT:
                del self._recent[next(iter(self._recent))]
            self._recent[x.tobytes()] = evaluation
        orbit = self.equation.orbit(x[:-1] * self._unknown_scales, value, evaluation)
        return BranchPoint(value, orbit, x, *course, arclength)

    def point(self, correction: Correction, along: NDArray[np.float64], arclength: float) -> BranchPoint:
        """Return the branch point of a correction."""
        course = correction.course
        way = 0.0 if course is None else float(course.tangent @ along)
        if course is None or abs(way) < _ACROSS:
            course = self.tangent(correction.evaluation, along)
        elif way < 0.0:
            course = Course(-course.tangent, -course.determinant)
        return self._placed(correction.x, correction.evaluation, course, arclength)

    def at_value(self, guess: NDArray[np.float64], value: float) -> Correction | None:
        """Return the point of the branch at a given value of the parameter, from a guess."""
        normal = np.zeros(len(guess))
        normal[-1] = 1.0
        start = guess.copy()
        start[-1] = value / self.scales[-1]
        return self.correct(start, normal)

    def _bordered(self, evaluation: Evaluation, border: NDArray[np.float64]) -> NDArray[np.float64]:
        assert evaluation.by_parameter is not None
        size = len(border)
        matrix = np.empty((size, size), order="F")
        np.multiply(evaluation.by_unknowns, self._unknown_scales, out=matrix[:-1, :-1])
        np.multiply(evaluation.by_parameter, self._last_scale, out=matrix[:-1, -1])
        matrix[-1] = border
        return matrix

    def _course(self, factors: NDArray[np.float64], pivots: NDArray[np.intp], along: NDArray[np.float64]) -> Course:
        """Return tangent and determinant from the factors of a bordered matrix and its solution along the border."""
        # replacing the border by the unit tangent t/|t| multiplies the determinant by t.t/|t| (Cramer's rule)
        length = length_of(along)
        return Course(along / length, self._product(factors, pivots) * length)

    def _determinant(self, evaluation: Evaluation, border: NDArray[np.float64]) -> float:
        """Return the determinant of the Jacobian bordered by a unit vector; see `Course`."""
        factors, pivots, singular = lapack.dgetrf(self._bordered(evaluation, border))
        return 0.0 if singular else self._product(factors, pivots)

    def _product(self, factors: NDArray[np.float64], pivots: NDArray[np.intp]) -> float:
        """Return the determinant of a bordered matrix, for unscaled unknowns, from its factors."""
        swaps = sum(place != row for row, place in enumerate(pivots.tolist()))
        size = bounded_product(list(map(truediv, factors.diagonal().tolist(), self._column_scales)))
        return -size if swaps % 2 else size


def _largest(vector: NDArray[np.float64]) -> float:
    """Return the largest absolute component (for short vectors several times faster than NumPy's)."""
    return max(map(abs, vector.tolist()))


def length_of(vector: NDArray[np.float64]) -> float:
    """Return the length of a vector (for short vectors several times faster than NumPy's)."""
    return math.sqrt(vector.dot(vector))


def bounded_product(factors: list[float]) -> float:
    """Return the product of nonzero numbers, with the correct sign even where its size overflows or underflows.

    In that case its size is 1e300 or 1e-300, which is sufficient where only the sign matters.
    """
    product = math.prod(factors)
    if 0.0 < abs(product) < math.inf:
        return product
    logarithm = sum(math.log(abs(factor)) for factor in factors)
    sign = -1.0 if sum(factor < 0.0 for factor in factors) % 2 else 1.0
    return sign * math.exp(min(max(logarithm, -_LOGARITHM), _LOGARITHM))


def ahead(
    earlier: BranchPoint | None, previous: BranchPoint | None, point: BranchPoint, step: float
) -> list[NDArray[np.float64]]:
    """Return guesses for the point one step ahead, best first: by a polynomial through known points, by the tangent.

    The polynomial is the cubic through two points or, if the point before them agrees, the quintic through three.
    """
    straight = point.x + step * point.tangent
    if previous is None or point.orbit.stuck:  # a cubic would amplify errors of what friction keeps, fivefold in a step
        return [straight]
    length = point.arclength - previous.arclength
    if not 0.0 < step < 3.0 * length:
        return [straight]
    curved = hermite(previous, point, 1.0 + step / length)
    bent = length_of(curved - straight)
    if bent > 0.5 * step:
        return [straight]
    # both guesses lie on the same plane across the tangent
    curved += ((straight - curved) @ point.tangent) * point.tangent
    if earlier is not None and length < 3.0 * (previous.arclength - earlier.arclength):
        finer = interpolated((earlier, previous, point), point, step)
        if finer is not None and length_of(finer - curved) < _AGREES * bent:
            curved = finer
    return [curved, straight]


def interpolated(points: Sequence[BranchPoint], origin: BranchPoint, ahead: float) -> NDArray[np.float64] | None:
    """Return the place ahead of a point on the polynomial through some points, with their tangents.

    The polynomial is a function of the distance along the tangent at that point. Unlike the arclength, which sums
    chords, this distance is exact, so that the order of the polynomial counts. The result is None if the branch turns
    away from the tangent.
    """
    along = origin.tangent
    rates = [float(point.tangent @ along) for point in points]
    if min(rates) < _ALONG:
        return None
    places = [float((point.x - origin.x) @ along) for point in points]
    total = np.zeros(len(along))
    for point, place, rate in zip(points, places, rates, strict=True):
        others = [each for each in places if each != place]
        weight = math.prod((ahead - each) / (place - each) for each in others) ** 2
        off, slope = ahead - place, sum(1.0 / (place - each) for each in others)
        total += (weight * (1.0 - 2.0 * slope * off)) * point.x + (weight * off / rate) * point.tangent
    return total


def hermite(a: BranchPoint, b: BranchPoint, share: float) -> NDArray[np.float64]:
    """Evaluate the cubic through two points with their tangents: `share` 0 is the first, 1 the second, > 1 is ahead."""
    length, t = b.arclength - a.arclength, share
    return (
        (1 + 2 * t) * (1 - t) ** 2 * a.x
        + t * (1 - t) ** 2 * length * a.tangent
        + t * t * (3 - 2 * t) * b.x
        + t * t * (t - 1) * length * b.tangent
    )
