"""Coefficients of the equations of motion from named parameters, with exact derivatives.

The compiled flow has no names. It integrates, over ``theta = W t``,

    q' = r v
    v' = r [ -A q - B v - sum_k D_k f_k(e_k . q, e_k . v) + m + sum_h (a_h cos h theta + b_h sin h theta) ]

with ``r = 1/W``, ``A = M^-1 K``, ``B = M^-1 C``, ``D_k = M^-1 d_k``, and so on. Those numbers, and the
breakpoints and springs of the contacts, are its coefficients. Their derivative by any named parameter comes
from one evaluation with a complex step (Squire and Trapp 1998, SIAM Review 40, 110-112), exact to rounding,
without derivatives written by hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, OutsideError
from gapwalk.model.contact import ContactForm
from gapwalk.model.registry import NameBlock, Parameter, ParameterNames
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.model.value_checks import value_problems

_ASIDE = 0.0123  # relative shift of parameters, at which no slope is zero by coincidence
_STEP = 1e-150  # complex step: its square must underflow relative to every coefficient, the step must not
_MOST_KEPT = 100_000  # numbers of a table that is kept for the next call


@dataclass(frozen=True, eq=False, slots=True)
class Wave:
    """Slots of what a number varies by over the angle: of its cosines and sines; and the cycles that are added."""

    lines: NDArray[np.intp]  #: shape (2 orders,): Slots of the cosines, then of the sines, of all orders.
    #: The cycles of two levels (`CycleSlots`) by their numbers, each with a factor.
    cycles: tuple[tuple[int, float], ...]


class CycleSlots(NamedTuple):
    """Slots of a variation with two levels: of the low and the high one, and of the angles between them."""

    order: int
    low: int
    high: int
    up: int
    down: int


@dataclass(frozen=True, eq=False, slots=True)
class StageSlots:
    """Slots of the coefficients of one stage on one side, by the names of its parameters.

    `waves` has what those numbers vary by, of those that do.
    """

    sign: int
    innermost: bool
    numbers: Mapping[str, int]
    waves: Mapping[str, Wave]

    @property
    def clearance(self) -> int:
        """Slot of its clearance."""
        return self.numbers["clearance"]


@dataclass(frozen=True, eq=False, slots=True)
class ContactSlots:
    """Slots of the coefficients of one contact: arrays of shape (n,), its stages, its own parameters by name.

    It has one deflection vector for each argument of its law. `waves` has what its numbers vary by, of those that do;
    those of the names of arguments are displacements, which are added to the deflections.
    """

    form: ContactForm
    deflections: tuple[NDArray[np.intp], ...]
    force: NDArray[np.intp]
    stages: tuple[StageSlots, ...]
    numbers: Mapping[str, int]
    waves: Mapping[str, Wave]

    @property
    def deflection(self) -> NDArray[np.intp]:
        """The vector of its first deflection, which is the only one if it has stages."""
        return self.deflections[0]

    @property
    def sway(self) -> NDArray[np.intp] | None:
        """Slots of the displacement that is added to its first deflection: cosines, then sines; else None."""
        wave = self.waves.get(self.form.law.arguments[0])
        return None if wave is None else wave.lines

    @property
    def varies(self) -> bool:
        """True if any of its numbers or deflections varies over the angle."""
        return bool(self.waves) or any(stage.waves for stage in self.stages)

    def parameters(self) -> Iterator[tuple[Parameter, int]]:
        """Iterate over the parameters of its stages on each side, and its own, with their slots."""
        for stage in self.stages:
            yield from zip(self.form.law.stage_parameters, stage.numbers.values(), strict=True)
        yield from zip(self.form.law.parameters, self.numbers.values(), strict=True)


@dataclass(frozen=True)
class CoefficientLayout:
    """The slot of each coefficient in the flat vector of a flow, and the computation of the vector."""

    assembled: Structure

    @cached_property
    def structure(self) -> Structure:
        """Structure with the plain parameters of the equations of motion, without an assembly."""
        return self.assembled.equations

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """The different orders of the excitation."""
        return tuple(sorted({order for load in self.structure.harmonics for order in load.orders if order}))

    @cached_property
    def _columns(self) -> int:
        return 2 * self.structure.size + len(self.structure.contacts) + 1 + 2 * len(self.orders)

    @property
    def cycles(self) -> tuple[CycleSlots, ...]:
        """Slots of each variation with two levels."""
        return self._variations[2]

    @cached_property
    def accelerations(self) -> NDArray[np.intp]:
        """Slots of ``[A | B | D_1 ... | m | a_1 ... | b_1 ...]``, shape (n, columns)."""
        n = self.structure.size
        return 1 + np.arange(n * self._columns).reshape(n, self._columns)

    @property
    def contacts(self) -> tuple[ContactSlots, ...]:
        """Slots of each contact."""
        return self._contacts[0]

    @cached_property
    def _contacts(self) -> tuple[tuple[ContactSlots, ...], NDArray[np.intp]]:
        """The slots of each contact, which follow those of the accelerations, and their places in the value vector."""
        s, n = self.structure, self.structure.size
        first, places, contacts = self._variations[0], [], []

        def slots_of(prefix: str, parameters: Sequence[Parameter]) -> dict[str, int]:
            start = first + len(places)
            places.extend(s.place(f"{prefix}.{each.name}") for each in parameters)
            return {each.name: start + offset for offset, each in enumerate(parameters)}

        by_place: dict[tuple[int, int], dict[str, Wave]] = {}
        for variation, wave in zip(s.variations, self._variations[1], strict=True):
            by_place.setdefault((variation.contact, variation.stage), {})[variation.name] = wave
        for index, form in enumerate(s.contacts):
            deflections = []
            for vector in form.vectors:
                deflections.append(first + len(places) + np.arange(n))
                places.extend(s.block(vector, n))
            prefixes = [form.stage_prefix(stage) for stage, _ in form.sides]
            stages = tuple(
                StageSlots(
                    *shape,
                    slots_of(prefix, form.law.stage_parameters),
                    by_place.get((index, form.stages.index(stage)), {}),
                )
                for prefix, shape, (stage, _) in zip(prefixes, form.shapes, form.sides, strict=True)
            )
            numbers = slots_of(form.name, form.law.parameters)
            push = self.accelerations[:, 2 * n + index]
            contacts.append(
                ContactSlots(form, tuple(deflections), push, stages, numbers, by_place.get((index, -1), {}))
            )
        return tuple(contacts), np.array(places, dtype=np.intp)

    @cached_property
    def _variations(self) -> tuple[int, tuple[Wave, ...], tuple[CycleSlots, ...]]:
        """The first slot after those of the variations, which follow the accelerations; waves, and cycles."""
        s, lines = self.structure, 2 * len(self.orders)
        first = 1 + s.size * self._columns
        places = first + np.arange(len(s.variations) * lines).reshape(len(s.variations), lines)
        first += places.size
        jumps = [number for number, load in enumerate(s.harmonics) if load.kind.has_levels]
        cycles = [
            CycleSlots(s.harmonics[number].order, *range(first + 4 * place, first + 4 * place + 4))
            for place, number in enumerate(jumps)
        ]
        waves = [
            Wave(row, tuple((jumps.index(load), factor) for load, factor in variation.loads if load in jumps))
            for variation, row in zip(s.variations, places, strict=True)
        ]
        return first + 4 * len(cycles), tuple(waves), tuple(cycles)

    @cached_property
    def reactions(self) -> NDArray[np.intp]:
        """Slots of the reactions, shape (reactions, columns): each is a sum over the columns of `accelerations`.

        They follow all other slots, and are 0 unless a contact is held; see `gapwalk.flow.constraints`.
        """
        shape = len(self.structure.reactions), self._columns
        return self._variations[0] + self._contacts[1].size + np.arange(shape[0] * shape[1]).reshape(shape)

    def __len__(self) -> int:
        """Number of coefficients."""
        return self._variations[0] + self._contacts[1].size + self.reactions.size

    @cached_property
    def _solved(self) -> dict[str, tuple[tuple[str, bytes, bytes], NDArray[Any]]]:
        """The last table, real and complex, with what it is for: along a load or a contact it stays the same."""
        return {}

    @cached_property
    def _mass_places(self) -> NDArray[np.intp]:
        """Places of the mass matrix in the value vector."""
        return self.structure.block("mass", self.structure.size, self.structure.size)

    @cached_property
    def _column_places(self) -> NDArray[np.intp]:
        """Places, in the value vector, of ``[K | C | d_1 ... | m | s_1 ...]``, with the shapes s of the loads."""
        s, n = self.structure, self.structure.size
        columns = [form.push for form in s.contacts]
        columns += ["mean", *(load.shape for load in s.driving)]
        matrices = s.block("stiffness", n, n), s.block("damping", n, n)
        return np.hstack([*matrices, *(s.block(name, n, 1) for name in columns)])

    def compute(self, values: NDArray[Any]) -> NDArray[Any]:
        """Compute the coefficients of the flow from the (real or complex) vector of parameter values."""
        table, values, places = self.table(values), self.assembled.expand(values), self._contacts[1]
        s, found = self.structure, np.empty(len(self), values.dtype)
        found[0] = 1.0 / values.item(0)
        first = table.shape[1] - 1 - len(s.driving)
        found[1 : 1 + s.size * self._columns].reshape(-1, self._columns)[:, :first] = table[:, :first]
        self._set_loads(found, table, self._load_lines(values))
        if s.variations:
            jumps = [number for number, load in enumerate(s.harmonics) if load.kind.has_levels]
            for cycle, number in zip(self.cycles, jumps, strict=True):
                numbers = map(values.item, self._load_places[number])
                found[[*cycle[1:]]] = s.harmonics[number].levels(values.item(0), numbers)
        first = self._variations[0]
        found[first : first + places.size] = values[places]
        found[first + places.size :] = 0.0
        return found

    @cached_property
    def frequency_enters(self) -> bool:
        """True if the frequency enters loads or other numbers, and not through 1/W alone."""
        return self.assembled.is_paced or any(load.depends_on_frequency for load in self.structure.harmonics)

    def moved_by_speed(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return a mask of the coefficients that loads with a factor over the speed change, at any speed.

        The factor may vanish at one speed, or stay the same in a part of its table, so that its slope there does not
        tell.
        """
        if not any(load.is_scaled for load in self.structure.harmonics):
            return np.zeros(len(self), dtype=bool)
        table, values, found = self.table(values), self.assembled.expand(values), np.zeros(len(self))
        lines = self._load_lines(values, only_factors=True)
        lines *= np.sqrt(np.arange(1.0, len(lines) + 1.0))[:, None]  # equal loads do not cancel
        self._set_loads(found, table, lines)
        return found != 0.0

    def _set_loads(self, found: NDArray[Any], table: NDArray[Any], lines: NDArray[Any]) -> None:
        """Set the accelerations by the loads, and the waves of what varies, from the lines of all loads."""
        s, count = self.structure, len(self.orders)
        first, last = table.shape[1] - 1 - len(s.driving), 1 + s.size * self._columns
        acting = lines[self._acting] if s.variations else lines
        found[1:last].reshape(-1, self._columns)[:, first:] = table[:, first:] @ acting
        if not s.variations:
            return
        waves = found[last : last + 2 * count * len(s.variations)].reshape(len(s.variations), 2 * count)
        waves[:] = 0.0
        for wave, variation in zip(waves, s.variations, strict=True):
            for load, factor in variation.loads:
                wave += factor * lines[1 + load, 1:]

    @cached_property
    def _acting(self) -> NDArray[np.intp]:
        """The rows of the lines of loads that act on coordinates; the first is the constant load."""
        return np.array([0, *(1 + row for row, load in enumerate(self.structure.harmonics) if not load.varies)])

    def _load_lines(self, values: NDArray[Any], *, only_factors: bool = False) -> NDArray[Any]:
        """Return the constant part, the cosines and the sines of each load, shape (loads, 1 + 2 orders).

        With `only_factors`, only the loads with a factor over the speed have lines, and those are without the factor.
        """
        harmonics, count = self.structure.harmonics, len(self.orders)
        lines = np.zeros((1 + len(harmonics), 1 + 2 * count), values.dtype)
        lines[0, 0] = not only_factors  # the constant load
        for row, (load, places) in enumerate(zip(harmonics, self._load_places, strict=True), start=1):
            if only_factors and not load.is_scaled:
                continue
            if only_factors:  # what is 0 at one speed may not be at another
                at = (values.item(0), *(point for points, _ in load.tables for point in points))
                given = [line for each in at for line in load.plain_lines(each, map(values.item, places))]
                given = [(order, abs(cosine), abs(sine)) for order, cosine, sine in given]
            else:
                given = load.lines(values.item(0), map(values.item, places))
            for order, cosine, sine in given:
                column = 1 + self.orders.index(order) if order else 0
                lines[row, column] += cosine
                if order:
                    lines[row, column + count] += sine
        return lines

    @cached_property
    def _load_places(self) -> list[list[int]]:
        """Places of the parameters of each load that repeats with the excitation."""
        return [[*map(self.structure.place, load.parameters)] for load in self.structure.harmonics]

    def table(self, values: NDArray[Any]) -> NDArray[Any]:
        """Compute ``M^-1 [K | C | d_1 ... | m | s_1 ...]``, with the shapes s of the loads, from the same vector."""
        assembly = self.assembled.assembly
        if assembly is not None:
            if (found := assembly.accelerations(values)) is not None:
                return found
            values = assembly.expand(values)
        mass, columns = values[self._mass_places], values[self._column_places]
        numbers = values.dtype.char, mass.tobytes(), columns.tobytes()
        known = self._solved.get(numbers[0])
        if known is None or known[0] != numbers:
            found = np.linalg.solve(mass, columns)
            found.setflags(write=False)
            known = numbers, found
            if columns.size <= _MOST_KEPT:
                self._solved[numbers[0]] = known
        return known[1]


@lru_cache(maxsize=256)
def layout_of(structure: Structure) -> CoefficientLayout:
    """Return the coefficient layout of a structure."""
    return CoefficientLayout(structure)


def coefficients_of(system: System) -> NDArray[np.float64]:
    """Return the coefficients of the flow for the values of `system`."""
    known = getattr(system, "_coefficients", None)
    if known is None:
        structure = system.structure
        if not (limits := structure.pace_limits).covers(pace := system[structure.pace]):
            raise OutsideError(
                f"{limits.words}; it has no value at {structure.pace} = {pace:.6g}. Extend the table, or stay within it"
            )
        known = layout_of(system.structure).compute(system.values)
        object.__setattr__(system, "_coefficients", known)
    return known


def load_sizes(system: System) -> dict[int, float]:
    """Return the amplitudes of the loads of a system by their orders; those of equal order add."""
    structure, values = system.structure.equations, system.structure.expand(system.values)
    sizes = dict[int, float]()
    for load in structure.driving:
        numbers = [values.item(structure.place(name)) for name in load.parameters]
        for order, cosine, sine in () if load.kind.has_levels else load.lines(values.item(0), numbers):
            sizes[order] = sizes.get(order, 0.0) + math.hypot(cosine, sine)
    return sizes


def static_load(system: System) -> NDArray[np.float64]:
    """Return the constant load of a system: its mean, and the constant parts of its other loads; shape (n,)."""
    system = system.equations
    total, structure = system.vector("mean"), system.structure
    constant = [load for load in structure.driving if 0 in load.orders]
    if constant:
        coefficients_of(system)
    for load in constant:
        lines = load.lines(system.frequency, [system[name] for name in load.parameters])
        total = total + sum(line.cosine for line in lines if not line.order) * system.vector(load.shape)
    return total


def period_of(system: System, value: float) -> tuple[float, float]:
    """Return the first coefficient, 1/W, at a value of the first parameter, and its derivative by it."""
    unit = system.structure.frequency
    return 1.0 / (unit * value), -1.0 / (unit * value**2)


@dataclass(frozen=True)
class ParameterLine:
    """The systems that differ from one another by the value of one named parameter.

    Examples
    --------
    >>> gw.methods.ParameterLine(system, "stop.clearance").system_at(0.5).parameters["stop.clearance"]
    0.5
    """

    system: System  #: The system, with any value of the parameter.
    name: str  #: Name of the parameter.

    @cached_property
    def _place(self) -> int:
        return self.system.structure.place(self.name)

    @cached_property
    def _only_period(self) -> bool:
        """True if the parameter is the frequency, and enters through 1/W alone."""
        return self._place == 0 and not layout_of(self.system.structure).frequency_enters

    def system_at(self, value: float) -> System:
        """Return the system at one value of the parameter; unlike `System.at`, without checks."""
        system = System.beside(self.system, self._place, value)
        if self._only_period:  # cheap here, costly to compute later
            coefficients = coefficients_of(self.system).copy()
            coefficients[0] = period_of(self.system, value)[0]
            object.__setattr__(system, "_coefficients", coefficients)
        return system

    def coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the coefficients at one value of the parameter, and their derivative by the parameter.

        Returns
        -------
        coefficients : array, shape (coefficients,)
            The coefficients, in consistent units.
        slopes : array, shape (coefficients,)
            Their derivative by the parameter.
        """
        if self._only_period:  # by far the most frequent parameter of continuation
            base = coefficients_of(self.system)
            coefficients, slope = base.copy(), np.zeros(len(base))
            coefficients[0], slope[0] = period_of(self.system, value)
            return coefficients, slope
        coefficients, slopes = _with_slopes(self.system, {self._place: value})
        return coefficients, slopes[0]


def _with_slopes(system: System, changed: Mapping[int, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the coefficients with other values at some places, and the derivatives by each of those, in rows."""
    # beyond a table over the speed, for steps of Newton's method that pass its end, its last piece goes on
    layout, values, found = layout_of(system.structure), system.values.astype(complex), []
    values[[*changed]] = [*changed.values()]
    for place, value in changed.items():
        values[place] = complex(value, _STEP)
        found.append(layout.compute(values))
        values[place] = value
    return found[0].real.copy(), np.array([each.imag for each in found]) / _STEP


def varying(system: System, names: Sequence[str | tuple[str, ...]]) -> list[NDArray[np.bool_]]:
    """Return masks of the coefficients that each named parameter, or each of several, can change, at any values.

    A slope may be zero at one point by coincidence, as that of a cosine at 0 or of a product whose other factor is 0.
    """
    if not names:
        return []
    groups = [(each,) if isinstance(each, str) else each for each in names]
    places = [system.structure.place(name) for name in chain(*groups)]
    moved = system.values.copy()
    moved[places] += _ASIDE * (1.0 + np.abs(moved[places]))
    return [np.any([_varied(system, moved, name) for name in group], axis=0) for group in groups]


def _varied(system: System, moved: NDArray[np.float64], name: str) -> NDArray[np.bool_]:
    """Return the coefficients that one parameter changes at the values of a system or at others."""
    return _varied_at(system.structure, system.values.tobytes(), moved.tobytes(), name)


@lru_cache(maxsize=1024)  # a gradient asks for the same thirty parameters of a train many times
def _varied_at(structure: Structure, values: bytes, moved: bytes, name: str) -> NDArray[np.bool_]:
    both = [System.from_values(structure, np.frombuffer(each)) for each in (values, moved)]
    lines = [ParameterLine(each, name) for each in both]
    mask = np.any([line.coefficients(line.system[name])[1] != 0.0 for line in lines], axis=0)
    if structure.place(name) == 0:
        mask |= layout_of(structure).moved_by_speed(both[0].values)
    mask.setflags(write=False)
    return mask


@dataclass(frozen=True)
class ParameterPlane:
    """The systems that differ from one another by the values of two named parameters, or of more, or of one."""

    system: System
    names: tuple[str, ...]

    @cached_property
    def _line(self) -> ParameterLine:
        return ParameterLine(self.system, self.names[0])

    @cached_property
    def _places(self) -> list[int]:
        return [self.system.structure.place(name) for name in self.names]

    def system_at(self, *point: float) -> System:
        """Return the system at one value of each parameter; unlike `System.at`, without checks."""
        values = self.system.values.copy()
        values[self._places] = point
        return System.from_values(self.system.structure, values)

    def coefficients(self, *point: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the coefficients at one value of each parameter, and their derivatives by each, in rows."""
        if len(point) == 1:
            coefficients, slope = self._line.coefficients(*point)
            return coefficients, slope[None]
        return _with_slopes(self.system, dict(zip(self._places, point, strict=True)))


# Dependence of the equations of a system on the angle of its excitation: by loads, or by numbers that vary.


def loads_act(system: System) -> bool:
    """Return True if a load that depends on the angle acts on a system."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    first = 2 * layout.structure.size + len(layout.structure.contacts) + 1
    return bool(coefficients[layout.accelerations[:, first:]].any() or layout.cycles)


def numbers_vary(system: System) -> bool:
    """Return True if a number of a system varies over the angle."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    waves = [wave for slots in layout.contacts for wave in slots.waves.values()]
    waves += [wave for slots in layout.contacts for stage in slots.stages for wave in stage.waves.values()]
    return any(coefficients[wave.lines].any() or wave.cycles for wave in waves)


# Homotopy: a path from some values of parameters to others as one more parameter, continued like any other.

WAY = "way"
"""The name of the parameter: 0 at the first values, 1 at the others."""


@dataclass(frozen=True)
class PathAssembly:
    """Parameters that move together, linearly, while the path parameter goes from 0 to 1.

    Its own numbers are those of the system, then the path parameter, then the final value of each parameter. As they
    are numbers, all paths of the same parameters share one compiled flow.
    """

    structure: Structure  #: The structure of the system.
    moved: tuple[str, ...]  #: The names of the parameters without the frequency, by which everything is scaled.

    @property
    def names(self) -> ParameterNames:
        """Names of the system's parameters, of the path parameter, and ``way.`` with each moved parameter."""
        inner = self.structure.names
        blocks = (NameBlock(WAY), *(NameBlock(f"{WAY}.{name}") for name in self.moved))
        return replace(inner, blocks=(*inner.blocks, *blocks))

    @property
    def units(self) -> Units | None:
        """The units of the system's parameters."""
        return self.structure.units

    @property
    def is_paced(self) -> bool:
        """See `Assembly.is_paced`."""
        return self.structure.is_paced

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion."""
        return self.structure.expand(self.inner(values))

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the accelerations of the system; see `Assembly.accelerations`."""
        return layout_of(self.structure).table(self.inner(values))

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the values of the system at this point of the path."""
        yield from value_problems(self.structure, self.inner(values))

    def inner(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the system at this point of the path."""
        size, count = len(self.structure.names), len(self.moved)
        found, share, ends = values[:size].copy(), values[size], values[size + 1 : size + 1 + count]
        found[self._places] += share * (ends - found[self._places])
        return found

    @cached_property
    def _places(self) -> list[int]:
        return [self.structure.place(name) for name in self.moved]


def on_the_way(system: System, to: Mapping[str, float]) -> System:
    """Add a parameter ``way`` to a system: at 0 it is the given system, at 1 some parameters have other values."""
    system.at(to)
    structure = system.structure
    if structure.pace in to:
        raise ModelError(
            f"{structure.pace} cannot vary together with other parameters: time is scaled by it; follow it alone"
        )
    if isinstance(structure.assembly, PathAssembly):
        raise ModelError("the system already has a parameter path; start from the system without one")
    assembly = PathAssembly(structure, tuple(to))
    whole = Structure(structure.coordinates, structure.contacts, structure.harmonics, assembly)
    return System.from_values(whole, np.concatenate((system.values, [0.0], list(to.values()))))
