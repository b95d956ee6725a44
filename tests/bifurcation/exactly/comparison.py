"""The ratio of each special point's deviation to its stated error, over random machines that are walked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import gapwalk as gw
from tests.bifurcation.exactly.flights import LONG
from tests.bifurcation.exactly.machines import Rubbing, Slipping, Stopped

MACHINES = {"stops": (Stopped, 2.4), "friction": (Rubbing, 0.2), "spring": (Slipping, 2.0)}
"""The kinds of machines, each with the end of its walks."""
_MOST = 3.0  # largest ratio of a deviation to its stated error
_POINTS = 150


@dataclass(frozen=True)
class Recomputed:
    """Special points of one machine: kind, deviation and stated error of each that was computed again."""

    name: str
    kinds: list[str] = field(default_factory=list)
    deviations: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    missing: int = 0
    note: str = ""

    @property
    def ratios(self) -> list[float]:
        """Deviations as shares of the stated errors."""
        return [off / error for off, error in zip(self.deviations, self.errors, strict=True)]

    @property
    def agrees(self) -> bool:
        """True if no point is outside of its stated error by more than the allowed factor."""
        return all(ratio <= _MOST for ratio in self.ratios)


def compare(name: str) -> Recomputed:
    """Walk the random machine of a name such as ``stops 3`` and compute its special points again."""
    word, seed = name.split()
    kind, to = MACHINES[word]
    machine, found, missing = kind.random(int(seed)), list[tuple[str, float, float]](), 0
    orbit = gw.find_orbit(machine.system, start="settle")
    for special in gw.follow(orbit, "frequency", to, walk=gw.WalkOptions(max_points=_POINTS)).special_points:
        value = machine.value(special)
        if np.isfinite(value) and np.isfinite(special.uncertainty):
            deviation = abs(float(LONG(special.value) - value))
            found.append(
                (f"{special.kind} {special.value:.9g} {special.contact}".strip(), deviation, special.uncertainty)
            )
        else:
            missing += 1
    kinds, deviations, errors = ([*column] for column in zip(*found, strict=True)) if found else ([], [], [])
    return Recomputed(name, kinds, deviations, errors, missing)
