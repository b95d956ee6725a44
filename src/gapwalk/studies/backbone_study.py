"""The study of backbones: free vibrations without damping and excitation, from linear modes or from a release."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar

from annotated_types import Gt
from pydantic import Field

from gapwalk.errors import ModelError, NumericalError
from gapwalk.free.backbone_curve import Backbone, BackboneOptions, backbone, check_released
from gapwalk.free.free_shooting import without_losses
from gapwalk.free.island_births import Backbones, IslandBirth, check_load, foretell
from gapwalk.model.bounds import Counted
from gapwalk.model.system import System
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.run_up_study import Speed
from gapwalk.studies.study_kind import Found, Job, StudyKind
from gapwalk.summary import row_of

LINE = Part("backbone", tuple[int, Backbone | None, str], numbered=True)
"""Number of a start, its backbone, and the reason if there is none."""
BIRTHS = Part("births", tuple[IslandBirth, ...], numbered=True)
"""The births that the backbone of that number foretells."""


@dataclass(frozen=True)
class BackboneStudy(StudyKind):
    """Backbones of a system: its free vibrations without damping and excitation, over their amplitude."""

    kind: ClassVar[str] = "backbone"
    gives_frequency: ClassVar[bool] = True
    stored: ClassVar[tuple[Part, ...]] = (LINE, BIRTHS)

    #: Numbers of the linear modes about the equilibrium at which backbones begin, from 1.
    modes: tuple[Counted, ...] = (1,)
    #: Positions from which the system is released at rest, in place of modes, where there is no linear mode: one for
    #: each coordinate, in units of the model.
    release: tuple[float, ...] = ()
    #: begin, end: Range of the frequency (``from``, ``to``); by default from a fifth of the first frequency to five
    #: times that.
    begin: Annotated[Speed, Field(alias="from")] = None
    end: Annotated[Speed, Field(alias="to")] = None
    #: Amplitude at which a backbone ends, in clearances (in units of length for a system without gaps).
    largest_amplitude: Annotated[float, Gt(0)] = 20.0
    #: Name of a harmonic load, for which it is foretold at which amplitudes isolated branches are born; by default
    #: nothing is foretold.
    foretell: str = ""
    harmonics: tuple[Counted, ...] = (1, 2, 3)  #: Harmonics of the free vibrations that this load may drive.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
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
    def most_workers(self) -> int:
        """One for each backbone."""
        return len(self.starts)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        where = f"from a release at {list(self.release)}" if self.release else f"of modes {list(self.modes)}"
        return f"backbones {where}"

    def do(self, job: Job) -> Generator[Found]:
        """Follow the backbones that are left."""
        within = None if self.begin is None or self.end is None else (self.begin, self.end)
        options, left = BackboneOptions(self.largest_amplitude), range(len(job.known[LINE]), self.total(job))
        follow = partial(self._followed, job.system, within, options)
        for index, (line, reason, births) in job.workers.each(follow, left):
            one = job.keep(LINE, (left[index], line, reason), left[index])
            yield Found((*one.entries, *job.keep(BIRTHS, births, left[index]).entries))

    def _followed(
        self, system: System, within: tuple[float, float] | None, options: BackboneOptions, number: int
    ) -> tuple[Backbone | None, str, tuple[IslandBirth, ...]]:
        """Return a backbone, the reason if there is none, and what it foretells; a piece of work for any process."""
        try:
            line = backbone(system, self.starts[number], within, options=options)
        except NumericalError as error:
            return None, str(error), ()
        births = foretell(system, line, self.foretell, self.harmonics).births if self.foretell else ()
        return line, "", births

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the backbones belong to another study."""
        lines = job.all(LINE)
        if [number for number, _, _ in lines] != [*range(len(lines))] or len(lines) > self.total(job):
            raise ValueError("the backbones do not belong to the study")

    def done(self, job: Job) -> int:
        """Return the number of backbones that are done."""
        return len(job.known[LINE])

    def total(self, job: Job) -> int:
        """Return the number of all backbones."""
        return len(self.starts)

    def so_far(self, job: Job) -> Backbones:
        """Return the backbones so far."""
        lines = tuple(line for _, line, _ in job.all(LINE) if line is not None)
        failures = tuple(reason for _, _, reason in job.all(LINE) if reason)
        births = tuple(each for one in job.all(BIRTHS) for each in one)
        return Backbones(lines, failures, job.complete, births)

    def document(self, found: Backbones, points: bool) -> dict[str, Any]:
        """Return events and ends as JSON values; with all points if wanted."""
        document: dict[str, Any] = {"backbones": [self._line(line, points) for line in found.lines]}
        births = [plain(row_of(each)) for each in found.births]
        return {**document, "births": births} if births else document

    def _line(self, line: Backbone, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "mode": line.mode,
            "events": [plain(row_of(each)) for each in line.events],
            "ends": [{"reason": end.reason_words, "frequency": end.value} for end in line.ends],
        }
        if points:
            document["points"] = [plain(row_of(each)) | {"start": each.start.tolist()} for each in line.points]
        return document
