"""The members of a family, and the parameter in which they differ."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.model.system import System


class Place(NamedTuple):
    """Indices of a special point: of its member, of the branch in it, and of the point on the branch, all from 0.

    Examples
    --------
    >>> family.of_kind("fold")[0].places[0]
    Place(member=0, branch=0, special=0)
    """

    #: member, branch, special: The indices.
    member: int
    branch: int
    special: int


@dataclass(frozen=True)
class Member:
    """A member of a family: the branches at one value of the parameter in which members differ.

    Examples
    --------
    >>> member = family.members[0]
    >>> member.number, member.value, [name for name, branch in member.named]
    (0, 0.9, ['P1-1'])
    """

    number: int  #: Index of the member, from 0.
    value: float  #: Value of the parameter that differs.
    branches: tuple[Branch, ...] = ()  #: The branches; none if no first orbit was found.
    #: notes, failures: Remarks, and failures to walk a branch, in sentences.
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
        """Return all special points with their places."""
        for index, branch in enumerate(self.branches):
            for special_index, special in enumerate(branch.special_points):
                yield Place(self.number, index, special_index), special

    def __repr__(self) -> str:
        return f"Member({self.value:g}, {len(self.branches)} branches)"


_EXAMPLE = 'over = { "mean.q1" = [0.25, 0.3, 0.35] }'


@dataclass(frozen=True, slots=True)
class MemberParameter:
    """The parameters that differ from member to member, with their values.

    Raises
    ------
    ModelError
        If there are fewer than two members, lists of different lengths, or values that do not rise or fall throughout.

    Examples
    --------
    >>> over = gw.studies.MemberParameter.of({"stop.clearance": [0.9, 1.0]})
    >>> over.name, over.axis, over.at(1)
    ('stop.clearance', (0.9, 1.0), {'stop.clearance': 1.0})
    """

    #: Each parameter with its values, one for each member: what an engineer calls one quantity may change several
    #: coefficients.
    moved: tuple[tuple[str, tuple[float, ...]], ...]
    #: Name of the quantity that differs, if it is not one of the parameters (or a function of them), such as ``"Kb"``;
    #: by default the first of them.
    called: str = ""
    values: tuple[float, ...] = ()  #: Its values; by default those of the first parameter. They rise or fall.

    def __post_init__(self) -> None:
        if not self.moved:
            raise ModelError(f"over names no parameter; write one with its values, as in {_EXAMPLE}")
        if len({name for name, _ in self.moved}) < len(self.moved):
            raise ModelError("over names a parameter twice; leave one of them out")
        first, values = self.moved[0]
        if len(values) < 2:
            raise ModelError(f"over has {len(values)} values of {first}; a family needs at least two, as in {_EXAMPLE}")
        for name, others in self.moved[1:]:
            if len(others) != len(values):
                raise ModelError(
                    f"over has {len(others)} values of {name} and {len(values)} of {first}; each member needs one of "
                    "each"
                )
        if self.values and len(self.values) != len(values):
            raise ModelError(
                f"values has {len(self.values)} numbers, and over has {len(values)}; each member needs one"
            )
        if bool(self.called) != bool(self.values) and self.called != first:
            raise ModelError(
                "called and values belong together: what the family is over, and its value at each member, as in "
                'called = "Kb", values = [1.0, 1.5]'
            )
        if not all(math.isfinite(value) for value in self.axis):
            raise ModelError(f"over has {self.axis} of {self.name}; they must be finite numbers")
        steps = {math.copysign(1.0, b - a) if b != a else 0.0 for a, b in pairwise(self.axis)}
        if len(steps) > 1 or 0.0 in steps:
            raise ModelError(
                f"over has the values {', '.join(f'{value:g}' for value in self.axis)} of {self.name}; they must rise, "
                "or fall, from each member to the next: special points are joined from one to the next"
            )

    @classmethod
    def of(
        cls, over: MemberParameter | Mapping[str, Sequence[float]], called: str = "", values: Sequence[float] = ()
    ) -> MemberParameter:
        """Make it from a mapping of names to values.

        Parameters
        ----------
        over
            The parameters with their values; or a `MemberParameter`, which is returned.
        called
            Name of the quantity that differs.
        values
            Its values.
        """
        if isinstance(over, MemberParameter):
            return over
        moved = tuple((name, tuple(float(value) for value in given)) for name, given in over.items())
        return cls(moved, called, tuple(float(value) for value in values))

    @property
    def name(self) -> str:
        """Name of the quantity that the family is over."""
        return self.called or self.moved[0][0]

    @property
    def axis(self) -> tuple[float, ...]:
        """Value of that quantity at each member."""
        return self.values or self.moved[0][1]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that differ."""
        return tuple(name for name, _ in self.moved)

    def at(self, number: int) -> dict[str, float]:
        """Return the values of the parameters of one member, from 0.

        Parameters
        ----------
        number
            Index of the member, from 0.
        """
        return {name: values[number] for name, values in self.moved}

    def check(self, system: System, parameter: str, *, names_only: bool = False) -> None:
        """Raise a ModelError if the members of a family along a parameter cannot have these values.

        Parameters
        ----------
        system
            The system.
        parameter
            The parameter along which members are walked.
        names_only
            True to check the names, and not the values.
        """
        for name in self.names:
            try:
                system.structure.place(name)
            except ModelError as error:
                raise ModelError(f"over names {name!r}, but {error}") from None
        if parameter in self.names:
            raise ModelError(f"over has {parameter}, along which each member is walked; choose another one")
        pace = system.structure.pace
        if pace in self.names and len(self.moved) > 1:
            raise ModelError(
                f"over has {pace} beside other parameters; it must be alone there, because everything is scaled by it"
            )
        for number in () if names_only else range(len(self.axis)):
            try:
                system.at(self.at(number))
            except ModelError as error:
                where = f"{self.name} = {self.axis[number]:g}"
                raise ModelError(
                    "\n".join(f"over is refused at {where}: {line}" for line in str(error).splitlines())
                ) from None
