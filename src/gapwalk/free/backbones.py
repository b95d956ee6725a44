"""Record of several backbones of one system."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gapwalk.continuation.curve import numbered
from gapwalk.free.backbone_curve import Backbone
from gapwalk.free.island_births import IslandBirth, births_table
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, remarks, row_of, rows_of, summarizes


@dataclass(frozen=True, eq=False)
class Backbones(Shown):
    """Backbones of one system, one for each linear mode or release."""

    lines: tuple[Backbone, ...]  #: The backbones.
    failures: tuple[str, ...] = ()  #: Modes without a backbone, with the reasons, in sentences.
    complete: bool = True  #: True if all were followed.
    #: What the backbones foretell for a load, if that was asked: where isolated branches are born, or join.
    births: tuple[IslandBirth, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks: none."""
        return ()

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return each backbone in words."""
        for line in self.lines:
            yield from line.summary()
        if self.births:
            yield "foretold for the damping of the system:"
            yield births_table(self.births)
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of all points and events, with the number of the backbone."""
        return {
            "points": lambda: numbered("backbone", self.lines, lambda line: line.points),
            "events": lambda: numbered("backbone", self.lines, lambda line: line.events),
            "births": lambda: rows_of(map(row_of, self.births)),
        }
