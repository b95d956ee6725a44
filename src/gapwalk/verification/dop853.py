"""Integration of orbits over one period by another method: Dormand and Prince's of order 8, between contact events.

All orbits of a branch are integrated together, with fixed steps (Hairer, Norsett and Wanner, Solving ODEs I, section
II.10) and the coefficients of `scipy.integrate.DOP853`. The contact events are those stored with an orbit; it is
checked that the motion passes its breakpoints there, and nowhere else. A strongly unstable orbit continues from each of
its known states, where the motion must arrive. The stored events belong to an orbit about 1e-7 away, so the motion
closes less accurately. If that matters, they are located again on the motion itself.

Steps also end where a load jumps, and where a law has a kink (`gapwalk.model.laws.Law.guards`): across a kink a step
would have the order 2. Kinks are no stored events. They are found where a guard changes its sign within a step, and the
motion is integrated again with steps that end there, until they stay in place. Next to the kink of a fractional power,
which has no higher derivatives there, steps grow from a small one by a factor 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.contact_events import ContactEvent
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.independent_equations import Equations

Array = NDArray[np.float64]
Kinks = tuple[tuple[float, int], ...]

_PERIOD = 2.0 * math.pi
_FINER = 5.0  # steps at the first attempt, per step of the flow's Taylor series, whose order is about 20
_IN_PIECE = 2.0  # smallest number of such Taylor steps between two contact events
_TRIES = 3  # number of further attempts, each with twice as many steps
_EXACT = 5e-11  # error of the integration, relative to the motion, that is small enough
_AGAIN = 1e-10  # closure above which the contact events are located again
_PASSES = 6  # number of times that they are: where the force jumps, moving an event moves those after it
_ASIDE = 1e-5  # largest angle by which an event may be moved: farther away there is another event
_SETTLED = 1e-9  # change of the angle of a kink that is small enough: it costs that times a thousandth
_SOUGHT = 6  # number of integrations in which kinks are sought
_HALVINGS = 50  # of a step, to find a kink in it
_ONE_PLACE = 1e-9  # angle between two kinks within which a step ends at only one of them
_GRADES = 16  # steps next to the kink of a fractional power, each half as long as the next
_LANES = 2048  # number of orbits that are integrated at once
_NUMBERS = 4_000_000  # of the matrices of so many orbits


@dataclass(frozen=True)
class Round:
    """Result of integrating an orbit over one period."""

    #: Largest component of the difference between end and start, or between a known state and the motion from the one
    #: before, relative to the largest position or velocity.
    closure: float
    #: Largest depth of a deflection on one side of a breakpoint while the stored orbit is on its other side, relative
    #: to the largest position.
    astray: float
    contraction: float  #: Logarithm of the factor by which volumes of the state space change.
    extremes: Array  #: shape (n, 2): Maximum and minimum of each coordinate.
    error: float  #: Estimated error of this integration, relative to the motion.
    #: For each contact event, the delay with which the motion passes its breakpoint; 0 if it is large or unknown.
    shifts: tuple[float, ...] = ()
    kinks: Kinks = ()  #: Angles at which a law has a kink, in their order, each with the number of its guard.
    least: float = float(np.finfo(float).tiny)  #: Size below which a motion counts as rest.
    end: Array = field(default_factory=lambda: np.zeros(0))  #: shape (2n,): The state at the end.

    @property
    def size(self) -> float:
        """Largest position of the motion, at least its `least`."""
        return max(float(np.abs(self.extremes).max()), self.least)


def carry(
    orbits: Sequence[Orbit], report: Callable[[int], object] | None = None, *, closes: bool = True
) -> list[Round]:
    """Integrate orbits of one structure over one period; `report` is called with the number of completed ones."""
    # With `closes` false they are motions that need not close, whose events are their own, such as parts of a torus.
    require_one_structure(orbits)
    rounds: list[Round] = []
    size = orbits[0].system.size if orbits else 1
    lanes = max(1, min(_LANES, _NUMBERS // (size * (2 * size + 4))))
    for first in range(0, len(orbits), lanes):
        rounds += _carry(orbits[first : first + lanes], _PASSES if closes else 0)
        if report is not None:
            report(len(rounds))
    return rounds


def _carry(orbits: Sequence[Orbit], passes: int) -> list[Round]:
    # the Taylor series needs many short steps next to fractional powers
    edged = any(form.law.has_edges for form in orbits[0].system.structure.contacts)
    finer = _FINER / 5.0 if edged else _FINER
    rounds = _around_kinks(orbits, finer, [()] * len(orbits))
    for _ in range(_TRIES + edged):
        rough = [index for index, each in enumerate(rounds) if not each.error <= _EXACT]
        if not rough:
            break
        finer *= 2.0
        again = _around_kinks([orbits[index] for index in rough], finer, [rounds[index].kinks for index in rough])
        for index, better in zip(rough, again, strict=True):
            rounds[index] = better
    moved = list(orbits)
    for _ in range(passes):
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
        again = _around_kinks(
            [moved[index] for index in open_ended], finer, [rounds[index].kinks for index in open_ended]
        )
        for index, better in zip(open_ended, again, strict=True):
            # whether stages change at the stated events is judged by the events as they are stored
            rounds[index] = replace(better, astray=rounds[index].astray)
    return rounds


def _around_kinks(orbits: Sequence[Orbit], finer: float, kinks: Sequence[Kinks]) -> list[Round]:
    """Integrate orbits until their kinks are where steps end; `kinks` are those that are known."""
    rounds = _around(orbits, finer, kinks)
    known, left = list(kinks), [*range(len(orbits))]
    for _ in range(_SOUGHT - 1):
        left = [index for index in left if _moved(known[index], rounds[index].kinks) > _SETTLED]
        if not left:
            break
        for index in left:
            known[index] = rounds[index].kinks
        again = _around([orbits[index] for index in left], finer, [known[index] for index in left])
        for index, better in zip(left, again, strict=True):
            rounds[index] = better
    return rounds


def _moved(a: Kinks, b: Kinks) -> float:
    """Return by how much kinks have moved, or inf if there are others."""
    known, found = (sorted((guard, angle) for angle, guard in kinks) for kinks in (a, b))
    if [guard for guard, _ in known] != [guard for guard, _ in found]:
        return math.inf
    return max((abs(x - y) for (_, x), (_, y) in zip(known, found, strict=True)), default=0.0)


def _around(orbits: Sequence[Orbit], finer: float, kinks: Sequence[Kinks]) -> list[Round]:
    states = np.array([orbit.state for orbit in orbits])
    n = orbits[0].system.size
    everyone = Equations([orbit.system for orbit in orbits])
    inside = everyone.depths(everyone.deflections(np.zeros(len(orbits)), states[:, :n])) > 0.0
    plans = [_plan(orbit, everyone, index, inside[index], finer, kinks[index]) for index, orbit in enumerate(orbits)]
    order = sorted(range(len(orbits)), key=lambda index: -len(plans[index].thetas))
    counts = np.array([len(plans[index].thetas) for index in order])
    theta, length = (np.zeros((counts[0], len(orbits))) for _ in range(2))
    closed, levels = (np.zeros((counts[0], len(orbits), width)) for width in (inside.shape[1], everyone.jump_count))
    crossings: dict[int, list[tuple[int, int]]] = {}
    restarts: dict[int, list[tuple[int, Array]]] = {}
    for lane, index in enumerate(order):
        plan, count = plans[index], counts[lane]
        theta[:count, lane], length[:count, lane] = plan.thetas, plan.lengths
        closed[:count, lane], levels[:count, lane] = plan.closed, plan.levels
        for step, switch in plan.crossings:
            crossings.setdefault(step, []).append((lane, switch))
        for step, state in plan.restarts:
            restarts.setdefault(step, []).append((lane, state))
    equations = Equations([orbits[index].system for index in order])
    drifts = np.array([np.pad(orbit.drift, (0, states.shape[1] - n)) for orbit in orbits])
    motions = _Motions(equations, states[order], states[order] + drifts[order])
    motions.cross(crossings.get(-1, ()), theta[0])
    for k in range(counts[0]):
        active = int(np.searchsorted(-counts, -k))  # those with more than k steps come first
        motions.advance(slice(0, active), theta[k, :active], length[k, :active], closed[k, :active], levels[k, :active])
        motions.cross(crossings.get(k, ()), theta[k] + length[k])
        for lane, state in restarts.get(k, ()):
            motions.restart(lane, state)
    motions.locate_kinks()
    return [motions.round(lane) for lane in np.argsort(order).tolist()]


class _Plan(NamedTuple):
    """The steps of one orbit: start and length of each, the stages that act in it, and the levels of loads that jump.

    `crossings` has the contact events in their order: the number of the step after which each is, and its switch.
    `restarts` has the known states in the same way.
    """

    thetas: Array
    lengths: Array
    closed: Array
    levels: Array
    crossings: list[tuple[int, int]]
    restarts: list[tuple[int, Array]]


def _plan(
    orbit: Orbit, equations: Equations, lane: int, inside: NDArray[np.bool_], finer: float, kinks: Kinks
) -> _Plan:
    """Plan the steps of one orbit, which end at its contact events, kinks, and the jumps of loads."""
    end = _PERIOD * orbit.period
    step = end / max(8.0 * orbit.period, finer * orbit.steps)
    closed = inside.copy()
    for event in reversed(orbit.events):
        closed[event.switch] = not event.enters  # before its first event a stage is in the opposite state
    knots: list[tuple[float, ContactEvent | None, bool]] = [(event.theta, event, False) for event in orbit.events]
    known, restarts = dict(orbit.known_states), []
    knots += [(angle, None, False) for angle in known]
    for angles in equations.jumps(lane):
        knots += [(float(angle) + _PERIOD * k, None, False) for k in range(orbit.period) for angle in angles]
    for angle, guard in kinks:  # the two guards of a fractional power vanish at one place
        if all(abs(angle - other) > _ONE_PLACE for other, event, _ in knots if event is None):
            knots.append((angle, None, bool(equations.graded[guard])))
    knots.sort(key=lambda knot: knot[0])  # stable: events at one angle stay in their order
    thetas, lengths, stages, crossings = [np.zeros(0)], [np.zeros(0)], [np.zeros((0, len(closed)))], []
    total, start, graded, from_event = 0, 0.0, False, True
    for theta, event, grade in [*knots, (end, None, False)]:
        at_event = event is not None or theta == end
        if start < theta <= end:
            # contact with a stop lasts half a period of an oscillation that may be far faster than the rest
            least = _IN_PIECE * finer if at_event or from_event else 2.0
            nodes = _graded(
                np.linspace(start, theta, max(math.ceil((theta - start) / step), math.ceil(least)) + 1), graded, grade
            )
            thetas.append(nodes[:-1])
            lengths.append(np.diff(nodes))
            stages.append(np.tile(closed.astype(float), (len(nodes) - 1, 1)))
            total += len(nodes) - 1
            start, graded, from_event = theta, grade, at_event
        if event is not None:
            closed[event.switch] = event.enters
            crossings.append((total - 1, event.switch))
        elif theta in known:
            restarts.append((total - 1, known.pop(theta)))
    found, spans = np.concatenate(thetas), np.concatenate(lengths)
    levels = equations.levels(found + 0.5 * spans, np.full(len(found), lane))
    return _Plan(found, spans, np.concatenate(stages), levels, crossings, restarts)


def _graded(nodes: Array, first: bool, last: bool) -> Array:
    """Halve the first step, the last one, or both, again and again towards the end of the piece."""
    shares = 0.5 ** np.arange(_GRADES, 0, -1)
    parts = [nodes]
    if first:
        parts.append(nodes[0] + shares * (nodes[1] - nodes[0]))
    if last:
        parts.append(nodes[-1] - shares * (nodes[-1] - nodes[-2]))
    return np.unique(np.concatenate(parts))


class _Motions:
    """Orbits that are integrated together."""

    def __init__(self, equations: Equations, states: Array, ends: Array) -> None:
        self.equations, n = equations, equations.size
        self._returns, self._state = ends, np.column_stack((states, np.zeros(len(states))))
        self._gaps = np.zeros(states.shape)  # at the known states
        self._errors, self._astray = np.zeros(states.shape), np.zeros(len(states))
        self._largest, self._smallest = states[:, :n].copy(), states[:, :n].copy()
        self._fastest = np.abs(states[:, n:]).max(axis=1)
        self._shifts: list[list[float]] = [[] for _ in states]
        self._changes: list[_Change] = []
        self._kinks: list[list[tuple[float, int]]] = [[] for _ in states]

    def advance(self, lanes: slice, theta: Array, length: Array, closed: Array, levels: Array) -> None:
        """Take one step of each of the first orbits of the batch."""
        n, state, h = self.equations.size, self._state[lanes], length[:, None]
        tableau = method()
        stages = tableau.n_stages  # not counting the evaluation at the end of the step
        rates = np.empty((stages + 1, *state.shape))
        with np.errstate(over="ignore", invalid="ignore"):  # a wrong orbit may diverge, which is detected at the end
            rates[0] = self.equations.rates(theta, state, closed, lanes, levels)
            for s in range(1, stages):
                middle = state + h * np.tensordot(tableau.A[s, :s], rates[:s], axes=1)
                rates[s] = self.equations.rates(theta + tableau.C[s] * length, middle, closed, lanes, levels)
            new = state + h * np.tensordot(tableau.B, rates[:stages], axes=1)
            rates[-1] = self.equations.rates(theta + length, new, closed, lanes, levels)
            self._errors[lanes] += np.abs(h * error_of(rates))[:, : 2 * n]
            self._watch(lanes, theta, state, new, rates, length, closed)
            if self.equations.guard_count:
                self._watch_guards(lanes, theta, state, new, rates, length, closed, levels)
        self._state[lanes] = new

    def restart(self, lane: int, state: Array) -> None:
        """Continue one orbit from a known state, and record the difference from it."""
        own = self._state[lane, :-1]
        self._gaps[lane] = np.maximum(self._gaps[lane], np.abs(own - state))
        own[:] = state

    def cross(self, crossings: Sequence[tuple[int, int]], theta: Array) -> None:
        """Record the delay with which each of some lanes passes the breakpoint of a switch, at the present angles."""
        n = self.equations.size
        for lane, switch in crossings:
            q, v = self._state[lane : lane + 1, :n], self._state[lane : lane + 1, n : 2 * n]
            here, contact = slice(lane, lane + 1), self.equations.contact_of[switch]
            depth = self.equations.depths(self.equations.deflections(theta[here], q, here), here)[0, switch]
            over_theta = v / self.equations.frequency[lane]
            rates = self.equations.deflections(theta[here], over_theta, here, derivative=1)
            rate = self.equations.signs[switch] * rates[0, contact]
            shift = -depth / rate if rate else math.inf
            self._shifts[lane].append(float(shift) if abs(shift) < _ASIDE else 0.0)

    def _watch(
        self, lanes: slice, theta: Array, state: Array, new: Array, rates: Array, length: Array, closed: Array
    ) -> None:
        """Record extrema, and the depth of a deflection on the wrong side of a breakpoint."""
        n, h = self.equations.size, length[:, None]
        self._fastest[lanes] = np.maximum(self._fastest[lanes], np.abs(new[:, n : 2 * n]).max(axis=1))
        ends = self._ends(lanes, state, new, rates, h)
        turning = turn(*ends)
        for seen in (turning, new[:, :n]):
            np.maximum(self._largest[lanes], seen, out=self._largest[lanes])
            np.minimum(self._smallest[lanes], seen, out=self._smallest[lanes])
        if not closed.shape[1]:
            return
        moves = [
            [h**k * self.equations.deflections(angle, each / h**k, lanes, derivative=k) for k, each in enumerate(side)]
            for angle, side in zip((theta, theta + length), ends, strict=True)
        ]
        for x in (moves[0][0], turn(*moves), moves[1][0]):
            depths = self.equations.depths(x, lanes)
            wrong = np.where(closed > 0.0, -depths, depths).max(axis=1)
            self._astray[lanes] = np.fmax(self._astray[lanes], wrong)

    def _ends(self, lanes: slice, state: Array, new: Array, rates: Array, h: Array) -> tuple[list[Array], list[Array]]:
        """Return positions with their first two derivatives at both ends of a step, as if its length were 1."""
        n, frequency = self.equations.size, self.equations.frequency[lanes, None]
        first = [state[:, :n], h * rates[0][:, :n], h**2 * rates[0][:, n : 2 * n] / frequency]
        last = [new[:, :n], h * rates[-1][:, :n], h**2 * rates[-1][:, n : 2 * n] / frequency]
        return first, last

    def _watch_guards(
        self,
        lanes: slice,
        theta: Array,
        state: Array,
        new: Array,
        rates: Array,
        length: Array,
        closed: Array,
        levels: Array,
    ) -> None:
        """Record the steps in which a guard changes its sign."""
        before = self.equations.guards(theta, state, closed, lanes, levels) > 0.0
        after = self.equations.guards(theta + length, new, closed, lanes, levels) > 0.0
        here, guards = np.nonzero(before != after)
        if len(here):
            first, last = (
                [each[here] for each in side] for side in self._ends(lanes, state, new, rates, length[:, None])
            )
            lane_of = here + (lanes.start or 0)
            self._changes.append(
                _Change(lane_of, guards, theta[here], length[here], first, last, closed[here], levels[here])
            )

    def locate_kinks(self) -> None:
        """Find the angles at which guards vanish, in all steps in which one changes its sign, by bisection."""
        if not self._changes:
            return
        changes = _Change.joined(self._changes)
        rows, h = np.arange(len(changes.lanes)), changes.lengths[:, None]
        frequency = self.equations.frequency[changes.lanes, None]

        def is_high(share: Array) -> NDArray[np.bool_]:
            q, slope = between(changes.first, changes.last, share[:, None])
            states = np.column_stack((q, slope / h * frequency, np.zeros(len(q))))
            angles = changes.thetas + share * changes.lengths
            return (
                self.equations.guards(angles, states, changes.closed, changes.lanes, changes.levels)[
                    rows, changes.guards
                ]
                > 0.0
            )

        low, high = np.zeros(len(rows)), np.ones(len(rows))
        with np.errstate(over="ignore", invalid="ignore"):
            begun = is_high(low)
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                as_before = is_high(middle) == begun
                low, high = np.where(as_before, middle, low), np.where(as_before, high, middle)
        found = changes.thetas + high * changes.lengths
        for lane, angle, guard in zip(changes.lanes.tolist(), found.tolist(), changes.guards.tolist(), strict=True):
            self._kinks[lane].append((angle, guard))

    def round(self, lane: int) -> Round:
        """Return the result of one orbit."""
        n = self.equations.size
        length = max(float(np.abs([self._largest[lane], self._smallest[lane]]).max()), np.finfo(float).tiny)
        speed = max(float(self._fastest[lane]), np.finfo(float).tiny)
        units = np.repeat([length, speed], n)
        gap = np.maximum(self._gaps[lane], np.abs(self._state[lane, : 2 * n] - self._returns[lane])) / units
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
            tuple(sorted(self._kinks[lane])),
            end=self._state[lane, : 2 * n].copy(),
        )


class _Change(NamedTuple):
    """Steps in which a guard changes its sign: lanes, guards, and both ends of the steps as `_Motions._ends`."""

    lanes: NDArray[np.intp]
    guards: NDArray[np.intp]
    thetas: Array
    lengths: Array
    first: list[Array]
    last: list[Array]
    closed: Array
    levels: Array

    @classmethod
    def joined(cls, changes: Sequence[_Change]) -> _Change:
        """Join several."""

        def join(name: str) -> Any:
            parts = [getattr(each, name) for each in changes]
            if name in ("first", "last"):
                return [np.concatenate(those) for those in zip(*parts, strict=True)]
            return np.concatenate(parts)

        return cls(*map(join, cls._fields))


def require_one_structure(orbits: Sequence[Orbit]) -> None:
    """Raise a ValueError if the systems of orbits are of different structures."""
    if len({id(orbit.system.structure) for orbit in orbits}) > 1 and len({o.system.structure for o in orbits}) > 1:
        raise ValueError("orbits of systems of different structure cannot be integrated together")


@cache
def method() -> Any:
    """Return the class with the coefficients."""
    from scipy.integrate import DOP853  # takes a fifth of the start-up time of a command, and few commands verify

    return DOP853


def error_of(rates: Array) -> Array:
    """Return the error of a step of length 1, as DOP853 estimates it, component by component."""
    fifth, third = (np.tensordot(weights, rates, axes=1) for weights in (method().E5, method().E3))
    size = np.hypot(np.abs(fifth), 0.1 * np.abs(third))
    return np.divide(fifth**2, size, out=np.zeros_like(size), where=size > 0.0)


def turn(first: Sequence[Array], last: Sequence[Array]) -> Array:
    """Return the value at an extremum within a step, or the first value if there is none."""
    # It is computed from the polynomial of fifth degree that has the given values, slopes and second derivatives at
    # both ends of a step of length 1.
    (_, r0, a0), (_, r1, _) = first, last
    turns = r0 * r1 < 0.0
    s = np.divide(r0, r0 - r1, out=np.zeros_like(r0), where=turns)
    c3, c4, c5 = _quintic(first, last)
    _, slope = between(first, last, s)
    bend = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    s = np.where(turns, np.clip(s - np.divide(slope, bend, out=np.zeros_like(s), where=bend != 0.0), 0.0, 1.0), 0.0)
    return between(first, last, s)[0]


def between(first: Sequence[Array], last: Sequence[Array], s: Array) -> tuple[Array, Array]:
    """Return values and slopes at a share of a step of length 1, by that polynomial."""
    x0, r0, a0 = first
    c3, c4, c5 = _quintic(first, last)
    value = x0 + s * (r0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    return value, r0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))


def _quintic(first: Sequence[Array], last: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Return the coefficients of the third to fifth power of that polynomial."""
    (x0, r0, a0), (x1, r1, a1) = first, last
    d = x1 - x0
    return (
        10.0 * d - 6.0 * r0 - 4.0 * r1 - 1.5 * a0 + 0.5 * a1,
        -15.0 * d + 8.0 * r0 + 7.0 * r1 + 1.5 * a0 - a1,
        6.0 * d - 3.0 * (r0 + r1) - 0.5 * (a0 - a1),
    )
