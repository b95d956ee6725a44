"""The table ``[reduction]`` of a model file, and the record of how the system of a study was reduced."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field, model_validator

from gapwalk.errors import GapwalkError, ModelError
from gapwalk.model.model_file import refusal, validate
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Path, Problem, given
from gapwalk.model.schema import Part, Positive, Text
from gapwalk.model.system import System
from gapwalk.studies.set_values import study_tables, walked_parameters


@dataclass(frozen=True)
class ReducedFrom:
    """Origin of a reduced system."""

    degrees: int  #: Degrees of freedom of the full system.
    kept: tuple[str, ...]  #: The coordinates that are kept.
    modes: int  #: The number of modes.
    #: up_to, error: As in `gapwalk.Reduction`.
    up_to: float
    error: float
    #: The `gapwalk.Reduction` itself, if the study was read from a model file; it is not stored in a result.
    reduction: Any = field(default=None, compare=False, repr=False, metadata={"stored": False})

    @property
    def words(self) -> str:
        """The reduction in words."""
        return (
            f"reduced from {self.degrees} degrees of freedom to {len(self.kept) + self.modes}: {len(self.kept)} kept, "
            f"{self.modes} modes; contacts deflect within {self.error:.1e} up to frequency {self.up_to:g}"
        )


def reduce_for(source: Source, at: Path, part: ReductionPart, full: System) -> tuple[ReducedFrom | None, list[Problem]]:
    """Reduce the system of a study; every coordinate that the study names is kept."""
    from gapwalk.reduction import reduce  # only now: few studies need it

    table = study_tables(source)[at]
    keep = [*part.keep, *(name for name in full.coordinates if name in set(_words(table)) - set(part.keep))]
    up_to = part.up_to or _highest(table) or full.frequency
    try:
        found = reduce(full, modes=part.modes, error=part.error, up_to=up_to, keep=keep)
    except GapwalkError as error:
        return None, [source.problem(f"cannot be done: {refusal_of(error)}", ("reduction",))]
    problems = [
        source.problem(
            f"walks {name}, whose value in the reduced system contains what the other coordinates give; leave "
            "[reduction] out, or walk a parameter of a contact or of the excitation",
            at,
        )
        for name in walked_parameters(table)
        if name in found.system.structure.names
        and name in full.structure.names
        and abs(found.system[name] - full[name]) > 1e-9 * (abs(full[name]) + 1e-300)
    ]
    origin = ReducedFrom(full.size, found.kept, found.modes, found.up_to, found.error, found)
    return origin, problems


def refusal_of(error: GapwalkError) -> str:
    """Return the message of an error in one line."""
    return refusal(error) if isinstance(error, ModelError) else str(error)


def _words(value: object) -> Iterator[str]:
    """Yield all names in the texts of a table, keys included: ``half.q7``, ``q7'`` and ``mean.q7`` name q7."""
    if isinstance(value, str):
        yield from re.findall(r"\w+", value)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _words(str(key))
            yield from _words(item)
    elif isinstance(value, list):
        for item in value:
            yield from _words(item)


def _highest(table: Mapping[str, Any]) -> float | None:
    """Return the highest frequency to which a study walks, if the table gives it."""
    second = table.get("second")
    ranges = [table, second if isinstance(second, Mapping) else {}]
    values = [each.get(key) for each in ranges if each.get("parameter") == "frequency" for key in ("from", "to")]
    numbers = [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    return max((value for value in numbers if 0.0 < value < float("inf")), default=None)


class ReductionPart(Part):
    """Options of the reduction; the defaults are those of `gapwalk.reduce`."""

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
    """Return the table of a file, if it has one, and its problems."""
    table = source.data.get("reduction")
    if table is None:
        return None, []
    if not isinstance(table, Mapping):
        message = f"is {given(table)}; it must be a table [reduction], such as {{ error = 0.01 }}"
        return None, [source.problem(message, ("reduction",))]
    return validate(ReductionPart, table, source, ("reduction",))
