"""The study of a diagram: all branches that are attached to the first one, and those that a search finds."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from pydantic import AfterValidator, ValidationInfo

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import directions
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.isolated import Progress, SearchResult
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.kind import Content, Found, Work
from gapwalk.studies.option_tables import SearchPart
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.tables import Surroundings
from gapwalk.studies.whole_diagram import DiagramOptions, Grower, empty_diagram

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self


def _suits(search: SearchPart | None, info: ValidationInfo[Surroundings]) -> SearchPart | None:
    if search is not None:
        search.check(info.data, info.context.system)
    return search


SEARCH_KEYS: Mapping[str, Any] = {
    "search_values": None,
    "search": (Annotated[SearchPart | None, AfterValidator(_suits)], None),
}
"""The keys of a search: a table of its own."""


def with_search(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a table, with what its table of the search says."""
    search = values.get("search")
    rest = {name: value for name, value in values.items() if name != "search"}
    return rest if search is None else rest | search.options()


def search_words(values: int | tuple[float, ...]) -> str:
    """Where a search is to be, for a line that says what is to be done."""
    count = values if isinstance(values, int) else len(values)
    return f", with a search at {count} values" if count else ""


@dataclass(frozen=True)
class DiagramStudyOptions(DiagramOptions, BranchOptions):
    """A diagram: all branches that are attached to the first one, over one parameter, and those that a search finds.

    Parameters
    ----------
    parameter, begin, end, measure, period, start, walk, method
        As `BranchOptions`, for the first branch; the range is that of all.
    max_period, max_branches, workers, search_values, search
        How far it goes, in how many processes, and the search for branches that are attached to no other; as
        `DiagramOptions`.
    """

    kind: ClassVar[str] = "diagram"
    reports: ClassVar[str] = "branches"
    table_types: ClassVar[Mapping[str, Any]] = {**BranchOptions.table_types, **SEARCH_KEYS}

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """The study of a table, with its search."""
        return super().of_table(with_search(values), system)

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        return (
            f"{self.kind} over {self.range_words}, period {self.period}, showing {self.measure}, to period "
            f"{self.max_period}{search_words(self.search_values)}"
        )

    def work(self, system: System) -> DiagramWork:
        """The work on the diagram."""
        return DiagramWork(system, self)


class DiagramState(NamedTuple):
    """What is known of a diagram as a whole, without its branches and its search; and whether nothing is left to do."""

    diagram: Diagram
    finished: bool


BRANCH = Part("branch", DiagramBranch, numbered=True)
STATE = Part("diagram", DiagramState)
SEARCH = Part("search", SearchResult)


class DiagramWork(Work):
    """The branches of a diagram, each kept when it is accepted, whole, with what is known of the diagram.

    What is reported is the diagram so far, and the branch that was added to it last.

    Parameters
    ----------
    system
        The system, at the beginning of the range.
    asked
        What is asked for.
    """

    def __init__(self, system: System, asked: DiagramStudyOptions) -> None:
        self.system, self.asked = system, asked
        self.diagram = empty_diagram(asked.parameter, (asked.begin, asked.end))
        self._finished = False
        self._kept: SearchResult | None = None

    def take(self, known: Parts) -> None:
        """Take over the diagram of a file; a ValueError if it is of another study."""
        self.diagram, self._finished = stored_diagram(known)
        self._kept = self.diagram.search
        if (self.diagram.parameter, self.diagram.within) != (self.asked.parameter, self.asked.ends):
            raise ValueError("the diagram does not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find the branches that are not known yet."""
        grower = Grower(self.diagram, self.asked, self.asked.walk, self.asked.method)
        for member in self.members(grower, workers):
            self.diagram = grower.diagram
            entries = (BRANCH.entry(member, len(self.diagram.members) - 1), *self._state(finished=False))
            yield Found(entries, ((self.diagram, member),))
            self._kept = self.diagram.search  # only now: Ctrl-C may come before the file has it
        self.diagram, self._finished = grower.whole, True

    def members(self, grower: Grower, workers: Workers) -> Iterator[DiagramBranch]:
        """The branches, each when it has been added; a NumericalError if there is none at all."""
        asked, known = self.asked, self.diagram
        orbit = (
            known.branches[0].points[0].orbit
            if known.members
            else find_orbit(self.system, asked.period, asked.start, method=asked.method)
        )
        directions(orbit.system[asked.parameter], known.within)  # refuses a range that does not hold the start
        try:
            yield from grower.from_orbit(orbit, workers)
        except KeyboardInterrupt:
            self.diagram = grower.diagram  # with what a search has found
            raise
        if not grower.diagram.members:
            raise NumericalError("; ".join(grower.diagram.failures) or "no branch was found")

    def last(self, *, finished: bool) -> Iterator[Entry]:
        """The whole diagram, if there is anything."""
        return self._whole(finished=finished) if self.diagram.members else iter(())

    def again(self) -> Iterator[tuple[Any, ...]]:
        """The branches, each with the diagram as it was when it was added."""
        for count, member in enumerate(self.diagram.members, start=1):
            yield replace(self.diagram, members=self.diagram.members[:count]), member

    @property
    def complete(self) -> bool:
        """Whether nothing is left to do."""
        return self._finished

    @property
    def done(self) -> int:
        """Number of branches."""
        return len(self.diagram.members)

    @property
    def record(self) -> Diagram:
        """The diagram, as far as it has come."""
        return self.diagram

    def content(self) -> Content:
        """The diagram, and its branches."""
        return Content(self._finished, self.diagram.branches, self.diagram)

    def _whole(self, *, finished: bool) -> Iterator[Entry]:
        yield from _branches(self.diagram)
        yield from self._state(finished=finished)

    def _state(self, *, finished: bool) -> Iterator[Entry]:
        """What is known of the diagram as a whole; its search only when it is new, for it may be long."""
        yield STATE.entry(DiagramState(replace(self.diagram, members=(), search=None), finished))
        if self.diagram.search is not None and self.diagram.search is not self._kept:
            yield SEARCH.entry(self.diagram.search)


class OthersWork(DiagramWork):
    """Find the branches that are connected to no known one; see `gapwalk.find_others`.

    Parameters
    ----------
    system, asked
        As `DiagramWork`.
    apart
        The branches that are known along the parameter.
    searching
        Called with the progress of the search.
    """

    def __init__(
        self,
        system: System,
        asked: DiagramStudyOptions,
        apart: Sequence[Branch],
        searching: Callable[[Progress], None] | None = None,
    ) -> None:
        super().__init__(system, asked)
        self._apart, self._searching = apart, searching

    def members(self, grower: Grower, workers: Workers) -> Iterator[DiagramBranch]:
        """What a search leads to."""
        grower.apart, grower.searching = tuple(self._apart), self._searching
        try:
            yield from grower.search(self.system, workers)
        finally:
            self.diagram = grower.diagram

    def last(self, *, finished: bool) -> Iterator[Entry]:
        """The whole diagram, if there is a search."""
        return self._whole(finished=finished) if self.diagram.search is not None else iter(())


def whole_diagram(diagram: Diagram, *, finished: bool) -> Iterator[Entry]:
    """What a file keeps of a whole diagram, except for its search."""
    yield from _branches(diagram)
    yield STATE.entry(DiagramState(replace(diagram, members=()), finished))


def _branches(diagram: Diagram) -> Iterator[Entry]:
    return (BRANCH.entry(member, number) for number, member in enumerate(diagram.members))


def stored_diagram(parts: Parts) -> DiagramState:
    """The diagram of a file; a ValueError if it makes no sense."""
    members: list[DiagramBranch] = []
    for number, member in parts.all(BRANCH):
        known = {each.name: len(each.branch.special_points) for each in members}
        if number != len(members) or member.name in known:
            raise ValueError(f"branch {member.name:.60} has no place in the tree")
        if any(not 0 <= origin.special < known.get(origin.parent, 0) for origin in member.origins):
            raise ValueError(f"branch {member.name} begins or ends nowhere")
        members.append(member)
    state = parts.one(STATE)
    diagram = replace(state.diagram, members=tuple(members), search=parts.get(SEARCH))
    if not members and diagram.search is None:  # which may have led to nothing new
        raise ValueError("it holds no branch")
    if diagram.max_period is not None and diagram.max_period < 1:
        raise ValueError(f"its longest period is {diagram.max_period}")
    return state._replace(diagram=diagram)
