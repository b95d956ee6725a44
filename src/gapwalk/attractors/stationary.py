"""Stationarity of a motion that is not periodic: it has settled if averages over it no longer change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.average import birkhoff_mean, birkhoff_spread

# Numbers of blocks, and the allowed trend over them in standard errors. Few long blocks show the slow decay of a torus,
# because its weighted averages are then sharp; but errors from few blocks are themselves uncertain.
_LEVELS = ((16, 4.5), (8, 6.0), (5, 12.0))
_SMALL = 0.01  # weight of the differences over a nearest return: they may change by a hundred times the tolerance
_NOTHING = 1e-20  # square of a difference that is only rounding
_IRREGULAR = 1e-3  # spread of weighted averages, relative to the signal's deviation, above which a motion is chaotic


class Drift(NamedTuple):
    """The change of the averages of a motion along part of it.

    Attributes
    ----------
    change
        The largest change, between the halves, of the weighted average of a scaled state or of a product of two.
    trend
        The largest linear trend of averages over blocks, in its standard errors, relative to the allowed one. The
        errors come from the residual of the trend, so a slow decay cannot hide by increasing its own error.
    irregular
        True if weighted averages converge as slowly as those of chaotic motion.
    """

    change: float
    trend: float
    irregular: bool

    def is_settled(self, tolerance: float) -> bool:
        """Return True if the change is within the tolerance, or, for irregular motion, the trend within its errors."""
        return self.change <= tolerance or (self.irregular and self.trend <= 1.0)

    def text(self, tolerance: float) -> str:
        """Describe a settled motion in words."""
        if self.change > tolerance:
            return f"its averages fluctuate without a trend (at most {self.trend:.2f} of a significant one)"
        return f"its averages change by no more than {self.change:.1e}"


def drift_of(states: NDArray[np.float64], period: int = 1) -> Drift:
    """Compute the drift along a sequence of scaled strobes, shape (count, 2n) with a count of 64 or more.

    `period` is that of the nearest return. The difference of the motion over it (for example the size of a torus about
    an orbit) is scaled and tested separately: it may be small compared with the motion, and yet far from settled.
    """
    i, j = np.triu_indices(states.shape[1])
    left = (states[period:] - states[:-period]) ** 2
    left = _SMALL * left / np.maximum(left.mean(axis=0), _NOTHING)
    states = states[period:]
    observed = np.hstack((states, states[:, i] * states[:, j], left))
    half = len(observed) // 2
    change = np.abs(birkhoff_mean(observed[-half:]) - birkhoff_mean(observed[:half]))
    rough = birkhoff_spread(observed[-half:]) > _IRREGULAR * observed.std(axis=0)
    return Drift(float(change.max()), _trend(observed), bool(rough.any()))


def _trend(values: NDArray[np.float64]) -> float:
    """Return the largest linear trend of block averages, in its standard errors, relative to the allowed one."""
    largest = 0.0
    for count, allowed in _LEVELS:
        length = len(values) // count
        blocks = values[-length * count :].reshape(count, length, -1)
        means = np.array([birkhoff_mean(block) for block in blocks])
        place = np.arange(count) - (count - 1) / 2
        slope = place @ means / (place @ place)
        left = means - means.mean(axis=0) - np.outer(place, slope)
        error = np.sqrt((left**2).sum(axis=0) / (count - 2) / (place @ place))
        largest = max(largest, float((np.abs(slope) / (error + np.finfo(float).eps)).max()) / allowed)
    return largest
