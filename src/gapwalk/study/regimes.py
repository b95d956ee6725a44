"""The regime map: which kind of motion there is at each cell of a plane of two parameters, and how it rattles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.box import centres
from gapwalk.attractor.doubt import Finding, settle_doubts, take_another_look
from gapwalk.attractor.judge import RegimeOptions, Verdicts, judge
from gapwalk.attractor.mass_swarm import swarm_of
from gapwalk.attractor.regime import Regime, regime_word
from gapwalk.attractor.regimes import RegimeCheck, Regimes
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.find import initial_state
from gapwalk.study.grid import check_parameters, check_resolution
from gapwalk.study.workers import Workers, workers

_CHUNK = 2048  # cells; their results depend neither on the number of workers nor on what else is asked for
_ROWS = 64  # rows of a chunk whose states are carried over from column to column
_CHECKED = 4  # cells of a chunk that are checked


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
        How regimes are told apart.
    check
        Cells that are settled and classified again with the exact flow.
    seed
        Of the choice of those cells.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    carry: Carry = Carry.NO
    judging: RegimeOptions = field(default_factory=RegimeOptions)
    check: int = 64
    seed: int = 0
    workers: int | None = None

    def __post_init__(self) -> None:
        if self.carry not in list(Carry):
            raise ModelError(f'carry is {self.carry!r}; write "no", "up" or "down"')
        object.__setattr__(self, "carry", Carry(self.carry))
        for name in ("check", "seed"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 0")


Report = Callable[[int, int], None]
"""Called with the number of cells done so far, and of all."""


def regimes(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    start: str | Sequence[float] = "rest",
    options: RegimeMapOptions | None = None,
    report: Report | None = None,
) -> Regimes:
    """The regimes in the plane of two parameters: period, quasi-periodic, chaotic; peak force and impacts.

    At each cell a motion is followed by the fast flow until it is known what it is; a sample of the cells is
    classified again with the exact flow, from where the motion has come to. Ctrl-C ends the work and keeps what
    there is.

    Parameters
    ----------
    system
        The system.
    plane
        The two parameters and their ranges, the one across first: ``{"frequency": (0.2, 1.2), "mean.q1": (0, 1)}``.
    resolution
        Cells along each axis, or (columns, rows).
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        How the map is made; its ``carry`` says where motions start.
    report
        Called when a part is done.

    Raises
    ------
    ModelError
        For parameters, ranges or a start that make no sense.
    """
    options = options or RegimeMapOptions()
    (first, second), within = check_parameters(system, plane)
    columns, rows = check_resolution(resolution)
    job = _Job(system, (first, second), within, (columns, rows), initial_state(system, start), options, report)
    with workers(options.workers) as hands:
        job.run(hands)
    return job.record()


@dataclass(frozen=True)
class _Piece:
    """Some of the cells: a row of states to start from, or one for each column if they are carried over."""

    system: System
    names: tuple[str, str]
    values: NDArray[np.float64]  # shape (columns in turn, cells side by side, 2)
    start: NDArray[np.float64]
    judging: RegimeOptions


class _Job:
    """Makes one map."""

    def __init__(self, system, names, within, resolution, start, options: RegimeMapOptions, report) -> None:
        self.system, self.names, self.within, self.options, self.report = system, names, within, options, report
        columns, rows = resolution
        across, up = centres(within[0], columns), centres(within[1], rows)
        self.values = np.stack(np.meshgrid(across, up), axis=-1)  # shape (rows, columns, 2)
        self.start = start
        contacts = len(system.structure.contacts) if options.judging.forces else 0
        self.found = Verdicts(
            np.full((rows, columns), int(Regime.UNDECIDED)),
            np.zeros((rows, columns), dtype=int),
            np.full((rows, columns), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, contacts), np.nan),
            np.full((rows, columns, len(start)), np.nan),
        )
        self.done, self.error = 0, 0.0
        self.check = RegimeCheck()
        self.complete = False

    def run(self, hands: Workers) -> None:
        """Judge all cells, then check some; Ctrl-C ends it."""
        places = self._places()
        pieces = [
            _Piece(self.system, self.names, self.values[place], self.start, self.options.judging) for place in places
        ]

        def accept(index: int, result: tuple[Verdicts, float]) -> None:
            verdicts, error = result
            self.error = max(self.error, error)
            for whole, part in zip(self.found, verdicts, strict=True):
                whole[places[index]] = part
            self.done += places[index][0].size
            if self.report is not None:
                self.report(self.done, self.found.regimes.size)

        try:
            hands.run(_judge_piece, pieces, accept)
            self._check_some(hands)
            self.complete = True
        except KeyboardInterrupt:
            pass

    def record(self) -> Regimes:
        notes = []
        total = self.found.regimes.size
        if not self.complete:
            notes.append(f"stopped when {self.done} of {total} cells were done")
        undecided = int(np.sum(self.found.regimes == Regime.UNDECIDED))
        if undecided and self.complete:
            notes.append(f"{undecided} of {total} cells are undecided: locked to long periods, or weakly chaotic")
        return Regimes(
            self.system, *self.names, self.within, *self.found, self.check, self.error, self.complete, tuple(notes)
        )

    def _places(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """For each piece the rows and columns of its cells, shape (columns in turn, cells side by side)."""
        rows, columns = self.found.regimes.shape
        grid = np.mgrid[:rows, :columns]
        if self.options.carry is Carry.NO:
            # side by side go systems of about the same frequency: the lowest of them sets the steps of all
            axis = 1 if self.names[1] != "frequency" else 0
            order = np.argsort(grid[axis], axis=None, kind="stable")
            cells = grid.reshape(2, 1, -1)[..., order]
            return [tuple(cells[..., k : k + _CHUNK]) for k in range(0, rows * columns, _CHUNK)]
        turns = grid.transpose(0, 2, 1)[:, :: -1 if self.options.carry is Carry.DOWN else 1]
        return [tuple(turns[..., k : k + _ROWS]) for k in range(0, rows, _ROWS)]

    def _check_some(self, hands: Workers) -> None:
        """Classify the motions of random cells with the exact flow."""
        regimes, periods = self.found.regimes, self.found.periods
        decided = np.flatnonzero(np.isin(regimes, (Regime.PERIODIC, Regime.QUASI_PERIODIC, Regime.CHAOTIC)))
        random = np.random.default_rng(self.options.seed)
        chosen = np.sort(random.permutation(decided)[: self.options.check])
        systems = [_system_at(self.system, self.names, self.values.reshape(-1, 2), cell) for cell in chosen]
        states = self.found.states.reshape(regimes.size, -1)[chosen]
        jobs = [list(zip(systems, states, strict=True))[k : k + _CHECKED] for k in range(0, len(chosen), _CHECKED)]
        words: list[Finding] = []
        hands.run(_classify_some, jobs, lambda index, found: words.extend(found))
        different = [
            f"at {self.names[0]} = {system[self.names[0]]:.6g}, {self.names[1]} = {system[self.names[1]]:.6g}: "
            f"{regime_word(*mine)}, but {regime_word(*exact)} by the exact flow"
            for system, mine, exact in zip(
                systems, zip(regimes.ravel()[chosen], periods.ravel()[chosen], strict=True), words, strict=True
            )
            if mine != exact
        ]
        self.check = RegimeCheck(len(chosen), tuple(different))


def _judge_piece(piece: _Piece) -> tuple[Verdicts, float]:
    """Judge cells turn by turn, each from where those of the turn before came to; and the error of the flow."""
    states = np.tile(piece.start, (piece.values.shape[1], 1))
    turns, error = [], 0.0
    for values in piece.values:
        by_name = dict(zip(piece.names, values.T, strict=True))
        frequencies = by_name.get("frequency", np.full(len(values), piece.system.frequency))
        swarm = swarm_of(piece.system, states, by_name)
        verdicts = judge(swarm, states, frequencies, piece.judging)
        turns.append(settle_doubts(verdicts, partial(_system_at, piece.system, piece.names, values)))
        error = max(error, swarm.error)
        finite = np.isfinite(verdicts.states).all(axis=1, keepdims=True)
        states = np.where(finite, verdicts.states, piece.start)
    return Verdicts(*(np.array(parts) for parts in zip(*turns, strict=True))), error


def _system_at(system: System, names: tuple[str, str], values: NDArray[np.float64], cell: int) -> System:
    return system.at(dict(zip(names, values[cell].tolist(), strict=True)))


def _classify_some(jobs: list[tuple[System, NDArray[np.float64]]]) -> list[Finding]:
    return [take_another_look(system, state) for system, state in jobs]
