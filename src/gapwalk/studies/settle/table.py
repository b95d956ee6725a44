"""The study ``kind = "settle"`` of a model file."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import ValidationInfo, field_validator, model_validator

from gapwalk.attractors.settle import SettleOptions
from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_place
from gapwalk.model.model_fields import Angle, Count, Positive, Text
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.studies.settle.study_options import SettleStudyOptions
from gapwalk.studies.tables import Rest, RestOrState, StudyPart, Surroundings, plain_start

_LIMITS = ("max_periods", "max_period", "tolerance")


class SettlePart(StudyPart):
    """The study ``kind = "settle"``: where a motion settles."""

    kind: Literal["settle"]
    start: RestOrState = Rest.REST
    signal: Text = ""
    phase: Angle = 0.0
    max_periods: Count | None = None
    max_period: Count | None = None
    tolerance: Positive | None = None

    @field_validator("signal")
    @classmethod
    def _is_a_signal(cls, signal: str, info: ValidationInfo[Surroundings]) -> str:
        if signal and info.context.system:
            try:
                signal_place(info.context.system, signal)
            except ModelError as error:
                raise ValueError(f"is {given(signal)}, but {error}") from None
        return signal

    @field_validator("phase")
    @classmethod
    def _lies_in_one_turn(cls, phase: float) -> float:
        if not 0.0 <= phase < 2.0 * math.pi:
            raise ValueError(f"is {given(phase)} radians; it must be at least 0 and less than a whole turn, 2 pi")
        return phase

    @model_validator(mode="after")
    def _makes_options(self) -> SettlePart:
        SettleOptions(**self.model_dump(include=set(_LIMITS), exclude_none=True))
        return self

    def options(self, system: System) -> SettleStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        limits = self.model_dump(include=set(_LIMITS), exclude_none=True)
        signal = self.signal or system.coordinates[0]
        return SettleStudyOptions(signal, plain_start(self.start), self.phase, **limits)
