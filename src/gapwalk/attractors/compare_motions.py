"""Comparison of two motions, for example under two damping laws: histories, spectra, and their agreement.

The agreement of two histories of one signal is given by their rms difference, their correlation, and the differences of
their spectral lines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.settle import Settled
from gapwalk.attractors.spectrum import Spectrum, SpectrumOptions, spectrum
from gapwalk.errors import ModelError
from gapwalk.flow.motion import force_of, integrate
from gapwalk.notebook import Pictured
from gapwalk.orbit.orbit import Orbit

_BLOCK = 4096  # samples per block of the least-squares fit of lines: this bounds the memory
_SAMPLES = 1024  # per forcing period
_LONG = 6  # forcing periods shown of motions that do not repeat sooner
_LINES = 20  # highest order of the lines that are compared


@dataclass(frozen=True, repr=False)
class Contrast(Pictured):
    """A comparison of two motions."""

    names: tuple[str, str]  #: Names of the two motions.
    motions: tuple[Orbit | Settled, Orbit | Settled]  #: The two motions.
    pairs: tuple[SignalPair, ...]  #: Their signals, in pairs.

    def __repr__(self) -> str:
        texts = [
            f"{pair.signal} no common period"
            if pair.agreement is None
            else f"{pair.signal} differs by {pair.agreement.relative:.3g} of its rms"
            for pair in self.pairs
        ]
        return f"Contrast({self.names[0]}, {self.names[1]}: {'; '.join(texts)})"


class LinePair(NamedTuple):
    """One spectral line of two histories."""

    order: float  #: Multiple of the excitation frequency, or per turn of the shaft whose speed is a parameter.
    #: first, second: Amplitudes.
    first: float
    second: float
    shift: float  #: Phase of the second line minus that of the first one, in radians between -pi and pi.

    @property
    def difference(self) -> float:
        """Second amplitude minus first amplitude."""
        return self.second - self.first


@dataclass(frozen=True)
class Agreement:
    """Agreement of two histories after removal of their means, because an accelerometer does not measure the mean."""

    rms: float  #: Root mean square of the difference, in the units of the signal.
    relative: float  #: The rms difference divided by the root mean square of the first history.
    correlation: float  #: Pearson's correlation coefficient: 1 if the histories are proportional.
    lines: tuple[LinePair, ...]  #: Spectral lines of both histories, by order.


@dataclass(frozen=True, eq=False)
class SignalPair:
    """One signal of two motions."""

    signal: str  #: Name of the signal.
    theta: NDArray[np.float64]  #: shape (samples,): Angles of the excitation.
    #: shape (2, samples): Histories of the first and of the second motion, at the same phases of the excitation.
    histories: NDArray[np.float64]
    spectra: tuple[Spectrum, Spectrum]  #: Spectra of the first and of the second motion.
    agreement: Agreement | None  #: Agreement of the histories; None if a motion has no period.


def contrast(
    first: Orbit | Settled,
    second: Orbit | Settled,
    signals: Sequence[str] = (),
    *,
    names: tuple[str, str] = ("first", "second"),
    options: SpectrumOptions | None = None,
) -> Contrast:
    """Compare histories and spectra of two motions, for example under two damping laws (paper, section 4).

    Both motions are sampled at the same phases of the excitation. Their two systems may differ if both have `signals`.

    Parameters
    ----------
    first, second
        Orbits or settled motions.
    signals
        As in `Motion.signal`; by default the acceleration of the first coordinate, and the force of each contact.
    names
        Names of the two motions.
    options
        Options of the spectra.

    Returns
    -------
    Contrast
        The signals of both motions, with their agreement.

    Raises
    ------
    ModelError
        If one of the motions has no such signal.
    FlowError
        If a motion diverges.

    Examples
    --------
    >>> found = gw.analysis.contrast(orbit, impacting, ["x"])
    >>> found.pairs[0].agreement.correlation < 1.0
    True
    """
    system = first.system
    if len(names) != 2:
        raise ModelError(f"names is {names!r}; it must be two texts")
    known = [f"{system.coordinates[0]}''", *map(force_of, system.structure.contacts)]
    periods = [first.period or 0, second.period or 0]
    shared = math.lcm(*periods) if all(periods) else 0
    length = shared if 0 < shared <= 8 * _LONG else _LONG
    motions = [integrate(motion.system, motion.state, length, _SAMPLES) for motion in (first, second)]
    theta = motions[0].theta
    pairs = []
    for signal in signals or known:
        histories = np.array([motion.signal(signal) for motion in motions])
        spectra = spectrum(first, signal, options), spectrum(second, signal, options)
        found = None
        if length == shared:
            found = agreement(theta[:-1], histories[0, :-1], histories[1, :-1], orders_of(length, _LINES), system.turns)
        pairs.append(SignalPair(signal, theta, histories, spectra, found))
    return Contrast((names[0], names[1]), (first, second), tuple(pairs))


def agreement(
    theta: NDArray[np.float64],
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    orders: NDArray[np.float64],
    turns: int | Fraction | None = None,
) -> Agreement:
    """Compare two histories that are sampled at the same angles over whole periods."""
    # Shapes: `theta`, `first`, `second` (samples,); `orders` (lines,).
    first, second = first - first.mean(), second - second.mean()
    rms, size = float(np.sqrt(np.mean((second - first) ** 2))), float(np.sqrt(np.mean(first**2)))
    both = size * float(np.sqrt(np.mean(second**2)))
    lines = [lines_of(theta, values, orders) for values in (first, second)]
    shifts = np.angle(lines[1] * lines[0].conj())
    counted = float(turns or 1) * orders
    pairs = zip(counted.tolist(), *(np.abs(values).tolist() for values in lines), shifts.tolist(), strict=True)
    correlation = float(np.mean(first * second)) / both if both else 0.0
    relative = rms / size if size else np.inf if rms else 0.0
    return Agreement(rms, relative, correlation, tuple(LinePair(*pair) for pair in pairs))


def lines_of(
    theta: NDArray[np.float64], values: NDArray[np.float64], orders: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Fit ``Re(c exp(i order theta))`` plus a mean to a signal; return the complex amplitudes c, shape (lines,)."""
    # A least-squares fit, unlike an FFT, does not need a whole number of samples per period or even spacing, and it has
    # no leakage.
    count = len(orders)
    matrix, vector = np.zeros((2 * count + 1, 2 * count + 1)), np.zeros(2 * count + 1)
    for start in range(0, len(theta), _BLOCK):
        angles = np.multiply.outer(theta[start : start + _BLOCK], orders)
        rows = np.hstack((np.cos(angles), -np.sin(angles), np.ones((len(angles), 1))))
        matrix += rows.T @ rows
        vector += rows.T @ values[start : start + _BLOCK]
    found = np.linalg.lstsq(matrix, vector, rcond=1e-12)[0]
    return found[:count] + 1j * found[count : 2 * count]


def orders_of(period: int, highest: float) -> NDArray[np.float64]:
    """Return the orders of a motion of m forcing periods up to the highest one: multiples of 1/m."""
    return np.arange(1, int(highest * period + 1e-9) + 1) / period
