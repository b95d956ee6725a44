"""Arithmetic for many motions with dry friction or rigid stops at once: steps, and guards within them.

Each motion is a generator: it yields a request, and is sent the reply. Requests of one type, of motions that are in the
same modes, are answered together, the largest such set first. So each motion has its own steps and events, and a call
of NumPy still serves hundreds of them.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Generator, Hashable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.verification.dop853 import error_of, method, turn
from gapwalk.verification.dry_equations import DryEquations, Key, Modes, Sizes, Values

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
