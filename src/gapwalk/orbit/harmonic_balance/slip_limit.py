"""The limit of the force of a Jenkins element along a periodic motion, and the bounds of its slider.

The limit may be constant, jump where the contact that hosts the friction closes and opens, or follow the force of that
contact. Between its breaks it is smooth. A limit below zero, as where a damped contact pulls, counts as zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.model.laws import Friction, Stages
from gapwalk.model.laws.closed_form import Host
from gapwalk.orbit.harmonic_balance.series import grid, waves
from gapwalk.orbit.harmonic_balance.zeros import ASIDE, zeros_on

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
        """Return the rate, by the angle phi, of the quantity that is zero at a break.

        The angle of the break changes by minus the change of that quantity over this rate. The quantity is the
        penetration of the switch of the host, or the limit, which is returned too.
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
