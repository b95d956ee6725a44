"""The unit of length in which a motion is integrated: tolerances of the integrator are absolute below 1.

A gap of 50 micrometres in a model in metres is far below 1, and so are motions of the size 1e-9. Their flow is
integrated in a power of two of the model's own unit, so that scaling causes no rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.laws import CLEARANCE
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.model.units import QuantityKind

_LARGE = 0.01  # size from which motions are integrated in the unit of the model


class LengthUnit:
    """Conversion of coefficients of one layout to another unit of length, and the choice of the unit for a motion."""

    def __init__(self, layout: CoefficientLayout) -> None:
        n, forms, self._layout = layout.structure.size, layout.structure.contacts, layout
        self._size = n
        self._loads = layout.accelerations[:, 2 * n + len(forms) :].ravel()
        self._stiffness, self._damping = layout.accelerations[:, :n], layout.accelerations[:, n : 2 * n]
        self._contacts = layout.accelerations[:, 2 * n : 2 * n + len(forms)]
        numbers = [pair for contact in layout.contacts for pair in contact.parameters()]
        self._clearances = _slots(slot for parameter, slot in numbers if parameter == CLEARANCE)
        self._sways = _slots(slot for contact in layout.contacts for slot in _displacements(contact))
        self._springs = _slots(slot for parameter, slot in numbers if parameter.kind is QuantityKind.STIFFNESS)
        powers = [(slot, parameter.growth) for parameter, slot in numbers if parameter != CLEARANCE]
        self._scaled = [
            (_slots(slot for slot, each in powers if each == power), power)
            for power in sorted({power for _, power in powers if power})
        ]

    def natural(self, coefficients: NDArray[np.float64]) -> float:
        """Return the smaller of the smallest clearance and the amplitude of a free mass under the loads.

        It is 1 if both are 0. A clearance that is negligible compared with the motion does not determine its size: in
        a unit of it, rounding alone would move the motion from one side of such a gap to the other.
        """
        clearances, time = coefficients[self._clearances], coefficients[0]
        gap = float(clearances[clearances > 0.0].min(initial=np.inf))
        load = float(np.abs(coefficients[self._loads]).max(initial=0.0))
        moved = max(load * time**2, float(np.abs(coefficients[self._sways]).max(initial=0.0)))
        if gap < moved:  # then no smaller than the motion against springs, dampers and closed contacts
            damping, stiffness, contacts, springs = (
                float(np.abs(coefficients[slots]).max(initial=0.0))
                for slots in (self._damping, self._stiffness, self._contacts, self._springs)
            )
            gap = max(gap, load / (1.0 / time**2 + (contacts * springs + damping / time + stiffness)))
        return min((size for size in (moved, gap) if 0.0 < size < np.inf), default=1.0)

    def of_motion(self, coefficients: NDArray[np.float64], state: NDArray[np.float64]) -> float:
        """Return the unit for the motion from a state: 1 unless it is small."""
        half, numbers = self._size, state[: 2 * self._size].tolist()
        if max(map(abs, numbers[:half])) >= _LARGE:
            return 1.0
        size = max(*map(abs, numbers[:half]), coefficients[0] * max(map(abs, numbers[half:])))
        size = max(size, self.natural(coefficients))
        return 1.0 if not size < _LARGE else 2.0 ** round(math.log2(size))

    def carried(self, coefficients: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
        """Convert the coefficients of a system, or of a direction of systems, to lengths in that unit."""
        scaled = coefficients.copy()
        for first in range(0, scaled.shape[-1] - 2, len(self._layout)):  # of a ramp also their growth with the speed
            scaled[..., first + self._loads] /= unit
        scaled[..., self._clearances] /= unit
        scaled[..., self._sways] /= unit
        for slots, power in self._scaled:
            scaled[..., slots] *= unit**power
        return scaled


def _displacements(contact: ContactSlots) -> Iterator[int]:
    """Iterate over the slots of the displacements that are added to the deflections of a contact."""
    for argument in contact.form.law.arguments:
        if argument in contact.waves:
            yield from contact.waves[argument].lines.tolist()


def _slots(slots: Iterable[int]) -> NDArray[np.intp]:
    return np.array([*slots], dtype=np.intp)


@lru_cache(maxsize=256)
def _unit_of(structure: Structure) -> LengthUnit:
    return LengthUnit(layout_of(structure))


def natural_length(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> float:
    """Return the length of `LengthUnit.natural` for the coefficients of a system."""
    return _unit_of(layout.structure).natural(coefficients)


def smallness(system: System) -> float:
    """Return the size, at most 1, below which states are negligible: tolerances are relative to it or more.

    For systems whose clearances and motions are about 1 or larger it is 1, in the units of the system.
    """
    length = _unit_of(system.structure).natural(coefficients_of(system))
    return length if length < _LARGE else 1.0


def magnitude(state: NDArray[np.float64], system: System) -> float:
    """Return the size of a state of a system, never 0: distances between states are relative to it."""
    return smallness(system) + float(np.abs(state).max())
