"""The study ``kind = "map"`` of a model file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, ValidationInfo, field_validator

from gapwalk.bifurcation.branch import Kind
from gapwalk.errors import ModelError
from gapwalk.model.model_fields import Count, Text, one_of
from gapwalk.model.problems import given
from gapwalk.model.schema import Part
from gapwalk.model.system import System
from gapwalk.studies.diagram.search_table import SearchPart
from gapwalk.studies.fields import CountOrValues, check_inside, with_tuples
from gapwalk.studies.map.options import KINDS
from gapwalk.studies.method_table import ShootingPart
from gapwalk.studies.options import MapStudyOptions, SecondParameter
from gapwalk.studies.tables import BranchPart, Surroundings, Value, check_parameter, check_value

_LIMITS = ("sections", "max_period", "kinds", "workers")


class SecondPart(Part):
    """The second parameter of a map and its range: ``second = { parameter = "mean.q1", from = 0.1, to = 0.5 }``."""

    parameter: Text = Field(description='write the second parameter, as in parameter = "mean.q1"')
    begin: Value = Field(alias="from", description="write where its range begins")
    end: Value = Field(alias="to", description="write where its range ends")

    @field_validator("parameter")
    @classmethod
    def _exists(cls, parameter: str, info: ValidationInfo[Surroundings]) -> str:
        return check_parameter(parameter, info.context)

    @field_validator("begin", "end")
    @classmethod
    def _is_allowed(cls, value: float, info: ValidationInfo[Surroundings]) -> float:
        return check_value(value, info.data.get("parameter"), info.context)

    @field_validator("end")
    @classmethod
    def _differs(cls, end: float, info: ValidationInfo[Surroundings]) -> float:
        if info.data.get("begin") == end:
            raise ValueError(f"is {end:g}, where the range begins; make it wider")
        return end


class PlanePart(BranchPart):
    """What the schemas of the studies in the plane of two parameters have in common."""

    @field_validator("second", check_fields=False)
    @classmethod
    def _is_another(cls, second: SecondPart, info: ValidationInfo[Surroundings]) -> SecondPart:
        if second.parameter == info.data.get("parameter"):
            raise ValueError(f"has the parameter {given(second.parameter)}, which is the first one; choose another")
        return second

    @field_validator("shooting")
    @classmethod
    def _has_one_segment(cls, shooting: ShootingPart) -> ShootingPart:
        if shooting.options().segments > 1:
            raise ModelError(f"segments is {shooting.segments}; a locus is followed with one, so leave this out")
        return shooting


class MapPart(PlanePart):
    """The study ``kind = "map"``: all loci that bound regimes in the plane of two parameters."""

    kind: Literal["map"]
    second: SecondPart = Field(
        description='write the second parameter, as in second = { parameter = "mean.q1", from = 0.1, to = 0.5 }'
    )
    sections: CountOrValues | None = None
    max_period: Count | None = None
    kinds: Annotated[list[Annotated[Kind, PlainValidator(one_of(KINDS))]], Field(min_length=1)] | None = None
    workers: Count | None = None
    search: SearchPart | None = None

    @field_validator("sections")
    @classmethod
    def _lie_in_the_range(cls, sections: Any, info: ValidationInfo[Surroundings]) -> Any:
        second = info.data.get("second")
        if isinstance(sections, list):
            if len(set(sections)) < len(sections):
                raise ValueError(f"is {given(sections)}; each value must stand there once")
            if second is not None:
                check_inside(sections, "sections", (second.begin, second.end))
        return sections

    @field_validator("search")
    @classmethod
    def _search_suits(cls, search: SearchPart | None, info: ValidationInfo[Surroundings]) -> SearchPart | None:
        if search is not None:
            search.check(info.data, info.context.system)
        return search

    @field_validator("kinds")
    @classmethod
    def _without_repeats(cls, kinds: list[Kind] | None) -> list[Kind] | None:
        return kinds and list(dict.fromkeys(kinds))

    def system(self, system: System) -> System:
        """The system at the first value of both parameters."""
        return super().system(system).at({self.second.parameter: self.second.begin})

    def options(self, system: System) -> MapStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        found = with_tuples(self.model_dump(include=set(_LIMITS), exclude_none=True))
        if self.search is not None:
            found |= self.search.options()
        second = SecondParameter(self.second.parameter, self.second.begin, self.second.end)
        return MapStudyOptions(**self.given(system), second=second, **found)
