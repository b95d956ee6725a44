"""How basins are found."""

from __future__ import annotations

from dataclasses import dataclass, field

from gapwalk.attractors.attractor_catalogue import Effort
from gapwalk.errors import ModelError


@dataclass(frozen=True, slots=True)
class BasinOptions:
    """How basins are found.

    Parameters
    ----------
    longest
        The most forcing periods that a motion is followed before it is settled and classified by itself.
    max_period
        The longest period m of an orbit that is looked for.
    tries
        The most motions that are settled and classified one by one, with the exact flow.
    exact_borders
        Whether the label of every cell at a border between basins is found with the exact flow, and of those within two
        cells of a label that was wrong; otherwise those of `check` cells at borders are.
    check
        Random cells elsewhere whose label is found again with the exact flow: that many, and with `exact_borders` that
        many again, until none of the last ones is wrong.
    seed
        Of the choice of the states that are looked at first, and of those that are checked; and of random starts.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    longest: int = 3000
    max_period: int = 64
    tries: int = 48
    exact_borders: bool = True
    check: int = 1024
    seed: int = 0
    workers: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name, least in (("longest", 1), ("max_period", 1), ("tries", 1), ("check", 0), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")

    @property
    def borders(self) -> int | None:
        """How many labels at borders are found with the exact flow; None for all."""
        return None if self.exact_borders else self.check

    @property
    def effort(self) -> Effort:
        """What `explore` needs of it."""
        return Effort(self.longest, self.max_period, self.tries)
