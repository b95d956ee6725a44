"""Modes of dry friction and of held stops: set at the start of a motion, changed at its events, and checked.

Which contacts are held follows from what they would need: all that may be held are taken as held together, and the one
whose reaction exceeds its bound most is released, until none does.

Method: docs/numerics/flow.md
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.constraints import Constraint
from gapwalk.flow.dry_derivatives import (
    add_delay,
    depth_changes,
    extension_changes,
    margin_changes,
    margin_growth,
    project,
    rate_changes,
)
from gapwalk.flow.dry_state import Hold, Readings, SlipEvent, largest
from gapwalk.flow.equations import Equations
from gapwalk.flow.lone_friction import BARELY, LATER, NEAR, ON, PAUSE, SETTLING, STILL, UNSEEN, VALUES, LoneFriction

_BEYOND = 1e-2  # share of its size by which a motion may begin beyond a rigid stop
_BRIEF = 4e-9  # radians that they must last: two events of one contact are distinct from a quarter of that

Array = NDArray[np.float64]


class DrySwitches(LoneFriction):
    """Control of the modes of friction and of held stops of one compiled integrator.

    Attributes
    ----------
    missed
        True if a force came back within its bound that had never been beyond: slip was missed.
    keeps
        Number of a contact whose friction keeps its mode until the next start; None if there is none.
    """

    def __init__(self, equations: Equations) -> None:
        super().__init__(equations)
        self.keeps: int | None = None
        self._hosts = {self.layout.structure.host(friction) for friction in equations.dry} - {None}
        self.missed = False
        # places of the state that the last event has reset, and whether they follow a limit from there on
        self._forgotten: dict[int, bool] = {}

    def start(self, base: Array, directions: Array, theta: float, unit: float) -> None:
        """Set all modes for the state in the integrator, and begin a new log.

        Parameters are as in `DryState.begin`; `unit` is the unit of length.
        """
        self.log, self.kinks, self._begun, self.keeps = [], [], [theta - 1.0] * len(self.slots), None
        self.hold_log, self._brief = [Hold(theta, ())], [False] * len(self.slots)
        self.unseen, self.missed = UNSEEN, False
        self.begin(base, directions)
        if self.sign_of:
            self._move_within(theta, unit)
        self._restart(theta)
        self.log += [SlipEvent(theta, contact, self.slips[place]) for place, contact in enumerate(self.equations.dry)]

    def _move_within(self, theta: float, unit: float) -> None:
        """Move a state that is a little beyond a stop, as in a step of Newton's method, back to it."""
        for number, sign in self.sign_of.items():
            depth, _, scale = self.gap(number, theta)
            if sign * depth <= 0.0:
                continue
            if sign * depth > _BEYOND * (scale + largest(self.state[: self.n])):
                name = self.layout.contacts[self.layout.structure.reactions[number][0]].form.name
                raise FlowError(
                    f"the motion begins {sign * depth * unit:.3g} beyond the rigid stop {name!r}; begin it where the "
                    "deflection is within the clearance"
                )
            impulse = Constraint(self.layout, self.base, [number]).impulses[:, 0]
            if self.columns:
                self.rows()[:, : self.n] -= np.outer(depth_changes(self, number, theta), impulse)
            self.state[: self.n] -= depth * impulse

    def _touching(self, theta: float, still: float) -> list[int]:
        """Return the reactions of those stops on which the motion is, at rest."""
        found, size = [], largest(self.state[: self.n])
        for number in self.sign_of:
            depth, rate, scale = self.gap(number, theta)
            if abs(depth) <= STILL * (scale + size) and abs(rate) <= still:
                found.append(number)
        return found

    def _restart(self, theta: float) -> None:
        """Decide all modes from the state alone, and project the state on what is held."""
        still = STILL * self.speed() if self.layout.structure.reactions else 0.0
        candidates = self._touching(theta, still) if self.sign_of else []
        for place, number in enumerate(self.reaction_of):
            if number is None:
                continue
            rate = self.rigid_rate(place, theta)
            if abs(rate) <= still:
                candidates.append(number)
            else:
                self.slips[place] = 1 if rate > 0.0 else -1
        if candidates:
            if not self._sticks_alone(candidates, theta):
                self._leave(self._hold(theta, candidates), theta)
            project(self, theta)
        known: Readings | None = None
        for place, memory in enumerate(self.memory_of):
            if memory is not None:
                known = self._begin_memory(place, memory, theta, known)
        self.apply()

    def _leave(self, now: Readings, theta: float) -> None:
        """Open those stops, of the ones that are held at the start, whose force is zero there and then would pull."""
        if not self.sign_of or not self.held:
            return
        zero = NEAR * max(largest(now.accelerations), self.speed() / self.base.item(0))
        doubtful = [each for each in self.held if each in self.sign_of and abs(float(now.reactions[each])) <= zero]
        if not doubtful:
            return
        soon = self.soon(now, theta)
        pulling = [each for each in doubtful if self.sign_of[each] * float(soon.reactions[each]) < 0.0]
        if pulling:
            self._hold(theta, [each for each in self.held if each not in pulling])

    def _begin_memory(self, place: int, memory: int, theta: float, known: Readings | None = None) -> Readings | None:
        """Decide whether a Jenkins element sticks from its extension and slip rate; it is never beyond its limit.

        Return the values at the state, unless that has changed; `known` are those under other modes, if they are known.
        """
        self.slips[place], self.sticks[place] = 0, False
        force = self.stiffness(place) * self._own.item(memory)
        if self.has_constant_limit[place]:  # then the rate does not matter
            now, rate, limit = known, 0.0, self.base.item(self.slots[place].numbers["limit"])
        else:
            now = self.read(theta, known)
            rate, limit, _ = now.friction[place]
        # the contact that presses has just closed
        begins = self._grows(place) and limit <= ON * self.stiffness(place) * largest(self.state[: self.n])
        if limit > 0.0 and abs(force) < limit * (1.0 - ON) and not begins:
            self.sticks[place] = True
            return now
        side = 1 if force > 0.0 else -1
        if limit <= 0.0 or begins:
            side = 0 if not begins else 1 if rate > 0.0 else -1
        self._reset_extension(place, side, theta, limit)
        if side and self._slips_on(place, side, theta):
            self._forgotten[memory] = True
        elif side:
            self._stick(place, theta)
            if begins:
                self._reset_extension(place, 0, theta)
        return None

    def _slips_on(self, place: int, side: int, theta: float, known: Readings | None = None) -> bool:
        """Let friction in series with a spring slip to one side; return True if its slip rate has that direction.

        Where the rate vanishes, the acceleration decides, and where that does too, the acceleration a little later.
        """
        self.slips[place], self.sticks[place] = side, False
        if self.has_constant_limit[place] and (moves := self.moves(place)):
            return moves == side
        if known is None:
            self.apply()
            rate, _, _, change = self.decide(theta)[VALUES * place : VALUES * place + 4]
        else:
            known = self.read(theta, known)
            rate, change = known.friction[place][0], self.slip_acceleration(place, known, theta)
        if abs(rate) > SETTLING * float(self.base[0]) * abs(change) and abs(rate) > STILL * self.speed():
            return side * rate > 0.0
        change = self._leading(self.equations.dry[place], known or self.read(theta), theta)
        return side * change > 0.0

    def _leading(self, contact: int, now: Readings, theta: float) -> float:
        """Return the acceleration of a deflection; where it vanishes, the one a moment later.

        Where a stop or the only friction has just let go, all accelerations are rounding. Those to come tell their
        size, and so do the velocities.
        """
        change = self.acceleration(contact, now, theta)
        vanishes = abs(change) <= NEAR * max(largest(now.accelerations), self.speed() / self.base.item(0))
        if not vanishes and not self.sign_of:
            return change
        later = self.acceleration(contact, self.soon(now, theta), theta + LATER)
        return later if vanishes or abs(change) <= NEAR * abs(later) / LATER else change

    def _grows(self, place: int) -> bool:
        """Return True if the limit of friction is not constant, and the contact that presses is closed."""
        if self.laws[place].by != "normal":
            return False
        host = self.layout.structure.host(self.equations.dry[place])
        return host is not None and any(self.closed[host])

    def _reset_extension(self, place: int, side: int, theta: float, limit: float = 0.0) -> None:
        """Set the extension of a Jenkins element to its limit on one side (0: to zero), with its derivatives."""
        memory = self.memory_of[place]
        assert memory is not None
        if self.columns:
            self.rows()[:, memory] = side * extension_changes(self, place, theta) if side else 0.0
        self.state[memory] = side * limit / self.stiffness(place)
        self._forgotten[memory] = False

    def _hold(
        self, theta: float, candidates: Iterable[int], known: Readings | None = None, pressed: Sequence[int] = ()
    ) -> Readings:
        """Hold those of the candidates that stay within their bounds; the others slip, or open.

        Stops that are `pressed` are held even where their reactions only begin, and have a sign by rounding only.

        Return the values with what is held; `known` are those under other modes, if they are known.
        """
        held, released, back = {*candidates}, list[int](), set[int]()
        self._over: dict[int | None, float] = {}  # share of its bound by which a reaction exceeds it
        while True:
            for number in held:
                if (place := self.friction_of.get(number)) is not None:
                    self.slips[place], self.sticks[place] = 0, True
            self.hold(held)
            known = now = self.read(theta, known)
            worst, excess = -1, 0.0
            for number in self.entry.constraint.independent:
                reaction, place = float(now.reactions[number]), self.friction_of.get(number)
                if place is None:
                    over = np.inf if self.sign_of[number] * reaction < 0.0 and number not in pressed else 0.0
                else:
                    bound = now.friction[place][2]
                    over = abs(reaction) / bound - 1.0 - ON if bound > 0.0 else np.inf
                    self._over[number] = over
                if over > excess:
                    worst, excess = number, over
            if worst < 0:  # where others have let go since, one may not slip after all
                returning = [each for each in released if each not in back and self._returns(each, now, theta)]
                if not returning:
                    self.apply()
                    return now
                held.add(returning[0])
                back.add(returning[0])
                released.remove(returning[0])
                continue
            held.remove(worst)
            released.append(worst)
            if (place := self.friction_of.get(worst)) is not None:
                self._slip(place, 1 if now.reactions[worst] > 0.0 else -1, theta)

    def _returns(self, number: int, now: Readings, theta: float) -> bool:
        """Return True if a contact that was let go at rest accelerates against its slip, or into its stop."""
        place = self.friction_of.get(number)
        side = -self.sign_of[number] if place is None else self.slips[place]
        acceleration = self.acceleration(self.layout.structure.reactions[number][0], now, theta)
        return side * acceleration < -NEAR * largest(now.accelerations)

    def at_slip(self, event: int, direction: int, theta: float) -> None:
        """Change the mode of friction at one of its two events, which happens at an angle."""
        place, second = divmod(event, 2)
        if self.keeps is not None and self.keeps == self.equations.dry[place]:
            return
        if self.memory_of[place] is not None:
            if self._spring_changes_alone(place, bool(second), direction, theta):
                return
        elif self.sticks[place]:
            if direction > 0 or self._only_twitches(place, theta):
                return  # its force is within the bound again, or will be
            if self._lets_go_alone(place):
                self._change_alone(place, -1 if second else 1, theta)
                return
        elif not second and self._turns_alone(place, direction, theta):
            return
        now = self.read(theta)
        for other, memory in enumerate(self.memory_of):  # of two events at the same time only one is reported
            if other != place and memory is not None and self._stops_too(other, now, theta):
                self._at_memory(other, False, -self.slips[other], theta, now)
        if self.memory_of[place] is not None:
            hidden = [
                other
                for other, memory in enumerate(self.memory_of)
                if memory is None and self._stops_too(other, now, theta)
            ]
            self._at_memory(place, bool(second), direction, theta, now)
            if hidden:  # it lets the others stop with it
                self._stop(hidden[0], theta, self.read(theta))
        elif self.sticks[place]:
            self._release(place, -1 if second else 1, theta, now)
        elif not second and (theta - self._begun[place] > SETTLING or direction == -self.slips[place]):
            self._stop(place, theta, now)

    def stop_simultaneous(self, theta: float) -> None:
        """Change the mode of friction whose slip rate vanishes at the same time as another event, which hides it."""
        now = self.read(theta)
        for place, memory in enumerate(self.memory_of):
            if self._stops_too(place, now, theta):
                if memory is not None:
                    self._at_memory(place, False, -self.slips[place], theta, now)
                else:
                    self._stop(place, theta, now)
                now = self.read(theta)

    def _stop(self, place: int, theta: float, before: Readings) -> None:
        """Decide whether rigid friction sticks where its slip rate vanishes, or slips the other way."""
        acceleration = self.slip_acceleration(place, before, theta)
        turning = self.slips[place] * acceleration
        if turning > 0.0 or self._only_pauses(place, turning, theta, before):
            return  # the rate only begins to grow
        shifts = rate_changes(self, self.equations.dry[place], theta) if self.columns else np.zeros(0)
        candidates = [*self.held, self.reaction_of[place]]
        for other, number in enumerate(self.reaction_of):  # of two events at the same time only one is reported
            if number is not None and other != place and self._stops_too(other, before, theta):
                candidates.append(number)
        modes = self.slips.copy()
        after = self._hold(theta, [number for number in candidates if number is not None], before)
        if abs(self._over.get(self.reaction_of[place], 1.0)) < BARELY:
            after = self._settle_briefly(place, theta, after)
        project(self, theta)
        if self.columns:
            add_delay(self, before, theta, shifts, acceleration, after=after)
        else:
            self.kink(before, theta, after)
        self._report(modes, theta)

    def _settle_briefly(self, place: int, theta: float, now: Readings) -> Readings:
        """Leave out a stick, or a slip back before a stick, that is shorter than events can be told apart.

        Return the values with what is held then.
        """
        number = self.reaction_of[place]
        assert number is not None
        sticks, others = self.sticks[place], [each for each in self.held if each != number]
        if not sticks:
            self.slips[place], self.sticks[place] = 0, True
            self.hold([*others, number])
            self.apply()
            now = self.read(theta, now)
        reaction, bound = float(now.reactions[number]), now.friction[place][2]
        beyond, growth = abs(reaction) - bound, margin_growth(self, place, now, theta) * float(self.base[0])
        if sticks:
            lasts = -beyond / growth if growth > 0.0 else np.inf
        else:  # a slip back that begins with the rate 0 lasts twice as long as the force exceeds its bound
            lasts = -2.0 * beyond / growth if growth < 0.0 else np.inf
        if lasts > _BRIEF if sticks else 0.0 < lasts < _BRIEF:
            return now
        self._slip(place, 1 if reaction > 0.0 else -1, theta)
        return self._hold(theta, others, now)

    def _release(self, place: int, side: int, theta: float, before: Readings) -> None:
        """Let rigid friction slip where its reaction reaches the force at which slip begins."""
        number, modes = self.reaction_of[place], self.slips.copy()
        static = float(self.base[self.slots[place].numbers["static"]])
        # otherwise no force jumps, and nothing else may let go
        jumps = self.columns and (static != 1.0 or len(self.held) > 1)
        shifts = margin_changes(self, place, before, theta) if jumps else None
        growth = margin_growth(self, place, before, theta) if jumps else 0.0
        self._slip(place, side, theta)
        others = [each for each in self.held if each != number]
        after = self._hold(theta, others, before)
        if self.sign_of and (pressed := self._pressed(theta)):
            after = self._hold(theta, [*others, *pressed], after, pressed)
        if shifts is not None:
            add_delay(self, before, theta, shifts, growth, after=after)
        self._let_memories_slip(theta)
        self._report(modes, theta)

    def _pressed(self, theta: float) -> list[int]:
        """Return the reactions of open stops at which the motion rests, and into which it now accelerates."""
        resting = [number for number in self._touching(theta, STILL * self.speed()) if number not in self.held]
        if not resting:
            return []
        now, reactions = self.read(theta), self.layout.structure.reactions
        return [
            number for number in resting if self.sign_of[number] * self._leading(reactions[number][0], now, theta) > 0.0
        ]

    def _let_memories_slip(self, theta: float, near: float = NEAR) -> None:
        """Let springs slip that are within a share of their limit, and that something has set free to move on.

        Their force stays where it is while the deflection does not move, so no event tells.
        """
        for place, memory in enumerate(self.memory_of):
            if memory is None or not self.sticks[place]:
                continue
            now = self.read(theta)
            force, limit = self.stiffness(place) * float(self.state[memory]), now.friction[place][1]
            if abs(force) < limit * (1.0 - near):
                continue
            side = 1 if force > 0.0 else -1
            if self._slips_on(place, side, theta, now):
                self._reset_extension(place, side, theta, limit)
                self._begun[place] = theta
            else:
                self.slips[place], self.sticks[place] = 0, True
            self.apply()

    def _at_memory(self, place: int, second: bool, direction: int, theta: float, now: Readings) -> None:
        """Change the mode of a Jenkins element."""
        modes = self.slips.copy()
        if self.sticks[place]:
            side = -1 if second else 1
            if not self._slips_on(place, side, theta, now):
                self.slips[place], self.sticks[place] = 0, True
                self.apply()
                # where slip has just ended, the force is at its limit, and leaves it; later it was beyond
                late = theta - self._begun[place] > PAUSE
                self.missed = self.missed or (late and direction > 0 and self._brief[place])
                return
            self._reset_extension(place, side, theta, now.friction[place][1])
            self._begun[place] = theta - 1.0
            self.apply()
            self._let_memories_slip(theta, UNSEEN)  # of two events at the same time only one is reported
        elif self.slips[place] and direction in (0, -self.slips[place]):
            just = theta - self._begun[place] <= SETTLING
            steady = self.laws[place].by != "normal" and not self.slots[place].varies
            turning = self.slips[place] * self.slip_acceleration(place, now, theta)
            if just or (steady and (turning > 0.0 or self._only_pauses(place, turning, theta, now))):
                return
            self._stick(place, theta)
            self._brief[place] = not steady or -turning < self._slow(now.accelerations.tolist())
            if not self.columns:
                self.kink(now, theta)
        else:
            return
        self.apply()
        self._report(modes, theta)

    def holds(self, switch: int) -> bool:
        """Return True if the stop of a switch is held."""
        return self.stop_reaction.get(switch) in self.held

    def let_go(self, switch: int, theta: float) -> None:
        """Open a stop that is held where its reaction vanishes, unless the reaction only begins there."""
        number = self.stop_reaction[switch]
        sign, now, modes = self.sign_of[number], self.read(theta), self.slips.copy()
        if sign * float(self.soon(now, theta).reactions[number]) > 0.0:
            return
        self._hold(theta, [each for each in self.held if each != number])
        self._report(modes, theta)

    def after_impact(self, theta: float, stops: Sequence[int] = ()) -> None:
        """Decide all modes again after an impact, which moves what was stuck; `stops` are held if they are pushed."""
        still, modes = STILL * self.speed(), self.slips.copy()
        able = {*self.held, *stops}
        candidates = [number for number in self._touching(theta, still) if number in able] if able else []
        now = self.read(theta)
        for place, number in enumerate(self.reaction_of):
            rate = now.friction[place][0]
            if number is None:
                continue
            if abs(rate) <= still and self.sticks[place]:
                candidates.append(number)
            elif self.sticks[place] or rate * self.slips[place] < 0.0:
                self._slip(place, 1 if rate > 0.0 else -1, theta - 2.0 * SETTLING)
        self._hold(theta, candidates)
        for place, memory in enumerate(self.memory_of):
            if memory is not None and self.slips[place] * now.friction[place][0] < 0.0:
                self._stick(place, theta)
        self.apply()
        self._let_memories_slip(theta)
        self._report(modes, theta)

    def concerns(self, contact: int, jumps: bool) -> bool:
        """Return True if a stage of a contact that closes or opens may change what friction does or what is held.

        It does if the contact hosts friction, or its force jumps while something is held.
        """
        return (jumps and bool(self.held)) or contact in self._hosts

    def after_stage(self, contact: int, theta: float) -> None:
        """Decide the friction that a contact hosts again after one of its stages has closed or opened."""
        modes = self.slips.copy()
        self._forgotten.clear()
        for place, friction in enumerate(self.equations.dry):
            memory = self.memory_of[place]
            if memory is not None and self.layout.structure.host(friction) == contact:
                self._begin_memory(place, memory, theta)
        self._hold(theta, self.held)
        self._report(modes, theta)

    def add_delay(self, before: Readings, theta: float, shifts: Array, speed: float) -> None:
        """Add what a stage that closes or opens earlier or later contributes to the changes, after `after_stage`."""
        add_delay(self, before, theta, shifts, speed, self._forgotten)

    def are_right(self, theta: float) -> bool:
        """Return True if the modes are those of the present state, unless they change there, and no slip was missed."""
        if self.missed:
            return False
        if not any(self.sticks) and not self._springs:
            least = min([side * self.rigid_rate(place, theta) for place, side in enumerate(self.slips)], default=0.0)
            return least >= 0.0 or least >= -NEAR * self.speed()
        if not self.held and len(self._springs) == len(self.slots) and all(map(self._is_clearly_right, self._springs)):
            return True
        velocity, found = self.speed(), self.decide(theta)
        for place, memory in enumerate(self.memory_of):
            rate, _, bound, _, force, *_ = found[VALUES * place : VALUES * (place + 1)]
            if self.slips[place]:
                if self.slips[place] * rate < -NEAR * velocity:
                    return False
            elif self.sticks[place]:
                if memory is not None:
                    force = self.stiffness(place) * float(self.state[memory])
                if abs(force) > bound * (1.0 + NEAR):
                    return False
        return True

    def _is_clearly_right(self, place: int) -> bool:
        """Return True if a spring with a constant limit sticks within it, or slips on fast: no other value decides."""
        if not self.has_constant_limit[place]:
            return False
        if self.slips[place]:
            return self.moves(place) == self.slips[place]
        memory, limit = self.memory_of[place], self.base.item(self.slots[place].numbers["limit"])
        return memory is not None and self.sticks[place] and self.stiffness(place) * abs(self._own.item(memory)) < limit
