"""The margin of one change of the sequence of slip and stick: zero where its phase appears or vanishes.

What it is for each kind of change is said in `friction_along_branch`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.motion import DryModes, modes_along
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart
from gapwalk.orbit.sticking import Course, FrictionGauge, FrictionPhase, Margin

_SAME = 1.0  # radians by which an event may move in a step: where a quantity touches, by the root of its change
_TRACKED = 0.05  # radians by which the least value may have moved since it was known, without being searched for
_ROUGH = 0.1  # radians by which it may be off as a margin of the orbit, by its samples
_SMALL = 1e-4  # share of a value that does not matter far from its zero
_SETTLED, _REFINEMENTS = 1e-5, 8  # last step towards it, whose cube is rounding, and the largest number of steps
_BEGUN = 0.3  # largest angle after slip in the other direction ends at which least values are sought between samples
_CLOSER = 0.7 ** np.arange(30.0, -1.0, -1.0)  # shares of it
_AT_START = 1e-6  # radians from the start of the period within which an instant is taken from its end


class Change(NamedTuple):
    """A phase of friction that appears or vanishes."""

    contact: int  #: Number of the contact.
    #: before, mode, after: Mode of the phase before it, its own, and that of the phase after it.
    before: int
    mode: int
    after: int
    theta: float  #: The angle at which it begins.
    alone: bool  #: True if friction never slips without it.
    others: int = 0  #: Number of the other phases of the same mode between phases of the same modes.

    @property
    def side(self) -> int:
        """Direction of slip that the change concerns: 1 or -1."""
        return self.before or self.mode

    @property
    def reverses(self) -> bool:
        """True if it begins where the slip rate reverses its sign, not where a quantity touches zero."""
        return self.before != self.after


def modes_around(phases: Sequence[FrictionPhase]) -> list[tuple[int, int, int]]:
    """Return the modes before, in and after each phase of a period."""
    modes = [phase.mode for phase in phases]
    return list(zip([*modes[-1:], *modes[:-1]], modes, [*modes[1:], *modes[:1]], strict=True))


def own_phase(orbit: Orbit, change: Change, near: float) -> FrictionPhase | None:
    """Return the phase of a change nearest to an angle, if an orbit has it."""
    phases, full = orbit.friction.get(change.contact, []), PERIOD * orbit.period
    own = (change.before, change.mode, change.after)
    alike = [phase for phase, around in zip(phases, modes_around(phases), strict=True) if around == own]
    if len(alike) <= change.others:
        return None
    found = [(phase.away(near, full), phase) for phase in alike]
    return min((pair for pair in found if pair[0] < _SAME), key=lambda pair: pair[0], default=(0.0, None))[1]


def margin(orbit: Orbit, change: Change, near: float) -> tuple[float, float]:
    """Return the angle nearest to another one at which a change happens, and its margin there."""
    full, coefficients, readings = PERIOD * orbit.period, coefficients_of(orbit.system), flow_of(orbit.system).readings
    gauge = FrictionGauge(layout_of(orbit.system.structure), change.contact, readings)
    if change.reverses:
        phases = orbit.friction.get(change.contact, [])
        theta = min(
            (
                phase.start
                for place, phase in enumerate(phases)
                if phases[place - 1].mode == change.before and phase.mode in (change.mode, change.after)
            ),
            key=lambda start: apart(start, near, full),
            default=math.inf,
        )
        if not apart(theta, near, full) < _SAME:
            raise LookupError
        now, side = instant_of(orbit, theta), change.side
        at = coefficients, now.theta, now.state, gauge.sticking(now.modes)
        reserve = float(gauge.reserve(*at, -side))
        # stick ends at one bound or at the other, whose reserve is zero; both are where the bounds vanish
        return theta, reserve if change.before else reserve - float(gauge.reserve(*at, side))
    quantity = _Quantity(orbit, gauge, change)
    own = own_phase(orbit, change, near)
    if own is not None:
        course = quantity.course(instant_of(orbit, own.start))
        if own.length < (turned := quantity.turned(course)):  # another event ends the phase: it is least just before
            return (own.start + own.length) % full, quantity.ahead(course, own.length)
        # the angle is that of the vertex, which the least value has on the other side of the change
        return (own.start + turned) % full, -abs(course.depth)
    return _least(orbit, quantity, change, near)


def lowest_among(orbit: Orbit, change: Change, thetas: NDArray[np.float64]) -> list[float]:
    """Return those of increasing angles just after which the quantity of a change, which touches zero, was least."""
    gauge = FrictionGauge(layout_of(orbit.system.structure), change.contact)
    quantity = _Quantity(orbit, gauge, change)
    slopes = np.array([quantity.course(instant_of(orbit, theta)).slope for theta in thetas])
    return thetas[1:][(slopes[:-1] < 0.0) & (slopes[1:] > 0.0)].tolist()


class _Instant(NamedTuple):
    """One instant of an orbit: its angle, its state, and the modes just before it."""

    theta: float
    state: NDArray[np.float64]
    modes: DryModes


def instant_of(orbit: Orbit, theta: float) -> _Instant:
    """Return the state of an orbit, and its modes, at an angle, which may lie beyond its period."""
    # the modes before the start of the period are those at its end
    full = PERIOD * orbit.period
    angle = theta % full if theta % full > _AT_START else theta % full + full
    angles, flow = np.array([0.0, angle]), flow_of(orbit.system)
    found = flow.sample(coefficients_of(orbit.system), orbit.state, angles, orbit.known_states)
    modes = modes_along(orbit.system.structure, np.array([angle]), found.slips, found.holds, before=True)
    return _Instant(angle, found.states[1], modes.at(0))


class _Quantity:
    """Slip rate or reserve of one orbit, whose least value is the margin of a change."""

    def __init__(self, orbit: Orbit, gauge: FrictionGauge, change: Change) -> None:
        self._gauge, self._change, self._coefficients = gauge, change, coefficients_of(orbit.system)
        self._function = gauge.rate if change.before else gauge.reserve

    def _modes(self, now: _Instant) -> DryModes:
        """Return the modes with the friction as it is before the phase of the change."""
        before = self._change.before
        return self._gauge.slipping(now.modes, before) if before else self._gauge.sticking(now.modes)

    def course(self, now: _Instant) -> Course:
        """Return it at an instant, with its derivatives."""
        at = self._coefficients, now.theta, now.state, self._modes(now), self._change.side
        return self._gauge.course(self._function, *at)

    def turned(self, course: Course) -> float:
        """Return the angle from an instant to the vertex of the parabola there."""
        return course.vertex / float(self._coefficients[0])

    def ahead(self, course: Course, angle: float) -> float:
        """Return what the parabola at an instant comes to after an angle."""
        time = angle * float(self._coefficients[0])
        return course.value + (course.slope + 0.5 * course.bend * time) * time


def _least(orbit: Orbit, quantity: _Quantity, change: Change, near: float) -> tuple[float, float]:
    """Return the angle and the value of the minimum of a quantity within a phase, the nearest to another angle."""
    full, what = PERIOD * orbit.period, "rate" if change.before else "reserve"
    found = _vertex(orbit, quantity, near, _TRACKED) if _is_within(orbit, change, near) else None
    if found is None:
        own = [
            each
            for each in orbit.margins
            if (each.contact, each.what, each.side) == (change.contact, what, change.side)
        ]
        own = [each for each in own if apart(each.theta, near, full) < _SAME]
        if own:
            found = _vertex(orbit, quantity, min(own, key=lambda each: each.value).theta, _ROUGH)
    if found is None:  # friction elsewhere stops or begins to slip where it is least
        others = (each for contact, phases in orbit.friction.items() if contact != change.contact for each in phases)
        theta = min((each.start for each in others), key=lambda start: apart(start, near, full), default=math.inf)
        if not apart(theta, near, full) < _TRACKED:
            raise LookupError
        course = quantity.course(instant_of(orbit, theta))
        if not course.slope < 0.0:
            raise LookupError
        found = theta, course.value
    return found


def _is_within(orbit: Orbit, change: Change, theta: float) -> bool:
    """Return True if an angle is within a phase like that before a change."""
    phases, full = orbit.friction.get(change.contact, []), PERIOD * orbit.period
    return any(phase.mode == change.before and phase.contains(theta, full) for phase in phases)


def _vertex(orbit: Orbit, quantity: _Quantity, theta: float, farthest: float) -> tuple[float, float] | None:
    """Return angle and value of the minimum of a quantity near an angle, by Newton's method; None if it is far off."""
    start = theta
    for _ in range(_REFINEMENTS):
        course = quantity.course(instant_of(orbit, theta))
        shift = quantity.turned(course)
        if not course.bend > 0.0 or abs(theta + shift - start) > farthest:
            return None
        theta += shift
        value = course.value - course.depth
        # what the parabola leaves out grows with the cube of the shift
        if abs(shift) < _SETTLED or course.depth * abs(shift) < _SMALL * abs(value):
            return theta % (PERIOD * orbit.period), value
    return None


class Instant(NamedTuple):
    """Instant of a point of sliding, by the quantity that vanishes there."""

    what: str  #: ``stop``, ``rate`` or ``reserve``, as in `gapwalk.orbit.sticking.Margin`.
    contact: int  #: Number of the contact.
    side: int  #: The direction of slip concerned.

    @property
    def modes(self) -> tuple[int, int, int] | None:
        """Modes before, in and after the phase that appears there; None where slip ends."""
        return {"rate": (self.side, 0, self.side), "reserve": (0, self.side, 0)}.get(self.what)


def nearest_margin(orbit: Orbit, instant: Instant) -> Margin:
    """Return the margin of an orbit that is nearest to zero, of those that vanish at such an instant."""
    # On one side of a point of sliding the margin is that of the phase that vanishes there; the orbit at the point
    # itself may have that phase, very short.
    what, contact, side = instant
    alike = [each for each in orbit.margins if (each.what, each.contact, each.side) == instant]
    phases = orbit.friction.get(contact, [])
    own = [phase for phase, around in zip(phases, modes_around(phases), strict=True) if around == instant.modes]
    if instant.modes and (own or not alike):
        change = Change(contact, *instant.modes, 0.0, False)
        for near in [min(own, key=lambda phase: phase.length).start] if own else _just_begun(orbit, change):
            theta, value = margin(orbit, change, near)
            alike.append(Margin(contact, what, side, theta, value, _range(orbit, instant, theta)))
    if not alike:
        raise ConvergenceError("no friction of this motion is near a point at which sliding begins or ends")
    return min(alike, key=lambda each: abs(each.value) / each.range)


def _just_begun(orbit: Orbit, change: Change) -> Iterator[float]:
    """Yield angles near the least values just after slip in the other direction ends, between the usual samples."""
    phases = orbit.friction.get(change.contact, [])
    for (before, mode, _), phase in zip(modes_around(phases), phases, strict=True):
        if before == -change.side and mode == change.before:
            yield from lowest_among(orbit, change, phase.start + min(_BEGUN, phase.length) * _CLOSER)


def missed_by(orbit: Orbit, instant: Instant) -> float:
    """Return by how much an orbit misses a point of sliding, as a share of the range of what vanishes there."""
    value = (found := nearest_margin(orbit, instant)).value
    if instant.modes:  # margins of an orbit are those of its samples
        with suppress(LookupError):
            value = margin(orbit, Change(instant.contact, *instant.modes, 0.0, False), found.theta)[1]
    return abs(value) / found.range


def _range(orbit: Orbit, instant: Instant, theta: float) -> float:
    """Return the size of the quantity that vanishes at an instant: of rates that of the motion, of forces the bound."""
    if instant.what == "rate":
        return float(np.abs(orbit.extremes).max()) * float(orbit.system.frequency)
    now, gauge = instant_of(orbit, theta), FrictionGauge(layout_of(orbit.system.structure), instant.contact)
    bound, _ = gauge.bound_and_force(coefficients_of(orbit.system), now.theta, now.state, gauge.sticking(now.modes))
    return float(bound)
