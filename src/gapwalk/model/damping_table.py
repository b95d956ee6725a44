"""Damping in a model file without its matrix: ``damping = { mass = 0.02, stiffness = 0.002 }`` or by modal ratios."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from gapwalk.model.damping import Damping, ModalDamping, ProportionalDamping
from gapwalk.model.model_fields import Matrix, NonNegative, Number
from gapwalk.model.schema import Part, by_shape, tagged


class DampingPart(Part):
    """The table of a damping: in proportion to mass and stiffness, or by the ratios of the modes."""

    mass: Number | None = None
    stiffness: Number | None = None
    ratios: (
        Annotated[
            Annotated[NonNegative, tagged("one")] | Annotated[list[NonNegative], Field(min_length=1), tagged("many")],
            by_shape(lambda value: "many" if isinstance(value, list) else "one"),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _says_one_thing(self) -> DampingPart:
        if self.ratios is not None and (self.mass is not None or self.stiffness is not None):
            raise ValueError("has ratios beside mass or stiffness; leave one of the two out")
        return self

    def damping(self) -> Damping:
        """What the table describes."""
        if self.ratios is not None:
            return ModalDamping(self.ratios)
        return ProportionalDamping(self.mass or 0.0, self.stiffness or 0.0)


DampingField = Annotated[
    Annotated[DampingPart, tagged("table")] | Annotated[Matrix, tagged("numbers")],
    by_shape(lambda value: "table" if isinstance(value, Mapping) else "numbers"),
]
"""A damping in a model file: its matrix, the diagonal of it, or a table."""
