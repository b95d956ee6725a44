"""Orbits of one system in the plane of two parameters: the interface that the equations of all loci use.

`ShotPlane` implements it by shooting, with orbits from their exact state at theta = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.kinds.defining_functions import Criticality
from gapwalk.bifurcation.kinds.flip import flip_coefficient
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.corrector import unknown_scales
from gapwalk.flow.breakpoints import Gauge
from gapwalk.flow.equations import natural_length
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of, flow_with
from gapwalk.model.coefficients import CoefficientLayout, ParameterPlane, coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation
from gapwalk.orbit.shooting import Shooting
from gapwalk.orbit.sticking import Closure, released, transition_of

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
        """Return the derivatives of the criticality of a place by unknowns and parameters, shape (N + k,).

        `scales` are those of the unknowns and of the parameters, shape (N + k,). With a `step`, in these units,
        differences are central ones with this step; otherwise forward ones with `STEP`.
        """
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
    alike: tuple[str, ...] = ()
    """Parameters of which any may be the second and following; they share one compiled flow. Empty for `names`."""

    def with_system(self, system: System) -> ShotPlane:
        """Return the plane of another system with the same parts, with the same compiled flow if that suits it.

        Looking up a compiled flow takes as long as a period of motion. The flow leaves out coefficients that are zero
        here; a system in which one of them is not zero needs a flow of its own.
        """
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
        jacobian, size = _derivatives(closed), len(unknowns)
        jacobian[:, :size].flat[:: size + 1] -= 1.0
        return Place(unknowns, coefficients, slopes, closed.state - unknowns, jacobian, arc)

    def closed(
        self, unknowns: NDArray[np.float64], *point: float, theta: float | None = None
    ) -> tuple[Place, NDArray[np.float64]]:
        """Evaluate the equations without derivatives by the parameters, which take a third of the time of `place`.

        Returns the place, and the state at the angle `theta` on the way; at the start if there is none.
        """
        flow, stop = _without_directions(self._flow), PERIOD * self.period
        coefficients, there = self._parameters.coefficients(*point)[0], unknowns
        angle = 0.0 if theta is None else theta % stop
        if angle > 0.0:
            found = flow.vary(coefficients, unknowns, np.array([0.0, angle, stop]))
            arc, there = (
                Arc(found.states[-1], found.transitions[-1], None, found.contacts, 0, *found.logs[1:]),
                found.states[1],
            )
        else:
            arc = flow.integrate(coefficients, unknowns, 0.0, stop)
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
        closure = Closure.of(self._layout, lambda: evaluation.evidence.coefficients, [arc], unknowns)
        return Orbit(
            self._parameters.system_at(first, second),
            self.period,
            unknowns.copy(),
            closure.multipliers,
            tuple(arc.contacts),
            float(np.abs(evaluation.residual).max()),
            arc.steps,
            slips=closure.slips,
            stuck=closure.stuck,
        )

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the state at theta = 0."""
        return orbit.state.copy()

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
            return _derivatives(self._released(place.coefficients, arc, place.unknowns))

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
        angle = theta % (PERIOD * self.period)
        there, by_all = place.unknowns, np.eye(size, size + len(self.names))
        if angle > 0.0:
            arc = self._flow.integrate(coefficients, place.unknowns, 0.0, angle, slopes)
            there, by_all = arc.state, _derivatives(arc)
        vector, (depth, rate, turning) = gauge.vector(coefficients), gauge.read(coefficients, angle, there)
        derivatives = np.empty((2, size + 1 + len(self.names)))
        by_all = np.stack((vector @ by_all[:n], vector @ by_all[n : 2 * n]))
        by_all[:, size:] += np.transpose([gauge.slopes(coefficients, each, angle, there) for each in slopes])
        derivatives[:, :size], derivatives[:, size + 1 :] = by_all[:, :size], by_all[:, size:]
        derivatives[:, size] = coefficients[0] * rate, coefficients[0] * turning
        return np.array([depth, rate]), derivatives

    def reached(
        self, place: Place, contact: int, keeping: float, angle: float
    ) -> tuple[NDArray[np.float64], NDArray, Arc]:
        """Return the state at an angle, its derivatives by unknowns and parameters, and the motion until `keeping`.

        From that angle on the friction of a contact keeps its mode. Errors as in `Flow.integrate`.
        """
        if keeping <= 0.0:
            only = self._flow.integrate(place.coefficients, place.unknowns, 0.0, angle, place.slopes, keeps=contact)
            return only.state, _derivatives(only), place.evidence
        first = self._flow.integrate(place.coefficients, place.unknowns, 0.0, keeping, place.slopes)
        last = self._flow.integrate(place.coefficients, first.state, keeping, angle, place.slopes, keeps=contact)
        size, to, on = len(place.unknowns), _derivatives(first), _derivatives(last)
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
        return 0.5 * (orbit.state + flow.integrate(coefficients, orbit.state, 0.0, 0.5 * PERIOD * orbit.period).state)

    def _turn(
        self,
        coefficients: NDArray[np.float64],
        state: NDArray[np.float64],
        slopes: NDArray[np.float64],
        keeps: int | None = None,
    ) -> Arc:
        """Integrate the motion from a state over the whole period, with all sensitivities."""
        return self._flow.integrate(coefficients, state, 0.0, PERIOD * self.period, slopes, keeps=keeps)

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


def _derivatives(arc: Arc) -> NDArray[np.float64]:
    """Return the derivatives of the final state by initial state and parameters, in rows of state_size + k."""
    assert arc.sensitivity is not None
    transition = transition_of(arc)
    # by one parameter alone the sensitivity is a vector
    return np.concatenate((transition, arc.sensitivity.reshape(len(transition), -1)), axis=1)
