"""Many motions at once by equal steps without events: for statistics, labels and starts, not for orbits.

Eight motions are advanced in a register (`gapwalk.ensemble.lane_code`), twice in a step, each time from the last two
accelerations: deflections by Stoermer's formula, velocities by Adams and Moulton's. Contact forces are continuous, so a
step over a breakpoint has an error of second order, others of fourth. In a step, the phase of the fastest vibration
advances by 0.44 rad. Friction in series with a spring is exact except where it turns; rigid friction sticks by a stiff
spring with a damper. Rigid stops need the exact flow. A run with half the step shows the error.

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
from gapwalk.ensemble.lane_code import LABELS, ONE, WIDTH, Code, Form, code_of, refuse
from gapwalk.errors import UnfitError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

TURN = 0.44
"""Angle in radians by which a step turns the fastest vibration."""
_FEW = 3  # coordinates up to which the exact flow is fast
_ROUNDING = 1e-13  # relative difference of two products of numbers that are equal
_LEAST = 40  # fewest steps in a period of the highest order
DAMPED = 0.7
"""Damping of the spring that stands for stick, as a share of its critical damping."""


class Lanes:
    """Motions of systems of one structure, from theta = 0 on, each with its own numbers.

    Shapes: `coefficients` (count, number of coefficients), `states` (count, state_size), `signals` (count, number of
    signals, n + 1 + 2 orders), by the accelerations, 1, and the cosines and sines of all orders.
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
        self._pattern = self._pattern_of(coefficients) if pattern is None else pattern.astype(np.uint8)
        signals = np.zeros((len(states), 0, 0)) if signals is None else signals
        found, self._parents = _chained(signals[0])
        self._entries, self._kinds, self._more = found != 0.0, tuple(kinds), more
        for slots in self.layout.contacts:
            _refuse_static(slots, coefficients)
        self.count = len(states)
        blocks, n = -(-self.count // WIDTH), self.layout.structure.size
        self._signals = np.zeros((blocks * WIDTH, *signals.shape[1:]))
        self._compile(blocks)
        self._state = aligned((blocks, 2 * n + 2 * len(self.code.dry), WIDTH))
        #: Accelerations at the last two half steps; nan where there are none yet.
        self._slopes = aligned((blocks, 2 * n, WIDTH))
        self._notes = aligned((blocks, max(len(self.code.notes), 1), WIDTH))
        self._kept = len(self.code.begin) - sum(kind == "side" for kind, _ in self.code.notes)  # notes that begin again
        self._steps, self._needed = np.full(blocks, steps), np.ones((blocks, WIDTH), dtype=int)
        self._coefficients, self._used = (
            np.zeros((blocks * WIDTH, len(self.layout))),
            np.zeros(blocks * WIDTH, dtype=bool),
        )
        self.turn, memories = turn_of(structure), self.layout.structure.memories
        self._own = [*range(2 * n), *(2 * n + self.code.dry.index(index) for index in memories)]  # of a state
        turn = -1 if self.turn is None else self.turn
        drift = self.code.notes.get(("drift", turn))
        self._drift = None if drift is None else (n + turn, drift)
        places = np.minimum(np.arange(blocks * WIDTH), self.count - 1)  # the last block is filled with copies
        self.put(np.arange(blocks * WIDTH), coefficients[places], states[places], signals[places])
        self._used[self.count :] = False

    def _pattern_of(self, coefficients: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return what each coefficient is in all systems: always 0, always 1 as some of deflections are, or neither."""
        found, units = (coefficients != 0.0).any(axis=0).astype(np.uint8), np.zeros(len(self.layout), dtype=bool)
        for slots in self.layout.contacts:
            units[slots.deflection] = True
        found[units & (coefficients == 1.0).all(axis=0)] = ONE
        return found

    def _compile(self, blocks: int) -> None:
        """Compile the code for what may differ from 0, and make room for its numbers."""
        entries = tuple(row.tobytes() for row in self._entries)
        self.code: Code = code_of(Form(self.structure, self._pattern.tobytes(), entries, self._kinds, **self._more))
        self._numbers = aligned((blocks, 1 + len(self.code.rows), WIDTH))
        slots = [(slot, row) for slot, row in self.code.rows.items() if isinstance(slot, int)]
        self._slots = np.array(slots, dtype=int).reshape(-1, 2).T  # of coefficients, with the rows of their numbers
        keys = [
            (*key, row) for key, row in self.code.rows.items() if isinstance(key, tuple) and isinstance(key[0], int)
        ]
        self._places = np.array(keys, dtype=int).reshape(-1, 3).T  # of entries of signals, with the rows of theirs

    def put(
        self,
        lanes: NDArray[np.intp],
        coefficients: NDArray[np.float64],
        states: NDArray[np.float64],
        signals: NDArray[np.float64] | None = None,
    ) -> None:
        """Give some lanes the numbers of a system, and a state at theta = 0; signals stay as they are if not given."""
        signals = self._signals[lanes] if signals is None else signals
        fits = not np.any(coefficients[:, self._pattern == 0])
        fits &= not np.any(coefficients[:, self._pattern == ONE] != 1.0)
        if not fits:  # what was always 0 or 1 before, is not
            self._pattern = self._pattern_of(np.concatenate((self._coefficients, coefficients)))
        if any(np.any(_chained(each, self._parents)[0][~self._entries]) for each in signals):
            fits, self._parents = False, (-1,) * len(self._entries)
            every = np.concatenate((self._signals, signals))
            self._entries = np.any([_chained(each, self._parents)[0] for each in every], axis=0)
        self._coefficients[lanes], self._signals[lanes] = coefficients, signals
        if not fits:
            self._compile(len(self._numbers))
            self._write(np.arange(len(self._signals)))
        self._needed.reshape(-1)[lanes] = np.ceil(self.finer * steps_of(self.layout, coefficients))
        self.restart(lanes, states)
        self._write(lanes)

    def _write(self, lanes: NDArray[np.intp]) -> None:
        """Write the numbers of systems."""
        block, lane = np.divmod(lanes, WIDTH)
        from_, to = self._slots
        self._numbers[block[:, None], to, lane[:, None]] = self._coefficients[np.ix_(lanes, from_)]
        signal, column, to = self._places
        for one, place, own in zip(block, lane, self._signals[lanes], strict=True):
            self._numbers[one, to, place] = _chained(own, self._parents)[0][signal, column]
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
        self._notes[block, :, lane] = self._slopes[block, :, lane] = np.nan  # sides and accelerations are not known
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
        if steps != self._steps[block]:
            self._steps[block], self._slopes[block] = steps, np.nan
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
        return self._of(self._state)[:, self._own]

    @property
    def diverged(self) -> NDArray[np.bool_]:
        """Marks of the motions that have diverged, shape (count,)."""
        return ~(np.abs(self._of(self._state)).max(axis=1) < LIMIT)

    @property
    def steps(self) -> NDArray[np.intp]:
        """Steps in a period of each motion, shape (count,)."""
        return np.repeat(self._steps, WIDTH)[: self.count]

    def idle(self, lane: int) -> None:
        """Leave a lane out, if its whole register is; otherwise it goes on as a copy."""
        self._used[lane] = False

    def note(self, kind: str) -> NDArray[np.float64]:
        """Return the notes of a kind over the last period, shape (count, contacts with stages, or the like)."""
        return self._of(self._notes[:, [row for (own, _), row in self.code.notes.items() if own == kind]])

    def _of(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return rows of blocks, shape (..., blocks, rows, lanes), by lanes."""
        found = rows.swapaxes(-1, -2).reshape(*rows.shape[:-3], -1, rows.shape[-2])
        return found[..., : self.count, :].copy()  # of one block it is a view

    def advance(self, periods: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Advance all motions by some forcing periods; return the notes over each, and the states at its end.

        Shapes: (periods, count, rows), with the rows of `Code.notes`, and (periods, count, state_size).
        """
        notes, states = aligned((periods, *self._notes.shape)), np.zeros((periods, *self._state.shape))
        notes[:, :, : self._kept], notes[0, :, self._kept :] = (
            self.code.begin[: self._kept, None],
            self._notes[:, self._kept :],
        )
        first, (long, wide) = notes.ctypes.data, notes.strides[:2]
        for block in np.flatnonzero(self._used.reshape(-1, WIDTH).any(axis=1)).tolist():
            steps, given = int(self._steps[block]), (self._numbers[block], self._state[block], self._slopes[block])
            numbers, state, slopes = (each.ctypes.data for each in given)
            table = _table(self.layout.orders, steps).ctypes.data
            for period in range(periods):
                if period:
                    notes[period, block, self._kept :] = notes[period - 1, block, self._kept :]
                self.code.advance(numbers, table, state, slopes, first + period * long + block * wide, steps)
                if self._drift is not None:
                    # the rotation as a whole returns to its mean within thousands of periods: it is put there
                    self._state[block, self._drift[0]] -= notes[period, block, self._drift[1]] / steps
                states[period, block] = self._state[block]
        notes[:, :, self.code.alike[0]] = notes[:, :, self.code.alike[1]]
        self._notes[:] = notes[-1]
        return self._of(notes), self._of(states)[..., self._own]


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


def _chained(
    signals: NDArray[np.float64], parents: tuple[int, ...] | None = None
) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Append a column for each row, and write a row as a multiple of an earlier one with the rest, where that is short.

    The acceleration of an inertia is that of its neighbour and of the link between: two numbers in place of all. Those
    earlier rows are returned too, -1 for none.
    """
    return _chain(signals.tobytes(), signals.shape, parents)


@lru_cache(maxsize=256)
def _chain(content: bytes, shape: tuple[int, int], parents: tuple[int, ...] | None) -> Any:
    signals, chosen = np.frombuffer(content).reshape(shape), list[int]()
    found = np.hstack((signals, np.zeros((len(signals), len(signals)))))
    for k, row in enumerate(signals):
        chosen.append(-1)
        for j in range(k) if parents is None else [parents[k]] * (parents[k] >= 0):
            other = signals[j]
            common = row * other != 0.0
            factor = np.median(row[common] / other[common]) if common.any() else 0.0
            rest = row - factor * other
            rest[np.abs(rest) <= _ROUNDING * np.abs(row)] = 0.0
            if parents is not None or np.count_nonzero(rest) + 1 < np.count_nonzero(found[k]):
                found[k, : len(row)], found[k, len(row) :] = rest, factor * (np.arange(len(signals)) == j)
                chosen[-1] = j
    return found, tuple(chosen)


def _refuse_static(slots: ContactSlots, coefficients: NDArray[np.float64]) -> None:
    static = slots.numbers.get("static") if slots.form.law.is_dry else None
    if static is not None and np.any(coefficients[:, static] != 1.0):
        raise UnfitError(f"equal steps cannot include {slots.form.name!r}: its static is not 1.0; use the exact flow")


def turn_of(structure: Structure) -> int | None:
    """Return the number of the coordinate that is the rotation of a train as a whole, if it has one."""
    assembly = structure.assembly
    return structure.size - 1 if isinstance(assembly, TrainAssembly) and assembly.form.has_turn else None


def steps_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the steps that a period of each system needs, shape (count,)."""
    known, keys = _known_steps(layout.structure), [each.tobytes() for each in coefficients]
    if new := {key: place for place, key in enumerate(keys) if key not in known}:
        linear = Linear(layout, coefficients[list(new.values())])
        fast = fastest(linear, np.zeros((len(new), layout.structure.state_size)))
        highest = max([*layout.orders, *(cycle.order for cycle in layout.cycles)], default=1)
        found = np.maximum(PERIOD * linear.rate * fast / TURN, _LEAST * highest)
        known |= dict(zip(new, found.tolist(), strict=True))
    return np.array([known[key] for key in keys])


@lru_cache(maxsize=8)
def _known_steps(structure: Structure) -> dict[bytes, float]:
    """Return the steps of systems that are known, by their coefficients."""
    return {}


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
