"""Friction that slips, sticks or turns round alone: where nothing else is held, and nothing else changes its mode.

This is how nearly all events of friction are, thousands in a walk. Their outcome is known in closed form, from one
evaluation of the forces. Where several contacts are held or change together, `gapwalk.flow.dry_switches` decides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.dry_derivatives import margin_growth, rate_changes
from gapwalk.flow.dry_state import DryState, Kink, Readings, SlipEvent, largest
from gapwalk.flow.equations import Equations

SETTLING = 1e-7
"""Radians after a change within which a guard of the new mode vanishes by rounding."""
BARELY = 1e-6
"""Share of its bound by which a force may differ from it for a stick or slip to be too brief."""
TURNS = 1e-3
"""Share of the accelerations below which one may turn at once, so that slip only pauses; see `_slow`."""
LATER = 1e-4
"""Radians after which an acceleration decides that vanishes now."""
UNSEEN = 1e-13
"""Share of its limit, or of the velocities, by which an extension or a slip rate may be off."""
_TOGETHER = 1e-9  # radians within which two slip rates vanish together
_MOMENT = 1e-6  # radians over which a force shows how fast it leaves its bound

Array = NDArray[np.float64]


class Push(NamedTuple):
    """Effects of a unit of the force of rigid friction.

    Attributes
    ----------
    moved : shape (n,)
        Accelerations against which it acts.
    on_itself
        That of its own deflection.
    stopping : shape (n,)
        Change of the velocities by which the rate of its deflection changes by 1.
    vector : shape (n,)
        Its deflection vector.
    sways
        True if a displacement is added to its deflection.
    """

    moved: Array
    on_itself: float
    stopping: Array
    vector: Array
    sways: bool


class LoneFriction(DryState):
    """Control of friction that changes its mode alone.

    Parameters
    ----------
    equations
        The equations of the integrator.

    Attributes
    ----------
    unseen
        Share of its limit by which the force of a spring in series may be off where its slip only pauses.
    log
        The slip events since the start, which begin with the modes at the start.
    kinks
        The instants since the start at which friction ceased to slip in one direction, or an impact occurred.
    """

    def __init__(self, equations: Equations) -> None:
        super().__init__(equations)
        self.unseen = UNSEEN
        self.log: list[SlipEvent] = []
        self.kinks: list[Kink] = []
        self._begun = [0.0] * len(self.slots)
        self._pushes: tuple[bytes, dict[int, Push]] | None = None  # with the coefficients for which they are

    def _stick(self, place: int, theta: float) -> None:
        self.slips[place], self.sticks[place], self._begun[place] = 0, True, theta

    def _slip(self, place: int, side: int, theta: float) -> None:
        self.slips[place], self.sticks[place], self._begun[place] = side, False, theta

    def _lets_go_alone(self, place: int) -> bool:
        """Return True if rigid friction sticks, and slips with a force that does not jump and moves nothing else."""
        number = self.reaction_of[place]
        if self.held != (number,) or self.sign_of or self._springs:
            return False
        return not self.columns or float(self.base[self.slots[place].numbers["static"]]) == 1.0

    def _turns_alone(self, place: int, direction: int, theta: float) -> bool:
        """Turn rigid friction round, or let it stick, where its slip rate vanishes and nothing else is held or stops.

        This is `_stop` in closed form: with the acceleration ``a`` of the deflection and its change ``EW`` by a unit of
        force, the force that sticking needs exceeds the force in slip by ``a / EW``. Return False if it decides
        nothing.
        """
        number, side = self.reaction_of[place], self.slips[place]
        if self.held or self._springs or number is None or not side:
            return False
        if theta - self._begun[place] <= SETTLING and direction != -side:
            return True  # its rate begins at 0
        # nothing but plain numbers of the values that decide: this happens at nearly every event
        n, columns, first, push = self.n, self._columns_end, self._columns_end + 3 * place, self._push_of(place)
        found = self._values(theta)
        accelerations = self.entry.table[:n].dot(found[:columns])
        rate, limit, bound = found[first : first + 3].tolist()
        acceleration = push.vector.dot(accelerations).item()
        if push.sways:
            acceleration += self._swaying(self.equations.dry[place], theta)
        turning = side * acceleration
        if turning > 0.0:
            return True  # its rate only begins to grow
        if -turning <= self._slow(accelerations, found[: 2 * n]) or not bound > 0.0 or not push.on_itself > 0.0:
            return False
        needed = side * limit + acceleration / push.on_itself
        beyond = abs(needed) / bound - 1.0
        if abs(beyond) < 2.0 * BARELY or side * needed > bound:
            return False
        if len(self.slots) > 1:
            now = self.read(theta)
            if any(other != place and self._stops_too(other, now, theta) for other in range(len(self.slots))):
                return False
        # accelerations jump where it turns round, and what comes later contributes what they did meanwhile
        turns = beyond > 0.0
        share, jump = (2.0 * side * limit, push.moved) if turns else (-acceleration, push.stopping)
        if self.columns:
            changes = rate_changes(self, self.equations.dry[place], theta)
            self.velocity_rows += changes[:, None] * ((share / acceleration) * jump)
        else:
            velocities, positions = found[n : 2 * n], found[:n]
            turning = accelerations, accelerations + share * jump
            self.kinks.append(Kink(theta, positions, (velocities, velocities), turning))
        if not turns:
            self.state[n : 2 * n] -= rate * push.stopping
        self._change_alone(place, -side if turns else 0, theta)
        return True

    def _slow(self, accelerations: Array, moved: Array | None = None) -> float:
        """Return the acceleration below which slip may turn round at once, by what the velocities need in a period.

        Those of the moment alone do not tell: where one coordinate moves, the slip rate is its only velocity. `moved`
        are positions and velocities, if they are at hand.
        """
        return TURNS * max(largest(accelerations), self.speed(moved) / self.base.item(0))

    def _soon(self, now: Readings, theta: float) -> Readings:
        """Return the values a moment later, under the present modes."""
        kept, step = self.state[: self.size].copy(), LATER * float(self.base[0])
        self.state[: self.size] += step * np.concatenate((now.velocities, now.accelerations, now.extending))
        later = self.read(theta + LATER)
        self.state[: self.size] = kept
        return later

    def _only_pauses(self, place: int, turning: float, theta: float, now: Readings) -> bool:
        """Return True if friction whose slip rate vanishes would slip on before rounding shows that it sticks.

        `turning` is the acceleration in the direction of slip. If slip ended for such a moment, as next to a point of
        grazing-sliding, the force would leave its bound by rounding only, and its return could be missed.
        """
        if not -self._slow(now.accelerations) < turning < 0.0:
            return False
        later = self.slips[place] * self.slip_acceleration(place, self._soon(now, theta), theta + LATER)
        bend = (later - turning) / (LATER * float(self.base[0]))
        if self.memory_of[place] is None:
            return bend > 0.0 and 0.5 * turning**2 < UNSEEN * self.speed() * bend
        away = 2.0 / 3.0 * abs(turning) ** 3
        return bend > 0.0 and self.stiffness(place) * away < self.unseen * now.friction[place][1] * bend**2

    def _only_twitches(self, place: int, theta: float) -> bool:
        """Return True if friction whose force reaches its bound would stick again before rounding shows that it slips.

        Such a slip, as next to a point of adding-sliding, ends so soon that its end could be missed. With the growth
        ``g`` of the force beyond its bound and its change ``-b`` over the angle, the slip rate is ``2 g^3 / (3 b^2)``
        at most, by the acceleration per force.
        """
        if self._grows_surely(place, theta):
            return False
        now, turn = self.read(theta), float(self.base[0])
        growth = margin_growth(self, place, now, theta) * turn
        if not 0.0 < growth < TURNS * now.friction[place][2]:
            return False
        kept, later = self.state[: self.size].copy(), theta + LATER
        rates = np.concatenate((now.velocities, now.accelerations, now.extending))
        self.state[: self.size] += LATER * turn * rates
        bend = (growth - margin_growth(self, place, self.read(later), later) * turn) / LATER
        self.state[: self.size] = kept
        most = self._push_of(place).on_itself * turn * 2.0 * growth**3
        return bend > 0.0 and most < 3.0 * UNSEEN * self.speed() * bend**2

    def _grows_surely(self, place: int, theta: float) -> bool:
        """Return True if a force at its bound leaves it fast, by its difference over a moment: exact it costs more."""
        number, now, given = self.reaction_of[place], self._values(theta), self._given
        assert number is not None
        n, columns, table, first = self.n, self._columns_end, self.entry.table, self._columns_end + 3 * place + 2
        rates = np.concatenate((now[n : 2 * n], table[:n].dot(now[:columns]), now[self._friction_end :]))
        given[: self.size] += (_MOMENT * self.base.item(0)) * rates
        given[self.size] += _MOMENT
        later, row = self._read(given), table[n + number]
        force, then = row.dot(now[:columns]).item(), row.dot(later[:columns]).item()
        bound, after = now.item(first), later.item(first)
        growth = abs(then) - abs(force) - (after - bound)
        return force * then > 0.0 and abs(growth) > 2.0 * TURNS * bound * _MOMENT

    def _change_alone(self, place: int, side: int, theta: float) -> None:
        """Let one friction slip to a side (0: stick) where nothing else is held."""
        number = self.reaction_of[place]
        if not side and number is not None:
            self.slips[place], self.sticks[place] = 0, True
            self.hold((number,))
        else:
            self._slip(place, side, theta)
            if self.held:
                self.hold(())
        self.apply()
        self.log.append(SlipEvent(theta, self.equations.dry[place], side))

    def _push_of(self, place: int) -> Push:
        """Return what a unit of the force of rigid friction does, by its place."""
        if self._pushes is None or self._pushes[0] != self._numbers[0]:
            self._pushes = self._numbers[0], {}
        known = self._pushes[1].get(place)
        if known is None:
            slots = self.slots[place]
            moved = self.base[slots.force]
            on_itself = float(moved.dot(self.base[slots.deflection]))
            stopping = moved / on_itself if on_itself else moved
            known = Push(moved, on_itself, stopping, self.vectors[self.equations.dry[place]], slots.sway is not None)
            self._pushes[1][place] = known
        return known

    def _stops_too(self, place: int, now: Readings, theta: float) -> bool:
        """Return True if the slip rate of friction that slips vanishes at the same time as an event."""
        if not self.slips[place] or theta - self._begun[place] <= SETTLING:
            return False
        rate, change = now.friction[place][0], self.slip_acceleration(place, now, theta)
        return abs(rate) <= _TOGETHER * abs(change) * float(self.base[0]) and self.slips[place] * change < 0.0

    def kink(self, before: Readings, theta: float, after: Readings | None = None) -> None:
        """Record an instant at which velocities or accelerations jump."""
        after = after or self.read(theta)
        velocities, turning = (before.velocities, after.velocities), (before.accelerations, after.accelerations)
        self.kinks.append(Kink(theta, self.state[: self.n].copy(), velocities, turning))

    def _report(self, before: list[int], theta: float) -> None:
        """Log the modes that have changed."""
        for contact, old, new in zip(self.equations.dry, before, self.slips, strict=True):
            if old != new:
                self.log.append(SlipEvent(theta, contact, new))
