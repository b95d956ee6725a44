"""The study of a map: all loci that bound regimes in the plane of two parameters.

Branches are followed at some values of the second parameter, then the loci of their special points.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from pydantic import AfterValidator, ValidationInfo

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.bifurcation.loci import Locus, follow_locus
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.model.bounds import Counted
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import phases
from gapwalk.orbit.shooting import Shooting
from gapwalk.parallel.workers import Outcome, Workers, outcomes
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.bifurcation_map import Map, MapSection, Ranges, Which
from gapwalk.studies.diagram_study import DiagramOptions, diagram_from
from gapwalk.studies.options import (
    SEARCH_KEYS,
    BranchOptions,
    ParameterRange,
    Second,
    kinds_key,
    search_words,
    with_search,
)
from gapwalk.studies.study_kind import MAX_VALUES, Found, Work, check_values
from gapwalk.studies.study_schema import (
    PARAMETERS,
    CountOrValues,
    Surroundings,
    check_inside,
    check_parameters,
    check_range,
    key_type,
)

if TYPE_CHECKING:
    from typing import Self


# The pieces of a map in the order in which they begin: its sections, then its loci, hardly any of which is done twice.
#
# Method: docs/numerics/notes/special-points.md

_BESIDE = 4e-3  # distance from a locus, in widths of the ranges, within which a special point may lie on it
_ALIKE = 0.1  # relative distance of two orbits' states within which they may belong to the same locus

Family = tuple[Kind, int, str]
"""Kind, period and contact: special points that differ in one of them never lie on the same locus."""


@dataclass(frozen=True)
class _Start:
    """A special point at which a locus may begin: the number of its section, the value there, and the point."""

    section: int
    value: float
    special: SpecialPoint

    @property
    def family(self) -> Family:
        return self.special.kind, self.special.orbit.period, self.special.contact


class MapQueue(Sequence[tuple[bool, Any]]):
    """Pieces of a map: True and the system of a section, or False and a special point whose locus is to be followed.

    A special point that lies on the locus of an earlier one begins none. So a locus is begun only when all earlier
    points of its family are decided; while they are not, whoever is free follows loci of other families. Points that
    may prove superfluous are followed only while a single family is left, on the section of its first point: a locus
    seldom crosses a section twice, except that it often connects two points. What is found is the same, in the same
    order, however many pieces are in progress.
    """

    def __init__(self, systems: Sequence[System], width: float, loci: Iterable[Locus] = (), tried: int = 0) -> None:
        self._systems, self._width, self._loci, self._tried = systems, width, list(loci), tried
        self._begun: list[tuple[bool, int]] = []
        self._walks = self._walked = 0  # sections that were begun, and those that were handed on
        self._walked_early: dict[int, Any] = {}
        self._starts: list[_Start] = []
        self._undecided: dict[Family, list[int]] = {}
        self._in_work: set[int] = set()
        self._followed: dict[int, Outcome] = {}  # before their turn in the family
        self._decided: dict[int, Locus | str | None] = {}  # before their turn among all; None for superfluous points

    def __len__(self) -> int:
        """Number of the pieces that were begun, and of those that can begin now."""
        return len(self._begun) + len(self._systems) - self._walks + len(self._ready())

    def __getitem__(self, number: Any) -> Any:
        if number == len(self._begun):
            self._begin()
        is_section, place = self._begun[number]
        return is_section, self._systems[place] if is_section else self._starts[place].special

    def take(self, number: int, outcome: Outcome) -> None:
        """Take the outcome of a piece: what was found on a section, or a locus, or why it cannot be followed."""
        # It raises the error of a piece that is needed.
        is_section, place = self._begun[number]
        if is_section:
            self._walked_early[place] = outcome.value()
            return
        self._followed[place] = outcome
        family = self._starts[place].family
        while (undecided := self._undecided[family]) and undecided[0] in self._followed:
            first = undecided.pop(0)
            self._decided[first] = found = self._followed.pop(first).value()
            if not isinstance(found, str):
                self._loci.append(found)
                self._leave_out(family, found)

    def sections(self) -> Iterator[Any]:
        """Yield what was found on the next sections."""
        while self._walked in self._walked_early:
            self._walked += 1
            yield self._walked_early.pop(self._walked - 1)

    def add(self, section: int, value: float, specials: Iterable[SpecialPoint]) -> None:
        """Add the special points of the next section from which loci may be followed."""
        for special in specials:
            start, number = _Start(section, value, special), len(self._starts)
            self._starts.append(start)
            if number < self._tried:
                continue
            if any(lies_on_locus(locus, special, value, self._width) for locus in self._loci):
                self._decided[number] = None
            else:
                self._undecided.setdefault(start.family, []).append(number)

    def loci(self) -> Iterator[tuple[int, Locus | str]]:
        """Yield the next loci, or why one cannot be followed, each with the number of special points up to it."""
        while self._tried in self._decided:
            found = self._decided.pop(self._tried)
            self._tried += 1
            if found is not None:
                yield self._tried, found

    def _begin(self) -> None:
        """Begin the next section, or else a locus."""
        if self._walks < len(self._systems):
            self._begun.append((True, self._walks))
            self._walks += 1
        else:
            self._begun.append((False, self._ready()[0]))
            self._in_work.add(self._begun[-1][1])

    def _ready(self) -> list[int]:
        """Return the special points whose loci can be followed now: first those that are certain to begin one."""
        # in their order: with the largest families first, maps are done up to 9 % sooner, but up to two thirds of the
        # loci wait for earlier ones before they are stored
        families = [family for family in self._undecided.values() if family]
        ready = sorted(family[0] for family in families)
        if len(families) == 1:  # they would otherwise be followed one after the other
            first, *others = families[0]
            beside = [number for number in others if self._starts[number].section == self._starts[first].section]
            ready += beside if len(beside) > 1 else []
        return [number for number in ready if number not in self._in_work]

    def _leave_out(self, family: Family, locus: Locus) -> None:
        """Decide that points of a family that lie on a locus begin none, even if they have been followed."""
        left = []
        for number in self._undecided[family]:
            start = self._starts[number]
            if lies_on_locus(locus, start.special, start.value, self._width):
                self._decided[number] = None
                self._followed.pop(number, None)
            else:
                left.append(number)
        self._undecided[family] = left


def lies_on_locus(locus: Locus, special: SpecialPoint, value: float, width: float) -> bool:
    """Return True if a special point is on a locus: between two of its points, with an orbit like theirs."""
    if locus.kind is not special.kind or locus.period != special.orbit.period or locus.contact != special.contact:
        return False
    places = locus.values
    a, b = places[:-1], places[1:]
    crosses = np.flatnonzero((a[:, 1] - value) * (b[:, 1] - value) <= 0.0)
    for k in crosses:
        rise = b[k, 1] - a[k, 1]
        share = 0.5 if rise == 0.0 else (value - a[k, 1]) / rise
        if abs(a[k, 0] + share * (b[k, 0] - a[k, 0]) - special.value) <= _BESIDE * width:
            # two orbits of neighbouring systems may be the same motion, one begun later
            nearest, orbit = locus.points[k if share < 0.5 else k + 1].orbit, special.orbit
            distance = float(np.abs(phases(nearest) - orbit.state).max(axis=1).min())
            if distance <= _ALIKE * magnitude(orbit.state, orbit.system):
                return True
    return False


Report = Callable[[Map, MapSection | Locus], None]
"""Called with the map, and the section or the locus that was added to it last."""


def _has_one_segment(shooting: Shooting) -> Shooting:
    if shooting.segments > 1:
        raise ModelError(f"segments is {shooting.segments}; a locus is followed with one, so leave this out")
    return shooting


def _lie_in_the_range(sections: Any, info: ValidationInfo[Surroundings]) -> Any:
    if isinstance(sections, int):
        return sections
    if len(set(sections)) < len(sections):
        raise ValueError(f"is {given(list(sections))}; list each value only once")
    if second := info.data.get("second"):
        check_inside(sections, "sections", second.ends)
    return sections


@dataclass(frozen=True)
class MapStudyOptions(BranchOptions):
    """A map: all loci of folds, flips, Neimark-Sacker and grazing points that are met in the plane of two parameters.

    Branches are followed along the first parameter at several values of the second; each of their special points that
    is on no locus yet begins one. They start at the system's own value of the first parameter if that is in its range,
    and at the upper end otherwise.

    Raises
    ------
    ModelError
        For unknown or equal parameters, or empty ranges.
    NumericalError
        If no branch can be followed on any section.
    WorkError
        If a worker process dies.

    Examples
    --------
    >>> loci = gw.bifurcation_map(system, {"frequency": (1.0, 1.6), "stop.clearance": (0.9, 1.1)}, sections=1)
    >>> loci.names
    ('grazing-1', 'fold-1', 'fold-2')
    """

    kind: ClassVar[str] = "map"
    answer: ClassVar[Part | None] = Part("map", Map)  # made of sections and loci
    arguments: ClassVar[tuple[str, ...]] = ("plane",)
    not_asked: ClassVar[tuple[str, ...]] = ("parameter", "begin", "end", "second", "measure", "verify")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {"plane": PARAMETERS}
    reports: ClassVar[str] = "sections and loci"
    table_types: ClassVar[Mapping[str, Any]] = {
        **BranchOptions.table_types,
        "shooting": (Annotated[key_type(Shooting), AfterValidator(_has_one_segment)], Shooting()),
        "sections": Annotated[key_type(CountOrValues), AfterValidator(_lie_in_the_range)],
        "kinds": kinds_key(Kind.with_locus),
        **SEARCH_KEYS,
    }

    second: Second = field(kw_only=True)  #: The second parameter.
    #: Values of the second parameter at which branches are followed along the first one: their special points are where
    #: the loci begin. A number of them is spread evenly over the range, its ends included.
    sections: int | tuple[float, ...] = 5
    #: Longest period, in forcing periods, of the branches that are followed there.
    max_period: Annotated[int, Ge(1), Le(MAX_VALUES)] = 2
    kinds: tuple[Kind, ...] = field(default_factory=Kind.with_locus)  #: Kinds of loci.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)
    #: Values of the first parameter on each section at which branches not connected to others are sought; as in
    #: `DiagramOptions`.
    search_values: int | tuple[float, ...] = 0
    search: SearchOptions = SearchOptions()  #: Options of the search.

    def __post_init__(self) -> None:
        super().__post_init__()
        check_values("sections", self.sections, 1, "the second parameter")
        if isinstance(self.sections, tuple) and len(set(self.sections)) < len(self.sections):
            raise ModelError(f"sections is {self.sections!r}; list each value only once")
        if not self.kinds or not set(self.kinds) <= set(Kind.with_locus()):
            names = ", ".join(kind.value for kind in Kind.with_locus())
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")

    def values(self, low: float, high: float) -> tuple[float, ...]:
        """Return the values of the sections between two bounds.

        Parameters
        ----------
        low, high
            The bounds, in the unit of the second parameter.
        """
        if isinstance(self.sections, int):
            count = self.sections
            return tuple(np.linspace(low, high, count).tolist()) if count > 1 else (0.5 * (low + high),)
        outside = [value for value in self.sections if not low <= value <= high]
        if outside:
            raise ModelError(f"a section is requested at {outside[0]:g}, outside the range from {low:g} to {high:g}")
        return tuple(float(value) for value in self.sections)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table, with its search."""
        return super().of_table(with_search(values), system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return (
            f"{self.kind} over {self.range_words} and {self.second.words}, period {self.period}, to period "
            f"{self.max_period}{search_words(self.search_values)}"
        )

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call."""
        (first, second), ((low, high), ends) = check_parameters(system, values["plane"])
        rest = {name: value for name, value in values.items() if name != "plane"}
        return cls(first, low, high, **{"measure": "", **rest}, second=ParameterRange(second, *ends))

    def system_of_call(self, system: System) -> System:
        """Return the system itself, whose value of the first parameter is where branches start."""
        return system

    @classmethod
    def progress_words(cls, count: int, *news: Any) -> str:
        """Return the number of sections and of loci."""
        chart, _ = news
        return f"{len(chart.sections)} sections, {len(chart.loci)} loci"

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of each parameter, the smaller value first."""
        return self.ends, self.second.ends

    def first_system(self, system: System) -> System:
        """Return the system at the first value of both parameters."""
        return super().first_system(system).at({self.second.parameter: self.second.begin})

    def work(self, system: System) -> MapWork:
        """Return the work on the map."""
        return MapWork(system, self)


SECTION = Part("section", MapSection, numbered=True)
LOCUS = Part("locus", Locus, numbered=True)
STATE = Part("map", tuple[Map, int, int])
"""Facts of the map as a whole, without its sections and loci, and how many of each there are."""


class MapWork(Work):
    """Computation of the sections and the loci of a map; each is stored as a whole when it is accepted.

    At any time the known sections and loci are the first ones of the complete map. It reports the map so far, and the
    section or the locus that was added last.
    """

    def __init__(self, system: System, asked: MapStudyOptions, which: Which | None = None) -> None:
        first, second = asked.parameter, asked.second.parameter
        if first == second:
            raise ModelError(f"a map needs two different parameters, but both are {first!r}")
        ranges = (check_range(system, first, asked.ends), check_range(system, second, asked.second.ends))
        self.chart = Map(first, second, ranges)
        self.system, self.asked, self.which = system, asked, which

    def take(self, known: Parts) -> None:
        """Read the map of a file; raise a ValueError if it belongs to another study or is inconsistent."""
        before = self.chart
        sections, loci = (tuple(value for _, value in known.all(part)) for part in (SECTION, LOCUS))
        chart, *counts = known.one(STATE)
        if counts != [len(sections), len(loci)]:
            raise ValueError("a section or a locus is missing")
        self.chart = replace(chart, sections=sections, loci=loci)
        if any(getattr(chart, name) != getattr(before, name) for name in ("first", "second", "within")):
            raise ValueError("the map does not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find the remaining sections, then the remaining loci."""
        chart, values = self.chart, self._values
        low, high = chart.within[0]
        systems = [self.system.at({chart.second: value}) for value in values[len(chart.sections) :]]
        queue = MapQueue(systems, high - low, chart.loci, chart.tried)
        for number, section in enumerate(chart.sections):
            queue.add(number, section.value, self._starts_on(section))
        yield from self._settle(queue)
        for number, outcome in outcomes(partial(_follow_one, *self._functions), queue, workers):
            queue.take(number, outcome)
            yield from self._settle(queue)
        starts = [special for section in self.chart.sections for special in self._starts_on(section)]
        self.chart = replace(self.chart, tried=len(starts))
        if self.which is not None and not starts:
            self.chart = replace(self.chart, failures=(*self.chart.failures, self._has_none(self.which)))
        if not self.chart.branches:
            raise NumericalError("; ".join(self.chart.failures) or "no branch was found")
        self.chart = replace(self.chart, complete=True)

    def last(self, *, finished: bool) -> Iterator[Entry]:
        """Yield the whole map, unless it is empty."""
        if self.chart.sections:
            yield from whole_map(self.chart)

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield the sections, then the loci, each with the map at the time when it was added."""
        known = self.chart
        plane = (known.first, known.second, known.within)
        for count, section in enumerate(known.sections, start=1):
            yield Map(*plane, (), known.sections[:count]), section
        for count, locus in enumerate(known.loci, start=1):
            yield Map(*plane, known.loci[:count], known.sections), locus

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.chart.complete

    @property
    def record(self) -> Map:
        """The map so far."""
        return self.chart

    @property
    def done(self) -> int:
        """Number of sections and loci that are done."""
        return len(self.chart.sections) + len(self.chart.loci)

    @property
    def _values(self) -> tuple[float, ...]:
        """Values of the second parameter on all sections."""
        return self.asked.values(*self.chart.within[1])

    @property
    def _functions(self) -> tuple[Callable[[System], Any], Callable[[SpecialPoint], Locus | str]]:
        """The functions that follow the branches of a section, and the locus of a special point."""
        first, second, within = self.chart.first, self.chart.second, self.chart.within
        tree = DiagramOptions(
            max_period=self.asked.max_period,
            workers=1,
            search_values=self.asked.search_values,
            search=self.asked.search,
        )
        method = self.asked.method.suited_to(self.system)
        how = (self.asked.start, self.asked.period, self.asked.walk, method, None if self.which else tree)
        return (
            partial(_follow_section, first, second, within[0], *how),
            partial(_follow_special, first, second, within, self.asked.walk, method),
        )

    def _settle(self, queue: MapQueue) -> Iterator[Found]:
        """Add the sections that have come in turn and, once all have, the loci that have come in turn."""
        for branches, notes, failures in queue.sections():
            count = len(self.chart.sections)
            section = MapSection(self._values[count], branches)
            lost = {special.kind for branch in branches for special in branch.special_points if special.kind.no_locus}
            absent = [f"no loci of the kind {kind}: the sections list these points" for kind in sorted(lost)]
            if self.which is None:
                notes = [*(text for text in absent if text not in self.chart.notes), *notes]
            self.chart = replace(
                self.chart,
                sections=(*self.chart.sections, section),
                notes=(*self.chart.notes, *notes),
                failures=(*self.chart.failures, *failures),
            )
            queue.add(count, section.value, self._starts_on(section))
            yield Found((SECTION.entry(section, count), _state(self.chart)), ((self.chart, section),))
        if len(self.chart.sections) < len(self._values):
            return
        for tried, locus in queue.loci():
            if isinstance(locus, str):
                self.chart = replace(self.chart, failures=(*self.chart.failures, locus), tried=tried)
            else:
                self.chart = replace(self.chart, loci=(*self.chart.loci, locus), tried=tried)
                entry = LOCUS.entry(locus, len(self.chart.loci) - 1)
                yield Found((entry, _state(self.chart)), ((self.chart, locus),))

    def _starts_on(self, section: MapSection) -> list[SpecialPoint]:
        """Return the special points of a section at which loci may begin."""
        which, (low, high) = self.which, self.chart.within[0]
        return [
            special
            for branch in section.branches
            for special in (branch.special_points if which is None else which.of(branch.special_points))
            # a fold between two points of a branch may lie just beyond the edge
            if special.kind in self.asked.kinds and low <= special.value <= high
        ]

    def _has_none(self, which: Which) -> str:
        """Say that the branch has none of the special points that were asked for."""
        there = [
            f"{special.kind.value}{special.contact and f' of {special.contact}'} at {special.value:.8g}"
            for branch in self.chart.branches
            for special in branch.special_points
        ]
        return f"the branch has no {which.words}; it has {', '.join(there) or 'no special points'}"


def whole_map(chart: Map) -> Iterator[Entry]:
    """Yield the parts of a file that keep a whole map."""
    yield from (SECTION.entry(section, number) for number, section in enumerate(chart.sections))
    yield from (LOCUS.entry(locus, number) for number, locus in enumerate(chart.loci))
    yield _state(chart)


def _state(chart: Map) -> Entry:
    return STATE.entry((replace(chart, sections=(), loci=()), len(chart.sections), len(chart.loci)))


def _follow_one(
    follow_section: Callable[[System], Any],
    follow_special: Callable[[SpecialPoint], Locus | str],
    piece: tuple[bool, Any],
) -> Any:
    """Do a piece of the `MapQueue`."""
    is_section, item = piece
    return follow_section(item) if is_section else follow_special(item)


def _follow_section(
    first: str,
    second: str,
    within: tuple[float, float],
    start: str | Sequence[float],
    period: int,
    walk: WalkOptions | None,
    method: Method | None,
    tree: DiagramOptions | None,
    system: System,
) -> tuple[tuple[Branch, ...], list[str], list[str]]:
    """Follow the branch through the first orbit of a section; with options of a diagram, also those that leave it."""
    (low, high), value = within, system[first]
    where = f"at {second} = {system[second]:.10g}"
    try:
        orbit = find_orbit(system.at({first: value if low <= value <= high else high}), period, start, method=method)
        if tree is None:
            return (follow(orbit, first, within, walk=walk, method=method),), [], []
        grown = diagram_from(orbit, first, within, tree, walk, method)
    except NumericalError as error:
        return (), [], [f"{where} no branch could be followed: {error}"]
    return grown.branches, [f"{where}: {text}" for text in grown.notes], [f"{where}: {text}" for text in grown.failures]


def _follow_special(
    first: str, second: str, within: Ranges, walk: WalkOptions | None, method: Method | None, special: SpecialPoint
) -> Locus | str:
    """Follow the locus of a special point; return the reason, as a sentence, if it cannot be followed."""
    try:
        return follow_locus(special, first, second, within, walk=walk, method=method)
    except NumericalError as error:
        where = f"{first} = {special.value:.10g}, {second} = {special.orbit.system[second]:.10g}"
        return f"the locus of the {special.kind.value} at {where} could not be followed: {error}"
