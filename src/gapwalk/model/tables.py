"""Tables that stand in model files of every form: stages of springs, and terms of the excitation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from gapwalk.model.contact import Side
from gapwalk.model.excitation import Harmonic
from gapwalk.model.fields import (
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
from gapwalk.model.problem import given
from gapwalk.model.schema import Part

SideName = Annotated[Side, BeforeValidator(one_of(Side))]


class StagePart(Part):
    """One spring of a contact: ``[[contact.stage]]``."""

    name: Name | None = None
    clearance: Clearance = Field(description="it is half the width of the gap")
    stiffness: Stiffness = Field(description="it is what this spring adds to the slope of the force")
    cubic: CubicStiffness = 0.0
    side: SideName = Side.BOTH


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
    return study
