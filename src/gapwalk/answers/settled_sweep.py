"""Settled motions met by a slow sweep of one parameter, followed as branches where they are periodic.

A slow sweep stays on a stable motion until it ends or loses its stability: at a fold it jumps, at a flip or a
Neimark-Sacker point another motion leaves, at a graze of a stiff stop either may happen. Up to there the branch is
walked, which locates the point exactly. Just beyond it a transient is followed until it has settled, from the last
state of the branch; so the sweep continues where a machine would. Motions that are not periodic, or of a long period,
are sampled at even steps of the parameter until a periodic motion is found again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import Settled, SettleOptions, judge_returns, settle
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.errors import FlowError, NumericalError
from gapwalk.model.bounds import Bounded, Counted
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

_BEYOND = 0.02  # share of a step beyond a loss of stability at which the transient begins
_FIRST, _LONGEST = 48, 8  # forcing periods before the first look at a transient, and longest period of a sample
_KEPT = 4  # states of a sampled motion that are stored
_STUCK = 8  # walks in succession that may fail to leave their first point


class Direction(StrEnum):
    """Direction in which a sweep changes the parameter."""

    UP = "rising"
    DOWN = "falling"

    @property
    def sign(self) -> int:
        """1 for a rising parameter, -1 for a falling one."""
        return 1 if self is Direction.UP else -1


@dataclass(frozen=True, slots=True)
class SlowSweepOptions(Bounded):
    """Options of a slow sweep."""

    steps: Annotated[int, Ge(2)] = 100  #: Steps of the range at which motions without a branch are sampled.
    #: Longest period, in forcing periods, of motions that are followed as branches; longer ones are sampled.
    longest: Counted = 2
    patience: Annotated[int, Ge(16)] = 300  #: The most forcing periods in which a sampled motion may become periodic.
    walk: WalkOptions = WalkOptions()  #: Options of the walks.


@dataclass(frozen=True, eq=False)
class Stretch:
    """Stable periodic motions over a stretch of the parameter."""

    branch: Branch  #: The branch, in the direction of the sweep; its last point may lie beyond the loss of stability.
    #: begin, end: Values of the parameter between which it is stable, in the direction of the sweep.
    begin: float
    end: float
    lost: SpecialPoint | None  #: Special point at which it loses its stability; None if it does not.
    why: str  #: Reason why it ends, in words.

    @property
    def points(self) -> tuple[BranchPoint, ...]:
        """Its stable points, in the direction of the sweep."""
        limit = math.inf if self.lost is None else self.lost.point.arclength
        return tuple(point for point in self.branch.points if point.stable and point.arclength <= limit)

    @property
    def special_points(self) -> tuple[SpecialPoint, ...]:
        """Special points on it; the loss of stability is not among them."""
        limit = math.inf if self.lost is None else self.lost.point.arclength
        return tuple(point for point in self.branch.special_points if point.point.arclength < limit)


@dataclass(frozen=True, eq=False)
class Sample:
    """A settled motion at one value of the parameter."""

    value: float  #: Value of the parameter.
    motion: Settled  #: The motion, with its orbit if it is periodic.


@dataclass(frozen=True, eq=False)
class SettledSweep:
    """The motions met by a slow sweep."""

    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: Its range, the smaller end first.
    direction: Direction  #: Direction of the sweep.
    #: stretches, samples: Periodic motions that were followed, and motions that were sampled; both in the order of the
    #: sweep.
    stretches: tuple[Stretch, ...]
    samples: tuple[Sample, ...]
    notes: tuple[str, ...] = ()  #: Failures, in sentences.
    name: str = ""  #: How the motions are met if not by a sweep; empty for a sweep.

    @property
    def met(self) -> str:
        """How the motions are met: ``rising``, ``falling``, or otherwise."""
        return self.name or str(self.direction)

    @property
    def pieces(self) -> list[Stretch | Sample]:
        """Stretches and samples in the order of the sweep."""
        both: list[Stretch | Sample] = [*self.stretches, *self.samples]
        return sorted(both, key=lambda piece: self.direction.sign * start_of(piece))


def start_of(piece: Stretch | Sample) -> float:
    """Return the value of the parameter at which a piece of a sweep begins."""
    return piece.begin if isinstance(piece, Stretch) else piece.value


def settled_sweep(
    system: System,
    parameter: str,
    within: tuple[float, float],
    direction: Direction,
    start: str | tuple[float, ...] = "rest",
    options: SlowSweepOptions | None = None,
) -> SettledSweep:
    """Follow the settled motion over a range of a parameter that changes slowly in one direction."""
    options = options or SlowSweepOptions()
    low, high = within
    sweep = _SlowSweep(system, parameter, (min(low, high), max(low, high)), direction, options)
    sweep.run(start)
    return SettledSweep(
        parameter, sweep.within, direction, tuple(sweep.stretches), tuple(sweep.samples), tuple(sweep.notes)
    )


def stable_stretch(
    orbit: Orbit, parameter: str, to: float, options: WalkOptions, begin: float | None = None
) -> tuple[Stretch, NDArray[np.float64]]:
    """Follow a stable orbit until it loses its stability or reaches a value of the parameter."""
    steps = walk(orbit, parameter, to, walk=options)
    lost: SpecialPoint | None = None
    for point in steps:
        lost = next((each for each in steps.special_points if not each.before.total and each.after.total), None)
        if lost is not None or not point.stable:
            break
    branch = steps.branch
    last = branch.points[-1]
    first = orbit.system[parameter] if begin is None else begin
    if lost is not None:
        return Stretch(branch, first, lost.value, lost, str(lost.kind)), last.orbit.state
    if not last.stable:  # the point where it was lost could not be located
        values = [point.value for point in branch.points[-2:]]
        return Stretch(branch, first, float(np.mean(values)), None, "a loss of stability"), last.orbit.state
    return Stretch(branch, first, branch.ends[-1].value, None, branch.ends[-1].reason_words), last.orbit.state


class _SlowSweep:
    """A sweep that is being computed."""

    def __init__(
        self,
        system: System,
        parameter: str,
        within: tuple[float, float],
        direction: Direction,
        options: SlowSweepOptions,
    ) -> None:
        self.system, self.parameter, self.within, self.options = system, parameter, within, options
        self.direction = direction
        self.sign = direction.sign
        self.begin, self.end = within if self.sign > 0 else within[::-1]
        self.step = (within[1] - within[0]) / options.steps
        self.stretches: list[Stretch] = []
        self.samples: list[Sample] = []
        self.notes: list[str] = []

    def run(self, start: str | tuple[float, ...]) -> None:
        """Follow the motion from one end of the range to the other."""
        settled = settle(self.system, start, at={self.parameter: self.begin})
        state, value, fails = settled.state, self.begin, 0
        while True:
            orbit = settled.orbit
            if orbit is not None and orbit.period <= self.options.longest and fails < _STUCK:
                before, after = value, self._followed(orbit)
                if after is not None:
                    (value, state), fails = after, 0 if abs(after[0] - before) > _BEYOND * self.step else fails + 1
                    ahead = value + self.sign * _BEYOND * self.step
                else:
                    ahead = self._sampled(value, settled)
            else:
                ahead, fails = self._sampled(value, settled), 0
            if self._is_past(value) or self._is_past(ahead):
                return
            value = ahead
            try:
                settled = self._settled(self.system.at({self.parameter: value}), state)
            except FlowError as error:
                self.notes.append(f"{self.parameter} = {value:.8g}: {error}")
                return
            state = settled.state

    def _settled(self, system: System, state: NDArray[np.float64]) -> Settled:
        """Follow a transient until its returns shrink towards an orbit, which is then found, or to the end of patience.

        Newton's method is called only where returns shrink: in chaos it would be called at every chance return.
        """
        strobe, scales, longest = Strobe(system), system.state_scales(), max(_LONGEST, self.options.longest)
        states, length = state[None, :], max(_FIRST, 3 * longest + 1)
        while True:
            states = np.vstack((states, strobe.run(states[-1], length - (len(states) - 1))))
            tail = states[-min(len(states), length // 2 + 3 * longest) :] / scales
            size = max(float(np.abs(tail).max()), np.finfo(float).tiny)
            period = int(judge_returns(tail[:, None] / size, longest).periods[0])
            if period:
                settled = settle(system, states[-1], SettleOptions(max_periods=8 * _FIRST, max_period=max(period, 1)))
                if settled.orbit is not None:
                    return replace(settled, periods=settled.periods + length)
            if length >= self.options.patience:
                why = f"it did not become periodic within {length} forcing periods"
                return Settled(system, states, length, False, None, float("inf"), (why,))
            length = min(length + length // 2, self.options.patience)

    def _is_past(self, value: float) -> bool:
        return (value - self.end) * self.sign >= 0.0

    def _sampled(self, value: float, settled: Settled) -> float:
        """Keep a motion as a sample, and return the next value to look at."""
        self.samples.append(Sample(value, replace(settled, strobes=settled.strobes[-_KEPT:].copy())))
        return value + self.sign * self.step

    def _followed(self, orbit: Orbit) -> tuple[float, NDArray[np.float64]] | None:
        """Follow an orbit; return the value and the state where the stretch ends, None if that fails."""
        value = orbit.system[self.parameter]
        # a motion settled just beyond a loss of stability is there from the very point on
        previous = self.stretches[-1].end if self.stretches else value
        begin = previous if abs(value - previous) <= 1.5 * _BEYOND * self.step else value
        try:
            stretch, state = stable_stretch(orbit, self.parameter, self.end, self.options.walk, begin)
        except NumericalError as error:
            self.notes.append(f"{self.parameter} = {value:.8g}: {error}")
            return None
        if not stretch.points or (stretch.end - begin) * self.sign <= 0.0:
            return None
        if stretch.branch.ends[-1].reason is EndReason.FAILED:
            self.notes.append(f"{self.parameter} = {stretch.end:.8g}: {stretch.why}")
        self.stretches.append(stretch)
        return stretch.end, state
