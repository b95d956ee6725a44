"""What a page may ask the explorer to do: each action a small checked record, which is kept beside its result."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from gapwalk.errors import ModelError

Name = Annotated[str, Field(min_length=1, max_length=200)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Values = Annotated[dict[Name, Number], Field(max_length=1000)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Place(_Part):
    """An orbit that the page shows: a point or a special point of a branch, or where a motion has settled.

    Parameters
    ----------
    result
        Which result; empty for the one that was opened.
    branch
        Which of its branches, from 0.
    point, special
        Which point or special point of the branch; neither for a settled motion.
    """

    result: Annotated[str, Field(max_length=100)] = ""
    branch: Annotated[int, Field(ge=0)] = 0
    point: Annotated[int, Field(ge=0)] | None = None
    special: Annotated[int, Field(ge=0)] | None = None


class Compute(_Part):
    """Do the study of the model file, with other values if there are any."""

    do: Literal["compute"]
    study: Annotated[str, Field(max_length=200)] = ""
    values: Values = {}


class Walk(_Part):
    """Walk from an orbit along any parameter to a value."""

    do: Literal["walk"]
    start: Place
    parameter: Name
    to: Number


class Switch(_Part):
    """Walk the branches that begin or cross at a special point, between two values of the parameter of its branch."""

    do: Literal["switch"]
    start: Place
    low: Number
    high: Number


class Search(_Part):
    """Search for motions connected to no known branch, between two values of a parameter.

    Parameters
    ----------
    start
        The motion whose system is searched; None for that of the file that was opened.
    parameter, low, high
        The parameter, and its range.
    count
        At how many values of it to search.
    known
        Results whose branches are known.
    """

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
    """Let the motion settle that begins at the state of an orbit, or at rest, with other values if there are any."""

    do: Literal["settle"]
    start: Place | None = None
    values: Values = {}


Action = Compute | Walk | Switch | Search | FollowLocus | Settle
_ACTION: TypeAdapter[Action] = TypeAdapter(Annotated[Action, Field(discriminator="do")])


def read_action(plain: object) -> Action:
    """The action that a request or a record describes.

    Raises
    ------
    ModelError
        With everything that is wrong with it.
    """
    try:
        return _ACTION.validate_python(plain)
    except ValidationError as error:
        wrong = [f"{'.'.join(map(str, each['loc'][1:])) or 'the request'}: {each['msg']}" for each in error.errors()]
        raise ModelError(f"this cannot be done: {'; '.join(wrong[:5])}") from None


def plain_action(action: Action) -> dict[str, object]:
    """An action as JSON values; `read_action` reads it."""
    return action.model_dump(mode="json")
