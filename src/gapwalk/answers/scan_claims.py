"""Claims about results, as descriptions make them: a kind of motion at a place, a special point in a range.

A claim holds or not for one system; `gapwalk.studies.scan_study` tries many. It says what must be computed for it: the
settled motions of many starts (`place`), or the branch of a walk (`Course`), which several claims may share.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from gapwalk.attractors.regimes import Regime
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds import Kind
from gapwalk.errors import ModelError
from gapwalk.model.problems import given

Motion = tuple[int, int]
"""A `Regime` as a number, and the period of a periodic motion."""

_ROUNDING = 1e-9  # of the ends of a walk
_PERIOD = re.compile(r"period ([1-9]\d*)")
_KINDS = {"periodic": Regime.PERIODIC, "quasi-periodic": Regime.QUASI_PERIODIC, "chaotic": Regime.CHAOTIC}


@dataclass(frozen=True, slots=True)
class MotionClaim:
    """A claim that motions settle on a kind of motion.

    Examples
    --------
    >>> gw.ask.MotionClaim("period 3", {"frequency": 0.63}).words
    'period 3 at frequency = 0.63'
    """

    motion: str  #: ``"period 3"`` (of the excitation), ``"periodic"``, ``"quasi-periodic"`` or ``"chaotic"``.
    #: Values of parameters, by name, at which it is said.
    at: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Least share of the starts that must settle on it; at 0, one start is enough, and 1 means that there is nothing
    #: else.
    share: float = 0.0

    def __post_init__(self) -> None:
        if self.motion not in _KINDS and not _PERIOD.fullmatch(self.motion):
            raise ModelError(
                f'motion is {given(self.motion)}; write "period 3", "periodic", "quasi-periodic" or "chaotic"'
            )
        if not 0.0 <= self.share <= 1.0:
            raise ModelError(f"share is {self.share!r}; it must be from 0 (one start is enough) to 1 (all of them)")

    @property
    def words(self) -> str:
        """The claim in words."""
        only = "" if not self.share else "only " if self.share == 1.0 else f"at least {self.share:.0%} "
        return f"{only}{self.motion}{_at_words(self.at)}"

    @property
    def varied(self) -> frozenset[str]:
        """Parameters whose values the claim gives."""
        return frozenset(self.at)

    def matches(self, motion: Motion) -> bool:
        """Return True if a settled motion is of this kind."""
        regime, period = motion
        if found := _PERIOD.fullmatch(self.motion):
            return regime == Regime.PERIODIC and period == int(found[1])
        return regime == _KINDS[self.motion]

    def judge(self, motions: Sequence[Motion]) -> tuple[bool, float]:
        """Return whether the claim holds, and the share of starts that settle on this kind of motion.

        Parameters
        ----------
        motions
            The settled motions of all starts.

        Returns
        -------
        holds : bool
            Whether it holds.
        share : float
            The share.
        """
        share = sum(map(self.matches, motions)) / len(motions)
        return share > 0.0 and share >= self.share, share


@dataclass(frozen=True, slots=True)
class Course:
    """A walk that claims rest on."""

    #: parameter, begin, end: The parameter, and the range over which the branch is walked, from the first value to the
    #: second.
    parameter: str
    begin: float
    end: float
    period: int = 1  #: Number m of forcing periods after which its orbits repeat.
    at: tuple[tuple[str, float], ...] = ()  #: Values of other parameters, by name and in the order of their names.


@dataclass(frozen=True, slots=True)
class PointClaim:
    """A claim that a branch has a special point in a range of a parameter, or has none there.

    Examples
    --------
    >>> gw.ask.PointClaim("flip", "frequency", 0.62, 0.85, over=(2.0, 0.5)).words
    'flip at frequency from 0.62 to 0.85'
    """

    kind: Kind  #: Kind of special point, such as ``"flip"``.
    #: parameter, low, high: The parameter, and the range in which the point lies.
    parameter: str
    low: float
    high: float
    absent: bool = False  #: True if there is no such point in the range.
    #: Range over which the branch is walked, from the first value to the second; by default from `high` to `low`.
    over: tuple[float, float] | None = None
    period: int = 1  #: Number m of forcing periods after which the orbits of the branch repeat.
    #: Values of other parameters, by name, at which it is said.
    at: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", Kind.named(self.kind))
        if not self.low < self.high:
            raise ModelError(f"the range of a claim is from {self.low:g} to {self.high:g}; write the lower end first")
        first, last = min(self.walk), max(self.walk)
        if not (first <= self.low and self.high <= last):
            raise ModelError(
                f"over is {list(self.walk)}; the walk must cover the range of the claim, {self.low:g} to {self.high:g}"
            )
        if self.parameter in self.at:
            raise ModelError(f"at gives a value of {self.parameter}, over which the branch is walked; leave it out")

    @property
    def walk(self) -> tuple[float, float]:
        """Range over which the branch is walked."""
        return (self.high, self.low) if self.over is None else self.over

    @property
    def course(self) -> Course:
        """The walk on which it rests."""
        return Course(self.parameter, *self.walk, self.period, tuple(sorted(self.at.items())))

    @property
    def words(self) -> str:
        """The claim in words."""
        of = f" of period {self.period}" if self.period > 1 else ""
        no = "no " if self.absent else ""
        return f"{no}{self.kind}{of} at {self.parameter} from {self.low:g} to {self.high:g}{_at_words(self.at)}"

    @property
    def varied(self) -> frozenset[str]:
        """Parameters whose values the claim gives."""
        return frozenset(self.at) | {self.parameter}

    def judge(self, branch: Branch) -> tuple[bool | None, float]:
        """Return whether the claim holds, and the number of such points; None if the walk did not come that far.

        Returns
        -------
        holds : bool or None
            Whether it holds; None if that is unknown.
        count : float
            The number of points.
        """
        found = sum(self.low <= point.value <= self.high for point in branch.special(self.kind))
        if found:
            return not self.absent, float(found)
        # what has not been walked may hold a point, or none
        rounding = _ROUNDING * max(abs(self.low), abs(self.high))
        covers = branch.values.min() <= self.low + rounding and branch.values.max() >= self.high - rounding
        return (self.absent if covers else None), 0.0


AnyClaim = MotionClaim | PointClaim
"""A claim of any kind."""


def _at_words(at: Mapping[str, float]) -> str:
    return f" at {', '.join(f'{name} = {value:g}' for name, value in at.items())}" if at else ""
