"""The ways to find orbits, in a model file: the key ``method``, and a table of options for each."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import BeforeValidator, model_validator

from gapwalk.model.fields import Count, Positive, one_of
from gapwalk.model.schema import Part
from gapwalk.orbit.balance.options import Balance
from gapwalk.orbit.shooting import Shooting


class MethodName(StrEnum):
    """The ways to find orbits, as a model file calls them."""

    SHOOTING = Shooting.name
    BALANCE = Balance.name


class Stability(StrEnum):
    """How harmonic balance tells stability, as a model file calls it."""

    VARIATIONAL = "variational"
    HILL = "hill"


class ShootingPart(Part):
    """Numerical options of orbits that are found by shooting: ``[study.shooting]``."""

    segments: Count | None = None
    tolerance: Positive | None = None

    @model_validator(mode="after")
    def _makes_options(self) -> ShootingPart:
        self.options()
        return self

    def options(self) -> Shooting:
        """The options; what the table does not give has the default of `Shooting`."""
        return Shooting(**self.model_dump(exclude_unset=True))


class BalancePart(Part):
    """Numerical options of orbits that are found by harmonic balance: ``[study.balance]``."""

    harmonics: Count | None = None
    error: Positive | None = None
    stability: Annotated[Stability, BeforeValidator(one_of(Stability))] | None = None
    tolerance: Positive | None = None

    @model_validator(mode="after")
    def _makes_options(self) -> BalancePart:
        self.options()
        return self

    def options(self) -> Balance:
        """The options; what the table does not give has the default of `Balance`."""
        return Balance(**self.model_dump(exclude_unset=True, mode="json"))
