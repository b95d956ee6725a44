"""Folds, flips and Neimark-Sacker points in two parameters: a periodic orbit with a critical multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.condition import Criticality
from gapwalk.bifurcation.locus.plane import OrbitPlane, Place
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True, eq=False)
class MultiplierEquation:
    """An orbit, and ``g = 0``, with g a condition on its derivatives that makes it critical.

    The unknowns are those of the orbit and the first parameter; the second is the one to follow.

    Parameters
    ----------
    plane
        The orbits among which to look.
    kind
        The bifurcation: a fold, a flip or a Neimark-Sacker point.
    scales : shape (N + 2,)
        Of the unknowns of the orbit and of both parameters, so that the condition does not depend on the user's units.
    tolerance
        Largest residual, relative to the size of the unknowns.
    """

    plane: OrbitPlane
    kind: Kind
    scales: NDArray[np.float64]
    tolerance: float

    @property
    def system(self):
        """The system at the start."""
        return self.plane.system

    @property
    def parameter(self) -> str:
        """The second parameter."""
        return self.plane.names[1]

    @property
    def period(self) -> int:
        """m, forcing periods of the orbits."""
        return self.plane.period

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Residual and derivatives; see `Equation.evaluate`. Errors as in `OrbitPlane.place`."""
        size = len(unknowns) - 1
        place = self.plane.place(unknowns[:-1], float(unknowns[-1]), value)
        critical = self.criticality(place)
        by_all = self.plane.gradient(self.kind, critical, place, self.scales)
        # beside a grazing contact g is so steep that rounding alone would exceed the tolerance: g over its slope is not
        slope = max(1.0, float(np.linalg.norm(by_all[:size] * self.scales[:size])))
        jacobian = np.vstack((place.jacobian, by_all / slope))
        residual = np.append(place.residual, critical.value / slope)
        return Evaluation(residual, jacobian[:, :-1], jacobian[:, -1], place)

    def criticality(self, place: Place) -> Criticality:
        """How far an orbit is from the bifurcation."""
        return self.plane.criticality(self.kind, place, self.scales)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """The orbit of a solution."""
        return self.plane.orbit(unknowns[:-1], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Unknowns and first parameter of an orbit."""
        return np.append(self.plane.unknowns(orbit), orbit.system[self.plane.names[0]])

    def flip_coefficient(self, unknowns: NDArray[np.float64], value: float) -> float:
        """The cubic coefficient of a flip; see `gapwalk.bifurcation.normal_form.flip_coefficient`."""
        place = self.plane.place(unknowns[:-1], float(unknowns[-1]), value)
        return self.plane.flip_coefficient(place, self.scales)
