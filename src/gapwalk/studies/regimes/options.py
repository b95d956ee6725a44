"""How a regime map is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from gapwalk.attractors.regime_judge import RegimeOptions
from gapwalk.errors import ModelError
from gapwalk.studies.regimes.job import Places, Plan


class Carry(StrEnum):
    """Where the motion at a cell starts."""

    NO = "no"
    """At each cell from the same state."""
    UP = "up"
    """From where the motion came to at the cell before it, with the first parameter rising."""
    DOWN = "down"
    """The same with the first parameter falling."""


@dataclass(frozen=True, slots=True)
class RegimeMapOptions:
    """How a regime map is made.

    Parameters
    ----------
    carry
        Where the motions start: ``"no"``: all from the same state. ``"up"`` or ``"down"``: the state is carried over
        along the first parameter, as in a sweep.
    judging
        How regimes are told apart.
    check
        Cells that are settled and classified again with the exact flow.
    seed
        Of the choice of those cells.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    carry: Carry = Carry.NO
    judging: RegimeOptions = field(default_factory=RegimeOptions)
    check: int = 64
    seed: int = 0
    workers: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.carry not in list(Carry):
            raise ModelError(f'carry is {self.carry!r}; write "no", "up" or "down"')
        object.__setattr__(self, "carry", Carry(self.carry))
        for name in ("check", "seed"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 0")


def places_of(plan: Plan, carry: Carry) -> list[Places]:
    """The cells of a map in chunks."""
    return plan.cells() if carry is Carry.NO else plan.lines(rising=carry is Carry.UP)
