"""Requests of a page: what it asks to be computed, and from which orbit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from gapwalk.errors import ModelError

MOST_SECONDS = 120
"""Length of one way of a run-up that a page can ask for."""

Name = Annotated[str, Field(min_length=1, max_length=200)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Values = Annotated[dict[Name, Number], Field(max_length=1000)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Place(_Part):
    """An orbit on the page: a point or a special point of a branch, or a settled motion."""

    result: Annotated[str, Field(max_length=100)] = ""
    branch: Annotated[int, Field(ge=0)] = 0
    point: Annotated[int, Field(ge=0)] | None = None
    special: Annotated[int, Field(ge=0)] | None = None


class Compute(_Part):
    """Run a study of the model file, with changed values if any are given."""

    do: Literal["compute"]
    study: Annotated[str, Field(max_length=200)] = ""
    values: Values = {}


class Walk(_Part):
    """Follow the branch from an orbit along any parameter to a value."""

    do: Literal["walk"]
    start: Place
    parameter: Name
    to: Number


class Switch(_Part):
    """Follow the branches that begin or cross at a special point, between two values of the parameter of its branch."""

    do: Literal["switch"]
    start: Place
    low: Number
    high: Number


class Search(_Part):
    """Search for isolated branches: motions connected to no known branch, between two values of a parameter."""

    do: Literal["search"]
    start: Place | None = None
    parameter: Name
    low: Number
    high: Number
    count: Annotated[int, Field(ge=1, le=3000)] = 60
    known: Annotated[list[Annotated[str, Field(max_length=100)]], Field(max_length=500)] = []


class FollowLocus(_Part):
    """Follow a special point in two parameters: that of its branch, between two values, and a second one."""

    do: Literal["locus"]
    start: Place
    low: Number
    high: Number
    second: Name
    second_low: Number
    second_high: Number


class Settle(_Part):
    """Let a motion settle that begins at the state of an orbit, or from zero, with changed values if any are given."""

    do: Literal["settle"]
    start: Place | None = None
    values: Values = {}


class RunUp(_Part):
    """Run the speed up, down, or both, in some seconds, from the motion that settles at the first speed."""

    do: Literal["runup"]
    start: Place | None = None
    values: Values = {}
    low: Annotated[Number, Field(gt=0)]
    high: Annotated[Number, Field(gt=0)]
    seconds: Annotated[Number, Field(gt=0, le=MOST_SECONDS)] = 10.0
    way: Literal["up", "down", "both"] = "both"


Action = Compute | Walk | Switch | Search | FollowLocus | Settle | RunUp
_ACTION: TypeAdapter[Action] = TypeAdapter(Annotated[Action, Field(discriminator="do")])


def read_action(plain: object) -> Action:
    """Read an action from the JSON values of a request or a stored record."""
    try:
        return _ACTION.validate_python(plain)
    except ValidationError as error:
        wrong = [f"{'.'.join(map(str, each['loc'][1:])) or 'the request'}: {each['msg']}" for each in error.errors()]
        raise ModelError(f"this request is not valid: {'; '.join(wrong[:5])}") from None


def plain_action(action: Action) -> dict[str, object]:
    """Write an action as JSON values, which `read_action` reads."""
    return action.model_dump(mode="json")
