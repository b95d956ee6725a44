"""Spectra of signals: amplitudes in the units of the signal over multiples of W, and the names of spectral lines.

A line is named W, 2W, W/3, 5W/3 and so on, or after those it lies between. A waterfall shows spectra of a signal along
a branch or for a list of orbits.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from math import lcm
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.attractors.settle import Settled
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError, StoreError
from gapwalk.files import why_no_file
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion, integrate, sample
from gapwalk.model.bounds import Positive, check, check_fields
from gapwalk.model.problems import given
from gapwalk.model.system import System, pace_text
from gapwalk.model.units import Units
from gapwalk.notebook import Pictured
from gapwalk.orbit.orbit import Orbit
from gapwalk.pieces import tell_stage
from gapwalk.summary import Described, Rows, TableRows, Tables

_FIRST, _FINEST = 128, 16_384  # samples per forcing period at the start and at the end of the refinement
_SUBHARMONICS = (1, 2, 3, 4, 5, 6)  # multiples of W over these numbers get names if a motion has no period
BAND = (500.0, 5000.0)
"""Frequencies, in Hz, between which the level is that of rattle."""
_HANN = 1.5  # lines of a Hann window over which noise is counted

_CLEAN = 4  # lines above a quarter of the sampling rate are omitted: aliasing affects them most


@dataclass(frozen=True, eq=False)
class Spectrum(Described):
    """The spectrum of one signal."""

    system: System  #: The system that moves.
    signal: str  #: Name of the signal.
    #: shape (lines,): Orders from 0 upwards: multiples of W, or orders per turn of a shaft if its speed is a parameter
    #: (theta below is then the angle of that shaft).
    orders: NDArray[np.float64]
    #: shape (lines,): Complex amplitudes c in the units of the signal, which is the sum of ``Re(c exp(i order
    #: theta))``. For a motion without period a line of amplitude A appears as a peak of height A, slightly wider than
    #: `resolution`.
    values: NDArray[np.complex128]
    period: int  #: Period m of a periodic motion, whose lines are exact; 0 for a windowed motion.
    resolution: float  #: Width of a line, as an order: 0 for a periodic motion.
    folding: float  #: Bound on the contribution of aliasing to any line, in the units of the signal.

    @property
    def amplitudes(self) -> NDArray[np.float64]:
        """Amplitude of each line, shape (lines,)."""
        return np.abs(self.values)

    def tables(self) -> Tables:
        """Return the table of lines: their orders, amplitudes and complex amplitudes."""
        return {"lines": TableRows(self._rows, 1)}

    def _rows(self) -> Rows:
        yield ["order", f"amplitude.{self.signal}", f"re.{self.signal}", f"im.{self.signal}"]
        columns = self.orders, self.amplitudes, self.values.real, self.values.imag
        yield from map(list, np.column_stack(columns).tolist())

    def amplitude(self, order: float) -> float:
        """Return the amplitude of the line nearest to an order within the resolution; 0 if there is none."""
        nearest = int(np.argmin(np.abs(self.orders - order)))
        reach = max(self.resolution, 1e-9)
        return float(self.amplitudes[nearest]) if abs(self.orders[nearest] - order) <= reach else 0.0

    def peaks(self, count: int = 10, least: float = 1e-3) -> tuple[Peak, ...]:
        """Return the highest peaks without the mean, in descending order."""
        from scipy.signal import find_peaks  # imported late: it takes long

        heights = self.amplitudes.copy()
        heights[0] = 0.0
        if self.period:
            places = np.flatnonzero(heights > max(least * heights.max(), self.folding))
        else:
            places = find_peaks(heights, height=least * float(heights.max()))[0]
        best = places[np.argsort(-heights[places], kind="stable")][:count]
        near = 1e-9 if self.period else 0.5 * float(self.orders[1])
        periods = (self.period,) if self.period else _SUBHARMONICS
        found = [(float(self.orders[k]), float(heights[k])) for k in best]
        return tuple(Peak(line_name(order, periods, near, self.system.turns), order, size) for order, size in found)

    def __repr__(self) -> str:
        lines = ", ".join(f"{peak.name} {peak.amplitude:.4g}" for peak in self.peaks(5))
        return f"Spectrum({self.signal} at {pace_text(self.system, 6)}: {lines})"


@dataclass(frozen=True, slots=True)
class SpectrumOptions:
    """Options of a spectrum.

    Examples
    --------
    >>> gw.analysis.SpectrumOptions(periods=128, window="hann").window
    'hann'
    """

    periods: Annotated[int, Ge(8)] = 256  #: Number of forcing periods in the window, for a motion without period.
    #: Window of `scipy.signal.get_window`, for a motion without period. ``"flattop"`` gives amplitudes to within 0.1 %;
    #: ``"hann"`` separates neighbouring lines better.
    window: str = "flattop"
    #: Largest change of a line by aliasing, relative to the largest line; the sampling is refined until it is reached.
    tolerance: Annotated[float, Ge(1e-12), Le(0.1)] = 1e-6

    def __post_init__(self) -> None:
        from scipy.signal import get_window  # imported late: it takes long

        check_fields(self)
        try:
            get_window(self.window, 8)
        except (ValueError, TypeError):
            raise ModelError(
                f"window is {self.window!r}; write the name of a window of scipy.signal, such as 'flattop' or 'hann'"
            ) from None


class Peak(NamedTuple):
    """A line of a spectrum: its name, its order (see `Spectrum`) and its amplitude."""

    name: str  #: Name of the line.
    order: float  #: Its order.
    amplitude: float  #: Its amplitude, in the unit of the signal.


@dataclass(frozen=True, eq=False)
class Waterfall(Described, Pictured):
    """Spectra over orders, orbit by orbit: multiples of W, or orders per turn of a shaft whose speed is a parameter."""

    parameter: str  #: Name of the parameter that changes from orbit to orbit.
    signal: str  #: Name of the signal.
    #: shape (orbits,): The parameter at each orbit, in the order along the branch: it reverses at folds.
    values: NDArray[np.float64]
    orders: NDArray[np.float64]  #: shape (lines,): Orders, evenly spaced from 0; see `Spectrum`.
    #: shape (orbits, lines): Amplitudes in the units of the signal; the first column is the mean.
    amplitudes: NDArray[np.float64]
    stable: NDArray[np.bool_]  #: shape (orbits,): True for stable orbits.
    turns: int | Fraction | None = None  #: See `System.turns`.
    units: Units | None = None  #: Units of the system.
    #: shape (orbits,): Frequency of order 1 at each orbit, in Hz (angular without units).
    pitch: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    #: shape (orbits,): Root mean square of the signal without its mean, of all orders.
    overall: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    #: shape (orbits,): Root mean square of the lines from 500 to 5,000 Hz, the level of rattle; NaN without units, and
    #: where the samples do not resolve 5,000 Hz.
    band: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    window: str = ""  #: The window of the spectra, in words.

    def tables(self) -> Tables:
        """Return the table of amplitudes: a row for each orbit, a column for each order."""
        return {"amplitudes": TableRows(self._rows, 1, self.signal)}

    def cut(self, order: float) -> NDArray[np.float64]:
        """Return the amplitudes of the order nearest to a given one, shape (orbits,)."""
        if not 0.0 <= order <= self.orders[-1] + 1e-9:
            raise ModelError(f"order {order:g} is not in these spectra; they go up to order {self.orders[-1]:g}")
        return self.amplitudes[:, int(np.argmin(np.abs(self.orders - order)))]

    def _rows(self) -> Rows:
        yield [self.parameter, "stable", *map(order_heading, self.orders)]
        for value, stable, row in zip(
            self.values.tolist(), self.stable.tolist(), self.amplitudes.tolist(), strict=True
        ):
            yield [value, stable, *row]

    def __repr__(self) -> str:
        return (
            f"Waterfall({self.signal} over {self.parameter} {self.values[0]:.6g} ... {self.values[-1]:.6g}, "
            f"{len(self.values)} orbits, orders up to {self.orders[-1]:g})"
        )


def spectrum(motion: Orbit | Settled, signal: str, options: SpectrumOptions | None = None) -> Spectrum:
    """Compute the spectrum of a signal of a settled motion.

    An orbit is transformed over exactly one period, so there is no leakage; any other motion is windowed. In both cases
    the sampling is refined until aliasing is negligible, because kinks at contacts have many harmonics.

    Parameters
    ----------
    motion
        An orbit or a settled motion.
    signal
        A coordinate (``"q1"``), its velocity (``"q1'"``) or acceleration (``"q1''"``), a contact's force
        (``"stop.force"``): as in `Motion.signal`.
    options
        Length, window and accuracy.

    Returns
    -------
    Spectrum
        The lines.

    Raises
    ------
    ModelError
        If there is no such signal.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> gw.analysis.spectrum(impacting, "x''").amplitudes[1:4].round(4)
    array([1.5755, 0.885 , 0.7284])
    """
    return _spectrum(motion.system, motion.state.tobytes(), motion.period or 0, signal, options or SpectrumOptions())


@lru_cache(maxsize=8)  # the study of a motion and its picture ask for the same
def _spectrum(system: System, content: bytes, period: int, signal: str, options: SpectrumOptions) -> Spectrum:
    from scipy.signal import get_window  # imported late: it takes long

    state, length = np.frombuffer(content), period or options.periods

    def sampled(samples: int) -> Motion:
        return integrate(system, state, length, samples)

    def window(count: int) -> NDArray[np.float64]:
        return np.ones(count) if period else get_window(options.window, count)

    values, folding = _refined(sampled, signal, length, window, options.tolerance)
    weights = window(len(values) * 2)
    bins = 0.0 if period else len(weights) * float((weights**2).sum() / weights.sum() ** 2)
    turns = float(system.turns or 1)
    orders = turns * np.arange(len(values)) / length
    return Spectrum(system, signal, orders, values, period, turns * bins / length, folding)


def _refined(
    sampled: Callable[[int], Motion],
    signal: str,
    length: int,
    window: Callable[[int], NDArray[np.float64]],
    tolerance: float,
) -> tuple[NDArray[np.complex128], float]:
    """Double the sampling until aliasing is small; return the lines of a signal and a bound on the aliasing."""
    samples = 2 * _FIRST
    rounds = math.log2(min(_FINEST, (1 << 22) / length) / _FIRST)
    while True:
        tell_stage((math.log2(samples / _FIRST) - 1.0) / max(rounds, 1.0))
        motion = sampled(samples)
        values, impulses = motion.signal(signal)[:-1], motion.impulses(signal)
        coarse, lines = (_lines(each, impulses, length, window) for each in (values[::2], values))
        folding = float(np.abs(lines[: len(coarse)] - coarse).max())
        largest = float(np.abs(lines).max())
        if folding <= tolerance * largest or samples >= _FINEST or len(values) > 1 << 21:
            return lines, folding
        samples *= 2


def _lines(
    values: NDArray[np.float64],
    impulses: tuple[NDArray[np.float64], NDArray[np.float64]],
    length: int,
    window: Callable[[int], NDArray[np.float64]],
) -> NDArray[np.complex128]:
    """Return the unaliased part of the spectrum, corrected for the window; the mean is removed before the transform."""
    # Impulses between the samples, of rigid stops, have the lines of their exact angles.
    weights, step = window(len(values)), PERIOD * length / len(values)
    theta, sizes = impulses
    mean = values.mean() + sizes.sum() / (PERIOD * length)
    lines = 2.0 * np.fft.rfft((values - mean) * weights) / weights.sum()
    lines = lines[: len(values) // _CLEAN + 1]
    heights = 2.0 * sizes / step * np.interp(theta / step, np.arange(len(values)), weights) / weights.sum()
    for each, height in zip(theta, heights, strict=True):
        lines += height * np.exp(-1j * each / length * np.arange(len(lines)))
    lines[0] = mean
    return lines


def waterfall(
    orbits: Branch | Sequence[Orbit],
    signal: str,
    top: float = 10.0,
    *,
    parameter: str = "frequency",
    options: SpectrumOptions | None = None,
) -> Waterfall:
    """Compute the spectra of a signal along a branch, or for a list of orbits.

    Parameters
    ----------
    orbits
        A branch, or orbits in the order in which a parameter changes.
    signal
        As in `spectrum`.
    top
        The highest order.
    parameter
        For a list of orbits, the name of the parameter that changes; for a branch it is known.
    options
        As in `spectrum`; by default aliasing is limited to 1e-4 of the largest line.

    Returns
    -------
    Waterfall
        The spectra, in the order of the orbits.

    Raises
    ------
    ModelError
        If there are no orbits, no such signal, or no such parameter.

    Examples
    --------
    >>> found = gw.analysis.waterfall(branch, "x''", top=5.0)
    >>> found.amplitudes.shape == (found.values.size, found.orders.size)
    True
    """
    if isinstance(orbits, Branch):
        parameter, orbits = orbits.parameter, [point.orbit for point in orbits.points]
    if not orbits:
        raise ModelError("a waterfall needs at least one orbit")
    if not top > 0.0:
        raise ModelError(f"top is {top!r}; it must be a positive order")
    options = options or SpectrumOptions(tolerance=1e-4)
    spacing = lcm(*(orbit.period for orbit in orbits))
    turns = orbits[0].system.turns
    orders = float(turns or 1) * np.arange(round(top / float(turns or 1) * spacing) + 1) / spacing
    table, levels = np.zeros((len(orbits), len(orders))), []
    for row, orbit in zip(table, orbits, strict=True):
        step, found = spacing // orbit.period, spectrum(orbit, signal, options)
        lines = found.amplitudes[: len(row[::step])]
        row[: len(lines) * step : step] = lines
        levels.append(_levels(orbit.system, orbit.system.frequency, found.orders, found.amplitudes))
    values = np.array([orbit.system[parameter] for orbit in orbits])
    return Waterfall(
        parameter,
        signal,
        values,
        orders,
        table,
        np.array([orbit.stable for orbit in orbits]),
        turns,
        orbits[0].system.units,
        *np.array(levels).T,
        window="one period each, without a window",
    )


def _window(values: NDArray[np.float64], weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the mean of the values in a window, and the amplitudes of its lines."""
    mean = float(values.mean())
    return mean, 2.0 * np.abs(np.fft.rfft((values - mean) * weights)) / weights.sum()


def _levels(
    system: System, frequency: float, orders: NDArray[np.float64], lines: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the frequency of order 1, the root mean square of some lines, and that of those in the band of rattle."""
    pitch = frequency / float(system.turns or 1) * (0.5 / math.pi if system.units else 1.0)
    squares, inside = 0.5 * lines[1:] ** 2, (orders[1:] * pitch >= BAND[0]) & (orders[1:] * pitch <= BAND[1])
    band = math.sqrt(squares[inside].sum()) if system.units else math.nan
    return pitch, math.sqrt(squares.sum()), band


def turns_of(system: System, turns: int) -> int:
    """Return the forcing periods in some turns of the reference shaft, at least; without a speed, as many periods."""
    return math.ceil(turns * Fraction(system.turns or 1))


def order_heading(order: float) -> str:
    """Return the heading of the amplitudes at an order, with all digits."""
    return f"order {float(order)!r}".removesuffix(".0")


def line_name(
    order: float | Fraction, periods: Sequence[int] = (1,), within: float = 1e-9, turns: int | Fraction | None = None
) -> str:
    """Return the name of a line at a multiple of W, or at an order per turn of a shaft."""
    for period in periods:
        nearest = Fraction(round(float(order) * period / (turns or 1)), period) * (turns or 1)
        if abs(float(order) - nearest) <= within:
            return _fraction_name(nearest) if turns is None or not nearest else f"order {nearest}"
    return f"{float(order):.4g}W" if turns is None else f"order {float(order):.4g}"


def _fraction_name(order: Fraction) -> str:
    if order == 0:
        return "mean"
    top = "W" if order.numerator == 1 else f"{order.numerator}W"
    return top if order.denominator == 1 else f"{top}/{order.denominator}"


# Order tracking: a signal over the angle of the excitation while the speed changes, computed or measured.
#
# Sampled evenly over the angle, orders stay lines while the speed changes. Extremes of each forcing period and spectra
# of windows of some periods are taken along it; each part in which the speed rises or falls is a leg of its own.

_TURNS_BACK = 0.05  # share of the range of the speed by which it must come back before another leg begins


@dataclass(frozen=True, eq=False)
class Tracked(Described):
    """A signal over the angle of the excitation."""

    system: System  #: The system, whose signal it is.
    signal: str  #: Name of the signal.
    samples: int  #: Samples per forcing period; there may be further ones between them.
    theta: NDArray[np.float64]  #: shape (samples,): Angle of the excitation, in radians.
    #: time, speed: shape (samples,): Time, and the first parameter of the system, such as its speed in rpm.
    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    values: NDArray[np.float64]  #: shape (samples,): The signal.
    #: shape (samples,): Its integral over time, where that is known exactly: of an acceleration. Orders are then those
    #: of means between samples: impacts shorter than these would look like low orders.
    integral: NDArray[np.float64] | None = None

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
        integral = None if self.integral is None else self.integral[part]
        return replace(self, theta=theta, time=time, speed=speed, values=values, integral=integral)

    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, smallest and largest value in each forcing period, shapes (periods,)."""
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
        """Compute spectra over orders in windows of some forcing periods."""
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
            raise ModelError(f"top is {top:g}; {self.samples} samples per period do not resolve so high an order")
        weights = np.hanning(length + 1)[:-1]
        starts = np.arange(0, len(values) - length + 1, max(1, round(length * (1.0 - overlap))))
        rows, levels, unit = [], [], self.system.structure.frequency
        every, speed = turns * np.arange(length // 2 + 1) / periods, self.speed[even][starts + length // 2]
        means, kept = values, 1.0
        if self.integral is not None:
            means = np.diff(self.integral[even]) / np.diff(self.time[even])
            means = np.append(means, means[-1])
            kept = np.sinc(every / turns / self.samples)
        for start, pace in zip(starts, speed, strict=True):
            mean, lines = _window(values[start : start + length], weights)
            smooth = _window(means[start : start + length], weights)[1] / kept
            rows.append([abs(mean), *smooth[1:count]])
            pitch, overall, band = _levels(self.system, float(pace) * unit, every, lines / math.sqrt(_HANN))
            levels.append((pitch, overall, band if every[-1] * pitch >= BAND[1] else math.nan))
        along = speed if over_speed else self.time[even][starts + length // 2]
        revolutions = (
            f"{periods / turns:g} turn{'s' * (periods != turns)}" if self.system.turns else f"{periods} periods"
        )
        return Waterfall(
            self.system.structure.pace if over_speed else "time", self.signal, along, every[:count],
            np.array(rows), np.ones(len(starts), bool), self.system.turns, self.system.units, *np.array(levels).T,
            window=f"Hann window of {revolutions}, {overlap:.0%} overlap, lines {turns / periods:g} apart",
        )  # fmt: skip

    def __repr__(self) -> str:
        periods = (self.theta[-1] - self.theta[0]) / PERIOD
        return f"Tracked({self.signal}, {self.speed[0]:.6g} to {self.speed[-1]:.6g}, {periods:.4g} forcing periods)"


# Sounds: a signal of a motion over true time, at its true pitch and level, and WAV files of it.
#
# Each sample is that of the exact flow at its instant; nothing is interpolated. The level is in the unit of the
# signal, so a quiet motion and a rattling one sound as differently loud as they are. What is infinite for no time, as
# an acceleration where a rigid stop strikes, is a sample whose area is the impulse.

RATE = 48_000
"""Samples per second."""
SECOND = 2.0 * math.pi * 90.0
"""Units of time that a second lasts without units: the excitation at frequency 1 is then heard at 90 Hz."""

_RATES = (4_000, 384_000)
_MOST = 30_000_000  # samples: ten minutes
_DEPTH = 2**23 - 1  # largest value of a sample of 24 bits
_ROUND = (1.0, 2.0, 5.0, 10.0)
_LOG_SAMPLES = 64  # per period, of the motion from which impulses are taken


@dataclass(frozen=True, eq=False)
class Sound(Described):
    """A signal over true time."""

    #: signal, unit: Name of the signal, and its unit; empty without units.
    signal: str
    unit: str
    rate: int  #: Samples per second.
    values: NDArray[np.float64]  #: shape (samples,): The signal, in its unit.
    second: float = 1.0  #: Units of the model's time that a second lasts: 1 for a model with units.

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return len(self.values) / self.rate

    @property
    def peak(self) -> float:
        """Largest magnitude without the mean, which nobody hears."""
        return float(np.abs(self._heard).max(initial=0.0))

    @property
    def level(self) -> float:
        """Root mean square without the mean."""
        return float(np.sqrt(np.mean(self._heard**2)))

    @property
    def full_scale(self) -> float:
        """The next of 1, 2, 5, 10, 20, ... above the peak: the amplitude that `wav` makes the largest sample."""
        if not self.peak > 0.0:
            return 1.0
        power = 10.0 ** math.floor(math.log10(self.peak))
        return next(step * power for step in _ROUND if step * power >= self.peak)

    @property
    def _heard(self) -> NDArray[np.float64]:
        return self.values - self.values.mean()

    def wav(self, full_scale: float | None = None) -> bytes:
        """Return the content of a WAV file of one channel, 24 bits; a comment in it says what full scale is."""
        scale = self.full_scale if full_scale is None else full_scale
        check("full_scale", scale, Positive)
        if self.peak > scale * (1.0 + 1e-12):
            raise ModelError(
                f"{self.signal} reaches {self.peak:.4g} {self.unit}".rstrip()
                + f", above the full scale of {scale:g}: the sound would be distorted. Write "
                f"full_scale={self.full_scale:g} or more, for all sounds that are compared"
            )
        levels = np.rint(self._heard * (_DEPTH / scale)).astype("<i4")
        content = levels.view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
        note = f"{self.signal}, full scale {scale:g} {self.unit}".rstrip()
        form = struct.pack("<HHIIHH", 1, 1, self.rate, 3 * self.rate, 3, 24)
        comment = b"INFO" + _chunk(b"ICMT", note.encode() + b"\0")
        body = b"WAVE" + _chunk(b"fmt ", form) + _chunk(b"LIST", comment) + _chunk(b"data", content)
        return _chunk(b"RIFF", body)

    def save(self, path: str | os.PathLike[str], full_scale: float | None = None) -> None:
        """Write a WAV file; see `wav`. Raise a StoreError if it cannot be written."""
        content = self.wav(full_scale)
        if why := why_no_file(path):
            raise StoreError(f"{os.fspath(path)} {why}")
        try:
            Path(path).write_bytes(content)
        except OSError as error:
            raise StoreError(f"{os.fspath(path)} cannot be written: {error.strerror or error}") from None

    def __repr__(self) -> str:
        return (
            f"Sound({self.signal}, {self.duration:.4g} s at {self.rate} Hz, peak {self.peak:.4g} {self.unit}".rstrip()
            + ")"
        )


def sound(
    motion: Orbit | Settled, signal: str, seconds: float = 3.0, *, rate: int = RATE, second: float | None = None
) -> Sound:
    """Compute the sound of a settled motion, at its true pitch and level.

    Parameters
    ----------
    motion
        An orbit, which need not be stable, or a settled motion.
    signal
        As in `Motion.signal`: usually an acceleration (``"gear''"``) or the force of a contact (``"mesh.force"``).
    seconds
        Length in seconds.
    rate
        Samples per second.
    second
        For a model without units: how many of its units of time a second has. By default, an excitation at frequency 1
        is heard at 90 Hz.

    Returns
    -------
    Sound
        The samples, in the unit of the signal.

    Raises
    ------
    ModelError
        If there is no such signal, or a number is out of its range.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=1.0
    ... )
    >>> heard = gw.analysis.sound(gw.find_orbit(mass), "x''")
    >>> round(heard.peak, 6), heard.duration
    (1.0, 3.0)
    """
    system = motion.system
    lasts = second_of(system, second)
    times = instants(seconds, rate) * lasts
    theta = times * system.frequency
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is None:
        found = sample(system, motion.state, theta)
        values, struck, whole = found.signal(signal), found, theta[-1]
    else:
        # a periodic motion is integrated over one period, also where it is unstable: it would be left
        whole = orbit.period * PERIOD
        angles, places = np.unique(theta % whole, return_inverse=True)
        values = sample(system, orbit.state, angles).signal(signal)[places]
        struck = integrate(system, orbit.state, orbit.period, _LOG_SAMPLES) if system.structure.reactions else None
    if struck is not None and struck.impacts:
        values = values + _struck(struck, signal, theta, whole, rate / lasts)
    return Sound(signal, unit_of(system, signal), rate, values, lasts)


def _struck(motion: Motion, signal: str, theta: NDArray[np.float64], whole: float, rate: float) -> NDArray[np.float64]:
    """Return impulses as samples: each is divided between two neighbours, and its area is kept."""
    angles, sizes = motion.impulses(signal)
    found, step = np.zeros(len(theta)), theta[1] - theta[0]
    for turn in range(int(theta[-1] // whole) + 1):
        places = (angles + turn * whole) / step
        first = np.floor(places).astype(int)
        part = places - first
        for at, share in ((first, 1.0 - part), (first + 1, part)):
            inside = (at >= 0) & (at < len(theta))
            np.add.at(found, at[inside], (share * sizes)[inside])
    return found * (rate / motion.system.frequency)  # an integral over theta becomes one over time


def instants(seconds: float, rate: int) -> NDArray[np.float64]:
    """Return the times of the samples of a sound, in seconds."""
    check("rate", rate, Annotated[int, Ge(_RATES[0]), Le(_RATES[1])])  # in samples per s
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 2.0 <= seconds * rate <= _MOST:
        raise ModelError(f"seconds is {given(seconds)}; it must be a length up to {_MOST / rate:g} s")
    return np.arange(int(seconds * rate + 1e-9)) / rate


def second_of(system: System, second: float | None) -> float:
    """Return the units of time that a second lasts."""
    if system.units is not None:
        if second not in (None, 1.0):
            raise ModelError("this model has units, so its time is in seconds; leave second out")
        return 1.0
    if second is None:
        return SECOND
    check("second", second, Positive)
    return float(second)


def unit_of(system: System, signal: str) -> str:
    """Return the unit of a signal; empty without units."""
    return "" if system.units is None else system.units.signal(signal)[1]


def _chunk(name: bytes, content: bytes) -> bytes:
    """Return a part of a RIFF file, whose length is even."""
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
