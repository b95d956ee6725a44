"""Options of a search: its thoroughness, and the values of the parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError

VALUES = 300
"""Number of values in a range for a thorough search: it misses no isolated branch wider than a 300th of the range."""

_MOST = 100_000  # largest number of starts, or of values


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """Thoroughness of a search at each value of the parameter.

    The defaults suit many values, several of which lie on each isolated branch; at a single value use more starts.

    Parameters
    ----------
    starts
        Starts of transients at each value of the parameter.
    periods
        Longest period, in forcing periods, of the orbits on which a transient may settle.
    newton_starts
        Number of starts at each value that Newton's method uses too, to find unstable orbits; 0 for none.
    newton_periods
        Periods, in forcing periods, of the orbits that Newton's method searches for. One of those starts in m is used
        for period m; orbits of shorter periods are found too.
    patience
        Forcing periods after which a transient whose returns no longer shrink counts as not periodic.
    box
        Half-widths of the box of starts about zero, 2n numbers: positions, then velocities. By default it is derived
        from the system; see `state_box`.
    spread
        Ratio of the derived box to the motions.
    seed
        Seed of the starts: the same seed gives the same result.
    block
        Starts in one piece of work. It affects the result, because a piece does not use what others find.
    """

    starts: int = 24
    periods: int = 8
    newton_starts: int = 24
    newton_periods: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8)
    patience: int = 400
    box: tuple[float, ...] | None = None
    spread: float = 1.5
    seed: int = 0
    block: int = 24

    def __post_init__(self) -> None:
        for name, least in (("starts", 1), ("periods", 1), ("patience", 16), ("block", 1)):
            _check_integer(name, getattr(self, name), least)
        for name in ("newton_starts", "seed"):
            _check_integer(name, getattr(self, name), 0)
        if max(self.starts, self.newton_starts) > _MOST:
            raise ModelError(f"starts is {self.starts}, newton_starts {self.newton_starts}; at most {_MOST:,} each")
        for period in self.newton_periods:
            _check_integer("each of newton_periods", period, 1)
        if self.newton_starts and not self.newton_periods:
            raise ModelError("newton_periods is empty; name at least one period, or write newton_starts = 0")
        if not 0.0 < self.spread < math.inf:
            raise ModelError(f"spread is {self.spread!r}; it must be a number > 0")


def values_between(low: float, high: float, narrowest: float | None = None) -> NDArray[np.float64]:
    """Return evenly spaced values of a parameter, so dense that each isolated branch of some width contains one.

    An isolated branch (isola) is connected to no other, and exists only over a part of the range.

    Parameters
    ----------
    low, high
        The range of the parameter.
    narrowest
        Width of the narrowest isolated branch that must not lie between two of the values, in units of the parameter;
        by default a 300th of the range.

    Returns
    -------
    ndarray of shape (count,)
        The middles of `count` equal parts of the range, none of them wider than `narrowest`.

    Raises
    ------
    ModelError
        For an empty range, or a width that is not positive.
    """
    if not low < high < math.inf or low == -math.inf:
        raise ModelError(f"the range is from {low!r} to {high!r}; its limits must be finite and increasing")
    if narrowest is not None and not 0.0 < narrowest < math.inf:
        raise ModelError(f"narrowest is {narrowest!r}; it must be a number > 0, in units of the parameter")
    ratio = VALUES if narrowest is None else (high - low) / narrowest * (1.0 - 1e-12)
    if ratio > _MOST:
        raise ModelError(f"narrowest is {narrowest!r}, which takes {ratio:.3g} values; at most {_MOST:,} are allowed")
    count = math.ceil(ratio)
    return low + (high - low) * (np.arange(count) + 0.5) / count


def _check_integer(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")
