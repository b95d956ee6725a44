"""Forms of special points: the same point with other contacts, and points that only some systems have.

A special point is tracked through systems as long as its contacts and its other multipliers stay (its *key*). Beyond
a grazing contact it is the same point in another form; folds appear in pairs at a cusp. Some branches are therefore
walked, and each key that is met there, at its place between the points that all systems have, is a form. Solutions in
all systems where it was met predict it in others (`gapwalk.answers.point_prediction.Fit`).

Newton's method finds a form wherever it exists, even on another branch. What walks met among the forms found tells
which ones lie on the branch (`Patterns`).
"""

from __future__ import annotations

from ast import literal_eval
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.near_misses import Miss
from gapwalk.answers.point_prediction import Cloud, Fit, Regressions, Terms, degree_for
from gapwalk.answers.point_tracking import TrackedPoint
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.floquet import Instability

Array = NDArray[np.float64]

_ATTACHED = 3e-5  # share of its value within which a point beside a grazing point is taken from it
_MOST = 2  # degree of the polynomials that tell where a form exists, and how far it is from its companion


@dataclass(frozen=True, eq=False)
class Met:
    """A special point that a walk met, reduced to what forms need."""

    index: int  #: Index of its nominal counterpart, or -1.
    #: kind, contact, turns: What it has in common with its counterpart; see `label_of`.
    kind: str
    contact: str
    turns: str
    value: float  #: Value of the parameter of the branch.
    #: How often each stage and side closes in a period, without the touch of a grazing point itself, as text.
    closings: str
    others: str  #: Its unstable multipliers without the critical ones, as text.
    #: before, after: Number of unstable multipliers on either side.
    before: int
    after: int
    unknowns: Array  #: Solution of its equation; empty if it has none that can be tracked.
    orientation: float = 0.0  #: Sign of the determinant of the derivatives of its equation; 0 if it is not known.
    way: float = 0.0  #: Sign of the change of the parameter where the walk passes it; 0 where the branch turns back.
    uncertainty: float = np.inf  #: Estimated error of its value.

    @property
    def key(self) -> str:
        """All that stays while a point is tracked."""
        return " | ".join((self.kind, self.contact, self.turns, self.closings, self.others))

    @property
    def alike(self) -> tuple[str, str]:
        """All that its equation depends on."""
        return self.kind, self.contact

    @property
    def signature(self) -> tuple[object, ...]:
        """Its contacts and unstable multipliers, as in `TrackedPoint.signature`."""
        return literal_eval(self.closings), Instability(*literal_eval(self.others))


@dataclass(frozen=True, eq=False)
class Walked:
    """All special points of the branch of one sample, as a walk met them."""

    sample: int  #: Number of the sample.
    how: int  #: Value of `HowFound`: walked, refused or failed.
    met: tuple[Met, ...] = ()  #: The points in the order of the walk.
    #: which, specials: Places in `met` of points of which no nominal point has kind and contact, and these points.
    which: tuple[int, ...] = ()
    specials: tuple[SpecialPoint, ...] = ()
    misses: tuple[Miss, ...] = ()  #: Where the branch nearly has further points.


@dataclass(frozen=True, eq=False)
class Form:
    """A special point as some of the systems have it."""

    index: int  #: Index of its nominal counterpart, or -1.
    name: str  #: Its key, its place between the points that all walks met, and its number of several there.
    position: float  #: Place along the branch; those of the nominal points are 0, 1, 2 and so on.
    sample: int  #: Number of a sample that has it; -1 for the nominal system.
    met: Met  #: The point there.
    special: SpecialPoint  #: A point of the same kind and contact, whose equation it has.
    fit: Fit | None = None  #: Its predictor; None if the gradient predicts it.
    #: Number of the form of a grazing point to which it is attached; -1 if it is tracked by itself.
    companion: int = -1
    #: shape (terms,): Coefficients of its distance from the companion.
    offset: Array = field(default_factory=lambda: np.zeros(0))
    #: offset_cloud, offset_error: The samples of this fit, and a bound for its error at leverage 0; it grows like 1 +
    #: leverage.
    offset_cloud: Cloud | None = None
    offset_error: float = np.inf
    #: shape (terms,): Coefficients of a polynomial that is about 1 where the form exists, and 0 elsewhere; empty if it
    #: always does.
    scores: Array = field(default_factory=lambda: np.zeros(0))
    degree: int = 0  #: Degree of these polynomials.

    def offset_at(self, terms: Terms) -> tuple[Array, Array]:
        """Return the distances from the companion in samples, and bounds of their errors: infinity beyond the fit."""
        assert self.offset_cloud is not None
        return terms.of(self.offset_cloud.degree) @ self.offset, self.offset_error * (
            1.0 + terms.leverages(self.offset_cloud)
        )

    def point(self, names: Sequence[str]) -> TrackedPoint:
        """Return the point to track."""
        point = replace(TrackedPoint.of(self.special, names), fit=self.fit)
        # in the place of those of its special point
        point.__dict__.update(signature=self.met.signature, orientation=self.met.orientation)
        return point


def met_of(special: SpecialPoint, names: Sequence[str], index: int, turns: str) -> Met:
    """Return the properties of a special point that its form depends on."""
    closings = others = ""
    unknowns, orientation = np.zeros(0), 0.0
    try:
        point = TrackedPoint.of(special, names)
        signature, unknowns, orientation = point.signature, point.unknowns, point.orientation
        closings, others = repr(signature[0]), repr(tuple(signature[1]))  # pyright: ignore[reportArgumentType]
    except (ModelError, NumericalError):
        pass  # it cannot be tracked: samples that have it are noticed where it breaks the chain
    counts = special.before.total, special.after.total
    kind = special.kind.value
    way = 0.0 if special.turns else float(np.sign(special.point.tangent[-1]))
    label = index, kind, special.contact, turns, special.value, closings, others
    return Met(*label, *counts, unknowns, orientation, way, special.uncertainty)


def names_of(walked: Walked, anchors: Iterable[int]) -> list[str]:
    """Name the points of a walk by key, by the last of the points that all walks have, and by number."""
    fixed, last, seen, names = set(anchors), -1, dict[str, int](), []
    for met in walked.met:
        if met.index in fixed:
            last = met.index
        name = f"{met.index} | {met.key}" if met.index >= 0 else f"after {last} | {met.key}"
        seen[name] = seen.get(name, 0) + 1
        names.append(name if seen[name] == 1 else f"{name} | {seen[name]}")
    return names


def positions_of(walked: Walked) -> list[float]:
    """Return the places of the points of a walk between the nominal ones, which are at 0, 1, 2 and so on."""
    own = [(place, met.index) for place, met in enumerate(walked.met) if met.index >= 0]
    places = [-1, *(place for place, _ in own), len(walked.met)]
    indices = [-1.0, *(float(index) for _, index in own)]
    indices.append(max(indices) + 1.0)
    return np.interp(np.arange(len(walked.met)), places, indices).tolist()


def anchors_of(walks: Sequence[Walked], count: int) -> list[int]:
    """Return the nominal points that all walks met."""
    return [j for j in range(count) if all(any(met.index == j for met in each.met) for each in walks)]


def forms_of(
    walks: Sequence[Walked], anchors: Sequence[int], nominal: Sequence[SpecialPoint], mine: Sequence[Met]
) -> tuple[Form, ...]:
    """Return the forms that some walks met, without predictors, in their order along the branch."""
    places: dict[str, list[float]] = {}
    first: dict[str, tuple[int, Met]] = {}
    alike: dict[tuple[str, str], SpecialPoint] = {}
    for special, met in zip(nominal, mine, strict=True):
        name = f"{met.index} | {met.key}"
        first[name], places[name], alike[met.alike] = (-1, met), [float(met.index)], special
    for each in walks:
        for k, special in zip(each.which, each.specials, strict=True):
            alike.setdefault(each.met[k].alike, special)
        every = zip(names_of(each, anchors), positions_of(each), each.met, strict=True)
        for name, position, met in every:
            places.setdefault(name, []).append(position)
            if met.alike in alike and len(met.unknowns):
                first.setdefault(name, (each.sample, met))
    found = [
        Form(met.index, name, float(np.mean(places[name])), sample, met, alike[met.alike])
        for name, (sample, met) in first.items()
    ]
    return tuple(sorted(found, key=lambda form: (form.position, form.name)))


@dataclass(frozen=True, eq=False)
class Pool:
    """Solutions of one form in some samples."""

    rows: NDArray[np.intp]  #: Numbers of the samples.
    #: unknowns, derivatives, curvatures: As in `Fit.to`.
    unknowns: Array
    derivatives: Array
    curvatures: Array


@dataclass(frozen=True, eq=False)
class Solutions:
    """Solutions of all forms in some samples, on the branch or not."""

    number: int  #: Number of the chunk.
    rows: NDArray[np.intp]  #: Numbers of the samples.
    found: tuple[tuple[int, ...], ...]  #: Of each sample, the numbers of the forms that were found.
    #: unknowns, derivatives: Of each form its unknowns, shape (samples, unknowns), and the derivatives of its equation,
    #: shape (samples, unknowns, unknowns); nan where it was not found.
    unknowns: tuple[Array, ...]
    derivatives: tuple[Array, ...]
    curvatures: tuple[Array, ...]  #: Of each form the curvatures seen by Newton's method, shape (samples,).


def pools_of(
    forms: Sequence[Form],
    names: Sequence[Sequence[str]],
    walks: Sequence[Walked],
    chunks: Sequence[Solutions],
) -> tuple[Pool, ...]:
    """Return the solutions of all forms in walked samples, whose points have names, and in chunks of other samples."""
    at: dict[str, list[tuple[int, Met]]] = {}
    for each, own in zip(walks, names, strict=True):
        for name, met in zip(own, each.met, strict=True):
            if len(met.unknowns):
                at.setdefault(name, []).append((each.sample, met))
    found = []
    for f, form in enumerate(forms):
        mine = at.get(form.name, [])
        size = len(form.met.unknowns)
        rows = [np.array([row for row, _ in mine], dtype=int)]
        unknowns = [np.array([met.unknowns for _, met in mine]).reshape(-1, size)]
        # the equations of walked points have other scales, and so other derivatives
        derivatives = [np.full((len(mine), size, size), np.nan)]
        curvatures = [np.full(len(mine), np.nan)]
        for chunk in chunks:
            has = np.flatnonzero(~np.isnan(chunk.unknowns[f]).any(axis=1))
            rows.append(chunk.rows[has])
            unknowns.append(chunk.unknowns[f][has])
            derivatives.append(chunk.derivatives[f][has])
            curvatures.append(chunk.curvatures[f][has])
        found.append(
            Pool(np.concatenate(rows), *(np.concatenate(each) for each in (unknowns, derivatives, curvatures)))
        )
    return tuple(found)


def with_predictors(
    forms: Sequence[Form],
    points: Sequence[TrackedPoint],
    pools: Sequence[Pool],
    samples: Array,
    known: NDArray[np.intp],
    scaled: tuple[Array, Array],
) -> tuple[Form, ...]:
    """Return forms with predictors from their solutions."""
    found = []
    regressions = Regressions((samples - scaled[0]) / scaled[1])
    for number, (form, point, pool) in enumerate(zip(forms, points, pools, strict=True)):
        slopes = None
        if not degree_for(len(pool.rows), samples.shape[1]):
            at = point.origin if form.sample < 0 else samples[form.sample]
            slopes = point.slopes_at(point.solved(at, form.met.unknowns))
        fit = Fit.to(
            scaled,
            regressions,
            pool.rows,
            pool.unknowns,
            point.scales,
            slopes=slopes,
            derivatives=pool.derivatives,
            curvatures=pool.curvatures,
        )
        made = replace(form, fit=fit)
        if len(np.setdiff1d(known, pool.rows)):
            by = regressions.at(known, min(_MOST, degree_for(len(known), samples.shape[1])))
            made = replace(made, scores=by.fit(np.isin(known, pool.rows).astype(float)), degree=by.degree)
        found.append(_attached(made, number, forms, pools, regressions))
    return tuple(found)


def _attached(form: Form, number: int, forms: Sequence[Form], pools: Sequence[Pool], regressions: Regressions) -> Form:
    """Return a form attached to a grazing point that is beside it in all samples, as a fold of a stiff stop is."""
    own = pools[number]
    if form.met.kind == "grazing" or not len(own.rows):
        return form
    for other, pool in enumerate(pools):
        if forms[other].met.kind != "grazing" or abs(forms[other].met.value - form.met.value) > 0.01 * form.met.value:
            continue
        both, mine, theirs = np.intersect1d(own.rows, pool.rows, return_indices=True)
        if len(both) < len(own.rows):
            continue
        apart = own.unknowns[mine, -1] - pool.unknowns[theirs, -1]
        if np.abs(apart).max() <= _ATTACHED * np.abs(own.unknowns[:, -1]).min():
            by = regressions.at(both, min(_MOST, degree_for(len(both), regressions.x.shape[1])))
            error = by.unit_error(apart)
            if np.isfinite(error):
                return replace(form, companion=other, offset=by.fit(apart), offset_cloud=by.cloud, offset_error=error)
    return form


@dataclass(frozen=True, eq=False)
class Patterns:
    """Which of the forms found in a sample lie on the branch, as walked samples show it.

    A point found by Newton's method may lie on another branch, such as one that is closed and separate in some systems
    and joined to the branch in others. So the forms found in a walked sample are compared with those that its walk
    met. A sample in which the same forms are found has the same ones of them on its branch.
    """

    #: Of each form the number of the stretch, between points that all walks met, to which it belongs.
    stretch: tuple[int, ...]
    #: found, met: Numbers of forms of one stretch that were found in a walked sample, and those that its walk met
    #: there.
    found: tuple[tuple[int, ...], ...]
    met: tuple[tuple[int, ...], ...]
    #: Share of the walked samples that the others would have told: what to expect of samples that are not walked.
    known_share: float = 1.0

    @classmethod
    def of(cls, forms: Sequence[Form], sets: Iterable[tuple[Iterable[int], Iterable[str]]]) -> Patterns:
        """Compare forms found in walked samples with the names of those that the walks met, in their order."""
        sets, names = [(set(found), list(met)) for found, met in sets], {form.name: f for f, form in enumerate(forms)}
        fixed = [f for f, form in enumerate(forms) if sets and all(form.name in met for _, met in sets)]
        stretch = tuple(sum(g <= f for g in fixed) for f in range(len(forms)))
        pairs: dict[tuple[int, tuple[int, ...]], tuple[int, ...] | None] = {}
        counts, asked = Counter[tuple[int, tuple[int, ...]]](), list[list[tuple[int, tuple[int, ...]]]]()
        for found, met in sets:
            asked.append([])
            on, unknown, passed = {names[name] for name in met if name in names}, set[int](), 0
            for name in met:
                passed += name in names and names[name] in fixed
                if name not in names:
                    unknown.add(passed)
            for number in range(len(fixed) + 1):
                own = tuple(sorted(f for f in found if stretch[f] == number))
                there = tuple(sorted(f for f in on if stretch[f] == number))
                asked[-1].append((number, own))
                known = pairs.setdefault((number, own), there)
                if known != there or number in unknown:  # two answers are none, nor is a point without a form one
                    pairs[number, own] = None
            counts.update(asked[-1])
        told = sum(all(pairs[key] is not None and counts[key] > 1 for key in keys) for keys in asked)
        kept = [(own, there) for (_, own), there in pairs.items() if there is not None and (own or there)]
        return cls(stretch, tuple(own for own, _ in kept), tuple(there for _, there in kept), told / max(len(sets), 1))

    def told(self, found: Iterable[int], near: Collection[int] = ()) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return which of the forms found lie on the branch, and the stretches of which no walk tells.

        In the stretches `near`, points may have been born that were not looked for.
        """
        parts: dict[int, list[int]] = {number: [] for number in range(max(self.stretch, default=0) + 1)}
        for f in sorted(found):
            parts[self.stretch[f]].append(f)
        every, unclear = list[int](), list[int]()
        for number, own in parts.items():
            # every stretch but the first begins with a point that all walks met: nothing found there is no answer
            there = self._known.get(tuple(own), None if own or number else ())
            if there is None or not set(there) <= set(own) or number in near:
                unclear.append(number)
            else:
                every += there
        return tuple(every), tuple(unclear)

    @cached_property
    def anchors(self) -> tuple[int, ...]:
        """The form that all walks met with which each stretch begins; -1 for the first one, the beginning."""
        return (-1, *(f for f, number in enumerate(self.stretch) if number > (self.stretch[f - 1] if f else 0)))

    @cached_property
    def _known(self) -> dict[tuple[int, ...], tuple[int, ...]]:
        return dict(zip(self.found, self.met, strict=True))
