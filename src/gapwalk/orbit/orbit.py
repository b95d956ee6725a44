"""Periodic orbit: one steady motion of a system, with its multipliers, contacts and measures.

Two orbits are the same motion if they agree up to a shift after which the forcing repeats, or if one repeats the other
several times.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.contact_events import ContactEvent, Turn
from gapwalk.flow.equations import magnitude
from gapwalk.flow.flow import PERIOD, Arc, Flow, Restarts, flow_of
from gapwalk.flow.forces import Angles, contact_deflections
from gapwalk.flow.friction_state import SlipEvent
from gapwalk.flow.motion import Motion, Signal, drags_turned_back, one_sided_drags, sample, switch_names
from gapwalk.late_fields import LateFields
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of
from gapwalk.model.measures import EXAMPLES, IMPACTS, KINDS, MeasureName, full_measure, parsed
from gapwalk.model.problems import did_you_mean, near_names
from gapwalk.model.system import System, pace_text
from gapwalk.notebook import Shown
from gapwalk.orbit.drifting import brought_back, drifts_of
from gapwalk.orbit.floquet import Instability, classify
from gapwalk.orbit.method import Method
from gapwalk.orbit.sticking import (
    FrictionPhase,
    Margin,
    friction_phases,
    kept_words,
    margins_of,
    released,
    stick_words,
    transition_of,
    without_kept,
)
from gapwalk.summary import Tables, row_of, rows_of

# Measures of one orbit: extrema, mean, rms and harmonics of any of its signals.
#
# `survey` finds the extrema and means of each coordinate, and the turning points of the deflections, in one pass.

_TURNS = 1e-9  # rate of a deflection, over the size of a state, that is only rounding where it turns at the start
_SAMPLES = 96  # per forcing period: those of a motion with friction

MEASURES = ("max", "min", "half", "mean", "rms")


def measure_names(coordinates: Sequence[str]) -> list[str]:
    """Return the headings of the measures: maximum, minimum, half the peak to peak, mean and rms of each coordinate."""
    return [f"{kind}.{q}" for q in coordinates for kind in MEASURES]


def parameter_headings(parameters: Sequence[str], coordinates: Sequence[str]) -> list[str]:
    """Return headings of parameters: their names, but ``parameter mean.q1`` if a measure is called ``mean.q1``."""
    taken = measure_names(coordinates)
    return [f"parameter {name}" if name in taken else name for name in parameters]


class Turns(NamedTuple):
    """Turning points of a quantity along an orbit: their angles, increasing, and its values there.

    Plain lists are used, because there are few turning points and they are needed at every step of a walk.
    """

    thetas: list[float]  #: Angles, in radians.
    values: list[float]  #: Values of the quantity there.

    def nearest(self, theta: float, full: float) -> int:
        """Return the index of the turning point nearest to an angle, on a circle of circumference `full`."""
        after = bisect_left(self.thetas, theta)
        before, after = after - 1, after % len(self.thetas)
        nearer = apart(self.thetas[before], theta, full) <= apart(self.thetas[after], theta, full)
        return before if nearer else after


def measure(orbit: Orbit, name: str) -> float:
    """See `Orbit.measure`."""
    coordinates, units = orbit.system.coordinates, orbit.system.units
    full = full_measure(name, coordinates)
    asked = parsed(full)
    if asked is None:
        kind, _, signal = full.partition(".")
        if kind.startswith("h") and signal and not near_names(kind, MEASURES):
            return abs(harmonic(orbit, kind[1:], signal))  # which says what an order is
        if near := near_names(name, [*coordinates, *(f"{each}.{q}" for each in KINDS for q in coordinates)]):
            raise ModelError(f"there is no measure {name!r}; did you mean {' or '.join(near)}?")
        raise ModelError(
            f"there is no measure {name!r}; write one of {EXAMPLES}, a dot and a signal, such as half.{coordinates[0]}"
        )
    value = _measured(orbit, asked)
    if asked.over is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            value = float(np.divide(value, _measured(orbit, asked.over)))
    return asked.level(value, units) if asked.is_level else value


def _measured(orbit: Orbit, asked: MeasureName) -> float:
    """Return a measure in the unit of its signal."""
    coordinates, signal = orbit.system.coordinates, asked.signal
    if asked.kind == IMPACTS:
        return float(impact_rate(orbit, signal))
    if asked.orders:
        return math.hypot(*(abs(each) for each in harmonics(orbit, asked.orders, signal)))
    if asked.kind == "drift":
        if signal not in coordinates:
            raise ModelError(f"only coordinates drift, not {signal!r}; {did_you_mean(signal, coordinates)}")
        return float(orbit.drift[coordinates.index(signal)]) / orbit.period
    if signal in coordinates:
        row = orbit.extremes[coordinates.index(signal)]
    else:
        motion = orbit.motion(8 * orbit.samples)
        values = motion.signal(signal)  # its largest sample is its maximum to about 1e-5
        row = values.max(), values.min(), values[:-1].mean(), np.sqrt(np.mean(values[:-1] ** 2))
        impulses = motion.impulses(signal)[1]
        if len(impulses):  # of rigid stops: it is infinite there
            struck = [(impulses > 0.0).any(), (impulses < 0.0).any()]
            high, low = np.where(struck, (np.inf, -np.inf), row[:2])
            row = high, low, row[2] + impulses.sum() / (PERIOD * orbit.period), np.inf
    if asked.kind in ("half", "peak_to_peak"):
        return float(row[0] - row[1]) / (2 if asked.kind == "half" else 1)
    return float(row[("max", "min", "mean", "rms").index(asked.kind)])


def impact_rate(orbit: Orbit, contact: str) -> Fraction:
    """Return the impacts on a contact per forcing period, on both sides: where the first of its stages is closed."""
    first: dict[int, tuple[float, int]] = {}
    for switch, (number, side, clearance) in enumerate(orbit.system.breakpoints):
        if orbit.system.structure.contacts[number].name == contact:
            first[side] = min(first.get(side, (math.inf, 0)), (clearance, switch))
    if not first:
        names = {orbit.system.structure.contacts[number].name: None for number, *_ in orbit.system.breakpoints}
        raise ModelError(f"there are no impacts on {contact!r}: with a gap {did_you_mean(contact, [*names])}")
    return Fraction(sum(orbit.closings[switch] for _, switch in first.values()), orbit.period)


def harmonic(orbit: Orbit, order: str | int | Fraction, signal: str) -> complex:
    """Return the complex amplitude of a harmonic (``Re(c exp(i h theta))``); its order is a multiple of 1/m."""
    # Orders count turns of the forcing frequency, or of a shaft whose speed is a parameter.
    return harmonics(orbit, (order,), signal)[0]


def harmonics(orbit: Orbit, orders: Sequence[str | int | Fraction], signal: str) -> list[complex]:
    """Return the complex amplitudes of some harmonics, as `harmonic` does."""
    places = [_line_of(orbit, order) for order in orders]
    motion = orbit.motion(4 * orbit.samples)
    values = motion.signal(signal)[:-1]
    lines = np.fft.rfft(values) / len(values)
    theta, sizes = motion.impulses(signal)
    found = []
    for order, line in zip(orders, places, strict=True):
        if line >= len(lines):
            raise ModelError(f"harmonic {order} lies beyond the {len(lines) - 1} lines that this orbit resolves")
        pulses = np.sum(sizes * np.exp(-1j * line / orbit.period * theta)) / (PERIOD * orbit.period)
        found.append(complex(lines[line] + pulses) * (1 if line == 0 else 2))
    return found


def _line_of(orbit: Orbit, order: str | int | Fraction) -> int:
    """Return the number of the line of an order in the spectrum over one period."""
    turns = orbit.system.turns
    try:
        line = Fraction(order) / (turns or 1) * orbit.period
    except ValueError:
        raise ModelError(f"harmonic {order!r} is not an order; write h0, h1, h2, ... or h1/2") from None
    if line.denominator != 1 or line < 0:
        step = f"1/{orbit.period} of W" if turns is None else f"multiples of order {Fraction(turns) / orbit.period}"
        raise ModelError(f"a period-{orbit.period} orbit has harmonics of {step}, not of {order}")
    return int(line)


class Survey(NamedTuple):
    """Survey of one orbit."""

    turns: tuple[Turns, ...]  #: Angles at which the deflection of each contact turns, and its values there.
    visited: list[list[float]]  #: Positions at the start, and at the turning points of coordinates and deflections.
    means: NDArray[np.float64]  #: shape (2, n): Mean of each coordinate, and of its square.
    margins: list[Margin]  #: Distances of friction from changes of its sequence of slip and stick.
    #: shape (period + 1, state_size): States at the start of each forcing period, and at the end; None of motions with
    #: friction or rigid stops.
    returns: NDArray[np.float64] | None = None


def survey(orbit: Orbit) -> Survey:
    """Integrate an orbit once more, with the integrals of its positions, and record every turning point."""
    flow, coefficients = flow_of(orbit.system, survey=True), coefficients_of(orbit.system)
    length, n, structure = PERIOD * orbit.period, orbit.system.size, orbit.system.structure
    thetas = PERIOD * np.arange(orbit.period + 1.0)
    if structure.friction:
        starts = [phase.start % length for phases in orbit.friction.values() for phase in phases]
        thetas = np.sort(np.concatenate((_even(orbit.period), starts)))
        if (same := thetas[1:] == thetas[:-1]).any():
            thetas = np.delete(thetas, np.flatnonzero(same))
    integrals, turns, found = flow.survey(coefficients, orbit.state, thetas, orbit.known_states)
    contacts = []
    for contact in flow.equations.layout.contacts:
        factors = [(i, f) for i, f in enumerate(coefficients[contact.deflection].tolist()) if f] or [(0, 0.0)]
        event = factors[0][0]  # the deflection turns with its only coordinate, or has an event of its own
        sways = contact.sway is not None
        if len(factors) > 1 or sways:
            event = next(k for k, (slots, _) in enumerate(flow.equations.turning) if slots is contact.deflection)
        own = [turn for turn in turns if turn.event == event]
        if len(own) % 2 and not sways and not structure.friction and not structure.reactions:
            # turns alternate: of an odd number one is lost at the start, as where a free motion begins at its extremum
            rate = sum([factor * float(orbit.state[n + i]) for i, factor in factors])
            if abs(rate) <= _TURNS * magnitude(orbit.state, orbit.system):
                own.insert(0, Turn(event, 0.0, orbit.state[:n].tolist()))
        values: list[float] = [sum([factor * turn.positions[i] for i, factor in factors]) for turn in own]
        if sways:
            angles = Angles(flow.equations.layout, coefficients, np.array([turn.theta for turn in own]))
            values = (np.array(values) + angles.sway(contact)).tolist()
        contacts.append(Turns([turn.theta for turn in own], values))
    visited = [orbit.state[:n].tolist(), *(turn.positions for turn in turns)]
    margins = []
    if structure.friction and orbit.is_exact:
        margins = margins_of(orbit, thetas, found, flow.readings)
    returns = None if structure.friction or structure.reactions else found.states
    return Survey(tuple(contacts), visited, integrals / length, margins, returns)


def reversals_of(orbit: Orbit) -> NDArray[np.float64] | None:
    """Return the reversals of deflections of a motion a last Newton step away, as in `Arc`; None if not known."""
    return orbit.__dict__.get("_reversals")


@lru_cache(maxsize=16)
def _even(period: int) -> NDArray[np.float64]:
    """Return the even samples of a motion with friction over some forcing periods."""
    return np.linspace(0.0, PERIOD * period, _SAMPLES * period + 1)


def apart(a: float, b: float, full: float) -> float:
    """Return the distance of two angles on a circle of circumference `full`."""
    return abs((a - b + full / 2) % full - full / 2)


_AT_STOP = 1e-9  # share of a clearance by which a motion that rests on it may differ from it
_AT_IMPACT = 1e-4  # radians within which a turning point is that at an impact; logs are those of the last step but one
_SIGNS = {1: "+", -1: "-"}
_EXACTLY, _NEARLY = 1e-12, 1e-5  # distances of a multiplier from 1 between which rounding of the state may move it far
_KEPT = 1e-4  # the larger of them where friction slips, which may keep nearly any position
_ROUNDINGS = 1e-15  # rounding of a state over one period, as a share of it
_SAFETY = 4.0  # factor on the motion of a multiplier by rounding
SAME = 1e-6
"""Distance of two states, relative to their size, within which they count as equal."""


_NO_STATES = np.zeros((0, 0))
_ALIKE = 0.8  # least ratio of the lengths of a flight at two neighbouring points of a branch
_SETTLES = (1e-5, 1e-2)  # angles between which the impacts of a chatter are distinguished from its end


@dataclass(frozen=True, eq=False)
class Orbit(LateFields, Shown):
    """Motion that repeats after `period` forcing periods.

    At points of branches all but `state` may be those of a state 1e-7 away; ``find_orbit(orbit.system, orbit.period,
    orbit)`` gives them to rounding.

    Attributes
    ----------
    found_by
        Name of the method that finds such orbits.
    is_exact
        True if the flow over one period leads back to its state, to the accuracy of the flow.
    truncation
        Truncation error of the method, relative to the motion; 0 if the orbit is exact.

    Examples
    --------
    >>> orbit.period, orbit.stable, abs(orbit.multipliers).round(6)
    (1, True, array([0.592385, 0.592385]))
    >>> round(orbit.measure("max.x"), 6)
    0.777839
    """

    found_by: ClassVar[str] = "shooting"
    is_exact: ClassVar[bool] = True
    truncation = 0.0

    system: System  #: The system, with the parameter values at which this orbit exists.
    period: int  #: m: the orbit repeats after m forcing periods.
    state: NDArray[np.float64]  #: shape (state_size,): Positions, velocities and extensions at theta = 0.
    #: shape (state_size,): Floquet multipliers, largest modulus first. One is exactly 1 for each position that friction
    #: keeps because it never slips.
    multipliers: NDArray[np.complex128]
    events: tuple[ContactEvent, ...]  #: Crossings of breakpoints in one full period.
    residual: float  #: Largest component of the difference between its end and its start.
    steps: int  #: Number of integration steps over the orbit; it determines the sampling.
    #: Beginnings of slip and stick of friction in one full period, first those that already last at its start.
    slips: tuple[SlipEvent, ...] = field(default=(), kw_only=True)
    #: Numbers of the contacts whose friction never slips and keeps its position: the orbit is one of a continuum.
    stuck: tuple[int, ...] = field(default=(), kw_only=True)
    #: shape (segments - 1, state_size): States at the starts of the later of several equal segments: of a strongly
    #: unstable orbit, the state at theta = 0 alone does not determine the rest to working accuracy.
    restarts: NDArray[np.float64] = field(default_factory=lambda: _NO_STATES, kw_only=True)

    _late: ClassVar[tuple[str, ...]] = ("multipliers",)
    _kept: ClassVar[tuple[str, ...]] = ("extremes",)  # in files too: a picture then needs no integration

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        structure = self.system.structure
        size, switches = structure.state_size, len(structure.breakpoints)
        shapes = (self.state.shape, self.multipliers.shape, self.extremes.shape)
        if shapes != ((size,), (size,), (structure.size, 4)) or self.period < 1 or self.steps < 0:
            raise ValueError("an orbit has another size than the states of its system")
        if self.restarts.ndim != 2 or (len(self.restarts) and self.restarts.shape[1] != size):
            raise ValueError("the later segments of an orbit begin in states of another size")
        if not all(0 <= event.switch < switches for event in self.events):
            raise ValueError("a contact event has the number of a switch that the system does not have")
        if not all(0 <= each < len(structure.contacts) for each in (*self.stuck, *(e.contact for e in self.slips))):
            raise ValueError("friction slips at a contact that the system does not have")

    def tables(self) -> Tables:
        """Return the state by its names, the multipliers, and the contact events with the names of their contacts."""
        found = super().tables()
        names, state = self.system.state_names, self.state.tolist()
        rows = {
            "state": [{"state": name, "value": value} for name, value in zip(names, state, strict=True)],
            "multipliers": [{"multiplier": each} for each in self.multipliers.tolist()],
        }
        if self.events:
            rows["events"] = [{"contact": describe_switch(self, each.switch), **row_of(each)} for each in self.events]
        return {**found, **{name: partial(rows_of, table) for name, table in rows.items()}}

    @cached_property
    def instability(self) -> Instability:
        """Numbers of multipliers outside the unit circle (above 1, below -1, complex pairs), and of those on it."""
        return classify(self.free_multipliers, self.multiplier_error if self.is_exact else 0.0)

    @cached_property
    def free_multipliers(self) -> NDArray[np.complex128]:
        """Multipliers that decide on stability: 0 in place of those equal to 1 by friction that sticks all the time."""
        return without_kept(self.multipliers, self.kept)

    @property
    def kept(self) -> int:
        """Number of multipliers that are exactly 1 because the orbit is one of a continuum; stability ignores them."""
        return len(self.stuck) or self._drifts.shape[1]

    @cached_property
    def _drifts(self) -> NDArray[np.float64]:
        return drifts_of(self.system)

    @cached_property
    def drift(self) -> NDArray[np.float64]:
        """Increments of the positions over the orbit's period, shape (n,); zero for parts that return to their place.

        A motion repeats up to a translation in a direction in which no force depends on a position, as of a mass that
        slides by dry friction: its position at the start is any.
        """
        if not self._drifts.shape[1]:
            return np.zeros(self.system.size)
        moved = self.motion(1).q
        return self._drifts @ (self._drifts.T @ (moved[-1] - moved[0]))

    @property
    def own_method(self) -> Method | None:
        """The only method that can follow the orbit, as it is not isolated by others; None if any method can."""
        return None

    @property
    def determined(self) -> NDArray[np.float64]:
        """The first unknowns of an exact orbit, which determine its motion: its state, shape (state_size,)."""
        return self.state

    @property
    def stable(self) -> bool:
        """True if all multipliers lie inside the unit circle."""
        return self.instability.label == "stable"

    @cached_property
    def multiplier_error(self) -> float:
        """Approximate error of the multiplier nearest to 1, by rounding of the state; 0 if no multiplier is near 1."""
        near = min([abs(each - 1.0) for each in self.free_multipliers.tolist()], default=1.0)
        is_near = _EXACTLY < near < (_KEPT if self.slips else _NEARLY)
        if not is_near or self.stuck or len(self.restarts) or self.own_method is not None:
            return 0.0
        flow, coefficients = flow_of(self.system, transition=True), coefficients_of(self.system)

        def nearest(state: NDArray[np.float64]) -> tuple[Arc, NDArray[np.float64], NDArray[np.float64], complex]:
            arc = flow.integrate(coefficients, state, 0.0, PERIOD * self.period)
            assert arc.transition is not None
            values, ways = np.linalg.eig(arc.transition)
            place = int(np.argmin(np.abs(values - 1.0)))
            return arc, np.real(ways[:, place]), np.real(np.linalg.pinv(ways)[place]), complex(values[place])

        arc, way, left, value = nearest(self.state)
        off = abs(float(left @ (arc.state - self.state))) + _ROUNDINGS * float(np.abs(left) @ np.abs(self.state))
        try:
            moved = [nearest(self.state + sign * off / near * way)[-1] for sign in (-1.0, 1.0)]
        except NumericalError:
            return 0.0
        return _SAFETY * max(abs(each - value) for each in moved)

    @property
    def harmonics(self) -> int:
        """H, the highest harmonic of the forcing frequency in its Fourier series; 0 if it is given by its state."""
        return 0

    @property
    def method(self) -> type[Method]:
        """The method that finds such orbits."""
        return Method.named(self.found_by)

    def posed_in(self, count: int) -> Method:
        """Return the orbit's method, with options that give its equation a number of unknowns."""
        return self.method.resolving(self, count)

    @cached_property
    def closings(self) -> tuple[int, ...]:
        """Number of closings of each switch in one full period; it changes only where a contact grazes.

        It is zero for a stage that acts on both sides without a gap, as a smooth spring does: it stays closed.
        """
        gapless = self.system.gapless
        counts = [0] * len(gapless)
        for event in self.events:
            counts[event.switch] += event.enters and not gapless[event.switch]
        return tuple(counts)

    @cached_property
    def chatters(self) -> dict[int, list[float]]:
        """Angles from each impact on a rigid stop to the instant from which the stop is held, for each switch.

        Infinitely many impacts precede this instant; the log has those that are not too close to it.
        """
        found, full = {}, PERIOD * self.period
        for switch in {switch for _, switch in self.system.structure.reactions if switch >= 0}:
            own = [event for event in self.events if event.switch == switch]
            begins = [own[place - 1].theta for place, event in enumerate(own) if not event.enters]
            if begins:
                lasts = (min((begin - event.theta) % full for begin in begins) for event in own)
                found[switch] = sorted(lasts)
        return found

    @cached_property
    def held(self) -> dict[int, tuple[int, int]]:
        """Number of phases of a period in which each rigid stop is held, and in which it is not, for each switch.

        A stop that a part touches all the time, at times without a force, is held all the time.
        """
        found: dict[int, tuple[int, int]] = {}
        for switch in {switch for _, switch in self.system.structure.reactions if switch >= 0}:
            own = [event for event in self.events if event.switch == switch]
            lets_go = sum(not event.enters for event in own)
            leaves = any(event.enters for event in own) or not self._rests_on(switch)
            found[switch] = (lets_go, max(1, lets_go)) if leaves else (1, 0)
        return found

    def rests(self, switch: int) -> bool:
        """Return True if the stop of a switch (index into `System.breakpoints`) is rigid, and held all the time."""
        return self.held.get(switch) == (1, 0)

    def _rests_on(self, switch: int) -> bool:
        """Return True if the motion begins at a breakpoint."""
        contact, side, clearance = self.system.breakpoints[switch]
        deflection = side * float(self._deflections[contact])
        size = float(np.abs(self.state[: self.system.size]).max())  # a deflection of 0 is a difference of positions
        return abs(deflection - clearance) <= _AT_STOP * max(size, abs(clearance))

    def closing_changes(self, other: Orbit) -> tuple[int, ...]:
        """Count how much more often each switch closes in another orbit, near this one; negative if less often.

        Infinitely many impacts precede a phase in which a stop is held, so flights between impacts are compared. If the
        stop is held in only one of the two motions, nothing is counted: between them, infinitely many impacts graze.
        """
        changes = [then - now for now, then in zip(self.closings, other.closings, strict=True)]
        for switch, phases in self.held.items():
            if other.held[switch] != phases:
                changes[switch] = 0
            elif changes[switch] and switch in self.chatters:
                ours, theirs = self.chatters[switch], other.chatters[switch]
                split = _more_flights(ours[::-1], theirs[::-1]) if phases[0] == 1 else None
                within = _widest_gap(ours)
                more = sum(angle > within for angle in theirs) - sum(angle > within for angle in ours)
                changes[switch] = more if split is None else split
        return tuple(changes)

    @cached_property
    def pattern(self) -> str:
        """Contact pattern: the numbers of impacts on each side in one full period, such as ``3+/1-``.

        It is ``open`` for a contact that never closes, ``closed+`` or ``closed-`` for one that never opens, ``held+``
        or ``held-`` for a rigid stop on which the motion rests all the time, and ``closed`` for one without a gap. Dry
        friction has the number of times it sticks, as in ``lining 2 sticks``. It is ``none`` without contacts.
        """
        texts, breakpoints = [], self.system.breakpoints
        contacts = [pair for pair in enumerate(self.system.structure.contacts) if pair[1].stages]
        for place, contact in contacts:
            innermost: dict[int, int] = {}  # only the innermost stage of each side counts as an impact
            for switch, (own, side, _) in enumerate(breakpoints):
                if own == place and not self.system.gapless[switch]:
                    innermost.setdefault(side, switch)
            resting = [side for side, switch in innermost.items() if self.rests(switch)]
            if resting:
                text = "/".join(f"held{_SIGNS[side]}" for side in resting)
            elif not innermost:
                text = "closed"
            elif any(self.closings[switch] for switch in innermost.values()):
                text = "/".join(f"{self.closings[switch]}{_SIGNS[side]}" for side, switch in innermost.items())
            else:
                deflection = self._deflections[place]
                held = [side for side, switch in innermost.items() if side * deflection > breakpoints[switch][2]]
                text = f"closed{_SIGNS[held[0]]}" if held else "open"
            texts.append(text if len(contacts) == 1 else f"{contact.name} {text}")
        names = [contact.name for contact in self.system.structure.contacts]
        texts += [f"{names[contact]} {stick_words(phases)}" for contact, phases in self.friction.items()]
        return ", ".join(texts) or "none"

    @property
    def z(self) -> str:
        """Impacts p in n forcing periods, such as ``3/2``, on both sides together; of several contacts, by name."""
        stages = [contact.name for contact in self.system.structure.contacts if contact.stages]
        found = {name: round(self.period * self.measure(f"impacts.{name}")) for name in stages}
        texts = [
            f"{count}/{self.period}" if len(stages) == 1 else f"{n} {count}/{self.period}" for n, count in found.items()
        ]
        return ", ".join(texts)

    @cached_property
    def friction(self) -> dict[int, list[FrictionPhase]]:
        """Phases of slip and stick in one full period of each contact that is dry friction, by its number.

        Slip in one direction only, on a base at rest, is a rounding error, because real slip would not return to where
        it began: such friction sticks, unless its contact opens or closes meanwhile.
        """
        full, found, structure = PERIOD * self.period, {}, self.system.structure
        layout, coefficients = layout_of(structure), coefficients_of(self.system)
        moved = {structure.breakpoints[event.switch].contact for event in self.events}
        for contact in sorted({event.contact for event in self.slips}):
            phases = friction_phases(self.slips, contact, full)
            ways, speed = {phase.mode for phase in phases}, layout.contacts[contact].numbers.get("speed")
            is_kept = structure.host(contact) not in moved and (speed is None or not coefficients[speed])
            reaches = is_kept and 0 in ways and len(ways) == 2
            found[contact] = [FrictionPhase(0, 0.0, full)] if reaches else phases
        return found

    @property
    def _deflections(self) -> NDArray[np.float64]:
        """The first deflection of each contact at theta = 0."""
        layout, state = layout_of(self.system.structure), self.state[: self.system.size]
        return contact_deflections(layout, coefficients_of(self.system), 0.0, state)

    def motion(self, samples: int | None = None) -> Motion:
        """Return one full period, with `samples` even samples per forcing period (by default as many as it needs)."""
        count = (samples or self.samples) * self.period
        angles = PERIOD * self.period * np.arange(count + 1) / count
        return sample(self.system, self.state, angles, self.known_states)

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """Derivatives of the state after the orbit's period by its state at theta = 0, shape (state_size, state_size).

        Its eigenvalues are the multipliers; the jumps at events are included. Residual: `residual`.
        """
        flow, coefficients = flow_of(self.system, transition=True), coefficients_of(self.system)
        found = np.eye(len(self.state))
        starts = [(0.0, self.state), *self.known_states]
        ends = [*(theta for theta, _ in starts[1:]), PERIOD * self.period]
        for (theta, state), end in zip(starts, ends, strict=True):
            arc = flow.integrate(coefficients, state, theta, end)
            assert arc.transition is not None
            found = arc.transition @ found
        return found

    @cached_property
    def eigenvectors(self) -> NDArray[np.complex128]:
        """Eigenvectors of the `jacobian` as columns, of length 1, in the order of `multipliers`."""
        values, vectors = np.linalg.eig(self.jacobian)
        left, order = [*range(len(values))], list[int]()
        for each in self.multipliers.tolist():
            order.append(left.pop(int(np.argmin(np.abs(values[left] - each)))))
        return vectors[:, order].astype(complex)

    @cached_property
    def turned_back(self) -> tuple[str, ...]:
        """The drags whose slip reverses for a while; during that time their computed torques are wrong."""
        return tuple(drags_turned_back(self.motion())) if one_sided_drags(self.system.structure) else ()

    def begun_in(self, state: NDArray[np.float64]) -> Orbit:
        """Return the orbit with another state at theta = 0, such as after a change of phase."""
        return self if np.array_equal(state, self.state) else replace(self, state=state, restarts=_NO_STATES)

    def repeated(self, times: int) -> Orbit:
        """Return the same motion as an orbit of a multiple of its period."""
        restarts = [*self.restarts, *[self.state, *self.restarts] * (times - 1)] if len(self.restarts) else _NO_STATES
        return replace(self, period=times * self.period, restarts=np.array(restarts))

    @property
    def known_states(self) -> Restarts:
        """Angles within the period at which its state is known, with the states; see `restarts`."""
        count = len(self.restarts) + 1
        return [(PERIOD * self.period * j / count, state) for j, state in enumerate(self.restarts, start=1)]

    def strobes(self, count: int, apart: float = PERIOD) -> NDArray[np.float64]:
        """Return the first `count` states at intervals of `apart` radians of theta, shape (count, state_size).

        Their `drift` is subtracted.
        """
        states, flow, coefficients = [self.state], flow_of(self.system), coefficients_of(self.system)
        if len(self.restarts):
            return flow.sample(coefficients, self.state, apart * np.arange(float(count)), self.known_states).states
        for number in range(count - 1):
            start = number * apart % PERIOD
            states.append(flow.integrate(coefficients, states[-1], start, start + apart).state)
        return brought_back(self._drifts, np.array(states))

    @property
    def samples(self) -> int:
        """Samples per forcing period that resolve the motion."""
        needed = max(64, 5 * self.steps // self.period)
        return 1 << (needed - 1).bit_length()

    @cached_property
    def _survey(self) -> Survey:
        return survey(self)

    @cached_property
    def turns(self) -> tuple[Turns, ...]:
        """Angles at which the deflection of each contact turns, and its values there."""
        return self._survey.turns

    @cached_property
    def extremes(self) -> NDArray[np.float64]:
        """Maximum, minimum, mean and root mean square of each coordinate, shape (n, 4); accurate to rounding."""
        visited, (mean, square) = np.array(self._survey.visited), self._survey.means
        return np.column_stack((visited.max(axis=0), visited.min(axis=0), mean, np.sqrt(square)))

    @property
    def margins(self) -> list[Margin]:
        """Distances of friction from changes of its sequence of slip and stick; none if the orbit is not exact."""
        return self._survey.margins

    @cached_property
    def turning_depths(self) -> tuple[Turns, ...]:
        """Angles at which the deflection of each switch turns, and its depths beyond the breakpoint there.

        At an impact on a rigid stop the depth is 0 but for rounding. Instead, the height of a throw at the speed of the
        impact is given: it is positive, and goes to 0 where the motion only grazes.
        """
        depths = []
        for switch, (contact, side, clearance) in enumerate(self.system.breakpoints):
            thetas, values = self.turns[contact]
            own = [side * x - clearance for x in values]
            if own and self.system.structure.contacts[contact].law.rebounds:
                turns, full = Turns(thetas, own), PERIOD * self.period
                for event in self.events:
                    if event.switch == switch and event.enters:
                        place = turns.nearest(event.theta % full, full)
                        if apart(thetas[place], event.theta % full, full) <= _AT_IMPACT:
                            own[place] = 0.5 * (event.velocity / self.system.frequency) ** 2
            depths.append(Turns(thetas, own))
        return tuple(depths)

    def measure(self, name: str) -> float:
        """Return one measure of the motion by its name, such as ``half.q1``, ``max.q1''`` or ``rms.stage2``.

        The first part is ``max``, ``min``, ``half`` (half the peak-to-peak), ``peak_to_peak``, ``mean``, ``rms``; or
        ``h0``, ``h1``, ... or ``order1``, ... (amplitude of a harmonic of W, or of an order per turn of a shaft;
        ``h1/2`` for that of W/2, ``order2+4+6`` for the root of the sum of squares); the second a signal. ``a/b`` is
        the ratio of two measures, or of one of two signals: ``order2.input.speed/flywheel.speed``. With ``db.`` in
        front it is a level in dB: see `gapwalk.model.measures`. ``impacts`` and a contact: its impacts per forcing
        period; ``drift`` and a coordinate: its progress per forcing period.
        """
        return measure(self, name)

    def __repr__(self) -> str:
        state = ", ".join(f"{value:.6g}" for value in self.state[:4])
        kept = "".join(f", {words}" for words in kept_words(self.system.structure, self.stuck))
        kept += "".join(f", {name} turns back, against its torque" for name in self.turned_back)
        return (
            f"Orbit(period {self.period} at {pace_text(self.system)}, {self.instability.words}, "
            f"contacts {self.pattern}{kept}, state ({state}{', ...' if len(self.state) > 4 else ''}))"
        )


def true_period(orbit: Orbit) -> int:
    """Return the smallest number of forcing periods after which an orbit repeats; it divides `orbit.period`."""
    states = stroboscopic(orbit)
    near = _distances(states, orbit) <= SAME
    return next((k for k in range(1, orbit.period) if orbit.period % k == 0 and near[k]), orbit.period)


def stroboscopic(orbit: Orbit) -> NDArray[np.float64]:
    """Return the states of an orbit at the start of each of its m forcing periods, shape (m, state_size)."""
    return orbit.strobes(orbit.period)


def returns(orbit: Orbit, count: int) -> NDArray[np.float64]:
    """Return the first `count` states at the start of a forcing period, at most all; shape (count, state_size)."""
    # Where the survey of the motion has them, which a walk needs of each point, nothing more is integrated.
    known = orbit._survey.returns if orbit.is_exact else None
    return orbit.strobes(count) if known is None else brought_back(drifts_of(orbit.system), known[:count])


def _distances(states: NDArray[np.float64], orbit: Orbit) -> NDArray[np.float64]:
    return np.abs(states - orbit.state).max(axis=1) / magnitude(orbit.state, orbit.system)


def is_same(a: Orbit, b: Orbit, tolerance: float = SAME) -> bool:
    """Return True if two orbits of a system are the same motion, possibly with another phase; see `phases`."""
    if a.period != b.period:
        return False
    return bool(np.any(_distances(phases(a), b) <= tolerance))


def phases(orbit: Orbit) -> NDArray[np.float64]:
    """Return the states at theta = 0 of all orbits that are this motion with another phase, m * `repeats` of them."""
    # If the excitation repeats three times in a forcing period, shifting a motion by a third of it gives another orbit
    # that is the same motion.
    count = repeats(orbit.system)
    return orbit.strobes(orbit.period * count, PERIOD / count)


def repeats(system: System) -> int:
    """Return how often the excitation repeats within a forcing period: three times for the orders 3 and 6."""
    return math.gcd(*(order for load in system.structure.harmonics for order in load.multiples)) or 1


def _more_flights(ours: list[float], theirs: list[float]) -> int | None:
    """Return in how many more flights a second chatter is divided, by its falling angles to its end; None if unclear.

    The first flight begins where the stop lets go. Two flights that correspond are nearly as long as each other; their
    place near the end may differ by far more.
    """
    mine, more, low = 0, 0, _SETTLES[0]
    while True:
        own, other = ours[mine : mine + 3], theirs[mine + more : mine + more + 3]
        if len(own) < 3 or len(other) < 3 or own[2] < low or other[2] < low:
            return more
        (a, both_a), (b, both_b) = ((each[0] - each[1], each[0] - each[2]) for each in (own, other))
        if not _alike(a, b):
            if _alike(a, both_b):
                more += 1
            elif _alike(both_a, b):
                more, mine = more - 1, mine + 1
            else:
                return None
        mine += 1


def _alike(a: float, b: float) -> bool:
    """Return True if two flights are about as long as each other."""
    return _ALIKE * a < b < a / _ALIKE


def _widest_gap(angles: list[float]) -> float:
    """Return the middle of the widest gap between some angles, by their ratio, near the end of a chatter."""
    low, high = _SETTLES
    edges = [low, *(angle for angle in angles if low < angle < high), high]
    ratio, at = max((b / a, a) for a, b in pairwise(edges))
    return at * math.sqrt(ratio)


# Sensitivity of an orbit to parameters: exact derivatives of its state, and of its motion over the period.
#
# The implicit function theorem on the shooting equation ``Phi(x; p) - x = 0`` gives ``(Phi_x - I) dx/dp = -Phi_p``. A
# later state of the orbit changes by ``Phi_x(theta) dx/dp + Phi_p(theta)``.

_SINGULAR = 1e-11  # smallest relative singular value of ``Phi_x - I`` of an orbit that has derivatives
_AT_ONE = 1e-6  # distance of a multiplier from 1 from which on smaller ones do too


class SignalSlopes(NamedTuple):
    """Signal at some angles of an orbit, and its derivatives."""

    values: NDArray[np.float64]  #: shape (samples,): The signal.
    #: shape (samples, k): Its derivatives with respect to the parameters, at the same angles.
    by_parameters: NDArray[np.float64]
    by_angle: NDArray[np.float64]  #: shape (samples,): Its derivative with respect to the angle.
    #: shape (k,): Rms of the two parts of each derivative before they are added: the contribution of the state and that
    #: of the parameter itself. If they cancel, the remainder is rounding.
    sizes: NDArray[np.float64]


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of one orbit with respect to some named parameters."""

    #: orbit, names: The orbit and the parameters.
    orbit: Orbit
    names: tuple[str, ...]

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """Derivative of the orbit's state at theta = 0, shape (state_size, k)."""
        length = PERIOD * self.orbit.period
        arc = self._flow.integrate(self._coefficients, self.orbit.state, 0.0, length, self.slopes)
        size = len(self.orbit.state)
        (arc,) = released(layout_of(self.orbit.system.structure), self._coefficients, [arc], self.orbit.state)
        matrix = transition_of(arc) - np.eye(size)
        singular = np.linalg.svd(matrix, compute_uv=False)
        # a train with parts of very different size has small singular values, but no multiplier of 1
        if singular[-1] <= _SINGULAR * singular[0] and np.abs(np.linalg.eigvals(matrix)).min() <= _AT_ONE:
            raise NumericalError("the orbit lies on a fold or a branch point, where it has no derivative by parameters")
        by_parameters = np.zeros((size, 0)) if arc.sensitivity is None else arc.sensitivity.reshape(size, -1)
        return np.linalg.solve(matrix, -by_parameters).astype(float, copy=False)

    @cached_property
    def slopes(self) -> NDArray[np.float64]:
        """Derivative of the flow's coefficients, shape (k, coefficients)."""
        system = self.orbit.system
        lines = [ParameterLine(system, name).coefficients(system[name])[1] for name in self.names]
        return np.array(lines).reshape(len(self.names), len(self._coefficients))

    def signal(self, signal: Signal, theta: NDArray[np.float64]) -> SignalSlopes:
        """Return a signal at any angles, with its derivatives by the parameters and by the angle."""
        grid, back = _grid(self.orbit, theta)
        system = self.orbit.system
        found = self._flow.vary(self._coefficients, self.orbit.state, grid, self.slopes)
        motion = Motion.of(system, grid, found.states, *found.logs)
        states = found.transitions @ self.state + found.sensitivities
        by_parameters, sizes = np.zeros((len(grid), len(self.names))), np.zeros(len(self.names))
        for k, direction in enumerate(self.slopes):
            through_state = signal.slope(motion, states[:, :, k])
            by_parameters[:, k] = signal.slope(motion, states[:, :, k], direction)
            sizes[k] = np.sqrt(np.mean(through_state**2) + np.mean((by_parameters[:, k] - through_state) ** 2))
        by_angle = signal.slope(motion, motion.rates / system.frequency, theta=1.0)
        return SignalSlopes(signal.of(motion)[back], by_parameters[back], by_angle[back], sizes)

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return coefficients_of(self.orbit.system)

    @cached_property
    def _flow(self) -> Flow:
        return flow_of(self.orbit.system, *self.names, transition=True)


def sensitivity(orbit: Orbit, names: Sequence[str]) -> Sensitivity:
    """Return the sensitivity of an orbit to named parameters; raise a ModelError for an unknown name."""
    for name in names:
        orbit.system.structure.place(name)
    if orbit.own_method is not None:
        raise ModelError("this motion has no excitation, and its frequency is an unknown: it has no gradients here")
    if len(orbit.restarts):
        raise NumericalError(
            f"small changes of this motion grow by {abs(complex(orbit.multipliers[0])):.3g} in a period, too much for "
            "its gradients: take them of a motion that is less unstable"
        )
    return Sensitivity(orbit, tuple(names))


def signal_along(orbit: Orbit, signal: Signal, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of a signal of an orbit at any angles, exact at each; shape (samples,)."""
    grid, back = _grid(orbit, theta)
    return signal.of(sample(orbit.system, orbit.state, grid, orbit.known_states))[back]


def _grid(orbit: Orbit, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return increasing angles from 0 within one period that include the given ones, and the indices of these."""
    grid, back = np.unique(np.concatenate(([0.0], theta % (PERIOD * orbit.period))), return_inverse=True)
    return grid, back[1:]


def describe_switch(orbit: Orbit, switch: int) -> str:
    """Return contact, stage and side of a switch, such as ``stage2 -``."""
    contact, stage, side = switch_names(orbit.system)[switch]
    return f"{contact}{'.' + stage if stage else ''} {'+' if side > 0 else '-'}"


def switch_named(orbit: Orbit, name: str) -> int | None:
    """Return the switch with a name of `describe_switch`; None for that of a formula, which has no switch."""
    return next((each for each in range(len(orbit.closings)) if describe_switch(orbit, each) == name), None)
