"""Impacts on rigid stops: the reset of the rates, impacts that follow each other ever faster, and derivatives.

An impact changes the velocities along its force, ``v+ = v - w (u - u+) / (e.w)`` with ``w = M^-1 d``, the
rate u of the deflection before it, and the rate u+ after it that the law gives. An impulse is larger than any force of
friction, so what sticks may slip from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.chatter import Chatter, Stop, sum_chatter
from gapwalk.flow.dry_derivatives import depth_changes
from gapwalk.flow.dry_switches import DrySwitches
from gapwalk.flow.event_rule import pass_event
from gapwalk.flow.forces import Angles, accelerations
from gapwalk.flow.mode_switches import ModeSwitches
from gapwalk.model.coefficients import ContactSlots

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
        """Reset the state at an impact on the stop of a switch, and transform its derivatives.

        Impacts that would last together for a moment only are summed up: the contact is held from here on. Their
        impulses act along one direction, so that leaves an error of the second order of that time.
        """
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
        """Return where all impacts to come on a stop, or those before the next place, end.

        None if they do not, if they are few, or if something else happens meanwhile.
        """
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
        dry.state[: 2 * n] = rest.state
        if dry.columns:
            dry.rows()[:] = rest.changes
        else:
            dry.state[2 * n : 2 * n + 2 * n][: len(dry.state) - 2 * n] += rest.integrals[: len(dry.state) - 2 * n]
        dry.after_impact(rest.theta, [rest.reaction] * rest.ends)
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
