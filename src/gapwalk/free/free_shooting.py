"""Shooting of free motions: periodic orbits of a system without excitation, whose frequency is an unknown too.

Over ``theta = W t`` the period is 2 pi at any frequency W, so W is the only unknown more. One condition more fixes the
phase: at theta = 0 the rate of one coordinate is zero, as at its largest deflection. So with the state x, the flow P
over one period, and the rate v_k,

    P(x; W, a) - x = 0,    v_k = 0

are 2n + 1 equations for 2n + 1 unknowns at each value a of a parameter. They are regular at an orbit whose only
multiplier 1 is the trivial one (Doedel, Keller and Kernevez 1991, Int. J. Bifurcation Chaos 1, 745-772).

Method: docs/numerics/self-excited.md
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.bracketed_root import zero_between_signs
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.flow.length_unit import magnitude
from gapwalk.free.undriven import check_constant, check_free
from gapwalk.model.coefficients import ParameterPlane, coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation
from gapwalk.orbit.shooting import assembled, composed
from gapwalk.orbit.sticking import never_slipping, transition_of

_ON_SECTION = 1e-9  # rate of a coordinate, in units of a motion, that is zero but for rounding
_STILL = 1e-9  # change of the state in a radian, in units of a motion, below which it is at rest
_AROUND = 64  # samples of an orbit, of which that with the largest deflection is near the section
_TIMES = 400  # samples of a period between which the coordinate turns round
_LOWEST = 1e-6  # share of the frequency of the start below which a motion is not integrated


@dataclass(frozen=True, slots=True)
class FreeShooting(Method):
    """Shooting for free motions, whose frequency is unknown.

    Examples
    --------
    >>> gw.free.FreeShooting("x").coordinate
    'x'
    """

    name: ClassVar[str] = "free shooting"

    coordinate: str = ""  #: Name of the coordinate that is at rest at theta = 0; empty for the one that swings most.
    #: Number of segments into which the period is divided: more help if the motion is strongly unstable.
    segments: int = 1
    tolerance: float = 1e-10  #: Largest residual of an orbit, relative to the size of its state.

    def __post_init__(self) -> None:
        if isinstance(self.segments, bool) or not isinstance(self.segments, int) or not 1 <= self.segments <= 1000:
            raise ModelError(f"segments is {self.segments!r}; it must be an integer from 1 to 1000")

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> FreeEquation:
        """Return the equation of the free motions of a system."""
        if parameter == system.structure.pace:
            raise ModelError(
                f"{parameter} is an unknown of free motions, so it cannot be the parameter; write another one, such as "
                '"belt.speed"'
            )
        check_free(system)
        check_constant(system)
        if self.coordinate and self.coordinate not in system.coordinates:
            raise ModelError(f"coordinate is {self.coordinate!r}; it must be one of {', '.join(system.coordinates)}")
        return FreeEquation(system, parameter, period, self)


@dataclass(frozen=True, eq=False, repr=False)
class FreeOrbit(Orbit):
    """Periodic motion without excitation. The frequency of its system is its own.

    Its multipliers include the trivial one, which is exactly 1: a shift along the motion. `free_multipliers`, which
    decide on stability, have 0 in its place: they are those of the return map to the section on which it begins.

    Examples
    --------
    >>> orbit = cycle.points[-1].orbit
    >>> orbit.coordinate, orbit.stable
    ('x', True)
    """

    found_by: ClassVar[str] = "free shooting"

    coordinate: str  #: Name of the coordinate that is at rest at theta = 0.

    @property
    def method(self) -> type[Method]:
        """The method that finds such orbits."""
        return FreeShooting

    def posed_in(self, count: int) -> Method:
        """Return the method with the section on which this orbit begins."""
        return FreeShooting(self.coordinate, max(1, (count - 1) // self.system.state_size))

    @property
    def own_method(self) -> Method:
        """The method with its section: to others each phase of the motion is a motion."""
        return FreeShooting(self.coordinate)

    @property
    def kept(self) -> int:
        """Number of multipliers that are exactly 1: the trivial one."""
        return 1

    @property
    def determined(self) -> NDArray[np.float64]:
        """The unknowns that determine the motion: its state and its frequency, shape (state_size + 1,)."""
        return np.append(self.state, self.system[self.system.structure.pace])

    @property
    def duration(self) -> float:
        """The period in time: 2 pi over the frequency, times `period`."""
        return PERIOD * self.period / self.system.frequency


@dataclass(frozen=True)
class FreeEquation(OrbitEquation):
    """Equations of free motions in the state at theta = 0 and the frequency; see `FreeShooting`."""

    options: FreeShooting = field(default_factory=FreeShooting)
    frequencies: ClassVar[int] = 1
    """Number of unknowns, after the states, that are frequencies."""

    @cached_property
    def coordinate(self) -> int:
        """Number of the coordinate that is at rest at theta = 0."""
        return self.system.coordinates.index(self.options.coordinate) if self.options.coordinate else 0

    @cached_property
    def _names(self) -> tuple[str, ...]:
        pace = self.system.structure.pace
        return (pace,) if self.parameter is None else (self.parameter, pace)

    @cached_property
    def _plane(self) -> ParameterPlane:
        return ParameterPlane(self.system, self._names)

    @cached_property
    def _flow(self) -> Flow:
        return flow_of(self.system, *self._names, transition=True)

    def system_at(self, value: float) -> System:
        """Return the system at a value of the parameter, with the frequency of the equation's own."""
        return self.system_of(value, self.system[self._names[-1]])

    def system_of(self, value: float, pace: float) -> System:
        """Return the system at a value of the parameter and a frequency."""
        return self._plane.system_at(*(() if self.parameter is None else (value,)), pace)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; see `Equation.evaluate`."""
        states, pace = unknowns[:-1].reshape(self.options.segments, -1), float(unknowns[-1])
        if not pace > _LOWEST * abs(self.system[self._names[-1]]):
            raise FlowError(f"the frequency of a free motion became {pace:.3g}; it must be positive")
        point = (pace,) if self.parameter is None else (value, pace)
        coefficients, slopes = self._plane.coefficients(*point)
        direction = slopes if len(point) > 1 else slopes[0]
        arcs = [
            self._flow.integrate(coefficients, state, start, stop, direction)
            for state, (start, stop) in zip(states, pairwise(self._knots), strict=True)
        ]
        if kept := never_slipping(arcs):
            names = ", ".join(self.system.structure.contacts[contact].name for contact in kept)
            raise FlowError(f"{names} never slips along a free motion, so it is one of a continuum")
        found = assembled(arcs, states)
        assert found.by_parameter is not None
        sensitivity = found.by_parameter.reshape(states.size, -1)
        row, unit = self.system.size + self.coordinate, coefficients[0]  # the rate counts over theta, as a length
        by_unknowns = np.zeros((states.size + 1, states.size + 1))
        by_unknowns[:-1, :-1], by_unknowns[:-1, -1] = found.by_unknowns, sensitivity[:, -1]
        by_unknowns[-1, row] = unit
        residual = np.append(found.residual, unit * states[0, row])
        by_parameter = None if self.parameter is None else np.append(sensitivity[:, 0], 0.0)
        return Evaluation(residual, by_unknowns, by_parameter, arcs)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> FreeOrbit:
        """Return the orbit of a solution.

        The multipliers are those of the return map to the section ``v_k = 0``, whose derivative is that of the flow
        with its part along the motion taken out, and the trivial one. The change by the frequency is a multiple of the
        rate of the state at the end.
        """
        arcs: list[Arc] = evaluation.evidence
        around = composed(arcs)
        assert around.sensitivity is not None
        transition, rate = transition_of(around), around.sensitivity.reshape(len(around.state), -1)[:, -1]
        row, state = self.system.size + self.coordinate, unknowns[: len(around.state)].copy()
        system = self.system_of(value, float(unknowns[-1]))
        if abs(rate[row]) > _STILL * magnitude(state, system) * system.frequency / float(unknowns[-1]):
            returned = transition - np.outer(rate, transition[row]) / rate[row]
            returned[row] = 0.0
            found = multipliers([returned])
            found[np.argmin(np.abs(found))] = 1.0
        else:  # an equilibrium, at which a branch begins
            found = multipliers([transition])
            found[np.argsort(np.abs(found - 1.0))[:2]] = 1.0  # the critical pair
        found = found[np.argsort(-np.abs(found), kind="stable")]
        return FreeOrbit(
            system,
            self.period,
            state,
            found.astype(complex),
            tuple(event for arc in arcs for event in arc.contacts),
            float(np.abs(evaluation.residual[:-1]).max()),
            sum(arc.steps for arc in arcs),
            slips=tuple(around.slips),
            coordinate=self.system.coordinates[self.coordinate],
        )

    @cached_property
    def _knots(self) -> list[float]:
        """Angles at which the segments begin, and the end."""
        count = self.options.segments
        return [PERIOD * self.period * number / count for number in range(count + 1)]

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the states of an orbit from where the coordinate is at its largest deflection, and its frequency."""
        state, row = orbit.state, orbit.system.size + self.coordinate
        if abs(state[row]) / orbit.system.frequency > _ON_SECTION * magnitude(state, orbit.system):
            states = orbit.strobes(_AROUND * self.period, PERIOD / _AROUND)
            highest = int(np.argmax(states[:, self.coordinate]))
            state = at_rest(orbit.system, states[highest - 1], self.coordinate)
        return self._spread(state, orbit.system)

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of the motion from a state, with the frequency of the system as a guess."""
        return self._spread(at_rest(self.system, state, self.coordinate), self.system)

    def _spread(self, state: NDArray[np.float64], system: System) -> NDArray[np.float64]:
        """Return the states at the start of each segment on the motion of a system from a state, and its frequency."""
        flow, coefficients, states = flow_of(system), coefficients_of(system), [np.asarray(state, dtype=float)]
        for start, stop in pairwise(self._knots[:-1]):
            states.append(flow.integrate(coefficients, states[-1], start, stop).state)
        return np.append(np.concatenate(states), system[self._names[-1]])

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """Return scales: of the states as for shooting; that of the frequency is the frequency."""
        count = self.options.segments
        states = np.tile(self.system.state_scales(length, frequency), count) * np.sqrt(self.system.size * count)
        pace = self.system[self._names[-1]]
        return np.append(states, abs(pace if frequency is None else pace * frequency / self.system.frequency))

    def otherwise(self) -> FreeEquation:
        """Return the equation with one segment more: its steps and its rounding differ."""
        return replace(self, options=replace(self.options, segments=self.options.segments + 1))

    def with_other_phases(self, orbit: Orbit) -> list[NDArray[np.float64]]:
        """Return nothing: the phase condition sets where a free motion begins."""
        return []

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """Return the change of the first state and of the frequency, with zeros for the other states."""
        size = self.system.state_size
        found = np.zeros(len(other.scales(1.0)))
        found[:size], found[-1] = direction[:size], direction[-1]
        return found


def at_rest(system: System, state: NDArray[np.float64], coordinate: int) -> NDArray[np.float64]:
    """Return the next state of a motion at which a coordinate is at its largest deflection, within a period.

    The state itself is returned if the coordinate does not turn round.
    """
    flow, coefficients = flow_of(system), coefficients_of(system)
    thetas = np.linspace(0.0, PERIOD, _TIMES + 1)
    states = flow.sample(coefficients, state, thetas).states
    rates = states[:, system.size + coordinate]
    turns = np.flatnonzero((rates[:-1] > 0.0) & (rates[1:] <= 0.0))
    if not len(turns):
        return state
    first = int(turns[0])

    def rate(theta: float) -> float:
        return float(beyond(theta)[system.size + coordinate])

    def beyond(theta: float) -> NDArray[np.float64]:
        return flow.integrate(coefficients, states[first], 0.0, theta).state if theta > 0.0 else states[first]

    step = float(thetas[1])
    found = beyond(zero_between_signs(rate, 0.0, step, absolute=1e-14)) if rate(step) < 0.0 else states[first + 1]
    return np.asarray(found, dtype=np.float64)


def check_orbit(orbit: Any) -> None:
    """Raise a ModelError unless this is a free motion."""
    if not isinstance(orbit, FreeOrbit):
        raise ModelError(f"a free motion is needed, as from gw.free.find_self_excited(system), not {orbit!r:.60}")
