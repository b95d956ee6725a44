"""The study of basins of attraction in a plane of initial states."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.attractors.basins import (
    IMPOSSIBLE,
    UNRESOLVED,
    AttractorSignature,
    BasinCheck,
    Basins,
    BasinShares,
    Box,
    Catalogue,
    Range,
    Sorted,
    Window,
    about,
    beside_cells,
    beside_states,
    differs,
    explore,
    in_order,
    sort_states,
)
from gapwalk.attractors.many_motions import ExactMotions, enough, has_kernel, motions_of
from gapwalk.ensemble.batch_flow import within_stops
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Bounded, Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.words import coordinate_words
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.cell_work import CellWork
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import Found, StudyKind
from gapwalk.studies.study_schema import CELLS, Resolution, Surroundings, check_resolution, key_type
from gapwalk.summary import SummaryParts, Table

# Computation of the attractor to which each of many states leads, and of the shares of a box of states.

CHUNK = 4096
"""States in a chunk: one piece of work, and what a killed run loses at most."""
FEW = 64
"""States in a chunk of a system that only the exact flow can follow."""

_CHECKED = 32  # states of a piece that is followed with the exact flow
_WANDERING = 512  # periods for which a motion that seems to be on a torus or chaotic is followed exactly, at most
_SHIFT = 1e-15  # relative: where it changes a label, rounding decides
_PILOT = 64  # states that are looked at first: most attractors are found by them


@dataclass(frozen=True, slots=True)
class BasinOptions(Bounded):
    """Options for the computation of basins."""

    #: Largest number of forcing periods of the common run; motions still undecided are classified one by one.
    longest: Counted = 3000
    max_period: Counted = 64  #: Longest period m of the orbits to be found.
    tries: Counted = 48  #: Largest number of motions that are settled and classified one by one, with the exact flow.
    #: True to find the attractor of every cell at a border between basins with the exact flow, and of cells within two
    #: cells of a wrong one; False to do this for `check` cells at borders only.
    exact_borders: bool = True
    #: Number of random cells away from borders whose attractor is found again with the exact flow; with
    #: `exact_borders`, as many more are checked until none is wrong.
    check: Natural = 1024
    #: Seed of the choice of the states that are examined first, of those that are checked, and of random starts.
    seed: Natural = 0
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @property
    def borders(self) -> int | None:
        """Number of labels at borders that are found with the exact flow; None for all."""
        return None if self.exact_borders else self.check


@dataclass(frozen=True)
class BasinChunk:
    """Attractors to which the states of one chunk lead, by the fast flow."""

    number: int  #: Number of the chunk.
    sorted: Sorted  #: Labels in the order in which the attractors were found.
    error: float  #: Error of the fast flow; see `gapwalk.attractors.many_motions.ManyMotions`.


CATALOGUE = Part("attractors", Catalogue)
EXACT = Part("exact", Sorted, numbered=True)


class BasinWork(CellWork):
    """Computation of the attractors to which many states lead.

    States beyond a rigid stop are left out: `states`, `neighbours` and `labels` are those of the others.

    Shapes: `states` (count, state_size); `neighbours` (count, any number).
    """

    chunk_part = Part("cells", BasinChunk, numbered=True)

    def __init__(
        self,
        system: System,
        states: NDArray[np.float64],
        neighbours: NDArray[np.intp],
        resolution: tuple[int, int],
        options: BasinOptions,
    ) -> None:
        super().__init__(options if isinstance(options, BasinStudy) else None, resolution)
        self._possible = possible = within_stops(system, states)
        if not possible.any():
            raise ModelError("all states are beyond rigid stops; begin where the deflections are within the clearances")
        own, number = np.arange(possible.sum())[:, None], np.cumsum(possible) - 1
        beside = neighbours[possible]
        self.system, self.states, self.options = system, states[possible], options
        self.neighbours = np.where(possible[beside], number[beside], own)  # beyond a stop is as beyond an edge
        self.catalogue = Catalogue(system)
        self.labels = np.full(len(self.states), UNRESOLVED)
        self.checked = BasinCheck(len(self.states))
        self.is_begun = False
        self._sorted, self._pieces = dict[int, Sorted](), 0  # those that the exact flow has sorted, and their number
        self._is_exact = not has_kernel(system)
        self._chunk = FEW if self._is_exact else CHUNK
        self._ends = self.states.copy()  # where the motions have come to

    @property
    def all_labels(self) -> NDArray[np.int_]:
        """The labels of all states, with those beyond rigid stops."""
        labels = np.full(len(self._possible), IMPOSSIBLE)
        labels[self._possible] = self.labels
        return labels

    @property
    def total(self) -> int:
        """Number of chunks."""
        return -(-len(self.states) // self._chunk)

    def take(self, known: Parts) -> None:
        """Read the record of a file, or its attractors and chunks."""
        super().take(known)
        if (catalogue := known.get(CATALOGUE)) is not None:
            self.catalogue, self.is_begun = catalogue, True
        self._sorted = dict(known.all(EXACT))

    def begin(self) -> Iterable[Found]:
        """Find the attractors to which some of the states lead, unless they are known."""
        if not self.is_begun:
            self.is_begun = True
            random = np.random.default_rng(self.options.seed)
            pilot = np.sort(random.permutation(len(self.states))[:_PILOT])
            self._explore(pilot, self.states[pilot])
            for chunk in self.chunks.values():
                self.note(chunk)
            yield Found((CATALOGUE.entry(self.catalogue),), ())

    def follow(self, workers: Workers, numbers: list[int]) -> Iterable[tuple[int, BasinChunk]]:
        """Sort the states of some chunks by the attractors that are known."""
        sort = partial(_sort_fast, *self._known, self.options.longest)
        size = self._chunk
        pieces = [(number, self.states[number * size : (number + 1) * size]) for number in numbers]
        return workers.each(sort, pieces, in_order=False)

    def note(self, chunk: BasinChunk) -> None:
        """Enter the labels of a chunk."""
        place = slice(chunk.number * self._chunk, chunk.number * self._chunk + len(chunk.sorted.labels))
        self.labels[place], self._ends[place] = chunk.sorted.labels, chunk.sorted.states

    def notes(self, complete: bool) -> tuple[str, ...]:
        """Return sentences on what could not be done."""
        left = int(np.sum(self.labels == UNRESOLVED))
        if not complete:
            done = sum(len(chunk.sorted.labels) for chunk in self.chunks.values())
            left = "; they were not all checked" * (done == len(self.states))
            return (f"stopped when {done} of {len(self.states)} states were done{left}",)
        return (f"{left} states lead to no attractor that was found; raise longest or tries",) if left else ()

    def check(self, workers: Workers) -> Iterable[Found]:
        """Find the attractors of the states that are still undecided; then check labels."""
        left = np.flatnonzero(self.labels == UNRESOLVED)
        self._explore(left, self._ends[left])
        yield from self.check_labels(workers)

    def check_labels(self, workers: Workers) -> Iterable[Found]:
        """Find labels at borders, and some others, again with the exact flow, and correct wrong ones."""
        # Wrong labels occur in groups: the labels around a wrong one are found again too. If a sample contains a wrong
        # label, there are probably more, so further samples are drawn until one contains none. With
        # `BasinOptions.exact_borders` off there is one sample at borders, and one elsewhere. In the end some states are
        # followed once more after a shift by their rounding: where basins are as fine as that, no computation can tell
        # their labels.
        neighbours, at_borders, elsewhere = self.neighbours, self.options.borders, self.options.check
        checked, changed, sampled = (np.zeros(len(self.states), dtype=bool) for _ in range(3))
        wrong = wrong_elsewhere = 0
        while True:
            while True:  # corrected labels make new borders
                near = differs(self.labels, neighbours)
                if at_borders is None:
                    near |= about(about(changed, neighbours), neighbours)
                left = len(self.states) if at_borders is None else at_borders - int(np.sum(checked & ~sampled))
                chosen = self._choose(near & ~checked, left)
                if not len(chosen):
                    break
                wrong += yield from self._correct(workers, chosen, changed)
                checked[chosen] = True
            chosen = self._choose(~near & ~checked, elsewhere)
            before = int(changed.sum())
            wrong_elsewhere += yield from self._correct(workers, chosen, changed)
            checked[chosen] = sampled[chosen] = True
            if at_borders is not None or changed.sum() == before:
                break
        at_border = checked & ~sampled
        counts = (int(np.sum((near | at_border) & ~sampled)), int(at_border.sum()), wrong)
        again = self._choose(checked, elsewhere)
        shifted = yield from self._exact(workers, again, _SHIFT)
        differ = int(np.sum((shifted != UNRESOLVED) & (shifted != self.labels[again])))
        self.checked = BasinCheck(
            len(self.states), *counts, int(sampled.sum()), wrong_elsewhere, shifted=len(again), shifted_wrong=differ
        )

    def _choose(self, group: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
        """Choose random cells of a group; return them in order."""
        random = np.random.default_rng(self.options.seed)
        return np.sort(random.permutation(np.flatnonzero(group))[:most])

    def _correct(
        self, workers: Workers, which: NDArray[np.intp], changed: NDArray[np.bool_]
    ) -> Generator[Found, None, int]:
        """Find labels again with the exact flow, and mark those that differ in `changed`; return their number."""
        if self._is_exact:  # the exact flow has found them already
            return 0
        exact = yield from self._exact(workers, which)
        wrong = int(np.sum(exact != self.labels[which]))
        # a state that has come to no attractor by then keeps its label, but counts as wrong
        corrected = np.where(exact == UNRESOLVED, self.labels[which], exact)
        changed[which] = corrected != self.labels[which]
        self.labels[which] = corrected
        return wrong

    def _exact(
        self, workers: Workers, which: NDArray[np.intp], shift: float = 0.0
    ) -> Generator[Found, None, NDArray[np.int_]]:
        """Return labels by the exact flow, from states shifted by a given fraction of their largest component."""
        exact = np.full(len(self.states), UNRESOLVED)
        wide = np.array(
            [signature.wide for signature in self.catalogue.signatures] + [False, False]
        )  # the last: no attractor
        is_wide = wide[self.labels[which]]
        states = self.states + shift * np.abs(self.states).max(axis=0)
        # a motion without period is followed for a shorter time
        times = ((which[~is_wide], self.options.longest), (which[is_wide], min(self.options.longest, _WANDERING)))
        groups = [
            (group[first : first + _CHECKED], longest)
            for group, longest in times
            for first in range(0, len(group), _CHECKED)
        ]
        pieces = dict(enumerate(((longest, states[group]) for group, longest in groups), self._pieces))
        left, self._pieces = [number for number in pieces if number not in self._sorted], self._pieces + len(pieces)
        todo = [pieces[number] for number in left]
        for index, found in workers.each(partial(_sort_exactly, *self._known), todo, in_order=False):
            self._sorted[left[index]] = found
            yield Found((EXACT.entry(found, left[index]),), ())
        for number, (group, _) in zip(pieces, groups, strict=True):
            exact[group] = self._sorted[number].labels
        return exact[which]

    def _explore(self, which: NDArray[np.intp], starts: NDArray[np.float64]) -> None:
        """Find the attractors of some states one by one, starting from the states that their motions have reached."""
        if len(which):
            motions = motions_of(self.catalogue.system, self.states[which])
            limits = {name: getattr(self.options, name) for name in ("longest", "max_period", "tries")}
            self.catalogue, labels = explore(self.catalogue, motions.advance, starts, **limits)
            self.labels[which] = labels

    @property
    def _known(self) -> tuple[System, tuple[AttractorSignature, ...]]:
        return self.catalogue.system, self.catalogue.signatures


def _sort_fast(
    system: System, signatures: tuple[AttractorSignature, ...], longest: int, piece: tuple[int, NDArray[np.float64]]
) -> BasinChunk:
    """Sort the states of a chunk by the batch integrator."""
    number, states = piece
    found, error = enough(
        motions_of(system, states), lambda motions: sort_states(motions.advance, states, signatures, longest)
    )
    return BasinChunk(number, found, error)


def _sort_exactly(
    system: System, signatures: tuple[AttractorSignature, ...], piece: tuple[int, NDArray[np.float64]]
) -> Sorted:
    longest, states = piece
    return sort_states(ExactMotions(system).advance, states, signatures, longest)


def basin_shares(
    system: System,
    box: Mapping[str, Range],
    starts: int = 1000,
    *,
    confidence: float = 0.95,
    workers: Workers | int | None = None,
    report: Report | None = None,
    **keywords: Any,
) -> BasinShares:
    """Return the shares of a box of initial states that lead to each attractor, with confidence limits.

    Parameters
    ----------
    system
        The system.
    box
        A range or a fixed value for components of the state at theta = 0: ``{"q1": (-4, 4), "q1'": (-4, 4), "q3": 1}``;
        those that are not named are 0.
    starts
        Number of random starts, evenly distributed over the part of the box within all rigid stops.
    confidence
        Probability with which the limits of a share hold.
    workers, report
        As in `gapwalk.basins`.
    keywords
        Further keywords of `gapwalk.basins`: ``longest``, ``max_period``, ``tries``, ``exact_borders``, ``check``,
        ``seed``. A start is at a border if its attractor differs from that of one of the nearest starts.

    Returns
    -------
    BasinShares
        The share of each attractor, with its limits.

    Raises
    ------
    ModelError
        If the box is invalid.
    WorkError
        If other processes cannot do the work.
    Interrupted
        After Ctrl-C; its `found` is the result so far, with ``complete`` False.

    Notes
    -----
    Confidence limits: Clopper and Pearson (1934), Biometrika 26, 404-413.

    Examples
    --------
    >>> found = gw.basin_shares(system.at(frequency=1.3), {"x": (-2, 1)}, starts=20)
    >>> [(each.name, each.share) for each in found.shares]
    [('period 1a', 0.5), ('period 1b', 0.5)]
    """
    options = BasinOptions(**keywords)
    room = Box.of(system, box)
    if not room.free:
        raise ModelError('all components of the box are fixed; give at least one a range, such as {"q1": (-4, 4)}')
    if isinstance(starts, bool) or not isinstance(starts, int) or starts < 1:
        raise ModelError(f"starts is {starts!r}; it must be an integer >= 1")
    if not 0.0 < confidence < 1.0:
        raise ModelError(f"confidence is {confidence!r}; it must lie between 0 and 1, such as 0.95")
    states = room.draw(starts, options.seed, lambda states: within_stops(system, states))

    class Shares(BasinWork):
        whole_part: Any = Part("shares", BasinShares)

        def found(self, *, complete: bool) -> BasinShares:
            attractors, labels = in_order(self.catalogue.attractors, self.labels)
            how = (confidence, complete, self.notes(complete), self.checked, self.error)
            return BasinShares(system, room, states, labels, attractors, *how)

    work = Shares(system, states, beside_states(states), (starts, 1), options)
    return call(options, work, system, workers=workers, report=report).record


_PLANE = 'write two axes, each with its range, as in plane = { q1 = [-4.0, 4.0], "q1\'" = [-4.0, 4.0] }'

Plane = Mapping[str, tuple[float, float]]


def _is_a_plane(plane: Plane, info: ValidationInfo[Surroundings]) -> Plane:
    if len(plane) != 2:
        raise ValueError(f"names {len(plane)} {'axis' if len(plane) == 1 else 'axes'}; {_PLANE}")
    if info.context.system is not None:
        Window.of(info.context.system, plane, {})
    return plane


def _is_fixed(fixed: Mapping[str, float], info: ValidationInfo[Surroundings]) -> Mapping[str, float]:
    system, plane = info.context.system, info.data.get("plane")
    if system is not None and plane is not None:
        Window.of(system, plane, fixed)
    return fixed


@dataclass(frozen=True)
class BasinStudy(BasinOptions, StudyKind):
    """Basins of attraction in a plane of initial states.

    Each cell is judged by the state at its centre; those beyond a rigid stop are left out. The batch integrator follows
    the motion until it is in the trapping region of a known attractor (see `gapwalk.attractors.settle`); the attractors
    themselves are exact. Cells at borders between basins, and samples of the others, are followed again by the exact
    flow, which corrects labels and counts the wrong ones. A system that the batch integrator cannot include, as one
    with friction that sticks rigidly, is followed by the exact flow alone, a hundred times slower.

    Raises
    ------
    ModelError
        If the plane is invalid.

    Examples
    --------
    >>> found = gw.basins(system.at(frequency=1.3), {"x": (-2, 1), "x'": (-2, 2)}, resolution=8)
    >>> found.cells  # two motions are stable
    {'period 1a': 52, 'period 1b': 12}
    """

    kind: ClassVar[str] = "basins"
    answer: ClassVar[Part | None] = Part("basins", Basins)
    arguments: ClassVar[tuple[str, ...]] = ("plane", "resolution")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {"resolution": CELLS}
    table_types: ClassVar[Mapping[str, Any]] = {"resolution": key_type(Resolution)}

    #: The two axes and their ranges, the horizontal one first.
    plane: Annotated[Plane, Field(description=_PLANE), AfterValidator(_is_a_plane)] = field(kw_only=True)
    #: The other components of the state at theta = 0; those that are not named are 0.
    fixed: Annotated[Mapping[str, float], AfterValidator(_is_fixed)] = field(default_factory=dict)
    resolution: tuple[int, int] = (128, 128)  #: Columns and rows of cells.

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        columns, rows = self.resolution
        ranges = [f"{name} from {low:g} to {high:g}" for name, (low, high) in self.plane.items()]
        return f"basins over {' and '.join(ranges)}, {columns} x {rows} cells"

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> BasinStudy:
        """Return the study of a call."""
        plane, rest = values["plane"], dict(values)
        window = Window.of(system, plane, rest.pop("fixed", {}))
        box = window.box
        rest["plane"] = dict(zip((window.across, window.up), window.within, strict=True))
        rest["resolution"] = check_resolution(values.get("resolution", 128))
        fixed = {name: low for name, low in zip(box.names, box.low, strict=True) if name not in plane}
        return cls(**rest, fixed=fixed)

    def work(self, system: System) -> PlaneBasins:
        """Return the work on the basins."""
        return PlaneBasins(system, self)

    def summary(self, found: Basins) -> SummaryParts:
        """Return the share of cells of each attractor, and how reliable the labels are."""
        (columns, rows), total = found.resolution, found.labels.size
        axes = (coordinate_words(name, found.system.units) for name in (found.window.across, found.window.up))
        yield f"{', '.join(axes)}: {columns} x {rows} cells"
        exponents = [attractor.lyapunov for attractor in found.attractors]
        largest = ["" if each is None else f"{each.exponents[0]:.4g}" for each in exponents]
        counts = [(name, found.cells[name], text) for name, text in zip(found.names, largest, strict=True)]
        counts += [(text, n, "") for text, n in found.others.items() if n]
        cells = [(name, str(count), f"{count / total:.2%}", text) for name, count, text in counts]
        yield Table(["leads to", ">cells", ">share", ">largest exponent"], cells)
        yield found.check.text

    def document(self, found: Basins, points: bool) -> dict[str, Any]:
        """Return attractors with their cells, and the reliability of the labels; with each cell's label if wanted."""
        window = found.window
        document: dict[str, Any] = {
            "plane": dict(zip((window.across, window.up), map(list, window.within), strict=True)),
            "resolution": list(found.resolution),
            "attractors": [
                {
                    "name": name,
                    "kind": attractor.kind.value,
                    "period": attractor.period,
                    "cells": found.cells[name],
                    "state": attractor.state.tolist(),
                    "evidence": list(attractor.evidence),
                }
                for name, attractor in zip(found.names, found.attractors, strict=True)
            ],
            "unresolved": found.unresolved,
            "runaway": found.runaway,
            "impossible": found.impossible,
            "check": {**asdict(found.check), "share": found.check.share, "limit": found.check.limit},
            "error": found.error,
        }
        if points:
            document["labels"] = found.labels.tolist()
        return document


class PlaneBasins(BasinWork):
    """The basins of the cells of a plane."""

    def __init__(self, system: System, asked: BasinStudy) -> None:
        (columns, rows), self.window = asked.resolution, Window.of(system, asked.plane, asked.fixed)
        states = self.window.states(asked.resolution)
        super().__init__(system, states, beside_cells(rows, columns), asked.resolution, asked)

    def found(self, *, complete: bool) -> Basins | None:
        """Return the basins; None before the attractors are known, because the labels of chunks refer to them."""
        if not (complete or self.is_begun):
            return None
        attractors, labels = in_order(self.catalogue.attractors, self.all_labels)
        how = (self.checked, self.error, complete, self.notes(complete))
        return Basins(self.system, self.window, labels.reshape(self.resolution[::-1]), attractors, *how)
