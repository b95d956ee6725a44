"""Record of all tori over a range: the branches of periodic motions, and the families that begin on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, remarks, row_of, rows_of, summarizes
from gapwalk.tori.locked_window import LockedWindow
from gapwalk.tori.tongue import Tongue
from gapwalk.tori.torus_family import TorusEndReason, TorusFamily

_SAME = 1e-6  # distance of two Neimark-Sacker points, relative to the parameter, within which they are one


@dataclass(frozen=True, eq=False)
class TorusDiagram(Shown):
    """Families of tori over a range of one parameter, with the branches at whose Neimark-Sacker points they begin.

    Examples
    --------
    >>> found = gw.tori.TorusDiagram(diagram)
    >>> len(found.families), found.starts
    (0, ())
    """

    diagram: Diagram  #: The branches of periodic motions.
    families: tuple[TorusFamily, ...] = ()  #: The families of tori.
    #: Neimark-Sacker points from which no family could be followed, with the reasons, in sentences.
    failures: tuple[str, ...] = ()
    tried: int = 0  #: Number of Neimark-Sacker points, in the order of the branches, that are done.
    #: Windows in which motions lock, followed in a second parameter, if that was asked.
    tongues: tuple[Tongue, ...] = ()
    unfollowed: int = 0  #: Number of windows that are left to be followed so.

    @property
    def starts(self) -> tuple[SpecialPoint, ...]:
        """The Neimark-Sacker points of all branches."""
        branches = (member.branch for member in self.diagram.members)
        return tuple(chain.from_iterable(branch.special(Kind.NEIMARK_SACKER) for branch in branches))

    @property
    def complete(self) -> bool:
        """True if all Neimark-Sacker points are done."""
        return self.diagram.complete and self.tried == len(self.starts) and not self.unfollowed

    @property
    def windows(self) -> tuple[LockedWindow, ...]:
        """The windows along all families, and at their ends, whose own ends are folds, each once."""
        found: list[LockedWindow] = []
        for window in (each.window for family in self.families for each in (*family.events, *family.ends)):
            if window is None or len(window.folds) != 2:
                continue
            period, value = window.orbit.period, window.folds[0].value
            known = ((each.orbit.period, each.folds[0].value) for each in found)
            if all(period != other or abs(value - place) > _SAME * abs(value) for other, place in known):
                found.append(window)
        return tuple(found)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the branches, in sentences."""
        return self.diagram.notes

    def holds(self, special: SpecialPoint) -> bool:
        """Return True if a known family begins or ends at a Neimark-Sacker point."""
        return any(
            family.curves == special.orbit.period and abs(end.value - special.value) <= _SAME * abs(special.value)
            for family in self.families
            for end in family.ends
            if end.reason in (TorusEndReason.BORN, TorusEndReason.SHRINKS)
        )

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the number of branches and points, and each family, in words.

        Parameters
        ----------
        notes
            True to include notes and failures.
        """
        branches, starts, families = len(self.diagram.members), len(self.starts), len(self.families)
        begun = (
            f"{branches} {'branch' if branches == 1 else 'branches'} with {starts} Neimark-Sacker "
            f"{'point' if starts == 1 else 'points'}; "
        )
        yield f"{begun if branches else ''}{families} {'family' if families == 1 else 'families'} of tori"
        for number, family in enumerate(self.families, start=1):
            first, *rest = family.summary()
            yield f"T{number}: {first}"
            yield from rest
        for tongue in self.tongues:
            yield from tongue.summary()
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of all tori, and of events and ends, with the number of the family."""
        return {
            "tori": lambda: rows_of(self._rows(lambda family: map(row_of, family.points))),
            "events": lambda: rows_of(self._rows(lambda family: map(row_of, family.events))),
            "ends": lambda: rows_of(self._rows(lambda family: map(row_of, family.ends))),
            "tongues": lambda: rows_of(row for tongue in self.tongues for row in tongue.rows()),
        }

    def _rows(self, rows: Callable[[TorusFamily], Any]) -> Iterator[dict[str, Any]]:
        for number, family in enumerate(self.families, start=1):
            yield from ({"family": f"T{number}", **row} for row in rows(family))

    def __repr__(self) -> str:
        return f"TorusDiagram({len(self.families)} families of tori on {len(self.diagram.members)} branches)"
