"""A kind of study in one file: the amplitude of the orbit at each of some values of a parameter."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from matplotlib.axes import Axes
from pydantic import AfterValidator, ValidationInfo

import gapwalk as gw
from gapwalk import Study
from gapwalk.parallel import Workers
from gapwalk.studies import (
    OPEN,
    Counted,
    Finding,
    Found,
    Part,
    Parts,
    RangeStudy,
    Rows,
    Surroundings,
    Work,
    add_kind,
    check_signal,
    check_study,
)


def _is_a_coordinate(name: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    system = info.context.system
    return name and check_signal(name, system.coordinates if system else [])


@add_kind
@dataclass(frozen=True)
class AmplitudeStudy(RangeStudy):
    """The amplitude of a coordinate at each of some values of a parameter."""

    kind: ClassVar[str] = "amplitudes"

    coordinate: Annotated[str, OPEN, AfterValidator(_is_a_coordinate)]
    count: int = 5
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.count < 2:
            raise gw.errors.ModelError(f"count is {self.count}; it must be an integer >= 2")

    @property
    def plan(self) -> str:
        return f"amplitudes of {self.coordinate} over {self.range_words} at {self.count} values"

    @property
    def values(self) -> list[float]:
        return [self.begin + (self.end - self.begin) * k / (self.count - 1) for k in range(self.count)]

    @classmethod
    def of_table(cls, values: dict[str, Any], system: gw.System) -> AmplitudeStudy:
        return super().of_table({"coordinate": system.coordinates[0], **values}, system)

    def work(self, system: gw.System) -> AmplitudeWork:
        return AmplitudeWork(system, self)


class Amplitude(NamedTuple):
    """One part: a value of the parameter, and the amplitude there."""

    value: float
    amplitude: float


@dataclass(frozen=True)
class Amplitudes:
    """The amplitudes that are known."""

    asked: AmplitudeStudy
    found: tuple[Amplitude, ...]


AMPLITUDE = Part("amplitude", Amplitude, numbered=True)


class AmplitudeWork(Work):
    """The amplitudes, one by one, by many workers."""

    def __init__(self, system: gw.System, asked: AmplitudeStudy) -> None:
        self.system, self.asked = system, asked
        self.known: dict[int, Amplitude] = {}

    def take(self, known: Parts) -> None:
        self.known = dict(known.all(AMPLITUDE))

    def parts(self, workers: Workers) -> Generator[Found]:
        left = [number for number in range(self.asked.count) if number not in self.known]
        pieces = [(self.system, self.asked, self.asked.values[number]) for number in left]
        for index, found in workers.each(_amplitude, pieces, in_order=False):
            self.known[left[index]] = found
            yield Found.part(AMPLITUDE, found, left[index])

    @property
    def complete(self) -> bool:
        return self.done == self.total

    @property
    def done(self) -> int:
        return len(self.known)

    @property
    def total(self) -> int:
        return self.asked.count

    @property
    def record(self) -> Amplitudes:
        return Amplitudes(self.asked, tuple(found for _, found in sorted(self.known.items())))

    def finding(self) -> AmplitudeFinding:
        return AmplitudeFinding(self.record)


def _amplitude(piece: tuple[gw.System, AmplitudeStudy, float]) -> Amplitude:
    system, asked, value = piece
    orbit = gw.find_orbit(system.at({asked.parameter: value}))
    return Amplitude(value, orbit.measure(f"half.{asked.coordinate}"))


@dataclass(frozen=True)
class AmplitudeFinding(Finding):
    """The amplitudes that are known, as a result shows them."""

    found: Amplitudes

    @property
    def record(self) -> Amplitudes:
        return self.found

    @property
    def complete(self) -> bool:
        return len(self.record.found) == self.record.asked.count

    @property
    def stored(self) -> str:
        return f"{len(self.record.found)} of {self.record.asked.count} amplitudes are stored"

    def summary(self) -> Iterator[str]:
        return (f"{value:g}: {amplitude:.6g}" for value, amplitude in self.record.found)

    def document(self, points: bool) -> dict[str, Any]:
        return {"amplitudes": [list(each) for each in self.record.found]}

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        asked = self.record.asked
        return {"amplitudes": lambda: [(asked.parameter, asked.coordinate), *self.record.found]}


@gw.plot.draws(Amplitudes)
def draw_amplitudes(amplitudes: Amplitudes, ax: Axes) -> None:
    """Draw the amplitudes over the parameter."""
    ax.set(xlabel=amplitudes.asked.parameter, ylabel=amplitudes.asked.coordinate)
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
