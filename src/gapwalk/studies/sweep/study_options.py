"""What the study of a sweep is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from gapwalk.studies.options import StudyOptions
from gapwalk.studies.sweep.options import SweepOptions
from gapwalk.studies.sweep.transient import Patience

_LIMITS = SweepOptions()


@dataclass(frozen=True, slots=True)
class SweepStudyOptions(StudyOptions):
    """A sweep: settled motions over one parameter.

    Parameters
    ----------
    parameter, begin, end
        The parameter, and its range.
    signal
        What the picture shows: a coordinate, or its velocity (``q1'``).
    steps, ways, points, starts, seed, max_period, patience, kick, workers
        How it is driven, as `gapwalk.SweepOptions`.
    """

    kind: ClassVar[str] = "sweep"

    parameter: str
    begin: float
    end: float
    signal: str
    steps: int = _LIMITS.steps
    ways: str = _LIMITS.ways
    points: int = _LIMITS.points
    starts: int | tuple[tuple[float, ...], ...] = _LIMITS.starts
    seed: int = _LIMITS.seed
    max_period: int = _LIMITS.max_period
    patience: Patience = _LIMITS.patience
    kick: float = _LIMITS.kick
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        where = f"{self.parameter} from {self.begin:g} to {self.end:g}"
        starts = self.starts if isinstance(self.starts, int) else len(self.starts)
        many = f", from {starts} starts" if starts > 1 else ""
        return f"sweep over {where} at {self.steps} values, {self.ways}{many}, showing {self.signal}"

    @property
    def limits(self) -> SweepOptions:
        """How it is driven, and in how many processes."""
        names = ("steps", "ways", "points", "starts", "seed", "max_period", "patience", "kick", "workers")
        return SweepOptions(**{name: getattr(self, name) for name in names})
