"""Harmonic balance equations of the full and of the reduced system; the unknowns of both are contact deflections."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.orbit import Orbit

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation
    from gapwalk.reduction.reduction import Reduction

_HARMONICS = 15
_CONTRACTION = 0.5  # largest ratio of the second of two Newton corrections to the first


class Correction(NamedTuple):
    """The result of two steps of Newton's method on the full system's equation from a motion of the reduced one.

    Attributes
    ----------
    unknowns : shape (N,)
        The motion after the steps.
    change : float
        Bound on the distance of the full system's motion, relative to the size of the motion; inf if the steps do not
        converge, because then nothing is known.
    """

    unknowns: NDArray[np.float64]
    change: float


@dataclass(frozen=True)
class Pair:
    """The equations of both systems.

    In harmonic balance all coordinates except the deflections of the contacts are eliminated, exactly, so equations of
    systems of different size have the same unknowns. Their difference at a motion is the effect of the reduction alone,
    because the truncation of harmonics is common to both.

    Parameters
    ----------
    reduction
        The reduction.
    system
        The reduced system, at its parameter values.
    parameter
        Name of the parameter that varies, or None.
    period
        Period m in forcing periods.
    method
        Options of the harmonic balance.
    """

    reduction: Reduction
    system: System
    parameter: str | None
    period: int
    method: Balance

    @cached_property
    def reduced(self) -> BalanceEquation:
        """The equation of the reduced system."""
        return self.method.pose(self.system, self.parameter, self.period)

    @cached_property
    def full(self) -> BalanceEquation:
        """The equation of the full system."""
        return self.method.pose(self.reduction.full_at(self.system), self.parameter, self.period)

    def correct(self, unknowns: NDArray[np.float64], value: float = 0.0) -> Correction:
        """Correct a motion of the reduced system towards that of the full one.

        By Newton and Kantorovich: after corrections of lengths a and theta a, with ``theta < 1/2``, the solution is
        within ``a / (1 - theta)``.
        """
        size = self.size(unknowns)
        lengths: list[float] = []
        for _ in range(2):
            evaluation = self.full.evaluate(unknowns, value)
            step = np.asarray(
                np.linalg.lstsq(evaluation.by_unknowns, -evaluation.residual, rcond=1e-14)[0], dtype=float
            )
            unknowns = unknowns + step
            lengths.append(self.size(step, mean=True))
        first, second = lengths
        if first == 0.0:
            return Correction(unknowns, 0.0)
        theta = second / first
        return Correction(unknowns, first / (1.0 - theta) / size if theta < _CONTRACTION else np.inf)

    def size(self, unknowns: NDArray[np.float64], *, mean: bool = False) -> float:
        """Return the largest sum of amplitudes of a deflection, with its mean or without."""
        from gapwalk.orbit.harmonic_balance.kernels import (
            from_real_form,  # imported late: it loads numba, which takes long
        )

        lines = np.abs(from_real_form(unknowns.reshape(len(self.system.structure.contacts), -1)))
        return float(lines[:, 0 if mean else 1 :].sum(axis=1).max())


def method_for(orbit: Orbit, method: Balance | None) -> Balance:
    """Return the harmonic balance for an orbit: the given one, or with as many harmonics as the orbit has."""
    if method is not None and not isinstance(method, Balance):
        raise ModelError(f"method is {method!r}; it must be a Balance, as in Balance(harmonics=20)")
    if method is None:
        return Balance(max(_HARMONICS, orbit.harmonics), error=1.0)
    return Balance(method.harmonics or _HARMONICS, error=1.0, stability=method.stability, tolerance=method.tolerance)
