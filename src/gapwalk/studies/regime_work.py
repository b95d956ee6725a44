"""The job behind a regime map: the kind of motion in each of many cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import partial
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.box import centres
from gapwalk.attractors.many_motions import motions_of
from gapwalk.attractors.regime_judge import Finding, RegimeOptions, Verdicts, judge, settle_doubts, take_another_look
from gapwalk.attractors.regimes import Regime, RegimeCheck, Regimes, regime_word
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part
from gapwalk.studies.cell_work import CellFinding, CellWork
from gapwalk.studies.columns import parameter_headings
from gapwalk.studies.kind import Rows, plain_numbers
from gapwalk.studies.kinds import INLINE, Counted
from gapwalk.summary import Table


class Carry(StrEnum):
    """Where the motion at a cell starts."""

    NO = "no"
    """At each cell from the same state."""
    UP = "up"
    """From where the motion came to at the cell before it, with the first parameter rising."""
    DOWN = "down"
    """The same with the first parameter falling."""


@dataclass(frozen=True, slots=True)
class RegimeMapOptions:
    """How a regime map is made.

    Parameters
    ----------
    carry
        Where the motions start: ``"no"``: all from the same state. ``"up"`` or ``"down"``: the state is carried over
        along the first parameter, as in a sweep.
    judging
        Criteria that separate the regimes.
    check
        Cells that are settled and classified again with the exact flow.
    seed
        Of the choice of those cells.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    carry: Carry = Carry.NO
    judging: Annotated[RegimeOptions, INLINE] = field(default_factory=RegimeOptions)
    check: int = 64
    seed: int = 0
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.carry not in list(Carry):
            raise ModelError(f'carry is {self.carry!r}; write "no", "up" or "down"')
        object.__setattr__(self, "carry", Carry(self.carry))
        for name in ("check", "seed"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 0")


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
        Criteria that separate the regimes.
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


_LONGEST_LISTED = 12  # longest period that the summary lists separately
_ARRAYS = ("regimes", "periods", "exponents", "peak_force", "impacts", "states")


class RegimeFinding(CellFinding):
    """A regime map, as far as it has come."""

    map: Regimes

    def summary(self) -> Iterator[str | Table]:
        """Return the share of cells of each regime, and the cells that were classified again."""
        found = self.map
        (columns, rows), total = found.resolution, found.regimes.size
        symbols = (parameter_symbol(name, found.system.units) for name in (found.first, found.second))
        yield f"{', '.join(symbols)}: {columns} x {rows} cells"
        counts: Counter[str] = Counter()
        for word, count in found.cells.items():
            kind, _, period = word.partition(" ")
            is_long = kind == "period" and int(period) > _LONGEST_LISTED
            counts[f"longer periods than {_LONGEST_LISTED}" if is_long else word] += count
        cells = [(word, str(count), f"{count / total:.2%}") for word, count in counts.items()]
        yield Table(["motion", ">cells", ">share"], cells)
        yield f"{found.check.checked} cells classified again, {len(found.check.different)} differently"
        yield from (f"  {text}" for text in found.check.different)

    def map_document(self, points: bool) -> dict[str, Any]:
        """How many cells have each regime, and how far the words hold; with everything cell by cell if wanted."""
        found = self.map
        document: dict[str, Any] = {
            "plane": dict(zip((found.first, found.second), map(list, found.within), strict=True)),
            "resolution": list(found.resolution),
            "cells": found.cells,
            "check": asdict(found.check) | {"different": list(found.check.different)},
            "error": found.error,
        }
        if points:
            document["contacts"] = [contact.name for contact in found.system.structure.contacts]
            document |= {name: plain_numbers(getattr(found, name).tolist()) for name in _ARRAYS}
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """What there is at each cell."""
        return {"cells": lambda: _cell_rows(self.map)}


def _cell_rows(found: Regimes) -> Iterator[list[object]]:
    contacts = [contact.name for contact in found.system.structure.contacts][: found.impacts.shape[2]]
    headings = [f"{what}.{contact}" for what in ("peak.force", "impacts") for contact in contacts]
    names = parameter_headings([found.first, found.second], found.system.coordinates)
    yield [*names, "regime", "period", "exponent", *headings]
    (across, up), (rows, columns) = found.axes, found.regimes.shape
    for row, column in np.ndindex(rows, columns):
        regime, period = int(found.regimes[row, column]), int(found.periods[row, column])
        exponent = float(found.exponents[row, column])
        yield [
            float(across[column]),
            float(up[row]),
            regime_word(regime, period),
            period,
            "" if np.isnan(exponent) else exponent,
            *found.peak_force[row, column].tolist(),
            *found.impacts[row, column].tolist(),
        ]


class RegimeWork(CellWork):
    """Finds the regimes of all cells of a map.

    Parameters
    ----------
    plan
        The cells of the map.
    options
        How the map is made.
    """

    chunk_part = Part("cells", RegimeChunk, numbered=True)
    whole_part = Part("regimes", Regimes)
    finding = RegimeFinding

    def __init__(self, plan: Plan, options: RegimeMapOptions) -> None:
        super().__init__(plan.resolution)
        self.plan, self.options = plan, options
        carry = options.carry
        self.places = plan.cells() if carry is Carry.NO else plan.lines(rising=carry is Carry.UP)
        columns, rows = plan.resolution
        contacts = len(plan.system.structure.contacts) if plan.judging.forces else 0
        self.verdicts = Verdicts(
            np.full((rows, columns), int(Regime.UNDECIDED)),
            np.zeros((rows, columns), dtype=int),
            np.full((rows, columns), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, len(plan.start)), np.nan),
        )
        self._checked = RegimeCheck()

    @property
    def total(self) -> int:
        """Number of chunks."""
        return len(self.places)

    def follow(self, workers: Workers, numbers: list[int]) -> Iterable[tuple[int, RegimeChunk]]:
        """Judge the cells of some chunks."""
        values = self.plan.values
        pieces = [_Piece(number, self.plan, values[self.places[number]]) for number in numbers]
        return workers.each(_judge_piece, pieces, in_order=False)

    def note(self, chunk: RegimeChunk) -> None:
        """Enter the verdicts of a chunk."""
        for whole, part in zip(self.verdicts, chunk.verdicts, strict=True):
            whole[self.places[chunk.number]] = part

    def check(self, workers: Workers) -> None:
        """Classify the motions of random cells with the exact flow, from where they have come to."""
        regimes, periods = self.verdicts.regimes.ravel(), self.verdicts.periods.ravel()
        decided = np.flatnonzero(np.isin(regimes, (Regime.PERIODIC, Regime.QUASI_PERIODIC, Regime.CHAOTIC)))
        random = np.random.default_rng(self.options.seed)
        chosen = np.sort(random.permutation(decided)[: self.options.check])
        systems = [self.plan.system_at(pair) for pair in self.plan.values.reshape(-1, 2)[chosen]]
        states = self.verdicts.states.reshape(len(regimes), -1)[chosen]
        jobs = [list(zip(systems, states, strict=True))[k : k + _CHECKED] for k in range(0, len(chosen), _CHECKED)]
        exact = [found for _, some in workers.each(_classify_some, jobs) for found in some]
        mine = zip(regimes[chosen].tolist(), periods[chosen].tolist(), strict=True)
        both = zip(systems, mine, exact, strict=True)
        sentences = [self._difference(system, *words) for system, *words in both if words[0] != words[1]]
        self._checked = RegimeCheck(len(chosen), tuple(sentences))

    def found(self, *, complete: bool) -> Regimes:
        """The map, as far as it has come."""
        cells = self.verdicts.regimes.size
        undecided = int(np.sum(self.verdicts.regimes == Regime.UNDECIDED))
        notes: tuple[str, ...] = ()
        if not complete:
            done = sum(self.places[number][0].size for number in self.chunks)
            notes = (f"stopped when {done} of {cells} cells were done",)
        elif undecided:
            notes = (f"{undecided} of {cells} cells are undecided: locked to long periods, or weakly chaotic",)
        plan, how = self.plan, (self._checked, self.error, complete, notes)
        return Regimes(plan.system, *plan.names, plan.within, *self.verdicts, *how)

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
