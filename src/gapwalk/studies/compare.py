"""Comparison of two results: common branches and loci, their distances, and what is in one result only.

Method: docs/numerics/notes/results.md
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.rattle_map import RattleMap, cell_word
from gapwalk.attractors.basins import Basins, distance
from gapwalk.attractors.regimes import Regimes, regime_word
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_comparison import (
    SplineCurve,
    common_range,
    compare_in,
    match_places,
    measure_ranges,
    measures_of,
    value_range,
)
from gapwalk.bifurcation.loci import Codim2Point, Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.notebook import Shown
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.result import Result
from gapwalk.summary import SummaryParts, Table, remarks

# Comparison of two maps of cells (regimes, basins, rattle): which cells have other labels, and how many.

_LISTED = 20  # cells in words; JSON has all


class CellDifference(NamedTuple):
    """A cell whose label differs."""

    what: str  #: What the label says: ``regime``, ``leads to``, or the name of a gap.
    place: tuple[float, float]  #: The values at the centre of the cell.
    labels: tuple[str, str]  #: Its label in each result.


@dataclass(frozen=True)
class CellComparison(Shown):
    """Cells of two maps whose labels differ."""

    results: tuple[Result, Result]  #: The results.
    names: tuple[str, str]  #: Names of the axes.
    within: tuple[tuple[float, float], tuple[float, float]]  #: The values at the first and the last cell of each axis.
    resolution: tuple[int, int]  #: Cells along each axis.
    labels: tuple[str, ...]  #: What is compared in each cell: ``regime``, ``leads to``, or the gaps that both have.
    differences: tuple[CellDifference, ...] = ()  #: The cells that differ, in the order of `labels`.
    only: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())  #: Gaps in the first result only, and in the second only.
    notes: tuple[str, ...] = ()  #: Differences of the studies, in sentences.

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells that differ, by what is compared."""
        found = Counter(each.what for each in self.differences)
        return {what: found[what] for what in self.labels}

    @property
    def cells(self) -> int:
        """Number of all cells."""
        return self.resolution[0] * self.resolution[1]

    def within_share(self, share: float) -> bool:
        """Return True if both have the same gaps, and at most a share of the cells differs in each label."""
        return not any(self.only) and max(self.counts.values(), default=0) <= share * self.cells

    def lines(self) -> SummaryParts:
        """Return the differences in words: counts, changes of labels, and the first cells."""
        yield from remarks(self.notes, ())
        axes = (f"{name} from {a:.6g} to {b:.6g}" for name, (a, b) in zip(self.names, self.within, strict=True))
        yield f"compared: {' x '.join(map(str, self.resolution))} cells, {', '.join(axes)}"
        for what, count in self.counts.items():
            yield f"{what}: {count} of {self.cells} cells differ"
            changes = Counter(each.labels for each in self.differences if each.what == what)
            yield from (f"  {before} -> {after}: {n}" for (before, after), n in changes.most_common())
        for which, gaps in zip(("first", "second"), self.only, strict=True):
            yield from (f"only in the {which}: {gap}" for gap in gaps)
        if shown := self.differences[:_LISTED]:
            rows = [(*(f"{value:.8g}" for value in each.place), each.what, *each.labels) for each in shown]
            yield Table((*(f">{name}" for name in self.names), "", "first", "second"), rows)
        if left := len(self.differences) - len(shown):
            yield f"and {left} more (all are in --json)"

    def document(self, tolerance: float) -> dict[str, Any]:
        """Return the comparison as plain JSON values."""
        return {
            "agree": self.within_share(tolerance),
            "tolerance": tolerance,
            "parameters": list(self.names),
            "resolution": list(self.resolution),
            "cells": self.cells,
            "different": self.counts,
            "cell_differences": [
                {"what": each.what, "at": list(each.place), "first": each.labels[0], "second": each.labels[1]}
                for each in self.differences
            ],
            "only_first": list(self.only[0]),
            "only_second": list(self.only[1]),
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        return "\n".join(f"{what}: {count} of {self.cells} cells differ" for what, count in self.counts.items())


Words = NDArray[np.str_]


class _Cells(NamedTuple):
    """The labels of a map in words, shape (rows, columns) each, by what they say; axes go upwards."""

    names: tuple[str, str]
    axes: tuple[NDArray[np.float64], NDArray[np.float64]]
    labels: dict[str, Words]


def map_of(result: Result) -> Regimes | Basins | RattleMap | None:
    """Return the map of cells that a result holds; None if it holds none."""
    found = getattr(result.finding, "record", None)
    return found if isinstance(found, Regimes | Basins | RattleMap) else None


def compare_cells(first: Result, second: Result, notes: Sequence[str] = ()) -> CellComparison:
    """Compare two maps of one kind cell by cell."""
    a, b = map_of(first), map_of(second)
    if a is None or b is None or type(a) is not type(b):
        words = [
            f"the {which} result is of the kind {result.options.kind}" + " and has no map of cells" * (found is None)
            for which, result, found in (("first", first, a), ("second", second, b))
        ]
        raise ModelError(f"{', '.join(words)}; compare two maps of one kind")
    attractors = a.names if isinstance(a, Basins) else ()
    one = _cells(a, attractors)
    other = _cells(b, _named_as(a, b) if isinstance(a, Basins) and isinstance(b, Basins) else ())
    if other.names == one.names[::-1] != one.names:  # the axes are exchanged
        turned = {what: words.T for what, words in other.labels.items()}
        other = _Cells(one.names, (other.axes[1], other.axes[0]), turned)
    if one.names != other.names or not all(map(_same_axis, one.axes, other.axes)):
        places = [_place_words(each) for each in (one, other)]
        raise ModelError(
            f"the first map has the cells {places[0]}, the second {places[1]}; compare maps over the same cells"
        )
    labels = tuple(what for what in one.labels if what in other.labels)
    return CellComparison(
        (first, second),
        one.names,
        tuple((float(axis[0]), float(axis[-1])) for axis in one.axes),  # type: ignore[arg-type]
        (len(one.axes[0]), len(one.axes[1])),
        labels,
        tuple(each for what in labels for each in _differences(what, one, other)),
        (_missing_names(one, other), _missing_names(other, one)),
        tuple(notes),
    )


def _missing_names(one: _Cells, other: _Cells) -> tuple[str, ...]:
    return tuple(what for what in one.labels if what not in other.labels)


def _differences(what: str, one: _Cells, other: _Cells) -> Iterator[CellDifference]:
    before, after = one.labels[what], other.labels[what]
    for row, column in np.argwhere(before != after).tolist():
        place = float(one.axes[0][column]), float(one.axes[1][row])
        yield CellDifference(what, place, (str(before[row, column]), str(after[row, column])))


def _cells(found: Regimes | Basins | RattleMap, attractors: Sequence[str]) -> _Cells:
    match found:
        case Regimes():
            names = found.first, found.second
            labels = {"regime": _words(regime_word, found.regimes, found.periods)}
        case Basins():
            names = found.window.across, found.window.up
            known = dict(enumerate(attractors))
            others = {-1: "unresolved", -2: "diverges", -3: "beyond a rigid stop"}
            labels = {"leads to": _words(lambda label: (known | others)[label], found.labels)}
        case RattleMap():
            names = found.first, found.second
            labels = {
                gap: _words(cell_word, found.codes[..., place], found.periods > 0)
                for place, gap in enumerate(found.gaps)
            }
    across, up = (np.argsort(axis) for axis in found.axes)
    axes = found.axes[0][across], found.axes[1][up]
    return _Cells(names, axes, {what: words[np.ix_(up, across)] for what, words in labels.items()})


def _words(word: Any, *codes: NDArray[Any]) -> Words:
    found = [word(*each) for each in zip(*(code.ravel().tolist() for code in codes), strict=True)]
    return np.array(found, dtype=np.str_).reshape(codes[0].shape)


def _named_as(first: Basins, second: Basins) -> list[str]:
    """Return names of the attractors of the second map: those of the nearest ones of the same kind in the first."""
    # Letters of equal names follow the sizes of basins, so that those of one motion may differ between two maps.
    from scipy.optimize import linear_sum_assignment  # imported late: it takes long

    names = [f"{name} of the second" for name in second.names]
    kinds = [[(each.kind, each.period) for each in found.attractors] for found in (first, second)]
    for kind in set(kinds[0]) & set(kinds[1]):
        mine, theirs = ([index for index, each in enumerate(known) if each == kind] for known in kinds)
        costs = [[distance(first.attractors[i], second.attractors[j].strobes) for j in theirs] for i in mine]
        for i, j in zip(*linear_sum_assignment(costs), strict=True):
            names[theirs[j]] = first.names[mine[i]]
    return names


def _same_axis(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return True if the centres of cells are the same, to a thousandth of a cell."""
    if len(one) != len(other):
        return False
    width = float(np.ptp(one)) / max(1, len(one) - 1) or abs(float(one[0]))
    return bool(np.abs(one - other).max() <= 1e-3 * width)


def _place_words(cells: _Cells) -> str:
    axes = zip(cells.names, cells.axes, strict=True)
    return " and ".join(f"{name} from {axis[0]:.6g} to {axis[-1]:.6g} ({len(axis)})" for name, axis in axes)


class Shift(NamedTuple):
    """A special point that both results have."""

    label: str  #: Kind of the special point, and the contact that grazes.
    #: first, second: The value of the parameter in each result; on a locus, of both parameters.
    first: tuple[float, ...]
    second: tuple[float, ...]
    share: float  #: The largest of the differences, as a share of the parameter's range.

    @property
    def differences(self) -> tuple[float, ...]:
        """Second minus first, in units of the parameters."""
        return tuple(b - a for a, b in zip(self.first, self.second, strict=True))


class Lone(NamedTuple):
    """A special point that is in one result only: its kind, and its place."""

    label: str  #: Kind of the special point, and the contact that grazes.
    values: tuple[float, ...]  #: Its place.


@dataclass(frozen=True, eq=False)
class Pair:
    """A branch, or a locus, that both results have."""

    names: tuple[str, str]  #: Its name in each result.
    #: places, distances: shape (points, 1 or 2), (points,): Parameters of the points of both, and how far each is from
    #: the other curve, as a share of the ranges.
    places: NDArray[np.float64]
    distances: NDArray[np.float64]
    resolution: float  #: Roughly the largest part of a distance that the interpolation between points may be.
    shifts: tuple[Shift, ...]  #: Special points that both have.
    #: Special points in the first result only, and in the second only, where both curves have points.
    only: tuple[tuple[Lone, ...], tuple[Lone, ...]]
    #: The range of the parameter, or of the first of two, that each curve covers.
    covered: tuple[tuple[float, float], tuple[float, float]]
    #: The largest part of a range that one covers and the other does not, as a share of the parameter's range.
    missing: float

    @property
    def largest(self) -> float:
        """The largest distance between the curves, as a share of the ranges."""
        return float(self.distances.max(initial=0.0))

    @property
    def worst(self) -> tuple[float, ...]:
        """The parameters at the largest distance."""
        return tuple(self.places[int(np.argmax(self.distances))].tolist()) if len(self.distances) else ()

    @property
    def largest_shift(self) -> float:
        """The largest difference in the location of a special point, as a share of the parameter's range."""
        return max((shift.share for shift in self.shifts), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Return True if the curves agree in distances, locations and ranges, and have the same special points."""
        return not any(self.only) and max(self.largest, self.largest_shift, self.missing) <= tolerance


@dataclass(frozen=True)
class ResultComparison(Shown):
    """Common and different branches and loci of two results.

    Lengths are shares: of the range of the parameter, and of the range of each measure, over all branches of both.
    """

    results: tuple[Result, Result]  #: The results.
    parameters: tuple[str, ...]  #: The parameter of the branches; of the loci of a map both.
    ranges: tuple[float, ...]  #: The range of each, in its units; shares refer to it.
    #: Measures that distinguish motions, as well as the parameters; none on loci, which are curves in the plane.
    measures: tuple[str, ...]
    pairs: tuple[Pair, ...]  #: The branches, and the loci of maps, that both have.
    #: Names of the curves in the first result only, and in the second only.
    only: tuple[tuple[str, ...], tuple[str, ...]]
    notes: tuple[str, ...] = ()  #: Differences of the studies, in sentences.

    @property
    def largest(self) -> float:
        """The largest distance between curves that both have, as a share of the ranges."""
        return max((pair.largest for pair in self.pairs), default=0.0)

    @property
    def largest_shift(self) -> float:
        """The largest difference in the location of a special point, as a share of the parameter's range."""
        return max((pair.largest_shift for pair in self.pairs), default=0.0)

    def within(self, tolerance: float) -> bool:
        """Return True if both results contain the same, within a tolerance (a share of the ranges)."""
        return not any(self.only) and all(pair.within(tolerance) for pair in self.pairs)

    def __str__(self) -> str:
        lines = [line for pair in self.pairs for line in _pair_lines(pair, self.parameters)]
        for which, names in zip(("first", "second"), self.only, strict=True):
            lines += [f"only in the {which}: {name}" for name in names]
        return "\n".join([*self.notes, *lines])


def place_words(parameters: Sequence[str], values: Sequence[float]) -> str:
    """Write the values of parameters: ``frequency = 0.61909789``."""
    return ", ".join(f"{name} = {value:.8g}" for name, value in zip(parameters, values, strict=False))


def _pair_lines(pair: Pair, parameters: tuple[str, ...]) -> list[str]:
    """Return a pair in words, line by line."""
    name = pair.names[0] if pair.names[0] == pair.names[1] else " and ".join(pair.names)
    apart = f"the curves differ by at most {pair.largest:.3g} of their ranges"
    lines = [f"{name}: {apart}, at {place_words(parameters, pair.worst)}"]
    if pair.missing > 0.0:
        ranges = ", ".join(f"{low:.8g} to {high:.8g}" for low, high in pair.covered)
        lines.append(f"  the first and the second cover {parameters[0]} from {ranges.replace(', ', ' and from ')}")
    for shift in pair.shifts:
        differences = ", ".join(f"{difference:+.3g}" for difference in shift.differences)
        lines.append(f"  {shift.label} at {place_words(parameters, shift.first)}: {differences}")
    for which, alone in zip(("first", "second"), pair.only, strict=True):
        lines += [f"  only in the {which}: {each.label} at {place_words(parameters, each.values)}" for each in alone]
    return lines


_ALIKE = 0.05  # half the points of two branches that are the same one are no farther apart, in sizes of the picture
_FAR = 1e3


def compare_results(first: Result, second: Result, measures: str | Sequence[str] | None = None) -> Any:
    """Compare two results of studies of one system over the same parameters, for example by two methods.

    Each branch of one is compared with the one of equal period in the other that is nearest to it. The branches of the
    sections of maps, and their loci, are compared in the same way. Maps of regimes, basins and rattle are compared cell
    by cell.

    Parameters
    ----------
    first, second
        The results.
    measures
        Measures (see `Orbit.measure`) that distinguish motions; by default mean and root mean square of each
        coordinate, which have no corners along a branch, as extremes have.

    Returns
    -------
    ResultComparison or CellComparison
        What both have, and what differs.

    Raises
    ------
    ModelError
        If a result has neither branches nor a map of cells, or they are over different parameters or cells, or of
        different coordinates.

    Notes
    -----
    Lengths are relative to the range of the parameter, and to the range of each measure over all branches of both
    results. Two motions at one value of the parameter cannot be compared at a fold, so the distance of the points of
    each branch from the other branch counts, as a curve over the parameter in the space of the measures.

    Examples
    --------
    >>> gw.studies.compare_results(result, gw.run(study)).within(1e-5)
    True
    """
    if map_of(first) is not None or map_of(second) is not None:
        _check_coordinates(first, second)
        cells = compare_cells(first, second)
        return replace(cells, notes=_notes(first, second, {*cells.names}))
    _check_comparable(first, second)
    names = measures_of(first.branches[0], measures)
    everything = [*first.branches, *second.branches]
    spans = np.array([value_range(branch) for branch in everything])
    ranges = np.append(float(np.ptp(spans)), measure_ranges(everything, names))
    pairs, only = _paired(_branches(first), _branches(second), lambda a, b: _compare_branches(a, b, names, ranges))
    parameters, widths = (first.walked.parameter,), (float(ranges[0]),)
    if first.map is not None and second.map is not None:
        low, high = np.array([chart.within for chart in (first.map, second.map)]).transpose(2, 0, 1)
        plane = high.max(axis=0) - low.min(axis=0)
        loci, alone = _paired(_loci(first.map), _loci(second.map), lambda a, b: _compare_loci(a, b, plane))
        pairs, only = (*loci, *pairs), ((*alone[0], *only[0]), (*alone[1], *only[1]))
        parameters, widths = (first.map.first, first.map.second), tuple(plane.tolist())
    return ResultComparison(
        (first, second), parameters, widths, names, pairs, only, _notes(first, second, {*parameters})
    )


class _Named(NamedTuple):
    """A branch or a locus with its name, and the properties that a matching curve must share."""

    name: str
    label: object
    curve: Branch | Locus


def _branches(result: Result) -> list[_Named]:
    chart = result.map
    sections = None if chart is None else [section.value for section in chart.sections for _ in section.branches]
    return [
        _Named(name, (branch.period, sections and sections[index]), branch)
        for index, (name, branch) in enumerate(zip(result.names, result.branches, strict=True))
    ]


def _loci(chart: Map) -> list[_Named]:
    named = zip(chart.names, chart.loci, strict=True)
    return [_Named(name, (locus.kind, locus.period, locus.contact), locus) for name, locus in named]


def _paired(
    first: list[_Named], second: list[_Named], compare: Callable[[_Named, _Named], Pair | None]
) -> tuple[tuple[Pair, ...], tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the pairs of matching curves, and the names of curves without a match."""
    from scipy.optimize import linear_sum_assignment  # imported late: it takes long

    costs = np.full((len(first), len(second)), _FAR)
    found: dict[tuple[int, int], Pair] = {}
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            pair = compare(a, b) if a.label == b.label else None
            if pair is not None and (_is_near(pair) or len(first) == len(second) == 1):
                found[i, j] = pair
                costs[i, j] = float(np.median(pair.distances)) + pair.missing
    places = [(int(i), int(j)) for i, j in zip(*linear_sum_assignment(costs), strict=True)]
    chosen = [place for place in places if place in found]
    only = (
        tuple(each.name for i, each in enumerate(first) if i not in {place[0] for place in chosen}),
        tuple(each.name for j, each in enumerate(second) if j not in {place[1] for place in chosen}),
    )
    return tuple(found[place] for place in chosen), only


def _is_near(pair: Pair) -> bool:
    return bool(len(pair.distances)) and float(np.median(pair.distances)) <= _ALIKE


def _compare_branches(
    first: _Named, second: _Named, names: tuple[str, ...], ranges: NDArray[np.float64]
) -> Pair | None:
    """Compare two branches of one period; return None if their ranges do not overlap."""
    a, b = first.curve, second.curve
    assert isinstance(a, Branch)
    assert isinstance(b, Branch)
    low, high = common_range(a, b)
    if not low < high:
        return None
    there, back = compare_in(a, b, names, ranges), compare_in(b, a, names, ranges)
    covered = (value_range(a), value_range(b))
    return Pair(
        (first.name, second.name),
        np.concatenate((there.values, back.values))[:, None],
        np.concatenate((there.distances, back.distances)),
        max(there.resolution, back.resolution),
        tuple(
            Shift(_what(m.first), (m.first.value,), (m.second.value,), abs(m.difference) / float(ranges[0]))
            for m in there.matches
        ),
        (_alone(there.only_first), _alone(there.only_second)),
        covered,
        _missing(*covered, float(ranges[0])),
    )


def _compare_loci(first: _Named, second: _Named, plane: NDArray[np.float64]) -> Pair | None:
    """Compare two loci of one kind, period and contact, as curves in the plane."""
    a, b = first.curve, second.curve
    assert isinstance(a, Locus)
    assert isinstance(b, Locus)
    values = a.values, b.values
    curves = [SplineCurve(_knots(locus) / plane) for locus in (a, b)]
    codim2 = [np.array([each.values for each in locus.codim2_points]).reshape(-1, 2) for locus in (a, b)]
    labels = [[(each.kind, each.contact) for each in locus.codim2_points] for locus in (a, b)]
    matches = match_places(codim2[0] / plane, labels[0], codim2[1] / plane, labels[1])
    taken = {i for i, _ in matches}, {j for _, j in matches}
    covered = tuple((float(each[:, 0].min()), float(each[:, 0].max())) for each in values)
    return Pair(
        (first.name, second.name),
        np.concatenate(values),
        np.concatenate((curves[1].distances(values[0] / plane), curves[0].distances(values[1] / plane))),
        max(curve.resolution for curve in curves),
        tuple(_codim2_shift(a.codim2_points[i], b.codim2_points[j], plane) for i, j in matches),
        (_left_over(a, taken[0]), _left_over(b, taken[1])),
        (covered[0], covered[1]),
        _missing(covered[0], covered[1], float(plane[0])),
    )


def _missing(first: tuple[float, float], second: tuple[float, float], width: float) -> float:
    """Return the largest part of a range that one curve covers and the other does not, as a share of a width."""
    return max(abs(a - b) for a, b in zip(first, second, strict=True)) / width


def _knots(locus: Locus) -> NDArray[np.float64]:
    """Return the points of a locus and its points of codimension two in their order, shape (points, 2)."""
    points = [*locus.points, *(codim2.point for codim2 in locus.codim2_points)]
    return np.array([point.values for point in sorted(points, key=lambda point: point.arclength)])


def _codim2_shift(first: Codim2Point, second: Codim2Point, plane: NDArray[np.float64]) -> Shift:
    share = float(np.abs((np.array(second.values) - first.values) / plane).max())
    return Shift(_codim2_words(first), first.values, second.values, share)


def _left_over(locus: Locus, taken: set[int]) -> tuple[Lone, ...]:
    points = enumerate(locus.codim2_points)
    return tuple(Lone(_codim2_words(each), each.values) for index, each in points if index not in taken)


def _codim2_words(codim2: Codim2Point) -> str:
    return f"{codim2.kind.value} {codim2.contact}".rstrip()


def _alone(points: Sequence[SpecialPoint]) -> tuple[Lone, ...]:
    return tuple(Lone(_what(special), (special.value,)) for special in points)


def _what(special: SpecialPoint) -> str:
    return f"{special.kind.value} {special.contact}".rstrip()


def _check_comparable(first: Result, second: Result) -> None:
    """Raise a ModelError unless both results have branches over the same parameters."""
    for which, result in (("first", first), ("second", second)):
        if not result.branches:
            raise ModelError(
                f"the {which} result is of the kind {result.options.kind} and has neither branches nor a map of cells; "
                "compare results of the kinds response, diagram, map, regimes, basins and rattle (over two parameters)"
            )
        if not all(branch.points for branch in result.branches):
            raise ModelError(f"the {which} result has settled motions alone and no orbits, which a comparison needs")
    planes = [
        (result.walked.parameter, *([] if result.map is None else [result.map.second])) for result in (first, second)
    ]
    if planes[0] != planes[1]:
        words = [" and ".join(names) for names in planes]
        raise ModelError(f"the results are over {words[0]} and {words[1]}; compare results over the same parameters")
    _check_coordinates(first, second)


def _check_coordinates(first: Result, second: Result) -> None:
    coordinates = [", ".join(result.system.coordinates) for result in (first, second)]
    if coordinates[0] != coordinates[1]:
        raise ModelError(
            f"the coordinates of one result are {coordinates[0]}, those of the other {coordinates[1]}; compare results "
            "of one system"
        )


def _notes(first: Result, second: Result, walked: set[str]) -> tuple[str, ...]:
    """Return the differences of two studies other than their methods: values of parameters, completeness."""
    notes = []
    then, now = first.system.parameters, second.system.parameters
    notes += [f"{name} is in the first only" for name in then if name not in now]
    notes += [f"{name} is in the second only" for name in now if name not in then]
    notes += [
        f"{name} is {value:.10g} in the first and {now[name]:.10g} in the second"
        for name, value in then.items()
        if name in now and now[name] != value and name not in walked
    ]
    notes += [f"the {which} is not complete" for which, r in (("first", first), ("second", second)) if not r.complete]
    return tuple(notes)


def comparison_document(found: ResultComparison, tolerance: float) -> dict[str, Any]:
    """Return a comparison as plain JSON values; lengths are shares of the ranges."""
    return {
        "agree": found.within(tolerance),
        "tolerance": tolerance,
        "methods": [result.walked.method.name for result in found.results],
        "parameters": list(found.parameters),
        "ranges": list(found.ranges),
        "measures": list(found.measures),
        "largest": found.largest,
        "largest_shift": found.largest_shift,
        "pairs": [_pair(pair, tolerance) for pair in found.pairs],
        "only_first": list(found.only[0]),
        "only_second": list(found.only[1]),
        "notes": list(found.notes),
    }


def _pair(pair: Pair, tolerance: float) -> dict[str, Any]:
    return {
        "names": list(pair.names),
        "agree": pair.within(tolerance),
        "largest": pair.largest,
        "at": list(pair.worst),
        "resolution": pair.resolution,
        "covered": [list(each) for each in pair.covered],
        "missing": pair.missing,
        "special_points": [
            {
                "label": shift.label,
                "first": list(shift.first),
                "second": list(shift.second),
                "differences": list(shift.differences),
                "share": shift.share,
            }
            for shift in pair.shifts
        ],
        "only_first": [_lone(each) for each in pair.only[0]],
        "only_second": [_lone(each) for each in pair.only[1]],
    }


def _lone(lone: Lone) -> dict[str, Any]:
    return {"label": lone.label, "parameters": list(lone.values)}
