"""The measured record: one acceleration over time, optionally with the measured speed of a shaft."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError

MAX_SAMPLES = 200_000
"""Longest record. A few tens of periods contain all information about a steady motion."""

_LEAST = 16
_UNEVEN = 0.1  # largest relative difference between a time step and the median step
_CLOSE = 0.01  # largest relative difference between the measured speed and the frequency of a motion


@dataclass(frozen=True, eq=False)
class Record:
    """A measured time history.

    Raises
    ------
    ModelError
        With all problems that were found: samples that are not finite numbers, time that does not increase in even
        steps, or too few or too many samples.

    Examples
    --------
    >>> record.time.shape, record.scaled(acceleration=9.81).acceleration.shape
    ((64,), (64,))
    """

    time: NDArray[np.float64]  #: shape (samples,): Times in increasing, even steps, in units of the model's time.
    #: shape (samples,): The measured signal, in units of the model. It may be any signal of the model, not only an
    #: acceleration.
    acceleration: NDArray[np.float64]
    #: shape (samples,), or None: Angular speed of the shaft, in radians per unit of time.
    speed: NDArray[np.float64] | None = None
    name: str = "measured"  #: Name of the record in messages and pictures.

    def __post_init__(self) -> None:
        for field in ("time", "acceleration", "speed"):
            value = getattr(self, field)
            if value is not None:
                object.__setattr__(self, field, _column(field, value))
        problems = list(_problems(self))
        if problems:
            raise ModelError("\n".join(f"{self.name}: {problem}" for problem in problems))

    def __len__(self) -> int:
        return len(self.time)

    def scaled(self, time: float = 1.0, acceleration: float = 1.0, speed: float = 1.0) -> Record:
        """Convert the record to other units: multiply each column by its factor."""
        for what, factor in (("time", time), ("acceleration", acceleration), ("speed", speed)):
            if not (np.isfinite(factor) and factor != 0.0) or (what == "time" and factor < 0.0):
                raise ModelError(f"the factor of {what} is {factor!r}; it must be a number other than zero")
        speeds = None if self.speed is None else speed * self.speed
        return Record(time * self.time, acceleration * self.acceleration, speeds, self.name)

    def between(self, begin: float, end: float) -> Record:
        """Return the part from one time to another.

        Parameters
        ----------
        begin, end
            Times, in the unit of the record.
        """
        keep = (self.time >= begin) & (self.time <= end)
        speed = None if self.speed is None else self.speed[keep]
        return Record(self.time[keep], self.acceleration[keep], speed, self.name)

    def frequency(self, order: float = 1.0) -> float | None:
        """Return the mean frequency of `order` excitation periods per shaft turn; None without a measured speed.

        Parameters
        ----------
        order
            Periods of the excitation in a turn of the shaft.
        """
        if self.speed is None:
            return None
        return order * float(np.trapezoid(self.speed, self.time) / (self.time[-1] - self.time[0]))

    def angles(self, frequency: float, order: float = 1.0) -> NDArray[np.float64]:
        """Return the angles of the excitation relative to the first sample, in radians, shape (samples,).

        With a measured speed they are its integral (order tracking), otherwise ``frequency * time``.

        Parameters
        ----------
        frequency
            Angular frequency of the excitation.
        order
            Periods of the excitation in a turn of the shaft.

        Returns
        -------
        array, shape (samples,)
            The first one is 0.
        """
        time, measured = self.time - self.time[0], self.frequency(order)
        if self.speed is None or measured is None:
            return frequency * time
        if abs(measured / frequency - 1.0) > _CLOSE:
            raise ModelError(
                f"{self.name}: its speed corresponds to an excitation frequency of {measured:.6g}, but the motion has "
                f"{frequency:.6g}; find the motion at that frequency, or correct the order or the units of the speed"
            )
        steps = 0.5 * (self.speed[1:] + self.speed[:-1]) * np.diff(time)
        return order * np.concatenate(([0.0], np.cumsum(steps)))


def _column(field: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        column = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{field} must be a list of numbers") from None
    if column.ndim != 1:
        raise ModelError(f"{field} has the shape {column.shape}; it must be one row of numbers")
    column.flags.writeable = False
    return column


def _problems(record: Record) -> Iterator[str]:
    count = len(record.time)
    if not _LEAST <= count <= MAX_SAMPLES:
        hint = "; cut a few tens of periods out of it" if count > MAX_SAMPLES else ""
        yield f"it has {count} samples; a record has {_LEAST} to {MAX_SAMPLES:,}{hint}"
        return
    columns = {"acceleration": record.acceleration, "speed": record.speed}
    for field, column in columns.items():
        if column is not None and len(column) != count:
            yield f"{field} has {len(column)} samples, but time has {count}"
    for field, column in {"time": record.time, **columns}.items():
        wrong = [] if column is None else np.flatnonzero(~np.isfinite(column))
        if len(wrong):
            more = f" ({len(wrong)} in all)" if len(wrong) > 1 else ""
            yield f"{field} is not a finite number in sample {wrong[0] + 1}{more}; cut the record there, or correct it"
    if record.speed is not None and np.any(record.speed <= 0.0):
        yield "the speed is not positive everywhere; give its magnitude"
    if np.all(np.isfinite(record.time)):
        yield from _time_problems(record.time)


def _time_problems(time: NDArray[np.float64]) -> Iterator[str]:
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0.0)
    if len(back):
        at = back[0]
        yield f"time does not increase from sample {at + 1} ({time[at]:g}) to sample {at + 2} ({time[at + 1]:g})"
        return
    usual = float(np.median(steps))
    wrong = np.flatnonzero(np.abs(steps - usual) > _UNEVEN * usual)
    if len(wrong):
        at = wrong[0]
        yield (
            f"time is uneven: its steps are {usual:g}, but {steps[at]:g} from sample {at + 1} to sample {at + 2} "
            f"({len(wrong)} such steps). If samples are missing, cut the record there; if time was written with "
            "too few digits, write it with more"
        )
