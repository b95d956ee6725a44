"""Equation of grazing in two parameters: a periodic orbit on which a contact just touches a breakpoint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.orbit_plane import OrbitPlane, Place
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation

MARGIN = 1e-11
"""Distance, in units of the state, of a grazing orbit from the breakpoint, on the side without the extra event.

It is very small, and yet so large that the touch itself causes no event and does not affect the multipliers, which
change like the square root of its depth.
"""


@dataclass(frozen=True)
class TouchEquation:
    """Equation of an orbit whose deflection turns at ``theta*``, at a given `depth` beyond a breakpoint.

    The unknowns are those of the orbit, ``theta*`` and the first parameter; the second parameter is followed.

    Parameters
    ----------
    plane
        The plane of orbits.
    switch
        Stage and side, as an index into `Equations.switches`.
    depth
        Depth beyond the breakpoint at which the deflection turns.
    tolerance
        Largest residual, relative to the size of the unknowns.
    """

    plane: OrbitPlane
    switch: int
    depth: float
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
        place, size = self._place(unknowns, value), len(unknowns) - 2
        jacobian = np.zeros((size + 2, size + 3))
        jacobian[:size, :size], jacobian[:size, size + 1 :] = place.jacobian[:, :size], place.jacobian[:, size:]
        turning, jacobian[size:] = self.plane.turning(self.switch, place, float(unknowns[-2]))
        turning[0] -= self.depth
        residual = np.concatenate((place.residual, turning))
        return Evaluation(residual, jacobian[:, :-1], jacobian[:, -1], place)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution."""
        return self.plane.orbit(unknowns[:-2], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit, with the angle of the turning point nearest to the breakpoint."""
        thetas, depths = orbit.turning_depths[self.switch]
        theta = thetas[int(np.argmin(np.abs(depths)))]
        return np.concatenate((self.plane.unknowns(orbit), [theta, orbit.system[self.plane.names[0]]]))

    def is_highest(self, unknowns: NDArray[np.float64], value: float) -> bool:
        """Return whether the deflection has a maximum there, seen from outside the breakpoint."""
        _, derivatives = self.plane.turning(self.switch, self._place(unknowns, value), float(unknowns[-2]))
        return bool(derivatives[1, -3] < 0.0)

    def _place(self, unknowns: NDArray[np.float64], value: float) -> Place:
        return self.plane.place(unknowns[:-2], float(unknowns[-1]), value)
