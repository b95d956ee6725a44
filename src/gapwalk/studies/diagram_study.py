"""The study of a diagram: follow a branch, switch at every flip and branch point, and search for isolated branches.

A search tries many starts at some values of the parameter; what it finds on no known branch is followed in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge, Le

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import directions, start_branch, switch
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin, is_attached
from gapwalk.bifurcation.follow import walk_out
from gapwalk.bifurcation.isolated import Progress, SearchOptions, SearchResult, coverage, search
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.bounds import Bounded, Counted, check_fields
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.parallel.workers import Workers, do_by_groups
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.options import SEARCH_KEYS, BranchOptions, search_words, with_search
from gapwalk.studies.runner import call
from gapwalk.studies.study_kind import MAX_VALUES, Found, Work, check_values, found_by
from gapwalk.studies.study_schema import Start

if TYPE_CHECKING:
    from typing import Self

_VALUES = 60  # of the parameter, at which is searched by default

Report = Callable[[Diagram, DiagramBranch], None]
"""Called with the diagram and the branch that was added to it last."""


@dataclass(frozen=True, slots=True)
class DiagramOptions(Bounded):
    """Options of a diagram: its extent, and the search for isolated branches."""

    #: Longest period, in forcing periods, of branches to switch to.
    max_period: Annotated[int, Ge(1), Le(MAX_VALUES)] = 8
    #: Number of branches after which the diagram stops; a note then says so.
    max_branches: Annotated[int, Ge(1), Le(MAX_VALUES)] = 200
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)
    #: Values of the parameter at which branches not connected to others are sought. A number of them is spread evenly
    #: over the range; 0 for no search.
    search_values: int | tuple[float, ...] = 0
    search: SearchOptions = SearchOptions()  #: Options of the search.

    def __post_init__(self) -> None:
        check_fields(self)
        check_values("search_values", self.search_values, 0, "the parameter")


@dataclass(frozen=True)
class DiagramStudyOptions(DiagramOptions, BranchOptions):
    """A diagram: all branches that are attached to the first one, over one parameter, and those that a search finds.

    Each branch is included once: if it is found from both of its ends, it is walked from the first. Orbits that differ
    by a shift of whole forcing periods are the same orbit. The first orbit is looked for at the system's own value of
    the parameter.

    Raises
    ------
    ModelError
        For an unknown parameter or a range that does not contain the start.
    NumericalError
        If no first orbit is found, or no branch can be walked from it.

    Examples
    --------
    >>> tree = gw.diagram(system, "frequency", (0.6, 1.0), max_period=2)
    >>> [(member.name, member.period) for member in tree.members]
    [('P1-1', 1), ('P2-1', 2)]
    """

    kind: ClassVar[str] = "diagram"
    reports: ClassVar[str] = "branches"
    answer: ClassVar[Part | None] = Part("diagram", Diagram)  # made of its branches
    not_asked: ClassVar[tuple[str, ...]] = ("measure", "verify")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {
        "start": (
            str | Sequence[float] | Orbit,
            Start.SETTLE,
            "Start of the first branch: an orbit, its state, or as in `gapwalk.find_orbit`.",
        )
    }
    table_types: ClassVar[Mapping[str, Any]] = {**BranchOptions.table_types, **SEARCH_KEYS}

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table, with its search."""
        return super().of_table(with_search(values), system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return (
            f"{self.kind} over {self.range_words}, period {self.period}, showing {self.measure}, to period "
            f"{self.max_period}{search_words(self.search_values)}"
        )

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call; a start orbit stays in memory, its state is in the file."""
        orbit, rest = values.get("start"), {"measure": "", **values}
        if orbit is not None and not isinstance(orbit, Orbit | str):
            rest["start"] = tuple(float(each) for each in orbit)
        if isinstance(orbit, Orbit):
            rest |= {"start": tuple(orbit.state.tolist()), "period": orbit.period}
        asked = cls(**rest)
        if isinstance(orbit, Orbit):
            object.__setattr__(asked, "_orbit", orbit)
        return asked

    def system_of_call(self, system: System) -> System:
        """Return the system itself: the range may begin anywhere."""
        orbit = getattr(self, "_orbit", None)
        return system if orbit is None else orbit.system

    @property
    def limits(self) -> DiagramOptions:
        """The options without those of the first branch."""
        return DiagramOptions(**{each.name: getattr(self, each.name) for each in fields(DiagramOptions)})

    @classmethod
    def progress_words(cls, count: int, *news: Any) -> str:
        """Return the number of branches, and the last of them."""
        tree, member = news
        return f"{len(tree.members)} branches, last {member.name}"

    def work(self, system: System) -> DiagramWork:
        """Return the work on the diagram."""
        given, method = getattr(self, "_orbit", None), self.method.suited_to(system)

        def first() -> Orbit:
            return given or find_orbit(system, self.period, self.start, method=method)

        return DiagramWork(system, empty_diagram(self.parameter, self.ends), self, self.walk, method, first)

    def search_work(
        self, system: System, apart: Sequence[Branch], searching: Callable[[Progress], None] | None = None
    ) -> DiagramWork:
        """Return the work on branches that are not connected to known ones; see `gapwalk.find_others`.

        Parameters
        ----------
        system
            The system.
        apart
            Known branches.
        searching
            Called with the progress of the search.
        """
        known, method = empty_diagram(self.parameter, self.ends), self.method.suited_to(system)
        return DiagramWork(system, known, self, self.walk, method, apart=apart, searching=searching)


class DiagramState(NamedTuple):
    """State of a diagram, without its branches and its search, and whether no work is left."""

    diagram: Diagram
    finished: bool


BRANCH = Part("branch", DiagramBranch, numbered=True)
STATE = Part("diagram", DiagramState)
SEARCH = Part("search", SearchResult)


class DiagramWork(Work):
    """Computation of a diagram, generation by generation; each branch is stored as a whole when it is accepted.

    It reports the diagram so far, and the branch that was added last.
    """

    def __init__(
        self,
        system: System,
        known: Diagram,
        options: DiagramOptions,
        walk: WalkOptions | None = None,
        method: Method | None = None,
        first: Callable[[], Orbit] | None = None,
        *,
        apart: Sequence[Branch] = (),
        searching: Callable[[Progress], None] | None = None,
    ) -> None:
        self.system, self.options, self.walk, self.method = system, options, walk, method
        self.diagram, self.first, self.apart, self.searching = known, first, tuple(apart), searching
        self._finished = self._truncated = False
        self._kept: SearchResult | None = None  # the search that the file has
        self._tried: set[tuple[Origin, int]] = set()
        self._curves: list[Curve] = []

    def take(self, known: Parts) -> None:
        """Read the diagram of a file; raise a ValueError if it belongs to another study."""
        before = self.diagram
        self.diagram, self._finished = stored_diagram(known)
        self._kept = self.diagram.search
        if (self.diagram.parameter, self.diagram.within) != (before.parameter, before.within):
            raise ValueError("the diagram does not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find the branches that are not known yet."""
        # what could not be done before is tried again, and noted again
        self.diagram = replace(self.diagram, notes=(), failures=(), complete=False, max_period=self.options.max_period)
        for member in self._members(workers):
            entries = (BRANCH.entry(member, len(self.diagram.members) - 1), *self._state(finished=False))
            yield Found(entries, ((self.diagram, member),))
            self._kept = self.diagram.search  # only now: Ctrl-C may come before the file has it
        if self.first is not None and not self.diagram.members:
            raise NumericalError("; ".join(self.diagram.failures) or "no branch was found")
        self.diagram, self._finished = replace(self.diagram, complete=not self._truncated), True

    def last(self, *, finished: bool) -> Iterator[Entry]:
        """Yield the whole diagram, if there is anything."""
        if self.diagram.members or self.diagram.search is not None:
            yield from _branches(self.diagram)
            yield from self._state(finished=finished)

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield the branches, each with the diagram at the time when it was added."""
        for count, member in enumerate(self.diagram.members, start=1):
            yield replace(self.diagram, members=self.diagram.members[:count]), member

    @property
    def complete(self) -> bool:
        """True if no work is left, because everything was found or a limit was reached."""
        return self._finished

    @property
    def record(self) -> Diagram:
        """The diagram so far."""
        return self.diagram

    @property
    def done(self) -> int:
        """Number of branches."""
        return len(self.diagram.members)

    def _state(self, *, finished: bool) -> Iterator[Entry]:
        """Yield the whole diagram; include its search only if it is new, because it may be large."""
        yield STATE.entry(DiagramState(replace(self.diagram, members=(), search=None), finished))
        if self.diagram.search is not None and self.diagram.search is not self._kept:
            yield SEARCH.entry(self.diagram.search)

    @property
    def _known(self) -> tuple[Branch, ...]:
        """All known branches; those that do not belong to the diagram come first."""
        return (*self.apart, *self.diagram.branches)

    def _members(self, workers: Workers) -> Iterator[DiagramBranch]:
        """The branches, each when it has been added: those attached to the first one, and those that a search finds."""
        # If branches from a search are known already, then those attached to the first branch were found before them.
        # What was omitted then, such as a branch that could not be walked, must not depend on them.
        if self.first is None:
            yield from self._searched(self.system, workers)
            return
        members = self.diagram.members
        orbit = members[0].branch.points[0].orbit if members else self.first()
        directions(orbit.system[self.diagram.parameter], self.diagram.within)  # refuses a range without the start
        yield from self._plant([orbit], workers)
        yield from self._grow_from(self.diagram.members[:1], workers)
        if self.options.search_values and self.diagram.members and not self._truncated:
            yield from self._searched(orbit.system, workers)

    def _searched(self, system: System, workers: Workers) -> Iterator[DiagramBranch]:
        """Add the isolated branches, and all branches that begin on them."""
        # The search knows the branches that were found without it. Its result is kept with the first branch that it
        # leads to, so that a resumed diagram starts from the same orbits in the same order.
        result = self.diagram.search
        if result is None or not result.complete:
            result = found_by(
                search,
                system,
                self.diagram.parameter,
                self._search_values(),
                known=self._known,
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
        structure = self.system.structure
        if structure.place(self.diagram.parameter) == 0:  # nowhere else are the loads known
            low, high = max(low, structure.pace_limits.low), min(high, structure.pace_limits.high)
        return low + (high - low) * (np.arange(values) + 0.5) / values

    def _plant(self, orbits: Sequence[Orbit], workers: Workers) -> Iterator[DiagramBranch]:
        """Add the branches through orbits that the search has found."""

        def is_new(index: int) -> bool:
            self._curves += [Curve(branch) for branch in self._known[len(self._curves) :]]  # each is made once
            return not any(curve.holds(orbits[index]) for curve in self._curves) and not self._full()

        pieces, periods = [(orbit, 0) for orbit in orbits], [orbit.period for orbit in orbits]
        for _, branch in do_by_groups(self._walker, pieces, periods, is_new, workers):
            yield from self._accepted(branch, None)

    def _grow_from(self, roots: Sequence[DiagramBranch], workers: Workers) -> Iterator[DiagramBranch]:
        """Add all branches that begin on given ones, generation by generation."""
        generation = list(roots)
        while generation:
            yield from self._branch_off(generation, workers)
            names = {member.name for member in generation}
            generation = [member for member in self.diagram.members if member.begins and member.begins.parent in names]

    def _branch_off(self, generation: list[DiagramBranch], workers: Workers) -> Iterator[DiagramBranch]:
        """Walk away from every flip and branch point of one generation of branches."""
        buds = [
            (origin, special, way)
            for member in generation
            for index, special in enumerate(member.branch.special_points)
            if special.kind.times * member.period <= max(member.period, self.options.max_period)
            for way in range(special.ways)
            if ((origin := Origin(member.name, index)), way) not in self._tried
        ]
        self._tried.update((origin, way) for origin, _, way in buds)

        def is_new(index: int) -> bool:
            origin, special, _ = buds[index]
            return not is_attached(self.diagram, origin, special.ways) and not self._full()

        # a branch that leaves one flip mostly ends at another of its parent, from which it would be walked once more
        pieces, parents = [(special, way) for _, special, way in buds], [origin.parent for origin, _, _ in buds]
        for index, branch in do_by_groups(self._walker, pieces, parents, is_new, workers):
            # a branch that begins where a known one ends is that one if its middle lies on it
            if isinstance(branch, str) or not any(
                known.period == branch.period and lies_on(known, branch.points[len(branch.points) // 2].orbit)
                for known in self._known
            ):
                yield from self._accepted(branch, buds[index][0])

    @property
    def _walker(self) -> Callable[[tuple[Orbit | SpecialPoint, int]], Branch | str]:
        return partial(_walk_branch, self.diagram.parameter, self.diagram.within, self.walk, self.method)

    def _accepted(self, branch: Branch | str, origin: Origin | None) -> Iterator[DiagramBranch]:
        """Add a branch and yield it; if there is none, note the reason."""
        if isinstance(branch, str):
            # both directions of a branch fail for one reason
            self.diagram = replace(self.diagram, failures=tuple(dict.fromkeys((*self.diagram.failures, branch))))
            return
        self.diagram = self.diagram.with_branch(branch, origin, self.method)
        yield self.diagram.members[-1]

    def _full(self) -> bool:
        if len(self.diagram.members) < self.options.max_branches:
            return False
        if not self._truncated:
            self._truncated = True
            note = f"stopped at max_branches = {self.options.max_branches}; there are more"
            self.diagram = replace(self.diagram, notes=(*self.diagram.notes, note))
        return True


def _walk_branch(
    parameter: str,
    within: tuple[float, float],
    walk: WalkOptions | None,
    method: Method | None,
    piece: tuple[Orbit | SpecialPoint, int],
) -> Branch | str:
    """Walk one branch, in both directions from an orbit or in one from a special point; return a message on failure."""
    start, way = piece
    value = start.system[parameter] if isinstance(start, Orbit) else start.value
    try:
        if isinstance(start, Orbit):
            beginnings = [start_branch(start, parameter, within, each, method) for each in directions(value, within)]
        else:
            beginnings = [switch(start, parameter, within, method)[way]]
        return walk_out(beginnings, walk)
    except NumericalError as error:
        return f"the branch that leaves {value:.10g} could not be walked: {error}"


def whole_diagram(diagram: Diagram, *, finished: bool) -> Iterator[Entry]:
    """Yield the parts of a file that keep a whole diagram, except for its search."""
    yield from _branches(diagram)
    yield STATE.entry(DiagramState(replace(diagram, members=()), finished))


def _branches(diagram: Diagram) -> Iterator[Entry]:
    return (BRANCH.entry(member, number) for number, member in enumerate(diagram.members))


def stored_diagram(parts: Parts) -> DiagramState:
    """Return the diagram of a file; raise a ValueError if it is inconsistent."""
    members: list[DiagramBranch] = []
    for number, member in parts.all(BRANCH):
        known = {each.name: len(each.branch.special_points) for each in members}
        if number != len(members) or member.name in known:
            raise ValueError(f"branch {member.name:.60} is out of order in the file, or is stored twice")
        if any(not 0 <= origin.special < known.get(origin.parent, 0) for origin in member.origins):
            raise ValueError(f"branch {member.name} begins or ends at a special point that is not in the file")
        members.append(member)
    state = parts.one(STATE)
    diagram = replace(state.diagram, members=tuple(members), search=parts.get(SEARCH))
    if not members and diagram.search is None:  # which may have led to nothing new
        raise ValueError("it holds no branch")
    if diagram.max_period is not None and diagram.max_period < 1:
        raise ValueError(f"its longest period is {diagram.max_period}")
    return state._replace(diagram=diagram)


def empty_diagram(parameter: str, to: tuple[float, float]) -> Diagram:
    """Return a diagram without branches; the ends of the range may be given in either order."""
    low, high = sorted((float(to[0]), float(to[1])))
    return Diagram(parameter, (low, high))


def diagram_from(
    orbit: Orbit,
    parameter: str,
    to: tuple[float, float],
    options: DiagramOptions,
    walk: WalkOptions | None = None,
    method: Method | None = None,
) -> Diagram:
    """Return the diagram of the branches that are attached to the one through an orbit."""
    work = DiagramWork(orbit.system, empty_diagram(parameter, to), options, walk, method, lambda: orbit)
    return call(options, work, orbit.system).record


def find_others(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    known: Sequence[Branch] = (),
    search_values: int | tuple[float, ...] = _VALUES,
    workers: Workers | int | None = None,
    report: Report | None = None,
    **keywords: Any,
) -> Diagram:
    """Search for motions connected to no known branch, and follow all that is found.

    The `notes` of the diagram state what the search has covered and what it may have missed.

    Parameters
    ----------
    system
        The system; its value of the parameter does not matter.
    parameter, to
        Name of the parameter, and the range.
    known
        Branches along this parameter that have been followed already. They do not become part of the diagram.
    search_values
        Values of the parameter at which it searches, or their number.
    workers, report, keywords
        As in `diagram`: ``max_period``, ``max_branches``, ``search``, ``walk``, ``method``.

    Returns
    -------
    Diagram
        The branches that were found.

    Raises
    ------
    ModelError
        For an unknown parameter, a value that is not allowed, or no value at which to search.
    Interrupted
        After Ctrl-C; its `found` is the diagram so far.

    Notes
    -----
    The estimate of what was missed: Good (1953), Biometrika 40, 237-264.

    Examples
    --------
    >>> found = gw.find_others(system, "frequency", (1.25, 1.35), search_values=2)
    >>> found.notes[0]
    '48 starts at 2 values of frequency, 1.275 to 1.325: 48 settled on 3 periodic motions.'
    """
    if not search_values:
        raise ModelError("search_values is 0; say at how many values to search, as in search_values=60")
    begin, end = map(float, to)
    values = {"parameter": parameter, "begin": begin, "end": end, "search_values": search_values, **keywords}
    asked = DiagramStudyOptions.of_call({name: value for name, value in values.items() if value is not None}, system)
    asked.refuse_invalid(system)
    return call(asked, asked.search_work(system, known), system, workers=workers, report=report).record
