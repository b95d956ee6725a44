"""Fourier lines of the contact forces along a motion given by its lines, exact to rounding, with all derivatives.

Each stage on each side acts while its penetration ``xi = sign * x - clearance`` is positive. Whatever the damping law,
the force of a contact is

    f = g(x) + d/dt P(x)

with functions g and P that are polynomials of the penetrations, read from the closed form of the law: Hunt and
Crossley's ``beta |g| x'`` is the time derivative of the integral of ``beta |g|`` over x, and the viscous ``c x'`` while
touching that of ``c xi``. So neither velocities nor jumps of the force need to be integrated.

The function that is 1 while a stage is closed has its spectrum in closed form, from the angles at which the breakpoint
is passed. Every term of the force is that function times a power of the penetration, and a product of functions is a
convolution of their spectra. So nothing is sampled and nothing aliases.

Where numbers vary over the angle, the coefficients of the polynomials have lines too (`modulation`): one more
convolution. Where they jump at known angles, a stage has a second row of polynomials, which acts while it is closed and
its gate is open: such an angle is one more crossing. Only forces by formulas are sampled (`sampled_forces`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import CoefficientLayout, StageSlots, Wave
from gapwalk.model.spring import ForcePolynomials, Product, arranged
from gapwalk.orbit.harmonic_balance.jenkins_forces import NO_MEMORY, DryForces, Memory, check_dry
from gapwalk.orbit.harmonic_balance.kernels import contact_forces
from gapwalk.orbit.harmonic_balance.linear_part import (
    Gate,
    Jumps,
    Share,
    add_lines,
    add_passages,
    firsts_of,
    grid,
    jumps_of,
    modulation_of,
    subsets,
)
from gapwalk.orbit.harmonic_balance.sampled_forces import NO_PAIRS, Formulas, Pairs, formulas_in

_STEP = 1e-150  # of the complex step


@dataclass(frozen=True, eq=False)
class Laws:
    """Polynomials of every stage on every side ("switch"), in the order of the flow's switches.

    They are followed by rows that act only while a gate is open, if numbers jump over the angle.
    """

    contact: NDArray[np.intp]  #: shape (rows,): Deflection of each row.
    #: sign, clearance: shape (rows,): The stage is closed where ``sign * x > clearance``.
    sign: NDArray[np.float64]
    clearance: NDArray[np.float64]
    #: shape (rows, 2, degree + 1): Coefficients of 1, xi, ... of its part of g and of P.
    polynomials: NDArray[np.float64]
    #: clearance_slope, slopes: Derivatives of the clearances and of the polynomials by the parameter.
    clearance_slope: NDArray[np.float64]
    slopes: NDArray[np.float64]
    orders: NDArray[np.intp]  #: shape (orders,): Orders of the excitation at which coefficients vary.
    #: waves, wave_slopes: shape (rows, 2, degree + 1, 2 orders): Cosines, then sines, that are added to the
    #: polynomials, and their derivatives by the parameter.
    waves: NDArray[np.float64]
    wave_slopes: NDArray[np.float64]
    gate: NDArray[np.intp]  #: shape (rows,): Gate of each row, or -1 if it always acts.
    jumps: Jumps  #: The angles at which gates open and close.
    formulas: Formulas | None  #: The forces by formulas, None for none.
    dry: DryForces | None  #: The forces of Jenkins elements, None for none.
    frequency: tuple[float, float]  #: That of the excitation, and its derivative by the parameter.

    @cached_property
    def has_kicks(self) -> bool:
        """True if a damping jumps over the angle."""
        own = self.gate >= 0
        return bool(self.polynomials[own, 1].any() or self.waves[own, 1].any())

    @property
    def are_slim(self) -> bool:
        """True if the derivatives of each force are by its own deflection, and momenta do not jump."""
        return self.formulas is None and self.dry is None and not self.has_kicks

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """Absolute change of the slope of the force where each stage begins, shape (rows,); at most, if it varies."""
        return np.abs(self.polynomials[:, 0, 1]) + np.abs(self.waves[:, 0, 1]).sum(axis=1)

    @cached_property
    def rates(self) -> NDArray[np.float64]:
        """Coefficients of each row's part of g' and P', derivatives by x; shape (rows, 2, degree + 1)."""
        return self.sign[:, None, None] * _by_depth(self.polynomials)

    @cached_property
    def wave_rates(self) -> NDArray[np.float64]:
        """Changes of `rates` over the angle, of the shape of `waves`."""
        return self.sign[:, None, None, None] * _by_depth(self.waves)

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Coefficients of each row's part of g, g', P and P', shape (rows, 4, degree + 1)."""
        rows, _, powers = self.polynomials.shape
        return np.stack((self.polynomials, self.rates), axis=2).reshape(rows, 4, powers)

    @cached_property
    def wave_table(self) -> NDArray[np.float64]:
        """Changes of `table` over the angle, shape (rows, 4, degree + 1, 2 orders)."""
        rows, _, powers, lines = self.waves.shape
        return np.stack((self.waves, self.wave_rates), axis=2).reshape(rows, 4, powers, lines)

    @cached_property
    def switches(self) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
        """Deflection, sign and clearance of each row."""
        return self.contact, self.sign, self.clearance

    @cached_property
    def slope_table(self) -> NDArray[np.float64]:
        """Coefficients of the derivatives of g and P by the parameter, x constant; shape (rows, 2, degree + 1)."""
        return self.slopes - self.clearance_slope[:, None, None] * _by_depth(self.polynomials)

    @cached_property
    def wave_slope_table(self) -> NDArray[np.float64]:
        """Changes of `slope_table` over the angle, of the shape of `waves`."""
        return self.wave_slopes - self.clearance_slope[:, None, None, None] * _by_depth(self.waves)

    def over(self, period: int) -> Variation:
        """Return the variation over the angle phi of a motion of some forcing periods."""
        known = self._variations.get(period)
        if known is None:
            known = self.orders * period, self.gate, self.jumps.first, self.jumps.over(period)
            self._variations[period] = known
        return known

    @cached_property
    def _variations(self) -> dict[int, Variation]:
        return {}

    def tangents(
        self, x: NDArray[np.float64], phi: NDArray[np.float64], period: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ``g'(x)`` and ``P'(x)`` at deflections of shape (..., deflections), of the same shape."""
        # Shapes: `phi` (...,).
        # sign of each row in the column of its deflection
        select = (self.contact[:, None] == np.arange(x.shape[-1])) * self.sign[:, None]
        depth = np.maximum(self.sign * x[..., self.contact] - self.clearance, 0.0)
        acts = depth > 0.0
        if self.gate.max(initial=-1) >= 0:
            acts &= self._open(period * phi)[..., self.gate] | (self.gate < 0)
        angles = np.multiply.outer(period * phi, self.orders)
        lines = np.concatenate((np.cos(angles), np.sin(angles)), axis=-1)
        found = []
        for steady, waves in zip(
            _by_depth(self.polynomials).transpose(1, 0, 2), _by_depth(self.waves).transpose(1, 0, 2, 3), strict=True
        ):
            value = np.zeros(depth.shape)
            for power in range(steady.shape[1] - 1, -1, -1):
                value = value * depth + steady[:, power] + (lines @ waves[:, power].T if len(self.orders) else 0.0)
            found.append((value * acts) @ select)
        return found[0], found[1]

    def _open(self, theta: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return True where each gate is open, shape (..., gates)."""
        jumps, found = self.jumps, []
        for gate, first in enumerate(self.jumps.first):
            passed = np.searchsorted(jumps.angles[jumps.gates == gate], theta % (2.0 * np.pi), side="right")
            found.append((passed + int(first)) % 2 == 1)
        return np.stack(found, axis=-1)


Variation = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]
"""The orders in lines of a motion, the gate of each row, 1 for each gate that is open at first, and the jumps."""


def _by_depth(polynomials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients of the derivatives by the penetration, powers along the third axis, of the same shape."""
    found, powers = np.zeros_like(polynomials), np.arange(1.0, polynomials.shape[2])
    found[:, :, :-1] = polynomials[:, :, 1:] * powers.reshape(-1, *(1 for _ in polynomials.shape[3:]))
    return found


class Forces(NamedTuple):
    """Contact forces ``g(x) + d/dt P(x)`` of a motion with K lines, and forces by formulas."""

    #: shape (deflections, 4, 2K + 1): Lines of g, the spectrum (k = 0 ... 2K) of ``g'(x)``, and the same of P. The
    #: force of a formula belongs to g, but its derivatives are among the `pairs`.
    parts: NDArray[np.complex128]
    #: shape (deflections, 2, K + 1): Derivatives of the lines of g and P by the parameter, with the motion constant.
    slopes: NDArray[np.complex128]
    #: shape (4, crossings): Crossings of breakpoints: angles ``0 <= phi < 2 pi`` in their order, derivatives of the
    #: deflection by phi, 1 where the stage closes, and its switch.
    crossings: NDArray[np.float64]
    pairs: Pairs  #: The derivatives of forces by formulas, and those of Jenkins elements at the same angle.
    #: The angles phi, in order, at which anything has a kink or jumps: breakpoints, kinks of formulas, known angles,
    #: where elements begin to slip and to stick.
    breaks: NDArray[np.float64]
    memory: Memory = NO_MEMORY  #: The forces of Jenkins elements.


def laws_of(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    slope: NDArray[np.float64] | None = None,
    shares: tuple[Share, ...] = (),
) -> Laws:
    """Return the laws of all contacts for the coefficients of the flow, and their derivatives along `slope`."""
    # Of the forces by formulas some shares are taken away.
    plan = _plan_of(layout)
    moves = np.zeros_like(coefficients) if slope is None else slope
    table, slopes = _table(plan.steady, coefficients, slope)
    clearance, clearance_slope = coefficients[plan.steady.clearances], moves[plan.steady.clearances]
    rows = [plan.steady.contacts, plan.steady.signs, clearance, clearance_slope]
    gate, numbers, waves = np.full(len(clearance), -1), np.zeros(0, np.intp), np.zeros((2, *table.shape, 0))
    jumps = _NO_JUMPS
    if plan.varied:
        varied = _varied(layout, plan, coefficients, moves)
        gates = [Gate(), *sorted((each for each in varied if each), key=sorted)]
        count, width = len(gates), max(each.shape[-1] for each in varied.values())
        dense: NDArray[np.complex128] = np.zeros((2, count, *table.shape, width), dtype=complex)
        for place, each in enumerate(gates):
            if each in varied:
                dense[:, place, ..., : varied[each].shape[-1]] = varied[each]
        lines = dense.reshape(2, -1, *table.shape[1:], width)
        numbers = 1 + np.flatnonzero((lines[..., 1:] != 0.0).any(axis=(0, 1, 2, 3)))
        waves = np.concatenate((np.real(lines[..., numbers]), -np.imag(lines[..., numbers])), axis=-1)
        steady = np.zeros((2, (count - 1) * len(table), *table.shape[1:]))
        table, slopes = np.concatenate((np.stack((table, slopes)), steady), axis=1) + np.real(lines[..., 0])
        rows = [np.tile(each, count) for each in rows]
        gate = np.repeat(np.arange(-1, count - 1), len(gate))
        jumps = jumps_of(layout, gates[1:], coefficients, moves)
    used = np.flatnonzero((table != 0.0).any(axis=(0, 1)) | (waves != 0.0).any(axis=(0, 1, 2, 4)))
    powers = slice(1 + int(used.max(initial=1)))  # 1 and xi at least: a contact may have no force at all
    polynomials, slopes = table[:, :, powers].copy(), slopes[:, :, powers].copy()
    waves, wave_slopes = (each[:, :, powers].copy() for each in waves)
    formulas = Formulas(layout, coefficients, moves, shares) if plan.formulas else None
    dry = DryForces(layout, coefficients, moves, shares) if layout.structure.memories else None
    contact, sign, clearance, clearance_slope = rows
    return Laws(
        contact,
        sign,
        clearance,
        polynomials,
        clearance_slope,
        slopes,
        numbers,
        waves,
        wave_slopes,
        gate,
        jumps,
        formulas,
        dry,
        (1.0 / float(coefficients[0]), -float(moves[0]) / float(coefficients[0]) ** 2),
    )


def depend_on_frequency(layout: CoefficientLayout) -> bool:
    """Return True if the frequency enters the forces: by a damping that varies, by a formula, or by friction."""
    plan = _plan_of(layout)
    return plan.formulas or bool(layout.structure.memories) or any(products.is_damped for _, products in plan.varied)


def _table(
    products: ForcePolynomials, coefficients: NDArray[np.float64], slope: NDArray[np.float64] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a table of polynomials, and its derivative along `slope`."""
    if slope is None:
        table = products.table(coefficients)
        return table, np.zeros(table.shape)
    table: NDArray[Any] = products.table(coefficients + 1j * _STEP * slope)
    return np.real(table).copy(), np.imag(table) / _STEP


def _varied(
    layout: CoefficientLayout, plan: _Plan, coefficients: NDArray[np.float64], slope: NDArray[np.float64]
) -> dict[Gate, NDArray[np.complex128]]:
    """Return the addition to the table of polynomials while each gate is open."""
    # They are lines and their derivatives by the parameter, of shape (2, switches, 2, degree + 1, lines).
    found: dict[Gate, NDArray[np.complex128]] = {}
    frequency = 1.0 / coefficients[0]
    frequency_slope = -slope[0] * frequency**2
    for waves, products in plan.varied:
        table, slopes = (each[..., None] for each in _table(products, coefficients, slope))
        for gate, (lines, moved) in modulation_of(layout, waves, coefficients, slope).items():
            value, change = table * lines, table * moved + slopes * lines
            # of (1 + w) dP/dt = d/dt ((1 + w) P) - w' P the last term belongs to g
            by_angle = 1j * np.arange(len(lines)) * frequency
            value[:, 0] -= table[:, 1] * by_angle * lines
            faster = moved + lines * (frequency_slope / frequency)
            change[:, 0] -= by_angle * (table[:, 1] * faster + slopes[:, 1] * lines)
            both = np.stack((value, change))
            add_lines(found, gate, both)
    return found


class _Plan(NamedTuple):
    """The polynomials g and P of all contacts as functions of the coefficients."""

    steady: ForcePolynomials  #: Those of the mean values.
    #: For each product of waves those that it multiplies, in the shape of `steady`.
    varied: tuple[tuple[tuple[Wave, ...], ForcePolynomials], ...]
    formulas: bool  #: True if there are forces by formulas.


@lru_cache(maxsize=256)
def _plan_of(layout: CoefficientLayout) -> _Plan:
    """Return the polynomials g and P of all contacts, as functions of the coefficients."""
    backend = "harmonic balance"
    check_dry(layout)
    switches: list[tuple[int, StageSlots]] = []
    steady: list[Product] = []
    varied: dict[tuple[Wave, ...], list[Product]] = {}
    for place, slots in zip(firsts_of(layout.structure), layout.contacts, strict=True):
        first = len(switches)
        if slots.form.law.rebounds:
            raise ModelError(
                f"{backend} cannot include {slots.form.name!r}: its force law {slots.form.law.name!r} reverses the "
                "rate at an impact, and no Fourier series has rates that jump. Give the stop a stiffness "
                '(law = "elastic", stiffness = 1000), or use the method shooting'
            )
        switches += [(place, stage) for stage in slots.stages]
        for term in slots.form.closed_form(backend) if slots.stages else ():
            refused = f"{backend} cannot include {slots.form.name!r}: its"
            if term.rate > 1 or term.power == term.rate == 0:
                reason = "is not linear in the rate" if term.rate else "jumps at a breakpoint whatever the rate"
                raise ModelError(f"{refused} force law {slots.form.law.name!r} {reason}")
            stage = slots.stages[term.stage]
            named = [(slots.numbers[name], slots.waves.get(name)) for name in term.numbers]
            named += [(stage.numbers[name], stage.waves.get(name)) for name in term.stage_numbers]
            at = (first + term.stage, term.rate, term.power)
            product: Product = (at, term.factor * stage.sign**term.power, [slot for slot, _ in named])
            waves = [wave for _, wave in named if wave is not None]
            steady.append(product)
            for each in subsets(waves):
                varied.setdefault(each, []).append(product)
    whole = arranged(layout, switches, steady)
    parts = [
        (waves, arranged(layout, switches, products, whole.shape).integrated()) for waves, products in varied.items()
    ]
    return _Plan(whole.integrated(), tuple(parts), bool(formulas_in(layout)))


def contact_forces_of(lines: NDArray[np.complex128], laws: Laws, period: int = 1) -> Forces:
    """Compute the forces along deflections with lines of shape (deflections, K + 1), of some forcing periods."""
    own, variation = (laws.table, laws.slope_table), (laws.wave_table, laws.wave_slope_table)
    angles = grid(lines.shape[1] - 1)
    parts, slopes, crossings = contact_forces(lines, *laws.switches, *own, *angles, *laws.over(period), *variation)
    breaks = crossings[0]
    if len(laws.jumps.angles):
        breaks = np.sort(np.concatenate((breaks, laws.jumps.over(period)[0])))
        if laws.jumps.move or laws.has_kicks:
            add_passages(lines, laws, period, parts, slopes)
    pairs, memory = NO_PAIRS, NO_MEMORY
    if laws.formulas is not None:
        sampled = laws.formulas.sample(lines, period)
        parts[sampled.places, 0] += sampled.lines
        slopes[sampled.places, 0] += sampled.slopes
        breaks, pairs = np.sort(np.concatenate((breaks, sampled.breaks))), sampled.pairs
    if laws.dry is not None:
        memory = laws.dry.along(lines, period, crossings)
        for each in memory.forces:
            parts[each.slider.element.place, 0] += each.lines
            slopes[each.slider.element.place, 0] += each.slopes
        breaks = np.sort(np.concatenate((breaks, *(each.breaks for each in memory.forces))))
        pairs = memory.pairs if laws.formulas is None else pairs.and_those(memory.pairs)
    return Forces(parts, slopes, crossings, pairs, breaks, memory)


_NO_JUMPS = Jumps(*np.zeros((5, 0)))
