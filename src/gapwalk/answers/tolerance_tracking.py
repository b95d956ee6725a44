"""Special points of many samples of a system: some branches are walked, and in the others the same points are tracked.

The walks show in which forms the points occur, also those that the nominal system does not have
(`gapwalk.answers.point_forms`). The forms are tracked in some more samples by Newton's method. Polynomials fitted to
all these solutions predict those of the other samples, and where each form exists. A sample in which such forms are
found together as no walk has met them is walked too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from gapwalk.answers.point_forms import (
    Form,
    Patterns,
    Solutions,
    Walked,
    met_of,
    offset_at,
)
from gapwalk.answers.point_tracking import Corrected, TrackedPoint, polynomial
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit

Array = NDArray[np.float64]

_SAME = 1e-6  # share of the range within which two values are one point
_BEYOND = 0.02  # share of the range by which a walk goes on beyond the farthest tracked point
_NEAR = 3e-3  # share of the range within which a walked point may always be the counterpart of a nominal one
_ALIKE = 1e-5  # share of the range within which a point found and one of a walk are the same
_FAR = 4.0  # the same, as a multiple of its spread over the samples: a form beyond a contact may be so far
_WORTH = 0.15  # share of samples that must be told by the walks, lest finding forms cost more than it saves
_UNLIKELY = -0.2  # score below which a form is not looked for


class HowFound(IntEnum):
    """How the special points of one sample were found."""

    TRACKED = 0
    """By Newton's method, from predictions."""
    WALKED = 1
    """By walking the branch of the sample."""
    REFUSED = 2
    """Not at all: the model does not allow these values."""
    FAILED = 3
    """Not all: the walk failed."""
    LOST = 4
    """Not yet."""


@dataclass(frozen=True, eq=False)
class Further:
    """A special point of a sample that has no nominal counterpart.

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
class ToleranceWalks:
    """Walked branches of some samples.

    Attributes
    ----------
    number
        Number of the chunk.
    walked
        The samples.
    """

    number: int
    walked: tuple[Walked, ...]


@dataclass(frozen=True, eq=False)
class ToleranceChunk:
    """Special points of some samples.

    Attributes
    ----------
    number
        Number of the chunk.
    rows
        Numbers of the samples.
    values : shape (samples, points)
        Value of the parameter at each point; nan where it does not exist.
    how : shape (samples,)
        Values of `HowFound`.
    further
        Special points without nominal counterpart.
    unclear
        Of each sample that is still lost, the numbers of the forms that were found: no walk has shown them together.
    """

    number: int
    rows: NDArray[np.intp]
    values: Array
    how: NDArray[np.intp]
    further: tuple[Further, ...] = ()
    unclear: tuple[tuple[int, ...], ...] = ()


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
    deviations
        Standard deviations of the parameters.
    walk
        Options of the walks.
    forms
        Forms of all points; empty for the walks.
    patterns
        Which of the forms found in a sample lie on its branch; None for the first solutions.
    """

    key: str
    system: System
    names: tuple[str, ...]
    first: Orbit
    parameter: str
    begin: float
    end: float
    specials: tuple[SpecialPoint, ...]
    deviations: Array
    walk: WalkOptions
    forms: tuple[Form, ...] = ()
    patterns: Patterns | None = None

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
        self.nominal = [TrackedPoint.of(special, asked.names) for special in asked.specials]
        self.mine = [
            met_of(special, asked.names, j, str(label_of(special)[2])) for j, special in enumerate(asked.specials)
        ]
        self.points = [form.point(asked.names) for form in asked.forms]

    def walks(self, number: int, rows: NDArray[np.intp], samples: Array) -> ToleranceWalks:
        """Walk the branches of some samples with the numbers `rows`."""
        known, found = {met.alike for met in self.mine}, []
        for row, sample in zip(rows.tolist(), samples, strict=True):
            if not self._allows(sample):
                found.append(Walked(row, HowFound.REFUSED))
                continue
            specials = self.walked(sample)
            if specials is None:
                found.append(Walked(row, HowFound.FAILED))
                continue
            indices, met = self.match(specials, sample), []
            for special, index in zip(specials, indices, strict=True):
                met.append(met_of(special, self.asked.names, index, str(label_of(special)[2])))
            which = tuple(j for j, each in enumerate(met) if each.alike not in known)
            found.append(Walked(row, HowFound.WALKED, tuple(met), which, tuple(specials[j] for j in which)))
        return ToleranceWalks(number, tuple(found))

    def solve(self, number: int, rows: NDArray[np.intp], samples: Array, inverses_too: bool) -> Solutions:
        """Find all forms in some samples with the numbers `rows`; keep their solutions, with inverses if wanted."""
        sizes, count = [len(point.unknowns) for point in self.points], len(samples)
        unknowns = [np.full((count, size), np.nan) for size in sizes]
        inverses = [np.full((count, size, size), np.nan) for size in sizes]
        curvatures = [np.full(count, np.nan) for _ in sizes]
        every = []
        for k, found in enumerate(self._found(samples)):
            for f, each in (found or {}).items():
                if isinstance(each, Corrected):
                    unknowns[f][k], curvatures[f][k] = each.unknowns, each.curvature or np.nan
                    if inverses_too:
                        inverses[f][k] = self.points[f].inverse_at(each)
            every.append(tuple(sorted(found or ())))
        return Solutions(number, rows, tuple(every), tuple(unknowns), tuple(inverses), tuple(curvatures))

    def chunk(self, number: int, rows: NDArray[np.intp], samples: Array) -> ToleranceChunk:
        """Find the points of some samples with the numbers `rows`."""
        asked, count = self.asked, len(samples)
        values, how = np.full((count, len(asked.specials)), np.nan), np.zeros(count, dtype=int)
        further, unclear = list[Further](), list[tuple[int, ...]]()
        assert asked.patterns is not None
        if asked.patterns.known_share < _WORTH:
            for k, (row, sample) in enumerate(zip(rows.tolist(), samples, strict=True)):
                how[k], more = self.recover(sample, values[k])
                further += [replace(each, sample=row) for each in more]
            return ToleranceChunk(number, rows, values, how, tuple(further))
        for k, found in enumerate(self._found(samples)):
            on = None if found is None else asked.patterns.on_branch(found)
            if found is None:
                how[k] = HowFound.REFUSED
            elif on is None:
                how[k] = HowFound.LOST
                unclear.append(tuple(sorted(found)))
            else:
                for f in on:
                    each = found[f]
                    form, value = asked.forms[f], each.value if isinstance(each, Corrected) else each
                    if form.index >= 0:
                        values[k, form.index] = value
                    else:
                        further.append(Further(int(rows[k]), form.met.kind, value))
        return ToleranceChunk(number, rows, values, how, tuple(further), tuple(unclear))

    def _allows(self, sample: Array) -> bool:
        try:
            self.asked.at(sample)
        except ModelError:
            return False
        return True

    def recover(self, sample: Array, values: Array) -> tuple[HowFound, list[Further]]:
        """Walk the branch of a sample, and write the values of its points into `values`; return the further ones."""
        if not self._allows(sample):
            return HowFound.REFUSED, []
        specials = self.walked(sample)
        if specials is None:
            return HowFound.FAILED, []
        further = []
        for special, index in zip(specials, self.match(specials, sample), strict=True):
            if index >= 0:
                values[index] = special.value
            else:
                further.append(Further(0, special.kind.value, special.value))
        return HowFound.WALKED, further

    def walked(self, sample: Array) -> tuple[SpecialPoint, ...] | None:
        """Walk the branch of a sample; None if the walk fails."""
        asked = self.asked
        way = float(np.sign(asked.end - asked.begin))
        expected = [self.predicted_value(j, sample) for j in range(len(self.nominal))]
        farthest = max([way * asked.end, *(way * value + _BEYOND * asked.width for value in expected)])
        try:
            start = find_orbit(asked.at(sample), asked.first.period, tuple(asked.first.state.tolist()))
            branch = follow(start, asked.parameter, way * farthest, walk=asked.walk)
        except (ModelError, NumericalError):
            return None
        return branch.special_points if branch.ends[-1].reason is EndReason.RANGE else None

    def match(self, walked: Sequence[SpecialPoint], sample: Array) -> list[int]:
        """Return for each point of a walk the index of its nominal counterpart, or -1.

        Counterparts share a label, and are near to where the gradient predicts them, compared with how the point is
        spread over the samples.
        """
        labels, found = self.asked.labels, [-1] * len(walked)
        for label in dict.fromkeys(labels):
            rows = [j for j, each in enumerate(labels) if each == label]
            columns = [k for k, special in enumerate(walked) if label_of(special) == label]
            if not columns:
                continue
            expected = np.array([self.predicted_value(j, sample) for j in rows])
            cost = np.abs(expected[:, None] - np.array([walked[k].value for k in columns])[None])
            limits = np.array([self.reaches[j] for j in rows])
            far = cost > limits[:, None]
            cost[far] += 1e3 * self.asked.width
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if not far[row, column]:
                    found[columns[column]] = rows[row]
        return found

    def predicted_value(self, index: int, sample: Array) -> float:
        """Return the value of the parameter at a nominal point by its gradient."""
        point = self.nominal[index]
        return point.value + float(point.slopes[-1] @ (sample - point.origin))

    @cached_property
    def reaches(self) -> list[float]:
        """How far from the value by its gradient the counterpart of each nominal point may be."""
        spreads = (float(np.linalg.norm(point.slopes[-1] * self.asked.deviations)) for point in self.nominal)
        return [max(_FAR * each, _NEAR * self.asked.width) for each in spreads]

    def _scores(self, samples: Array) -> Array:
        """Return a number for each sample and form: about 1 where the form exists, and 0 where it does not."""
        found = np.ones((len(samples), len(self.points)))
        x = (samples - self.nominal[0].origin) / self.asked.deviations
        terms: dict[int, Array] = {}
        for f, form in enumerate(self.asked.forms):
            if len(form.scores):
                if form.degree not in terms:
                    terms[form.degree] = polynomial(x, form.degree)
                found[:, f] = terms[form.degree] @ form.scores
        return found

    def _found(self, samples: Array) -> Iterator[dict[int, Corrected | float] | None]:
        """Yield for each sample what was found of each form, of an attached one its value; None if it is refused."""
        forms, x = self.asked.forms, (samples - self.nominal[0].origin) / self.asked.deviations
        guesses = [None if point.fit is None else point.fit.predicted(samples) for point in self.points]
        scores = self._scores(samples)
        for k, sample in enumerate(samples):
            found = dict[int, Corrected | float]()
            if not self._allows(sample):
                yield None
                continue
            plane = self.nominal[0].plane_at(sample)
            for f in np.argsort(-scores[k], kind="stable").tolist():
                guess = guesses[f]
                if scores[k, f] < _UNLIKELY or forms[f].companion >= 0 or guess is None:
                    continue
                each = self.points[f].fitted_at(plane, guess[0][k], None if guess[1] is None else guess[1][k])
                if each is not None and not self._is_double(f, each, found):
                    found[f] = each
            for f, form in enumerate(forms):
                beside = found.get(form.companion)
                if isinstance(beside, Corrected):
                    found[f] = beside.value + offset_at(form, x[k])
            yield found

    def _is_double(self, f: int, each: Corrected, found: dict[int, Corrected | float]) -> bool:
        """Return True if another form came to the same solution."""
        kind, scales = self.asked.forms[f].met.kind, self.points[f].scales
        return any(
            isinstance(other, Corrected)
            and self.asked.forms[g].met.kind == kind
            and len(other.unknowns) == len(each.unknowns)
            and float(np.abs((other.unknowns - each.unknowns) / scales).max()) < _SAME
            for g, other in found.items()
        )


@lru_cache(maxsize=3)
def _prepared(key: str) -> list[Tracker]:
    return []


def tracker_of(asked: Tracking) -> Tracker:
    """Return the tracker of a tracking, prepared once in each process."""
    kept = _prepared(asked.key)
    if not kept:
        kept.append(Tracker(asked))
    return kept[0]


def walk_chunk(asked: Tracking, piece: tuple[int, NDArray[np.intp], Array]) -> ToleranceWalks:
    """Walk the branches of a chunk of samples; a piece of work for any process."""
    return tracker_of(asked).walks(*piece)


def solve_chunk(asked: Tracking, piece: tuple[int, NDArray[np.intp], Array, bool]) -> Solutions:
    """Find all forms in a chunk of samples; a piece of work for any process."""
    return tracker_of(asked).solve(*piece)


def track_chunk(asked: Tracking, piece: tuple[int, NDArray[np.intp], Array]) -> ToleranceChunk:
    """Find the special points of a chunk of samples; a piece of work for any process."""
    return tracker_of(asked).chunk(*piece)


class Compared(NamedTuple):
    """Comparison of the points found in a sample with those of a walk of its branch.

    Attributes
    ----------
    largest
        Largest difference of a point that both have.
    missed, invented
        Points that only the walk has, and that it has not, as texts.
    """

    largest: float
    missed: tuple[str, ...]
    invented: tuple[str, ...]


def walk_sample(asked: Tracking, piece: tuple[Array, Array, tuple[tuple[str, float], ...]]) -> Compared | None:
    """Walk the branch of a sample, and compare it with what was found otherwise; None if the walk fails.

    Parameters
    ----------
    asked
        The tracking.
    piece
        The sample, its values at the nominal points, and kinds and values of its further points.
    """
    sample, values, further = piece
    walked = tracker_of(asked).walked(sample)
    if walked is None:
        return None
    mine = [(s.kind.value, v) for s, v in zip(asked.specials, values.tolist(), strict=True) if not np.isnan(v)]
    mine, theirs = [*mine, *further], [(special.kind.value, special.value) for special in walked]
    cost = np.full((len(mine), len(theirs)), asked.width)
    for row, (kind, value) in enumerate(mine):
        for column, (other, there) in enumerate(theirs):
            if kind == other:
                cost[row, column] = abs(value - there)
    rows, columns = linear_sum_assignment(np.minimum(cost, _ALIKE * asked.width))
    near = [(r, c) for r, c in zip(rows.tolist(), columns.tolist(), strict=True) if cost[r, c] < _ALIKE * asked.width]
    low, high = sorted((asked.begin, asked.end))

    def only(every: list[tuple[str, float]], met: set[int]) -> tuple[str, ...]:
        return tuple(f"a {k} at {v:.6g}" for n, (k, v) in enumerate(every) if n not in met and low <= v <= high)

    largest = max((float(cost[pair]) for pair in near), default=0.0)
    return Compared(largest, only(theirs, {c for _, c in near}), only(mine, {r for r, _ in near}))
