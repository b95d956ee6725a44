"""Friction that slips, sticks or turns round alone: where nothing else is held, and nothing else changes its mode.

This is how nearly all events of friction are, thousands in a walk. Their outcome is known in closed form, from one
evaluation of the forces. Where several contacts are held or change together, `gapwalk.flow.friction_switches` decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.equations import Equations
from gapwalk.flow.friction_state import (
    DryState,
    Kink,
    Readings,
    SlipEvent,
    extension_changes,
    largest,
    margin_growth,
    rate_changes,
)

SETTLING = 1e-7
"""Radians after a change within which a guard of the new mode vanishes by rounding."""
BARELY = 1e-6
"""Share of its bound by which a force may differ from it for a stick or slip to be too brief."""
TURNS = 1e-3
"""Share of the accelerations below which one may turn at once, so that slip only pauses; see `_slow`."""
STILL = 1e-12
"""Share of the size of the velocities below which a slip rate is 0."""
NEAR = 1e-8
"""Share of its size below which a value that decides vanishes by rounding."""
PAUSE = 1e-3
"""Radians that the stick of a spring lasts at least which is no pause in its slip."""
LATER = 1e-4
"""Radians after which an acceleration decides that vanishes now."""
UNSEEN = 1e-13
"""Share of its limit, or of the velocities, by which an extension or a slip rate may be off."""
VALUES = 7
"""Number of values of `Equations.decisions` for each friction."""
ON = 1e-12
"""Share of a limit within which a force is at it."""
_CLEAR = 1e-3  # share of the size of the velocities above which a slip rate keeps its sign for far more than `SETTLING`
_TOGETHER = 1e-9  # radians within which two slip rates vanish together

Array = NDArray[np.float64]


class Push(NamedTuple):
    """Effects of a unit of the force of rigid friction."""

    moved: Array  #: shape (n,): Accelerations against which it acts.
    on_itself: float  #: That of its own deflection.
    stopping: Array  #: shape (n,): Change of the velocities by which the rate of its deflection changes by 1.
    #: turns, stops: shape (n, n): For changes of the velocities, that of the slip rate times what a unit of the force
    #: moves, or times `stopping`.
    turns: Array
    stops: Array


class LoneFriction(DryState):
    """Control of friction that changes its mode alone.

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
        self._brief = [False] * len(self.slots)  # of springs that stick: whether that may be too short to be told
        self._pushes: tuple[bytes, dict[int, Push]] | None = None  # with the coefficients for which they are

    def _stick(self, place: int, theta: float) -> None:
        self.slips[place], self.sticks[place], self._begun[place] = 0, True, theta

    def _slip(self, place: int, side: int, theta: float) -> None:
        self.slips[place], self.sticks[place], self._begun[place] = side, False, theta

    def _sticks_alone(self, reactions: list[int], theta: float) -> bool:
        """Hold the one rigid friction of a system, by its reaction, and return True if it stays within its bound."""
        if len(self.slots) != 1 or self.sign_of or self._springs:
            return False
        self.slips[0], self.sticks[0] = 0, True
        self.hold(reactions)
        self.apply()
        _, _, bound, _, reaction, *_ = self.decide(theta)
        return bound > 0.0 and abs(reaction) / bound - 1.0 <= ON

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
        n, found, push = self.n, self.decide(theta), self._push_of(place)
        rate, limit, bound, acceleration = found[VALUES * place : VALUES * place + 4]
        turning = side * acceleration
        if turning > 0.0:
            return True  # its rate only begins to grow
        if self._is_slow(-turning, found) or not bound > 0.0 or not push.on_itself > 0.0:
            return False
        needed = side * limit + acceleration / push.on_itself
        beyond = abs(needed) / bound - 1.0
        if abs(beyond) < 2.0 * BARELY or side * needed > bound:
            return False
        if len(self.slots) > 1 and self._others_stop(place, found, theta):
            return False
        # accelerations jump where it turns round, and what comes later contributes what they did meanwhile
        turns = beyond > 0.0
        share = 2.0 * side * limit if turns else -acceleration
        if not self.columns:
            moved = self._own.copy()
            velocities, before = moved[n : 2 * n], np.array(found[-n:])
            after = before + share * (push.moved if turns else push.stopping)
            self.kinks.append(Kink(theta, moved[:n], (velocities, velocities), (before, after)))
        elif self.is_moved[contact := self.equations.dry[place]]:
            changes = rate_changes(self, contact, theta) * (share / acceleration)
            self.velocity_rows += changes[:, None] * (push.moved if turns else push.stopping)
        else:
            changes = self.velocity_rows.dot(push.turns if turns else push.stops)
            changes *= share / acceleration
            self.velocity_rows += changes
        if not turns:
            self.state[n : 2 * n] -= rate * push.stopping
        self._change_alone(place, -side if turns else 0, theta)
        return True

    def _spring_changes_alone(self, place: int, second: bool, direction: int, theta: float) -> bool:
        """Let a spring in series slip at its limit, or stick where its slip ends, while nothing else changes."""
        # Its force does not jump, and its limit is constant: changes of the motion go on, but for those of its
        # extension, which are those of the limit in slip. Return False if it decides nothing.
        memory, side = self.memory_of[place], self.slips[place]
        if memory is None or self.held or self.sign_of or not self.has_constant_limit[place]:
            return False
        if side and direction == side:
            return False
        if side and theta - self._begun[place] <= SETTLING:
            return True  # its rate begins at 0
        if not side and len(self.slots) == 1 and self.moves(place) == (-1 if second else 1):
            self._slip_at_limit(place, memory, -1 if second else 1, theta)
            return True
        n, found = self.n, self.decide(theta)
        rate, _, _, acceleration = found[VALUES * place : VALUES * place + 4]
        if len(self.slots) > 1 and self._others_stop(place, found, theta):
            return False
        if side:
            turning = side * acceleration
            if turning > 0.0:
                return True  # its rate only begins to grow
            if self._is_slow(-turning, found):
                return False
            if not self.columns:
                moved = self._own.copy()
                velocities, turned = moved[n : 2 * n], np.array(found[-n:])
                self.kinks.append(Kink(theta, moved[:n], (velocities, velocities), (turned, turned)))
            self._change_alone(place, 0, theta)
            self._brief[place] = False
            return True
        side, leading = -1 if second else 1, rate
        # of a share of the largest velocity less than that of the length of the vector
        if abs(rate) <= max(SETTLING * self.base.item(0) * abs(acceleration), STILL * found[-n - 1]):
            leading = acceleration
            # of a single coordinate that has just been let go, only the velocity tells that this is rounding
            if abs(acceleration) <= NEAR * max(*map(abs, found[-n:]), self.speed() / self.base.item(0)):
                return False
        if side * leading <= 0.0:  # slip has just ended at the limit, and the force leaves it
            return theta - self._begun[place] <= PAUSE or direction < 0
        self._slip_at_limit(place, memory, side, theta)
        for other in (
            self._springs if len(self.slots) > 1 else ()
        ):  # of two events at the same time only one is reported
            if (way := self.moves(other)) and self._is_at_limit(other, way):
                self._slip_at_limit(other, self.memory_of[other] or 0, way, theta)
        return True

    def _is_at_limit(self, place: int, side: int) -> bool:
        """Return True if a spring in series sticks with its force at its constant limit on a side, but for rounding."""
        if not (self.sticks[place] and self.has_constant_limit[place]):
            return False
        limit = self.base.item(self.slots[place].numbers["limit"])
        return side * self.stiffness(place) * self._own.item(self.memory_of[place] or 0) >= limit * (1.0 - UNSEEN)

    def moves(self, place: int) -> int:
        """Return the side to which a deflection moves so fast that no acceleration need be known; 0 if it may not."""
        factors = self.rate_factors[place]
        if factors is None:
            return 0
        numbers = self._own.tolist()
        rate = sum([factor * numbers[i] for i, factor in factors])
        if abs(rate) <= _CLEAR * self._speed_of(numbers):
            return 0
        return 1 if rate > 0.0 else -1

    def _slip_at_limit(self, place: int, memory: int, side: int, theta: float) -> None:
        """Let a spring in series slip to a side, with the extension of its constant limit."""
        self._own[memory] = side * self.base.item(self.slots[place].numbers["limit"]) / self.stiffness(place)
        if self.columns:
            self._rows[:, memory] = side * extension_changes(self, place, theta) if self.is_strained[place] else 0.0
        self._change_alone(place, side, theta)
        self._begun[place] = theta - 1.0  # its rate does not begin at 0

    def _is_slow(self, turning: float, found: list[float]) -> bool:
        """Return True if slip may turn round at once with a deceleration of its rate, by the values that decide."""
        n = self.n
        # the length of a vector is its largest number or more: usually it tells, and costs nothing
        if turning > TURNS * max(*map(abs, found[-n:]), found[-n - 1] / self.base.item(0)):
            return False
        return turning <= self._slow(found[-n:])

    def _slow(self, accelerations: list[float]) -> float:
        """Return the acceleration below which slip may turn round at once, by what the velocities need in a period."""
        # Those of the moment alone do not tell: where one coordinate moves, the slip rate is its only velocity.
        return TURNS * max(*map(abs, accelerations), self.speed() / self.base.item(0))

    def soon(self, now: Readings, theta: float) -> Readings:
        """Return the values a moment later, under the present modes."""
        kept, step = self.state[: self.size].copy(), LATER * float(self.base[0])
        self.state[: self.size] += step * np.concatenate((now.velocities, now.accelerations, now.extending))
        later = self.read(theta + LATER)
        self.state[: self.size] = kept
        return later

    def _only_pauses(self, place: int, turning: float, theta: float, now: Readings) -> bool:
        """Return True if friction whose slip rate vanishes would slip on before rounding shows that it sticks."""
        # `turning` is the acceleration in the direction of slip. If slip ended for such a moment, as next to a point of
        # grazing-sliding, the force would leave its bound by rounding only, and its return could be missed.
        if not -self._slow(now.accelerations.tolist()) < turning < 0.0:
            return False
        later = self.slips[place] * self.slip_acceleration(place, self.soon(now, theta), theta + LATER)
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
        *_, bound, _, reaction, growth, widening = self.decide(theta)[VALUES * place : VALUES * (place + 1)]
        growth = math.copysign(growth, growth * reaction) - widening
        if not 0.0 < growth < TURNS * bound:
            return False
        now, turn = self.read(theta), float(self.base[0])
        kept, later = self.state[: self.size].copy(), theta + LATER
        rates = np.concatenate((now.velocities, now.accelerations, now.extending))
        self.state[: self.size] += LATER * turn * rates
        bend = (growth - margin_growth(self, place, self.read(later), later) * turn) / LATER
        self.state[: self.size] = kept
        most = self._push_of(place).on_itself * turn * 2.0 * growth**3
        return bend > 0.0 and most < 3.0 * UNSEEN * self.speed() * bend**2

    def _change_alone(self, place: int, side: int, theta: float) -> None:
        """Let one friction slip to a side (0: stick) where nothing else is held."""
        number = self.reaction_of[place]
        self.slips[place], self.sticks[place], self._begun[place] = side, not side, theta
        if number is not None and (self.held or not side):
            self.hold(() if side else (number,))
            self.apply()
        else:
            self.apply_alone(place)
        self.log.append(SlipEvent(theta, self.equations.dry[place], side))

    def _push_of(self, place: int) -> Push:
        """Return the effect of a unit of the force of rigid friction, by its place."""
        if self._pushes is None or self._pushes[0] != self._numbers[0]:
            self._pushes = self._numbers[0], {}
        known = self._pushes[1].get(place)
        if known is None:
            slots = self.slots[place]
            moved = self.base[slots.force]
            on_itself = float(moved.dot(self.base[slots.deflection]))
            stopping, vector = moved / on_itself if on_itself else moved, self.base[slots.deflection]
            known = Push(moved, on_itself, stopping, np.outer(vector, moved), np.outer(vector, stopping))
            self._pushes[1][place] = known
        return known

    def _stops_too(self, place: int, now: Readings, theta: float) -> bool:
        """Return True if the slip rate of friction that slips vanishes at the same time as an event."""
        if not self.slips[place] or theta - self._begun[place] <= SETTLING:
            return False
        rate = now.friction[place][0]
        # nearly always it is far too fast, whatever its acceleration
        if abs(rate) > _TOGETHER * largest(now.accelerations) * self.spans[place] * self.base.item(0):
            return False
        return self._vanishes(place, rate, self.slip_acceleration(place, now, theta))

    def _vanishes(self, place: int, rate: float, change: float) -> bool:
        """Return True if a slip rate with some change over time vanishes now, and ends slip."""
        return abs(rate) <= _TOGETHER * abs(change) * self.base.item(0) and self.slips[place] * change < 0.0

    def _others_stop(self, place: int, found: list[float], theta: float) -> bool:
        """Return True if the slip rate of other friction vanishes at the same time, by the values that decide."""
        return any(
            other != place
            and self.slips[other]
            and theta - self._begun[other] > SETTLING
            and self._vanishes(other, found[VALUES * other], found[VALUES * other + 3])
            for other in range(len(self.slots))
        )

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
