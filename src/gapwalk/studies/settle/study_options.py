"""What the study of a settled motion is asked to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gapwalk.attractors.lyapunov import LyapunovOptions
from gapwalk.attractors.settle import SettleOptions
from gapwalk.studies.options import StudyOptions

_LIMITS = SettleOptions()


@dataclass(frozen=True, slots=True)
class SettleStudyOptions(StudyOptions):
    """Where a motion settles: its attractor, how it rattles, and its spectrum.

    Parameters
    ----------
    signal
        A coordinate, its velocity (``q1'``) or acceleration (``q1''``), a contact's force (``stop.force``), or another
        signal of `Motion.signal`: what the spectrum is of, and what the picture shows.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    phase
        Phase of the excitation at which the section is taken, in radians.
    max_periods, max_period, tolerance
        How to settle; as `gapwalk.SettleOptions`.
    lyapunov
        How long the exponents of a motion without period are averaged.
    """

    kind: ClassVar[str] = "settle"

    signal: str
    start: str | tuple[float, ...] = "rest"
    phase: float = 0.0
    max_periods: int = _LIMITS.max_periods
    max_period: int = _LIMITS.max_period
    tolerance: float = _LIMITS.tolerance
    lyapunov: LyapunovOptions = LyapunovOptions()

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        start = self.start if isinstance(self.start, str) else f"({', '.join(f'{value:g}' for value in self.start)})"
        return f"settle from {start}, showing {self.signal}"

    @property
    def limits(self) -> SettleOptions:
        """How to settle."""
        return SettleOptions(self.max_periods, self.max_period, self.tolerance)
