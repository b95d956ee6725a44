"""The call of `gapwalk.sweep` as its file keeps it, and the stretches in which it is driven."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.results.file import Part, Parts
from gapwalk.study.request import Call
from gapwalk.study.sweep.driver import Driver
from gapwalk.study.sweep.options import SweepOptions
from gapwalk.study.sweep.record import BLOCK, Sweep, stretches_of
from gapwalk.study.sweep.stretch import Stretch

STRETCH = Part("stretch", Stretch, numbered=True)


@dataclass(frozen=True)
class SweepCall(Call):
    """What a sweep is to do.

    Attributes
    ----------
    system, parameter, to, options
        As in `gapwalk.sweep`; the system has the first value of the parameter.
    block
        Values in a stretch.
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
            raise ModelError(f"its stretches have {self.block} values, and {BLOCK} are expected")
        driver = Driver(self.system, self.parameter, self.to, self.options)
        driver.take(stretches(parts.all(STRETCH), driver))
        return driver.sweep()


def place_of(stretch: Stretch, driver: Driver) -> int:
    """The number of a stretch in a file."""
    return stretch.lane * stretches_of(driver.options.steps) + stretch.number


def stretches(parts: Iterable[tuple[int, Stretch]], driver: Driver) -> Iterator[Stretch]:
    """The stretches of a file, one by one; a ValueError if one is in the place of another."""
    for number, stretch in parts:
        if place_of(stretch, driver) != number:
            raise ValueError("a stretch stands in the place of another")
        yield stretch
