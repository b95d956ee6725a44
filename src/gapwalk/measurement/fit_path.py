"""Minimisation of the misfit between an orbit and a record over parameters, along the branch of the first orbit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.measurement.misfit import Misfit, Slopes
from gapwalk.orbit.carry_orbit import carry
from gapwalk.orbit.orbit import Orbit

_SETTLED = 1e-4  # change of the sum of squares, in noise variances, that is small compared with any error bar
_TOLERANCE = 1e-12  # relative tolerance of step and gradient
_INDEPENDENT = 1e-7  # smallest independent part of a slope, relative to its size, for which a parameter is fitted
_ROUNDS = 3  # most minimisations, each with the parameters that have an effect by then


class Descent(NamedTuple):
    """The end of a minimisation.

    Attributes
    ----------
    values : shape (k,)
        The parameters, and the phase if it is fitted too.
    orbit
        The orbit at these values.
    slopes
        Derivatives of the residual at these values.
    free : shape (k,)
        True for values that were changed; the others cannot be distinguished from them and have their first values.
    evaluations
        Number of orbits that were compared with the record.
    lost
        A sentence on the values that the branch does not reach; empty if it reached all of them.
    """

    values: NDArray[np.float64]
    orbit: Orbit
    slopes: Slopes
    free: NDArray[np.bool_]
    evaluations: int
    lost: str


def descend(
    misfit: Misfit,
    orbit: Orbit,
    names: tuple[str, ...],
    first: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    phase: float | None,
    max_evaluations: int,
) -> Descent:
    """Minimise the sum of squares of a misfit; raise a ConvergenceError if that takes too many evaluations."""
    trial = _Trial(misfit, orbit, names, phase)
    values, slopes, evaluations = first, trial.slopes(first), 0
    free = _independent(slopes)
    for _ in range(_ROUNDS):
        values, count = _minimise(trial, values, free, bounds, max_evaluations)
        slopes, evaluations = trial.slopes(values), evaluations + count
        now = _independent(slopes)
        if np.count_nonzero(now) <= np.count_nonzero(free):
            break
        free = now  # a parameter without effect at the start may have one here, e.g. a gap
    return Descent(values, trial.orbit_at(values), slopes, free, evaluations, trial.lost)


def _minimise(trial: _Trial, values, free, bounds, max_evaluations: int) -> tuple[NDArray[np.float64], int]:
    """Return the values at the minimum over the free ones, and the number of evaluations."""
    from scipy.optimize import least_squares  # imported late: it takes long

    def whole(part: NDArray[np.float64]) -> NDArray[np.float64]:
        merged = values.copy()
        merged[free] = part
        return merged

    found = least_squares(
        lambda part: trial.residual(whole(part)),
        values[free],
        lambda part: trial.slopes(whole(part)).table[:, free],
        bounds=(bounds[0][free], bounds[1][free]),
        x_scale="jac",
        ftol=_SETTLED / len(trial.misfit.measured),
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=max_evaluations,
    )
    if found.status == 0:
        raise ConvergenceError(
            f"no minimum was found with {found.nfev} orbits; start nearer to it, or allow more orbits (FitOptions)"
        )
    return whole(found.x), found.nfev


class _Trial:
    """Evaluates trial values; each orbit is continued from the best one so far."""

    def __init__(self, misfit: Misfit, orbit: Orbit, names: tuple[str, ...], phase: float | None) -> None:
        self.misfit, self._names, self._phase = misfit, names, phase
        self._base, self._cost, self.lost = orbit, np.inf, ""

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residual at trial values; infinite if the branch does not reach them, to shorten the step."""
        try:
            orbit = self.orbit_at(x)
            values = self.misfit.residual(orbit, self._phase_at(x))
        except (NumericalError, ModelError) as error:
            self.lost = str(error)
            return np.full(len(self.misfit.measured), np.inf)
        cost = float(values @ values)
        if cost < self._cost:
            self._base, self._cost = orbit, cost
        return values

    def slopes(self, x: NDArray[np.float64]) -> Slopes:
        """Return the derivatives of the residual at values that the branch reaches."""
        return self.misfit.slopes(self.orbit_at(x), self._phase_at(x), self._names).first(len(x))

    def orbit_at(self, x: NDArray[np.float64]) -> Orbit:
        """Return the orbit at trial values."""
        values = dict(zip(self._names, x.tolist(), strict=False))
        return carry(self._base, self._base.system.at(values), self._names)

    def _phase_at(self, x: NDArray[np.float64]) -> float:
        return float(x[-1]) if self._phase is None else self._phase


def _independent(slopes: Slopes) -> NDArray[np.bool_]:
    """Mark the parameters whose effect is not a combination of the effects of others, shape (k,)."""
    from scipy.linalg import qr  # imported late, as above

    free, places = np.zeros(len(slopes.moving), dtype=bool), np.flatnonzero(slopes.moving)
    if len(places):
        columns = slopes.table[:, places]
        table, order = qr(columns / np.linalg.norm(columns, axis=0), mode="r", pivoting=True)
        own = np.abs(np.diag(table)) > _INDEPENDENT
        free[places[order[: len(own)][own]]] = True
    return free
