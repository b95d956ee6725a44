"""The study of self-excitation: equilibria over a parameter, their Hopf points, and the periodic motions from them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.free.equilibrium_walk import RestEvent, Rests, check_rest, follow_rest
from gapwalk.free.free_shooting import without_excitation
from gapwalk.free.self_excitation import SelfExcited, cycle_from, is_known, is_reached, starts, with_cycle
from gapwalk.model.bounds import Counted
from gapwalk.model.system import System
from gapwalk.pieces import workers_around
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import Found, Job
from gapwalk.summary import row_of

LINE = Part("equilibria", tuple[Rests, ...])
"""All branches of equilibria, once they are complete."""
CYCLE = Part("motions", tuple[int, Branch | None, tuple[str, ...]], numbered=True)
"""Number of a beginning, the branch from it, and the reasons if there is none or it is not complete."""


@dataclass(frozen=True)
class SelfExcitedStudy(RangeStudy):
    """Self-excited motions over a range of one parameter: equilibria, and motions from their Hopf points."""

    kind: ClassVar[str] = "self-excited"
    gives_frequency: ClassVar[bool] = True
    stored: ClassVar[tuple[Part, ...]] = (LINE, CYCLE)

    #: Positions near an equilibrium there, one for each coordinate; by default all equilibria that are found.
    start: tuple[float, ...] = ()
    walk: WalkOptions = field(default_factory=WalkOptions)  #: Numerical options of the walks.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> SelfExcitedStudy:
        """Return the study of a table, if equilibria and motions can be followed along the parameter."""
        asked = super().of_table(values, system)
        free = without_excitation(system)
        check_rest(free, asked.parameter)
        if asked.start and len(asked.start) != system.size:
            raise ModelError(f"start has {len(asked.start)} positions; the system has {system.size} coordinates")
        return asked

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return f"self-excited motions and equilibria over {self.range_words}"

    def work(self, system: System) -> Job:
        """Return the work on equilibria and motions of the system without its excitation."""
        return Job(without_excitation(self.first_system(system)), self)

    def do(self, job: Job) -> Generator[Found]:
        """Follow the equilibria, then the motions that are left."""
        yield from job.once(LINE, lambda: self._rests(job.system))
        first = len(job.known[CYCLE])
        pieces = list(self._beginnings(job)[first:])
        follow = partial(cycle_from, self._found(job, complete=False).system, self.parameter, self.ends, self.walk)

        def is_needed(index: int) -> bool:
            return not is_reached(self._found(job, complete=False), pieces[index])

        for index, found in job.workers.each(follow, pieces, is_needed):
            yield from self._left_out(job, first + index)
            before = self._found(job, complete=False)
            after, cycle = with_cycle(before, found), None if isinstance(found, str) else found
            yield job.keep(CYCLE, (first + index, cycle, after.failures[len(before.failures) :]), first + index)
            pieces += self._beginnings(job)[first + len(pieces) :]
        yield from self._left_out(job, self._count(job))

    def _rests(self, system: System) -> tuple[Rests, ...]:
        """Follow all equilibria."""
        lines = list[Rests]()
        all_starts = [np.array(self.start)] if self.start else starts(system)
        follow = partial(_line_from, system, self.parameter, self.ends, self.walk)
        for _, line in workers_around().each(
            follow, all_starts, lambda k: not is_known(lines, self.begin, all_starts[k])
        ):
            lines.append(line)
        return tuple(lines)

    def _left_out(self, job: Job, until: int) -> Generator[Found]:
        """Keep beginnings that another branch has reached, up to a number."""
        for number in range(len(job.known[CYCLE]), until):
            yield job.keep(CYCLE, (number, None, ()), number)

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the motions belong to another study."""
        cycles = job.all(CYCLE)
        if [number for number, _, _ in cycles] != [*range(len(cycles))] or len(cycles) > self._count(job):
            raise ValueError("the motions do not belong to the study")

    def is_complete(self, job: Job) -> bool:
        """Return True if equilibria and motions are known."""
        return bool(job.one(LINE)) and len(job.known[CYCLE]) == self._count(job)

    def total(self, job: Job) -> int:
        """Return the number of all parts, as far as it is known."""
        return 1 + self._count(job)

    def so_far(self, job: Job) -> SelfExcited | None:
        """Return what was found so far; None before the equilibria are."""
        return self._found(job, complete=job.complete) if job.one(LINE) else None

    def _count(self, job: Job) -> int:
        """Return the number of places where motions begin, as far as it is known."""
        return len(self._beginnings(job))

    def _beginnings(self, job: Job) -> tuple[RestEvent | SpecialPoint, ...]:
        return self._found(job, complete=False).beginnings

    def _found(self, job: Job, *, complete: bool) -> SelfExcited:
        rests = job.one(LINE) or ()
        cycles = tuple(cycle for _, cycle, _ in job.all(CYCLE) if cycle is not None)
        failures = tuple(each for _, _, reasons in job.all(CYCLE) for each in reasons)
        ends = tuple(each for line in rests for each in line.failures)
        return SelfExcited(self.parameter, self.ends, rests, cycles, (*ends, *failures), complete)

    def document(self, found: SelfExcited, points: bool) -> dict[str, Any]:
        """Return equilibria with their events, and motions with their special points, as JSON values."""
        return {
            "parameter": found.parameter,
            "equilibria": [self._line(line, points) for line in found.rests],
            "motions": [self._cycle(cycle, points) for cycle in found.cycles],
        }

    def _line(self, line: Rests, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "events": [plain(row_of(each)) for each in line.events],
            "ends": [{"reason": end.reason_words, "value": end.value} for end in line.ends],
        }
        if points:
            document["points"] = [plain(row_of(each)) | {"position": each.position.tolist()} for each in line.points]
        return document

    def _cycle(self, cycle: Branch, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "special_points": [plain(row_of(each)) for each in cycle.special_points],
            "ends": [
                {"reason": end.reason.name.lower(), "value": end.value, "detail": end.detail} for end in cycle.ends
            ],
        }
        if points:
            document["points"] = [
                plain(row_of(each)) | {"frequency": each.orbit.system.frequency, "state": each.orbit.state.tolist()}
                for each in cycle.points
            ]
        return document


def _line_from(
    system: System, parameter: str, ends: tuple[float, float], walk: WalkOptions, start: NDArray[np.float64]
) -> Rests:
    """Follow an equilibrium; a piece of work for any process."""
    return follow_rest(system, parameter, ends, start=start, walk=walk)
