"""Samples of the guards of events within a step of an integration: which of them pass below zero, and where first.

A guard is sampled at some shares of the step. Where it is positive at all of them, it may still dip below zero between
two, as at a touch that is shorter than a tenth of the step. So a smallest sample between two larger ones is refined,
until a parabola through the three stays well above zero. Near zero this is done with exact values, since samples are
interpolated.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.equations import smallness
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sticking import collapses
from gapwalk.verification.dop853 import Round, error_of, method, require_one_structure, turn
from gapwalk.verification.dop853 import carry as carry_together
from gapwalk.verification.friction_equations import Change, DryEquations, Key, Loading, Modes, Sizes, Values, mismatch

FIRES = 1e-11
"""Share of its scale by which a guard is beyond zero once it has changed its sign."""

# dense at both ends: a dip just before the end of a step would otherwise be between two steps, and in neither
_SHARES = np.concatenate(
    ([0.0], 0.5 ** np.arange(28.0, 4.0, -4.0), np.arange(1, 8) / 8.0, 1.0 - 0.5 ** np.array([8.0, 20.0]), [1.0])
)
_CLOSER = 8  # parts of an interval that is looked at more closely
_DEEPEST = 6  # times that it is
_ROUGH = 1e-2  # share of its scale by which an interpolated sample of a guard may be off
_CLEAR = 0.5  # share of its smallest sample above which the parabola is clear of zero

Array = NDArray[np.float64]
Found = TypeVar("Found")
Search = Generator[tuple[Array, Key | None], Any, Found]


def brackets() -> Search[dict[Key, tuple[float, Array]]]:
    """Find the guards that pass below zero in a step, each with a share of the step before that, and all those after.

    It is a generator. It yields increasing shares of the step, from 0 to 1, and None, and is sent the interpolated
    values of each guard; or it yields shares and the key of a guard, and is sent its exact values, which may take long.
    """
    found = {}
    for key, values in (yield _SHARES, None).items():
        shares = _SHARES
        below = np.flatnonzero(values[1:] < -FIRES) + 1
        if not len(below):
            shares, values = yield from _dip(key, shares, values)
            below = np.flatnonzero(values < -FIRES)
        if len(below):
            above = np.flatnonzero(values[: below[0]] > FIRES)
            found[key] = (float(shares[above[-1]]) if len(above) else 0.0, shares[below])
    return found


def _dip(key: Key, shares: Array, values: Array) -> Search[tuple[Array, Array]]:
    """Return samples near a dip of a guard below zero, or no samples."""
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:])) + 1
    for place in inner:
        near, seen = shares[place - 1 : place + 2], values[place - 1 : place + 2]
        known = False
        for _ in range(_DEEPEST):
            is_rough = seen[1] < _ROUGH
            if (known or not is_rough) and _lowest(near, seen) > _CLEAR * seen[1]:
                break
            closer, known = np.linspace(near[0], near[2], _CLOSER + 1), is_rough
            again = (yield closer, key) if is_rough else (yield closer, None)[key]
            if again.min() < -FIRES:
                return closer, again
            middle = int(np.clip(np.argmin(again), 1, _CLOSER - 1))
            near, seen = closer[middle - 1 : middle + 2], again[middle - 1 : middle + 2]
    return shares[:0], values[:0]


def _lowest(shares: Array, values: Array) -> float:
    """Return the lowest value of the parabola through three points, of which the middle one is the lowest."""
    left, right = ((values[k] - values[1]) / (shares[k] - shares[1]) for k in (0, 2))
    bend = (right - left) / (shares[2] - shares[0])
    slope = left + bend * (shares[1] - shares[0])
    return float(values[1] - (0.25 * slope**2 / bend if bend > 0.0 else 0.0))


# A motion with dry friction or rigid stops at one instant: its states, its modes, and how events change them.
#
# It decides the modes of a start and those after an event on its own, from the equations of `DryEquations`, and knows
# nothing of the modes that are stored with an orbit. A mode lasts as long as its guard is positive.
#
# States have small imaginary parts, one set for each direction in the state space: those are the changes of the
# motion, to first order.

SMALL = 1e-25
"""Size of the imaginary parts: rounding does not see their squares."""

EQUAL = 1e-11  # share of its bound by which a force in stick may exceed it by rounding
_IMPACTS_AT_ONCE = 200  # the most impacts at one instant
_STILL = 1e-11  # slip rate, relative to the velocities, within which friction may stick
_LEAST = 1e-3  # share of the small length of a system below which a motion is rest
_HELD = 1e-7  # angle of a flight that is not made any more


class DryInstant:
    """The states and modes of the motion of an orbit, and of its neighbours, at one instant.

    Shapes: `states` (state size + 1, state size).

    Attributes
    ----------
    theta, angles
        The angle of the motion, and those of all: it, and one neighbour for each direction of the state space.
    modes, levels
        What is closed, slips and is held; and the levels of numbers that jump.
    length, speed, scales
        The size of the motion, of its velocities, and of each part of a state.
    """

    def __init__(self, orbit: Orbit) -> None:
        equations = self.equations = DryEquations([orbit.system])
        n, size = equations.size, equations.state_size
        self.theta, self.angles = 0.0, np.zeros(size + 1)
        self.states = np.tile(orbit.state.astype(complex), (size + 1, 1))
        self.states[1:] += 1j * SMALL * np.eye(size)
        least = _LEAST * smallness(orbit.system)  # friction may keep all at rest
        length = max(float(np.abs(orbit.extremes).max()), float(np.abs(orbit.state[:n]).max()), least)
        speed = max(float(np.abs(orbit.state[n : 2 * n]).max()), length * equations.omega)
        self.scales = np.full(size, length)
        self.scales[n : 2 * n] = speed
        self.length, self.speed, self._slack = length, speed, EQUAL
        self.sizes = Sizes(np.array([length]), np.array([speed]))
        self.levels = equations.levels(np.array([1e-9]))
        self._stopped, self._began = dict[int, float](), dict[int, float]()
        self._pressed: list[tuple[int, float]] = []  # held stops that an impulse strikes, with the speed of the impact
        self.modes = self._start()

    def _now(self) -> Loading:
        """Return the loading of the motion itself."""
        return self.equations.loading(np.array([self.theta]), np.real(self.states[:1]), self.modes, self.levels)

    def _gap(self, switch: int) -> tuple[float, float]:
        """Return the distance of the motion from a breakpoint, positive where it is open, and its rate over time."""
        equations, n = self.equations, self.equations.size
        angle, state = np.array([self.theta]), np.real(self.states[:1])
        index = equations.contact_of[switch]
        depth = equations.depths(equations.deflections(angle, state[:, :n]))[0, switch]
        rate = equations.deflections(angle, state[:, n : 2 * n] / equations.omega, derivative=1)[0, index]
        return -float(depth), -float(equations.signs[switch] * rate) * equations.omega

    def _slip_rate(self, index: int) -> float:
        return float(self.equations.sliding(np.array([self.theta]), np.real(self.states[:1]))[0, index])

    def _start(self) -> Modes:
        equations = self.equations
        modes = self.modes = Modes(np.zeros(len(equations.signs)), dict.fromkeys(equations.dry, 0), set())
        for switch in range(len(equations.signs)):
            gap, rate = self._gap(switch)
            on = abs(gap) <= 1e-12 * self.length
            if switch not in equations.rigid and ((gap < 0.0 and not on) or (on and rate < 0.0)):
                modes.closed[switch] = 1.0
        for index in equations.dry:
            if index not in equations.memories:
                rate = self._slip_rate(index)
                modes.slip[index] = 0 if abs(rate) <= _STILL * self.speed else round(math.copysign(1.0, rate))
        self._decide()
        for index in equations.memories:
            self._set_slider(index)
        self._decide()
        for switch in equations.rigid:
            gap, rate = self._gap(switch)
            if abs(gap) <= 1e-12 * self.length and abs(rate) <= _STILL * self.speed:
                self._strike(switch)
        equations.come_to_rest(self.angles, self.states, modes, positions=True)
        equations.set_extensions(self.angles, self.states, modes, self.levels)
        return modes

    def _set_slider(self, index: int) -> None:
        """Decide the mode of a Jenkins element by its extension, which is not beyond its limit."""
        equations, place = self.equations, self.equations.memories[index]
        limit = float(self._now().limits[index][0]) / equations.stiffnesses[index]
        z = float(np.real(self.states[0, place]))
        self.modes.slip[index] = 0
        grown = limit > 1e-12 * self.length
        if grown and abs(z) < limit * (1.0 - 1e-12):
            return
        side = round(math.copysign(1.0, z if grown else self._slip_rate(index)))
        if equations.is_idle(index, np.array([limit]), self.modes)[0]:
            self.states[:, place] = 0.0
            return
        self.modes.slip[index] = side
        self.equations.set_extensions(self.angles, self.states, self.modes, self.levels)
        if not self._sliding(index) > 0.0:
            self.modes.slip[index] = 0

    def _sliding(self, index: int) -> float:
        """Return the rate of the slider of a Jenkins element in the direction of its slip."""
        creep = self.equations.creep(index, np.array([self.theta]), self.states[:1], self.modes, self.levels)[0]
        return self.modes.slip[index] * self._slip_rate(index) - float(creep)

    def _decide(self, slipping: Sequence[int] = ()) -> None:
        """Decide which rigid friction at rest sticks: as many as can; `slipping` have just begun to slip."""
        equations, modes = self.equations, self.modes
        at_rest = [
            index
            for index in equations.dry
            if index not in equations.memories
            and index not in slipping
            and abs(self._slip_rate(index)) <= _STILL * self.speed
        ]
        for slips in sorted(product((0, 1, -1), repeat=len(at_rest)), key=lambda each: sum(map(abs, each))):
            modes.slip.update(zip(at_rest, slips, strict=True))
            try:
                now = self._now()
            except np.linalg.LinAlgError:  # too many would stick
                continue
            if all(self._may(index, slip, now) for index, slip in zip(at_rest, slips, strict=True)):
                break
        else:
            raise NumericalError("no modes of friction are consistent")
        equations.come_to_rest(self.angles, self.states, modes)

    def _may(self, index: int, slip: int, now: Loading) -> bool:
        """Return True if friction at rest may stick, or begin to slip in a direction."""
        bound = float(now.breakaways[index][0])
        if not slip:
            return bound > 0.0 and abs(float(now.forces[0, index])) <= bound * (1.0 + self._slack)
        turning = self.equations.turning(np.array([self.theta]), now)[0, index]
        return slip * float(turning) > (0.0 if bound else -1e-12 * self.speed * self.equations.omega)

    def _strike(self, switch: int) -> None:
        """Reverse the rate at a rigid stop, and at those held that this impulse drives the motion into."""
        # Stops at which the next flight is short are held. Before the modes are decided, the stops that are held have a
        # rate: an impulse that pulls releases them.
        equations, modes, still = self.equations, self.modes, _STILL * self.speed
        struck, touching = [switch], sorted(modes.held - {switch})
        if self._gap(switch)[1] < 0.0:
            modes.held.discard(switch)
            equations.rebound(switch, self.angles, self.states)
            while (into := self._driven_into([switch, *touching], struck[-1])) is not None and len(
                struck
            ) < _IMPACTS_AT_ONCE:
                if into not in struck:
                    self._pressed.append((into, -self._gap(into)[1]))
                struck.append(into)
                equations.rebound(into, self.angles, self.states)
            modes.held -= {other for other in touching if self._gap(other)[1] > still}
            self._after_impact()
        for each in dict.fromkeys(struck):
            index, side = int(equations.contact_of[each]), equations.signs[each]
            leaves = max(self._gap(each)[1], 0.0)
            turning = -side * float(equations.turning(np.array([self.theta]), self._now())[0, index])
            if turning < 0.0 and 2.0 * leaves * equations.omega < _HELD * -turning:
                modes.held.add(each)
                equations.come_to_rest(self.angles, self.states, modes)
                self._decide()

    def _driven_into(self, touching: Sequence[int], last: int) -> int | None:
        """Return a stop among those that the motion touches which it is driven into by the last impulse."""
        into = (each for each in touching if each != last and self._gap(each)[1] < -_STILL * self.speed)
        return next(into, None)

    def _after_impact(self) -> None:
        for index in self.equations.dry:
            rate = self._slip_rate(index)
            if index in self.equations.memories:
                if self.modes.slip[index]:
                    self._set_slider(index)
            elif abs(rate) > _STILL * self.speed:
                self.modes.slip[index] = round(math.copysign(1.0, rate))
        self._decide()

    def _change(self, key: tuple[str, int]) -> None:
        """Set the modes after an event."""
        equations, modes, (kind, index) = self.equations, self.modes, key
        released: tuple[int, ...] = ()
        kept = self._kept()
        if kind == "contact" and index in equations.rigid:
            if index in modes.held:
                modes.held.discard(index)
            else:
                self._strike(index)
        elif kind == "contact":
            modes.closed[index] = 1.0 - modes.closed[index]
            for other in equations.memories:
                if equations.host_of(other) == equations.contact_of[index]:
                    self._set_slider(other)
        elif index in equations.memories:
            z = float(np.real(self.states[0, equations.memories[index]]))
            if modes.slip[index]:
                modes.slip[index], self._stopped[index] = 0, self.theta
            else:
                modes.slip[index], self._began[index] = round(math.copysign(1.0, z)), self.theta
                if self.theta == self._stopped.get(index):
                    modes.pausing.add(index)
        elif not modes.slip[index]:
            modes.slip[index] = round(math.copysign(1.0, float(self._now().forces[0, index])))
            released = (index,)
        self._decide(released)
        if self._kept() - kept:
            self._stop_sliders()

    def _kept(self) -> set[Key]:
        """Return the rigid friction that sticks and the stops that are held: what keeps a rate at zero."""
        equations, modes = self.equations, self.modes
        stuck = {index for index in equations.dry if index not in equations.memories and not modes.slip[index]}
        return {("slip", index) for index in stuck} | {("contact", switch) for switch in modes.held}

    def _stop_sliders(self) -> None:
        """End the slip of Jenkins elements that stop with what has just come to rest."""
        # Their guards would stay within rounding of zero as long as that keeps them there.
        for index in self.equations.memories:
            slips = self.modes.slip[index] and self._began.get(index) != self.theta
            if slips and abs(self._sliding(index)) <= _STILL * self.speed:
                self.modes.slip[index], self._stopped[index] = 0, self.theta

    def _end_pauses(self) -> None:
        """End the pauses of elements whose slip rate has its direction again, or whose slip has ended otherwise."""
        for index in [*self.modes.pausing]:
            slip = self.modes.slip[index]
            if not slip or slip * self._slip_rate(index) > FIRES * self.speed:
                self.modes.pausing.discard(index)

    def _rates(self, angle: float, states: Values) -> Values:
        return self.equations.derivatives(np.full(len(states), angle), states, self.modes, self.levels)


# Integration of orbits with dry friction or rigid stops over one period, by DOP853 between events.
#
# Unlike `gapwalk.verification.dop853`, it finds each event, decides the modes after it on its own, and compares both
# with those that are stored afterwards. Of these it uses only the angles of contacts so brief that its error hides
# them, where they matter. Steps are chosen by the error estimate. In a step the guards of the present modes are
# sampled, and an event is located by shorter steps from the same start.
#
# The imaginary parts of the states are changes of the motion, to first order. At an event each of these neighbours has
# its own time. It is carried there along the flow before the event, reset, and carried back along the flow after it;
# so the transition matrix needs no formula of its own.
#
# Impacts are followed until flights take less than 1e-7 radians: then the contact is held.

# Arithmetic for many motions with dry friction or rigid stops at once: steps, and guards within them.
#
# Each motion is a generator: it yields a request, and is sent the reply. Requests of one type, of motions that are in
# the same modes, are answered together, the largest such set first. So each motion has its own steps and events, and a
# call of NumPy still serves hundreds of them.


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
    systems: Sequence[System], begin: Callable[[int], Follower], end: Callable[[int, Follower | None], object]
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
    """Integrate orbits of one structure over one period, each by the integrator for its system."""
    # See `gapwalk.verification.dop853.carry`; those with friction or rigid stops give a `DryRound`, and their steps
    # have an error of `exact` at most, relative to the motion.
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
    gap = np.abs(end - orbit.state - np.pad(orbit.drift, (0, len(end) - n))) / scales
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
        """Return True if the motion is about to turn back from a breakpoint that it may pass or not, by its error."""
        # An impact so slow changes the rates by little, and their derivatives by much, as the inverse of its speed; and
        # friction of a stage that opens or closes for a moment may do something else from there on. This is the one
        # thing that is taken from the stored events: at their angle the rate is known as well as elsewhere.
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
