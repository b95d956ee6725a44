"""Integrators of a program, and functions of a state, by the compiled kernel."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from enum import Enum
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gapwalk.machine_code import engine_of_object, kept, object_of
from gapwalk.taylor import header
from gapwalk.taylor.header import LANES, LENGTH
from gapwalk.taylor.program import Program
from gapwalk.taylor.symbols import ZERO, Symbol

Array = NDArray[np.float64]


_nothing = np.zeros(1)
_NOTHING = _nothing.ctypes.data  # where a function that returns nothing writes it


@cache
def kernel() -> tuple[Callable[..., int], Callable[..., int]]:
    """Return the two functions of the kernel: machine code that is kept, or is compiled now, which takes seconds."""
    from importlib.metadata import version  # only now: reading a model file needs no kernel

    files = (Path(__file__).with_name(f"{name}.py") for name in ("kernel", "header"))
    source = b"".join([*(file.read_bytes() for file in files), version("numba").encode()])
    parts = kept("taylor", source, _compile)
    name = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
    first, second = (name(engine_of_object(content).get_function_address(function)) for function, content in parts)
    return first, second


def _compile() -> list[tuple[str, bytes]]:
    from gapwalk.taylor.kernel import compiled

    return [(name, object_of(text)) for name, text in compiled().values()]


class Outcome(Enum):
    """Why a propagation ended."""

    REACHED = 0
    STOPPED = 1
    MANY_STEPS = 2
    NOT_FINITE = 3


class Integrator:
    """A motion that is integrated from event to event.

    Attributes
    ----------
    state, pars
        The state with its columns, and the run-time parameters; both may be changed between calls.
    time
        The angle.
    """

    def __init__(
        self, program: Program, answers: Sequence[Callable[[int], bool]], turn: Callable[..., None] | None
    ) -> None:
        self._program, self._advance = program, kernel()[0]
        self._answers, self._turn = answers, turn
        self.state, self.pars = np.zeros(program.whole), np.zeros(program.parameters)
        memory = np.zeros(program.memory + LANES)
        self._memory = memory[-(memory.ctypes.data // memory.itemsize) % LANES :]  # from a cache line on
        self._io = np.zeros(header.IO)
        self._turns = np.zeros((program.most_turns, 2 + program.size))
        self._table = np.zeros(9, dtype=np.int64)
        self._places = [program.integers, program.numbers, self._memory, self.state, self.pars, self._io]
        self._table[:6] = [each.ctypes.data for each in self._places]
        self._table[8] = self._turns.ctypes.data
        self._io[header.IO_MOST_TURNS] = len(self._turns)
        self._address = self._table.ctypes.data
        self.reset_cooldowns()

    @property
    def time(self) -> float:
        """The angle."""
        return self._io.item(header.IO_TIME)

    @time.setter
    def time(self, value: float) -> None:
        self._io[header.IO_TIME], self._io[header.IO_REST] = value, 0.0

    def reset_cooldowns(self) -> None:
        """Let all events happen at once again."""
        self._memory[self._program.cool] = -math.inf
        self._io[header.IO_TURNS], self._is_full = 0.0, False

    def turns(self) -> Array | None:
        """Return number, time and state of all turns since all events may happen, in rows; None if they are too many.

        For an integrator that has no function to call at a turn.
        """
        return None if self._is_full else self._turns[: int(self._io[header.IO_TURNS])].copy()

    def series(self) -> Array:
        """Return the Taylor series of the state, shape (size, orders), without a step; not finite: the time is NaN."""
        self._io[header.IO_ONLY] = 1.0
        self._advance(_NOTHING, None, self._address)
        self._io[header.IO_ONLY] = 0.0
        if self._io[header.IO_STATUS] != header.REACHED:
            self.time = math.nan
        first, size = self._program.series, self._program.size
        return self._memory[first : first + size * LENGTH].reshape(size, LENGTH).copy()

    def propagate(
        self, stop: float, max_steps: int, longest: float, grid: Array | None = None
    ) -> tuple[Outcome, int, Array]:
        """Integrate to an angle; return the outcome, the steps taken, and the states at the angles of a grid."""
        io, total = self._io, 0
        io[header.IO_STOP], io[header.IO_LONGEST], io[header.IO_STEPS] = stop, longest, max_steps
        rows = np.empty((0 if grid is None else len(grid), len(self.state)))
        if grid is not None and len(grid):
            grid = np.ascontiguousarray(grid)
            self._table[6], self._table[7] = grid.ctypes.data, rows.ctypes.data
        io[header.IO_GRID], io[header.IO_GRID_COUNT] = 0.0, len(rows)
        outcome = Outcome.REACHED
        while True:
            self._advance(_NOTHING, None, self._address)
            total += int(io[header.IO_TAKEN])
            if self._turn is not None and io[header.IO_TURNS]:
                for turn in self._turns[: int(io[header.IO_TURNS])].tolist():
                    self._turn(int(turn[0]), turn[1], turn[2:])
                io[header.IO_TURNS] = 0.0
            status = io.item(header.IO_STATUS)
            if status == header.EVENT:
                if not self._answers[int(io[header.IO_EVENT])](int(io[header.IO_DIRECTION])):
                    outcome = Outcome.STOPPED
                    break
                if io[header.IO_STEPS] > 0:
                    continue
                outcome = Outcome.MANY_STEPS
            elif status == header.NOT_FINITE:
                outcome = Outcome.NOT_FINITE
            elif status == header.MANY_STEPS:
                outcome = Outcome.MANY_STEPS
            elif status == header.MANY_TURNS:
                self._is_full = io[header.IO_TURNS] > 0.0
                io[header.IO_TURNS] = 0.0
                continue
            break
        if outcome is Outcome.REACHED:  # angles beside the last one by rounding
            rows[int(io[header.IO_GRID]) :] = self.state
            return outcome, total, rows
        return outcome, total, rows[: int(io[header.IO_GRID])]


class Evaluator:
    """Functions of some variables, of one state or of many; several threads may call one at the same time."""

    def __init__(self, functions: Sequence[Symbol], variables: Sequence[Symbol]) -> None:
        self._program = Program(0, [(each, ZERO) for each in variables], outputs=functions)
        self._count, self._width, self._evaluate = len(functions), len(variables), kernel()[1]
        self._idle: list[_Room] = []  # for one state, as events ask it thousands of times

    def __call__(self, given: Array) -> Array:
        """Return the values, shape (functions,) or (functions, states), for variables of shape (variables, states)."""
        count = 1 if given.ndim == 1 else given.shape[1]
        try:
            room = self._idle.pop() if count == 1 else _Room(self._program, count, self._width, self._count)
        except IndexError:  # another thread may have the last one
            room = _Room(self._program, count, self._width, self._count)
        room.given[:] = given if given.ndim == 2 else given[:, None]
        self._evaluate(_NOTHING, None, room.address)
        found = room.found.copy() if given.ndim == 2 else room.found[:, 0].copy()
        if count == 1:
            self._idle.append(room)
        return found


class _Room:
    """The arrays of one call of a function."""

    def __init__(self, program: Program, count: int, variables: int, functions: int) -> None:
        self._memory, self._io, self._program = np.zeros(program.memory), np.zeros(header.IO), program
        self.given, self.found = np.empty((variables, count)), np.empty((functions, count))
        self._io[header.IO_GRID_COUNT] = count
        self._table = np.zeros(9, dtype=np.int64)
        self._table[:4] = [each.ctypes.data for each in (program.integers, program.numbers, self._memory, self.given)]
        self._table[4:7], self._table[7] = self._io.ctypes.data, self.found.ctypes.data
        self.address = self._table.ctypes.data
