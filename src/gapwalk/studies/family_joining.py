"""The work on a family: its members, then their special points joined, by their exact loci or by nearness.

The locus of a special point is followed from one member towards the next, in the plane of the parameter of the branches
and of the one in which members differ. Points whose loci end on the way, or are not followed, are assigned by nearness.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.loci import Codim2, Locus, LocusEndReason, follow_locus
from gapwalk.bifurcation.loci.locus import LocusPoint
from gapwalk.bifurcation.loci.locus_equations import Secant, zero_along
from gapwalk.bifurcation.loci.locus_start import start_locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.corrector import Correction
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.length_unit import magnitude
from gapwalk.model.parameter_homotopy import WAY, on_the_way
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import is_same, stroboscopic
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.diagram_study import DiagramOptions, diagram
from gapwalk.studies.family import Family
from gapwalk.studies.family_member import Member, Place
from gapwalk.studies.special_point_path import TURN, Connection, Fate, Passage
from gapwalk.studies.study_kind import Finding, Found, Work
from gapwalk.studies.study_registry import Counted, check_integers

if TYPE_CHECKING:
    from gapwalk.studies.family_study import FamilyStudy

LIMIT = 0.25
"""Distance beyond which two special points are not taken for the same, as `distance_between` measures it."""

_FORBIDDEN = 1e6


def nearest_pairs(
    left: Mapping[Place, SpecialPoint], right: Mapping[Place, SpecialPoint], within: tuple[float, float]
) -> list[tuple[Place, Place]]:
    """Return the pairs with the least sum of distances, each within `LIMIT`; the other points stay single.

    A single point costs half of the limit, so that a point that appears or vanishes between the members is not paired
    with one that continues.
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
    """Return the distance of two special points, relative to the range and their motions; inf if their kinds differ.

    The motions may begin at different forcing periods.
    """
    if (a.kind, a.contact, a.orbit.period) != (b.kind, b.contact, b.orbit.period):
        return np.inf
    orbit, width = b.orbit, within[1] - within[0]
    apart = np.abs(stroboscopic(a.orbit) - orbit.state).max(axis=1).min() / magnitude(orbit.state, orbit.system)
    return float(np.hypot((a.value - b.value) / width, apart))


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """Options of a family: the extent of its members, and how their special points are joined.

    Examples
    --------
    >>> gw.FamilyOptions(kinds=("fold",), exact=False).exact
    False
    """

    #: Longest period, in forcing periods, of further branches that are followed, as in a diagram; None: only the first
    #: branch.
    max_period: Counted | None = None
    kinds: tuple[Kind, ...] = field(default_factory=Kind.known)  #: Kinds of special points that are joined.
    #: True to join special points by the exact loci that lead from member to member; otherwise each to the nearest of
    #: its kind, which is a guess.
    exact: bool = True
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_integers(self, **{name: 1 for name in ("max_period", "workers") if getattr(self, name) is not None})
        if not self.kinds or not set(self.kinds) <= set(Kind.known()):
            names = ", ".join(kind.value for kind in Kind.known())
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")


MEMBER = Part("member", Member, numbered=True)
JOINTS = Part("connections", tuple[Connection, ...], numbered=True)
"""Changes of special points between two members, by the number of the first."""


class FamilyWork(Work):
    """The work on one family: its members, then the connections of special points between them."""

    def __init__(self, system: System, asked: FamilyStudy, finding: Callable[[Family], Finding]) -> None:
        self.asked, self._finding = asked, finding
        self._family = Family(system, asked.parameter, asked.ends, asked.over)
        self.members: dict[int, Member] = {}
        self.connections: dict[int, tuple[Connection, ...]] = {}

    def take(self, known: Parts) -> None:
        """Read members and connections; raise a ValueError if they belong to another family."""
        self.members, self.connections = dict(known.all(MEMBER)), dict(known.all(JOINTS))
        for number, member in self.members.items():
            if member.number != number or not 0 <= number < self.count:
                raise ValueError(f"member {number} calls itself {member.number}")
        if any(not 0 <= number < self.count - 1 for number in self.connections):
            raise ValueError("the file has connections of members that it does not contain")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Walk the remaining members, and join the remaining special points of neighbours that are walked."""
        begun = set(self.connections)
        pieces: list[int | tuple[Member, Member]] = [k for k in range(self.count) if k not in self.members]
        pieces += self._ready(begun)
        do_one = partial(_do_one, self._family.system, self.asked)
        for index, found in workers.each(do_one, pieces, in_order=False):
            piece = pieces[index]
            if isinstance(found, Member):
                self.members[found.number] = found
                pieces += self._ready(begun)
                yield Found.part(MEMBER, found, found.number)
            elif isinstance(piece, tuple):
                number = piece[0].number
                self.connections[number] = found
                yield Found.part(JOINTS, found, number)

    def _ready(self, begun: set[int]) -> list[tuple[Member, Member]]:
        """Return the gaps that can be joined now, and note them: all members from one side to the other are known."""
        ready = [
            (left, right)
            for left, right in self.record.gaps
            if left.number not in begun and all(k in self.members for k in range(left.number, right.number))
        ]
        begun.update(left.number for left, _ in ready)
        return ready

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.record.complete

    @property
    def done(self) -> int:
        """Number of members that are walked, and of gaps in which special points are joined."""
        return len(self.members) + len(self.connections)

    @property
    def total(self) -> int:
        """Number of members, and of gaps between members that have branches."""
        gaps = len(self.record.gaps) if len(self.members) == self.count else self.count - 1
        return self.count + gaps

    @property
    def record(self) -> Family:
        """The family so far."""
        members = tuple(member for _, member in sorted(self.members.items()))
        return replace(self._family, members=members, connections=dict(sorted(self.connections.items())))

    def finding(self) -> Finding:
        """Return the family as the finding of a study."""
        return self._finding(self.record)

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self._family.over.axis)


def _do_one(system: System, asked: FamilyStudy, piece: int | tuple[Member, Member]) -> Member | tuple[Connection, ...]:
    """Walk a member, given by its number, or join the special points of two."""
    return _walk_member(system, asked, piece) if isinstance(piece, int) else _join(asked, piece)


def _walk_member(system: System, asked: FamilyStudy, number: int) -> Member:
    """Walk the branches of one member; a failure does not affect the others."""
    value, parameter, ends = asked.over.axis[number], asked.parameter, (asked.begin, asked.end)
    how: Any = {"walk": asked.walk, "method": asked.method}
    try:
        first = system.at({**asked.over.at(number), parameter: asked.begin})
        orbit = find_orbit(first, asked.period, asked.start, method=asked.method)
        if asked.max_period is None:
            return Member(number, value, (follow(orbit, parameter, asked.end, **how),))
        limits = DiagramOptions(max_period=asked.max_period, workers=1)
        grown = diagram(first, parameter, ends, start=orbit, options=limits, **how)
    except NumericalError as error:
        return Member(number, value, failures=(f"no branch could be walked: {error}",))
    return Member(number, value, grown.branches, grown.notes, grown.failures)


def _join(asked: FamilyStudy, members: tuple[Member, Member]) -> tuple[Connection, ...]:
    """Join the special points of two neighbouring members.

    Points of the first member are followed towards the second; then those of the second that were not reached are
    followed back.
    """
    return _Joiner(asked, members).join()


# The gap is one wide, like the range. Loci bend less than branches, and steps shorten where they do; where one leads is
# verified by the orbit at its end.
_WALK = WalkOptions(initial_step=0.02, largest_step=0.1)
_EDGE = 1e-9  # share of the gap within which a locus has reached a member
_SECANT = Secant(longest=0.05, farthest=0.2)
_CORNERS = (Codim2.CUSP, Codim2.GRAZING, Codim2.DEGENERATE_GRAZING)  # in which a locus may turn back


Specials = dict[Place, SpecialPoint]

_SAME = 1e-5  # distance of two special points, in widths of the range, and of their orbits, within which they are one
_TRUNCATED = 30.0  # the same in the share of the motion that is neglected: contacts amplify it


class _Joiner:
    """Connection of the special points of two neighbouring members.

    A single parameter keeps its name; several parameters that change together are replaced by one, the path from the
    first member to the second.

    Attributes
    ----------
    plane
        The parameter of the members, the one that leads from the one member to the other, and their ranges.
    bounds
        The values of the second at the one member and at the other.
    """

    def __init__(self, asked: FamilyStudy, members: tuple[Member, Member]) -> None:
        self.asked, self.members = asked, members
        self.ends = tuple(asked.over.at(member.number) for member in members)
        names = asked.over.names
        second = names[0] if len(names) == 1 else WAY
        self.bounds = (0.0, 1.0) if second == WAY else (self.ends[0][second], self.ends[1][second])
        self.plane = (asked.parameter, second, (asked.ends, (min(self.bounds), max(self.bounds))))
        self.left: tuple[Specials, Specials] = (self._chosen(0), self._chosen(1))
        self.lost: dict[Place, str] = {}
        self.connections: list[Connection] = []

    def join(self) -> tuple[Connection, ...]:
        """Join special points by their loci, then by nearness; the others stay single."""
        if self.asked.exact:
            for side in (0, 1):
                for place in list(self.left[side]):
                    special = self.left[side].get(place)  # it may be what another one has led to
                    if special is not None and special.kind is not Kind.BRANCH_POINT:
                        self._join_exactly(place, special, side)
        for one, other in nearest_pairs(*self.left, self.asked.ends):
            pair = (self.left[0].pop(one), self.left[1].pop(other))
            curve = tuple((each.value, member.value) for each, member in zip(pair, self.members, strict=True))
            detail = self.lost.get(one, self.lost.get(other, ""))
            self._add(pair[0], Fate.NEAR, one, other, curve=curve, detail=detail)
        for specials in self.left:
            for place, special in specials.items():
                fate = Fate.LOST if place in self.lost else Fate.ALONE
                self._add(special, fate, place, detail=self.lost.get(place, ""))
        return tuple(sorted(self.connections, key=lambda connection: connection.begin))

    def _chosen(self, side: int) -> Specials:
        low, high = self.asked.ends
        kinds = self.asked.kinds
        # a fold between two points of a branch may lie just beyond the edge
        return {
            place: special
            for place, special in self.members[side].special_points
            if special.kind in kinds and low <= special.value <= high
        }

    def _lifted(self, special: SpecialPoint, side: int) -> SpecialPoint:
        """Return a special point of the first (side 0) or second (1) member, in a system with the second parameter."""
        system = special.orbit.system
        if self.plane[1] == WAY:
            system = on_the_way(system.at(self.ends[0]), self.ends[1]).at({WAY: self.bounds[side]})
        return replace(special, point=replace(special.point, orbit=replace(special.orbit, system=system)))

    def _share(self, second: float) -> float:
        """Return the position of a value of the second parameter between the two members, from 0 to 1."""
        begin, end = self.bounds
        return (second - begin) / (end - begin)

    def _value(self, second: float) -> float:
        """Return the quantity in which members differ, at a value of the second parameter."""
        one, other = (member.value for member in self.members)
        share = self._share(second)
        return (1.0 - share) * one + share * other

    def _add(self, special: SpecialPoint, fate: Fate, begin: Place, end: Place | None = None, **more: Any) -> None:
        about = (special.kind, special.contact, special.orbit.period)
        self.connections.append(Connection(*about, fate, begin, end, **more))

    def _join_exactly(self, place: Place, special: SpecialPoint, side: int) -> None:
        """Add the connection of a special point by its locus; if it cannot be followed, note the reason."""
        lifted = self._lifted(special, side)
        try:
            locus = _inwards(follow_locus(lifted, *self.plane, walk=_WALK))
        except NumericalError as error:
            self.lost[place] = str(error)
            return
        end = locus.ends[1]
        if end.reason.is_failure:
            self.lost[place] = str(end)
            return
        del self.left[side][place]
        first, second = locus.points[-1].values
        at_edge = end.reason in (LocusEndReason.RANGE, LocusEndReason.TABLE) and len(locus.points) > 1
        arrives = next((edge for edge in (0, 1) if at_edge and abs(self._share(second) - edge) <= _EDGE), None)
        partner = None if arrives is None else self._at_end(locus, arrives)
        if partner is not None and arrives is not None:
            del self.left[arrives][partner]
        ways = tuple((first, self._value(second)) for first, second in locus.values.tolist())
        passages = tuple(
            Passage(each.kind.value, each.values[0], self._value(each.values[1]), each.contact)
            for each in locus.codim2_points
        )
        more: dict[str, Any] = {"curve": ways, "passages": passages, "at": (first, self._value(second))}
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
        elif end.reason in (LocusEndReason.RANGE, LocusEndReason.TABLE, LocusEndReason.START):
            self._add(special, Fate.RANGE, place, **more)
        else:
            event = locus.codim2_points[-1].kind.value if locus.codim2_points else ""
            self._add(special, Fate.ENDS, place, event=event, **more)

    def _at_end(self, locus: Locus, side: int) -> Place | None:
        """Return the special point to which a locus has led."""
        (low, high), reached = self.asked.ends, locus.points[-1]
        near = []
        for place, special in self.left[side].items():
            tolerance = max(_SAME, _TRUNCATED * special.orbit.truncation)
            distance = abs(special.value - reached.values[0]) / (high - low)
            is_alike = (special.kind, special.contact) == (locus.kind, locus.contact)
            if is_alike and distance <= tolerance and is_same(special.orbit, reached.orbit, tolerance):
                near.append((distance, place))
        return min(near)[1] if near else None

    def _farthest(self, locus: Locus, lifted: SpecialPoint, side: int) -> tuple[tuple[float, float], str]:
        """Find the farthest point of a locus that returns to the member from which it started, and the event there.

        Unless it turns in a corner, it turns where the second parameter does not change along it.
        """
        here = self.bounds[side]
        points: list[tuple[LocusPoint, str]] = [(point, TURN) for point in locus.points]
        points += [(each.point, each.kind.value) for each in locus.codim2_points if each.kind in _CORNERS]
        best, event = max(points, key=lambda each: abs(each[0].values[1] - here))
        first, second = best.values
        if event == TURN:
            corrector = start_locus(lifted, *self.plane)[0].corrector

            def slope(correction: Correction) -> float:
                return float(corrector.tangent(correction.evaluation, best.tangent).tangent[-1])

            if (turn := zero_along(corrector, best.x, slope, _SECANT)) is not None:
                first, second = (turn.x[-2:] * corrector.scales[-2:]).tolist()
        return (first, self._value(second)), event


def _inwards(locus: Locus) -> Locus:
    """Return the half of the locus that leads into the gap; the other half leaves it at the start and ends at once."""
    begin, end = locus.ends
    if begin.reason is LocusEndReason.START:
        return locus
    points, codim2 = locus.points[::-1], locus.codim2_points[::-1]
    return replace(locus, points=points, codim2_points=codim2, ends=(end, begin))
