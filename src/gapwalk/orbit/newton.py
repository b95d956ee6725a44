"""Newton's method for one orbit at fixed parameters, damped for convergence from rough starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.flow.length_unit import smallness
from gapwalk.orbit.orbit_equation import Equation, Evaluation

_RUNAWAY = 1e12  # size above which unknowns are not a motion, as at an undamped resonance


@dataclass(frozen=True, slots=True)
class Newton:
    """Options of Newton's method.

    Parameters
    ----------
    iterations
        Largest number of iterations.
    halvings
        Largest number of halvings of a step that does not reduce the residual; then it is taken nevertheless.
    """

    iterations: int = 40
    halvings: int = 6


def solve(
    equation: Equation, unknowns: NDArray[np.float64], value: float, options: Newton | None = None
) -> tuple[NDArray[np.float64], Evaluation]:
    """Return the solution nearest to a start, and the evaluation there.

    Raises
    ------
    ConvergenceError
        If there is none within reach; the message gives the last residual.
    """
    options = options or Newton()
    evaluation = _evaluate(equation, unknowns, value)
    for _ in range(options.iterations):
        if is_solved(equation, unknowns, evaluation):
            return _polished(equation, unknowns, value, evaluation)
        step = np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0]
        unknowns, evaluation = _damped(equation, unknowns, value, evaluation, step, options.halvings)
    if is_solved(equation, unknowns, evaluation):
        return _polished(equation, unknowns, value, evaluation)
    raise ConvergenceError(
        f"no period-{equation.period} orbit found in {options.iterations} Newton iterations; the last residual is "
        f"{np.abs(evaluation.residual).max():.3g}"
    )


def is_solved(equation: Equation, unknowns: NDArray[np.float64], evaluation: Evaluation) -> bool:
    """Return whether the residual is within the equation's tolerance, relative to the size of the unknowns."""
    scale = max(smallness(equation.system), float(np.abs(unknowns).max()))
    if scale > _RUNAWAY:
        return False
    return float(np.abs(evaluation.residual).max()) <= equation.tolerance * scale


def _polished(equation: Equation, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation):
    """Take one more step, which leaves only rounding errors, if it helps and if the orbit is an isolated one."""
    try:
        better = unknowns - np.linalg.solve(evaluation.by_unknowns, evaluation.residual)
        trial = equation.evaluate(better, value)
    except (np.linalg.LinAlgError, FlowError):
        return unknowns, evaluation
    if np.abs(trial.residual).max() < np.abs(evaluation.residual).max():
        return better, trial
    return unknowns, evaluation


def _evaluate(equation: Equation, unknowns: NDArray[np.float64], value: float) -> Evaluation:
    try:
        return equation.evaluate(unknowns, value)
    except FlowError as error:
        raise ConvergenceError(f"the motion from the start of Newton's method cannot be followed: {error}") from error


def _damped(equation, unknowns, value, evaluation, step, halvings):
    """Return the longest of the halved steps that reduces the residual."""
    before, factor = np.linalg.norm(evaluation.residual), 1.0
    best = None
    for _ in range(halvings + 1):
        try:
            trial = equation.evaluate(unknowns + factor * step, value)
        except FlowError:
            trial = None
        if trial is not None:
            best = (unknowns + factor * step, trial) if best is None else best
            if np.linalg.norm(trial.residual) < before:
                return unknowns + factor * step, trial
        factor /= 2
    if best is None:
        raise ConvergenceError("Newton's method left the region in which the motion can be followed")
    return best
