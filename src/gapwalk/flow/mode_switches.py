"""Switches besides those of the stages: modes of laws, which guards set, and levels, which change at known angles.

The force is continuous where a guard vanishes, so derivatives of the motion pass it unchanged. Where friction sticks,
the guard of ``abs(v)`` vanishes all the time: such a mode waits until something slips. Where a level changes,
the force jumps at an angle that does not depend on the state: only sensitivities to that angle change.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.dry_switches import DrySwitches
from gapwalk.flow.equations import EDGE, Equations
from gapwalk.flow.forces import Angles, Dry, accelerations, is_at_high, stages_of
from gapwalk.flow.lone_friction import LATER, NEAR, SETTLING, STILL

_ON = 1e-13  # share of the size of a guard within which a motion begins on it
_NEAR = 1e-9  # the same for its end
_SAME = 1e-12  # radians within which an angle at which a level changes is the start or the end of an interval
_TOGETHER = 1e-9  # radians within which two guards vanish together
_STEP = 1e-150  # of the complex step
_AHEAD = 1e-3  # share of the reach of the Taylor series at which guards decide that vanish at the start


class ModeSwitches:
    """Control of the modes and levels of one compiled integrator.

    Attributes
    ----------
    kinks
        The angles and states at which guards vanished since the start.
    """

    def __init__(self, equations: Equations) -> None:
        self.equations, self.n = equations, equations.layout.structure.size
        self.mode_count, self.cycle_count = len(equations.modes), len(equations.layout.cycles)
        self._modes, self._levels = equations.first_mode, equations.first_level

    def attach(self, integrator: Any) -> None:
        """Attach to the integrator's state and parameters (live views)."""
        self._integrator, self._state, self._parameters = integrator, integrator.state, integrator.pars

    def start(self, coefficients: NDArray[np.float64], theta: float, unit: float) -> None:
        """Set all modes and levels for the state in the integrator, with lengths in multiples of `unit`."""
        self.coefficients, self._unit = coefficients, unit
        self.kinks: list[tuple[float, NDArray[np.float64]]] = []
        if self.cycle_count:
            self._set_levels(theta)
        if self.mode_count:
            found = self._contact_modes(theta, self._state[: 2 * self.n])
            self._parameters[self._modes : self._modes + self.mode_count] = [mode for mode, _ in found]

    def refresh(self, theta: float, closed: list[list[bool]]) -> None:
        """Set the modes again after a stage closed or opened, for guards of laws with stages may jump there."""
        found = self._contact_modes(theta, self._state[: 2 * self.n], closed)
        largest = max(abs(guard) for _, guard in found)
        for place, (mode, guard) in enumerate(found):
            if abs(guard) > _NEAR * largest:
                self._parameters[self._modes + place] = mode

    def _contact_modes(
        self,
        theta: Any,
        state: NDArray[Any],
        closed: list[list[bool]] | None = None,
        decide: Callable[[int, Any], Any] | None = None,
    ) -> list[tuple[bool, Any]]:
        """Return the modes of all laws at a state by their guards, and the values of these, real or complex.

        `decide` returns the value of a mode from its number and its guard; by default the sign of the guard decides.
        """
        n, layout, found = self.n, self.equations.layout, []
        angles = Angles(layout, self.coefficients, theta, unit=self._unit)
        for index, slots in enumerate(layout.contacts):
            law = slots.form.law
            if not law.mode_count:
                continue
            unit = self._unit if law.is_formula else 1.0
            moves = [
                (
                    unit * (state[:n] @ self.coefficients[vector] + angles.sway(slots, place)),
                    unit * (state[n:] @ self.coefficients[vector] + angles.sway(slots, place, 1)),
                )
                for place, vector in enumerate(slots.deflections)
            ]
            edge = {"_edge": EDGE * unit} if law.is_formula else {}
            first, own = len(found), None
            if decide is not None:
                own = partial(lambda first, mode, guard: decide(first + mode, guard), first)
            stages = stages_of(slots, angles, moves, None if closed is None else closed[index], edge, own)
            guards = law.guards(moves[0][1], stages, angles.named(slots.numbers, slots.waves) | edge)
            found += [(bool(mode), guard) for mode, guard in zip(stages.modes, guards, strict=True)]
        return found

    def leave(self, theta: float, dry: DrySwitches) -> None:
        """Set the modes whose guards vanish at the start of a motion, by the motion just after; `dry` has begun."""
        self._waits, self._left, self._present = [False] * self.mode_count, [-math.inf] * self.mode_count, ()
        self.wait(theta, dry)
        self._integrator.step(max_delta_t=0.0, write_tc=True)
        state, series = self._state[: 2 * self.n], self._integrator.tc[: 2 * self.n]
        ahead = _AHEAD * taylor_reach(series)
        after = self._contact_modes(theta + ahead, series @ ahead ** np.arange(series.shape[1]))
        for place, ((_, guard), (late, size)) in enumerate(zip(self._contact_modes(theta, state), after, strict=True)):
            if abs(guard) <= _ON * abs(size):
                self._parameters[self._modes + place] = late

    def wait(self, theta: float, dry: DrySwitches) -> None:
        """Let those modes wait whose guards vanish for as long as what is held stays so, where friction has changed.

        Such a guard depends on what is held alone, and the force does not depend on its mode. Another guard that
        vanishes is decided by the motion a moment later: where friction has just let go, or has turned round with
        hardly any acceleration, all that decides now is rounding.
        """
        present = dry.held, *dry.slips
        if present == self._present or not self.equations.may_wait:
            return
        begins, self._present = not self._present, present
        now, still = dry.read(theta), self._still(theta, dry)
        self._waits = [zero and stays for zero, stays in still]
        first = self.equations.first_waiting
        self._parameters[first : first + self.mode_count] = self._waits
        leaving = [mode for mode, (zero, stays) in enumerate(still) if zero and not stays]
        if begins or not leaving:
            return
        n, step = self.n, LATER * float(self.coefficients[0])
        turning = 0.5 * (now.accelerations + dry.soon(now, theta).accelerations)
        later = self._state[: 2 * n] + step * np.concatenate((now.velocities, turning))
        found = self._contact_modes(theta + LATER, later, dry.closed or None)
        for mode in leaving:
            self._parameters[self._modes + mode], self._left[mode] = found[mode][0], theta

    def _still(self, theta: float, dry: DrySwitches) -> list[tuple[bool, bool]]:
        """Return for each mode whether its guard vanishes, and whether it cannot change while what is held stays so."""
        n, now, state, closed = self.n, dry.read(theta), self._state[: 2 * self.n], dry.closed or None
        rate, speed = float(self.coefficients[0]), dry.speed()
        turning = max(float(np.abs(now.accelerations).max()), speed / rate)
        along = 1j * _STEP * rate * np.concatenate((now.velocities, now.accelerations))
        found = [guard for _, guard in self._contact_modes(theta + 1j * _STEP, state + along, closed)]
        moved = [self._contact_modes(theta, state + 1j * _STEP * unit, closed) for unit in np.eye(2 * n)]
        still = []
        for mode, guard in enumerate(found):
            slopes = np.imag([each[mode][1] for each in moved]) / _STEP
            size, growth = (np.abs(slopes) @ np.repeat(each, n) for each in ([speed * rate, speed], [speed, turning]))
            stays = bool(dry.held) and abs(np.imag(guard)) / _STEP <= NEAR * rate * growth
            stays = stays and all(dry.keeps_still(each) for each in (slopes[:n], slopes[n:]) if each.any())
            still.append((bool(abs(np.real(guard)) <= STILL * size), stays))
        return still

    def are_right(self) -> bool:
        """Return True if the modes are those of the guards at the present state, unless it is on one of them."""
        found = self._contact_modes(self._integrator.time, self._state[: 2 * self.n])
        modes = self._parameters[self._modes : self._modes + self.mode_count].tolist()
        largest = max(abs(guard) for _, guard in found)
        return all(
            mode == now or waits or abs(guard) <= _NEAR * largest
            for (mode, guard), now, waits in zip(found, modes, self._waits, strict=True)
        )

    def set_mode(self, mode: int, direction: int) -> None:
        """Set a mode whose guard changes its sign in a direction; a guard that only touches 0 changes nothing."""
        if self._integrator.time - self._left[mode] <= SETTLING:
            return  # it begins at 0, and rounding may be a crossing until it has left
        if direction:
            self._parameters[self._modes + mode] = direction > 0
        self.kinks.append((self._integrator.time, self._state[: 2 * self.n].copy()))

    def set_simultaneous(self, closed: list[list[bool]] | None, mode: int = -1, dry: Dry | None = None) -> None:
        """Set the modes, other than one, whose guards vanish at the same time as an event: it alone was reported.

        Two forces with ``abs(v)`` of the same coordinate have two guards that always vanish together, and a guard that
        depends on a mode may vanish until that mode changes. `closed` has for each contact which of its stages are
        closed, and `dry` the modes of friction.
        """
        n, theta, levels = self.n, self._integrator.time, self._parameters[self._levels :][: self.cycle_count] > 0.5
        state = self._state[: 2 * n]
        q, v = state[:n], state[n:]
        layout = self.equations.layout
        turning = accelerations(layout, self.coefficients, theta, q, v, closed, levels, self._unit, dry)
        rates = self.coefficients[0] * np.concatenate((v, turning))
        modes = self._parameters[self._modes : self._modes + self.mode_count]

        def decide(other: int, guard: Any) -> float:
            slope = float(np.imag(guard)) / _STEP
            # a guard without a slope is left by a higher derivative, which decided at the start
            settles = other == mode or theta - self._left[other] <= SETTLING
            if not settles and slope and abs(float(np.real(guard))) <= _TOGETHER * abs(slope):
                modes[other] = slope > 0.0
            return float(modes[other])

        self._contact_modes(theta + 1j * _STEP, state + 1j * _STEP * rates, closed, decide)

    def jumps_between(self, start: float, stop: float) -> list[tuple[float, int, bool]]:
        """Return the angles at which cycles of two levels change, with their numbers, and True if to the high one."""
        found = []
        for number, cycle in enumerate(self.equations.layout.cycles):
            length = 2.0 * math.pi / cycle.order
            for slot, rises in ((cycle.up, True), (cycle.down, False)):
                first = float(self.coefficients[slot])
                low, high = math.ceil((start - first) / length) - 1, math.floor((stop - first) / length) + 1
                angles = (first + k * length for k in range(low, high + 1))
                # a change at the start belongs to this interval, one at the end to the next
                found += [
                    (max(angle, start), number, rises) for angle in angles if start - _SAME <= angle < stop - _SAME
                ]
        return sorted(found)

    def _set_levels(self, theta: float) -> None:
        """Set the levels of all cycles just before a change at an angle, if there is one."""
        cycles = self.equations.layout.cycles
        self._parameters[self._levels : self._levels + len(cycles)] = [
            is_at_high(cycle, self.coefficients, theta - 2.0 * _SAME) for cycle in cycles
        ]

    def change_level(
        self,
        theta: float,
        number: int,
        rises: bool,
        columns: NDArray[np.float64],
        directions: NDArray[np.float64],
        closed: list[list[bool]],
        dry: Dry | None = None,
    ) -> None:
        """Change a level at its angle; transform the sensitivities to what moves that angle.

        The angle does not depend on the state, so ``g_y`` is 0 and the transition matrix continues.

        Shapes: `columns` (columns, 2n); `directions` (directions, number of coefficients).
        """
        layout, n = self.equations.layout, self.n
        cycle, place = layout.cycles[number], self._levels + number
        moves = directions[:, cycle.up if rises else cycle.down]
        if moves.any():
            q, v = self._state[:n], self._state[n : 2 * n]
            levels = [bool(each) for each in self._parameters[self._levels : self._levels + self.cycle_count]]
            sides = []
            for level in (not rises, rises):
                levels[number] = level
                sides.append(accelerations(layout, self.coefficients, theta, q, v, closed, levels, self._unit, dry))
            slip = float(self.coefficients[0]) * (sides[1] - sides[0])
            columns[len(columns) - len(moves) :, n : 2 * n] -= np.outer(moves, slip)
        self._parameters[place] = rises


def taylor_reach(series: NDArray) -> float:
    """Return the time for which Taylor series hold: the step of Jorba and Zou (2005, Exp. Mathematics 14, 99-117)."""
    order = series.shape[1] - 1
    size, last = max(1.0, float(np.abs(series[:, 0]).max())), float(np.abs(series[:, -1]).max())
    before = float(np.abs(series[:, -2]).max())
    radii = [(size / tail) ** (1.0 / power) for tail, power in ((last, order), (before, order - 1)) if tail > 0.0]
    return min([1.0, *(radius / math.e**2 for radius in radii)])


def taylor_beginning(series: NDArray, distance: float, shortest: float, longest: float) -> tuple[float, float]:
    """Return when a motion has covered a distance by its Taylor series (without the constant), and its position.

    Times from `shortest` on are tried. If it does not cover the distance, they are those where the series ceases to
    hold; 0, 0 if it does not move.
    """
    powers, time, depth = np.arange(1.0, len(series) + 1.0), min(shortest, longest), 0.0
    if not series.any():
        return 0.0, 0.0
    while True:
        depth = float(series @ time**powers)
        if abs(depth) > distance or time >= longest:
            return time, depth
        time = min(2.0 * time, longest)
