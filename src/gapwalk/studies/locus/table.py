"""The study ``kind = "locus"`` of a model file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PlainValidator, ValidationInfo, field_validator

from gapwalk.bifurcation.branch import Kind
from gapwalk.model.model_fields import Text, one_of
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.system import System
from gapwalk.model.units import PACES
from gapwalk.studies.fields import check_inside
from gapwalk.studies.locus.study_options import LocusStudyOptions
from gapwalk.studies.map.options import KINDS
from gapwalk.studies.map.table import PlanePart, SecondPart
from gapwalk.studies.options import SecondParameter
from gapwalk.studies.tables import Surroundings, Value, check_value


class LocusSecondPart(SecondPart):
    """The second parameter of a locus, and where in its range the branch is walked: ``at = 0.25``."""

    at: Value | None = Field(default=None, validate_default=True)

    @field_validator("at")
    @classmethod
    def _lies_in_the_range(cls, at: float | None, info: ValidationInfo[Surroundings]) -> float | None:
        """The value at which the branch is walked: that of the model, if it has one in the range, or one given."""
        name, around = info.data.get("parameter"), info.context
        ends = [info.data[end] for end in ("begin", "end") if end in info.data]
        if at is not None:
            at = check_value(at, name, around)
            if len(ends) == 2:
                check_inside([at], "at", (ends[0], ends[1]))
            return at
        if name is None or len(ends) < 2 or around.system is None or around.guessed:
            return None
        if name in PACES and not around.frequency_given:
            raise ValueError("is missing, and the file gives no frequency either; write where the branch is walked")
        own, (low, high) = around.system[name], sorted(ends)
        if not low <= own <= high:
            raise ValueError(
                f"is missing, and the model has {name} = {own:g}, outside the range from {low:g} to {high:g}; write "
                "where in the range the branch is walked on which the special points lie"
            )
        return own


class LocusPart(PlanePart):
    """The study ``kind = "locus"``: some special points of one branch, followed in the plane of two parameters."""

    kind: Literal["locus"]
    second: LocusSecondPart = Field(
        description='write the second parameter, as in second = { parameter = "mean.q1", from = 0.1, to = 0.5 }'
    )
    of: Annotated[Kind, PlainValidator(one_of(KINDS))] = Field(
        description='write which special points are followed, as in of = "grazing"'
    )
    near: Value | None = None
    contact: Text = ""

    @field_validator("near")
    @classmethod
    def _lies_in_the_range(cls, near: float | None, info: ValidationInfo[Surroundings]) -> float | None:
        if near is None:
            return None
        return check_value(near, info.data.get("parameter"), info.context)

    @field_validator("contact")
    @classmethod
    def _is_a_contact(cls, contact: str, info: ValidationInfo[Surroundings]) -> str:
        if contact and info.data.get("of", Kind.GRAZING) is not Kind.GRAZING:
            raise ValueError(f'is for of = "grazing"; leave it out for {given(info.data["of"].value)}')
        system = info.context.system
        names = [form.name for form in system.structure.contacts] if system else []
        if contact and system and contact.split(" ", maxsplit=1)[0] not in names:
            raise ValueError(f"is {given(contact)}, which is no contact; {did_you_mean(contact, names)}")
        return contact

    def system(self, system: System) -> System:
        """The system at the first value of the parameter, and at the value of the second where the branch is walked."""
        found = super().system(system)
        return found if self.second.at is None else found.at({self.second.parameter: self.second.at})

    def options(self, system: System) -> LocusStudyOptions:
        """The options of the study of this system."""
        second = SecondParameter(self.second.parameter, self.second.begin, self.second.end)
        place = self.system(system)[second.parameter]
        which = {"kinds": (self.of,), "near": self.near, "contact": self.contact}
        return LocusStudyOptions(**self.given(system), second=second, sections=(place,), **which)
