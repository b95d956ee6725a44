"""The whole diagram: follow a branch, switch at every flip and branch point, and search for isolated branches.

A search tries many starts at some values of the parameter; what it finds on no known branch is followed in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.branch_start import directions, start_branch
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin, is_attached
from gapwalk.bifurcation.follow import walk_out
from gapwalk.bifurcation.isolated import Progress, SearchOptions, coverage, search
from gapwalk.bifurcation.membership import Curve, lies_on
from gapwalk.bifurcation.switch import switch
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.parallel.workers import Workers, local_workers
from gapwalk.studies.kind import found_by
from gapwalk.studies.kinds import Counted

_MOST = 100_000  # of any count

Report = Callable[[Diagram, DiagramBranch], None]
"""Called with the diagram and the branch that was added to it last."""


@dataclass(frozen=True, slots=True)
class DiagramOptions:
    """How far a diagram goes.

    Parameters
    ----------
    max_period
        Longest period, in forcing periods, of branches to switch to.
    max_branches
        Branches after which it stops, and says so.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    search_values
        Values of the parameter at which branches not connected to others are sought. A number of them is
        spread evenly over the range; 0 for no search.
    search
        How thoroughly to search there.
    """

    max_period: int = 8
    max_branches: int = 200
    workers: Counted | None = field(default=None, compare=False)
    search_values: int | tuple[float, ...] = 0
    search: SearchOptions = SearchOptions()

    def __post_init__(self) -> None:
        for name in ("max_period", "max_branches"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= _MOST:
                raise ModelError(f"{name} is {value!r}; it must be an integer from 1 to {_MOST:,}")
        check_search_values(self.search_values)


def check_search_values(values: object) -> None:
    """A ModelError unless these can be the `search_values` of `DiagramOptions`."""
    if isinstance(values, tuple):
        if all(isinstance(value, float | int) and np.isfinite(value) for value in values):
            return
    elif isinstance(values, int) and not isinstance(values, bool) and 0 <= values <= _MOST:
        return
    raise ModelError(
        f"search_values is {values!r}; it must be an integer from 0 to {_MOST:,}, or values of the parameter"
    )


class Growth(NamedTuple):
    """A diagram, and whether nothing is left to do, because it is complete or at a limit."""

    diagram: Diagram
    finished: bool

    @property
    def whole(self) -> Diagram:
        """The diagram; Interrupted, with the diagram, after Ctrl-C."""
        if not self.finished:
            raise Interrupted(self.diagram)
        return self.diagram


@dataclass(frozen=True)
class _Piece:
    """One branch to walk, from an orbit (both ways) or from a special point (one way)."""

    start: Orbit | SpecialPoint
    parameter: str
    within: tuple[float, float]
    way: int
    walk: WalkOptions | None
    method: Method | None


@shows_progress(lambda count, diagram, member: f"{len(diagram.members)} branches, last {member.name}")
def diagram(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    start: str | Orbit | Sequence[float] = "settle",
    period: int = 1,
    options: DiagramOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
) -> Diagram:
    """The tree of branches over a range of one parameter: P1, P2, P4, ... to the longest period asked for.

    Each branch comes once: one that is met from both of its ends is walked from the first, and orbits that differ by a
    shift of whole forcing periods are the same orbit.

    Parameters
    ----------
    system
        The system; the first orbit is sought at its value of the parameter.
    parameter, to
        Name of the parameter, and the range.
    start, period
        Where the first branch starts: an orbit, or as in `find_orbit`.
    options, walk, method
        How far the diagram goes; options of the walk and of the method.
    report
        Called with each branch as it is accepted.
    resume
        A diagram of the same request that was stopped: its branches are kept, and the rest is added.

    Raises
    ------
    ModelError
        For an unknown parameter or a range that does not hold the start.
    ConvergenceError
        If no first orbit is found.
    Interrupted
        After Ctrl-C; its `found` is the diagram as far as it has come, from which `resume` goes on.
    """
    orbit = start if isinstance(start, Orbit) else find_orbit(system, period, start, method=method)
    return grow(orbit, parameter, to, options, walk, method, report, resume).whole


def empty_diagram(parameter: str, to: tuple[float, float]) -> Diagram:
    """A diagram without branches yet; the range may be given either way round."""
    low, high = sorted((float(to[0]), float(to[1])))
    return Diagram(parameter, (low, high))


def grow(
    orbit: Orbit,
    parameter: str,
    to: tuple[float, float],
    options: DiagramOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
) -> Growth:
    """The diagram from a first orbit, and whether it is finished; parameters and errors as in `diagram`."""
    options = options or DiagramOptions()
    known = resume or empty_diagram(parameter, to)
    directions(orbit.system[parameter], known.within)  # refuses a range that does not hold the start
    grower = Grower(known, options, walk, method, report)

    return grower.grow(lambda workers: grower.from_orbit(orbit, workers))


class Grower:
    """Grows one diagram, generation by generation.

    Parameters
    ----------
    known
        What there is of it already.
    options, walk, method, report
        As in `diagram`.
    apart
        Branches that are known and do not belong to it: what lies on one of them is not added.
    searching
        Called with the progress of a search.
    """

    def __init__(
        self,
        known: Diagram,
        options: DiagramOptions,
        walk: WalkOptions | None = None,
        method: Method | None = None,
        report: Report | None = None,
        apart: Sequence[Branch] = (),
        searching: Callable[[Progress], None] | None = None,
    ) -> None:
        # what could not be done before is tried again, and noted again
        self.diagram = replace(known, notes=(), failures=(), complete=False, max_period=options.max_period)
        self.options, self.walk, self.method = options, walk, method
        self.report, self.apart, self.searching = report, tuple(apart), searching
        self.truncated = False
        self._tried: set[tuple[Origin, int]] = set()
        self._curves: list[Curve] = []

    @property
    def branches(self) -> tuple[Branch, ...]:
        """All branches that are known, those apart first."""
        return (*self.apart, *self.diagram.branches)

    def grow(self, members: Callable[[Workers], Iterator[DiagramBranch]]) -> Growth:
        """Let all branches come with many workers; Ctrl-C ends that, and keeps what there is."""
        try:
            with local_workers(self.options.workers) as workers:
                for member in members(workers):
                    if self.report is not None:
                        self.report(self.diagram, member)
        except KeyboardInterrupt:
            return Growth(self.diagram, finished=False)
        return Growth(self.whole, finished=True)

    @property
    def whole(self) -> Diagram:
        """The diagram when nothing is left to do."""
        return replace(self.diagram, complete=not self.truncated)

    def from_orbit(self, orbit: Orbit, workers: Workers) -> Iterator[DiagramBranch]:
        """All branches, each when it has been added: those attached to the first one, and those that a search finds."""
        yield from self.plant_first(orbit, workers)
        if self.options.search_values and self.diagram.members and not self.truncated:
            yield from self.search(orbit.system, workers)

    def plant_first(self, orbit: Orbit, workers: Workers) -> Iterator[DiagramBranch]:
        """Add the branch through the first orbit, and all that grows from it.

        If branches are known that a search has found, then this was done before them; what it leaves out, such as a
        branch that could not be walked, must not depend on them.
        """
        yield from self._plant([orbit], workers)
        yield from self._grow_from(self.diagram.members[:1], workers)

    def search(self, system: System, workers: Workers) -> Iterator[DiagramBranch]:
        """Add the branches connected to no other, with all that grows from them.

        The search knows the branches that were found without it. Its result is kept with the first branch that it
        leads to, so that a diagram that is resumed plants the same orbits in the same order.
        """
        result = self.diagram.search
        if result is None or not result.complete:
            result = found_by(
                search,
                system,
                self.diagram.parameter,
                self._search_values(),
                known=self.branches,
                options=self.options.search,
                workers=workers,
                report=self.searching,
            )
        notes = (*self.diagram.notes, *coverage(result))
        self.diagram = replace(self.diagram, search=result, notes=notes)
        if not result.complete:
            raise KeyboardInterrupt
        new = sorted(result.new, key=lambda found: (not found.orbit.stable, -found.hits_settled, found.orbit.period))
        yield from self._plant([found.orbit for found in new if found.orbit.period <= self.options.max_period], workers)
        yield from self._grow_from([member for member in self.diagram.members if member.begins is None], workers)

    def _search_values(self) -> np.ndarray:
        values = self.options.search_values
        if isinstance(values, tuple):
            return np.array(values, dtype=float)
        low, high = self.diagram.within
        return low + (high - low) * (np.arange(values) + 0.5) / values

    def _plant(self, orbits: Sequence[Orbit], workers: Workers) -> Iterator[DiagramBranch]:
        """Add the branches through orbits that were found by themselves."""
        pieces = [self._piece(orbit, 0) for orbit in orbits]

        def is_new(index: int) -> bool:
            return not any(curve.holds(orbits[index]) for curve in self._all_curves()) and not self._full()

        for _, branch in workers.each(_walk_piece, pieces, is_new):
            yield from self._accepted(branch, None)

    def _grow_from(self, roots: Sequence[DiagramBranch], workers: Workers) -> Iterator[DiagramBranch]:
        """Add all that grows from some branches, generation by generation."""
        generation = list(roots)
        while generation:
            yield from self._branch_off(generation, workers)
            names = {member.name for member in generation}
            generation = [member for member in self.diagram.members if member.begins and member.begins.parent in names]

    def _branch_off(self, generation: list[DiagramBranch], workers: Workers) -> Iterator[DiagramBranch]:
        """Walk away from every flip and branch point of one generation of branches."""
        buds = [bud for member in generation for bud in _buds(member, self.options.max_period)]
        buds = [bud for bud in buds if (bud[0], bud[2]) not in self._tried]
        self._tried.update((origin, way) for origin, _, way in buds)
        pieces = [self._piece(special, way) for _, special, way in buds]

        def is_new(index: int) -> bool:
            origin, special, _ = buds[index]
            return not is_attached(self.diagram, origin, special.kind.ways) and not self._full()

        for index, branch in workers.each(_walk_piece, pieces, is_new):
            if isinstance(branch, str) or not any(_is_same_branch(known, branch) for known in self.branches):
                yield from self._accepted(branch, buds[index][0])

    def _accepted(self, branch: Branch | str, origin: Origin | None) -> Iterator[DiagramBranch]:
        """The branch when it has been added; nothing where there is none, which is noted."""
        if isinstance(branch, str):
            self.diagram = replace(self.diagram, failures=(*self.diagram.failures, branch))
            return
        self.diagram = self.diagram.with_branch(branch, origin, self.method)
        yield self.diagram.members[-1]

    def _all_curves(self) -> list[Curve]:
        """The branches as curves, each made once."""
        self._curves += [Curve(branch) for branch in self.branches[len(self._curves) :]]
        return self._curves

    def _full(self) -> bool:
        if len(self.diagram.members) < self.options.max_branches:
            return False
        if not self.truncated:
            self.truncated = True
            note = f"stopped at max_branches = {self.options.max_branches}; there are more"
            self.diagram = replace(self.diagram, notes=(*self.diagram.notes, note))
        return True

    def _piece(self, start: Orbit | SpecialPoint, way: int) -> _Piece:
        return _Piece(start, self.diagram.parameter, self.diagram.within, way, self.walk, self.method)


def _buds(member: DiagramBranch, max_period: int) -> list[tuple[Origin, SpecialPoint, int]]:
    """The special points of a branch from which others leave, and which of their directions."""
    buds = []
    for index, special in enumerate(member.branch.special_points):
        if special.kind.times * member.period <= max(member.period, max_period):
            buds += [(Origin(member.name, index), special, way) for way in range(special.kind.ways)]
    return buds


def _walk_piece(piece: _Piece) -> Branch | str:
    """Walk one branch; a sentence instead if that cannot be done."""
    try:
        if isinstance(piece.start, Orbit):
            start = piece.start.system[piece.parameter]
            ways = directions(start, piece.within)
            beginnings = [start_branch(piece.start, piece.parameter, piece.within, way, piece.method) for way in ways]
        else:
            beginnings = [switch(piece.start, piece.parameter, piece.within, piece.method)[piece.way]]
        return walk_out(beginnings, piece.walk)
    except NumericalError as error:
        value = piece.start.value if isinstance(piece.start, SpecialPoint) else piece.start.system[piece.parameter]
        return f"the branch that leaves {value:.10g} could not be walked: {error}"


def _is_same_branch(known: Branch, branch: Branch) -> bool:
    """Whether a branch is one that is known: it begins where that ends, and its middle lies on it."""
    return known.period == branch.period and lies_on(known, branch.points[len(branch.points) // 2].orbit)


_VALUES = 60  # of the parameter, at which is searched by default


def find_others(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    known: Sequence[Branch] = (),
    options: DiagramOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
) -> Diagram:
    """Search for motions connected to no known branch, and follow all that is found.

    What the search has covered, and what it may have missed, is in the `notes` of the diagram.

    Parameters
    ----------
    system
        The system; its value of the parameter does not matter.
    parameter, to
        Name of the parameter, and the range.
    known
        Branches along this parameter that have been followed already. They do not become part of the diagram.
    options
        How far it goes; `search_values` are where it searches, by default 60 values.
    walk, method, report, resume
        As in `diagram`.

    Raises
    ------
    ModelError
        For an unknown parameter, a value that is not allowed, or no value at which to search.
    Interrupted
        After Ctrl-C; its `found` is the diagram as far as it has come, from which `resume` goes on.
    """
    options = options or DiagramOptions(search_values=_VALUES)
    return grow_others(system, parameter, to, known, options, walk, method, report, resume).whole


def grow_others(
    system: System,
    parameter: str,
    to: tuple[float, float],
    known: Sequence[Branch],
    options: DiagramOptions,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
    searching: Callable[[Progress], None] | None = None,
) -> Growth:
    """The diagram, and whether it is finished; as `find_others`, which can tell the progress of its search."""
    if not options.search_values:
        raise ModelError("search_values is 0; say at how many values to search, as in DiagramOptions(search_values=60)")
    for bound in to:
        system.at({parameter: bound})
    grower = Grower(resume or empty_diagram(parameter, to), options, walk, method, report, known, searching)
    return grower.grow(lambda workers: grower.search(system, workers))
