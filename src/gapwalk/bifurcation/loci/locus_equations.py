"""Equations of loci in two parameters, and moves along their solution curves.

`GrazingEquation` poses a periodic orbit on which a contact just touches a breakpoint, `MultiplierEquation` an orbit
with a critical multiplier: a fold, a flip or a Neimark-Sacker point. From a place near the solution curve,
`onto_curve` moves onto it, and `zero_along` to the zero of a function on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.defining_functions import Criticality
from gapwalk.bifurcation.loci.orbit_plane import OrbitPlane, Place, ShotPlane
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation

MARGIN = 1e-11
"""Distance, in units of the state, of a grazing orbit from the breakpoint, on the side without the extra event.

It is very small, and yet so large that the touch itself causes no event and does not affect the multipliers, which
change like the square root of its depth.
"""


@dataclass(frozen=True, eq=False)
class LocusEquation:
    """Common part of the equations of loci: an orbit in the plane of two parameters; the second is followed."""

    plane: OrbitPlane  #: The plane of orbits.
    others: ClassVar[int]
    """Number of unknowns beyond those of the orbit."""

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; see `Equation.evaluate`. Errors are those of `OrbitPlane.place`."""
        residual, by_all, place = self.linearised(unknowns, value)
        return Evaluation(residual, by_all[:, :-1], by_all[:, -1], place)

    def linearised(
        self, unknowns: NDArray[np.float64], *others: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """Return residual, its derivatives by the unknowns and by the parameters after the first, and the place."""
        raise NotImplementedError

    def residual(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], Place]:
        """Return the residual of a point in the plane of one parameter, and the place, without derivatives by it.

        The residual of a condition on multipliers is not divided by its slope, so it needs none of the multipliers.
        """
        residual, _, place = self.linearised(unknowns)
        return residual, place

    def derivatives(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """Return `residual` and its derivatives at a point in the plane of one parameter, and the place."""
        return self.linearised(unknowns)

    def place(self, unknowns: NDArray[np.float64], *others: float) -> Place:
        """Evaluate the equations of the orbit; see `OrbitPlane.place`."""
        return self.plane.place(unknowns[: -self.others], float(unknowns[-1]), *others)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution."""
        return self.plane.orbit(unknowns[: -self.others], float(unknowns[-1]), value, evaluation)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns and the first parameter of an orbit."""
        return np.append(self.plane.unknowns(orbit), orbit.system[self.plane.names[0]])

    def on(self, plane: OrbitPlane, scales: NDArray[np.float64]) -> Self:
        """Return the equation of the same locus in another plane, with the scales of its variables."""
        return replace(self, plane=plane)

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


@dataclass(frozen=True, eq=False)
class GrazingEquation(LocusEquation):
    """Equation of an orbit whose deflection turns at ``theta*``, at a given `depth` beyond a breakpoint.

    The unknowns are those of the orbit, ``theta*`` and the first parameter; the second parameter is followed.
    """

    others: ClassVar[int] = 2

    switch: int  #: Stage and side, as an index into `Equations.switches`.
    depth: float  #: Depth beyond the breakpoint at which the deflection turns.
    tolerance: float  #: Largest residual, relative to the size of the unknowns.

    def linearised(
        self, unknowns: NDArray[np.float64], *others: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """See `LocusEquation.linearised`."""
        place, size = self.place(unknowns, *others), len(unknowns) - 2
        jacobian = np.zeros((size + 2, size + 2 + len(others)))
        jacobian[:size, :size], jacobian[:size, size + 1 :] = place.jacobian[:, :size], place.jacobian[:, size:]
        turning, jacobian[size:] = self.plane.turning(self.switch, place, float(unknowns[-2]))
        turning[0] -= self.depth
        return np.concatenate((place.residual, turning)), jacobian, place

    def residual(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], Place]:
        """See `LocusEquation.residual`."""
        if not isinstance(self.plane, ShotPlane):
            return super().residual(unknowns)
        theta = float(unknowns[-2])
        place, there = self.plane.closed(unknowns[:-2], float(unknowns[-1]), theta=theta)
        depth, rate = self.plane.depth(self.switch, place, theta, there)
        return np.concatenate((place.residual, [depth - self.depth, rate])), place

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit, with the angle of the turning point nearest to the breakpoint."""
        thetas, depths = orbit.turning_depths[self.switch]
        theta = thetas[int(np.argmin(np.abs(depths)))]
        return np.concatenate((self.plane.unknowns(orbit), [theta, orbit.system[self.plane.names[0]]]))

    def is_highest(self, unknowns: NDArray[np.float64], *others: float) -> bool:
        """Return True if the deflection has a maximum there, seen from outside the breakpoint."""
        _, derivatives = self.plane.turning(self.switch, self.place(unknowns, *others), float(unknowns[-2]))
        return bool(derivatives[1, len(unknowns) - 2] < 0.0)


@dataclass(frozen=True, eq=False)
class MultiplierEquation(LocusEquation):
    """Equation of an orbit and of ``g = 0``, where g is a smooth condition for a critical multiplier.

    The unknowns are those of the orbit and the first parameter; the second parameter is followed.
    """

    others: ClassVar[int] = 1

    kind: Kind  #: The bifurcation: a fold, a flip or a Neimark-Sacker point.
    #: shape (N + 2,): Scales of the orbit's unknowns and of both parameters; they make the condition independent of the
    #: user's units.
    scales: NDArray[np.float64]
    tolerance: float  #: Largest residual, relative to the size of the unknowns.
    #: Step of central differences, in scaled variables; None for a forward difference, which suffices to converge.
    step: float | None = None

    def linearised(
        self, unknowns: NDArray[np.float64], *others: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """See `LocusEquation.linearised`."""
        return self.linearised_at(self.place(unknowns, *others))

    def linearised_at(self, place: Place) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """Return the same where the equations of the orbit have been evaluated."""
        size = len(place.unknowns)
        critical = self.criticality(place)
        by_all = self.plane.gradient(self.kind, critical, place, self.scales, self.step)
        # near a grazing contact g is so steep that rounding alone would exceed the tolerance; g over its slope is not
        slope = max(1.0, float(np.linalg.norm(by_all[:size] * self.scales[:size])))
        jacobian = np.vstack((place.jacobian, by_all / slope))
        return np.append(place.residual, critical.value / slope), jacobian, place

    def residual(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], Place]:
        """See `LocusEquation.residual`."""
        plane = self.plane
        place = (
            plane.closed(unknowns[:-1], float(unknowns[-1]))[0]
            if isinstance(plane, ShotPlane)
            else self.place(unknowns)
        )
        return np.append(place.residual, self.criticality(place).value), place

    def derivatives(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], Place]:
        """See `LocusEquation.derivatives`."""
        place = self.place(unknowns)
        critical = self.criticality(place)
        by_all = self.plane.gradient(self.kind, critical, place, self.scales, self.step)
        return np.append(place.residual, critical.value), np.vstack((place.jacobian, by_all)), place

    def criticality(self, place: Place) -> Criticality:
        """Return the criticality of an orbit with respect to this bifurcation."""
        return self.plane.criticality(self.kind, place, self.scales)

    def on(self, plane: OrbitPlane, scales: NDArray[np.float64]) -> Self:
        """Return the equation of the same locus in another plane, with the scales of its variables."""
        return replace(self, plane=plane, scales=scales)

    def flip_coefficient(self, unknowns: NDArray[np.float64], value: float) -> float:
        """Return the cubic coefficient of a flip; see `gapwalk.bifurcation.kinds.flip.flip_coefficient`."""
        return self.plane.flip_coefficient(self.place(unknowns, value), self.scales)


@dataclass(frozen=True, slots=True)
class Secant:
    """Options of the secant method along a curve; all lengths are scaled."""

    first: float = 1e-4  #: The first step.
    longest: float = 1e-2  #: The longest step.
    farthest: float = 0.1  #: Largest distance from the start.
    exact: float = 1e-12  #: Step below which it has converged.
    noise: float = 1e-7  #: Step below which it has also converged if steps no longer shrink, because of rounding.
    steps: int = 25  #: Largest number of steps.


def zero_along(
    corrector: Corrector, start: NDArray[np.float64], function: Callable[[Correction], float], secant: Secant
) -> Correction | None:
    """Locate a zero of a function on a curve near a start by the secant method; None if none is found."""
    correction, tangent = onto_curve(corrector, start)
    if correction is None:
        return None
    origin, s, s_before, last = correction.x, 0.0, -secant.first, np.inf
    before = corrector.correct(origin + s_before * tangent, tangent)
    if before is None:
        return None
    f_before = function(before)
    for _ in range(secant.steps):
        f = function(correction)
        if f == f_before or not np.isfinite(f):
            return None
        step = -f * (s - s_before) / (f - f_before)
        if abs(step) <= secant.exact or last < abs(step) < secant.noise:
            return correction
        s_before, f_before, last = s, f, abs(step)
        s += max(-secant.longest, min(secant.longest, step))
        correction = corrector.correct(origin + s * tangent, tangent) if abs(s) < secant.farthest else None
        if correction is None:
            return None
    return None


def onto_curve(corrector: Corrector, start: NDArray[np.float64]) -> tuple[Correction | None, NDArray[np.float64]]:
    """Return the point of a curve nearest to a start in scaled variables, or None, and the tangent near there."""
    tangent = np.linalg.svd(corrector.jacobian(start))[2][-1]
    return corrector.correct(start, tangent), tangent
