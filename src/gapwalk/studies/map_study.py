"""The study of a map: all loci that bound regimes in the plane of two parameters.

Branches are followed at some values of the second parameter, then the loci of their special points.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, ValidationInfo

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.loci import Locus, follow_locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting
from gapwalk.parallel.groups import outcomes
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.diagram_study import DiagramOptions, diagram
from gapwalk.studies.map import Map, MapOptions, MapSection, Ranges, Which
from gapwalk.studies.map_queue import MapQueue
from gapwalk.studies.options import SEARCH_KEYS, BranchOptions, Second, kinds_key, search_words, with_search
from gapwalk.studies.runner import call
from gapwalk.studies.study_kind import Found, Work
from gapwalk.studies.tables import CountOrValues, Surroundings, check_inside, check_range

if TYPE_CHECKING:
    from typing import Self

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
class MapStudyOptions(MapOptions, BranchOptions):
    r"""A map: all loci that bound regimes in the plane of two parameters.

    Parameters
    ----------
    parameter, begin, end, period, start, walk, method
        As `BranchOptions`, for the branches on which the loci are picked up; the range is that of the map too.
    measure
        Measure in tables and lists of motions.
    sections, max_period, kinds, workers, search_values, search
        Content of the map, and the sections on which its loci begin; as `MapOptions`.

    Examples
    --------
    >>> import io
    >>> keys = "[study]\nsecond = { parameter = 'stop.clearance', from = 0.9, to = 1.1 }"
    >>> gw.read_study(io.StringIO(file.replace("[study]", keys).replace("response", "map"))).options.plan
    'map over frequency from 1.1 to 1.5 and stop.clearance from 0.9 to 1.1, period 1, to period 2'
    """

    kind: ClassVar[str] = "map"
    reports: ClassVar[str] = "sections and loci"
    table_types: ClassVar[Mapping[str, Any]] = {
        **BranchOptions.table_types,
        "shooting": (Annotated[key_type(Shooting), AfterValidator(_has_one_segment)], Shooting()),
        "sections": Annotated[key_type(CountOrValues), AfterValidator(_lie_in_the_range)],
        "kinds": kinds_key(Kind.with_locus),
        **SEARCH_KEYS,
    }

    second: Second = field(kw_only=True)  #: The second parameter.

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

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of each parameter, the smaller value first."""
        return self.ends, self.second.ends

    def first_system(self, system: System) -> System:
        """Return the system at the first value of both parameters."""
        return super().first_system(system).at({self.second.parameter: self.second.begin})

    def work(self, system: System) -> MapWork:
        """Return the work on the map."""
        how = (self.start, self.period, self.walk, self.method)
        return MapWork(system, self.parameter, self.second.parameter, self.within, self, *how)


SECTION = Part("section", MapSection, numbered=True)
LOCUS = Part("locus", Locus, numbered=True)
STATE = Part("map", tuple[Map, int, int])
"""Facts of the map as a whole, without its sections and loci, and how many of each there are."""


class MapWork(Work):
    """Computation of the sections and the loci of a map; each is stored as a whole when it is accepted.

    At any time the known sections and loci are the first ones of the complete map. It reports the map so far, and the
    section or the locus that was added last.
    """

    def __init__(
        self,
        system: System,
        first: str,
        second: str,
        to: Ranges,
        options: MapOptions,
        start: str | Sequence[float] = "settle",
        period: int = 1,
        walk: WalkOptions | None = None,
        method: Method | None = None,
        which: Which | None = None,
    ) -> None:
        if first == second:
            raise ModelError(f"a map needs two different parameters, but both are {first!r}")
        ranges = (check_range(system, first, sorted(to[0])), check_range(system, second, sorted(to[1])))
        self.chart = Map(first, second, ranges)
        self.system, self.options, self.which = system, options, which
        self.start, self.period, self.walk, self.method = start, period, walk, method

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
        return self.options.values(*self.chart.within[1])

    @property
    def _functions(self) -> tuple[Callable[[System], Any], Callable[[SpecialPoint], Locus | str]]:
        """The functions that follow the branches of a section, and the locus of a special point."""
        first, second, within = self.chart.first, self.chart.second, self.chart.within
        tree = DiagramOptions(
            max_period=self.options.max_period,
            workers=1,
            search_values=self.options.search_values,
            search=self.options.search,
        )
        how = (self.start, self.period, self.walk, self.method, None if self.which else tree)
        return (
            partial(_follow_section, first, second, within[0], *how),
            partial(_follow_special, first, second, within, self.walk, self.method),
        )

    def _settle(self, queue: MapQueue) -> Iterator[Found]:
        """Add the sections that have come in turn and, once all have, the loci that have come in turn."""
        for branches, notes, failures in queue.sections():
            count = len(self.chart.sections)
            section = MapSection(self._values[count], branches)
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
            if special.kind in self.options.kinds and low <= special.value <= high
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
        grown = diagram(orbit.system, first, within, start=orbit, options=tree, walk=walk, method=method)
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


@shows_progress(lambda count, chart, added: f"{len(chart.sections)} sections, {len(chart.loci)} loci")
def bifurcation_map(
    system: System,
    first: str,
    second: str,
    to: Ranges,
    *,
    start: str | Sequence[float] = "settle",
    period: int = 1,
    options: MapOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    resume: Map | None = None,
) -> Map:
    """Return all loci of folds, flips, Neimark-Sacker and grazing points that are met in the plane of two parameters.

    Branches are followed along the first parameter at several values of the second; each of their special points that
    is on no locus yet begins one.

    Parameters
    ----------
    system
        The system.
    first, second
        Names of the parameters; the first is the one along which branches are followed.
    to
        The range of each.
    start, period
        Where the branches start, as in `find_orbit`, at the system's own value of the first parameter if that is in
        its range, and at the upper end otherwise.
    options, walk, method
        Options of the map, of the walks and of the method.
    workers
        Number of local processes, or workers that were started before (`gapwalk.parallel`); by default as the options
        say. The result does not depend on them.
    report
        Called with each section and each locus as it is accepted.
    resume
        A stopped map of the same request: its parts are kept, and the others are added.

    Returns
    -------
    Map
        The loci, and the sections on which they begin.

    Raises
    ------
    ModelError
        For unknown or equal parameters, or empty ranges.
    NumericalError
        If no branch can be followed on any section.
    WorkError
        If a worker process dies.
    Interrupted
        After Ctrl-C; its `found` is the map so far, which `resume` continues.

    Examples
    --------
    >>> plane = ((1.0, 1.6), (0.9, 1.1))
    >>> loci = gw.bifurcation_map(system, "frequency", "stop.clearance", plane, options=gw.MapOptions(sections=1))
    >>> loci.names
    ('grazing-1', 'fold-1', 'fold-2')
    """
    options = options or MapOptions()
    work = MapWork(system, first, second, to, options, start, period, walk, method)
    work.chart = resume or work.chart
    return call(options, work, system, workers=workers, report=report).record
