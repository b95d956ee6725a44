"""Diagram: a tree of branches over one parameter, each once, with parents, children and cascades.

Method: docs/numerics/notes/continuation.md
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.isolated import SearchResult
from gapwalk.bifurcation.orbit_on_branch import junction_nearby, meets
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import SummaryParts, Tree, remarks, summarizes


@dataclass(frozen=True)
class Origin:
    """Special point at which a branch begins on another: the name of that branch, and the index of the point."""

    parent: str  #: Name of that branch.
    special: int  #: Index of the special point, from 0.


@dataclass(frozen=True)
class DiagramBranch:
    """Member of a diagram: one branch and its place in the tree."""

    name: str  #: Name such as ``P2-3``: the third branch of period 2.
    branch: Branch  #: The branch.
    begins: Origin | None = None  #: Its beginning on another branch; None for a branch that was found independently.
    joins: Origin | None = None  #: Its end on another branch; None if it ends otherwise.

    @property
    def period(self) -> int:
        """m, number of forcing periods of its orbits."""
        return self.branch.period

    @property
    def origins(self) -> tuple[Origin, ...]:
        """One or two special points of other branches to which it is attached."""
        return tuple(origin for origin in (self.begins, self.joins) if origin is not None)


@dataclass(frozen=True)
class Cascade:
    """Successive period doublings: flips that follow one another in one direction along the parameter.

    Each flip lies on the child that begins at the flip before it, and is the first flip along it from there. If the
    next flip lies in the opposite direction, the child has turned back before reaching it. There the cascade ends, and
    another may begin. Only with this rule can the intervals between the flips shrink by a constant ratio.
    """

    members: tuple[str, ...]  #: Names of the branches on which the flips lie.
    values: tuple[float, ...]  #: The parameter at each flip.

    @property
    def ratios(self) -> tuple[float, ...]:
        """Ratios of successive intervals between the flips; they tend to 4.669... (Feigenbaum 1978)."""
        steps = np.diff(self.values)
        return tuple(float(ratio) for ratio in steps[:-1] / steps[1:])


@dataclass(frozen=True, eq=False)
class Diagram(Shown):
    """All branches that were found over a range of one parameter."""

    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: Limits of the range.
    members: tuple[DiagramBranch, ...] = ()  #: Members of the diagram, in the order in which they were accepted.
    complete: bool = False  #: False if the computation was stopped before its end.
    notes: tuple[str, ...] = ()  #: Remarks, as sentences: what the search covered, which limit was reached.
    failures: tuple[str, ...] = ()  #: Branches that could not be walked, as sentences.
    search: SearchResult | None = None  #: Result of the search for isolated branches; None if there was none.
    #: The longest period of branches that was requested; None if it does not apply, as for a single branch.
    max_period: int | None = None

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Branches of all members."""
        return tuple(member.branch for member in self.members)

    def __getitem__(self, name: str) -> DiagramBranch:
        """Return the member with a name; raise a KeyError if there is none."""
        for member in self.members:
            if member.name == name:
                return member
        raise KeyError(name)

    def _special_at(self, origin: Origin) -> SpecialPoint:
        """Return the special point at which a branch begins or ends."""
        return self[origin.parent].branch.special_points[origin.special]

    def children(self, name: str) -> tuple[DiagramBranch, ...]:
        """Return the members that begin or end on the branch of one name, such as ``P1-1``."""
        return tuple(member for member in self.members if any(origin.parent == name for origin in member.origins))

    def attached(self, name: str, special: int) -> tuple[DiagramBranch, ...]:
        """Return the members that begin or end at a special point: index, from 0, on the branch of one name."""
        return tuple(member for member in self.members if Origin(name, special) in member.origins)

    def depth(self, member: DiagramBranch) -> int:
        """Return the number of branches between a member and the branch found on its own from which it descends."""
        return 0 if member.begins is None else 1 + self.depth(self[member.begins.parent])

    @cached_property
    def cascades(self) -> tuple[Cascade, ...]:
        """All sequences of three or more flips, longest first; none is contained in another."""
        chains = [
            _chain(self, Origin(member.name, index))
            for member in self.members
            for index, special in enumerate(member.branch.special_points)
            if special.kind is Kind.FLIP
        ]
        found = [
            Cascade(tuple(flip.parent for flip in chain), tuple(self._special_at(flip).value for flip in chain))
            for chain in chains
            if len(chain) >= 3 and not any(set(chain) < set(other) for other in chains)
        ]
        return tuple(sorted(found, key=lambda cascade: -len(cascade.values)))

    def with_branch(self, branch: Branch, begins: Origin | None = None, method: Method | None = None) -> Diagram:
        """Return the diagram with one more branch, from its origin; its end is linked to where it joins another."""
        count = sum(member.period == branch.period for member in self.members) + 1
        member = DiagramBranch(f"P{branch.period}-{count}", branch, begins)
        if branch.ends[-1].reason is EndReason.JOINED:
            member = _tied(self, member, method)
        return replace(self, members=(*self.members, member))

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the tree of the branches, the period-doubling cascades, notes and failures, for the terminal."""
        # A branch that connects two others is listed below the one on which it begins.
        tree = Tree(self._contents())
        nodes: dict[str, Tree] = {}
        for member in self.members:
            nodes[member.name] = node = Tree(self._member_words(member))
            (tree if member.begins is None else nodes[member.begins.parent]).children.append(node)
        yield tree
        if self.cascades:
            yield "period-doubling cascades"
        for cascade in self.cascades:
            values = ", ".join(f"{value:.10g}" for value in cascade.values)
            ratios = ", ".join(f"{ratio:.4g}" for ratio in cascade.ratios)
            yield f"  {' → '.join(cascade.members)}: {values}; ratios of the steps {ratios}"
        yield from remarks(self.notes, self.failures)

    @property
    def _counts(self) -> str:
        """Numbers of branches of each period."""
        periods = sorted(Counter(member.period for member in self.members).items())
        return ", ".join(f"{count} of period {period}" for period, count in periods)

    def _contents(self) -> str:
        """Return range and numbers of branches and points in a line."""
        low, high = self.within
        units = self.branches[0].system.units if self.branches else None
        over = f"{parameter_symbol(self.parameter, units)} from {low:.10g} to {high:.10g}"
        if not self.members:
            return f"{over}: no branches"
        points = sum(len(branch.points) for branch in self.branches)
        special = sum(len(branch.special_points) for branch in self.branches)
        return f"{over}: {len(self.members)} branches, {self._counts}; {points} points, {special} special points"

    def _member_words(self, member: DiagramBranch) -> str:
        """Return range, points, and both ends of a branch, in two lines."""
        values, (first, last) = member.branch.values, member.branch.ends
        found = "" if member is self.members[0] else "found by the search; "
        if member.begins is not None:
            begin = f"begins at {self._place(member.begins)}"
        elif first.reason is EndReason.START:
            begin = f"{found}begins at {first.value:.10g}"
        else:
            begin = f"{found}ends at {first.value:.10g}: {first.reason_words}"
        end = f"{last.value:.10g}: {last.reason_words}" if member.joins is None else self._place(member.joins)
        counts = member.branch.counts
        return f"{member.name}  {values.min():.8g} to {values.max():.8g}; {counts}\n{begin}; ends at {end}"

    def _place(self, origin: Origin) -> str:
        special = self._special_at(origin)
        return f"{special.value:.10g}, a {special.kind.value.replace('-', ' ')} of {origin.parent}"

    def __repr__(self) -> str:
        low, high = self.within
        return f"Diagram({self.parameter} from {low:g} to {high:g}, branches: {self._counts or 'none'})"


def is_attached(diagram: Diagram, origin: Origin, needed: int = 1) -> bool:
    """Return True if at least `needed` accepted branches already begin or end at a special point."""
    return sum(each == origin for member in diagram.members for each in member.origins) >= needed


def _tied(diagram: Diagram, member: DiagramBranch, method: Method | None) -> DiagramBranch:
    """Return the member with its end linked to the special point that it joins, if that lies on a known branch."""
    # The end is linked only where both have the same orbit, never by mere closeness, because the joined branch may not
    # be known up to there. If the branch ends just before the point at which it joins, that is located first.
    branch = member.branch
    origin, value = _shared(diagram, member, branch.points[-1].orbit), branch.ends[-1].value
    if origin is None and (orbit := junction_nearby(branch, diagram.within, method)) is not None:
        origin, value = _shared(diagram, member, orbit), orbit.system[branch.parameter]
    detail = branch.ends[-1].detail
    if origin is not None:
        special = diagram._special_at(origin)
        value, detail = special.value, f"{origin.parent}, at its {special.kind.value}"
    end = End(EndReason.JOINED, value, detail)
    return replace(member, branch=replace(branch, ends=(*branch.ends[:-1], end)), joins=origin)


def _shared(diagram: Diagram, member: DiagramBranch, orbit: Orbit) -> Origin | None:
    """Return the point of a branch at which one of this period joins, with this orbit; not the start."""
    candidates = (
        (Origin(other.name, index), special)
        for other in diagram.members
        for index, special in enumerate(other.branch.special_points)
        if (special.ways and other.period * special.kind.times == member.period)
        or (special.doubles and 2 * other.period == member.period)
    )
    shared = [
        (abs(special.value - orbit.system[diagram.parameter]), origin)
        for origin, special in candidates
        if origin != member.begins and meets(orbit, special, diagram.parameter)
    ]
    return min(shared, key=lambda each: each[0])[1] if shared else None


def _chain(diagram: Diagram, flip: Origin) -> list[Origin]:
    """Return the flips of a cascade from one flip on: the next one on each child, while the direction is the same."""
    chain = [flip]
    while (following := _next_flip(diagram, chain[-1])) is not None:
        steps = np.diff([diagram._special_at(origin).value for origin in (*chain[-2:], following)])
        if steps[0] * steps[-1] <= 0.0:
            break
        chain.append(following)
    return chain


def _next_flip(diagram: Diagram, flip: Origin) -> Origin | None:
    """Return the first flip along the branch of twice the period that begins at a flip."""
    period = 2 * diagram[flip.parent].period
    child = next((member for member in diagram.attached(flip.parent, flip.special) if member.period == period), None)
    if child is None:
        return None
    flips = [i for i, special in enumerate(child.branch.special_points) if special.kind is Kind.FLIP]
    return Origin(child.name, flips[0] if child.begins == flip else flips[-1]) if flips else None
