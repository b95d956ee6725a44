"""One result on the page: what was asked, how far it has come, and its branches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from gapwalk.attractor.settled import Settled
from gapwalk.continuation.branch import Branch, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.explorer.action import Action, Place
from gapwalk.explorer.task import Progress
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.result import Result

_NOWHERE = (0.0, 0.0)  # the range of a branch that is not finished: nothing leaves it yet


class State(StrEnum):
    """How far a job has come."""

    QUEUED = "queued"
    RUNNING = "running"
    PAUSED = "paused"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self in (State.DONE, State.STOPPED, State.FAILED)


class Line(NamedTuple):
    """A branch as it is shown: its name, its parameter and the range of that, its period, and its points so far."""

    name: str
    parameter: str
    within: tuple[float, float]
    period: int
    points: list[BranchPoint] | tuple[BranchPoint, ...]
    special_points: list[SpecialPoint] | tuple[SpecialPoint, ...]


@dataclass
class Entry:
    """A result, while it is computed and afterwards.

    Attributes
    ----------
    key
        What it is called in requests: the name of its file without the ending; empty for the file that was opened.
    title
        What the page calls it.
    path
        The result file.
    action
        What was asked for; None for a result that was opened.
    state, message
        How far it has come, and what there is to say.
    result
        What is in the file, once the job is over.
    live
        What has been reported so far.
    version
        Grows with each change.
    """

    key: str
    title: str
    path: Path
    action: Action | None = None
    state: State = State.DONE
    message: str = ""
    result: Result | None = None
    live: Progress = field(default_factory=Progress)
    version: int = 0

    def hear(self, news: Progress) -> None:
        """Take in what is new."""
        self.live.points += news.points
        self.live.special_points += news.special_points
        self.live.limbs += news.limbs
        self.live.done, self.live.total = news.done, news.total
        self.version += 1

    def lines(self) -> list[Line]:
        """Its branches as they are shown."""
        if self.result is not None:
            if not self.result.branches:
                return []
            within = _range(self.result)
            return [_line(*each, within) for each in zip(self.result.names, self.result.branches, strict=True)]
        found = [_line(limb.name, limb.branch, _NOWHERE) for limb in self.live.limbs]
        return [*found, *_growing(self.live)] if self.live.points else found

    def settled(self) -> Settled | None:
        """Where a motion has settled, if that is what was asked."""
        record = None if self.result is None or self.result.finding is None else self.result.finding.record
        return record if isinstance(record, Settled) else None

    def motion(self, place: Place) -> Orbit | Settled:
        """The orbit at a place, or where a motion has settled.

        Raises
        ------
        ModelError
            If there is no such place.
        """
        settled = self.settled()
        if settled is not None:
            return settled
        lines = self.lines()
        if place.branch < len(lines):
            line = lines[place.branch]
            kinds = ((place.point, line.points), (place.special, line.special_points))
            for number, places in kinds:
                if number is not None and number < len(places):
                    return places[number].orbit
        raise ModelError(f"{self.title} has no such point any more; reload the page")

    def special(self, place: Place) -> tuple[Line, SpecialPoint]:
        """The special point at a place, and its branch; errors as `motion`."""
        lines = self.lines()
        if place.branch < len(lines) and place.special is not None:
            line = lines[place.branch]
            if place.special < len(line.special_points):
                return line, line.special_points[place.special]
        raise ModelError(f"{self.title} has no such special point any more; reload the page")


def _range(result: Result) -> tuple[float, float]:
    low, high = sorted((result.walked.begin, result.walked.end))
    return low, high


def _line(name: str, branch: Branch, within: tuple[float, float]) -> Line:
    return Line(name, branch.parameter, within, branch.period, branch.points, branch.special_points)


def _growing(live: Progress) -> Iterator[Line]:
    period = live.points[0].orbit.period
    yield Line(f"P{period}-1", "", _NOWHERE, period, list(live.points), list(live.special_points))
