"""The ways to find orbits, in a model file: the key ``method``, and a table of options for each."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, model_validator

from gapwalk.model.model_fields import Count, Positive, one_of
from gapwalk.model.schema import Part
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting


def method_name(value: object) -> str:
    """The name of a method; a ValueError for what is none."""
    return one_of(method.name for method in Method.known())(value)


class Stability(StrEnum):
    """How harmonic balance tells stability, as a model file calls it."""

    VARIATIONAL = "variational"
    HILL = "hill"


class MethodPart(Part):
    """Numerical options of orbits that are found by one method."""

    method: ClassVar[type[Method]]

    @model_validator(mode="after")
    def _makes_options(self) -> MethodPart:
        self.options()
        return self

    def options(self) -> Any:
        """The options; what the table does not give has the default of the method."""
        return self.method(**self.model_dump(exclude_unset=True, mode="json"))


class ShootingPart(MethodPart):
    """Numerical options of orbits that are found by shooting: ``[study.shooting]``."""

    method: ClassVar[type[Method]] = Shooting

    segments: Count | None = None
    tolerance: Positive | None = None


class BalancePart(MethodPart):
    """Numerical options of orbits that are found by harmonic balance: ``[study.balance]``."""

    method: ClassVar[type[Method]] = Balance

    harmonics: Count | None = None
    error: Positive | None = None
    stability: Annotated[Stability, BeforeValidator(one_of(Stability))] | None = None
    tolerance: Positive | None = None
