"""Friction that never slips over a whole period: what it keeps is no unknown of the orbit.

A Jenkins element that never slips keeps the position of its slider, ``s = e.q - z`` with the deflection ``e.q`` and the
extension z. Coulomb friction that never slips keeps the deflection itself. The motion is then one of a continuum, a
multiplier is exactly 1, and Newton's method has no unique solution. This is no branch point. Such a position has the
left eigenvector ``w = (e, 0, -1)`` or ``(e, 0, 0)`` of the monodromy matrix B, for every motion of the continuum.

Therefore the motion over one period is followed by a reset: ``z = e.q - s``, or ``e.q = s``, with the position s that
the start has. Its derivative N replaces the multiplier 1 of B by 0, as after slip, and leaves the others unchanged
(Wielandt's deflation). So the determinant of ``N B - 1`` does not change its sign where slip begins, and Newton's
method keeps s. This s is rounded to a fine grid; otherwise its rounding errors, which nothing corrects, would grow from
step to step of a walk.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.flow import PERIOD, Arc, Variations
from gapwalk.flow.forces import Angles, CompiledReadings, Dry, balance, contact_force, contact_forces, stages_of
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.flow.motion import DryModes, modes_along
from gapwalk.late_fields import late
from gapwalk.model.coefficients import CoefficientLayout, coefficients_of, layout_of
from gapwalk.model.laws import Host
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit


# The slip rate of dry friction, and what its force lacks to its bound, at instants of a motion with known modes.
#
# Slip ends where the *slip rate* vanishes, and stick ends where the *reserve* does: the force at which slip begins,
# less the force in stick towards one side. Both are functions of the state, the angle and the coefficients while the
# modes are kept as they are, beyond the event too. All of them accept complex numbers, for derivatives by a complex
# step.

_STEP = 1e-150  # of the complex step
_BESIDE = 1e-5  # radians over which the rate of change of a rate is taken
_ORIGIN = [(0.0, 0.0)]  # friction itself depends on no deflection

Array = NDArray[np.float64]


class Course(NamedTuple):
    """Value of a quantity at one instant, and its first and second derivative over time."""

    value: float
    slope: float
    bend: float

    @property
    def vertex(self) -> float:
        """Time from the instant to the vertex of its parabola."""
        return -self.slope / self.bend if self.bend else 0.0

    @property
    def depth(self) -> float:
        """Difference from the value to that at the vertex, positive if that is lower; 0 without a bend."""
        return self.slope**2 / (2.0 * self.bend) if self.bend else 0.0


class FrictionGauge:
    """Gauge of one contact that is dry friction."""

    def __init__(self, layout: CoefficientLayout, contact: int, readings: CompiledReadings | None = None) -> None:
        structure = layout.structure
        self._readings = readings
        self.layout, self.contact, self.n = layout, contact, structure.size
        self._slots = layout.contacts[contact]
        self._law: Any = structure.contacts[contact].law
        self.place = structure.friction.index(contact)
        self.memory = structure.memories.index(contact) if contact in structure.memories else None
        self.reaction = next(
            (number for number, (own, switch) in enumerate(structure.reactions) if own == contact and switch < 0), None
        )

    def sticking(self, modes: DryModes) -> DryModes:
        """Return the modes, at one instant or at some, with this friction in stick."""
        return self._with(modes, 0)

    def slipping(self, modes: DryModes, slip: int) -> DryModes:
        """Return the modes, at one instant or at some, with this friction in slip."""
        return self._with(modes, slip)

    def _with(self, modes: DryModes, slip: int) -> DryModes:
        slips, held = modes.slips.copy(), modes.held.copy()
        slips[..., self.place] = slip
        if self.reaction is not None:
            held[..., self.reaction] = not slip
        return DryModes(slips, held)

    def rate(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes | None, side: int) -> NDArray:
        """Return the slip rate towards a side, over time, for states of the shape (..., state_size)."""
        moved = y[..., self.n : 2 * self.n] @ coefficients[self._slots.deflection]
        if self._slots.sway is not None:
            moved = moved + Angles(self.layout, coefficients, theta).sway(self._slots, 0, 1)
        return side * (moved - coefficients[self._slots.numbers["speed"]])

    def reserve(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> NDArray:
        """Return the force at which slip to a side begins, less the force in stick; shape as `rate`."""
        bound, force = self.bound_and_force(coefficients, theta, y, modes)
        return bound - side * force

    def bound_and_force(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, known: NDArray | None = None
    ) -> tuple[Any, NDArray]:
        """Return the force at which slip begins, and the force in stick, under the modes of one instant."""
        # `known` are the columns of `CompiledReadings.along` while nothing slips.
        if self.reaction is not None and (read := self._read(coefficients, theta, y, modes, known)) is not None:
            columns, table = read
            force = columns[..., : table.shape[1]] @ table[self.n + self.reaction]
            return columns[..., table.shape[1] + 3 * self.place + 2], force
        if self.memory is not None and self.has_constant_limit:  # nothing but the spring
            own = {name: coefficients[slot] for name, slot in self._slots.numbers.items()}
            return self._law.breakaway([], own), own["stiffness"] * y[..., 2 * self.n + self.memory]
        angles, n = Angles(self.layout, coefficients, theta), self.n
        numbers, stages = angles.named(self._slots.numbers, self._slots.waves), stages_of(self._slots, angles, _ORIGIN)
        if (host := self.layout.structure.host(self.contact)) is not None:
            outside = self.layout.contacts[host]
            vector = coefficients[outside.deflection]
            move = (y[..., :n] @ vector + angles.sway(outside), y[..., n : 2 * n] @ vector + angles.sway(outside, 0, 1))
            stages.host = Host(stages_of(outside, angles, [move]), contact_force(outside, angles, [move]))
        if self.memory is not None:
            force = numbers["stiffness"] * y[..., 2 * n + self.memory]
        else:
            force = self._balanced(coefficients, angles, y, modes, [self.reaction or 0])[..., 0]
        return self._law.breakaway(stages, numbers), force

    @property
    def has_constant_limit(self) -> bool:
        """True for a spring whose limit depends on no contact and does not vary."""
        return self.memory is not None and self._law.by == "limit" and not self._slots.varies

    def _read(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, known: NDArray | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the columns of `CompiledReadings.along` for states, and its table; None where they do not serve."""
        if self._readings is None or np.iscomplexobj(coefficients) or np.iscomplexobj(y) or np.iscomplexobj(theta):
            return None
        states, thetas = y.reshape(-1, y.shape[-1]), np.atleast_1d(theta)
        if known is not None:
            read = self._readings.slipping(known, modes.slips)
        else:
            read = self._readings.along(coefficients, states, thetas, modes.slips.astype(float))
        if read is None:
            return None
        return read.reshape(*y.shape[:-1], -1), self._readings.table(coefficients, modes.order(self.layout.structure))

    def acceleration(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> NDArray:
        """Return the derivative of `rate` over time."""
        angles = Angles(self.layout, coefficients, theta)
        moved = self._accelerations(coefficients, angles, y, modes) @ coefficients[self._slots.deflection]
        return side * (moved + angles.sway(self._slots, 0, 2))

    def _accelerations(self, coefficients: NDArray, angles: Angles, y: NDArray, modes: DryModes) -> NDArray:
        """Return accelerations, shape (..., n), under the modes of one instant."""
        if (read := self._read(coefficients, angles.theta, y, modes)) is None:
            return self._balanced(coefficients, angles, y, modes, None)
        columns, table = read
        return columns[..., : table.shape[1]] @ table[: self.n].T

    def _balanced(
        self, coefficients: NDArray, angles: Angles, y: NDArray, modes: DryModes, reactions: list[int] | None
    ) -> NDArray:
        """Return accelerations, shape (..., n), or reactions, under the modes of one instant."""
        layout, n = self.layout, self.n
        held = Constraint(layout, coefficients, modes.order(layout.structure)).coefficients()
        slips, q, v = modes.slips.astype(float), y[..., :n], y[..., n : 2 * n]
        dry = Dry(np.broadcast_to(slips, (*y.shape[:-1], len(slips))), y[..., 2 * n :])
        forces = contact_forces(layout, coefficients, angles.theta, q, v, None, angles, dry)
        rows = layout.accelerations if reactions is None else layout.reactions[reactions]
        return balance(held[rows], q, v, forces, angles.waves)

    def motion(self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes) -> NDArray:
        """Return the derivatives of states over time, shape as `y`."""
        n, structure = self.n, self.layout.structure
        turning = self._accelerations(coefficients, Angles(self.layout, coefficients, theta), y, modes)
        found = np.concatenate((y[..., n : 2 * n], turning, 0.0 * y[..., 2 * n :]), axis=-1)
        for place, contact in enumerate(structure.memories):
            gauge = self if contact == self.contact else FrictionGauge(self.layout, contact, self._readings)
            found[..., 2 * n + place] = gauge._extending(coefficients, theta, y, modes, found)
        return found

    def _extending(
        self, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, motion: NDArray
    ) -> NDArray | float:
        """Return the derivative of the extension over time, from those of positions and velocities."""
        # In stick it is the slip rate, in slip that of the limit. A spring without a limit, whose host is open, has let
        # go: it does not extend.
        if self.has_constant_limit:
            return 0.0 if modes.slips[self.place] else self.rate(coefficients, theta, y, modes, 1)
        angle = theta + 1j * _STEP / float(coefficients[0])
        limit, _ = self.bound_and_force(coefficients.astype(complex), angle, y + 1j * _STEP * motion, modes)
        if slip := int(modes.slips[self.place]):
            return slip * np.imag(limit) / _STEP / coefficients[self._slots.numbers["stiffness"]]
        return np.where(np.real(limit) > 0.0, self.rate(coefficients, theta, y, modes, 1), 0.0)

    def change(self, function: Any, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int) -> Any:
        """Return the derivative over time of `rate` or `reserve` along the motion under some modes; shape as `rate`."""
        if function == self.rate:
            return self.acceleration(coefficients, theta, y, modes, side)
        return self._along(function, coefficients, theta, y, modes, side)[1]

    def _along(
        self, function: Any, coefficients: NDArray, theta: Any, y: NDArray, modes: DryModes, side: int
    ) -> tuple[Any, Any]:
        """Return a function, and its derivative over time along the motion by a complex step."""
        moved = y + 1j * _STEP * self.motion(coefficients, theta, y, modes)
        angle = theta + 1j * _STEP / float(coefficients[0])
        found = function(coefficients.astype(complex), angle, moved, modes, side)
        return np.real(found), np.imag(found) / _STEP

    def course(
        self, function: Any, coefficients: NDArray, theta: float, y: NDArray, modes: DryModes, side: int
    ) -> Course:
        """Return `rate` or `reserve` at one instant with two derivatives over time under the modes just before it."""
        # The second derivative is that of a quantity that is smooth there, to a few digits. It is taken from before the
        # instant: an event may follow at once.
        step, way = _BESIDE * float(coefficients[0]), self.motion(coefficients, theta, y, modes)
        shares = np.array((0.0, -1.0, -2.0))
        thetas, states = theta + _BESIDE * shares, y + step * np.multiply.outer(shares, way)
        if function == self.rate:
            value = function(coefficients, theta, y, modes, side)
            slopes = self.acceleration(coefficients, thetas, states, modes, side)
        else:
            values, slopes = self._along(function, coefficients, thetas, states, modes, side)
            value = values[0]
        bend = float(3.0 * slopes[0] - 4.0 * slopes[1] + slopes[2]) / (2.0 * step)
        return Course(float(value), float(slopes[0]), bend)


# The phases of dry friction over one period of an orbit, and how far they are from a change of their sequence.
#
# A phase is slip in one direction, slip in the other, or stick. Two changes of the sequence that cancel each other
# within one step of a walk are not visible at its ends; the margins there show where there may be some.

_SIGNS = {1: "+", -1: "-", 0: "0"}


class FrictionPhase(NamedTuple):
    """A phase of friction: its mode, 1 or -1 in slip and 0 in stick, and the angles at which it begins and ends.

    The end of the last phase lies in the next period if it passes the end of its own.
    """

    mode: int  #: 1 or -1 in slip, 0 in stick.
    #: start, stop: Angles in radians.
    start: float
    stop: float

    @property
    def length(self) -> float:
        """Its duration in radians."""
        return self.stop - self.start

    def contains(self, theta: float, full: float, margin: float = 0.0) -> bool:
        """Return True if an angle lies within it, on a circle of circumference `full`."""
        return (theta - self.start + margin) % full <= self.length + 2.0 * margin

    def away(self, theta: float, full: float) -> float:
        """Return the distance of an angle from it, on a circle of circumference `full`; 0 within it."""
        after = (theta - self.start) % full
        return 0.0 if after <= self.length else min(after - self.length, full - after)


def friction_phases(slips: Sequence[SlipEvent], contact: int, full: float) -> list[FrictionPhase]:
    """Return the phases of one contact in one period, in order; one that lasts all the period begins at 0."""
    own = [event for event in slips if event.contact == contact]
    # of changes at one instant the last one counts: a phase without length is none
    own = [each for each, after in zip(own, [*own[1:], None], strict=True) if after is None or after.theta > each.theta]
    turns = [event for before, event in zip([own[-1], *own[:-1]], own, strict=True) if event.slip != before.slip]
    if not turns:
        return [FrictionPhase(event.slip, 0.0, full) for event in own[:1]]
    stops = [*(event.theta for event in turns[1:]), turns[0].theta + full]
    return [FrictionPhase(event.slip, event.theta, stop) for event, stop in zip(turns, stops, strict=True)]


def text_of(phases: Sequence[FrictionPhase]) -> str:
    """Return the modes of successive phases as a text, such as ``+0-0``."""
    return "".join(_SIGNS[phase.mode] for phase in phases)


def stick_words(phases: Sequence[FrictionPhase]) -> str:
    """Return how often friction sticks in a period, such as ``2 sticks``."""
    modes = [phase.mode for phase in phases]
    if not any(modes):
        return "sticks"
    count = modes.count(0)
    return "slips" if not count else f"{count} stick{'s' if count > 1 else ''}"


class Margin(NamedTuple):
    """Distance of friction from a change at one instant."""

    contact: int  #: Number of the contact.
    what: str  #: What vanishes at the change: ``rate`` within slip, ``reserve`` within stick, ``stop`` where slip ends.
    side: int  #: The direction of slip concerned.
    #: theta, value: The angle, and the distance: for ``rate`` and ``reserve`` the least value nearby.
    theta: float
    value: float
    range: float  #: Largest value of the same quantity.


def margins_of(
    orbit: Orbit, thetas: Array, found: Variations, readings: CompiledReadings | None = None
) -> list[Margin]:
    """Return the margins of all friction over one period."""
    structure, along = orbit.system.structure, _Along(None, None)
    if structure.reactions and len(structure.friction) + len(structure.reactions) > 2:
        modes, still = modes_along(structure, thetas, *found.logs[1:3], before=True), np.zeros(len(structure.friction))
        columns = readings and readings.along(coefficients_of(orbit.system), found.states, thetas, still)
        along = _Along(columns, modes)
    return [
        each
        for contact, phases in orbit.friction.items()
        for each in _Margins(
            orbit, thetas, found, FrictionGauge(layout_of(structure), contact, readings), phases, along
        ).all()
    ]


class _Along(NamedTuple):
    """Readings of a motion while nothing slips, and the modes just before its samples, which all contacts share."""

    columns: Array | None
    modes: Any


class _Margins:
    """Margins of one contact that is friction."""

    def __init__(
        self,
        orbit: Orbit,
        thetas: Array,
        found: Variations,
        gauge: FrictionGauge,
        phases: list[FrictionPhase],
        along: _Along,
    ) -> None:
        self._gauge, self._phases, self._contact = gauge, phases, gauge.contact
        self._thetas, self._states, self._full = thetas, found.states, float(thetas[-1])
        self._coefficients, self._along = coefficients_of(orbit.system), along
        self._structure = orbit.system.structure

    def all(self) -> list[Margin]:
        """Return all margins."""
        thetas, found, full = self._thetas, list[Margin](), self._full
        rates = self._gauge.rate(self._coefficients, thetas, self._states, None, 1)
        firsts = np.searchsorted(thetas, [phase.start % full for phase in self._phases]).tolist()
        lasts = [*firsts[1:], *firsts[:1]]
        inside = [self._inside(*each) for each in zip(self._phases, firsts, lasts, strict=True)]
        sticks = [place for place, own in enumerate(inside) if not self._phases[place].mode and len(own) > 2]
        past = [phase.mode for phase in (self._phases[-1], *self._phases[:-1])]
        ends = [place for place, phase in enumerate(self._phases) if past[place] not in (0, phase.mode)]
        starts = [firsts[place] for place in ends]
        asked = [(inside[place], int(inside[place][len(inside[place]) // 2])) for place in sticks]
        if self._gauge.memory is None:
            asked += [(np.array([start]), start) for start in starts]
        bounds = self._bounds(asked)
        for place, (own, phase) in enumerate(zip(inside, self._phases, strict=True)):
            if phase.mode and len(own) > 2:
                found += self._least(phase, phase.mode, own, phase.mode * rates[own])
            elif place in sticks:
                bound, force = bounds[sticks.index(place)]
                for side in (1, -1):
                    found += self._least(phase, side, own, bound - side * force)
        for place, start, (bound, force) in zip(ends, starts, bounds[len(sticks) :], strict=False):
            side = past[place]
            own, other = float(bound[0] + side * force[0]), float(bound[0] - side * force[0])
            found.append(Margin(self._contact, "stop", side, float(thetas[start]), own, own + other))
        return found

    def _inside(self, phase: FrictionPhase, first: int, last: int) -> NDArray[np.intp]:
        """Return the samples within a phase, in the order of time, given those at which it and the next one begin."""
        count = len(self._thetas) - 1
        if first == last:  # it lasts a moment, or all the period
            return np.arange(first, first + count) % count if phase.length > 0.5 * self._full else np.array([first])
        return np.arange(first, last + 1) if first < last else np.arange(first, last + count + 1) % count

    def _bounds(self, asked: list[tuple[NDArray[np.intp], int]]) -> list[tuple[Array, Array]]:
        """Return the force at which slip begins, and that in stick, at sets of samples with the modes at one each."""
        groups: dict[bytes, tuple[DryModes, list[int]]] = {}
        for number, modes in enumerate(self._stuck([at for _, at in asked])):
            groups.setdefault(modes.slips.tobytes() + modes.held.tobytes(), (modes, []))[1].append(number)
        found: dict[int, tuple[Array, Array]] = {}
        for modes, numbers in groups.values():
            samples = np.concatenate([asked[number][0] for number in numbers])
            states, thetas = self._states[samples], self._thetas[samples]
            read = None if self._along.columns is None else self._along.columns[samples]
            bound, force = self._gauge.bound_and_force(self._coefficients, thetas, states, modes, read)
            bound, first = bound + 0.0 * force, 0
            for number in numbers:
                last = first + len(asked[number][0])
                found[number], first = (bound[first:last], force[first:last]), last
        return [found[number] for number in range(len(asked))]

    def _stuck(self, samples: list[int]) -> list[DryModes]:
        """Return the modes just before some samples, with this friction in stick."""
        structure = self._structure
        friction, reactions = len(structure.friction), len(structure.reactions)
        # the force of a spring in series depends on no modes, and there may be no others
        if self._gauge.memory is not None or friction == reactions == 1:
            return [DryModes(np.zeros(friction, dtype=np.int8), np.ones(reactions, dtype=bool))] * len(samples)
        return [self._gauge.sticking(self._along.modes.at(sample)) for sample in samples]

    def _least(self, phase: FrictionPhase, side: int, samples: NDArray[np.intp], values: Array) -> list[Margin]:
        """Return the least values of a quantity within a phase, by parabolas."""
        thetas = self._thetas[samples]
        if phase.length >= self._full:
            thetas, values = np.append(thetas, thetas[:2] + PERIOD), np.append(values, values[:2])
        rises = values[1:] >= values[:-1]
        lowest = rises[1:] & ~rises[:-1]
        if not lowest.any():
            return []
        found, what, largest = list[Margin](), "rate" if phase.mode else "reserve", float(values.max())
        for place in np.flatnonzero(lowest).tolist():
            before, here, after = values[place : place + 3].tolist()
            slope, bend = 0.5 * (after - before), before - 2.0 * here + after
            value = here - (0.5 * slope**2 / bend if bend > 0.0 else 0.0)
            # the samples are even but for those at events
            at, width = float(thetas[place + 1]), float(thetas[place + 1] - thetas[place]) % PERIOD
            shift = -width * slope / bend if bend > 0.0 else 0.0
            found.append(Margin(self._contact, what, side, at + shift, value, largest))
        return found


_KEPT = 1e-6  # change over one period, as a share, of what is kept but for rounding
_BITS = 30  # of the grid of positions that are kept: 1e-9 of a length of the system
_MOMENT = 1e-5  # radians of a phase at the start of an arc that an error of the state makes
_ROUNDING = 1e-12  # multipliers of motions with friction that are 0 but for rounding, over the largest
_DECAYED = 1e-2  # multipliers beyond which none counts as 0: beside a graze the largest may be 1e12


def collapses(system: System) -> bool:
    """Return True if friction or impacts can make neighbouring motions one, so that volumes of states vanish."""
    return bool(system.structure.memories or system.structure.reactions)


def stuck_in(layout: CoefficientLayout, coefficients: NDArray[np.float64], arcs: Sequence[Arc]) -> tuple[int, ...]:
    """Return the numbers of the contacts whose friction sticks all through some arcs, and keeps what it had."""
    # Friction of a stage that opens neither slips nor keeps anything meanwhile, so the transitions decide.
    found = []
    for contact in never_slipping(arcs):
        kept = kept_row(layout, coefficients, contact)
        carried = kept
        for arc in reversed(arcs):
            carried = carried @ transition_of(arc)
        if np.abs(carried - kept).max() <= _KEPT * np.abs(kept).max():
            found.append(contact)
    return tuple(found)


def never_slipping(arcs: Sequence[Arc]) -> list[int]:
    """Return the numbers of the contacts whose friction sticks all through some arcs."""
    events = [event for arc in arcs for event in arc.slips]
    if not events:
        return []
    slipping = {event.contact for event in events if event.slip}
    return sorted({event.contact for event in events} - slipping)


def released(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    arcs: Sequence[Arc],
    start: NDArray[np.float64],
    length: float = 1.0,
) -> list[Arc]:
    """Return the arcs of one period with the reset of what friction keeps at the end of the last one."""
    # Shapes: `start` (state_size,).
    stuck = stuck_in(layout, coefficients, arcs)
    if not stuck:
        return [*arcs]
    reset, offset = reset_of(layout, coefficients, stuck, start, length)
    last = arcs[-1]
    state, transition = reset @ last.state + offset, reset @ transition_of(last)
    return [*arcs[:-1], last._replace(state=state, transition=transition)]


def reset_of(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    stuck: Sequence[int],
    start: NDArray[np.float64],
    length: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the reset of what some contacts keep: a matrix N, and the vector c of ``N y + c``."""
    structure, n = layout.structure, layout.structure.size
    reset, offset = np.eye(structure.state_size), np.zeros(structure.state_size)
    grid = 2.0 ** (round(math.log2(length)) - _BITS)
    vectors = {contact: coefficients[layout.contacts[contact].deflection] for contact in stuck}
    rigid = [vector for contact, vector in vectors.items() if contact not in structure.memories]
    if rigid:
        across = np.linalg.qr(np.transpose(rigid))[0]
        reset[:n, :n] -= across @ across.T
        offset[:n] = across @ (grid * np.round(start[:n] @ across / grid))
    for contact, vector in vectors.items():
        if contact in structure.memories:
            row = 2 * n + structure.memories.index(contact)
            reset[row] = 0.0
            reset[row, :n] = vector @ reset[:n, :n]
            kept = float(vector @ start[:n] - start[row])
            offset[row] = vector @ offset[:n] - grid * round(kept / grid)
    return reset, offset


def kept_row(layout: CoefficientLayout, coefficients: NDArray[np.float64], contact: int) -> NDArray[np.float64]:
    """Return the derivative by the state of what friction keeps while it sticks; shape (state_size,)."""
    structure = layout.structure
    row = np.zeros(structure.state_size)
    row[: structure.size] = coefficients[layout.contacts[contact].deflection]
    if contact in structure.memories:
        row[2 * structure.size + structure.memories.index(contact)] = -1.0
    return row


class Closure(NamedTuple):
    """Multipliers of a motion with dry friction over one period."""

    #: shape (state_size,): They are exactly 1 for what friction keeps, and exactly 0 where slip or stick makes
    #: neighbouring motions one.
    multipliers: NDArray[np.complex128]
    slips: tuple[SlipEvent, ...] = ()  #: The log of slip: a mode that only goes on at the start of an arc is left out.
    stuck: tuple[int, ...] = ()  #: Numbers of the contacts whose friction never slips.

    @classmethod
    def of(
        cls,
        layout: CoefficientLayout,
        coefficients: Callable[[], NDArray[np.float64]],
        arcs: Sequence[Arc],
        start: NDArray[np.float64],
        exact: Callable[[], Sequence[Arc]] | None = None,
    ) -> Closure:
        """Compute the multipliers from the arcs of one period; `coefficients` is called only if friction sticks.

        Where the arcs have no transitions, in none of which friction sticks all the time, those of `exact` give the
        multipliers, late.
        """
        if exact is not None:
            return cls(late(lambda: cls.of(layout, coefficients, exact(), start).multipliers), _joined(arcs))
        if not any(arc.slips for arc in arcs):
            return cls(multipliers([transition_of(arc) for arc in arcs], arcs[0].modes))
        stuck = stuck_in(layout, coefficients(), arcs) if never_slipping(arcs) else ()
        free = released(layout, coefficients(), arcs, start) if stuck else arcs
        found = multipliers([transition_of(arc) for arc in free])  # the largest first
        sizes = [abs(each) for each in found.tolist()]
        least = min(_ROUNDING * max(1.0, sizes[0]), _DECAYED)
        if sizes[-1] <= least:
            found[[size <= least for size in sizes]] = 0.0
        if stuck:
            values = [*found.tolist()[: len(found) - len(stuck)], *[1.0 + 0.0j] * len(stuck)]
            found = np.array(sorted(values, key=abs, reverse=True))
        return cls(found, _joined(arcs), stuck)


def _joined(arcs: Sequence[Arc]) -> tuple[SlipEvent, ...]:
    """Return the log of slip of successive arcs as one."""
    # The state at the start of an arc is off by what Newton's method leaves. If friction slips there, its force may be
    # a little within its bound; then it would stick for a moment. Such a moment is left out.
    modes, found = {event.contact: event.slip for event in arcs[-1].slips}, list[SlipEvent]()
    for arc in arcs:
        for place, event in enumerate(arc.slips):
            before, is_start = modes[event.contact], event.theta == arc.slips[0].theta
            if is_start and _lasts_a_moment(arc.slips[place:], before):
                event = event._replace(slip=before)
            if event.slip != before or (is_start and arc is arcs[0]):
                found.append(event)
                modes[event.contact] = event.slip
    return tuple(found)


def _lasts_a_moment(events: Sequence[SlipEvent], before: int) -> bool:
    """Return True if friction returns to the mode before an arc a moment after the start, the first of the events."""
    following = (each for each in events[1:] if each.contact == events[0].contact)
    later = next(following, events[0])
    return later.slip == before and later.theta - events[0].theta < _MOMENT


def transition_of(arc: Arc) -> NDArray[np.float64]:
    """Return the transition of an arc that was integrated with it."""
    assert arc.transition is not None
    return arc.transition


def without_kept(multipliers: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """Return multipliers with 0 in place of `count` that are 1, as in `Closure`."""
    if not count:
        return multipliers
    order = np.argsort(np.abs(multipliers - 1.0), kind="stable")
    return np.append(np.delete(multipliers, order[:count]), np.zeros(count, complex))


def kept_words(structure: Structure, stuck: Iterable[int]) -> list[str]:
    """Return a clause for each contact that never slips: what it keeps."""
    return [
        f"{structure.contacts[contact].name} never slips: its "
        f"{'extension' if contact in structure.memories else 'position'} is kept"
        for contact in stuck
    ]
