"""Modes of dry friction and of held stops: set at the start of a motion, changed at its events, and checked.

Which contacts are held follows from what they would need: all that may be held are taken as held together, and the one
whose reaction exceeds its bound most is released, until none does.

Method: docs/numerics/notes/flow.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import EDGE, Equations
from gapwalk.flow.forces import Angles, Dry, accelerations, is_at_high, stages_of
from gapwalk.flow.friction_state import (
    Hold,
    Readings,
    SlipEvent,
    add_delay,
    depth_changes,
    extension_changes,
    largest,
    margin_changes,
    margin_growth,
    project,
    rate_changes,
)
from gapwalk.flow.single_friction import BARELY, LATER, NEAR, ON, PAUSE, SETTLING, STILL, UNSEEN, VALUES, LoneFriction
from gapwalk.model.laws import Expression

_BEYOND = 1e-2  # share of its size by which a motion may begin beyond a rigid stop
_FAST = 2e-9  # radians of the largest acceleration after which a slip rate is too fast to vanish; twice `_TOGETHER`
_BRIEF = 4e-9  # radians that they must last: two events of one contact are distinct from a quarter of that

Array = NDArray[np.float64]


class DrySwitches(LoneFriction):
    """Control of the modes of friction and of held stops of one compiled integrator.

    Attributes
    ----------
    missed
        True if a force came back within its bound that had never been beyond: slip was missed.
    latest
        The angle of the last event.
    keeps
        Number of a contact whose friction keeps its mode until the next start; None if there is none.
    """

    def __init__(self, equations: Equations) -> None:
        super().__init__(equations)
        self.keeps: int | None = None
        self._hosts = {self.layout.structure.host(friction) for friction in equations.dry} - {None}
        self.missed, self.latest = False, -math.inf
        # places of the state that the last event has reset, and whether they follow a limit from there on
        self._forgotten: dict[int, bool] = {}

    def start(self, base: Array, directions: Array, theta: float, unit: float) -> None:
        """Set all modes for the state in the integrator, and begin a new log."""
        # Parameters are as in `DryState.begin`; `unit` is the unit of length.
        self.log, self.kinks, self._begun, self.keeps = [], [], [theta - 1.0] * len(self.slots), None
        self.hold_log, self._brief = [Hold(theta, ())], [False] * len(self.slots)
        self.unseen, self.missed, self.latest = UNSEEN, False, -math.inf
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
        """Decide whether a Jenkins element sticks from its extension and slip rate; it is never beyond its limit."""
        # Return the values at the state, unless that has changed; `known` are those under other modes, if they are
        # known.
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
        """Let friction in series with a spring slip to one side; return True if its slip rate has that direction."""
        # Where the rate vanishes, the acceleration decides, and where that does too, the acceleration a little later.
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
        """Return the acceleration of a deflection; where it vanishes, the one a moment later."""
        # Where a stop or the only friction has just let go, all accelerations are rounding. Those to come tell their
        # size, and so do the velocities.
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
        """Hold those of the candidates that stay within their bounds; the others slip, or open."""
        # Stops that are `pressed` are held even where their reactions only begin, and have a sign by rounding only.
        #
        # Return the values with what is held; `known` are those under other modes, if they are known.
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
        for other in self._stopping(now, theta, place) if self._springs else ():
            if self.memory_of[other] is not None:  # of two events at the same time only one is reported
                self._at_memory(other, False, -self.slips[other], theta, now)
        if self.memory_of[place] is not None:
            hidden = [other for other in self._stopping(now, theta, place) if self.memory_of[other] is None]
            self._at_memory(place, bool(second), direction, theta, now)
            if hidden:  # it lets the others stop with it
                self._stop(hidden[0], theta, self.read(theta))
        elif self.sticks[place]:
            self._release(place, -1 if second else 1, theta, now)
        elif not second and (theta - self._begun[place] > SETTLING or direction == -self.slips[place]):
            self._stop(place, theta, now)

    def _stopping(self, now: Readings, theta: float, but: int) -> Iterator[int]:
        """Yield other friction whose slip rate vanishes at the same time as an event, each as it is asked for."""
        # nearly all of it is far too fast, whatever its acceleration: `_stops_too` need not be asked
        fastest = _FAST * largest(now.accelerations) * self.base.item(0)
        for place, (rate, _, _) in enumerate(now.friction):
            is_fast = abs(rate) > fastest * self.spans[place]
            if self.slips[place] and place != but and not is_fast and self._stops_too(place, now, theta):
                yield place

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
        # of two events at the same time only one is reported
        candidates += [self.reaction_of[other] for other in self._stopping(before, theta, place)]
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
        """Leave out a stick, or a slip back before a stick, that is shorter than events can be told apart."""
        # Return the values with what is held then.
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
        """Let springs slip that are within a share of their limit, and that something has set free to move on."""
        # Their force stays where it is while the deflection does not move, so no event tells.
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
                # or it was just there as another event has set it
                late = theta - self._begun[place] > PAUSE and theta > self.latest
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
        """Return True if a stage of a contact that closes or opens may change what friction does or what is held."""
        # It does if the contact hosts friction, or its force jumps while something is held.
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


# Switches besides those of the stages: modes of laws, which guards set, and levels, which change at known angles.
#
# The force is continuous where a guard vanishes, so derivatives of the motion pass it unchanged. Where friction
# sticks, the guard of ``abs(v)`` vanishes all the time: such a mode waits until something slips. Where a level
# changes, the force jumps at an angle that does not depend on the state: only sensitivities to that angle change.

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
            for place, (mode, _) in enumerate(found):
                self._refuse_negative(place, mode, theta)

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
        """Return the modes of all laws at a state by their guards, and the values of these, real or complex."""
        # `decide` returns the value of a mode from its number and its guard; by default the sign of the guard decides.
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
        state, series = self._state[: 2 * self.n], self._integrator.series()[: 2 * self.n]
        ahead = _AHEAD * taylor_reach(series)
        after = self._contact_modes(theta + ahead, series @ ahead ** np.arange(series.shape[1]))
        for place, ((_, guard), (late, size)) in enumerate(zip(self._contact_modes(theta, state), after, strict=True)):
            if abs(guard) <= _ON * abs(size):
                self._parameters[self._modes + place] = late

    def wait(self, theta: float, dry: DrySwitches) -> None:
        """Let those modes wait whose guards vanish for as long as what is held stays so, where friction has changed."""
        # Such a guard depends on what is held alone, and the force does not depend on its mode. Another guard that
        # vanishes is decided by the motion a moment later: where friction has just let go, or has turned round with
        # hardly any acceleration, all that decides now is rounding.
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
            self._refuse_negative(mode, direction > 0, self._integrator.time)
            self._parameters[self._modes + mode] = direction > 0
        self.kinks.append((self._integrator.time, self._state[: 2 * self.n].copy()))

    def _refuse_negative(self, mode: int, is_on: bool, theta: float) -> None:
        """Raise a FlowError where the mode is that of a limit of friction, which has become negative."""
        index, own = self.equations.modes[mode]
        slots = self.equations.layout.contacts[index]
        law = slots.form.law
        if is_on or not isinstance(law, Expression) or own < law.formula.mode_count:
            return
        q, v = self._unit * self._state[: self.n], self._unit * self._state[self.n : 2 * self.n]
        moves = self.coefficients[slots.deflections[0]]
        text, contacts = law.formula.text, self.equations.layout.structure.contacts
        name = next(each.name for each in contacts if each.law.host == slots.form.name)
        raise FlowError(
            f"the limit of friction {name!r}, {text}, becomes negative at x = {moves @ q:.4g}, v = {moves @ v:.4g} and "
            f'theta = {theta:.4g}; write limit = "max(..., 0)", or numbers with which it stays positive there'
        )

    def set_simultaneous(self, closed: list[list[bool]] | None, mode: int = -1, dry: Dry | None = None) -> None:
        """Set the modes, other than one, whose guards vanish at the same time as an event: it alone was reported."""
        # Two forces with ``abs(v)`` of the same coordinate have two guards that always vanish together, and a guard
        # that depends on a mode may vanish until that mode changes. `closed` has for each contact which of its stages
        # are closed, and `dry` the modes of friction.
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
        """Change a level at its angle; transform the sensitivities to what moves that angle."""
        # The angle does not depend on the state, so ``g_y`` is 0 and the transition matrix continues.
        #
        # Shapes: `columns` (columns, 2n); `directions` (directions, number of coefficients).
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
    """Return when a motion has covered a distance by its Taylor series (without the constant), and its position."""
    # Times from `shortest` on are tried. If it does not cover the distance, they are those where the series ceases to
    # hold; 0, 0 if it does not move.
    powers, time, depth = np.arange(1.0, len(series) + 1.0), min(shortest, longest), 0.0
    if not series.any():
        return 0.0, 0.0
    while True:
        depth = float(series @ time**powers)
        if abs(depth) > distance or time >= longest:
            return time, depth
        time = min(2.0 * time, longest)
