"""The record of basins of attraction: which attractor each cell of a plane of initial states leads to.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import size_of
from gapwalk.attractors.settle import (
    Attractor,
    AttractorKind,
    ClassifyOptions,
    Settled,
    SettleOptions,
    TrappingRegion,
    classify,
    trapping_region_of,
)
from gapwalk.errors import FlowError, ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import is_same
from gapwalk.summary import Rows, TableRows, Tables, rows_of

# The catalogue of the known attractors of one system, and the assignment of states to the attractors they lead to.
#
# The catalogue grows when a state leads to an attractor not yet in it. A motion is recognised by the trapping region
# of an orbit or, more cheaply, by its distance to the strobes of known attractors (`AttractorSignature`). Many states
# are sorted at once, each followed only as long as it needs.

_SPACING = 4.0  # largest distance of a strobe from the sample of its torus or chaos, in spacings of the sample
_MOST = 0.9  # fraction of the strobes that must be so near
_CLOSEST = 2e-3  # relative distance that always counts as near: the two may come from different flows
UNRESOLVED, RUNAWAY, IMPOSSIBLE = -1, -2, -3
"""Labels of states that lead to no known attractor, of motions that diverge, and of states beyond a rigid stop."""

_FIRST = 8  # forcing periods before the first test; the total grows by half before each further test
_WATCHED = 48  # strobes of a motion in no trapping region that are compared with the attractor signatures

Advance = Callable[[NDArray[np.float64], int], NDArray[np.float64]]
"""Advances states, one in each row, by some forcing periods; a motion that cannot be integrated becomes nan."""
_COMPARED = 64  # strobes with which a motion is compared with the known attractors


@dataclass(frozen=True)
class Catalogue:
    """The known attractors of a system, each with a signature by which motions on it are recognised."""

    system: System  #: The system.
    #: attractors, signatures: The attractors in the order in which they were found, and the signature of each.
    attractors: tuple[Attractor, ...] = ()
    signatures: tuple[AttractorSignature, ...] = ()

    def with_one_more(self, attractor: Attractor) -> Catalogue:
        """Return a copy of the catalogue with one more attractor at its end."""
        return Catalogue(self.system, (*self.attractors, attractor), (*self.signatures, signature_of(attractor)))


@dataclass(frozen=True, eq=False)
class AttractorSignature:
    """The signature by which motions on an attractor are recognised."""

    #: The trapping region of its orbit; None if the attractor is not periodic, or too weakly stable.
    region: TrappingRegion | None
    strobes: NDArray[np.float64]  #: shape (count, state_size): States of the attractor, one forcing period apart.
    scale: NDArray[np.float64]  #: shape (state_size,): Size of the attractor.
    reach: float  #: Distance from the strobes, relative to that size, up to which a state belongs to the attractor.

    @property
    def wide(self) -> bool:
        """True if motions are recognised by their strobes alone."""
        return self.region is None

    def distance(self, track: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the distance of most strobes of motions, shape (strobes, ...); up to 1 they are on the attractor."""
        # The strobes have the shape (strobes, ..., state_size). A motion that has diverged is nan; its distance is inf.
        from scipy.spatial import KDTree  # imported late: it takes long

        finite = np.isfinite(track).all(axis=(0, -1))
        away = np.full(finite.shape, np.inf)
        distances = KDTree(self.strobes / self.scale).query(track[:, finite] / self.scale)[0]
        away[finite] = np.quantile(distances, _MOST, axis=0) / self.reach
        return away


class Sorted(NamedTuple):
    """The attractors to which states lead."""

    #: shape (count,): Index of the attractor signature that each motion reaches; UNRESOLVED or RUNAWAY for none.
    labels: NDArray[np.int_]
    states: NDArray[np.float64]  #: shape (count, state_size): States of the motions when this was decided.
    periods: NDArray[np.int_]  #: shape (count,): Number of forcing periods until then.


def explore(
    catalogue: Catalogue, advance: Advance, states: NDArray[np.float64], *, longest: int, max_period: int, tries: int
) -> tuple[Catalogue, NDArray[np.int_]]:
    """Classify states that lead to no known attractor: settle the first, sort the others by its attractor, and repeat.

    Shapes: `states` (count, state_size).
    """
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    rest = np.arange(len(states))
    for _ in range(tries):
        if not len(rest):
            break
        first, rest = rest[0], rest[1:]
        known = len(catalogue.attractors)
        catalogue, labels[first] = _settle_one(catalogue, states[first], max_period)
        if labels[first] == known:  # a new attractor, to which others may lead too
            found = sort_states(advance, states[rest], catalogue.signatures, longest)
            states[rest], labels[rest] = found.states, found.labels
            rest = rest[found.labels == UNRESOLVED]
    return catalogue, labels


def _settle_one(catalogue: Catalogue, state: NDArray[np.float64], max_period: int) -> tuple[Catalogue, int]:
    """Label one state with the exact flow; return the catalogue, extended if its attractor is new, and the label."""
    options = ClassifyOptions(settle=SettleOptions(max_period=max_period))
    try:
        attractor = classify(catalogue.system, state, options)
    except FlowError:
        return catalogue, RUNAWAY
    if attractor.kind is AttractorKind.UNDECIDED:
        return catalogue, UNRESOLVED
    track = attractor.strobes[-_COMPARED:]
    for index, signature in enumerate(catalogue.signatures):
        if signature.distance(track) <= 1.0 if signature.region is None else signature.region.holds(track).all():
            return catalogue, index
    return catalogue.with_one_more(attractor), len(catalogue.attractors)


def sort_states(
    advance: Advance, states: NDArray[np.float64], signatures: Sequence[AttractorSignature], longest: int
) -> Sorted:
    """Follow states until each has reached one of the attractors, or for `longest` forcing periods."""
    # Shapes: `states` (count, state_size).
    states = np.array(states, dtype=float)
    labels = np.full(len(states), UNRESOLVED)
    periods = np.zeros(len(states), dtype=int)
    total = 0
    alive = _look(states, labels, signatures, np.arange(len(states)))
    while len(alive) and total < longest:
        step = min(max(_FIRST, total // 2), longest - total)
        states[alive] = advance(states[alive], step)
        total += step
        periods[alive] = total
        alive = _look(states, labels, signatures, alive)
    wide = [(index, signature) for index, signature in enumerate(signatures) if signature.wide]
    if len(alive) and wide:
        track = np.empty((_WATCHED, len(alive), states.shape[1]))
        for strobe in track:
            strobe[:] = states[alive] = advance(states[alive], 1)
        periods[alive] += _WATCHED
        for index, signature in wide:
            labels[alive[(labels[alive] == UNRESOLVED) & (signature.distance(track) <= 1.0)]] = index
    return Sorted(labels, states, periods)


def _look(
    states: NDArray[np.float64],
    labels: NDArray[np.int_],
    signatures: Sequence[AttractorSignature],
    alive: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Label the motions that are in a trapping region or have diverged; return the rest of `alive`."""
    labels[alive[~np.isfinite(states[alive]).all(axis=1)]] = RUNAWAY
    for index, signature in enumerate(signatures):
        if signature.region is not None:
            rest = alive[labels[alive] == UNRESOLVED]
            labels[rest[signature.region.holds(states[rest])]] = index
    return alive[labels[alive] == UNRESOLVED]


def match(
    attractors: Sequence[Attractor],
    motion: Attractor | Settled | NDArray[np.float64],
    tolerance: float = 1e-3,
) -> int | None:
    """Return the index of the attractor to which a settled motion belongs, or None."""
    # Two orbits are compared as in `gapwalk.orbit.orbit.is_same`. States are compared with the strobes of each
    # attractor: they must be near those of an orbit within `tolerance`, and near those of a torus or of chaos within
    # some spacings of its sample. If several attractors match, the nearest one is returned.
    if isinstance(motion, Attractor | Settled) and motion.orbit is not None:
        same = [each.orbit is not None and is_same(each.orbit, motion.orbit, tolerance) for each in attractors]
        if sum(same) == 1:
            return same.index(True)  # several: one motion in phases shifted by whole forcing periods
    states = motion.strobes if isinstance(motion, Attractor | Settled) else np.atleast_2d(np.asarray(motion, float))
    if isinstance(motion, Settled) and motion.orbit is not None:
        states = motion.orbit.state[None, :]
    distances = [distance(attractor, states, tolerance) for attractor in attractors]
    best = int(np.argmin(distances)) if distances else 0
    return best if distances and distances[best] <= 1.0 else None


def distance(attractor: Attractor, states: NDArray[np.float64], tolerance: float = 1e-3) -> float:
    """Return the distance of most of some states, one in each row, from an attractor; up to 1 they belong to it."""
    length = attractor.strobes.shape[1]
    if states.ndim != 2 or states.shape[1] != length:
        raise ModelError(f"the states have the shape {states.shape}; it must be (count, {length})")
    return float(_signature(attractor, None, tolerance).distance(states))


def signature_of(attractor: Attractor, reach: float | None = None) -> AttractorSignature:
    """Build the signature of an attractor; quickly, by strobes within a relative distance, if that is given."""
    if reach is not None:
        return _signature(attractor, None, reach)
    region = None if attractor.orbit is None else trapping_region_of(attractor.orbit)
    return _signature(attractor, region, _CLOSEST)


def _signature(attractor: Attractor, region: TrappingRegion | None, reach: float) -> AttractorSignature:
    """Build a signature whose reach is at least the given one, and more for the sample of a torus or of chaos."""
    from scipy.spatial import KDTree  # imported late: it takes long

    scale = size_of(attractor.system, attractor.strobes)
    known = attractor.strobes / scale
    if attractor.kind is not AttractorKind.PERIODIC and len(known) > 1:
        spacing = KDTree(known).query(known, k=2)[0][:, 1]
        reach = max(reach, _SPACING * float(np.quantile(spacing, 0.95)))
    return AttractorSignature(region, attractor.strobes, scale, reach)


# Boxes of initial states: a range or a fixed value for each coordinate and velocity, by name.
#
# The extension of a contact with a state of its own begins at zero.
#
# States in a box are the centres of the cells of a plane, their neighbours, or random.

Range = Sequence[float] | float
"""The two ends of a range, or one number for a fixed component."""
_DRAWS = 1000  # of all states, to find enough of them within rigid stops
_NEAREST = 4  # as for a cell of a plane


@dataclass(frozen=True)
class Box:
    """Initial states at theta = 0, each component within a range; a component with equal ends is fixed."""

    names: tuple[str, ...]  #: Names of the components: coordinates, velocities, then extensions, which are zero.
    #: low, high: The ends of the ranges, in the order of the names.
    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, system: System, ranges: Mapping[str, Range]) -> Box:
        """Create a box from ranges (two numbers) or fixed values (one number) by name; all others are 0."""
        names = system.state_names
        low, high = np.zeros(len(names)), np.zeros(len(names))
        for name, given in ranges.items():
            if name in names[2 * system.size :]:
                raise ModelError(f"{name} is no axis of a box: springs of friction begin without force, at 0")
            if name not in names:
                known = did_you_mean(name, names[: 2 * system.size])
                raise ModelError(f"there is no coordinate or velocity {name!r}; {known}")
            place = names.index(name)
            low[place], high[place] = _ends(name, given)
        return cls(names, tuple(low.tolist()), tuple(high.tolist()))

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the components that are not fixed."""
        return tuple(name for name, a, b in zip(self.names, self.low, self.high, strict=True) if a < b)

    def draw(
        self, count: int, seed: int, is_possible: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None
    ) -> NDArray[np.float64]:
        """Draw random states, uniformly distributed over the box and repeatable, shape (count, state_size)."""
        # Only those that are possible are kept.
        random, found = np.random.default_rng(seed), np.empty((0, len(self.names)))
        for _ in range(_DRAWS):
            drawn = random.uniform(self.low, self.high, (count, len(self.names)))
            found = np.concatenate((found, drawn if is_possible is None else drawn[is_possible(drawn)]))
            if len(found) >= count:
                return found[:count]
        raise ModelError(
            f"only {len(found)} of {_DRAWS * count} states in the box are within the rigid stops; give a smaller box"
        )


@dataclass(frozen=True)
class Window:
    """A window on a plane of initial states: a box with two free components."""

    box: Box  #: The box.
    #: across, up: Names of the components along the two axes.
    across: str
    up: str

    @classmethod
    def of(cls, system: System, ranges: Mapping[str, Sequence[float]], fixed: Mapping[str, float]) -> Window:
        """Create the window on two components with their ranges, the horizontal one first; others are fixed or 0."""
        if len(ranges) != 2:
            raise ModelError(
                f"a plane has two axes, but {len(ranges)} ranges were given ({', '.join(ranges) or 'none'}); write "
                '{"q1": (-4, 4), "q1\'": (-4, 4)}'
            )
        both = [name for name in ranges if name in fixed]
        if both:
            raise ModelError(f"{both[0]} is both an axis of the plane and fixed; remove it from the fixed ones")
        for name, given in ranges.items():
            if isinstance(given, int | float):
                raise ModelError(f"{name} is {given}; an axis of the plane needs a range such as (-4, 4)")
        for name, given in fixed.items():
            if not isinstance(given, int | float | np.floating | np.integer):
                raise ModelError(f"{name} is fixed at {given!r}; it must be one number")
        across, up = ranges
        return cls(Box.of(system, {**fixed, **ranges}), across, up)

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ranges of the two axes."""
        first, second = (self.box.names.index(name) for name in (self.across, self.up))
        return (self.box.low[first], self.box.high[first]), (self.box.low[second], self.box.high[second])

    def centres(self, resolution: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the centres of `resolution` cells (columns, rows) along the two axes."""
        across, up = (centres(ends, count) for ends, count in zip(self.within, resolution, strict=True))
        return across, up

    def states(self, resolution: tuple[int, int]) -> NDArray[np.float64]:
        """Return the states at the centres of all cells, row by row from the bottom; shape (cells, state_size)."""
        across, up = self.centres(resolution)
        states = np.tile(self.box.low, (len(across) * len(up), 1))
        states[:, self.box.names.index(self.across)] = np.tile(across, len(up))
        states[:, self.box.names.index(self.up)] = np.repeat(up, len(across))
        return states


def beside_cells(rows: int, columns: int) -> NDArray[np.intp]:
    """Return the indices of the left, right, lower and upper neighbours of the cells, row by row; shape (cells, 4)."""
    # At an edge of the plane the missing neighbour is the cell itself.
    numbers = np.arange(rows * columns).reshape(rows, columns)
    wide = np.pad(numbers, 1, mode="edge")
    sides = (wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1])
    return np.stack([side.ravel() for side in sides], axis=1)


def beside_states(states: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the four nearest other states of each state, scaled by the ranges of the components; shape (count, 4)."""
    from scipy.spatial import cKDTree  # imported late: it takes long

    widths = np.ptp(states, axis=0)
    scaled = states / np.where(widths > 0.0, widths, 1.0)
    count = min(_NEAREST, len(states) - 1)
    _, nearest = cKDTree(scaled).query(scaled, k=np.arange(1, count + 2))
    return np.asarray(nearest[:, 1:], dtype=np.intp)


def differs(labels: NDArray[np.int_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the labels that differ from the label of a neighbour."""
    return (labels[neighbours] != labels[:, None]).any(axis=1)


def about(marked: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the states that are marked already or have a marked neighbour."""
    return marked | marked[neighbours].any(axis=1)


def _ends(name: str, given: Range) -> tuple[float, float]:
    try:
        ends = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        ends = np.array([np.nan])
    if ends.shape not in {(1,), (2,)} or not np.isfinite(ends).all():
        raise ModelError(f"the range of {name} is {given!r}; write two finite numbers (low, high), or one to fix it")
    if len(ends) == 2 and not ends[0] < ends[1]:
        raise ModelError(f"the range of {name} is from {ends[0]:g} to {ends[1]:g}: it is empty; write (low, high)")
    return float(ends[0]), float(ends[-1])


def centres(within: tuple[float, float], count: int) -> NDArray[np.float64]:
    """Return the centres of `count` cells that divide a range evenly."""
    low, high = within
    return low + (high - low) * (np.arange(count) + 0.5) / count


_ORDER = tuple(AttractorKind)
_WORDS = {UNRESOLVED: "unresolved", RUNAWAY: "diverges", IMPOSSIBLE: "beyond a rigid stop"}
_WIDEST = 16  # cells of the plane in the largest error of a start
_BLOCKS = 32  # blocks of rows, and of columns, of which the bootstrap draws
_SAMPLES = 400
_LETTERS = "abcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True)
class BasinCheck:
    """Accuracy of the labels: cells that were checked with the exact flow and corrected where they were wrong."""

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
        return f"{text}; rounding decides {self.shifted_wrong} of {self.shifted} cells" if self.shifted_wrong else text

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
    """Basins of attraction in a plane of initial states at theta = 0."""

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
            raise ValueError(f"some of its labels belong to none of its {count} attractors")
        if not np.isfinite(self.axes[0]).all():
            raise ValueError("its axes hold values that are not finite")

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

    def uncertainty(self, confidence: float = 0.95) -> Uncertainty:
        """Return the exponent with which the share of uncertain starts shrinks with their error, with its limits.

        It is 1 for smooth boundaries; the dimension of the boundary is that of the plane, 2, less the exponent.
        (Grebogi, McDonald, Ott and Yorke 1983, Physics Letters A 99, 415-418.) The limits are those of a bootstrap
        of blocks of rows and of columns, and of the differences between the local slopes over the distances. With
        the edges of stripes on a Cantor set it is 0.03 to 0.05 too small: the limits held it in half of the cases.
        """
        return Uncertainty.of(self.labels, confidence)

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
class Uncertainty:
    """Exponent with which the share of starts whose attractor is uncertain shrinks with the error of a start."""

    exponent: float  #: The exponent; 1 for a smooth boundary.
    #: low, high: Its confidence limits.
    low: float
    high: float
    distances: tuple[int, ...]  #: Errors of the start, in cells.
    shares: tuple[float, ...]  #: Share of the cells from which a start moved by that distance leads elsewhere.

    @property
    def dimension(self) -> float:
        """Box-counting dimension of the boundary in the plane."""
        return 2.0 - self.exponent

    @classmethod
    def of(cls, labels: NDArray[np.int_], confidence: float) -> Uncertainty:
        """Compute it from the labels of cells, shape (rows, columns)."""
        most = min(labels.shape) // _WIDEST
        distances = [2**k for k in range(int(np.log2(max(most, 1))) + 1)]
        widest, counts = distances[-1], list[NDArray[np.float64]]()  # of a direction, shape (distances, blocks)
        for cells in (labels, labels.T):
            middle, length = cells[:, widest:-widest], cells.shape[1] - 2 * widest  # the same starts for each distance
            moved = [[cells[:, widest + k :][:, :length] for k in (each, -each)] for each in distances]
            found = np.array([((middle != up) | (middle != down)).mean(axis=1) for up, down in moved])
            counts.append(np.array([block.mean(axis=1) for block in np.array_split(found, _BLOCKS, axis=1)]).T)
        shares = np.mean([each.mean(axis=1) for each in counts], axis=0)
        if len(distances) < 3 or not (shares > 0.0).all():
            raise ModelError(
                f"the {labels.shape[1]} x {labels.shape[0]} cells show no boundary over enough distances; write a "
                "finer resolution, at least 64, over a plane with a boundary"
            )

        def slopes(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.diff(np.log(np.maximum(values, 1e-12))) / np.log(2.0)

        from scipy.stats import t  # imported late: it takes long

        # Starts side by side are correlated, so blocks of them are drawn; local slopes differ where the boundary is
        # bent or not self-similar at each scale, and each is one value of a sample as small as their number.
        random, samples = np.random.default_rng(0), []
        for _ in range(_SAMPLES):
            picked = [each[:, random.integers(_BLOCKS, size=_BLOCKS)].mean(axis=1) for each in counts]
            samples.append(slopes(np.mean(picked, axis=0)).mean())
        own = slopes(shares)
        error = np.hypot(np.std(samples), own.std(ddof=1) / np.sqrt(len(own)))
        half = float(t.ppf(0.5 + 0.5 * confidence, len(own) - 1) * error)
        mean = float(own.mean())
        return cls(mean, mean - half, mean + half, tuple(distances), tuple(shares.tolist()))


@dataclass(frozen=True)
class Share:
    """The fraction of random starts that lead to one attractor."""

    name: str  #: Name of the attractor.
    starts: int  #: Number of starts that lead to it.
    share: float  #: Fraction of the starts that lead to it.
    #: low, high: Confidence limits of the fraction of the whole box (Clopper and Pearson 1934, Biometrika 26, 404-413).
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class BasinShares:
    """Fractions of a box of initial states that lead to each attractor, estimated from random starts."""

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

    def live(self, parameter: str, to: tuple[float, float]) -> Any:
        """Draw the shares above a slider for another parameter; see `Branch.live`."""
        from gapwalk.plot.live_slider import live_slider

        return live_slider(self, parameter, to)

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
