"""Alignment in phase of a measured record with a computed orbit, and their agreement (paper, figure 8).

Nothing is interpolated: the orbit is evaluated at every instant of the record, whose first sample lies at an unknown
phase of the excitation. Means are removed, because an accelerometer does not measure them. Derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.compare_motions import Agreement, agreement, lines_of, orders_of
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.measured_record import Record
from gapwalk.model.system import pace_text
from gapwalk.notebook import Pictured
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sensitivity import sensitivity, signal_along

_STEPS = 30  # most Gauss-Newton steps of the phase; from the grid three suffice
_STILL = 1e-12  # step of the phase in rad below which the iteration ends
_HIGHEST = 20.0  # highest order of the lines that are compared
_FEWEST = 8  # fewest samples per forcing period
_CANCELLED = 1e-9  # size of a derivative, relative to its terms, that is only rounding
_GRID = 1024  # phases per forcing period that are tried
_ALIKE = 0.8  # correlation below which the two are probably different motions


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(Pictured):
    """A record and a computed orbit, at the phase at which they agree best.

    Examples
    --------
    >>> found = gw.measure.align(orbit, record, "x''")
    >>> found.periods, round(found.agreement.correlation, 6)
    (1, 1.0)
    """

    #: orbit, record, signal: The orbit, the record, and the signal of the orbit that is compared with the record.
    orbit: Orbit
    record: Record
    signal: Signal
    phase: float  #: Phase of the excitation at the first sample of the record, in radians.
    periods: int  #: Number of periods of the orbit in the record.
    theta: NDArray[np.float64]  #: shape (samples,): Angle of the excitation at the samples that were used.
    #: measured, computed: shape (samples,): The two histories without their means.
    measured: NDArray[np.float64]
    computed: NDArray[np.float64]
    agreement: Agreement  #: Rms error, correlation, and spectral lines; the record is the first of the two.

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why this may not be the measured motion, in sentences."""
        found = []
        if not self.orbit.stable:
            found.append("the computed motion is unstable, so it is probably not the measured one")
        if self.agreement.correlation < _ALIKE:
            found.append(
                f"record and motion hardly correlate ({self.agreement.correlation:.2f}): perhaps another motion of the "
                "system was measured (another start or another period), or the signal or a scale is wrong"
            )
        return tuple(found)

    def __repr__(self) -> str:
        found = self.agreement
        return (
            f"Alignment({self.record.name} as {self.signal.name}: rms error {found.rms:.4g} "
            f"({found.relative:.2%} of the record's), correlation {found.correlation:.6f}, "
            f"phase {self.phase:.6g} rad, {self.periods} periods)"
        )


class Misfit:
    """A record to compare with the orbits of one branch, over as many whole periods of them as it contains."""

    def __init__(self, orbit: Orbit, record: Record, signal: Signal, order: float = 1.0) -> None:
        self.record, self.signal, self.period, self._order = record, signal, orbit.period, order
        motion = orbit.motion(1)
        if struck := [name for name, _ in signal.terms if len(motion.impulses(name)[0])]:
            raise ModelError(
                f"{struck[0]} is infinite where a rigid stop strikes, so it cannot be compared sample by sample; give "
                "the stop a stiffness, or compare a velocity or a position"
            )
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
    """Derivatives of the residual."""

    table: NDArray[np.float64]  #: shape (samples, k): Derivatives by each parameter, and by the phase.
    moving: NDArray[np.bool_]  #: shape (k,): True for derivatives larger than rounding.

    def first(self, count: int) -> Slopes:
        """Return the derivatives by the first parameters."""
        return Slopes(self.table[:, :count], self.moving[:count])


def align(
    orbit: Orbit,
    record: Record,
    signal: str | Mapping[str, float] | Signal,
    *,
    phase: float | None = None,
    order: float = 1.0,
) -> Alignment:
    """Align a record in phase with a computed orbit, and evaluate their agreement.

    The period is that of the excitation. The orbit is evaluated at the instants of the record, so nothing is resampled.
    The phase that fits best in the least-squares sense is found to rounding, far below one sample.

    Parameters
    ----------
    orbit
        The orbit.
    record
        The measured record, in the units of the model.
    signal
        The measured signal: a name as in `Motion.signal` such as ``"q1''"``, or a weighted sum of several, as in
        ``{"q1''": 1.0, "q3''": -0.5}``.
    phase
        Phase of the excitation at the first sample, in radians, if it is known.
    order
        Excitation periods per turn of the shaft whose speed was measured.

    Returns
    -------
    Alignment
        Both histories at the best phase, and their agreement.

    Raises
    ------
    ModelError
        If there is no such signal, or the record is too short, too coarse, constant, or at another speed.

    Examples
    --------
    >>> found = gw.measure.align(orbit, record, "x''")
    >>> round(found.agreement.correlation, 6), found.periods
    (1.0, 1)
    """
    misfit = Misfit(orbit, record, signal_of(orbit.system, signal), order)
    return aligned(misfit, orbit, found_phase(misfit, orbit) if phase is None else phase)


def found_phase(misfit: Misfit, orbit: Orbit) -> float:
    """Find the phase of the first sample at which record and orbit agree best."""
    phase = misfit.best_phase(orbit)
    error = np.inf
    for _ in range(_STEPS):
        residual, slope = misfit.residual(orbit, phase), misfit.slopes(orbit, phase, ()).table[:, 0]
        if residual @ residual >= error:  # no further progress because of rounding
            break
        error = residual @ residual
        step = -float(slope @ residual) / float(slope @ slope) if slope.any() else 0.0
        phase += step
        if abs(step) < _STILL:
            break
    return phase % (PERIOD * orbit.period)


def aligned(misfit: Misfit, orbit: Orbit, phase: float) -> Alignment:
    """Build the alignment of an orbit at a given phase."""
    theta, computed = misfit.angles(orbit.system.frequency) + phase, misfit.computed(orbit, phase)
    found = agreement(theta, misfit.measured, computed, misfit.orders, orbit.system.turns)
    return Alignment(
        orbit, misfit.record, misfit.signal, phase, misfit.periods, theta, misfit.measured, computed, found
    )
