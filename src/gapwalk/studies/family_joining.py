"""Join the special points of two neighbouring members of a family, by their exact loci or by nearness.

The locus of a special point is followed from one member towards the next, in the plane of the parameter of the branches
and of the one in which members differ. Points whose loci end on the way, or are not followed, are assigned by nearness.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, follow_locus
from gapwalk.bifurcation.loci.locus import Codim2Point, LocusPoint
from gapwalk.bifurcation.loci.locus_equations import Secant, zero_along
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.parameter_path import WAY, on_the_way
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit, is_same, stroboscopic
from gapwalk.studies.family import TURN, Connection, Fate, Member, Passage, Place
from gapwalk.studies.kinds import Counted

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
    """How far two special points are apart: in widths of the range, and of their motions; infinite for other kinds."""
    if (a.kind, a.contact, a.orbit.period) != (b.kind, b.contact, b.orbit.period):
        return np.inf
    width = within[1] - within[0]
    return float(np.hypot((a.value - b.value) / width, _apart(stroboscopic(a.orbit), b.orbit)))


def _apart(states: NDArray[np.float64], orbit: Orbit) -> float:
    """Relative distance of two motions, which may begin at different forcing periods."""
    return float(np.abs(states - orbit.state).max(axis=1).min() / magnitude(orbit.state, orbit.system))


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
        for name in ("max_period", "workers"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 1, or None")
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
        system = self._lifted(special.orbit.system, side)
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

    def curve(self, locus: Locus) -> tuple[tuple[float, float], ...]:
        """The points of a locus: the parameter, and what the family is over."""
        return tuple((first, self.value(second)) for first, second in locus.values.tolist())

    def _lifted(self, system: System, side: int) -> System:
        if self.second != WAY:
            return system
        return on_the_way(system.at(self.ends[0]), self.ends[1]).at({WAY: self.bounds[side]})


# The gap is one wide, like the range. Loci bend less than branches, and steps shorten where they do; where one leads is
# verified by the orbit at its end.
_WALK = WalkOptions(initial_step=0.02, largest_step=0.1)
_EDGE = 1e-9  # share of the gap within which a locus has reached a member
_SECANT = Secant(longest=0.05, farthest=0.2)


@dataclass(frozen=True)
class Trace:
    """The locus of a special point between two members.

    Attributes
    ----------
    locus
        The locus from the special point on.
    arrives
        The member that it reaches, 0 or 1; None if it ends between them.
    """

    locus: Locus
    arrives: int | None

    @property
    def orbit(self) -> Orbit:
        """The orbit where it ends."""
        return self.locus.points[-1].orbit

    @property
    def first(self) -> float:
        """The parameter of the members where it ends."""
        return self.locus.points[-1].values[0]


def trace(special: SpecialPoint, side: int, gap: Gap) -> Trace:
    """Follow a special point of one member into the gap.

    Raises
    ------
    NumericalError
        If it cannot be followed.
    """
    lifted = gap.lifted(special, side)
    locus = _inwards(follow_locus(lifted, gap.parameter, gap.second, gap.ranges, walk=_WALK))
    share = gap.share(locus.points[-1].values[1])
    at_edge = locus.ends[1].reason is LocusEndReason.RANGE and len(locus.points) > 1
    arrives = next((end for end in (0, 1) if at_edge and abs(share - end) <= _EDGE), None)
    return Trace(locus, arrives)


def _inwards(locus: Locus) -> Locus:
    """The locus from its start on: of its two directions there, one leads out of the gap and ends at once."""
    begin, end = locus.ends
    if begin.reason is LocusEndReason.START:
        return locus
    points, codim2 = locus.points[::-1], locus.codim2_points[::-1]
    return replace(locus, points=points, codim2_points=codim2, ends=(end, begin))


def farthest(found: Trace, special: SpecialPoint, side: int, gap: Gap) -> tuple[tuple[float, float], str]:
    """Where a locus that comes back to the member from which it started is farthest from it, and what happens there."""
    here = gap.bounds[side]
    points: list[tuple[LocusPoint, str]] = [(point, TURN) for point in found.locus.points]
    points += [(each.point, each.kind.value) for each in found.locus.codim2_points if _turns(each)]
    best, event = max(points, key=lambda each: abs(each[0].values[1] - here))
    if event != TURN:
        return (best.values[0], gap.value(best.values[1])), event
    corrector = start_locus(gap.lifted(special, side), gap.parameter, gap.second, gap.ranges)[0].corrector
    turn = zero_along(corrector, best.x, lambda correction: _slope(corrector, correction, best), _SECANT)
    first, second = best.values if turn is None else (turn.x[-2:] * corrector.scales[-2:]).tolist()
    return (first, gap.value(second)), event


def _turns(codim2: Codim2Point) -> bool:
    """Whether a locus may turn back at a point: at a cusp, and at the corners that it has where a contact grazes."""
    return codim2.kind in (Codim2.CUSP, Codim2.GRAZING, Codim2.DEGENERATE_GRAZING)


def _slope(corrector: Corrector, correction: Correction, beside: LocusPoint) -> float:
    """How fast the second parameter changes along a locus."""
    return float(corrector.tangent(correction.evaluation, beside.tangent).tangent[-1])


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
