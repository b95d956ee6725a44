"""The study of rattle: where gaps rattle over a range of a parameter, how badly, and what moves the ends."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from gapwalk.answers.gap_states import (
    BandEnd,
    Direction,
    SettledSweep,
    SlowSweepOptions,
    SweepBy,
    chosen_gaps,
    judge_gaps,
    other_motions,
    seldom,
    settled_sweep,
)
from gapwalk.answers.held_flank import QuietRanges, quiet_ranges
from gapwalk.answers.lane_sweep import (
    LanePiece,
    Started,
    is_many,
    joined,
    known_at,
    lasting,
    observed,
    other_sweeps,
    pieces_of,
    stages,
    stages_of,
    start_values,
    started_piece,
    sweep_piece,
)
from gapwalk.answers.rattle_bands import RattleBands, Severity, bands_of_sweeps, severities_of, worst_of
from gapwalk.answers.rattle_map import RattleMap, borders, exact_gaps
from gapwalk.attractors.basins import centres
from gapwalk.attractors.lane_settling import LaneMotion
from gapwalk.attractors.many_motions import finite_rows
from gapwalk.bifurcation.loci import Locus
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.orbit.find import initial_state
from gapwalk.parallel.workers import Workers
from gapwalk.pieces import tell
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.cell_work import CellWork, check_until_right
from gapwalk.studies.options import RangeStudy, Second
from gapwalk.studies.study_kind import INLINE, OPEN, Found, Job, Work
from gapwalk.studies.study_schema import Resolution, RestOrState, Surroundings, key_type

# The work on a map of rattle: chunks of cells by the batch integrator, then the exact borders.

CHUNK = 512
"""Cells in a chunk."""
_SEARCHED = 3  # values at which motions are sought that no sweep meets
_TOGETHER = 4  # of those values in one part of the work, where motions are settled at each step
_NO_BORDERS = (
    "no borders are followed where a train has so many parts: its cells are settled by equal steps; the same study "
    "without second gives the ends of quiet motions over {} exactly"
)
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


class RattleMapWork(CellWork):
    """Computation of the states of gaps at all cells of a map, and of its borders."""

    chunk_part = Part("cells", RattleChunk, numbered=True)
    whole_part: Any = Part("rattle-map", RattleMap)

    def __init__(self, system: System, asked: RattleStudy) -> None:
        assert asked.second is not None
        super().__init__(asked, asked.resolution)
        self.system, self.names = system, (asked.parameter, asked.second.parameter)
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
        if prefers_lanes(self.system):  # to follow one border takes longer than all cells
            self._notes = (_NO_BORDERS.format(self.names[0]),)
        else:
            loci, notes = borders(self.system, self.names, self.within, self.gaps, asked.start, asked.sweep, sections)
            self._loci, self._notes = tuple(loci), tuple(notes)
        look = partial(_look, self.system, self.names, self.gaps, asked.sweep.patience)
        sentences: dict[int, str] = {}

        def find_wrong(chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
            states = np.where(finite_rows(self._states[chosen])[:, None], self._states[chosen], self.start)
            jobs = list(zip(self.values[chosen], states, self._codes[chosen].tolist(), strict=True))
            is_wrong = np.zeros(len(chosen), dtype=bool)
            for number, (k, (codes, text)) in enumerate(workers.each(look, jobs, in_order=False), start=1):
                tell(number / len(jobs))
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
            left = "; borders and checks are missing" * (done == len(self.values))
            notes = (*notes, f"stopped when {done} of {len(self.values)} cells were done{left}")
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


def _are_gaps(gaps: tuple[str, ...] | None, info: ValidationInfo[Surroundings]) -> tuple[str, ...]:
    gaps = tuple(gaps or ())
    return chosen_gaps(info.context.system, gaps) if info.context.system else gaps


def listed(gaps: object) -> object:
    """Return one name as a list."""
    return [gaps] if isinstance(gaps, str) else gaps


GAPS = Annotated[
    list[str] | None,
    BeforeValidator(listed),
    Field(description='write the contacts that may rattle, as in gaps = ["mesh"]'),
    AfterValidator(_are_gaps),
]
"""Names of contacts with a gap in a table; one may be written without a list."""


@dataclass(frozen=True, eq=False)
class SweepWithSeverity:
    """One slow sweep, and the severity along it."""

    sweep: SettledSweep
    severities: tuple[Severity, ...]


@dataclass(frozen=True, eq=False)
class StartedPiece:
    """Motions to which random starts at some values lead."""

    started: tuple[Started, ...]


@dataclass(frozen=True, eq=False)
class OtherMotions:
    """Motions that no sweep meets, and the severity along them."""

    found: tuple[SweepWithSeverity, ...]
    notes: tuple[str, ...]


PIECE = Part("piece", LanePiece, numbered=True)
QUIET = Part("quiet", QuietRanges)
SWEEP = Part("sweep", SweepWithSeverity, numbered=True)
STARTS = Part("starts", StartedPiece, numbered=True)
OTHERS = Part("others", OtherMotions)


@dataclass(frozen=True)
class RattleStudy(RangeStudy):
    """Rattle bands: where gaps open and close over a range of a parameter, and how badly.

    The settled motion is followed for a slowly rising and a slowly falling parameter: as a branch where it is periodic,
    in samples elsewhere. The ends of the bands are grazing points or jumps of these branches, located exactly. With a
    second parameter, the states of the gaps are found at all cells of a plane, and the exact borders between them.

    Raises
    ------
    ModelError
        For an unknown parameter, an empty range, or contacts without a gap.
    FlowError
        If the first motion diverges.

    Examples
    --------
    >>> found = gw.ask.rattle_bands(system, "frequency", (1.1, 1.6), "stop", search=0)
    >>> [(round(band.low.value, 6), round(band.high.value, 6)) for band in found.of("stop", "rising")]
    [(1.1, 1.392109)]
    """

    kind: ClassVar[str] = "rattle"
    stored: ClassVar[tuple[Part, ...]] = (PIECE, QUIET, SWEEP, STARTS, OTHERS)
    answer: ClassVar[Part | None] = Part("bands", RattleBands)
    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to", "gaps")
    table_types: ClassVar[Mapping[str, Any]] = {"gaps": GAPS, "resolution": key_type(Resolution)}

    #: Names of contacts with a gap; one may be written without a list. By default all gaps, or, in a drive train, those
    #: of links that can part.
    gaps: Annotated[tuple[str, ...], OPEN] = ()
    start: RestOrState = "rest"  #: Start of the first transient: ``"rest"``, or a state at theta = 0.
    #: The vertical parameter of a map of rattle, and its range; None for bands over the first parameter alone.
    second: Second | None = None
    resolution: tuple[int, int] = (48, 32)  #: Columns and rows of cells of a map.
    sweep: Annotated[SlowSweepOptions, INLINE] = field(default_factory=SlowSweepOptions)  #: Options of the slow sweeps.
    #: Number of values of the parameter at which motions that the sweeps do not meet are sought; None: three, or 40
    #: where motions are settled at each step.
    search: Natural | None = None
    #: Number of random starts at each value of `search`, and at the value of the worst motion, to find the share of
    #: this motion.
    starts: Natural = 16
    seed: Natural = 0  #: Seed of these starts.
    #: Acceleration to which levels in dB refer, in rad/s^2 or non-dimensional.
    reference: Annotated[float, Gt(0)] = 1.0
    check: Natural = 32  #: Cells of a map whose gaps are observed again with the exact flow.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> RattleStudy:
        """Return the study of a table; its gaps are the usual ones if the table says nothing else."""
        return super().of_table({**values, "gaps": chosen_gaps(system, values.get("gaps") or ())}, system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> RattleStudy:
        """Return the study of a call."""
        low, high = values["begin"], values["end"]
        if not low < high:
            raise ModelError(
                f"the range of {values['parameter']} is from {low:g} to {high:g}; write the smaller value first"
            )
        return cls.of_table(values, system)

    @property
    def most_workers(self) -> int | None:
        """One for each direction of a curve; as many as there are pieces of sweeps by steps, or chunks of a map."""
        by = self.sweep.by
        curves = by is SweepBy.CURVES or (by is SweepBy.CHOSEN and len(self.gaps) == 1)
        return len(Direction) if self.second is None and curves else None

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        what = f"rattle of {', '.join(self.gaps)} over {self.range_words}"
        if self.second is None:
            return f"{what}, rising and falling"
        columns, rows = self.resolution
        return f"{what} and {self.second.words}, {columns} x {rows} cells"

    def work(self, system: System) -> Work:
        """Return the work on the bands, or on the map if there is a second parameter."""
        return Job(system, self) if self.second is None else RattleMapWork(system, self)

    def do(self, job: Job) -> Generator[Found]:
        """Sweep up and down, look for what no sweep meets, and find the bands."""
        if self.by_steps(job.system):
            about = job.system, self.parameter, self.ends, self.sweep.steps
            for pieces in stages(self.sweep.steps, job.known[PIECE]):
                yield from job.each(PIECE, partial(sweep_piece, *about), pieces)
            quiet = job.system, self.parameter, self.ends, self.gaps
            yield from job.once(QUIET, lambda: quiet_ranges(*quiet))
            for number, direction in enumerate(Direction):
                yield from job.once(SWEEP, lambda way=direction: self._joined(job, way), number)
            begin = partial(_started, job.system, self)
            yield from job.each(STARTS, begin, self._searched(job))
        else:
            yield from job.each(SWEEP, partial(_swept, job.system, self), dict(enumerate(Direction)))
        yield from job.once(OTHERS, lambda: self._others(job))
        yield job.end(self._bands(job, complete=True))

    def by_steps(self, system: System) -> bool:
        """Return True if motions are settled at each step of the sweeps, False if they are followed as curves."""
        by = self.sweep.by
        return by is SweepBy.STEPS or (by is SweepBy.CHOSEN and is_many(system))

    def total(self, job: Job) -> int:
        """Return the number of parts."""
        if not self.by_steps(job.system):
            return len(Direction) + 2
        values = start_values(self.ends, self.sweep.steps, self.search)
        pieces = len(pieces_of(self.sweep.steps, 0, {})) * stages_of(self.sweep.steps)
        return pieces + len(Direction) + -(-len(values) // _TOGETHER) + 3

    def so_far(self, job: Job) -> RattleBands | None:
        """Return the bands of the sweeps that are done; None before the first."""
        return self._bands(job, complete=False) if job.known[SWEEP] or job.known[PIECE] else None

    def _joined(self, job: Job, direction: Direction, *, whole: bool = True) -> SweepWithSeverity:
        about = job.system, self.parameter, self.ends, self.sweep.steps, direction
        first = job.known[SWEEP].get(0) if whole and direction is not Direction.UP else None
        other = first.sweep if first is not None else None
        return self.severity(job.system, joined(*about, job.all(PIECE), self.gaps, whole=whole, other=other))

    def _searched(self, job: Job) -> dict[int, list[tuple[LaneMotion, ...]]]:
        """Return the known motions at some values beside which random starts are followed, by the number of a part."""
        values = start_values(self.ends, self.sweep.steps, self.search) if self.starts else []
        known = known_at([each.sweep for each in job.all(SWEEP)], values)
        return {first // _TOGETHER: known[first : first + _TOGETHER] for first in range(0, len(known), _TOGETHER)}

    def severity(self, system: System, sweep: SettledSweep) -> SweepWithSeverity:
        """Return a sweep with the severity along it."""
        return SweepWithSeverity(sweep, tuple(severities_of(system, sweep, self.gaps, self.reference)))

    def _others(self, job: Job) -> OtherMotions:
        sweeps = [each.sweep for each in job.all(SWEEP)]
        if self.by_steps(job.system):
            started = [each for piece in job.all(STARTS) for each in piece.started]
            found, notes = other_sweeps(job.system, sweeps, self.sweep.steps, started)
        else:
            search = _SEARCHED if self.search is None else self.search
            found, notes = other_motions(job.system, sweeps, self.gaps, search, self.starts, self.seed, self.sweep)
        return OtherMotions(tuple(self.severity(job.system, each) for each in found), tuple(notes))

    def _bands(self, job: Job, *, complete: bool) -> RattleBands:
        both, others = job.all(SWEEP), job.one(OTHERS) or OtherMotions((), ())
        if not complete and job.known[PIECE]:
            ways = enumerate(Direction)
            both = [job.known[SWEEP].get(k) or self._joined(job, way, whole=False) for k, way in ways]
        sweeps = tuple(each.sweep for each in (*both, *others.found))
        rows = (row for each in (*both, *others.found) for row in each.severities)
        severities = tuple(sorted(rows, key=lambda row: row.value))
        starts = self.starts if complete else 0
        given = starts, self.seed, sweeps, dict[tuple[str, float], float]()
        worst = (worst_of(job.system, self.parameter, severities, gap, *given) for gap in self.gaps)
        notes = [*(note for sweep in sweeps for note in sweep.notes), *others.notes]
        told = *(seldom(sweeps, gap) for gap in self.gaps), observed(sweeps), lasting(job.system, sweeps)
        notes += [note for note in told if note is not None]
        if sampled := sum(sample.motion.orbit is None for sweep in sweeps for sample in sweep.samples):
            step = abs((self.end - self.begin) / self.sweep.steps)
            notes.append(
                f"at {sampled} values the settled motion did not become periodic within {self.sweep.patience} forcing "
                f"periods; between these values, {step:.4g} apart, nothing is known"
            )
        if not complete:
            notes.append(f"stopped when {self.done(job)} of {self.total(job)} parts of the study were done")
        known = tuple(each for each in worst if each is not None)
        bands, about = bands_of_sweeps(sweeps, self.gaps), (self.parameter, self.ends, self.gaps, self.reference)
        if (quiet := job.one(QUIET)) is not None:
            notes = [*quiet.notes, *notes]
        return RattleBands(job.system, *about, sweeps, bands, severities, known, complete, tuple(notes))

    def document(self, found: RattleBands | RattleMap, points: bool) -> dict[str, Any]:
        """Return the bands, or the map, as JSON values; with the severity along them, or all cells, if wanted."""
        if isinstance(found, RattleMap):
            return _map_document(found, points)
        document: dict[str, Any] = {
            "parameter": found.parameter,
            "within": list(found.within),
            "answers": {gap: found.sentence(gap) for gap in found.gaps},
            "bands": [
                {
                    "gap": band.gap,
                    "met": band.met,
                    "from": _end_document(band.low),
                    "to": _end_document(band.high),
                    "states": [str(state) for state in band.states],
                }
                for band in found.bands
            ],
            "worst": [plain(each) for each in found.worst],
        }
        if points:
            document["severity"] = [plain(row) for row in found.severities]
        return document


def _swept(system: System, asked: RattleStudy, direction: Direction) -> SweepWithSeverity:
    return asked.severity(
        system, settled_sweep(system, asked.parameter, asked.ends, direction, asked.start, asked.sweep)
    )


def _started(system: System, asked: RattleStudy, known: list[tuple[LaneMotion, ...]]) -> StartedPiece:
    return StartedPiece(started_piece(system, asked.parameter, asked.starts, asked.seed, known))


def _map_document(found: RattleMap, points: bool) -> dict[str, Any]:
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


def _end_document(end: BandEnd) -> dict[str, Any]:
    movers = [plain(each) for each in end.movers]
    return {"value": end.value, "kind": end.kind, "error": end.error, "movers": movers}
