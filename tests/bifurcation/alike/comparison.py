"""One machine walked in several ways: with other steps, mirrored, in other units, from other angles of its loads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import gapwalk as gw
from gapwalk import Branch, Orbit, SpecialPoint, WalkOptions
from gapwalk.bifurcation.detector import unexplained_of
from gapwalk.continuation.walk import EndReason
from tests.bifurcation.alike.machine import Machine
from tests.bifurcation.ranges.comparison import Comparison

FINE = WalkOptions(initial_step=2e-4, largest_step=2e-3, max_points=40_000)
ANGLES = (1.0, 2.5, 4.0)
UNITS = (1e-6, 1e-3, 1e3)
"""Units of length, time and force that are smaller by these factors."""
_SIDES = str.maketrans("+-", "-+")
_EXACT = 1e-12  # relative rounding of a value that a change of units leaves
_UNKNOWN = 1e-6  # relative error of a value whose error is unknown


class Way(NamedTuple):
    """A way in which a machine is walked: the machine, its walk, the start, and how its results are read."""

    name: str
    machine: Machine
    start: np.ndarray
    walk: WalkOptions | None = None
    time: float = 1.0
    swaps: bool = False

    def walked(self) -> Branch:
        """Walk the machine over its range."""
        return gw.follow(
            gw.find_orbit(self.machine.system, start=self.start), "frequency", self.machine.to, walk=self.walk
        )

    def contact(self, special: SpecialPoint) -> str:
        """Return the contact of a special point in the words of the machine itself."""
        return special.contact[:-1] + special.contact[-1:].translate(_SIDES) if self.swaps else special.contact


def compare_ways(name: str, machine: Machine, verified: bool = True, fine: WalkOptions = FINE) -> Comparison:
    """Walk a machine in all ways, from one orbit, and compare all special points with those of the default walk."""
    orbit = gw.find_orbit(machine.system)
    plain, *others = ways(machine, orbit, fine)
    branch = plain.walked()
    faults = [f"{plain.name}: verification: {breach}" for breach in gw.verify(branch).breaches[:3]] if verified else []
    ends = [branch.ends[-1]]
    faults += [f"{plain.name}: {each}" for each in unexplained_of(branch)]
    for way in others:
        other = way.walked()
        ends.append(other.ends[-1])
        faults += [f"{way.name}: {each}" for each in (*unexplained_of(other), *differences(plain, branch, way, other))]
    stuck = sum(end.reason is EndReason.STEP for end in ends)
    faults += [str(end) for end in ends[:1] if end.reason.is_failure]
    return Comparison(name, faults, len(branch.special_points), len(ends), stuck)


def ways(machine: Machine, orbit: Orbit, fine: WalkOptions = FINE) -> Iterator[Way]:
    """Yield all ways in which a machine is walked from an orbit, the default one first."""
    yield Way("default steps", machine, orbit.state)
    yield Way("small steps", machine, orbit.state, fine)
    yield Way("mirrored", machine.mirrored(), -orbit.state, swaps=True)
    length, time, force = UNITS
    n = machine.system.size
    scaled = orbit.state * length
    scaled[n : 2 * n] /= time
    yield Way("other units", machine.in_units(length, time, force), scaled, time=time)
    for angle in ANGLES:
        yield Way(f"begun at {angle:g}", machine.begun_at(angle), orbit.strobes(2, angle)[1])


def differences(plain: Way, branch: Branch, way: Way, other: Branch) -> list[str]:
    """Return what two walks do not have in common, up to where the first of them ends before its range does."""
    ours, theirs = branch.special_points, other.special_points
    for number, (a, b) in enumerate(zip(ours, theirs, strict=False)):
        if not _is_same(plain, a, way, b) and not _is_swapped(plain, ours, way, theirs, number):
            return [f"{b!r} in place of {a!r}, {b.value * way.time - a.value:.1e} apart"]
    reasons = {each.ends[-1].reason for each in (branch, other)}
    if len(reasons) > 1:
        return [f"it ends otherwise: {other.ends[-1]}, in place of {branch.ends[-1]}"]
    more = max(ours[len(theirs) :], theirs[len(ours) :], key=len)
    return [f"{each!r} is {'missing' if len(ours) > len(theirs) else 'invented'}" for each in more]


def _is_same(plain: Way, a: SpecialPoint, way: Way, b: SpecialPoint) -> bool:
    if (a.kind, plain.contact(a), a.before, a.after) != (b.kind, way.contact(b), b.before, b.after):
        return False
    errors = [each if np.isfinite(each) else _UNKNOWN * a.value for each in (a.uncertainty, b.uncertainty * way.time)]
    return abs(a.value - b.value * way.time) <= sum(errors) + _EXACT * a.value


def _is_swapped(
    plain: Way, ours: tuple[SpecialPoint, ...], way: Way, theirs: tuple[SpecialPoint, ...], number: int
) -> bool:
    """Return True if points at one place, as both sides of a gap that graze at once, are only in another order."""
    value = ours[number].value
    here = [
        sorted((each.kind, own.contact(each)) for each in points if abs(each.value * own.time - value) <= 1e-9 * value)
        for own, points in ((plain, ours), (way, theirs))
    ]
    return here[0] == here[1]
