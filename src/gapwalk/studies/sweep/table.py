"""The study ``kind = "sweep"`` of a model file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from gapwalk.attractors.box import state_names
from gapwalk.model.model_fields import Count, Number, Positive, Text
from gapwalk.model.schema import by_shape, tagged
from gapwalk.model.system import System
from gapwalk.studies.fields import Whole, count_shape
from gapwalk.studies.sweep.options import SweepOptions
from gapwalk.studies.sweep.study_options import SweepStudyOptions
from gapwalk.studies.sweep.transient import Patience
from gapwalk.studies.tables import RangePart, State, Surroundings, check_signal

_LIMITS = ("steps", "ways", "points", "seed", "max_period", "kick", "workers")
_PATIENCE = ("shortest", "longest", "tolerance")
_Starts = Annotated[
    Annotated[Count, tagged("count")] | Annotated[Annotated[list[State], Field(min_length=1)], tagged("values")],
    by_shape(count_shape),
]


class SweepPart(RangePart):
    """The study ``kind = "sweep"``: settled motions over one parameter."""

    kind: Literal["sweep"]
    signal: Text = ""
    steps: Count | None = None
    ways: Text | None = None
    points: Count | None = None
    starts: _Starts | None = None
    seed: Whole | None = None
    max_period: Count | None = None
    shortest: Count | None = None
    longest: Count | None = None
    tolerance: Positive | None = None
    kick: Number | None = None
    workers: Count | None = None

    @field_validator("signal")
    @classmethod
    def _is_a_signal(cls, signal: str, info: ValidationInfo[Surroundings]) -> str:
        system = info.context.system
        return check_signal(signal, state_names(system.coordinates) if system and signal else [])

    @model_validator(mode="after")
    def _makes_options(self) -> SweepPart:
        SweepOptions(**self._limits())
        return self

    def options(self, system: System) -> SweepStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        begin = self.system(system)[self.parameter]
        signal = self.signal or system.coordinates[0]
        return SweepStudyOptions(self.parameter, begin, self.end, signal, **self._limits())

    def _limits(self) -> dict[str, Any]:
        found = self.model_dump(include=set(_LIMITS), exclude_none=True)
        patience = Patience(**self.model_dump(include=set(_PATIENCE), exclude_none=True))
        if self.starts is not None:
            found["starts"] = self.starts if isinstance(self.starts, int) else tuple(map(tuple, self.starts))
        return found | {"patience": patience}
