"""The job behind a regime map: what kinds of motion there are in many cells, in chunks, checked with the exact flow."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.batch_motions import motions_of
from gapwalk.attractors.box import centres
from gapwalk.attractors.exact_recheck import Finding, settle_doubts, take_another_look
from gapwalk.attractors.regime import Regime, regime_word
from gapwalk.attractors.regime_judge import RegimeOptions, Verdicts, judge
from gapwalk.attractors.regimes import RegimeCheck, Regimes
from gapwalk.model.system import System
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers

CHUNK = 1024
"""Cells in a chunk: one piece of work, and what a killed run loses at most."""

ROWS = 64
"""Rows in a chunk whose states are carried over from column to column."""

_CHECKED = 4  # cells of a piece that are checked

Places = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Rows and columns of cells, shape (turns, cells side by side): each turn starts where the turn before came to."""


@dataclass(frozen=True)
class RegimeChunk:
    """The motions in one chunk of cells.

    Attributes
    ----------
    number
        Which chunk.
    verdicts
        What they are, in the order of its cells.
    error
        Of the fast flow, see `gapwalk.attractors.many_motions.ManyMotions`.
    """

    number: int
    verdicts: Verdicts
    error: float


Report = Callable[[RegimeChunk, Pace], object]
"""Called with each chunk when it is done, and how far the job has come."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a regime map is to be over.

    Attributes
    ----------
    system
        The system.
    names
        The two parameters, the one across first.
    within
        Their ranges.
    resolution
        Columns and rows.
    start : shape (2n,)
        Where motions start.
    judging
        How regimes are told apart.
    """

    system: System
    names: tuple[str, str]
    within: tuple[tuple[float, float], tuple[float, float]]
    resolution: tuple[int, int]
    start: NDArray[np.float64]
    judging: RegimeOptions

    @property
    def values(self) -> NDArray[np.float64]:
        """The parameters' values at the centres of the cells, shape (rows, columns, 2)."""
        across, up = (centres(ends, count) for ends, count in zip(self.within, self.resolution, strict=True))
        return np.stack(np.meshgrid(across, up), axis=-1)

    def cells(self) -> list[Places]:
        """The cells in chunks, when each starts from the same state."""
        columns, rows = self.resolution
        grid = np.mgrid[:rows, :columns]
        # side by side go systems of about the same frequency: the lowest of them sets the steps of all
        axis = 0 if self.names[1] == self.system.structure.pace else 1
        order = np.argsort(grid[axis], axis=None, kind="stable")
        cells = grid.reshape(2, 1, -1)[..., order]
        return [_places(cells[..., first : first + CHUNK]) for first in range(0, rows * columns, CHUNK)]

    def lines(self, *, rising: bool) -> list[Places]:
        """The cells in chunks, when states are carried over along the first parameter."""
        columns, rows = self.resolution
        turns = np.mgrid[:rows, :columns].transpose(0, 2, 1)[:, :: 1 if rising else -1]
        return [_places(turns[..., first : first + ROWS]) for first in range(0, rows, ROWS)]

    def system_at(self, pair: NDArray[np.float64]) -> System:
        """The system with two values of the parameters."""
        return self.system.at(dict(zip(self.names, pair.tolist(), strict=True)))


@dataclass(frozen=True, eq=False)
class _Piece:
    """Some of the cells."""

    number: int
    plan: Plan
    values: NDArray[np.float64]  # shape (turns, cells side by side, 2)


class RegimeJob:
    """Finds the regimes of all cells of a map.

    Parameters
    ----------
    plan
        What the map is over.
    places
        The cells in chunks.
    """

    def __init__(self, plan: Plan, places: list[Places]) -> None:
        self.plan, self.places = plan, places
        columns, rows = plan.resolution
        contacts = len(plan.system.structure.contacts) if plan.judging.forces else 0
        self.found = Verdicts(
            np.full((rows, columns), int(Regime.UNDECIDED)),
            np.zeros((rows, columns), dtype=int),
            np.full((rows, columns), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, len(plan.start)), np.nan),
        )
        self.checked = RegimeCheck()
        self.complete = False
        self._chunks: dict[int, RegimeChunk] = {}

    def take(self, done: Iterable[RegimeChunk]) -> None:
        """Take over chunks of the same job that have been done already."""
        self._chunks.update({chunk.number: chunk for chunk in done})
        for chunk in self._chunks.values():
            self._note(chunk)

    def judge(self, hands: Workers, report: Report | None = None) -> None:
        """Judge all cells that have not been judged yet."""
        values = self.plan.values
        pieces = [
            _Piece(number, self.plan, values[place])
            for number, place in enumerate(self.places)
            if number not in self._chunks
        ]
        begun, before = time.monotonic(), len(self._chunks)

        def accept(_: int, chunk: RegimeChunk) -> None:
            self._chunks[chunk.number] = chunk
            self._note(chunk)
            if report is not None:
                report(chunk, Pace(len(self._chunks), len(self.places), before, time.monotonic() - begun))

        hands.run(_judge_piece, pieces, accept, in_order=False)

    def check(self, hands: Workers, count: int, seed: int) -> None:
        """Classify the motions of random cells with the exact flow, from where they have come to."""
        regimes, periods = self.found.regimes.ravel(), self.found.periods.ravel()
        decided = np.flatnonzero(np.isin(regimes, (Regime.PERIODIC, Regime.QUASI_PERIODIC, Regime.CHAOTIC)))
        chosen = np.sort(np.random.default_rng(seed).permutation(decided)[:count])
        systems = [self.plan.system_at(pair) for pair in self.plan.values.reshape(-1, 2)[chosen]]
        states = self.found.states.reshape(len(regimes), -1)[chosen]
        jobs = [list(zip(systems, states, strict=True))[k : k + _CHECKED] for k in range(0, len(chosen), _CHECKED)]
        exact: list[Finding] = []
        hands.run(_classify_some, jobs, lambda _, found: exact.extend(found))
        mine = zip(regimes[chosen].tolist(), periods[chosen].tolist(), strict=True)
        both = zip(systems, mine, exact, strict=True)
        sentences = [self._difference(system, *words) for system, *words in both if words[0] != words[1]]
        self.checked = RegimeCheck(len(chosen), tuple(sentences))

    def record(self) -> Regimes:
        """The map, as far as it has come."""
        total = self.found.regimes.size
        undecided = int(np.sum(self.found.regimes == Regime.UNDECIDED))
        notes: tuple[str, ...] = ()
        if not self.complete:
            done = sum(self.places[number][0].size for number in self._chunks)
            notes = (f"stopped when {done} of {total} cells were done",)
        elif undecided:
            notes = (f"{undecided} of {total} cells are undecided: locked to long periods, or weakly chaotic",)
        error = max((chunk.error for chunk in self._chunks.values()), default=0.0)
        plan = self.plan
        return Regimes(plan.system, *plan.names, plan.within, *self.found, self.checked, error, self.complete, notes)

    def _note(self, chunk: RegimeChunk) -> None:
        for whole, part in zip(self.found, chunk.verdicts, strict=True):
            whole[self.places[chunk.number]] = part

    def _difference(self, system: System, mine: Finding, exact: Finding) -> str:
        where = ", ".join(f"{name} = {system[name]:.6g}" for name in self.plan.names)
        return f"at {where}: {regime_word(*mine)}, but {regime_word(*exact)} by the exact flow"


def _places(cells: NDArray[np.intp]) -> Places:
    return cells[0], cells[1]


def _judge_piece(piece: _Piece) -> RegimeChunk:
    """Judge cells turn by turn, each from where those of the turn before came to."""
    plan = piece.plan
    states = np.tile(plan.start, (piece.values.shape[1], 1))
    turns, error = [], 0.0
    for values in piece.values:
        by_name = dict(zip(plan.names, values.T, strict=True))
        structure = plan.system.structure
        paces = by_name.get(structure.pace, np.full(len(values), plan.system[structure.pace]))
        frequencies = structure.frequency * paces
        motions = motions_of(plan.system, states, by_name)
        verdicts = judge(motions, states, frequencies, plan.judging)
        turns.append(settle_doubts(verdicts, [partial(plan.system_at, pair) for pair in values]))
        error = max(error, motions.error)
        finite = np.isfinite(verdicts.states).all(axis=1, keepdims=True)
        states = np.where(finite, verdicts.states, plan.start)
    return RegimeChunk(piece.number, Verdicts(*(np.array(parts) for parts in zip(*turns, strict=True))), error)


def _classify_some(jobs: list[tuple[System, NDArray[np.float64]]]) -> list[Finding]:
    return [take_another_look(system, state) for system, state in jobs]
