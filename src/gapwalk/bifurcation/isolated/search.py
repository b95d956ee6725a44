"""Search for isolated branches and other attractors: orbits at several values of a parameter, from many starts.

Each branch through an orbit found by a search is then followed once.

Method: docs/numerics/isolated-branches.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.orbit_catalogue import Catalogue, exact_orbit
from gapwalk.bifurcation.isolated.search_chunk import Catch, Chunk, PieceRunner, SerialRunner, search_chunk
from gapwalk.bifurcation.isolated.search_options import SearchOptions, spread_starts, state_box
from gapwalk.bifurcation.isolated.search_result import FoundOrbit, SearchResult, Tally
from gapwalk.bifurcation.membership import Curve
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit


class Progress(NamedTuple):
    """Progress of a search: pieces of work done, their total number, and the value and result of the last one."""

    done: int
    total: int
    value: float
    catch: Catch


@dataclass(frozen=True)
class Isolated:
    """Result of following the orbits of a search.

    Attributes
    ----------
    branches
        The new branches, in the order in which they were followed.
    lost
        Orbits from which no branch could be followed, each with the reason.
    complete
        False if the work was stopped before its end.
    """

    branches: tuple[Branch, ...]
    lost: tuple[tuple[FoundOrbit, str], ...]
    complete: bool


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

    If `stop` ends it between two pieces of work, the result holds the orbits found so far, and is not `complete`.

    Parameters
    ----------
    system
        The system.
    parameter
        Name of the parameter.
    values
        Its values.
    known
        Known branches along this parameter: orbits on them are not new.
    options
        Options of the search.
    workers
        Executor of the work; by default this process alone. ``with gw.parallel.local_workers() as workers:``
        uses all local cores. The result does not depend on it.
    report
        Called after each piece of work.
    stop
        Called between two pieces of work; True ends the search.

    Raises
    ------
    ModelError
        For an unknown parameter, a value that is not allowed, or inconsistent options.
    Interrupted
        After Ctrl-C; its `found` is the result so far, not `complete`.
    """
    chosen = [float(value) for value in dict.fromkeys(np.asarray(values, dtype=float).ravel().tolist())]
    if not chosen:
        raise ModelError("values is empty; name at least one value of the parameter at which to search")
    numbers = [number for number, branch in enumerate(known) if branch.parameter == parameter]
    curves = [Curve(known[number]) for number in numbers]
    chunks = [chunk for value in chosen for chunk in _chunks(system, parameter, value, curves, options)]
    catches: dict[int, Catch] = {}

    def keep(number: int, catch: Catch) -> None:
        catches[number] = catch
        if report is not None:
            report(Progress(len(catches), len(chunks), chunks[number].value, catch))

    try:
        (workers or SerialRunner()).run(search_chunk, chunks, keep, lambda _: stop is None or not stop())
    except KeyboardInterrupt:
        raise Interrupted(_result(parameter, chunks, catches, curves, numbers)) from None
    return _result(parameter, chunks, catches, curves, numbers)


def _chunks(
    system: System, parameter: str, value: float, curves: list[Curve], options: SearchOptions
) -> Iterator[Chunk]:
    """Yield the pieces of work at one value."""
    there = system.at({parameter: value})
    on_branches = (_exact(orbit) for curve in curves for orbit in curve.orbits_at(value))
    known = tuple(orbit for orbit in on_branches if orbit is not None)
    box = state_box(there, known, options.spread) if options.box is None else np.array(options.box, dtype=float)
    if box.shape != (2 * system.size,) or not np.all((box > 0.0) & (box < np.inf)):
        raise ModelError(f"box is {options.box!r}; it must be {2 * system.size} numbers > 0: half-widths of the box")
    starts = spread_starts(box, options.starts, options.seed, value)
    for block, first in enumerate(range(0, options.starts, options.block)):
        yield Chunk(value, block, there, box, starts[first : first + options.block], known, options)


def _exact(orbit: Orbit) -> Orbit | None:
    """Return an orbit of a known branch as shooting finds it; None if there is none near an orbit that is not exact."""
    return orbit if orbit.is_exact else exact_orbit(orbit.system, orbit.period, orbit.state)


def _result(
    parameter: str, chunks: list[Chunk], catches: dict[int, Catch], curves: list[Curve], numbers: list[int]
) -> SearchResult:
    """Return what the completed pieces of work have found."""
    found: list[FoundOrbit] = []
    tallies: list[Tally] = []
    for value in dict.fromkeys(chunk.value for chunk in chunks):
        done = [(chunk, catches[i]) for i, chunk in enumerate(chunks) if chunk.value == value and i in catches]
        if done:
            tallies.append(_tally(value, done))
            found += _merge(value, done, curves, numbers)
    return SearchResult(parameter, tuple(found), tuple(tallies), len(catches) == len(chunks))


def _tally(value: float, done: list[tuple[Chunk, Catch]]) -> Tally:
    """Return the counts at one value."""
    return Tally(
        value,
        done[0][0].box,
        sum(len(chunk.starts) for chunk, _ in done),
        sum(settled for _, catch in done for _, settled, _ in catch.orbits),
        sum(catch.ran_away for _, catch in done),
        np.concatenate([catch.unsettled for _, catch in done]),
        sum(catch.newton_starts for _, catch in done),
    )


def _merge(
    value: float, done: list[tuple[Chunk, Catch]], curves: list[Curve], numbers: list[int]
) -> Iterator[FoundOrbit]:
    """Yield the distinct orbits of all chunks at one value."""
    catalogue = Catalogue(done[0][0].box)
    for _, catch in done:
        for orbit, settled, newton in catch.orbits:
            entry = catalogue.add(orbit)
            entry.settled += settled
            entry.newton += newton
    for entry in sorted(catalogue.entries, key=lambda each: (each.orbit.period, -each.settled, -each.newton)):
        branch = next((n for n, curve in zip(numbers, curves, strict=True) if curve.holds(entry.orbit)), None)
        yield FoundOrbit(value, entry.orbit, entry.settled, entry.newton, branch)


def isolated(
    found: Iterable[FoundOrbit],
    parameter: str,
    to: tuple[float, float],
    *,
    known: Sequence[Branch] = (),
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Callable[[Branch], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Isolated:
    """Follow each orbit of a search that lies on no known branch and on no branch followed before it.

    Orbits on which most transients have settled come first.

    Parameters
    ----------
    found
        The orbits, as from `SearchResult.new`.
    parameter
        Name of the parameter.
    to
        The values between which the branches are followed, in both directions.
    known
        Branches along this parameter that have been followed already.
    walk, method
        Options of the walk and of the method.
    report
        Called with each new branch.
    stop
        Called before each new branch; True stops the work.

    Raises
    ------
    ModelError
        For an unknown parameter, or a range that does not contain an orbit.
    """
    curves = [Curve(branch) for branch in known if branch.parameter == parameter]
    branches: list[Branch] = []
    lost: list[tuple[FoundOrbit, str]] = []
    try:
        for each in sorted(found, key=lambda f: (not f.orbit.stable, -f.hits_settled, f.orbit.period)):
            if stop is not None and stop():
                return Isolated(tuple(branches), tuple(lost), False)
            if any(curve.holds(each.orbit) for curve in curves):
                continue
            try:
                branch = follow(each.orbit, parameter, to, walk=walk, method=method)
            except NumericalError as error:
                lost.append((each, str(error)))
                continue
            curves.append(Curve(branch))
            branches.append(branch)
            if report is not None:
                report(branch)
    except KeyboardInterrupt:
        raise Interrupted(Isolated(tuple(branches), tuple(lost), False)) from None
    return Isolated(tuple(branches), tuple(lost), True)
