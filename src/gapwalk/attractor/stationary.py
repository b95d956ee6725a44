"""Whether a motion that is not periodic has settled: averages over it must not change any more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.average import birkhoff_mean, birkhoff_spread

# Numbers of blocks, and the standard errors by which the trend over so many may differ from none. Few long blocks show
# the slow decay of a torus, whose weighted averages are then sharp; errors from few blocks are uncertain themselves.
_LEVELS = ((16, 4.5), (8, 6.0), (5, 12.0))
_SMALL = 0.01  # weight of what is left over a nearest return: it may change by a hundred times the tolerance
_NOTHING = 1e-20  # its square where nothing is left but rounding
_IRREGULAR = 1e-3  # spread of weighted averages, relative to the signal's deviation, above which it is chaotic


class Drift(NamedTuple):
    """How the averages of a motion change along a stretch of it.

    Attributes
    ----------
    change
        The largest change, between the halves, of the weighted average of a scaled state or of a product of two.
    trend
        The largest linear trend of averages over blocks, in its standard errors, over what is allowed. The errors come
        from what the trend leaves unexplained: a slow decay does not hide itself by adding to its own error.
    irregular
        Whether weighted averages converge as slowly as those of chaotic motion do.
    """

    change: float
    trend: float
    irregular: bool

    def is_settled(self, tolerance: float) -> bool:
        """Whether the change is within the tolerance, or, for irregular motion, the trend within its errors."""
        return self.change <= tolerance or (self.irregular and self.trend <= 1.0)

    def text(self, tolerance: float) -> str:
        """What is known of a settled motion, in words."""
        if self.change > tolerance:
            return f"its averages fluctuate, and show no trend (at most {self.trend:.2f} of what counts as one)"
        return f"its averages change by no more than {self.change:.1e}"


def drift_of(states: NDArray[np.float64], period: int = 1) -> Drift:
    """The drift along a sequence of scaled strobes, shape (count, 2n) with a count of 64 or more.

    `period` is that of the nearest return. What is left of the motion over it, the size of a torus about an orbit say,
    is looked at by itself and in its own measure: it may be small beside the motion, and far from settled.
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
    """Size of the largest linear trend of block averages, in its standard errors, over what is allowed."""
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
