"""Averages over a sequence of values along a motion, with errors that allow for their correlation.

There are two estimators. For regular motion (periodic or quasi-periodic) the weighted Birkhoff average converges
faster than any power of the length (Das, Saiki, Sander and Yorke 2017, Nonlinearity 30, 4111-4140). For chaotic motion
the plain mean is as good as any other estimator; its error is estimated from averages over blocks of growing length
(Flyvbjerg and Petersen 1989, J. Chem. Phys. 91, 461-466).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BLOCKS = 16  # the fewest blocks from which an error is estimated
_PARTS = 4  # parts of the sequence whose weighted averages are compared


class Average(NamedTuple):
    """A mean and its error, for each column of a sequence.

    Attributes
    ----------
    mean, error : shape (columns,)
        The better of the two estimates, and its standard error.
    spread : shape (columns,)
        Range of the weighted averages of four parts of the sequence: small only for regular motion.
    """

    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    spread: NDArray[np.float64]


@lru_cache(maxsize=32)
def birkhoff_weights(count: int) -> NDArray[np.float64]:
    """Return `count` weights ``exp(-1 / (t (1 - t)))``, normalised to the sum 1."""
    t = np.arange(1, count + 1) / (count + 1)
    weights = np.exp(-1.0 / (t * (1.0 - t)))
    weights /= weights.sum()
    weights.flags.writeable = False
    return weights


def birkhoff_mean(values: NDArray) -> NDArray:
    """Compute the weighted Birkhoff average over the first axis."""
    return birkhoff_weights(len(values)) @ values


def birkhoff_spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the range of the weighted averages of four equal parts of the sequence, for each column."""
    length = len(values) // _PARTS
    parts = [birkhoff_mean(values[k * length : (k + 1) * length]) for k in range(_PARTS)]
    return np.ptp(parts, axis=0)


def block_error(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the standard error of the plain mean of each column: the largest value over all block lengths."""
    error = np.zeros(values.shape[1:])
    while len(values) >= _BLOCKS:
        error = np.maximum(error, values.std(axis=0, ddof=1) / np.sqrt(len(values)))
        even = values[: len(values) // 2 * 2]
        values = 0.5 * (even[::2] + even[1::2])
    return error


def average(values: NDArray[np.float64]) -> Average:
    """Compute mean and error of each column of a sequence, shape (length, columns) with a length of at least 16."""
    plain, weighted = block_error(values), birkhoff_spread(values)
    rounding = np.finfo(float).eps * np.abs(values).max(axis=0)
    plain, weighted = np.maximum(plain, rounding), np.maximum(weighted, rounding)
    regular = weighted <= plain
    mean = np.where(regular, birkhoff_mean(values), values.mean(axis=0))
    return Average(mean, np.where(regular, weighted, plain), weighted)
