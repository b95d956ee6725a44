"""Alignment in phase of a measured record with a computed orbit, and their agreement (paper, figure 8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.contrast import Agreement, agreement
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.measured_record import Record
from gapwalk.measurement.misfit import Misfit
from gapwalk.orbit.orbit import Orbit

_STEPS = 30  # most Gauss-Newton steps of the phase; from the grid three suffice
_STILL = 1e-12  # step of the phase in rad below which the iteration ends
_ALIKE = 0.8  # correlation below which the two are probably different motions


@dataclass(frozen=True, eq=False, repr=False)
class Alignment:
    """A record and a computed orbit, at the phase at which they agree best.

    Attributes
    ----------
    orbit, record, signal
        The orbit, the record, and the signal of the orbit that is compared with the record.
    phase
        Phase of the excitation at the first sample of the record, in radians.
    periods
        Number of periods of the orbit in the record.
    theta : shape (samples,)
        Angle of the excitation at the samples that were used.
    measured, computed : shape (samples,)
        The two histories without their means.
    agreement
        Rms error, correlation, and spectral lines; the record is the first of the two.
    """

    orbit: Orbit
    record: Record
    signal: Signal
    phase: float
    periods: int
    theta: NDArray[np.float64]
    measured: NDArray[np.float64]
    computed: NDArray[np.float64]
    agreement: Agreement

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

    def plot(self, title: str | None = None, **options: Any):
        """Draw the record over the computed motion, and their spectral lines; see `gapwalk.plot.draw`."""
        from gapwalk.plot import draw

        return draw(self, title=title, **options)

    def __repr__(self) -> str:
        found = self.agreement
        return (
            f"Alignment({self.record.name} as {self.signal.name}: rms error {found.rms:.4g} "
            f"({found.relative:.2%} of the record's), correlation {found.correlation:.6f}, "
            f"phase {self.phase:.6g} rad, {self.periods} periods)"
        )


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

    Raises
    ------
    ModelError
        If there is no such signal, or the record is too short, too coarse, constant, or at another speed.
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
