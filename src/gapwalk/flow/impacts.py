"""Impacts on rigid stops: the reset of the rates, impacts that follow each other ever faster, and derivatives.

An impact changes the velocities along its force, ``v+ = v - w (u - u+) / (e.w)`` with ``w = M^-1 d``, the
rate u of the deflection before it, and the rate u+ after it that the law gives. An impulse is larger than any force of
friction, so what sticks may slip from there on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from gapwalk.flow.event_rule import pass_event
from gapwalk.flow.forces import Angles, accelerations
from gapwalk.flow.friction_state import depth_changes
from gapwalk.flow.friction_switches import DrySwitches, ModeSwitches
from gapwalk.model.coefficients import ContactSlots

# Complete chatter: infinitely many impacts on a rigid stop that follow each other ever faster, summed at once.
#
# After an impact the motion leaves the stop at a rate u, falls back, and leaves it at about r u, with the restitution
# r. The states after all impacts still to come lie on a smooth curve S(m), of which the n-th is at ``m = r^n`` and the
# end, where the motion has come to rest on the stop, at ``m = 0``. Over one flight from any point of this curve the
# state changes by D(m), which the flights give, so the curve satisfies
#
#     S(r m) - S(m) = D(m),     with S(1) known
#
# for the angle, the positions, the rates along the stop, and ``u / m``. Term by term, with ``D = sum d_k m^k``, this
# is the sum of geometric series, ``S(1) - S(0) = - sum d_k / (1 - r^k)``. The curve and its flights are polynomials
# through Chebyshev nodes; the flights follow from the curve by integration, and the curve from the flights, in turn
# until nothing changes. All of it accepts complex numbers, so derivatives are taken by a complex step.
#
# Nordmark and Piiroinen (2009), Simulation and stability analysis of impacting systems with complete chattering,
# Nonlinear Dynamics 58, 85-106.

_ALONG, _WITHIN = 12, 10  # nodes along the curve, and within a flight
_FEWEST, _SWEEPS = 6, 30  # least and most repetitions; each adds more digits, the shorter the chatter is
_LOOK, _FAR = 4, 2.0  # repetition after which a chatter that is too long shows it, and by how much
_SETTLED = 1e-13  # change in a repetition, as a share of the motion, after which one more makes the rest rounding
_RESOLVED = 1e-12  # share of the last coefficients of accelerations; their errors enter times the length of the chatter

Array = NDArray[Any]


class Stop(NamedTuple):
    """A stop, with the motion between two impacts on it."""

    #: vector, push: Its deflection vector, and the accelerations by that force which accelerates the deflection by 1.
    vector: Array
    push: Array
    side: int  #: 1 or -1.
    restitution: Any  #: Share of the rate of its deflection that is left after an impact.
    #: Function of the angle: the first and second derivative over time of what is added to its deflection.
    sway: Callable[[Array], tuple[Any, Any]]
    turning: Callable[[Array, Array, Array], Array]  #: Function of angles, positions and velocities: the accelerations.
    pace: Any  #: Time of a radian.


class Chatter(NamedTuple):
    """The chatter after an impact, of one motion or of many (...)."""

    #: shape (..., along, 4n + 2): At the nodes of the curve: angle, positions, rates along the stop, rate away from it
    #: over m, and integrals over the angle, since the impact, of each position and of its square.
    curve: Array
    #: angles, positions, velocities: shape (..., along, within), (..., along, within, n): The flights that begin at the
    #: nodes.
    angles: Array
    positions: Array
    velocities: Array

    def impacts(self, restitution: float, shortest: float) -> tuple[Array, Array]:
        """Return angles of the impacts to come, and rates before them, until the rest of them takes a moment only."""
        curve = np.real(self.curve.reshape(-1, *self.curve.shape[-2:])[0])[:, [0, self.curve.shape[-1] // 2]]
        count = math.ceil(math.log(shortest / float(curve[-1, 0] - curve[0, 0])) / math.log(restitution))
        places = restitution ** np.arange(1.0, max(count, 1) + 1.0)
        angles, rates = (_weights(places) @ curve).T
        return angles, places * rates / restitution

    def after(self, stop: Stop, count: float = math.inf) -> tuple[Array, Array, Array]:
        """Return angle, state and integrals just after a number of impacts, or where the motion has come to rest."""
        place, half = np.asarray(stop.restitution**count if count < math.inf else 0.0), self.curve.shape[-1] // 2
        found = np.squeeze(_weights(place) @ self.curve, -2) if place else self.curve[..., -1, :]
        state = found[..., 1:half].copy()
        state[..., half // 2 :] -= stop.side * place * found[..., half : half + 1] * stop.push
        return found[..., 0], state, found[..., half + 1 :]


def sum_chatter(stop: Stop, theta: Array, q: Array, v: Array) -> Chatter | None:
    """Sum all impacts that follow one on a stop; None if they do not end, or not as smoothly as needed."""
    # Shapes: `theta`, `q`, `v` (...), (..., n), (..., n).
    n, side = q.shape[-1], stop.side
    sums, own = _sums(complex(stop.restitution)), slice(2 * n + 1, 2 * n + 2)
    away = -side * (v @ stop.vector + stop.sway(theta)[0])[..., None]
    parts = theta[..., None], q, v + side * away * stop.push, away, np.zeros((*q.shape[:-1], 2 * n))
    start = np.concatenate(parts, axis=-1)[..., None, :]
    curve = np.repeat(start, _ALONG, axis=-2)
    turning = np.repeat(stop.turning(theta, q, v)[..., None, :], _ALONG, axis=-2)[..., None, :]
    turning, flight = np.repeat(turning, _WITHIN, axis=-2), 0.0 * curve[..., :1]
    last, angles, positions, velocities = math.inf, curve, curve, curve
    for number in range(_SWEEPS):
        angles = curve[..., :1] + flight / stop.pace * _WITHIN_NODES
        begin = curve[..., n + 1 : 2 * n + 1] - side * _ALONG_NODES[:, None] * curve[..., own] * stop.push
        velocities = begin[..., None, :] + flight[..., None] * (_RUNNING @ turning)
        positions = curve[..., None, 1 : n + 1] + flight[..., None] * (_RUNNING @ velocities)
        turning = stop.turning(angles, positions, velocities)
        pull = side * (turning @ stop.vector + stop.sway(angles)[1])
        late, whole = (pull @ _LATE)[..., None], (pull @ _WHOLE)[..., None]
        if not np.isfinite(late).all() or np.real(late).min() <= 0.0:
            return None
        rates = start[..., own] + sums @ (curve[..., own] * (whole / late - 2.0))  # first, as flights depend on them
        flight = _ALONG_NODES[:, None] * rates / late
        turn = flight / stop.pace
        changes = (
            turn,
            flight * (_WHOLE @ velocities),
            flight * (_WHOLE @ turning - side * whole * stop.push),
            0.0 * turn,
            turn * (_WHOLE @ positions),
            turn * (_WHOLE @ positions**2),
        )
        before, curve = curve, start + sums @ np.concatenate(changes, axis=-1)
        curve[..., own] = rates
        if number == _LOOK and not _is_resolved(turning, _FAR):
            return None
        if last <= _SETTLED:
            break
        if number >= _FEWEST:
            last = _change(curve - before, curve, n)
    if not last <= _SETTLED or not _is_resolved(turning):
        return None
    return Chatter(curve, angles, positions, velocities)


def _weights(places: Array) -> Array:
    """Return the weights of the values at the nodes in those at some places of the curve."""
    return chebyshev.chebvander(2.0 * places - 1.0, _ALONG - 1) @ _SPECTRUM_ALONG


def _is_resolved(turning: Array, times: float = 1.0) -> bool:
    """Return True if the last coefficients of accelerations at the nodes of all flights are as small as needed."""
    by_node = np.real(turning)
    spectra = _SPECTRUM_WITHIN @ by_node, _SPECTRUM_ALONG @ np.swapaxes(by_node, -3, -2)
    return all(np.abs(each[..., -2:, :]).max() <= times * _RESOLVED * np.abs(each).max() for each in spectra)


def _change(change: Array, curve: Array, n: int) -> float:
    """Return the largest change of angle, positions or rates as a share of their sizes; the same of derivatives."""
    count, kinds = 2 * n + 2, (0, 1, n + 1)
    both, moved = (each[..., :count].reshape(-1, _ALONG, count) for each in (curve, change))

    def largest(each: Array) -> Array:
        return np.maximum.reduceat(np.abs(each).max(axis=-2), kinds, axis=-1)

    whole, turns = largest(np.real(both)).max(axis=0), abs(both[0, 0, 0] - both[0, -1, 0])
    sizes = np.maximum((whole[0], max(whole[1], whole[2] * turns), whole[2]), np.finfo(float).tiny)
    found = 0.0
    for own, part in ((np.real(moved), np.real(both)), (np.imag(moved), np.imag(both))):
        most, all_of_it = ((largest(each) / sizes).max(axis=-1) for each in (own, part))
        found = max(found, float((most / np.where(most > 0.0, all_of_it, 1.0)).max()))
    return found if math.isfinite(found) else math.inf


@lru_cache(maxsize=16)
def _sums(restitution: complex) -> Array:
    """Return the matrix by which ``S(m) - S(1)`` at the nodes follows from ``S(r m) - S(m)``."""
    r = restitution if restitution.imag else restitution.real
    nodes = 2.0 * r * _ALONG_NODES - 1.0
    values = [np.ones_like(nodes), nodes]
    while len(values) < _ALONG:
        values.append(2.0 * nodes * values[-1] - values[-2])
    equations = np.stack(values, axis=-1) @ _SPECTRUM_ALONG - np.eye(_ALONG)
    equations[-1] = 0.0
    equations[-1, 0] = 1.0  # at m = 0 nothing changes; S(1) is known instead
    found = np.linalg.inv(equations)
    found[:, -1] = 0.0
    return found


def _places(count: int) -> Array:
    """Return Chebyshev nodes from 1 to 0."""
    return 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / (count - 1))


def _spectrum(nodes: Array) -> Array:
    """Return the matrix that takes values at nodes to coefficients of Chebyshev polynomials of 2 m - 1."""
    return np.linalg.inv(chebyshev.chebvander(2.0 * nodes - 1.0, len(nodes) - 1))


_ALONG_NODES, _WITHIN_NODES = _places(_ALONG), _places(_WITHIN)[::-1]
_SPECTRUM_ALONG, _SPECTRUM_WITHIN = _spectrum(_ALONG_NODES), _spectrum(_WITHIN_NODES)
# integrals within a flight: from its begin to each node, over all of it, and of the integral to each node over all
_RISING = [chebyshev.chebint(row, lbnd=-1, scl=0.5) for row in _SPECTRUM_WITHIN.T]
_RUNNING = np.array([chebyshev.chebval(2.0 * _WITHIN_NODES - 1.0, each) for each in _RISING]).T
_WHOLE = _RUNNING[-1]
_LATE = _WHOLE @ _RUNNING


_TAIL = 1e-6  # radians that further impacts may last together for the contact to be held at once
_INTO = 1e-13  # share of the size of the velocities above which a stop that is held is struck too
_AT_ONCE = 200  # the most impacts at one instant
_LONG = 0.3  # radians that further impacts may last together for their sum to be tried
_MANY = 10  # impacts to come from which on to sum them costs less than to follow them
_CLEAR = 0.1  # share of its change in a chatter by which another deflection must stay beside its breakpoint
_STEP = 1e-100  # of the complex step
_FAINT = 1e-40  # share of it for coefficients, which therefore change nothing of what states change beside them
_total = partial(np.add.reduce, axis=-1)  # for short rows twice as fast as the sum


class Rest(NamedTuple):
    """The end of a chatter, or of a part of it: angle, stop, whether the motion rests, state, changes, and impacts."""

    theta: float
    reaction: int
    ends: bool
    state: NDArray[np.float64]
    changes: NDArray[np.float64]
    shifts: NDArray[np.float64]
    integrals: NDArray[np.float64]
    angles: NDArray[np.float64]
    speeds: NDArray[np.float64]


class Impacts:
    """Impacts of the motions of one integrator."""

    def __init__(self, dry: DrySwitches, modes: ModeSwitches) -> None:
        self._dry, self._layout, self._modes = dry, dry.layout, modes
        self.rest: Rest | None = None
        self.begin(np.zeros(0), None, 1.0)

    def begin(self, places: NDArray[np.float64], watched: NDArray[np.float64] | None, unit: float) -> None:
        """Begin a motion; between its `places` alone are impacts summed, and only where no `watched` rate turns."""
        self._places, self._watched, self._unit = places, watched, unit
        self._longest, self.rest = _LONG, None

    def strike(self, switch: int, theta: float) -> list[int]:
        """Reset the state at an impact on the stop of a switch, and transform its derivatives."""
        # Impacts that would last together for a moment only are summed up: the contact is held from here on. Their
        # impulses act along one direction, so that leaves an error of the second order of that time.
        dry, begin, first = self._dry, self._dry.read(theta), self._dry.stop_reaction[switch]
        before, struck = dry.state[: dry.size].copy(), [first]
        reset = partial(self._reset, struck, ())
        while True:
            dry.state[: dry.size] = after = reset(before, dry.base, theta)
            if self._modes.mode_count:
                self._modes.refresh(theta, dry.closed)
            into = self._struck_too(struck, theta)
            if into is None or len(struck) > _AT_ONCE:
                break
            struck.append(into)
        dry.after_impact(theta)
        several = struck.count(first) > 1  # these, too, become ever weaker
        lasting = {number: self._lasting(number, theta) for number in (struck if several else struck[:1])}
        ends = [number for number, lasts in lasting.items() if lasts <= _TAIL]
        if ends and (several or len(struck) == 1):
            reset = partial(self._reset, struck if several else (), ends)
            dry.state[: dry.size] = after = reset(before, dry.base, theta)
            dry.after_impact(theta, ends)
        if dry.columns:
            now, guard = dry.read(theta), partial(self._depth, first)
            pace = float(dry.base[0])
            flows = pace * np.concatenate(begin[:3]), pace * np.concatenate(now[:3])
            dry.rows()[:] = pass_event(dry.rows(), dry.along(), before, dry.base, theta, guard, reset, flows)
        dry.state[: dry.size] = after
        dry.kink(begin, theta)
        if len(struck) == 1 and _TAIL < lasting[first] < self._longest and len(self._places):
            self.rest = self._sum(first, theta)
        return [self._layout.structure.reactions[number][1] for number in dict.fromkeys(struck) if number != first]

    def _struck_too(self, struck: Sequence[int], theta: float) -> int | None:
        """Return the reaction of a stop that was held or struck, and into which the last impulse has driven the motion.

        What lies between two stops goes back and forth in no time, until neither of them is approached.
        """
        dry = self._dry
        for number, sign in dry.sign_of.items():
            touches = number != struck[-1] and (number in dry.held or number in struck)
            if touches and sign * dry.gap(number, theta)[1] > _INTO * dry.speed():
                return number
        return None

    def _lasting(self, number: int, theta: float) -> float:
        """Return the angle that all further impacts on a stop take under a constant force; inf if they do not end."""
        dry, sign = self._dry, self._dry.sign_of[number]
        contact = self._layout.structure.reactions[number][0]
        restitution = float(self._restitution(self._layout.contacts[contact], dry.base, theta))
        towards, left = sign * dry.acceleration(contact, dry.read(theta), theta), -sign * dry.gap(number, theta)[1]
        if towards <= 0.0 or restitution >= 1.0:
            return np.inf
        return 2.0 * max(left, 0.0) / (float(dry.base[0]) * towards * (1.0 - restitution))

    def _sum(self, number: int, theta: float) -> Rest | None:
        """Return where all impacts to come on a stop, or those before the next place, end."""
        # None if they do not, if they are few, or if something else happens meanwhile.
        dry, n, layout = self._dry, self._dry.n, self._layout
        if dry.held or dry.slots or self._modes.mode_count or layout.cycles:
            return None
        contact, own = layout.structure.reactions[number]
        slots, side, pace = layout.contacts[contact], dry.sign_of[number], float(dry.base[0])
        now = dry.read(theta)
        restitution = self._restitution(slots, dry.base, theta)
        leaving, pull = -side * dry.gap(number, theta)[1], side * dry.acceleration(contact, now, theta)
        if not (0.0 < restitution < 1.0 and leaving > 0.0 and pull > 0.0) or any(
            name in slots.waves for name in slots.numbers
        ):
            return None
        lasts = 2.0 * leaving / (pull * (1.0 - restitution) * pace)
        if not _TAIL < lasts < self._longest or lasts * restitution**_MANY < _TAIL:
            return None
        place = min(self._places[self._places > theta], default=np.inf)
        if lasts * (1.0 - restitution**_MANY) > place - theta:
            return None
        self._longest = 0.5 * lasts
        state, found = dry.state[: 2 * n], list[tuple[Stop, Chatter]]()
        rows, late = np.zeros((1, 2 * n)), np.zeros(1)
        if dry.columns:
            flow = np.concatenate((now.velocities, now.accelerations)) * pace
            late = np.append(depth_changes(dry, number, theta) * side / (leaving * pace), 0.0)
            rows = np.vstack((dry.rows(), rows)) + np.outer(late, flow)
        for direction in dry.directions if len(dry.directions) else [0.0 * dry.base]:
            part = slice(-1, None) if found else slice(None)  # states change with the first direction, far below it
            moved, thetas, numbers = state + rows, theta + late, dry.base
            if dry.columns:
                moved, thetas = state + 1j * _STEP * rows[part], theta + 1j * _STEP * late[part]
                numbers = dry.base + 1j * _STEP * _FAINT * direction
            stop = self._stop(slots, side, numbers)
            chatter = sum_chatter(stop, thetas, moved[:, :n], moved[:, n:])
            if chatter is None:
                return None
            found.append((stop, chatter))
        one = found[0][1]
        angles, positions, velocities = (np.real(each[0]) for each in (one.angles, one.positions, one.velocities))
        if not self._is_alone(own, angles, positions) or (self._watched is not None and self._turns(slots, velocities)):
            return None
        thetas, speeds = one.impacts(restitution, _TAIL)
        ends = bool(np.real(one.curve[0, -1, 0]) < place)
        count = len(thetas) if ends else int(np.searchsorted(thetas, place - _TAIL))
        if not ends and count < _MANY:
            return None
        after = [chatter.after(stop, np.inf if ends else count) for stop, chatter in found]
        end, state, integrals = (np.real(part[0]) for part in after[0])
        delays, changes = (np.imag(part[:-1]) / _STEP for part in after[0][:2])
        for place, (delay, change, _) in enumerate(after if len(dry.directions) else (), -len(dry.directions)):
            delays[place] += np.imag(delay[-1]) / _STEP / _FAINT
            changes[place] += np.imag(change[-1]) / _STEP / _FAINT
        return Rest(float(end), number, ends, state, changes, delays, integrals, thetas[:count], side * speeds[:count])

    def _stop(self, slots: ContactSlots, side: int, numbers: NDArray) -> Stop:
        layout, closed, vector = self._layout, self._dry.closed, numbers[slots.deflection]
        push = numbers[slots.force]

        def sway(theta: NDArray) -> tuple[Any, Any]:
            if slots.sway is None:
                return 0.0, 0.0
            angles = Angles(layout, numbers, theta)
            return angles.sway(slots, 0, 1), angles.sway(slots, 0, 2)

        def turning(theta: NDArray, q: NDArray, v: NDArray) -> NDArray:
            return accelerations(layout, numbers, theta, q, v, closed, unit=self._unit)

        restitution = self._restitution(slots, numbers, 0.0)
        return Stop(vector, push / (vector @ push), side, restitution, sway, turning, numbers[0])

    def _restitution(self, slots: ContactSlots, numbers: NDArray, theta: float) -> Any:
        return -slots.form.law.rebound(1.0, Angles(self._layout, numbers, theta).named(slots.numbers, slots.waves))

    def _is_alone(self, own: int, angles: NDArray, positions: NDArray) -> bool:
        """Return True if no other breakpoint is passed, nor nearly, in some flights."""
        angle = Angles(self._layout, self._dry.base, angles)
        for switch, (contact, place) in enumerate(self._dry.equations.switches):
            slots = self._layout.contacts[contact]
            stage = slots.stages[place]
            values = angle.named(stage.numbers, stage.waves)
            depth = positions @ self._dry.base[slots.deflection] + angle.sway(slots) - stage.sign * values["clearance"]
            low, high = float(depth.min()), float(depth.max())
            if switch != own and not (low > _CLEAR * (high - low) or high < -_CLEAR * (high - low)):
                return False
        return True

    def _turns(self, slots: ContactSlots, velocities: NDArray) -> bool:
        """Return True if a rate that is watched may vanish in some flights, but for the deflection of their stop."""
        vector = self._dry.base[slots.deflection]
        for each in self._watched if self._watched is not None else []:
            if abs(each @ vector) >= (1.0 - 1e-15) * np.linalg.norm(each) * np.linalg.norm(vector):
                continue
            rates = velocities @ each
            if rates.any() and rates.min() <= 0.0 <= rates.max():
                return True
        return False

    def land(self) -> Rest:
        """Set the state where a chatter was summed up to, and hold its stop if it ended; return what has passed."""
        dry, rest, n = self._dry, self.rest, self._dry.n
        assert rest is not None
        self.rest = None
        # at rest on the stop it is exactly there: nothing else tells how large a rate is that is only rounding
        ends = [rest.reaction] * rest.ends
        dry.state[: 2 * n] = self._reset((), ends, rest.state, dry.base, rest.theta)
        if dry.columns:
            dry.rows()[:] = rest.changes
        else:
            dry.state[2 * n : 2 * n + 2 * n][: len(dry.state) - 2 * n] += rest.integrals[: len(dry.state) - 2 * n]
        dry.after_impact(rest.theta, ends)
        now = dry.read(rest.theta)
        if dry.columns:
            flow = np.concatenate((now.velocities, now.accelerations)) * float(dry.base[0])
            dry.rows()[:] -= np.outer(rest.shifts, flow)
        return rest

    def _reset(
        self, struck: Sequence[int], ends: Sequence[int], state: NDArray, coefficients: NDArray, theta: Any
    ) -> NDArray:
        """Return the state after impacts on some stops, one after the other, and plastic ones that end on theirs."""
        n, angles = self._dry.n, Angles(self._layout, coefficients, theta)
        for number, plastic in [*((each, False) for each in struck), *((each, True) for each in ends)]:
            slots = self._layout.contacts[self._layout.structure.reactions[number][0]]
            vector, push = coefficients[..., slots.deflection], coefficients[..., slots.force]
            push = push / _total(vector * push)[..., None]
            rate = _total(vector * state[..., n : 2 * n]) + angles.sway(slots, 0, 1)
            after = 0.0 * rate if plastic else slots.form.law.rebound(rate, angles.named(slots.numbers, slots.waves))
            q, v = state[..., :n], state[..., n : 2 * n] + (after - rate)[..., None] * push
            if plastic:
                q = q - self._depth(number, state, coefficients, theta)[..., None] * push
            state = np.concatenate((q, v, state[..., 2 * n :]), axis=-1)
        return state

    def _depth(self, number: int, state: NDArray, coefficients: NDArray, theta: Any) -> NDArray:
        """Return the deflection beyond a stop, real or complex."""
        contact, switch = self._layout.structure.reactions[number]
        slots = self._layout.contacts[contact]
        stage = slots.stages[self._dry.equations.switches[switch][1]]
        x = _total(coefficients[..., slots.deflection] * state[..., : self._dry.n])
        return (
            x + Angles(self._layout, coefficients, theta).sway(slots) - stage.sign * coefficients[..., stage.clearance]
        )
