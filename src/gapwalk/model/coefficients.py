"""From named parameters to the coefficients of the equations of motion, with exact derivatives.

The compiled flow knows nothing of names. It integrates, over ``theta = W t``,

    q' = r v
    v' = r [ -A q - B v - sum_k D_k f_k(e_k . q, e_k . v) + m + sum_h (a_h cos h theta + b_h sin h theta) ]

with ``r = 1/W``, ``A = M^-1 K``, ``B = M^-1 C``, ``D_k = M^-1 d_k``, and so on. Those numbers, and the
breakpoints and springs of the contacts, are its coefficients. Their derivative by any named parameter comes
from one evaluation with a complex step (Squire and Trapp 1998, SIAM Review 40, 110-112), exact to rounding:
no hand-written derivative to get wrong, whatever the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.structure import Structure
from gapwalk.model.system import System

_ASIDE = 0.0123  # relative shift of parameters at which no slope vanishes by chance
_STEP = 1e-150  # of the complex step: its square must underflow against every coefficient, itself not


@dataclass(frozen=True, slots=True)
class StageSlots:
    """Where the coefficients of one stage on one side stand."""

    sign: int
    clearance: int
    stiffness: int
    cubic: int


@dataclass(frozen=True, eq=False, slots=True)
class ContactSlots:
    """Where the coefficients of one contact stand: arrays of shape (n,), its stages, its damping."""

    deflection: NDArray[np.intp]
    force: NDArray[np.intp]
    stages: tuple[StageSlots, ...]
    damping: int | None


@dataclass(frozen=True)
class CoefficientLayout:
    """Where each coefficient of the flow stands in its flat vector, and how the vector is made."""

    assembled: Structure

    @cached_property
    def structure(self) -> Structure:
        """The structure whose numbers are those of the equations of motion."""
        return self.assembled.equations

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """The different orders of the excitation."""
        return tuple(sorted({harmonic.order for harmonic in self.structure.harmonics}))

    @cached_property
    def _columns(self) -> int:
        return 2 * self.structure.size + len(self.structure.contacts) + 1 + 2 * len(self.orders)

    @cached_property
    def accelerations(self) -> NDArray[np.intp]:
        """Slots of ``[A | B | D_1 ... | m | a_1 ... | b_1 ...]``, shape (n, columns)."""
        n = self.structure.size
        return 1 + np.arange(n * self._columns).reshape(n, self._columns)

    @cached_property
    def contacts(self) -> tuple[ContactSlots, ...]:
        """Slots of each contact."""
        n = self.structure.size
        free = 1 + n * self._columns
        slots = []
        for index, form in enumerate(self.structure.contacts):
            deflection = free + np.arange(n)
            free += n
            stages = []
            for stage in form.stages:
                for sign in stage.side.signs:
                    stages.append(StageSlots(sign, free, free + 1, free + 2))
                    free += 3
            damping = free if form.damping_name else None
            free += damping is not None
            force = self.accelerations[:, 2 * n + index]
            slots.append(ContactSlots(deflection, force, tuple(stages), damping))
        return tuple(slots)

    @cached_property
    def _linear_places(self) -> NDArray[np.intp]:
        """Places, in the value vector, of ``[K | C | d_1 ... | m]``, shape (n, 2n + contacts + 1)."""
        s, n = self.structure, self.structure.size
        blocks = [s.block("stiffness", n, n), s.block("damping", n, n)]
        for form in s.contacts:
            which = "deflection" if form.reciprocal else "force"
            blocks.append(s.block(f"{form.name}.{which}", n, 1))
        blocks.append(s.block("mean", n, 1))
        return np.hstack(blocks)

    @cached_property
    def _contact_places(self) -> NDArray[np.intp]:
        s, n = self.structure, self.structure.size
        places: list[int] = []
        for form in s.contacts:
            places.extend(s.block(f"{form.name}.deflection", n))
            for stage in form.stages:
                first = s.place(f"{form.stage_prefix(stage)}.clearance")
                places.extend([first, first + 1, first + 2] * len(stage.side.signs))
            if form.damping_name:
                places.append(s.place(f"{form.name}.{form.damping_name}"))
        return np.array(places, dtype=np.intp)

    @cached_property
    def _harmonic_places(self):
        s, n = self.structure, self.structure.size
        first = np.array([s.place(f"{harmonic.name}.amplitude") for harmonic in s.harmonics], dtype=np.intp)
        shapes = (first[:, None] + 2 + np.arange(n)).astype(np.intp)
        select = np.array([[h.order == order for h in s.harmonics] for order in self.orders], dtype=float)
        return first, first + 1, shapes, select.reshape(len(self.orders), len(s.harmonics))

    def compute(self, values: NDArray[Any]) -> NDArray[Any]:
        """The coefficients of the flow from the (real or complex) vector of parameter values."""
        table, values = self.table(values), self.assembled.expand(values)
        amplitude, phase, _, select = self._harmonic_places
        linear, shape = np.split(table, [table.shape[1] - len(self.structure.harmonics)], axis=1)
        size, angle = values[amplitude], values[phase]
        cosines = shape @ (select * (size * np.cos(angle))).T
        sines = shape @ (select * (size * -np.sin(angle))).T
        accelerations = np.concatenate((linear, cosines, sines), axis=1)
        return np.concatenate(([1.0 / values[0]], accelerations.ravel(), values[self._contact_places]))

    def table(self, values: NDArray[Any]) -> NDArray[Any]:
        """``M^-1 [K | C | d_1 ... | m | s_1 ...]`` with the shapes s of the harmonics, from the same vector."""
        if self.assembled.assembly:
            return self.assembled.assembly.accelerations(values)
        n, shapes = self.structure.size, self._harmonic_places[2]
        mass, loads = values[self.structure.block("mass", n, n)], values[self._linear_places]
        return np.linalg.solve(mass, np.concatenate((loads, values[shapes].T), axis=1))


@lru_cache(maxsize=256)
def layout_of(structure: Structure) -> CoefficientLayout:
    """The coefficient layout of a structure."""
    return CoefficientLayout(structure)


def coefficients_of(system: System) -> NDArray[np.float64]:
    """The coefficients of the flow for the values of `system`."""
    known = getattr(system, "_coefficients", None)
    if known is None:
        known = layout_of(system.structure).compute(system.values)
        object.__setattr__(system, "_coefficients", known)
    return known


def period_of(system: System, value: float) -> tuple[float, float]:
    """The first coefficient, 1/W, at a value of the first parameter, and its derivative by that."""
    unit = system.structure.frequency
    return 1.0 / (unit * value), -1.0 / (unit * value**2)


@dataclass(frozen=True)
class ParameterLine:
    """The systems that differ from one another by the value of one named parameter."""

    system: System
    name: str

    @cached_property
    def _place(self) -> int:
        return self.system.structure.place(self.name)

    @cached_property
    def _base(self) -> NDArray[np.float64]:
        return coefficients_of(self.system)

    def system_at(self, value: float) -> System:
        """The system of the line at one value of the parameter; unlike `System.at`, it trusts the value."""
        system = System.beside(self.system, self._place, value)
        if self._place == 0:  # cheap here, costly to compute later
            object.__setattr__(system, "_coefficients", self.coefficients(value)[0])
        return system

    def coefficients(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The coefficients at one value of the parameter, and their derivative by it."""
        if self._place == 0:  # the frequency enters through 1/W alone: by far the most frequent line to walk
            coefficients, slope = self._base.copy(), np.zeros_like(self._base)
            coefficients[0], slope[0] = period_of(self.system, value)
            return coefficients, slope
        values = self.system.values.astype(complex)
        values[self._place] = complex(value, _STEP)
        both: NDArray[np.complex128] = layout_of(self.system.structure).compute(values)
        return both.real.copy(), both.imag / _STEP


def varying(system: System, names: Sequence[str]) -> list[NDArray[np.bool_]]:
    """For each named parameter the coefficients that it can change, wherever it and the others go.

    A slope may be zero at one place by chance, as that of a cosine at 0 or of a product whose other factor is 0.
    """
    if not names:
        return []
    places = [system.structure.place(name) for name in names]
    moved = system.values.copy()
    moved[places] += _ASIDE * (1.0 + np.abs(moved[places]))
    masks = []
    for name in names:
        lines = [ParameterLine(each, name) for each in (system, System.from_values(system.structure, moved))]
        masks.append(np.any([line.coefficients(line.system[name])[1] != 0.0 for line in lines], axis=0))
    return masks


@dataclass(frozen=True)
class ParameterPlane:
    """The systems that differ from one another by the values of two named parameters."""

    system: System
    names: tuple[str, str]

    @cached_property
    def _places(self) -> tuple[int, int]:
        first, second = self.names
        return self.system.structure.place(first), self.system.structure.place(second)

    def system_at(self, first: float, second: float) -> System:
        """The system of the plane at one value of each parameter; unlike `System.at`, it trusts the values."""
        values = self.system.values.copy()
        values[list(self._places)] = first, second
        return System.from_values(self.system.structure, values)

    def coefficients(self, first: float, second: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The coefficients at one value of each parameter, and their derivatives by the two, one in each row."""
        values = self.system.values.astype(complex)
        values[list(self._places)] = first, second
        layout, first_place, second_place = layout_of(self.system.structure), *self._places
        values[first_place] += 1j * _STEP
        by_first: NDArray[np.complex128] = layout.compute(values)
        values[first_place] = first
        values[second_place] += 1j * _STEP
        by_second: NDArray[np.complex128] = layout.compute(values)
        return by_first.real.copy(), np.array((by_first.imag, by_second.imag)) / _STEP
