"""The record of a regime map: the kind of motion at each cell of a plane of two parameters.

A `Regime` is the kind of a motion, as a number that arrays can hold and in words.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.attractors.basins import centres
from gapwalk.attractors.lyapunov import LyapunovOptions
from gapwalk.attractors.many_motions import ExactMotions, ManyMotions
from gapwalk.attractors.settle import AttractorKind, ClassifyOptions, SettleOptions, classify, judge_returns, settle
from gapwalk.errors import FlowError, ModelError
from gapwalk.model.bounds import Bounded, Counted
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import parameter_headings
from gapwalk.summary import Rows, TableRows, Tables

_SHORT = 8  # longest period that a short summary lists separately


@dataclass(frozen=True)
class RegimeCheck:
    """Accuracy of the regimes of a map."""

    #: Number of cells whose motion was settled further and classified with the exact flow, rare kinds first.
    checked: int = 0
    #: One sentence for each of these cells whose regime or period in the map was corrected.
    different: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Regimes(Shown):
    """The regimes in the plane of two parameters, cell by cell; the first row of each array is the lowest."""

    system: System  #: The system, with the values of the other parameters.
    #: first, second: Names of the parameters: horizontal, and vertical.
    first: str
    second: str
    #: The range of each parameter. A cell is evaluated at its centre.
    within: tuple[tuple[float, float], tuple[float, float]]
    regimes: NDArray[np.int_]  #: shape (rows, columns): Values of `Regime`.
    periods: NDArray[np.int_]  #: shape (rows, columns): Period m of the periodic motions; 0 for the others.
    #: shape (rows, columns): Largest Lyapunov exponent per forcing period of motions that were not found to be periodic
    #: at once; else nan.
    exponents: NDArray[np.float64]
    #: peak_force, impacts: shape (rows, columns, contacts): Largest magnitude of each contact force (nan of a rigid
    #: stop, whose impacts have no finite force), and impacts per forcing period; shape (rows, columns, 0) if not
    #: requested.
    peak_force: NDArray[np.float64]
    impacts: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (rows, columns, state_size): A state of the motion at theta = 0.
    check: RegimeCheck = RegimeCheck()  #: Accuracy of the regimes.
    #: Error of the fast flow over one forcing period, relative to the size of the motion, measured against the exact
    #: flow; 0 if only the exact flow was used.
    error: float = 0.0
    complete: bool = True  #: False if the computation was stopped before its end; the remaining cells are undecided.
    notes: tuple[str, ...] = ()  #: Sentences on what could not be computed.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        parts = (self.regimes, self.periods, self.exponents, self.peak_force, self.impacts, self.states)
        if self.regimes.ndim != 2 or any(part.shape[:2] != self.regimes.shape for part in parts):
            raise ValueError(f"its parts have the shapes {', '.join(str(part.shape) for part in parts)}")
        if self.impacts.ndim != 3 or self.peak_force.shape != self.impacts.shape:
            raise ValueError("its forces and impacts are not those of the same contacts")

    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.regimes.shape
        return columns, rows

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values of the parameters at the centres of the cells."""
        first, second = (centres(ends, count) for ends, count in zip(self.within, self.resolution, strict=True))
        return first, second

    @property
    def cells(self) -> dict[str, int]:
        """Number of cells of each regime, by its name: ``period 1``, ..., ``quasi-periodic``, ``chaotic``, ..."""
        words = Counter(zip(self.regimes.ravel().tolist(), self.periods.ravel().tolist(), strict=True))
        order = sorted(words, key=lambda key: (key[0] < 0, key))
        return {regime_word(*key): words[key] for key in order}

    @cached_property
    def z(self) -> NDArray[np.str_]:
        """Impacts p in n forcing periods of each periodic cell, such as ``3/2``; elsewhere empty; see `Orbit.z`."""
        contacts = self.system.structure.contacts[: self.impacts.shape[2]]
        names = {place: form.name for place, form in enumerate(contacts) if form.stages}

        def text(row: int, column: int) -> str:
            period, counts = int(self.periods[row, column]), self.impacts[row, column]
            known = [place for place in names if np.isfinite(counts[place])]
            if self.regimes[row, column] != Regime.PERIODIC or not known:
                return ""
            each = {names[place]: f"{round(period * counts[place])}/{period}" for place in known}
            return ", ".join(each.values() if len(names) == 1 else (f"{name} {z}" for name, z in each.items()))

        cells = np.ndindex(*self.regimes.shape)
        return np.array([text(*place) for place in cells], dtype=np.str_).reshape(self.regimes.shape)

    def at(self, first: float, second: float) -> str:
        """Return the regime of the cell that contains two parameter values."""
        place = []
        for value, (low, high), count in zip((first, second), self.within, self.resolution, strict=True):
            if not low <= value <= high:
                raise ModelError(f"({first:g}, {second:g}) lies outside the map, which is over {self.within}")
            place.append(min(int((value - low) / (high - low) * count), count - 1))
        column, row = place
        return regime_word(int(self.regimes[row, column]), int(self.periods[row, column]))

    def tables(self) -> Tables:
        """Return the table of the cells."""
        return {"cells": TableRows(self._cell_rows, 2, units={"peak.force.": ".force"})}

    def _cell_rows(self) -> Rows:
        contacts = [contact.name for contact in self.system.structure.contacts][: self.impacts.shape[2]]
        headings = [f"{what}.{contact}" for what in ("peak.force", "impacts") for contact in contacts]
        names = parameter_headings([self.first, self.second], self.system.coordinates)
        yield [*names, "regime", "period", "exponent", *headings, *["z"] * bool(contacts)]
        (across, up), (rows, columns) = self.axes, self.regimes.shape
        for row, column in np.ndindex(rows, columns):
            regime, period = int(self.regimes[row, column]), int(self.periods[row, column])
            forces, impacts = self.peak_force[row, column], self.impacts[row, column]
            yield [
                float(across[column]),
                float(up[row]),
                regime_word(regime, period),
                period,
                *("" if np.isnan(each) else float(each) for each in (self.exponents[row, column], *forces, *impacts)),
                *[str(self.z[row, column])] * bool(contacts),
            ]

    def _groups(self) -> dict[str, int]:
        """Count cells as in `cells`, with all long periods in one group."""
        longer = int(np.sum(self.periods > _SHORT))
        short = {f"period {m}": int(np.sum(self.periods == m)) for m in range(1, _SHORT + 1)}
        others = {word: count for word, count in self.cells.items() if not word.startswith("period ")}
        groups = {**short, f"longer periods than {_SHORT}": longer, **others}
        return {word: count for word, count in groups.items() if count}

    def __repr__(self) -> str:
        columns, rows = self.resolution
        parts = ", ".join(f"{word}: {count}" for word, count in self._groups().items())
        return f"Regimes({self.first}, {self.second}; {columns} x {rows} cells; {parts})"


class Regime(IntEnum):
    """The kind of a motion."""

    RUNAWAY = -2
    UNDECIDED = -1
    PERIODIC = 0
    QUASI_PERIODIC = 1
    CHAOTIC = 2

    @property
    def text(self) -> str:
        """The regime in words."""
        return ("periodic", "quasi-periodic", "chaotic", "diverges", "undecided")[self.value]


def regime_word(regime: int, period: int) -> str:
    """Return the name of a regime in a regime map: ``period 3``, ``quasi-periodic``, ``chaotic``, ..."""
    return f"period {period}" if regime == Regime.PERIODIC else Regime(regime).text


# Classification of many motions at once: periodic (with its period), quasi-periodic or chaotic, and contact figures.
#
# A motion is periodic if it returns after m forcing periods and if the returns, extrapolated, end nearby: a slow
# transient near a fold returns just as closely, but each time with the same error. A motion that does not return
# within `RegimeOptions.longest` is classified by its largest Lyapunov exponent: a second motion starts close by and is
# reset to that distance again and again (Benettin, Galgani and Strelcyn 1976, Phys. Rev. A 14, 2338-2345). On a torus
# the distance grows by a bounded factor only, however long the average; this distinguishes a torus from chaos. Motions
# of a regime map that seem not to be periodic, and random samples of the others, are classified again by the exact
# flow.

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
class RegimeOptions(Bounded):
    """Options of the classification of regimes."""

    #: The most forcing periods in which a motion may become periodic; after them it is classified by its exponent.
    longest: Counted = 3000
    #: The longest period m that is searched for at once; longer ones are found only where the exponent is negative.
    max_period: Annotated[int, Ge(1), Le(LONGEST_RETURN)] = 16
    forces: bool = True  #: True if peak forces and impacts are computed.


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
    """Follow motions until they are periodic, or until patience ends; each no longer than it needs."""
    # Shapes: `states`, `scales` (count, state_size).
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
    """Follow motions for some forcing periods and a look at their returns; return the last states and the periods."""
    # A period is 0 if a motion does not return within `longest` forcing periods, and -1 if it has diverged.
    track = motions.strobes(states, 3 * longest + 1, after)
    periods, is_bounded = np.full(len(states), -1), np.isfinite(track).all(axis=(0, 2))
    last, track = track[-1], track[:, is_bounded] / scales[is_bounded]
    sizes = np.maximum(np.abs(track).max(axis=(0, 2)), np.finfo(float).tiny)
    periods[is_bounded] = judge_returns(track / sizes[:, None], longest).periods
    return last, periods


def judge(
    motions: ManyMotions, states: NDArray[np.float64], scales: NDArray[np.float64], options: RegimeOptions
) -> Verdicts:
    """Classify motions from states at theta = 0, by the scales of their entries; both of shape (count, state_size)."""
    # The scales are `System.state_scales`, with which a velocity counts as the derivative over theta.
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

    def _find_returns(self, which: NDArray[np.intp], longest: int) -> NDArray[np.intp]:
        """Follow motions, mark those that return within `longest` forcing periods afterwards, and return the others."""
        if not len(which):
            return which
        states, scales = self.found.states[which], 1.0 / self.weights[which]
        self.found.states[which], periods = _returns(self.motions.part(which), states, scales, longest, _FIRST)
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
"""Sign of the exponent, not its digits: chaos is decided by it, so the average ends at twice the errors that decide."""


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
