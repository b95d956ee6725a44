"""Forces of contacts at rest, by any law: evaluated at a position, with exact derivatives for small motions about it.

What varies over the angle has its mean value: prescribed displacements are 0.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.laws import Stages, StageTerms
from gapwalk.model.laws.closed_form import Symbols
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System

_STEP = 1e-150  # of the complex step


class Tangent(NamedTuple):
    """A force at rest and what it changes by in small motions.

    Attributes
    ----------
    force : shape (...)
        The force.
    stiffness, damping : shape (..., deflections)
        Its derivatives by each deflection, and by the rate of each.
    """

    force: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]

    @property
    def is_finite(self) -> NDArray[np.bool_]:
        """True where the force and its derivatives are finite, shape (...)."""
        return np.isfinite(self.stiffness).all(axis=-1) & np.isfinite(self.damping).all(axis=-1)


@dataclass(frozen=True, eq=False)
class StaticForce:
    """The force of a contact, by any law.

    Attributes
    ----------
    slots
        The contact.
    deflections : shape (deflections, n)
        A vector for each deflection of the law.
    direction : shape (n,)
        The vector along which it acts, on the left-hand side of the equations of motion.
    """

    slots: ContactSlots
    deflections: NDArray[np.float64]
    direction: NDArray[np.float64]
    _coefficients: NDArray[np.float64]

    @property
    def form(self) -> ContactForm:
        """The contact without its numbers."""
        return self.slots.form

    @property
    def is_formula(self) -> bool:
        """True if it has no stages."""
        return not self.form.law.stage_parameters

    def at(self, q: NDArray[np.float64], v: NDArray[np.float64] | None = None) -> Tangent:
        """Evaluate the force and its derivatives, at rest by default; NaN where it has no value.

        Parameters
        ----------
        q, v : shape (..., n)
            Positions and velocities.
        """
        moves = q @ self.deflections.T, (np.zeros_like(q) if v is None else v) @ self.deflections.T
        found = self._at(np.concatenate(moves, axis=-1))
        if found.ndim > 1:  # of one state, the part of a formula that is switched off may be infinite
            for place in np.argwhere(~np.isfinite(found).all(axis=-1)):
                found[tuple(place)] = self._at(np.concatenate([each[tuple(place)] for each in moves]))
        count = len(self.deflections)
        return Tangent(found[..., 0], found[..., 1 : 1 + count], found[..., 1 + count :])

    def _at(self, moves: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the force and its derivatives by all deflections and rates, in this order, along the last axis."""
        columns = []
        with np.errstate(all="ignore"):
            # without a step first: the logarithm of a negative number is complex, not NaN
            columns.append(np.broadcast_to(self._force(moves), moves.shape[:-1]))
            for step in 1j * _STEP * np.eye(moves.shape[-1]):
                columns.append(np.broadcast_to(np.imag(self._force(moves + step)) / _STEP, moves.shape[:-1]))
        found = np.stack(columns, axis=-1)
        found[~np.isfinite(found[..., 0])] = np.nan
        return found

    def _force(self, moves: NDArray[Any]) -> Any:
        """Evaluate the law for deflections, then their rates, along the last axis."""
        law, stages, count = self.form.law, [], len(self.deflections)
        columns = list(np.moveaxis(moves, -1, 0))
        deflections, rates = columns[:count], columns[count:]
        for stage, numbers in zip(self.slots.stages, self._numbers[1], strict=True):
            depth = deflections[0] - stage.sign * numbers["clearance"]
            closed = stage.sign * np.real(depth) > 0.0
            stages.append(StageTerms(stage.sign, depth * closed, closed * 1.0, stage.innermost, numbers))
        named = dict(zip(law.arguments, zip(deflections, rates, strict=True), strict=True))
        modes: list[Any] = [0.0] * law.mode_count
        found = Stages(stages, deflections=named, modes=modes, functions=NUMPY_FUNCTIONS)
        for mode in range(law.mode_count):  # a guard may depend on earlier modes
            modes[mode] = (np.real(law.guards(rates[0], found, self._numbers[0])[mode]) > 0.0) * 1.0
        return law.force(rates[0], found, self._numbers[0])

    @cached_property
    def _numbers(self) -> tuple[dict[str, float], list[dict[str, float]]]:
        """The parameters of the contact as a whole, and of its stages."""

        def values(slots: Mapping[str, int]) -> dict[str, float]:
            return {name: self._coefficients[slot] for name, slot in slots.items()}

        return values(self.slots.numbers), [values(stage.numbers) for stage in self.slots.stages]

    @cached_property
    def polynomial(self) -> dict[tuple[int, ...], float] | None:
        """The factors of a formula by the powers of all deflections, then of all rates; None if it is no polynomial."""
        law, found = self.form.law, defaultdict(float)
        if not self.is_formula or law.mode_count:
            return None
        count = len(law.arguments)
        places = range(count)
        moves = {
            name: (Symbols.of(place), Symbols.of(place + count))
            for name, place in zip(law.arguments, places, strict=True)
        }
        stages = Stages([], deflections=moves, functions=NUMPY_FUNCTIONS)
        try:
            numbers = {name: float(value) for name, value in self._numbers[0].items()}
            force = law.force(next(iter(moves.values()))[1], stages, numbers) + Symbols({})
        except (TypeError, ValueError, AttributeError, ArithmeticError):  # another operation than a sum or a product
            return None
        for product, factor in force.products.items():
            powers = [sum(symbol == (place,) for symbol in product) for place in range(2 * count)]
            found[tuple(powers)] += factor
        return dict(found)

    @property
    def is_linear(self) -> bool:
        """True if it is a formula without products of deflections and rates, and without a constant."""
        return self.polynomial is not None and all(sum(powers) == 1 for powers in self.polynomial)


def static_forces_of(system: System) -> tuple[StaticForce, ...]:
    """Return the static forces of all contacts of a system."""
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    return tuple(
        StaticForce(slots, coefficients[np.array(slots.deflections)], system.vector(slots.form.push), coefficients)
        for slots in layout.contacts
    )


def formulas_of(system: System) -> tuple[StaticForce, ...]:
    """Return the static forces by formulas of a system."""
    if all(form.law.stage_parameters for form in system.structure.contacts):
        return ()
    return tuple(each for each in static_forces_of(system) if each.is_formula)


def formula_matrices(
    system: System, q: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute what the formulas add to stiffness and damping for small motions about a position, each shape (n, n).

    By default about zero.

    Raises
    ------
    ModelError
        If a formula has no finite value or slope there; the message names it.
    """
    n = system.size
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for each in formulas_of(system):
        tangent = each.at(np.zeros(n) if q is None else q)
        if not tangent.is_finite:
            where = "at zero deflection" if q is None else "at rest"
            raise ModelError(
                f"the force {each.form.name!r} has no finite value and slope {where}: {each.form.law.name} "
                f"{getattr(each.form.law, 'text', '')!r}"
            )
        stiffness += np.outer(each.direction, tangent.stiffness @ each.deflections)
        damping += np.outer(each.direction, tangent.damping @ each.deflections)
    return stiffness, damping
