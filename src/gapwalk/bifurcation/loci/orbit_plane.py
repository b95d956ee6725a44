"""Orbits of one system in the plane of two parameters: the interface that the equations of all loci use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.kinds.condition import Criticality
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation

STEP = 1e-9
"""Step of forward differences of exact matrices, in units of the unknowns.

At this step rounding leaves about 1e-7 of the derivative, and so does curvature. Larger steps would reach beyond a
grazing contact nearby, where the derivative of the monodromy matrix grows like one over the square root of the depth.
"""


@dataclass(frozen=True, eq=False)
class Place:
    """Unknowns at a point of the plane, and the equations of an orbit there.

    Attributes
    ----------
    unknowns : shape (N,)
        Unknowns of the orbit.
    coefficients
        Coefficients of the flow.
    slopes : shape (2, coefficients)
        Their derivatives with respect to both parameters.
    residual : shape (N,)
        Zero on an orbit.
    jacobian : shape (N, N + 2)
        Its derivatives with respect to the unknowns and both parameters.
    evidence
        Data that the plane needs to construct the orbit later.
    """

    unknowns: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    slopes: NDArray[np.float64]
    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    evidence: Any


Turning = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Depth beyond a breakpoint and its rate at an angle; derivatives by unknowns, angle, parameters, shape (2, N + 3)."""


class OrbitPlane(Protocol):
    """Orbits of m forcing periods at all values of two parameters, by shooting or by harmonic balance.

    To follow loci with another method, write a class with these members, and let `start_locus` create it.
    """

    @property
    def system(self) -> System:
        """System at the start."""
        ...

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two parameters."""
        ...

    @property
    def period(self) -> int:
        """m, number of forcing periods."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual of an orbit, relative to the size of its unknowns."""
        ...

    def place(self, unknowns: NDArray[np.float64], first: float, second: float) -> Place:
        """Evaluate the equations at a point of the plane; raise a NumericalError where they do not exist."""
        ...

    def orbit(self, unknowns: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution, from an evaluation whose evidence is its place."""
        ...

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit found by any method."""
        ...

    def scales(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the scales of the unknowns near an orbit, shape (N,)."""
        ...

    def criticality(self, kind: Kind, place: Place, scales: NDArray[np.float64]) -> Criticality:
        """Return the signed distance of a place from a bifurcation, with its derivative."""
        ...

    def gradient(
        self, kind: Kind, critical: Criticality, place: Place, scales: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives of the criticality of a place by unknowns and parameters, shape (N + 2,).

        `scales` are those of the unknowns and of both parameters, shape (N + 2,).
        """
        ...

    def turning(self, switch: int, place: Place, theta: float) -> Turning:
        """Return the depth of a deflection beyond the breakpoint of a switch at an angle, its rate, and derivatives."""
        ...

    def flip_coefficient(self, place: Place, scales: NDArray[np.float64]) -> float:
        """Return the cubic coefficient at a flip, smooth along its locus; nan if it cannot be computed."""
        ...

    def halved(self) -> OrbitPlane:
        """Return the plane of the orbits of half the period."""
        ...

    def shared(self) -> NDArray[np.bool_]:
        """Return a mask of the unknowns that orbits of half the period have too; the others are zero on such orbits."""
        ...

    def mean_of_halves(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of the motion of half the period that is the mean of the two halves of an orbit."""
        ...

    def doubt(self, orbit: Orbit, share: float = 1.0) -> str:
        """Return why an orbit does not satisfy a share of the allowed error; empty if it does."""
        ...

    def finer(self) -> OrbitPlane | None:
        """Return the plane with a finer resolution of its orbits, or None if there is none."""
        ...
