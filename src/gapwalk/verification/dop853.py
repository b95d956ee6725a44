"""Integration of orbits over one period by another method: Dormand and Prince's of order 8, between contact events.

All orbits of a branch are integrated together, with fixed steps (Hairer, Norsett and Wanner, Solving ODEs I, section
II.10) and the coefficients of `scipy.integrate.DOP853`. The contact events are those stored with an orbit; it is
checked that the motion passes its breakpoints there, and nowhere else. The events belong to an orbit about 1e-7 away,
which costs digits of the closure. If that matters, they are located again on the motion itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.independent_equations import Equations

Array = NDArray[np.float64]

_PERIOD = 2.0 * math.pi
_FINER = 5.0  # steps at the first attempt, per step of the flow's Taylor series, whose order is about 20
_IN_PIECE = 2.0  # smallest number of such Taylor steps between two contact events
_TRIES = 4  # number of attempts, each with twice as many steps
_EXACT = 5e-11  # error of the integration, relative to the motion, that is small enough
_AGAIN = 1e-10  # closure above which the contact events are located again
_PASSES = 6  # number of times that they are: where the force jumps, moving an event moves those after it
_ASIDE = 1e-5  # largest angle by which an event may be moved: farther away there is another event
_LANES = 2048  # number of orbits that are integrated at once
_NUMBERS = 4_000_000  # of the matrices of so many orbits


@dataclass(frozen=True)
class Round:
    """Result of integrating an orbit over one period.

    Attributes
    ----------
    closure
        Largest component of the difference between end and start, relative to the largest position or velocity.
    astray
        Largest depth of a deflection on one side of a breakpoint while the stored orbit is on its other side, relative
        to the largest position.
    contraction
        Logarithm of the factor by which volumes of the state space change.
    extremes : shape (n, 2)
        Maximum and minimum of each coordinate.
    error
        Estimated error of this integration, relative to the motion.
    shifts
        For each contact event, the delay with which the motion passes its breakpoint; 0 if it is large or unknown.
    """

    closure: float
    astray: float
    contraction: float
    extremes: Array
    error: float
    shifts: tuple[float, ...] = ()


def carry(orbits: Sequence[Orbit], report: Callable[[int], object] | None = None) -> list[Round]:
    """Integrate orbits of one structure over one period; `report` is called with the number of completed ones.

    Raises
    ------
    ValueError
        If their systems are of different structures.
    """
    if len({id(orbit.system.structure) for orbit in orbits}) > 1 and len({o.system.structure for o in orbits}) > 1:
        raise ValueError("orbits of systems of different structure cannot be integrated together")
    rounds: list[Round] = []
    size = orbits[0].system.size if orbits else 1
    lanes = max(1, min(_LANES, _NUMBERS // (size * (2 * size + 4))))
    for first in range(0, len(orbits), lanes):
        rounds += _carry(orbits[first : first + lanes])
        if report is not None:
            report(len(rounds))
    return rounds


def _carry(orbits: Sequence[Orbit]) -> list[Round]:
    rounds = _around(orbits, _FINER)
    finer = _FINER
    for _ in range(_TRIES - 1):
        rough = [index for index, each in enumerate(rounds) if not each.error <= _EXACT]
        if not rough:
            break
        finer *= 2.0
        for index, better in zip(rough, _around([orbits[index] for index in rough], finer), strict=True):
            rounds[index] = better
    moved = list(orbits)
    for _ in range(_PASSES):
        open_ended = [index for index, each in enumerate(rounds) if each.closure > _AGAIN and any(each.shifts)]
        if not open_ended:
            break
        for index in open_ended:
            end = _PERIOD * orbits[index].period
            events = [
                event._replace(theta=min(max(event.theta + shift, 0.0), end))
                for event, shift in zip(moved[index].events, rounds[index].shifts, strict=True)
            ]
            moved[index] = replace(moved[index], events=tuple(sorted(events, key=lambda event: event.theta)))
        for index, better in zip(open_ended, _around([moved[index] for index in open_ended], finer), strict=True):
            # whether stages change at the stated events is judged by the events as they are stored
            rounds[index] = replace(better, astray=rounds[index].astray)
    return rounds


def _around(orbits: Sequence[Orbit], finer: float) -> list[Round]:
    states = np.array([orbit.state for orbit in orbits])
    n = orbits[0].system.size
    everyone = Equations([orbit.system for orbit in orbits])
    inside = everyone.depths(everyone.deflections(states[:, :n])) > 0.0
    plans = [_plan(orbit, inside[index], finer) for index, orbit in enumerate(orbits)]
    order = sorted(range(len(orbits)), key=lambda index: -len(plans[index][0]))
    counts = np.array([len(plans[index][0]) for index in order])
    theta, length = (np.zeros((counts[0], len(orbits))) for _ in range(2))
    closed = np.zeros((counts[0], len(orbits), inside.shape[1]))
    for lane, index in enumerate(order):
        count = counts[lane]
        theta[:count, lane], length[:count, lane], closed[:count, lane], _ = plans[index]
    equations = Equations([orbits[index].system for index in order])
    motions = _Motions(equations, states[order])
    crossings: dict[int, list[tuple[int, int]]] = {}
    for lane, index in enumerate(order):
        for step, switch in plans[index][3]:
            crossings.setdefault(step, []).append((lane, switch))
    motions.cross(crossings.get(-1, ()))
    for k in range(counts[0]):
        active = int(np.searchsorted(-counts, -k))  # those with more than k steps come first
        motions.advance(slice(0, active), theta[k, :active], length[k, :active], closed[k, :active])
        motions.cross(crossings.get(k, ()))
    return [motions.round(lane) for lane in np.argsort(order).tolist()]


def _plan(orbit: Orbit, inside: NDArray[np.bool_], finer: float) -> tuple[Array, Array, Array, list[tuple[int, int]]]:
    """Return the steps of one orbit: start and length of each, the stages that act in it, and the contact events.

    The latter are the numbers of the steps after which they are, with their switches, in the order of the events.
    """
    end = _PERIOD * orbit.period
    step = end / max(8.0 * orbit.period, finer * orbit.steps)
    closed = inside.copy()
    for event in reversed(orbit.events):
        closed[event.switch] = not event.enters  # before its first event a stage is in the opposite state
    thetas, lengths, stages, crossings, start = [], [], [], [], 0.0
    for theta, event in [*((event.theta, event) for event in orbit.events), (end, None)]:
        if theta > start:
            # contact with a stop lasts half a period of an oscillation that may be far faster than the rest
            count = max(math.ceil((theta - start) / step), math.ceil(_IN_PIECE * finer))
            length = (theta - start) / count
            thetas += [start + k * length for k in range(count)]
            lengths += [length] * count
            stages += [closed.astype(float)] * count
            start = theta
        if event is not None:
            closed[event.switch] = event.enters
            crossings.append((len(thetas) - 1, event.switch))
    return np.array(thetas), np.array(lengths), np.array(stages), crossings


class _Motions:
    """Orbits that are integrated together."""

    def __init__(self, equations: Equations, states: Array) -> None:
        self.equations, n = equations, equations.size
        self._start, self._state = states, np.column_stack((states, np.zeros(len(states))))
        self._errors, self._astray = np.zeros(states.shape), np.zeros(len(states))
        self._largest, self._smallest = states[:, :n].copy(), states[:, :n].copy()
        self._fastest = np.abs(states[:, n:]).max(axis=1)
        self._shifts: list[list[float]] = [[] for _ in states]

    def advance(self, lanes: slice, theta: Array, length: Array, closed: Array) -> None:
        """Take one step of each of the first orbits of the batch."""
        n, state, h = self.equations.size, self._state[lanes], length[:, None]
        method = _method()
        stages = method.n_stages  # not counting the evaluation at the end of the step
        rates = np.empty((stages + 1, *state.shape))
        with np.errstate(over="ignore", invalid="ignore"):  # a wrong orbit may diverge, which is detected at the end
            rates[0] = self.equations.rates(theta, state, closed, lanes)
            for s in range(1, stages):
                middle = state + h * np.tensordot(method.A[s, :s], rates[:s], axes=1)
                rates[s] = self.equations.rates(theta + method.C[s] * length, middle, closed, lanes)
            new = state + h * np.tensordot(method.B, rates[:stages], axes=1)
            rates[-1] = self.equations.rates(theta + length, new, closed, lanes)
            self._errors[lanes] += np.abs(h * _error(rates))[:, : 2 * n]
            self._watch(lanes, state, new, rates, h, closed)
        self._state[lanes] = new

    def cross(self, crossings: Sequence[tuple[int, int]]) -> None:
        """Record the delay with which each of some lanes passes the breakpoint of a switch."""
        n = self.equations.size
        for lane, switch in crossings:
            q, v = self._state[lane : lane + 1, :n], self._state[lane : lane + 1, n : 2 * n]
            here, contact = slice(lane, lane + 1), self.equations.contact_of[switch]
            depth = self.equations.depths(self.equations.deflections(q, here), here)[0, switch]
            rate = self.equations.signs[switch] * self.equations.deflections(v, here)[0, contact]
            shift = -depth * self.equations.frequency[lane] / rate if rate else math.inf
            self._shifts[lane].append(float(shift) if abs(shift) < _ASIDE else 0.0)

    def _watch(self, lanes: slice, state: Array, new: Array, rates: Array, h: Array, closed: Array) -> None:
        """Record extrema, and the depth of a deflection on the wrong side of a breakpoint."""
        n, frequency = self.equations.size, self.equations.frequency[lanes, None]
        self._fastest[lanes] = np.maximum(self._fastest[lanes], np.abs(new[:, n : 2 * n]).max(axis=1))
        first = [state[:, :n], h * rates[0][:, :n], h**2 * rates[0][:, n : 2 * n] / frequency]
        last = [new[:, :n], h * rates[-1][:, :n], h**2 * rates[-1][:, n : 2 * n] / frequency]
        turning = _turn(first, last)
        for seen in (turning, new[:, :n]):
            np.maximum(self._largest[lanes], seen, out=self._largest[lanes])
            np.minimum(self._smallest[lanes], seen, out=self._smallest[lanes])
        ends = [[self.equations.deflections(each, lanes) for each in side] for side in (first, last)]
        if not closed.shape[1]:
            return
        for x in (ends[0][0], _turn(*ends), ends[1][0]):
            depths = self.equations.depths(x, lanes)
            wrong = np.where(closed > 0.0, -depths, depths).max(axis=1)
            self._astray[lanes] = np.fmax(self._astray[lanes], wrong)

    def round(self, lane: int) -> Round:
        """Return the result of one orbit."""
        n = self.equations.size
        length = max(float(np.abs([self._largest[lane], self._smallest[lane]]).max()), np.finfo(float).tiny)
        speed = max(float(self._fastest[lane]), np.finfo(float).tiny)
        units = np.repeat([length, speed], n)
        gap = np.abs(self._state[lane, : 2 * n] - self._start[lane]) / units
        error = float((self._errors[lane] / units).max())
        extremes = np.column_stack((self._largest[lane], self._smallest[lane]))
        closure = float(gap.max())
        return Round(
            closure if math.isfinite(closure) else math.inf,
            float(self._astray[lane]) / length,
            float(self._state[lane, -1]),
            extremes,
            error if math.isfinite(error) else math.inf,
            tuple(self._shifts[lane]),
        )


@cache
def _method() -> Any:
    """Return the class with the coefficients."""
    from scipy.integrate import DOP853  # takes a fifth of the start-up time of a command, and few commands verify

    return DOP853


def _error(rates: Array) -> Array:
    """Return the error of a step of length 1, as DOP853 estimates it, component by component."""
    fifth, third = (np.tensordot(weights, rates, axes=1) for weights in (_method().E5, _method().E3))
    size = np.hypot(np.abs(fifth), 0.1 * np.abs(third))
    return np.divide(fifth**2, size, out=np.zeros_like(size), where=size > 0.0)


def _turn(first: Sequence[Array], last: Sequence[Array]) -> Array:
    """Return the value at an extremum within a step, or the first value if there is none.

    It is computed from the polynomial of fifth degree that has the given values, slopes and second derivatives at both
    ends of a step of length 1.
    """
    (x0, r0, a0), (x1, r1, a1) = first, last
    turns = r0 * r1 < 0.0
    share = np.divide(r0, r0 - r1, out=np.zeros_like(r0), where=turns)
    d, s = x1 - x0, share
    c3 = 10.0 * d - 6.0 * r0 - 4.0 * r1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * r0 + 7.0 * r1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * (r0 + r1) - 0.5 * (a0 - a1)
    slope = r0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    bend = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    s = np.where(turns, np.clip(s - np.divide(slope, bend, out=np.zeros_like(s), where=bend != 0.0), 0.0, 1.0), 0.0)
    return x0 + s * (r0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
