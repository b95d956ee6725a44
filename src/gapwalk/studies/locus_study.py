"""The study of a locus: some special points of one branch, followed in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, PlainValidator, ValidationInfo

from gapwalk.bifurcation.special_point import Kind
from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import Text, one_of
from gapwalk.model.system import System
from gapwalk.model.units import PACES
from gapwalk.studies.bifurcation_map import Which
from gapwalk.studies.map_study import MapStudyOptions, MapWork
from gapwalk.studies.options import ParameterRange, RangeStudy, is_allowed, is_another
from gapwalk.studies.study_schema import WITH_UNIT, Surroundings, check_inside, check_value, key_type

if TYPE_CHECKING:
    from typing import Self


def _where_the_branch_is(at: float | None, info: ValidationInfo[Surroundings]) -> float | None:
    """Return the value at which the branch is walked: the given one, or the model's if it is in the range."""
    name, around = info.data.get("parameter"), info.context
    ends = [info.data[end] for end in ("begin", "end") if end in info.data]
    if at is not None:
        at = check_value(at, name, around)
        if len(ends) == 2:
            check_inside([at], "at", (ends[0], ends[1]))
        return at
    if name is None or len(ends) < 2 or around.system is None or around.guessed:
        return None
    if name in PACES and not around.frequency_given:
        raise ValueError("is missing, and the file gives no frequency; write at which value the branch is walked")
    own, (low, high) = around.system[name], sorted(ends)
    if not low <= own <= high:
        raise ValueError(
            f"is missing, and the model has {name} = {own:g}, outside the range from {low:g} to {high:g}; write "
            "a value in this range, at which the branch with the special points is walked"
        )
    return own


def _is_a_contact(contact: str, info: ValidationInfo[Surroundings]) -> str:
    if contact and info.data.get("of", Kind.GRAZING) is not Kind.GRAZING:
        raise ValueError(f"selects among grazing points; leave it out for of = {given(info.data['of'].value)}")
    system = info.context.system
    names = [form.name for form in system.structure.contacts if form.stages] if system else []
    if contact and system and contact.split(" ", maxsplit=1)[0] not in names:
        raise ValueError(f"is {given(contact)}, which is no contact; {did_you_mean(contact, names)}")
    return contact


@dataclass(frozen=True)
class _SecondWithPlace(ParameterRange):
    """The second parameter of a locus, and the value at which the branch is walked: ``at = 0.25``."""

    at: Annotated[float | None, Field(validate_default=True), WITH_UNIT, AfterValidator(_where_the_branch_is)] = None


LocusSecond = Annotated[
    key_type(_SecondWithPlace),
    Field(description='write the second parameter, as in second = { parameter = "mean.q1", from = 0.1, to = 0.5 }'),
    AfterValidator(is_another),
]


@dataclass(frozen=True)
class LocusStudyOptions(MapStudyOptions):
    r"""The loci of some special points of one branch: a map of one kind, with one section on which it is walked."""

    kind: ClassVar[str] = "locus"
    table_types: ClassVar[Mapping[str, Any]] = {
        **{name: kind for name, kind in MapStudyOptions.table_types.items() if name != "search"},
        **dict.fromkeys(("sections", "max_period", "kinds", "workers", "search"), None),
        "second": LocusSecond,
        "of": (
            Annotated[Kind, PlainValidator(one_of(Kind.with_locus))],
            Field(description='write which special points are followed, as in of = "grazing"'),
        ),
        "contact": Annotated[Text, AfterValidator(_is_a_contact)],
    }

    #: Value that selects only the special point nearest to this value of the first parameter; by default all are
    #: followed.
    near: Annotated[float | None, WITH_UNIT, AfterValidator(is_allowed)] = field(default=None, kw_only=True)
    contact: str = field(default="", kw_only=True)  #: Contact that selects among grazing points.

    def __post_init__(self) -> None:
        if not isinstance(self.sections, tuple) or len(self.sections) != 1 or len(self.kinds) != 1:
            raise ModelError(
                "a locus begins at one value of the second parameter and has one kind, as in sections=(0.25,), "
                "kinds=(gw.Kind.FOLD,)"
            )
        self.which  # noqa: B018  (raises what is wrong with it)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table, with its keys ``of`` (the kind) and ``at`` (the second parameter)."""
        found = {name: value for name, value in values.items() if name != "of"}
        second = values["second"]
        plain = ParameterRange(second.parameter, second.begin, second.end)
        at = system[second.parameter] if second.at is None else second.at
        return super().of_table({**found, "kinds": (values["of"],), "second": plain, "sections": (at,)}, system)

    def first_system(self, system: System) -> System:
        """Return the system at the first value of the parameter, and at the value of the second for the walk."""
        assert isinstance(self.sections, tuple)
        first, (at,) = RangeStudy.first_system(self, system), self.sections
        return first if first[self.second.parameter] == at else first.at({self.second.parameter: at})

    def work(self, system: System) -> MapWork:
        """Return the work on the loci."""
        return MapWork(system, self, self.which)

    @property
    def which(self) -> Which:
        """Selection of the special points to follow."""
        return Which(self.kinds[0], self.near, self.contact)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        assert isinstance(self.sections, tuple)
        return (
            f"{self.kind} of {self.which.words} over {self.range_words} and {self.second.words}, picked up at "
            f"{self.second.parameter} = {self.sections[0]:g}, period {self.period}"
        )
