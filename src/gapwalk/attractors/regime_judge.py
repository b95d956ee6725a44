"""Classification of many motions at once: periodic (with its period), quasi-periodic or chaotic, and contact figures.

A motion is periodic if it returns after m forcing periods and if the returns, extrapolated, end nearby: a slow
transient near a fold returns just as closely, but each time with the same error. A motion that does not return within
`RegimeOptions.longest` is classified by its largest Lyapunov exponent: a second motion starts close by and is reset to
that distance again and again (Benettin, Galgani and Strelcyn 1976, Phys. Rev. A 14, 2338-2345). On a torus the
distance grows by a bounded factor only, however long the average; this distinguishes a torus from chaos. Motions of a
regime map that seem not to be periodic, and random samples of the others, are classified again by the exact flow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import AttractorKind
from gapwalk.attractors.classify import ClassifyOptions, classify
from gapwalk.attractors.lyapunov import LyapunovOptions
from gapwalk.attractors.many_motions import ExactMotions, ManyMotions
from gapwalk.attractors.regimes import Regime
from gapwalk.attractors.section import check_count
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.settling_judge import judge_returns
from gapwalk.errors import FlowError, ModelError
from gapwalk.model.system import System

_FIRST = 64  # forcing periods before the first test for returns; the total grows by half before each further test
LONGEST_RETURN = 128  # longest period in forcing periods that is tried for a contracting motion
_APART = 1e-9  # distance of the second motion, relative to the size of the motion
_STRETCH = 16  # forcing periods after which the second motion is reset to that distance
_LOOKS = (1024, 3072)  # forcing periods over which an exponent is averaged: most chaotic motions need the first only
_FOLDS = (20.0, 12.0)  # logarithm of the growth above which each of these averages decides
_ERRORS = 4.0  # standard errors from zero of an exponent that decides
_BLOCKS = 16  # parts of the average, from which its error is estimated
_SEED = 1976
_FORCES = 256  # forcing periods over which the contact forces of a motion that is not periodic are evaluated


@dataclass(frozen=True, slots=True)
class RegimeOptions:
    """Options of the classification of regimes.

    Examples
    --------
    >>> gw.analysis.RegimeOptions(longest=500, forces=True).longest
    500
    """

    #: The most forcing periods in which a motion may become periodic; after them it is classified by its exponent.
    longest: int = 3000
    #: The longest period m that is searched for at once; longer ones are found only where the exponent is negative.
    max_period: int = 16
    forces: bool = True  #: True if peak forces and impacts are computed.

    def __post_init__(self) -> None:
        check_count("longest", self.longest)
        check_count("max_period", self.max_period)
        if self.max_period > LONGEST_RETURN:
            raise ModelError(f"max_period is {self.max_period}; it must be at most {LONGEST_RETURN}")


class Verdicts(NamedTuple):
    """The regimes of many motions."""

    regimes: NDArray[np.int_]  #: shape (count,): Values of `Regime`.
    periods: NDArray[np.int_]  #: shape (count,): m of the periodic ones; 0 for the others.
    #: shape (count,): The largest Lyapunov exponent per forcing period, if it was needed; otherwise nan.
    exponents: NDArray[np.float64]
    #: peaks, impacts: shape (count, contacts): Largest magnitude of each contact force, and impacts per forcing period;
    #: nan if they were not requested.
    peaks: NDArray[np.float64]
    impacts: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (count, state_size): Last states of the motions.

    def copy(self) -> Verdicts:
        """Return a copy with its own arrays."""
        regimes, periods = self.regimes.copy(), self.periods.copy()
        return Verdicts(regimes, periods, *(part.copy() for part in self[2:]))

    def some(self, which: NDArray[np.intp] | int) -> Verdicts:
        """Return those at some places, or of one row of a chunk."""
        return Verdicts(self.regimes[which], self.periods[which], *(part[which] for part in self[2:]))


class Waited(NamedTuple):
    """Many motions that were followed until they are periodic."""

    states: NDArray[np.float64]  #: shape (count, state_size): Their last states.
    #: shape (count,): Their periods in forcing periods; 0 for those that did not become periodic, -1 for those that
    #: diverged.
    periods: NDArray[np.int_]
    longest: int  #: The most forcing periods over which any of them was followed.


def wait(
    motions: ManyMotions, states: NDArray[np.float64], scales: NDArray[np.float64], patience: int, max_period: int
) -> Waited:
    """Follow motions until they are periodic, or until patience ends; each no longer than it needs.

    Shapes: `states`, `scales` (count, state_size).
    """
    states, periods, total = states.copy(), np.zeros(len(states), dtype=int), 0
    rest = np.arange(len(states))
    while len(rest) and total < patience:
        step = min(max(_FIRST, total // 2), patience - total)
        found = _returns(motions.part(rest), states[rest], scales[rest], max_period, step)
        states[rest], periods[rest] = found
        rest, total = rest[found[1] == 0], total + step + 3 * max_period + 1
    return Waited(states, periods, total)


def _returns(
    motions: ManyMotions, states: NDArray[np.float64], scales: NDArray[np.float64], longest: int, after: int
) -> tuple[NDArray[np.float64], NDArray[np.int_]]:
    """Follow motions for some forcing periods and a look at their returns; return the last states and the periods.

    A period is 0 if a motion does not return within `longest` forcing periods, and -1 if it has diverged.
    """
    track = motions.strobes(states, 3 * longest + 1, after)
    periods, is_bounded = np.full(len(states), -1), np.isfinite(track).all(axis=(0, 2))
    last, track = track[-1], track[:, is_bounded] / scales[is_bounded]
    sizes = np.maximum(np.abs(track).max(axis=(0, 2)), np.finfo(float).tiny)
    periods[is_bounded] = judge_returns(track / sizes[:, None], longest).periods
    return last, periods


def judge(
    motions: ManyMotions, states: NDArray[np.float64], scales: NDArray[np.float64], options: RegimeOptions
) -> Verdicts:
    """Classify motions from states at theta = 0, by the scales of their entries; both of shape (count, state_size).

    The scales are `System.state_scales`, with which a velocity counts as the derivative over theta.
    """
    regime_judge = _RegimeJudge(motions, states, scales, options)
    regime_judge.wait_for_returns()
    regime_judge.measure_growth()
    if options.forces:
        regime_judge.look_at_contacts()
    return regime_judge.found


class _RegimeJudge:
    """Classifier of many motions, which fills in its results."""

    def __init__(
        self, motions: ManyMotions, states: NDArray[np.float64], scales: NDArray, options: RegimeOptions
    ) -> None:
        self.motions, self.options = motions, options
        count, self.weights = len(states), 1.0 / scales
        none = np.empty((count, 0))
        regimes, periods = np.full(count, int(Regime.UNDECIDED)), np.zeros(count, dtype=int)
        self.found = Verdicts(regimes, periods, np.full(count, np.nan), none, none, np.array(states, dtype=float))

    def wait_for_returns(self) -> None:
        """Follow each motion until it is periodic, or up to the allowed number of forcing periods."""
        states, scales = self.found.states, 1.0 / self.weights
        waited = wait(self.motions, states, scales, self.options.longest, self.options.max_period)
        states[:] = waited.states
        self._note(np.arange(len(states)), waited.periods)

    def measure_growth(self) -> None:
        """Classify the motions that are not periodic by their largest exponent."""
        rest = np.flatnonzero(self.found.regimes == Regime.UNDECIDED)
        for periods, folds in zip(_LOOKS, _FOLDS, strict=True):
            if not len(rest):
                return
            mean, error = self._exponents(rest, periods)
            self.found.exponents[rest] = mean
            is_sure = (np.abs(mean) > _ERRORS * error) & (np.abs(mean) * periods > folds)
            self.found.regimes[rest[is_sure & (mean > 0)]] = Regime.CHAOTIC
            self._find_returns(rest[is_sure & (mean < 0)], LONGEST_RETURN)
            rest = rest[~is_sure]
        rest = self._find_returns(rest, self.options.max_period)  # a slow transient may have ended meanwhile
        is_bounded = np.abs(self.found.exponents[rest]) * _LOOKS[-1] <= _FOLDS[-1]
        self.found.regimes[rest[is_bounded]] = Regime.QUASI_PERIODIC

    def look_at_contacts(self) -> None:
        """Compute peak forces and impacts, over whole periods for the periodic motions."""
        peaks = impacts = self.found.peaks
        lengths = np.where(self.found.periods > 0, self.found.periods, _FORCES)
        for length in np.unique(lengths):
            which = np.flatnonzero(lengths == length)
            found = self.motions.part(which).contacts(self.found.states[which], int(length))
            if not peaks.size:
                peaks = np.full((len(lengths), found.peaks.shape[1]), np.nan)
                impacts = peaks.copy()
            self.found.states[which], peaks[which], impacts[which] = found[:3]
        self.found = self.found._replace(peaks=peaks, impacts=impacts)

    def _find_returns(self, which: NDArray[np.intp], longest: int, after: int = _FIRST) -> NDArray[np.intp]:
        """Follow motions, mark those that return within `longest` forcing periods afterwards, and return the others."""
        if not len(which):
            return which
        states, scales = self.found.states[which], 1.0 / self.weights[which]
        self.found.states[which], periods = _returns(self.motions.part(which), states, scales, longest, after)
        self._note(which, periods)
        return which[periods == 0]

    def _note(self, which: NDArray[np.intp], periods: NDArray[np.int_]) -> None:
        """Enter the motions that are periodic, and those that have diverged."""
        self.found.regimes[which[periods < 0]] = Regime.RUNAWAY
        returned = which[periods > 0]
        self.found.periods[returned], self.found.regimes[returned] = periods[periods > 0], Regime.PERIODIC

    def _exponents(self, which: NDArray[np.intp], periods: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the largest exponent of motions per forcing period, and its standard error."""
        state, weights = self.found.states[which], self.weights[which]
        pairs = self.motions.part(np.concatenate((which, which)))
        apart = _APART * np.abs(state * weights).max(axis=1, keepdims=True)
        direction = np.random.default_rng(_SEED).normal(size=state.shape[1])
        direction = np.tile(direction / np.linalg.norm(direction), (len(which), 1))
        logs = np.empty((periods // _STRETCH, len(which)))
        for row in logs:
            both = pairs.advance(np.concatenate((state, state + apart * direction / weights)), _STRETCH)
            state, other = both[: len(which)], both[len(which) :]
            offset = (other - state) * weights / apart
            growth = np.linalg.norm(offset, axis=1)
            grown = growth > np.finfo(float).eps / _APART  # else only rounding is left: use the previous direction
            row[:] = np.log(np.where(grown, growth, np.finfo(float).eps / _APART))
            direction = np.where(grown[:, None], offset / np.where(grown, growth, 1.0)[:, None], direction)
        self.found.states[which] = state
        logs = logs[len(logs) // 8 :] / _STRETCH  # omit the start, before the directions have aligned
        blocks = np.array([block.mean(axis=0) for block in np.array_split(logs, _BLOCKS)])
        return logs.mean(axis=0), blocks.std(axis=0, ddof=1) / np.sqrt(_BLOCKS)


Finding = tuple[int, int]
"""A value of `Regime` and a period, 0 for a motion that is not periodic."""

_SLOW = SettleOptions(max_periods=16, max_period=16)
"""For a motion that seems quasi-periodic: it may spiral into an orbit so slowly that it has not converged yet."""

_LOCKED = SettleOptions(max_periods=4 * LONGEST_RETURN, max_period=LONGEST_RETURN)
"""For an undecided or contracting motion: it may be locked to a long period."""

_CONTRACTING = -1e-3
"""Exponent per forcing period below which a motion that seems quasi-periodic may be locked to a long period."""


_SIGN = ClassifyOptions(lyapunov=LyapunovOptions(relative=0.1))
"""Whether a motion is chaotic is the sign of its exponent: the average ends at twice the errors that decide it."""


def is_doubtful(verdicts: Verdicts) -> NDArray[np.bool_]:
    """Mark the motions that seem quasi-periodic or are undecided."""
    return np.isin(verdicts.regimes, (Regime.QUASI_PERIODIC, Regime.UNDECIDED))


def settle_doubts(verdicts: Verdicts, systems: Sequence[Callable[[], System]]) -> Verdicts:
    """Search for a stable orbit near each motion that seems quasi-periodic or is undecided."""
    found = verdicts.copy()
    is_locked = (verdicts.regimes == Regime.UNDECIDED) | (verdicts.exponents < _CONTRACTING)
    for place in np.flatnonzero(is_doubtful(verdicts)).tolist():
        system = systems[place]()
        with suppress(FlowError):
            orbit = settle(system, verdicts.states[place], _LOCKED if is_locked[place] else _SLOW).orbit
            if orbit is not None:
                found.regimes[place], found.periods[place] = Regime.PERIODIC, orbit.period
                found.states[place] = orbit.state
                if found.peaks.size:
                    contacts = ExactMotions(system).contacts(orbit.state[None, :], orbit.period)
                    found.peaks[place], found.impacts[place] = contacts.peaks[0], contacts.impacts[0]
    return found


def take_another_look(system: System, state: NDArray[np.float64]) -> Finding:
    """Classify the motion from a state with the exact flow."""
    return _looked_at(system, state)[0]


def _looked_at(system: System, state: NDArray[np.float64]) -> tuple[Finding, NDArray[np.float64]]:
    """Classify the motion from a state with the exact flow; also return a state of it."""
    try:
        attractor = classify(system, state, _SIGN)
    except FlowError:
        return (int(Regime.RUNAWAY), 0), np.full(len(state), np.nan)
    is_periodic = attractor.kind is AttractorKind.PERIODIC
    return (int(Regime[attractor.kind.name]), attractor.period if is_periodic else 0), attractor.state


def corrected(system: System, state: NDArray[np.float64], mine: Finding, forces: bool) -> Verdicts | None:
    """Return the verdict of the exact flow on the motion from a state, in arrays of one; None if it is the same."""
    (regime, period), state = _looked_at(system, state)
    if (regime, period) == mine:
        return None
    one, none = np.full(1, np.nan), np.full((1, len(system.structure.contacts) if forces else 0), np.nan)
    peaks, impacts = none, none
    if forces and regime != Regime.RUNAWAY:
        _, peaks, impacts, *_ = ExactMotions(system).contacts(state[None], period or _FORCES)
    return Verdicts(np.array([regime]), np.array([period]), one, peaks, impacts, state[None])
