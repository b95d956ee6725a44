"""The diagram: a tree of branches over one parameter, each once, with parents, children and cascades."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.bifurcation.meeting import meets, parent_flip
from gapwalk.bifurcation.search.result import SearchResult
from gapwalk.continuation.walk import End, EndReason
from gapwalk.notebook.shown import Shown
from gapwalk.orbit.equation import Method
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True)
class Origin:
    """Where a branch begins on another: the other's name, and which of its special points."""

    parent: str
    special: int


@dataclass(frozen=True)
class Limb:
    """One branch of a diagram and its place in the tree.

    Attributes
    ----------
    name
        Such as ``P2-3``: the third branch of period 2.
    branch
        The branch.
    begins
        Where it begins on another branch; None for one that was found by itself.
    joins
        Where it ends on another branch; None where it ends otherwise.
    """

    name: str
    branch: Branch
    begins: Origin | None = None
    joins: Origin | None = None

    @property
    def period(self) -> int:
        """m, forcing periods of its orbits."""
        return self.branch.period

    @property
    def origins(self) -> tuple[Origin, ...]:
        """The one or two special points of other branches that it is attached to."""
        return tuple(origin for origin in (self.begins, self.joins) if origin is not None)


@dataclass(frozen=True)
class Cascade:
    """Successive period doublings: flips that follow one another, all one way along the parameter.

    Each flip lies on the child that leaves the flip before it, and is the first that is met along it from there. Where
    the next one lies the other way, the child has turned round on its way to it: there a cascade ends, and another may
    begin. Only so can the intervals between the flips shrink by a constant ratio.

    Attributes
    ----------
    limbs
        Names of the branches on which the flips lie.
    values
        The parameter at each flip.
    """

    limbs: tuple[str, ...]
    values: tuple[float, ...]

    @property
    def ratios(self) -> tuple[float, ...]:
        """Ratios of successive intervals between the flips; they tend to 4.669... (Feigenbaum 1978)."""
        steps = np.diff(self.values)
        return tuple(float(ratio) for ratio in steps[:-1] / steps[1:])


@dataclass(frozen=True, eq=False)
class Diagram(Shown):
    """All branches that were found over a range of one parameter.

    Attributes
    ----------
    parameter
        Name of the parameter.
    within
        The range.
    limbs
        The branches, in the order in which they were accepted.
    complete
        False if the work was stopped before its end.
    notes
        What else there is to say, in sentences: what a search has covered, which limit was met.
    failures
        What could not be walked, in sentences.
    search
        What the search for branches that are attached to no other has met; None if there was none.
    max_period
        The longest period of branches that were asked for; None where that is not told, as of a single branch.
    """

    parameter: str
    within: tuple[float, float]
    limbs: tuple[Limb, ...] = ()
    complete: bool = False
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    search: SearchResult | None = None
    max_period: int | None = None

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches."""
        return tuple(limb.branch for limb in self.limbs)

    def __getitem__(self, name: str) -> Limb:
        """The limb of one name; a KeyError if there is none."""
        for limb in self.limbs:
            if limb.name == name:
                return limb
        raise KeyError(name)

    def children(self, name: str) -> tuple[Limb, ...]:
        """The limbs that begin or end on the branch of one name."""
        return tuple(limb for limb in self.limbs if any(origin.parent == name for origin in limb.origins))

    def attached(self, name: str, special: int) -> tuple[Limb, ...]:
        """The limbs that begin or end at one special point, by its place on the branch of one name."""
        return tuple(limb for limb in self.limbs if Origin(name, special) in limb.origins)

    def depth(self, limb: Limb) -> int:
        """How many branches lie between a limb and one that was found by itself."""
        return 0 if limb.begins is None else 1 + self.depth(self[limb.begins.parent])

    @cached_property
    def cascades(self) -> tuple[Cascade, ...]:
        """All successions of three or more flips, longest first; none is a part of another."""
        chains = [
            _chain(self, Origin(limb.name, index))
            for limb in self.limbs
            for index, special in enumerate(limb.branch.special_points)
            if special.kind is Kind.FLIP
        ]
        found = [
            _cascade(self, chain)
            for chain in chains
            if len(chain) >= 3 and not any(set(chain) < set(other) for other in chains)
        ]
        return tuple(sorted(found, key=lambda cascade: -len(cascade.values)))

    def with_branch(self, branch: Branch, begins: Origin | None = None, method: Method | None = None) -> Diagram:
        """The diagram with one more branch, its end tied to the special point at which it joins another.

        Parameters
        ----------
        branch
            The branch.
        begins
            Where it begins on another branch.
        method
            How its orbits were found.
        """
        count = sum(limb.period == branch.period for limb in self.limbs) + 1
        limb = Limb(f"P{branch.period}-{count}", branch, begins)
        if branch.ends[-1].reason is EndReason.JOINED:
            limb = _tied(self, limb, method)
        return replace(self, limbs=(*self.limbs, limb))

    def plot(self, measure: str = "half", **options: Any):
        """Draw the diagram: `measure` over the parameter, and the stroboscopic states. Returns the figure.

        Options are those of `gapwalk.plot.draw` and `gapwalk.plot.diagrams.draw_diagram`; with ``ax=...`` only the
        states are drawn.
        """
        from gapwalk.plot import draw

        return draw(self, measure, **options)

    def __repr__(self) -> str:
        low, high = self.within
        periods = sorted({limb.period for limb in self.limbs})
        counts = ", ".join(f"{sum(limb.period == m for limb in self.limbs)} of period {m}" for m in periods)
        return f"Diagram({self.parameter} from {low:g} to {high:g}, branches: {counts or 'none'})"


def is_attached(diagram: Diagram, origin: Origin, needed: int = 1) -> bool:
    """Whether as many accepted branches as there can be already begin or end at a special point."""
    return sum(each == origin for limb in diagram.limbs for each in limb.origins) >= needed


def _tied(diagram: Diagram, limb: Limb, method: Method | None) -> Limb:
    """The limb with its end tied to the special point that it joins, if that is on a known branch.

    It is tied where both have one and the same orbit, never to what is merely near: the branch that it joins may not
    be known up to there. If it ends just before the flip that it joins, that is located first.
    """
    branch = limb.branch
    origin, value = _shared(diagram, limb, branch.points[-1].orbit), branch.ends[-1].value
    if origin is None and (flip := parent_flip(branch, diagram.within, method)) is not None:
        origin, value = _shared(diagram, limb, flip), flip.system[branch.parameter]
    detail = branch.ends[-1].detail
    if origin is not None:
        special = diagram[origin.parent].branch.special_points[origin.special]
        value, detail = special.value, f"{origin.parent}, at its {special.kind.value}"
    end = End(EndReason.JOINED, value, detail)
    return replace(limb, branch=replace(branch, ends=(*branch.ends[:-1], end)), joins=origin)


def _shared(diagram: Diagram, limb: Limb, orbit: Orbit) -> Origin | None:
    """The flip of a parent, or the branch point of a branch of equal period, that has an orbit; not the limb's own."""
    kinds = {limb.period: Kind.BRANCH_POINT, limb.period / 2: Kind.FLIP}
    candidates = (
        (Origin(other.name, index), special)
        for other in diagram.limbs
        for index, special in enumerate(other.branch.special_points)
        if special.kind is kinds.get(other.period)
    )
    shared = [
        (abs(special.value - orbit.system[diagram.parameter]), origin)
        for origin, special in candidates
        if origin != limb.begins and meets(orbit, special, diagram.parameter)
    ]
    return min(shared, key=lambda each: each[0])[1] if shared else None


def _chain(diagram: Diagram, flip: Origin) -> list[Origin]:
    """The flips of a cascade from one flip on: the next one along each child, as long as all go one way."""
    chain = [flip]
    while (following := _next_flip(diagram, chain[-1])) is not None:
        values = [_value(diagram, origin) for origin in (*chain[-2:], following)]
        steps = np.diff(values)
        if steps[0] * steps[-1] <= 0.0:
            break
        chain.append(following)
    return chain


def _next_flip(diagram: Diagram, flip: Origin) -> Origin | None:
    """The first flip along the branch of twice the period that leaves a flip."""
    period = 2 * diagram[flip.parent].period
    child = next((limb for limb in diagram.attached(flip.parent, flip.special) if limb.period == period), None)
    if child is None:
        return None
    flips = [i for i, special in enumerate(child.branch.special_points) if special.kind is Kind.FLIP]
    return Origin(child.name, flips[0] if child.begins == flip else flips[-1]) if flips else None


def _cascade(diagram: Diagram, chain: list[Origin]) -> Cascade:
    return Cascade(tuple(flip.parent for flip in chain), tuple(_value(diagram, flip) for flip in chain))


def _value(diagram: Diagram, origin: Origin) -> float:
    """The parameter at a special point of a branch."""
    return diagram[origin.parent].branch.special_points[origin.special].value
