"""The switches of the contact stages: set at the start of a motion, flipped at its contact events, and checked.

Method: docs/numerics/flow.md
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.equations import Equations
from gapwalk.flow.event_call import answer_events
from gapwalk.flow.forces import accelerations
from gapwalk.model.contact import DampingLaw

COOLDOWN = 1e-9  # radians of theta; heyoka's automatic value is 0 for a start at rest on a breakpoint, and loops
_SLOW = 1e-6  # relative approach velocity below which a crossing may be a touch that ends within the cooldown
_ON = 1e-13  # relative distance within which a motion counts as being on a breakpoint
_LATELY = 10 * COOLDOWN  # time within which a second event of a switch is an echo of the first
_NEAR = 1e-9  # relative distance within which the end of a motion may be on either side of a breakpoint
_CLOSE = 1e-6  # relative distance of breakpoints of a contact within which rounding may make them one


class ContactEvent(NamedTuple):
    """One crossing of a breakpoint.

    Attributes
    ----------
    theta
        When, in radians of the fundamental excitation.
    switch
        Which stage on which side: index into `Equations.switches`.
    enters
        True if the contact closes, False if it opens.
    velocity
        Rate of the deflection over time; its size is the approach velocity.
    """

    theta: float
    switch: int
    enters: bool
    velocity: float


class Switchboard:
    """Keeps the switches of one compiled integrator right; the integrator calls it back at every event."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        layout = equations.layout
        contacts = [layout.contacts[k] for k, _ in equations.switches]
        stages = [layout.contacts[k].stages[j] for k, j in equations.switches]
        self.n = layout.structure.size
        self.count = len(stages)
        self.signs = np.array([stage.sign for stage in stages], dtype=float)
        self._breaks = np.array([stage.clearance for stage in stages], dtype=np.intp)
        self._deflections = np.array([contact.deflection for contact in contacts]).reshape(self.count, self.n)
        self._signs = self.signs.tolist()
        self._geometry = np.concatenate((self._deflections.ravel(), self._breaks))
        self._known = b""
        self._first, self._weights = equations.first_switch, equations.first_weight
        self._viscous = [self._is_viscous_edge(k, j) for k, j in equations.switches]
        self.log: list[ContactEvent] = []
        self.missed = 0
        self.event_limit = 0

    def attach(self, integrator, columns: int) -> None:
        """Take hold of the integrator's state and parameters (live views), with `columns` sensitivity columns."""
        self._integrator, self._state, self._parameters = integrator, integrator.state, integrator.pars
        self._columns = columns
        if self.count:
            answer_events(self, integrator.t_events)

    def start(self, coefficients: NDArray, theta: float, event_limit: int, unit: float = 1.0) -> None:
        """Set every switch for the state in the integrator, and begin a new log, whose lengths are told in `unit`s."""
        self.log, self.missed, self.event_limit, self._unit = [], 0, event_limit, unit
        if not self.count:
            return
        self._coefficients, self._theta = coefficients, theta
        self._read_geometry(coefficients)
        state = self._state[: 2 * self.n].tolist()
        self._speed = _SLOW * max(map(abs, state[self.n :]))
        depths = self._depths(state)
        self._inside = [depth > 0.0 for depth in depths]
        self._parameters[self._first : self._first + self.count] = self._inside
        self._changed = [theta] * self.count
        self._left = self._changed.copy()
        near = self._are_near(depths, state, _ON)
        if any(near):
            self._leave({switch: depths[switch] for switch in range(self.count) if near[switch]}, theta)

    def is_right(self) -> bool:
        """Whether no crossing was missed: each event changed its switch, and all switches are right at the end."""
        if self.missed:
            return False
        if not self.count:
            return True
        state = self._state[: 2 * self.n].tolist()
        depths = self._depths(state)
        if [depth > 0.0 for depth in depths] == self._inside:
            return True
        near = self._are_near(depths, state, _NEAR)
        return all(
            (depth > 0.0) is closed or close for depth, closed, close in zip(depths, self._inside, near, strict=True)
        )

    def _read_geometry(self, coefficients: NDArray) -> None:
        """Deflection vectors and breakpoints as plain numbers, read again only when they have changed."""
        known = coefficients[self._geometry].tobytes()
        if known == self._known:
            return
        self._known = known
        self._vectors = coefficients[self._deflections]
        self._offsets = (self.signs * coefficients[self._breaks]).tolist()
        self._scales = [1.0 + abs(offset) for offset in self._offsets]
        weights = [min(1.0, 1.0 / abs(offset)) if offset else 1.0 for offset in self._offsets]
        self._parameters[self._weights : self._weights + self.count] = weights
        self._rows = [tuple((int(i), float(vector[i])) for i in np.flatnonzero(vector)) for vector in self._vectors]
        self._twins = [self._possible_twins(switch) for switch in range(self.count)]
        self._rate_rows = [tuple((self.n + i, factor) for i, factor in row) for row in self._rows]

    def _possible_twins(self, switch: int) -> tuple[int, ...]:
        """The switches that may change at the same time: those of other contacts, and of breakpoints close by."""
        contact, offset = self.equations.switches[switch][0], self._offsets[switch]
        others = enumerate(zip(self.equations.switches, self._offsets, strict=True))
        return tuple(
            other
            for other, ((k, _), place) in others
            if other != switch and (k != contact or abs(place - offset) <= _CLOSE * self._scales[switch])
        )

    def _depths(self, positions: list[float]) -> list[float]:
        """How far the motion is inside each stage (> 0) or outside it (< 0)."""
        return [
            sign * (sum([factor * positions[i] for i, factor in row]) - offset)
            for sign, row, offset in zip(self._signs, self._rows, self._offsets, strict=True)
        ]

    def _are_near(self, depths: list[float], state: list[float], share: float) -> list[bool]:
        """Which breakpoints the motion is on, to a share of the size of the motion and of the breakpoint."""
        size = self._size(state)
        return [abs(depth) <= share * (scale + size) for depth, scale in zip(depths, self._scales, strict=True)]

    def _size(self, state: list[float]) -> float:
        """Size of the motion: of its deflections, now or a quarter of a period later."""
        return max(*map(abs, state[: self.n]), float(self._coefficients[0]) * max(map(abs, state[self.n :])))

    def at_event(self, switch: int, theta: float) -> bool:
        """Flip a switch, at an event of its breakpoint; whether the integrator goes on."""
        if self._settle(switch, theta) and self._twins[switch]:
            self._settle_twins(switch, theta)
        self.event_limit -= 1
        return self.event_limit > 0

    def _settle(self, switch: int, theta: float, reported: bool = True) -> bool:
        """Set one switch for a motion on its breakpoint; whether that changes it.

        An event that is reported and changes nothing tells that the one before it was missed.
        """
        if theta < self._left[switch]:
            return False
        velocity = 0.0
        for i, factor in self._rate_rows[switch]:
            velocity += factor * self._state.item(i)
        before = self._inside[switch]
        if velocity > self._speed or velocity < -self._speed:
            inside = self._signs[switch] * velocity > 0.0
            if reported and inside is before and theta - self._changed[switch] > _LATELY:
                self.missed += 1
        else:
            inside = self._after_touch(switch, velocity, theta)
        if inside is before:
            return False
        self._parameters[self._first + switch] = inside
        self._inside[switch], self._changed[switch] = inside, theta
        self.log.append(ContactEvent(theta, switch, inside, velocity * self._unit))
        if self._viscous[switch]:
            self._jump(switch, 1.0 if inside else -1.0)
        return True

    def _settle_twins(self, switch: int, theta: float) -> None:
        """Set the other switches whose breakpoints are crossed at the same time.

        Of two events at one time the integrator reports one, and the other only if rounding leaves it a sign change:
        the two sides of a gap of no width, two equal contacts, a symmetric system.
        """
        state = self._state[: 2 * self.n].tolist()
        near = self._are_near(self._depths(state), state, _ON)
        for other in self._twins[switch]:
            if near[other] and theta - self._changed[other] > _LATELY:
                self._settle(other, theta, reported=False)

    def _is_viscous_edge(self, contact: int, stage: int) -> bool:
        """Whether the force jumps at this breakpoint: the innermost stage of a viscously damped contact."""
        layout = self.equations.layout
        if layout.structure.contacts[contact].damping is not DampingLaw.VISCOUS:
            return False
        stages = layout.contacts[contact].stages
        return [other.sign for other in stages].index(stages[stage].sign) == stage

    def _leave(self, starts: dict[int, float], theta: float) -> None:
        """Set the switches on whose breakpoints the motion starts, by the sides to which it leaves them.

        Velocity and acceleration do not tell them all: a mass at rest leaves in the third order under a sine, and two
        orders later each if it is pushed through other masses. So the Taylor series of the motion tells them: its first
        term that is not zero does not depend on the switch itself. It may depend on another one, which then leaves
        earlier, so the series is looked at again until nothing changes. What is crossed before the motion has left
        its breakpoint by more than rounding is no event. `starts` are the depths of those switches.
        """
        distance = 2.0 * _ON * (max(self._scales) + self._size(self._state[: 2 * self.n].tolist()))
        for _ in range(self.count):
            self._integrator.step(max_delta_t=0.0, write_tc=True)
            series, longest = self._integrator.tc[: self.n, 1:], _reach(self._integrator.tc[: 2 * self.n])
            for switch, start in starts.items():
                depths = self.signs[switch] * (self._vectors[switch] @ series)
                time, depth = _beginning(depths, distance, longest)
                self._inside[switch], self._left[switch] = start + depth > 0.0, theta + time
            if self._parameters[self._first : self._first + self.count].tolist() == self._inside:
                return
            self._parameters[self._first : self._first + self.count] = self._inside

    def _after_touch(self, switch: int, velocity: float, theta: float) -> bool:
        """Where a slow crossing leads: the velocity decides, unless the motion turns back within the cooldown."""
        turning = float(self._vectors[switch] @ self._acceleration(theta))
        span = 4.0 * COOLDOWN * self._coefficients[0]
        turns_back = velocity * turning < 0 and 2.0 * abs(velocity) <= span * abs(turning)
        leading = turning if turns_back or velocity == 0.0 else velocity
        return bool(self.signs[switch] * leading > 0)

    def _acceleration(self, theta: float) -> NDArray:
        q, v = self._state[: self.n], self._state[self.n : 2 * self.n]
        return accelerations(self.equations.layout, self._coefficients, theta, q, v)

    def _jump(self, switch: int, change: float) -> None:
        """Carry the sensitivities over a jump of the force (the saltation matrix).

        With the damper's force ``c v_n`` appearing or vanishing, ``S = I + (F+ - F-) grad h / (grad h . F-)`` has no
        denominator left: each column changes by ``-D c`` times the column's own change of the gap.
        """
        if not self._columns:
            return
        n, size = self.n, 2 * self.n
        contact, stage = self.equations.switches[switch]
        slots = self.equations.layout.contacts[contact]
        columns = self._state[size:].reshape(self._columns, size)
        shift = columns[:, :n] @ self._vectors[switch]
        for index in range(self._columns - size):
            direction = np.zeros_like(self._coefficients)
            first, varying = self.equations.first_component(index), self.equations.varying[index]
            direction[varying] = self._parameters[first : first + len(varying)]
            shift[size + index] += direction[slots.deflection] @ self._state[:n]
            shift[size + index] -= slots.stages[stage].sign * direction[slots.stages[stage].clearance]
        push = self._coefficients[slots.force] * self._coefficients[slots.damping]
        columns[:, n:] -= change * np.outer(shift, push)


def _reach(series: NDArray) -> float:
    """How far Taylor series tell the motion: the step of Jorba and Zou (2005, Experimental Mathematics 14, 99-117)."""
    order = series.shape[1] - 1
    size, last = max(1.0, float(np.abs(series[:, 0]).max())), float(np.abs(series[:, -1]).max())
    before = float(np.abs(series[:, -2]).max())
    radii = [(size / tail) ** (1.0 / power) for tail, power in ((last, order), (before, order - 1)) if tail > 0.0]
    return min([1.0, *(radius / math.e**2 for radius in radii)])


def _beginning(series: NDArray, distance: float, longest: float) -> tuple[float, float]:
    """When a motion has gone a distance by its Taylor series (without the constant), and where it is then.

    If it does not go as far as that: where it is when the series tells no more. Where it does not move at all: 0, 0.
    """
    powers, time, depth = np.arange(1.0, len(series) + 1.0), min(COOLDOWN, longest), 0.0
    if not series.any():
        return 0.0, 0.0
    while True:
        depth = float(series @ time**powers)
        if abs(depth) > distance or time >= longest:
            return time, depth
        time = min(2.0 * time, longest)
