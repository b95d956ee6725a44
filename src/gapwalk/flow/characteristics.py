"""Characteristics of a system, before any motion: forces over deflections, and what varies over the angle."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles, contact_force
from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.laws import Expression, Law
from gapwalk.model.structure import Variation
from gapwalk.model.system import System

Array = NDArray[np.float64]

_SAMPLES, _ANGLES = 601, 241  # of a deflection, and of a period (at least; more for high orders)
_PER_CYCLE = 48  # angles in a cycle of the highest order
_BESIDE = 1e-9  # distance from a breakpoint of the samples on both sides, as a share of the range
_ROOM = 1.5  # range beyond the outermost breakpoint, as a factor
_WIDEST = 4.0  # largest range, as a factor of the outermost breakpoint
_LOADED = 6.0  # force at the edge of the range, as a factor of the largest load
_SCAN = np.geomspace(1e-6, 1e6, 1201)  # deflections among which the range of a force is looked for
_FAR = 100.0  # farthest maximum of a force that belongs to the range, as a factor of the deflection by the load
_ONE_SIDED = 0.35  # range on the side on which nothing acts, as a share of the other


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """The force of a contact over its deflection at rest; or over the rate, if it depends on that alone."""

    names: tuple[str, ...]  #: Names of the contacts that have this force.
    law: str  #: Its law in words, or its formula.
    over_rate: bool  #: True if `x` is the rate of the deflection, at the deflection 0.
    #: x, force: shape (samples,): The deflection and the force; numbers that vary over the angle have their mean
    #: values.
    x: Array
    force: Array
    #: (array, array) or None: Smallest and largest force over the angle of the excitation, if a number of it varies.
    band: tuple[Array, Array] | None = None
    breakpoints: tuple[float, ...] = ()  #: Deflections at which a stage begins, increasing.

    is_at_zero: bool = False  #: True if it also depends on the deflection, which is 0.
    over_slip: bool = (
        False  #: True for a drag of parts at different speeds: `x` is their slip, its breakpoint the mean.
    )

    @property
    def name(self) -> str:
        """Name of the contact, or the names of all."""
        shown = self.names if len(self.names) < 4 else (*self.names[:2], f"... {self.names[-1]} ({len(self.names)})")
        return ", ".join(shown)


@dataclass(frozen=True, eq=False)
class AngleCurve:
    """Numbers over the angle of the excitation."""

    parameter: str  #: Name of the number that varies; ``"load"`` for loads.
    names: tuple[str, ...]  #: Names of the curves: of stages, coordinates or inertias.
    repeats: int  #: Times that all of them repeat within a period of the excitation.
    theta: Array  #: shape (samples,): The angle, from 0 to ``2 pi / repeats``.
    values: Array  #: shape (curves, samples): The numbers.
    means: Array  #: shape (curves,): Their means.
    is_relative: bool = False  #: True if they are fractions of a mean that is no parameter of its own.


@dataclass(frozen=True, eq=False)
class Characteristics:
    """Forces over deflections, and numbers and loads over the angle of the excitation."""

    system: System  #: The system.
    forces: tuple[ForceCurve, ...]  #: The forces that depend on one deflection.
    variations: tuple[AngleCurve, ...]  #: The numbers that vary over the angle.
    loads: AngleCurve | None  #: The loads that vary over the angle, with the mean load; None if there are none.
    #: Names of the forces of several deflections with their formulas, and of those that vanish at rest; and of dry
    #: friction and rigid stops, whose forces are no functions.
    others: tuple[tuple[str, str], ...] = field(default=())


def characteristics_of(system: System) -> Characteristics:
    """Compute the characteristics of a system."""
    loads = _loads(system)
    size = 0.0 if loads is None else float(np.abs(loads.values).max())
    size = max(size, *np.abs(system.vector("mean")).tolist())
    forces, others = [], []
    coefficients, layout = coefficients_of(system), layout_of(system.structure)
    for slots, linear in zip(layout.contacts, _linear_parts(system), strict=True):
        law = slots.form.law
        is_function = not (law.arguments[1:] or law.is_dry or law.rebounds)
        curve = _slip_curve(system, slots, coefficients) if is_function else None
        curve = curve or (_force_curve(system, slots, coefficients, linear, size) if is_function else None)
        if curve is None:
            others.append((slots.form.name, slots.form.law.title))
        else:
            forces.append(curve)
    return Characteristics(system, tuple(_merged(forces)), tuple(_variations(system)), loads, tuple(others))


# --------------------------------------------------------------------------------------------------------- forces


def _linear_parts(system: System) -> list[float]:
    """Return the stiffness of the spring that always acts beside each contact: that of a shaft in a drive train."""
    assembly = system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return [0.0] * len(system.structure.contacts)
    stiffness = assembly.numbers(system.values).stiffness
    return [float(stiffness[number]) for number, _ in assembly.form.contacts]


def _slip_curve(system: System, slots: ContactSlots, coefficients: Array) -> ForceCurve | None:
    """Compute the whole torque of a drag over its slip, to twice the mean one; None for all else."""
    assembly, law = system.structure.assembly, slots.form.law
    if not (isinstance(assembly, TrainAssembly) and isinstance(law, Expression) and "x" not in law.formula.variables):
        return None
    numbers = assembly.numbers(system.values)
    place = next(place for place, link in enumerate(assembly.form.links) if slots.form in link.parts)
    mean = float(numbers.mean_slips[place])
    if not mean or any(each not in (law.arguments[0], f"{law.arguments[0]}'") for each in law.formula.variables):
        return None
    slip = mean * np.linspace(0.0, 2.0, _SAMPLES)[:: 1 if mean > 0.0 else -1]
    angles = Angles(layout_of(system.structure), coefficients, 0.0)
    torque = np.real(contact_force(slots, angles, [(np.zeros_like(slip), slip - mean)]))
    torque = torque + np.real(numbers.steady_drags[place] + numbers.damping[place] * (slip - mean))
    return ForceCurve((slots.form.name,), "drag", False, slip, torque, None, (mean,), over_slip=True)


def _force_curve(
    system: System, slots: ContactSlots, coefficients: Array, linear: float, size: float
) -> ForceCurve | None:
    """Compute the force over the deflection, or over the rate; None if it vanishes where both are tried."""
    form, layout = slots.form, layout_of(system.structure)
    still = replace(slots, waves={}, stages=tuple(replace(stage, waves={}) for stage in slots.stages))

    def force(x: Any, rate: Any, theta: Any = 0.0, which: ContactSlots = still) -> Array:
        with np.errstate(all="ignore"):
            found = contact_force(which, Angles(layout, coefficients, theta), [(x, rate)]) + linear * x
        return np.where(np.isfinite(found), np.real(found), np.nan)

    every = [stage.sign * float(coefficients[stage.clearance]) for stage in slots.stages]
    gapless = [system.equations.gapless[place] for place in _switches(system, slots)]
    # a stage without a gap on both sides never opens, so it begins nowhere
    levels = sorted({level for level, always in zip(every, gapless, strict=True) if not always})
    for over_rate in (False, True):

        def along(values: Array, *more: Any, over_rate: bool = over_rate) -> Array:
            zero = np.zeros_like(values)
            return force(zero, values, *more) if over_rate else force(values, zero, *more)

        low, high = _reach(along, [] if over_rate else levels, size)
        x = np.linspace(low, high, _SAMPLES)
        if not over_rate:
            beside = _BESIDE * (high - low)
            x = np.unique(np.concatenate((x[~np.isin(x, every)], *([each - beside, each + beside] for each in every))))
        values = along(x)
        if not np.nanmax(np.abs(values), initial=0.0):
            continue
        band, is_at_zero = None, over_rate and _needs_deflection(form.law)
        if any(name not in form.law.arguments for name in slots.waves) or any(each.waves for each in slots.stages):
            theta = _angles(system, range(len(system.structure.harmonics)))[1]
            moving = replace(slots, waves={k: w for k, w in slots.waves.items() if k not in form.law.arguments})
            each = np.array([along(x, angle, moving) for angle in theta])
            band = np.nanmin(each, axis=0), np.nanmax(each, axis=0)
        shape = (over_rate, x, values, band, tuple(levels), is_at_zero)
        return ForceCurve((form.name,), form.law.title, *shape)
    return None


def _needs_deflection(law: Law) -> bool:
    """Return True if a law depends on the deflection, and not on the rate alone."""
    return not isinstance(law, Expression) or not {*law.formula.variables}.isdisjoint(law.variables)


def _switches(system: System, slots: ContactSlots) -> list[int]:
    """Return the places of the stages of a contact among the switches of the flow."""
    numbers = [contact for contact, _, _ in system.breakpoints]
    own = [form.name for form in system.structure.contacts].index(slots.form.name)
    return [place for place, number in enumerate(numbers) if number == own]


def _reach(force: Callable[[Array], Array], levels: list[float], size: float) -> tuple[float, float]:
    """Return a range of the deflection that shows the breakpoints, the kinks of a formula, and the load."""
    outer = max((abs(level) for level in levels), default=0.0)
    both = np.stack([np.nan_to_num(np.abs(force(sign * _SCAN))) for sign in (1.0, -1.0)])
    largest = both.max(axis=0)
    found = [_ROOM * outer]
    loaded = np.flatnonzero(largest >= _LOADED * size) if size else []
    at_load = float(_SCAN[loaded[0]]) if len(loaded) else math.inf
    if math.isfinite(at_load):
        found.append(min(at_load, _WIDEST * outer or math.inf))
    falling = np.flatnonzero(np.diff(largest) < -1e-9 * largest[:-1])
    if not levels and len(falling) and (peak := float(_SCAN[falling[0]])) < _FAR * at_load:
        found.append(2.0 * peak)
    first = np.flatnonzero(largest > 0.0)
    if not levels and len(first) and first[0]:  # the force of a formula begins there, as beyond a clearance
        found.append(_ROOM * float(_SCAN[first[0]]))
    end = max(found)
    end = end if end > _SCAN[0] else 1.0
    inside = end >= _SCAN
    acts = [bool(side[inside].any()) for side in both]
    low, high = (-end if acts[1] else -_ONE_SIDED * end), (end if acts[0] else _ONE_SIDED * end)
    return (-end, end) if not any(acts) else (low, high)


def _merged(curves: list[ForceCurve]) -> Iterator[ForceCurve]:
    """Join the contacts that have equal forces, in the order of the first."""
    keys: dict[Any, list[ForceCurve]] = {}
    for curve in curves:
        band = b"" if curve.band is None else b"".join(each.tobytes() for each in curve.band)
        key = (curve.law, curve.over_rate, curve.x.tobytes(), curve.force.tobytes(), band)
        keys.setdefault(key, []).append(curve)
    for same in keys.values():
        yield replace(same[0], names=tuple(name for curve in same for name in curve.names))


# ---------------------------------------------------------------------------------------------- over the angle


def _angles(system: System, loads: Any) -> tuple[int, Array]:
    """Return how often some loads repeat within a period of the excitation, and angles of one repetition."""
    forms = [system.structure.harmonics[number] for number in loads]
    orders = [order for form in forms for order in (form.orders or (form.order,)) if order]
    repeats = math.gcd(*orders) or 1
    count = max(_ANGLES, _PER_CYCLE * max(orders, default=1) // repeats + 1)
    return repeats, np.linspace(0.0, PERIOD / repeats, count)


def _variations(system: System) -> Iterator[AngleCurve]:
    """Compute the numbers that vary; those of the stages of a contact that have one name together."""
    structure, coefficients, layout = system.structure, coefficients_of(system), layout_of(system.structure)

    def quantity(variation: Variation) -> tuple[int, str]:
        return variation.contact, variation.name

    for (contact, name), group in groupby(sorted(structure.variations, key=quantity), key=quantity):
        slots, members = layout.contacts[contact], list(group)
        form = slots.form
        repeats, theta = _angles(system, sorted({load for each in members for load, _ in each.loads}))
        theta = _with_jumps(theta, layout, coefficients)
        angles = Angles(layout, coefficients, theta)
        rows: list[tuple[str, Array, float]] = []
        relative = False
        for each in members:
            if each.is_deflection:
                rows.append((form.name, angles.wave(slots.waves[name]), 0.0))
                continue
            if each.stage < 0:
                label, wave = f"{form.name}.{name}", slots.waves[name]
            else:
                label = f"{form.stage_prefix(form.stages[each.stage])}.{name}"
                place = next(place for place, (stage, _) in enumerate(form.sides) if stage is form.stages[each.stage])
                wave = slots.stages[place].waves[name]
            mean = system[label] if label in structure.names else None
            if mean == 0.0:  # a term that there is not
                continue
            relative = relative or mean is None
            rows.append((label, angles.wave(wave), 1.0 if mean is None else mean))
        if not rows:
            continue
        values = np.array([wave if not mean else mean * (1.0 + wave) for _, wave, mean in rows])
        parameter = f"{form.name}.{name}" if len(rows) > 1 else rows[0][0]
        if members[0].is_deflection:
            parameter = form.vectors[form.law.arguments.index(name)]
        yield AngleCurve(
            parameter,
            tuple(row[0] for row in rows),
            repeats,
            theta,
            values,
            np.array([row[2] for row in rows]),
            relative,
        )


def _with_jumps(theta: Array, layout: Any, coefficients: Array) -> Array:
    """Add angles on both sides of each jump between two levels."""
    beside = []
    for cycle in layout.cycles:
        length = PERIOD / cycle.order
        for slot in (cycle.up, cycle.down):
            jumps = float(coefficients[slot]) % length + length * np.arange(cycle.order)
            beside += [jumps - _BESIDE, jumps + _BESIDE]
    every = np.concatenate((theta, *beside))
    return np.unique(every[(every >= theta[0]) & (every <= theta[-1])])


def _loads(system: System) -> AngleCurve | None:
    """Compute the loads on coordinates, or on the inertias of a train, that vary over the angle."""
    structure, assembly = system.structure, system.structure.assembly
    numbers = [number for number, load in enumerate(structure.harmonics) if not load.varies]
    plain = system.equations
    if isinstance(assembly, TrainAssembly):
        names, loads = assembly.form.inertias, assembly.form.loads
        numbers = [number for number in numbers if loads[number].link < 0]  # displacements are no torques
        mean, *shapes = assembly.numbers(system.values).torques
    else:
        names, mean = structure.coordinates, system.vector("mean")
        shapes = [system.vector(structure.harmonics[number].shape) for number in numbers]
    if not numbers:
        return None
    repeats, theta = _angles(system, numbers)
    values = np.zeros((len(names), len(theta)))
    for number, shape in zip(numbers, shapes, strict=True):
        load = plain.structure.harmonics[number]
        own = [plain[name] for name in load.parameters]
        for order, cosine, sine in load.lines(plain.values[0], own):
            values += np.outer(shape, cosine * np.cos(order * theta) + sine * np.sin(order * theta))
    moved = np.flatnonzero(np.ptp(values, axis=1) > 0.0)
    if not len(moved):
        return None
    values = values[moved] + np.asarray(mean)[moved, None]
    values = np.asarray(values, dtype=float)
    means = values[:, :-1].mean(axis=1)
    return AngleCurve("load", tuple(names[place] for place in moved), repeats, theta, values, means)
