"""The record of basins of attraction: which attractor each cell of a plane of initial states leads to.

Method: docs/numerics/basins.md
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind
from gapwalk.attractors.attractor_catalogue import IMPOSSIBLE, RUNAWAY, UNRESOLVED
from gapwalk.attractors.box import Box, Window
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, TableRows, Tables, rows_of

_ORDER = tuple(AttractorKind)
_WORDS = {UNRESOLVED: "unresolved", RUNAWAY: "diverges", IMPOSSIBLE: "beyond a rigid stop"}
_LETTERS = "abcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True)
class BasinCheck:
    """Accuracy of the labels: cells that were checked with the exact flow and corrected where they were wrong.

    Examples
    --------
    >>> basins.check.cells, basins.check.share < 0.1
    (64, True)
    """

    #: cells, borders: Number of cells in the plane (or random starts); number of them whose label differs from that of
    #: a neighbour, or that have a neighbour whose label was wrong.
    cells: int
    borders: int = 0
    #: border_checked, border_wrong: Border cells that were checked, and those of them whose label had been wrong.
    border_checked: int = 0
    border_wrong: int = 0
    #: inner_checked, inner_wrong: Random other cells that were checked, and those of them whose label had been wrong.
    inner_checked: int = 0
    inner_wrong: int = 0
    #: shifted, shifted_wrong: Checked cells that were followed again from a state shifted by 1e-15 of its size, and
    #: those of them that then got another label: rounding decides their label.
    shifted: int = 0
    shifted_wrong: int = 0

    @property
    def share(self) -> float:
        """Estimated fraction of the cells whose label is still wrong, or decided by rounding."""
        return self._still_wrong(_ratio)

    @property
    def limit(self) -> float:
        """Upper limit of that fraction: each group of cells at its 97.5 % limit (Clopper and Pearson)."""
        return self._still_wrong(_upper)

    @property
    def text(self) -> str:
        """The accuracy of the labels, in one line."""
        if not self.border_checked + self.inner_checked:
            return "not checked with the exact flow"
        text = f"{self.inner_wrong} of {self.inner_checked} cells differed from the exact flow"
        if self.borders == self.border_checked:
            text = f"exact at all borders; elsewhere {text}"
        else:
            text = f"{self.border_wrong} of {self.border_checked} cells at borders and elsewhere {text}"
        return f"{text}; rounding decides {self.shifted_wrong} of {self.shifted}" if self.shifted_wrong else text

    def _still_wrong(self, rate: Callable[[int, int], float]) -> float:
        exact = self.border_checked + self.inner_checked
        groups = [
            (self.borders - self.border_checked, self.border_wrong, self.border_checked),
            (self.cells - self.borders - self.inner_checked, self.inner_wrong, self.inner_checked),
        ]
        if self.shifted:  # older results have no shifted cells
            groups.append((exact - self.shifted, self.shifted_wrong, self.shifted))
        wrong = sum(others * rate(wrong, checked) for others, wrong, checked in groups if others)
        return (wrong + self.shifted_wrong) / self.cells


@dataclass(frozen=True, eq=False)
class Basins(Shown):
    """Basins of attraction in a plane of initial states at theta = 0.

    Examples
    --------
    >>> basins.names, basins.labels.shape
    (('period 1a', 'period 1b'), (8, 8))
    >>> basins.attractors[basins.labels[0, 0]].label
    'P1'
    """

    system: System  #: The system.
    window: Window  #: The part of the plane.
    #: shape (rows, columns): Label of each cell, from the state at its centre: an index into `attractors`, or -1
    #: (unresolved), -2 (the motion diverges) or -3 (the state is beyond a rigid stop). The first row is the lowest.
    labels: NDArray[np.int_]
    #: The attractors: periodic ones first, by period, then the others; those of equal kind by size of their basins.
    attractors: tuple[Attractor, ...]
    check: BasinCheck  #: Accuracy of the labels.
    #: Error of the fast flow over one forcing period, relative to the size of the motion, measured against the exact
    #: flow; 0 if only the exact flow was used.
    error: float = 0.0
    complete: bool = True  #: False if the computation was stopped before its end; the remaining cells are unresolved.
    notes: tuple[str, ...] = ()  #: Sentences on what could not be computed.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        labels, count = self.labels, len(self.attractors)
        if labels.ndim != 2 or not labels.size or labels.min() < IMPOSSIBLE or labels.max() >= count:
            raise ValueError(f"its labels are none of {count} attractors")
        if not np.isfinite(self.axes[0]).all():
            raise ValueError("its axes are no numbers")

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.labels.shape
        return columns, rows

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres of the cells along the two axes."""
        return self.window.centres(self.resolution)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the attractors; letters distinguish several of the same kind."""
        return attractor_names(self.attractors)

    @property
    def cells(self) -> dict[str, int]:
        """Number of cells that lead to each attractor, by its name."""
        counts = Counter(self.labels.ravel().tolist())
        return {name: counts[index] for index, name in enumerate(self.names)}

    @property
    def unresolved(self) -> int:
        """Number of cells that lead to no known attractor."""
        return int(np.sum(self.labels == UNRESOLVED))

    @property
    def runaway(self) -> int:
        """Number of cells from which the motion diverges."""
        return int(np.sum(self.labels == RUNAWAY))

    @property
    def impossible(self) -> int:
        """Number of cells whose state is beyond a rigid stop; no motion begins there."""
        return int(np.sum(self.labels == IMPOSSIBLE))

    @property
    def others(self) -> dict[str, int]:
        """Number of cells that lead to no attractor, by the reason in words."""
        return {"diverges": self.runaway, "unresolved": self.unresolved, "beyond a rigid stop": self.impossible}

    def tables(self) -> Tables:
        """Return the tables of the cells, each with its attractor, and of the attractors."""
        return {"cells": TableRows(self._cell_rows, 2), "attractors": self._attractor_rows}

    def _cell_rows(self) -> Rows:
        across, up = (axis.tolist() for axis in self.axes)
        names = dict(enumerate(self.names)) | _WORDS
        yield [self.window.across, self.window.up, "leads.to"]
        for y, row in zip(up, self.labels.tolist(), strict=True):
            for x, label in zip(across, row, strict=True):
                yield [x, y, names[label]]

    def _attractor_rows(self) -> Rows:
        yield ["name", "kind", "period", "cells", *(f"{q}(0)" for q in self.system.state_names)]
        for name, attractor in zip(self.names, self.attractors, strict=True):
            yield [name, attractor.kind.value, attractor.period, self.cells[name], *attractor.state.tolist()]

    def __repr__(self) -> str:
        columns, rows = self.resolution
        parts = [f"{name}: {count}" for name, count in self.cells.items()]
        parts += [f"{text}: {n}" for text, n in self.others.items() if n]
        return f"Basins({self.window.across}, {self.window.up}; {columns} x {rows} cells; {', '.join(parts)})"


@dataclass(frozen=True)
class Share:
    """The fraction of random starts that lead to one attractor.

    Examples
    --------
    >>> share = shares.shares[0]
    >>> share.name, share.share, round(share.low, 4), round(share.high, 4)
    ('period 1a', 0.5, 0.272, 0.728)
    """

    name: str  #: Name of the attractor.
    starts: int  #: Number of starts that lead to it.
    share: float  #: Fraction of the starts that lead to it.
    #: low, high: Confidence limits of the fraction of the whole box (Clopper and Pearson 1934, Biometrika 26, 404-413).
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class BasinShares:
    """Fractions of a box of initial states that lead to each attractor, estimated from random starts.

    Examples
    --------
    >>> [(each.name, each.share) for each in shares.shares]
    [('period 1a', 0.5), ('period 1b', 0.5)]
    """

    system: System  #: The system.
    box: Box  #: The box.
    starts: NDArray[np.float64]  #: shape (count, state_size): The random states.
    labels: NDArray[np.int_]  #: shape (count,): As in `Basins`.
    attractors: tuple[Attractor, ...]  #: As in `Basins`.
    confidence: float  #: Confidence level of the limits, for each fraction separately.
    #: complete, notes: As in `Basins`.
    complete: bool = True
    notes: tuple[str, ...] = ()
    check: BasinCheck = BasinCheck(0)  #: Accuracy of the labels.
    error: float = 0.0  #: As in `Basins`.

    @property
    def shares(self) -> tuple[Share, ...]:
        """The share of each attractor, then of diverging motions and of unresolved ones if there are any."""
        names = dict(enumerate(attractor_names(self.attractors)))
        names |= {label: name for label, name in _WORDS.items() if np.any(self.labels == label)}
        return tuple(self._share(name, int(np.sum(self.labels == label))) for label, name in names.items())

    def tables(self) -> Tables:
        """Return the tables of the shares, and of the starts, each with its attractor."""
        return {"shares": lambda: rows_of(map(asdict, self.shares)), "starts": self._start_rows}

    def _start_rows(self) -> Rows:
        names = dict(enumerate(attractor_names(self.attractors))) | _WORDS
        yield [*(f"{q}(0)" for q in self.system.state_names), "leads.to"]
        for start, label in zip(self.starts.tolist(), self.labels.tolist(), strict=True):
            yield [*start, names[label]]

    def _share(self, name: str, count: int) -> Share:
        from scipy.stats import binomtest  # imported late: it takes long

        interval = binomtest(count, len(self.labels)).proportion_ci(self.confidence, method="exact")
        return Share(name, count, count / len(self.labels), float(interval.low), float(interval.high))

    def __repr__(self) -> str:
        parts = [f"{each.name} {each.share:.4f} ({each.low:.4f} to {each.high:.4f})" for each in self.shares]
        told = f"{', '.join(parts)}; confidence {self.confidence:g}; labels: {self.check.text}"
        return f"BasinShares({len(self.labels)} starts; {told})"


def attractor_names(attractors: Sequence[Attractor]) -> tuple[str, ...]:
    """Return names such as ``period 3``, ``quasi-periodic``, ``chaotic``; a letter is added to equal names."""
    plain = [f"period {each.period}" if each.kind is AttractorKind.PERIODIC else each.kind.value for each in attractors]
    counts, seen, names = Counter(plain), Counter(), []
    for name in plain:
        letter = _LETTERS[seen[name]] if seen[name] < len(_LETTERS) else str(seen[name] + 1)
        names.append(name if counts[name] == 1 else f"{name}{'' if name[-1].isdigit() else ' '}{letter}")
        seen[name] += 1
    return tuple(names)


def in_order(
    attractors: Sequence[Attractor], labels: NDArray[np.int_]
) -> tuple[tuple[Attractor, ...], NDArray[np.int_]]:
    """Sort attractors into the order of a record, independent of which was found first; renumber the labels."""
    counts = Counter(labels.ravel().tolist())
    order = sorted(
        range(len(attractors)),
        key=lambda k: (_ORDER.index(attractors[k].kind), attractors[k].period, -counts[k]),
    )
    places = np.empty(len(order) + 3, dtype=int)
    places[order] = np.arange(len(order))
    others = [IMPOSSIBLE, RUNAWAY, UNRESOLVED]
    places[others] = others  # these negative labels index the last entries
    return tuple(attractors[k] for k in order), places[labels]


def _ratio(wrong: int, checked: int) -> float:
    return wrong / checked if checked else 0.0


def _upper(wrong: int, checked: int) -> float:
    """Return the 97.5 per cent upper limit; 1 if nothing was checked."""
    if not checked:
        return 1.0
    from scipy.stats import binomtest  # imported late: it takes long

    return float(binomtest(wrong, checked).proportion_ci(0.95, method="exact").high)
