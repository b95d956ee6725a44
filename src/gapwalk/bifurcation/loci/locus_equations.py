"""Equations of loci in two parameters, and moves along their solution curves.

`GrazingEquation` poses a periodic orbit on which a contact just touches a breakpoint, `MultiplierEquation` an orbit
with a critical multiplier: a fold, a flip or a Neimark-Sacker point. From a place near the solution curve,
`onto_curve` moves onto it, and `zero_along` to the zero of a function on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.friction_margin import Instant, nearest_margin
from gapwalk.bifurcation.kinds.critical_multipliers import Criticality, flip_coefficient
from gapwalk.bifurcation.kinds.sliding import Sliding
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.corrector import Correction, Corrector, unknown_scales
from gapwalk.errors import FlowError
from gapwalk.flow.equations import natural_length
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of, flow_with
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.flow.motion import DryModes, Gauge, modes_along
from gapwalk.model.coefficients import CoefficientLayout, ParameterLine, ParameterPlane, coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.shooting import Shooting
from gapwalk.orbit.sticking import Closure, FrictionGauge, released, transition_of

# Orbits of one system in the plane of two parameters: the interface that the equations of all loci use.
#
# `ShotPlane` implements it by shooting, with orbits from their exact state at theta = 0.

STEP = 1e-9
"""Step of forward differences of exact matrices, in units of the unknowns.

At this step rounding leaves about 1e-7 of the derivative, and so does curvature. Larger steps would reach beyond a
grazing contact nearby, where the derivative of the monodromy matrix grows like one over the square root of the depth.
"""
Turning = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Depth beyond a breakpoint, its rate at an angle; derivatives by unknowns, angle, parameters: (2, N + 1 + k)."""


@dataclass(frozen=True, eq=False)
class Place:
    """Unknowns at a point of the plane, and the equations of an orbit there."""

    unknowns: NDArray[np.float64]  #: shape (N,): Unknowns of the orbit.
    coefficients: NDArray[np.float64]  #: Coefficients of the flow.
    slopes: NDArray[np.float64]  #: shape (k, coefficients): Their derivatives with respect to the parameters.
    residual: NDArray[np.float64]  #: shape (N,): Zero on an orbit.
    jacobian: NDArray[np.float64]  #: shape (N, N + k): Its derivatives with respect to the unknowns and the parameters.
    evidence: Any  #: Data that the plane needs to construct the orbit later.


@dataclass(frozen=True)
class OrbitPlane:
    """Orbits of m forcing periods at all values of k = 2 parameters, by shooting or by harmonic balance.

    For the gradient of a special point there may be more of them.

    To follow loci with another method, derive a class with these members, and register it with `plane_of`.
    """

    system: System  #: The system at the start.
    names: tuple[str, ...]  #: The parameters.
    period: int  #: m, number of forcing periods.
    options: Any  #: The method.

    @property
    def tolerance(self) -> float:
        """Largest residual of an orbit, relative to the size of its unknowns."""
        return self.options.tolerance

    def with_system(self, system: System) -> Self:
        """Return the plane of another system with the same parts."""
        return replace(self, system=system)

    def halved(self) -> Self:
        """Return the plane of the orbits of half the period."""
        return replace(self, period=self.period // 2)

    def inaccuracy(self, orbit: Orbit, share: float = 1.0) -> str:
        """Return the reason if an orbit exceeds a share of the allowed error; empty otherwise, as for exact orbits."""
        return ""

    def finer(self) -> OrbitPlane | None:
        """Return the plane with a finer resolution of its orbits; None if there is none, as for exact orbits."""
        return None

    def place(self, unknowns: NDArray[np.float64], *point: float) -> Place:
        """Evaluate the equations at a point of the plane; raise a NumericalError where they do not exist."""
        raise NotImplementedError

    def orbit(self, unknowns: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution, from an evaluation whose evidence is its place."""
        raise NotImplementedError

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of an orbit found by any method."""
        raise NotImplementedError

    def scales(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the scales of the unknowns near an orbit, shape (N,)."""
        raise NotImplementedError

    def criticality(self, kind: Kind, place: Place, scales: NDArray[np.float64]) -> Criticality:
        """Return the signed distance of a place from a bifurcation, with its derivative."""
        raise NotImplementedError

    def gradient(
        self, kind: Kind, critical: Criticality, place: Place, scales: NDArray[np.float64], step: float | None = None
    ) -> NDArray[np.float64]:
        """Return the derivatives of the criticality of a place by unknowns and parameters, shape (N + k,)."""
        # `scales` are those of the unknowns and of the parameters, shape (N + k,). With a `step`, in these units,
        # differences are central ones with this step; otherwise forward ones with `STEP`.
        raise NotImplementedError

    def turning(self, switch: int, place: Place, theta: float) -> Turning:
        """Return the depth of a deflection beyond the breakpoint of a switch at an angle, its rate, and derivatives."""
        raise NotImplementedError

    def flip_coefficient(self, place: Place, scales: NDArray[np.float64]) -> float:
        """Return the cubic coefficient at a flip, smooth along its locus; nan if it cannot be computed."""
        raise NotImplementedError

    def shared(self) -> NDArray[np.bool_]:
        """Return a mask of the unknowns that orbits of half the period have too; the others are zero on such orbits."""
        raise NotImplementedError

    def mean_of_halves(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the unknowns of the motion of half the period that is the mean of the two halves of an orbit."""
        raise NotImplementedError

    @cached_property
    def _parameters(self) -> ParameterPlane:
        return ParameterPlane(self.system, self.names)

    @cached_property
    def _layout(self) -> CoefficientLayout:
        return layout_of(self.system.structure)


@dataclass(frozen=True)
class ShotPlane(OrbitPlane):
    """Equation of shooting in one segment, ``Phi(u; a, b) - u = 0``.

    The derivatives of Phi are exact. Those of the multipliers need second derivatives of Phi, but only along the
    critical vectors. Since second derivatives are symmetric, differences of the first ones along each vector suffice.
    """

    options: Shooting = Shooting()
    #: Angle at which the states that are the unknowns are taken, in radians; an `Orbit` has its state at theta = 0.
    begin: float = 0.0
    alike: tuple[str, ...] = ()
    """Parameters of which any may be the second and following; they share one compiled flow. Empty for `names`."""

    def halved(self) -> ShotPlane:
        """See `OrbitPlane.halved`."""
        half = self.period // 2
        return replace(self, period=half, begin=self.begin % (PERIOD * half))

    def with_system(self, system: System) -> ShotPlane:
        """Return the plane of another system with the same parts, with the same compiled flow if that suits it."""
        # Looking up a compiled flow takes as long as a period of motion. The flow leaves out coefficients that are zero
        # here; a system in which one of them is not zero needs a flow of its own.
        other = replace(self, system=system)
        if not np.any((coefficients_of(system) != 0.0) & ~self._flow.equations.pattern):
            other.__dict__["_flow"] = self._flow
        other.__dict__["_length"] = self._length  # lengths are units, of any value
        return other

    def place(self, unknowns: NDArray[np.float64], *point: float, keeps: int | None = None) -> Place:
        """See `OrbitPlane.place`; the friction of the contact `keeps` keeps its mode. Errors as in `Flow.integrate`."""
        coefficients, slopes = self._parameters.coefficients(*point)
        arc = self._turn(coefficients, unknowns, slopes, keeps)
        closed = self._released(coefficients, arc, unknowns)
        jacobian, size = _final_derivatives(closed), len(unknowns)
        jacobian[:, :size].flat[:: size + 1] -= 1.0
        return Place(unknowns, coefficients, slopes, closed.state - unknowns, jacobian, arc)

    def closed(
        self, unknowns: NDArray[np.float64], *point: float, theta: float | None = None
    ) -> tuple[Place, NDArray[np.float64]]:
        """Evaluate the equations without derivatives by the parameters, which take a third of the time of `place`."""
        # Returns the place, and the state at the angle `theta` on the way; at the start if there is none.
        flow, start, stop = _without_directions(self._flow), self.begin, self.begin + PERIOD * self.period
        coefficients, there = self._parameters.coefficients(*point)[0], unknowns
        angle = start if theta is None else self._after(theta)
        if angle > start:
            found = flow.vary(coefficients, unknowns, np.array([start, angle, stop]))
            arc, there = (
                Arc(found.states[-1], found.transitions[-1], None, found.contacts, 0, *found.logs[1:]),
                found.states[1],
            )
        else:
            arc = flow.integrate(coefficients, unknowns, start, stop)
        ended = self._released(coefficients, arc, unknowns)
        jacobian = transition_of(ended).copy()
        jacobian.flat[:: len(unknowns) + 1] -= 1.0
        nothing = np.zeros((0, len(coefficients)))
        return Place(unknowns, coefficients, nothing, ended.state - unknowns, jacobian, arc), there

    def depth(self, switch: int, place: Place, theta: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of a motion beyond the breakpoint of a switch, and its rate over time, at one state."""
        angle = theta % (PERIOD * self.period)
        return np.array(Gauge(self._layout, switch).depth(place.coefficients, angle, state))

    def orbit(self, unknowns: NDArray[np.float64], first: float, second: float, evaluation: Evaluation) -> Orbit:
        """See `OrbitPlane.orbit`."""
        arc: Arc = evaluation.evidence.evidence
        coefficients, state, full = evaluation.evidence.coefficients, unknowns.copy(), PERIOD * self.period
        if self.begin:
            state = self._flow.integrate(coefficients, unknowns, self.begin, full, evaluation.evidence.slopes).state
            arc = self._flow.integrate(coefficients, state, 0.0, full, evaluation.evidence.slopes)
        closure = Closure.of(self._layout, lambda: coefficients, [arc], state)
        return Orbit(
            self._parameters.system_at(first, second),
            self.period,
            state,
            closure.multipliers,
            tuple(arc.contacts),
            float(np.abs(evaluation.residual).max()),
            arc.steps,
            slips=closure.slips,
            stuck=closure.stuck,
        )

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the state at the angle at which the unknowns are taken."""
        if not self.begin:
            return orbit.state.copy()
        flow = flow_of(orbit.system)
        return flow.integrate(coefficients_of(orbit.system), orbit.state, 0.0, self.begin).state

    def scales(self, orbit: Orbit) -> NDArray[np.float64]:
        """See `OrbitPlane.scales`."""
        return unknown_scales(self.options.pose(orbit.system), orbit)

    def criticality(self, kind: Kind, place: Place, scales: NDArray[np.float64]) -> Criticality:
        """See `OrbitPlane.criticality`; from the monodromy matrix in units of the state."""
        return kind.condition(self._scaled(place, place.evidence, scales))

    def gradient(
        self, kind: Kind, critical: Criticality, place: Place, scales: NDArray[np.float64], step: float | None = None
    ) -> NDArray[np.float64]:
        """See `OrbitPlane.gradient`."""
        units, length = scales[: len(place.unknowns)], step or STEP

        def derivatives(shift: NDArray[np.float64]) -> NDArray[np.float64]:
            arc = place.evidence
            if shift.any():
                arc = self._turn(place.coefficients, place.unknowns + shift, place.slopes)
            return _final_derivatives(self._released(place.coefficients, arc, place.unknowns))

        by_all = np.zeros(len(units) + len(self.names))
        for direction, covector in zip(critical.directions, critical.covectors, strict=True):
            shift = length * units * direction
            before = derivatives(0.0 * shift if step is None else -shift)
            by_all += (covector / units) @ (derivatives(shift) - before)
        return by_all / (length if step is None else 2.0 * length)

    def turning(self, switch: int, place: Place, theta: float) -> Turning:
        """See `OrbitPlane.turning`; the rate is over time."""
        gauge, coefficients, slopes = Gauge(self._layout, switch), place.coefficients, place.slopes
        n, size = self.system.size, len(place.unknowns)
        angle = self._after(theta)
        there, by_all = place.unknowns, np.eye(size, size + len(self.names))
        if angle > self.begin:
            arc = self._flow.integrate(coefficients, place.unknowns, self.begin, angle, slopes)
            there, by_all = arc.state, _final_derivatives(arc)
        vector, (depth, rate, turning) = gauge.vector(coefficients), gauge.read(coefficients, angle, there)
        derivatives = np.empty((2, size + 1 + len(self.names)))
        by_all = np.stack((vector @ by_all[:n], vector @ by_all[n : 2 * n]))
        by_all[:, size:] += np.transpose([gauge.slopes(coefficients, each, angle, there) for each in slopes])
        derivatives[:, :size], derivatives[:, size + 1 :] = by_all[:, :size], by_all[:, size:]
        derivatives[:, size] = coefficients[0] * rate, coefficients[0] * turning
        return np.array([depth, rate]), derivatives

    def by_parameters(self, switch: int, place: Place, theta: float, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the derivatives of the residual, and of depth and rate as in `turning`, by parameters.

        Their columns are integrated without the transition matrix.
        """
        gauge, coefficients, n = Gauge(self._layout, switch), place.coefficients, self.system.size
        ways = np.array([ParameterLine(self.system, name).coefficients(self.system[name])[1] for name in names])
        angles = np.array([self.begin, self._after(theta), self.begin + PERIOD * self.period])
        found = flow_with(self._layout, coefficients, *ways).vary(coefficients, place.unknowns, angles, ways)
        there = np.reshape(np.split(found.sensitivities[1], [n, 2 * n])[:2], (2, n, -1))
        moved = gauge.vector(coefficients) @ there
        moved += np.transpose([gauge.slopes(coefficients, way, angles[1], found.states[1]) for way in ways])
        return np.vstack((found.sensitivities[2], moved))

    def reached(
        self, place: Place, contact: int, keeping: float, angle: float
    ) -> tuple[NDArray[np.float64], NDArray, Arc]:
        """Return the state at an angle, its derivatives by unknowns and parameters, and the motion until `keeping`."""
        # From that angle on the friction of a contact keeps its mode. Errors as in `Flow.integrate`.
        if keeping <= 0.0:
            only = self._flow.integrate(place.coefficients, place.unknowns, 0.0, angle, place.slopes, keeps=contact)
            return only.state, _final_derivatives(only), place.evidence
        first = self._flow.integrate(place.coefficients, place.unknowns, 0.0, keeping, place.slopes)
        last = self._flow.integrate(place.coefficients, first.state, keeping, angle, place.slopes, keeps=contact)
        size, to, on = len(place.unknowns), _final_derivatives(first), _final_derivatives(last)
        by_all = on[:, :size] @ to
        by_all[:, size:] += on[:, size:]
        return last.state, by_all, first

    def flip_coefficient(self, place: Place, scales: NDArray[np.float64]) -> float:
        """See `OrbitPlane.flip_coefficient`."""
        units = scales[: len(place.unknowns)]

        def monodromy(unknowns: NDArray[np.float64]):
            arc = self._turn(place.coefficients, unknowns, place.slopes)
            return self._scaled(place, arc, scales), arc.contacts

        here = self._scaled(place, place.evidence, scales), place.evidence.contacts
        critical = self.criticality(Kind.FLIP, place, scales)
        bordering = np.eye(len(units)) - here[0]
        vectors = critical.directions[0], critical.covectors[0]
        return flip_coefficient(monodromy, here, place.unknowns, units, vectors, bordering).value

    def shared(self) -> NDArray[np.bool_]:
        """Return a mask of all unknowns, since they form the state."""
        return np.ones(self.system.state_size, dtype=bool)

    def mean_of_halves(self, orbit: Orbit) -> NDArray[np.float64]:
        """See `OrbitPlane.mean_of_halves`."""
        flow, coefficients = flow_of(orbit.system), coefficients_of(orbit.system)
        first, half = self.unknowns(orbit), 0.5 * PERIOD * orbit.period
        return 0.5 * (first + flow.integrate(coefficients, first, self.begin, self.begin + half).state)

    def _turn(
        self,
        coefficients: NDArray[np.float64],
        state: NDArray[np.float64],
        slopes: NDArray[np.float64],
        keeps: int | None = None,
    ) -> Arc:
        """Integrate the motion from a state over the whole period, with all sensitivities."""
        stop = self.begin + PERIOD * self.period
        return self._flow.integrate(coefficients, state, self.begin, stop, slopes, keeps=keeps)

    def _after(self, theta: float) -> float:
        """Return an angle within the period after that at which the unknowns are taken."""
        return self.begin + (theta - self.begin) % (PERIOD * self.period)

    def _released(self, coefficients: NDArray[np.float64], arc: Arc, start: NDArray[np.float64]) -> Arc:
        """Return the motion over the whole period with the reset of what friction keeps; see `released`."""
        return released(self._layout, coefficients, [arc], start, self._length)[0]

    def _scaled(self, place: Place, arc: Arc, scales: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the monodromy matrix of a motion over the whole period, in units of the state."""
        matrix = transition_of(self._released(place.coefficients, arc, place.unknowns))
        units = scales[: len(matrix)]
        return matrix * units / units[:, None]

    @cached_property
    def _length(self) -> float:
        return natural_length(self._layout, coefficients_of(self.system))

    @cached_property
    def _flow(self) -> Flow:
        others = [self.alike] * (len(self.names) - 1) if self.alike else self.names[1:]
        return flow_of(self.system, self.names[0], *others, transition=True)


@lru_cache(maxsize=8)
def _without_directions(flow: Flow) -> Flow:
    """Return the flow of the same systems, with the transition matrix, but without derivatives by parameters."""
    return flow_with(flow.equations.layout, flow.equations.pattern.astype(float), transition=True)


def _final_derivatives(arc: Arc) -> NDArray[np.float64]:
    """Return the derivatives of the final state by initial state and parameters, in rows of state_size + k."""
    assert arc.sensitivity is not None
    transition = transition_of(arc)
    # by one parameter alone the sensitivity is a vector
    return np.concatenate((transition, arc.sensitivity.reshape(len(transition), -1)), axis=1)


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
        """Return the residual of a point in the plane of one parameter, and the place, without derivatives by it."""
        # The residual of a condition on multipliers is not divided by its slope, so it needs none of the multipliers.
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
        """Return the cubic coefficient of a flip; see the function of this name in `critical_multipliers`."""
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
    s, s_before, last = 0.0, -secant.first, np.inf
    before = corrector.correct(correction.x + s_before * tangent, tangent)
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
        way, last = (correction.x - before.x) / (s - s_before), abs(step)
        step = max(-secant.longest, min(secant.longest, step))
        found = None
        while found is None and abs(s + step) < secant.farthest:
            found = corrector.correct(correction.x + step * way, tangent)
            step *= 1.0 if found is not None else 0.5
            if abs(step) < secant.first:
                break
        if found is None:
            return None
        f_before, before, correction, s_before, s = f, correction, found, s, s + step
    return None


def onto_curve(corrector: Corrector, start: NDArray[np.float64]) -> tuple[Correction | None, NDArray[np.float64]]:
    """Return the point of a curve nearest to a start in scaled variables, or None, and the tangent near there."""
    tangent = np.linalg.svd(corrector.jacobian(start))[2][-1]
    return corrector.correct(start, tangent), tangent


# Equation of the loci of points of sliding: a periodic orbit at an instant of which friction is about to change.

_STEP = 1e-150  # of the complex step
_ASIDE = 1e-6  # step of central differences, as a share of the unknowns
_LEAD = 0.3  # largest angle before the instant, in radians, from which on friction keeps its mode
_REFINEMENTS, _FARTHEST = 4, 0.05  # of the angle of the start, and the largest change in each
_AT = 1e-3  # radians within which the beginning of a phase is the instant itself
# shares of the largest rate by which the rates at the start are moved where the motion from it is not known
_ASTRAY = 1e-5  # share of the unknowns by which a motion may miss them after a period
_BESIDE = (0.0, 1e-10, 1e-9, 1e-8, 1e-7)
_MARGIN = 1e-11  # distance from the change, on the side without the phase; as for grazing

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SlidingEquation(LocusEquation):
    """Equation of an orbit with two conditions at an angle ``theta*``.

    Where slip ends (crossing- and switching-sliding), the slip rate and the reserve of the force are zero. Within slip
    (grazing-sliding), the slip rate and its derivative are. Within stick (adding-sliding and the onset of slip), the
    reserve and its derivative are. Shortly before ``theta*`` the friction keeps its mode, so all are smooth.

    The unknowns are those of the orbit, ``theta*`` and the first parameter; the second parameter is followed.
    """

    others: ClassVar[int] = 2

    instant: Instant  #: What vanishes.
    #: Angle before the instant, in radians, from which on the friction keeps its mode: all the period at an onset of
    #: slip, where the position that it keeps is the same all along the locus.
    lead: float
    units: tuple[float, float]  #: Scales of the two conditions.
    tolerance: float  #: Largest residual, relative to the size of the unknowns.

    def place(self, unknowns: Array, *others: float) -> Place:
        """Evaluate the equations of the orbit; see `OrbitPlane.place`."""
        keeps = self.instant.contact if self.lead >= PERIOD * self.period else None
        plane = cast("ShotPlane", self.plane)
        return plane.place(unknowns[: -self.others], float(unknowns[-1]), *others, keeps=keeps)

    def linearised(self, unknowns: Array, *others: float) -> tuple[Array, Array, Place]:
        """See `LocusEquation.linearised`."""
        place, size = self.place(unknowns, *others), len(unknowns) - 2
        jacobian = np.zeros((size + 2, size + 2 + len(others)))
        jacobian[:size, :size], jacobian[:size, size + 1 :] = place.jacobian[:, :size], place.jacobian[:, size:]
        found, jacobian[size:] = self._conditions(place, float(unknowns[-2]))
        residual = np.concatenate((place.residual, found / self.units))
        jacobian[size:] /= np.array(self.units)[:, None]
        if self.instant.what != "stop":
            residual[size] -= _MARGIN
        return residual, jacobian, place

    def _reached(self, place: Place, theta: float) -> tuple[float, Array, Array, FrictionGauge, DryModes, DryModes]:
        """Return the instant: its angle, state, derivatives of that, gauge, and the modes of slip and of stick."""
        plane, (_, contact, side), full = cast("ShotPlane", self.plane), self.instant, PERIOD * self.period
        structure = plane.system.structure
        angle = theta % full
        lead = min(self.lead, angle)
        if self.lead < full:
            lead = min(self.lead, 0.5 * self.since_begin(place.evidence.slips, angle))
        angle += full * (angle < 2.0 * lead and self.lead < full)
        there, by_all, arc = plane.reached(place, contact, angle - lead, angle)
        gauge = FrictionGauge(layout_of(structure), contact)
        modes = modes_along(structure, np.array([angle - lead]), arc.slips, arc.holds, before=True).at(0)
        return angle, there, by_all, gauge, gauge.slipping(modes, side), gauge.sticking(modes)

    def since_begin(self, slips: Sequence[SlipEvent], angle: float) -> float:
        """Return the angle from the end of slip in the other direction to an instant within a phase."""
        what, contact, side = self.instant
        own = [event for event in slips if event.contact == contact and what != "stop"]
        pairs, full = zip([*own[-1:], *own[:-1]], own, strict=True), PERIOD * self.period
        since = ((angle - event.theta) % full for before, event in pairs if before.slip == -side != event.slip)
        return min(since, default=math.inf)

    def tangency(self, unknowns: Array, value: float) -> float:
        """Return the change of the reserve where slip ends, in its unit; its sign decides what follows the slip."""
        n, rates = self.plane.system.size, np.zeros(len(unknowns))
        rates[n : 2 * n] = np.abs(unknowns[n : 2 * n]).max()
        for aside in _BESIDE:  # a motion that comes exactly there could go either way; the mean of two is close to it
            with suppress(FlowError):
                asides = (-aside, aside) if aside else (0.0,)
                return float(np.mean([self._tangency_at(unknowns + each * rates, value) for each in asides]))
        raise FlowError("the motion could go either way where slip ends")

    def _tangency_at(self, unknowns: Array, value: float) -> float:
        place = self.place(unknowns, value)
        if np.abs(place.residual).max() > _ASTRAY * np.abs(place.unknowns).max():
            raise FlowError("the motion does not return")
        angle, there, _, gauge, _, sticks = self._reached(place, float(unknowns[-2]))
        return _changing(gauge)(place.coefficients, angle, there, sticks, -self.instant.side) / self.units[1]

    def _conditions(self, place: Place, theta: float) -> tuple[Array, Array]:
        """Return both conditions, and their derivatives by unknowns, angle and parameters."""
        plane, (what, _, side), size = cast("ShotPlane", self.plane), self.instant, len(place.unknowns)
        angle, there, by_all, gauge, slips, sticks = self._reached(place, theta)
        pairs: dict[str, list[tuple[Callable[..., Any], DryModes, int]]] = {
            "stop": [(gauge.rate, slips, side), (gauge.reserve, sticks, -side)],
            "rate": [(gauge.rate, slips, side), (gauge.acceleration, slips, side)],
            "reserve": [(gauge.reserve, sticks, side), (_changing(gauge), sticks, side)],
        }
        own = slips if what != "reserve" else sticks
        values, derivatives = np.empty(2), np.empty((2, size + 1 + len(plane.names)))
        rates = gauge.motion(place.coefficients, angle, there, own)
        for row, (function, modes_of, towards) in enumerate(pairs[what]):

            def at(y: NDArray, coefficients: NDArray, t: Any, use: Any = (function, modes_of, towards)) -> Any:
                return use[0](coefficients, t, y, use[1], use[2])

            by_state, by_angle, by_slopes = _derivatives(
                at, there, place.coefficients, angle, place.slopes, rates, smooth=row == 0 or what != "reserve"
            )
            values[row] = float(np.real(at(there, place.coefficients, angle)))
            derivatives[row, :size] = by_state @ by_all[:, :size]
            derivatives[row, size] = by_angle
            derivatives[row, size + 1 :] = by_state @ by_all[:, size:] + by_slopes
        return values, derivatives

    def unknowns(self, orbit: Orbit) -> Array:
        """Return the unknowns of an orbit, with the angle of the margin that is nearest to zero."""
        theta, values = nearest_margin(orbit, self.instant).theta, [orbit.system[name] for name in self.plane.names]
        if self.instant.what != "stop":
            place = self.plane.place(self.plane.unknowns(orbit), *values)
            for _ in range(_REFINEMENTS):
                found, derivatives = self._conditions(place, theta)
                shift = -found[1] / derivatives[1, len(place.unknowns)]
                theta += max(-_FARTHEST, min(_FARTHEST, float(shift)))
        return np.concatenate((self.plane.unknowns(orbit), [theta, orbit.system[self.plane.names[0]]]))


def instant_on(orbit: Orbit, kind: Sliding, contact: str) -> Instant:
    """Return what vanishes at a point of sliding, which names its contact and its side."""
    name, _, sign = contact.rpartition(" ")
    names = [each.name for each in orbit.system.structure.contacts]
    return Instant(kind.what, names.index(name), 1 if sign == "+" else -1)


def posed(plane: ShotPlane, kind: Sliding, orbit: Orbit, contact: str, length: float, tolerance: float):
    """Return the equation of the locus of a point of sliding."""
    instant = instant_on(orbit, kind, contact)
    near = nearest_margin(orbit, instant)
    time = float(orbit.system.frequency)
    units = {
        "stop": (time, near.range / length),
        "rate": (time, time**2),
        "reserve": (near.range / length, near.range * time / length),
    }
    full = PERIOD * orbit.period
    passed = [(near.theta - phase.start) % full for phase in orbit.friction[instant.contact]]
    lead = min([_LEAD, *(0.5 * each for each in passed if each > _AT)]) if kind is not Kind.SLIP_ONSET else full
    return SlidingEquation(plane, instant, lead, units[kind.what], min(tolerance, 0.1 * _MARGIN * length))


def _changing(gauge: FrictionGauge) -> Callable[..., Any]:
    def changing(coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> float:
        return gauge.change(gauge.reserve, coefficients, theta, y, modes, side)

    return changing


def _derivatives(
    function: Callable[..., Any],
    y: Array,
    coefficients: Array,
    theta: float,
    slopes: Array,
    rates: Array,
    *,
    smooth: bool,
) -> tuple[Array, float, Array]:
    """Return the derivatives of a function of one instant by the state, along the motion over theta, and by slopes."""
    size = len(y)
    ways = [(row, 0.0 * coefficients, 0.0) for row in np.eye(size)]
    ways.append((rates * float(coefficients[0]), 0.0 * coefficients, 1.0))
    ways += [(0.0 * y, slope, 0.0) for slope in slopes]
    found = []
    for dy, dc, dt in ways:
        if smooth:
            step = 1j * _STEP
            found.append(complex(function(y + step * dy, coefficients + step * dc, theta + step * dt)).imag / _STEP)
        else:
            moved = max(float(np.abs(dy).max()), float(np.abs(dc).max(initial=0.0)), abs(dt)) or 1.0
            step = _ASIDE / moved
            ends = [function(y + s * dy, coefficients + s * dc, theta + s * dt) for s in (step, -step)]
            found.append(float(ends[0] - ends[1]) / (2.0 * step))
    return np.array(found[:size]), found[size], np.array(found[size + 1 :])
