"""How far friction is, all over an orbit, from a change of its sequence of slip and stick.

Two changes that cancel each other within one step of a walk are not visible in the sequences at its ends. The margins
at its ends, and those of the point before it, show where there may be some.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.flow.dry_motion import DryModes
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.friction_gauge import FrictionGauge
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.friction_phases import FrictionPhase
from gapwalk.orbit.measures import apart
from gapwalk.orbit.orbit import Orbit, survey_of

_SAME = 0.5  # radians by which a margin may move between two points
_DOUBT = 0.5  # share of its bend by which a margin may have moved between two points; 1/8 for a parabola
_NEAR = 0.05  # share of its range within which a least value that appears counts as near zero
_FAR, _LONG = 0.6, 4e-3  # the same in steps of more than this arclength
_BIRTH = 2e-4  # arclength to which the appearance of such a value is narrowed down

Array = NDArray[np.float64]


class Margin(NamedTuple):
    """Distance of friction from a change at one instant.

    Attributes
    ----------
    contact
        Number of the contact.
    what
        What vanishes at the change: ``rate`` within slip, ``reserve`` within stick, ``stop`` where slip ends.
    side
        The direction of slip concerned.
    theta, value
        The angle, and the distance: for ``rate`` and ``reserve`` the least value nearby.
    range
        Largest value of the same quantity.
    """

    contact: int
    what: str
    side: int
    theta: float
    value: float
    range: float


def margins_of(point: BranchPoint) -> list[Margin]:
    """Return all margins of the orbit of a point; they are computed once."""
    found = point.memo.get("friction margins")
    if found is None:
        found = point.memo["friction margins"] = margins_of_orbit(point.orbit)
    return found


def margins_of_orbit(orbit: Orbit) -> list[Margin]:
    """Return all margins of an orbit, from the samples of its survey."""
    return [each for contact in orbit.friction for each in _Margins(orbit, contact).all()]


class _Margins:
    """Margins of one contact that is friction, from the samples of an orbit's survey."""

    def __init__(self, orbit: Orbit, contact: int) -> None:
        self._contact, self._phases, self._full = contact, orbit.friction[contact], PERIOD * orbit.period
        self._survey, self._coefficients = survey_of(orbit), coefficients_of(orbit.system)
        self._gauge = FrictionGauge(layout_of(orbit.system.structure), contact)

    def all(self) -> list[Margin]:
        """Return all margins."""
        thetas, found = self._survey.thetas, []
        rates = self._gauge.rate(self._coefficients, thetas, self._survey.states, None, 1)
        inside = [self._inside(phase) for phase in self._phases]
        sticks = [place for place, own in enumerate(inside) if not self._phases[place].mode and len(own) > 2]
        past = [phase.mode for phase in (self._phases[-1], *self._phases[:-1])]
        ends = [place for place, phase in enumerate(self._phases) if past[place] not in (0, phase.mode)]
        starts = [int(np.searchsorted(thetas, self._phases[place].start % self._full)) for place in ends]
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

    def _inside(self, phase: FrictionPhase) -> NDArray[np.intp]:
        """Return the samples within a phase, in the order of time."""
        after = (self._survey.thetas[:-1] - phase.start) % self._full
        inside = np.flatnonzero(after <= phase.length)
        return inside[np.argsort(after[inside], kind="stable")]

    def _bounds(self, asked: list[tuple[NDArray[np.intp], int]]) -> list[tuple[Array, Array]]:
        """Return the force at which slip begins, and that in stick, at sets of samples with the modes at one each."""
        groups: dict[bytes, tuple[DryModes, list[int]]] = {}
        for number, (_, at) in enumerate(asked):
            modes = self._gauge.sticking(self._survey.modes.at(at))
            groups.setdefault(modes.slips.tobytes() + modes.held.tobytes(), (modes, []))[1].append(number)
        found: dict[int, tuple[Array, Array]] = {}
        for modes, numbers in groups.values():
            samples = np.concatenate([asked[number][0] for number in numbers])
            states, thetas = self._survey.states[samples], self._survey.thetas[samples]
            bound, force = self._gauge.bound_and_force(self._coefficients, thetas, states, modes)
            cuts = np.cumsum([len(asked[number][0]) for number in numbers])[:-1]
            parts = zip(np.split(np.broadcast_to(bound, force.shape), cuts), np.split(force, cuts), strict=True)
            found |= dict(zip(numbers, parts, strict=True))
        return [found[number] for number in range(len(asked))]

    def _least(self, phase: FrictionPhase, side: int, samples: NDArray[np.intp], values: Array) -> list[Margin]:
        """Return the least values of a quantity within a phase, by parabolas."""
        thetas = self._survey.thetas[samples]
        if phase.length >= self._full:
            thetas, values = np.append(thetas, thetas[:2] + PERIOD), np.append(values, values[:2])
        lowest = (values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])
        found, what, largest = [], "rate" if phase.mode else "reserve", float(values.max())
        for place in np.flatnonzero(lowest).tolist():
            before, here, after = values[place : place + 3].tolist()
            slope, bend = 0.5 * (after - before), before - 2.0 * here + after
            value = here - (0.5 * slope**2 / bend if bend > 0.0 else 0.0)
            # the samples are even but for those at events
            at, width = float(thetas[place + 1]), float(thetas[place + 1] - thetas[place]) % PERIOD
            shift = -width * slope / bend if bend > 0.0 else 0.0
            found.append(Margin(self._contact, what, side, at + shift, value, largest))
        return found


def may_change(before: BranchPoint | None, first: BranchPoint, last: BranchPoint) -> bool:
    """Return True if changes that cancel each other may hide between two points of a walk with the same sequence."""
    if not any(any(phase.mode for phase in phases) for phases in first.orbit.friction.values()):
        return False
    full, length = PERIOD * first.orbit.period, last.arclength - first.arclength
    now, then = margins_of(first), margins_of(last)
    past = None if before is None or first.arclength <= before.arclength else margins_of(before)
    ratio = math.nan if past is None or before is None else length / (first.arclength - before.arclength)
    for own in now:
        following = _same(own, then, full)
        if following is None:
            continue
        preceding = None if past is None else _same(own, past, full)
        if preceding is not None:
            bend = abs((following.value - own.value) - ratio * (own.value - preceding.value))
            if min(abs(own.value), abs(following.value)) < _DOUBT * bend:
                return True
    if length <= _BIRTH:
        return False
    lonely = [each for each in now if _same(each, then, full) is None]
    lonely += [each for each in then if _same(each, now, full) is None]
    near = _NEAR if length <= _LONG else _FAR
    return any(each.what != "stop" and 0.0 <= each.value < near * each.range for each in lonely)


def _same(own: Margin, others: Sequence[Margin], full: float) -> Margin | None:
    """Return the margin among others that one has become."""
    alike = [
        each
        for each in others
        if (each.contact, each.what, each.side) == (own.contact, own.what, own.side)
        and apart(each.theta, own.theta, full) < _SAME
    ]
    return min(alike, key=lambda each: apart(each.theta, own.theta, full), default=None)
