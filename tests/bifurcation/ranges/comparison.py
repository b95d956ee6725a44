"""One system walked over several ranges, and with small steps: which special points only one of the walks has."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gapwalk import Branch, SpecialPoint, System, WalkOptions, find_orbit, follow, verify
from gapwalk.bifurcation.detector import unexplained_of
from gapwalk.continuation.walk import EndReason
from gapwalk.model import Contact, Harmonic, Side, Stage

FROM, NARROW, WIDE = 0.3, 4.0, (30.0, 300.0, 1000.0)
FINE = WalkOptions(initial_step=2e-4, largest_step=2e-3, max_points=40_000)
SAME = 1e-7  # relative difference within which two values are the same
_SHARED = 10  # neighbouring seeds with one structure, so that it is compiled once
_LAWS = ("elastic", "hunt-crossley", "hunt-crossley", "viscous")


def random_system(seed: int) -> System:
    """A system of one or two degrees of freedom at the frequency 0.3; those of odd decades of seeds are symmetric."""
    shape, numbers = np.random.default_rng([seed // _SHARED, 15]), np.random.default_rng([seed, 150])
    n, symmetric = int(shape.choice([1, 2])), (seed // _SHARED) % 2 == 1
    names = [f"q{i + 1}" for i in range(n)]
    springs = numbers.uniform(0.0 if n == 1 else 0.3, 1.5, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    law = _LAWS[int(shape.integers(len(_LAWS)))]
    side = Side.BOTH if symmetric else Side(str(shape.choice([Side.BOTH, Side.POSITIVE, Side.NEGATIVE])))
    contact = Contact(
        "gap",
        {names[-1]: 1.0},
        (Stage(numbers.uniform(0.3, 1.2), 10.0 ** numbers.uniform(0.0, 1.7), side=side),),
        None,
        law,
        {
            "impact_damping": numbers.uniform(0.01, 0.2) if law == "hunt-crossley" else 0.0,
            "viscous_damping": numbers.uniform(0.01, 0.2) if law == "viscous" else 0.0,
        },
    )
    return System(
        names,
        stiffness,
        np.diag(numbers.uniform(0.03, 0.15, n)),
        np.diag(numbers.uniform(0.6, 1.5, n)),
        [contact],
        {} if symmetric else {names[0]: 0.4 * numbers.normal()},
        [Harmonic(numbers.uniform(0.3, 1.0), {names[0]: 1.0})],
        frequency=FROM,
    )


@dataclass(frozen=True)
class Comparison:
    """The faults found by walking one system in several ways."""

    name: str  #: Which system.
    faults: list[str] = field(default_factory=list)  #: What differs, is not explained, or was found by verification.
    shared: int = 0  #: Special points that all walks have.
    walks: int = 0  #: How many walks were compared.
    stuck: int = 0  #: How many of them ended with too small a step, if that is counted.
    note: str = ""  #: Why there is nothing to compare, if there is not.

    @property
    def agrees(self) -> bool:
        """Whether there is no fault."""
        return not self.faults

    def __str__(self) -> str:
        if self.note:
            return self.note
        faults = "".join(f"\n    {each}" for each in self.faults)
        stuck = f", {self.stuck} of them stuck" if self.stuck else ""
        return f"{self.shared} special points in {self.walks} walks{stuck}{faults}"


def compare_ranges(name: str, system: System, verified: bool = True) -> Comparison:
    """Walk a system over all ranges, and over the narrow one with small steps too."""
    start = find_orbit(system)
    fine = follow(start, "frequency", NARROW, walk=FINE)
    faults: list[str] = []
    for to in (NARROW, *WIDE):
        branch = follow(start, "frequency", to)
        where = f"to {to:g}"
        if branch.ends[-1].reason not in (EndReason.RANGE, fine.ends[-1].reason) or branch.ends[-1].reason.is_failure:
            faults.append(f"{where}: {branch.ends[-1]}")
        faults += [f"{where}: {each}" for each in unexplained_of(branch)]
        faults += [f"{where}: {text}" for text in differences(fine, branch)]
        if verified:
            faults += [f"{where}: verification: {breach}" for breach in verify(branch).breaches[:3]]
    return Comparison(name, faults, len(fine.special_points), 1 + len(WIDE) + 1)


def differences(fine: Branch, branch: Branch) -> list[str]:
    """Special points that only one of two walks has, up to where the first of them ends."""
    ours, theirs = list(branch.special_points), list(fine.special_points)
    shared = min(len(ours), len(theirs))
    if branch.points[-1].value > fine.points[-1].value:
        ours = ours[: len(theirs)] if len(ours) >= len(theirs) else ours
    for number in range(shared):
        a, b = ours[number], theirs[number]
        if (a.kind, a.contact) != (b.kind, b.contact) or abs(a.value - b.value) > SAME * abs(b.value):
            if _swapped(ours, theirs, number):
                continue
            return [f"{a!r} in place of {b!r}"]
    return [f"{each!r} is missing" for each in theirs[shared:]] + [f"{each!r} is invented" for each in ours[shared:]]


def _swapped(ours: list[SpecialPoint], theirs: list[SpecialPoint], number: int) -> bool:
    """Whether points at one place, as both sides of a gap that graze at once, are only in another order."""
    value = theirs[number].value
    here = [
        sorted((each.kind, each.contact) for each in points if abs(each.value - value) <= SAME * abs(value))
        for points in (ours, theirs)
    ]
    return here[0] == here[1] and abs(ours[number].value - value) <= SAME * abs(value)
