"""The phases of dry friction over one period of an orbit, and how far they are from a change of their sequence.

A phase is slip in one direction, slip in the other, or stick. Two changes of the sequence that cancel each other within
one step of a walk are not visible at its ends; the margins there show where there may be some.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.compiled_readings import CompiledReadings
from gapwalk.flow.dry_motion import DryModes, modes_along
from gapwalk.flow.dry_state import SlipEvent
from gapwalk.flow.flow import PERIOD, Variations
from gapwalk.flow.friction_gauge import FrictionGauge
from gapwalk.model.coefficients import coefficients_of, layout_of

if TYPE_CHECKING:
    from gapwalk.orbit.orbit import Orbit

Array = NDArray[np.float64]
_SIGNS = {1: "+", -1: "-", 0: "0"}


class FrictionPhase(NamedTuple):
    """A phase of friction: its mode, 1 or -1 in slip and 0 in stick, and the angles at which it begins and ends.

    The end of the last phase lies in the next period if it passes the end of its own.

    Examples
    --------
    >>> gw.records.FrictionPhase(0, 0.5, 0.75).length
    0.25
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
        """Return True if an angle lies within it, on a circle of circumference `full`.

        Parameters
        ----------
        theta
            The angle, in radians.
        full
            The circumference, in radians.
        margin
            Distance from the ends that the angle must keep, in radians.
        """
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
    """Distance of friction from a change at one instant.

    Examples
    --------
    >>> margin = slipping.margins[0]
    >>> margin.what, round(margin.value, 6)
    ('stop', 0.093398)
    """

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
    layout = layout_of(orbit.system.structure)
    return [
        each
        for contact, phases in orbit.friction.items()
        for each in _Margins(orbit, thetas, found, FrictionGauge(layout, contact, readings), phases).all()
    ]


class _Margins:
    """Margins of one contact that is friction."""

    def __init__(
        self, orbit: Orbit, thetas: Array, found: Variations, gauge: FrictionGauge, phases: list[FrictionPhase]
    ) -> None:
        self._gauge, self._phases, self._contact = gauge, phases, gauge.contact
        self._thetas, self._states, self._full = thetas, found.states, float(thetas[-1])
        self._coefficients, self._logs = coefficients_of(orbit.system), (found.slips, found.holds)
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
            bound, force = self._gauge.bound_and_force(self._coefficients, thetas, states, modes)
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
        modes = modes_along(structure, self._thetas[samples], *self._logs, before=True)
        return [self._gauge.sticking(modes.at(number)) for number in range(len(samples))]

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
