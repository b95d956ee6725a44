"""Numbers of contacts that vary over the angle: the polynomials of their forces have periodic coefficients.

A number of a force law that varies is its mean times ``1 + w(theta)``, where the wave w has some lines, and jumps
between levels at known angles. A term of the force, a product of numbers with powers of the penetration, is therefore
multiplied by a product of such factors: a `Modulation`. The product of two waves is the convolution of their lines. The
function that is 1 while some cycles are all at their high level is a `Gate`.

With the damping ``c (1 + w) p(xi) x'``, whose integral over x is P, the force is the derivative of ``(1 + w) P`` by the
time less ``w' P``: so a damping that varies adds to g.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, CycleSlots, Wave

Gate = frozenset[int]
"""The cycles that are all at their high level; empty for always."""

Modulation = Mapping[Gate, NDArray[np.complex128]]
"""A function of the angle: while a gate is open, lines k = 0, 1, ... of theta, and their derivatives by a parameter.

Each has the shape (2, lines).
"""


def modulation_of(
    layout: CoefficientLayout,
    waves: tuple[Wave, ...],
    coefficients: NDArray[np.float64],
    slope: NDArray[np.float64],
) -> Modulation:
    """Return the product of some waves."""
    product: Modulation = {Gate(): np.array([[1.0], [0.0]], dtype=complex)}
    for wave in waves:
        factor, found = _wave(layout, wave, (coefficients, slope)), {}
        for one, lines in product.items():
            for other, more in factor.items():
                add_lines(found, one | other, _times(lines, more))
        product = found
    return product


def _wave(
    layout: CoefficientLayout, wave: Wave, vectors: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> Modulation:
    """Return one wave: its lines, with the low levels of its cycles, and what the high levels add."""
    orders, count = [*layout.orders], len(layout.orders)
    lines = np.zeros((2, 1 + max(orders, default=0)), dtype=complex)
    for row, vector in zip(lines, vectors, strict=True):
        row[orders] = vector[wave.lines[:count]] - 1j * vector[wave.lines[count:]]
    found = {Gate(): lines}
    for number, factor in wave.cycles:
        low, high = (
            np.array([vector[slot] for vector in vectors])
            for slot in (layout.cycles[number].low, layout.cycles[number].high)
        )
        lines[:, 0] += factor * low
        add_lines(found, Gate([number]), (factor * (high - low)).astype(complex)[:, None])
    return found


def add_lines(found: dict[Gate, NDArray[np.complex128]], gate: Gate, lines: NDArray[np.complex128]) -> None:
    """Add lines, along the last axis, to those of a gate."""
    known = found.get(gate, np.zeros((*lines.shape[:-1], 0), dtype=complex))
    longest, shortest = (known, lines) if known.shape[-1] > lines.shape[-1] else (lines, known)
    total = longest.copy()
    total[..., : shortest.shape[-1]] += shortest
    found[gate] = total


def _times(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Multiply two functions of the angle, with their derivatives by the product rule."""
    (f, df), (g, dg) = ([_two_sided(row) for row in each] for each in (a, b))
    products = np.array([np.convolve(f, g), np.convolve(df, g) + np.convolve(f, dg)])
    lines = products[:, products.shape[1] // 2 :].copy()
    lines[:, 1:] *= 2.0
    return lines


def _two_sided(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the spectrum of lines, from negative to positive k."""
    half = 0.5 * lines[1:]
    return np.concatenate((half[::-1].conj(), lines[:1], half))


@dataclass(frozen=True, eq=False)
class Jumps:
    """The angles at which some gates open and close in one turn of theta, in order."""

    angles: NDArray[np.float64]  #: shape (jumps,): Angles of theta, from 0 to 2 pi.
    slopes: NDArray[np.float64]  #: shape (jumps,): Their derivatives by the parameter.
    opens: NDArray[np.float64]  #: shape (jumps,): 1 where the gate opens, 0 where it closes.
    gates: NDArray[np.float64]  #: shape (jumps,): Number of the gate.
    first: NDArray[np.float64]  #: shape (gates,): 1 for each gate that is open just before theta = 0.

    @cached_property
    def move(self) -> bool:
        """True if the angles change with the parameter."""
        return bool(self.slopes.any())

    def over(self, period: int) -> NDArray[np.float64]:
        """Return angles phi, opens and gates over some turns, in rows."""
        turns = 2.0 * np.pi * np.arange(period)[:, None]
        angles = ((self.angles + turns) / period).ravel()
        return np.array([angles, np.tile(self.opens, period), np.tile(self.gates, period)])


def jumps_of(
    layout: CoefficientLayout, gates: list[Gate], coefficients: NDArray[np.float64], slope: NDArray[np.float64]
) -> Jumps:
    """Return the angles at which gates open and close."""
    found, first = [], []
    for number, gate in enumerate(gates):
        cycles = [layout.cycles[cycle] for cycle in sorted(gate)]
        changes = sorted(change for cycle in cycles for change in _changes(cycle, coefficients, slope))
        high = sum(_starts_high(cycle, coefficients) for cycle in cycles)
        first.append(float(high == len(cycles)))
        for angle, moves, rises in changes:
            opened, high = high == len(cycles), high + (1 if rises else -1)
            if opened != (high == len(cycles)):
                found.append((angle, moves, float(not opened), float(number)))
    table = np.array(sorted(found)).reshape(-1, 4).T
    angles, slopes, opens, numbers = (np.ascontiguousarray(row) for row in table)
    return Jumps(angles, slopes, opens, numbers, np.array(first))


def _changes(
    cycle: CycleSlots, coefficients: NDArray[np.float64], slope: NDArray[np.float64]
) -> Iterator[tuple[float, float, bool]]:
    """Yield the angles at which a cycle changes its level, with their derivatives, and whether it rises."""
    length = 2.0 * np.pi / cycle.order
    for slot, rises in ((cycle.up, True), (cycle.down, False)):
        angle = float(coefficients[slot]) % length
        yield from ((angle + length * turn, float(slope[slot]), rises) for turn in range(cycle.order))


def _starts_high(cycle: CycleSlots, coefficients: NDArray[np.float64]) -> bool:
    """Return True if a cycle is at its high level just before theta = 0."""
    up, down = (float(coefficients[slot]) % (2.0 * np.pi / cycle.order) for slot in (cycle.up, cycle.down))
    return up > down


def subsets(waves: list[Wave]) -> Iterator[tuple[Wave, ...]]:
    """Yield all products of some waves that occur in the product of all factors ``1 + wave``, without 1 itself."""
    ordered = sorted(waves, key=lambda wave: (tuple(wave.lines[:1]), wave.cycles))
    for count in range(1, len(ordered) + 1):
        yield from combinations(ordered, count)
