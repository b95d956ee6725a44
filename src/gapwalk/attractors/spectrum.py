"""Spectra of signals: amplitudes in the units of the signal over multiples of W, and the names of spectral lines.

A line is named W, 2W, W/3, 5W/3 and so on, or after those it lies between. A waterfall shows spectra of a signal along
a branch or for a list of orbits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Settled
from gapwalk.attractors.section import check_count
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion, integrate
from gapwalk.model.system import System, pace_text
from gapwalk.model.units import Units
from gapwalk.notebook import Pictured
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Described, Rows, TableRows, Tables

_FIRST, _FINEST = 128, 16_384  # samples per forcing period at the start and at the end of the refinement
_SUBHARMONICS = (1, 2, 3, 4, 5, 6)  # multiples of W over these numbers get names if a motion has no period
_CLEAN = 4  # lines above a quarter of the sampling rate are omitted: aliasing affects them most


@dataclass(frozen=True, eq=False)
class Spectrum(Described):
    """The spectrum of one signal.

    Examples
    --------
    >>> lines = gw.analysis.spectrum(impacting, "x")
    >>> lines.orders[:3], round(lines.amplitude(1), 6)
    (array([0., 1., 2.]), 1.302088)
    """

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
        """Return the amplitude of the line nearest to an order within the resolution; 0 if there is none.

        Parameters
        ----------
        order
            The order, a multiple of W or per turn, as in `orders`.
        """
        nearest = int(np.argmin(np.abs(self.orders - order)))
        reach = max(self.resolution, 1e-9)
        return float(self.amplitudes[nearest]) if abs(self.orders[nearest] - order) <= reach else 0.0

    def peaks(self, count: int = 10, least: float = 1e-3) -> tuple[Peak, ...]:
        """Return the highest peaks without the mean, in descending order.

        Parameters
        ----------
        count
            Largest number of peaks.
        least
            Smallest height, relative to the highest peak.
        """
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

    periods: int = 256  #: Number of forcing periods in the window, for a motion without period.
    #: A window of `scipy.signal.get_window`, for a motion without period. ``"flattop"`` gives amplitudes to 0.1 %,
    #: ``"hann"`` separates neighbouring lines better.
    window: str = "flattop"
    #: The sampling is refined until aliasing changes no line by more than this, relative to the largest line.
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        from scipy.signal import get_window  # imported late: it takes long

        check_count("periods", self.periods, 8)
        if not 1e-12 <= self.tolerance <= 0.1:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-12 and 0.1")
        try:
            get_window(self.window, 8)
        except (ValueError, TypeError):
            raise ModelError(
                f"window is {self.window!r}; write the name of a window of scipy.signal, such as 'flattop' or 'hann'"
            ) from None


class Peak(NamedTuple):
    """A line of a spectrum: its name, its order (see `Spectrum`) and its amplitude.

    Examples
    --------
    >>> peak = gw.analysis.spectrum(impacting, "x").peaks(1)[0]
    >>> peak.order, round(peak.amplitude, 6)
    (1.0, 1.302088)
    """

    name: str  #: Name of the line.
    order: float  #: Its order.
    amplitude: float  #: Its amplitude, in the unit of the signal.


@dataclass(frozen=True, eq=False)
class Waterfall(Described, Pictured):
    """Spectra over orders, orbit by orbit: multiples of W, or orders per turn of the shaft whose speed is a parameter.

    Examples
    --------
    >>> found = gw.analysis.waterfall([orbit, impacting], "x''", top=4.0)
    >>> found.values, found.amplitudes.shape
    (array([0.6, 1.1]), (2, 5))
    """

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

    def tables(self) -> Tables:
        """Return the table of amplitudes: a row for each orbit, a column for each order."""
        return {"amplitudes": TableRows(self._rows, 1, self.signal)}

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

    An orbit is transformed over exactly one period, so no line leaks; any other motion is windowed. In both cases the
    sampling is refined until aliasing is negligible: contacts cause kinks, and kinks have many harmonics.

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
    from scipy.signal import get_window  # imported late: it takes long

    options = options or SpectrumOptions()
    system, state, period = motion.system, motion.state, motion.period or 0
    length = period or options.periods

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
    samples, coarse = _FIRST, None
    while True:
        motion = sampled(samples)
        values = motion.signal(signal)[:-1]
        lines = _lines(values, motion.impulses(signal), length, window)
        if coarse is not None:
            folding = float(np.abs(lines[: len(coarse)] - coarse).max())
            largest = float(np.abs(lines).max())
            if folding <= tolerance * largest or samples >= _FINEST or len(values) > 1 << 21:
                return lines, folding
        samples, coarse = 2 * samples, lines


def _lines(
    values: NDArray[np.float64],
    impulses: tuple[NDArray[np.float64], NDArray[np.float64]],
    length: int,
    window: Callable[[int], NDArray[np.float64]],
) -> NDArray[np.complex128]:
    """Return the unaliased part of the spectrum, corrected for the window; the mean is removed before the transform.

    Impulses between the samples, of rigid stops, have the lines of their exact angles.
    """
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
        Name of the parameter that changes, for a list of orbits; a branch supplies its own.
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
    table = np.zeros((len(orbits), len(orders)))
    for row, orbit in zip(table, orbits, strict=True):
        step = spacing // orbit.period
        lines = spectrum(orbit, signal, options).amplitudes[: len(row[::step])]
        row[: len(lines) * step : step] = lines
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
    )


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
