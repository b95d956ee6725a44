"""Measured run-ups: a signal and the speed over time, from a CSV file, resampled over the angle of the excitation."""

from __future__ import annotations

import io
import math
import os

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.order_tracking import Tracked
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.measured.measured_table import NamedFile, WantedColumn, read_heads, read_table
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind, Unit, read_unit

_LEAST, _MOST = 8, 4096  # samples per forcing period over the angle
_PERIODS = 4  # forcing periods of the shortest record


def read_run_up(
    file: str | os.PathLike[str] | io.StringIO | NamedFile, system: System, signal: str, column: str = ""
) -> Tracked:
    r"""Read a measured run-up, to compare it with a computed one.

    Parameters
    ----------
    file
        A CSV file with columns of time, speed and the signal, such as ``time (s), speed (rpm), mesh.force (N m)``; or
        its text as ``io.StringIO``. Without units for a system without them. The speed is that of the system's first
        parameter.
    system
        The system.
    signal
        Its signal that was measured, as in `Motion.signal`.
    column
        Name of the column of the signal; by default that named as the signal, or the only one with its unit.

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
    )
    time = table["time"].values()
    speed = table[pace].values(None if units is None else units.of(QuantityKind.FREQUENCY))
    values = table[signal].values(_unit_of(system, signal))
    steps = np.diff(time)
    if len(time) < 2 or np.any(steps <= 0.0):
        wrong = int(np.argmax(steps <= 0.0)) if len(time) > 1 else 0
        raise ModelError(f"{table.name}: time does not increase in line {table.lines[min(wrong + 1, len(time) - 1)]}")
    if np.any(speed <= 0.0):
        raise ModelError(
            f"{table.name}: {pace} is {speed.min():g} in line {table.lines[int(np.argmin(speed))]}; it must be positive"
        )
    pulse = speed * system.structure.frequency
    theta = np.concatenate(([0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1]) * steps)))
    count = theta[-1] / PERIOD
    if count < _PERIODS:
        raise ModelError(f"{table.name}: it has {count:.3g} forcing periods; a run-up has {_PERIODS} at least")
    samples = 2 ** math.floor(math.log2(PERIOD / float(np.diff(theta).max()) * 2.0))
    if samples < _LEAST:
        raise ModelError(
            f"{table.name}: it has {samples} samples in a forcing period; an order needs {_LEAST} at least"
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


def value_columns(source: NamedFile, system: System, signal: str) -> list[str]:
    """Return the names of the columns of a file that may be a signal: those of its unit; without units all others."""
    heads = [head for head in read_heads(source) if head.name]
    if system.units is None:
        others = ("time", "t", "speed", "frequency", "n", system.structure.pace)
        return [head.text for head in heads if not head.unit and head.name.casefold() not in others]
    kind = kind_of_signal(signal)
    return [head.text for head in heads if head.is_of(kind)]


def is_run_up(source: NamedFile, system: System) -> bool:
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
