"""The table of a force by a formula in a model file, ``[[force]]``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import ConfigDict, Field, ValidationInfo, model_validator

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact
from gapwalk.model.contact import force as make_force
from gapwalk.model.laws import Expression
from gapwalk.model.laws.grammar import FormulaError, formula_of
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import MAX_COORDINATES, Direction, Name, Names, OwnName, Part, Text


class ForcePart(Part):
    """A force by a formula: ``[[force]]``. All keys that the schema does not know are parameters of the formula."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: OwnName = Field(description="its parameters begin with it, as in spring.k")
    law: Text = Field(description='write its formula, as in "k*x + c*v": x is its deflection, v the rate of it')
    deflection: Direction | None = None
    deflections: Annotated[dict[Name, Direction], Field(min_length=1, max_length=MAX_COORDINATES)] | None = None
    acts_on: Direction | None = None

    @model_validator(mode="after")
    def _makes_a_force(self, info: ValidationInfo[Names]) -> ForcePart:
        try:
            self.force(info.context.coordinates or [])
        except FormulaError as error:
            raise ValueError(f"law is {given(self.law)}, column {error.column}: {error.reason}") from None
        except ModelError as error:
            raise ValueError(f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}") from None
        return self

    def force(self, coordinates: Sequence[str]) -> Contact:
        """Make the force. A formula without a deflection is one of the coordinates that it names."""
        moves: Any = self.deflections or self.deflection
        if self.deflections and self.deflection:
            raise ModelError("deflection is given together with deflections; leave one of the two out")
        if moves is None:
            names = [*coordinates, *(f"{name}'" for name in coordinates)]
            used = formula_of(self.law, [*names, "v"] if coordinates == ["x"] else names).variables
            found = {"x" if name == "v" and "v" not in coordinates else name.removesuffix("'") for name in used}
            if not found:
                raise ModelError(
                    f"the formula {given(self.law)} names none of the coordinates {', '.join(coordinates)}; write "
                    "deflection = { q1 = 1.0 }, which the formula calls x"
                )
            moves = {name: {name: 1.0} for name in coordinates if name in found}
        numbers, keys = self.model_extra or {}, {*type(self).model_fields}
        made = make_force(self.name, moves, self.law, acts_on=self.acts_on, numbers=self._numbers(numbers, moves))
        for each in made.law.parameters:
            if each.name in keys:
                raise ModelError(f"the formula has a parameter {each.name!r}, which is a key of the table; rename it")
        return made

    def _numbers(self, numbers: Mapping[str, Any], moves: Mapping[str, Any]) -> dict[str, float]:
        """Return the parameters of the formula; refuse what is none, or no number."""
        several = all(isinstance(each, Mapping) for each in moves.values())
        known = [each.name for each in Expression(self.law, tuple(moves) if several else ("x",)).parameters]
        for name, value in numbers.items():
            if name not in known:
                hint = did_you_mean(name, [*known, *type(self).model_fields], "its parameters are")
                raise ModelError(f"{name} is no parameter of the formula {given(self.law)}; {hint}")
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ModelError(f"{name} is {given(value)}; it must be a finite number")
        for name in known:
            if name not in numbers:
                raise ModelError(f"{name} is missing; the formula {given(self.law)} needs it: write {name} = 1.0")
        return dict(numbers)
