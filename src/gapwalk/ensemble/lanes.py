"""Many motions at once by equal steps without events: for statistics, labels and starts, not for orbits.

The classical Runge-Kutta method advances eight motions in a register (`gapwalk.ensemble.lane_code`). Contact forces are
continuous, so that a step over a breakpoint has an error of second order of the step; a step turns the fastest
vibration by 0.4. Friction in series with a spring is exact but for where it turns; friction that sticks rigidly has a
stiff spring with a damper in place of stick. Rigid stops need the exact flow. Half the step tells how right it is.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.batch_flow import LIMIT, fastest
from gapwalk.ensemble.kernel_source import Linear
from gapwalk.ensemble.lane_code import LABELS, WIDTH, Code, Form, code_of, refuse
from gapwalk.errors import UnfitError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

TURN = 0.4
"""Angle in radians by which a step turns the fastest vibration."""
_FEW = 3  # coordinates up to which the exact flow is fast
_ROUNDING = 1e-13  # relative difference of two products of numbers that are equal
_LEAST = 40  # fewest steps in a period of the highest order
DAMPED = 0.7
"""Damping of the spring that stands for stick, as a share of its critical damping."""


class Lanes:
    """Motions of systems of one structure, from theta = 0 on, each with its own numbers.

    Shapes: `coefficients` (count, number of coefficients), `states` (count, state_size), `signals` (count of signals, n
    + 1 + 2 orders), by the accelerations, 1, and the cosines and sines of all orders.
    """

    def __init__(
        self,
        structure: Structure,
        coefficients: NDArray[np.float64],
        states: NDArray[np.float64],
        *,
        kinds: Sequence[str] = LABELS,
        signals: NDArray[np.float64] | None = None,
        pattern: NDArray[np.bool_] | None = None,
        finer: float = 1.0,
        steps: int = 0,
        **more: bool,
    ) -> None:
        self.structure, self.layout, self.finer = structure, layout_of(structure), finer
        self._pattern = (coefficients != 0.0).any(axis=0) if pattern is None else pattern
        self._signals = np.zeros((0, 0)) if signals is None else _chained(signals)
        asked = self._pattern.tobytes(), tuple((row != 0.0).tobytes() for row in self._signals), tuple(kinds)
        self.code: Code = code_of(Form(structure, *asked, **more))
        for slots in self.layout.contacts:
            _refuse_static(slots, coefficients)
        self.count = len(states)
        blocks, n = -(-self.count // WIDTH), self.layout.structure.size
        self._numbers = aligned((blocks, 1 + len(self.code.rows), WIDTH))
        for key, row in self.code.rows.items():
            if isinstance(key, tuple) and isinstance(key[0], int):
                self._numbers[:, row] = self._signals[key]
        slots = [(slot, row) for slot, row in self.code.rows.items() if isinstance(slot, int)]
        self._slots = np.array(slots, dtype=int).reshape(-1, 2).T  # of coefficients, with the rows of their numbers
        self._state = aligned((blocks, 2 * n + 2 * len(self.code.dry), WIDTH))
        self._scratch = aligned((4 * n, WIDTH))
        self._notes = aligned((blocks, max(len(self.code.notes), 1), WIDTH))
        self._kept = len(self.code.begin) - sum(kind == "side" for kind, _ in self.code.notes)  # notes that begin again
        arrays = self._numbers, self._state, self._notes
        places = [tuple(each[block].ctypes.data for each in arrays) for block in range(blocks)]
        self._places = [(numbers, state, self._scratch.ctypes.data, notes) for numbers, state, notes in places]
        self._steps, self._needed = np.full(blocks, steps), np.ones((blocks, WIDTH), dtype=int)
        self._coefficients, self._used = (
            np.zeros((blocks * WIDTH, len(self.layout))),
            np.zeros(blocks * WIDTH, dtype=bool),
        )
        self.turn = turn_of(structure)
        places = np.minimum(np.arange(blocks * WIDTH), self.count - 1)  # the last block is filled with copies
        self.put(np.arange(blocks * WIDTH), coefficients[places], states[places])
        self._used[self.count :] = False

    def put(self, lanes: NDArray[np.intp], coefficients: NDArray[np.float64], states: NDArray[np.float64]) -> None:
        """Give some lanes the numbers of a system, and a state at theta = 0."""
        self._coefficients[lanes] = coefficients
        keys = [each.tobytes() for each in coefficients]
        known = self.code.known_steps
        if new := {key: place for place, key in enumerate(keys) if key not in known}:
            found = steps_of(self.layout, coefficients[list(new.values())])
            known |= dict(zip(new, found.tolist(), strict=True))
        self._needed.reshape(-1)[lanes] = np.ceil([self.finer * known[key] for key in keys])
        self.restart(lanes, states)
        block, lane = np.divmod(lanes, WIDTH)
        from_, to = self._slots
        self._numbers[block[:, None], to, lane[:, None]] = coefficients[:, from_]
        for one in np.unique(block):
            self._set_steps(int(one))

    def restart(self, lanes: NDArray[np.intp], states: NDArray[np.float64]) -> None:
        """Give some lanes another state at theta = 0."""
        n, dry = self.layout.structure.size, self.code.dry
        rows = np.zeros((len(states), self._state.shape[1]))
        rows[:, : 2 * n] = states[:, : 2 * n]
        memories = [dry.index(index) for index in self.layout.structure.memories]
        rows[:, [2 * n + place for place in memories]] = states[:, 2 * n :]
        for place, index in enumerate(dry):
            slots = self.layout.contacts[index]
            rows[:, 2 * n + len(dry) + place] = self._start(slots, lanes, states)
        block, lane = np.divmod(lanes, WIDTH)
        self._state[block, :, lane] = rows
        self._notes[block, :, lane] = np.nan  # sides are not known
        self._used[lanes] = True

    def _start(self, slots: Any, lanes: NDArray[np.intp], states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the deflection of friction at theta = 0."""
        n, own = self.layout.structure.size, self._coefficients[lanes]
        moved = np.einsum("li,li->l", own[:, slots.deflection], states[:, :n])
        if slots.sway is None:
            return moved
        count = len(self.layout.orders)
        return moved + own[:, slots.sway[:count]].sum(axis=1)

    def _set_steps(self, block: int) -> None:
        # they never become fewer: a change of the steps looks like a change of the motions that are under way
        steps = max(even(int(self._needed[block].max())), int(self._steps[block]))
        self._steps[block] = steps
        rate = self._coefficients[block * WIDTH : (block + 1) * WIDTH, 0]
        self._numbers[block, 0] = PERIOD / steps * rate
        fast = TURN / self._numbers[block, 0]
        for index in self.code.dry:
            if ("spring", index) not in self.code.rows:
                continue
            slots, own = self.layout.contacts[index], self._coefficients[block * WIDTH : (block + 1) * WIDTH]
            inverse = np.einsum("li,li->l", own[:, slots.deflection], own[:, slots.force])
            self._numbers[block, self.code.rows["spring", index]] = fast**2 / inverse
            self._numbers[block, self.code.rows["damper", index]] = 2.0 * DAMPED * fast / inverse

    @property
    def states(self) -> NDArray[np.float64]:
        """The states at theta = 0, shape (count, state_size); without meaning for motions that have diverged."""
        n, dry = self.layout.structure.size, self.code.dry
        rows = [*range(2 * n), *(2 * n + dry.index(index) for index in self.layout.structure.memories)]
        return self._of(self._state[:, rows])

    @property
    def diverged(self) -> NDArray[np.bool_]:
        """Marks of the motions that have diverged, shape (count,)."""
        return ~(np.abs(self._of(self._state)).max(axis=1) < LIMIT)

    @property
    def steps(self) -> NDArray[np.intp]:
        """Steps in a period of each motion, shape (count,)."""
        return np.repeat(self._steps, WIDTH)[: self.count]

    @property
    def all_notes(self) -> NDArray[np.float64]:
        """All notes over the last period, shape (count, rows); their rows are `Code.notes`."""
        return self._of(self._notes)

    def idle(self, lane: int) -> None:
        """Leave a lane out, if its whole register is; otherwise it goes on as a copy."""
        self._used[lane] = False

    def note(self, kind: str) -> NDArray[np.float64]:
        """Return the notes of a kind over the last period, shape (count, contacts with stages, or the like)."""
        return self._of(self._notes[:, [row for (own, _), row in self.code.notes.items() if own == kind]])

    def _of(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return rows.transpose(0, 2, 1).reshape(-1, rows.shape[1])[: self.count].copy()  # of one block it is a view

    def advance(self) -> None:
        """Advance all motions by one forcing period, and take new notes."""
        self._notes[:, : self._kept] = self.code.begin[: self._kept, None]
        n = self.layout.structure.size
        for block in np.flatnonzero(self._used.reshape(-1, WIDTH).any(axis=1)).tolist():
            steps = int(self._steps[block])
            numbers, *others = self._places[block]
            self.code.advance(numbers, _table(self.layout.orders, steps).ctypes.data, *others, steps)
            if self.turn is not None and ("drift", self.turn) in self.code.notes:
                # the rotation as a whole returns to its mean within thousands of periods: it is put there
                drift = self._notes[block, self.code.notes["drift", self.turn]]
                self._state[block, n + self.turn] -= drift / steps


def prefers_lanes(system: System) -> bool:
    """Return True for trains of many parts: other integrators meet too many contacts, or need too many steps."""
    structure = system.structure
    if not isinstance(structure.assembly, TrainAssembly) or structure.equations.size <= _FEW:
        return False
    try:
        refuse(structure.equations)
        for slots in layout_of(structure).contacts:
            _refuse_static(slots, coefficients_of(system)[None])
    except UnfitError:
        return False
    return True


def _chained(signals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Append a column for each row, and write a row as a multiple of an earlier one with the rest, where that is short.

    The acceleration of an inertia is that of its neighbour and of the link between: two numbers in place of all.
    """
    found = np.hstack((signals, np.zeros((len(signals), len(signals)))))
    for k, row in enumerate(signals):
        for j, other in enumerate(signals[:k]):
            common = row * other != 0.0
            factor = np.median(row[common] / other[common]) if common.any() else 0.0
            rest = row - factor * other
            rest[np.abs(rest) <= _ROUNDING * np.abs(row)] = 0.0
            if np.count_nonzero(rest) + 1 < np.count_nonzero(found[k]):
                found[k, : len(row)], found[k, len(row) :] = rest, factor * (np.arange(len(signals)) == j)
    return found


def _refuse_static(slots: ContactSlots, coefficients: NDArray[np.float64]) -> None:
    static = slots.numbers.get("static") if slots.form.law.is_dry else None
    if static is not None and np.any(coefficients[:, static] != 1.0):
        raise UnfitError(f"equal steps cannot carry {slots.form.name!r}: at rest its friction is larger than in slip")


def turn_of(structure: Structure) -> int | None:
    """Return the number of the coordinate that is the rotation of a train as a whole, if it has one."""
    assembly = structure.assembly
    return structure.size - 1 if isinstance(assembly, TrainAssembly) and assembly.form.has_turn else None


def steps_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the steps that a period of each system needs, shape (count,)."""
    linear = Linear(layout, coefficients)
    fast = fastest(linear, np.zeros((len(coefficients), layout.structure.state_size)))
    highest = max([*layout.orders, *(cycle.order for cycle in layout.cycles)], default=1)
    return np.maximum(PERIOD * linear.rate * fast / TURN, _LEAST * highest)


def even(steps: int) -> int:
    """Round steps up to one of eight numbers an octave, so that few tables over the angle are needed."""
    unit = max(1 << (max(steps, 8).bit_length() - 4), 1)
    return -(-steps // unit) * unit


@lru_cache(maxsize=32)
def _table(orders: tuple[int, ...], steps: int) -> NDArray[np.float64]:
    """Return cosines and sines of all orders, and the angle, at each half step, shape (2 steps + 1, columns)."""
    theta = np.arange(2 * steps + 1) * (0.5 * PERIOD / steps)
    angles = np.multiply.outer(theta, np.array(orders, dtype=float))
    return np.ascontiguousarray(np.column_stack((np.cos(angles), np.sin(angles), theta)), dtype=np.float64)


def aligned(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Make an array of zeros that begins at the boundary of a register."""
    size = int(np.prod(shape))
    whole = np.zeros(size + WIDTH)
    first = (-whole.ctypes.data % (8 * WIDTH)) // 8
    return whole[first : first + size].reshape(shape)
