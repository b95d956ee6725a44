"""Leading term of what a light touch adds to a motion, and what follows from it beyond a graze.

A touch of depth d adds ``b d^order`` to the state (the zero-time discontinuity map; di Bernardo, Budd, Champneys and
Kowalczyk 2008, chapters 6 and 7). With the monodromy matrix M without the touch, and the derivative c of the depth by
the state, the sequence ``c M^n b`` says how deep the motion comes n periods after the touch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import Gauge
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart

_ASIDE = 1e-9  # depth, as a share of the motion, by which an orbit that touches is moved back
_NEAR = 1e-3  # radians around the touch within which an event is its own
_RATE = 1e-6  # rate, as a share of the velocities, at which jumps of the force are read
_NONE = 1e-9  # share of the accelerations below which a jump is none

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TouchMap:
    """Leading term ``b d^order`` that a touch of depth d adds to a motion; vectors are carried to the section."""

    order: float  #: 1/2 if the force jumps or the velocity does, 1 if damping acts one way only, otherwise 3/2.
    #: Coefficient b of the rate of the deflection: a touch of depth d changes that rate by ``coefficient d^order``.
    coefficient: float
    covector: Array  #: shape (N,): c, the derivative of the depth by the state at the section.
    vector: Array  #: shape (N,): What b has become at the end of the period.
    monodromy: Array  #: shape (N, N): M, without the touch.

    def sequence(self, count: int) -> Array:
        """Return ``c M^n b`` for n = 1 to a count."""
        found, vector = np.empty(count), self.vector
        for n in range(count):
            found[n], vector = self.covector @ vector, self.monodromy @ vector
        return found

    def response(self, multiplier: complex) -> complex:
        """Return ``c (mu - M)^-1 M b``: with it times ``order d^(order - 1)`` equal to 1, mu is a multiplier."""
        matrix = multiplier * np.eye(len(self.vector)) - self.monodromy
        return complex(self.covector @ np.linalg.solve(matrix, self.vector))

    def adjugate(self, multiplier: float) -> float:
        """Return ``det(mu - M)`` times the response, which is smooth where mu is a multiplier without the touch."""
        size = len(self.vector)
        bordered = np.zeros((size + 1, size + 1))
        bordered[:size, :size] = multiplier * np.eye(size) - self.monodromy
        bordered[:size, size], bordered[size, :size] = self.vector, -self.covector
        return float(np.linalg.det(bordered))

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Multipliers without the touch, largest modulus first."""
        found = np.linalg.eigvals(self.monodromy).astype(complex)
        return found[np.argsort(-np.abs(found), kind="stable")]


def touch_map(orbit: Orbit, switch: int, theta: float | None = None) -> TouchMap | None:
    """Return the map of a touch that begins in an orbit; None if it has none, as where friction acts."""
    structure, full = orbit.system.structure, PERIOD * orbit.period
    if structure.friction:
        return None
    layout, coefficients = layout_of(structure), coefficients_of(orbit.system)
    if theta is None:
        thetas, depths = orbit.turning_depths[switch]
        if not depths:
            return None
        theta = thetas[int(np.argmin(np.abs(depths)))]
    angle, gauge = theta % full, Gauge(layout, switch)
    try:
        there, to, monodromy = _beside(orbit, coefficients, switch, angle, gauge)
    except NumericalError:
        return None
    leading = _leading(orbit, coefficients, switch, angle, there, gauge)
    if leading is None:
        return None
    order, vector, sign = leading
    size, n = len(there), orbit.system.size
    along = sign * gauge.vector(coefficients)
    after = monodromy @ np.linalg.lstsq(to, vector, rcond=None)[0]
    covector = along @ to[:n] if size else along
    return TouchMap(order, float(along @ vector[n : 2 * n]), covector, after, monodromy)


def _beside(orbit: Orbit, coefficients: Array, switch: int, angle: float, gauge: Gauge) -> tuple[Array, Array, Array]:
    """Return state and transition to the touch, and over the period, of a motion that just does not touch."""
    flow, full, n = flow_of(orbit.system, transition=True), PERIOD * orbit.period, orbit.system.size
    size, state = float(np.abs(orbit.extremes[:, :2]).max()), orbit.state
    for share in (0.0, _ASIDE, 30.0 * _ASIDE):
        thetas = np.array([0.0, angle, full]) if 0.0 < angle < full else np.array([0.0, full])
        found = flow.vary(coefficients, state, thetas)
        place = 1 if len(thetas) > 2 else 0
        there, to = found.states[place], found.transitions[place]
        if not any(e.switch == switch and apart(e.theta % full, angle, full) < _NEAR for e in found.contacts):
            return there, to, found.transitions[-1]
        way = gauge.vector(coefficients) @ to[:n]
        highest = gauge.read(coefficients, angle, there)[2] < 0.0
        state = orbit.state - (1.0 if highest else -1.0) * max(share, _ASIDE) * size * way / float(way @ way)
    raise NumericalError("the motion touches by more than a graze")


def _leading(
    orbit: Orbit, coefficients: Array, switch: int, angle: float, state: Array, gauge: Gauge
) -> tuple[float, Array, float] | None:
    """Return order and vector b of a touch, and the sign of the depth: -1 where the contact opens for a moment."""
    structure, n = orbit.system.structure, orbit.system.size
    layout = layout_of(structure)
    contact, _, _ = orbit.system.breakpoints[switch]
    q, v = state[:n], state[n : 2 * n]
    first = [slots.stages for slots in layout.contacts[:contact]]
    stage = switch - sum(map(len, first))
    turning = gauge.read(coefficients, angle, state)[2]
    sign = 1.0 if turning < 0.0 else -1.0
    along, vector = sign * gauge.vector(coefficients), np.zeros(len(state))
    law, slots = structure.contacts[contact].law, layout.contacts[contact]
    pull = -sign * turning
    if not pull > 0.0:
        return None
    push = coefficients[slots.force]
    if law.rebounds:
        ratio = float(coefficients[slots.numbers["restitution"]])
        vector[n : 2 * n] = -(1.0 + ratio) * math.sqrt(2.0 * pull) * push / float(along @ push)
        return 0.5, vector, sign

    def jump(rate: float, depth: float = 0.0) -> Array:
        """Return the change of the accelerations where the touch begins, at a rate and a depth of the deflection."""
        here = q + depth * lift, v + rate * lift
        own = float(slots_deflection @ here[0])
        inside = [each.sign * own > coefficients[each.clearance] for each in slots.stages]
        both = []
        for touches in (True, False):
            inside[stage] = touches is (sign > 0.0)
            closed = [None] * len(layout.contacts)
            closed[contact] = list(inside)
            both.append(accelerations(layout, coefficients, angle, *here, closed))
        return both[0] - both[1]

    slots_deflection = coefficients[slots.deflection]
    lift = along / float(along @ along)
    size = float(np.abs(orbit.extremes[:, :2]).max())
    speed = _RATE * float(orbit.system.frequency) * size
    enters, leaves, rest = jump(speed), jump(-speed), jump(0.0)
    least = max(_NONE * pull, 10.0 * np.finfo(float).eps * float(np.abs(coefficients[layout.accelerations]).max()))
    at_rest = 2.0 * enters - jump(2.0 * speed), 2.0 * leaves - jump(-2.0 * speed)  # extrapolated to rest
    if max(float(np.abs(each).max()) for each in (*at_rest, rest)) > least:
        inward, outward = (pull - float(along @ each) for each in at_rest)
        if not min(inward, outward) > 0.0:
            return None  # the contact holds what touches
        vector[n : 2 * n] = math.sqrt(2.0 * pull) * (at_rest[0] / inward + at_rest[1] / math.sqrt(inward * outward))
        return 0.5, vector, sign
    one_way = (enters + leaves) / speed
    drag = (enters - leaves) / (2.0 * speed)
    if float(np.abs(one_way).max()) > 1e-5 * max(float(np.abs(drag).max()), 1e-30):
        vector[n : 2 * n] = one_way
        return 1.0, vector, sign
    # a parabola of depth d over the time 2 sqrt(2 d / pull) has the area 4/3 sqrt(2 / pull) d^(3/2)
    area = 4.0 / 3.0 * math.sqrt(2.0 / pull)
    deep = _RATE * size
    spring = (jump(0.0, deep) - jump(0.0, -deep)) / (2.0 * deep)
    ways = [accelerations(layout, coefficients, angle, q, v + step * drag) for step in (1e-6, -1e-6)]
    vector[:n] = area * drag
    vector[n : 2 * n] = area * (spring + (ways[0] - ways[1]) / 2e-6)
    return 1.5, vector, sign
