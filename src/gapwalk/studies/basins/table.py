"""The study ``kind = "basins"`` of a model file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from gapwalk.attractors.box import Window
from gapwalk.model.model_fields import Count, Number
from gapwalk.model.schema import by_shape, tagged
from gapwalk.model.system import System
from gapwalk.studies.basins.study_options import BasinStudyOptions
from gapwalk.studies.fields import Whole, count_shape
from gapwalk.studies.grid import check_resolution
from gapwalk.studies.tables import StudyPart, Surroundings

_LIMITS = ("longest", "max_period", "tries", "exact_borders", "check", "seed", "workers")
_PLANE = 'write two axes, each with its range, as in plane = { q1 = [-4.0, 4.0], "q1\'" = [-4.0, 4.0] }'
_Pair = Annotated[list[Count], Field(min_length=2, max_length=2)]
Resolution = Annotated[
    Annotated[Count, tagged("count")] | Annotated[_Pair, tagged("values")],
    by_shape(count_shape),
    AfterValidator(lambda given: check_resolution(columns_and_rows(given)) and given),
]
"""Cells along each axis of a plane; or columns and rows."""


def columns_and_rows(resolution: int | list[int]) -> tuple[int, int]:
    """A resolution as options have it."""
    columns, rows = (resolution, resolution) if isinstance(resolution, int) else resolution
    return columns, rows


class BasinsPart(StudyPart):
    """The study ``kind = "basins"``: basins of attraction in a plane of initial states."""

    kind: Literal["basins"]
    plane: dict[str, list[Number]] = Field(description=_PLANE)
    fixed: dict[str, Number] = Field(default_factory=dict)
    resolution: Resolution = 128
    longest: Count | None = None
    max_period: Count | None = None
    tries: Count | None = None
    exact_borders: bool | None = None
    check: Whole | None = None
    seed: Whole | None = None
    workers: Count | None = None

    @field_validator("plane")
    @classmethod
    def _is_a_plane(cls, plane: dict[str, list[float]], info: ValidationInfo[Surroundings]) -> Any:
        system = info.context.system
        if len(plane) != 2:
            raise ValueError(f"names {len(plane)} {'axis' if len(plane) == 1 else 'axes'}; {_PLANE}")
        if system is not None:
            Window.of(system, plane, {})
        return plane

    @field_validator("fixed")
    @classmethod
    def _is_fixed(cls, fixed: dict[str, float], info: ValidationInfo[Surroundings]) -> Any:
        system, plane = info.context.system, info.data.get("plane")
        if system is not None and plane is not None:
            Window.of(system, plane, fixed)
        return fixed

    def options(self, system: System) -> BasinStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        limits = self.model_dump(include=set(_LIMITS), exclude_none=True)
        window = Window.of(system, self.plane, self.fixed)
        return BasinStudyOptions(window, columns_and_rows(self.resolution), **limits)
