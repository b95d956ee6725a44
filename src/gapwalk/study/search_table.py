"""The table ``[study.search]`` of a model file: the search for branches that hang together with no other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from gapwalk.bifurcation.search import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.fields import Count, Number, Positive
from gapwalk.model.schema import Part, by_shape, tagged
from gapwalk.model.system import System
from gapwalk.study.plain import with_tuples

Whole = Annotated[int, Field(strict=True, ge=0)]


def count_shape(value: object) -> str:
    """Whether a value is a count, or a list of values."""
    return "values" if isinstance(value, list) else "count"


CountOrValues = Annotated[
    Annotated[Count, tagged("count")] | Annotated[Annotated[list[Number], Field(min_length=1)], tagged("values")],
    by_shape(count_shape),
]
"""How many values, spread evenly over a range; or the values themselves."""


class SearchPart(Part):
    """Where and how thoroughly to search; but for the values, the keys are those of `SearchOptions`."""

    values: CountOrValues = Field(description="write at how many values of the parameter to search, or a list of them")
    starts: Count | None = None
    periods: Count | None = None
    newton_starts: Whole | None = None
    newton_periods: list[Count] | None = None
    patience: Annotated[int, Field(strict=True, ge=16)] | None = None
    box: list[Positive] | None = None
    spread: Positive | None = None
    seed: Whole | None = None
    block: Count | None = None

    @model_validator(mode="after")
    def _makes_options(self) -> SearchPart:
        self.options()
        return self

    def check(self, study: Mapping[str, Any], system: System | None) -> None:
        """Refuse what does not suit the study: values outside its range, a box of another size than the state.

        Raises
        ------
        ModelError
            Its message begins with the key that is wrong.
        """
        ends = (study.get("begin"), study.get("end"))
        if isinstance(self.values, list) and None not in ends:
            check_inside(self.values, "values", ends)
        if self.box is not None and system and len(self.box) != 2 * system.size:
            raise ModelError(
                f"box is a list of {len(self.box)} numbers; it must have {2 * system.size}: half-widths of the box of "
                "starts in the positions, then in the velocities"
            )

    def options(self) -> dict[str, Any]:
        """The options `search_values` and `search`; what is not given has the default of `SearchOptions`."""
        found = with_tuples(self.model_dump(exclude_none=True))
        return {"search_values": found.pop("values"), "search": SearchOptions(**found)}


def check_inside(values: list[float], key: str, ends: tuple[Any, ...]) -> None:
    """A ModelError that begins with a key if one of its values lies outside a range."""
    low, high = sorted(ends)
    for value in values:
        if not low <= value <= high:
            raise ModelError(f"{key} has {value:g}, outside the range from {low:g} to {high:g}")
