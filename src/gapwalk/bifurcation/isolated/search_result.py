"""Records of a search: the orbits found, the starts tried, and bounds on what the search may have missed.

N random starts all miss an attractor of basin share p with probability ``(1 - p)^N``. The probability that the next
start reaches a new attractor is about the share of starts that reached an attractor that no other start reached (Good
1953, Biometrika 40, 237-264). Evenly spread starts, as those of a search, cover the box better.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.orbit import Orbit

CONFIDENCE = 0.95
"""Probability with which an attractor of more than the given share would have been found."""


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
    found: tuple[FoundOrbit, ...]
    tallies: tuple[Tally, ...]
    complete: bool

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the parameter at which the search was made."""
        return tuple(tally.value for tally in self.tallies)

    @property
    def new(self) -> tuple[FoundOrbit, ...]:
        """Orbits that lie on none of the known branches."""
        return tuple(each for each in self.found if each.is_new)

    def at(self, value: float) -> tuple[FoundOrbit, ...]:
        """Return the orbits found at one value."""
        return tuple(each for each in self.found if each.value == value)

    def __repr__(self) -> str:
        stopped = "" if self.complete else ", stopped before its end"
        return (
            f"SearchResult({self.parameter} at {len(self.tallies)} values, {len(self.found)} orbits, "
            f"{len(self.new)} of them new{stopped})"
        )


@dataclass(frozen=True)
class FoundOrbit:
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
        """Raise a ValueError if its parts do not fit together."""
        if self.box.ndim != 1 or self.unsettled.ndim != 2 or self.unsettled.shape[1] != len(self.box):
            raise ValueError("the box of a search has another size than its states")


def coverage(result: SearchResult) -> tuple[str, ...]:
    """Return sentences on what a search has covered, and what it may have missed."""
    return tuple(_sentences(result))


def _sentences(result: SearchResult) -> Iterator[str]:
    tallies = result.tallies
    if not tallies:
        yield "The search was stopped before its first start."
        return
    if not result.complete:
        yield "The search was stopped before its end."
    starts, settled = sum(tally.starts for tally in tallies), sum(tally.settled for tally in tallies)
    attractors = sum(each.hits_settled > 0 for each in result.found)
    low, high = min(result.values), max(result.values)
    where = f"at {len(tallies)} values of {result.parameter}, {low:.6g} to {high:.6g}"
    if len(tallies) == 1:
        where = f"at {result.parameter} = {low:.6g}"
    yield f"{starts} starts {where}: {settled} settled on {_count(attractors, 'periodic motion')}."
    yield from _between(result)
    yield from _hits(result)
    yield from _not_periodic(tallies)
    yield _unseen(tallies)
    if settled:
        once = _count(sum(each.hits_settled == 1 for each in result.found), "motion")
        chance = f"{100 * next_is_new(result):.2g} %"
        yield (
            f"{once} had one start only: one more start would settle on a new motion with a probability of about "
            f"{chance}."
        )
    unstable = sum(each.hits_settled == 0 for each in result.found)
    yield (
        f"Newton's method, from {sum(tally.newton_starts for tally in tallies)} states, found "
        f"{_count(unstable, 'orbit')} more on which no start settled; for unstable orbits no bound can be given."
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _between(result: SearchResult) -> Iterator[str]:
    """Yield what may lie between the values."""
    if len(result.values) > 1:
        width = float(np.diff(np.sort(result.values)).max())
        yield f"An isolated branch narrower than {width:.2g} in {result.parameter} may lie between two values."


def _hits(result: SearchResult) -> Iterator[str]:
    """Yield how many starts settled on each motion."""
    settled = sorted(each.hits_settled for each in result.found if each.hits_settled)
    if len(settled) == 1:
        yield f"All {settled[0]} settled on the same motion."
    elif settled:
        yield (
            f"The starts per motion number {settled[0]} to {settled[-1]}, "
            f"with a median of {settled[(len(settled) - 1) // 2]}."
        )


def _not_periodic(tallies: tuple[Tally, ...]) -> Iterator[str]:
    unsettled = [tally for tally in tallies if len(tally.unsettled)]
    if unsettled:
        count = sum(len(tally.unsettled) for tally in unsettled)
        places = ", ".join(f"{tally.value:.6g}" for tally in unsettled)
        yield f"{count} did not become periodic (quasi-periodic, chaotic, or very slow), at {places}."
    ran_away = sum(tally.ran_away for tally in tallies)
    if ran_away:
        yield f"{ran_away} could not be followed: they diverged, or their contacts chattered."


def _unseen(tallies: tuple[Tally, ...]) -> str:
    """Return the bound on the basin of an unseen attractor."""
    shares = np.array([unseen_share(tally.settled) for tally in tallies])
    worst = tallies[int(np.argmax(shares))]
    percent = f"{100 * CONFIDENCE:.0f} %"
    if not np.any(shares < 1.0):
        return "As no start settled, nothing can be said about unseen attractors."
    text = (
        f"An unseen periodic attractor fills, with {percent} confidence, less than {100 * shares.min():.2g} % of "
        "the box of starts"
    )
    if shares.max() > 1.01 * shares.min():
        bound = f"less than {100 * shares.max():.2g} %" if shares.max() < 1.0 else "nothing can be said"
        return f"{text} at the best value, and at the worst, {worst.value:.6g}, {bound}."
    return f"{text}." if len(tallies) == 1 else f"{text} at any of these values."


def unseen_share(settled: int, confidence: float = CONFIDENCE) -> float:
    """Return the largest share of the box of starts that the basin of an unseen attractor may fill.

    Parameters
    ----------
    settled
        Number N of starts that settled.
    confidence
        Probability with which an attractor of a larger share would have been found.
    """
    return 1.0 if settled == 0 else 1.0 - (1.0 - confidence) ** (1.0 / settled)


def next_is_new(result: SearchResult) -> float:
    """Return the Good-Turing estimate of the probability that one more start settles on a new orbit."""
    settled = sum(tally.settled for tally in result.tallies)
    singletons = sum(each.hits_settled == 1 for each in result.found)
    return 1.0 if settled == 0 else singletons / settled
