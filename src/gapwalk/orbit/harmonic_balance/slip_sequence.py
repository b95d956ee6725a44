"""When a Jenkins element sticks and slips along a periodic deflection: all events, exact to rounding.

With the deflection ``x``, less the way of a base that moves, the slider stands at ``p = x - z``, where ``z`` is the
extension of the spring. The limit over the stiffness, ``r``, is the largest extension, so ``x - r <= p <= x + r``. The
slider stays where it is unless one of these bounds pushes it: that is slip, and it ends where the bound turns. If the
limit varies, the bounds are ``x`` less or plus what varies; where the limit jumps, the bounds jump.

Between two events of the contact that hosts the friction, the bounds have turning points. Between two neighbouring ones
of all these angles both bounds are monotone, and what the slider does follows from their ends. Its place after a period
is ``min(max(p, low), high)`` of that before: so it settles within one period, and the second one is the periodic motion.
If it never slips, any place from the highest lower bound to the lowest upper bound is possible. Then the one is taken at
which the mean of its force is zero, or nearest to that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.laws import Friction, Stages
from gapwalk.model.laws.closed_form import Host
from gapwalk.orbit.harmonic_balance.series import grid, waves

Array = NDArray[np.float64]
Function = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]

TURN = 2.0 * np.pi
_STEP = 1e-150  # of the complex step
_SAME = 1e-12  # radians between two angles that count as one
_ROUNDING = 4e-15  # of a place, relative to the size of the bounds
_ITERATIONS = 60  # bisection alone would need about 50; Newton's method takes 4
_TOLERANCE = 2e-15
_ASIDE = 1e-9  # radians from a break, at which the sign of the limit beside it is read
_BESIDE = 1e-6  # radians, for a rough second derivative


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
    """An angle at which the limit may jump or has a kink.

    Attributes
    ----------
    phi
        The angle.
    switch
        Number of the switch of the host that passes its breakpoint; -1 where the limit reaches or leaves zero.
    piece
        The interval beside it in which the limit is not zero, for such a place.
    """

    phi: float
    switch: int
    piece: int


class Pin(NamedTuple):
    """The angle of a bound at which the slider comes to rest.

    Attributes
    ----------
    phi
        The angle, below 0 if that was in the period before.
    side
        -1 for the lower bound, 1 for the upper one; 0 for a slider that never slips, and rests where its force has the
        mean zero.
    piece
        The interval of the limit to which the bound belongs.
    place
        Number of the break at that angle; -1 for none.
    is_before
        True if the bound is that just before the angle.
    """

    phi: float
    side: int
    piece: int
    place: int
    is_before: bool


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


@dataclass(frozen=True, eq=False)
class Motion:
    """Deflections by their lines, for some coefficients of the flow.

    Parameters
    ----------
    layout, coefficients, slope
        The coefficients, and their derivatives by a parameter.
    lines : shape (deflections, K + 1)
        The deflections.
    period
        m.
    crossings
        The crossings of breakpoints; see `Forces`.
    """

    layout: CoefficientLayout
    coefficients: Array
    slope: Array
    lines: NDArray[np.complex128]
    period: int
    crossings: Array

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
    """The slider of a Jenkins element along a periodic motion.

    Parameters
    ----------
    motion, element
        The motion, and the element.
    """

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
        """Return the limit at some angles, each in an interval with a number; without `partial` no partial derivatives."""
        found = self._signed_limit(phi, self._patterns[pieces], partial=partial)
        acts = self._acts[pieces] & (found.value > 0.0)
        return found if acts.all() else Limit(*(np.where(acts, each, 0.0) for each in found))

    @cached_property
    def is_steady(self) -> bool:
        """True if the limit is constant between the events of its host."""
        law, host = self.slots.form.law, self._host
        assert isinstance(law, Friction)
        stages = host.stages if host and law.by == "stages" else ()
        return law.by != "normal" and not self.slots.waves and not any("hysteresis" in each.waves for each in stages)

    @cached_property
    def breaks(self) -> list[Break]:
        """All breaks, in order."""
        return self._intervals[0]

    @cached_property
    def pieces(self) -> list[tuple[float, float, int]]:
        """The parts of the period from 0 to 2 pi between breaks, each with the number of its interval."""
        return _parts([each.phi for each in self.breaks])

    def moved(self, place: int) -> tuple[float, Limit | None]:
        """Return what moves a break: its angle changes by less the change of a quantity over this rate by phi.

        The quantity is the penetration of the switch of the host, or the limit, which is returned too.
        """
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
            if 0 <= own < len(self._host.stages) and not (found and phi - found[-1].phi < _SAME):
                found.append(Break(phi % TURN, own, -1))
        if len(found) > 1 and found[0].phi + TURN - found[-1].phi < _SAME:
            found.pop()
        return sorted(found)

    @cached_property
    def _closed(self) -> NDArray[np.bool_]:
        """True for each stage of the host that is closed in each interval between its events, shape (intervals, stages)."""
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
        """All breaks; for each interval after one the pattern of closed stages; and True where the limit is positive."""
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
        """Return points of a grid in some parts, with their ends; the interval of each; and True but for last points."""
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
                return now, (rate(phi + _BESIDE, which) - now) / _BESIDE if side else self._bend(phi)

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
        """Return what the law gives for the limit, which may be negative."""
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


def sequence_of(slider: Slider) -> tuple[list[Phase], list[Pin], list[Leap], list[float]]:
    """Return the phases of a slider from 0 to 2 pi, its pins, its leaps, and the place of the slider at each pin."""
    stiffness, drift = slider.number("stiffness")[0], slider.drift[0]
    knots, pieces, places = _knots(slider)
    ends = np.concatenate((knots[:-1], knots[1:]))
    x = slider.deflection(ends)
    reach = slider.limit(ends, np.concatenate((pieces, pieces)), partial=False).value / stiffness
    (low, low_then), (high, high_then) = (each.reshape(2, -1).tolist() for each in (x - reach, x + reach))
    rounding = _ROUNDING * max(float(np.abs(x).max()), float(np.abs(reach).max()))
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
    """Return the angles between which both bounds are monotone, from 0 to 2 pi.

    With them come the number of the interval of the limit after each, and the number of the break at each, or -1.
    """
    knots, intervals, places = [], [], []
    at_break = {each.phi: number for number, each in enumerate(slider.breaks)}
    for (low, high, piece), turning in zip(slider.pieces, slider.turning_points(), strict=True):
        inside = [low]
        for each in turning:
            if each - inside[-1] > _SAME and high - each > _SAME:
                inside.append(each)
        knots += inside
        intervals += [piece] * len(inside)
        places += [at_break.get(low, -1)] + [-1] * (len(inside) - 1)
    return [*knots, TURN], np.array(intervals), [*places, places[0]]


def _parts(angles: list[float]) -> list[tuple[float, float, int]]:
    """Return the parts of the period from 0 to 2 pi between some angles, each with the number of the angle before it."""
    ends = [0.0, *angles, TURN]
    count = max(1, len(angles))
    parts = [(low, high, (number - 1) % count) for number, (low, high) in enumerate(zip(ends, ends[1:], strict=False))]
    return [each for each in parts if each[1] > each[0]]


def zeros_on(
    function: Function, phi: Array, which: NDArray[np.intp], opens: NDArray[np.bool_]
) -> tuple[list[int], list[float]]:
    """Return the zeros of a function between neighbouring points, each after the number of the point before it.

    Two zeros between two points are found, too, if the slopes there point to an extremum beyond zero.

    Parameters
    ----------
    function
        It has angles with the numbers of their intervals, and returns values and slopes, which may be rough.
    phi, which
        The points, and the interval of each.
    opens
        True for each point after which the next one follows.
    """
    value, slope = function(phi, which)
    above, cells = value > 0.0, np.flatnonzero(opens)
    changes = cells[above[cells] != above[cells + 1]]
    same = cells[above[cells] == above[cells + 1]]
    side, width = np.where(above[same], 1.0, -1.0), phi[same + 1] - phi[same]
    dips = (side * slope[same] < 0.0) & (side * slope[same + 1] > 0.0)
    dips &= np.minimum(abs(value[same]), abs(value[same + 1])) < width * np.maximum(
        abs(slope[same]), abs(slope[same + 1])
    )
    same, side = same[dips], side[dips]
    low, high, numbers = phi[changes], phi[changes + 1], changes
    if len(same):
        pieces = which[same]

        def turned(phi: Array, each: NDArray[np.intp]) -> tuple[Array, Array]:
            now = function(phi, pieces[each])[1]
            return now, (function(phi + _BESIDE, pieces[each])[1] - now) / _BESIDE

        middle = roots(turned, phi[same], phi[same + 1])
        beyond = side * function(middle, pieces)[0] < 0.0
        same, middle = same[beyond], middle[beyond]
        low, high = np.concatenate((low, phi[same], middle)), np.concatenate((high, middle, phi[same + 1]))
        numbers = np.concatenate((changes, same, same))
    found = roots(lambda phi, each: function(phi, which[numbers[each]]), low, high)
    return numbers.tolist(), found.tolist()


def roots(function: Function, low: Array, high: Array) -> Array:
    """Return a zero of a function between each two angles at which its signs differ, all at once.

    By Newton's method, or bisection where that leaves the bracket. The function has angles with the numbers of their
    brackets, and returns its values and its slopes, which may be rough.
    """
    if not len(low):
        return low
    low, high, each = low.copy(), high.copy(), np.arange(len(low))
    rises = function(high, each)[0] > 0.0
    found = 0.5 * (low + high)
    phi = found.copy()
    for _ in range(_ITERATIONS):
        value, slope = function(phi, each)
        above = (value > 0.0) == rises[each]
        high[each[above]], low[each[~above]] = phi[above], phi[~above]
        with np.errstate(all="ignore"):
            following = phi - value / slope
        inside = (following >= low[each]) & (following <= high[each])
        following = np.where(inside, following, 0.5 * (low[each] + high[each]))
        found[each] = following
        going = np.abs(following - phi) > _TOLERANCE
        if not going.any():
            break
        each, phi = each[going], following[going]
    return found
