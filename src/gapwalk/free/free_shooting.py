"""Shooting of free motions: periodic orbits of a system without excitation, whose frequency is an unknown too.

Over ``theta = W t`` the period is 2 pi at any frequency W, so W is the only unknown more. One condition more fixes the
phase: at theta = 0 the rate of one coordinate is zero, as at its largest deflection. So with the state x, the flow P
over one period, and the rate v_k,

    P(x; W, a) - x = 0,    v_k = 0

are 2n + 1 equations for 2n + 1 unknowns at each value a of a parameter. They are regular at an orbit whose only
multiplier 1 is the trivial one (Doedel, Keller and Kernevez 1991, Int. J. Bifurcation Chaos 1, 745-772).

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.bracketed_root import zero_between_signs
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import is_dry
from gapwalk.model.coefficients import (
    CoefficientLayout,
    ParameterPlane,
    coefficients_of,
    layout_of,
    loads_act,
    numbers_vary,
    static_load,
)
from gapwalk.model.modes import gyroscopic_part
from gapwalk.model.spring import springs_of
from gapwalk.model.static_force import static_forces_of
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation
from gapwalk.orbit.shooting import assembled, composed
from gapwalk.orbit.sticking import never_slipping, transition_of

# Small motions of a system without excitation: their matrices at a state, and the length beyond which they change.

_STEP = 1e-150  # complex step
_OCTAVES = np.arange(-60, 61)  # lengths that are tried, as powers of two
_CHANGED = 0.3  # relative change of a matrix at which motions are no longer small
_SLIGHT = 1e-6  # damping, relative to a frequency, whose changes do not count
_FEW = 8  # coordinates that are displaced one by one


def tangents(
    layout: CoefficientLayout, coefficients: NDArray[np.float64], q: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and damping for small motions about states, per unit of mass, each shape (..., n, n)."""
    # They are exact to rounding, by a complex step; at a breakpoint those of its open side.
    steps = 1j * _STEP * np.eye(q.shape[-1])
    with np.errstate(all="ignore"):
        by_positions = [np.imag(accelerations(layout, coefficients, 0.0, q + step, v + 0j)) for step in steps]
        by_rates = [np.imag(accelerations(layout, coefficients, 0.0, q + 0j, v + step)) for step in steps]
    return -np.stack(by_positions, axis=-1) / _STEP, -np.stack(by_rates, axis=-1) / _STEP


def companion(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of small motions in positions and velocities, shape (2n, 2n)."""
    size = len(stiffness)
    return np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]])


def length_at_rest(system: System, positions: NDArray[np.float64]) -> float:
    """Return a length of a system: its largest clearance, or the smallest motion that is not small, or 1."""
    # Shapes: `positions` (n,).
    gaps = [slope.clearance for spring in springs_of(system) for slope in spring.slopes if slope.clearance > 0.0]
    if gaps:
        return max(gaps)
    layout, coefficients, size = layout_of(system.structure), coefficients_of(system), system.size
    stiffness, damping = tangents(layout, coefficients, positions, np.zeros(size))
    frequency = float(np.sqrt(np.abs(stiffness).max()))
    ways = np.vstack((np.ones(size), np.eye(size)[:_FEW]))
    moved = (np.exp2(_OCTAVES.astype(float))[:, None, None] * ways).reshape(-1, size)
    still = np.zeros_like(moved)
    found = [1.0]
    for q, v in ((moved, still), (still, moved * frequency)):
        changed = tangents(layout, coefficients, positions + q, v)
        off = np.zeros(len(moved), dtype=bool)
        for matrix, other, least in zip((stiffness, damping), changed, (0.0, _SLIGHT * frequency), strict=True):
            size_of = max(float(np.abs(matrix).max()), least)
            change = np.abs(other - matrix).max(axis=(1, 2))
            off |= ~(change <= _CHANGED * size_of) & (size_of > 0.0)
        lengths = np.abs(moved[off]).max(axis=1)
        found += [float(lengths.min())] if len(lengths) else []
    return min(found[1:], default=1.0)


# The system without its excitation, and the refusal of systems whose equations depend on the angle.


def without_excitation(system: System) -> System:
    """Return a system without its excitation: its damping and its constant loads remain.

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    System
        The same system, in which the amplitudes of all harmonics are zero.

    Raises
    ------
    ModelError
        If something still depends on the angle of the excitation: a load that is no harmonic, or a varying number.

    Examples
    --------
    >>> import gapwalk as gw
    >>> free = gw.free.without_excitation(gw.paper.case("13"))
    >>> free["harmonic1.amplitude"], free["damping.q1.q1"] > 0.0
    (0.0, True)
    """
    free = system.at(dict.fromkeys(amplitudes_of(system), 0.0))
    check_free(free)
    return free


def amplitudes_of(system: System) -> list[str]:
    """Return the names of the amplitudes of all loads that depend on the angle."""
    names = [f"{load.name}.amplitude" for load in system.structure.harmonics if load.multiples]
    return [name for name in names if name in system.structure.names]


def check_constant(system: System) -> None:
    """Raise a ModelError if a constant load depends on the frequency, of which a free motion has its own."""
    for load in system.structure.harmonics:
        if not load.multiples and load.depends_on_frequency:
            raise ModelError(
                f"{load.name} is constant over the angle and depends on the frequency of the excitation, but a free "
                f"motion has a frequency of its own; write the value that {load.name} has at this speed as a mean load"
            )


def check_free(system: System) -> None:
    """Raise a ModelError if the equations of a system depend on the angle of its excitation."""
    if loads_act(system):
        names = ", ".join(load.name for load in layout_of(system.structure).structure.harmonics if load.multiples)
        raise ModelError(
            f"a free motion has no excitation, and {names} acts on this system; take it out with "
            "gw.free.without_excitation(system), or set its amplitude to 0"
        )
    if numbers_vary(system):
        raise ModelError(
            "a number of this system varies over the angle of the excitation, and a free motion has no such angle; set "
            "the amplitude of that variation to 0"
        )


# The system without damping and excitation, its energy, and the test that its motions run backwards.

_LOSSES = ("impact_damping", "viscous_damping")  # numbers of contacts that are set to zero
_BACK = 1e-7  # largest difference of a motion that ran forward and back, relative to it


def without_losses(system: System) -> System:
    """Return a system without damping and without excitation: its mean loads remain, and its gyroscopic terms.

    Of a drive train, the system of its equations of motion is returned.

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    System
        The same system without damping and excitation.

    Raises
    ------
    ModelError
        For a system with dry friction or rigid stops, or with another force that depends on velocities; or if its
        gyroscopic terms cannot be distinguished from losses.

    Examples
    --------
    >>> import gapwalk as gw
    >>> free = gw.free.without_losses(gw.paper.case("13"))
    >>> free["damping.q1.q1"], free["harmonic1.amplitude"]
    (0.0, 0.0)
    """
    if is_dry(system.structure):
        raise ModelError(
            "a system with dry friction or rigid stops has no free vibration without losses; leave them out, or "
            "replace a rigid stop by a stiff one"
        )
    check_constant(system)
    plain = system.equations
    structure, names = plain.structure, plain.coordinates
    zero = [f"{form.name}.{loss}" for form in structure.contacts for loss in _LOSSES]
    kept = gyroscopic_part(plain, plain.matrix("stiffness"), plain.matrix("damping"))
    turning = damping_values(plain, np.zeros((len(names), len(names))) if kept is None else kept)
    none = {name: 0.0 for name in (*zero, *amplitudes_of(plain)) if name in structure.names}
    free = plain.at({**none, **turning})
    _check_reversible(free)
    return free


def damping_values(system: System, damping: NDArray[np.float64]) -> dict[str, float]:
    """Return the values of the parameters that make up a damping matrix."""
    names = system.coordinates
    return {f"damping.{a}.{b}": float(damping[i, k]) for i, a in enumerate(names) for k, b in enumerate(names)}


def _check_reversible(system: System) -> None:
    """Refuse a system whose motions do not run backwards, by running one: that shows any loss, whatever its law."""
    # Gyroscopic terms turn with the motion.
    flow, coefficients = flow_of(system), coefficients_of(system)
    turned = coefficients_of(system.at(damping_values(system, -system.matrix("damping"))))
    size = 2.0 * max((slope.clearance for spring in springs_of(system) for slope in spring.slopes), default=1.0) or 1.0
    start = np.zeros(2 * system.size)
    start[: system.size] = size * np.linspace(1.0, 0.7, system.size)
    turn = np.repeat([1.0, -1.0], system.size)
    try:
        there = flow.integrate(coefficients, start, 0.0, PERIOD).state
        back = flow.integrate(turned, turn * there, 0.0, PERIOD).state * turn
    except FlowError:
        return
    unit = system.state_scales()
    if np.abs((back - start) / unit).max() > _BACK * max(np.abs(start / unit).max(), np.abs(there / unit).max()):
        raise ModelError(
            "the motions of this system without damping and excitation do not run backwards: a force depends on rates "
            "(such as a formula with v), or a number varies over the angle; take that out of the model"
        )


def potential_of(system: System, positions: NDArray[np.float64]) -> float:
    """Return the potential energy at some positions, relative to zero positions, in the units of the model."""
    # The forces of contacts are integrated along the straight line from zero, piece by piece between breakpoints. It is
    # nan if the stiffness matrix is not symmetric or a contact acts along another vector than its deflection: then the
    # equations were multiplied by something, and do not show their energy.
    if not shows_energy(system):
        return float("nan")
    total = 0.5 * float(positions @ system.matrix("stiffness") @ positions) - float(static_load(system) @ positions)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for force, spring in zip(static_forces_of(system), springs_of(system), strict=True):
        along = force.deflections @ positions
        places = {0.0, 1.0}
        edges = [slope.sign * slope.clearance / along[0] for slope in spring.slopes if along[0] != 0.0]
        places |= {edge for edge in edges if 0.0 < edge < 1.0}
        ordered = sorted(places)
        for low, high in pairwise(ordered):
            shares = low + (high - low) * 0.5 * (nodes + 1.0)
            forces = force.by_deflections(np.outer(shares, along)).force
            total += 0.5 * (high - low) * float(weights @ forces) * float(force.direction @ positions)
    return total


def shows_energy(system: System) -> bool:
    """Return True if the equations of a system show its energy: they were not multiplied by anything."""
    stiffness = system.matrix("stiffness")
    symmetric = np.allclose(stiffness, stiffness.T, rtol=1e-12, atol=1e-12 * np.abs(stiffness).max(initial=0.0))
    forces = static_forces_of(system)
    return symmetric and all(
        len(each.deflections) == 1 and np.allclose(each.direction, each.deflections[0]) for each in forces
    )


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
    #: Number of segments into which the period is divided. For strongly unstable motions, use several.
    segments: Annotated[int, Ge(1), Le(1000)] = 1
    tolerance: float = 1e-10  #: Largest residual of an orbit, relative to the size of its state.

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
            raise FlowError(f"{names} never slips along a free motion, so this motion is one of a continuum")
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
        """Return the orbit of a solution."""
        # The multipliers are those of the return map to the section ``v_k = 0``, whose derivative is that of the flow
        # with its part along the motion taken out, and the trivial one. The change by the frequency is a multiple of
        # the rate of the state at the end.
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
    """Return the next state of a motion at which a coordinate is at its largest deflection, within a period."""
    # The state itself is returned if the coordinate does not turn round.
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
