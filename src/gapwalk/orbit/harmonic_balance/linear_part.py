"""The matrices of the linear part of the equations of motion, read from the coefficients of the flow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate, combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD
from gapwalk.model.coefficients import CoefficientLayout, CycleSlots, Wave, coefficients_of, layout_of
from gapwalk.model.spring import springs_of
from gapwalk.model.static_force import static_forces_of
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.contact_forces import Laws


# Numbers of contacts that vary over the angle: the polynomials of their forces have periodic coefficients.
#
# A number of a force law that varies is its mean times ``1 + w(theta)``, where the wave w has some lines, and jumps
# between levels at known angles. A term of the force, a product of numbers with powers of the penetration, is
# therefore multiplied by a product of such factors: a `Modulation`. The product of two waves is the convolution of
# their lines. The function that is 1 while some cycles are all at their high level is a `Gate`.
#
# With the damping ``c (1 + w) p(xi) x'``, whose integral over x is P, the force is the derivative of ``(1 + w) P`` by
# the time less ``w' P``: so a damping that varies adds to g.

Gate = frozenset[int]
"""The cycles that are all at their high level; empty for always."""

Modulation = Mapping[Gate, NDArray[np.complex128]]
"""A function of the angle: while a gate is open, lines k = 0, 1, ... of theta, and their derivatives by a parameter.

Each has the shape (2, lines).
"""


def modulation_of(
    layout: CoefficientLayout, waves: tuple[Wave, ...], coefficients: NDArray[np.float64], slope: NDArray[np.float64]
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


# A periodic motion as a finite Fourier series: its values, its turning points, and its means, all in closed form.
#
# A function of ``phi`` with K lines is ``x = Re sum_k c_k exp(i k phi)``, k = 0 ... K, with real ``c_0``. *Lines* are
# the ``c_k``. Its *real form* is ``[c_0, Re c_1 ... Re c_K, -Im c_1 ... -Im c_K]``, coefficients of 1, cosines and
# sines. Its *spectrum* is two-sided: ``x = sum_k s_k exp(i k phi)``, k = -K ... K, so that products become
# convolutions.

_MANY = 32  # angles from which products are faster than exponentials


@dataclass(frozen=True, eq=False)
class Series:
    """``q(theta) = Re sum_k lines_k exp(i k theta / m)``."""

    lines: NDArray[np.complex128]  #: shape (n, K + 1): Complex amplitudes of each coordinate.
    period: int  #: m, forcing periods.
    frequency: float  #: W.

    def states(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return positions and velocities (over time) at angles of the excitation, shape (samples, 2n)."""
        wave = waves(np.asarray(theta) / self.period, self.lines.shape[1] - 1)
        rates = (self.frequency / self.period) * (_exponents(self.lines.shape[1] - 1) * self.lines)
        return np.hstack(((wave @ self.lines.T).real, (wave @ rates.T).real))

    def start(self) -> NDArray[np.float64]:
        """Return the state at theta = 0, shape (2n,)."""
        # all waves are 1 there, so this is the sum of the lines, and of those of the derivative by phi
        exponents = _exponents(self.lines.shape[1] - 1)
        state = (self.lines @ np.column_stack((np.ones_like(exponents), exponents))).real.T.ravel()
        state[len(self.lines) :] *= self.frequency / self.period
        return state

    def turns(self) -> list[NDArray[np.float64]]:
        """Return the angles theta at which each coordinate turns, and its values there; shape (2, turns) each."""
        from gapwalk.orbit.harmonic_balance.kernels import turns  # numba takes longer to load than all the rest

        phi, _, slopes = grid(self.lines.shape[1] - 1)
        found = [turns(row, phi, slopes) for row in self.lines]
        for row in found:
            row[0] = row[0] * self.period % (PERIOD * self.period)
        return found

    def extremes(self) -> NDArray[np.float64]:
        """Return maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        mean = self.lines[:, 0].real
        square = mean**2 + 0.5 * (np.abs(self.lines[:, 1:]) ** 2).sum(axis=1)
        largest, smallest = mean.copy(), mean.copy()
        for index, (_, values) in enumerate(self.turns()):
            if len(values):
                largest[index], smallest[index] = values.max(), values.min()
        return np.column_stack((largest, smallest, mean, np.sqrt(square)))


def waves(phi: NDArray[np.float64], count: int) -> NDArray[np.complex128]:
    """Return ``exp(i k phi)`` for k = 0 ... count, shape (..., count + 1)."""
    if phi.size < _MANY:
        return np.exp(phi[..., None] * _exponents(count))
    powers = np.empty((*phi.shape, count + 1), dtype=complex)
    powers[..., 0] = 1.0
    powers[..., 1:] = np.exp(1j * phi)[..., None]
    return np.multiply.accumulate(powers, axis=-1, out=powers)


@lru_cache(maxsize=64)
def _exponents(count: int) -> NDArray[np.complex128]:
    return 1j * np.arange(count + 1, dtype=np.complex128)


@lru_cache(maxsize=32)
def grid(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a grid that resolves K lines, with eight cells per shortest wave."""
    samples = 8 * max(8, count)
    phi = 2.0 * np.pi * np.arange(samples + 1) / samples
    phi[-1] = 2.0 * np.pi
    wave, k = waves(phi % (2.0 * np.pi), count), np.arange(count + 1)
    values = np.hstack((wave.real, wave.imag[:, 1:]))
    slopes = np.hstack((-k * wave.imag, k[1:] * wave.real[:, 1:]))
    return phi, np.ascontiguousarray(values.T), np.ascontiguousarray(slopes.T)


# Gates that open and close: impulses where a damping jumps over the angle, and the effect of angles that move.
#
# While a gate G is open, a row of polynomials adds the force ``G g + G dP/dt = G g + d/dt (G P) - G' P``. The
# derivative G' is an impulse at each angle at which the gate opens or closes. Its lines are known in closed form. The
# impulse cancels with that of ``d/dt (G P)``, but the momenta ``p = v + D P`` of the variational equations jump.

Array = NDArray[np.float64]


class Passage(NamedTuple):
    """A row of polynomials at the angles at which its gate opens (sign 1) or closes (-1)."""

    row: int  #: Its number.
    #: phi, signs, moves: shape (angles,): The angles, and their derivatives by the parameter.
    phi: Array
    signs: Array
    moves: Array
    #: forces, by_deflection, by_angle, slopes: shape (2, angles): g and P there, and their derivatives by the
    #: deflection, by phi along the motion, and by the parameter.
    forces: Array
    by_deflection: Array
    by_angle: Array
    slopes: Array


def passages(lines: NDArray[np.complex128], laws: Laws, period: int) -> list[Passage]:
    """Return all rows that have a gate, at the angles at which it opens or closes."""
    (angles, opens, gates), moves = laws.jumps.over(period), np.tile(laws.jumps.slopes, period) / period
    orders, count = laws.orders.astype(float) * period, lines.shape[1] - 1
    found: list[Passage] = []
    for row in np.flatnonzero(laws.gate >= 0):
        here = gates == laws.gate[row]
        phi, turns = angles[here], waves(angles[here], count)
        own = lines[laws.contact[row]]
        depth = laws.sign[row] * (turns @ own).real - laws.clearance[row]
        speed = (turns @ (1j * np.arange(count + 1) * own)).real
        cosines, sines = np.cos(np.multiply.outer(phi, orders)), np.sin(np.multiply.outer(phi, orders))
        wave = np.concatenate((cosines, sines), axis=1)
        turned = np.concatenate((-sines * orders, cosines * orders), axis=1)
        powers = depth[:, None] ** np.arange(laws.polynomials.shape[2]) * (depth > 0.0)[:, None]

        def values(steady: Array | float, varied: Array, wave: Array, powers: Array = powers) -> Array:
            """Evaluate polynomials with coefficients that vary, shape (2, angles)."""
            return ((steady + np.moveaxis(varied @ wave.T, -1, 0)) * powers[:, None]).sum(axis=2).T

        by_deflection = values(laws.rates[row], laws.wave_rates[row], wave)
        by_angle = by_deflection * speed + values(0.0, laws.waves[row], turned)
        forces = values(laws.polynomials[row], laws.waves[row], wave)
        slopes = values(laws.slope_table[row], laws.wave_slope_table[row], wave)
        signs = np.where(opens[here] > 0.0, 1.0, -1.0)
        found.append(Passage(int(row), phi, signs, moves[here], forces, by_deflection, by_angle, slopes))
    return found


def add_passages(
    lines: NDArray[np.complex128],
    laws: Laws,
    period: int,
    parts: NDArray[np.complex128],
    slopes: NDArray[np.complex128],
) -> None:
    """Add impulses, and what moves with the angles, to the lines of forces and their slopes (see `Forces`)."""
    count, (frequency, faster) = lines.shape[1] - 1, (each / period for each in laws.frequency)
    k = np.arange(2 * count + 1)
    doubled = np.where(k, 2.0, 1.0)
    for each in passages(lines, laws, period):
        contact, turns = laws.contact[each.row], waves(-each.phi, 2 * count) / (2.0 * np.pi)
        signed, impulses = each.signs * turns.T, -frequency * each.signs * turns.T
        parts[contact, 0] += doubled * (impulses @ each.forces[1])
        parts[contact, 1] += impulses @ each.by_deflection[1]
        change = impulses @ (each.slopes[1] + each.by_angle[1] * each.moves)
        change += (-1j * k) * (impulses @ (each.forces[1] * each.moves))
        change -= faster * (signed @ each.forces[1])
        change -= signed @ (each.forces[0] * each.moves)
        slopes[contact, 0] += (doubled * change)[: count + 1]
        slopes[contact, 1] -= (doubled * (signed @ (each.forces[1] * each.moves)))[: count + 1]


def kicks(lines: NDArray[np.complex128], laws: Laws, period: int, linear: Linear) -> tuple[Array, Array]:
    """Return the angles at which momenta jump with positions, as gates open and close, and how, as matrices."""
    n, angles, changes = len(linear.stiffness), [], []
    for each in passages(lines, laws, period):
        place = laws.contact[each.row]
        along: Array = linear.contacts[:, place, None] * linear.deflections[place]
        for phi, size in zip(each.phi, each.signs * each.by_deflection[1], strict=True):
            if size:
                angles.append(phi)
                changes.append(np.zeros((2 * n, 2 * n)))
                changes[-1][n:, :n] = size * along
    return np.array(angles, dtype=float), np.array(changes).reshape(len(angles), 2 * n, 2 * n)


LOOSE = 1e10
"""Condition number of the stiffness beyond which only contacts restrain the system."""

_PART = 0.5  # size of a share, relative to the inertia


@dataclass(frozen=True, eq=False, slots=True)
class Linear:
    """The matrices of the equations of motion, or their derivatives by a parameter.

    A force by a formula may depend on several deflections. It acts with the first of them, with the others no force.
    """

    #: stiffness, damping: shape (n, n): A and B.
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    contacts: NDArray[np.float64]  #: shape (n, deflections): The D_k.
    #: shape (n, orders + 1): The constant load, and the complex amplitudes of each order of the excitation.
    loads: NDArray[np.complex128]
    deflections: NDArray[np.float64]  #: shape (deflections, n): The e_k.
    #: shape (deflections, orders + 1): The displacements u_k that are added to the deflections: complex amplitudes of
    #: each order, after a zero.
    sways: NDArray[np.complex128]

    def shifted(self, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add a share of the stiffness of each contact to the stiffness matrix, shape (n, n)."""
        return self.stiffness + (self.contacts * shift) @ self.deflections

    def pushed(self, shift: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the loads beside that share: it acts on the coordinates, but its forces are those of deflections."""
        return self.loads - (self.contacts * shift) @ self.sways

    @property
    def is_zero(self) -> bool:
        """True if all entries are zero: as derivatives, nothing changes with the parameter."""
        return not any(
            part.any()
            for part in (self.stiffness, self.damping, self.contacts, self.loads, self.deflections, self.sways)
        )


def linear_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> Linear:
    """Read the matrices from a vector of coefficients (or of their derivatives)."""
    n, contacts, orders = layout.structure.size, len(layout.contacts), len(layout.orders)
    table = coefficients[layout.accelerations]
    mean = 2 * n + contacts
    cosines, sines = table[:, mean + 1 : mean + 1 + orders], table[:, mean + 1 + orders :]
    loads: NDArray[np.complex128] = np.hstack((table[:, mean : mean + 1].astype(complex), cosines - 1j * sines))
    first = firsts_of(layout.structure)
    vectors = [vector for slots in layout.contacts for vector in slots.deflections]
    deflections = np.array([coefficients[vector] for vector in vectors]).reshape(len(vectors), n)
    pushes, sways = np.zeros((n, len(vectors))), np.zeros((len(vectors), orders + 1), dtype=complex)
    pushes[:, first] = table[:, 2 * n : mean]
    for place, slots in zip(first, layout.contacts, strict=True):
        for number, name in enumerate(slots.form.law.arguments):
            if (wave := slots.waves.get(name)) is not None:
                lines = coefficients[wave.lines]
                sways[place + number, 1:] = lines[:orders] - 1j * lines[orders:]
    return Linear(table[:, :n], table[:, n : 2 * n], pushes, loads, deflections, sways)


class Share(NamedTuple):
    """A spring and a damper that are moved from a force by a formula, or by friction, into the linear part.

    Without them, a system that only these forces hold or damp would have a resonance in its linear part.
    """

    place: int  #: Number of the deflection on which they act.
    #: spring, damper: Their coefficients.
    spring: float
    damper: float


@dataclass(frozen=True, eq=False)
class ForcesLessShares:
    """Forces of some contacts less their shares, for some coefficients of the flow and their derivatives."""

    #: layout, coefficients, slope: The coefficients, and their derivatives by a parameter.
    layout: CoefficientLayout
    coefficients: NDArray[np.float64]
    slope: NDArray[np.float64]
    shares: tuple[Share, ...] = ()  #: What is taken away from the forces.


def shares_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> tuple[Share, ...]:
    """Choose the shares of forces without stages: dampers, and springs if the stiffness does not hold the system."""
    # They are about as large as the inertia of the deflection at the frequency of the excitation.
    linear, frequency, found = linear_of(layout, coefficients), 1.0 / float(coefficients[0]), []
    is_held = np.linalg.cond(linear.stiffness, 1) < LOOSE
    for place, slots in zip(firsts_of(layout.structure), layout.contacts, strict=True):
        inverse = float(linear.deflections[place] @ linear.contacts[:, place])  # of the mass that is moved
        if not slots.form.law.stage_parameters and inverse > 0.0:
            spring = 0.0 if is_held else _PART * frequency**2 / inverse
            found.append(Share(place, spring, _PART * frequency / inverse))
    return tuple(found)


def shared(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    slope: NDArray[np.float64] | None,
    shares: tuple[Share, ...],
) -> tuple[Linear, Linear | None]:
    """Return the linear part with shares of formulas, and its derivative by a parameter."""
    # Displacements that are prescribed in a deflection act on its spring and damper as loads.
    linear, change = linear_of(layout, coefficients), None if slope is None else linear_of(layout, slope)
    frequency = 1.0 / float(coefficients[0])
    orders = np.array([0, *layout.orders])
    for place, spring, damper in shares:
        push, vector, sway = linear.contacts[:, place], linear.deflections[place], linear.sways[place]
        along: NDArray[np.float64] = push[:, None] * vector
        factors = spring + 1j * orders * frequency * damper
        if change is not None and slope is not None:
            pushed, moved, swayed = change.contacts[:, place], change.deflections[place], change.sways[place]
            turned: NDArray[np.float64] = pushed[:, None] * vector + push[:, None] * moved
            faster = -1j * orders * damper * frequency**2 * float(slope[0])
            loads = np.outer(pushed, factors * sway) + np.outer(push, faster * sway + factors * swayed)
            change = _with(change, spring * turned, damper * turned, loads)
        linear = _with(linear, spring * along, damper * along, np.outer(push, factors * sway))
    return linear, change


def _with(
    linear: Linear, stiffness: NDArray[np.float64], damping: NDArray[np.float64], loads: NDArray[np.complex128]
) -> Linear:
    """Add to the matrices of stiffness and damping, and subtract from the loads."""
    return replace(
        linear, stiffness=linear.stiffness + stiffness, damping=linear.damping + damping, loads=linear.loads - loads
    )


def firsts_of(structure: Structure) -> list[int]:
    """Return the number of the first deflection of each contact, of those of all contacts one after the other."""
    counts = [len(form.law.arguments) for form in structure.contacts]
    return [*accumulate(counts, initial=0)][:-1]


def deflections_in(structure: Structure) -> int:
    """Return the number of deflections of all contacts: one for each argument of their laws."""
    return sum(len(form.law.arguments) for form in structure.contacts)


def open_response(system: System) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the angular frequencies of all orders, and the response to each with all gaps open, shape (n, orders).

    Stages that have no clearance belong to the stiffness, and so do the tangents of formulas at zero. Displacements
    that are prescribed in deflections are loads. It raises a LinAlgError at the resonance of a system without damping.
    """
    layout, n = layout_of(system.structure), system.size
    coefficients = coefficients_of(system)
    linear = linear_of(layout, coefficients)
    stiffness, damping, loads = linear.stiffness.copy(), linear.damping.copy(), linear.loads[:, 1:].copy()
    frequencies = np.array(layout.orders) * system.frequency
    pushes = linear.contacts.T[firsts_of(layout.structure)]
    forces = zip(static_forces_of(system), springs_of(system), pushes, strict=True)
    for force, spring, push in forces:
        if force.is_formula:
            _, own_stiffness, own_damping = force.at(np.zeros(n))
        else:
            own_stiffness = np.array([sum(each.stiffness for each in spring.slopes if each.clearance == 0 < each.sign)])
            own_damping = np.zeros(1)
        stiffness += np.outer(push, own_stiffness @ force.deflections)
        damping += np.outer(push, own_damping @ force.deflections)
        for place, name in enumerate(force.form.law.arguments):
            if name in force.slots.waves:
                cosines, sines = np.split(coefficients[force.slots.waves[name].lines], 2)
                felt = own_stiffness[place] + 1j * frequencies * own_damping[place]
                loads -= np.outer(push, felt * (cosines - 1j * sines))
    found = np.zeros((n, len(frequencies)), dtype=complex)
    for place, (frequency, load) in enumerate(zip(frequencies, loads.T, strict=True)):
        found[:, place] = np.linalg.solve(stiffness - frequency**2 * np.eye(n) + 1j * frequency * damping, load)
    return frequencies, found
