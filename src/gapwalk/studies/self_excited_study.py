"""The study of self-excitation: equilibria over a parameter, their Hopf points, and the periodic motions from them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.free.free_shooting import without_excitation
from gapwalk.free.rest_walk import Rests, check_rest, follow_rest
from gapwalk.free.self_excitation import SelfExcited, is_known, starts, with_cycle
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import AnswerFinding, Found, Work, plain_numbers
from gapwalk.summary import row_of


@dataclass(frozen=True)
class SelfExcitedStudy(RangeStudy):
    """Self-excited motions over a range of one parameter: equilibria, and motions from their Hopf points."""

    kind: ClassVar[str] = "self-excited"
    gives_frequency: ClassVar[bool] = True

    #: Positions near an equilibrium there, one for each coordinate; by default all equilibria that are found.
    start: tuple[float, ...] = ()
    walk: WalkOptions = field(default_factory=WalkOptions)  #: Numerical options of the walks.

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

    def work(self, system: System) -> SelfExcitedWork:
        """Return the work on equilibria and motions."""
        return SelfExcitedWork(self.first_system(system), self)


LINE = Part("equilibria", tuple[Rests, ...])
"""All branches of equilibria, once they are complete."""
CYCLE = Part("motions", tuple[int, Branch | None, tuple[str, ...]], numbered=True)
"""Number of a beginning, the branch from it, and the reasons if there is none or it is not complete."""


@dataclass(frozen=True)
class SelfExcitedFinding(AnswerFinding[SelfExcited]):
    """Finding of a study of self-excitation."""

    def document_of(self, found: SelfExcited, points: bool) -> dict[str, Any]:
        """Return equilibria with their events, and motions with their special points, as JSON values."""
        return {
            "parameter": found.parameter,
            "equilibria": [self._line(line, points) for line in found.rests],
            "motions": [self._cycle(cycle, points) for cycle in found.cycles],
        }

    def _line(self, line: Rests, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "events": [_plain(each) for each in line.events],
            "ends": [{"reason": end.reason_words, "value": end.value} for end in line.ends],
        }
        if points:
            document["points"] = [_plain(each) | {"position": each.position.tolist()} for each in line.points]
        return document

    def _cycle(self, cycle: Branch, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "special_points": [_plain(each) for each in cycle.special_points],
            "ends": [
                {"reason": end.reason.name.lower(), "value": end.value, "detail": end.detail} for end in cycle.ends
            ],
        }
        if points:
            document["points"] = [
                _plain(each) | {"frequency": each.orbit.system.frequency, "state": each.orbit.state.tolist()}
                for each in cycle.points
            ]
        return document


def _plain(record: Any) -> dict[str, Any]:
    return {
        name: plain_numbers(value.item() if isinstance(value, np.generic) else value)
        for name, value in row_of(record).items()
    }


class SelfExcitedWork(Work):
    """The work on self-excitation: all equilibria, then the motions from one beginning after the other."""

    def __init__(self, system: System, asked: SelfExcitedStudy) -> None:
        self.system, self.asked = without_excitation(system), asked
        self._rests: tuple[Rests, ...] = ()
        self._reason = ""
        self._cycles: list[tuple[int, Branch | None, tuple[str, ...]]] = []

    def take(self, known: Parts) -> None:
        """Read equilibria and motions of a file; raise a ValueError if they belong to another study."""
        self._rests = known.get(LINE) or ()
        self._cycles = [cycle for _, cycle in known.all(CYCLE)]
        if [number for number, _, _ in self._cycles] != [*range(len(self._cycles))] or len(self._cycles) > self._count:
            raise ValueError("the motions do not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Follow the equilibria, then the motions that are left."""
        asked = self.asked
        if not self._rests:
            lines = list[Rests]()
            for positions in [np.array(asked.start)] if asked.start else starts(self.system):
                if not is_known(lines, asked.begin, positions):
                    lines.append(
                        follow_rest(self.system, asked.parameter, asked.ends, start=positions, walk=asked.walk)
                    )
            self._rests = tuple(lines)
            yield Found.part(LINE, self._rests)
        while (number := len(self._cycles)) < self._count:
            before = self._so_far(complete=False)
            after = with_cycle(before, before.beginnings[number], asked.walk)
            cycle = after.cycles[-1] if len(after.cycles) > len(before.cycles) else None
            self._cycles.append((number, cycle, after.failures[len(before.failures) :]))
            yield Found.part(CYCLE, self._cycles[-1], number)

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return bool(self._rests) and len(self._cycles) == self._count

    @property
    def done(self) -> int:
        """Number of parts that are done."""
        return bool(self._rests) + len(self._cycles)

    @property
    def total(self) -> int:
        """Number of all parts, as far as it is known."""
        return 1 + self._count

    @property
    def record(self) -> SelfExcited | None:
        """What was found so far; None before the equilibria are."""
        return self._so_far(complete=self.complete) if self._rests else None

    @property
    def _count(self) -> int:
        """Number of places where motions begin, as far as it is known."""
        return len(self._so_far(complete=False).beginnings)

    def _so_far(self, *, complete: bool) -> SelfExcited:
        cycles = tuple(cycle for _, cycle, _ in self._cycles if cycle is not None)
        failures = tuple(each for _, _, reasons in self._cycles for each in reasons)
        ends = tuple(each for line in self._rests for each in line.failures)
        asked = self.asked
        return SelfExcited(asked.parameter, asked.ends, self._rests, cycles, (*ends, *failures), complete)

    def finding(self) -> SelfExcitedFinding:
        """Return what was found so far as the finding of a study."""
        return SelfExcitedFinding(self.record, self.done, self.total)
