"""The call of `gapwalk.sweep` as its file keeps it, and the segments in which it is driven."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.request import Call
from gapwalk.studies.sweep.driver import Driver
from gapwalk.studies.sweep.options import SweepOptions
from gapwalk.studies.sweep.record import BLOCK, Sweep, segments_of
from gapwalk.studies.sweep.segment import SweepSegment

STRETCH = Part("segment", SweepSegment, numbered=True)


@dataclass(frozen=True)
class SweepCall(Call):
    """What a sweep is to do.

    Attributes
    ----------
    system, parameter, to, options
        As in `gapwalk.sweep`; the system has the first value of the parameter.
    block
        Values in a segment.
    """

    asks: ClassVar[str] = "sweep"

    system: System
    parameter: str
    to: tuple[float, float]
    options: SweepOptions
    block: int = BLOCK

    @classmethod
    def of(cls, driver: Driver) -> SweepCall:
        """The call that a driver does."""
        low, high = float(driver.values[0]), float(driver.values[-1])
        return cls(driver.system.at({driver.parameter: low}), driver.parameter, (low, high), driver.options)

    def found(self, parts: Parts) -> Sweep:
        """The sweep, as far as it has been driven."""
        if self.block != BLOCK:
            raise ModelError(f"its segments have {self.block} values, and {BLOCK} are expected")
        driver = Driver(self.system, self.parameter, self.to, self.options)
        driver.take(segments(parts.all(STRETCH), driver))
        return driver.sweep()


def place_of(segment: SweepSegment, driver: Driver) -> int:
    """The number of a segment in a file."""
    return segment.lane * segments_of(driver.options.steps) + segment.number


def segments(parts: Iterable[tuple[int, SweepSegment]], driver: Driver) -> Iterator[SweepSegment]:
    """The segments of a file, one by one; a ValueError if one is in the place of another."""
    for number, segment in parts:
        if place_of(segment, driver) != number:
            raise ValueError("a segment stands in the place of another")
        yield segment
