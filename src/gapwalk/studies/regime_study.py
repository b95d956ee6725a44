"""The study of a regime map: which kind of motion there is at each cell of a plane of two parameters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import partial
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.basins import centres
from gapwalk.attractors.many_motions import enough, has_kernel, motions_of
from gapwalk.attractors.regimes import (
    Finding,
    Regime,
    RegimeCheck,
    RegimeOptions,
    Regimes,
    Verdicts,
    corrected,
    is_doubtful,
    judge,
    regime_word,
    settle_doubts,
)
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.orbit.find import initial_state
from gapwalk.parallel.workers import Workers, do_in_stages
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.cell_work import CellWork, check_until_right
from gapwalk.studies.options import ParameterRange, RangeStudy, Second
from gapwalk.studies.study_kind import INLINE
from gapwalk.studies.study_schema import (
    CELLS,
    PARAMETERS,
    Resolution,
    RestOrState,
    check_parameters,
    check_resolution,
    key_type,
)
from gapwalk.summary import SummaryParts, Table


class Carry(StrEnum):
    """Start of the motion at a cell."""

    NO = "no"
    """At each cell from the same state."""
    UP = "up"
    """From where the motion came to at the cell before it, with the first parameter rising."""
    DOWN = "down"
    """The same with the first parameter falling."""


@dataclass(frozen=True)
class RegimeStudy(RangeStudy):
    """A regime map: which kind of motion there is at each cell of a plane of two parameters.

    At the centre of each cell a motion is followed by the fast flow until its regime is known. Those that seem
    quasi-periodic are examined again with the exact flow, and a sample of all cells is classified by it, from the
    states that the motions have reached.

    Raises
    ------
    ModelError
        For parameters, ranges or a start that make no sense.

    Examples
    --------
    >>> found = gw.regimes(system, {"frequency": (0.6, 1.2), "stop.clearance": (0.8, 1.2)}, resolution=8)
    >>> found.at(0.8, 1.0)
    'period 2'
    """

    kind: ClassVar[str] = "regimes"
    answer: ClassVar[Part | None] = Part("regimes", Regimes)
    arguments: ClassVar[tuple[str, ...]] = ("plane", "resolution")
    not_asked: ClassVar[tuple[str, ...]] = ("parameter", "begin", "end", "second")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {"plane": PARAMETERS, "resolution": CELLS}
    table_types: ClassVar[Mapping[str, Any]] = {"resolution": key_type(Resolution)}

    second: Second = field(kw_only=True)  #: The vertical parameter, and its range.
    resolution: tuple[int, int] = (128, 128)  #: Columns and rows of cells.
    start: RestOrState = "rest"  #: ``"rest"``, or a state at theta = 0: positions, then velocities.
    #: Start of the motions. ``"no"``: all from the same state. ``"up"`` or ``"down"``: the state is carried over along
    #: the first parameter, as in a sweep.
    carry: Carry = Carry.NO
    #: Criteria that separate the regimes.
    judging: Annotated[RegimeOptions, INLINE] = field(default_factory=RegimeOptions)
    #: Cells that are settled and classified again with the exact flow: those of rare regimes, and of rare contacts,
    #: first. If one differs, it is corrected, and more are checked until none differs.
    check: Natural = 64
    seed: Natural = 0  #: Seed of the choice of the checked cells.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> RegimeStudy:
        """Return the study of a call."""
        (first, second), ((low, high), ends) = check_parameters(system, values["plane"])
        rest = {name: value for name, value in values.items() if name not in ("plane", "resolution")}
        rest["start"] = tuple(initial_state(system, values.get("start", "rest")).tolist())
        over = ParameterRange(second, *ends)
        return cls(first, low, high, second=over, resolution=check_resolution(values.get("resolution", 128)), **rest)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        columns, rows = self.resolution
        return f"regimes over {self.range_words} and {self.second.words}, {columns} x {rows} cells"

    def first_system(self, system: System) -> System:
        """Return the system at the first value of both parameters."""
        return super().first_system(system).at({self.second.parameter: self.second.begin})

    @property
    def names(self) -> tuple[str, str]:
        """The parameters of the plane, the horizontal one first."""
        return self.parameter, self.second.parameter

    def work(self, system: System) -> RegimeWork:
        """Return the work on the map."""
        return RegimeWork(system, self)

    def summary(self, found: Regimes) -> SummaryParts:
        """Return the share of cells of each regime, and the cells that were classified again."""
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
        yield from (f"  {text}" for text in found.check.different[:_LISTED])

    def document(self, found: Regimes, points: bool) -> dict[str, Any]:
        """Return the number of cells of each regime, and the results of the check; with all cells if wanted."""
        document: dict[str, Any] = {
            "plane": dict(zip((found.first, found.second), map(list, found.within), strict=True)),
            "resolution": list(found.resolution),
            "cells": found.cells,
            "check": asdict(found.check) | {"different": list(found.check.different)},
            "error": found.error,
        }
        if points:
            document["contacts"] = [contact.name for contact in found.system.structure.contacts]
            document |= {name: plain(getattr(found, name)) for name in _ARRAYS}
        return document


CHUNK = 1024
"""Cells in a chunk: one piece of work, and what a killed run loses at most."""

FEW = 64
"""Cells in a chunk of a system that only the exact flow can follow."""

ROWS = 64
"""Rows in a chunk whose states are carried over from column to column."""

_CHECKED = 4  # cells of a piece that are checked
_DOUBTED = 8  # doubtful cells of a piece: each takes some hundredths of a second, up to one second

Places = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Rows and columns of cells, shape (turns, cells side by side): each turn starts where the turn before came to."""


@dataclass(frozen=True)
class RegimeChunk:
    """The motions in one chunk of cells."""

    number: int  #: Number of the chunk.
    verdicts: Verdicts  #: Their regimes, in the order of the cells.
    error: float  #: Error of the fast flow; see `gapwalk.attractors.many_motions.ManyMotions`.


class _Doubts(NamedTuple):
    """Some doubtful cells of a chunk: their places in it, the values of both parameters, and the verdicts."""

    which: NDArray[np.intp]
    values: NDArray[np.float64]
    verdicts: Verdicts


_LISTED = 8  # differences that the summary lists
_LONGEST_LISTED = 12  # longest period that the summary lists separately
_ARRAYS = ("regimes", "periods", "exponents", "peak_force", "impacts", "states")


class RegimeWork(CellWork):
    """Computation of the regimes of all cells of a map."""

    asked: RegimeStudy
    chunk_part = Part("cells", RegimeChunk, numbered=True)

    def __init__(self, system: System, asked: RegimeStudy) -> None:
        super().__init__(asked, asked.resolution)
        self.system, self.within = system, (asked.ends, asked.second.ends)
        self.start = initial_state(system, asked.start)
        # the values of the parameters at the centres of the cells, shape (rows, columns, 2)
        axes = (centres(ends, count) for ends, count in zip(self.within, asked.resolution, strict=True))
        self.values = np.stack(np.meshgrid(*axes), axis=-1)
        self.places = self._places()
        shape = self.values.shape[:2]
        contacts = len(system.structure.contacts) if asked.judging.forces else 0
        self.verdicts = Verdicts(
            np.full(shape, int(Regime.UNDECIDED)),
            np.zeros(shape, dtype=int),
            np.full(shape, np.nan),
            np.full((*shape, contacts), np.nan),
            np.full((*shape, contacts), np.nan),
            np.full((*shape, len(self.start)), np.nan),
        )
        self._checked = RegimeCheck()

    @property
    def total(self) -> int:
        """Number of chunks."""
        return len(self.places)

    def follow(self, workers: Workers, numbers: list[int]) -> Iterator[tuple[int, RegimeChunk]]:
        """Judge the cells of some chunks; the doubtful ones of a chunk, which may take most of the time, in parts."""
        pieces = [(number, self.values[self.places[number]]) for number in numbers]
        judge_one = partial(_judge_piece, self.system, self.asked.names, self.start, self.asked.judging)
        settle_some = partial(_settle_some, self.system, self.asked.names)
        for _, chunk, doubts in do_in_stages(judge_one, pieces, _doubts_in, settle_some, workers):
            for which, verdicts in doubts:
                for whole, part in zip(chunk.verdicts, verdicts, strict=True):
                    whole[0, which] = part
            yield chunk.number, chunk

    def note(self, chunk: RegimeChunk) -> None:
        """Enter the verdicts of a chunk."""
        for whole, part in zip(self.verdicts, chunk.verdicts, strict=True):
            whole[self.places[chunk.number]] = part

    def check(self, workers: Workers) -> None:
        """Classify cells with the exact flow, from the states that their motions have reached, and correct them."""
        # All kinds of cells are among them; a wrong cell leads to more of them.
        known, names = self.verdicts, self.asked.names
        count = known.regimes.size
        numbers = (part.reshape(count, *part.shape[2:]) for part in known[2:])
        whole = Verdicts(known.regimes.reshape(count), known.periods.reshape(count), *numbers)
        # a motion that has diverged is followed from its start once more, if that is known
        gone = known.regimes == Regime.RUNAWAY
        may = (known.regimes != Regime.UNDECIDED) & (~gone | (self.asked.carry is Carry.NO))
        kinds = [known.regimes, known.periods, *np.moveaxis(known.impacts > 0.0, 2, 0)]
        sentences: dict[int, str] = {}

        def find_wrong(chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
            groups, is_wrong = _by_cost(whole.regimes[chosen]), np.zeros(len(chosen), dtype=bool)
            jobs = []
            for group in groups:
                cells = chosen[group]
                states = np.where(gone.reshape(-1, 1)[cells], self.start, whole.states[cells])
                mine = list(zip(whole.regimes[cells].tolist(), whole.periods[cells].tolist(), strict=True))
                jobs.append(list(zip(self.values.reshape(-1, 2)[cells], states, mine, strict=True)))
            look = partial(_correct_some, self.system, names, self.asked.judging.forces)
            for number, some in workers.each(look, jobs, in_order=False):
                for k, (pair, _, mine), exact in zip(groups[number], jobs[number], some, strict=True):
                    if exact is None:
                        continue
                    cell, found = chosen[k], (int(exact.regimes[0]), int(exact.periods[0]))
                    where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, pair, strict=True))
                    sentences[cell] = f"at {where}: {regime_word(*mine)}, but {regime_word(*found)} by the exact flow"
                    is_wrong[k] = found[0] != Regime.UNDECIDED
                    if is_wrong[k]:
                        for part, value in zip(whole, exact, strict=True):
                            part[cell] = value[0]
            return is_wrong

        wanders, how = known.regimes != Regime.PERIODIC, (self.asked.check, self.asked.seed)
        checked = check_until_right(np.stack(kinds, axis=-1), may, wanders, *how, find_wrong)
        self._checked = RegimeCheck(checked, tuple(sentences[cell] for cell in sorted(sentences)))

    def found(self, *, complete: bool) -> Regimes:
        """Return the map so far."""
        cells = self.verdicts.regimes.size
        undecided = int(np.sum(self.verdicts.regimes == Regime.UNDECIDED))
        notes: tuple[str, ...] = ()
        if not complete:
            done = sum(self.places[number][0].size for number in self.chunks)
            notes = (f"stopped when {done} of {cells} cells were done",)
        elif undecided:
            notes = (f"{undecided} of {cells} cells are undecided: locked to long periods, or weakly chaotic",)
        how = (self._checked, self.error, complete, notes)
        # impacts on a rigid stop have no finite force
        rigid = [form.law.rebounds for form in self.system.structure.contacts][: self.verdicts.peaks.shape[2]]
        verdicts = self.verdicts._replace(peaks=np.where(rigid, np.nan, self.verdicts.peaks))
        return Regimes(self.system, *self.asked.names, self.within, *verdicts, *how)

    def _places(self) -> list[Places]:
        """Return the cells in chunks: in any order where each starts from the same state, or line by line."""
        (columns, rows), carry = self.resolution, self.asked.carry
        grid = np.mgrid[:rows, :columns]
        if carry is Carry.NO:
            # side by side go systems of about the same frequency: the lowest of them sets the steps of all
            axis = 0 if self.asked.names[1] == self.system.structure.pace else 1
            order = np.argsort(grid[axis], axis=None, kind="stable")
            cells, size = grid.reshape(2, 1, -1)[..., order], CHUNK if has_kernel(self.system) else FEW
        else:
            cells, size = grid.transpose(0, 2, 1)[:, :: 1 if carry is Carry.UP else -1], ROWS
        starts = range(0, cells.shape[2], size)
        return [(cells[0, :, first : first + size], cells[1, :, first : first + size]) for first in starts]


def _system_at(system: System, names: tuple[str, str], pair: NDArray[np.float64]) -> System:
    return system.at(dict(zip(names, pair.tolist(), strict=True)))


def _judge_piece(
    system: System,
    names: tuple[str, str],
    start: NDArray[np.float64],
    judging: RegimeOptions,
    piece: tuple[int, NDArray[np.float64]],
) -> RegimeChunk:
    """Judge a chunk of cells, whose values have the shape (turns, cells side by side, 2)."""
    # Each turn starts from the states that the motions of the turn before have reached.
    number, turns = piece
    states = np.tile(start, (turns.shape[1], 1))
    found, error, structure = [], 0.0, system.structure
    for values in turns:
        by_name = dict(zip(names, values.T, strict=True))
        paces = by_name.get(structure.pace, np.full(len(values), system[structure.pace]))
        scales = np.array([system.state_scales(1.0, structure.frequency * pace) for pace in paces.tolist()])
        work = partial(judge, states=states, scales=scales, options=judging)
        verdicts, measured = enough(motions_of(system, states, by_name), work)
        if len(turns) > 1:  # the next turn starts from the states of this one
            verdicts = settle_doubts(verdicts, [partial(_system_at, system, names, pair) for pair in values])
        found.append(verdicts)
        error = max(error, measured)
        finite = np.isfinite(verdicts.states).all(axis=1, keepdims=True)
        states = np.where(finite, verdicts.states, start)
    return RegimeChunk(number, Verdicts(*(np.array(parts) for parts in zip(*found, strict=True))), error)


def _doubts_in(piece: tuple[int, NDArray[np.float64]], chunk: RegimeChunk) -> list[_Doubts]:
    """Return the cells of a chunk that are to be examined again, in parts; none if that has been done."""
    _, turns = piece
    if len(turns) > 1:
        return []
    verdicts = chunk.verdicts.some(0)
    which = np.flatnonzero(is_doubtful(verdicts))
    parts = [which[first : first + _DOUBTED] for first in range(0, len(which), _DOUBTED)]
    return [_Doubts(part, turns[0][part], verdicts.some(part)) for part in parts]


def _settle_some(system: System, names: tuple[str, str], doubts: _Doubts) -> tuple[NDArray[np.intp], Verdicts]:
    systems = [partial(_system_at, system, names, pair) for pair in doubts.values]
    return doubts.which, settle_doubts(doubts.verdicts, systems)


def _by_cost(regimes: NDArray[np.int_]) -> list[list[int]]:
    """Return cells to be checked in groups: first, alone, those of motions without period, which take longest."""
    is_periodic = regimes == Regime.PERIODIC
    quick = np.flatnonzero(is_periodic).tolist()
    groups = [quick[first : first + _CHECKED] for first in range(0, len(quick), _CHECKED)]
    return [*([k] for k in np.flatnonzero(~is_periodic).tolist()), *groups]


def _correct_some(
    system: System,
    names: tuple[str, str],
    forces: bool,
    jobs: list[tuple[NDArray[np.float64], NDArray[np.float64], Finding]],
) -> list[Verdicts | None]:
    return [corrected(_system_at(system, names, pair), state, mine, forces) for pair, state, mine in jobs]
