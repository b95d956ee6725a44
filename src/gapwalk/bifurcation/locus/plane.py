"""The orbits of one system in the plane of two parameters: what the equations of all loci ask of a way to pose them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.condition import Criticality
from gapwalk.model.system import System
from gapwalk.orbit.equation import Evaluation
from gapwalk.orbit.orbit import Orbit

STEP = 1e-9
"""Step of forward differences of exact matrices, in units of the unknowns.

Rounding leaves about 1e-7 of the derivative at this step, and so does curvature. Larger steps would reach over to the
other side of a grazing contact nearby, where the derivative of the monodromy matrix grows like one over the square root
of the depth.
"""


@dataclass(frozen=True, eq=False)
class Place:
    """Some unknowns at a point of the plane, and the equations of an orbit there.

    Attributes
    ----------
    unknowns : shape (N,)
        Those of the orbit.
    coefficients
        Of the flow.
    slopes : shape (2, coefficients)
        Their derivatives by both parameters.
    residual : shape (N,)
        Zero on an orbit.
    jacobian : shape (N, N + 2)
        Its derivatives by the unknowns and by both parameters.
    evidence
        Whatever the plane wants back.
    """

    unknowns: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    slopes: NDArray[np.float64]
    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    evidence: Any


Turning = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Depth past a breakpoint and its rate at an angle; their derivatives by unknowns, angle, parameters, (2, N + 3)."""


class OrbitPlane(Protocol):
    """Orbits of m forcing periods at all values of two parameters; shooting is one way to pose them, balance another.

    To follow loci in another way, write a class with these members, and let `depart_locus` make it.
    """

    @property
    def system(self) -> System:
        """The system at the start."""
        ...

    @property
    def names(self) -> tuple[str, str]:
        """The two parameters."""
        ...

    @property
    def period(self) -> int:
        """m, forcing periods."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual of an orbit, relative to the size of its unknowns."""
        ...

    def place(self, unknowns: NDArray[np.float64], first: float, second: float) -> Place:
        """The equations at a point of the plane; a NumericalError where they do not exist."""
        ...

    def orbit(self, unknowns: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """The orbit of a solution, from an evaluation whose evidence is its place."""
        ...

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """The unknowns of an orbit that was found in whatever way."""
        ...

    def scales(self, orbit: Orbit) -> NDArray[np.float64]:
        """Scales of the unknowns near an orbit, shape (N,)."""
        ...

    def criticality(self, kind: Kind, place: Place, scales: NDArray[np.float64]) -> Criticality:
        """How far a place is from a bifurcation."""
        ...

    def gradient(
        self, kind: Kind, critical: Criticality, place: Place, scales: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Derivatives of the criticality of a place by unknowns and parameters, shape (N + 2,).

        `scales` are those of the unknowns and of both parameters, shape (N + 2,).
        """
        ...

    def turning(self, switch: int, place: Place, theta: float) -> Turning:
        """How far a deflection is past the breakpoint of a switch at an angle, and how fast it goes on."""
        ...

    def flip_coefficient(self, place: Place, scales: NDArray[np.float64]) -> float:
        """The cubic coefficient at a flip, smooth along its locus; nan where it cannot be told."""
        ...

    def halved(self) -> OrbitPlane:
        """The orbits of half the period."""
        ...

    def shared(self) -> NDArray[np.bool_]:
        """Which of the unknowns are unknowns of orbits of half the period too; zero are the others on such orbits."""
        ...

    def mean_of_halves(self, orbit: Orbit) -> NDArray[np.float64]:
        """The unknowns of the motion of half the period that lies between the two halves of an orbit."""
        ...

    def doubt(self, orbit: Orbit, share: float = 1.0) -> str:
        """Why an orbit is not to be trusted as a motion to a share of the error allowed; empty if it is."""
        ...

    def finer(self) -> OrbitPlane | None:
        """The same orbits more finely resolved, where the method leaves that open; otherwise None."""
        ...
