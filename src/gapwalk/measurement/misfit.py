"""Misfit between a record and an orbit at the instants of the record, with exact derivatives.

Nothing is interpolated: the orbit is evaluated at every instant of the record, whose first sample lies at an unknown
phase of the excitation. Means are removed, because an accelerometer does not measure them.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.agreement import lines_of, orders_of
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.signal import Signal
from gapwalk.measurement.measured_record import Record
from gapwalk.model.system import pace_text
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sensitivity import sensitivity, signal_along

_HIGHEST = 20.0  # highest order of the lines that are compared
_FEWEST = 8  # fewest samples per forcing period
_ROUNDING = 1e-9  # size of a derivative, relative to its terms, that is only rounding
_GRID = 1024  # phases per forcing period that are tried


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
        return Slopes(table, np.sqrt(np.mean(table**2, axis=0)) > _ROUNDING * sizes)

    def best_phase(self, orbit: Orbit) -> float:
        """Find the phase of the record's first sample at which record and orbit correlate best, on a fine grid."""
        count = _GRID * orbit.period
        theta = PERIOD * orbit.period * np.arange(count) / count
        theirs = np.fft.rfft(signal_along(orbit, self.signal, theta)) / count
        ours = lines_of(self.angles(orbit.system.frequency), self.measured, self.orders)
        product = np.zeros(count // 2 + 1, dtype=complex)
        product[1 : len(ours) + 1] = ours.conj() * theirs[1 : len(ours) + 1]
        return float(theta[np.argmax(np.fft.irfft(product, count))])
