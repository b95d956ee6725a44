"""An orbit that was found by harmonic balance: it knows its Fourier series, and draws its motion from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion
from gapwalk.orbit.harmonic_balance.series import Series
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.survey import Turns

_AMPLIFIED = 30.0  # times what is neglected by which multipliers may be off


@dataclass(frozen=True, eq=False, repr=False)
class BalancedOrbit(Orbit):
    """A motion given by its Fourier series; the rest as for any orbit.

    It satisfies the equations of motion up to the harmonics that are neglected. An integration from its state would
    leave an unstable one, so everything is drawn from the series.

    Attributes
    ----------
    series
        The lines of all coordinates.
    deflections
        The lines of the deflections of all contacts.
    truncation
        Sum of the amplitudes of the neglected harmonics, as the exact contact force drives them, relative to the
        largest amplitude of the deflections.
    """

    found_by: ClassVar[str] = "harmonic-balance"
    is_exact: ClassVar[bool] = False

    series: Series
    deflections: Series
    truncation: float = field()

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        super()._check_read()
        series = (self.series, self.deflections)
        rows, widths = zip(*(each.lines.shape for each in series), strict=True)
        if rows != (self.system.size, len(self.system.structure.contacts)) or not 0 < min(widths) == max(widths):
            raise ValueError("the lines of an orbit are not those of its coordinates and contacts")
        if any(each.period != self.period for each in series):
            raise ValueError("the lines of an orbit are those of another period")

    @property
    def harmonics(self) -> int:
        """H, the highest harmonic of the forcing frequency."""
        return (self.series.lines.shape[1] - 1) // self.period

    @property
    def multiplier_error(self) -> float:
        """About by how much the multipliers may be off for what is neglected: thirty times that."""
        return _AMPLIFIED * self.truncation

    def motion(self, samples: int | None = None) -> Motion:
        """One full period, sampled evenly with `samples` a forcing period."""
        count = (samples or self.samples) * self.period
        theta = PERIOD * self.period * np.arange(count + 1) / count
        states = self.series.states(theta)
        n = self.system.size
        return Motion(self.system, theta, states[:, :n], states[:, n:], self.events)

    def strobes(self, count: int, apart: float = PERIOD) -> NDArray[np.float64]:
        """The first `count` states that lie `apart` radians of theta from each other, shape (count, 2n)."""
        return self.series.states(apart * np.arange(count, dtype=float))

    @cached_property
    def turns(self) -> tuple[Turns, ...]:
        """For each contact the angles at which its deflection turns, and its values there."""
        return tuple(Turns(*found[:, np.argsort(found[0])].tolist()) for found in self.deflections.turns())

    @cached_property
    def extremes(self) -> NDArray[np.float64]:
        """Maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        return self.series.extremes()
