"""Records of how the special points of many samples of a system are found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.near_misses import Watch
from gapwalk.answers.point_forms import Form, Patterns, Walked
from gapwalk.answers.point_tracking import ENOUGH, TrackedPoint
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

Array = NDArray[np.float64]


class HowFound(IntEnum):
    """How the special points of one sample were found.

    Examples
    --------
    >>> gw.records.HowFound(tolerance.how[0]).name
    'WALKED'
    """

    TRACKED = 0
    """By predictions, corrected by Newton's method where their error is not known to be small."""
    WALKED = 1
    """By walking the branch of the sample."""
    REFUSED = 2
    """Not at all: the model does not allow these values."""
    FAILED = 3
    """Not all: the walk failed."""
    LOST = 4
    """Not yet."""
    PARTLY = 5
    """Tracked, but for a stretch of the branch that was walked."""


@dataclass(frozen=True, eq=False)
class Further:
    """A special point of a sample that has no nominal counterpart.

    Examples
    --------
    >>> gw.records.Further(sample=3, kind="fold", value=1.4).value
    1.4
    """

    sample: int  #: Number of the sample.
    kind: str  #: Name of its kind.
    value: float  #: Value of the parameter.


@dataclass(frozen=True, eq=False)
class ToleranceWalks:
    """Walked branches of some samples."""

    number: int  #: Number of the chunk.
    walked: tuple[Walked, ...]  #: The samples.


@dataclass(frozen=True, eq=False)
class ToleranceChunk:
    """Special points of some samples."""

    number: int  #: Number of the chunk.
    rows: NDArray[np.intp]  #: Numbers of the samples.
    values: Array  #: shape (samples, points): Value of the parameter at each point; nan where it does not exist.
    errors: Array  #: shape (samples, points): Bounds of their errors.
    how: NDArray[np.intp]  #: shape (samples,): Values of `HowFound`.
    further: tuple[Further, ...] = ()  #: Special points without nominal counterpart.


@dataclass(frozen=True, eq=False)
class Tracking:
    """The nominal special points, and how those of samples are found."""

    key: str  #: Text that no other tracking has: a process prepares the same points only once.
    system: System  #: The nominal system.
    names: tuple[str, ...]  #: The parameters that vary.
    first: Orbit  #: Nominal orbit from which the branch is walked.
    #: parameter, begin, end: The branch.
    parameter: str
    begin: float
    end: float
    specials: tuple[SpecialPoint, ...]  #: The nominal points that are tracked.
    deviations: Array  #: Standard deviations of the parameters.
    walk: WalkOptions  #: Options of the walks.
    accuracy: float = 2.0 * ENOUGH  #: Largest error of a value, as a share of it.
    forms: tuple[Form, ...] = ()  #: Forms of all points; empty for the walks.
    #: Which of the forms found in a sample lie on its branch; None for the first solutions.
    patterns: Patterns | None = None
    watches: tuple[Watch, ...] = ()  #: Where further points may be born.

    @property
    def width(self) -> float:
        """Width of the range."""
        return abs(self.end - self.begin)

    @property
    def labels(self) -> list[tuple[object, ...]]:
        """Properties that a point shares with its counterpart."""
        return [label_of(special) for special in self.specials]

    def at(self, values: Array) -> System:
        """Return the system of a sample at the beginning of its branch; raise a ModelError if it is not allowed."""
        return self.system.at({**dict(zip(self.names, values.tolist(), strict=True)), self.parameter: self.begin})


def label_of(special: SpecialPoint) -> tuple[object, ...]:
    """Return kind, contact, and the side to which a fold opens; of other kinds, if it makes the branch less stable."""
    turns = special.nature if special.kind.is_turning else np.sign(special.after.total - special.before.total)
    return special.kind, special.contact, str(turns)


def trackable(branch: Branch, names: Sequence[str]) -> tuple[tuple[SpecialPoint, ...], tuple[str, ...]]:
    """Return the special points of a branch that can be tracked, and a sentence for each that cannot."""
    points, failures = [], []
    for special in branch.special_points:
        try:
            TrackedPoint.of(special, names)
            points.append(special)
        except (ModelError, NumericalError) as error:
            failures.append(f"the {special.kind} at {special.value:.8g} is not tracked: {error}")
    return tuple(points), tuple(failures)
