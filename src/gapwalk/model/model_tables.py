"""Tables that stand in model files of every form: stages of springs, and terms of the excitation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, WrapValidator, field_validator

from gapwalk.model.contact import Side
from gapwalk.model.excitation import Harmonic
from gapwalk.model.model_fields import (
    MAX_COORDINATES,
    Clearance,
    CubicStiffness,
    Direction,
    Name,
    Names,
    Order,
    Phase,
    Stiffness,
    Torque,
    claim,
    one_of,
)
from gapwalk.model.problems import given
from gapwalk.model.schema import Part

MAX_STUDIES = 200
"""In one file: all of them are checked whenever one is asked for."""

SideName = Annotated[Side, BeforeValidator(one_of(Side))]


class StagePart(Part):
    """One spring of a contact: ``[[contact.stage]]``."""

    name: Name | None = None
    clearance: Clearance = Field(description="it is half the width of the gap")
    stiffness: Stiffness = Field(description="it is what this spring adds to the slope of the force")
    cubic: CubicStiffness = 0.0
    side: SideName = Side.BOTH


def _in_order(tables: object, handler: Callable[[object], Any]) -> Any:
    """Look at the order of the stages too where some of them are wrong, so that all is told at once."""
    problem = _order_problem(tables)
    if problem is None:
        return handler(tables)
    try:
        handler(tables)
    except ValidationError as error:
        details: Any = [
            *error.errors(),
            {"type": "value_error", "input": tables, "ctx": {"error": ValueError(problem)}},
        ]
        raise ValidationError.from_exception_data(error.title, details) from None
    raise ValueError(problem)


def _order_problem(tables: object) -> str | None:
    """What is wrong with the order of those stages whose clearance is a plain number."""
    stages = [table for table in tables if isinstance(table, Mapping)] if isinstance(tables, list) else []
    for side in (Side.POSITIVE, Side.NEGATIVE):
        met = [table.get("clearance") for table in stages if table.get("side", Side.BOTH) in (Side.BOTH, side)]
        numbers = [value for value in met if isinstance(value, int | float) and not isinstance(value, bool)]
        for inner, outer in pairwise(value for value in numbers if value >= 0):
            if outer <= inner:
                return (
                    f"is out of order on the {side.value} side: clearance {outer} follows {inner}; list the stages "
                    "from the inside out"
                )
    return None


Stages = Annotated[list[StagePart], Field(max_length=MAX_COORDINATES), WrapValidator(_in_order)]
"""The stages of a contact, from the inside out."""


class HarmonicPart(Part):
    """A term of the excitation: ``[[harmonic]]``."""

    order: Order = 1
    amplitude: Torque = Field(description="it is the size of the load")
    phase: Phase = 0.0
    acts_on: Direction = Field(description="write on which coordinates it acts, as in { q1 = 1.0 }")
    name: Name | None = Field(default=None, validate_default=True)

    @field_validator("name")
    @classmethod
    def _is_free(cls, name: str | None, info: ValidationInfo[Names]) -> str | None:
        if name is not None:
            claim(name, info)
        elif "order" in info.data:
            name = f"harmonic{info.data['order']}"
            if name in info.context.taken:
                raise ValueError(f"is missing, and the default {given(name)} is taken already; write another")
            info.context.taken.add(name)
        return name

    def harmonic(self) -> Harmonic:
        """The harmonic that the table describes."""
        return Harmonic(self.amplitude, self.acts_on, self.order, self.phase, self.name or "")


def study_tables(study: object) -> object:
    """Refuse a study that is neither a table nor a list of tables; its content is read elsewhere."""
    tables = study if isinstance(study, list) and study else [study]
    if not all(isinstance(table, Mapping) for table in tables):
        raise ValueError(f"is {given(study)}; it must be a table [study], or several tables [[study]]")
    if len(tables) > MAX_STUDIES:
        raise ValueError(f"is a list of {len(tables):,} tables; a file may have {MAX_STUDIES} studies")
    return study
