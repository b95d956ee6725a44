"""One member of a family: the branches of the system at one value of what differs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from gapwalk.bifurcation.branch import Branch, SpecialPoint


class Place(NamedTuple):
    """Which special point: the number of its member, of the branch there, and its own on the branch, all from 0."""

    member: int
    branch: int
    special: int


@dataclass(frozen=True)
class Member:
    """The branches at one value of what differs.

    Attributes
    ----------
    number
        Of the member, from 0.
    value
        Of what the family is over.
    branches
        The branches; none if no first orbit was found.
    notes, failures
        What else there is to say, and what could not be walked, in sentences.
    """

    number: int
    value: float
    branches: tuple[Branch, ...] = ()
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def named(self) -> Iterator[tuple[str, Branch]]:
        """The branches with their names, such as ``P2-1``: the first branch of period 2."""
        counts: Counter[int] = Counter()
        for branch in self.branches:
            counts[branch.period] += 1
            yield f"P{branch.period}-{counts[branch.period]}", branch

    @property
    def special_points(self) -> Iterator[tuple[Place, SpecialPoint]]:
        """All special points with their places."""
        for index, branch in enumerate(self.branches):
            for special_index, special in enumerate(branch.special_points):
                yield Place(self.number, index, special_index), special

    def __repr__(self) -> str:
        return f"Member({self.value:g}, {len(self.branches)} branches)"
