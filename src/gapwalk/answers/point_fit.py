"""Fit named parameters to special points measured in slow sweeps, such as jump frequencies and ends of rattle bands.

The residual of a point is its computed value minus the measured one, over the standard uncertainty of the measurement.
The special points are tracked from trial to trial; their gradients are exact, and give the standard errors.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

import math
import os
from ast import literal_eval
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_prediction import Cloud, Corrected, Fit, Miss, Regressions, Terms, TrackedPoint, degree_for
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.files import content_of
from gapwalk.measurement.fit import (
    Estimate,
    Evidence,
    FitOptions,
    determined,
    doubts_of,
    estimate_of,
    independent,
    limits_of,
)
from gapwalk.model.bounds import Finite, Positive, check_fields
from gapwalk.model.channels.text_table import parse_csv
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, with_error
from gapwalk.notebook import Shown
from gapwalk.orbit.find import carry
from gapwalk.orbit.floquet import Instability
from gapwalk.summary import SummaryParts, Table, Tables, remarks, row_of, rows_of, summarizes

# Special points measured in slow sweeps, and the special points of a branch to which they belong.

MAX_POINTS = 10_000
"""Most points that a file may have."""
_MAX_BYTES = 10_000_000
_COLUMNS = ("kind", "value", "error", "which")
_LISTED = 6  # points that a message lists
_CLEAR = 2.0  # the second nearest special point must be farther than the nearest one by this factor


@dataclass(frozen=True, slots=True)
class MeasuredPoint:
    """A special point that was measured, such as the frequency of a jump in a slow sweep."""

    kind: str  #: Its kind: ``"fold"`` for a jump, ``"grazing"`` for a stop that is first touched, or another.
    value: Finite  #: Measured value of the parameter of the branch, in its units.
    error: Positive  #: Standard uncertainty of this value.
    #: The special point of the computed branch that was measured, if the nearest one of its kind is in doubt: its
    #: number among those of its kind along the branch, from 1; or its contact, such as ``"stage2 +"``.
    which: int | str = ""

    def __post_init__(self) -> None:
        kinds = [str(kind) for kind in Kind.known()]
        if self.kind not in kinds:
            raise ModelError(f"kind is {self.kind!r}; {did_you_mean(str(self.kind), kinds)}")
        check_fields(self, f" of the {self.kind}")
        if isinstance(self.which, bool) or not isinstance(self.which, int | str):
            raise ModelError(f"which is {self.which!r}; write a number from 1, or a contact such as 'stage2 +'")

    @property
    def words(self) -> str:
        """Kind, measured value and uncertainty."""
        return f"{self.kind} measured at {with_error(self.value, self.error, figures=2)}"


def measured_of(row: MeasuredPoint | Sequence[object]) -> MeasuredPoint:
    """Return a measured point from (kind, value, error) or (kind, value, error, which)."""
    if isinstance(row, MeasuredPoint):
        return row
    if isinstance(row, str) or not isinstance(row, Sequence) or len(row) not in {3, 4}:
        raise ModelError(f"a measured point is {row!r}; write (kind, value, error), as in ('fold', 0.619, 0.0005)")
    return MeasuredPoint(*row)  # type: ignore[arg-type]


def match_points(specials: Sequence[SpecialPoint], measured: Sequence[MeasuredPoint]) -> list[SpecialPoint]:
    """Return the special point that belongs to each measured one."""
    if not measured:
        raise ModelError("no point was measured; write some, as in [('fold', 0.619, 0.0005)]")
    if len({(each.parameter, each.orbit.system) for each in specials}) == 0:
        raise ModelError("the branch has no special points; walk a longer one")
    found: list[SpecialPoint] = []
    for each in measured:
        alike = [special for special in specials if special.kind == each.kind]
        listed = _listed(alike, each.value)
        if not alike:
            known = ", ".join(dict.fromkeys(str(special.kind) for special in specials))
            raise ModelError(f"a {each.words} was measured, but the branch has none; it has {known}")
        if isinstance(each.which, int):
            if not 1 <= each.which <= len(alike):
                raise ModelError(f"a {each.words} is number {each.which}, but the branch has {len(alike)} ({listed})")
            found.append(alike[each.which - 1])
            continue
        near = [special for special in alike if each.which in ("", special.contact)]
        if not near:
            raise ModelError(f"a {each.words} has which = {each.which}, but the branch has {listed}")
        near.sort(key=lambda special: abs(special.value - each.value))
        distances = [abs(special.value - each.value) for special in near]
        if len(near) > 1 and distances[1] < _CLEAR * distances[0]:
            raise ModelError(
                f"a {each.words} may be that at {near[0].value:.8g} or at {near[1].value:.8g}; say which, as in "
                f"which = {alike.index(near[0]) + 1} (the branch has {listed})"
            )
        for other, special in zip(measured, found, strict=False):
            if special is near[0] and not isinstance(other.which, int):
                raise ModelError(
                    f"a {each.words} and a {other.words} are both nearest to that at {special.value:.8g}; say which "
                    f"they are, as in which = {alike.index(special) + 1} (the branch has {listed})"
                )
        found.append(near[0])
    return found


def _listed(alike: Sequence[SpecialPoint], value: float) -> str:
    """List the points nearest to a value by their numbers along the branch."""
    numbered = list(enumerate(alike, start=1))
    nearest = sorted(numbered, key=lambda each: abs(each[1].value - value))[:_LISTED]
    texts = [
        f"{number}: at {special.value:.8g}{', ' * bool(special.contact)}{special.contact}"
        for number, special in sorted(nearest, key=lambda each: each[0])
    ]
    return "; ".join([*texts, *(["and others"] if len(alike) > _LISTED else [])])


def read_points(path: str | os.PathLike[str]) -> tuple[MeasuredPoint, ...]:
    r"""Read measured special points from a CSV file with the columns kind, value, error and, if needed, which.

    `value` and `error` are in the unit of the parameter of the branch, such as rpm; `which` is as in `MeasuredPoint`.

    Parameters
    ----------
    path
        The file; its first line names the columns.

    Returns
    -------
    points : tuple of MeasuredPoint
        One for each line.

    Raises
    ------
    ModelError
        If the file cannot be read, a column is missing, or an entry is invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> written = Path("jumps.csv").write_text("kind,value,error,which\nfold,1.39,0.001,1\n")
    >>> gw.measure.read_points("jumps.csv")[0].value
    1.39
    """
    name = repr(os.fspath(path))
    try:
        table = parse_csv(content_of(path, _MAX_BYTES, "leave out rows"), "kind,value,error", MAX_POINTS)
        places = {head: place for place, head in enumerate(table.heads)}
        for head in _COLUMNS[:3]:
            if head not in places:
                raise ModelError(
                    f"has no column {head}; its first line must be kind,value,error or {','.join(_COLUMNS)}"
                )
        for head in places:
            if head not in _COLUMNS:
                raise ModelError(f"has a column {head!r}, which points do not have; {did_you_mean(head, _COLUMNS)}")
        numbers = table.numbers({head: places[head] for head in ("value", "error")})
        kinds = table.texts(places["kind"])
        which = table.texts(places["which"]) if "which" in places else [""] * len(kinds)
        points = []
        for (line, _), kind, value, error, text in zip(table.rows, kinds, *numbers.values(), which, strict=True):
            try:
                points.append(MeasuredPoint(kind, float(value), float(error), int(text) if text.isdigit() else text))
            except ModelError as problem:
                raise ModelError(f"line {line}: {problem}") from None
    except ValueError as problem:
        raise ModelError(f"points in {name}: {problem}") from None
    return tuple(points)


# Forms of special points: the same point with other contacts, and points that only some systems have.
#
# A special point is tracked through systems as long as its contacts and its other multipliers stay (its *key*). Beyond
# a grazing contact it is the same point in another form; folds appear in pairs at a cusp. Some branches are therefore
# walked, and each key that is met there, at its place between the points that all systems have, is a form. Solutions
# in all systems where it was met predict it in others (`gapwalk.answers.point_prediction.Fit`).
#
# Newton's method finds a form wherever it exists, even on another branch. What walks met among the forms found tells
# which ones lie on the branch (`Patterns`).

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
    """Solutions of the same kind of orbit, at some samples of the parameters."""

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
    forms: Sequence[Form], names: Sequence[Sequence[str]], walks: Sequence[Walked], chunks: Sequence[Solutions]
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
        """Return which of the forms found lie on the branch, and the stretches of which no walk tells."""
        # In the stretches `near`, points may have been born that were not looked for.
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


_TOLERANCE = 1e-13  # relative tolerance of step, cost and gradient
_ROUNDS = 3  # most minimisations, each with the parameters that have an effect by then
_RANK = 1e-6  # slopes of multipliers have about nine digits; see `gapwalk.measurement.fit`
_IDLE = 1e-6  # shift of the points by 100 % of a parameter, in uncertainties, below which it has no effect
_ROUNDING = 1e-6  # the same, relative to that of the most effective parameter: slopes are not exact
_SAME = 1e-6  # scaled distance within which two special points are one
_EDGE = 1e-3  # cosine between residual and slopes above which a minimum was not reached
_UNLIKELY = 1e-3  # probability of so large a sum of squares below which the uncertainties are in doubt
_SMALL = 0.05  # component of a combination below which it is not named
_MET = 1e-6  # share of the range within which a walk must meet a fitted point

_POINTS = Evidence("the points do not determine", "it moves none of them", "leaves the points where they are")


@dataclass(frozen=True, slots=True)
class FittedPoint:
    """A measured special point beside the computed one."""

    #: kind, contact: Its kind, and the contact that grazes.
    kind: str
    contact: str
    #: before, after: Values computed with the first guess and with the fitted parameters.
    before: float
    after: float
    #: measured, error: Measured value and its standard uncertainty.
    measured: float
    error: float

    @property
    def residual(self) -> float:
        """Fitted minus measured value, in standard uncertainties."""
        return (self.after - self.measured) / self.error


@dataclass(frozen=True, slots=True)
class Combination:
    """A combination of relative changes of the parameters, and how well the points determine it."""

    #: Weight of the relative change of each parameter; the sum of their squares is 1. A parameter that is 0 counts in
    #: its unit.
    weights: tuple[float, ...]
    singular: float  #: Singular value: by how many standard uncertainties a relative change of 1 moves the points.

    @property
    def error(self) -> float:
        """Standard error of the combination, relative; infinite if it is not determined."""
        return 1.0 / self.singular if self.singular > 0.0 else math.inf

    def words(self, names: Sequence[str]) -> str:
        """Return the combination as a sum, without small parts."""
        parts = [(w, name) for w, name in zip(self.weights, names, strict=True) if abs(w) > _SMALL]
        parts.sort(key=lambda part: -abs(part[0]))
        text = " ".join(f"{'-' if w < 0.0 else '+'} {abs(w):.2f} {name}" for w, name in parts)
        return text.removeprefix("+ ")


@dataclass(frozen=True, eq=False, repr=False)
class PointFit(Shown):
    """Parameters fitted to measured special points."""

    parameter: str  #: Parameter of the branch.
    estimates: tuple[Estimate, ...]  #: The fitted parameters, each with its standard error.
    points: tuple[FittedPoint, ...]  #: The points, before and after, beside the measured ones.
    correlation: Array  #: shape (k, k): Correlations of the estimates' errors.
    #: Combinations of the parameters from the best to the least determined one, without those at a bound.
    combinations: tuple[Combination, ...]
    chi_square: float  #: Sum of the squares of the residuals in standard uncertainties.
    freedom: int  #: Number of points minus that of combinations that they determine.
    evaluations: int  #: Number of systems in which the points were computed.
    system: System  #: The fitted system.
    #: The branch of the fitted system, walked again; None if it could not be, or only points were given.
    branch: Branch | None
    notes: tuple[str, ...]  #: Further information, in sentences.
    failures: tuple[str, ...]  #: Reasons to distrust the result.

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of one parameter."""
        return estimate_of(self.estimates, name)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the parameters that did not end at a bound, in the order of the weights of combinations."""
        return tuple(each.name for each in self.estimates if not math.isnan(each.error))

    @summarizes
    def summary(self, failures: bool = True) -> SummaryParts:
        """Return the parameters, the points, what the points determine, notes, and failures if wanted."""
        units = self.system.units
        parameters, points = len(self.estimates), len(self.points)
        yield f"{parameters} parameter{'s'[: parameters > 1]} fitted to {points} measured point{'s'[: points > 1]}"
        rows = []
        for each in self.estimates:
            value, _, rest = str(each).partition(" ")
            rows.append([parameter_symbol(each.name, units), f"{each.start:.6g}", f"{value} {rest}".strip()])
        yield Table(["parameter", ">before", "after"], rows)
        symbol = parameter_symbol(self.parameter, units)
        yield Table(
            ["point", "contact", f">{symbol} before", ">after", ">measured", ">residual"],
            [
                [
                    *(p.kind, p.contact, f"{p.before:.8g}", f"{p.after:.8g}"),
                    *(with_error(p.measured, p.error, figures=2), f"{round(p.residual, 2) + 0.0:+.2f}"),
                ]
                for p in self.points
            ],
        )
        if self.combinations:
            rows = [[each.words(self.free_names), f"{each.singular:.3g}", _percent(each)] for each in self.combinations]
            yield Table(["combination of relative changes", ">singular value", ">known to"], rows)
        yield f"chi-square {self.chi_square:.3g} with {self.freedom} degree{'s'[: self.freedom != 1]} of freedom"
        yield from remarks(self.notes, self.failures if failures else ())

    def tables(self) -> Tables:
        """Return the tables of parameters, points, and combinations with their weights."""
        names = self.free_names
        return {
            "parameters": lambda: rows_of(row_of(each) for each in self.estimates),
            "points": lambda: rows_of({**row_of(each), "residual": each.residual} for each in self.points),
            "combinations": lambda: rows_of(
                {"singular": each.singular, "error": each.error, **dict(zip(names, each.weights, strict=True))}
                for each in self.combinations
            ),
        }

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name} = {each}" for each in self.estimates)
        parts = [values, f"chi-square {self.chi_square:.3g} of {self.freedom}", *self.failures]
        return f"PointFit({'; '.join(parts)})"


def _percent(each: Combination) -> str:
    return f"± {100.0 * each.error:.2g} %" if math.isfinite(each.error) else "undetermined"


def fit_points(
    branch: Branch | Iterable[SpecialPoint],
    measured: Iterable[MeasuredPoint | Sequence[object]],
    parameters: Sequence[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    options: FitOptions | None = None,
) -> PointFit:
    """Fit named parameters of a system to measured special points, such as jump frequencies and ends of rattle bands.

    The sum of the squares of the residuals is minimised (trust region, `scipy.optimize.least_squares`) with exact
    gradients of the points. Each computed point is a special point of `branch`, followed while parameters change.
    Standard errors follow from the uncertainties of the measured values, which are taken as independent. At the end the
    branch is walked again with the fitted parameters, to check that it has the fitted points.

    Parameters
    ----------
    branch
        The branch computed with the first guess of the parameters; or special points of one system.
    measured
        The measured points, each as `MeasuredPoint` or as (kind, value, error) or (kind, value, error, which).
    parameters
        Names of the parameters to fit, without the parameter of the branch.
    bounds
        Lowest and highest value by name. Clearances and damping coefficients are never negative.
    options
        Limits on the work.

    Returns
    -------
    fitted : PointFit
        The parameters with their standard errors; ``failures`` name parameters that the points do not determine.

    Raises
    ------
    ModelError
        For an unknown parameter, an invalid bound, or a measured point that matches no special point or several.
    ConvergenceError
        If no minimum is found within the allowed number of evaluations.

    Examples
    --------
    >>> found = gw.measure.fit_points(branch, [("fold", 1.39, 0.001)], ["stop.clearance"])
    >>> round(found.estimates[0].value, 4)
    1.0102
    """
    if isinstance(branch, System):
        raise ModelError(
            "fit_points was given a system; give a branch, as in gw.follow(gw.find_orbit(system), 'frequency', 0.5)"
        )
    specials = tuple(branch.special_points if isinstance(branch, Branch) else branch)
    wanted = [measured_of(each) for each in measured]
    matched = match_points(specials, wanted)
    system, parameter = matched[0].orbit.system, matched[0].parameter
    names, limits = limits_of(system, parameters, bounds or {})
    if not names:
        raise ModelError("parameters is empty; name the parameters to fit")
    for name in names:
        if system.structure.place(name) == system.structure.place(parameter):
            raise ModelError(f"{name} is the parameter of the branch, which was measured; name other parameters")
    first = np.array([system[name] for name in names])
    trial = _Trial(matched, wanted, names)
    values, evaluations = _minimised(trial, first, limits, (options or FitOptions()).max_evaluations)
    residual, table = trial.residual(values), trial.table(values)
    moving = _moving(table, _sizes(first, values))
    bounds_of = (limits[0], limits[1])
    estimates, correlation, held, undetermined = determined(
        names, first, values, bounds_of, table, moving, 1.0, _POINTS, _RANK
    )
    relative = np.where(values != 0.0, np.abs(values), np.abs(first))
    combinations = _combinations((table * np.where(relative > 0.0, relative, 1.0))[:, ~held])
    seen = sum(math.isfinite(each.error) for each in combinations)
    found = trial.found_at(values)
    points = tuple(
        FittedPoint(str(s.kind), s.contact, s.value, each.value, m.value, m.error)
        for s, each, m in zip(matched, found, wanted, strict=True)
    )
    fitted = system.at(dict(zip(names, values.tolist(), strict=True)))
    again, doubts = (None, ()) if not isinstance(branch, Branch) else _walked(branch, fitted, names, points)
    squares, freedom = float(residual @ residual), len(points) - seen
    return PointFit(
        parameter,
        estimates,
        points,
        correlation,
        combinations,
        squares,
        freedom,
        evaluations,
        fitted,
        again,
        (*doubts_of(estimates), *_notes(squares, freedom)),
        (*undetermined, *_edge(trial, residual, table, held), *doubts),
    )


class _Trial:
    """Evaluates trial values; the points are tracked from those of the last accepted values."""

    def __init__(self, matched: list[SpecialPoint], measured: list[MeasuredPoint], names: tuple[str, ...]) -> None:
        made = {id(special): TrackedPoint.of(special, names) for special in matched}
        self.points = [made[id(special)] for special in matched]
        self._names, self._values = names, np.array([each.value for each in measured])
        self._errors = np.array([each.error for each in measured])
        self._system, self.lost = matched[0].orbit.system, ""
        self._at, self._found = np.array([]), list[Corrected]()
        self._base, self._slopes = self.points[0].origin, [point.slopes for point in self.points]
        self._unknowns = [point.unknowns for point in self.points]

    def found_at(self, x: Array) -> list[Corrected]:
        """Return the points at trial values; raise a ConvergenceError if one is lost."""
        if np.array_equal(x, self._at):
            return self._found
        values = dict(zip(self._names, x.tolist(), strict=True))
        self._system.at(values)
        known: dict[int, Corrected] = {}
        for point, unknowns, slopes in zip(self.points, self._unknowns, self._slopes, strict=True):
            if id(point) in known:
                continue
            each = point.found_at(x, unknowns + slopes @ (x - self._base))
            if each is None:
                place = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
                raise ConvergenceError(
                    f"the {point.special.kind} that was at {point.value:.8g} is not found at {place}; "
                    "perhaps it has vanished there"
                )
            known[id(point)] = each
        tracked = {id(point): point for point in self.points}
        for one, other in combinations(known, 2):
            a, b = known[one].unknowns, known[other].unknowns
            is_alike = tracked[one].special.kind == tracked[other].special.kind and len(a) == len(b)
            if is_alike and float(np.abs((a - b) / tracked[one].scales[: len(a)]).max()) < _SAME:
                raise ConvergenceError(f"two points of kind {tracked[one].special.kind} met at {a[-1]:.8g}")
        self._at, self._found = x.copy(), [known[id(point)] for point in self.points]
        return self._found

    def residual(self, x: Array) -> Array:
        """Return the residuals at trial values; infinite if a point is lost, to shorten the step."""
        try:
            found = self.found_at(x)
        except (NumericalError, ModelError) as error:
            self.lost = str(error)
            return np.full(len(self.points), np.inf)
        return (np.array([each.value for each in found]) - self._values) / self._errors

    def table(self, x: Array) -> Array:
        """Return the derivatives of the residuals, and track from there on."""
        found = self.found_at(x)
        known = {id(each): (point, each) for point, each in zip(self.points, found, strict=True)}
        slopes = {key: point.slopes_at(each) for key, (point, each) in known.items()}
        self._base, self._unknowns = x.copy(), [each.unknowns for each in found]
        self._slopes = [slopes[id(each)] for each in found]
        return np.array([each[-1] for each in self._slopes]) / self._errors[:, None]


def _sizes(first: Array, values: Array) -> Array:
    """Return the sizes of changes that would move the points if anything did; at least 1 for one that began at 0."""
    return np.maximum(np.abs(values), np.where(first == 0.0, 1.0, np.abs(first)))


def _moving(table: Array, sizes: Array) -> NDArray[np.bool_]:
    """Mark the parameters that move the points, shape (k,)."""
    effects = np.linalg.norm(table, axis=0) * sizes
    return effects > max(_IDLE, _ROUNDING * float(effects.max(initial=0.0)))


def _minimised(trial: _Trial, first: Array, limits: Array, most: int) -> tuple[Array, int]:
    """Return the values of least squares, and the number of evaluations."""
    from scipy.optimize import least_squares  # imported late: it takes long

    def freed(values: Array) -> NDArray[np.bool_]:
        table = trial.table(values)
        return independent(table, _moving(table, _sizes(first, values)), _RANK)

    values, evaluations, free = first, 0, freed(first)
    for _ in range(_ROUNDS):
        if not free.any():
            break
        base = values

        def whole(part: Array, base: Array = base, free: NDArray[np.bool_] = free) -> Array:
            merged = base.copy()
            merged[free] = part
            return merged

        found = least_squares(
            lambda part, whole=whole: trial.residual(whole(part)),
            values[free],
            lambda part, whole=whole, free=free: trial.table(whole(part))[:, free],
            bounds=(limits[0][free], limits[1][free]),
            x_scale="jac",
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            gtol=_TOLERANCE,
            max_nfev=most,
        )
        if found.status == 0:
            raise ConvergenceError(
                f"no minimum was found with {found.nfev} evaluations; start nearer to it, or allow more (FitOptions)"
            )
        values, evaluations = whole(found.x), evaluations + int(found.nfev)
        now = freed(values)
        if np.count_nonzero(now) <= np.count_nonzero(free):
            break
        free = now  # a parameter without effect at the start may have one here
    return values, evaluations


def _combinations(table: Array) -> tuple[Combination, ...]:
    """Return the right singular vectors of the slopes by relative changes, from the best to the least determined."""
    points, count = table.shape
    if not count:
        return ()
    _, singular, rows = np.linalg.svd(np.concatenate((table, np.zeros((max(0, count - points), count)))))
    least = max(_IDLE, _ROUNDING * float(singular[0]))
    signs = [np.sign(row[int(np.argmax(np.abs(row)))]) for row in rows[:count]]
    return tuple(
        Combination(tuple((sign * row).tolist()), float(value) if value > least else 0.0)
        for sign, row, value in zip(signs, rows[:count], singular, strict=True)
    )


def _notes(squares: float, freedom: int) -> tuple[str, ...]:
    from scipy.special import chdtrc  # imported late: it takes long

    if freedom <= 0:
        return ("there are no more points than determined parameters, so the fit is no test of the model",)
    if chdtrc(freedom, squares) < _UNLIKELY:
        return (
            f"the points differ from the fitted ones by more than their uncertainties (chi-square {squares:.3g} of "
            f"{freedom}), so standard errors are too small; perhaps the model lacks something",
        )
    return ()


def _edge(trial: _Trial, residual: Array, table: Array, held: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return a message if the fit ended where a point is lost, which is not a minimum."""
    sizes, size = np.linalg.norm(table, axis=0), np.linalg.norm(residual)
    free = ~held & (sizes > 0.0)
    if not trial.lost or size < _SAME or not free.any():
        return ()
    cosine = float(np.abs(table[:, free].T @ residual / (sizes[free] * size)).max())
    return (f"no minimum: {trial.lost}",) if cosine > _EDGE else ()


def _walked(
    branch: Branch, fitted: System, names: tuple[str, ...], points: Sequence[FittedPoint]
) -> tuple[Branch | None, tuple[str, ...]]:
    """Walk the branch again in the fitted system; return it, with sentences on points that it does not meet."""
    start, ends = branch.points[0].orbit, (branch.points[0].value, branch.ends[-1].value)
    try:
        moved = carry(start, fitted.at({branch.parameter: ends[0]}), names)
        again = follow(moved, branch.parameter, ends[1])
    except (NumericalError, ModelError) as error:
        return None, (f"the branch was not walked again with the fitted parameters: {error}",)
    width, missed = abs(ends[1] - ends[0]), []
    for point in points:
        is_inside = min(ends) <= point.after <= max(ends)
        values = [s.value for s in again.special(point.kind) if s.contact == point.contact]
        if is_inside and not any(abs(value - point.after) <= _MET * width for value in values):
            missed.append(f"the fitted {point.kind} at {point.after:.8g} is not on the branch walked with these values")
    return again, tuple(missed)
