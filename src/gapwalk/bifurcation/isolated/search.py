"""Search for isolated branches and other attractors: orbits at several values of a parameter, from many starts.

Its result states what the search may have missed. N random starts all miss an attractor of basin share p with
probability ``(1 - p)^N``. The probability that the next start reaches a new attractor is about the share of starts that
reached an attractor that no other start reached (Good 1953, Biometrika 40, 237-264). Evenly spread starts, as those of
a search, cover the box better.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.isolated.search_starts import (
    Catalogue,
    Catch,
    Chunk,
    SearchOptions,
    exact_orbit,
    search_chunk,
    spread_starts,
    state_box,
    with_extensions,
)
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.pieces import workers_around


class Progress(NamedTuple):
    """Progress of a search: pieces of work done, their total number, and the value and result of the last one."""

    done: int
    total: int
    value: float
    catch: Catch


class PieceRunner(Protocol):
    """Executor of independent pieces of work in any processes; see `gapwalk.parallel.workers` for several cores."""

    def run(
        self,
        function: Callable[[Any], Any],
        pieces: Sequence[Any],
        accept: Callable[[int, Any], None],
        is_needed: Callable[[int], bool],
    ) -> None:
        """Apply a function, importable by its name, to each piece that is still needed when its turn comes."""
        # `accept` takes the number of each piece and its result, in this process.
        ...


_MANY = 500  # starts from which a search uses the batch integrator, which takes a second to compile, or to load
CONFIDENCE = 0.95
"""Probability with which an attractor of more than the given share would have been found."""


@dataclass(frozen=True)
class SearchResult:
    """Result of a search."""

    parameter: str  #: Name of the parameter.
    #: The distinct orbits in the order of the values; at each value in the order of their periods, then of their hits.
    found: tuple[FoundOrbit, ...]
    tallies: tuple[Tally, ...]  #: Counts at each value.
    complete: bool  #: False if the search was stopped before its end.

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
    """One orbit that the search has found."""

    value: float  #: Value of the parameter.
    orbit: Orbit  #: The orbit, with its true period.
    hits_settled: int  #: Number of transients that settled on it.
    hits_newton: int  #: Number of Newton iterations that ended on it.
    branch: int | None = None  #: Index of the known branch on which it lies; None if it is new.

    @property
    def is_new(self) -> bool:
        """True if it lies on none of the known branches."""
        return self.branch is None


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts of the search at one value of the parameter."""

    value: float  #: Value of the parameter.
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of starts.
    #: starts, settled, ran_away: Numbers of transients: all, those that settled on a periodic orbit, and those that
    #: could not be followed.
    starts: int
    settled: int
    ran_away: int
    #: shape (count, state_size): Last states of the transients that did not become periodic: tori, chaos, or slow
    #: decay.
    unsettled: NDArray[np.float64]
    newton_starts: int  #: Number of starts of Newton's method.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.box.ndim != 1 or self.unsettled.ndim != 2 or self.unsettled.shape[1] != len(self.box):
            raise ValueError("the box of a search has another size than its states")


def search(
    system: System,
    parameter: str,
    values: Sequence[float] | NDArray[np.float64],
    *,
    known: Sequence[Branch] = (),
    options: SearchOptions = SearchOptions(),
    workers: PieceRunner | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> SearchResult:
    """Search for periodic orbits at several values of a parameter, from many starts.

    If `stop` ends the search early, the result holds the orbits found so far, and its field `complete` is False.

    Parameters
    ----------
    system
        The system.
    parameter
        Name of the parameter.
    values
        The values of the parameter.
    known
        Known branches along this parameter; orbits on them do not count as new.
    options
        Options of the search.
    workers
        Executor of the work; by default that of a `with` block of `gapwalk.parallel.on_cores` or
        `gapwalk.parallel.on_cluster` around the call, otherwise this process. The result is the same.
    report
        Called after each piece of work: a number of starts at one value.
    stop
        Called between two pieces of work; the search ends if it returns True.

    Returns
    -------
    SearchResult
        The distinct orbits at each value.

    Raises
    ------
    ModelError
        For an unknown parameter, a value that is not allowed, or inconsistent options.
    Interrupted
        After Ctrl-C; the field `found` of the error is the result so far.

    Examples
    --------
    >>> options = gw.SearchOptions(starts=8, newton_starts=4)
    >>> found = gw.search(system, "frequency", [1.3], known=[branch], options=options)
    >>> len(found.found), len(found.new)  # all lie on the branch
    (3, 0)
    """
    chosen = [float(value) for value in dict.fromkeys(np.asarray(values, dtype=float).ravel().tolist())]
    if not chosen:
        raise ModelError("values is empty; name at least one value of the parameter at which to search")
    numbers = [number for number, branch in enumerate(known) if branch.parameter == parameter]
    curves = [Curve(known[number]) for number in numbers]
    many = len(chosen) * options.starts >= _MANY
    chunks = [chunk for value in chosen for chunk in _chunks(system, parameter, value, curves, options, many)]
    catches: dict[int, Catch] = {}

    def keep(number: int, catch: Catch) -> None:
        catches[number] = catch
        if report is not None:
            report(Progress(len(catches), len(chunks), chunks[number].value, catch))

    try:
        (workers or workers_around()).run(search_chunk, chunks, keep, lambda _: stop is None or not stop())
    except KeyboardInterrupt:
        raise Interrupted(_result(parameter, chunks, catches, curves, numbers)) from None
    return _result(parameter, chunks, catches, curves, numbers)


def _chunks(
    system: System, parameter: str, value: float, curves: list[Curve], options: SearchOptions, many: bool
) -> Iterator[Chunk]:
    """Yield the pieces of work at one value."""
    there = system.at({parameter: value})
    on_branches = (orbit for curve in curves for orbit in curve.orbits_at(value))
    exact = (each if each.is_exact else exact_orbit(each.system, each.period, each.state) for each in on_branches)
    known = tuple(orbit for orbit in exact if orbit is not None)  # none may be near an orbit that is not exact
    box = state_box(there, known, options.spread) if options.box is None else np.array(options.box, dtype=float)
    if box.shape != (2 * system.size,) or not np.all((box > 0.0) & (box < np.inf)):
        raise ModelError(f"box is {options.box!r}; it must be {2 * system.size} numbers > 0: half-widths of the box")
    starts = spread_starts([there], box, options.starts, options.seed, value)
    box = with_extensions(there, box)
    for block, first in enumerate(range(0, options.starts, options.block)):
        yield Chunk(value, block, there, box, starts[first : first + options.block], known, options, many)


def _result(
    parameter: str, chunks: list[Chunk], catches: dict[int, Catch], curves: list[Curve], numbers: list[int]
) -> SearchResult:
    """Return the result of the completed pieces of work."""
    found: list[FoundOrbit] = []
    tallies: list[Tally] = []
    for value in dict.fromkeys(chunk.value for chunk in chunks):
        done = [(chunk, catches[i]) for i, chunk in enumerate(chunks) if chunk.value == value and i in catches]
        if not done:
            continue
        catalogue = Catalogue(done[0][0].box)
        for _, catch in done:
            for orbit, settled, newton in catch.orbits:
                entry = catalogue.add(orbit)
                entry.settled += settled
                entry.newton += newton
        for entry in sorted(catalogue.entries, key=lambda each: (each.orbit.period, -each.settled, -each.newton)):
            branch = next((n for n, curve in zip(numbers, curves, strict=True) if curve.holds(entry.orbit)), None)
            found.append(FoundOrbit(value, entry.orbit, entry.settled, entry.newton, branch))
        tallies.append(
            Tally(
                value,
                catalogue.scales,
                sum(len(chunk.starts) for chunk, _ in done),
                sum(settled for _, catch in done for _, settled, _ in catch.orbits),
                sum(catch.ran_away for _, catch in done),
                np.concatenate([catch.unsettled for _, catch in done]),
                sum(catch.newton_starts for _, catch in done),
            )
        )
    return SearchResult(parameter, tuple(found), tuple(tallies), len(catches) == len(chunks))


def coverage(result: SearchResult) -> tuple[str, ...]:
    """Return sentences on what a search has covered, and what it may have missed."""
    return tuple(_sentences(result)) if result.tallies else ("The search was stopped before its first start.",)


def _sentences(result: SearchResult) -> Iterator[str]:
    tallies, low, high = result.tallies, min(result.values), max(result.values)
    if not result.complete:
        yield "The search was stopped before its end."
    where = f"at {len(tallies)} values of {result.parameter}, {low:.6g} to {high:.6g}"
    if len(tallies) == 1:
        where = f"at {result.parameter} = {low:.6g}"
    starts, settled = sum(tally.starts for tally in tallies), sum(tally.settled for tally in tallies)
    hits = sorted(each.hits_settled for each in result.found if each.hits_settled)
    yield f"{starts} starts {where}: {settled} settled on {_count(len(hits), 'periodic motion')}."
    if len(tallies) > 1:
        width = float(np.diff(np.sort(result.values)).max())
        yield f"An isolated branch narrower than {width:.2g} in {result.parameter} may lie between two values."
    if len(hits) == 1:
        yield f"All {hits[0]} settled on the same motion."
    elif hits:
        yield f"Each motion was reached from {hits[0]} to {hits[-1]} starts (median {hits[(len(hits) - 1) // 2]})."
    unsettled = [tally for tally in tallies if len(tally.unsettled)]
    if unsettled:
        count, places = sum(len(tally.unsettled) for tally in unsettled), [f"{tally.value:.6g}" for tally in unsettled]
        yield f"{count} motions did not become periodic (quasi-periodic, chaotic, or slow), at {', '.join(places)}."
    if ran_away := sum(tally.ran_away for tally in tallies):
        yield f"{ran_away} motions could not be followed: they diverged, or chattered without end."
    yield _unseen(tallies)
    if settled:
        yield (
            f"{_count(hits.count(1), 'motion')} had one start only: one more start would settle on an unseen motion "
            f"with a probability of about {100 * next_is_new(result):.2g} %."
        )
    yield (
        f"Newton's method, from {sum(tally.newton_starts for tally in tallies)} states, found "
        f"{_count(len(result.found) - len(hits), 'orbit')} more on which no start settled; for unstable orbits no "
        "bound can be given."
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _unseen(tallies: tuple[Tally, ...]) -> str:
    """Return the bound on the basin of an unseen attractor."""
    shares = np.array([unseen_share(tally.settled) for tally in tallies])
    if not np.any(shares < 1.0):
        return "As no start settled, nothing can be said about unseen attractors."
    text = (
        f"An unseen periodic attractor fills, with {100 * CONFIDENCE:.0f} % confidence, less than "
        f"{100 * shares.min():.2g} % of the box of starts"
    )
    if shares.max() > 1.01 * shares.min():
        bound = f"less than {100 * shares.max():.2g} %" if shares.max() < 1.0 else "nothing can be said"
        return f"{text} at the value with most settled starts; at {tallies[int(np.argmax(shares))].value:.6g}, {bound}."
    return f"{text}." if len(tallies) == 1 else f"{text} at any of these values."


def unseen_share(settled: int, confidence: float = CONFIDENCE) -> float:
    """Return the largest share of the box of starts that the basin of an unseen attractor may fill."""
    return 1.0 if settled == 0 else 1.0 - (1.0 - confidence) ** (1.0 / settled)


def next_is_new(result: SearchResult) -> float:
    """Return the Good-Turing estimate of the probability that one more start settles on a new orbit."""
    settled = sum(tally.settled for tally in result.tallies)
    singletons = sum(each.hits_settled == 1 for each in result.found)
    return 1.0 if settled == 0 else singletons / settled
