"""The kinds of values that the tables of several studies have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from gapwalk.errors import ModelError
from gapwalk.model.model_fields import Count, Number
from gapwalk.model.schema import by_shape, tagged

Whole = Annotated[int, Field(strict=True, ge=0)]
"""0, 1, 2, ..."""


MAX_VALUES = 100_000
"""Of a parameter, at which something is to be done."""


def count_shape(value: object) -> str:
    """Whether a value is a count, or a list of values."""
    return "values" if isinstance(value, list) else "count"


CountOrValues = Annotated[
    Annotated[Annotated[Count, Field(le=MAX_VALUES)], tagged("count")]
    | Annotated[Annotated[list[Number], Field(min_length=1)], tagged("values")],
    by_shape(count_shape),
]
"""How many values, spread evenly over a range; or the values themselves."""


def check_inside(values: list[float], key: str, ends: tuple[Any, ...]) -> None:
    """A ModelError that begins with a key if one of its values lies outside a range."""
    low, high = sorted(ends)
    for value in values:
        if not low <= value <= high:
            raise ModelError(f"{key} has {value:g}, outside the range from {low:g} to {high:g}")


def with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same values with tuples in place of lists, as frozen options have them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
