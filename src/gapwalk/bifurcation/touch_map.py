"""Leading term of what a light touch adds to a motion, and what follows from it beyond a graze.

A touch of depth d adds ``b d^order`` to the state (the zero-time discontinuity map; di Bernardo, Budd, Champneys and
Kowalczyk 2008, chapters 6 and 7). With the monodromy matrix M without the touch, and the derivative c of the depth by
the state, the sequence ``c M^n b`` says how deep the motion comes n periods after the touch.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import Gauge
from gapwalk.model.coefficients import StageSlots, coefficients_of, layout_of
from gapwalk.orbit.orbit import Orbit, apart

_ASIDE = 1e-9  # depth, as a share of the motion, by which an orbit that touches is moved back
_NEAR = 1e-3  # radians around the touch within which an event is its own
_RATE = 1e-4  # rate, as a share of the velocities, at which jumps of the force are read
_NONE = 1e-8  # share of the accelerations below which a jump is none

_RETURNS = 400  # periods over which a touch is followed
# share of the largest return, or of the root of the motion, below which the sign of another one decides nothing
_LITTLE = 1e-3
_RESONANT = 0.02  # size of the square-root term below which the motion beyond soon is stable again
_STARTS = (0.0, 1.0, -1.0, 2.0, -2.0, 4.0, -4.0)  # displacements of motions that must settle alike, in touches
# distance, in depths, from which a motion does not come back; relative distance of states that are the same, periods
# up to which one repeats, and growth a period of what is chaos
_AWAY, _SAME, _PERIODS, _GROWS = 1e6, 1e-6, 33, 0.02
_ANGLES = 720  # arguments of multipliers on the unit circle that are tried
_FINE = 1e-8  # distances, as shares of the motion, to which the windows beyond a graze are looked at
_DOUBT = 0.01  # share within which it is not decided whether windows overlap, or whether there are any
_ALIKE = 0.1  # share to which the ratio of the last two windows is that of the theory of one multiplier

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TouchMap:
    """Leading term ``b d^order`` that a touch of depth d adds to a motion; vectors are carried to the section."""

    #: 1/2 if the force jumps or the velocity does, 1 if damping acts one way only or friction sticks, otherwise 3/2.
    order: float
    #: Coefficient b of the rate of the deflection: a touch of depth d changes that rate by ``coefficient d^order``.
    coefficient: float
    covector: Array  #: shape (N,): c, the derivative of the depth by the state at the section.
    vector: Array  #: shape (N,): What b has become at the end of the period.
    monodromy: Array  #: shape (N, N): M, without the touch.
    size: float  #: The largest position of the motion.

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

    def determinant(self, multiplier: float) -> float:
        """Return ``det(mu - M - b c)``, which vanishes where a touch of order 1 has this multiplier."""
        own = float(np.linalg.det(multiplier * np.eye(len(self.vector)) - self.monodromy))
        return own - self.adjugate(multiplier)

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Multipliers without the touch, largest modulus first."""
        found = np.linalg.eigvals(self.monodromy).astype(complex)
        return found[np.argsort(-np.abs(found), kind="stable")]


@dataclass(frozen=True)
class Beyond:
    """Motion beyond a graze, by the leading term of the touch."""

    #: ``goes on``, ``doubles``, ``period 3`` or more, ``jumps``, ``period adding``, ``period adding and chaos``,
    #: ``chaos at once`` (several of these with ``or`` where the state decides), or ``unknown`` if the theory does not.
    verdict: str
    #: order, coefficient: A touch of depth d changes the rate of the deflection by ``coefficient d^order``, at once.
    order: float
    coefficient: float
    multiplier: complex  #: The leading multiplier of the motion that does not touch yet.
    #: Ratio of successive windows of period adding, in the distance from the graze; otherwise nan.
    ratio: float = math.nan
    #: Depth of the touch at which a multiplier becomes critical, if the motion goes on; infinite if none does. Depth
    #: of the touch to which the motion jumps, if that is small.
    depth: float = math.nan

    @property
    def words(self) -> str:
        """The verdict in a table: empty where the theory does not decide."""
        verdict = {"goes on": "motion continues", "unknown": ""}.get(self.verdict, self.verdict)
        if verdict == "jumps" and self.depth < math.inf:
            return f"jumps, by {self.depth:.1g}"
        return verdict + (f", windows by {self.ratio:.4g}" if self.ratio < math.inf else "")


def beyond(touch: TouchMap | None) -> Beyond:
    """Judge the motion beyond a graze from the map of its touch.

    With the order 1/2, all that counts are the depths ``c M^n b sqrt(d)`` of the next returns: where one of them is
    beyond the stop the next touch is deeper, and the motion leaves. Otherwise there are windows of motions that touch
    once in their periods, which overlap or not (Nordmark 1991; Chin, Ott, Nusse and Grebogi 1994; Fredriksson and
    Nordmark 1997); with one multiplier they overlap below 1/4, and end at 2/3. With the order 1 the map is
    linear on either side (di Bernardo and others 2008, chapter 3). With the order 3/2 it is smooth enough.
    """
    if touch is None:
        return Beyond("unknown", math.nan, math.nan, complex(math.nan, math.nan))
    leading = complex(touch.multipliers[0])
    known = touch.order, touch.coefficient, leading
    if not abs(leading) < 1.0:
        return Beyond("unknown", *known)  # the motion that touches is not the one that settles
    if touch.order == 1.5:
        return Beyond("goes on", *known, depth=_reach(touch))
    if touch.order == 1.0:
        verdict = _across(touch)
        return Beyond(verdict, *known, depth=math.inf if verdict == "goes on" else math.nan)
    size = float(np.linalg.norm(touch.covector) * np.linalg.norm(touch.vector))
    returns = touch.sequence(_RETURNS)
    largest = float(np.abs(returns).max())
    if not size or abs(returns[0]) < _RESONANT * size:
        return Beyond("unknown", *known)
    first = int(np.argmax(returns > 0.0)) if float(returns.max()) > 0.0 else _RETURNS - 1
    if float(returns[first]) > _LITTLE * max(largest, math.sqrt(touch.size)):
        return Beyond("jumps", *known)
    if returns[first] > 0.0 and (there := windows_beyond(touch, first + 1)[-1].depth) > _FINE * touch.size:
        return Beyond("jumps", *known, depth=there)
    found = windows_beyond(touch, first + 1)
    windows = [each for each in found if each.begin < touch.size and each.end > _FINE * touch.size]
    stable = [each for each in windows if each.end > each.begin]
    apart = [own.begin / after.end for own, after in pairwise(stable[-4:])]
    least = [each.end / max(each.begin, 1e-300) - 1.0 for each in windows[-3:]]
    if not windows or min(map(abs, least + [each - 1.0 for each in apart])) < _DOUBT:
        return Beyond("unknown", *known)
    if max(least) < 0.0:
        return Beyond("chaos at once", *known)
    if not apart:
        return Beyond("unknown", *known)
    verdict, ratio = "period adding" if max(apart) < 1.0 else "period adding and chaos", abs(leading) ** -2
    same = abs(stable[-2].end / stable[-1].end / ratio - 1.0) < _ALIKE
    return Beyond(verdict, *known, ratio=ratio if same and leading.imag == 0.0 else math.nan)


class Window(NamedTuple):
    """Distances from the graze, in depths, at which a motion that touches once in its periods begins and ends."""

    begin: float  # its flip, 0 if it has none
    end: float  # its next graze, infinite if it has none
    depth: float  # of its touch, at the graze of the motion that does not touch yet


def windows_beyond(touch: TouchMap, count: int) -> list[Window]:
    """Return where motions of the periods 1 to a count are stable: of the depth y^2, with y^2 = d + R_n y."""
    eye, found = np.eye(len(touch.vector)), list[Window]()
    vectors, power = touch.vector[:, None], touch.monodromy
    for _ in range(count):
        inner = np.linalg.solve((eye - power).T, touch.covector) @ vectors  # the depths in its periods, over y
        last, highest = float(inner[-1]), float(inner[:-1].max(initial=-math.inf))
        root = -0.5 * float(np.linalg.solve((eye + power).T, touch.covector) @ vectors[:, -1])
        end = -highest * (last - highest) if len(inner) > 1 else math.inf
        found.append(Window(max(root, 0.0) * (root - last), end, max(last, 0.0) ** 2))
        vectors, power = np.column_stack((vectors, touch.monodromy @ vectors[:, -1])), power @ touch.monodromy
    return found


def _across(touch: TouchMap) -> str:
    """Return the verdict of a map that is linear on either side of the graze: what its motions settle to."""
    verdicts = {_settled(touch, share * touch.vector) for share in _STARTS}
    return "unknown" if "unknown" in verdicts else " or ".join(sorted(verdicts))


def _settled(touch: TouchMap, state: Array) -> str:
    """Return the verdict of the motion from a state, whose distance is from the motion that would not touch."""
    # The unit is the depth to which that motion would reach.
    both = touch.monodromy, touch.monodromy + np.outer(touch.vector, touch.covector)
    along, growth, found = touch.vector, 0.0, list[Array]()
    for step in range(2 * _RETURNS):
        depth = float(touch.covector @ state) + 1.0
        matrix = both[depth > 0.0]
        state = touch.monodromy @ state + touch.vector * max(depth, 0.0)
        if not float(np.abs(touch.covector @ state)) < _AWAY:
            return "jumps"
        if step >= _RETURNS:
            along = matrix @ along
            size = float(np.linalg.norm(along)) or 1.0
            along, growth = along / size, growth + math.log(size)
            found.append(state)
    last, scale = found[-1], float(np.abs(found).max())

    def is_same(back: int) -> bool:
        return float(np.abs(found[-1 - back] - last).max()) < _SAME * scale

    # what still decays with a change of sign repeats after two periods, too, but not for long
    period = next((n for n in range(1, _PERIODS) if is_same(n) and is_same(n * (_RETURNS // 2 // n))), 0)
    if not period:
        return "chaos at once" if growth > _GROWS * _RETURNS else "unknown"
    return {1: "goes on", 2: "doubles"}.get(period, f"period {period}")


def _reach(touch: TouchMap) -> float:
    """Return the smallest depth of a touch of order 3/2 at which a multiplier is on the unit circle."""
    arguments = np.linspace(0.0, math.pi, _ANGLES + 1)
    found = np.array([touch.response(cmath.exp(1j * each)) for each in arguments], complex)
    real, imag = np.real(found), np.imag(found)
    values = [value for value in real[[0, -1]].tolist() if value > 0.0]
    for k in np.flatnonzero(imag[1:-2] * imag[2:-1] < 0.0) + 1:
        share = imag[k] / (imag[k] - imag[k + 1])
        values.append(float(real[k] + share * (real[k + 1] - real[k])))
    largest = max(values, default=0.0)
    return (1.5 * largest) ** -2.0 if largest > 0.0 else math.inf


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
    n = orbit.system.size
    along = sign * gauge.vector(coefficients)
    after = monodromy @ np.linalg.lstsq(to, vector, rcond=None)[0]
    return TouchMap(
        order,
        float(along @ vector[n : 2 * n]),
        along @ to[:n],
        after,
        monodromy,
        float(np.abs(orbit.extremes[:, :2]).max()),
    )


def _beside(orbit: Orbit, coefficients: Array, switch: int, angle: float, gauge: Gauge) -> tuple[Array, Array, Array]:
    """Return state and transition to the touch, and over the period, of a motion that just does not touch."""
    flow, full, n = flow_of(orbit.system, transition=True), PERIOD * orbit.period, orbit.system.size
    size, state = float(np.abs(orbit.extremes[:, :2]).max()), orbit.state
    for share in (_ASIDE, 30.0 * _ASIDE, 0.0):
        thetas = np.array([0.0, angle, full]) if 0.0 < angle < full else np.array([0.0, full])
        found = flow.vary(coefficients, state, thetas)
        place = 1 if len(thetas) > 2 else 0
        there, to = found.states[place], found.transitions[place]
        if not any(e.switch == switch and apart(e.theta % full, angle, full) < _NEAR for e in found.contacts):
            return there, to, found.transitions[-1]
        way = gauge.vector(coefficients) @ to[:n]
        highest = gauge.read(coefficients, angle, there)[2] < 0.0
        state = orbit.state - (1.0 if highest else -1.0) * share * size * way / float(way @ way)
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

    def is_closed(other: StageSlots) -> bool:
        own = slots.stages[stage]
        return other.sign == own.sign and bool(coefficients[other.clearance] < coefficients[own.clearance])

    def jump(rate: float, depth: float = 0.0) -> Array:
        """Return the change of the accelerations where the touch begins, at a rate and a depth of the deflection."""
        here = q + depth * lift, v + rate * lift
        inside = [each is not slots.stages[stage] and is_closed(each) for each in slots.stages]
        both = []
        for touches in (True, False):
            inside[stage] = touches is (sign > 0.0)
            closed: list[list[bool] | None] = [None] * len(layout.contacts)
            closed[contact] = list(inside)
            both.append(accelerations(layout, coefficients, angle, *here, closed))
        return both[0] - both[1]

    lift = along / float(along @ along)
    q = q - sign * gauge.depth(coefficients, angle, state)[0] * lift  # exactly at the breakpoint
    size = float(np.abs(orbit.extremes[:, :2]).max())
    speed = _RATE * float(orbit.system.frequency) * size
    enters, leaves = ([jump(way * times * speed) for times in (1.0, 2.0)] for way in (1.0, -1.0))
    at_rest = [2.0 * near - far for near, far in (enters, leaves)]  # extrapolated to rest
    noise = _NONE * float(np.abs(accelerations(layout, coefficients, angle, q, v)).max() + pull)
    if max(float(np.abs(each).max()) for each in at_rest) > noise:
        inward, outward = (pull - float(along @ each) for each in at_rest)
        if not min(inward, outward) > 0.0:
            return None  # the contact holds what touches
        vector[n : 2 * n] = math.sqrt(2.0 * pull) * (at_rest[0] / inward + at_rest[1] / math.sqrt(inward * outward))
        return 0.5, vector, sign
    (near, far), (near_out, far_out) = enters, leaves
    one_way = (4.0 * (near + near_out) - (far + far_out)) / (2.0 * speed)
    drag = (near - near_out) / (2.0 * speed)
    if float(np.abs(one_way).max()) * speed > noise:
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
