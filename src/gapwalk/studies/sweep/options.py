"""How a sweep is driven: the values, the ways, the starts, and how long each motion is let settle."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from gapwalk.errors import ModelError
from gapwalk.studies.sweep.transient import Patience

_MOST = 100_000_000  # states that are kept


class Way(StrEnum):
    """How the values are visited."""

    UP = "up"
    """From the lowest to the highest, the state carried over."""
    DOWN = "down"
    """From the highest to the lowest, the state carried over."""
    AFRESH = "afresh"
    """At each value from the start again."""

    @property
    def number(self) -> int:
        """A number of its own, whatever other ways there are."""
        return list(Way).index(self)


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """How a sweep is driven.

    Parameters
    ----------
    steps
        Number of values, spread evenly over the range, both ends included.
    ways
        ``"up and down"``, ``"up"``, ``"down"``, or ``"afresh"``: at each value from the starts again. Any of them may
        be joined by "and".
    points
        Section points at each value: states a forcing period apart, once the transient has settled.
    starts
        How many: the first one is rest, the others are spread over the box of states. Or the states themselves, 2n
        numbers each.
    seed
        Of the starts and of the kicks: the same seed gives the same result.
    max_period
        Longest period, in forcing periods, that is told from a motion that is not periodic.
    patience
        How long a transient is let settle at each value.
    kick
        Size of a random disturbance at each value, in half-widths of the box of states. It does what noise does in a
        test rig: no motion stays on an unstable orbit for want of one. 0: none.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    steps: int = 500
    ways: str = "up and down"
    points: int = 100
    starts: int | tuple[tuple[float, ...], ...] = 1
    seed: int = 0
    max_period: int = 12
    patience: Patience = Patience()
    kick: float = 1e-7
    workers: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name, least in (("steps", 2), ("points", 2), ("seed", 0), ("max_period", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= {least}")
        if isinstance(self.starts, int) and (isinstance(self.starts, bool) or self.starts < 1):
            raise ModelError(f"starts is {self.starts!r}; it must be an integer >= 1, or a list of states")
        starts = self.starts if isinstance(self.starts, int) else len(self.starts)
        if (states := self.steps * self.points * starts) > _MOST:
            raise ModelError(
                f"steps is {self.steps:,}, with {self.points:,} points from {starts:,} starts: that makes {states:,} "
                f"states; {_MOST:,} can be kept"
            )
        if not self.starts:
            raise ModelError("starts is empty; name at least one state, or how many there are to be")
        if self.points <= self.max_period:
            raise ModelError(
                f"points is {self.points}; it must be more than max_period, {self.max_period}, so that a return is seen"
            )
        if not 0.0 <= self.kick <= 1e-2:
            raise ModelError(
                f"kick is {self.kick!r}; it must lie between 0 and 1e-2 (half-widths of the box of states)"
            )
        self.each_way()

    def each_way(self) -> tuple[Way, ...]:
        """The ways, in the order in which they are written."""
        words = [word.strip() for word in self.ways.split(" and ")]
        if not set(words) <= set(Way) or len(set(words)) < len(words):
            raise ModelError(
                f'ways is {self.ways!r}; write "up and down", "up", "down" or "afresh", or several joined by "and"'
            )
        return tuple(Way(word) for word in words)
