"""Integration of orbits with dry friction or rigid stops over one period, one at a time, by DOP853 between events.

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
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sticking import collapses
from gapwalk.verification.dop853 import Round, error_of, method, turn
from gapwalk.verification.dop853 import carry as carry_together
from gapwalk.verification.dry_changes import Change, mismatch
from gapwalk.verification.dry_equations import Values
from gapwalk.verification.dry_instant import EQUAL, SMALL, DryInstant
from gapwalk.verification.guard_samples import FIRES, brackets

Array = NDArray[np.float64]

_PERIOD = 2.0 * math.pi
_STEP = 1e-150  # of the complex step
_EXACT = 2e-11  # error of a step, relative to the motion
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
    """Result of integrating an orbit with friction or rigid stops over one period.

    Attributes
    ----------
    transition : shape (state size, state size)
        Derivative of the final state by the initial one.
    changes
        The modes at the start, then the events that were found.
    """

    transition: Array | None = None
    changes: tuple[Change, ...] = ()


def carry(orbits: Sequence[Orbit], report: Callable[[int], object] | None = None) -> Sequence[Round]:
    """Integrate orbits of one structure over one period, each by the integrator for its system.

    See `gapwalk.verification.dop853.carry`; those with friction or rigid stops give a `DryRound`.
    """
    if not orbits or not collapses(orbits[0].system):
        return carry_together(orbits, report)
    rounds: list[Round] = []
    for orbit in orbits:
        rounds.append(carry_dry(orbit))
        if report is not None:
            report(len(rounds))
    return rounds


def carry_dry(orbit: Orbit) -> DryRound:
    """Integrate an orbit with friction or rigid stops over one period.

    Where that fails, closure and the error are infinite.
    """
    n = orbit.system.size
    try:
        motion = _Motion(orbit)
        motion.advance(_PERIOD * orbit.period)
    except (NumericalError, np.linalg.LinAlgError):
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
        (),
        (),
        transition,
        changes,
    )


class _Motion(DryInstant):
    """The motion of an orbit and of its neighbours, one for each direction of the state space."""

    def __init__(self, orbit: Orbit) -> None:
        super().__init__(orbit)
        equations, n = self.equations, self.equations.size
        self.error, self._step, self._steps = 0.0, 1e-3, _STEPS * orbit.period
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

    def advance(self, end: float) -> None:
        """Integrate to an angle."""
        equations, repeated, count, last, missing = self.equations, 0, 0, -1.0, {*self._last}
        for stop in [*(angle for angle in sorted({*self._pieces, *self._grazes}) if 0.0 < angle < end), end]:
            self.levels = equations.levels(np.array([0.5 * (self.theta + stop)]))
            while self.theta < stop:
                key = self._advance(stop)
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
                self._pass(key)
            if stop in self._grazes and self._may_graze(*self._grazes[stop]):
                self._pass(("contact", self._grazes[stop][0]))
        for switch in missing:  # the stored motion ends after its impact
            gap, rate = self._gap(switch)
            if switch not in self.modes.held and rate < 0.0 and abs(gap) <= FIRES * self.length:
                self._pass(("contact", switch))
        self._slack = EQUAL
        self.angles = np.full(len(self.states), self.theta)
        equations.set_extensions(self.angles, self.states, self.modes, self.levels)

    def _is_impact(self, key: tuple[str, int]) -> bool:
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

    def _stepped(self, h: float, first: Values | None = None) -> tuple[Values, Values]:
        """Return the states after a step, and the rates at its stages and its end."""
        tableau, states = method(), self.states
        count = tableau.n_stages
        rates = np.empty((count + 1, *states.shape), dtype=complex)
        rows = rates.reshape(count + 1, -1)  # a view: `np.tensordot` does the same with more ado
        rates[0] = self._rates(self.theta, states) if first is None else first
        for s in range(1, count):
            middle = states + (h * tableau.A[s, :s] @ rows[:s]).reshape(states.shape)
            rates[s] = self._rates(self.theta + tableau.C[s] * h, middle)
        new = states + (h * tableau.B @ rows[:count]).reshape(states.shape)
        rates[-1] = self._rates(self.theta + h, new)
        return new, rates

    def _advance(self, stop: float) -> tuple[str, int] | None:
        """Take one step, to the first event in it if there is any; return that."""
        self._steps -= 1
        if self._steps < 0:
            raise NumericalError("the motion takes too many steps")
        self._end_pauses()
        hops = self._hops()
        most = min([stop - self.theta, *(1.5 * hop for hop in hops.values()), *(_HOP for _ in self.pausing)])
        h = min(self._step, most)
        with np.errstate(over="ignore", invalid="ignore"):
            while True:
                new, rates = self._stepped(h)
                error = float((np.abs(h * error_of(np.real(rates[:, 0]))) / self.scales).max())
                if not math.isfinite(error):
                    raise NumericalError("the motion diverges")
                ratio = 0.9 * (error / _EXACT + 1e-12) ** -0.125
                if error <= _EXACT or h < _SHORTEST:
                    break
                h *= max(0.2, ratio)
        longer = max(self._step, h) if h == most else h
        self._step = min(longer * min(4.0, max(ratio, 0.2)), 0.5)
        found, key = self._first_event(h, new, rates, hops), None
        if found is not None:
            h, key = found
            new, rates = (self._stepped(h, rates[0])) if h > 0.0 else (self.states.copy(), rates[:1])
        if h > 0.0:
            self.error += error
            self._watch(h, new, rates)
        self.states, self.theta = new, self.theta + h if found is not None or h < stop - self.theta else stop
        return key

    def _hops(self) -> dict[tuple[str, int], float]:
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
                    if 0.0 < root < _HOP:
                        found["contact", switch] = root
        return found

    def _first_event(
        self, h: float, new: Values, rates: Values, hops: dict[tuple[str, int], float]
    ) -> tuple[float, tuple[str, int]] | None:
        found = []
        for key, guess in hops.items():
            share = guess
            for _ in range(4):
                value, slope = self._guard_after(share, key)
                if slope < 0.0:
                    share = max(share - value / slope, 0.0)
            if share <= h:
                found.append((share, key))
        ends, slopes = np.real((self.states[0], new[0])), np.real(rates[[0, -1], 0])

        def sample(shares: Array) -> dict[tuple[str, int], Values]:
            states = self.equations.inside(shares, h, ends, slopes)
            values = self.guards(self.theta + shares * h, states)
            return {key: each for key, each in values.items() if key not in hops}

        def exact(shares: Array, key: tuple[str, int]) -> Array:
            return np.array([self._guard_after(share * h, key)[0] for share in shares])

        for key, (last, after) in brackets(sample, exact).items():
            for first in after.tolist():
                at_first = self._guard_after(first * h, key)
                if at_first[0] < -0.1 * FIRES:
                    break  # the interpolation is less exact than that: it may be above zero before
            else:
                continue
            at_last = self._guard_after(last * h, key)[0]
            if at_last <= 0.0 < last:  # as here, in a dip that is as shallow as that
                last, at_last = 0.0, self._guard_after(0.0, key)[0]
            found.append((0.0 if at_last <= 0.0 else self._root(last * h, first * h, key, at_first), key))
        return min(found) if found else None

    def _root(self, low: float, high: float, key: tuple[str, int], at_high: tuple[float, float]) -> float:
        """Locate a sign change by Newton's method within a bracket that shrinks; `at_high` are value and slope there.

        It ends when the next step, by the ratio of the last two, would be rounding: each evaluation costs a whole step.
        """
        exact, share, last = 4e-16 * (1.0 + self.theta), high, 0.0
        for number in range(60):
            value, slope = self._guard_after(share, key) if number else at_high
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

    def _guard_after(self, h: float, key: tuple[str, int]) -> tuple[float, float]:
        """Return a guard and its slope over the angle after a step of some length."""
        everyone, self.states = self.states, np.real(self.states[:1]).astype(complex)
        try:
            state = np.real(self._stepped(h)[0]) if h > 0.0 else np.real(self.states)
        finally:
            self.states = everyone
        return self._slope(key, self.theta + h, state)

    def _slope(self, key: tuple[str, int], angle: float, state: Array) -> tuple[float, float]:
        aside = state + 1j * _STEP * np.real(self._rates(angle, state))
        found = self.guards(np.array([angle + 1j * _STEP]), aside)[key][0]
        value, slope = float(np.real(found)), float(np.imag(found) / _STEP)
        kind, index = key
        if kind == "slip" and self.modes.slip[index] and index in self.equations.creeping:
            h = 1e-6  # the rate of a limit has been a complex step already
            later = self.guards(np.array([angle + h]), state + h * np.real(self._rates(angle, state)))[key][0]
            slope = (float(np.real(later)) - value) / h
        return value, slope

    def _watch(self, h: float, new: Values, rates: Values) -> None:
        """Record extrema."""
        n, omega = self.equations.size, self.equations.omega
        y0, y1 = np.real(self.states[0]), np.real(new[0])
        r0, r1 = h * np.real(rates[0, 0]), h * np.real(rates[-1, 0])
        turning = turn([y0[:n], r0[:n], h * r0[n : 2 * n] / omega], [y1[:n], r1[:n], h * r1[n : 2 * n] / omega])
        for seen in (turning, y1[:n]):
            np.maximum(self.largest, seen, out=self.largest)
            np.minimum(self.smallest, seen, out=self.smallest)

    def _width(self, key: tuple[str, int]) -> float:
        """Return the change of a guard for a change of a state by the size of the motion, velocities as lengths."""
        unit, n = np.ones(len(self.states[0])), self.equations.size
        unit[n : 2 * n] = self.equations.omega
        states = np.real(self.states[:1]) + 1j * _STEP * np.diag(unit)
        found = self.guards(np.full(len(unit), self.theta, complex), states)[key]
        return self.length * (float(np.abs(np.imag(found)).max() / _STEP) or 1.0)

    def _pass(self, key: tuple[str, int]) -> None:
        """Pass an event with all neighbours, each at its own time."""
        before, everyone = self._rates(self.theta, self.states), np.full(len(self.states), self.theta)
        slips, closed, held = dict(self.modes.slip), self.modes.closed.copy(), set(self.modes.held)
        slope = self._slope(key, self.theta, np.real(self.states[:1]))[1]
        values, width = self.guards(everyone, self.states)[key], self._width(key)
        delays = -np.imag(values) / slope if slope else np.zeros(len(values))
        self.states = self.states + 1j * delays[:, None] * np.real(before)
        self.angles = everyone + 1j * delays
        self.equations.set_extensions(self.angles, self.states, self.modes, self.levels)
        self._change(key)
        after = self._rates(self.theta, self.states)
        self.states = self.states - 1j * delays[:, None] * np.real(after)
        if key[0] == "contact":
            mode = key[1] not in held if key[1] in self.equations.rigid else not closed[key[1]]
            self.changes.append(Change(*key, int(mode), self.theta, slope / width))
        for other, slip in self.modes.slip.items():
            if slip != slips[other]:
                self.changes.append(Change("slip", other, slip, self.theta, slope / width))
