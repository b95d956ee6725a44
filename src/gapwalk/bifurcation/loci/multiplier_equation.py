"""Equation of folds, flips and Neimark-Sacker points in two parameters: an orbit with a critical multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.condition import Criticality
from gapwalk.bifurcation.loci.orbit_plane import OrbitPlane, Place
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation


@dataclass(frozen=True, eq=False)
class MultiplierEquation:
    """Equation of an orbit and of ``g = 0``, where g is a smooth condition for a critical multiplier.

    The unknowns are those of the orbit and the first parameter; the second parameter is followed.

    Parameters
    ----------
    plane
        The plane of orbits.
    kind
        The bifurcation: a fold, a flip or a Neimark-Sacker point.
    scales : shape (N + 2,)
        Scales of the orbit's unknowns and of both parameters; they make the condition independent of the user's units.
    tolerance
        Largest residual, relative to the size of the unknowns.
    """

    plane: OrbitPlane
    kind: Kind
    scales: NDArray[np.float64]
    tolerance: float

    @property
    def system(self):
        """System at the start."""
        return self.plane.system

    @property
    def parameter(self) -> str:
        """Name of the second parameter."""
        return self.plane.names[1]

    @property
    def period(self) -> int:
        """m, number of forcing periods of the orbits."""
        return self.plane.period

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; see `Equation.evaluate`. Errors are those of `OrbitPlane.place`."""
        size = len(unknowns) - 1
        place = self.plane.place(unknowns[:-1], float(unknowns[-1]), value)
        critical = self.criticality(place)
        by_all = self.plane.gradient(self.kind, critical, place, self.scales)
        # near a grazing contact g is so steep that rounding alone would exceed the tolerance; g over its slope is not
        slope = max(1.0, float(np.linalg.norm(by_all[:size] * self.scales[:size])))
        jacobian = np.vstack((place.jacobian, by_all / slope))
        residual = np.append(place.residual, critical.value / slope)
        return Evaluation(residual, jacobian[:, :-1], jacobian[:, -1], place)

    def criticality(self, place: Place) -> Criticality:
        """Return the criticality of an orbit with respect to this bifurcation."""
        return self.plane.criticality(self.kind, place, self.scales)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution."""
        return self.plane.orbit(unknowns[:-1], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns and the first parameter of an orbit."""
        return np.append(self.plane.unknowns(orbit), orbit.system[self.plane.names[0]])

    def flip_coefficient(self, unknowns: NDArray[np.float64], value: float) -> float:
        """Return the cubic coefficient of a flip; see `gapwalk.bifurcation.normal_form.flip_coefficient`."""
        place = self.plane.place(unknowns[:-1], float(unknowns[-1]), value)
        return self.plane.flip_coefficient(place, self.scales)
