"""Misfit between a record and an orbit at the instants of the record, with exact derivatives.

Nothing is interpolated: the orbit is evaluated at every instant of the record, whose first sample lies at an unknown
phase of the excitation. Means are removed, because an accelerometer does not measure them. The derivatives also give
the standard errors of fitted parameters, and show parameters that the record does not determine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.contrast import lines_of, orders_of
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.signal import Signal
from gapwalk.measurement.measured_record import Record
from gapwalk.model.system import pace_text
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sensitivity import sensitivity, signal_along

_HIGHEST = 20.0  # highest order of the lines that are compared
_FEWEST = 8  # fewest samples per forcing period
_CANCELLED = 1e-9  # size of a derivative, relative to its terms, that is only rounding
_GRID = 1024  # phases per forcing period that are tried
_RANK = 1e-7  # singular value, relative to the largest of slopes of equal size, below which a direction is undetermined
_SHARE = 0.05  # component of an undetermined direction above which a parameter counts as undetermined
_COLOURED = 0.2  # correlation of neighbouring residuals above which standard errors are too small
_NOISE = 4.0  # that correlation must also exceed this many of its own standard errors
_BOUND = 1e-4  # distance from a bound, relative to the parameter, below which it counts as at the bound
_ROUNDING = 1e-6  # residual, relative to the record, below which its correlation has no meaning


class Misfit:
    """A record to compare with the orbits of one branch, over as many whole periods of them as it contains.

    Parameters
    ----------
    orbit
        The first orbit; the orbits to compare have its period, and its frequency unless the frequency is fitted.
    record
        The measured record.
    signal
        The measured signal of the motion.
    order
        Excitation periods per turn of the shaft whose speed was measured.

    Raises
    ------
    ModelError
        If the record is too short or too coarse for the orbit, constant, or at another speed.
    """

    def __init__(self, orbit: Orbit, record: Record, signal: Signal, order: float = 1.0) -> None:
        self.record, self.signal, self.period, self._order = record, signal, orbit.period, order
        length = PERIOD * orbit.period
        turned = record.angles(orbit.system.frequency, order)
        step = float(turned[-1]) / (len(turned) - 1)
        if PERIOD / step < _FEWEST:
            raise ModelError(
                f"{record.name}: it has {PERIOD / step:.2g} samples per forcing period; at least {_FEWEST} are needed"
            )
        self.periods = int((float(turned[-1]) + 1.001 * step) // length)
        if not self.periods:
            raise ModelError(
                f"{record.name}: it covers {turned[-1] / PERIOD:.3g} forcing periods, but the motion repeats after "
                f"{orbit.period} at {pace_text(orbit.system, 6)}; check the time, its scale and the frequency"
            )
        self._keep = turned < length * self.periods - 1e-6 * step
        measured = record.acceleration[self._keep]
        self.measured = measured - measured.mean()
        if not self.measured.any():
            raise ModelError(f"{record.name}: it is constant, so there is nothing to compare")
        self.orders = orders_of(orbit.period, min(_HIGHEST, 0.4 * PERIOD / step))

    def angles(self, frequency: float) -> NDArray[np.float64]:
        """Return the angles of the excitation relative to the first sample, shape (samples,)."""
        return self.record.angles(frequency, self._order)[self._keep]

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """Derivative of the angles by the frequency, shape (samples,)."""
        time = self.record.time[self._keep]
        return time - time[0] if self.record.speed is None else np.zeros(len(time))

    def computed(self, orbit: Orbit, phase: float) -> NDArray[np.float64]:
        """Return the signal of an orbit at the instants of the record, without its mean, shape (samples,)."""
        values = signal_along(orbit, self.signal, self.angles(orbit.system.frequency) + phase)
        return values - values.mean()

    def residual(self, orbit: Orbit, phase: float) -> NDArray[np.float64]:
        """Return the signal of the orbit minus the record, shape (samples,)."""
        return self.computed(orbit, phase) - self.measured

    def slopes(self, orbit: Orbit, phase: float, names: tuple[str, ...]) -> Slopes:
        """Return the derivatives of the residual by named parameters, and by the phase."""
        along = sensitivity(orbit, names).signal(self.signal, self.angles(orbit.system.frequency) + phase)
        table = np.column_stack((along.by_parameters, along.by_angle))
        structure = orbit.system.structure
        if structure.pace in names:  # then the angles change too
            table[:, names.index(structure.pace)] += structure.frequency * self.times * along.by_angle
        sizes = np.maximum(np.append(along.sizes, 0.0), np.sqrt(np.mean(table**2, axis=0)))
        table -= table.mean(axis=0)
        return Slopes(table, np.sqrt(np.mean(table**2, axis=0)) > _CANCELLED * sizes)

    def best_phase(self, orbit: Orbit) -> float:
        """Find the phase of the record's first sample at which record and orbit correlate best, on a fine grid."""
        count = _GRID * orbit.period
        theta = PERIOD * orbit.period * np.arange(count) / count
        theirs = np.fft.rfft(signal_along(orbit, self.signal, theta)) / count
        ours = lines_of(self.angles(orbit.system.frequency), self.measured, self.orders)
        product = np.zeros(count // 2 + 1, dtype=complex)
        product[1 : len(ours) + 1] = ours.conj() * theirs[1 : len(ours) + 1]
        return float(theta[np.argmax(np.fft.irfft(product, count))])


class Slopes(NamedTuple):
    """Derivatives of the residual.

    Attributes
    ----------
    table : shape (samples, k)
        Derivatives by each parameter, and by the phase.
    moving : shape (k,)
        True for derivatives larger than rounding.
    """

    table: NDArray[np.float64]
    moving: NDArray[np.bool_]

    def first(self, count: int) -> Slopes:
        """Return the derivatives by the first parameters."""
        return Slopes(self.table[:, :count], self.moving[:count])


class Estimate(NamedTuple):
    """One fitted parameter.

    Attributes
    ----------
    name
        Its name.
    start, value
        The first guess, and the fitted value.
    error
        Standard error; infinite if the record does not determine the parameter, nan if it ended at a bound.
    """

    name: str
    start: float
    value: float
    error: float

    def __str__(self) -> str:
        if np.isnan(self.error):
            return f"{self.value:.6g} (at its bound)"
        return f"{self.value:.6g} ± {self.error:.2g}" if np.isfinite(self.error) else f"{self.value:.6g} (undetermined)"


class Verdict(NamedTuple):
    """The information of a record about all parameters of a fit.

    Attributes
    ----------
    estimates
        The estimates of the parameters.
    correlation : shape (k, k)
        Correlations of the errors; nan where there are none.
    held : shape (k,)
        True for parameters that ended at a bound.
    notes, failures
        Notes and failures, in sentences.
    """

    estimates: tuple[Estimate, ...]
    correlation: NDArray[np.float64]
    held: NDArray[np.bool_]
    notes: tuple[str, ...]
    failures: tuple[str, ...]


def judge(
    names: Sequence[str],
    first: NDArray[np.float64],
    values: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    residual: NDArray[np.float64],
    slopes: Slopes,
    size: float,
) -> Verdict:
    """Estimate errors of fitted parameters, and find those that the record does not determine.

    Parameters
    ----------
    names
        Names of the k parameters.
    first, values : shape (k,)
        The first guess, and the fitted values.
    bounds
        Lowest and highest values.
    residual : shape (samples,)
        Residual at the fitted values.
    slopes
        Derivatives of the residual by the parameters.
    size
        Norm of the record.
    """
    count, samples = len(names), len(residual)
    scale = np.maximum(np.abs(values), np.abs(first))
    held = (values - bounds[0] <= _BOUND * scale) | (bounds[1] - values <= _BOUND * scale)
    sizes = np.linalg.norm(slopes.table, axis=0)
    idle = ~held & ~slopes.moving
    free = np.flatnonzero(~held & ~idle)
    covariance = np.full((count, count), np.nan)
    covariance[idle, idle] = np.inf
    undetermined = [
        f"the record does not determine {names[k]}: it changes nothing in this signal"
        for k in np.flatnonzero(idle).tolist()
    ]
    if len(free):
        within, directions = _covariance(slopes.table[:, free], residual, samples - count - 1)
        covariance[np.ix_(free, free)] = within
        undetermined += [
            _sentence([names[k] for k in free.tolist()], direction / sizes[free]) for direction in directions
        ]
    variances = np.diag(covariance)
    errors = np.sqrt(variances)
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(errors, errors)
    estimates = tuple(
        Estimate(*row) for row in zip(names, first.tolist(), values.tolist(), errors.tolist(), strict=True)
    )
    return Verdict(estimates, correlation, held, tuple(_notes(estimates, residual, size)), tuple(undetermined))


def _covariance(slopes: NDArray[np.float64], residual: NDArray[np.float64], freedom: int):
    """Compute the covariance of the errors, infinite for undetermined parameters, and the undetermined directions.

    Directions are given in units of the parameters in which all slopes have equal size.
    """
    sizes = np.linalg.norm(slopes, axis=0)
    _, singular, rows = np.linalg.svd(slopes / sizes, full_matrices=False)
    seen = singular > _RANK * singular[0]
    variance = float(residual @ residual) / max(1, freedom)
    inverse = (rows[seen].T / singular[seen] ** 2) @ rows[seen]
    covariance = variance * inverse / np.outer(sizes, sizes)
    blurred = np.any(np.abs(rows[~seen]) > _SHARE, axis=0)
    covariance[blurred, :] = covariance[:, blurred] = np.nan
    covariance[blurred, blurred] = np.inf
    return covariance, rows[~seen]


def _sentence(names: Sequence[str], direction: NDArray[np.float64]) -> str:
    """Describe parameters that can be changed together without changing the signal."""
    weights = np.abs(direction) / np.abs(direction).max()
    parts = [(name, value) for name, value, weight in zip(names, direction, weights, strict=True) if weight > 1e-4]
    ratio = " : ".join(f"{value / parts[0][1]:.3g}" for _, value in parts)
    together = " and ".join(name for name, _ in parts)
    return (
        f"the record does not determine {together}: changing them as {ratio} leaves the signal unchanged; "
        "fit one fewer of them"
    )


def _notes(estimates: Sequence[Estimate], residual: NDArray[np.float64], size: float) -> Iterator[str]:
    for each in estimates:
        if np.isnan(each.error):
            yield f"{each.name} ended at its bound {each.value:.6g}; the errors of the others hold for this value"
        elif np.isfinite(each.error) and each.error > abs(each.value) and each.name != "phase":
            yield f"{each.name} is poorly determined: its standard error is larger than its value"
    squares = float(residual @ residual)
    near = float(residual[1:] @ residual[:-1]) / squares if squares > (_ROUNDING * size) ** 2 else 0.0
    if near > max(_COLOURED, _NOISE / np.sqrt(len(residual))):
        yield (
            f"neighbouring residuals correlate ({near:.2f}): they are not only noise, so standard errors are too "
            "small; perhaps the model lacks something, or the record was filtered"
        )
