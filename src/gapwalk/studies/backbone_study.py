"""The study of backbones: free vibrations without damping and excitation, from linear modes or from a release."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from annotated_types import Gt
from pydantic import Field

from gapwalk.errors import ModelError, NumericalError
from gapwalk.free.backbone_curve import Backbone, BackboneOptions, backbone, check_released
from gapwalk.free.free_shooting import without_losses
from gapwalk.free.island_births import Backbones, IslandBirth, check_load, foretell
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.run_up_study import Speed
from gapwalk.studies.study_kind import AnswerFinding, Found, StudyKind, Work, plain_numbers
from gapwalk.studies.study_registry import Counted
from gapwalk.summary import row_of


@dataclass(frozen=True)
class BackboneStudy(StudyKind):
    """Backbones of a system: its free vibrations without damping and excitation, over their amplitude."""

    kind: ClassVar[str] = "backbone"
    gives_frequency: ClassVar[bool] = True

    #: Numbers of the linear modes about the equilibrium at which backbones begin, from 1.
    modes: tuple[Counted, ...] = (1,)
    #: Positions from which the system is released at rest, in place of modes, where there is no linear mode: one for
    #: each coordinate, in units of the model.
    release: tuple[float, ...] = ()
    #: begin, end: Range of the frequency (``from``, ``to``); by default a fifth to five times the first frequency.
    begin: Annotated[Speed, Field(alias="from")] = None
    end: Annotated[Speed, Field(alias="to")] = None
    #: Amplitude at which a backbone ends, in clearances (in units of length for a system without gaps).
    largest_amplitude: Annotated[float, Gt(0)] = 20.0
    #: Name of a harmonic load, for which it is foretold at which amplitudes isolated branches are born; by default
    #: nothing is foretold.
    foretell: str = ""
    harmonics: tuple[Counted, ...] = (1, 2, 3)  #: Harmonics of the free vibrations that this load may drive.

    def __post_init__(self) -> None:
        BackboneOptions(self.largest_amplitude)
        if (self.begin is None) != (self.end is None):
            raise ModelError("from and to give the range of the frequency together; write both, or leave both out")
        if not (self.modes or self.release):
            raise ModelError("modes is an empty list; write the numbers of some modes, as in modes = [1, 2]")

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> BackboneStudy:
        """Return the study of a table, if the system has free vibrations without losses."""
        asked = cls(**values)
        free = without_losses(system)
        if asked.release:
            check_released(free)
        if asked.foretell:
            check_load(system, asked.foretell)
        if asked.release and len(asked.release) != system.size:
            raise ModelError(f"release has {len(asked.release)} positions; the system has {system.size} coordinates")
        if not asked.release and max(asked.modes) > system.size:
            raise ModelError(f"modes names mode {max(asked.modes)}; the system has the modes 1 to {system.size}")
        return asked

    @property
    def starts(self) -> tuple[int | tuple[float, ...], ...]:
        """Modes, or the release, at which backbones begin."""
        return (self.release,) if self.release else self.modes

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        where = f"from a release at {list(self.release)}" if self.release else f"of modes {list(self.modes)}"
        return f"backbones {where}"

    def work(self, system: System) -> BackboneWork:
        """Return the work on the backbones."""
        return BackboneWork(system, self)


LINE = Part("backbone", tuple[int, Backbone | None, str], numbered=True)
"""Number of a start, its backbone, and the reason if there is none."""
BIRTHS = Part("births", tuple[IslandBirth, ...], numbered=True)
"""What the backbone of that number foretells."""


@dataclass(frozen=True)
class BackboneFinding(AnswerFinding[Backbones]):
    """Finding of a study of backbones."""

    def document_of(self, found: Backbones, points: bool) -> dict[str, Any]:
        """Return events and ends as JSON values; with all points if wanted."""
        document: dict[str, Any] = {"backbones": [self._line(line, points) for line in found.lines]}
        births = [{name: plain_numbers(value) for name, value in row_of(each).items()} for each in found.births]
        return {**document, "births": births} if births else document

    def _line(self, line: Backbone, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "mode": line.mode,
            "events": [{name: plain_numbers(value) for name, value in row_of(each).items()} for each in line.events],
            "ends": [{"reason": end.reason_words, "frequency": end.value} for end in line.ends],
        }
        if points:
            document["points"] = [
                {name: plain_numbers(value) for name, value in row_of(each).items()} | {"start": each.start.tolist()}
                for each in line.points
            ]
        return document


class BackboneWork(Work):
    """The work on backbones, one after the other."""

    def __init__(self, system: System, asked: BackboneStudy) -> None:
        self.system, self.asked = system, asked
        self._lines: list[tuple[int, Backbone | None, str]] = []
        self._births: dict[int, tuple[IslandBirth, ...]] = {}

    def take(self, known: Parts) -> None:
        """Read the backbones of a file; raise a ValueError if they belong to another study."""
        self._lines = [line for _, line in known.all(LINE)]
        self._births = dict(known.all(BIRTHS))
        if [number for number, _, _ in self._lines] != [*range(len(self._lines))] or len(self._lines) > self.total:
            raise ValueError("the backbones do not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Follow the backbones that are left."""
        asked = self.asked
        within = None if asked.begin is None or asked.end is None else (asked.begin, asked.end)
        options = BackboneOptions(asked.largest_amplitude)
        for number in range(len(self._lines), self.total):
            start = asked.starts[number]
            try:
                line, reason = backbone(self.system, start, within, options=options), ""
            except NumericalError as error:
                line, reason = None, str(error)
            self._lines.append((number, line, reason))
            self._births[number] = self._foretold(line)
            births = BIRTHS.entry(self._births[number], number)
            yield Found((LINE.entry(self._lines[-1], number), births))

    def _foretold(self, line: Backbone | None) -> tuple[IslandBirth, ...]:
        """Return what a backbone foretells for the load that was named."""
        if line is None or not self.asked.foretell:
            return ()
        return foretell(self.system, line, self.asked.foretell, self.asked.harmonics).births

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return len(self._lines) == self.total

    @property
    def done(self) -> int:
        """Number of backbones that are done."""
        return len(self._lines)

    @property
    def total(self) -> int:
        """Number of all backbones."""
        return len(self.asked.starts)

    @property
    def record(self) -> Backbones:
        """The backbones so far."""
        lines = tuple(line for _, line, _ in self._lines if line is not None)
        failures = tuple(reason for _, _, reason in self._lines if reason)
        births = tuple(each for number, _, _ in self._lines for each in self._births.get(number, ()))
        return Backbones(lines, failures, self.complete, births)

    def finding(self) -> BackboneFinding:
        """Return the backbones so far as the finding of a study."""
        return BackboneFinding(self.record, self.done, self.total)
