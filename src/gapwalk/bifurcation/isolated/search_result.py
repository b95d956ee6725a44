"""Records of a search: the orbits found, the starts tried, and the whole result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True)
class Found:
    """One orbit that the search has found.

    Attributes
    ----------
    value
        Value of the parameter.
    orbit
        The orbit, with its true period.
    hits_settled
        Number of transients that settled on it.
    hits_newton
        Number of Newton iterations that ended on it.
    branch
        Index of the known branch on which it lies; None if it is new.
    """

    value: float
    orbit: Orbit
    hits_settled: int
    hits_newton: int
    branch: int | None = None

    @property
    def is_new(self) -> bool:
        """True if it lies on none of the known branches."""
        return self.branch is None


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts of the search at one value of the parameter.

    Attributes
    ----------
    value
        Value of the parameter.
    box : shape (2n,)
        Half-widths of the box of starts.
    starts, settled, ran_away
        Transients followed; those that settled on a periodic orbit; those that could not be followed.
    unsettled : shape (count, 2n)
        Last states of the transients that did not become periodic: tori, chaos, or slow decay.
    newton_starts
        Number of starts of Newton's method.
    """

    value: float
    box: NDArray[np.float64]
    starts: int
    settled: int
    ran_away: int
    unsettled: NDArray[np.float64]
    newton_starts: int

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.box.ndim != 1 or self.unsettled.ndim != 2 or self.unsettled.shape[1] != len(self.box):
            raise ValueError("the box of a search has another size than its states")


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes
    ----------
    parameter
        Name of the parameter.
    found
        The distinct orbits in the order of the values; at each value in the order of their periods, then of their
        hits.
    tallies
        Counts at each value.
    complete
        False if the search was stopped before its end.
    """

    parameter: str
    found: tuple[Found, ...]
    tallies: tuple[Tally, ...]
    complete: bool

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the parameter at which the search was made."""
        return tuple(tally.value for tally in self.tallies)

    @property
    def new(self) -> tuple[Found, ...]:
        """Orbits that lie on none of the known branches."""
        return tuple(each for each in self.found if each.is_new)

    def at(self, value: float) -> tuple[Found, ...]:
        """Return the orbits found at one value."""
        return tuple(each for each in self.found if each.value == value)

    def __repr__(self) -> str:
        stopped = "" if self.complete else ", stopped before its end"
        return (
            f"SearchResult({self.parameter} at {len(self.tallies)} values, {len(self.found)} orbits, "
            f"{len(self.new)} of them new{stopped})"
        )
