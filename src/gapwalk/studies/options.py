"""What a study is asked to do: one frozen dataclass of options for each kind of study."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from importlib import import_module
from typing import ClassVar

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting
from gapwalk.results.codec import Column, OneOf, column_of, register
from gapwalk.studies.diagram.diagram import DiagramOptions
from gapwalk.studies.map.options import MapOptions

_LIMITS, _MAP = DiagramOptions(), MapOptions()


class Start(StrEnum):
    """Where the search for the first orbit of a study begins."""

    REST = "rest"
    """Newton's method from the state zero."""
    SETTLE = "settle"
    """Newton's method from where a transient from rest has come to."""


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """What is to be done, of any kind of study; each kind has a dataclass of its own."""

    kind: ClassVar[str]
    """What a model file calls this kind of study."""

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class BranchOptions(StudyOptions):
    """What the studies of branches have in common: a first orbit, and the range of one parameter.

    Parameters
    ----------
    parameter
        The parameter that is walked, any of the system's, for example ``"frequency"``.
    begin, end
        The values between which it is walked, from the first to the second.
    measure
        What a picture shows: ``max``, ``min``, ``half`` (half the peak to peak), ``mean`` or ``rms``, a dot, and a
        coordinate, for example ``"half.q1"``.
    period
        m: the orbits repeat after m forcing periods.
    start
        Where the first orbit is looked for; or the state itself at theta = 0, 2n numbers: positions, then
        velocities.
    walk
        Numerical options of the walk.
    method
        How its orbits are found: `Shooting` or `Balance`, with their options.
    verify
        Whether the result is checked by other means when it is complete; see `gapwalk.verify`.
    """

    parameter: str
    begin: float
    end: float
    measure: str
    period: int = 1
    start: Start | tuple[float, ...] = Start.SETTLE
    walk: WalkOptions = field(default_factory=WalkOptions)
    method: Method = field(default_factory=Shooting)
    verify: bool = field(default=False, compare=False)  # it changes nothing of what is found

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        return f"{self.kind} over {self._range}, period {self.period}, showing {self.measure}"

    @property
    def balanced(self) -> bool:
        """Whether its orbits are stored with their series."""
        return isinstance(self.method, Balance)

    @property
    def _range(self) -> str:
        return f"{self.parameter} from {self.begin:g} to {self.end:g}"


@dataclass(frozen=True, slots=True)
class ResponseOptions(BranchOptions):
    """A response curve: the branch of periodic orbits over one parameter; parameters as `BranchOptions`."""

    kind: ClassVar[str] = "response"


@dataclass(frozen=True, slots=True)
class DiagramStudyOptions(BranchOptions):
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

    max_period: int = _LIMITS.max_period
    max_branches: int = _LIMITS.max_branches
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result
    search_values: int | tuple[float, ...] = _LIMITS.search_values
    search: SearchOptions = _LIMITS.search

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        return (
            f"{self.kind} over {self._range}, period {self.period}, showing {self.measure}, to period "
            f"{self.max_period}{_search_words(self.search_values)}"
        )

    @property
    def limits(self) -> DiagramOptions:
        """How far the diagram goes, and in how many processes."""
        return DiagramOptions(self.max_period, self.max_branches, self.workers, self.search_values, self.search)


@dataclass(frozen=True, slots=True)
class SecondParameter:
    """The second parameter of a plane, and its range.

    Parameters
    ----------
    parameter
        Its name.
    begin, end
        The range.
    """

    parameter: str
    begin: float
    end: float

    @property
    def words(self) -> str:
        """The same in words."""
        return f"{self.parameter} from {self.begin:g} to {self.end:g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class MapStudyOptions(BranchOptions):
    """A map: all loci that bound regimes in the plane of two parameters.

    Parameters
    ----------
    parameter, begin, end, period, start, walk, method
        As `BranchOptions`, for the branches on which the loci are picked up; the range is that of the map too.
    measure
        What tables and lists of motions show.
    second
        The second parameter.
    sections, max_period, kinds, workers, search_values, search
        What the map shows, and where its loci are picked up; as `MapOptions`.
    """

    kind: ClassVar[str] = "map"

    second: SecondParameter
    sections: int | tuple[float, ...] = _MAP.sections
    max_period: int = _MAP.max_period
    kinds: tuple[Kind, ...] = _MAP.kinds
    workers: int | None = field(default=None, compare=False)
    search_values: int | tuple[float, ...] = _MAP.search_values
    search: SearchOptions = _MAP.search

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        return (
            f"{self.kind} over {self._range} and {self.second.words}, period {self.period}, to period "
            f"{self.max_period}{_search_words(self.search_values)}"
        )

    @property
    def limits(self) -> MapOptions:
        """What the map shows, and in how many processes."""
        return MapOptions(self.sections, self.max_period, self.kinds, self.workers, self.search_values, self.search)

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of each parameter, the smaller value first."""
        (a, b), (c, d) = sorted((self.begin, self.end)), sorted((self.second.begin, self.second.end))
        return (a, b), (c, d)


def _search_words(values: int | tuple[float, ...]) -> str:
    """Where a search is to be, for a line that says what is to be done."""
    count = values if isinstance(values, int) else len(values)
    return f", with a search at {count} values" if count else ""


# Each is loaded only when a result holds it, as with `gapwalk.studies.kinds`.
_HOMES = {
    "response": "options.ResponseOptions",
    "diagram": "options.DiagramStudyOptions",
    "map": "options.MapStudyOptions",
    "locus": "locus.study_options.LocusStudyOptions",
    "family": "family.study_options.FamilyStudyOptions",
    "settle": "settle.study_options.SettleStudyOptions",
    "sweep": "sweep.study_options.SweepStudyOptions",
    "basins": "basins.study_options.BasinStudyOptions",
    "regimes": "regimes.study_options.RegimeStudyOptions",
}


def _column_of(kind: str) -> Column:
    module, _, name = _HOMES[kind].rpartition(".")
    return column_of(getattr(import_module(f"gapwalk.studies.{module}"), name))


register(StudyOptions, OneOf(lambda value: value.kind if isinstance(value, StudyOptions) else None, _column_of))
