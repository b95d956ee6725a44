"""The balance equations of a full system and of its reduced one: the same unknowns, the deflections of the contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.balance import Balance
from gapwalk.orbit.orbit import Orbit

if TYPE_CHECKING:
    from gapwalk.orbit.balance.equation import BalanceEquation
    from gapwalk.reduction.reduction import Reduction

_HARMONICS = 15
_CONTRACTION = 0.5  # of two Newton corrections, the share of the first that the second may have


class Correction(NamedTuple):
    """What two steps of Newton's method on the full system's equation change of a motion.

    Attributes
    ----------
    unknowns : shape (N,)
        The motion after the steps.
    change : float
        Bound on how far the full system's motion is, relative to the size of the motion; inf where the steps do not
        converge, so nothing is known.
    """

    unknowns: NDArray[np.float64]
    change: float


@dataclass(frozen=True)
class Pair:
    """The two equations.

    In harmonic balance all coordinates but the deflections of the contacts are eliminated, exactly, so equations of
    systems of different size have the same unknowns. Their difference at a motion is all that the reduction changes:
    the truncation is common to both.

    Parameters
    ----------
    reduction
        The reduction.
    system
        The reduced system, at its parameter values.
    parameter
        The named parameter that varies, or None.
    period
        m, forcing periods.
    method
        How to balance.
    """

    reduction: Reduction
    system: System
    parameter: str | None
    period: int
    method: Balance

    @cached_property
    def reduced(self) -> BalanceEquation:
        """That of the reduced system."""
        return self.method.pose(self.system, self.parameter, self.period)

    @cached_property
    def full(self) -> BalanceEquation:
        """That of the full system."""
        return self.method.pose(self.reduction.full_at(self.system), self.parameter, self.period)

    def correct(self, unknowns: NDArray[np.float64], value: float = 0.0) -> Correction:
        """What the full system makes of a motion of the reduced one.

        By Newton and Kantorovich: with corrections of lengths a and theta a, ``theta < 1/2``, the solution is within
        ``a / (1 - theta)``.
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
        """The largest sum of amplitudes of a deflection, with its mean or without."""
        from gapwalk.orbit.balance.kernels import from_real_form  # loads numba, which takes time

        lines = np.abs(from_real_form(unknowns.reshape(len(self.system.structure.contacts), -1)))
        return float(lines[:, 0 if mean else 1 :].sum(axis=1).max())


def method_for(orbit: Orbit, method: Balance | None) -> Balance:
    """How to balance an orbit: as asked, or with as many harmonics as it was found with."""
    if method is not None and not isinstance(method, Balance):
        raise ModelError(f"method is {method!r}; it must be a Balance, as in Balance(harmonics=20)")
    if method is None:
        return Balance(max(_HARMONICS, orbit.harmonics), error=1.0)
    return Balance(method.harmonics or _HARMONICS, error=1.0, stability=method.stability, tolerance=method.tolerance)
