"""Newton's method with deflation, which avoids known orbits (Farrell, Birkisson, Funke 2015).

Instead of ``G(x) = 0`` it solves ``M(x) G(x) = 0`` with the deflation operator

    M(x) = prod_i ( 1 / |(x - x_i) / r|^p + s )

over the known solutions x_i. (SIAM J. Sci. Comput. 37, A2026-A2045.) Its Jacobian is that of G plus a matrix of rank
one, so by the formula of Sherman and Morrison its Newton step is the ordinary one, d, times a number:

    1 / (1 - grad ln M . d)

Its reach r is short. With r as wide as the whole box of states, measured on the paper's system, the known solutions
flatten everything between them, and fewer new ones are found than without any deflation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.orbit.newton import is_solved
from gapwalk.orbit.orbit_equation import Equation, Evaluation


@dataclass(frozen=True, slots=True)
class Deflation:
    """Options of the search for further orbits. Lengths are shares of the box of states.

    Parameters
    ----------
    iterations, halvings
        Largest number of Newton steps; largest number of halvings of a step that does not reduce the deflated residual,
        before the search is given up.
    power, shift, reach
        p, s and r of the deflation operator.
    longest
        Longest step.
    farthest
        Distance from the centre of the box at which the search is given up.
    """

    iterations: int = 15
    halvings: int = 3
    power: float = 2.0
    shift: float = 1.0
    reach: float = 0.1
    longest: float = 0.5
    farthest: float = 3.0


def newton_aside(
    equation: Equation,
    start: NDArray[np.float64],
    scales: NDArray[np.float64],
    known: NDArray[np.float64] | None = None,
    options: Deflation = Deflation(),
    is_enough: Callable[[NDArray[np.float64]], bool] = lambda _: False,
) -> NDArray[np.float64] | None:
    """Find a solution other than the known ones, from a start; return None if Newton's method finds none.

    Parameters
    ----------
    equation
        The equation, without a parameter.
    start : shape (N,)
        The initial guess.
    scales : shape (N,)
        Half-widths of the box of states, the units of length.
    known : shape (K, N)
        The known solutions; without any, this is Newton's method with damping and bounds.
    options
        Options of the search.
    is_enough
        Called after each step; if it returns True, the search is given up, for instance near a known solution.
    """
    known = np.zeros((0, len(start))) if known is None else known
    x, evaluation = start, _evaluate(equation, start, scales, options)
    for _ in range(options.iterations):
        if evaluation is None or is_solved(equation, x, evaluation):
            break
        try:
            newton = np.linalg.solve(evaluation.by_unknowns, -evaluation.residual)
        except np.linalg.LinAlgError:
            return None
        step = newton
        if len(known):
            away = (x - known) / (scales * options.reach)
            step = newton * _stretch(away, newton / (scales * options.reach), options)
        step *= min(1.0, options.longest / float(np.linalg.norm(step / scales)))
        x, evaluation = _line_search(equation, x, evaluation, step, scales, known, options)
        if evaluation is not None and is_enough(x):
            return None
    if evaluation is None or not is_solved(equation, x, evaluation):
        return None
    return x


def _stretch(away: NDArray[np.float64], step: NDArray[np.float64], options: Deflation) -> float:
    """Return the factor by which deflation intervals (or reverses) the Newton step."""
    p, distance2 = options.power, np.maximum((away * away).sum(axis=1), 1e-300)
    slopes = -p / (distance2 * (1.0 + options.shift * distance2 ** (p / 2.0)))
    rest = 1.0 - float(slopes @ (away @ step))
    return 1.0 / (rest if abs(rest) > 1e-9 else 1e-9)


def _line_search(equation, x, evaluation, step, scales, known, options: Deflation):
    """Return the first of the halved steps that reduces the deflated residual; None as evaluation if none does."""
    before, factor = _merit(x, evaluation, scales, known, options), 1.0
    for _ in range(options.halvings + 1):
        there = x + factor * step
        trial = _evaluate(equation, there, scales, options)
        if trial is not None and _merit(there, trial, scales, known, options) < before:
            return there, trial
        factor /= 2.0
    return x, None


def _merit(x, evaluation: Evaluation, scales, known, options: Deflation) -> float:
    """Return the logarithm of the size of the deflated residual."""
    size = math.log(max(math.hypot(*(evaluation.residual / scales).tolist()), 1e-300))
    if not len(known):
        return size
    away = (x - known) / (scales * options.reach)
    distance2 = np.maximum((away * away).sum(axis=1), 1e-300)
    return size + float(np.log(distance2 ** (-options.power / 2.0) + options.shift).sum())


def _evaluate(equation: Equation, x: NDArray[np.float64], scales, options: Deflation) -> Evaluation | None:
    """Evaluate the equation at a point; None outside the bounds, where hard impacts make integration extremely slow."""
    if not np.abs(x / scales).max() <= options.farthest:
        return None
    try:
        return equation.evaluate(x, 0.0)
    except NumericalError:
        return None
