"""The unit of length in which a motion is integrated: tolerances of the integrator are absolute below 1.

A gap of 50 micrometres in a model in metres is far below 1, and so are motions of the size 1e-9. Their flow is
integrated in a power of two of the model's own unit, which rounds nothing.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.contact import DampingLaw
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

_LARGE = 0.01  # size from which motions are integrated as they are


class LengthUnit:
    """Carries coefficients of one layout to another unit of length, and tells which unit suits a motion."""

    def __init__(self, layout: CoefficientLayout) -> None:
        n, forms = layout.structure.size, layout.structure.contacts
        self._loads = layout.accelerations[:, 2 * n + len(forms) :].ravel()
        self._stiffness, self._damping = layout.accelerations[:, :n], layout.accelerations[:, n : 2 * n]
        self._contacts = layout.accelerations[:, 2 * n : 2 * n + len(forms)]
        stages = [stage for contact in layout.contacts for stage in contact.stages]
        self._clearances = np.array([stage.clearance for stage in stages], dtype=np.intp)
        self._springs = np.array([stage.stiffness for stage in stages], dtype=np.intp)
        self._cubics = np.array([stage.cubic for stage in stages], dtype=np.intp)
        # of the laws only this one's coefficient is not that of a force by a velocity: beta is 1 over a velocity
        impacts = (DampingLaw.HUNT_CROSSLEY, DampingLaw.HUNT_CROSSLEY_AS_PRINTED)
        self._impacts = np.array(
            [c.damping for c, form in zip(layout.contacts, forms, strict=True) if form.damping in impacts],
            dtype=np.intp,
        )

    def natural(self, coefficients: NDArray[np.float64]) -> float:
        """The smaller of the smallest clearance and the amplitude that the loads give a free mass; 1 if both are 0.

        A clearance that is nothing beside the motion says nothing of its size: in a unit of it, rounding alone would
        carry the motion from one side of such a gap to the other.
        """
        clearances, time = coefficients[self._clearances], coefficients[0]
        gap = float(clearances[clearances > 0.0].min(initial=np.inf))
        load = float(np.abs(coefficients[self._loads]).max(initial=0.0))
        moved = load * time**2
        if gap < moved:
            gap = max(gap, load / (1.0 / time**2 + self._resistance(coefficients)))
        return min((size for size in (moved, gap) if 0.0 < size < np.inf), default=1.0)

    def _resistance(self, coefficients: NDArray[np.float64]) -> float:
        """How strongly springs, dampers and closed contacts hold a unit of motion at most, beside its inertia."""
        contacts = float(np.abs(coefficients[self._contacts]).max()) * float(np.abs(coefficients[self._springs]).max())
        damping = float(np.abs(coefficients[self._damping]).max()) / coefficients[0]
        return contacts + damping + float(np.abs(coefficients[self._stiffness]).max())

    def of_motion(self, coefficients: NDArray[np.float64], state: NDArray[np.float64]) -> float:
        """The unit for the motion from a state: 1 unless it is small."""
        half, numbers = len(state) // 2, state.tolist()
        if max(map(abs, numbers[:half])) >= _LARGE:
            return 1.0
        size = max(*map(abs, numbers[:half]), coefficients[0] * max(map(abs, numbers[half:])))
        size = max(size, self.natural(coefficients))
        return 1.0 if not size < _LARGE else 2.0 ** round(math.log2(size))

    def carried(self, coefficients: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
        """The same system, or direction of systems, with lengths in that unit."""
        scaled = coefficients.copy()
        scaled[..., self._loads] /= unit
        scaled[..., self._clearances] /= unit
        scaled[..., self._cubics] *= unit * unit
        scaled[..., self._impacts] *= unit
        return scaled


@lru_cache(maxsize=256)
def _unit_of(structure: Structure) -> LengthUnit:
    return LengthUnit(layout_of(structure))


def smallness(system: System) -> float:
    """The size, at most 1, below which states of a system count as nothing: tolerances are relative to that and more.

    For systems whose clearances and motions are about 1 or larger it is 1, in the units of the system.
    """
    length = _unit_of(system.structure).natural(coefficients_of(system))
    return length if length < _LARGE else 1.0


def magnitude(state: NDArray[np.float64], system: System) -> float:
    """Size of a state of a system, never nothing: what distances between states are relative to."""
    return smallness(system) + float(np.abs(state).max())
