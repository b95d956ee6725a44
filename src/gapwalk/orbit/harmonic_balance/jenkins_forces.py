"""Forces of Jenkins elements along a motion given by its lines, exact to rounding, with all derivatives.

The phases of an element come from `slip_sequence`. In stick its force is ``k (x - p)``, with the place p of its slider,
in slip plus or minus its limit. The function that is 1 in some phases has its spectrum in closed form; so the lines of
the force in stick are convolutions, like those of a contact. A limit that varies over a phase of slip is integrated by
Gauss's rule between the events, which is exact to rounding.

In the derivatives the events need not be moved, because the force is continuous there. But in each phase of stick the
slider stands where a bound ``x - r`` or ``x + r`` came to rest, at its pin: so the force depends on the motion at that
one angle, too. Such a derivative is a product of lines and of a linear function of the unknowns, a *link*. Where the
limit jumps the force may jump: then the event moves with the host, which is a link as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.laws import Friction, Stages
from gapwalk.model.laws.law import Host
from gapwalk.orbit.harmonic_balance.linear_part import ForcesLessShares, Share, firsts_of, grid, waves
from gapwalk.orbit.harmonic_balance.sampled_forces import ASIDE, NO_PAIRS, Pairs, roots, zeros_on

# The limit of the force of a Jenkins element along a periodic motion, and the bounds of its slider.
#
# The limit may be constant, jump where the contact that hosts the friction closes and opens, or follow the force of
# that contact. Between its breaks it is smooth. A limit below zero, as where a damped contact pulls, counts as zero.

Array = NDArray[np.float64]

TURN = 2.0 * np.pi
SAME = 1e-12
"""Radians between two angles that count as one."""

_STEP = 1e-150  # of the complex step
_ASIDE = 1e-9  # radians from a break, at which the sign of the limit beside it is read


class Limit(NamedTuple):
    """The limit of the force at some angles, and its derivatives; arrays of the shape of the angles.

    Those by the angle phi are along the motion, those by the parameter at a constant motion; those by the deflection of
    the host and by its rate over time are partial.
    """

    value: Array
    by_angle: Array
    by_parameter: Array
    by_deflection: Array
    by_rate: Array


class Break(NamedTuple):
    """An angle at which the limit may jump or has a kink."""

    phi: float  #: The angle.
    #: Number of the switch of the host that passes its breakpoint; -1 where the limit reaches or leaves zero.
    switch: int
    piece: int  #: The interval beside it in which the limit is not zero, for such a place.


@dataclass(frozen=True, eq=False)
class Motion:
    """Deflections by their lines, for some coefficients of the flow."""

    #: layout, coefficients, slope: The coefficients, and their derivatives by a parameter.
    layout: CoefficientLayout
    coefficients: Array
    slope: Array
    lines: NDArray[np.complex128]  #: shape (deflections, K + 1): The deflections.
    period: int  #: m.
    crossings: Array  #: The crossings of breakpoints; see `Forces`.

    @property
    def frequency(self) -> float:
        """Derivative of phi over time."""
        return 1.0 / (self.period * float(self.coefficients[0]))

    @property
    def faster(self) -> float:
        """Relative derivative of the frequency by the parameter."""
        return -float(self.slope[0] / self.coefficients[0])

    @cached_property
    def rates(self) -> NDArray[np.complex128]:
        """Lines of the derivatives by phi."""
        return 1j * np.arange(self.lines.shape[1]) * self.lines


class Element(NamedTuple):
    """A Jenkins element: number of its contact, and of its deflection; the same of its host, or -1."""

    contact: int
    place: int
    host: int
    host_place: int


@dataclass(frozen=True, eq=False)
class Slider:
    """The slider of a Jenkins element along a periodic motion."""

    #: motion, element: The motion, and the element.
    motion: Motion
    element: Element

    @property
    def slots(self) -> ContactSlots:
        """The slots of its coefficients."""
        return self.motion.layout.contacts[self.element.contact]

    def number(self, name: str) -> tuple[float, float]:
        """Return one of its numbers, and its derivative by the parameter."""
        slot = self.slots.numbers[name]
        return float(self.motion.coefficients[slot]), float(self.motion.slope[slot])

    @cached_property
    def drift(self) -> tuple[float, float]:
        """The way of the base over phi, and its derivative by the parameter."""
        (speed, slope), frequency = self.number("speed"), self.motion.frequency
        return speed / frequency, (slope - speed * self.motion.faster) / frequency

    def deflection(self, phi: Array) -> Array:
        """Return the deflection, less the way of the base."""
        lines = self.motion.lines[self.element.place]
        return (waves(phi, len(lines) - 1) @ lines).real - self.drift[0] * phi

    def deflection_rate(self, phi: Array) -> Array:
        """Return its derivative by phi."""
        rates = self.motion.rates[self.element.place]
        return (waves(phi, len(rates) - 1) @ rates).real - self.drift[0]

    def limit(self, phi: Array, pieces: NDArray[np.intp], *, partial: bool = True) -> Limit:
        """Return the limit at some angles, each in the interval of a number; all derivatives only if `partial`."""
        found = self._signed_limit(phi, self._patterns[pieces], partial=partial)
        acts = self._acts[pieces] & (found.value > 0.0)
        return found if acts.all() else Limit(*(np.where(acts, each, 0.0) for each in found))

    @cached_property
    def is_steady(self) -> bool:
        """True if the limit is constant between the events of its host."""
        law = self.slots.form.law
        assert isinstance(law, Friction)
        return law.by != "normal"

    @cached_property
    def breaks(self) -> list[Break]:
        """All breaks, in order."""
        return self._intervals[0]

    @cached_property
    def pieces(self) -> list[tuple[float, float, int]]:
        """The parts of the period from 0 to 2 pi between breaks, each with the number of its interval."""
        return _parts([each.phi for each in self.breaks])

    def moved(self, place: int) -> tuple[float, Limit | None]:
        """Return the rate, by the angle phi, of the quantity that is zero at a break."""
        # The angle of the break changes by minus the change of that quantity over this rate. The quantity is the
        # penetration of the switch of the host, or the limit, which is returned too.
        each = self.breaks[place]
        if each.switch >= 0:
            rates = self.motion.rates[self.element.host_place]
            assert self._host is not None
            sign = self._host.stages[each.switch].sign
            return sign * float((waves(np.array(each.phi), len(rates) - 1) @ rates).real), None
        at = self._signed_limit(np.array([each.phi]), self._patterns[[each.piece]])
        return float(at.by_angle[0]), at

    @property
    def _host(self) -> ContactSlots | None:
        return self.motion.layout.contacts[self.element.host] if self.element.host >= 0 else None

    @cached_property
    def _closings(self) -> list[Break]:
        """The breaks by the host, without those that coincide."""
        if self._host is None:
            return []
        contacts = self.motion.layout.contacts[: self.element.host]
        first = sum(len(each.stages) for each in contacts)
        found: list[Break] = []
        for phi, _, _, switch in sorted(self.motion.crossings.T.tolist()):
            own = int(switch) - first
            if 0 <= own < len(self._host.stages) and not (found and phi - found[-1].phi < SAME):
                found.append(Break(phi % TURN, own, -1))
        if len(found) > 1 and found[0].phi + TURN - found[-1].phi < SAME:
            found.pop()
        return sorted(found)

    @cached_property
    def _closed(self) -> NDArray[np.bool_]:
        """True for each stage of the host that is closed in each interval between its events; (intervals, stages)."""
        if self._host is None:
            return np.zeros((1, 0), dtype=bool)
        angles = np.array([each.phi for each in self._closings]) if self._closings else np.zeros(1)
        middle = 0.5 * (angles + np.append(angles[1:], angles[0] + TURN))
        lines = self.motion.lines[self.element.host_place]
        x = (waves(middle, len(lines) - 1) @ lines).real
        return np.array(
            [each.sign * x > self.motion.coefficients[each.clearance] for each in self._host.stages]
        ).T.reshape(len(angles), -1)

    @cached_property
    def _intervals(self) -> tuple[list[Break], NDArray[np.intp], NDArray[np.bool_]]:
        """All breaks; for each interval after one its pattern of closed stages; True where the limit is positive."""
        found, patterns = self._closings, np.arange(len(self._closed))
        if self.is_steady:
            return found, patterns, np.ones(len(patterns), dtype=bool)
        phi, which, opens = self._points(_parts([each.phi for each in found]))
        closes = np.roll(~opens, 1)  # at the ends it may be 0 by rounding
        phi = phi + _ASIDE * (closes * 1.0 - ~opens)

        def value(phi: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
            limit = self._signed_limit(phi, which, partial=False)
            return limit.value, limit.by_angle

        cells, zeros = zeros_on(value, phi, which, opens)
        added = [Break(each, -1, int(which[cell])) for cell, each in zip(cells, zeros, strict=True)]
        if not added and not found:
            return [], patterns, value(phi[:1], which[:1])[0] > 0.0
        # an added break lies within an interval of the host, whose pattern goes on
        known = sorted([*found, *added])
        current = len(found) - 1 if found else 0
        chosen = []
        for each in known:
            current = found.index(each) if each.switch >= 0 else current
            chosen.append(current)
        places, angles = [], np.array([each.phi for each in known])
        middle = 0.5 * (angles + np.append(angles[1:], angles[0] + TURN))
        acts = self._signed_limit(middle, np.array(chosen), partial=False).value > 0.0
        for number, each in enumerate(known):  # a zero of the limit is moved with the side on which it is positive
            beside = number if acts[number] else number - 1
            places.append(each if each.switch >= 0 else each._replace(piece=beside % len(known)))
        return places, np.array(chosen), acts

    @property
    def _patterns(self) -> NDArray[np.intp]:
        return self._intervals[1]

    @property
    def _acts(self) -> NDArray[np.bool_]:
        return self._intervals[2]

    def _points(self, parts: list[tuple[float, float, int]]) -> tuple[Array, NDArray[np.intp], NDArray[np.bool_]]:
        """Return points of a grid in some parts, with their ends; their intervals; and True but for last points."""
        cells, phi, which, opens = grid(self.motion.lines.shape[1] - 1)[0], [], [], []
        for low, high, piece in parts:
            phi.append(np.concatenate(([low], cells[(cells > low) & (cells < high)], [high])))
            which.append(np.full(len(phi[-1]), piece))
            opens.append(np.arange(len(phi[-1])) < len(phi[-1]) - 1)
        return np.concatenate(phi), np.concatenate(which), np.concatenate(opens)

    def turning_points(self) -> list[list[float]]:
        """Return the angles within each of the `pieces` at which a bound turns, in order."""
        phi, which, opens = self._points(self.pieces)
        number, stiffness = np.cumsum(~opens), self.number("stiffness")[0]
        found: list[list[float]] = [[] for _ in self.pieces]
        for side in (0.0,) if self.is_steady else (-1.0, 1.0):

            def rate(phi: Array, which: NDArray[np.intp], side: float = side) -> Array:
                speed = self.deflection_rate(phi)
                return speed + side / stiffness * self.limit(phi, which, partial=False).by_angle if side else speed

            def value(phi: Array, which: NDArray[np.intp], side: float = side, rate=rate) -> tuple[Array, Array]:
                now = rate(phi, which)
                return now, (rate(phi + ASIDE, which) - now) / ASIDE if side else self._bend(phi)

            for cell, angle in zip(*zeros_on(value, phi, which, opens), strict=True):
                found[number[cell]].append(angle)
        return [sorted(each) for each in found]

    def _bend(self, phi: Array) -> Array:
        """Return the second derivative of the deflection by phi."""
        rates = self.motion.rates[self.element.place]
        return (waves(phi, len(rates) - 1) @ (1j * np.arange(len(rates)) * rates)).real

    @cached_property
    def _steady_limits(self) -> Array:
        """The limit in each pattern, and its derivative by the parameter, shape (2, patterns)."""
        none, closed = np.zeros(len(self._closed)), list(self._closed.T)
        moved = self.motion.coefficients + 1j * _STEP * self.motion.slope
        found = np.broadcast_to(self._formula(moved, none, none, none, closed), none.shape)
        return np.array([np.real(found), np.imag(found) / _STEP])

    def _signed_limit(self, phi: Array, patterns: NDArray[np.intp], *, partial: bool = True) -> Limit:
        """Return the limit by the law, which may be negative."""
        none = np.zeros(len(phi))
        if self.is_steady:
            value, slope = self._steady_limits[:, patterns]
            return Limit(value, none, slope, none, none)
        motion, closed, step = self.motion, list(self._closed[patterns].T), 1j * _STEP
        x = v = bend = none
        if self._host is not None:
            turns = waves(phi, motion.lines.shape[1] - 1)
            lines, rates = motion.lines[self.element.host_place], motion.rates[self.element.host_place]
            x, v = (turns @ lines).real, (turns @ rates).real
            bend = (turns @ (1j * np.arange(len(rates)) * rates)).real
        w, numbers = motion.frequency, motion.coefficients
        found = [self._formula(numbers, phi + step, x + step * v, w * (v + step * bend), closed)]
        if partial:
            found += [
                self._formula(numbers + step * motion.slope, phi, x, w * v * (1.0 + step * motion.faster), closed),
                self._formula(numbers, phi, x + step, w * v, closed),
                self._formula(numbers, phi, x, w * v + step, closed),
            ]
        values = [np.broadcast_to(each, phi.shape) for each in found]
        slopes = [np.imag(each) / _STEP for each in values]
        return Limit(np.real(values[0]).copy(), *slopes, *[none] * (4 - len(slopes)))

    def _formula(self, coefficients: NDArray, phi: NDArray, x: NDArray, v: NDArray, closed: list) -> NDArray:
        """Evaluate the law of the friction, real or complex."""
        slots, host = self.slots, self._host
        angles = Angles(self.motion.layout, coefficients, self.motion.period * phi)
        stages = Stages(())
        if host is not None:
            moves = [(x, v)]
            stages.host = Host(stages_of(host, angles, moves, closed), contact_force(host, angles, moves, closed))
        law = slots.form.law
        assert isinstance(law, Friction)
        return law.limit(stages, angles.named(slots.numbers, slots.waves))


def _parts(angles: list[float]) -> list[tuple[float, float, int]]:
    """Return the parts of the period from 0 to 2 pi between angles, each with the number of the angle before it."""
    ends = [0.0, *angles, TURN]
    count = max(1, len(angles))
    parts = [(low, high, (number - 1) % count) for number, (low, high) in enumerate(pairwise(ends))]
    return [each for each in parts if each[1] > each[0]]


# When a Jenkins element sticks and slips along a periodic deflection: all events, exact to rounding.
#
# With the deflection ``x``, less the way of a base that moves, the slider stands at ``p = x - z``, where ``z`` is the
# extension of the spring. The limit over the stiffness, ``r``, is the largest extension, so ``x - r <= p <= x + r``.
# The slider stays where it is unless one of these bounds pushes it: that is slip, and it ends where the bound turns.
# If the limit varies, the bounds are ``x`` less or plus what varies; where the limit jumps, the bounds jump.
#
# Between two events of the contact that hosts the friction, the bounds have turning points. Between two neighbouring
# ones of all these angles both bounds are monotone, and what the slider does follows from their ends. Its place after
# a period is ``min(max(p, low), high)`` of that before: so it settles within one period, and the second one is the
# periodic motion. If it never slips, any place from the highest lower bound to the lowest upper bound is possible.
# Then the one is taken at which the mean of its force is zero, or nearest to that.

_PLACE_ROUNDING = 4e-15  # of a place, relative to the size of the bounds


class Pin(NamedTuple):
    """The angle of a bound at which the slider comes to rest."""

    phi: float  #: The angle, below 0 if that was in the period before.
    #: -1 for the lower bound, 1 for the upper one; 0 for a slider that never slips, and rests where its force has the
    #: mean zero.
    side: int
    piece: int  #: The interval of the limit to which the bound belongs.
    place: int  #: Number of the break at that angle; -1 for none.
    is_before: bool  #: True if the bound is that just before the angle.


class Phase(NamedTuple):
    """A phase of stick, with its pin, or of slip in a direction, 1 or -1, with the interval of the limit."""

    start: float
    end: float
    slip: int
    pin: int
    piece: int


class Leap(NamedTuple):
    """A change of the extension at once, where the limit falls below it; `place` is the number of the break."""

    place: int
    change: float


def sequence_of(slider: Slider) -> tuple[list[Phase], list[Pin], list[Leap], list[float]]:
    """Return the phases of a slider from 0 to 2 pi, its pins, its leaps, and the place of the slider at each pin."""
    stiffness, drift = slider.number("stiffness")[0], slider.drift[0]
    knots, pieces, places = _knots(slider)
    ends = np.concatenate((knots[:-1], knots[1:]))
    x = slider.deflection(ends)
    reach = slider.limit(ends, np.concatenate((pieces, pieces)), partial=False).value / stiffness
    (low, low_then), (high, high_then) = (each.reshape(2, -1).tolist() for each in (x - reach, x + reach))
    rounding = _PLACE_ROUNDING * max(float(np.abs(x).max()), float(np.abs(reach).max()))
    highest, lowest = max(*low, *low_then), min(*high, *high_then)
    if not drift and highest <= lowest:
        middle = float(slider.motion.lines[slider.element.place][0].real)
        rest = min(max(middle, highest), lowest)
        pin = Pin(0.0, 0, 0, -1, False)
        if rest != middle:
            side, bounds, then = (-1, low, low_then) if rest == highest else (1, high, high_then)
            number = (bounds + then).index(rest)
            at, is_before = number % len(bounds), number >= len(bounds)
            pin = Pin(float(ends[number]), side, int(pieces[at]), places[at + is_before], is_before)
        return [Phase(0.0, TURN, 0, 0, -1)], [pin], [], [rest]
    rest, pin = np.inf if drift >= 0.0 else -np.inf, None
    for turn in (-1, 0):  # in the period before, and in this one
        phases: list[Phase] = []
        pins: list[Pin] = [] if pin is None else [pin]
        rests, leaps, starts = [rest], [], []
        for number, (start, end, piece) in enumerate(zip(knots, knots[1:], pieces, strict=False)):
            shift = TURN * turn
            for side, bound in ((-1, low[number]), (1, high[number])):
                if side * (rest - bound) > 0.0:
                    if places[number] >= 0 and abs(rest - bound) > rounding:
                        leaps.append(Leap(places[number], bound - rest))
                    rest = bound
                    pins.append(Pin(start + shift, side, int(piece), places[number], False))
                    rests.append(rest)
            slip = 1 if low_then[number] > rest else -1 if high_then[number] < rest else 0
            begin = low[number] if slip > 0 else high[number]
            if not slip:
                phases.append(Phase(start, end, 0, len(pins) - 1, int(piece)))
                continue
            if abs(rest - begin) > rounding:
                starts.append((len(phases), rest))
                phases.append(Phase(start, end, 0, len(pins) - 1, int(piece)))
            phases.append(Phase(start, end, slip, -1, int(piece)))
            rest = low_then[number] if slip > 0 else high_then[number]
            pins.append(Pin(end + shift, -slip, int(piece), places[number + 1], True))
            rests.append(rest)
        pin, rest = pins[-1], rest + TURN * drift * (turn < 0)
    _begin(slider, phases, starts, stiffness)
    return [each for each in _joined(phases) if each.end > each.start], pins, leaps, rests


def _begin(slider: Slider, phases: list[Phase], starts: list[tuple[int, float]], stiffness: float) -> None:
    """Find the angles at which slip begins within a segment, and set them as ends of stick and starts of slip."""
    if not starts:
        return
    slips = [phases[number + 1] for number, _ in starts]
    sides, piece = np.array([each.slip for each in slips]), np.array([each.piece for each in slips])
    rests = np.array([rest for _, rest in starts])

    def beyond(phi: Array, number: NDArray[np.intp]) -> tuple[Array, Array]:
        limit, side = slider.limit(phi, piece[number], partial=False), sides[number] / stiffness
        return (
            slider.deflection(phi) - side * limit.value - rests[number],
            slider.deflection_rate(phi) - side * limit.by_angle,
        )

    low, high = np.array([each.start for each in slips]), np.array([each.end for each in slips])
    for (number, _), phi in zip(starts, roots(beyond, low, high).tolist(), strict=True):
        phases[number] = phases[number]._replace(end=phi)
        phases[number + 1] = phases[number + 1]._replace(start=phi)


def _joined(phases: list[Phase]) -> list[Phase]:
    """Join neighbouring phases of stick with the same pin, and of slip in one interval."""
    found: list[Phase] = []
    for each in phases:
        if (
            found
            and found[-1].slip == each.slip
            and found[-1].pin == each.pin
            and (not each.slip or found[-1].piece == each.piece)
        ):
            found[-1] = found[-1]._replace(end=each.end)
        else:
            found.append(each)
    return found


def _knots(slider: Slider) -> tuple[list[float], NDArray[np.intp], list[int]]:
    """Return the angles between which both bounds are monotone, from 0 to 2 pi."""
    # With them come the number of the interval of the limit after each, and the number of the break at each, or -1.
    knots, intervals, places = [], [], []
    at_break = {each.phi: number for number, each in enumerate(slider.breaks)}
    for (low, high, piece), turning in zip(slider.pieces, slider.turning_points(), strict=True):
        inside = [low]
        for each in turning:
            if each - inside[-1] > SAME and high - each > SAME:
                inside.append(each)
        knots += inside
        intervals += [piece] * len(inside)
        places += [at_break.get(low, -1)] + [-1] * (len(inside) - 1)
    return [*knots, TURN], np.array(intervals), [*places, places[0]]


_NODES, _WEIGHTS = legendre.leggauss(20)
_ROUNDING = 1e-12  # multipliers that are 0 but for rounding, over the largest


class Links(NamedTuple):
    """Changes of forces with the motion at single angles: lines times linear functions of the unknowns."""

    forces: NDArray[np.intp]  #: shape (links,): Number of the deflection with which each force acts.
    columns: NDArray[np.complex128]  #: shape (links, K + 1): Lines of the force.
    #: shape (links, unknowns): The linear functions of the real forms of all deflections, one after the other.
    rows: Array


class DryForces(ForcesLessShares):
    """The forces of Jenkins elements."""

    def along(self, lines: NDArray[np.complex128], period: int, crossings: Array) -> Memory:
        """Return the forces along deflections with some lines, which pass breakpoints at known crossings."""
        motion = Motion(self.layout, self.coefficients, self.slope, lines, period, crossings)
        found = []
        for element in elements_in(self.layout):
            share = next((each for each in self.shares if each.place == element.place), Share(element.place, 0.0, 0.0))
            found.append(DryForce(Slider(motion, element), share))
        return Memory(tuple(found))


@dataclass(frozen=True, eq=False)
class DryForce:
    """The force of one element along a motion, less its share."""

    #: slider, share: The slider with the motion, and what is taken away.
    slider: Slider
    share: Share

    def __post_init__(self) -> None:
        phases, pins, leaps, rests = sequence_of(self.slider)
        for name, value in (("phases", phases), ("pins", pins), ("leaps", leaps), ("rests", np.array(rests))):
            object.__setattr__(self, name, value)

    phases: list[Phase] = field(init=False)
    pins: list[Pin] = field(init=False)
    leaps: list[Leap] = field(init=False)
    rests: Array = field(init=False)

    @property
    def never_slips(self) -> bool:
        """True if it sticks throughout, so that it keeps its offset."""
        return len(self.phases) == 1 and not self.phases[0].slip

    @property
    def _motion(self) -> Motion:
        return self.slider.motion

    @property
    def _count(self) -> int:
        return self._motion.lines.shape[1] - 1

    @cached_property
    def sticks(self) -> list[Phase]:
        """Its phases of stick."""
        return [each for each in self.phases if not each.slip]

    @cached_property
    def _slips(self) -> list[Phase]:
        return [each for each in self.phases if each.slip]

    @cached_property
    def stiffness(self) -> tuple[float, float]:
        """The stiffness of its spring, and its derivative by the parameter."""
        return self.slider.number("stiffness")

    @cached_property
    def modes(self) -> list[int]:
        """The mode of each phase: 1 or -1 in slip, 0 in stick, and where it has no force."""
        middle = np.array([0.5 * (each.start + each.end) for each in self.phases])
        pieces = np.maximum([each.piece for each in self.phases], 0)
        acts = self.slider.limit(middle, pieces, partial=False).value > 0.0
        return [each.slip * int(act) for each, act in zip(self.phases, acts, strict=True)]

    @cached_property
    def lines(self) -> NDArray[np.complex128]:
        """Lines of the force, shape (2K + 1,)."""
        (k, _), spectrum = self.stiffness, self._slip_spectra[0].copy()
        spectrum += k * self._stretched
        found = _doubled(spectrum)
        found[: self._count + 1] -= self._of_share(self.share.spring, self._motion.frequency * self.share.damper)
        return found

    @cached_property
    def slopes(self) -> NDArray[np.complex128]:
        """Derivatives of the lines by the parameter, with the motion constant, shape (K + 1,)."""
        (k, slope), kept, motion = self.stiffness, self._count + 1, self._motion
        spectrum = self._slip_spectra[1] + slope * self._stretched
        spectrum -= k * self.slider.drift[1] * self._moment
        found = _doubled(spectrum)[:kept]
        found -= self._of_share(0.0, motion.frequency * motion.faster * self.share.damper)
        for column, (_, _, by_parameter) in self._linked:
            found += by_parameter * column
        return found

    @cached_property
    def pairs(self) -> list[tuple[int, int, NDArray[np.complex128]]]:
        """The derivatives by its deflection at the same angle, and by that of its host; see `Pairs`."""
        own = np.zeros((2, 2 * self._count + 1), dtype=complex)
        own[0] = self.stiffness[0] * self._stuck[: 2 * self._count + 1]
        own[:, 0] -= self.share.spring, self.share.damper
        element, found = self.slider.element, [(self.slider.element.place, self.slider.element.place, own)]
        if self.has_host:
            found.append((element.place, element.host_place, self._slip_spectra[2:].copy()))
        return found

    @property
    def has_host(self) -> bool:
        """True if its limit depends on the force of a host at the same angle."""
        law = self.slider.slots.form.law
        return isinstance(law, Friction) and law.by == "normal"

    @cached_property
    def links(self) -> list[tuple[int, NDArray[np.complex128], Array]]:
        """The force, the column and the row of each link; see `Links`."""
        place, width, found = self.slider.element.place, len(self._motion.lines), []
        for column, (by_own, by_host, _) in self._linked:
            row = np.zeros((width, 2 * self._count + 1))
            row[place] += by_own
            if self.slider.element.host >= 0:
                row[self.slider.element.host_place] += by_host
            found.append((place, column, row.ravel()))
        return found

    @cached_property
    def _linked(self) -> list[tuple[NDArray[np.complex128], tuple[Array, Array, float]]]:
        """The column and the linear function of each link: of both deflections, and its derivative by the parameter."""
        k, kept, found = self.stiffness[0], self._count + 1, []
        for pin in sorted({each.pin for each in self.sticks}):
            own = [each for each in self.sticks if each.pin == pin]
            column = -k * _doubled(_indicators(own, self._count).sum(axis=0))
            found.append((column, self._row(self.change_of(self.pins[pin]))))
        for leap in self.leaps:
            phi = self.slider.breaks[leap.place].phi
            column = k * leap.change / TURN * _doubled(np.exp(-1j * phi * np.arange(kept)))
            found.append((column, self._row(self.shift_of(leap.place))))
        return found

    def _row(self, change: Change) -> tuple[Array, Array, float]:
        """Return a change as a function of the real forms of both deflections, and of the parameter."""
        k, w = np.arange(self._count + 1), self._motion.frequency
        if np.isnan(change.phi):  # the mean
            return np.eye(1, 2 * self._count + 1)[0], np.zeros(2 * self._count + 1), 0.0
        angle = k * change.phi
        value = np.concatenate((np.cos(angle), np.sin(angle[1:])))
        rate = w * np.concatenate((-k * np.sin(angle), (k * np.cos(angle))[1:]))
        return change.own * value, change.host * value + change.host_rate * rate, change.by_parameter

    def change_of(self, pin: Pin) -> Change:
        """Return the change of the place of the slider at a pin."""
        if not pin.side:
            return Change(np.nan, 1.0, 0.0, 0.0, 0.0)
        (k, slope), faster, at = self.stiffness, self.slider.drift[1], np.array([pin.phi])
        limit = self.slider.limit(at, np.array([pin.piece]))
        value, by_angle, by_parameter, by_deflection, by_rate = (pin.side / k * float(each[0]) for each in limit)
        found = Change(pin.phi, 1.0, by_deflection, by_rate, by_parameter - pin.phi * faster - value * slope / k)
        if pin.place < 0:
            return found
        shift, rate = self.shift_of(pin.place), float(self.slider.deflection_rate(at)[0]) + by_angle
        host, host_rate, more = (a + rate * b for a, b in zip(found[2:], shift[2:], strict=True))
        return Change(pin.phi, 1.0, host, host_rate, more)

    def shift_of(self, place: int) -> Change:
        """Return the change of the angle of a break."""
        each = self.slider.breaks[place]
        rate, limit = self.slider.moved(place)
        if limit is not None:
            _, _, by_parameter, by_deflection, by_rate = (float(part[0]) for part in limit)
            return Change(each.phi, 0.0, -by_deflection / rate, -by_rate / rate, -by_parameter / rate)
        stage = self._motion.layout.contacts[self.slider.element.host].stages[each.switch]
        wider = float(self._motion.slope[stage.clearance])
        return Change(each.phi, 0.0, -stage.sign / rate, 0.0, wider / rate)

    def _of_share(self, spring: float, damper: float) -> NDArray[np.complex128]:
        """Return the lines of a spring and a damper, whose coefficient is multiplied by the frequency."""
        own = self._motion.lines[self.slider.element.place]
        return (spring + 1j * damper * np.arange(len(own))) * own

    @cached_property
    def _stuck(self) -> NDArray[np.complex128]:
        """Spectrum of the function that is 1 in stick, k = 0 ... 3K."""
        return _indicators(self.sticks, 3 * self._count).sum(axis=0)

    @cached_property
    def _moment(self) -> NDArray[np.complex128]:
        """Spectrum of that function times phi, k = 0 ... 2K."""
        return _moments(self.sticks, 2 * self._count)

    @cached_property
    def _stretched(self) -> NDArray[np.complex128]:
        """Spectrum of the extension in stick, k = 0 ... 2K."""
        longest, own = 2 * self._count, self._motion.lines[self.slider.element.place]
        half = 0.5 * own[1:]
        function = np.concatenate((half[::-1].conj(), own[:1], half))
        both = np.concatenate((self._stuck[:0:-1].conj(), self._stuck))
        spectrum = np.convolve(both, function, "valid")[longest:]
        rests = self.rests[[each.pin for each in self.sticks]]
        spectrum -= rests @ _indicators(self.sticks, longest)
        if self.slider.drift[0]:
            spectrum -= self.slider.drift[0] * self._moment
        return spectrum

    @cached_property
    def _slip_spectra(self) -> NDArray[np.complex128]:
        """Spectra, k = 0 ... 2K, of the force in slip and its derivatives by the parameter, the host, and its rate."""
        longest, slips = 2 * self._count, self._slips
        signs, pieces = np.array([each.slip for each in slips]), np.array([each.piece for each in slips], dtype=np.intp)
        found: NDArray[np.complex128] = np.zeros((4, longest + 1), dtype=complex)
        if self.slider.is_steady:
            limit = self.slider.limit(np.zeros(len(slips)), pieces)
            both = signs * np.array([limit.value, limit.by_parameter])
            found[:2] = both @ _indicators(slips, longest)
        elif slips:
            nodes, weights, each = _gauss(slips, longest)
            limit = self.slider.limit(nodes, pieces[each])
            values = np.array([limit.value, limit.by_parameter, limit.by_deflection, limit.by_rate])
            found = (values * (signs[each] * weights)) @ waves(-nodes, longest) / TURN
        return found

    def _phases_at(self, phi: Array) -> NDArray[np.intp]:
        ends = np.array([each.end for each in self.phases])
        return np.minimum(np.searchsorted(ends, phi, side="right"), len(ends) - 1)

    def sticks_at(self, phi: Array) -> Array:
        """Return 1 where it sticks, otherwise 0."""
        return np.array([float(not each.slip) for each in self.phases])[self._phases_at(phi)]

    def tangents(self, phi: Array) -> Array:
        """Return the derivatives at some angles, in the order of `pairs`, shape (pairs, 2, angles)."""
        places = self._phases_at(phi)
        slips = np.array([each.slip for each in self.phases])[places]
        pieces = np.array([each.piece for each in self.phases], dtype=np.intp)[places]
        none = np.zeros(len(phi))
        own = self.stiffness[0] * (slips == 0) - self.share.spring, none - self.share.damper
        found = [np.array(own)]
        if self.has_host:
            limit = self.slider.limit(phi, pieces)
            found.append(slips * np.array([limit.by_deflection, limit.by_rate]))
        return np.array(found)

    def extension(self, phi: Array) -> Array:
        """Return the extension of its spring at some angles from 0 to 2 pi."""
        places = self._phases_at(phi)
        slips, pins, pieces = np.array([each[2:] for each in self.phases]).T
        rests = self.rests[pins[places]]  # in slip not used
        limit = self.slider.limit(phi, pieces[places], partial=False).value / self.stiffness[0]
        return np.where(slips[places] == 0, self.slider.deflection(phi) - rests, slips[places] * limit)

    @cached_property
    def breaks(self) -> Array:
        """The angles of all its events."""
        ends = [each.end for each in self.phases if each.end < TURN]
        return np.sort(np.concatenate((ends, [each.phi for each in self.slider.breaks])))


class Change(NamedTuple):
    """A linear function of the motion at an angle: of the own deflection, of the host, of its rate over time."""

    phi: float
    own: float
    host: float
    host_rate: float
    by_parameter: float


@dataclass(frozen=True, eq=False)
class Memory:
    """The forces of all Jenkins elements along a motion."""

    forces: tuple[DryForce, ...] = ()  #: That of each element, in the order of the contacts.

    def __len__(self) -> int:
        return len(self.forces)

    @cached_property
    def pairs(self) -> Pairs:
        """The derivatives by deflections at the same angle."""
        if not self.forces:
            return NO_PAIRS
        places, arguments, spectra = zip(*(pair for each in self.forces for pair in each.pairs), strict=True)
        return Pairs(np.array(places), np.array(arguments), np.array(spectra))

    @cached_property
    def links(self) -> Links:
        """The derivatives by the motion at single angles."""
        found = [link for each in self.forces for link in each.links]
        lines = self.forces[0].slider.motion.lines
        places, columns, rows = ([link[part] for link in found] for part in range(3))
        return Links(
            np.array(places, dtype=np.intp),
            np.array(columns, dtype=complex).reshape(len(found), lines.shape[1]),
            np.array(rows, dtype=float).reshape(len(found), len(lines) * (2 * lines.shape[1] - 1)),
        )

    def extensions(self, phi: Array) -> Array:
        """Return the extensions of all springs, shape (angles, elements)."""
        return np.array([each.extension(phi % TURN) for each in self.forces]).reshape(len(self.forces), -1).T

    @property
    def stuck(self) -> tuple[int, ...]:
        """Numbers of the contacts that never slip."""
        return tuple(each.slider.element.contact for each in self.forces if each.never_slips)

    def slips(self, period: int) -> tuple[SlipEvent, ...]:
        """Return the modes of all elements at the start of a motion of some forcing periods, and their changes."""
        found = []
        for each in self.forces:
            mode = None
            for phase, slip in zip(each.phases, each.modes, strict=True):
                if slip != mode:
                    found.append(SlipEvent(period * phase.start, each.slider.element.contact, slip))
                mode = slip
        return tuple(sorted(found))

    def with_kept(self, multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return multipliers with 1 for each element that never slips, in place of 0, largest first."""
        found, kept = multipliers.copy(), len(self.stuck)
        found[np.abs(found) <= _ROUNDING * max(1.0, float(np.abs(found).max()))] = 0.0
        found = np.append(found[: len(found) - kept], np.ones(kept, complex))
        return found[np.argsort(-np.abs(found), kind="stable")]


NO_MEMORY = Memory()
"""That of a system without Jenkins elements."""


def elements_in(layout: CoefficientLayout) -> list[Element]:
    """Return all Jenkins elements of a system."""
    structure, first = layout.structure, firsts_of(layout.structure)
    found = []
    for contact in structure.memories:
        host = structure.host(contact)
        found.append(
            Element(contact, first[contact], -1 if host is None else host, -1 if host is None else first[host])
        )
    return found


def check_dry(layout: CoefficientLayout) -> None:
    """Refuse friction that harmonic balance cannot include."""
    for slots in layout.contacts:
        law, name = slots.form.law, slots.form.name
        if not isinstance(law, Friction):
            continue
        if not law.has_memory:
            raise ModelError(
                f"harmonic balance cannot include {name!r}: its force law {law.name!r} sticks rigidly, and the force "
                "in stick is a reaction, which does not follow from the deflection. Give it a stiffness in series, "
                "which makes it a Jenkins element (stiffness = 100 beside limit or coefficient, in the units of the "
                "model), or use the method shooting"
            )


def _doubled(spectrum: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the lines of a spectrum k = 0, 1, ..."""
    found = np.asarray(2.0 * spectrum, dtype=np.complex128)
    found[0] = spectrum[0].real
    return found


def _indicators(phases: list[Phase], longest: int) -> NDArray[np.complex128]:
    """Return the spectrum, k = 0 ... longest, of the function that is 1 in each phase; shape (phases, longest + 1)."""
    start, end = (np.array([each[place] for each in phases], dtype=float) for place in (0, 1))
    found: NDArray[np.complex128] = np.empty((len(phases), longest + 1), dtype=complex)
    found[:, 0] = (end - start) / TURN
    difference = waves(-start, longest) - waves(-end, longest)
    found[:, 1:] = difference[:, 1:] / (1j * TURN * np.arange(1, longest + 1))
    return found


def _moments(phases: list[Phase], longest: int) -> NDArray[np.complex128]:
    """Return the spectrum, k = 0 ... longest, of the function that is phi in some phases, and 0 elsewhere."""
    start, end = (np.array([each[place] for each in phases], dtype=float) for place in (0, 1))
    found: NDArray[np.complex128] = np.empty(longest + 1, dtype=complex)
    found[0] = (end**2 - start**2).sum() / (2.0 * TURN)
    ends = start @ waves(-start, longest) - end @ waves(-end, longest)
    inner = _indicators(phases, longest).sum(axis=0)
    k = np.arange(1, longest + 1)
    found[1:] = ends[1:] / (1j * TURN * k) + inner[1:] / (1j * k)
    return found


def _gauss(phases: list[Phase], longest: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return nodes and weights of Gauss's rule on panels that resolve all lines, and the phase of each."""
    nodes, weights, numbers = [], [], []
    for number, each in enumerate(phases):
        count = 1 + int((each.end - each.start) * max(8, longest) / TURN)
        ends = each.start + (each.end - each.start) * np.arange(count + 1) / count
        half = 0.5 * np.diff(ends)[:, None]
        nodes.append((ends[:-1, None] + half * (1.0 + _NODES)).ravel())
        weights.append((half * _WEIGHTS).ravel())
        numbers.append(np.full(len(nodes[-1]), number))
    return np.concatenate(nodes), np.concatenate(weights), np.concatenate(numbers)
