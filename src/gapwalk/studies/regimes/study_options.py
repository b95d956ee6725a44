"""What the study of a regime map is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from gapwalk.attractors.regime_judge import RegimeOptions
from gapwalk.studies.options import SecondParameter, StudyOptions
from gapwalk.studies.regimes.options import Carry, RegimeMapOptions

_LIMITS, _JUDGING = RegimeMapOptions(), RegimeOptions()


@dataclass(frozen=True, slots=True)
class RegimeStudyOptions(StudyOptions):
    """A regime map: which kind of motion there is at each cell of a plane of two parameters.

    Parameters
    ----------
    parameter, begin, end
        The parameter across, and its range.
    second
        The one up.
    resolution
        Columns and rows of cells.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    carry, check, seed, workers
        How the map is made, as `gapwalk.RegimeMapOptions`.
    longest, max_period, forces
        How regimes are told apart, as `gapwalk.RegimeOptions`.
    """

    kind: ClassVar[str] = "regimes"

    parameter: str
    begin: float
    end: float
    second: SecondParameter
    resolution: tuple[int, int] = (128, 128)
    start: str | tuple[float, ...] = "rest"
    carry: Carry = _LIMITS.carry
    longest: int = _JUDGING.longest
    max_period: int = _JUDGING.max_period
    forces: bool = _JUDGING.forces
    check: int = _LIMITS.check
    seed: int = _LIMITS.seed
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        columns, rows = self.resolution
        where = f"{self.parameter} from {self.begin:g} to {self.end:g} and {self.second.words}"
        return f"regimes over {where}, {columns} x {rows} cells"

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The range of each parameter, the smaller value first."""
        (a, b), (c, d) = sorted((self.begin, self.end)), sorted((self.second.begin, self.second.end))
        return (a, b), (c, d)

    @property
    def names(self) -> tuple[str, str]:
        """The names of both parameters."""
        return self.parameter, self.second.parameter

    @property
    def limits(self) -> RegimeMapOptions:
        """How the map is made, and in how many processes."""
        judging = RegimeOptions(self.longest, self.max_period, self.forces)
        return RegimeMapOptions(self.carry, judging, self.check, self.seed, self.workers)
