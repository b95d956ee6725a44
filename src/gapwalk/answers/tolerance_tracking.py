"""Special points of many samples of a system: some branches are walked, and in the others the same points are tracked.

The walks show in which forms the points occur, also those that the nominal system does not have
(`gapwalk.answers.point_fit`). The forms are tracked in some more samples by Newton's method. Polynomials fitted to all
these solutions predict those of the other samples, and where each form exists. A prediction whose error is known to be
small is the answer; others are corrected. Where forms occur together that no walk has met together, this stretch of the
branch is walked (`gapwalk.answers.tolerance_tracking`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from gapwalk.answers.point_fit import Solutions, Walked, met_of
from gapwalk.answers.point_prediction import Corrected, Predicted, Terms, TrackedPoint, misses_of
from gapwalk.answers.tolerance import Further, HowFound, ToleranceChunk, ToleranceWalks, Tracking, label_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import BranchWalk
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit

# Forms of special points in samples: predicted where the error of that is known to be small, and else corrected.

Array = NDArray[np.float64]

_ONE_POINT = 1e-6  # scaled distance within which two solutions are one point
_UNLIKELY = -0.2  # score below which a form is not looked for
_EXACT = 0.05  # share of the allowed error that solutions may have to which predictions are fitted
_APART = 0.2  # distance between neighbouring points, as a share of the nominal one, below which both are corrected


class Located(NamedTuple):
    """A form in a sample."""

    #: value, error: Value of the parameter, and a bound of its error.
    value: float
    error: float
    unknowns: Array  #: Unknowns of its equation; empty for a form that is attached to another one.
    corrected: Corrected | None = None  #: The solution; None for a prediction whose error is known to be small.


class FormFinder:
    """Finds forms of special points in samples."""

    def __init__(self, asked: Tracking, origin: TrackedPoint) -> None:
        self.asked, self.origin = asked, origin
        self.points = [form.point(asked.names) for form in asked.forms]

    def terms(self, samples: Array) -> Terms:
        """Return the terms of polynomials at some samples."""
        return Terms((samples - self.origin.origin) / self.asked.deviations)

    def allows(self, sample: Array) -> bool:
        """Return True if the model allows the values of a sample."""
        try:
            self.asked.at(sample)
        except ModelError:
            return False
        return True

    def found(self, samples: Array, *, exact: bool = False) -> Iterator[dict[int, Located] | None]:
        """Yield for each sample what was found of each form; None if it is refused."""
        # If `exact`, predictions are corrected everywhere, and more exactly.
        forms = self.asked.forms
        terms = self.terms(samples)
        guesses = [None if point.fit is None else point.fit.predicted(terms) for point in self.points]
        scores, nothing = self._scores(terms), np.zeros(0)
        trusted = None if exact else self._trusted(guesses)
        offsets = {f: form.offset_at(terms) for f, form in enumerate(forms) if form.companion >= 0}
        left = 0.5 * self.asked.accuracy * (_EXACT if exact else 1.0)
        for k, sample in enumerate(samples):
            found = dict[int, Located]()
            if not self.allows(sample):
                yield None
                continue
            plane = self.origin.plane_at(sample)
            for f in np.argsort(-scores[k], kind="stable").tolist():
                guess = guesses[f]
                if scores[k, f] < _UNLIKELY or forms[f].companion >= 0 or guess is None:
                    continue
                if trusted is not None and np.isfinite(trusted[f][k]):
                    found[f] = Located(float(guess.unknowns[k, -1]), float(trusted[f][k]), guess.unknowns[k])
                    continue
                each = self.points[f].fitted_at(plane, guess.at(k), left)
                if each is not None and not self._is_double(f, each, found):
                    error = left * float(self.points[f].scales[-1])
                    found[f] = Located(each.value, error, each.unknowns, each)
            for f, (offset, errors) in offsets.items():
                beside = found.get(forms[f].companion)
                if beside is not None and np.isfinite(errors[k]):
                    error = beside.error + float(errors[k])
                    found[f] = Located(beside.value + float(offset[k]), error, nothing)
            yield found

    def _scores(self, terms: Terms) -> Array:
        """Return a number for each sample and form: about 1 where the form exists, and 0 where it does not."""
        found = np.ones((len(terms.x), len(self.points)))
        for f, form in enumerate(self.asked.forms):
            if len(form.scores):
                found[:, f] = terms.of(form.degree) @ form.scores
        return found

    def _trusted(self, predicted: Sequence[Predicted | None]) -> list[Array]:
        """Return for each form the bounds of the errors of its predictions, infinity where it must be corrected."""
        # A prediction is the answer if the form exists in all systems known so far, its error is small, and it is far
        # from its neighbours on the branch: contacts and multipliers of a special point change only where another
        # special point passes it, and points vanish where two of them meet.
        asked, forms = self.asked, self.asked.forms
        always = [f for f, form in enumerate(forms) if form.companion < 0 and not len(form.scores)]
        errors = [np.full(1, np.inf) if each is None else np.full(len(each.errors), np.inf) for each in predicted]
        for f in always:
            each = predicted[f]
            if each is not None:
                near = each.errors <= asked.accuracy * np.abs(each.unknowns[:, -1])
                errors[f] = np.where(near, each.errors, np.inf)
        for f, g in pairwise(f for f in always if predicted[f] is not None):
            near = self._nearness(f, g, predicted) < _APART
            errors[f][near] = errors[g][near] = np.inf
        return errors

    def _nearness(self, f: int, g: int, predicted: Sequence[Predicted | None]) -> Array:
        """Return the distance of two predicted forms in samples, along and as a share of the one at zero parameters."""
        one, other, fits = predicted[f], predicted[g], (self.points[f].fit, self.points[g].fit)
        assert one is not None
        assert other is not None
        assert fits[0] is not None
        assert fits[1] is not None
        columns = [*range(len(self.asked.first.state)), -1]
        scales = self.points[f].scales[columns]
        apart = (other.unknowns[:, columns] - one.unknowns[:, columns]) / scales
        between = (fits[1].coefficients[0, columns] - fits[0].coefficients[0, columns]) / scales
        return apart @ between / float(between @ between)

    def _is_double(self, f: int, each: Corrected, found: Mapping[int, Located]) -> bool:
        """Return True if another form came to the same solution."""
        kind, scales = self.asked.forms[f].met.kind, self.points[f].scales
        return any(
            self.asked.forms[g].met.kind == kind
            and len(other.unknowns) == len(each.unknowns)
            and float(np.abs((other.unknowns - each.unknowns) / scales).max()) < _ONE_POINT
            for g, other in found.items()
        )


# Walks of a stretch of a branch, between special points that are known to lie on it.
#
# Where it is unclear which special points a stretch has, the branch is walked from the last point before it that is
# known, until it meets a known point beyond.

_SAME = 1e-3  # difference of states, relative to the motion, within which two orbits at nearly one value are the same
_EQUAL = 1e-4  # share of the range within which two values are nearly one


@dataclass(frozen=True, eq=False)
class Mark:
    """A special point that is known to lie on a branch."""

    form: int  #: Number of its form.
    #: kind, contact: What it is.
    kind: str
    contact: str
    value: float  #: Value of the parameter.
    state: Array  #: shape (state size,): Initial state of its orbit.
    way: float  #: Sign of the change of the parameter where the walk passes it.

    def is_at(self, special: SpecialPoint, width: float) -> bool:
        """Return True if a special point of a walk is this one; `width` is that of the range."""
        if special.kind.value != self.kind or special.contact != self.contact:
            return False
        return abs(special.value - self.value) <= _EQUAL * width and self.has(special.orbit.state, special.orbit.system)

    def has(self, state: Array, system: System) -> bool:
        """Return True if an orbit that begins at a state is the one of this point."""
        return float(np.abs(state - self.state).max()) <= _SAME * magnitude(self.state, system)


def walk_stretch(
    system: System,
    parameter: str,
    period: int,
    within: tuple[float, float],
    start: Mark,
    ends: Sequence[Mark],
    options: WalkOptions,
) -> tuple[list[SpecialPoint], Mark | None] | None:
    """Walk a branch from a known special point until it meets another one, or the end of the range."""
    width, low, high = abs(within[1] - within[0]), min(within), max(within)
    found: list[SpecialPoint] = []
    try:
        orbit = find_orbit(system.at({parameter: start.value}), period, start.state)
        if not start.has(orbit.state, orbit.system):
            return None
        steps = BranchWalk([start_branch(orbit, parameter, (low, high), int(start.way))], options, judges=False)
        for _ in steps:
            for special in steps.special_points:
                met = next((end for end in ends if end.is_at(special, width)), None)
                if met is not None:
                    return found, met
                if found or not start.is_at(special, width):
                    found.append(special)
        end = steps.branch.ends[-1]
    except (ModelError, NumericalError):
        return None
    is_over = end.reason in (EndReason.RANGE, EndReason.TURNED_BACK) and end.value == within[1]
    return (found, None) if is_over else None


_BEYOND = 0.05  # share of the range by which a walk goes on beyond the farthest tracked point
_NEAR = 3e-3  # share of the range within which a walked point may always be the counterpart of a nominal one
_ALIKE = 1e-5  # share of the range within which a point found and one of a walk are the same
_FAR = 4.0  # the same, as a multiple of its spread over the samples: a form beyond a contact may be so far
_WORTH = 0.15  # share of samples that must be told by the walks, lest finding forms cost more than it saves


class Tracker:
    """Finds the special points of samples; see `Tracking`."""

    def __init__(self, asked: Tracking) -> None:
        self.asked = asked
        self.nominal = [TrackedPoint.of(special, asked.names) for special in asked.specials]
        self.mine = [
            met_of(special, asked.names, j, str(label_of(special)[2])) for j, special in enumerate(asked.specials)
        ]
        self.finder = FormFinder(asked, self.nominal[0])

    def walks(self, number: int, rows: NDArray[np.intp], samples: Array) -> ToleranceWalks:
        """Walk the branches of some samples with the numbers `rows`."""
        known, found = {met.alike for met in self.mine}, []
        for row, sample in zip(rows.tolist(), samples, strict=True):
            if not self.finder.allows(sample):
                found.append(Walked(row, HowFound.REFUSED))
                continue
            branch = self.walked(sample)
            if branch is None:
                found.append(Walked(row, HowFound.FAILED))
                continue
            specials = branch.special_points
            indices, met = self.match(specials, sample), []
            for special, index in zip(specials, indices, strict=True):
                met.append(met_of(special, self.asked.names, index, str(label_of(special)[2])))
            which = tuple(j for j, each in enumerate(met) if each.alike not in known)
            found.append(
                Walked(row, HowFound.WALKED, tuple(met), which, tuple(specials[j] for j in which), misses_of(branch))
            )
        return ToleranceWalks(number, tuple(found))

    def solve(self, number: int, rows: NDArray[np.intp], samples: Array, derivatives_too: bool) -> Solutions:
        """Find all forms in some samples with the numbers `rows`; keep their solutions, with derivatives if wanted."""
        sizes, count = [len(point.unknowns) for point in self.finder.points], len(samples)
        unknowns = [np.full((count, size), np.nan) for size in sizes]
        derivatives = [np.full((count, size, size), np.nan) for size in sizes]
        curvatures = [np.full(count, np.nan) for _ in sizes]
        every = []
        for k, found in enumerate(self.finder.found(samples, exact=self.asked.patterns is None)):
            for f, each in (found or {}).items():
                if each.corrected is not None:
                    unknowns[f][k], curvatures[f][k] = each.unknowns, each.corrected.curvature or np.nan
                    if derivatives_too:
                        derivatives[f][k] = self.finder.points[f].derivatives_at(each.corrected)
            every.append(tuple(sorted(found or ())))
        return Solutions(number, rows, tuple(every), tuple(unknowns), tuple(derivatives), tuple(curvatures))

    def chunk(self, number: int, rows: NDArray[np.intp], samples: Array) -> ToleranceChunk:
        """Find the points of some samples with the numbers `rows`."""
        asked, shape = self.asked, (len(samples), len(self.asked.specials))
        values, errors, how = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(len(samples), dtype=int)
        further = list[Further]()
        assert asked.patterns is not None
        tracks, near = asked.patterns.known_share >= _WORTH, self._near(samples)
        every = (
            self.finder.found(samples) if tracks else ({} if self.finder.allows(sample) else None for sample in samples)
        )
        for k, (row, found) in enumerate(zip(rows.tolist(), every, strict=True)):
            if found is None:
                how[k] = HowFound.REFUSED
                continue
            on, unclear = asked.patterns.told(found, near[k]) if tracks else ((), (0,))
            specials: Sequence[SpecialPoint] | None = ()
            if unclear:
                specials, on = self._walked_stretches(samples[k], found, on, unclear) or (None, on)
                how[k] = HowFound.PARTLY if specials is not None and on else HowFound.WALKED
            if specials is None:
                branch, on = self.walked(samples[k]), ()
                specials = None if branch is None else branch.special_points
            if specials is None:
                how[k] = HowFound.FAILED
                continue
            points = [
                (self.asked.forms[f].index, self.asked.forms[f].met.kind, found[f].value, found[f].error) for f in on
            ]
            indices = self.match(specials, samples[k], {index for index, *_ in points})
            points += [
                (index, special.kind.value, special.value, special.uncertainty)
                for special, index in zip(specials, indices, strict=True)
            ]
            for index, kind, value, error in points:
                if index >= 0:
                    values[k, index], errors[k, index] = value, error
                else:
                    further.append(Further(row, kind, value))
        return ToleranceChunk(number, rows, values, errors, how, tuple(further))

    def _near(self, samples: Array) -> list[set[int]]:
        """Return the stretches of samples in which points may have been born that walks only nearly met."""
        near, terms = [set[int]() for _ in samples], self.finder.terms(samples)
        for watch in self.asked.watches:
            for k in np.flatnonzero(watch.is_near(terms)).tolist():
                near[k].add(watch.stretch)
        return near

    def _walked_stretches(
        self, sample: Array, found: dict[int, Located], on: Sequence[int], unclear: Sequence[int]
    ) -> tuple[list[SpecialPoint], tuple[int, ...]] | None:
        """Walk the unclear stretches of a branch: the points met there, and the forms that lie on the rest of it."""
        # None if the whole branch is to be walked: where the first stretch is unclear, or a walk fails.
        asked, specials = self.asked, list[SpecialPoint]()
        assert asked.patterns is not None
        stretch, anchors = asked.patterns.stretch, asked.patterns.anchors
        kept, walked_to = set(on), 0
        for number in unclear:
            if number < walked_to:
                continue
            starts = [n for n in range(max(1, walked_to), number + 1) if self._is_mark(anchors[n], found)]
            if not starts:
                return None
            # a walk may end where the next one could begin, or where nothing is left to walk
            ends = [
                self._mark(anchors[n], found)
                for n in range(number + 1, len(anchors))
                if anchors[n] in found
                and (n not in unclear or self._is_mark(anchors[n], found))
                and asked.forms[anchors[n]].companion < 0
            ]
            done = walk_stretch(
                asked.at(sample),
                asked.parameter,
                asked.first.period,
                (asked.begin, self._farthest(sample)),
                self._mark(anchors[starts[-1]], found),
                ends,
                asked.walk,
            )
            if done is None:
                return None
            met, end = done
            specials += met
            walked_to = len(anchors) if end is None else stretch[end.form]
            kept = {f for f in kept if not starts[-1] <= stretch[f] < walked_to} | {anchors[starts[-1]]}
        return specials, tuple(sorted(kept))

    def _is_mark(self, f: int, found: Collection[int]) -> bool:
        """Return True if a walk can begin at a form that was found."""
        return f in found and self.asked.forms[f].companion < 0 and self.asked.forms[f].met.way != 0.0

    def _mark(self, f: int, found: dict[int, Located]) -> Mark:
        met, unknowns = self.asked.forms[f].met, found[f].unknowns
        state = unknowns[: len(self.asked.first.state)]
        return Mark(f, met.kind, met.contact, found[f].value, state, met.way)

    def walked(self, sample: Array) -> Branch | None:
        """Walk the branch of a sample; None if the walk fails."""
        asked = self.asked
        try:
            start, end = find_orbit(asked.at(sample), asked.first.period, asked.first.state), self._farthest(sample)
            within, way = (min(asked.begin, end), max(asked.begin, end)), 1 if end > asked.begin else -1
            steps = BranchWalk([start_branch(start, asked.parameter, within, way)], asked.walk, judges=False)
            for _ in steps:
                pass
            branch = steps.branch
        except (ModelError, NumericalError):
            return None
        return branch if branch.ends[-1].reason is EndReason.RANGE else None

    def _farthest(self, sample: Array) -> float:
        """Return the value of the parameter at which the walk of a sample ends."""
        asked = self.asked
        way = float(np.sign(asked.end - asked.begin))
        expected = [self.predicted_value(j, sample) for j in range(len(self.nominal))]
        return way * max([way * asked.end, *(way * value + _BEYOND * asked.width for value in expected)])

    def match(self, walked: Sequence[SpecialPoint], sample: Array, taken: Collection[int] = ()) -> list[int]:
        """Return for each point of a walk the index of its nominal counterpart, or -1."""
        # Counterparts share a label, and are near to where the gradient predicts them, compared with how the point is
        # spread over the samples. Nominal points that are `taken` have one already.
        labels, found = self.asked.labels, [-1] * len(walked)
        for label in dict.fromkeys(labels):
            rows = [j for j, each in enumerate(labels) if each == label and j not in taken]
            columns = [k for k, special in enumerate(walked) if label_of(special) == label]
            if not columns or not rows:
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
    """Comparison of the points found in a sample with those of a walk of its branch."""

    largest: float  #: Largest difference of a point that both have.
    #: missed, invented: Points that only the walk has, and that it has not, as texts.
    missed: tuple[str, ...]
    invented: tuple[str, ...]


def walk_sample(asked: Tracking, piece: tuple[Array, Array, tuple[tuple[str, float], ...]]) -> Compared | None:
    """Walk the branch of a sample, and compare it with what was found otherwise; None if the walk fails."""
    sample, values, further = piece
    walked = tracker_of(asked).walked(sample)
    if walked is None:
        return None
    mine = [(s.kind.value, v) for s, v in zip(asked.specials, values.tolist(), strict=True) if not np.isnan(v)]
    mine, theirs = [*mine, *further], [(special.kind.value, special.value) for special in walked.special_points]
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
