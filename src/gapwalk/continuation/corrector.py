"""From a predicted point back to the branch: Newton's method on the bordered system, and the tangent there."""

from __future__ import annotations

import math
from operator import truediv
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.equation import Equation, Evaluation

TRUST = 1e-7
"""Residual from which the next Newton step is exact to rounding, with exact derivatives."""

_LOST = 2.0  # growth of the residual from one iteration to the next at which the corrector gives up
_CONTRACTION = 0.5  # of the step before: longer ones do not converge; at a graze each is a third of it
_EXACT = 1e-14  # residual, relative to the unknowns, that is rounding where another step makes it no smaller
_ROUNDING = 1e-13  # length of a step that rounding alone can make
_POLISH = 1e-5  # longest last step within the tolerance: a longer one means a Jacobian too singular for it
_SHALLOW = 1e-3  # share of the depth of the shallowest touch: a longer step finds other multipliers than it comes from
_LOGARITHM = 300.0 * math.log(10.0)  # of the largest determinant that is told by its size
_ACROSS = 0.3  # cosine of the angle to the way ahead below which a tangent is better found bordered by that way
_TRUSTED = 1e-7  # the same where the residual is only trusted: by a crossing the tangent turns by 0.1 rad in 1e-6


class Course(NamedTuple):
    """Which way a branch goes on.

    Attributes
    ----------
    tangent : shape (N + 1,)
        Unit tangent of the branch, in scaled variables.
    determinant
        Determinant of the Jacobian bordered by it, by unknowns that are not scaled: with their scales it would change
        with the units, and grow with the number of unknowns until no number can hold it.
    """

    tangent: NDArray[np.float64]
    determinant: float


class Correction(NamedTuple):
    """A corrected point and how it was reached.

    Attributes
    ----------
    x : shape (N + 1,)
        The point, in scaled variables.
    evaluation
        The equation there.
    iterations
        Newton steps taken.
    distance
        From the predicted to the corrected point.
    last
        Length of the last Newton step.
    course
        Which way the branch goes on there, if that is known too.
    """

    x: NDArray[np.float64]
    evaluation: Evaluation
    iterations: int
    distance: float
    last: float
    course: Course | None = None


class Corrector:
    """Corrects points onto the branch of one equation, in scaled variables.

    Parameters
    ----------
    equation
        The equation whose solutions form the branch.
    scales : shape (N + 1,)
        Scale of each unknown, and of the parameter: physical = scale * scaled.
    iterations
        Most Newton steps.
    """

    def __init__(self, equation: Equation, scales: NDArray[np.float64], iterations: int = 7) -> None:
        self.equation, self.scales, self.iterations = equation, scales, iterations
        self._unknown_scales = scales[:-1]
        self._smallest = min(1.0, _largest(self._unknown_scales))  # unknowns below that count as nothing
        self._column_scales = [*self._unknown_scales.tolist(), 1.0]

    def correct(
        self,
        guess: NDArray[np.float64],
        normal: NDArray[np.float64],
        trust: float = 0.0,
        near: float = math.inf,
    ) -> Correction | None:
        """The point of the branch on the plane through `guess` with that `normal`; None if Newton finds none.

        Where the residual is within the tolerance, or within `trust` if that is larger, one more step is taken
        without looking, if it is short: it leaves about the square of the residual. So the point is exact to rounding,
        and the evaluation belongs to a point off by that step; `trust` serves where multipliers need no more digits.
        A step that is longer than `near`, or not much shorter than the one before, is looked at all the same: where a
        branch bends within 1e-10, a residual of 1e-10 says little, and what such a step leaves is not its square.

        Each step solves the bordered system

            [ G_u     G_a  ] [ du ]     [ -G ]
            [ normal^T     ] [ da ]  =  [  0 ]
        """
        x, last, before = guess, 0.0, np.inf
        for iteration in range(self.iterations + 1):
            unknowns = x[:-1] * self._unknown_scales
            try:
                evaluation = self.equation.evaluate(unknowns, float(x[-1] * self.scales[-1]))
            except NumericalError:
                return None
            size, scale = _largest(evaluation.residual), max(self._smallest, _largest(unknowns))
            solved = size <= self.equation.tolerance * scale
            if not solved and not size <= _LOST * before:
                return None
            # the second right-hand side leads along the branch
            right = np.zeros((len(x), 2), order="F")
            np.negative(evaluation.residual, out=right[:-1, 0])
            right[-1, 1] = 1.0
            factors, pivots, steps, singular = lapack.dgesv(self._bordered(evaluation, normal), right)
            step = steps[:, 0]
            length = np.inf if singular else length_of(step)
            near_enough = near if not last else min(near, _CONTRACTION * last)
            shallow = max(_SHALLOW * evaluation.reach / float(self._unknown_scales[0]), _ROUNDING)
            exact = _CONTRACTION * before < size <= _EXACT * scale  # nothing but rounding is left of the residual
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

    def refined(self, point: BranchPoint) -> BranchPoint:
        """The same point with its multipliers and tangent evaluated exactly there, not at a point beside it."""
        evaluation = self.equation.evaluate(point.x[:-1] * self._unknown_scales, point.value)
        return self.point(Correction(point.x, evaluation, 0, 0.0, 0.0), point.tangent, point.arclength)

    def tangent(self, evaluation: Evaluation, along: NDArray[np.float64]) -> Course:
        """Unit tangent at a point, pointing the way of `along`, and the determinant bordered by it."""
        matrix = self._bordered(evaluation, along)
        right = np.zeros((len(along), 1))
        right[-1] = 1.0
        factors, pivots, solution, singular = lapack.dgesv(matrix, right)
        if not singular:
            return self._course(factors, pivots, solution[:, 0])
        tangent = np.linalg.svd(matrix[:-1])[2][-1]
        tangent *= np.sign(tangent @ along) or 1.0
        return Course(tangent, self._determinant(evaluation, tangent))

    def uncorrected(self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float) -> BranchPoint:
        """The branch point at `x` as it is, for places where Newton's method is ill-posed."""
        evaluation = self.equation.evaluate(x[:-1] * self._unknown_scales, float(x[-1] * self.scales[-1]))
        return self.evaluated(x, evaluation, tangent, arclength)

    def crossed(self, x: NDArray[np.float64], tangent: NDArray[np.float64], arclength: float) -> BranchPoint:
        """The branch point near `x`, where another branch crosses: corrected in all directions but the other branch's.

        In that one the bordered Jacobian is singular, and `x` is known better than Newton's method could tell.
        """
        evaluation = self.equation.evaluate(x[:-1] * self._unknown_scales, float(x[-1] * self.scales[-1]))
        left, sizes, ways = np.linalg.svd(self._bordered(evaluation, tangent))
        off = left.T @ np.append(-evaluation.residual, 0.0)
        return self.uncorrected(x + ways[:-1].T @ (off[:-1] / sizes[:-1]), tangent, arclength)

    def evaluated(
        self, x: NDArray[np.float64], evaluation: Evaluation, tangent: NDArray[np.float64], arclength: float
    ) -> BranchPoint:
        """The branch point at `x`, of which evaluation and tangent are known."""
        value = float(x[-1] * self.scales[-1])
        determinant = self._determinant(evaluation, tangent)
        orbit = self.equation.orbit(x[:-1] * self._unknown_scales, value, evaluation)
        return BranchPoint(value, orbit, x, tangent, determinant, arclength)

    def point(self, correction: Correction, along: NDArray[np.float64], arclength: float) -> BranchPoint:
        """The branch point of a correction."""
        x, evaluation, course = correction.x, correction.evaluation, correction.course
        way = 0.0 if course is None else float(course.tangent @ along)
        if course is None or abs(way) < _ACROSS:
            course = self.tangent(evaluation, along)
        elif way < 0.0:
            course = Course(-course.tangent, -course.determinant)
        tangent, determinant = course
        value = float(x[-1] * self.scales[-1])
        orbit = self.equation.orbit(x[:-1] * self.scales[:-1], value, evaluation)
        return BranchPoint(value, orbit, x, tangent, determinant, arclength)

    def at_value(self, guess: NDArray[np.float64], value: float) -> Correction | None:
        """The point of the branch at one value of the parameter, from a guess."""
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
        np.multiply(evaluation.by_parameter, self.scales[-1], out=matrix[:-1, -1])
        matrix[-1] = border
        return matrix

    def _course(self, factors: NDArray[np.float64], pivots: NDArray[np.intp], along: NDArray[np.float64]) -> Course:
        """What follows from the factors of a bordered matrix and its solution for a step along the border."""
        # replacing the border by the unit tangent t/|t| multiplies the determinant by t.t/|t| (Cramer's rule)
        length = length_of(along)
        return Course(along / length, self._product(factors, pivots) * length)

    def _determinant(self, evaluation: Evaluation, border: NDArray[np.float64]) -> float:
        """Determinant of the Jacobian bordered by a unit vector; see `Course`."""
        factors, pivots, singular = lapack.dgetrf(self._bordered(evaluation, border))
        return 0.0 if singular else self._product(factors, pivots)

    def _product(self, factors: NDArray[np.float64], pivots: NDArray[np.intp]) -> float:
        """The determinant of a bordered matrix, by unknowns that are not scaled, from its factors."""
        swaps = sum(place != row for row, place in enumerate(pivots.tolist()))
        size = bounded_product(list(map(truediv, factors.diagonal().tolist(), self._column_scales)))
        return -size if swaps % 2 else size


def bounded_product(factors: list[float]) -> float:
    """The product of some numbers, none of them 0: with its sign, even where its size is beyond what a number holds.

    There the size is 1e300, or 1e-300, which is as good where only the sign matters.
    """
    product = math.prod(factors)
    if 0.0 < abs(product) < math.inf:
        return product
    logarithm = sum(math.log(abs(factor)) for factor in factors)
    sign = -1.0 if sum(factor < 0.0 for factor in factors) % 2 else 1.0
    return sign * math.exp(min(max(logarithm, -_LOGARITHM), _LOGARITHM))


def _largest(vector: NDArray[np.float64]) -> float:
    """Largest size of a component (for short vectors several times faster than NumPy's)."""
    return max(map(abs, vector.tolist()))


def length_of(vector: NDArray[np.float64]) -> float:
    """Length of a vector (for short vectors several times faster than NumPy's)."""
    return math.sqrt(float(vector @ vector))
