"""Agreement of two histories of one signal: rms difference, correlation, and differences of spectral lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BLOCK = 4096  # samples per block of the least-squares fit of lines: this bounds the memory


class LinePair(NamedTuple):
    """One spectral line of two histories.

    Attributes
    ----------
    order
        Multiple of the excitation frequency, or per turn of the shaft whose speed is a parameter.
    first, second
        Amplitudes.
    shift
        Phase of the second line minus that of the first one, in radians between -pi and pi.
    """

    order: float
    first: float
    second: float
    shift: float

    @property
    def difference(self) -> float:
        """Second amplitude minus first amplitude."""
        return self.second - self.first


@dataclass(frozen=True)
class Agreement:
    """Agreement of two histories after removal of their means, because an accelerometer does not measure the mean.

    Attributes
    ----------
    rms
        Root mean square of the difference, in the units of the signal.
    relative
        The rms difference divided by the root mean square of the first history.
    correlation
        Pearson's correlation coefficient: 1 if the histories are proportional.
    lines
        Spectral lines of both histories, by order.
    """

    rms: float
    relative: float
    correlation: float
    lines: tuple[LinePair, ...]


def agreement(
    theta: NDArray[np.float64],
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    orders: NDArray[np.float64],
    turns: int | None = None,
) -> Agreement:
    """Compare two histories that are sampled at the same angles over whole periods.

    Parameters
    ----------
    theta : shape (samples,)
        Angles of the excitation, in radians.
    first, second : shape (samples,)
        The histories.
    orders : shape (lines,)
        Multiples of the excitation frequency at which spectral lines are compared.
    turns
        Forcing periods per turn of the shaft, as in `System.turns`; line orders are then counted per turn.
    """
    first, second = first - first.mean(), second - second.mean()
    rms, size = float(np.sqrt(np.mean((second - first) ** 2))), float(np.sqrt(np.mean(first**2)))
    both = size * float(np.sqrt(np.mean(second**2)))
    lines = [lines_of(theta, values, orders) for values in (first, second)]
    shifts = np.angle(lines[1] * lines[0].conj())
    counted = (turns or 1) * orders
    pairs = zip(counted.tolist(), *(np.abs(values).tolist() for values in lines), shifts.tolist(), strict=True)
    correlation = float(np.mean(first * second)) / both if both else 0.0
    return Agreement(rms, rms / size if size else np.inf, correlation, tuple(LinePair(*pair) for pair in pairs))


def lines_of(
    theta: NDArray[np.float64], values: NDArray[np.float64], orders: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Fit ``Re(c exp(i order theta))`` plus a mean to a signal; return the complex amplitudes c, shape (lines,).

    A least-squares fit, unlike an FFT, does not need a whole number of samples per period or even spacing, and it has
    no leakage.
    """
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
