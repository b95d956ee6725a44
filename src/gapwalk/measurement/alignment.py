"""A record aligned in phase with a computed orbit, and how well the two agree (paper, figure 8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.agreement import Agreement, agreement
from gapwalk.measurement.misfit import Misfit
from gapwalk.measurement.record import Record
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.signal import Signal, signal_of
from gapwalk.orbit.orbit import Orbit

_STEPS = 30  # Gauss-Newton steps of the phase; from the grid it takes three
_STILL = 1e-12  # rad
_ALIKE = 0.8  # correlation below which the two are hardly the same motion


@dataclass(frozen=True, eq=False, repr=False)
class Alignment:
    """A record beside a computed orbit, at the phase at which they agree best.

    Attributes
    ----------
    orbit, record, signal
        What is compared.
    phase
        Phase of the excitation at the first sample of the record, in radians.
    periods
        Periods of the orbit that the record holds.
    theta : shape (samples,)
        Angle of the excitation at the samples that were used.
    measured, computed : shape (samples,)
        The two histories, their means left out.
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
        """Why this may not be the motion that was measured, in sentences."""
        found = []
        if not self.orbit.stable:
            found.append("the computed motion is unstable, so it is hardly what was measured")
        if self.agreement.correlation < _ALIKE:
            found.append(
                f"record and motion hardly correlate ({self.agreement.correlation:.2f}): perhaps another motion of the "
                "system was measured, from another start or of another period, or the signal or a scale is wrong"
            )
        return tuple(found)

    def plot(self, title: str | None = None, **options: Any):
        """Draw the record over the computed motion, and their lines; see `gapwalk.plot.draw`."""
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
    """Align a record in phase with a computed orbit, and say how well they agree.

    The period is that of the excitation. The orbit is evaluated at the record's own instants, so nothing is resampled;
    the phase that fits best in the sense of least squares is found to rounding, far below one sample.

    Parameters
    ----------
    orbit
        The orbit.
    record
        What was measured, in the units of the model.
    signal
        What of the motion it measures: a name as in `Motion.signal` such as ``"q1''"``, or a sum of several, as in
        ``{"q1''": 1.0, "q3''": -0.5}``.
    phase
        Phase of the excitation at the first sample, in radians, if it is known.
    order
        Periods of the excitation in a turn of the shaft whose speed was measured.

    Raises
    ------
    ModelError
        If there is no such signal, or the record is too short, too coarse, constant, or at another speed.
    """
    misfit = Misfit(orbit, record, signal_of(orbit.system, signal), order)
    return aligned(misfit, orbit, found_phase(misfit, orbit) if phase is None else phase)


def found_phase(misfit: Misfit, orbit: Orbit) -> float:
    """The phase of the first sample at which record and orbit agree best."""
    phase = misfit.best_phase(orbit)
    error = np.inf
    for _ in range(_STEPS):
        residual, slope = misfit.residual(orbit, phase), misfit.slopes(orbit, phase, ()).table[:, 0]
        if residual @ residual >= error:  # as near as rounding lets it
            break
        error = residual @ residual
        step = -float(slope @ residual) / float(slope @ slope) if slope.any() else 0.0
        phase += step
        if abs(step) < _STILL:
            break
    return phase % (PERIOD * orbit.period)


def aligned(misfit: Misfit, orbit: Orbit, phase: float) -> Alignment:
    """The alignment of an orbit at a phase."""
    theta, computed = misfit.angles(orbit.system.frequency) + phase, misfit.computed(orbit, phase)
    found = agreement(theta, misfit.measured, computed, misfit.orders, orbit.system.turns)
    return Alignment(
        orbit, misfit.record, misfit.signal, phase, misfit.periods, theta, misfit.measured, computed, found
    )
