"""Comparison of two maps of cells (regimes, basins, rattle): which cells have other labels, and how many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.rattle_map import RattleMap, cell_word
from gapwalk.attractors.attractor_catalogue import distance
from gapwalk.attractors.basins import Basins
from gapwalk.attractors.regimes import Regimes, regime_word
from gapwalk.errors import ModelError
from gapwalk.notebook import Shown
from gapwalk.studies.result import Result
from gapwalk.summary import SummaryParts, Table, remarks

_LISTED = 20  # cells in words; JSON has all


class CellDifference(NamedTuple):
    """A cell whose label differs.

    Examples
    --------
    >>> gw.studies.CellDifference("regime", (0.8, 0.2), ("period 1", "chaotic")).labels[1]
    'chaotic'
    """

    what: str  #: What the label says: ``regime``, ``leads to``, or the name of a gap.
    place: tuple[float, float]  #: The values at the centre of the cell.
    labels: tuple[str, str]  #: Its label in each result.


@dataclass(frozen=True)
class CellComparison(Shown):
    """Cells of two maps whose labels differ.

    Examples
    --------
    >>> gw.studies.CellComparison((result, result), ("a", "b"), ((0, 1), (0, 1)), (2, 2), ("regime",)).within_share(0.0)
    True
    """

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
        """Return the comparison as plain JSON values.

        Parameters
        ----------
        tolerance
            The share of cells that may differ.
        """
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
    found = getattr(result.finding, "map", None)
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
        (_missing(one, other), _missing(other, one)),
        tuple(notes),
    )


def _missing(one: _Cells, other: _Cells) -> tuple[str, ...]:
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
    """Return names of the attractors of the second map: those of the nearest ones of the same kind in the first.

    Letters of equal names follow the sizes of basins, so that those of one motion may differ between two maps.
    """
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
