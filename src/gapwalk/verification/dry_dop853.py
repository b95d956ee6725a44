"""Integration of orbits with dry friction or rigid stops over one period, by DOP853 between events.

Unlike `gapwalk.verification.dop853`, it finds each event, decides the modes after it on its own
(`gapwalk.verification.dry_instant`), and compares both with those that are stored afterwards. Of these it uses only
the angles of contacts so brief that its error hides them, where they matter. Steps are chosen by the error
estimate. In a step the guards of the present modes are sampled (`gapwalk.verification.guard_samples`), and an event is
located by shorter steps from the same start.

The imaginary parts of the states are changes of the motion, to first order. At an event each of these neighbours has
its own time. It is carried there along the flow before the event, reset, and carried back along the flow after it; so
the transition matrix needs no formula of its own.

Impacts are followed until flights take less than 1e-7 radians: then the contact is held.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sticking import collapses
from gapwalk.verification.dop853 import Round, error_of, method, require_one_structure, turn
from gapwalk.verification.dop853 import carry as carry_together
from gapwalk.verification.dry_equations import Change, DryEquations, Key, Modes, Sizes, Values, mismatch
from gapwalk.verification.dry_instant import EQUAL, SMALL, DryInstant
from gapwalk.verification.guard_samples import FIRES, brackets

# Arithmetic for many motions with dry friction or rigid stops at once: steps, and guards within them.
#
# Each motion is a generator: it yields a request, and is sent the reply. Requests of one type, of motions that are in
# the same modes, are answered together, the largest such set first. So each motion has its own steps and events, and a
# call of NumPy still serves hundreds of them.

Array = NDArray[np.float64]

_STEP = 1e-150  # of the complex step
_LATER = 1e-6  # radians, for the slope of a guard that is a complex step already
_ACTIVE = 384  # motions that are followed at a time


class Step(NamedTuple):
    """Request for a step of a motion and its neighbours, shape (rows, size); the motion itself is the first."""

    angle: float
    h: float
    states: Values


class Stepped(NamedTuple):
    """Reply to it: the states after the step; and of the motion itself its derivatives at both ends, shape (2, size).

    `error` is the estimated error of its state, and `turned` has its positions where they turn round within the step.
    """

    states: Values
    slopes: Array
    error: Array
    turned: Array


class Samples(NamedTuple):
    """Request for the guards at some shares of a step, interpolated from states and derivatives at its ends.

    The reply has the values of each.
    """

    angle: float
    h: float
    ends: Array
    slopes: Array
    shares: Array


class Probe(NamedTuple):
    """Request for one guard after steps of some lengths, with its slope over the angle; the reply has pairs of both."""

    angle: float
    h: Array
    state: Array
    key: Key


Request = Step | Samples | Probe
Follow = Generator[Request, object, None]


class Batch:
    """Answers to requests of motions of some systems of one structure."""

    def __init__(self, systems: Sequence[System]) -> None:
        self.equations = DryEquations(systems)

    def answer(self, asked: Sequence[Asked]) -> Sequence[object]:
        """Answer requests of one type, all in the same modes."""
        kind = type(asked[0].request)
        with np.errstate(over="ignore", invalid="ignore"):
            return {Step: self._step, Samples: self._sample, Probe: self._probe}[kind](asked)

    def _advance(self, lots: _Lots, states: Values, h: Values) -> tuple[Values, Values]:
        """Return the states after a step of each, and the derivatives at its stages and its end."""
        tableau, turns = method(), h[:, None]
        count = tableau.n_stages
        rates = np.empty((count + 1, *states.shape), dtype=states.dtype)
        rows = rates.reshape(count + 1, -1)  # a view: `np.tensordot` does the same with more ado
        rates[0] = self._rates(lots, lots.angles, states)
        for s in range(1, count):
            middle = states + turns * (tableau.A[s, :s] @ rows[:s]).reshape(states.shape)
            rates[s] = self._rates(lots, lots.angles + tableau.C[s] * h, middle)
        new = states + turns * (tableau.B @ rows[:count]).reshape(states.shape)
        rates[-1] = self._rates(lots, lots.angles + h, new)
        return new, rates

    def _rates(self, lots: _Lots, angles: Values, states: Values) -> Values:
        return self.equations.derivatives(angles, states, lots.modes, lots.levels, lots.lanes)

    def _guards(self, lots: _Lots, angles: Values, states: Values) -> dict[Key, Values]:
        return self.equations.mode_guards(angles, states, lots.modes, lots.levels, lots.sizes, lots.lanes)

    def _step(self, asked: Sequence[Asked]) -> Sequence[Stepped]:
        requests = [each.request for each in asked]
        counts = [len(each.states) for each in requests]
        lots = _Lots(asked, counts)
        states = np.concatenate([each.states for each in requests])
        first = np.cumsum([0, *counts])
        h, n = np.repeat([each.h for each in requests], counts), self.equations.size
        new, rates = self._advance(lots, states, h)
        own = first[:-1]
        slopes, turns, omega = np.real(rates[:, own]), h[own, None], self.equations.frequency[lots.lanes[own], None]
        errors = np.abs(turns * error_of(slopes))
        r0, r1 = turns * slopes[0], turns * slopes[-1]
        y0, y1 = np.real(states[own]), np.real(new[own])
        turned = turn(
            [y0[:, :n], r0[:, :n], turns * r0[:, n : 2 * n] / omega],
            [y1[:, :n], r1[:, :n], turns * r1[:, n : 2 * n] / omega],
        )
        both = slopes[[0, -1]]
        return [
            Stepped(new[a:b], both[:, k], errors[k], turned[k]) for k, (a, b) in enumerate(pairwise(first.tolist()))
        ]

    def _sample(self, asked: Sequence[Asked]) -> Sequence[dict[Key, Array]]:
        """Answer requests for samples: those for the same shares together."""
        together: dict[bytes, list[int]] = defaultdict(list)
        for number, each in enumerate(asked):
            together[each.request.shares.tobytes()].append(number)
        found: list[dict[Key, Array]] = [{} for _ in asked]
        for numbers in together.values():
            some = [asked[number] for number in numbers]
            shares, count = some[0].request.shares, len(some[0].request.shares)
            h = np.array([each.request.h for each in some])
            ends, slopes = (
                np.stack([getattr(each.request, name) for each in some], axis=1) for name in ("ends", "slopes")
            )
            own, lots = _Lots(some, [1] * len(some)), _Lots(some, [count] * len(some))
            states = self.equations.inside(shares, h, ends, slopes, own.lanes)
            angles = lots.angles + (h[:, None] * shares).ravel()
            values = self._guards(lots, angles, states.reshape(len(angles), -1))
            for key, guard in values.items():
                for number, row in zip(numbers, guard.reshape(len(some), count), strict=True):
                    found[number][key] = row
        return found

    def _probe(self, asked: Sequence[Asked]) -> Sequence[Sequence[tuple[float, float]]]:
        requests = [each.request for each in asked]
        counts = [len(each.h) for each in requests]
        lots, h = _Lots(asked, counts), np.concatenate([each.h for each in requests])
        states = np.repeat([each.state for each in requests], counts, axis=0)
        keys = [each.key for each, count in zip(requests, counts, strict=True) for _ in range(count)]
        if h.any():  # at an event itself there is nothing to integrate
            states = self._advance(lots, states, h)[0]
        found = self._slopes(lots, lots.angles + h, states, keys)
        first = np.cumsum([0, *counts]).tolist()
        return [found[a:b] for a, b in pairwise(first)]

    def _slopes(self, lots: _Lots, angles: Array, states: Array, keys: Sequence[Key]) -> Sequence[tuple[float, float]]:
        """Return one guard of each motion, and its slope over the angle."""
        rates = self._rates(lots, angles, states)
        aside = self._guards(lots, angles + 1j * _STEP, states + 1j * _STEP * rates)
        values = [float(np.real(aside[key][row])) for row, key in enumerate(keys)]
        slopes = [float(np.imag(aside[key][row]) / _STEP) for row, key in enumerate(keys)]
        creeping = [
            kind == "slip" and lots.modes.slip[index] and index in self.equations.creeping for kind, index in keys
        ]
        if any(creeping):  # the rate of a limit has been a complex step already
            later = self._guards(lots, angles + _LATER, states + _LATER * rates)
            for row, key in enumerate(keys):
                if creeping[row]:
                    slopes[row] = (float(later[key][row]) - values[row]) / _LATER
        return [*zip(values, slopes, strict=True)]


class Asked(NamedTuple):
    """A request, with the number of the motion that makes it, its modes, levels and sizes."""

    lane: int
    request: Any  # a `Request`; those that are answered together are of one type
    modes: Modes
    levels: Values
    sizes: Sizes


class _Lots:
    """Angles, lanes, levels and sizes of motions in the same modes, each as often as it has states."""

    def __init__(self, asked: Sequence[Asked], counts: Sequence[int]) -> None:
        self.modes = asked[0].modes
        self.lanes = np.repeat([each.lane for each in asked], counts)
        self.angles = np.repeat([each.request.angle for each in asked], counts)
        self.levels = np.repeat([each.levels[0] for each in asked], counts, axis=0)
        length, speed = (np.repeat([each.sizes[k][0] for each in asked], counts) for k in (0, 1))
        self.sizes = Sizes(length, speed)


class Follower:
    """A motion that is followed: a generator of requests, and what they depend on."""

    modes: Modes
    levels: Values
    sizes: Sizes

    def follow(self) -> Follow:
        """Follow the motion to its end."""
        raise NotImplementedError


def follow_together(
    systems: Sequence[System],
    begin: Callable[[int], Follower],
    end: Callable[[int, Follower | None], object],
) -> None:
    """Follow a motion of each of some systems."""
    batch, waiting = Batch(systems), deque(range(len(systems)))
    motions: dict[int, tuple[Follower, Follow]] = {}
    asked: dict[Hashable, list[Asked]] = defaultdict(list)

    def go_on(lane: int, reply: object, error: Exception | None = None) -> None:
        motion, follow = motions[lane]
        try:
            request = follow.throw(error) if error is not None else follow.send(reply)
        except StopIteration:
            end(lane, motions.pop(lane)[0])
        except (NumericalError, np.linalg.LinAlgError):
            del motions[lane]
            end(lane, None)
        else:
            asked[type(request), motion.modes.key].append(
                Asked(lane, request, motion.modes, motion.levels, motion.sizes)
            )

    while waiting or asked:
        while waiting and len(motions) < _ACTIVE:
            lane = waiting.popleft()
            try:
                motion = begin(lane)
            except (NumericalError, np.linalg.LinAlgError):
                end(lane, None)
                continue
            motions[lane] = motion, motion.follow()
            go_on(lane, None)
        if not asked:
            continue
        some = asked.pop(max(asked, key=lambda key: len(asked[key])))
        try:
            replies = batch.answer(some)
        except np.linalg.LinAlgError:  # of one of them
            for each in some:
                try:
                    (reply,) = batch.answer([each])
                except np.linalg.LinAlgError as error:
                    go_on(each.lane, None, error)
                else:
                    go_on(each.lane, reply)
            continue
        for each, reply in zip(some, replies, strict=True):
            go_on(each.lane, reply)


Found = TypeVar("Found")
Finding = Generator[Request, Any, Found]

EXACT, FINE = 2e-11, 2e-14
"""Error of a step, relative to the motion; and where changes of the motion grow much, as beside a graze."""

_PERIOD = 2.0 * math.pi
_BARELY = 1e-8  # excess of a force over its bound where friction would slip for no time, as at switching-sliding
_HOP = 1e-3  # angle of a flight that is located from its parabola, and of a step while slip pauses
_SLOW = 1e-4  # share of the velocities below which an event may be too slow to be found
_SECTION = 1e-10  # radians before the end in which an impact may come before or after it, by rounding
_SHORTEST = 1e-9  # angle of a step that is taken whatever its error is
_STEPS = 8000  # the most in a period: those in pauses, and as many as it may take besides
_MOST = 4000  # events in a period
_AT_ONCE = 40  # events at one angle


@dataclass(frozen=True)
class DryRound(Round):
    """Result of integrating an orbit with friction or rigid stops over one period."""

    #: shape (state size, state size): Derivative of the final state by the initial one.
    transition: Array | None = None
    changes: tuple[Change, ...] = ()  #: The modes at the start, then the events that were found.
    #: Largest factor by which a small change of the initial state has grown at an event; at least 1.
    growth: float = 1.0


def carry(
    orbits: Sequence[Orbit], report: Callable[[int], object] | None = None, exact: float = EXACT
) -> Sequence[Round]:
    """Integrate orbits of one structure over one period, each by the integrator for its system.

    See `gapwalk.verification.dop853.carry`; those with friction or rigid stops give a `DryRound`, and their steps have
    an error of `exact` at most, relative to the motion.
    """
    if not orbits or not collapses(orbits[0].system):
        return carry_together(orbits, report)
    require_one_structure(orbits)
    rounds: dict[int, Round] = {}

    def end(number: int, motion: Follower | None) -> None:
        assert motion is None or isinstance(motion, _Motion)
        rounds[number] = _round(orbits[number], motion)
        if report is not None:
            report(len(rounds))

    follow_together([orbit.system for orbit in orbits], lambda number: _Motion(orbits[number], exact), end)
    return [rounds[number] for number in range(len(orbits))]


def _round(orbit: Orbit, motion: _Motion | None) -> DryRound:
    """Return the result of a motion; closure and the error are infinite if it failed."""
    n = orbit.system.size
    if motion is None:
        return DryRound(math.inf, math.inf, math.nan, np.full((n, 2), math.nan), math.inf)
    scales = motion.scales
    end = np.real(motion.states[0])
    gap = np.abs(end - orbit.state) / scales
    extremes = np.column_stack((motion.largest, motion.smallest))
    transition = (np.imag(motion.states[1:]) / SMALL).T
    changes = tuple(motion.changes)
    closure = float(gap.max())
    return DryRound(
        closure if math.isfinite(closure) else math.inf,
        mismatch(orbit, changes),
        math.nan,
        extremes,
        motion.error,
        least=motion.length,
        transition=transition,
        changes=changes,
        growth=motion.growth,
    )


class _Motion(DryInstant, Follower):
    """The motion of an orbit and of its neighbours, one for each direction of the state space."""

    def __init__(self, orbit: Orbit, exact: float = EXACT) -> None:
        super().__init__(orbit)
        self._exact, self.growth = exact, 1.0
        equations, n = self.equations, self.equations.size
        self.error, self._step, self._steps, self._to = 0.0, 1e-3, _STEPS * orbit.period, _PERIOD * orbit.period
        self.largest, self.smallest = np.real(orbit.state[:n]).copy(), np.real(orbit.state[:n]).copy()
        self._pieces = sorted(
            {float(angle) + _PERIOD * k for k in range(orbit.period) for own in equations.jumps(0) for angle in own}
        )
        hosts = {equations.host_of(index) for index in equations.dry}
        matter = {switch for switch, index in enumerate(equations.contact_of) if index in hosts} | {*equations.rigid}
        self._grazes = {
            each.theta: (each.switch, each.enters)
            for each in orbit.events
            if each.switch in matter and abs(each.velocity) < _SLOW * self.speed
        }
        since = _PERIOD * orbit.period - _SECTION
        self._last = {each.switch for each in orbit.events if each.switch in equations.rigid and each.theta > since}
        self.changes = [Change("slip", index, slip, 0.0, 0.0) for index, slip in self.modes.slip.items()]
        soft = [switch for switch in range(len(equations.signs)) if switch not in equations.rigid]
        self.changes += [Change("contact", switch, int(self.modes.closed[switch]), 0.0, 0.0) for switch in soft]

    def follow(self) -> Follow:
        """Integrate over the period."""
        equations, repeated, count, last, missing, end = self.equations, 0, 0, -1.0, {*self._last}, self._to
        for stop in [*(angle for angle in sorted({*self._pieces, *self._grazes}) if 0.0 < angle < end), end]:
            self.levels = equations.levels(np.array([0.5 * (self.theta + stop)]))
            while self.theta < stop:
                key = yield from self._advance(stop)
                if key is None:
                    continue
                if self.theta > end - _SECTION and self._is_impact(key):
                    if key[1] not in missing:
                        self.theta = end  # the stored motion ends before it
                        break
                    missing.discard(key[1])
                repeated = repeated + 1 if self.theta - last <= 1e-14 * (1.0 + self.theta) else 0
                count += 1
                if repeated > _AT_ONCE or count > _MOST:
                    raise NumericalError("events repeat")
                last = self.theta
                self._slack = _BARELY if repeated else EQUAL
                yield from self._pass(key)
            if stop in self._grazes and self._may_graze(*self._grazes[stop]):
                yield from self._pass(("contact", self._grazes[stop][0]))
        for switch in missing:  # the stored motion ends after its impact
            gap, rate = self._gap(switch)
            if switch not in self.modes.held and rate < 0.0 and abs(gap) <= FIRES * self.length:
                yield from self._pass(("contact", switch))
        self._slack = EQUAL
        self.angles = np.full(len(self.states), self.theta)
        equations.set_extensions(self.angles, self.states, self.modes, self.levels)

    def _is_impact(self, key: Key) -> bool:
        """Return True if an event is an impact on a rigid stop."""
        return key[0] == "contact" and key[1] in self.equations.rigid and key[1] not in self.modes.held

    def _may_graze(self, switch: int, enters: bool) -> bool:
        """Return True if the motion is about to turn back from a breakpoint that it may pass or not, by its error.

        An impact so slow changes the rates by little, and their derivatives by much, as the inverse of its speed; and
        friction of a stage that opens or closes for a moment may do something else from there on. This is the one
        thing that is taken from the stored events: at their angle the rate is known as well as elsewhere.
        """
        gap, rate = self._gap(switch)
        if switch in self.modes.held or bool(self.modes.closed[switch]) is enters or abs(gap) > FIRES * self.length:
            return False
        side = 1.0 if enters else -1.0
        turning = self.equations.turning(np.array([self.theta]), self._now())[0]
        back = -side * self.equations.signs[switch] * float(turning[self.equations.contact_of[switch]])
        return side * rate < 0.0 < back and rate**2 < 4.0 * FIRES * self.length * back

    def _advance(self, stop: float) -> Finding[Key | None]:
        """Take one step, to the first event in it if there is any; return that."""
        self._steps -= 1
        if self._steps < 0:
            raise NumericalError("the motion takes too many steps")
        self._end_pauses()
        hops = self._hops()
        most = min([stop - self.theta, *(1.5 * hop for hop in hops.values()), *(_HOP for _ in self.modes.pausing)])
        h = min(self._step, most)
        while True:
            stepped: Stepped = yield Step(self.theta, h, self.states)
            error = float((stepped.error / self.scales).max())
            if not math.isfinite(error):
                raise NumericalError("the motion diverges")
            ratio = 0.9 * (error / self._exact + 1e-12) ** -0.125
            if error <= self._exact or h < _SHORTEST:
                break
            h *= max(0.2, ratio)
        longer = max(self._step, h) if h == most else h
        self._step = min(longer * min(4.0, max(ratio, 0.2)), 0.5)
        found, key = (yield from self._first_event(h, stepped, hops)), None
        if found is not None:
            h, key = found
            if h > 0.0:
                stepped = yield Step(self.theta, h, self.states)
        if h > 0.0:
            self.error += error
            for seen in (stepped.turned, np.real(stepped.states[0, : self.equations.size])):
                np.maximum(self.largest, seen, out=self.largest)
                np.minimum(self.smallest, seen, out=self.smallest)
            self.states = stepped.states
        self.theta = self.theta + h if found is not None or h < stop - self.theta else stop
        return key

    def _hops(self) -> dict[Key, float]:
        """Return the angles until rigid stops are hit that are near, by parabolas."""
        equations, found = self.equations, {}
        if not equations.rigid:
            return found
        turning = equations.turning(np.array([self.theta]), self._now())[0]
        for switch in equations.rigid:
            if switch not in self.modes.held:
                gap, rate = self._gap(switch)
                bend = -equations.signs[switch] * float(turning[equations.contact_of[switch]])
                if bend < 0.0:
                    root = (rate + math.sqrt(max(rate**2 - 2.0 * bend * gap, 0.0))) / -bend * equations.omega
                    if rate < 0.0 and gap <= 0.0:  # a step has ended on the stop
                        found["contact", switch] = 0.0
                    elif 0.0 < root < _HOP:
                        found["contact", switch] = root
        return found

    def _first_event(self, h: float, stepped: Stepped, hops: dict[Key, float]) -> Finding[tuple[float, Key] | None]:
        found = []
        for key, guess in hops.items():
            share = guess
            for _ in range(4):
                value, slope = yield from self._guard_after(share, key)
                if slope < 0.0:
                    share = max(share - value / slope, 0.0)
            if share <= h:
                found.append((share, key))
        for key, (last, after) in (yield from self._brackets(h, stepped, hops)).items():
            for first in after.tolist():
                at_first = yield from self._guard_after(first * h, key)
                if at_first[0] < -0.1 * FIRES:
                    break  # the interpolation is less exact than that: it may be above zero before
            else:
                continue
            at_last = (yield from self._guard_after(last * h, key))[0]
            if at_last <= 0.0 < last:  # as here, in a dip that is as shallow as that
                last, at_last = 0.0, (yield from self._guard_after(0.0, key))[0]
            root = 0.0 if at_last <= 0.0 else (yield from self._root(last * h, first * h, key, at_first))
            found.append((root, key))
        return min(found) if found else None

    def _brackets(self, h: float, stepped: Stepped, hops: dict[Key, float]) -> Finding[dict[Key, tuple[float, Array]]]:
        """Answer the search for guards that pass below zero."""
        ends, search = np.real((self.states[0], stepped.states[0])), brackets()
        shares, key = next(search)
        while True:
            if key is None:
                values = yield Samples(self.theta, h, ends, stepped.slopes, shares)
                reply = {other: each for other, each in values.items() if other not in hops}
            else:
                found = yield Probe(self.theta, h * shares, np.real(self.states[0]), key)
                reply = np.array(found)[:, 0]
            try:
                shares, key = search.send(reply)
            except StopIteration as done:
                return done.value

    def _root(self, low: float, high: float, key: Key, at_high: tuple[float, float]) -> Finding[float]:
        """Locate a sign change by Newton's method within a bracket that shrinks; `at_high` are value and slope there.

        It ends when the next step, by the ratio of the last two, would be rounding: each evaluation costs a whole step.
        """
        exact, share, last = 4e-16 * (1.0 + self.theta), high, 0.0
        for number in range(60):
            value, slope = (yield from self._guard_after(share, key)) if number else at_high
            if value > 0.0:
                low = share
            else:
                high = share
            step = -value / slope if slope else math.inf
            inside = low <= share + step <= high
            better = share + step if inside else 0.5 * (low + high)
            if abs(better - share) <= exact or high - low <= 1e-16:
                return better
            if inside and last and abs(step) ** 3 <= exact * last**2:
                return better
            share, last = better, step if inside else 0.0
        return share

    def _guard_after(self, h: float, key: Key) -> Finding[tuple[float, float]]:
        """Return a guard and its slope over the angle after a step of some length."""
        (found,) = yield Probe(self.theta, np.array([h]), np.real(self.states[0]), key)
        return found

    def _width(self, key: Key) -> float:
        """Return the change of a guard for a change of a state by the size of the motion, velocities as lengths."""
        unit, n = np.ones(len(self.states[0])), self.equations.size
        unit[n : 2 * n] = self.equations.omega
        states = np.real(self.states[:1]) + 1j * _STEP * np.diag(unit)
        found = self._guards(np.full(len(unit), self.theta, complex), states)[key]
        return self.length * (float(np.abs(np.imag(found)).max() / _STEP) or 1.0)

    def _guards(self, angles: Values, states: Values) -> dict[Key, Values]:
        return self.equations.mode_guards(angles, states, self.modes, self.levels, self.sizes)

    def _pass(self, key: Key) -> Finding[None]:
        """Pass an event with all neighbours, each at its own time."""
        moved = (np.imag(self.states[1:]) / SMALL).T
        self.growth = max(self.growth, float(np.linalg.norm(moved * self.scales / self.scales[:, None], 2)))
        before, everyone = self._rates(self.theta, self.states), np.full(len(self.states), self.theta)
        slips, closed, held = dict(self.modes.slip), self.modes.closed.copy(), set(self.modes.held)
        slope = (yield from self._guard_after(0.0, key))[1]
        values, width = self._guards(everyone, self.states)[key], self._width(key)
        delays = -np.imag(values) / slope if slope else np.zeros(len(values))
        self.states = self.states + 1j * delays[:, None] * np.real(before)
        self.angles = everyone + 1j * delays
        self.equations.set_extensions(self.angles, self.states, self.modes, self.levels)
        self._pressed.clear()
        self._change(key)
        after = self._rates(self.theta, self.states)
        self.states = self.states - 1j * delays[:, None] * np.real(after)
        if key[0] == "contact":
            mode = key[1] not in held if key[1] in self.equations.rigid else not closed[key[1]]
            self.changes.append(Change(*key, int(mode), self.theta, slope / width))
        # an impulse releases held stops, or strikes them: an impact each, even if they stay held
        opened = held - self.modes.held - {key[1] if key[0] == "contact" else None}
        self.changes += [Change("contact", other, 0, self.theta, slope / width) for other in sorted(opened)]
        for other, speed in self._pressed:
            change = speed / (self.equations.omega * self.length)
            self.changes.append(Change("contact", other, 1, self.theta, change))
        for other, slip in self.modes.slip.items():
            if slip != slips[other]:
                self.changes.append(Change("slip", other, slip, self.theta, slope / width))
