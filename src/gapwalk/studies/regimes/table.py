"""The study ``kind = "regimes"`` of a model file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from gapwalk.model.model_fields import Count, one_of
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.studies.basins.table import Resolution, columns_and_rows
from gapwalk.studies.fields import Whole
from gapwalk.studies.map.table import SecondPart
from gapwalk.studies.options import SecondParameter
from gapwalk.studies.regimes.options import Carry
from gapwalk.studies.regimes.study_options import RegimeStudyOptions
from gapwalk.studies.tables import RangePart, Rest, RestOrState, Surroundings, plain_start

_LIMITS = ("carry", "longest", "max_period", "forces", "check", "seed", "workers")


class RegimesPart(RangePart):
    """The study ``kind = "regimes"``: kinds of motion in the plane of two parameters."""

    kind: Literal["regimes"]
    second: SecondPart = Field(
        description='write the second parameter, as in second = { parameter = "mean.q1", from = 0.1, to = 0.5 }'
    )
    resolution: Resolution = 128
    start: RestOrState = Rest.REST
    carry: Annotated[Carry, BeforeValidator(one_of(Carry))] | None = None
    longest: Count | None = None
    max_period: Count | None = None
    forces: bool | None = None
    check: Whole | None = None
    seed: Whole | None = None
    workers: Count | None = None

    @field_validator("second")
    @classmethod
    def _is_another(cls, second: SecondPart, info: ValidationInfo[Surroundings]) -> SecondPart:
        if second.parameter == info.data.get("parameter"):
            raise ValueError(f"has the parameter {given(second.parameter)}, which is the first one; choose another")
        return second

    def system(self, system: System) -> System:
        """The system at the first value of both parameters."""
        return super().system(system).at({self.second.parameter: self.second.begin})

    def options(self, system: System) -> RegimeStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        limits = self.model_dump(include=set(_LIMITS), exclude_none=True)
        second = SecondParameter(self.second.parameter, self.second.begin, self.second.end)
        return RegimeStudyOptions(
            self.parameter,
            self.system(system)[self.parameter],
            self.end,
            second,
            columns_and_rows(self.resolution),
            plain_start(self.start),
            **limits,
        )
