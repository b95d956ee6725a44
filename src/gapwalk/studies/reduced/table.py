"""The table ``[reduction]`` of a model file: how the system is reduced before it is studied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from gapwalk.model.model_fields import Positive, Text
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Problem, given
from gapwalk.model.schema import Part, validate


class ReductionPart(Part):
    """How the system is reduced; what is not given has the defaults of `gapwalk.reduce`."""

    modes: Annotated[int, Field(strict=True, ge=0)] | None = None
    error: Annotated[Positive, Field(ge=1e-8, le=1.0)] | None = None
    up_to: Positive | None = None
    keep: list[Text] = Field(default=[])

    @model_validator(mode="after")
    def _says_one_thing(self) -> ReductionPart:
        if self.modes is not None and self.error is not None:
            raise ValueError("has modes and error; leave one of the two out: the error decides the number of modes")
        return self


def reduction_part(source: Source) -> tuple[ReductionPart | None, list[Problem]]:
    """The table of a file, if it has one, and what is wrong with it."""
    table = source.data.get("reduction")
    if table is None:
        return None, []
    if not isinstance(table, Mapping):
        message = f"is {given(table)}; it must be a table [reduction], such as {{ error = 0.01 }}"
        return None, [source.problem(message, ("reduction",))]
    return validate(ReductionPart, table, source, ("reduction",))
