"""Shooting: a periodic orbit as the fixed point of the flow over m forcing periods, in one or more segments.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, partial
from itertools import pairwise
from typing import Annotated, ClassVar, NamedTuple, cast

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, FlowError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.equations import natural_length
from gapwalk.flow.event_rule import jump_of, jumping_switches
from gapwalk.flow.flow import PERIOD, Arc, Flow, flow_of
from gapwalk.flow.forces import Angles
from gapwalk.flow.motion import Gauge
from gapwalk.flow.symmetry import Symmetry, symmetries_of
from gapwalk.late_fields import LateFields, late
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.drifting import brought_back, drifts_of, returned, together
from gapwalk.orbit.floating import centre_of
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import Evaluation, OrbitEquation, places_beside, roundings
from gapwalk.orbit.sticking import Closure, never_slipping, released, stuck_in, transition_of

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

    #: Number of segments into which the orbit's period is divided (multiple shooting): 1 suits most orbits; use several
    #: for strongly unstable motions.
    segments: Annotated[int, Ge(1), Le(_SEGMENTS)] = 1
    #: Largest residual of an orbit, relative to the size of its state.
    tolerance: Annotated[float, Ge(1e-14), Le(1e-3)] = 1e-10

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


@dataclass(frozen=True, eq=False)
class LateEvaluation(LateFields):
    """Evaluation whose derivatives are late: that of the motion alone."""

    _late: ClassVar[tuple[str, ...]] = ("by_unknowns", "by_parameter")
    residual: NDArray[np.float64]
    by_unknowns: NDArray[np.float64]
    by_parameter: NDArray[np.float64] | None
    evidence: list[Arc]  #: The arcs, without transitions.
    reach: float
    exact: Callable[[], list[Arc]]  #: Returns the arcs with transitions.


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
            for state, start, stop in zip(states, knots[:-1], knots[1:], strict=True)
        ]
        kept = bool(arcs[0].slips and never_slipping(arcs))
        free = released(layout_of(self.system.structure), coefficients, arcs, states[0], self.length) if kept else arcs
        if not kept and self._drifts.shape[1]:
            free = returned(self._drifts, arcs)
        found = assembled(free, states)
        if kept and direction is not None:
            self._place(found, bounded, coefficients, direction, arcs, states)
        reach = self._reach(arcs, coefficients)
        return Evaluation(found.residual, found.by_unknowns, found.by_parameter, arcs, reach)

    def evaluate_late(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return the evaluation with its derivatives late where they are dear; see `OrbitEquation.evaluate_late`."""
        if not self.is_dear:
            return self.evaluate(unknowns, value)
        coefficients, flow = self.coefficients(value)[0], flow_of(self.system_at(value))
        states = unknowns.reshape(len(self.knots) - 1, -1)
        arcs = [flow.integrate(coefficients, *each) for each in zip(states, self.knots, self.knots[1:], strict=False)]
        if never_slipping(arcs):  # what friction keeps depends on the transition
            return self.evaluate(unknowns, value)
        exact = cache(lambda: self.evaluate(unknowns, value))
        residual = np.concatenate([arc.state - after for arc, after in zip(arcs, np.roll(states, -1, 0), strict=True)])
        derivatives = late(lambda: exact().by_unknowns), late(lambda: exact().by_parameter)
        found = LateEvaluation(residual, *derivatives, arcs, self._reach(arcs, coefficients), lambda: exact().evidence)
        return cast("Evaluation", found)

    @property
    def is_dear(self) -> bool:
        """See `OrbitEquation.is_dear`; by the number of columns of the transition matrix, which is no clock."""
        return self._flow.is_dear and not (self.begin or self.held or self._drifts.shape[1])

    def _reach(self, arcs: list[Arc], coefficients: NDArray[np.float64]) -> float:
        return min(_shallowest(arcs), self._slowest(arcs)) * float(coefficients[0]) if _modes_go_on(arcs) else 0.0

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
        state = unknowns[: system.state_size].copy()
        if self.begin:
            arcs = self._from_zero(coefficients_of(system), arcs, unknowns.reshape(len(arcs), -1))
            state = brought_back(self._drifts, arcs[-1].state)
        exact = evaluation.exact if isinstance(evaluation, LateEvaluation) else None
        closure = Closure.of(layout_of(system.structure), lambda: coefficients_of(system), arcs, state, exact)
        found = Orbit(
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
        if len(arcs) == 1:
            found.__dict__["_reversals"] = arcs[0].reversals
        return found

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
        """Yield equations with more segments, and the states of the motions from and to a state that meet best."""
        # An error of the state grows as the square root of the largest multiplier up to the middle of the period, from
        # either end.
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
    def _drifts(self) -> NDArray[np.float64]:
        return drifts_of(self.system)

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
        return together(self._drifts, found.states[1:-1]).ravel()

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
        return together(self._drifts, np.array(states)).ravel()

    def carried(
        self, state: NDArray[np.float64], change: NDArray[np.float64], value: float, start: float, stop: float
    ) -> NDArray[np.float64]:
        """Return the change of a motion and of the parameter at an angle, as the change of the state at a later one."""
        # Shapes: `state` (state_size,); `change` (state_size + 1,).
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
    """Assemble residual and derivatives from the segments' arcs and their initial states."""
    # The states have the shape (segments, state_size).
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
    """Return True if all friction begins each arc in the mode in which it ends the arc before."""
    # A spring in slip whose extension is a little within its limit would stick at first, until it is there again.
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


# Orbits that are about to touch a breakpoint, posed so that the stiffness beyond it does not matter.
#
# Where a deflection just touches the breakpoint of a stage of stiffness k, the effect of the stage on the motion grows
# with the depth d as ``k d^1.5``, and beyond depths of about 1/k as its square root. Newton's method in the state at
# theta = 0 meets a slope that arises within a depth of 1/k^2, and jumps back and forth over the breakpoint. Therefore
# the depth is prescribed instead. A segment begins just before the touch, where the depth that the motion would reach
# unimpeded is an explicit and smooth function of the state. With the depth fixed, the impact is fixed too, and the
# other equations are smooth.

LEAD = 2e-3  # largest angle, in radians, by which a segment begins before a touch
_STEADY = 0.02  # largest relative change of the acceleration from there to the touch
_SHORTEST = 1e-6  # angle before a touch below which a segment is useless, in radians
_JUST = 1e-6  # angle before a touch at which its acceleration is read, by which angles of events may be off
_TURNING = 0.05  # share of the way to where the acceleration vanishes up to which it is almost constant
_ITERATIONS = 12
_SIMPLE = 4  # steps of the simplified Newton's method
_EXACTLY = 2  # steps that give the touches their depth
_CALIBRATIONS = 2
_UNEVEN = 0.1  # largest relative difference of the depths of simultaneous touches
_SETTLED = 1e-16  # length of a Newton step, in scaled variables, below which nothing changes
_ROUNDING = 1e-9  # the same if steps become no shorter
_EXACT = 1e-14  # residual, relative to the states, that is rounding


class Touch(NamedTuple):
    """Touch: a point of an orbit where a deflection turns near a breakpoint."""

    switch: int  #: Stage and side of the breakpoint: index into `Equations.switches`.
    #: Angle, in radians, at which the deflection turns, or at which it crosses the breakpoint just before.
    theta: float
    #: Depth beyond the breakpoint that the deflection would reach if the stage did not change there; negative if it
    #: turns before it.
    depth: float
    #: Second derivative of the depth over time, just before: negative if the deflection comes from outside.
    acceleration: float


class Held(NamedTuple):
    """Orbit with a prescribed depth of its touch."""

    states: NDArray[np.float64]  #: shape (segments, state_size): The state at the beginning of each segment.
    value: float  #: Value of the parameter.
    depth: float  #: The depth.
    evaluation: Evaluation  #: Evaluation of the equation with all segments.
    #: shape (segments * state_size + 1,): Derivatives of the scaled states and the scaled parameter with respect to the
    #: depth.
    slope: NDArray[np.float64]
    #: Error of the value due to rounding: the change by another Newton step, and the rounding of the depth.
    error: float


def touches(orbit: Orbit) -> list[Touch]:
    """Return all places where a deflection turns near a breakpoint, or crosses it and returns, nearest first."""
    # For a crossing, the depth is computed from the velocity there. In a rigid stop nothing is deep; an impact has the
    # depth that the motion would reach without it.
    rigid = {switch for _, switch in orbit.system.structure.reactions}
    places: list[tuple[float, int, float | None]] = [
        (theta, switch, depth)
        for switch, turns in enumerate(orbit.turning_depths)
        for theta, depth in zip(*turns, strict=True)
        if switch not in rigid or depth <= 0.0  # otherwise it is the speed of an impact, of which the event tells more
    ]
    places += [(event.theta, event.switch, None) for event in orbit.events]
    sides = [side for _, side, _ in orbit.system.breakpoints]
    # a state at the angle of an impact may be the one before it or the one after it
    speeds = {(each.theta, each.switch): sides[each.switch] * each.velocity for each in orbit.events if each.enters}
    places = sorted((each for each in places if each[0] > 0.0), key=lambda each: each[:2])
    if not places:
        return []
    # the acceleration jumps where a force does, and where the deflection turns, as the slip of friction on it reverses
    just = _JUST if orbit.slips or jumping_switches(orbit.system, friction=False) else 0.0
    thetas = sorted({max(theta - aside, 0.0) for theta, _, _ in places for aside in (0.0, just)})
    states = dict(zip(thetas, _states(orbit, thetas), strict=True))
    coefficients, found = coefficients_of(orbit.system), []
    for theta, switch, depth in places:
        gauge = Gauge(layout_of(orbit.system.structure), switch)
        _, speed, acceleration = gauge.read(coefficients, theta, states[theta])
        if just and (depth is not None or switch not in rigid):
            before = max(theta - just, 0.0)
            acceleration = gauge.read(coefficients, before, states[before])[2]
        if depth is None:
            speed = speeds.get((theta, switch), speed) if switch in rigid else speed
            if speed * acceleration < 0.0:
                found.append(Touch(switch, theta, -0.5 * speed**2 / acceleration, acceleration))
        elif depth * acceleration >= 0.0 or (switch in rigid and acceleration < 0.0):
            found.append(Touch(switch, theta, depth, acceleration))
    return sorted(found, key=lambda touch: abs(touch.depth))


class TouchEquation:
    """Equation of shooting orbits near one or several touches, each with a segment that begins just before it.

    Shapes: `scales` (N + 1,).
    """

    def __init__(
        self,
        equation: ShootingEquation,
        near: Orbit,
        touches: Sequence[Touch],
        scales: NDArray[np.float64],
        lead: float = LEAD,
    ) -> None:
        self._own, self._near = equation, near
        # one for all: what the depth leaves out before a touch is then the same in each of a symmetric motion
        leads = [min(self._lead(touch, lead) for touch in touches)] * len(touches)
        full, rate = PERIOD * equation.period, coefficients_of(near.system)[0]
        self._thetas = [(touch.theta - ahead) % full for touch, ahead in zip(touches, leads, strict=True)]
        self._posed = replace(equation, marks=tuple(self._thetas))
        self._firsts = [self._posed.knots.index(knot) for knot in equation.knots]  # where the own segments begin
        self._segments = [self._posed.knots.index(theta) for theta in self._thetas]
        self._switches = [touch.switch for touch in touches]
        self._gauges = [Gauge(layout_of(equation.system.structure), switch) for switch in self._switches]
        self._jumps = not jumping_switches(near.system, friction=False).isdisjoint(self._switches)
        self._offsets = np.zeros(len(touches))
        self.deepest = min(
            abs(touch.acceleration) * (rate * ahead) ** 2 / 8.0 for touch, ahead in zip(touches, leads, strict=True)
        )
        """Depth up to which a touch certainly begins after the start of its segment."""
        self.turns = min(map(self._turns_up_to, touches, leads))
        """Depth by which a touch may miss the breakpoint, so that its deflection certainly still turns there."""
        self.free = float(np.sign(touches[0].acceleration))
        """Sign of the depths at which the breakpoint is not passed."""
        self._size = equation.system.state_size
        self._scales = np.append(np.tile(scales[: self._size], len(self._posed.knots) - 1), scales[-1])
        self._weights = 1.0 / np.append(self._scales[:-1], np.full(len(touches), scales[0]))

    def at(self, orbit: Orbit) -> Held:
        """Return an orbit of the shooting equation as one of this equation."""
        value = orbit.system[self._own.parameter or ""]
        unknowns = np.append(self._posed.unknowns(orbit), value)
        return self._solve(unknowns, float(self._depths(unknowns)[0][0]))

    def hold(self, start: Held, depth: float) -> Held:
        """Return the orbit with a prescribed depth near another orbit."""
        unknowns, ahead = np.append(start.states.ravel(), start.value), 0.0
        if self._jumps and start.depth * self.free > 0.0 > depth * self.free:
            return self._solve(self._struck(start, depth), depth)
        if self._jumps and start.depth * self.free <= 0.0 < depth * self.free:
            # the derivatives with the impact grow as the inverse of its velocity; where it is missed they are smooth
            return self._solve(self._at_depth(unknowns, depth), depth)
        if depth * self.free > 0.0:
            ahead = depth - start.depth if start.depth * self.free > 0.0 else 0.0
        elif start.depth * depth > 0.0:  # the effect of an impact is smooth in its velocity, the root of the depth
            ahead = 2.0 * start.depth * (np.sqrt(depth / start.depth) - 1.0)
        unknowns += ahead * start.slope * self._scales
        if self._jumps and depth * self.free > 0.0:  # off by so little, the orbit might touch
            unknowns = self._at_depth(unknowns, depth)
        try:
            return self._solve(unknowns, depth)
        except ConvergenceError:
            if not start.depth * self.free < 0.0 < depth * self.free:
                raise
        # the derivatives with a touch are not valid beyond its end: go to its end first
        return self.hold(self.hold(start, 0.0), depth)

    def _struck(self, start: Held, depth: float) -> NDArray[np.float64]:
        """Return a start for Newton's method with a touch of a force that jumps, from an orbit that just misses it."""
        # An impact changes the motion in proportion to its velocity, the root of the depth. Derivatives of that are
        # large, but they vanish while the depth does not change. So the first steps leave them out. The very first one
        # does not integrate the motion: an impact that nothing makes up for may let the next touch begin before its
        # segment does, as another impact.
        unknowns = np.append(start.states.ravel(), start.value) + (depth - start.depth) * start.slope * self._scales
        for number in range(_SIMPLE):
            depths, rows = self._depths(unknowns)
            integrated = self._posed.evaluate(unknowns[:-1], float(unknowns[-1])).residual if number else None
            residual = self._impulses(start, depth) if integrated is None else integrated
            matrix = self._bordered(start.evaluation, rows)
            right = -np.append(residual, depths - depth) * self._weights
            unknowns = unknowns + np.linalg.lstsq(matrix, right, rcond=None)[0] * self._scales
            unknowns = self._at_depth(unknowns, depth)
        return unknowns

    def shifted(self, start: Held, depth: float) -> float:
        """Return by how much touches of a depth move the parameter, to first order; for a force that jumps."""
        if not self._jumps:
            raise ConvergenceError("the contact force begins at zero, so the root of the depth does not move the orbit")
        unknowns = np.append(start.states.ravel(), start.value)
        matrix = self._bordered(start.evaluation, self._depths(unknowns)[1])
        right = -np.append(self._impulses(start, depth), np.zeros(len(self._gauges))) * self._weights
        return float(np.linalg.lstsq(matrix, right, rcond=None)[0][-1] * self._scales[-1])

    def _impulses(self, start: Held, depth: float) -> NDArray[np.float64]:
        """Return the residual that impacts of a depth leave of an orbit that just misses them, to first order."""
        layout, n = layout_of(self._own.system.structure), self._own.system.size
        coefficients, residual = self._posed.line.coefficients(start.value)[0], np.zeros(start.states.size)
        touches = zip(self._gauges, self._switches, self._segments, self._thetas, strict=True)
        for gauge, switch, segment, theta in touches:
            state = start.states[segment]
            acceleration = gauge.read(coefficients, theta, state)[2]
            kick = np.zeros(self._size)
            kick[n : 2 * n] = _impulse(layout, coefficients, switch, theta, depth, acceleration)
            place = slice(segment * self._size, (segment + 1) * self._size)
            residual[place] = start.evaluation.by_unknowns[place, place] @ kick
        return residual

    def _at_depth(self, unknowns: NDArray[np.float64], depth: float) -> NDArray[np.float64]:
        """Return unknowns with positions at which each touch has exactly a depth."""
        # The depth is the square of the velocity of an impact, so the square of a step changes it as much as the step
        # itself; Newton's method would not converge otherwise.
        found, n = unknowns.copy(), self._own.system.size
        for _ in range(_EXACTLY):
            missing = depth - self._depths(found)[0]
            for gauge, segment, short in zip(self._gauges, self._segments, missing, strict=True):
                vector = gauge.vector(self._posed.line.coefficients(float(found[-1]))[0])
                found[segment * self._size : segment * self._size + n] += short * vector / (vector @ vector)
        return found

    def calibrate(self, start: Held, depth: float) -> Held:
        """Correct for changes of the acceleration before the touch, by means of an orbit that just misses it."""
        for _ in range(_CALIBRATIONS):
            start = self.hold(start, self.free * min(depth, self.turns))
            unknowns, evaluation = self.evaluation(start)
            depths = self._own.orbit(unknowns, start.value, evaluation).turning_depths
            for number, (switch, theta) in enumerate(zip(self._switches, self._thetas, strict=True)):
                turns = depths[switch]
                self._offsets[number] += turns.values[turns.nearest(theta, PERIOD * self._own.period)] - start.depth
        return start

    def evaluation(self, held: Held) -> tuple[NDArray[np.float64], Evaluation]:
        """Return the unknowns and the evaluation of the shooting equation itself at an orbit."""
        pieces = [held.evaluation.evidence[i:j] for i, j in pairwise(self._firsts)]
        states = held.states[self._firsts[:-1]]
        arcs, coefficients = [composed(piece) for piece in pieces], self._own.coefficients(held.value)[0]
        found = assembled(
            released(layout_of(self._own.system.structure), coefficients, arcs, states[0], self._own.length), states
        )
        return states.ravel(), found._replace(evidence=arcs)

    def slope(self, held: Held) -> NDArray[np.float64]:
        """Return the derivatives of the shooting equation's scaled unknowns and scaled parameter by the depth."""
        return np.append(held.slope[:-1].reshape(-1, self._size)[self._firsts[:-1]].ravel(), held.slope[-1])

    def rounding(self, held: Held) -> float:
        """Return the largest change of the value of an orbit by rounding of the residual; see `roundings`."""
        unknowns = held.states.ravel()
        x = np.append(unknowns, held.value)
        matrix = self._bordered(held.evaluation, self._depths(x)[1])
        places = places_beside(x, self._scales)
        asides = [self._posed.evaluate(place[:-1], float(place[-1])) for place in places]
        samples = roundings(x, held.evaluation, places, asides)
        right = np.zeros((len(matrix), len(samples)))
        right[: len(unknowns)] = (samples * self._weights[: len(unknowns)]).T
        return float(np.abs(np.linalg.lstsq(matrix, right, rcond=None)[0][-1]).max() * self._scales[-1])

    def _lead(self, touch: Touch, lead: float) -> float:
        """Return the angle before a touch at which its segment begins, after the last event, at steady acceleration."""
        before = [event.theta for event in self._near.events if event.theta < touch.theta]
        lead = min(lead, 0.5 * (touch.theta - max(before, default=0.0)))
        gauge = Gauge(layout_of(self._near.system.structure), touch.switch)
        coefficients = coefficients_of(self._near.system)
        while lead > _SHORTEST:
            theta = touch.theta - lead
            acceleration = gauge.read(coefficients, theta, _states(self._near, [theta])[0])[2]
            if abs(acceleration - touch.acceleration) <= _STEADY * abs(touch.acceleration):
                return lead
            lead /= 4.0
        raise ConvergenceError(f"the segment before the touch is too short at theta = {touch.theta:.6g}")

    def _turns_up_to(self, touch: Touch, lead: float) -> float:
        """Return a share of the way from a turn to where the acceleration changes its sign, ``|a|^3 / (3 j^2)``."""
        # A motion that misses the breakpoint by more may not turn at all. Impacts that follow each other ever faster
        # end where their acceleration vanishes, so there this way is short.
        gauge, coefficients = (
            Gauge(layout_of(self._near.system.structure), touch.switch),
            coefficients_of(self._near.system),
        )
        theta = touch.theta - lead
        before = gauge.read(coefficients, theta, _states(self._near, [theta])[0])[2]
        jerk = (touch.acceleration - before) / (float(coefficients[0]) * lead)
        return _TURNING * abs(touch.acceleration) ** 3 / (3.0 * jerk**2) if jerk else np.inf

    def _solve(self, unknowns: NDArray[np.float64], depth: float) -> Held:
        """Solve for a prescribed depth of all touches by Newton's method, down to rounding."""
        #     [ G_u         G_a       ] [ du ]     [ -G                    ]
        #     [ depths_u    depths_a  ] [ da ]  =  [ wanted depth - depths ]
        #
        # In a symmetric motion each simultaneous touch adds an equation, but the additional conditions are not
        # independent. They make the system regular even where another branch crosses on which one touch is deeper.
        before, strikes = np.inf, self._jumps and depth * self.free < 0.0
        if strikes and len(self._switches) > 1:  # an impact that is off would throw the next one far off
            unknowns = self._at_depth(unknowns, depth)
        for _ in range(_ITERATIONS):
            value = float(unknowns[-1])
            evaluation = self._posed.evaluate(unknowns[:-1], value)
            depths, rows = self._depths(unknowns)
            matrix, states = self._bordered(evaluation, rows), unknowns[:-1] / self._scales[:-1]
            right = np.zeros((len(matrix), 2))
            right[:, 0] = np.append(-evaluation.residual, depth - depths) * self._weights
            right[len(states) :, 1] = self._weights[len(states) :]
            # small changes may grow by 1e6 in a segment, and nothing of the other equations may be lost beside those
            growth = np.maximum(1.0, np.linalg.norm(matrix, axis=1))
            solution, _, _, singular = np.linalg.lstsq(matrix / growth[:, None], right / growth[:, None], rcond=None)
            steps = np.asarray(solution, dtype=np.float64)
            length = float(np.linalg.norm(steps[:, 0]))
            if not length < 1.0:
                break
            # a residual of rounding causes steps of this length: they are long if a coordinate is hardly restrained
            rounding = max(_ROUNDING, _EXACT * float(np.abs(states).max()) / float(singular[-1]))
            if length < _SETTLED or (length < rounding and length > 0.5 * before):
                # all equations must be satisfied: there may be more of them than unknowns
                slack, missed = self._own.tolerance * float(np.abs(states).max()), np.abs(right[:, 0])
                uneven = missed[len(states) :].max() > _UNEVEN * abs(depth) * self._weights[-1] + slack * 1e-3
                grown = max(1.0, _EXACT * float(growth.max()) / self._own.tolerance)  # rounding grows with the motion
                if not uneven and missed[: len(states)].max() <= slack * grown:
                    error = abs(float(steps[-1, 0]) * self._scales[-1])
                    return Held(unknowns[:-1].reshape(-1, self._size), value, depth, evaluation, steps[:, 1], error)
                if length < _SETTLED:
                    raise ConvergenceError("the touches do not reach the same depth")
            unknowns, before = unknowns + steps[:, 0] * self._scales, length
            if strikes:
                unknowns = self._at_depth(unknowns, depth)
        raise ConvergenceError(f"no orbit is found that passes a breakpoint by {depth:.3g}, near {unknowns[-1]:.12g}")

    def _bordered(self, evaluation: Evaluation, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the scaled derivatives of a residual by the unknowns and the parameter, with further rows below."""
        assert evaluation.by_parameter is not None
        matrix = np.vstack((np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)), rows))
        return self._weights[:, None] * matrix * self._scales

    def _depths(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the depth of each touch, and its derivatives with respect to all unknowns and the parameter."""
        coefficients, direction = self._posed.line.coefficients(float(unknowns[-1]))
        depths, rows = self._offsets.copy(), np.zeros((len(self._gauges), len(unknowns)))
        for number, (gauge, segment) in enumerate(zip(self._gauges, self._segments, strict=True)):
            place = slice(segment * self._size, (segment + 1) * self._size)
            depth, rows[number, place], rows[number, -1] = _reach(
                gauge, coefficients, direction, self._thetas[number], unknowns[place]
            )
            depths[number] += depth
        return depths, rows


def _reach(
    gauge: Gauge,
    coefficients: NDArray[np.float64],
    direction: NDArray[np.float64],
    theta: float,
    state: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64], float]:
    """Return the depth at which a deflection will turn, and its derivatives by the state and along a direction."""
    # The acceleration is taken as constant. Its own derivatives are left out, since their effect is of second order in
    # a short time.
    depth, speed, turning = gauge.read(coefficients, theta, state)
    if turning == 0.0:
        raise ConvergenceError("the deflection does not turn at the breakpoint")
    vector, (by_value, by_rate) = gauge.vector(coefficients), gauge.slopes(coefficients, direction, theta, state)
    if gauge.sways:
        by_value -= speed / turning * by_rate
    by_state = np.zeros(len(state))
    by_state[: 2 * len(vector)] = np.concatenate((vector, -speed / turning * vector))
    return depth - 0.5 * speed**2 / turning, by_state, by_value


def _impulse(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    switch: int,
    theta: float,
    depth: float,
    acceleration: float,
) -> NDArray[np.float64]:
    """Return the change of the velocities by a touch of a depth: by a rebound, or by a force that begins with a jump.

    The force lasts until the deflection, with what is left of its acceleration, has its speed the other way. Where the
    deflection comes from inside, it is missing for so long.
    """
    contact, side, _ = layout.structure.breakpoints[switch]
    first = next(place for place, each in enumerate(layout.structure.breakpoints) if each.contact == contact)
    slots, push = layout.contacts[contact], coefficients[layout.contacts[contact].force]
    way = -1.0 if acceleration > 0.0 else 1.0
    before, along = way * side * np.sqrt(-2.0 * depth * acceleration), float(coefficients[slots.deflection] @ push)
    if slots.form.law.rebounds:
        numbers = Angles(layout, coefficients, theta).named(slots.numbers, slots.waves)
        return (slots.form.law.rebound(before, numbers) - before) / along * push
    force = 0.0
    for stage, each in enumerate(slots.stages):
        if (
            each.sign * coefficients[each.clearance] == side * coefficients[slots.stages[switch - first].clearance]
        ):  # also of a gap of no width
            quotient = jump_of(layout, contact, stage)
            jump = 0.0 if quotient is None else quotient(coefficients)(before, theta) * before
            force += way * each.sign * side * jump
    slowed = side * acceleration - along * force
    if slowed * before >= 0.0:
        raise ConvergenceError("the force beyond the breakpoint draws the deflection in")
    return 2.0 * before * force / slowed * push


def _states(orbit: Orbit, thetas: Sequence[float]) -> NDArray[np.float64]:
    """Return the states of an orbit at increasing angles."""
    grid = np.array([0.0, *thetas])
    return flow_of(orbit.system).sample(coefficients_of(orbit.system), orbit.state, grid, orbit.known_states).states[1:]
