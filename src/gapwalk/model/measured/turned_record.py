"""A record of a shaft that turns, as one period over its angle: its motion, or another signal along it.

The angle comes from a speed over time or over the angle, or from the pulses of an encoder. It is divided into a smooth
motion, which has the drift of the speed, and the deviation from it, which is zero where a period ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.measured.crank_orders import ERROR, OrderTable, displacement_orders, orders_of, turns_in
from gapwalk.model.measured.measured_table import finite_row

Array = NDArray[np.float64]

_TURN = 2.0 * math.pi
_LEAST = 8  # samples of a record
_GAP = 4.0  # of the median step: samples are missing
_MISSING = 1.5  # of the median distance of pulses
_NEAR = 0.02  # of the speed: periods that are taken as at this speed
_STEADY = 0.05  # of the speed: a record that changes more has no one speed
_FINEST = 65_536  # samples of a period
_SHORT = 1.5  # steps by which a record may end before its last period does


@dataclass(frozen=True, eq=False)
class TurnedRecord:
    """The angle of a shaft at the samples of a record."""

    time: Array  #: shape (samples,): Increasing times.
    angle: Array  #: shape (samples,): Angles in rad.
    turns: int  #: Turns in a period.
    unit: str  #: Unit of speeds in messages: ``"rpm"``, or empty for radians per unit of time.
    #: True if the angles are those of the shaft; otherwise the smooth angle is 0 at the first sample.
    is_absolute: bool = False

    @classmethod
    def of_speed(cls, axis: Array, speed: Array, turns: int, where: Where, unit: str, *, over_angle: bool) -> Self:
        """Integrate the speed, in rad per unit of time, over the time; or the time over the angle, along a spline."""
        _check_axis("the angle" if over_angle else "time", axis, where)
        _check_speed(speed, where, unit)
        found = _spline(axis, 1.0 / speed if over_angle else speed).antiderivative()(axis)
        return cls(*((found, axis) if over_angle else (axis, found)), turns, unit, is_absolute=over_angle)

    @classmethod
    def of_pulses(cls, times: Array, per_turn: int, turns: int, where: Where, unit: str = "") -> TurnedRecord:
        """Count pulses that are evenly spaced on the shaft."""
        _check_axis("the time of pulses", times, where)
        gaps = np.diff(times)
        usual = np.minimum(np.concatenate((gaps[1:], gaps[-1:])), np.concatenate((gaps[:1], gaps[:-1])))
        if len(wrong := np.flatnonzero(gaps > _MISSING * usual)):
            raise ModelError(
                f"a pulse is missing after {where(int(wrong[0]))}: {gaps[wrong[0]]:.4g} between two pulses, but "
                f"{usual[wrong[0]]:.4g} beside them ({len(wrong)} such gaps); cut the record there"
            )
        return cls(times, _TURN / per_turn * np.arange(len(times), dtype=np.float64), turns, unit)

    @property
    def period(self) -> float:
        """The angle of a period."""
        return _TURN * self.turns

    def mean_over_periods(self, at: float | None, signal: Array | None = None) -> tuple[Array, Array, float, Drift]:
        """Return even angles of one period, the mean of a signal there, the mean speed, and the drift taken off.

        Without a signal it is the deviation of the shaft from its smooth motion. The periods are all, or those in which
        the mean speed is `at`, within 2 %.
        """
        ends = self._ends()
        at_ends = _spline(self.angle, self.time)(ends)
        speeds = self.period / np.diff(at_ends)
        chosen = self._chosen(speeds, at)
        smooth = self._smooth(at_ends, ends)
        steady = smooth(self.time)
        if np.any(np.diff(steady) <= 0.0):
            raise ModelError(
                "the mean speed changes so fast from period to period that the record has no orders; cut it"
            )
        values = _spline(steady, self.angle - steady if signal is None else signal)
        within = int(max(np.count_nonzero((steady >= ends[k]) & (steady < ends[k + 1])) for k in chosen))
        count = min(max(2 ** math.ceil(math.log2(within)), 16), _FINEST)
        even = self.period / count * np.arange(count)
        mean = np.mean([values(ends[k] + even) for k in chosen], axis=0)
        first, last = chosen[0], chosen[-1]
        straight = np.interp(self.time, at_ends[[first, last + 1]], ends[[first, last + 1]])
        inside = (self.time >= at_ends[first]) & (self.time <= at_ends[last + 1])
        bend = float(np.max(np.abs((steady - straight)[inside])))
        return (
            even,
            mean,
            float(np.mean(speeds[chosen])),
            Drift(len(chosen), float(speeds[first]), float(speeds[last]), bend, self.unit),
        )

    def _ends(self) -> Array:
        """Return the angles at which periods begin and end."""
        step = float(np.median(np.diff(self.angle)))
        first = math.ceil((self.angle[0] - 1e-9) / self.period)
        last = math.floor((self.angle[-1] + _SHORT * step) / self.period)
        if last <= first:
            held = (self.angle[-1] - self.angle[0]) / _TURN
            raise ModelError(
                f"it has {held:.3g} turns, but {self.turns} whole {'turns are' if self.turns > 1 else 'turn is'} needed"
                "; give a longer record"
            )
        return self.period * np.arange(first, last + 1)

    def _chosen(self, speeds: Array, at: float | None) -> NDArray[np.intp]:
        if at is not None:
            found = np.flatnonzero(np.abs(speeds / at - 1.0) <= _NEAR)
            if not len(found):
                raise ModelError(
                    f"no period has the speed {_said(at, self.unit)} within {100 * _NEAR:g} %; its periods have "
                    f"{_said(speeds.min(), self.unit)} to {_said(speeds.max(), self.unit)}: write a speed among them"
                )
            return found
        if np.ptp(speeds) > _STEADY * np.mean(speeds):
            ends = f"{_said(speeds.min(), self.unit)} to {_said(speeds.max(), self.unit)}"
            mark = '"' * bool(self.unit)
            raise ModelError(
                f"its speed goes from {ends}, so its orders differ from speed to speed; say at which speed they are "
                f"wanted, as in speed = {mark}{_said(float(np.median(speeds)), self.unit, 4)}{mark}"
            )
        return np.arange(len(speeds))

    def _smooth(self, times: Array, ends: Array) -> Callable[[Array], Array]:
        """Return the smooth motion through the ends of periods; within a single one, with its acceleration."""
        if len(ends) > 2:
            return _spline(times, ends)
        speed = _spline(self.time, self.angle).derivative()(times)
        rate, bend = (ends[1] - ends[0]) / (times[1] - times[0]), 0.5 * (speed[1] - speed[0]) / (times[1] - times[0])
        return lambda t: ends[0] + rate * (t - times[0]) + bend * (t - times[0]) * (t - times[1])


@dataclass(frozen=True, slots=True)
class Drift:
    """The change of the mean speed of a record, which was taken off."""

    periods: int  #: Number of periods whose mean was taken.
    #: begin, end: Mean speeds of the first and the last of them, in rad per unit of time.
    begin: float
    end: float
    angle: float  #: By how much the smooth motion differs from an even one, in rad.
    unit: str = ""  #: Unit of speeds in `words`, as ``"rpm"``.

    @property
    def words(self) -> str:
        """Say it in a few words."""
        share, size = 100.0 * (self.end / self.begin - 1.0), math.degrees(self.angle)
        speeds = f"{_said(self.begin, self.unit)} to {_said(self.end, self.unit)}"
        mean = f"mean of {self.periods} periods" if self.periods > 1 else "one period"
        return f"{mean}, the drift from {speeds} ({share:+.2g} %, {size:.3g} deg) subtracted"


def _spline(x: Array, y: Array) -> Any:
    from scipy.interpolate import CubicSpline  # only where records are used

    return CubicSpline(x, y)


Where = Callable[[int], str]
"""Function that says in messages where a sample is."""


def _said(speed: float, unit: str, digits: int = 6) -> str:
    return f"{speed * 60.0 / _TURN:.{digits}g} rpm" if unit else f"{speed:.{digits}g}"


def _check_axis(what: str, axis: Array, where: Where) -> None:
    """Refuse times or angles that do not increase, or between which samples are missing."""
    if len(axis) < _LEAST:
        raise ModelError(f"it has {len(axis)} samples; a record of a turning shaft has {_LEAST} at least")
    steps = np.diff(axis)
    if len(back := np.flatnonzero(steps <= 0.0)):
        at = int(back[0])
        hint = "" if "time" in what else "; if it begins again after a turn, add a turn"
        raise ModelError(
            f"{what} does not increase from {where(at)} ({axis[at]:.6g}) to {where(at + 1)} ({axis[at + 1]:.6g}, "
            f"{len(back)} such steps){hint}: sort the samples, or cut the record there"
        )
    if "pulses" not in what and len(wide := np.flatnonzero(steps > _GAP * np.median(steps))):
        at = int(wide[0])
        raise ModelError(
            f"samples are missing: {what} goes on by {steps[at]:.4g} from {where(at)} to {where(at + 1)}, but by "
            f"{np.median(steps):.4g} elsewhere ({len(wide)} such gaps); give the part before or after it"
        )


def _check_speed(speed: Array, where: Where, unit: str) -> None:
    if np.all(speed < 0.0):
        raise ModelError("its speed is negative throughout; give its magnitude, and with phases the other sign")
    if len(wrong := np.flatnonzero(speed <= 0.0)):
        raise ModelError(
            f"its speed is {_said(float(speed[wrong[0]]), unit)} in {where(int(wrong[0]))} ({len(wrong)} in all); "
            "the angle must grow: cut the record to the part in which the shaft turns"
        )


def pulse_times(time: Array, level: Array, where: Where) -> Array:
    """Return the times at which a square wave rises through its middle, interpolated between samples."""
    _check_axis("time", time, where)
    low, high = float(level.min()), float(level.max())
    if not high > low:
        raise ModelError(
            f"the channel of pulses is {low:g} throughout; name the one with the square wave of the encoder"
        )
    middle, band = 0.5 * (low + high), 0.2 * (high - low)
    above = np.where(level > middle + band, 1, np.where(level < middle - band, -1, 0))  # noise at the edge counts once
    known = np.flatnonzero(above)
    rises = np.flatnonzero((above[known[:-1]] < 0) & (above[known[1:]] > 0))
    found = np.empty(len(rises))
    for number, rise in enumerate(rises):
        begin, end = known[rise], known[rise + 1] + 1
        found[number] = np.interp(middle, np.maximum.accumulate(level[begin:end]), time[begin:end])
    return found


def turning_orders(
    time: ArrayLike | None = None,
    speed: ArrayLike | None = None,
    signal: ArrayLike | None = None,
    *,
    angle: ArrayLike | None = None,
    pulses: int = 0,
    at: float | None = None,
    accelerates: bool = False,
    orders: list[float] | None = None,
    per: Literal["turn", "cycle"] = "turn",
    error: float = ERROR,
    where: Where = lambda row: f"sample {row + 1}",
    unit: str = "",
) -> tuple[OrderTable, Drift]:
    """Find the orders of the motion of a shaft, or of a signal that was measured while it turned.

    Parameters
    ----------
    time : shape (samples,)
        Times of the samples; of the pulses, if `pulses` is given without a signal.
    speed : shape (samples,)
        Speed of the shaft in rad per unit of time.
    signal : shape (samples,)
        A signal whose orders are wanted; by default the motion of the shaft itself. With `pulses`, the square wave of
        the encoder.
    angle : shape (samples,)
        Angles of the shaft in rad, in place of `time`.
    pulses
        Pulses in a turn of the shaft.
    at
        For a record whose speed changes, the speed at which orders are wanted: periods within 2 % of it are taken.
    accelerates
        True if the signal is an acceleration whose displacement is wanted.
    orders, per, error
        As in `gapwalk.loads.orders_of`.
    where
        Function that says in messages where a sample is.
    unit
        ``"rpm"`` if speeds in messages are to be in it.

    Returns
    -------
    orders : OrderTable
        The orders over the smooth angle: of the motion in rad, without a mean.
    drift : Drift
        The change of the mean speed that was subtracted.

    Raises
    ------
    ModelError
        If samples are missing, times do not increase, the speed is not positive, there is no whole period, or the speed
        changes by more than 5 % and `at` is not given.

    Notes
    -----
    The speed is integrated along its cubic spline. A cubic spline through the times at which periods end is the smooth
    motion. The deviation from it is zero at these times; its mean over the periods is the curve whose orders are found.
    A linear change of the speed is subtracted exactly. The smooth angle is 0 at the first sample, or that of `angle`
    less the mean deviation.

    Examples
    --------
    >>> t = np.linspace(0.0, 2.0, 4001)
    >>> speed = 100.0 + 5.0 * np.cos(2.0 * (100.0 * t))
    >>> table, drift = gw.loads.turning_orders(t, speed)
    >>> table.orders[0], round(abs(complex(table.lines[0].cosine, table.lines[0].sine)), 3)  # 5 / (2 * 100)
    (2.0, 0.025)
    """
    turns = turns_in(per)
    rows = {
        name: finite_row(row, name)
        for name, row in zip(("time", "speed", "signal", "angle"), (time, speed, signal, angle), strict=True)
        if row is not None
    }
    if len({*map(len, rows.values())}) > 1:
        told = ", but ".join(f"{name} has {len(row)} samples" for name, row in rows.items())
        raise ModelError(f"{told}; a record has equally many")
    x = rows.get("signal")
    if pulses:
        if pulses < 1 or "time" not in rows:
            raise ModelError(f"pulses is {pulses!r}; pulses need their times, and a number of them in a turn")
        times = rows["time"] if x is None else pulse_times(rows["time"], x, where)
        own = where if x is None else lambda row: f"pulse {row + 1}"
        record, x = TurnedRecord.of_pulses(times, pulses, turns, own, unit), None
    elif "speed" not in rows or ("time" in rows) == ("angle" in rows):
        raise ModelError("a record of a turning shaft needs its speed over time or angle, or the times of pulses")
    else:
        axis, over_angle = rows["angle" if "angle" in rows else "time"], "angle" in rows
        record = TurnedRecord.of_speed(axis, rows["speed"], turns, where, unit, over_angle=over_angle)
    even, mean, mean_speed, drift = record.mean_over_periods(at, x)
    how = {"orders": orders, "per": per, "error": error}
    if x is None:
        even = even + np.mean(mean) * record.is_absolute  # the smooth angle is then without the mean deviation
        mean -= np.mean(mean)
    if accelerates:
        return displacement_orders(even, acceleration=mean - np.mean(mean), speed=mean_speed, **how), drift
    return orders_of(even, mean, **how), drift
