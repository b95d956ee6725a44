"""The regime of a motion, a word for each value of the parameter, and the bands of equal regimes along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.regime import Regime, regime_word

NOT_PERIODIC, RUNS_AWAY = "not periodic", Regime.RUNAWAY.text

_SAME = 1e-4
"""Distance, in half-widths of the box of states, within which a motion has returned."""


@dataclass(frozen=True, slots=True)
class Band:
    """A range of the parameter in which the regime is the same.

    Attributes
    ----------
    regime
        In words, such as ``period 3``.
    low, high
        Its ends, halfway to the next values of another regime.
    count
        Number of values in it.
    """

    regime: str
    low: float
    high: float
    count: int


def regime_of(section: NDArray[np.float64], box: NDArray[np.float64], max_period: int) -> str:
    """The regime of section points in a row: ``period m``, the smallest m after which all return, or not periodic.

    Parameters
    ----------
    section : shape (points, 2n)
        States a forcing period apart, on a motion that has settled.
    box : shape (2n,)
        Half-widths of the box of states.
    max_period
        Longest period in question, in forcing periods.
    """
    states = section / box
    for m in range(1, max_period + 1):
        if np.abs(states[m:] - states[:-m]).max() <= _SAME:
            return regime_word(Regime.PERIODIC, m)
    return NOT_PERIODIC


def bands_of(values: NDArray[np.float64], regimes: Sequence[str]) -> tuple[Band, ...]:
    """The bands of equal regimes along increasing values; where a regime is empty, nothing is known and no band is."""
    edges = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    bands, first = [], 0
    for regime, group in groupby(regimes):
        count = len(list(group))
        if regime:
            bands.append(Band(regime, float(edges[first]), float(edges[first + count]), count))
        first += count
    return tuple(bands)
