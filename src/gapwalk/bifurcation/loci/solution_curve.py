"""Moves along the solution curve of an equation from a place nearby: onto it, and to the zero of a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Correction, Corrector


@dataclass(frozen=True, slots=True)
class Secant:
    """Options of the secant method along a curve; all lengths are scaled.

    Parameters
    ----------
    first
        The first step.
    longest
        The longest step.
    farthest
        Largest distance from the start.
    exact
        Step below which it has converged.
    noise
        Step below which it has also converged if steps no longer shrink, because of rounding.
    steps
        Largest number of steps.
    """

    first: float = 1e-4
    longest: float = 1e-2
    farthest: float = 0.1
    exact: float = 1e-12
    noise: float = 1e-7
    steps: int = 25


def onto_curve(corrector: Corrector, start: NDArray[np.float64]) -> tuple[Correction | None, NDArray[np.float64]]:
    """Return the point of a curve nearest to a start in scaled variables, or None, and the tangent near there."""
    x = start * corrector.scales
    evaluation = corrector.equation.evaluate(x[:-1], float(x[-1]))
    assert evaluation.by_parameter is not None
    jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * corrector.scales
    tangent = np.linalg.svd(jacobian)[2][-1]
    return corrector.correct(start, tangent), tangent


def zero_along(
    corrector: Corrector, start: NDArray[np.float64], function: Callable[[Correction], float], secant: Secant
) -> Correction | None:
    """Locate a zero of a function on a curve near a start by the secant method; None if none is found."""
    correction, tangent = onto_curve(corrector, start)
    if correction is None:
        return None
    origin, s, s_before, last = correction.x, 0.0, -secant.first, np.inf
    before = corrector.correct(origin + s_before * tangent, tangent)
    if before is None:
        return None
    f_before = function(before)
    for _ in range(secant.steps):
        f = function(correction)
        if f == f_before or not np.isfinite(f):
            return None
        step = -f * (s - s_before) / (f - f_before)
        if abs(step) <= secant.exact or last < abs(step) < secant.noise:
            return correction
        s_before, f_before, last = s, f, abs(step)
        s += max(-secant.longest, min(secant.longest, step))
        correction = corrector.correct(origin + s * tangent, tangent) if abs(s) < secant.farthest else None
        if correction is None:
            return None
    return None
