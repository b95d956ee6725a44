"""A speed that is a given function of time: a ramp, or a measured trace; linear between its points.

Over the angle of the excitation it is divided into pieces of constant acceleration, none longer than a period.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.bounds import NotNegative, Positive, check
from gapwalk.model.channels.channel_file import NamedFile
from gapwalk.model.measured.measured_table import WantedColumn, read_table
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind

_MOST = 100_000
_MOST_SAMPLES = 20_000_000


@dataclass(frozen=True, eq=False)
class SpeedCourse:
    """Speed over time, linear between points.

    Raises
    ------
    ModelError
        If times do not increase from 0, or a speed is not positive.

    Examples
    --------
    >>> gw.ask.SpeedCourse.ramp(700.0, 1100.0, 200.0).duration
    2.0
    """

    #: shape (points,): Increasing times from 0: in seconds if the system has units, otherwise non-dimensional.
    time: NDArray[np.float64]
    #: shape (points,): Positive values of the system's first parameter: its ``speed`` (such as rpm) or its
    #: ``frequency``.
    speed: NDArray[np.float64]

    def __post_init__(self) -> None:
        try:
            time, speed = (np.array(each, dtype=float) for each in (self.time, self.speed))
        except (TypeError, ValueError):
            raise ModelError("the times and speeds of a run-up must be lists of numbers") from None
        if time.ndim != 1 or time.shape != speed.shape or not 2 <= len(time) <= _MOST:
            raise ModelError(
                f"a run-up needs as many times as speeds, from 2 to {_MOST:,}; given are shapes {time.shape} and "
                f"{speed.shape}"
            )
        if not np.all(np.isfinite(time)) or not np.all(np.isfinite(speed)):
            raise ModelError("the times and speeds of a run-up must be finite numbers")
        if time[0] != 0.0 or not np.all(np.diff(time) > 0.0):
            raise ModelError(f"the times of a run-up must increase from 0; they begin with {time[:3].tolist()}")
        if not np.all(speed > 0.0):
            raise ModelError(
                f"the smallest speed of a run-up is {speed.min():g}; it must be > 0: the excitation is given over its "
                "angle, which stands still at 0. Begin at a low speed, as in from = 50"
            )
        for name, array in (("time", time), ("speed", speed)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def words(self) -> str:
        """The first speed, the extremes on the way, and the last speed, in words."""
        speeds = self.speed.tolist()
        first, last = speeds[0], speeds[-1]
        turns = sorted({max(speeds), min(speeds)} - {first, last}, key=speeds.index)
        way = [*(f"to {speed:g} and" for speed in turns), "back" if first == last else "", f"to {last:g}"]
        return " ".join(filter(None, (f"from {first:g}", *way)))

    @classmethod
    def ramp(cls, start: float, stop: float, rate: float, hold: float = 0.0) -> SpeedCourse:
        """Return a ramp from one speed to another at a positive rate, after which the last speed is held for a time.

        The end may be below the beginning (a run-down).
        """
        check("rate", rate, Positive)
        if start == stop:
            raise ModelError(f"a ramp from {start:g} to {stop:g} is empty; give two different speeds")
        check("hold", hold, NotNegative)
        time = abs(stop - start) / rate
        points = [(0.0, start), (time, stop), *([(time + hold, stop)] if hold else [])]
        return cls(*np.array(points).T)

    @classmethod
    def read(cls, file: str | os.PathLike[str] | io.StringIO | NamedFile, system: System) -> SpeedCourse:
        """Read a trace from a file with a column of times and one of speeds, such as ``time (s), speed (rpm)``.

        Times are counted from the first row. A file without units is for a system without units.
        """
        units, pace = system.units, system.structure.pace
        kinds = (None, None) if units is None else (QuantityKind.TIME, QuantityKind.FREQUENCY)
        columns = read_table(
            file, [WantedColumn("time", kinds[0], ("t",)), WantedColumn(pace, kinds[1], ("speed", "frequency", "n"))]
        )
        time = columns["time"].values()
        speed = columns[pace].values(None if units is None else units.of(QuantityKind.FREQUENCY))
        return cls(time - time[0], speed)

    @property
    def duration(self) -> float:
        """Length in time."""
        return float(self.time[-1])

    @property
    def rates(self) -> NDArray[np.float64]:
        """Change of the speed by time between the points, shape (points - 1,)."""
        return np.diff(self.speed) / np.diff(self.time)

    @property
    def is_one_way(self) -> bool:
        """True if the speed rises or falls and never turns; it may be held for some time."""
        signs = np.unique(np.sign(self.rates))
        return len(signs[signs != 0.0]) == 1

    @property
    def is_invertible(self) -> bool:
        """True if each speed occurs once, so that a picture may have the speed on its axis instead of the time."""
        return self.is_one_way and bool(np.all(self.rates != 0.0))

    @cached_property
    def turned(self) -> NDArray[np.float64]:
        """Integral of the speed over time up to each point, shape (points,)."""
        means = 0.5 * (self.speed[1:] + self.speed[:-1])
        return np.concatenate(([0.0], np.cumsum(means * np.diff(self.time))))

    def at(self, time: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the speed at given times from 0 to `duration`, and its integral from 0 to each of these times."""
        time = np.asarray(time, dtype=float)
        piece = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        since, rate = time - self.time[piece], self.rates[piece]
        return self.speed[piece] + rate * since, self.turned[piece] + since * (self.speed[piece] + 0.5 * rate * since)

    def passed(self, turned: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return time and speed at given integrals of the speed; after the last point, the speed stays constant."""
        place = np.clip(np.searchsorted(self.turned, turned, side="right") - 1, 0, len(self.time) - 2)
        beyond = np.maximum(turned - self.turned[-1], 0.0)
        since, first = turned - beyond - self.turned[place], self.speed[place]
        speed = np.sqrt(np.maximum(first**2 + 2.0 * self.rates[place] * since, 0.0))
        return self.time[place] + 2.0 * since / (first + speed) + beyond / speed, speed

    def __repr__(self) -> str:
        shape = "ramp" if len(self.time) == 2 else f"{len(self.time)} points"
        return f"SpeedCourse({shape}, {self.speed[0]:.6g} to {self.speed[-1]:.6g} in {self.duration:.6g})"


class Piece(NamedTuple):
    """A part of a forcing period with constant acceleration."""

    #: Angles at which the motion is sampled, the first of them its start, less whole turns.
    angles: NDArray[np.float64]
    turn: float  #: The whole turns, in radians.
    begun: float  #: Time at its start.
    #: speed, acceleration: The speed W at its start, and its derivative by time, in consistent units.
    speed: float
    acceleration: float

    def paces(self, angles: ArrayLike) -> NDArray[np.float64]:
        """Return the speeds W at some angles, less whole turns."""
        return np.sqrt(self.speed**2 + 2.0 * self.acceleration * (np.asarray(angles) - self.angles[0]))

    def times(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the times at some angles, less whole turns."""
        return self.begun + 2.0 * (angles - self.angles[0]) / (self.speed + self.paces(angles))


def angles_of(system: System, course: SpeedCourse, phase: float, samples: int) -> NDArray[np.float64]:
    """Return the angles of all samples: even ones, the knots of the course, and its end."""
    knots = phase + course.turned * system.structure.frequency
    count = int((knots[-1] - phase) / PERIOD * samples)
    if count > _MOST_SAMPLES:
        raise ModelError(
            f"the run-up lasts {(knots[-1] - phase) / PERIOD:.3g} forcing periods, over {_MOST_SAMPLES:,} samples; "
            "run up faster, or ask for fewer samples"
        )
    even = phase + PERIOD / samples * np.arange(count + 1)
    angles = np.unique(np.concatenate((even, knots)))
    close = np.diff(angles, prepend=-np.inf) < 1e-9  # rounding
    close |= angles > knots[-1]
    angles = angles[~close]
    angles[-1] = knots[-1]
    return np.asarray(angles, dtype=np.float64)


def pieces_of(system: System, course: SpeedCourse, thetas: NDArray[np.float64]) -> Iterator[Piece]:
    """Yield the pieces of a run-up, whose samples are at increasing angles with all knots of the course."""
    unit, first = system.structure.frequency, float(thetas[0])
    knots = first + course.turned * unit
    turns = np.arange(np.ceil(first / PERIOD + 1e-9) * PERIOD, knots[-1], PERIOD)
    ends = np.unique(np.concatenate((knots[1:], turns)))
    start, time, begun = first, 0.0, 0
    for end in ends:
        if end - start < 1e-9:
            continue
        last = min(int(np.searchsorted(thetas, end - 1e-9)), len(thetas) - 1)
        own = thetas[begun : last + 1]
        if abs(own[-1] - end) > 1e-8:  # a whole turn between samples is no end of a piece
            continue
        place = int(np.clip(np.searchsorted(knots, own[0] + 1e-9, side="right") - 1, 0, len(knots) - 2))
        since, rate = own[0] - knots[place], float(course.rates[place]) * unit
        speed = float(np.sqrt((course.speed[place] * unit) ** 2 + 2.0 * rate * since))
        turn = PERIOD * np.floor(own[0] / PERIOD + 1e-9)
        piece = Piece(own - turn, turn, time, speed, rate)
        yield piece
        time = float(piece.times(piece.angles[-1:])[0])
        start, begun = float(own[-1]), last
