"""Order tracking: a signal over the angle of the excitation while the speed changes, computed or measured.

Sampled evenly over the angle, orders stay lines while the speed changes. Extremes of each forcing period and spectra of
windows of some periods are taken along it; each part in which the speed rises or falls is a leg of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.spectrum import Waterfall
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.system import System
from gapwalk.summary import Described

_TURNS_BACK = 0.05  # share of the range of the speed by which it must come back before another leg begins


@dataclass(frozen=True, eq=False)
class Tracked(Described):
    """A signal over the angle of the excitation.

    Examples
    --------
    >>> tracked = run.tracked("x")
    >>> tracked.is_one_way, len(tracked.legs())
    (True, 1)
    """

    system: System  #: The system, whose signal it is.
    signal: str  #: Name of the signal.
    samples: int  #: Samples per forcing period; there may be further ones between them.
    theta: NDArray[np.float64]  #: shape (samples,): Angle of the excitation, in radians.
    #: time, speed: shape (samples,): Time, and the first parameter of the system, such as its speed in rpm.
    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    values: NDArray[np.float64]  #: shape (samples,): The signal.

    @property
    def is_one_way(self) -> bool:
        """True if each speed is met once."""
        signs = np.sign(np.diff(self.speed))
        return bool(len(signs)) and bool(np.all(signs == signs[0])) and bool(signs[0])

    @property
    def rises(self) -> bool:
        """True if the last speed is above the first one."""
        return bool(self.speed[-1] > self.speed[0])

    @property
    def _is_even(self) -> NDArray[np.bool_]:
        """True for the samples that divide the periods evenly."""
        return np.abs((self.theta - self.theta[0]) / PERIOD * self.samples % 1.0 - 0.5) > 0.5 - 1e-6

    def legs(self) -> tuple[Tracked, ...]:
        """Return the parts in which the speed rises or falls; waves of a measured speed below 5 % make no leg."""
        speed, reach = self.speed, _TURNS_BACK * float(np.ptp(self.speed))
        ends, way, low, high = [0], 0, 0, 0
        for place in range(0, len(speed), max(1, self.samples // 8)):
            high = place if speed[place] > speed[high] else high
            low = place if speed[place] < speed[low] else low
            if way >= 0 and speed[high] - speed[place] > reach:
                ends += [high] * (high > 0)
                way, low = -1, place
            elif way <= 0 and speed[place] - speed[low] > reach:
                ends += [low] * (low > 0)
                way, high = 1, place
        starts, stops = ends, [*ends[1:], len(speed) - 1]
        even = np.flatnonzero(self._is_even)
        found = []
        for start, stop in zip(starts, stops, strict=True):
            first = even[min(int(np.searchsorted(even, start)), len(even) - 1)]
            if stop - first >= self.samples:
                found.append(self._part(slice(int(first), stop + 1)))
        return tuple(found)

    def _part(self, part: slice) -> Tracked:
        columns = (self.theta, self.time, self.speed, self.values)
        theta, time, speed, values = (each[part] for each in columns)
        return replace(self, theta=theta, time=time, speed=speed, values=values)

    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, smallest and largest value in each forcing period, shapes (periods,).

        Returns
        -------
        speed, low, high : array, shape (periods,)
            The speed in the middle of each period, and the extremes in it.
        """
        turn = np.floor((self.theta - self.theta[0]) / PERIOD + 1e-9).astype(int)
        firsts = np.flatnonzero(np.diff(turn, prepend=-1))
        count = np.diff(np.append(firsts, len(turn)))
        firsts = firsts[count >= max(2, self.samples // 2)]  # not the beginning of a period at the end
        ends = np.minimum(firsts + self.samples, len(turn) - 1)
        pieces = [self.values[a : b + 1] for a, b in zip(firsts, ends, strict=True)]
        speeds = 0.5 * (self.speed[firsts] + self.speed[ends])
        return speeds, np.array([each.min() for each in pieces]), np.array([each.max() for each in pieces])

    def waterfall(
        self, top: float = 10.0, periods: int = 8, overlap: float = 0.75, *, over_speed: bool | None = None
    ) -> Waterfall:
        """Compute spectra over orders in windows of some forcing periods.

        Parameters
        ----------
        top
            Highest order.
        periods
            Length of a window; the resolution is one order over this number (four of them for Hann's window).
        overlap
            Share of a window that the next one repeats.
        over_speed
            True for spectra over the speed, False over the time; by default over the speed if each is met once.
        """
        turns, even = float(self.system.turns or 1), self._is_even
        values, length = self.values[even], periods * self.samples
        over_speed = self.is_one_way if over_speed is None else over_speed
        if len(values) < length:
            raise ModelError(
                f"the run-up lasts {len(values) / self.samples:.3g} forcing periods, less than a window of {periods}; "
                "give fewer periods"
            )
        count = round(top / turns * periods) + 1
        if count > length // 2:
            raise ModelError(f"top is {top:g}; with {self.samples} samples per period there are no such orders")
        weights = np.hanning(length + 1)[:-1]
        starts = np.arange(0, len(values) - length + 1, max(1, round(length * (1.0 - overlap))))
        rows = []
        for start in starts:
            piece = values[start : start + length]
            mean = piece.mean()
            lines = 2.0 * np.abs(np.fft.rfft((piece - mean) * weights)) / weights.sum()
            rows.append([abs(mean), *lines[1:count]])
        orders, along = turns * np.arange(count) / periods, (self.speed if over_speed else self.time)[even]
        return Waterfall(
            self.system.structure.pace if over_speed else "time", self.signal, along[starts + length // 2], orders,
            np.array(rows), np.ones(len(starts), bool), self.system.turns, self.system.units,
        )  # fmt: skip

    def __repr__(self) -> str:
        periods = (self.theta[-1] - self.theta[0]) / PERIOD
        return f"Tracked({self.signal}, {self.speed[0]:.6g} to {self.speed[-1]:.6g}, {periods:.4g} forcing periods)"
