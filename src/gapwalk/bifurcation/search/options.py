"""How thoroughly to search, and at which values of a parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError

VALUES = 300
"""Values of a parameter in a range at which a search is thorough: it misses no island wider than a 300th of it."""

_MOST = 100_000  # starts, or values


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """How thoroughly to search at each value of the parameter.

    The defaults suit many values, of which several lie on each island; at a single value take more starts.

    Parameters
    ----------
    starts
        Starts at each value of the parameter, from which transients are let settle.
    periods
        Highest period, in forcing periods, of the orbits to which a transient may settle.
    newton_starts
        How many of the starts at each value serve Newton's method too, which finds unstable orbits; 0: none.
    newton_periods
        Periods, in forcing periods, of the orbits that Newton's method looks for. One of those starts in m serves
        period m; orbits that repeat earlier are found too.
    patience
        Forcing periods after which a transient whose returns no longer shrink counts as not periodic.
    box
        Half-widths of the box of starts about zero, 2n numbers: positions, then velocities. By default it is derived
        from the system; see `state_box`.
    spread
        How many times larger than the motions the derived box is.
    seed
        Of the starts: the same seed gives the same result.
    block
        Starts in one piece of work. It is part of the result's definition, as a piece does not know what others find.
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
            raise ModelError(f"starts is {self.starts}, newton_starts {self.newton_starts}; they may be {_MOST:,}")
        for period in self.newton_periods:
            _check_integer("each of newton_periods", period, 1)
        if self.newton_starts and not self.newton_periods:
            raise ModelError("newton_periods is empty; name at least one period, or write newton_starts = 0")
        if not 0.0 < self.spread < math.inf:
            raise ModelError(f"spread is {self.spread!r}; it must be a number > 0")


def values_between(low: float, high: float, narrowest: float | None = None) -> NDArray[np.float64]:
    """Values of a parameter, spread evenly, so dense that each island of some width holds one of them at least.

    An island is a branch that hangs together with no other, and exists over a part of the range only.

    Parameters
    ----------
    low, high
        The range of the parameter.
    narrowest
        Width of the narrowest island that must not lie between two of the values, in units of the parameter; by
        default a three-hundredth of the range.

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
        raise ModelError(f"the range is from {low!r} to {high!r}; it must go up, between finite numbers")
    if narrowest is not None and not 0.0 < narrowest < math.inf:
        raise ModelError(f"narrowest is {narrowest!r}; it must be a number > 0, in units of the parameter")
    ratio = VALUES if narrowest is None else (high - low) / narrowest * (1.0 - 1e-12)
    if ratio > _MOST:
        raise ModelError(f"narrowest is {narrowest!r}, which takes {ratio:.3g} values; there may be {_MOST:,}")
    count = math.ceil(ratio)
    return low + (high - low) * (np.arange(count) + 0.5) / count


def _check_integer(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")
