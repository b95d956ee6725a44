"""Joins the special points of two neighbouring members of a family: by their exact loci, or by nearness."""

from __future__ import annotations

from collections.abc import Callable

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.loci import LocusEndReason
from gapwalk.errors import NumericalError
from gapwalk.orbit.identity import is_same
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.family.connection import Connection, Fate, Passage
from gapwalk.studies.family.gap import Gap
from gapwalk.studies.family.member import Place
from gapwalk.studies.family.nearness import nearest_pairs
from gapwalk.studies.family.trace import Trace, farthest, trace

Specials = dict[Place, SpecialPoint]

_SAME = 1e-5  # distance of two special points, in widths of the range, and of their orbits, within which they are one
_TRUNCATED = 30.0  # the same in the share of the motion that is neglected: contacts amplify it


def join(gap: Gap) -> tuple[Connection, ...]:
    """What becomes of each special point of two members between them.

    Those of the first member come first; those of the other that do not come from there follow: what becomes of them on
    the way back.
    """
    return _Joiner(gap).join()


class _Joiner:
    """Joins the special points of two members."""

    def __init__(self, gap: Gap) -> None:
        self.gap = gap
        self.specials: tuple[Specials, Specials] = (self._chosen(0), self._chosen(1))
        self.left: tuple[Specials, Specials] = (dict(self.specials[0]), dict(self.specials[1]))
        self.lost: dict[Place, str] = {}

    def join(self) -> tuple[Connection, ...]:
        connections = []
        if self.gap.options.exact:
            for side in (0, 1):
                for place in list(self.left[side]):
                    special = self.left[side].get(place)  # it may be what another one has led to
                    if special is not None and special.kind is not Kind.BRANCH_POINT:
                        connections += self._traced(place, special, side)
        connections += self._near()
        connections += self._alone()
        return tuple(sorted(connections, key=lambda connection: connection.begin))

    def _chosen(self, side: int) -> Specials:
        low, high = self.gap.within
        kinds = self.gap.options.kinds
        # a fold between two points of a branch may lie just beyond the edge
        return {
            place: special
            for place, special in self.gap.members[side].special_points
            if special.kind in kinds and low <= special.value <= high
        }

    def _traced(self, place: Place, special: SpecialPoint, side: int) -> list[Connection]:
        """The connection of a special point by its locus; none if that cannot be followed."""
        try:
            found = trace(special, side, self.gap)
        except NumericalError as error:
            self.lost[place] = str(error)
            return []
        if found.locus.ends[1].reason.is_failure:
            self.lost[place] = str(found.locus.ends[1])
            return []
        del self.left[side][place]
        partner = None if found.arrives is None else self._at_end(found, found.arrives)
        if partner is not None and found.arrives is not None:
            del self.left[found.arrives][partner]
        if partner is not None and found.arrives != side:
            begin, end = (place, partner) if side == 0 else (partner, place)
            return [self._connection(special, Fate.JOINED, begin, end, found, turned=side == 1)]
        if found.arrives == side:  # even where the other one is on no branch that is known, the two met
            at, event = farthest(found, special, side, self.gap)
            return [self._connection(special, Fate.MET, place, partner, found, at, event)]
        first, second = found.locus.points[-1].values
        at = (first, self.gap.value(second))
        if found.arrives is not None:
            return [self._connection(special, Fate.OUTSIDE, place, None, found, at)]
        if found.locus.ends[1].reason in (LocusEndReason.RANGE, LocusEndReason.START):
            return [self._connection(special, Fate.RANGE, place, None, found, at)]
        codim2 = found.locus.codim2_points
        return [self._connection(special, Fate.ENDS, place, None, found, at, codim2[-1].kind.value if codim2 else "")]

    def _at_end(self, found: Trace, side: int) -> Place | None:
        """The special point to which a locus has led."""
        low, high = self.gap.within
        alike = [
            (abs(special.value - found.first) / (high - low), place)
            for place, special in self.left[side].items()
            if (special.kind, special.contact) == (found.locus.kind, found.locus.contact)
            and is_same(special.orbit, found.orbit, _tolerance(special.orbit))
        ]
        near = [(distance, place) for distance, place in alike if distance <= _tolerance(self.left[side][place].orbit)]
        return min(near)[1] if near else None

    def _connection(
        self,
        special: SpecialPoint,
        fate: Fate,
        begin: Place,
        end: Place | None,
        found: Trace,
        at: tuple[float, float] | None = None,
        event: str = "",
        *,
        turned: bool = False,
    ) -> Connection:
        gap = self.gap
        order: Callable[[tuple], tuple] = (lambda parts: parts[::-1]) if turned else (lambda parts: parts)
        passages = tuple(
            Passage(each.kind.value, each.values[0], gap.value(each.values[1]), each.contact)
            for each in found.locus.codim2_points
        )
        about = (special.kind, special.contact, special.orbit.period, fate, begin, end, at, event)
        return Connection(*about, order(gap.curve(found.locus)), order(passages))

    def _near(self) -> list[Connection]:
        """Joints of what is left to the nearest of its kind."""
        connections = []
        for one, other in nearest_pairs(*self.left, self.gap.within):
            special = self.left[0].pop(one)
            across = self.left[1].pop(other)
            curve = tuple(
                (each.value, member.value) for each, member in zip((special, across), self.gap.members, strict=True)
            )
            detail = self.lost.get(one, self.lost.get(other, ""))
            about = (special.kind, special.contact, special.orbit.period, Fate.NEAR, one, other)
            connections.append(Connection(*about, curve=curve, detail=detail))
        return connections

    def _alone(self) -> list[Connection]:
        """What has not been joined in any way."""
        return [
            Connection(
                special.kind,
                special.contact,
                special.orbit.period,
                Fate.LOST if place in self.lost else Fate.ALONE,
                place,
                detail=self.lost.get(place, ""),
            )
            for specials in self.left
            for place, special in specials.items()
        ]


def _tolerance(orbit: Orbit) -> float:
    """Distance within which an orbit at a special point is the one that was followed to there, exactly."""
    return max(_SAME, _TRUNCATED * orbit.truncation)
