"""One result on the page: what was asked, how far it has come, and its branches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from gapwalk.attractors.settled import Settled
from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusPoint
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.explorer.action import Action, Place
from gapwalk.explorer.news import Progress
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.result import Result

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
    """A branch, or a locus, as it is shown.

    Attributes
    ----------
    name
        Its name.
    parameter
        The parameter that is walked; of a locus, the first one.
    within
        The range of that.
    period
        m, forcing periods of its orbits.
    points, special_points
        Its points so far, and its special points; of a locus, the points of codimension two.
    kind
        What happens on a locus; None for a branch.
    second
        The second parameter of a locus; otherwise empty.
    """

    name: str
    parameter: str
    within: tuple[float, float]
    period: int
    points: Sequence[BranchPoint | LocusPoint]
    special_points: Sequence[SpecialPoint | Codim2Point]
    kind: Kind | None = None
    second: str = ""


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
    model
        The mark of the model file that it was computed from; see `gapwalk.explorer.mark`.
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
    model: str = ""

    @property
    def can_go_on(self) -> bool:
        """Whether it was stopped before its end, so that it can go on, or begin again."""
        begun = self.action is not None and self.state is State.STOPPED
        return begun and (self.result is None or not self.result.complete)

    def hear(self, news: Progress) -> None:
        """Take in what is new."""
        self.live.add(news)
        self.version += 1

    def lines(self) -> list[Line]:
        """Its branches, then its loci, as they are shown."""
        if self.result is None:
            found = [_line(member.name, member.branch, _NOWHERE) for member in self.live.members]
            loci = [_locus(name, locus, _NOWHERE) for name, locus in self.live.loci]
            return [*found, *loci, *_growing(self.live)]
        if not isinstance(self.result.options, BranchOptions):
            return []
        within, chart = _range(self.result), self.result.map
        found = [_line(*each, within) for each in zip(self.result.names, self.result.branches, strict=True)]
        if chart is not None:
            found += [_locus(name, locus, within) for name, locus in zip(chart.names, chart.loci, strict=True)]
        return found

    @property
    def saves(self) -> list[str]:
        """What it can be saved as, now that it is over: there is no table of a search that has found nothing."""
        if not self.state.is_over or self.state is State.FAILED:
            return []
        settled, finding = self.settled(), self.result.finding if self.result else None
        has_orbit = bool(self.lines()) or (settled is not None and settled.orbit is not None)
        has_table = has_orbit or (finding is not None and finding.record is not None)
        there = {"table": has_table, "script": True, "model": has_orbit, "result": self.result is not None}
        return [word for word, is_there in there.items() if is_there]

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
            if line.kind is not None:
                raise ModelError("choose a special point of a branch; this is a point of a locus")
            if place.special < len(line.special_points):
                special = line.special_points[place.special]
                assert isinstance(special, SpecialPoint)  # it is no locus
                return line, special
        raise ModelError(f"{self.title} has no such special point any more; reload the page")


def _range(result: Result) -> tuple[float, float]:
    low, high = sorted((result.walked.begin, result.walked.end))
    return low, high


def _line(name: str, branch: Branch, within: tuple[float, float]) -> Line:
    return Line(name, branch.parameter, within, branch.period, branch.points, branch.special_points)


def _locus(name: str, locus: Locus, within: tuple[float, float]) -> Line:
    points = locus.points, locus.codim2_points
    return Line(name, locus.first, within, locus.period, *points, kind=locus.kind, second=locus.second)


def _growing(live: Progress) -> Iterator[Line]:
    """What is being walked: one line for each of its directions, which begin at the same place."""
    lengths = [point.arclength for point, _ in live.steps]
    turns = [i for i in range(1, len(lengths)) if lengths[i] < lengths[i - 1]]
    for start, stop in pairwise([0, *turns, len(lengths)]):
        steps = live.steps[start:stop]
        if steps:
            points, special = [point for point, _ in steps], [each for _, found in steps for each in found]
            period = points[0].orbit.period
            name = f"P{period}-1" if live.kind is None else f"{live.kind.value}-1"
            yield Line(name, "", _NOWHERE, period, points, special, live.kind, live.second)
