"""A kind of study in one file: the amplitude of the orbit at each of some values of a parameter."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from annotated_types import Ge
from matplotlib.axes import Axes
from pydantic import AfterValidator, ValidationInfo

import gapwalk as gw
from gapwalk import Study
from gapwalk.studies import OPEN, Counted, Found, Job, Part, RangeStudy, Surroundings, add_kind
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import Rows
from gapwalk.studies.study_schema import check_signal

if TYPE_CHECKING:
    from typing import Self


def _is_a_coordinate(name: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    system = info.context.system
    return name and check_signal(name, system.coordinates if system else [])


class Amplitude(NamedTuple):
    """One part: a value of the parameter, and the amplitude there."""

    value: float
    amplitude: float


@dataclass(frozen=True)
class Amplitudes:
    """The amplitudes that are known."""

    parameter: str
    coordinate: str
    found: tuple[Amplitude, ...]
    complete: bool = True

    def summary(self, *, notes: bool = True) -> Iterator[str]:
        return (f"{value:g}: {amplitude:.6g}" for value, amplitude in self.found)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        return {"amplitudes": lambda: [(self.parameter, self.coordinate), *self.found]}


AMPLITUDE = Part("amplitude", Amplitude, numbered=True)


@add_kind
@dataclass(frozen=True)
class AmplitudeStudy(RangeStudy):
    """The amplitude of a coordinate at each of some values of a parameter."""

    kind: ClassVar[str] = "amplitudes"
    stored: ClassVar[tuple[Part, ...]] = (AMPLITUDE,)
    answer: ClassVar[Part | None] = Part("amplitudes", Amplitudes)  # made of the parts

    coordinate: Annotated[str, OPEN, AfterValidator(_is_a_coordinate)] = ""  #: The coordinate; by default the first.
    count: Annotated[int, Ge(2)] = 5  #: Number of values.
    workers: Counted | None = field(default=None, compare=False)  #: Number of processes.

    @property
    def plan(self) -> str:
        return f"amplitudes of {self.coordinate} over {self.range_words} at {self.count} values"

    @classmethod
    def of_table(cls, values: dict[str, Any], system: gw.System) -> Self:
        return super().of_table({"coordinate": system.coordinates[0], **values}, system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: gw.System) -> Self:
        return cls.of_table(values, system)

    def do(self, job: Job) -> Generator[Found]:
        values = {k: self.begin + (self.end - self.begin) * k / (self.count - 1) for k in range(self.count)}
        return job.each(AMPLITUDE, partial(_amplitude, job.system, self), values)

    def is_complete(self, job: Job) -> bool:
        return self.done(job) == self.count

    def total(self, job: Job) -> int:
        return self.count

    def so_far(self, job: Job) -> Amplitudes:
        return Amplitudes(self.parameter, self.coordinate, tuple(job.all(AMPLITUDE)), job.complete)

    def stored_words(self, finding: Any) -> str:
        return f"{finding.done} of {self.count} amplitudes are stored"

    def document(self, found: Amplitudes, points: bool) -> dict[str, Any]:
        return {"amplitudes": [list(each) for each in found.found]}


def _amplitude(system: gw.System, asked: AmplitudeStudy, value: float) -> Amplitude:
    orbit = gw.find_orbit(system.at({asked.parameter: value}))
    return Amplitude(value, orbit.measure(f"half.{asked.coordinate}"))


@gw.plot.draws(Amplitudes)
def draw_amplitudes(amplitudes: Amplitudes, ax: Axes) -> None:
    """Draw the amplitudes over the parameter."""
    ax.set(xlabel=amplitudes.parameter, ylabel=amplitudes.coordinate)
    ax.plot(*zip(*amplitudes.found, strict=True), "o-")


MODEL = """
title = "One mass"
coordinates = ["x"]
mass = [1.0]
damping = [0.2]
stiffness = [1.0]

[[harmonic]]
amplitude = 0.3
acts_on = { x = 1.0 }

[study]
kind = "amplitudes"
parameter = "frequency"
from = 0.5
to = 1.5
count = 6
workers = 1
"""


def study() -> Study:
    """The study of a mass on a spring."""
    from gapwalk.model.model_source import parse_source

    return check_study(parse_source(MODEL))


def main(path: str) -> None:
    """Run it, or go on with it; write a line for each part that is safe."""
    result = gw.run(study(), path, resume=Path(path).exists(), report=lambda *_: print("part", flush=True))
    print("complete" if result.complete else "stopped", flush=True)
