"""How thoroughly to search."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gapwalk.errors import ModelError


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """How thoroughly to search.

    Parameters
    ----------
    starts
        Starts at each value of the parameter, from which transients are let settle.
    periods
        Highest period, in forcing periods, of the orbits to which a transient may settle.
    newton_starts
        How many of the starts at each value serve Newton's method too, which finds unstable orbits; 0: none.
    newton_periods
        Periods, in forcing periods, of the orbits that Newton's method looks for.
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

    starts: int = 192
    periods: int = 8
    newton_starts: int = 32
    newton_periods: tuple[int, ...] = (1, 2, 3, 4)
    patience: int = 400
    box: tuple[float, ...] | None = None
    spread: float = 1.5
    seed: int = 0
    block: int = 32

    def __post_init__(self) -> None:
        for name, least in (("starts", 1), ("periods", 1), ("patience", 16), ("block", 1)):
            _check_integer(name, getattr(self, name), least)
        for name in ("newton_starts", "seed"):
            _check_integer(name, getattr(self, name), 0)
        for period in self.newton_periods:
            _check_integer("each of newton_periods", period, 1)
        if not 0.0 < self.spread < math.inf:
            raise ModelError(f"spread is {self.spread!r}; it must be a number > 0")


def _check_integer(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")
