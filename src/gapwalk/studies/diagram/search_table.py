"""The table ``[study.search]`` of a model file: the search for branches connected to no other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.model_fields import Count, Positive
from gapwalk.model.schema import Part
from gapwalk.model.system import System
from gapwalk.studies.fields import CountOrValues, Whole, check_inside, with_tuples


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
