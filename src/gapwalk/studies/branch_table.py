"""The tables ``[study]`` of frequency responses and diagrams."""

from __future__ import annotations

from typing import Literal

from pydantic import ValidationInfo, field_validator

from gapwalk.model.model_fields import Count
from gapwalk.model.system import System
from gapwalk.studies.diagram.search_table import SearchPart
from gapwalk.studies.options import DiagramStudyOptions, ResponseOptions
from gapwalk.studies.tables import BranchPart, Surroundings


class ResponsePart(BranchPart):
    """The study ``kind = "response"``: one branch over one parameter."""

    kind: Literal["response"]

    def options(self, system: System) -> ResponseOptions:
        """The options of the study of this system."""
        return ResponseOptions(**self.given(system))


class DiagramPart(BranchPart):
    """The study ``kind = "diagram"``: all branches that are attached to the first one, and those of a search."""

    kind: Literal["diagram"]
    max_period: Count | None = None
    max_branches: Count | None = None
    workers: Count | None = None
    search: SearchPart | None = None

    @field_validator("search")
    @classmethod
    def _lies_in_the_range(cls, search: SearchPart | None, info: ValidationInfo[Surroundings]) -> SearchPart | None:
        if search is not None:
            search.check(info.data, info.context.system)
        return search

    def options(self, system: System) -> DiagramStudyOptions:
        """The options of the study of this system; limits that are not given have the defaults of the options."""
        limits = {name: getattr(self, name) for name in ("max_period", "max_branches", "workers")}
        found = {name: value for name, value in limits.items() if value is not None}
        if self.search is not None:
            found |= self.search.options()
        return DiagramStudyOptions(**self.given(system), **found)
