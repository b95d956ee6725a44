"""The study ``kind = "family"`` of a model file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo, field_validator

from gapwalk.bifurcation.branch import Kind
from gapwalk.model.model_fields import Count, Number, Text, one_of
from gapwalk.model.system import System
from gapwalk.studies.changes import leaves_of
from gapwalk.studies.family.over import MemberParameter
from gapwalk.studies.family.study_options import FamilyStudyOptions
from gapwalk.studies.fields import with_tuples
from gapwalk.studies.tables import BranchPart, Surroundings

_LIMITS = ("max_period", "kinds", "exact", "workers")
_OVER = 'write what differs from member to member, as in over = { "mean.q1" = [0.25, 0.3, 0.35] }'


def _flat(value: Any) -> Any:
    """A table of lists with the full names of parameters: ``mean.q1`` may be written with or without quotes."""
    if not isinstance(value, Mapping):
        return value
    return {".".join(str(key) for key in leaf.path): leaf.value for leaf in leaves_of(value, ())}


class FamilyPart(BranchPart):
    """The study ``kind = "family"``: the branches over one parameter, for several values of another one."""

    kind: Literal["family"]
    called: Text = ""
    values: list[Number] = Field(default_factory=list)
    over: Annotated[dict[str, list[Number]], BeforeValidator(_flat)] = Field(description=_OVER)
    max_period: Count | None = None
    kinds: Annotated[list[Annotated[Kind, PlainValidator(one_of(Kind.known()))]], Field(min_length=1)] | None = None
    exact: bool | None = None
    workers: Count | None = None

    @field_validator("over")
    @classmethod
    def _makes_a_family(cls, over: dict[str, list[float]], info: ValidationInfo[Surroundings]) -> Any:
        given = MemberParameter.of(over, info.data.get("called", ""), info.data.get("values", ()))
        if info.context.system and info.data.get("parameter"):
            given.check(info.context.system, info.data["parameter"], names_only=info.context.guessed)
        return over

    @field_validator("kinds")
    @classmethod
    def _without_repeats(cls, kinds: list[Kind] | None) -> list[Kind] | None:
        return kinds and list(dict.fromkeys(kinds))

    def system(self, system: System) -> System:
        """The system of the first member, at the first value of the parameter."""
        return super().system(system).at(MemberParameter.of(self.over, self.called, self.values).at(0))

    def options(self, system: System) -> FamilyStudyOptions:
        """The options of the study of this system; what is not given has the defaults of the options."""
        found = with_tuples(self.model_dump(include=set(_LIMITS), exclude_none=True))
        return FamilyStudyOptions(
            **self.given(system), over=MemberParameter.of(self.over, self.called, self.values), **found
        )
