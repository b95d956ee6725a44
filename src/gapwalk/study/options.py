"""What a study is asked to do: one frozen dataclass of options for each kind of study."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar

from gapwalk.continuation.options import WalkOptions
from gapwalk.orbit.shooting import Shooting
from gapwalk.study.diagram import DiagramOptions

_LIMITS = DiagramOptions()


class Start(StrEnum):
    """Where the search for the first orbit of a study begins."""

    REST = "rest"
    """Newton's method from the state zero."""
    SETTLE = "settle"
    """Newton's method from where a transient from rest has come to."""


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """What all kinds of study have in common: a first orbit, and the range of one parameter.

    Parameters
    ----------
    parameter
        The parameter that is walked, any of the system's, for example ``"frequency"``.
    begin, end
        The values between which it is walked, from the first to the second.
    measure
        What a picture shows: ``max``, ``min``, ``half`` (half the peak to peak), ``mean`` or ``rms``, a dot, and a
        coordinate, for example ``"half.q1"``.
    period
        m: the orbits repeat after m forcing periods.
    start
        Where the first orbit is looked for; or the state itself at theta = 0, 2n numbers: positions, then
        velocities.
    walk, shooting
        Numerical options of the walk, and of the orbits on it.
    """

    kind: ClassVar[str]
    """What a model file calls this kind of study."""

    parameter: str
    begin: float
    end: float
    measure: str
    period: int = 1
    start: Start | tuple[float, ...] = Start.SETTLE
    walk: WalkOptions = field(default_factory=WalkOptions)
    shooting: Shooting = field(default_factory=Shooting)


@dataclass(frozen=True, slots=True)
class ResponseOptions(StudyOptions):
    """A response curve: the branch of periodic orbits over one parameter; parameters as `StudyOptions`."""

    kind: ClassVar[str] = "response"


@dataclass(frozen=True, slots=True)
class DiagramStudyOptions(StudyOptions):
    """A diagram: all branches that are attached to the first one, over one parameter.

    Parameters
    ----------
    parameter, begin, end, measure, period, start, walk, shooting
        As `StudyOptions`, for the first branch; the range is that of all.
    max_period, max_branches, workers
        How far it goes, and in how many processes; as `DiagramOptions`.
    """

    kind: ClassVar[str] = "diagram"

    max_period: int = _LIMITS.max_period
    max_branches: int = _LIMITS.max_branches
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result

    @property
    def limits(self) -> DiagramOptions:
        """How far the diagram goes, and in how many processes."""
        return DiagramOptions(self.max_period, self.max_branches, self.workers)
