"""What differs from member to member of a family: one parameter, or several that move together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from gapwalk.errors import ModelError
from gapwalk.model.system import System

_EXAMPLE = 'over = { "mean.q1" = [0.25, 0.3, 0.35] }'


@dataclass(frozen=True, slots=True)
class MemberParameter:
    """The parameters that differ from member to member, with their values.

    Parameters
    ----------
    moved
        Each parameter with its values, one for each member: what an engineer calls one quantity may change several
        coefficients.
    called
        What the family is over, where that is none of the parameters (or a function of them), such as ``"Kb"``; by
        default the first of them.
    values
        Its values; by default those of the first parameter. They rise or fall.

    Raises
    ------
    ModelError
        If there are fewer than two members, lists of different lengths, or values that do not rise or fall throughout.
    """

    moved: tuple[tuple[str, tuple[float, ...]], ...]
    called: str = ""
    values: tuple[float, ...] = ()

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
        _check_steps(self.name, self.axis)

    @classmethod
    def of(
        cls, over: MemberParameter | Mapping[str, Sequence[float]], called: str = "", values: Sequence[float] = ()
    ) -> MemberParameter:
        """What is given as a mapping of names to values."""
        if isinstance(over, MemberParameter):
            return over
        moved = tuple((name, tuple(float(value) for value in given)) for name, given in over.items())
        return cls(moved, called, tuple(float(value) for value in values))

    @property
    def name(self) -> str:
        """What the family is over."""
        return self.called or self.moved[0][0]

    @property
    def axis(self) -> tuple[float, ...]:
        """Its value at each member."""
        return self.values or self.moved[0][1]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that differ."""
        return tuple(name for name, _ in self.moved)

    def at(self, number: int) -> dict[str, float]:
        """The values of the parameters of one member, from 0."""
        return {name: values[number] for name, values in self.moved}

    def check(self, system: System, parameter: str, *, names_only: bool = False) -> None:
        """A ModelError if the members of a family of a system along a parameter cannot have these values."""
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
                f"over has {pace} beside other parameters; it can stand there alone: everything is scaled by it"
            )
        for number in () if names_only else range(len(self.axis)):
            try:
                system.at(self.at(number))
            except ModelError as error:
                where = f"{self.name} = {self.axis[number]:g}"
                raise ModelError(
                    "\n".join(f"over is refused at {where}: {line}" for line in str(error).splitlines())
                ) from None


def _check_steps(name: str, axis: tuple[float, ...]) -> None:
    if not all(math.isfinite(value) for value in axis):
        raise ModelError(f"over has {axis} of {name}; they must be finite numbers")
    steps = {math.copysign(1.0, b - a) if b != a else 0.0 for a, b in pairwise(axis)}
    if len(steps) > 1 or 0.0 in steps:
        raise ModelError(
            f"over has the values {', '.join(f'{value:g}' for value in axis)} of {name}; they must rise, or fall, from "
            "each member to the next: special points are joined from one to the next"
        )
