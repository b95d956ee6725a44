"""Corrector of tori: Newton's method whose dense Jacobian is factorised once for all passes.

The bordered Jacobian of a curve with N samples has some N * size rows. Its factors at the guess serve the later passes
too: their systems are solved by iterative refinement, whose products use the blocks and the rotation of the exact
Jacobian. So every pass is one of Newton's method, and only the first one factorises a matrix.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gapwalk.continuation.corrector import Correction, Corrector, Course, length_of
from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit_equation import Equation, Evaluation
from gapwalk.tori.torus_equation import TorusEquation, TorusLinearisation

_LOST = 2.0  # growth of the residual from one iteration to the next at which the corrector gives up
_CONTRACTION = 0.5  # largest ratio of successive steps that converge; of residuals, above which one is rounding
_QUADRATIC = 1e-7  # residual, over the size of the motion, and step, after which the next one reaches rounding
_POLISH = 1e-5  # longest last step
_EXACT = 3e-14  # residual, over the size of the motion, that is only rounding
_REFINEMENTS = 8
_REFINED = 1e-10  # residual of a linear system, over its right-hand side, at which its solution is accepted
_FASTER = 0.3  # ratio of successive such residuals above which the matrix is factorised again
_NONE = np.zeros((0, 0))  # the Jacobian of a torus is kept as its blocks

Array = NDArray[np.float64]


class _Factors:
    """Factors of a bordered Jacobian, which also solve systems with others near it."""

    def __init__(self, scales: Array, normal: Array) -> None:
        self.scales, self.normal = scales, normal
        self._factors: tuple[Array, NDArray[np.intp]] | None = None

    def solve(self, found: TorusLinearisation, right: Array) -> Array | None:
        """Return the solutions for some right-hand sides in columns, in scaled variables; None if singular."""
        if self._factors is not None:
            solution = self._refined(found, right)
            if solution is not None:
                return solution
        size = len(self.scales)
        matrix = np.empty((size, size), order="F")
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1] = found.dense(), found.columns[:, 1], self.normal
        matrix[:-1] *= self.scales
        factors, pivots, singular = lapack.dgetrf(matrix, overwrite_a=True)
        if singular:
            return None
        self._factors = factors, pivots
        return lapack.dgetrs(factors, pivots, right)[0]

    def _refined(self, found: TorusLinearisation, right: Array) -> Array | None:
        assert self._factors is not None
        wanted = np.abs(right).max(axis=0)
        solution, residual, before = np.zeros_like(right), right, math.inf
        for _ in range(_REFINEMENTS):
            solution = solution + lapack.dgetrs(*self._factors, residual)[0]
            product = found.product(solution * self.scales[:, None])
            residual = right - np.vstack((product, self.normal @ solution))
            off = float((np.abs(residual).max(axis=0) / wanted).max())
            if off <= _REFINED:
                return solution
            if not off < _FASTER * before:
                return None
            before = off
        return None


class TorusCorrector(Corrector):
    """Corrector for families of tori; see `Corrector`.

    Shapes: `scales` (N * size + 2,).
    """

    def __init__(self, curves: TorusEquation, scales: Array) -> None:
        super().__init__(cast(Equation, cast(object, curves)), scales)
        self.curves = curves

    def correct(self, guess: Array, normal: Array, trust: float = 0.0, near: float = math.inf) -> Correction | None:
        """Return the torus of the family in the plane through `guess` with that `normal`; None if Newton fails.

        The residual need only be so small that the next pass reaches rounding: the error of a torus is measured
        between its samples, so that a wrong pass would be seen there.
        """
        factors, right = _Factors(self.scales, normal), np.zeros((len(guess), 2), order="F")
        right[-1, 1] = 1.0
        x, last, before = guess, 0.0, math.inf
        for iteration in range(self.iterations + 1):
            unknowns = x[:-1] * self.scales[:-1]
            try:
                found = self.curves.linearise(unknowns, float(x[-1] * self.scales[-1]))
            except NumericalError:
                return None
            size, scale = (float(np.abs(each).max()) for each in (found.residual, unknowns))
            solved = size <= self.curves.tolerance * scale
            if not solved and not size <= _LOST * before:
                return None
            right[:-1, 0], right[-1, 0] = -found.residual, 0.0
            steps = factors.solve(found, right)
            if steps is None:
                return None
            length = length_of(steps[:, 0])
            converges = solved and (not last or length <= _CONTRACTION * last or size >= _CONTRACTION * before)
            if converges or size <= _EXACT * scale or max(size / scale, length) <= _QUADRATIC:
                # where the residual is only rounding, a long step means a nearly singular Jacobian, as at a resonance
                x = x + steps[:, 0] if length < _POLISH else x
                along = steps[:, 1]
                evaluation = Evaluation(found.residual, _NONE, found.columns[:, 1], found)
                course = Course(along / length_of(along), math.nan)
                return Correction(x, evaluation, iteration, length_of(x - guess), last, course)
            x, last, before = x + steps[:, 0], length, size
        return None

    def tangent(self, evaluation: Evaluation, along: Array) -> Course:
        """Return the unit tangent at a point, oriented along `along`; its determinant is not computed."""
        right = np.zeros((len(along), 1), order="F")
        right[-1] = 1.0
        found = _Factors(self.scales, along).solve(evaluation.evidence, right)
        if found is None:
            raise NumericalError("the tangent of a family of tori is not unique")
        return Course(found[:, 0] / length_of(found[:, 0]), math.nan)
