"""Basins of attraction as a job: of the cells of a plane, or of random starts in a box, in chunks on all workers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.basins import Basins, BasinShares, Check, border_cells, in_order
from gapwalk.attractor.box import Box, Range, Window
from gapwalk.attractor.catalogue import Catalogue, Effort, explore
from gapwalk.attractor.haunt import Haunt
from gapwalk.attractor.mass_swarm import swarm_of
from gapwalk.attractor.sorting import UNRESOLVED, Sorted, sort_states
from gapwalk.attractor.swarm import ExactSwarm
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.study.grid import check_resolution
from gapwalk.study.workers import Workers, workers

_CHUNK = 4096  # states; their results depend neither on the number of workers nor on what else is asked for
_CHECKED = 32  # states of a chunk that is followed with the exact flow
_PILOT = 64  # states that are looked at first: most attractors are found by them

Report = Callable[[int, int], None]
"""Called with the number of states done so far, and of all."""


@dataclass(frozen=True, slots=True)
class BasinOptions:
    """How basins are found.

    Parameters
    ----------
    longest
        The most forcing periods that a motion is followed before it is settled and classified by itself.
    max_period
        The longest period m of an orbit that is looked for.
    tries
        The most motions that are settled and classified one by one, with the exact flow.
    exact_borders
        Whether the label of every cell at a border between basins is found with the exact flow; otherwise those of
        `check` of them are.
    check
        Random cells elsewhere whose label is found again with the exact flow.
    seed
        Of the choice of the cells that are looked at first and checked, and of random starts.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    longest: int = 3000
    max_period: int = 64
    tries: int = 48
    exact_borders: bool = True
    check: int = 1024
    seed: int = 0
    workers: int | None = None

    def __post_init__(self) -> None:
        for name, least in (("longest", 1), ("max_period", 1), ("tries", 1), ("check", 0), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")

    @property
    def effort(self) -> Effort:
        """What `explore` needs of it."""
        return Effort(self.longest, self.max_period, self.tries)


def basins(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    fixed: Mapping[str, float] | None = None,
    options: BasinOptions | None = None,
    report: Report | None = None,
) -> Basins:
    """Basins of attraction in a plane of initial states.

    Each cell is judged by the state at its centre. It is followed by the fast flow until it is in a trap about a known
    attractor (see `gapwalk.attractor.trap`); the attractors themselves are exact. Cells at borders between basins, and
    a sample of the others, are followed again by the exact flow, which mends labels and tells how many are wrong.
    Ctrl-C ends the work and keeps what there is.

    Parameters
    ----------
    system
        The system.
    plane
        The two axes and their ranges, the horizontal one first: ``{"q1": (-4, 4), "q1'": (-4, 4)}``.
    resolution
        Cells along each axis, or (columns, rows).
    fixed
        The other components of the state at theta = 0; those that are not named are 0.
    options
        How the basins are found.
    report
        Called when a part is done.

    Raises
    ------
    ModelError
        For a plane that makes no sense.
    """
    options = options or BasinOptions()
    window = Window.of(system, plane, fixed or {})
    columns, rows = check_resolution(resolution)
    states = window.states((columns, rows))
    with workers(options.workers) as hands:
        job = _Job(system, states, options, hands, report)
        job.run(lambda: job.check((rows, columns)))
    attractors, labels = in_order(job.catalogue.attractors, job.labels)
    return Basins(
        system,
        window,
        labels.reshape(rows, columns),
        attractors,
        job.checked,
        job.error,
        job.complete,
        tuple(job.notes()),
    )


def basin_shares(
    system: System,
    box: Mapping[str, Range],
    starts: int = 1000,
    *,
    confidence: float = 0.95,
    options: BasinOptions | None = None,
    report: Report | None = None,
) -> BasinShares:
    """The shares of a box of initial states that lead to each attractor, with confidence limits.

    Parameters
    ----------
    system
        The system.
    box
        A range or a fixed value for components of the state at theta = 0: ``{"q1": (-4, 4), "q1'": (-4, 4), "q3": 1}``;
        those that are not named are 0.
    starts
        Number of random starts, evenly distributed over the box.
    confidence
        Probability with which the limits of a share hold.
    options
        How the basins are found; its ``check`` is not used.
    report
        Called when a part is done.

    Raises
    ------
    ModelError
        For a box that makes no sense.
    """
    options = options or BasinOptions()
    room = Box.of(system, box)
    if not room.free:
        raise ModelError('all components of the box are fixed; give at least one a range, such as {"q1": (-4, 4)}')
    if isinstance(starts, bool) or not isinstance(starts, int) or starts < 1:
        raise ModelError(f"starts is {starts!r}; it must be an integer >= 1")
    if not 0.0 < confidence < 1.0:
        raise ModelError(f"confidence is {confidence!r}; it must lie between 0 and 1, such as 0.95")
    states = room.draw(starts, options.seed)
    with workers(options.workers) as hands:
        job = _Job(system, states, options, hands, report)
        job.run(lambda: None)
    attractors, labels = in_order(job.catalogue.attractors, job.labels)
    return BasinShares(system, room, states, labels, attractors, confidence, job.complete, tuple(job.notes()))


@dataclass(frozen=True)
class _Piece:
    """Some of the states, and what is known of the attractors."""

    system: System
    states: NDArray[np.float64]
    haunts: tuple[Haunt, ...]
    longest: int


class _Job:
    """Finds the labels of many states."""

    def __init__(
        self, system: System, states: NDArray[np.float64], options: BasinOptions, hands: Workers, report: Report | None
    ) -> None:
        self.states, self.options, self.hands, self.report = states, options, hands, report
        self.catalogue = Catalogue(system)
        self.labels = np.full(len(states), UNRESOLVED)
        self.ends = states.copy()  # where the motions have come to
        self.done, self.error = 0, 0.0
        self.checked = Check(len(states))
        self.complete = False

    def run(self, then: Callable[[], None]) -> None:
        """Find all labels, then do what remains; Ctrl-C ends it."""
        try:
            self._look_around()
            self._sort()
            self._explore(np.flatnonzero(self.labels == UNRESOLVED))
            then()
            self.complete = True
        except KeyboardInterrupt:
            pass

    def notes(self):
        """What could not be done, in sentences."""
        if not self.complete:
            yield f"stopped when {self.done} of {len(self.states)} states were done"
        left = int(np.sum(self.labels == UNRESOLVED))
        if left and self.complete:
            yield f"{left} states lead to no attractor that was found; raise longest or tries"

    def check(self, shape: tuple[int, int]) -> None:
        """Find labels at borders, and of some other cells, again with the exact flow, and mend what is wrong."""
        most = len(self.states) if self.options.exact_borders else self.options.check
        checked = np.zeros(len(self.states), dtype=bool)
        at_borders = wrong_there = 0
        while True:  # mended labels make new borders
            borders = border_cells(self.labels.reshape(shape)).ravel()
            chosen = self._choose(borders & ~checked, most - at_borders)
            if not len(chosen):
                break
            at_borders, wrong_there = at_borders + len(chosen), wrong_there + self._mend(chosen)
            checked[chosen] = True
        chosen = self._choose(~borders & ~checked, self.options.check)
        wrong = self._mend(chosen)
        self.checked = Check(
            len(self.states), int((borders | checked).sum()), at_borders, wrong_there, len(chosen), wrong
        )

    def _choose(self, group: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
        """Random ones of a group of cells, in order."""
        random = np.random.default_rng(self.options.seed)
        return np.sort(random.permutation(np.flatnonzero(group))[:most])

    def _mend(self, which: NDArray[np.intp]) -> int:
        """Find labels again with the exact flow; how many were wrong."""
        exact = np.full(len(which), UNRESOLVED)

        def accept(index: int, found: Sorted) -> None:
            exact[index * _CHECKED : index * _CHECKED + len(found.labels)] = found.labels

        self.hands.run(_sort_exactly, self._pieces(self.states[which], _CHECKED), accept)
        wrong = int(np.sum(exact != self.labels[which]))
        # one that has come to no attractor by then keeps its label, but counts as wrong
        self.labels[which] = np.where(exact == UNRESOLVED, self.labels[which], exact)
        return wrong

    def _look_around(self) -> None:
        """Find the attractors to which some of the states lead."""
        random = np.random.default_rng(self.options.seed)
        pilot = np.sort(random.permutation(len(self.states))[:_PILOT])
        self._explore(pilot)

    def _sort(self) -> None:
        """Sort all states by the attractors that are known."""

        def accept(index: int, result: tuple[Sorted, float]) -> None:
            found, error = result
            self.error = max(self.error, error)
            place = slice(index * _CHUNK, index * _CHUNK + len(found.labels))
            self.labels[place], self.ends[place] = found.labels, found.states
            self.done += len(found.labels)
            if self.report is not None:
                self.report(self.done, len(self.states))

        self.hands.run(_sort_fast, self._pieces(self.states, _CHUNK), accept)

    def _explore(self, which: NDArray[np.intp]) -> None:
        if not len(which):
            return
        swarm = swarm_of(self.catalogue.system, self.states[which])
        self.catalogue, labels = explore(self.catalogue, swarm.advance, self.ends[which], self.options.effort)
        self.labels[which] = labels

    def _pieces(self, states: NDArray[np.float64], size: int) -> list[_Piece]:
        return [
            _Piece(self.catalogue.system, states[first : first + size], self.catalogue.haunts, self.options.longest)
            for first in range(0, len(states), size)
        ]


def _sort_fast(piece: _Piece) -> tuple[Sorted, float]:
    """Sort states by the mass flow, and tell its error."""
    swarm = swarm_of(piece.system, piece.states)
    return sort_states(swarm.advance, piece.states, piece.haunts, piece.longest), swarm.error


def _sort_exactly(piece: _Piece) -> Sorted:
    return sort_states(ExactSwarm(piece.system).advance, piece.states, piece.haunts, piece.longest)
