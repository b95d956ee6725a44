"""Planes in state space for sections: a linear combination of positions and velocities has a given value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System


class Crossing(StrEnum):
    """The direction in which a motion crosses a plane."""

    UPWARDS = "upwards"
    DOWNWARDS = "downwards"
    BOTH = "both"

    def takes(self, before: float) -> bool:
        """Return True if a crossing counts that starts below (`before` < 0) or above the plane."""
        return self is Crossing.BOTH or (before < 0.0) is (self is Crossing.UPWARDS)


@dataclass(frozen=True)
class Plane:
    """All states at which a weighted sum of positions and velocities has a given value.

    Parameters
    ----------
    normal
        The weights by name: ``{"q1": 1.0}``, or ``{"q1": 1.0, "q3'": -0.5}`` with a velocity.
    level
        The value.
    crossing
        ``"upwards"``, ``"downwards"`` or ``"both"``.
    """

    normal: Mapping[str, float] = field(hash=False)
    level: float = 0.0
    crossing: Crossing = Crossing.UPWARDS

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "crossing", Crossing(self.crossing))
        except ValueError:
            allowed = ", ".join(repr(each.value) for each in Crossing)
            raise ModelError(f"crossing is {self.crossing!r}; it must be one of {allowed}") from None
        if not any(self.normal.values()):
            raise ModelError('the normal of a plane is zero; name a signal with its weight, such as {"q1": 1.0}')

    def weights(self, system: System) -> NDArray[np.float64]:
        """Return the weights of all positions, then of all velocities, shape (2n,).

        Raises
        ------
        ModelError
            If the plane names a signal that is neither a position nor a velocity of the system.
        """
        names = [*system.coordinates, *(f"{name}'" for name in system.coordinates)]
        unknown = [name for name in self.normal if name not in names]
        if unknown:
            raise ModelError(f"a plane cannot be defined on {unknown[0]!r} here; it can be on {', '.join(names)}")
        return np.array([float(self.normal.get(name, 0.0)) for name in names])

    @property
    def text(self) -> str:
        """The plane in words, such as ``q1 = 1, upwards``."""
        terms = [name if factor == 1.0 else f"{factor:g} {name}" for name, factor in self.normal.items() if factor]
        where = "" if self.crossing is Crossing.BOTH else f", {self.crossing.value}"
        return f"{' + '.join(terms)} = {self.level:g}{where}".replace("+ -", "− ")


def impact_plane(system: System, contact: str, side: int = 1, *, closes: bool = True) -> Plane:
    """Return the plane on which a contact's innermost stage closes (or opens) on one side.

    Raises
    ------
    ModelError
        If there is no such contact, or none of its stages acts on that side.
    """
    forms = {form.name: form for form in system.structure.contacts}
    if contact not in forms:
        raise ModelError(f"there is no contact {contact!r}; contacts are {', '.join(forms) or 'none at all'}")
    form = forms[contact]
    stages = [stage for stage in form.stages if side in stage.side.signs]
    if not stages:
        raise ModelError(f"no stage of {contact!r} acts on the side {side!r}; a side is +1 or -1")
    vector = system.vector(f"{contact}.deflection").tolist()
    level = side * system[f"{form.stage_prefix(stages[0])}.clearance"]
    upwards = (side > 0) is closes
    normal = {name: factor for name, factor in zip(system.coordinates, vector, strict=True) if factor}
    return Plane(normal, level, Crossing.UPWARDS if upwards else Crossing.DOWNWARDS)


class Height:
    """Computes the signed distance of states from a plane, and its derivative over theta."""

    def __init__(self, system: System, plane: Plane) -> None:
        self._weights, self._level, self._n = plane.weights(system), plane.level, system.size
        self._layout, self._coefficients = layout_of(system.structure), coefficients_of(system)
        self._rate = 1.0 / system.frequency

    def of(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance of states, shape (..., 2n)."""
        return states @ self._weights - self._level

    def slope(self, theta: NDArray[np.float64] | float, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of that distance over theta."""
        n = self._n
        q, v = states[..., :n], states[..., n:]
        a = accelerations(self._layout, self._coefficients, theta, q, v)
        return self._rate * (v @ self._weights[:n] + a @ self._weights[n:])
