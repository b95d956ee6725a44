"""Equations of motion as data for the compiled kernel: a list of operations on Taylor series.

What depends on run-time parameters only is a *constant*. What depends on the state or the angle has a *slot*, and its
series is a linear combination with constant factors, or another operation on slots. Columns of derivatives have *lane
slots*, which are linear combinations, or products of a slot with a lane slot. Operations that need nothing of each
other form a block.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.taylor import header
from gapwalk.taylor.header import LANES, LENGTH, WIDE
from gapwalk.taylor.symbols import ANGLE, FUNCTIONS, ONE, ZERO, Symbol, number

_KINDS = {
    name: getattr(header, name.upper())
    for name in ("product", "quotient", "power", "sqrt", "exp", "log", "sin", "cos", "tanh", "sum")
}
_PARTNERS = ("sin", "cos")
_FEW = 3  # terms of a sum that is taken apart where it occurs more than once

_TURNS = 32  # turning points of each function for which there is room
_COMPUTED = 1_000_000_000  # constants from here on are computed; their places follow when the numbers are known

Right = Sequence[tuple[Symbol, Symbol]]
"""(variable, right-hand side) of some equations."""


class _Term(NamedTuple):
    """A term of a linear combination: number, constant, and what is multiplied, if anything."""

    factor: float
    constant: Symbol
    of: Symbol | None


@dataclass
class _Operations:
    """Operations on slots, with the depth of what they need."""

    slots: dict[Symbol, int] = field(default_factory=dict)
    depths: dict[int, int] = field(default_factory=dict)
    rows: list[tuple[int, int, list[_Term]]] = field(default_factory=list)  # (depth, slot, terms)
    others: list[tuple[int, tuple[int, int, int, int]]] = field(default_factory=list)  # (depth, operation)
    count: int = 0

    def new(self, node: Symbol | None, depth: int) -> int:
        """Return the slot of a new series."""
        slot, self.count = self.count, self.count + 1
        if node is not None:
            self.slots[node] = slot
        self.depths[slot] = depth
        return slot

    def blocks(self, first_row: int) -> tuple[list[tuple[int, int, int]], list[tuple[int, int, list[_Term]]]]:
        """Return (kind, first, last) of the blocks in their order, and the rows in that order."""
        found, rows = [], []
        operation = 0
        for depth in range(1 + max([0, *self.depths.values()])):
            own = [row for row in self.rows if row[0] == depth]
            count = sum(each == depth for each, _ in self.others)
            if own:
                found.append((0, first_row + len(rows), first_row + len(rows) + len(own)))
                rows += own
            if count:
                found.append((1, operation, operation + count))
                operation += count
        self.others.sort(key=lambda each: each[0])
        return found, rows


class Program:
    """A program, and the sizes of what it works on.

    Attributes
    ----------
    parameters, size, columns
        How many run-time parameters, numbers of a state, and columns there are.
    integers, numbers
        The arrays that the kernel reads.
    memory
        Numbers of the memory that it needs.
    whole
        Numbers of a state with its columns, and with what is integrated beside it.
    """

    def __init__(
        self,
        parameters: int,
        state: Right,
        beside: Right = (),
        *,
        columns: int = 0,
        lane: Right = (),
        forced: Sequence[Sequence[Symbol]] = (),
        events: Sequence[Symbol] = (),
        turns: Sequence[Symbol] = (),
        outputs: Sequence[Symbol] = (),
    ) -> None:
        self.parameters = parameters
        self._constants: dict[Symbol, int] = {}
        self._numbers: list[float] = []
        self._steps: list[tuple[int, int, int, int]] = []
        self.size, self.columns = len(state), columns
        equations = [*state, *beside]
        forcing = [each for direction in forced for each in direction]
        scalar = [*(rate for _, rate in equations), *forcing, *events, *turns, *outputs]
        lanes = {variable for variable, _ in lane}
        self._uses = _uses([*scalar, *(rate for _, rate in lane)])
        self._lanes, self._scalars = _Operations(), _Operations()
        self._symbols, self._factors = lanes, dict[int, int]()
        for variable, _ in equations:
            self._scalars.new(variable, 0)
        self._waves: list[tuple[int, float]] = []
        self._zero: int | None = None
        rates = [self._rate(rate) for _, rate in equations]
        event_slots, turn_slots, output_slots = (
            [self._slot(each) for each in some] for some in (events, turns, outputs)
        )
        for variable, _ in lane:
            self._lanes.new(variable, 0)
        lane_rates = [self._lane_rate(rate) for _, rate in lane]
        first = columns - len(forced)
        forcings = [
            (first + number, place, self._slot(each))
            for number, direction in enumerate(forced)
            for place, each in enumerate(direction)
            if each is not ZERO
        ]
        self._write(rates, lane_rates, forcings, event_slots, turn_slots, output_slots)

    # constants

    def _constant(self, node: Symbol) -> int:
        """Return the place of a constant."""
        if node.operation == "parameter":
            return int(node.value)
        found = self._constants.get(node)
        if found is None:
            if node.operation == "number":
                self._constants[node] = found = -1 - len(self._numbers)
                self._numbers.append(node.value)
                return found
            arguments = list(node.arguments)
            kind = _KINDS[node.operation]
            a = self._constant(arguments[0])
            for argument in arguments[1:] or arguments:  # a function has one argument
                b, out = self._constant(argument), _COMPUTED + len(self._steps)
                self._steps.append((kind, out, a, b))
                a = out
            self._constants[node] = found = a
        return found

    # series

    def _terms(self, node: Symbol, factor: float, constant: Symbol, is_lane: bool = False) -> Iterable[_Term]:
        """Iterate over the terms of a linear combination."""
        known = self._lanes.slots if is_lane else self._scalars.slots
        if node.is_constant:
            if node.operation == "number":
                factor, node = factor * node.value, ONE
            elif node.operation == "product" and node.arguments[0].operation == "number":
                factor, node = factor * node.arguments[0].value, node.arguments[1]
            if factor:
                yield _Term(factor, _times(constant, node), None)
        elif node in known:
            yield _Term(factor, constant, node)
        elif node.operation == "sum" and constant is ONE and (self._uses[node] == 1 or len(node.arguments) <= _FEW):
            for each in node.arguments:
                yield from self._terms(each, factor, constant, is_lane)
        elif node.operation == "product" and node.arguments[0].operation == "number":
            yield from self._terms(node.arguments[1], factor * node.arguments[0].value, constant, is_lane)
        elif node.operation == "product" and any(each.is_constant for each in node.arguments):
            a, b = node.arguments if node.arguments[0].is_constant else reversed(node.arguments)
            yield from self._terms(b, factor, _times(constant, a), is_lane)
        elif node.operation == "quotient" and node.arguments[1].is_constant:
            yield from self._terms(node.arguments[0], factor, _times(constant, ONE / node.arguments[1]), is_lane)
        else:
            yield _Term(factor, constant, node)

    def _row(self, node: Symbol | None, terms: Iterable[_Term]) -> int:
        """Return the slot of a linear combination."""
        found = list(terms)
        depth = 0
        for each in found:
            if each.of is not None:
                depth = max(depth, self._scalars.depths[self._slot(each.of)])
        slot = self._scalars.new(node, depth + 1)
        self._scalars.rows.append((depth + 1, slot, found))
        return slot

    def _slot(self, node: Symbol) -> int:
        """Return the slot of a function."""
        found = self._scalars.slots.get(node)
        if found is not None:
            return found
        if node is ANGLE:
            return self._scalars.new(node, 0)
        operation, arguments = node.operation, node.arguments
        if node.is_constant or operation == "sum":
            return self._row(node, self._parts(node))
        if operation in _PARTNERS:
            return self._wave(node)
        if operation == "product":
            a, b = arguments
            if a.is_constant or b.is_constant:
                return self._row(node, self._parts(node))
            return self._operation(node, header.PRODUCT, self._slot(a), self._slot(b))
        if operation == "quotient":
            if arguments[1].is_constant:
                return self._row(node, self._parts(node))
            return self._operation(node, header.QUOTIENT, *map(self._slot, arguments))
        if operation == "power":
            base, power = arguments
            if power.operation == "number" and power.value == int(power.value) and power.value > 2.0:
                half = base ** (power.value // 2)
                rest = half * half
                return self._named(node, rest * base if power.value % 2 else rest)
            return self._operation(node, header.POWER, self._slot(base), self._constant(power))
        of = self._slot(arguments[0])
        slot = self._operation(node, _KINDS[operation], of, 0)
        if operation == "tanh":
            self._scalars.new(None, self._scalars.depths[slot])  # 1 - tanh^2
        return slot

    def _named(self, node: Symbol, same: Symbol) -> int:
        """Return the slot of a function that equals another one."""
        slot = self._slot(same)
        self._scalars.slots[node] = slot
        return slot

    def _parts(self, node: Symbol) -> list[_Term]:
        """Return the terms of a function that is a linear combination itself."""
        if node.is_constant:
            return [_Term(1.0, node, None)]
        if node.operation == "sum":
            return [term for each in node.arguments for term in self._terms(each, 1.0, ONE)]
        return list(self._terms(node, 1.0, ONE))

    def _operation(self, node: Symbol, kind: int, a: int, b: int) -> int:
        depths = self._scalars.depths
        two = kind in (header.PRODUCT, header.QUOTIENT)
        depth = 1 + max(depths[a], depths[b] if two else 0)
        slot = self._scalars.new(node, depth)
        self._scalars.others.append((depth, (kind, slot, a, b)))
        return slot

    def _wave(self, node: Symbol) -> int:
        """Return the slot of a sine or cosine; both of one argument are computed together."""
        (argument,) = node.arguments
        both = {name: FUNCTIONS[name](argument) for name in _PARTNERS}
        order = _order_of(argument)
        if order is not None:
            first = self._scalars.new(both["cos"], 0)
            self._scalars.new(both["sin"], 0)
            self._waves.append((first, order))
        else:
            of = self._slot(argument)
            slot = self._operation(both["sin"], header.SIN, of, 0)
            self._scalars.new(both["cos"], self._scalars.depths[slot])
        return self._scalars.slots[node]

    def _scaled(self, node: Symbol) -> tuple[Symbol, float, Symbol]:
        """Return a constant factor, a number, and what they multiply."""
        constant, factor = ONE, 1.0
        while node.operation == "product":
            a, b = node.arguments
            if a.operation == "number":
                factor, node = factor * a.value, b
            elif a.is_constant and not b.is_constant:
                constant, node = _times(constant, a), b
            elif b.is_constant and not a.is_constant:
                constant, node = _times(constant, b), a
            else:
                break
        return constant, factor, node

    def _rate(self, rate: Symbol) -> tuple[int, int]:
        """Return the slot and the constant whose product is a right-hand side."""
        constant, factor, node = self._scaled(rate)
        return self._slot(node), self._constant(number(factor) * constant)

    # columns

    def _lane_slot(self, node: Symbol) -> int:
        """Return the lane slot of a function that is linear in the columns."""
        found = self._lanes.slots.get(node)
        if found is not None:
            return found
        if node.operation == "product":
            a, b = node.arguments
            a, b = (a, b) if self._symbols.isdisjoint(a.leaves) else (b, a)
            if not a.is_constant:
                lane, slot = self._lane_slot(b), self._slot(a)
                factor = self._factors.setdefault(slot, len(self._factors))
                depth = self._lanes.depths[lane] + 1
                out = self._lanes.new(node, depth)
                self._lanes.others.append((depth, (0, out, factor, lane)))
                return out
        if node.operation == "quotient":
            return self._lane_slot(ONE / node.arguments[1] * node.arguments[0])
        if node.operation == "sum":
            terms = [term for each in node.arguments for term in self._terms(each, 1.0, ONE, is_lane=True)]
        else:
            terms = list(self._terms(node, 1.0, ONE, is_lane=True))
        depth = 0
        for each in terms:
            assert each.of is not None
            depth = max(depth, self._lanes.depths[self._lane_slot(each.of)])
        slot = self._lanes.new(node, depth + 1)
        self._lanes.rows.append((depth + 1, slot, terms))
        return slot

    def _lane_rate(self, rate: Symbol) -> tuple[int, int]:
        constant, factor, node = self._scaled(rate)
        if node is ZERO or rate is ZERO:
            if self._zero is None:
                self._zero = self._lanes.new(None, 1)
                self._lanes.rows.append((1, self._zero, []))
            return self._zero, self._constant(ONE)
        return self._lane_slot(node), self._constant(number(factor) * constant)

    # arrays

    def _write(
        self,
        rates: Sequence[tuple[int, int]],
        lane_rates: Sequence[tuple[int, int]],
        forcings: Sequence[tuple[int, int, int]],
        events: Sequence[int],
        turns: Sequence[int],
        outputs: Sequence[int],
    ) -> None:
        """Write all lists into one array of integers, and what is a number into another one."""
        blocks, rows = self._scalars.blocks(0)
        lane_blocks, lane_rows = self._lanes.blocks(len(rows))
        entries: list[tuple[int, float, int]] = []  # place of a series, factor, constant

        def scalar_place(slot: int) -> int:
            return slot * LENGTH

        def aside(slot: int) -> int:
            return (slot - self.size) * WIDE

        def lane_place(slot: int) -> int:  # those of the state are kept for each group of columns, others are not
            return slot * WIDE if slot < self.size else ~aside(slot)

        table: list[tuple[int, int, int, int]] = []
        for some, of in ((rows, self._scalars.slots), (lane_rows, self._lanes.slots)):
            for _, slot, terms in some:
                merged: dict[tuple[int, int], float] = {}
                for factor, constant, node in terms:
                    key = -1 if node is None else of[node], self._constant(constant)
                    merged[key] = merged.get(key, 0.0) + factor
                known = sorted(merged.items(), key=lambda each: (each[0][0] < 0, each[0]))
                begin = len(entries)
                where = lane_place if of is self._lanes.slots else scalar_place
                entries += [(where(place), factor, constant) for (place, constant), factor in known]
                middle = begin + sum(place >= 0 for (place, _), _ in known)
                out = aside(slot) if of is self._lanes.slots else slot * LENGTH
                table.append((out, begin, middle, len(entries)))
        parameters, count = self.parameters, len(self._numbers)
        first = parameters + count

        def place(constant: int) -> int:
            if constant >= _COMPUTED:
                return first + constant - _COMPUTED
            return constant if constant >= 0 else parameters - 1 - constant

        head = dict.fromkeys(range(header.HEAD), 0)
        integers: list[int] = [0] * header.HEAD

        def add(name: int, values: Iterable[int]) -> int:
            head[name] = begin = len(integers)
            integers.extend(map(int, values))
            return begin

        at = add(header.ROWS, (each for row in table for each in row))
        operations = len(integers)
        integers.extend(map(int, self._operation_numbers(place)))
        lane_operations = len(integers)
        for _, (kind, out, factor, lane) in self._lanes.others:
            integers += [kind, aside(out), factor, lane_place(lane)]
        for name, some, begin in (
            (header.BLOCKS, blocks, operations),
            (header.LANE_BLOCKS, lane_blocks, lane_operations),
        ):
            add(
                name,
                (n for kind, a, b in some for n in (kind, *(4 * each + (begin if kind else at) for each in (a, b)))),
            )
        add(header.PLACES, [*(slot for slot, _, _ in entries), *(place(constant) for _, _, constant in entries)])
        add(header.RATES, (n for slot, constant in rates for n in (slot * LENGTH, place(constant))))
        add(header.LANE_RATES, (n for slot, constant in lane_rates for n in (lane_place(slot), place(constant))))
        add(header.STEPS, (n for kind, *others in self._steps for n in (kind, *map(place, others))))
        groups = -(-self.columns // LANES)
        begin = add(header.FORCED, [0] * (groups + 1))
        for group in range(groups):
            integers[begin + group] = len(integers)
            for column, own, slot in forcings:
                if column // LANES == group:
                    integers += [own * WIDE + column % LANES, slot * LENGTH]
        integers[begin + groups] = len(integers)
        waves = [slot for slot, _ in self._waves]
        for name, some in (
            (header.FACTORS, self._factors),
            (header.EVENTS, events),
            (header.TURNS, turns),
            (header.OUTPUTS, outputs),
            (header.WAVES, waves),
        ):
            add(name, map(scalar_place, some))
        constants = first + len(self._steps)
        head |= {
            header.SIZE: self.size,
            header.STATES: len(rates),
            header.COLUMNS: self.columns,
            header.PARAMETERS: parameters,
            header.NUMBERS: count,
            header.ENTRIES: len(entries),
            header.BLOCK_COUNT: len(blocks),
            header.STEP_COUNT: len(self._steps),
            header.LANE_BLOCK_COUNT: len(lane_blocks),
            header.FACTOR_COUNT: len(self._factors),
            header.EVENT_COUNT: len(events),
            header.TURN_COUNT: len(turns),
            header.OUTPUT_COUNT: len(outputs),
            header.WAVE_COUNT: len(self._waves),
            header.ANGLE: scalar_place(self._scalars.slots[ANGLE]) if ANGLE in self._scalars.slots else -1,
        }
        memory = constants
        rest = -(constants + len(entries) + self._scalars.count * LENGTH) % LANES  # columns begin at a cache line
        for name, room in (
            (header.VALUES, len(entries)),
            (header.SERIES, self._scalars.count * LENGTH + rest),
            (header.LANE_SERIES, (1 + self._lanes.count - len(lane_rates)) * LENGTH * LANES),
            (header.LANE_STATES, groups * self.size * LENGTH * LANES),
            (header.COOL, len(events)),
            (header.COUNTS, len(self._factors)),
        ):
            head[name], memory = memory, memory + room
        for name, value in head.items():
            integers[name] = value
        self.integers: NDArray[np.int64] = np.array(integers, dtype=np.int64)
        self.numbers: NDArray[np.float64] = np.array(
            [*self._numbers, *(factor for _, factor, _ in entries), *(order for _, order in self._waves)]
        )
        self.memory, self.whole = memory + 1, len(rates) + self.columns * self.size
        self.series, self.most_turns = head[header.SERIES], _TURNS * len(turns)
        self.cool = slice(head[header.COOL], head[header.COOL] + len(events))

    def _operation_numbers(self, place: Callable[[int], int]) -> Iterable[int]:
        """Iterate over the operations on slots, with the places of their series."""
        for _, (kind, out, a, b) in self._scalars.others:
            yield from (kind, out * LENGTH, a * LENGTH, place(b) if kind == header.POWER else b * LENGTH)


def _times(a: Symbol, b: Symbol) -> Symbol:
    return b if a is ONE else a if b is ONE else a * b


def _order_of(argument: Symbol) -> float | None:
    """Return the number that multiplies the angle; None if the argument is something else."""
    if argument is ANGLE:
        return 1.0
    if argument.operation == "product" and argument.arguments[1] is ANGLE:
        first = argument.arguments[0]
        return float(first.value) if first.operation == "number" else None
    return None


def _uses(functions: Sequence[Symbol]) -> Counter[Symbol]:
    """Count how often each symbol is an argument."""
    found: Counter[Symbol] = Counter()
    left, seen = list(functions), set[Symbol]()
    found.update(functions)
    while left:
        each = left.pop()
        if each in seen:
            continue
        seen.add(each)
        found.update(each.arguments)
        left.extend(each.arguments)
    return found
