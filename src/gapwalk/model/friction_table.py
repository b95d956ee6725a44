"""The table of dry friction in a model file, ``[[friction]]``, in systems and in drive trains."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, create_model, model_validator

from gapwalk.errors import ModelError
from gapwalk.model.contact import Contact, friction
from gapwalk.model.laws import FRICTION
from gapwalk.model.schema import Direction, Name, OwnName, Part, Vector, number_of


class FrictionBase(Part):
    """Dry friction: the keys that it has in systems and in drive trains; see `friction_part`."""

    name: OwnName = Field(description="its parameters begin with it, as in brake.limit")
    normal: Name | None = None

    @classmethod
    def hint_for(cls, key: str, value: object) -> str:
        """Return the line to write in place of a key of another name."""
        words = {
            "mu": 'the coefficient of friction is coefficient, beside normal = "stop", the contact that presses',
            "force": "the force in slip is limit",
            "torque": "the torque in slip is limit",
            "damping": "a damper beside it belongs in the matrix damping, or in a [[shaft]]",
            "hysteresis": "the force in slip is limit; a [[contact]] has hysteresis",
            "clearance": "friction that acts beyond a clearance is the hysteresis of a [[contact]]",
            "law": "friction with a stiffness is a Jenkins element, without one Coulomb's; leave law out",
        }
        return words.get(key, "")

    @model_validator(mode="after")
    def _says_how_much(self) -> FrictionBase:
        given = self.given
        if "limit" in given and "coefficient" in given:
            raise ValueError("has limit together with coefficient; leave one of the two out")
        if "coefficient" in given and self.normal is None:
            raise ValueError(
                'has a coefficient, but no normal; write which contact presses, as in normal = "stop", or write the '
                "force in slip: limit = 0.3"
            )
        if "coefficient" not in given and self.normal is not None:
            raise ValueError("has normal, but no coefficient; write coefficient = 0.3, say")
        if not given.keys() & {"limit", "coefficient"}:
            raise ValueError(
                'has no limit; write limit = ..., the force in slip, or coefficient = 0.3 and normal = "stop", the '
                "contact that presses"
            )
        if "stiffness" in given and "static" in given:
            raise ValueError(
                "has static together with stiffness; a Jenkins element begins to slip at its limit: leave one of the "
                "two out"
            )
        return self

    @property
    def given(self) -> dict[str, Any]:
        """The numbers that the table gives."""
        found = {name: getattr(self, name) for name in FRICTION}
        return {name: value for name, value in found.items() if value is not None}


class PlainFrictionBase(FrictionBase):
    """Dry friction on a deflection of a system."""

    deflection: Direction = Field(description="write by which coordinates it slips, as in { q1 = 1.0 }")
    force: Vector | None = None

    @model_validator(mode="after")
    def _makes_friction(self) -> PlainFrictionBase:
        try:
            self.contact()
        except ModelError as error:
            raise ValueError(f"is refused: {str(error).removeprefix(f'contact {self.name!r}: ')}") from None
        return self

    def contact(self) -> Contact:
        """Make the friction."""
        return friction(self.name, self.deflection, normal=self.normal or "", force=self.force, **self.given)


def friction_part(base: type[FrictionBase] = PlainFrictionBase) -> Any:
    """Return the schema of a table of dry friction, with its numbers."""
    fields: dict[str, Any] = {
        name: (Annotated[number_of(each) | None, Field(description=each.words)], None)
        for name, each in FRICTION.items()
    }
    return create_model(base.__name__.replace("Base", "Part"), __base__=base, **fields)
