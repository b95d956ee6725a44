"""What a job tells while it is done: branches, points and loci as they come, four times a second at most."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusPoint
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.studies.map import Map, Section

SECONDS = 0.25
"""Between two reports of progress: a page that is told more often only works more."""


Step = tuple[BranchPoint | LocusPoint, Sequence[SpecialPoint | Codim2Point]]
"""A point, and the special points before it."""


class NamedLocus(NamedTuple):
    """A locus that was finished, and its name."""

    name: str
    locus: Locus


@dataclass
class Progress:
    """What is new since the last report.

    Parameters
    ----------
    steps
        Points of the branch or the locus that is being walked, each with the special points before it.
    kind, second
        What happens on the locus that is being walked, and its second parameter; None and empty for a branch.
    members, loci
        Branches and loci that were finished.
    done, total
        Parts of what has no branches, such as a search.
    """

    steps: list[Step] = field(default_factory=list)
    kind: Kind | None = None
    second: str = ""
    members: list[DiagramBranch] = field(default_factory=list)
    loci: list[NamedLocus] = field(default_factory=list)
    done: int = 0
    total: int = 0

    def add(self, more: Progress) -> None:
        """Take in what came after."""
        for name in ("steps", "members", "loci"):
            getattr(self, name).extend(getattr(more, name))
        self.kind, self.second = more.kind or self.kind, more.second or self.second
        if more.total:
            self.done, self.total = more.done, more.total


class News:
    """Gathers what is new, and tells it now and then.

    Parameters
    ----------
    tell
        Called with what is new.
    """

    def __init__(self, tell: Callable[[Progress], object]) -> None:
        self._tell, self._progress, self._told = tell, Progress(), 0.0

    def point(self, point: BranchPoint | LocusPoint, special_points: list[Any]) -> None:
        """A new point of what is being walked, and the special points before it."""
        self._progress.steps.append((point, special_points))
        self._now_and_then()

    def locus(self, kind: Kind, second: str) -> None:
        """The points to come are those of a locus."""
        self._progress.kind, self._progress.second = kind, second

    def member(self, diagram: Diagram, member: DiagramBranch) -> None:
        """A new branch of a diagram."""
        self._progress.members.append(member)
        self._now_and_then()

    def chart(self, chart: Map, addition: Section | Locus) -> None:
        """A new section, or a new locus, of a map."""
        if isinstance(addition, Locus):
            self._progress.loci.append(NamedLocus(chart.names[-1], addition))
        else:
            number = len(chart.sections)
            self._progress.members += [DiagramBranch(f"S{number}-{name}", branch) for name, branch in addition.named]
        self._now_and_then()

    def part(self, *about: Any) -> None:
        """A part of what has no branches; the last of the arguments says how many are done."""
        pace = about[-1]
        self._progress.done, self._progress.total = getattr(pace, "done", 0), getattr(pace, "total", 0)
        self._now_and_then()

    def tell(self) -> None:
        """Tell what is new now."""
        progress, self._progress, self._told = self._progress, Progress(), time.monotonic()
        self._tell(progress)

    def _now_and_then(self) -> None:
        if time.monotonic() - self._told >= SECONDS:
            self.tell()
