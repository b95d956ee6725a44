"""Shooting: a periodic orbit as the fixed point of the flow over m forcing periods, in one or more segments.

Method: docs/numerics/continuation.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.flow.length_unit import natural_length
from gapwalk.flow.symmetry import Symmetry, symmetries_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.centring import centre_of
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation
from gapwalk.orbit.sticking import Closure, never_slipping, released, stuck_in, transition_of

if TYPE_CHECKING:
    from gapwalk.orbit.touch_equation import TouchEquation


_SEGMENTS = 1000  # largest number of segments
_NEAR = 1e-10  # lengths of the system by which a spring that is pushed along lacks its limit
_NEVER = 1e3  # factor on the limit of friction that does not slip
_MOST, _UNKNOWNS = 64, 2000  # segments, and their unknowns, up to which they are tried where one fails
_MEETS = 1e-6  # error of a motion that ends in a state, as a share of it
_APART = 0.1  # distance of the motions from and to a state, as a share of them, from which Newton's method may start
_GROWTH = 1e5  # of a small change of the state in a segment: beyond, residuals of 1e-10 are hardly reached


@dataclass(frozen=True, slots=True)
class Shooting(Method):
    """Options of shooting.

    Examples
    --------
    >>> gw.find_orbit(system, method=gw.Shooting(segments=4)).stable
    True
    """

    name: ClassVar[str] = "shooting"

    #: Number of segments into which the orbit's period is divided (multiple shooting): 1 suits most orbits; more help
    #: if the motion is strongly unstable.
    segments: Annotated[int, Ge(1)] = 1
    tolerance: Annotated[float, Gt(0)] = 1e-10  #: Largest residual of an orbit, relative to the size of its state.

    def __post_init__(self) -> None:
        if isinstance(self.segments, bool) or not isinstance(self.segments, int) or not 1 <= self.segments <= _SEGMENTS:
            raise ModelError(f"segments is {self.segments!r}; it must be an integer from 1 to {_SEGMENTS}")
        if not 1e-14 <= self.tolerance <= 1e-3:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-14 and 1e-3")

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> ShootingEquation:
        """Return the shooting equation of the orbits of a system."""
        return ShootingEquation(system, parameter, period, self)

    @classmethod
    def resolving(cls, orbit: Orbit, count: int) -> Shooting:
        """Return the method with as many segments as the orbit has states."""
        return cls(max(1, count // orbit.system.state_size))

    def for_loci(self) -> Shooting:
        """Return the method with one segment."""
        return replace(self, segments=1)


class HeldSpring(NamedTuple):
    """A spring in series whose friction never slips: its contact, and where it is."""

    contact: int  #: Number of the contact.
    #: Side of the bound that its force just reaches, to which it is pushed along; 0 if it keeps its position.
    side: int
    #: position, doubt: The position that it keeps, and how well it is known.
    position: float = 0.0
    doubt: float = 0.0


@dataclass(frozen=True)
class ShootingEquation(OrbitEquation):
    """Equations ``Phi_j(x_j; a) - x_(j+1) = 0`` for the S segments of an orbit of m forcing periods (paper, section 3).

    The unknowns are the states at the start of each segment, one after the other. Over theta the period is ``2 pi m``
    at any frequency, so the frequency is a parameter like any other.
    """

    options: Shooting = Shooting()
    #: Angles at which further segments begin, in addition to those of the options: see `TouchEquation`.
    marks: tuple[float, ...] = ()
    #: Angle at which the first segment begins, in radians. An impact at theta = 0 makes the state there jump from one
    #: orbit of a branch to the next; where the motion is free, the state is smooth. An `Orbit` has its state at theta =
    #: 0 in any case, so only the unknowns depend on this angle.
    begin: float = 0.0
    held: tuple[HeldSpring, ...] = ()  #: Springs in series whose friction never slips, not even beyond its limit.

    @property
    def by_touches(self) -> Callable[..., TouchEquation] | None:
        """Function that makes the equation with a segment that begins just before each touch."""
        from gapwalk.orbit.touch_equation import TouchEquation

        return None if self.begin else partial(TouchEquation, self)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives; see `Equation.evaluate`."""
        coefficients, direction = self.coefficients(value)
        bounded, knots, flow = coefficients, self.knots, self._flow
        for spring in self.held:
            coefficients = coefficients.copy() if coefficients is bounded else coefficients
            coefficients[layout_of(self.system.structure).contacts[spring.contact].numbers["limit"]] *= _NEVER
        states = unknowns.reshape(len(knots) - 1, -1)
        arcs = [
            flow.integrate(coefficients, state, start, stop, direction)
            for state, (start, stop) in zip(states, pairwise(knots), strict=True)
        ]
        kept = bool(never_slipping(arcs))
        free = released(layout_of(self.system.structure), coefficients, arcs, states[0], self.length) if kept else arcs
        found = assembled(free, states)
        if kept and direction is not None:
            self._place(found, bounded, coefficients, direction, arcs, states)
        reach = min(_shallowest(arcs), self._slowest(arcs)) * float(coefficients[0]) if _modes_go_on(arcs) else 0.0
        return Evaluation(found.residual, found.by_unknowns, found.by_parameter, arcs, reach)

    def _slowest(self, arcs: list[Arc]) -> float:
        """Return the least speed of the first impacts of arcs: a step of its size may let a motion rest instead."""
        rigid = {switch for _, switch in self.system.structure.reactions}
        struck = ((event for event in arc.contacts if event.switch in rigid and event.enters) for arc in arcs if rigid)
        firsts = [next(events, None) for events in struck]
        return min((abs(event.velocity) for event in firsts if event is not None), default=math.inf)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> Orbit:
        """Return the orbit of a solution."""
        arcs: list[Arc] = evaluation.evidence
        system = self.system_at(value)
        if self.begin:
            arcs = self._from_zero(coefficients_of(system), arcs, unknowns.reshape(len(arcs), -1))
        state = arcs[-1].state if self.begin else unknowns[: system.state_size].copy()
        closure = Closure.of(layout_of(system.structure), lambda: coefficients_of(system), arcs, state)
        return Orbit(
            system,
            self.period,
            state,
            closure.multipliers,
            tuple(event for arc in arcs for event in arc.contacts),
            max(map(abs, evaluation.residual.tolist())),
            sum(arc.steps for arc in arcs),
            slips=closure.slips,
            stuck=closure.stuck,
            restarts=self._restarts(unknowns),
        )

    def _restarts(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states at the starts of the later segments, if these are equal and begin at theta = 0."""
        states = unknowns.reshape(len(self.knots) - 1, -1)
        return states[1:].copy() if not (self.begin or self.marks) else states[:0]

    def inaccuracy(self, orbit: Orbit) -> str:
        """Return that more segments are needed if small changes grow too much in one of several, with the multiplier.

        One segment serves as long as Newton's method converges: beside the graze of a stiff stop the multiplier grows
        in one instant, where segments do not help.
        """
        largest = abs(complex(orbit.multipliers[0]))
        count = self.options.segments
        if count == 1 or largest ** (1.0 / count) <= _GROWTH:
            return ""
        return (
            f"small changes of the motion grow by {largest:.3g} in a period (its largest multiplier), too much for "
            f"{count} segment{'s' if count > 1 else ''} of shooting; write method = gw.Shooting(segments = {4 * count})"
        )

    def finer(self) -> ShootingEquation | None:
        """Return the equation with four times as many segments."""
        count = 4 * self.options.segments
        return replace(self, options=replace(self.options, segments=count)) if count <= _SEGMENTS else None

    def divided(self, state: NDArray[np.float64]) -> Iterator[tuple[ShootingEquation, NDArray[np.float64]]]:
        """Yield equations with more segments, and the states of the motions from and to a state that meet best.

        An error of the state grows as the square root of the largest multiplier up to the middle of the period, from
        either end.
        """
        structure, finer = self.system.structure, self.finer()
        if structure.reactions or structure.friction or self.begin or self.marks:
            return
        while finer and finer.options.segments <= min(_MOST, _UNKNOWNS / len(state)):
            ahead, back, unit = finer._forwards(state), finer._backwards(state), self.system.state_scales()
            apart = {
                place: float(np.linalg.norm((ahead[place] - back[place]) / unit))
                for place in range(1, min(len(ahead), len(finer.knots) - 1))
                if place in back
            }
            meet = min(apart, key=lambda place: apart[place], default=0)
            if meet and apart[meet] <= _APART * max(float(np.linalg.norm(each / unit)) for each in ahead[:meet]):
                states = [*ahead[:meet], *(back[place] for place in range(meet, len(finer.knots) - 1))]
                yield finer, np.concatenate(states)
            finer = finer.finer()

    def _forwards(self, state: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the states at the knots on the motion from a state, until it diverges."""
        coefficients, states = coefficients_of(self.system), [state]
        with suppress(FlowError):
            for start, stop in pairwise(self.knots):
                states.append(self._flow.integrate(coefficients, states[-1], start, stop).state)
        return states

    def _backwards(self, state: NDArray[np.float64]) -> dict[int, NDArray[np.float64]]:
        """Return, by the numbers of the knots, the states on the motion that ends in a state, as far as it is found."""
        coefficients, found = coefficients_of(self.system), {len(self.knots) - 1: state}
        with suppress(FlowError, np.linalg.LinAlgError):
            for place in range(len(self.knots) - 2, 0, -1):
                start, stop = self.knots[place], self.knots[place + 1]
                wanted, missed, trial = found[place + 1], np.inf, found[place + 1]
                while True:
                    arc = self._flow.integrate(coefficients, trial, start, stop)
                    off = arc.state - wanted
                    before, missed = missed, float(np.linalg.norm(off))
                    if not missed < before:
                        break
                    trial = trial - np.linalg.solve(transition_of(arc), off)
                if not missed <= _MEETS * float(np.abs(wanted).max()):
                    break
                found[place] = trial
        return found

    def _from_zero(self, coefficients: NDArray[np.float64], arcs: list[Arc], states: NDArray[np.float64]) -> list[Arc]:
        """Return the arcs of the motion from theta = 0 on; the one that passes the end of the period is cut there."""
        full, before, after = PERIOD * self.period, list[Arc](), list[Arc]()
        for arc, state, (start, stop) in zip(arcs, states, pairwise(self.knots), strict=True):
            if stop <= full:
                before.append(arc)
            elif start >= full:
                after.append(self._flow.integrate(coefficients, state, start - full, stop - full))
            else:
                before.append(self._flow.integrate(coefficients, state, start, full))
                after.append(self._flow.integrate(coefficients, before[-1].state, 0.0, stop - full))
        return [*after, *before]

    def _place(
        self,
        found: Evaluation,
        coefficients: NDArray[np.float64],
        unbounded: NDArray[np.float64],
        direction: NDArray[np.float64],
        arcs: list[Arc],
        states: NDArray[np.float64],
    ) -> None:
        """Replace the rows of extensions that friction keeps by the equation that they are centred, or at their limit.

        They are centred if the system is symmetric: the slider then stays in the middle. Otherwise the middle moves
        along the branch, which would turn where no multiplier is 1. Springs that are held keep their positions,
        or are at their limit but for so little that other integrators do not let them slip. A second computation
        comes another time as near, so that stated errors include it.
        """
        layout, n, size = layout_of(self.system.structure), self.system.size, states.shape[1]
        memories, held = layout.structure.memories, {each.contact: each for each in self.held}
        for contact in stuck_in(layout, coefficients, arcs):
            spring = held.get(contact)
            side = spring.side if spring else 0
            is_centred = contact in memories and not side and self._is_mirrored(contact)
            if not is_centred and not spring:
                continue
            slots, own = layout.contacts[contact], 2 * n + memories.index(contact)
            vector, row = coefficients[slots.deflection], (len(arcs) - 1) * size + own
            assert found.by_parameter is not None
            if spring and not is_centred and not side:
                found.residual[row] = vector @ states[0, :n] - states[0, own] - spring.position
                found.by_unknowns[row] = 0.0
                found.by_unknowns[row, :n], found.by_unknowns[row, own] = vector, -1.0
                found.by_parameter[row] = direction[slots.deflection] @ states[0, :n]
                continue
            picks = {1: (max,), -1: (min,), 0: (max, min)}[side]
            centre = centre_of(self._flow, self._light, slots, unbounded, direction, self.knots, states, picks)
            found.residual[row] = vector @ states[0, :n] - states[0, own] - centre.value
            found.by_unknowns[row] = -centre.by_unknowns
            found.by_unknowns[row, :n] += vector
            found.by_unknowns[row, own] -= 1.0
            found.by_parameter[row] = float(direction[slots.deflection] @ states[0, :n]) - centre.by_parameter
            if side:
                limit, stiffness = (slots.numbers[name] for name in ("limit", "stiffness"))
                reach = float(coefficients[limit] / coefficients[stiffness])
                found.residual[row] += side * (reach - _NEAR * self.options.segments * self.length)
                moved = float(direction[limit] - reach * direction[stiffness])
                found.by_parameter[row] += side * moved / float(coefficients[stiffness])

    def _is_mirrored(self, contact: int) -> bool:
        """Return True if the motions of the system are those of opposite deflection, half a forcing period later."""
        vector = self.system.vector(self.system.structure.contacts[contact].vectors[0])
        for each in self._symmetries if self.period % 2 else ():
            moved = np.zeros(len(vector))
            moved[[*each.order]] = np.array(each.signs) * vector
            if each.shift == 0.5 and np.allclose(moved, -vector):
                return True
        return False

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return symmetries_of(self.system)

    def unknowns(self, orbit: Orbit) -> NDArray[np.float64]:
        """Return the states of an orbit at the start of each segment."""
        if not len(orbit.restarts):
            return self._spread(orbit.state, orbit.system)
        flow, coefficients = flow_of(orbit.system), coefficients_of(orbit.system)
        full, known = PERIOD * self.period, orbit.known_states
        known = [*known, (full, orbit.state), *((full + angle, state) for angle, state in known)]
        found = flow.sample(coefficients, orbit.state, np.array([0.0, *self.knots]), known)
        return found.states[1:-1].ravel()

    def scales(self, length: float, frequency: float | None = None) -> NDArray[np.float64]:
        """Return scales: a length for positions, times the frequency for velocities, divided among the unknowns."""
        segments = len(self.knots) - 1
        unit = self.system.state_scales(length, frequency)
        return np.tile(unit, segments) * np.sqrt(self.system.size * segments)

    def otherwise(self) -> ShootingEquation:
        """Return the equation with one segment more: its steps and its rounding differ."""
        held = tuple(each._replace(position=each.position + each.doubt) for each in self.held)
        return replace(self, options=replace(self.options, segments=self.options.segments + 1), held=held)

    def embed(self, direction: NDArray[np.float64], other: OrbitEquation) -> NDArray[np.float64]:
        """Return the change of the state at theta = 0, with zeros for the other states, which it determines."""
        size = self.system.state_size
        return np.concatenate((direction[:size], np.zeros(len(other.scales(1.0)) - size)))

    def start(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states at the start of each segment on the motion from `state`."""
        return self._spread(state, self.system)

    def _spread(self, state: NDArray[np.float64], system: System) -> NDArray[np.float64]:
        """Return the states at the start of each segment on the motion of a system from `state`, concatenated."""
        flow, coefficients, states = flow_of(system), coefficients_of(system), [np.asarray(state, dtype=float)]
        if self.begin:
            states = [flow.integrate(coefficients, states[0], 0.0, self.begin).state]
        for start, stop in pairwise(self.knots[:-1]):
            states.append(flow.integrate(coefficients, states[-1], start, stop).state)
        return np.concatenate(states)

    def carried(
        self, state: NDArray[np.float64], change: NDArray[np.float64], value: float, start: float, stop: float
    ) -> NDArray[np.float64]:
        """Return the change of a motion and of the parameter at an angle, as the change of the state at a later one.

        Shapes: `state` (state_size,); `change` (state_size + 1,).
        """
        coefficients, direction = self.coefficients(value)
        arc = self._flow.integrate(coefficients, state, start, stop, direction)
        return np.append(transition_of(arc) @ change[:-1] + change[-1] * _sensitivity(arc), change[-1])

    @cached_property
    def knots(self) -> list[float]:
        """Angles at which the segments begin, and the end."""
        count = self.options.segments
        return sorted([*(self.begin + PERIOD * self.period * j / count for j in range(count + 1)), *self.marks])

    @cached_property
    def length(self) -> float:
        """The natural length of the system, for `released`."""
        return natural_length(layout_of(self.system.structure), coefficients_of(self.system))

    @cached_property
    def _light(self) -> Flow:
        return flow_of(self.system, *(() if self.parameter is None else (self.parameter,)))

    @cached_property
    def _flow(self) -> Flow:
        names = () if self.parameter is None else (self.parameter,)
        return flow_of(self.system, *names, transition=True)


def assembled(arcs: list[Arc], states: NDArray[np.float64]) -> Evaluation:
    """Assemble residual and derivatives from the segments' arcs and their initial states.

    The states have the shape (segments, state_size).
    """
    count, size = states.shape
    if count == 1:  # the usual case, evaluated at each iteration: no block has to be placed
        (arc,) = arcs
        jacobian = transition_of(arc) - _identity(size)
        return Evaluation(arc.state - states[0], jacobian, arc.sensitivity, arcs)
    residual = np.concatenate([arcs[j].state - states[(j + 1) % count] for j in range(count)])
    by_parameter = None if arcs[0].sensitivity is None else np.concatenate([_sensitivity(arc) for arc in arcs])
    # [ P_1  -I        ]
    # [       P_2  -I  ]
    # [ -I        P_3  ]
    jacobian = np.zeros((states.size, states.size))
    for j, arc in enumerate(arcs):
        jacobian[j * size : (j + 1) * size, j * size : (j + 1) * size] = transition_of(arc)
    rows = np.arange(states.size)
    jacobian[rows, (rows + size) % states.size] -= 1.0
    return Evaluation(residual, jacobian, by_parameter, arcs)


def composed(arcs: list[Arc]) -> Arc:
    """Compose successive arcs into one."""
    first = arcs[0]
    transition, sensitivity = transition_of(first), first.sensitivity
    for arc in arcs[1:]:
        transition = transition_of(arc) @ transition
        if sensitivity is not None:
            sensitivity = transition_of(arc) @ sensitivity + _sensitivity(arc)
    contacts = [event for arc in arcs for event in arc.contacts]
    steps, slips = sum(arc.steps for arc in arcs), [event for arc in arcs for event in arc.slips]
    return Arc(arcs[-1].state, transition, sensitivity, contacts, steps, slips)


def _shallowest(arcs: list[Arc]) -> float:
    """Return the depth of the shallowest touch per time of a radian: a quarter of its entry velocity times duration."""
    least = math.inf
    for arc in arcs:
        begun: dict[int, ContactEvent] = {}
        for event in arc.contacts:
            if event.enters:
                begun[event.switch] = event
            elif event.switch in begun:
                first = begun.pop(event.switch)
                least = min(least, 0.25 * abs(first.velocity) * (event.theta - first.theta))
    return least


def _modes_go_on(arcs: list[Arc]) -> bool:
    """Return True if all friction begins each arc in the mode in which it ends the arc before.

    A spring in slip whose extension is a little within its limit would stick at first, until it is there again.
    """
    if not arcs[0].slips:
        return True
    ends = [{event.contact: event.slip for event in arc.slips} for arc in arcs]
    begins = [{event.contact: event.slip for event in reversed(arc.slips)} for arc in arcs]
    return all(begin == end for begin, end in zip(begins, [ends[-1], *ends[:-1]], strict=True))


@lru_cache(maxsize=16)
def _identity(size: int) -> NDArray[np.float64]:
    return np.eye(size)


def _sensitivity(arc: Arc) -> NDArray[np.float64]:
    assert arc.sensitivity is not None
    return arc.sensitivity
