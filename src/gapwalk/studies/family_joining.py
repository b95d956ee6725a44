"""Join the special points of two neighbouring members of a family, by their exact loci or by nearness.

The locus of a special point is followed from one member towards the next, in the plane of the parameter of the branches
and of the one in which members differ. Points whose loci end on the way, or are not followed, are assigned by nearness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, follow_locus
from gapwalk.bifurcation.loci.locus import LocusPoint
from gapwalk.bifurcation.loci.locus_equations import Secant, zero_along
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.continuation.corrector import Correction
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.parameter_path import WAY, on_the_way
from gapwalk.orbit.orbit import is_same, stroboscopic
from gapwalk.studies.family import TURN, Connection, Fate, Member, Passage, Place
from gapwalk.studies.kinds import Counted, check_integers

LIMIT = 0.25
"""Distance beyond which two special points are not taken for the same, as `distance_between` measures it."""

_FORBIDDEN = 1e6


def nearest_pairs(
    left: Mapping[Place, SpecialPoint], right: Mapping[Place, SpecialPoint], within: tuple[float, float]
) -> list[tuple[Place, Place]]:
    """The pairs whose distances are least in all, each within the `LIMIT`; others stay alone.

    To leave one alone costs half of the limit, so that what is born or vanishes between the members is not forced upon
    what goes on.
    """
    from scipy.optimize import linear_sum_assignment  # imported late: it takes long

    if not left or not right:
        return []
    rows, columns = list(left), list(right)
    distances = np.array([[distance_between(left[a], right[b], within) for b in columns] for a in rows])
    alone = 0.5 * LIMIT
    count = len(rows) + len(columns)
    costs = np.full((count, count), _FORBIDDEN)
    costs[: len(rows), : len(columns)] = np.minimum(distances, _FORBIDDEN)
    costs[: len(rows), len(columns) :][np.diag_indices(len(rows))] = alone
    costs[len(rows) :, : len(columns)][np.diag_indices(len(columns))] = alone
    costs[len(rows) :, len(columns) :] = 0.0
    pairs = zip(*linear_sum_assignment(costs), strict=True)
    return [(rows[a], columns[b]) for a, b in pairs if a < len(rows) and b < len(columns) and distances[a, b] < LIMIT]


def distance_between(a: SpecialPoint, b: SpecialPoint, within: tuple[float, float]) -> float:
    """How far two special points are apart: in widths of the range, and of their motions; infinite for other kinds.

    The motions may begin at different forcing periods.
    """
    if (a.kind, a.contact, a.orbit.period) != (b.kind, b.contact, b.orbit.period):
        return np.inf
    orbit, width = b.orbit, within[1] - within[0]
    apart = np.abs(stroboscopic(a.orbit) - orbit.state).max(axis=1).min() / magnitude(orbit.state, orbit.system)
    return float(np.hypot((a.value - b.value) / width, apart))


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """How far the members of a family go, and how their special points are joined.

    Parameters
    ----------
    max_period
        Follow what branches off too, up to this period in forcing periods, as in a diagram; None: the first branch
        alone.
    kinds
        Kinds of special points that are joined.
    exact
        Whether special points are joined by the exact loci that lead from member to member; otherwise each to the
        nearest of its kind, which is a guess.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    max_period: Counted | None = None
    kinds: tuple[Kind, ...] = field(default_factory=Kind.known)
    exact: bool = True
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_integers(self, **{name: 1 for name in ("max_period", "workers") if getattr(self, name) is not None})
        if not self.kinds or not set(self.kinds) <= set(Kind.known()):
            names = ", ".join(kind.value for kind in Kind.known())
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")


@dataclass(frozen=True)
class Gap:
    """Two neighbouring members, and what moves between them.

    One parameter is followed by its own name; several that move together are one parameter, the way from the one member
    to the other.

    Parameters
    ----------
    members
        The two.
    parameter, within
        Along what the members are walked, and the range, the smaller value first.
    ends
        The values of what moves, at the one member and at the other.
    options
        How special points are joined.
    """

    members: tuple[Member, Member]
    parameter: str
    within: tuple[float, float]
    ends: tuple[Mapping[str, float], Mapping[str, float]]
    options: FamilyOptions

    @property
    def second(self) -> str:
        """The parameter that leads from the one member to the other."""
        return next(iter(self.ends[0])) if len(self.ends[0]) == 1 else WAY

    @property
    def bounds(self) -> tuple[float, float]:
        """Its values at the one member and at the other."""
        return (0.0, 1.0) if self.second == WAY else (self.ends[0][self.second], self.ends[1][self.second])

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ranges of both parameters, the smaller value first."""
        low, high = sorted(self.bounds)
        return self.within, (low, high)

    def lifted(self, special: SpecialPoint, side: int) -> SpecialPoint:
        """A special point of the one member (side 0) or the other (1), in a system that has the second parameter."""
        system = special.orbit.system
        if self.second == WAY:
            system = on_the_way(system.at(self.ends[0]), self.ends[1]).at({WAY: self.bounds[side]})
        return replace(special, point=replace(special.point, orbit=replace(special.orbit, system=system)))

    def share(self, second: float) -> float:
        """How far a value of the second parameter is on the way from the one member (0) to the other (1)."""
        begin, end = self.bounds
        return (second - begin) / (end - begin)

    def value(self, second: float) -> float:
        """What the family is over at a value of the second parameter."""
        one, other = (member.value for member in self.members)
        share = self.share(second)
        return (1.0 - share) * one + share * other


# The gap is one wide, like the range. Loci bend less than branches, and steps shorten where they do; where one leads is
# verified by the orbit at its end.
_WALK = WalkOptions(initial_step=0.02, largest_step=0.1)
_EDGE = 1e-9  # share of the gap within which a locus has reached a member
_SECANT = Secant(longest=0.05, farthest=0.2)
_CORNERS = (Codim2.CUSP, Codim2.GRAZING, Codim2.DEGENERATE_GRAZING)  # in which a locus may turn back


def join(gap: Gap) -> tuple[Connection, ...]:
    """What becomes of each special point of two members between them.

    Those of the first member come first; those of the other that do not come from there follow: what becomes of them on
    the way back.
    """
    return _Joiner(gap).join()


Specials = dict[Place, SpecialPoint]

_SAME = 1e-5  # distance of two special points, in widths of the range, and of their orbits, within which they are one
_TRUNCATED = 30.0  # the same in the share of the motion that is neglected: contacts amplify it


class _Joiner:
    """Joins the special points of two members."""

    def __init__(self, gap: Gap) -> None:
        self.gap = gap
        self.left: tuple[Specials, Specials] = (self._chosen(0), self._chosen(1))
        self.lost: dict[Place, str] = {}
        self.connections: list[Connection] = []

    def join(self) -> tuple[Connection, ...]:
        if self.gap.options.exact:
            for side in (0, 1):
                for place in list(self.left[side]):
                    special = self.left[side].get(place)  # it may be what another one has led to
                    if special is not None and special.kind is not Kind.BRANCH_POINT:
                        self._join_exactly(place, special, side)
        for one, other in nearest_pairs(*self.left, self.gap.within):
            pair = (self.left[0].pop(one), self.left[1].pop(other))
            curve = tuple((each.value, member.value) for each, member in zip(pair, self.gap.members, strict=True))
            detail = self.lost.get(one, self.lost.get(other, ""))
            self._add(pair[0], Fate.NEAR, one, other, curve=curve, detail=detail)
        for specials in self.left:
            for place, special in specials.items():
                fate = Fate.LOST if place in self.lost else Fate.ALONE
                self._add(special, fate, place, detail=self.lost.get(place, ""))
        return tuple(sorted(self.connections, key=lambda connection: connection.begin))

    def _chosen(self, side: int) -> Specials:
        low, high = self.gap.within
        kinds = self.gap.options.kinds
        # a fold between two points of a branch may lie just beyond the edge
        return {
            place: special
            for place, special in self.gap.members[side].special_points
            if special.kind in kinds and low <= special.value <= high
        }

    def _add(self, special: SpecialPoint, fate: Fate, begin: Place, end: Place | None = None, **more: Any) -> None:
        about = (special.kind, special.contact, special.orbit.period)
        self.connections.append(Connection(*about, fate, begin, end, **more))

    def _join_exactly(self, place: Place, special: SpecialPoint, side: int) -> None:
        """Add the connection of a special point by its locus; note why, if that cannot be followed."""
        gap, lifted = self.gap, self.gap.lifted(special, side)
        try:
            locus = _inwards(follow_locus(lifted, gap.parameter, gap.second, gap.ranges, walk=_WALK))
        except NumericalError as error:
            self.lost[place] = str(error)
            return
        end = locus.ends[1]
        if end.reason.is_failure:
            self.lost[place] = str(end)
            return
        del self.left[side][place]
        first, second = locus.points[-1].values
        at_edge = end.reason is LocusEndReason.RANGE and len(locus.points) > 1
        arrives = next((edge for edge in (0, 1) if at_edge and abs(gap.share(second) - edge) <= _EDGE), None)
        partner = None if arrives is None else self._at_end(locus, arrives)
        if partner is not None and arrives is not None:
            del self.left[arrives][partner]
        ways = tuple((first, gap.value(second)) for first, second in locus.values.tolist())
        passages = tuple(
            Passage(each.kind.value, each.values[0], gap.value(each.values[1]), each.contact)
            for each in locus.codim2_points
        )
        more: dict[str, Any] = {"curve": ways, "passages": passages, "at": (first, gap.value(second))}
        if partner is not None and arrives != side:
            if side == 0:
                self._add(special, Fate.JOINED, place, partner, curve=ways, passages=passages)
            else:
                self._add(special, Fate.JOINED, partner, place, curve=ways[::-1], passages=passages[::-1])
        elif arrives == side:  # even where the other one is on no branch that is known, the two met
            more["at"], event = self._farthest(locus, lifted, side)
            self._add(special, Fate.MET, place, partner, event=event, **more)
        elif arrives is not None:
            self._add(special, Fate.OUTSIDE, place, **more)
        elif end.reason in (LocusEndReason.RANGE, LocusEndReason.START):
            self._add(special, Fate.RANGE, place, **more)
        else:
            event = locus.codim2_points[-1].kind.value if locus.codim2_points else ""
            self._add(special, Fate.ENDS, place, event=event, **more)

    def _at_end(self, locus: Locus, side: int) -> Place | None:
        """The special point to which a locus has led."""
        (low, high), reached = self.gap.within, locus.points[-1]
        near = []
        for place, special in self.left[side].items():
            tolerance = max(_SAME, _TRUNCATED * special.orbit.truncation)
            distance = abs(special.value - reached.values[0]) / (high - low)
            is_alike = (special.kind, special.contact) == (locus.kind, locus.contact)
            if is_alike and distance <= tolerance and is_same(special.orbit, reached.orbit, tolerance):
                near.append((distance, place))
        return min(near)[1] if near else None

    def _farthest(self, locus: Locus, lifted: SpecialPoint, side: int) -> tuple[tuple[float, float], str]:
        """Where a locus that returns to the member from which it started is farthest from it, and what happens there.

        Unless it turns in a corner, it turns where the second parameter does not change along it.
        """
        gap, here = self.gap, self.gap.bounds[side]
        points: list[tuple[LocusPoint, str]] = [(point, TURN) for point in locus.points]
        points += [(each.point, each.kind.value) for each in locus.codim2_points if each.kind in _CORNERS]
        best, event = max(points, key=lambda each: abs(each[0].values[1] - here))
        first, second = best.values
        if event == TURN:
            corrector = start_locus(lifted, gap.parameter, gap.second, gap.ranges)[0].corrector

            def slope(correction: Correction) -> float:
                return float(corrector.tangent(correction.evaluation, best.tangent).tangent[-1])

            if (turn := zero_along(corrector, best.x, slope, _SECANT)) is not None:
                first, second = (turn.x[-2:] * corrector.scales[-2:]).tolist()
        return (first, gap.value(second)), event


def _inwards(locus: Locus) -> Locus:
    """The locus from its start on: of its two directions there, one leads out of the gap and ends at once."""
    begin, end = locus.ends
    if begin.reason is LocusEndReason.START:
        return locus
    points, codim2 = locus.points[::-1], locus.codim2_points[::-1]
    return replace(locus, points=points, codim2_points=codim2, ends=(end, begin))
