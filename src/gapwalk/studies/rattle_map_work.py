"""The work on a map of rattle: chunks of cells by the batch integrator, then the exact borders."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import chosen_gaps, judge_gaps
from gapwalk.answers.rattle_map import RattleMap, borders, exact_gaps
from gapwalk.attractors.box import centres
from gapwalk.attractors.many_motions import finite_rows
from gapwalk.bifurcation.loci import Locus
from gapwalk.model.system import System
from gapwalk.orbit.find import initial_state
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part
from gapwalk.studies.cell_work import CellFinding, CellWork, check_until_right
from gapwalk.studies.study_kind import Rows
from gapwalk.summary import SummaryParts, summarizes

if TYPE_CHECKING:
    from gapwalk.studies.rattle_study import RattleStudy

CHUNK = 512
"""Cells in a chunk."""
_SECTIONS = 3  # values of the second parameter at which points of borders are sought


@dataclass(frozen=True, eq=False)
class RattleChunk:
    """The motions in one chunk of cells."""

    number: int  #: Number of the chunk.
    #: codes, periods, peaks, states: What the gaps do; see `gapwalk.answers.gap_states.GapVerdicts`.
    codes: NDArray[np.int_]
    periods: NDArray[np.int_]
    peaks: NDArray[np.float64]
    states: NDArray[np.float64]
    error: float  #: Error of the batch integrator.


@dataclass(frozen=True)
class RattleMapFinding(CellFinding):
    """A map of rattle so far."""

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the shares of cells, and the borders."""
        return () if self.map is None else self.map.summary(notes=False)

    def map_document(self, points: bool) -> dict[str, Any]:
        """Return the map as JSON values; with all cells if wanted."""
        found: RattleMap = self.map
        document: dict[str, Any] = {
            "plane": [found.first, found.second],
            "within": [list(ends) for ends in found.within],
            "resolution": list(found.resolution),
            "cells": {gap: found.cells(gap) for gap in found.gaps},
            "borders": [
                {"kind": str(locus.kind), "points": locus.values.tolist() if points else len(locus.points)}
                for locus in found.loci
            ],
            "check": {"checked": found.checked, "different": list(found.different)},
        }
        if points:
            document["states"] = {gap: found.codes[..., k].tolist() for k, gap in enumerate(found.gaps)}
            document["periods"] = found.periods.tolist()
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of the record."""
        return {} if self.map is None else self.map.tables()


class RattleMapWork(CellWork):
    """Computation of the states of gaps at all cells of a map, and of its borders."""

    chunk_part = Part("cells", RattleChunk, numbered=True)
    whole_part = Part("rattle-map", RattleMap)
    found_as = RattleMapFinding

    def __init__(self, system: System, asked: RattleStudy) -> None:
        assert asked.second is not None
        super().__init__(asked.resolution)
        self.system, self.asked, self.names = system, asked, (asked.parameter, asked.second.parameter)
        self.within = (asked.ends, asked.second.ends)
        self.gaps = chosen_gaps(system, asked.gaps)
        for first in asked.ends:
            for second in asked.second.ends:
                system.at(dict(zip(self.names, (first, second), strict=True)))  # refuses what no system can have
        self.start = initial_state(system, asked.start)
        across, up = (centres(ends, count) for ends, count in zip(self.within, asked.resolution, strict=True))
        # cells side by side have about the same first parameter, mostly the speed: the lowest sets the steps of all
        self.values = np.stack(np.meshgrid(across, up, indexing="ij"), axis=-1).reshape(-1, 2)
        count, kinds = len(self.values), len(self.gaps)
        self._codes = np.full((count, kinds), -2)
        self._periods = np.zeros(count, dtype=int)
        self._peaks = np.full((count, kinds), np.nan)
        self._states = np.full((count, len(self.start)), np.nan)
        self._loci: tuple[Locus, ...] = ()
        self._notes: tuple[str, ...] = ()
        self._checked, self._different = 0, ()

    @property
    def total(self) -> int:
        """Number of chunks."""
        return -(-len(self.values) // CHUNK)

    def follow(self, workers: Workers, numbers: list[int]) -> Iterable[tuple[int, RattleChunk]]:
        """Judge the cells of some chunks."""
        pieces = [(number, self.values[number * CHUNK : (number + 1) * CHUNK]) for number in numbers]
        patience = self.asked.sweep.patience
        judge_one = partial(_judge_piece, self.system, self.names, self.start, self.gaps, patience)
        return workers.each(judge_one, pieces, in_order=False)

    def note(self, chunk: RattleChunk) -> None:
        """Enter the verdicts of a chunk."""
        place = slice(chunk.number * CHUNK, chunk.number * CHUNK + len(chunk.periods))
        self._codes[place], self._periods[place] = chunk.codes, chunk.periods
        self._peaks[place], self._states[place] = chunk.peaks, chunk.states

    def check(self, workers: Workers) -> None:
        """Follow the borders, and watch the gaps of cells with the exact flow, until no further cell is wrong."""
        asked, (low, high) = self.asked, self.within[1]
        own = self.system[self.names[1]]
        sections = [*np.linspace(low, high, _SECTIONS + 2)[1:-1].tolist()]
        sections = [own, *sections] if low < own < high else sections
        loci, notes = borders(self.system, self.names, self.within, self.gaps, asked.start, asked.sweep, sections)
        self._loci, self._notes = tuple(loci), tuple(notes)
        look = partial(_look, self.system, self.names, self.gaps, asked.sweep.patience)
        sentences: dict[int, str] = {}

        def find_wrong(chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
            states = np.where(finite_rows(self._states[chosen])[:, None], self._states[chosen], self.start)
            jobs = list(zip(self.values[chosen], states, self._codes[chosen].tolist(), strict=True))
            is_wrong = np.zeros(len(chosen), dtype=bool)
            for k, (codes, text) in workers.each(look, jobs, in_order=False):
                if text:
                    where = zip(self.names, self.values[chosen[k]].tolist(), strict=True)
                    sentences[chosen[k]] = f"at {', '.join(f'{name} = {value:.6g}' for name, value in where)}: {text}"
                    is_wrong[k], self._codes[chosen[k]], self._peaks[chosen[k]] = True, codes, np.nan
            return is_wrong

        columns, rows = self.resolution
        kinds = np.column_stack((self._codes, self._periods > 0)).reshape(columns, rows, -1)
        may = np.ones((columns, rows), dtype=bool)
        self._checked = check_until_right(kinds, may, ~may, asked.check, asked.seed, find_wrong)
        self._different = tuple(sentences[cell] for cell in sorted(sentences))

    def found(self, *, complete: bool) -> RattleMap:
        """Return the map so far."""
        columns, rows = self.resolution

        def cells(values: NDArray[Any]) -> NDArray[Any]:
            return np.swapaxes(values.reshape(columns, rows, *values.shape[1:]), 0, 1).copy()

        notes = self._notes
        if not complete:
            done = int((self._codes[:, 0] != -2).sum())
            notes = (*notes, f"stopped when {done} of {len(self.values)} cells were done")
        arrays = cells(self._codes), cells(self._periods), cells(self._peaks)
        checks = self._checked, self._different, self.error, complete, notes
        return RattleMap(self.system, *self.names, self.within, self.gaps, *arrays, self._loci, *checks)


def _judge_piece(
    system: System,
    names: tuple[str, str],
    start: NDArray[np.float64],
    gaps: tuple[str, ...],
    patience: int,
    piece: tuple[int, NDArray[np.float64]],
) -> RattleChunk:
    """Judge a chunk of cells, whose values have the shape (cells, 2)."""
    number, values = piece
    states = np.tile(start, (len(values), 1))
    found = judge_gaps(system, states, dict(zip(names, values.T, strict=True)), gaps, patience)
    return RattleChunk(number, *found[:4], found.error)


def _look(
    system: System,
    names: tuple[str, str],
    gaps: tuple[str, ...],
    patience: int,
    job: tuple[NDArray[np.float64], NDArray[np.float64], list[int]],
) -> tuple[list[int], str]:
    """Return the codes of the gaps of a cell by the exact flow, and how they differ."""
    values, state, codes = job
    return exact_gaps(system.at(dict(zip(names, values.tolist(), strict=True))), state, gaps, codes, patience)
