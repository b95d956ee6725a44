"""Special points of many samples of a system: tracked from the nominal ones, and walked again where one is lost.

The first samples are solved with predictions by gradients. Polynomials fitted to their solutions predict those of all
others, so one step of Newton's method is often enough. Where a point is lost, the branch of that sample is walked
again; the point found there becomes a second origin from which later samples may find it, such as a fold that lies
beyond another grazing contact in a sixth of all parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from gapwalk.answers.point_tracking import Fit, TrackedPoint
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit

Array = NDArray[np.float64]

_SAME = 1e-6  # share of the range within which two values are one point
_BEYOND = 0.02  # share of the range by which a walk goes on beyond the farthest tracked point
_FURTHER = (0.0, 0.1)  # shares of the range by which a walk that did not meet all tracked points goes on
_CLOUD = 3.0  # the curvature of a point, as a multiple of what most solutions showed


class HowFound(IntEnum):
    """How the special points of one sample were found."""

    TRACKED = 0
    """All by Newton's method from the nominal points."""
    WALKED = 1
    """By walking the branch of the sample: a point was lost."""
    REFUSED = 2
    """Not at all: the model does not allow these values."""
    FAILED = 3
    """Not all: a point was lost, and the walk failed too."""
    LOST = 4
    """Not yet all: a point was lost, and the walk comes later."""


@dataclass(frozen=True, eq=False)
class Origin:
    """Another special point from which a nominal one may be found in samples far from the nominal system.

    Attributes
    ----------
    index
        Index of the nominal point.
    special
        The point in another sample.
    """

    index: int
    special: SpecialPoint


@dataclass(frozen=True, eq=False)
class Further:
    """A special point of a walked sample that has no nominal counterpart.

    Attributes
    ----------
    sample
        Number of the sample.
    kind
        Name of its kind.
    value
        Value of the parameter.
    """

    sample: int
    kind: str
    value: float


@dataclass(frozen=True, eq=False)
class ToleranceChunk:
    """Special points of some samples.

    Attributes
    ----------
    number
        Number of the chunk.
    values : shape (samples, points)
        Value of the parameter at each point; nan where it does not exist.
    how : shape (samples,)
        Values of `HowFound`.
    further
        Special points without nominal counterpart, of the samples that were walked.
    solutions
        Of each point the unknowns, shape (samples, unknowns), nan where it was lost; empty after the first chunks.
    curvatures : shape (samples, points)
        Curvatures seen by Newton's method; empty after the first chunks.
    """

    number: int
    values: Array
    how: NDArray[np.intp]
    further: tuple[Further, ...] = ()
    solutions: tuple[Array, ...] = ()
    curvatures: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class Tracking:
    """The nominal special points, and how those of samples are found.

    Attributes
    ----------
    key
        Text that no other tracking has: a process prepares the same points only once.
    system
        The nominal system.
    names
        The parameters that vary.
    first
        Nominal orbit from which the branch is walked.
    parameter, begin, end
        The branch.
    specials
        The nominal points that are tracked.
    walk
        Options of the walks.
    fits
        Predictors of the points; empty for the first samples.
    origins
        Further points to track from.
    """

    key: str
    system: System
    names: tuple[str, ...]
    first: Orbit
    parameter: str
    begin: float
    end: float
    specials: tuple[SpecialPoint, ...]
    walk: WalkOptions
    fits: tuple[Fit | None, ...] = ()
    origins: tuple[Origin, ...] = ()

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


class Tracker:
    """Finds the special points of samples; see `Tracking`."""

    def __init__(self, asked: Tracking) -> None:
        self.asked = asked
        self.points = [TrackedPoint.of(special, asked.names) for special in asked.specials]
        if asked.fits:
            self.points = [replace(point, fit=fit) for point, fit in zip(self.points, asked.fits, strict=True)]
        self.origins: list[tuple[int, TrackedPoint]] = []
        for origin in asked.origins:
            self.add(origin)

    def add(self, origin: Origin) -> bool:
        """Add a further point to track from; False if it does not satisfy its equation well enough."""
        try:
            self.origins.append((origin.index, TrackedPoint.of(origin.special, self.asked.names)))
        except (ModelError, ConvergenceError):
            return False
        return True

    def chunk(self, number: int, first: int, samples: Array, *, keeps: bool) -> ToleranceChunk:
        """Find the points of some samples, of which the first has the number `first`.

        With `keeps`, the solutions are kept and lost points are left for later; otherwise their samples are walked.
        """
        asked, count = self.asked, len(samples)
        how = np.zeros(count, dtype=int)
        for k, values in enumerate(samples):
            try:
                asked.at(values)
            except ModelError:
                how[k] = HowFound.REFUSED
        found = np.full((count, len(self.points)), np.nan)
        solutions, curvatures = [], []
        for j, point in enumerate(self.points):
            unknowns, curved = np.full((count, len(point.unknowns)), np.nan), np.full(count, np.nan)
            for k, guess in enumerate(point.predicted(samples)):
                each = None if how[k] == HowFound.REFUSED else point.found_at(samples[k], guess)
                if each is not None:
                    found[k, j], unknowns[k], curved[k] = each.value, each.unknowns, each.curvature
            solutions.append(unknowns)
            curvatures.append(curved)
        further: list[Further] = []
        self._drop_doubles(found, solutions)
        for k in np.flatnonzero(np.isnan(found).any(axis=1) & (how == HowFound.TRACKED)):
            if keeps:
                how[k] = HowFound.LOST
            else:
                how[k], more, _ = self.recover(samples[k], found[k])
                further += [replace(each, sample=first + int(k)) for each in more]
        if not keeps:
            return ToleranceChunk(number, found, how, tuple(further))
        return ToleranceChunk(number, found, how, tuple(further), tuple(solutions), tuple(curvatures))

    def recover(self, sample: Array, found: Array) -> tuple[HowFound, list[Further], list[Origin]]:
        """Find the lost points of a sample, and write their values into `found`.

        Returns
        -------
        how : HowFound
            Tracked, walked or failed.
        further : list of Further
            Points of a walk without nominal counterpart.
        origins : list of Origin
            Points of a walk whose nominal counterparts were lost.
        """
        for index, point in self.origins:
            if np.isnan(found[index]):
                each = point.found_at(sample)
                if each is not None and not self._is_known(found, index, each.value):
                    found[index] = each.value
        if not np.isnan(found).any():
            return HowFound.TRACKED, [], []
        walked = self.walked(sample, found)
        if walked is None:
            return HowFound.FAILED, [], []
        return HowFound.WALKED, *self.match(walked, sample, found)

    def walked(self, sample: Array, found: Array) -> tuple[SpecialPoint, ...] | None:
        """Walk the branch of a sample; None if the walk fails."""
        asked = self.asked
        way = float(np.sign(asked.end - asked.begin))
        known = found[~np.isnan(found)]
        farthest = max([way * asked.end, *(way * value + _BEYOND * asked.width for value in known)])
        special: tuple[SpecialPoint, ...] | None = None
        for further in _FURTHER:
            try:
                start = find_orbit(asked.at(sample), asked.first.period, tuple(asked.first.state.tolist()))
                to = way * (farthest + further * asked.width)
                branch = follow(start, asked.parameter, to, walk=asked.walk)
            except (ModelError, NumericalError):
                break
            if branch.ends[-1].reason is not EndReason.RANGE:
                break
            special = branch.special_points
            values = np.array([each.value for each in special])
            # a branch may leave the range and come back: the points of that part are tracked, but not yet met
            if all(np.any(np.abs(values - value) <= _SAME * asked.width) for value in known):
                break
        return special

    def match(self, walked: Sequence[SpecialPoint], sample: Array, found: Array) -> tuple[list[Further], list[Origin]]:
        """Write the values of a walk into `found`, each to the nominal point with which it fits."""
        asked, lost = self.asked, np.isnan(found)
        expected = np.where(lost, [self.predicted_value(j, sample) for j in range(len(found))], found)
        labels, free, origins = asked.labels, set(range(len(walked))), []
        mine = np.full(len(found), np.nan)
        for label in dict.fromkeys(labels):
            rows = [j for j, each in enumerate(labels) if each == label]
            columns = [k for k, special in enumerate(walked) if label_of(special) == label]
            if not columns:
                continue
            cost = np.abs(expected[rows][:, None] - np.array([walked[k].value for k in columns])[None])
            # a tracked point is known: its counterpart is at the same value, and no lost one may take it away
            cost[~lost[rows]] *= 1e3
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                j, k = rows[row], columns[column]
                if not lost[j] and abs(walked[k].value - found[j]) > _SAME * asked.width:
                    continue
                mine[j] = walked[k].value
                free.discard(k)
                if lost[j]:
                    origins.append(Origin(j, walked[k]))
        way = np.sign(asked.end - asked.begin)
        outside = ~lost & ((way * (found - asked.end) > 0.0) | (way * (found - asked.begin) < 0.0))
        found[:] = np.where(outside & np.isnan(mine), found, mine)
        return [Further(0, walked[k].kind.value, walked[k].value) for k in sorted(free)], origins

    def predicted_value(self, index: int, sample: Array) -> float:
        """Return the value of the parameter at a point by its gradient."""
        point = self.points[index]
        return point.value + float(point.slopes[-1] @ (sample - point.origin))

    def _is_known(self, found: Array, index: int, value: float) -> bool:
        """Return True if another point of the same label is at a value already."""
        labels = self.asked.labels
        others = [j for j, label in enumerate(labels) if label == labels[index] and j != index]
        return bool(np.any(np.abs(found[others] - value) <= _SAME * self.asked.width))

    def _drop_doubles(self, found: Array, solutions: list[Array]) -> None:
        """Remove points that came to the same solution as another one."""
        labels = self.asked.labels
        for j, label in enumerate(labels):
            for other in range(j):
                if labels[other][:2] != label[:2]:
                    continue
                scales = self.points[j].scales
                near = np.abs((solutions[j] - solutions[other]) / scales).max(axis=1) < _SAME
                found[near, j] = found[near, other] = np.nan


def fitted(tracker: Tracker, samples: Array, chunks: Sequence[ToleranceChunk], widths: Array) -> tuple[Fit | None, ...]:
    """Fit predictors of all points to the solutions of the first samples."""
    fits: list[Fit | None] = []
    for j, point in enumerate(tracker.points):
        unknowns = np.concatenate([chunk.solutions[j] for chunk in chunks])
        curvatures = np.concatenate([chunk.curvatures[j] for chunk in chunks])
        known = ~np.isnan(unknowns).any(axis=1)
        if not known.any():
            fits.append(None)
            continue
        curvature = _CLOUD * float(np.quantile(curvatures[known], 0.99))
        fits.append(Fit.to(point.origin, widths, samples[known], unknowns[known], curvature))
    return tuple(fits)


@lru_cache(maxsize=2)
def _prepared(key: str) -> list[Tracker]:
    return []


def tracker_of(asked: Tracking) -> Tracker:
    """Return the tracker of a tracking, prepared once in each process."""
    kept = _prepared(asked.key)
    if not kept:
        kept.append(Tracker(asked))
    return kept[0]


def track_chunk(asked: Tracking, keeps: bool, piece: tuple[int, int, Array]) -> ToleranceChunk:
    """Find the special points of a chunk of samples; a piece of work for any process."""
    number, first, samples = piece
    return tracker_of(asked).chunk(number, first, samples, keeps=keeps)


def walk_sample(asked: Tracking, piece: tuple[Array, Array]) -> tuple[float, tuple[Further, ...]] | None:
    """Walk the branch of a sample, and compare it with its tracked points; None if the walk fails.

    Returns
    -------
    largest : float
        Largest difference of a tracked point, infinite if the walk has none there.
    further : tuple of Further
        Points without nominal counterpart.
    """
    sample, values = piece
    tracker, mine = tracker_of(asked), values.copy()
    walked = tracker.walked(sample, values)
    if walked is None:
        return None
    further, _ = tracker.match(walked, sample, mine)
    way = np.sign(asked.end - asked.begin)
    differences = [
        min((abs(special.value - value) for special in walked if label_of(special)[:2] == label[:2]), default=np.inf)
        for label, value in zip(asked.labels, values.tolist(), strict=True)
        if way * (value - asked.begin) >= 0.0  # a walk does not meet those before its beginning
    ]
    return max(differences, default=0.0), tuple(further)
