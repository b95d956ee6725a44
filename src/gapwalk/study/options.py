"""What a study is asked to do: one frozen dataclass of options for each kind of study."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from gapwalk.continuation.options import WalkOptions
from gapwalk.orbit.shooting import Shooting


class Start(StrEnum):
    """Where the search for the first orbit of a study begins."""

    REST = "rest"
    """Newton's method from the state zero."""
    SETTLE = "settle"
    """Newton's method from where a transient from rest has come to."""


@dataclass(frozen=True, slots=True)
class ResponseOptions:
    """A response curve: the branch of periodic orbits over one parameter.

    Parameters
    ----------
    parameter
        The parameter that is walked, any of the system's, for example ``"frequency"``.
    begin, end
        The values between which it is walked, from the first to the second.
    measure
        What a picture of the branch shows: ``max``, ``min``, ``half`` (half the peak to peak), ``mean`` or
        ``rms``, a dot, and a coordinate, for example ``"half.q1"``.
    period
        m: the orbits repeat after m forcing periods.
    start
        Where the first orbit is looked for; or the state itself at theta = 0, 2n numbers: positions, then
        velocities.
    walk, shooting
        Numerical options of the walk, and of the orbits on it.
    """

    parameter: str
    begin: float
    end: float
    measure: str
    period: int = 1
    start: Start | tuple[float, ...] = Start.SETTLE
    walk: WalkOptions = field(default_factory=WalkOptions)
    shooting: Shooting = field(default_factory=Shooting)


StudyOptions = ResponseOptions
"""The options of any kind of study."""
