"""The measured record: one acceleration over time, optionally with the measured speed of a shaft."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.spectrum import Tracked
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.channels.channel_file import MAX_SAMPLES as MAX_CHANNEL
from gapwalk.model.channels.channel_file import ChannelFile, NamedFile, open_channels
from gapwalk.model.measured.measured_table import (
    WantedColumn,
    as_written,
    named_errors,
    number_row,
    read_heads,
    read_table,
)
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, Unit, read_unit

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
                object.__setattr__(self, field, number_row(value, field))
                getattr(self, field).flags.writeable = False
        problems = list(_problems(self))
        if problems:
            raise ModelError("\n".join(f"{self.name}: {problem}" for problem in problems))

    def __len__(self) -> int:
        return len(self.time)

    def scaled(self, time: float = 1.0, acceleration: float = 1.0, speed: float = 1.0) -> Record:
        """Convert the record to other units: multiply each column by its factor."""
        for what, factor in (("time", time), ("acceleration", acceleration), ("speed", speed)):
            if not (np.isfinite(factor) and factor != 0.0) or (what == "time" and factor < 0.0):
                raise ModelError(
                    f"{self.name}: the factor of {what} is {factor!r}; it must be a number other than zero"
                )
        speeds = None if self.speed is None else speed * self.speed
        return Record(time * self.time, acceleration * self.acceleration, speeds, self.name)

    def between(self, begin: float, end: float) -> Record:
        """Return the part from one time to another, in the unit of the record."""
        keep = (self.time >= begin) & (self.time <= end)
        speed = None if self.speed is None else self.speed[keep]
        return Record(self.time[keep], self.acceleration[keep], speed, self.name)

    def frequency(self, order: float = 1.0) -> float | None:
        """Return the mean frequency of `order` excitation periods per shaft turn; None without a measured speed."""
        if self.speed is None:
            return None
        return order * float(np.trapezoid(self.speed, self.time) / (self.time[-1] - self.time[0]))

    def angles(self, frequency: float, order: float = 1.0) -> NDArray[np.float64]:
        """Return the angles of the excitation relative to the first sample, in radians, shape (samples,).

        With a measured speed they are its integral (order tracking), otherwise ``frequency * time``.
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


FIELDS = ("time", "acceleration", "speed")


def read_measurement(
    path: str | os.PathLike[str],
    columns: Mapping[str, str] | None = None,
    *,
    time_scale: float = 1.0,
    scale: float = 1.0,
    speed_scale: float = 1.0,
) -> Record:
    """Read a measured time history.

    Parameters
    ----------
    path
        A CSV file (a line of column names, then numbers, separated by commas, semicolons or tabs; lines that begin with
        ``#`` are comments; where commas do not separate columns, they may be decimal commas), or a MAT, HDF5, Excel,
        MDF, TDMS or UFF file with a channel for each column.
    columns
        Names of the columns in the file, as in ``{"time": "t [s]", "acceleration": "a3"}``; by default ``time``,
        ``acceleration`` and, if there is one, ``speed``.
    time_scale, scale, speed_scale
        Factors that convert time, acceleration and speed to the units of the model. A speed is then in radians per unit
        of the model's time.

    Returns
    -------
    Record
        The record.

    Raises
    ------
    ModelError
        If the file cannot be read, has no such columns, or its numbers are not a valid record; see `Record`.

    Examples
    --------
    >>> columns = np.array([record.time, record.acceleration]).T
    >>> np.savetxt("shaker.csv", columns, delimiter=",", header="t,a", comments="")
    >>> gw.measure.read_measurement("shaker.csv", {"time": "t", "acceleration": "a"}).time.size
    64
    """
    path = Path(path)
    wanted = _wanted(columns or {})
    with named_errors(path.name), open_channels(path, "time,acceleration") as file:
        places = {field: _place(file, field, name) for field, name in wanted.items()}
        if "speed" not in places and (speed := as_written(file, "speed")):
            places["speed"] = speed[0]
        table = file.numbers(places, MAX_SAMPLES)
    return Record(name=path.name, **table).scaled(time_scale, scale, speed_scale)


def _wanted(columns: Mapping[str, str]) -> dict[str, str]:
    """Return the name of each column in the file; the speed only if it is named."""
    for field in columns:
        if field not in FIELDS:
            raise ModelError(f"a record has no column {field!r}; {did_you_mean(field, FIELDS)}")
    return {field: field for field in FIELDS[:2]} | dict(columns)


def _place(file: ChannelFile, field: str, name: str) -> int:
    """Return the channel for a field; of several times, the record is said to have groups."""
    found = as_written(file, name)
    if len(found) == 1:
        return found[0]
    known = list(dict.fromkeys(head.text for head in file.heads if head.text))[:20]
    write = f'Name it: columns = {{ {field} = "..." }}'
    if found:
        groups = [f"{file.heads[place].group}/{file.heads[place].name}" for place in found[:20]]
        raise ModelError(f"{len(found)} channels may be {field}: {' and '.join(map(repr, groups))}. {write}")
    raise ModelError(f"there is no column {name!r} for {field}; {did_you_mean(name, known, 'columns are')}. {write}")


# Measured run-ups: a signal and the speed over time, from a file, resampled over the angle of the excitation.

_LEAST_PER_PERIOD, _MOST = 8, 4096  # samples per forcing period over the angle
_PERIODS = 4  # forcing periods of the shortest record


def read_run_up(
    file: str | os.PathLike[str] | io.StringIO | NamedFile, system: System, signal: str, column: str = ""
) -> Tracked:
    r"""Read a measured run-up, to compare it with a computed one.

    Parameters
    ----------
    file
        A file of any format with channels of time, speed and the signal, such as ``time (s), speed (rpm), mesh.force (N
        m)``; or the text of a CSV file as ``io.StringIO``. For a system without units, the columns have none either.
        The speed is the system's first parameter.
    system
        The system.
    signal
        Its signal that was measured, as in `Motion.signal`.
    column
        Name of the column of the signal; by default the column named as the signal, or the only column with its unit.

    Returns
    -------
    Tracked
        The record over the angle, which is the integral of the speed, with as many samples per forcing period as the
        record has where the speed is highest.

    Raises
    ------
    ModelError
        If there are no such columns, times do not increase, a speed is not positive, or the record is too short.

    Examples
    --------
    >>> import io
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=1.0
    ... )
    >>> rows = "".join(f"{t / 10},1.0,{(t % 63) / 63}\n" for t in range(700))
    >>> gw.measure.read_run_up(io.StringIO("time,frequency,x\n" + rows), mass, "x")
    Tracked(x, 1 to 1, 11.11 forcing periods)
    """
    units, pace = system.units, system.structure.pace
    kind = None if units is None else kind_of_signal(signal)
    kinds = (None, None) if units is None else (QuantityKind.TIME, QuantityKind.FREQUENCY)
    table = read_table(
        file,
        [
            WantedColumn("time", kinds[0], ("t",)),
            WantedColumn(pace, kinds[1], ("speed", "frequency", "n")),
            WantedColumn(signal, kind, (signal.rstrip("'"),), name=column, key="column"),
        ],
        most=MAX_CHANNEL,
    )
    time = table["time"].values()
    speed = table[pace].values(None if units is None else units.of(QuantityKind.FREQUENCY))
    values = table[signal].values(_unit_of(system, signal))
    steps = np.diff(time)
    if len(time) < 2 or np.any(steps <= 0.0):
        wrong = int(np.argmax(steps <= 0.0)) if len(time) > 1 else 0
        raise ModelError(f"{table.name}: time does not increase in {table.where(min(wrong + 1, len(time) - 1))}")
    if np.any(speed <= 0.0):
        raise ModelError(
            f"{table.name}: {pace} is {speed.min():g} in {table.where(int(np.argmin(speed)))}; it must be positive: "
            "cut the record to where the shaft turns, or give the magnitude of the speed"
        )
    pulse = speed * system.structure.frequency
    theta = np.concatenate(([0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1]) * steps)))
    count = theta[-1] / PERIOD
    if count < _PERIODS:
        raise ModelError(f"{table.name}: it has {count:.3g} forcing periods; a run-up has {_PERIODS} at least")
    samples = 2 ** math.floor(math.log2(PERIOD / float(np.diff(theta).max()) * 2.0))
    if samples < _LEAST_PER_PERIOD:
        raise ModelError(
            f"{table.name}: it has {samples} samples in a forcing period; an order needs {_LEAST_PER_PERIOD} at least"
        )
    return _tracked(system, signal, min(samples, _MOST), theta, time - time[0], speed, values)


def _tracked(
    system: System,
    signal: str,
    samples: int,
    theta: NDArray[np.float64],
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    values: NDArray[np.float64],
) -> Tracked:
    """Return a record at even angles; its speed without the vibration within a period."""
    from scipy.interpolate import CubicSpline  # imported late: it takes long

    count = int(theta[-1] / PERIOD * samples + 1e-9) + 1
    even = np.asarray(PERIOD / samples * np.arange(count), dtype=np.float64)
    smooth = np.interp(even, theta, speed)
    summed = np.concatenate(([0.0], np.cumsum(smooth)))
    places = np.arange(len(smooth))
    reach = np.minimum(samples // 2, np.minimum(places, len(smooth) - 1 - places))  # as far to either side
    smooth = (summed[places + reach + 1] - summed[places - reach]) / (2 * reach + 1)
    return Tracked(
        system, signal, samples, even, np.interp(even, theta, time), smooth, CubicSpline(theta, values)(even)
    )


def is_run_up(source: str | os.PathLike[str] | NamedFile, system: System) -> bool:
    """Return True if a file has columns of time and of the speed, so that it may be a measured run-up."""
    try:
        heads = read_heads(source)
    except ModelError:
        return False
    if system.units is None:
        names = {head.name.casefold() for head in heads}
        return bool({"time", "t"} & names) and bool({"speed", "frequency", "n", system.structure.pace} & names)
    return all(any(head.is_of(kind) for head in heads) for kind in (QuantityKind.TIME, QuantityKind.FREQUENCY))


def kind_of_signal(signal: str) -> QuantityKind:
    """Return the kind of quantity of a signal of a drive train."""
    if signal.endswith("''"):
        return QuantityKind.ACCELERATION
    if signal.endswith("'"):
        return QuantityKind.RATE
    return QuantityKind.TORQUE if signal.endswith((".force", ".torque")) else QuantityKind.ANGLE


def _unit_of(system: System, signal: str) -> Unit | None:
    """Return the unit in which a signal is counted; None without units."""
    if system.units is None:
        return None
    return read_unit(system.units.signal(signal)[1], kind_of_signal(signal))
