"""The study of a map: all loci that bound regimes in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, PlainValidator, ValidationInfo

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.problems import given
from gapwalk.model.schema import one_of
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.diagram_study import SEARCH_KEYS, search_words, with_search
from gapwalk.studies.kind import Content, Found, Work
from gapwalk.studies.map import Map, MapOptions, MapSection
from gapwalk.studies.map_charting import Charter, map_charter
from gapwalk.studies.option_tables import CountOrValues, ShootingPart, check_inside
from gapwalk.studies.options import BranchOptions, Second
from gapwalk.studies.tables import Surroundings

if TYPE_CHECKING:
    from typing import Self


def _has_one_segment(shooting: ShootingPart) -> ShootingPart:
    if shooting.options().segments > 1:
        raise ModelError(f"segments is {shooting.segments}; a locus is followed with one, so leave this out")
    return shooting


def _lie_in_the_range(sections: Any, info: ValidationInfo[Surroundings]) -> Any:
    if isinstance(sections, int):
        return sections
    if len(set(sections)) < len(sections):
        raise ValueError(f"is {given(sections)}; each value must stand there once")
    if second := info.data.get("second"):
        check_inside(sections, "sections", second.ends)
    return tuple(sections)


@dataclass(frozen=True)
class MapStudyOptions(MapOptions, BranchOptions):
    """A map: all loci that bound regimes in the plane of two parameters.

    Parameters
    ----------
    parameter, begin, end, period, start, walk, method
        As `BranchOptions`, for the branches on which the loci are picked up; the range is that of the map too.
    measure
        What tables and lists of motions show.
    sections, max_period, kinds, workers, search_values, search
        What the map shows, and where its loci are picked up; as `MapOptions`.
    second
        The second parameter.
    """

    kind: ClassVar[str] = "map"
    reports: ClassVar[str] = "sections and loci"
    table_types: ClassVar[Mapping[str, Any]] = {
        **BranchOptions.table_types,
        "shooting": (Annotated[ShootingPart, AfterValidator(_has_one_segment)], Field(default_factory=ShootingPart)),
        "sections": Annotated[CountOrValues, AfterValidator(_lie_in_the_range)],
        "kinds": Annotated[
            list[Annotated[Kind, PlainValidator(one_of(Kind.with_locus))]],
            Field(min_length=1),
            AfterValidator(lambda kinds: tuple(dict.fromkeys(kinds))),
        ],
        **SEARCH_KEYS,
    }

    second: Second = field(kw_only=True)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """The study of a table, with its search."""
        return super().of_table(with_search(values), system)

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        return (
            f"{self.kind} over {self.range_words} and {self.second.words}, period {self.period}, to period "
            f"{self.max_period}{search_words(self.search_values)}"
        )

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of each parameter, the smaller value first."""
        return self.ends, self.second.ends

    def first_system(self, system: System) -> System:
        """The system at the first value of both parameters."""
        return super().first_system(system).at({self.second.parameter: self.second.begin})

    def work(self, system: System) -> MapWork:
        """The work on the map."""
        return MapWork(system, self)

    def charter(self, system: System, known: Map) -> Charter:
        """What draws up the map, of which something may be known."""
        plane = (system, self.parameter, self.second.parameter, self.within)
        return map_charter(*plane, self.limits, self.start, self.period, self.walk, self.method, known)


SECTION = Part("section", MapSection, numbered=True)
LOCUS = Part("locus", Locus, numbered=True)
STATE = Part("map", tuple[Map, int, int])
"""What is known of the map as a whole, without its sections and loci; and how many of each there are."""


class MapWork(Work):
    """The sections and the loci of a map, each kept when it is accepted, whole.

    What is reported is the map so far, and the section or the locus that was added to it last.

    Parameters
    ----------
    system
        The system at the beginning of the ranges.
    asked
        What is asked for.
    """

    def __init__(self, system: System, asked: MapStudyOptions) -> None:
        self.system, self.asked = system, asked
        self.chart = Map(asked.parameter, asked.second.parameter, asked.within)

    def take(self, known: Parts) -> None:
        """Take over the map of a file; a ValueError if it is of another study."""
        before, self.chart = self.chart, stored_map(known)
        if any(getattr(self.chart, name) != getattr(before, name) for name in ("first", "second", "within")):
            raise ValueError("the map does not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find what is not known yet."""
        charter = self.asked.charter(self.system, self.chart)
        try:
            for addition in charter.additions(workers):
                self.chart = chart = charter.chart
                is_section = isinstance(addition, MapSection)
                added = SECTION.entry(addition, len(chart.sections) - 1) if is_section else None
                yield Found((added or LOCUS.entry(addition, len(chart.loci) - 1), _state(chart)), ((chart, addition),))
        finally:
            self.chart = charter.chart
        if not self.chart.branches:
            raise NumericalError("; ".join(self.chart.failures) or "no branch was found")
        self.chart = replace(self.chart, complete=True)

    def last(self, *, finished: bool) -> Iterator[Entry]:
        """The whole map, if there is anything."""
        if self.chart.sections:
            yield from whole_map(self.chart)

    def again(self) -> Iterator[tuple[Any, ...]]:
        """The sections, then the loci, each with the map as it was when it was added."""
        known = self.chart
        for count, section in enumerate(known.sections, start=1):
            yield Map(known.first, known.second, known.within, (), known.sections[:count]), section
        for count, locus in enumerate(known.loci, start=1):
            yield Map(known.first, known.second, known.within, known.loci[:count], known.sections), locus

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self.chart.complete

    @property
    def done(self) -> int:
        """Sections and loci."""
        return len(self.chart.sections) + len(self.chart.loci)

    @property
    def record(self) -> Map:
        """The map, as far as it has come."""
        return self.chart

    def content(self) -> Content:
        """The map, and the branches of its sections."""
        return Content(self.chart.complete, self.chart.branches, map=self.chart)


def whole_map(chart: Map) -> Iterator[Entry]:
    """What a file keeps of a map that is there as a whole."""
    yield from (SECTION.entry(section, number) for number, section in enumerate(chart.sections))
    yield from (LOCUS.entry(locus, number) for number, locus in enumerate(chart.loci))
    yield _state(chart)


def stored_map(parts: Parts) -> Map:
    """The map of a file; a ValueError if it makes no sense."""
    sections, loci = ([value for _, value in parts.all(part)] for part in (SECTION, LOCUS))
    chart, *counts = parts.one(STATE)
    if counts != [len(sections), len(loci)]:
        raise ValueError("a section or a locus is missing")
    return replace(chart, sections=tuple(sections), loci=tuple(loci))


def _state(chart: Map) -> Entry:
    return STATE.entry((replace(chart, sections=(), loci=()), len(chart.sections), len(chart.loci)))
