"""Claims about a system, as descriptions of experiments make them; a scan judges them for many variations.

A claim says what must be computed for it: settled motions of many starts at some values of parameters, or branches of
walks (`Course`), which several claims may share. It holds, does not hold, or is unknown, and states what was found.

Method: docs/numerics/scan.md
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from gapwalk.attractors.regimes import Regime
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds import Kind
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.model.bounds import check_fields
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.system import System
from gapwalk.orbit.floquet import Instability


class Course(NamedTuple):
    """A walk that claims rest on."""

    #: parameter, begin, end: The parameter, and the range over which the branch is walked, from the first value to the
    #: second.
    parameter: str
    begin: float
    end: float
    period: int = 1  #: Number m of forcing periods after which its orbits repeat.
    at: tuple[tuple[str, float], ...] = ()  #: Values of other parameters, by name and in the order of their names.
    doubled: bool = False  #: True if the branches of twice the period that leave it are walked too.


class Settled(NamedTuple):
    """What a start settles on: its `Regime` as a number, the period of a periodic motion, and its contact pattern."""

    regime: int
    period: int
    pattern: str = ""


Verdict = tuple[bool | None, float]
"""Whether a claim holds (None: unknown), and what was found."""

_ROUNDING = 1e-9  # of the ends of a walk
_GRID = 200  # values of the parameter at which two responses are compared
_PERIOD = re.compile(r"period ([1-9]\d*)")
_KINDS = {"periodic": Regime.PERIODIC, "quasi-periodic": Regime.QUASI_PERIODIC, "chaotic": Regime.CHAOTIC}


@dataclass(frozen=True, slots=True)
class MotionClaim:
    """A claim that the system settles on a motion of one kind, such as a motion of period 3.

    Examples
    --------
    >>> gw.ask.MotionClaim("period 3", {"frequency": 0.63}).words
    'period 3 at frequency = 0.63'
    """

    motion: str  #: ``"period 3"`` (of the excitation), ``"periodic"``, ``"quasi-periodic"`` or ``"chaotic"``.
    #: Values of parameters, by name, for which the claim is made.
    at: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Least share of the starts that must settle on such a motion; at 0, one start is enough, and 1 means that all
    #: starts settle on it.
    share: Annotated[float, Ge(0), Le(1)] = 0.0
    #: Contact pattern that a periodic motion must have, as `gapwalk.Orbit.pattern` writes it: ``"4+/1-"`` for four
    #: impacts on the positive side and one on the other.
    hits: str = ""
    says: str = ""  #: The claim in your own words, for tables and pictures.

    def __post_init__(self) -> None:
        if self.motion not in _KINDS and not _PERIOD.fullmatch(self.motion):
            raise ModelError(
                f'motion is {given(self.motion)}; write "period 3", "periodic", "quasi-periodic" or "chaotic"'
            )
        if self.hits and self.motion in ("quasi-periodic", "chaotic"):
            raise ModelError(f"a {self.motion} motion has no pattern that repeats; leave hits out, or write periodic")
        check_fields(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        only = "" if not self.share else "only " if self.share == 1.0 else f"at least {self.share:.0%} "
        return f"{only}{self.motion}{f' with impacts {self.hits}' if self.hits else ''}{_at_words(self.at)}"

    @property
    def walked(self) -> frozenset[str]:
        """Parameters over which branches are walked; none, as this claim needs no branch."""
        return frozenset()

    def matches(self, motion: Settled) -> bool:
        """Return True if a settled motion is of this kind."""
        if found := _PERIOD.fullmatch(self.motion):
            is_kind = motion.regime == Regime.PERIODIC and motion.period == int(found[1])
        else:
            is_kind = motion.regime == _KINDS[self.motion]
        return is_kind and self.hits in ("", motion.pattern)

    def judge(self, motions: Sequence[Settled]) -> Verdict:
        """Return whether the claim holds, and the share of starts that settle on this kind of motion."""
        share = sum(map(self.matches, motions)) / len(motions)
        return share > 0.0 and share >= self.share, share

    @staticmethod
    def amount_words(amount: float) -> str:
        """Describe what was found."""
        return f"{amount:.0%} of starts" if amount else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Walked:
    """What all claims about branches have: the range of a parameter, and the walk over it."""

    parameter: str  #: The parameter of the branch.
    #: low, high: The range that the claim is about.
    low: float
    high: float
    #: Range over which the branch is walked, from the first value to the second; by default from `high` to `low`.
    over: tuple[float, float] | None = None
    #: Number m of forcing periods after which the orbits of the branch repeat. Two numbers, such as ``(1, 2)``, mean
    #: the branch together with the branches of twice the period that begin on it.
    period: int | tuple[int, int] = 1
    #: Values of other parameters, by name, for which the claim is made.
    at: Mapping[str, float] = field(default_factory=dict, hash=False)
    says: str = ""  #: The claim in your own words, for tables and pictures.

    def __post_init__(self) -> None:
        periods = self._periods
        if min(periods) < 1 or periods not in ((periods[0],), (periods[0], 2 * periods[0])):
            raise ModelError(
                f"period is {self.period}; write a number of forcing periods, or one and its double: [1, 2]"
            )
        if not self.low < self.high:
            raise ModelError(f"the range of a claim is from {self.low:g} to {self.high:g}; write the lower end first")
        first, last = min(self.walk), max(self.walk)
        if not (first <= self.low and self.high <= last):
            raise ModelError(
                f"over is {list(self.walk)}; the walk must cover the range of the claim, {self.low:g} to {self.high:g}"
            )
        if self.parameter in self.at:
            raise ModelError(f"at gives a value of {self.parameter}, over which the branch is walked; leave it out")
        check_fields(self)

    @property
    def walk(self) -> tuple[float, float]:
        """Range over which the branch is walked."""
        return (self.high, self.low) if self.over is None else self.over

    @property
    def walked(self) -> frozenset[str]:
        """The parameter over which the branch of the claim is walked; a scan may not vary it."""
        return frozenset((self.parameter,))

    @property
    def models(self) -> tuple[Mapping[str, float], ...]:
        """Values of parameters of each model whose branch is needed."""
        return (self.at,)

    @property
    def courses(self) -> tuple[Course, ...]:
        """The walks on which it rests."""
        longest = max(self._periods)
        doubled = longest % 2 == 0 and self._leaves_parent
        period = longest // 2 if doubled else longest
        return tuple(
            Course(self.parameter, *self.walk, period, tuple(sorted(at.items())), doubled) for at in self.models
        )

    @property
    def _leaves_parent(self) -> bool:
        return True

    @property
    def _where(self) -> str:
        return f" at {self.parameter} from {self.low:g} to {self.high:g}{_at_words(self.at)}"

    @property
    def _periods(self) -> tuple[int, ...]:
        return (self.period,) if isinstance(self.period, int) else tuple(self.period)

    @property
    def _of(self) -> str:
        return "" if self.period == 1 else f" of period {' or '.join(map(str, self._periods))}"

    def _own(self, branches: Sequence[Branch]) -> list[Branch]:
        """Return the branches whose orbits have the period of the claim."""
        return [each for each in branches if each.points[0].orbit.period in self._periods]

    def _covered(self, branches: Sequence[Branch]) -> bool:
        """Return True if the first branch passes the whole range: what was not walked may hold anything."""
        rounding, values = _ROUNDING * max(abs(self.low), abs(self.high)), branches[0].values
        return bool(values.min() <= self.low + rounding and values.max() >= self.high - rounding)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Compared(_Walked):
    """What claims that compare with another model have."""

    #: Values of parameters, by name, of the other model with which this one is compared, such as another damping.
    than: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def models(self) -> tuple[Mapping[str, float], ...]:
        """The model, and the other one if there is one."""
        return (self.at, {**self.at, **self.than}) if self.than else (self.at,)


@dataclass(frozen=True, slots=True)
class PointClaim(_Walked):
    """A claim that a branch has a special point in a range of a parameter, or has none there.

    Examples
    --------
    >>> gw.ask.PointClaim("flip", parameter="frequency", low=0.62, high=0.85, over=(2.0, 0.5)).words
    'flip at frequency from 0.62 to 0.85'
    """

    kind: Kind  #: Kind of special point, such as ``"flip"``.
    absent: bool = field(default=False, kw_only=True)  #: True if there is no such point in the range.

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", Kind.named(self.kind))
        _Walked.__post_init__(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        return f"{'no ' if self.absent else ''}{self.kind}{self._of}{self._where}"

    @property
    def _leaves_parent(self) -> bool:
        return False

    def judge(self, branches: Sequence[Branch]) -> Verdict:
        """Return whether the claim holds (None if the walk ended too early), and the number of such points."""
        found = sum(self.low <= point.value <= self.high for point in branches[0].special(self.kind))
        if found:
            return not self.absent, float(found)
        return (self.absent if self._covered(branches) else None), 0.0

    @staticmethod
    def amount_words(amount: float) -> str:
        """Describe what was found."""
        return f"{amount:.0f}" if amount > 1.0 else ""


# Ranges of stability along a branch.


NATURES: Mapping[str, Callable[[Instability], bool]] = {
    "doubled": lambda instability: instability.below > 0,
    "folded": lambda instability: instability.above > 0,
    "pair": lambda instability: instability.pairs > 0,
    "unstable": lambda instability: instability.total > 0,
    "stable": lambda instability: not instability.total,
}
"""Tests of motions by their multipliers: beyond -1, beyond +1, a complex pair outside the unit circle."""


def _check_nature(key: str, nature: str) -> None:
    if nature not in NATURES:
        raise ModelError(f"{key} is {given(nature)}; {did_you_mean(nature, list(NATURES), 'natures of motions are')}")


def ranges_of(branch: Branch, nature: str) -> list[tuple[float, float]]:
    """Return the ranges of the parameter in which the motions of a branch have a nature, along the branch."""
    nodes = [(point.arclength, point.value, point.instability) for point in branch.points]
    nodes += [(special.point.arclength, special.value, special.after) for special in branch.special_points]
    nodes.sort(key=lambda node: node[0])
    found, inside = list[list[float]](), False
    for _, value, instability in nodes:
        if inside:  # where a range ends belongs to it too
            found[-1].append(value)
        passes = NATURES[nature](instability)
        if passes and not inside:
            found.append([value])
        inside = passes
    return [(min(each), max(each)) for each in found]


@dataclass(frozen=True, slots=True)
class RangeClaim(_Walked):
    """A claim that motions of one nature, such as unstable ones, extend over a range, or are found within it.

    Examples
    --------
    >>> gw.ask.RangeClaim("doubled", parameter="frequency", low=0.62, high=0.85, within=0.02, over=(2.0, 0.5)).words
    'doubled from 0.62 to 0.85 (each within 0.02) over frequency'
    """

    #: ``"doubled"`` (a multiplier beyond -1), ``"folded"`` (beyond +1), ``"pair"`` (a complex pair outside the unit
    #: circle: quasi-periodic motions), ``"unstable"`` or ``"stable"``.
    nature: str
    #: Largest distance of a computed end of the range from the claimed end; None if a part of the range is enough.
    within: Annotated[float, Gt(0)] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        _check_nature("range", self.nature)
        _Walked.__post_init__(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        if self.within is None:
            return f"{self.nature}{self._of}{self._where}"
        ends = f"{self.nature}{self._of} from {self.low:g} to {self.high:g} (each within {self.within:g})"
        return f"{ends} over {self.parameter}{_at_words(self.at)}"

    def judge(self, branches: Sequence[Branch]) -> Verdict:
        """Return whether the claim holds, and the distance of the worse end, or the width found within the range."""
        found = [each for branch in self._own(branches) for each in ranges_of(branch, self.nature)]
        if self.within is not None:
            off = min((max(abs(a - self.low), abs(b - self.high)) for a, b in found), default=math.inf)
            holds, amount = off <= self.within, off
        else:
            inside = [(max(a, self.low), min(b, self.high)) for a, b in found]
            holds = any(a <= b for a, b in inside)
            amount = sum(max(b - a, 0.0) for a, b in inside)
        return (True if holds else False if self._covered(branches) else None), amount

    def amount_words(self, amount: float) -> str:
        """Describe what was found."""
        if not math.isfinite(amount):
            return "none"
        return f"off by {amount:.3g}" if self.within is not None else f"{amount:.3g} wide" if amount else ""


@dataclass(frozen=True, slots=True)
class SizeClaim(_Compared):
    """A claim that a width, a peak or its place lies between two numbers, or is larger than in another model.

    Examples
    --------
    >>> gw.ask.SizeClaim("peak", "half.x", parameter="frequency", low=0.5, high=2.0, least=1.2).words
    'peak of half.x at least 1.2 at frequency from 0.5 to 2'
    """

    #: ``"width"`` of the ranges with motions of one nature, ``"peak"`` (the largest value of a measure) or ``"place"``
    #: (the value of the parameter at the peak).
    size: str
    of: str  #: The nature, as in `RangeClaim`, for a width; the measure for a peak or a place.
    least: float | None = field(default=None, kw_only=True)  #: Least value that the size may have.
    most: float | None = field(default=None, kw_only=True)  #: Largest value that the size may have.
    smaller: bool = field(default=False, kw_only=True)  #: True to claim a smaller size than in the other model.

    def __post_init__(self) -> None:
        if self.size not in ("width", "peak", "place"):
            raise ModelError(f'size is {given(self.size)}; write "width", "peak" or "place"')
        if self.size == "width":
            _check_nature("width", self.of)
        if self.least is None and self.most is None and not self.than:
            raise ModelError(
                f"a claim about the {self.size} of {self.of} says neither least nor most, nor another model; write "
                "least = 1.2, or smaller_than = { ... } with values of parameters"
            )
        _Walked.__post_init__(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        said = [f"at least {self.least:g}"] if self.least is not None else []
        said += [f"at most {self.most:g}"] if self.most is not None else []
        said += [f"{'smaller' if self.smaller else 'larger'} than with {_values_words(self.than)}"] if self.than else []
        return f"{self.size} of {self.of}{self._of} {' and '.join(said)}{self._where}"

    @property
    def is_measure(self) -> bool:
        """True if the claim is about a measure, False if it is about a nature of motions."""
        return self.size != "width"

    def judge(self, branches: Sequence[Branch], others: Sequence[Branch] = ()) -> Verdict:
        """Return whether the claim holds, and the size, or its ratio to the size in the other model."""
        own = self._size(branches)
        holds = (self.least is None or own >= self.least) and (self.most is None or own <= self.most)
        known = self._covered(branches) and not math.isnan(own)
        if not self.than:
            return (holds if known else None), own
        other = self._size(others)
        holds = holds and (own < other if self.smaller else own > other)
        is_known = known and self._covered(others) and not math.isnan(other)
        return (holds if is_known else None), own / other if other else math.inf if own else 1.0

    def _size(self, branches: Sequence[Branch]) -> float:
        own = self._own(branches)
        if self.size == "width":
            ranges = [each for branch in own for each in ranges_of(branch, self.of)]
            return sum(max(min(b, self.high) - max(a, self.low), 0.0) for a, b in ranges)
        values = np.concatenate([branch.values for branch in own]) if own else np.zeros(0)
        inside = (values >= self.low) & (values <= self.high)
        if not inside.any():
            return math.nan
        heights = np.concatenate([branch.measure(self.of) for branch in own])[inside]
        return float(heights.max() if self.size == "peak" else values[inside][heights.argmax()])

    def amount_words(self, amount: float) -> str:
        """Describe what was found."""
        return f"{amount:.3g} times" if self.than and math.isfinite(amount) else f"{amount:.4g}"


@dataclass(frozen=True, slots=True)
class AlikeClaim(_Compared):
    """A claim that another model has the same response, or special points at the same places.

    Examples
    --------
    >>> claim = gw.ask.AlikeClaim("half.x", 0.05, parameter="frequency", low=0.5, high=2.0, than={"damping.x.x": 0.1})
    >>> claim.words
    'half.x within 5 % of that with damping.x.x = 0.1 at frequency from 0.5 to 2'
    """

    of: str  #: A measure, or a kind of special point.
    #: Largest difference: for a measure, relative to its largest value in the range; for special points, relative to
    #: the value of the parameter at the point.
    within: Annotated[float, Gt(0), Le(1)]

    def __post_init__(self) -> None:
        if not self.than:
            raise ModelError(f"a claim that {self.of} is alike names no other model; write than = {{ ... }}")
        _Walked.__post_init__(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        what = self.of if self.is_measure else f"{self.of} points"
        return f"{what}{self._of} within {100 * self.within:g} % of that with {_values_words(self.than)}{self._where}"

    @property
    def is_measure(self) -> bool:
        """True if responses are compared, not places of special points."""
        return self.of not in [each.value for each in Kind.known()]

    def judge(self, branches: Sequence[Branch], others: Sequence[Branch]) -> Verdict:
        """Return whether the claim holds, and the largest difference."""
        pair = self._own(branches), self._own(others)
        off = self._heights(*pair) if self.is_measure else self._places(*pair)
        is_known = self._covered(branches) and self._covered(others)
        return (off <= self.within if is_known else None), off

    def _places(self, one: Sequence[Branch], other: Sequence[Branch]) -> float:
        """Return the largest relative distance from a special point of one model to the next of the other."""
        both = [
            np.array([each.value for branch in branches for each in branch.special(self.of)])
            for branches in (one, other)
        ]
        inside = [each[(each >= self.low) & (each <= self.high)] for each in both]
        if not any(map(len, inside)):
            return 0.0
        if not all(map(len, both)):
            return math.inf
        gaps = [np.abs(a[:, None] - b).min(axis=1) / np.abs(a) for a, b in (inside, inside[::-1]) if len(a) and len(b)]
        return float(np.concatenate(gaps).max()) if all(map(len, inside)) else math.inf

    def _heights(self, one: Sequence[Branch], other: Sequence[Branch]) -> float:
        """Return the largest difference of the measure at equal values of the parameter, over its largest value."""
        grid, worst, largest = np.linspace(self.low, self.high, _GRID), 0.0, 0.0
        curves = [[_crossings(branch, self.of, grid) for branch in branches] for branches in (one, other)]
        for index in range(_GRID):
            a, b = (np.concatenate([each[index] for each in own] or [np.zeros(0)]) for own in curves)
            if not len(a) or not len(b):
                return math.inf
            apart = np.abs(a[:, None] - b)
            worst = max(worst, float(apart.min(axis=1).max()), float(apart.min(axis=0).max()))
            largest = max(largest, float(np.abs(a).max()))
        return worst / largest if largest else 0.0

    @staticmethod
    def amount_words(amount: float) -> str:
        """Describe what was found."""
        return f"off by {100 * amount:.2g} %" if math.isfinite(amount) else "none"


def _crossings(branch: Branch, measure: str, grid: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the values of a measure where a branch passes each value of the parameter."""
    x, y = branch.values, branch.measure(measure)
    found = []
    for value in grid:
        steps = np.flatnonzero((np.minimum(x[:-1], x[1:]) <= value) & (value <= np.maximum(x[:-1], x[1:])))
        share = (value - x[steps]) / np.where(x[steps + 1] == x[steps], 1.0, x[steps + 1] - x[steps])
        found.append(y[steps] + share * (y[steps + 1] - y[steps]))
    return found


@dataclass(frozen=True, slots=True)
class LoopClaim(_Walked):
    """A claim that a branch of twice the period begins at one flip and ends at another, all within a range.

    Examples
    --------
    >>> gw.ask.LoopClaim(parameter="frequency", low=1.2, high=1.4, period=2).words
    'closed branch of period 2 at frequency from 1.2 to 1.4'
    """

    def __post_init__(self) -> None:
        if not isinstance(self.period, int) or self.period < 2 or self.period % 2:
            raise ModelError(f"loop is {self.period}; write an even period of 2 or more, as in loop = 2")
        _Walked.__post_init__(self)

    @property
    def words(self) -> str:
        """The claim in words."""
        return f"closed branch of period {self.period}{self._where}"

    def judge(self, branches: Sequence[Branch]) -> Verdict:
        """Return whether the claim holds, and the number of such branches."""
        closed = {EndReason.BRANCHED, EndReason.JOINED}  # from one flip to another
        loops = [each for each in self._own(branches) if {end.reason for end in each.ends} <= closed]
        found = sum(bool(self.low <= each.values.min() and each.values.max() <= self.high) for each in loops)
        return (True if found else False if self._covered(branches) else None), float(found)

    @staticmethod
    def amount_words(amount: float) -> str:
        """Describe what was found."""
        return f"{amount:.0f}" if amount > 1.0 else ""


WalkClaim = PointClaim | RangeClaim | SizeClaim | AlikeClaim | LoopClaim
"""A claim that rests on walks."""

AnyClaim = MotionClaim | WalkClaim
"""A claim of any kind."""


def said(claim: AnyClaim) -> str:
    """Return the words that a claim was given, or those of its keys."""
    return claim.says or claim.words


def _values_words(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


def _at_words(at: Mapping[str, float]) -> str:
    return f" at {_values_words(at)}" if at else ""


def fixed_by(claims: Sequence[AnyClaim]) -> frozenset[str]:
    """Return the parameters that may not vary: those of walks, and those to which every claim gives a value."""
    walked = frozenset[str]().union(*(claim.walked for claim in claims))
    return walked | frozenset.intersection(*(frozenset(claim.at) | claim.walked for claim in claims))


def check_claims(system: System, claims: Sequence[AnyClaim]) -> None:
    """Refuse claims about parameters that the system does not have, or values that it cannot have."""
    if not claims:
        raise ModelError('there are no claims; write tables [[study.claim]], as with motion = "period 3"')
    for claim in claims:
        for model in (claim.at,) if isinstance(claim, MotionClaim) else claim.models:
            system.at(model)
        for name in claim.walked:
            system.structure.place(name)
