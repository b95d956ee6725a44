"""The pieces of a map in the order in which they begin: its sections, then its loci, hardly any of which is done twice.

Method: docs/numerics/loci.md
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.system import System
from gapwalk.orbit.orbit import phases
from gapwalk.parallel.groups import Outcome

_BESIDE = 4e-3  # distance from a locus, in widths of the ranges, within which a special point may lie on it
_ALIKE = 0.1  # relative distance of two orbits' states within which they may belong to the same locus

Family = tuple[Kind, int, str]
"""Kind, period and contact: special points that differ in one of them never lie on the same locus."""


@dataclass(frozen=True)
class _Start:
    """A special point at which a locus may begin: the number of its section, the value there, and the point."""

    section: int
    value: float
    special: SpecialPoint

    @property
    def family(self) -> Family:
        return self.special.kind, self.special.orbit.period, self.special.contact


class MapQueue(Sequence[tuple[bool, Any]]):
    """Pieces of a map: True and the system of a section, or False and a special point whose locus is to be followed.

    A special point that lies on the locus of an earlier one begins none. So a locus is begun only when all earlier
    points of its family are decided; while they are not, whoever is free follows loci of other families. Points that
    may prove superfluous are followed only while a single family is left, on the section of its first point: a locus
    seldom crosses a section twice, except that it often connects two points. What is found is the same, in the same
    order, however many pieces are in progress.
    """

    def __init__(self, systems: Sequence[System], width: float, loci: Iterable[Locus] = (), tried: int = 0) -> None:
        self._systems, self._width, self._loci, self._tried = systems, width, list(loci), tried
        self._begun: list[tuple[bool, int]] = []
        self._walks = self._walked = 0  # sections that were begun, and those that were handed on
        self._walked_early: dict[int, Any] = {}
        self._starts: list[_Start] = []
        self._undecided: dict[Family, list[int]] = {}
        self._in_work: set[int] = set()
        self._followed: dict[int, Outcome] = {}  # before their turn in the family
        self._decided: dict[int, Locus | str | None] = {}  # before their turn among all; None for superfluous points

    def __len__(self) -> int:
        """Number of the pieces that were begun, and of those that can begin now."""
        return len(self._begun) + len(self._systems) - self._walks + len(self._ready())

    def __getitem__(self, number: Any) -> Any:
        if number == len(self._begun):
            self._begin()
        is_section, place = self._begun[number]
        return is_section, self._systems[place] if is_section else self._starts[place].special

    def take(self, number: int, outcome: Outcome) -> None:
        """Take the outcome of a piece: what was found on a section, or a locus, or why it cannot be followed.

        It raises the error of a piece that is needed.
        """
        is_section, place = self._begun[number]
        if is_section:
            self._walked_early[place] = outcome.value()
            return
        self._followed[place] = outcome
        family = self._starts[place].family
        while (undecided := self._undecided[family]) and undecided[0] in self._followed:
            first = undecided.pop(0)
            self._decided[first] = found = self._followed.pop(first).value()
            if not isinstance(found, str):
                self._loci.append(found)
                self._leave_out(family, found)

    def sections(self) -> Iterator[Any]:
        """Yield what was found on the next sections."""
        while self._walked in self._walked_early:
            self._walked += 1
            yield self._walked_early.pop(self._walked - 1)

    def add(self, section: int, value: float, specials: Iterable[SpecialPoint]) -> None:
        """Add the special points of the next section from which loci may be followed."""
        for special in specials:
            start, number = _Start(section, value, special), len(self._starts)
            self._starts.append(start)
            if number < self._tried:
                continue
            if any(lies_on_locus(locus, special, value, self._width) for locus in self._loci):
                self._decided[number] = None
            else:
                self._undecided.setdefault(start.family, []).append(number)

    def loci(self) -> Iterator[tuple[int, Locus | str]]:
        """Yield the next loci, or why one cannot be followed, each with the number of special points up to it."""
        while self._tried in self._decided:
            found = self._decided.pop(self._tried)
            self._tried += 1
            if found is not None:
                yield self._tried, found

    def _begin(self) -> None:
        """Begin the next section, or else a locus."""
        if self._walks < len(self._systems):
            self._begun.append((True, self._walks))
            self._walks += 1
        else:
            self._begun.append((False, self._ready()[0]))
            self._in_work.add(self._begun[-1][1])

    def _ready(self) -> list[int]:
        """Return the special points whose loci can be followed now: first those that are certain to begin one."""
        # in their order: with the largest families first, maps are done up to 9 % sooner, but up to two thirds of the
        # loci wait for earlier ones before they are stored
        families = [family for family in self._undecided.values() if family]
        ready = sorted(family[0] for family in families)
        if len(families) == 1:  # they would otherwise be followed one after the other
            first, *others = families[0]
            beside = [number for number in others if self._starts[number].section == self._starts[first].section]
            ready += beside if len(beside) > 1 else []
        return [number for number in ready if number not in self._in_work]

    def _leave_out(self, family: Family, locus: Locus) -> None:
        """Decide that points of a family that lie on a locus begin none, even if they have been followed."""
        left = []
        for number in self._undecided[family]:
            start = self._starts[number]
            if lies_on_locus(locus, start.special, start.value, self._width):
                self._decided[number] = None
                self._followed.pop(number, None)
            else:
                left.append(number)
        self._undecided[family] = left


def lies_on_locus(locus: Locus, special: SpecialPoint, value: float, width: float) -> bool:
    """Return True if a special point is on a locus: between two of its points, with an orbit like theirs."""
    if locus.kind is not special.kind or locus.period != special.orbit.period or locus.contact != special.contact:
        return False
    places = locus.values
    a, b = places[:-1], places[1:]
    crosses = np.flatnonzero((a[:, 1] - value) * (b[:, 1] - value) <= 0.0)
    for k in crosses:
        rise = b[k, 1] - a[k, 1]
        share = 0.5 if rise == 0.0 else (value - a[k, 1]) / rise
        if abs(a[k, 0] + share * (b[k, 0] - a[k, 0]) - special.value) <= _BESIDE * width:
            # two orbits of neighbouring systems may be the same motion, one begun later
            nearest, orbit = locus.points[k if share < 0.5 else k + 1].orbit, special.orbit
            distance = float(np.abs(phases(nearest) - orbit.state).max(axis=1).min())
            if distance <= _ALIKE * magnitude(orbit.state, orbit.system):
                return True
    return False
