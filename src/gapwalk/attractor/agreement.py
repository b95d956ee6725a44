"""How well two histories of one signal agree: rms difference, correlation, and the difference of their lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BLOCK = 4096  # samples that are taken together where lines are fitted: memory stays small


class LinePair(NamedTuple):
    """One spectral line of two histories.

    Attributes
    ----------
    order
        Multiple of the excitation frequency, or per turn of the shaft whose speed is a parameter.
    first, second
        Amplitudes.
    shift
        Phase of the second line ahead of the first one, in radians between -pi and pi.
    """

    order: float
    first: float
    second: float
    shift: float

    @property
    def difference(self) -> float:
        """By how much the second amplitude is larger."""
        return self.second - self.first


@dataclass(frozen=True)
class Agreement:
    """How well two histories agree, their means left out: an accelerometer does not see them.

    Attributes
    ----------
    rms
        Root mean square of the difference, in the units of the signal.
    relative
        The same, relative to the root mean square of the first history.
    correlation
        Pearson's coefficient of correlation: 1 where they have the same form.
    lines
        Spectral lines of both, by order.
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
    """How well two histories agree at the same angles, over whole periods.

    Parameters
    ----------
    theta : shape (samples,)
        Angles of the excitation, in radians.
    first, second : shape (samples,)
        The histories.
    orders : shape (lines,)
        Multiples of the excitation frequency at which lines are wanted.
    turns
        See `System.turns`: the orders of the lines are counted by it.
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
    """Complex amplitudes c of the sum of ``Re(c exp(i order theta))`` and a mean that fits best, shape (lines,).

    A fit by least squares needs neither a whole number of samples a period nor even ones, and nothing leaks.
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
    """The orders of a motion of m forcing periods, up to the highest: multiples of 1/m."""
    return np.arange(1, int(highest * period + 1e-9) + 1) / period
