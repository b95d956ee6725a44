"""Whether a motion that is not periodic has settled: averages over it must not change any more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.average import birkhoff_mean, birkhoff_spread

_BLOCKS = 16
_ERRORS = 4.5  # standard errors by which the trend of a chaotic motion may differ from none
_IRREGULAR = 1e-3  # spread of weighted averages, relative to the signal's deviation, above which it is chaotic


class Drift(NamedTuple):
    """How the averages of a motion change along a stretch of it.

    Attributes
    ----------
    change
        The largest change, between the halves, of the weighted average of a scaled state or of a product of two.
    in_errors
        The largest linear trend of averages over 16 blocks, in its standard errors. These come from what the trend
        leaves unexplained: a slow decay does not hide itself by adding to its own error.
    irregular
        Whether weighted averages converge as slowly as those of chaotic motion do.
    """

    change: float
    in_errors: float
    irregular: bool

    def is_settled(self, tolerance: float) -> bool:
        """Whether the change is within the tolerance, or, for irregular motion, the trend within its errors."""
        return self.change <= tolerance or (self.irregular and self.in_errors <= _ERRORS)

    @property
    def text(self) -> str:
        """What is known of a settled motion, in words."""
        if self.irregular:
            return f"its averages fluctuate, and show no trend beyond {self.in_errors:.1f} standard errors"
        return f"its averages change by no more than {self.change:.1e}"


def drift_of(states: NDArray[np.float64]) -> Drift:
    """The drift along a sequence of scaled strobes, shape (count, 2n) with a count of 64 or more."""
    i, j = np.triu_indices(states.shape[1])
    observed = np.hstack((states, states[:, i] * states[:, j]))
    half = len(observed) // 2
    change = np.abs(birkhoff_mean(observed[-half:]) - birkhoff_mean(observed[:half]))
    rough = birkhoff_spread(observed[-half:]) > _IRREGULAR * observed.std(axis=0)
    return Drift(float(change.max()), float(_trend(observed).max()), bool(rough.any()))


def _trend(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size of the linear trend of block averages, in its standard errors, for each column."""
    length = len(values) // _BLOCKS
    blocks = values[-length * _BLOCKS :].reshape(_BLOCKS, length, -1)
    means = np.array([birkhoff_mean(block) for block in blocks])
    place = np.arange(_BLOCKS) - (_BLOCKS - 1) / 2
    slope = place @ means / (place @ place)
    left = means - means.mean(axis=0) - np.outer(place, slope)
    error = np.sqrt((left**2).sum(axis=0) / (_BLOCKS - 2) / (place @ place))
    return np.abs(slope) / (error + np.finfo(float).eps)
