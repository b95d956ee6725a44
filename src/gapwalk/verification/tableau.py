"""Coefficients of Dormand and Prince's method of order 8, from `scipy.integrate.DOP853`."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

STAGES = 12
"""Evaluations of the rates in a step, not counting the one at its end."""


class Tableau(NamedTuple):
    """Coefficients of a step.

    Attributes
    ----------
    a : shape (STAGES, STAGES)
        Weights of earlier stages in each stage.
    b : shape (STAGES,)
        Weights of the stages in the step.
    c : shape (STAGES,)
        Times of the stages, in steps.
    fifth, third : shape (STAGES + 1,)
        Weights in the two estimates of the error.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    c: NDArray[np.float64]
    fifth: NDArray[np.float64]
    third: NDArray[np.float64]


@cache
def tableau() -> Tableau:
    """Return the coefficients."""
    from scipy.integrate import DOP853  # takes a fifth of the start-up time of a command, and few commands verify

    method: Any = DOP853
    return Tableau(method.A[:STAGES, :STAGES], method.B, method.C[:STAGES], method.E5, method.E3)
