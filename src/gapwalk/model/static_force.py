"""Forces of contacts at rest, by any law: evaluated at a position, with exact derivatives for small motions about it.

Dry friction is left out, for at rest it may have any force up to its limit; a rigid stop is open. What varies over the
angle has its mean value: prescribed displacements are 0.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import ContactSlots, coefficients_of, layout_of
from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import Stages, StageTerms
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS
from gapwalk.model.laws.law import Symbols
from gapwalk.model.system import System

_STEP, _LONGER_STEP = 1e-150, 1e-140  # of the complex step


class Tangent(NamedTuple):
    """A force at rest and what it changes by in small motions."""

    force: NDArray[np.float64]  #: shape (...): The force.
    #: stiffness, damping: shape (..., deflections): Its derivatives by each deflection, and by the rate of each.
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]

    @property
    def is_finite(self) -> Any:
        """True where the force and its derivatives are finite: a Boolean, or an array of them of shape (...)."""
        return np.isfinite(np.concatenate((self.stiffness, self.damping), axis=-1)).all(axis=-1)


@dataclass(frozen=True, eq=False)
class StaticForce:
    """The force of a contact, by any law."""

    slots: ContactSlots  #: The contact.
    deflections: NDArray[np.float64]  #: shape (deflections, n): A vector for each deflection of the law.
    #: shape (n,): The vector along which it acts, on the left-hand side of the equations of motion.
    direction: NDArray[np.float64]
    _coefficients: NDArray[np.float64]

    @property
    def form(self) -> ContactForm:
        """The contact without its numbers."""
        return self.slots.form

    @property
    def is_formula(self) -> bool:
        """True if it is a formula of deflections and rates: it has no stages, and is no dry friction."""
        return not (self.form.law.stage_parameters or self.form.law.is_dry)

    def at(self, q: NDArray[np.float64], v: NDArray[np.float64] | None = None) -> Tangent:
        """Evaluate the force and its derivatives, at rest by default; NaN where it has no value.

        Shapes: `q`, `v` (..., n).
        """
        return self.by_deflections(q @ self.deflections.T, (np.zeros_like(q) if v is None else v) @ self.deflections.T)

    def by_deflections(self, deflections: NDArray[np.float64], rates: NDArray[np.float64] | None = None) -> Tangent:
        """Evaluate the force and its derivatives for deflections and their rates, shape (..., deflections)."""
        moves = np.concatenate((deflections, np.zeros_like(deflections) if rates is None else rates), axis=-1)
        found = self._at(moves)
        if (
            found.ndim > 1 and self.form.law.mode_count
        ):  # of one state, the part of a formula that is switched off may be infinite
            for place in map(tuple, np.argwhere(~np.isfinite(found).all(axis=-1))):
                found[place] = self._at(moves[place])
        count = len(self.deflections)
        return Tangent(found[..., 0], found[..., 1 : 1 + count], found[..., 1 + count :])

    def _at(self, moves: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the force and its derivatives by all deflections and rates, in this order, along the last axis."""
        with np.errstate(all="ignore"):
            # without a step first: the logarithm of a negative number is complex, not NaN
            force = np.broadcast_to(np.real(self._force(moves)), moves.shape[:-1])
            slopes = self._slopes(moves, _STEP)
            # at its end the square root has no slope: it grows as the step shrinks, as rounding of a polynomial's may
            if moves.ndim == 1 and self.polynomial is None:
                slopes[np.abs(slopes) > (1.0 + 1e-6) * np.abs(self._slopes(moves, _LONGER_STEP))] = np.nan
        found = np.concatenate((force[..., None], slopes), axis=-1)
        found[~np.isfinite(force)] = np.nan
        return found

    def _slopes(self, moves: NDArray[np.float64], step: float) -> NDArray[np.float64]:
        columns = [np.imag(self._force(moves + 1j * step * way)) / step for way in np.eye(moves.shape[-1])]
        return np.stack([np.broadcast_to(column, moves.shape[:-1]) for column in columns], axis=-1)

    def _force(self, moves: NDArray[Any]) -> Any:
        """Evaluate the law for deflections, then their rates, along the last axis."""
        stages, columns = [], list(np.moveaxis(moves, -1, 0))
        for stage, numbers in zip(self.slots.stages, self._numbers[1], strict=True):
            depth = columns[0] - stage.sign * numbers["clearance"]
            closed = stage.sign * np.real(depth) > 0.0
            stages.append(StageTerms(stage.sign, depth * closed, closed * 1.0, stage.innermost, numbers))
        return self._law(columns, self._numbers[0], stages)

    def _law(self, moves: Sequence[Any], numbers: Mapping[str, Any], stages: Sequence[StageTerms]) -> Any:
        law, count = self.form.law, len(self.deflections)
        if law.is_dry:  # at rest it may have any force up to its limit; it is left out
            return 0.0 * moves[0]
        named = dict(zip(law.arguments, zip(moves[:count], moves[count:], strict=True), strict=True))
        modes: list[Any] = [0.0] * law.mode_count
        found = Stages(stages, deflections=named, modes=modes, functions=NUMPY_FUNCTIONS)
        for mode in range(law.mode_count):  # a guard may depend on earlier modes
            modes[mode] = (np.real(law.guards(moves[count], found, numbers)[mode]) > 0.0) * 1.0
        return law.force(moves[count], found, numbers)

    @cached_property
    def _numbers(self) -> tuple[dict[str, float], list[dict[str, float]]]:
        """The parameters of the contact as a whole, and of its stages."""

        def values(slots: Mapping[str, int]) -> dict[str, float]:
            return {name: self._coefficients[slot] for name, slot in slots.items()}

        return values(self.slots.numbers), [values(stage.numbers) for stage in self.slots.stages]

    @property
    def clearances(self) -> list[float]:
        """The clearance of each stage on each side."""
        return [float(numbers["clearance"]) for numbers in self._numbers[1]]

    @cached_property
    def polynomial(self) -> dict[tuple[int, ...], float] | None:
        """The factors of a formula by the powers of all deflections, then of all rates; None if it is no polynomial."""
        return self._factors(range(2 * len(self.deflections)))

    @cached_property
    def statics(self) -> dict[tuple[int, ...], float] | None:
        """The factors of a formula at rest by the powers of all deflections; None if it is no polynomial there."""
        return self._factors(range(len(self.deflections)))

    def _factors(self, places: range) -> dict[tuple[int, ...], float] | None:
        """Evaluate a formula with symbols for the first of its deflections and rates, and zero for the others."""
        if not self.is_formula:
            return None
        moves = [*map(Symbols.of, places), *[0.0] * (2 * len(self.deflections) - len(places))]
        found: dict[tuple[int, ...], float] = defaultdict(float)
        try:
            with np.errstate(all="ignore"):
                force = self._law(moves, {name: float(value) for name, value in self._numbers[0].items()}, [])
                products = (force + Symbols({})).products
        except (TypeError, ValueError, AttributeError, ArithmeticError):  # another operation than a sum or a product
            return None
        for product, factor in products.items():
            powers = (product.count((place,)) for place in places)
            found[tuple(powers)] += factor
        return dict(found) if np.isfinite([*found.values()]).all() else None

    @property
    def is_linear(self) -> bool:
        """True if it is a formula without products of deflections and rates."""
        return self.polynomial is not None and all(sum(powers) <= 1 for powers in self.polynomial)

    @property
    def is_linear_at_rest(self) -> bool:
        """True if it is a formula that has no products of deflections as long as all rates are zero."""
        return self.statics is not None and all(sum(powers) <= 1 for powers in self.statics)


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
    system: System, q: NDArray[np.float64] | None = None, *, strict: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the stiffness and damping of the formulas for small motions about a position, each shape (n, n).

    By default about zero.
    """
    n = system.size
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for each in formulas_of(system):
        tangent = each.at(np.zeros(n) if q is None else q)
        if not tangent.is_finite:
            if not strict:
                continue
            where = "at zero deflection" if q is None else "at rest"
            raise ModelError(
                f"the force {each.form.name!r} has no finite value and slope {where}: {each.form.law.name} "
                f"{getattr(each.form.law, 'text', '')!r}"
            )
        stiffness += np.outer(each.direction, tangent.stiffness @ each.deflections)
        damping += np.outer(each.direction, tangent.damping @ each.deflections)
    return stiffness, damping
