"""The switches of the contact stages: set at the start of a motion, flipped at its contact events, and checked.

At an event the switch follows the side to which the motion crosses the breakpoint; where the force law resets the rate,
the switch stays open.

Derivatives of the motion pass an event by the general rule (`gapwalk.flow.event_rule`). Where the state is not reset
and the force does not jump, the rule is the identity, and nothing is computed.

Method: docs/numerics/notes/flow.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import accumulate, pairwise
from typing import Any, NamedTuple
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError
from gapwalk.flow.equations import BreakpointGeometry, Equations
from gapwalk.flow.event_rule import Quotient, jump_of
from gapwalk.flow.forces import Angles, accelerations
from gapwalk.flow.friction_state import Kink, largest
from gapwalk.flow.friction_switches import DrySwitches, ModeSwitches, taylor_beginning, taylor_reach
from gapwalk.flow.impacts import Impacts

COOLDOWN = 1e-9  # radians of theta for which an event does not repeat
_SLOW = 1e-6  # relative approach velocity below which a crossing may be a touch that ends within the cooldown
_ON = 1e-13  # relative distance within which a motion counts as being on a breakpoint
_LATE = 1e-6  # radians by which a slow crossing may be reported after it was set beside another event
_ROUNDING = 1e-15  # the same, by rounding of the positions
_REPEATED = 10 * COOLDOWN  # time within which a second event of a switch repeats the first
_NEAR = 1e-9  # relative distance within which the end of a motion may be on either side of a breakpoint
_LEAVING = (
    1e-5  # radians within which a stop that lets go is not struck again: its deflection leaves in the third order
)
_NOWHERE = np.zeros(0)  # no angles: then no impacts are summed
_OFTEN = 2000  # events, within a forcing period, after which it is asked whether the motion rests on a force that jumps
_BRIEF = 2.0 * math.pi / _OFTEN  # radians of an excursion from a breakpoint on which a motion comes to rest


class RestOnJumpError(FlowError):
    """A motion comes to rest on a breakpoint at which a force jumps, towards which both sides push."""


class ContactEvent(NamedTuple):
    """One crossing of a breakpoint."""

    theta: float  #: Angle of the event, in radians of the fundamental excitation.
    switch: int  #: The stage and its side: index into `System.breakpoints`, whose entries begin with the contact.
    enters: bool  #: True if the contact closes, False if it opens.
    velocity: float  #: Rate of the deflection over time; its absolute value is the approach velocity.


class Switchboard(BreakpointGeometry):
    """Control of the switches of one compiled integrator, which calls it back at every event.

    Attributes
    ----------
    begun
        For each switch whether its stage is closed at the start of the motion.
    """

    def __init__(self, equations: Equations) -> None:
        super().__init__(equations)
        layout = equations.layout
        ends = [0, *accumulate(len(contact.stages) for contact in layout.contacts)]
        self._own_switches = [slice(*each) for each in pairwise(ends)]  # of each contact
        self.modes, self.dry = ModeSwitches(equations), DrySwitches(equations)
        self._impacts, self.chatters = Impacts(self.dry, self.modes), bool(self.dry.stop_reaction)
        self._first = equations.first_switch
        self._jumps = [jump_of(layout, *switch) for switch in equations.switches]
        self._rebounds = [
            layout.contacts[k].stages[j].innermost and layout.contacts[k].form.law.rebounds
            for k, j in equations.switches
        ]
        self._nowhere, self._all = [False] * self.count, range(self.count)
        self._inside: list[bool] = []
        self.begun: list[bool] = []
        self._holding = set[int]()  # switches of the stops that are held
        self.log: list[ContactEvent] = []
        self.missed = 0
        self.event_limit = 0
        self.listener: Callable[[], Callable[[float], None] | None] | None = None  # (weak) of every event

    def attach(self, integrator, columns: int, readings: Any = None) -> None:
        """Attach to the integrator's state and parameters (live views), with `columns` sensitivity columns."""
        # `readings` are those of friction and rigid stops, if there are any.
        self._integrator, self._state, self._parameters = integrator, integrator.state, integrator.pars
        self._columns, self._moving = columns, self._state[: 2 * self.n]
        self._is_plain = [  # nothing but the switch changes at its events
            not (rebounds or (columns and jump is not None) or self.dry.count or self.modes.mode_count)
            for rebounds, jump in zip(self._rebounds, self._jumps, strict=True)
        ]
        self._only_stages = not (self.dry.count or self.modes.mode_count)
        self.modes.attach(integrator)
        self.dry.attach(integrator, columns, readings, self._coefficient_change())

    def answer(self, kind: str, index: int, direction: int) -> bool:
        """Answer an event of the integrator; return whether it continues."""
        match kind:
            case "switch":
                return self.at_event(index, self._integrator.time)
            case "mode":
                return self.at_guard(index, direction)
            case "slip":
                return self.at_slip(index, direction)
            case _:
                return self.at_restart()

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The coefficients of the system, with lengths in multiples of the unit."""
        return self._system

    def _coefficient_change(self) -> Callable[[NDArray[np.float64]], None]:
        """Return a function that takes over coefficients, which change with what is held."""
        mine = ref(self)  # not self: a cycle would keep the integrator until the garbage collector comes

        def change(coefficients: NDArray[np.float64]) -> None:
            switches = mine()
            assert switches is not None
            switches._coefficients = switches.modes.coefficients = coefficients
            switches._of_motion.clear()

        return change

    def start(
        self, coefficients: NDArray, directions: NDArray, theta: float, event_limit: int, unit: float = 1.0
    ) -> None:
        """Set every switch for the state in the integrator, and begin a new log with lengths in multiples of `unit`."""
        # `directions` are those of the coefficients along which there are sensitivities, shape (directions, number).
        self.log, self.missed, self.event_limit, self._unit, self._counted = [], 0, event_limit, unit, theta
        if self.chatters:
            self.sums(_NOWHERE)
        # deceleration by a unit of the force, jump over rate, derivatives of deflection vector and of breakpoint
        self._of_motion: dict[int, tuple[NDArray, Quotient, NDArray, NDArray]] = {}
        self._coefficients = self._system = coefficients
        self._system_directions = directions
        if not self.count:
            self.modes.start(coefficients, theta, unit)
            if self.dry.count:
                self._start_dry(theta)
            if self.modes.mode_count:
                self.modes.leave(theta, self.dry)
            return
        self._read_geometry(coefficients)
        state = self._moving.tolist()
        self._speed = _SLOW * max(map(abs, state[self.n :]))
        depths = self._depths(state, theta)
        self._inside = [depth > 0.0 for depth in depths]
        self._parameters[self._first : self._first + self.count] = self._inside
        self.modes.start(coefficients, theta, unit)
        self._changed, self._left = [theta] * self.count, [theta] * self.count
        self._speeds, self._opened = [math.inf] * self.count, [-math.inf] * self.count
        if self.dry.count:
            self._start_dry(theta)
        if self.modes.mode_count:
            self.modes.leave(theta, self.dry)
        # no motion is larger than that, so nearly always its size need not be known
        most = _ON * (self._scale + max(map(abs, state)) * max(1.0, coefficients.item(0)))
        near = self._are_near(depths, state, _ON) if min(map(abs, depths)) <= most else self._nowhere
        if any(near):
            before = self._inside.copy()
            self._leave(
                {switch: depths[switch] for switch in range(self.count) if near[switch] and not self._rebounds[switch]},
                theta,
            )
            if self.modes.mode_count:
                self.modes.refresh(theta, self._closed())
            if before != self._inside and self.dry.count:
                self._start_dry(theta)
                if self.modes.mode_count:
                    self.modes.leave(theta, self.dry)
        self.begun = self._inside.copy()
        for switch in self.dry.stop_reaction:
            self._parameters[self._first + switch] = self._inside[switch] = False
            if near[switch] and not self.dry.holds(switch) and self._signs[switch] * self._rate(switch, theta) > 0.0:
                self._settle(switch, theta, reported=False)

    def _start_dry(self, theta: float) -> None:
        """Set the modes of friction and stops; where they change later, so do the coefficients."""
        self.dry.closed = self._closed()
        self.dry.start(self._system, self._system_directions, theta, self._unit)
        self._holding = {switch for switch in self.dry.stop_reaction if self.dry.holds(switch)}

    def is_right(self) -> bool:
        """Return True if no crossing was missed: each event changed its switch, and all are correct at the end."""
        if self.missed:
            return False
        if self.modes.mode_count and not self.modes.are_right():
            return False
        if self.dry.count and not self.dry.are_right(self._integrator.time):
            return False
        if not self.count:
            return True
        state = self._moving.tolist()
        depths = self._depths(state, self._integrator.time)
        if [depth > 0.0 for depth in depths] == self._inside:
            return True
        near = self._are_near(depths, state, _NEAR)
        return all(
            (depth > 0.0) is closed or close for depth, closed, close in zip(depths, self._inside, near, strict=True)
        )

    def at_event(self, switch: int, theta: float) -> bool:
        """Flip a switch at an event of its breakpoint; return whether the integrator continues."""
        if not self._only_stages and self.dry.count and self.dry.holds(switch):
            self.dry.let_go(switch, theta)
        elif self._settle(switch, theta) and self._simultaneous[switch]:
            self._settle_simultaneous(self._simultaneous[switch], theta)
        if self._only_stages:
            return self._counts_on(theta)
        if self.modes.mode_count:
            self.modes.set_simultaneous(self._closed(), dry=self.dry.present)
        return self._go_on(theta)

    def _settle(self, switch: int, theta: float, reported: bool = True) -> bool:
        """Set one switch for a motion on its breakpoint; return whether that changes it."""
        # A reported event that changes nothing shows that the one before it was missed.
        if theta < self._left[switch]:
            return False
        velocity, before = self._rate(switch, theta), self._inside[switch]
        if velocity > self._speed or velocity < -self._speed:
            inside = self._signs[switch] * velocity > 0.0
            if reported and inside is before:
                self.missed += not (self._repeats(switch, velocity, theta) or self._leaves(switch, velocity, theta))
        else:
            inside = self._after_touch(switch, velocity, theta)
        if inside is before:
            return False
        # beside another event, a crossing is set as soon as it is within rounding; a slow one is reported later
        self._changed[switch], self._speeds[switch] = theta if reported else theta + _LATE, abs(velocity)
        self.log.append(ContactEvent(theta, switch, inside, velocity * self._unit))
        if self._is_plain[switch]:
            self._parameters[self._first + switch] = self._inside[switch] = inside
        elif self._rebounds[switch]:
            others = self._impacts.strike(switch, theta)  # an impulse may press on stops that are held
            self._log_released(theta)
            for other in others:
                self.log.append(ContactEvent(theta, other, True, 0.0))
        else:
            self._cross(switch, velocity, inside, theta)
        return True

    def _cross(self, switch: int, velocity: float, inside: bool, theta: float) -> None:
        """Set a switch, and carry out what else changes with it: friction, modes, and derivatives of the motion."""
        contact = self.equations.switches[switch][0]
        if self.dry.count and self.dry.concerns(contact, self._jumps[switch] is not None):
            now = self.dry.read(theta)
            shifts = self._shifts(switch, theta) if self._columns else np.zeros(0)
            self._parameters[self._first + switch] = self._inside[switch] = inside
            self.dry.closed = self._closed()
            self.dry.after_stage(contact, theta)
            if self._columns:
                self.dry.add_delay(now, theta, shifts, velocity)
        elif self._columns and self._jumps[switch] is not None:
            self._jump(switch, velocity, inside, theta)
        self._parameters[self._first + switch] = self._inside[switch] = inside
        if self.dry.count:
            self.dry.closed = self._closed()
        if self.modes.mode_count:
            self.modes.refresh(theta, self._closed())

    def _repeats(self, switch: int, velocity: float, theta: float) -> bool:
        """Return True if an event follows the last change of its switch within time or distance that is rounding."""
        passed = theta - self._changed[switch]
        if passed <= _REPEATED:
            return True
        return max(abs(velocity), self._speeds[switch]) * passed <= self._rounding(switch)

    def _leaves(self, switch: int, velocity: float, theta: float) -> bool:
        """Return True if a motion crosses the breakpoint of a stop that has let go, but has not left it yet."""
        # It leaves in the third order of time, or at once after an impulse, and rounding of its position may be a
        # crossing until then.
        outwards = self._signs[switch] * velocity < 0.0
        return outwards and abs(velocity) * (theta - self._opened[switch]) <= self._rounding(switch)

    def _rounding(self, switch: int) -> float:
        """Return the product of speed and angle of a motion that has hardly left a breakpoint."""
        near = 4.0 * _ON * (self._scales[switch] + self._size(self._moving.tolist()))
        return near / float(self._coefficients[0])

    def _settle_simultaneous(self, others: Iterable[int], theta: float) -> None:
        """Set those of some other switches whose breakpoints are crossed at the same time."""
        # If two events coincide, the integrator reports one, and the other only if rounding leaves a sign change of it.
        # Examples are the two sides of a gap of no width, two equal contacts, and a symmetric system.
        state = self._moving.tolist()
        depths = self._depths(state, theta)
        # no motion is larger than that, so its size need not be known
        most = _ON * (self._scale + max(map(abs, state)) * max(1.0, self._coefficients.item(0)))
        for other in others:
            if -most <= depths[other] <= most:
                break
        else:
            return
        near = self._are_near(depths, state, _ON)
        on = self._are_near(depths, state, _ROUNDING)
        for other in others:
            # a stop that is held stays on its breakpoint, and its rate has a sign by rounding only; and where a motion
            # has hardly left since a switch changed, its own event follows
            if not near[other] or self._repeats(other, 0.0, theta) or self.dry.holds(other):
                continue
            if (depths[other] > 0.0) is self._inside[other] and not on[other]:
                reach = COOLDOWN * float(self._coefficients[0]) * abs(self._rate(other, theta))
                if abs(depths[other]) > reach:
                    continue  # a slow crossing comes later, or not at all, and is then reported
            self._settle(other, theta, reported=False)

    def _leave(self, starts: dict[int, float], theta: float) -> None:
        """Set the switches on whose breakpoints the motion starts, by the sides to which it leaves them."""
        # Velocity and acceleration do not always decide: a mass at rest leaves in the third order under a sine, and two
        # orders later for each further mass through which it is pushed. Therefore the Taylor series of the motion
        # decides: its first non-zero term does not depend on the switch itself. It may depend on another one, which
        # then leaves earlier, so the series is evaluated again until nothing changes. A crossing before the motion has
        # left its breakpoint by more than rounding is not an event. `starts` are the depths of those switches.
        distance = 2.0 * _ON * (self._scale + self._size(self._moving.tolist()))
        for _ in range(self.count):
            known = self._integrator.series()
            series, longest = known[: self.n, 1:], taylor_reach(known[: 2 * self.n])
            for switch, start in starts.items():
                depths = self._vectors[switch] @ series
                if self._lines[switch] is not None:
                    powers = range(1, series.shape[1] + 1)
                    depths += [self._sway(switch, theta, power) / math.factorial(power) for power in powers]
                depths *= self.signs[switch]
                time, depth = taylor_beginning(depths, distance, COOLDOWN, longest)
                self._inside[switch], self._left[switch] = start + depth > 0.0, theta + time
            if self._parameters[self._first : self._first + self.count].tolist() == self._inside:
                return
            self._parameters[self._first : self._first + self.count] = self._inside
        self.refuse_rest(theta)

    def _after_touch(self, switch: int, velocity: float, theta: float) -> bool:
        """Decide a slow crossing: the velocity decides, unless the motion turns back within the cooldown."""
        turning = self._turning(switch, theta)
        span = 4.0 * COOLDOWN * self._coefficients[0]
        turns_back = velocity * turning < 0 and 2.0 * abs(velocity) <= span * abs(turning)
        leading = turning if turns_back or velocity == 0.0 else velocity
        return bool(self.signs[switch] * leading > 0)

    def _turning(self, switch: int, theta: float, closed: list[list[bool]] | None = None) -> float:
        """Return the second derivative of a deflection over time; `closed` as in `accelerations`."""
        q, v = self._state[: self.n], self._state[self.n : 2 * self.n]
        layout, dry = self.equations.layout, self.dry.present
        acceleration = accelerations(layout, self._coefficients, theta, q, v, closed, unit=self._unit, dry=dry)
        turning = float(self._vectors[switch] @ acceleration)
        if self._lines[switch] is not None:
            turning += self._sway(switch, theta, 2) / float(self._coefficients[0]) ** 2
        return turning

    def _jump(self, switch: int, rate: float, inside: bool, theta: float) -> None:
        """Transform the sensitivities at a jump of the force, without a reset of the state."""
        # Then ``F+ - F-`` is the jump times ``-D / W`` and ``den`` the rate over W, so only their quotient is needed.
        # It stays finite if the jump vanishes with the rate, as for a viscous damper.
        if switch not in self._of_motion:
            directions, quotients = self._directions(), self._jumps[switch]
            assert quotients is not None
            contact = self.equations.layout.contacts[self.equations.switches[switch][0]]
            places = self.signs[switch] * directions[:, self._breaks[switch]]
            vectors = directions[:, self._deflections[switch]]
            coefficients = self._coefficients
            self._of_motion[switch] = coefficients[contact.force], quotients(coefficients), vectors, places
        push, quotient, vectors, places = self._of_motion[switch]
        jump = quotient(rate, theta)
        shifts = self._shifts(switch, theta, (vectors, places))
        columns = self._state[self.size :].reshape(self._columns, self.size)
        columns[:, self.n : 2 * self.n] -= np.outer(shifts, (jump if inside else -jump) * push)

    def _shifts(self, switch: int, theta: float, known: tuple[NDArray, NDArray] | None = None) -> NDArray[np.float64]:
        """Return the change of the deflection of a switch less its breakpoint, along each column."""
        # Derivatives of the deflection vector and of the breakpoint along the directions may be known.
        columns = self._state[self.size :].reshape(self._columns, self.size)
        shifts = columns[:, : self.n] @ self._vectors[switch]
        if known is None:
            directions = self._directions()
            places = self.signs[switch] * directions[:, self._breaks[switch]]
            known = directions[:, self._deflections[switch]], places
        vectors, places = known
        if len(places):  # g_p, of each direction of the coefficients
            shifts[self._columns - len(places) :] += vectors @ self._state[: self.n] - places
            if (sway := self._sways[switch]) is not None:
                angles = self._orders * theta
                waves = np.concatenate((np.cos(angles), np.sin(angles)))
                shifts[self._columns - len(places) :] += self._directions()[:, sway] @ waves
        return shifts

    def at_slip(self, event: int, direction: int) -> bool:
        """Change a mode of friction at one of its events; return whether the integrator continues."""
        theta = self._integrator.time
        self.dry.at_slip(event, direction, theta)
        if self.modes.mode_count:  # a law with abs(v) of the same deflection: only one of both events is reported
            self.modes.set_simultaneous(self._closed() if self.count else None, dry=self.dry.present)
        if self.count:
            self._settle_simultaneous(self._all, theta)
        return self._go_on(theta)

    def at_guard(self, mode: int, direction: int) -> bool:
        """Set a mode whose guard changes its sign in a direction; return whether the integrator continues."""
        self.modes.set_mode(mode, direction)
        if self.modes.mode_count > 1:
            self.modes.set_simultaneous(self._closed() if self.count else None, mode, self.dry.present)
        if self.dry.count:
            self.dry.stop_simultaneous(self._integrator.time)
        if self.count:
            self._settle_simultaneous(range(self.count), self._integrator.time)
        return self._go_on(self._integrator.time)

    def at_restart(self) -> bool:
        """Return whether the integrator continues where only a new Taylor series begins."""
        self.event_limit -= 1
        return self.event_limit > 0

    def _log_released(self, theta: float) -> None:
        """Log that stops open which the last event has let go: their own, friction that slips, or an impulse."""
        held = {switch for switch in self.dry.stop_reaction if self.dry.holds(switch)}
        for switch in sorted(self._holding - held):
            self.log.append(ContactEvent(theta, switch, False, 0.0))
            self._opened[switch] = theta
            fastest = max(map(abs, self._state[self.n : 2 * self.n].tolist()))  # at the start it may have been at rest
            if abs(self._rate(switch, theta)) <= max(self._speed, _SLOW * fastest):  # an impulse lets go fast
                self._left[switch] = theta + _LEAVING
        self._holding = held

    def sums(self, places: NDArray[np.float64], watched: NDArray[np.float64] | None = None) -> None:
        """Let impacts that follow each other ever faster be summed between some angles; see `Impacts.begin`."""
        self._impacts.begin(places, watched, self._unit)

    def land(self) -> bool:
        """Go to where a chatter was summed up to, if one was; return whether it was."""
        if self._impacts.rest is None:
            return False
        self._integrator.time = self._impacts.rest.theta
        rest = self._impacts.land()
        self._integrator.reset_cooldowns()
        switch = self.equations.layout.structure.reactions[rest.reaction][1]
        for theta, speed in zip(rest.angles.tolist(), rest.speeds.tolist(), strict=True):
            self.log.append(ContactEvent(theta, switch, True, speed * self._unit))
        self._changed[switch], self._speeds[switch] = rest.theta, 0.0 if rest.ends else abs(float(rest.speeds[-1]))
        self._log_released(rest.theta)
        return True

    def _go_on(self, theta: float) -> bool:
        """Return whether the integrator continues after an event."""
        self.dry.latest = theta
        if self.dry.sign_of:
            self._log_released(theta)
        if self.modes.mode_count and self.dry.count:
            self.modes.wait(theta, self.dry)
        if self.listener is not None and (listener := self.listener()) is not None:
            listener(theta)
        return self._counts_on(theta) and self._impacts.rest is None

    def _counts_on(self, theta: float) -> bool:
        """Count an event; return False where there were too many, or the motion comes to rest on a force that jumps."""
        self.event_limit -= 1
        if self.event_limit % _OFTEN == 0:
            if theta - self._counted < 2.0 * math.pi and self._rests_on(theta) is not None:
                self.event_limit = 0
            self._counted = theta
        return self.event_limit > 0

    def refuse_rest(self, theta: float) -> None:
        """Raise an error if the motion comes to rest on a force that jumps: it has no derivatives there."""
        switch = self._rests_on(theta)
        if switch is None:
            return
        contact, stage = self.equations.switches[switch]
        form = self.equations.layout.structure.contacts[contact]
        name = form.stage_prefix(form.sides[stage][0])
        place = self._offsets[switch] * self._unit
        raise RestOnJumpError(
            f"at theta = {theta:.6g} the motion comes to rest on the breakpoint {place:.6g} of {name}, where "
            "the force jumps and both sides push towards it: such a motion has no multipliers and is not followed. "
            "Give the jump a width: a stage of stiffness jump/width in place of the preload, and one of stiffness "
            "-jump/width at the clearance plus the width"
        )

    def _rests_on(self, theta: float) -> int | None:
        """Return a switch whose breakpoint the motion hardly leaves, as the forces on both sides push towards it."""
        if not self.count:
            return None
        state, closed = self._moving.tolist(), self._closed()
        for switch, depth in enumerate(self._depths(state, theta)):
            if self._jumps[switch] is None or self._rebounds[switch]:
                continue
            contact, stage = self.equations.switches[switch]
            inside, before = [list(each) for each in closed], [list(each) for each in closed]
            for own, place, now in [(contact, stage, True), *self._other_sides(switch)]:
                inside[own][place], before[own][place] = now, not now
            out, back = (self._signs[switch] * self._turning(switch, theta, each) for each in (before, inside))
            if not out > 0.0 > back:
                continue
            least, rate = min(out, -back), abs(self._rate(switch, theta))
            small = 4.0 * _ON * (self._scales[switch] + self._size(state))
            # 2 rate / least is the time of an excursion
            if 2.0 * rate <= _BRIEF * float(self._coefficients[0]) * least and abs(depth) <= rate**2 / least + small:
                return switch
        return None

    def _other_sides(self, switch: int) -> list[tuple[int, int, bool]]:
        """Return contact, stage and False for the other side of a gap of no width, which opens as the switch closes."""
        return [
            (*self.equations.switches[other], False)
            for other in self._simultaneous[switch]
            if self._offsets[other] == self._offsets[switch]
            and self._signs[other] != self._signs[switch]
            and self.equations.switches[other][0] == self.equations.switches[switch][0]
        ]

    def change_level(self, theta: float, number: int, rises: bool) -> None:
        """Change the level of a cycle at its angle."""
        columns = self._state[self.size :][: self._columns * self.size].reshape(self._columns, self.size)
        self.modes.change_level(theta, number, rises, columns, self._directions(), self._closed(), self.dry.present)
        if self.dry.count:
            self.dry.after_stage(-1, theta)
            if self.modes.mode_count:
                self.modes.wait(theta, self.dry)
        if self.dry.sign_of:
            self._log_released(theta)

    def _closed(self) -> list[list[bool]]:
        """Return for each contact which of its stages are closed."""
        return [self._inside[own] for own in self._own_switches]

    def _directions(self) -> NDArray[np.float64]:
        """Return the present directions of the coefficients of the sensitivities, shape (directions, number)."""
        directions = np.zeros((len(self.equations.varying), len(self._coefficients)))
        for index, varying in enumerate(self.equations.varying):
            first = self.equations.first_component(index)
            directions[index, varying] = self._parameters[first : first + len(varying)]
        return directions


# Turning points of coordinates and deflections along a motion, for a survey of an orbit.

_ONE_TURN = 1e-8  # radians within which two turning points of a deflection are the same
_TURNING = 1e-3  # share of the size of the velocities below which a rate may vanish within rounding of an event


class Turn(NamedTuple):
    """A turning point: index into `Equations.turning`, theta, and the positions there."""

    event: int
    theta: float
    positions: list[float]


class TurningPoints:
    """The turning points that one integrator finds."""

    def __init__(self, equations: Equations, switches: Switchboard) -> None:
        self._equations, self._switches = equations, switches
        self._turns: list[Turn] = []
        self._numbers, self._still = b"", dict[tuple[int, ...], list[int]]()  # what keeps still, by what is held
        layout = equations.layout
        self._size, self._unit = layout.structure.size, 1.0
        self._slots = [(event, slots) for event, (slots, _) in enumerate(equations.turning) if slots is not None]
        self.vectors = np.zeros((len(equations.turning), self._size))
        self.vectors[: self._size] = np.eye(self._size)
        self._swaying = [
            (event, contact)
            for event, slots in self._slots
            for contact in layout.contacts
            if contact.deflection is slots and contact.sway is not None
        ]

    def start(self, coefficients: NDArray[np.float64], unit: float) -> None:
        """Begin with the coefficients of a system, with lengths in multiples of `unit`."""
        self._turns, self._coefficients, self._unit = [], coefficients, unit
        self._stops: list[tuple[Kink, list[int]]] = []  # events that stop the integrator; what keeps still there
        numbers = coefficients[1:].tobytes()  # all but the frequency: the rest stays the same along most walks
        if numbers != self._numbers:
            self._numbers, self._still = numbers, {}
            for event, slots in self._slots:
                self.vectors[event] = coefficients[slots]
            self._longest = float(np.abs(self.vectors).sum(axis=1).max())

    def at_event(self, event: int, theta: float, positions: list[float]) -> None:
        """Record where a coordinate or a deflection turns, at an event of the integrator."""
        if self._switches.dry.held and event in self._keeping_still():
            return  # its rate is 0 all the time, and changes its sign by rounding
        own = positions[: self._size]
        self._turns.append(Turn(event, theta, own if self._unit == 1.0 else [self._unit * each for each in own]))

    def at_stop(self, theta: float) -> None:
        """Note an event of friction or stops, which stops the integrator: it may report no other at the same time."""
        dry, n = self._switches.dry, self._size
        if not dry.count or (dry.kinks and dry.kinks[-1].theta == theta):
            return
        if not self._swaying:
            rates = self.vectors.dot(dry.state[n : 2 * n]).tolist()
            if min(map(abs, rates)) > _TURNING * dry.speed():
                return
        q, v = dry.state[:n].copy(), dry.state[n : 2 * n].copy()
        a = dry.read(theta).accelerations
        self._stops.append((Kink(theta, q, (v, v), (a, a)), self._keeping_still()))

    def _keeping_still(self) -> list[int]:
        """Return the events whose rates are 0 because of what is held."""
        dry = self._switches.dry
        known = self._still.get(dry.held)
        if known is None:
            known = [event for event, vector in enumerate(self.vectors) if dry.keeps_still(vector)]
            self._still[dry.held] = known
        return known

    def found(self) -> list[Turn]:
        """Return all turning points since the start, with those at events that stop the integrator."""
        # Among these are the kinks of a coordinate with ``abs(v)`` or friction, and impacts.
        layout, coefficients = self._equations.layout, self._coefficients
        n, kinks = self._size, list(self._switches.dry.kinks)
        for theta, state in self._switches.modes.kinks:
            a = accelerations(layout, coefficients, theta, state[:n], state[n : 2 * n], unit=self._unit)
            v = state[n : 2 * n]
            kinks.append(Kink(theta, state[:n], (v, v), (a, a)))
        shortest = COOLDOWN * float(coefficients[0])
        for (theta, positions, velocities, turning), still in [(kink, list[int]()) for kink in kinks] + self._stops:
            if not self._swaying and velocities[0] is velocities[1]:  # nearly always: nothing turns just there
                slowest = min(map(abs, self.vectors.dot(velocities[0]).tolist()))
                if slowest > shortest * self._longest * max(largest(turning[0]), largest(turning[1])):
                    continue
            before, after, *turned = (self.vectors @ np.array([*velocities, *turning]).T).T.tolist()
            for event, contact in self._swaying:
                angles = Angles(layout, coefficients, theta)
                sways = [float(angles.sway(contact, 0, order)) for order in (1, 2)]
                for values, sway in zip((before, after, *turned), (sways[0], *sways, sways[1]), strict=True):
                    values[event] += sway
            for event, (rate, later, *changes) in enumerate(zip(before, after, *turned, strict=True)):
                change = max(map(abs, changes))
                if event in still or not change or not (rate * later < 0.0 or abs(later) <= shortest * change):
                    continue
                if not any(turn.event == event and abs(turn.theta - theta) <= _ONE_TURN for turn in self._turns):
                    self._turns.append(Turn(event, theta, (positions * self._unit).tolist()))
        return sorted(self._turns, key=lambda turn: turn.theta)
