"""Chunk of a search: a block of starts at one value of the parameter, processed by a pure function.

From each start a transient is followed until it repeats, instead of for a fixed number of forcing periods.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.isolated.lanes import Lanes, lanes_of, newton_in_lanes
from gapwalk.bifurcation.isolated.orbit_catalogue import Catalogue, Deflation, Entry, exact_orbit, newton_aside
from gapwalk.bifurcation.isolated.search_options import SearchOptions, generator
from gapwalk.errors import FlowError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

_EVERY = 8  # forcing periods between two examinations of the returns
_TOGETHER = 4 * _EVERY  # the same of many transients: their start takes as long as all of these periods
_STROBES = np.array([PERIOD * k for k in range(_EVERY + 1)])  # in one call: a call costs as much as a period
_RETURN = 1e-3  # distance of a return, in half-widths of the box, below which a transient may be settling
_FINEST = 1e-11  # the closest return that is required
_NEAR = 1e-2  # distance from a stable orbit within which a transient that returns has settled on it
_SHRINKING = 0.75  # ratio of the returns, over half the patience, up to which a transient is continued
_LONGEST = 10  # longest transient, as a multiple of the patience; slower decay would not end by then
_DOUBTS = 8  # number of times per patience that the returns of a long transient are examined
_EARLY = 1  # forcing periods after which the state of a transient is a start of Newton's method for short periods
_SHORT = 3  # the longest of the short periods
_LATE = 2  # forcing periods, in addition to the period sought, after which it is a start for any period
_THERE = 1e-2  # distance from a known orbit within which Newton's method would only return to it
_FEW = 0.25  # largest share of unsettled starts for which the patience is extended
_PATIENCE = 5  # factor by which it is extended
_MOST = 40  # largest number of new orbits whose neighbourhood is searched: without damping there are families of them
_KICK = 0.1  # distance from a known orbit at which the search for its neighbours begins, in half-widths of the box


@dataclass(frozen=True, eq=False)
class Settling:
    """Outcome of one transient."""

    path: NDArray[np.float64]  #: shape (periods + 1, state_size): States at the start of each forcing period.
    entry: Entry | None  #: The stable orbit on which it settled, or None.
    ran_away: bool = False  #: True if it could not be followed.


@dataclass(frozen=True, eq=False)
class Chunk:
    """Block of starts at one value of the parameter."""

    value: float  #: The value of the parameter.
    block: int  #: Index of the block among those of this value.
    system: System  #: The system at that value.
    box: NDArray[np.float64]  #: shape (state_size,): Half-widths of the box of states.
    starts: NDArray[np.float64]  #: shape (count, state_size): The starts.
    known: tuple[Orbit, ...]  #: Orbits known at that value.
    options: SearchOptions  #: Options of the search.
    many: bool = False  #: True if the search has so many starts that the batch integrator pays.


@dataclass(frozen=True, eq=False)
class Catch:
    """Result of one chunk: orbits with their hits by transients and by Newton's method, and the other transients."""

    #: Each orbit with the number of transients that settled on it, and of Newton iterations that ended on it.
    orbits: tuple[tuple[Orbit, int, int], ...]
    #: shape (count, state_size): Last states of the transients that did not become periodic.
    unsettled: NDArray[np.float64]
    ran_away: int  #: Number of transients that could not be followed.
    newton_starts: int  #: Number of starts of Newton's method.


def search_chunk(chunk: Chunk) -> Catch:
    """Process one chunk. The result depends only on the chunk, so chunks can be distributed over processes.

    Every start is followed until it settles. States along the transients are starts of Newton's method for orbits of
    several periods, stable or not. Finally, Newton's method with deflation searches near each new orbit for others.
    """
    options = chunk.options
    lanes = lanes_of(chunk.system, chunk.starts, chunk.box) if chunk.many else None
    hunt = _Hunt(chunk, lanes)
    settler = Settler(chunk.system, hunt.catalogue, options.periods, options.patience, lanes)
    every = math.ceil(options.starts / options.newton_starts) if options.newton_starts else 0
    unsettled, ran_away = [], 0
    first = chunk.block * options.block
    if (
        lanes is not None and every
    ):  # stable orbits that Newton's method finds let transients settle that die away slowly
        for number, path in enumerate(lanes.paths(chunk.starts, _LATE + max(options.newton_periods)), first):
            if number % every == 0:
                hunt.along(number // every, path)
        hunt.together()
    for number, settling in enumerate(settler.settle_each(chunk.starts), first):
        if settling.entry is not None:
            settling.entry.settled += 1
        elif settling.ran_away:
            ran_away += 1
        else:
            unsettled.append(settling.path[-1])
        if every and number % every == 0:
            if lanes is None:
                hunt.along(number // every, settling.path)
            if settling.entry is None:
                hunt.at_return(number // every, settling.path)
    hunt.together()
    if len(unsettled) <= _FEW * len(chunk.starts):  # if most have settled, a few may still linger near a chaotic saddle
        settler = Settler(chunk.system, hunt.catalogue, options.periods, _PATIENCE * options.patience, lanes)
        late = [*settler.settle_each(np.array(unsettled))] if unsettled else []
        unsettled = [settling.path[-1] for settling in late if settling.entry is None]
        for settling in late:
            if settling.entry is not None:
                settling.entry.settled += 1
    if every:
        hunt.beside()
    found = tuple((entry.orbit, entry.settled, entry.newton) for entry in hunt.catalogue.entries)
    last = np.array(unsettled).reshape(-1, len(chunk.box))
    return Catch(tuple(each for each in found if each[1] or each[2]), last, ran_away, hunt.tried)


class _Hunt:
    """Search for orbits, stable or not, by Newton's method: at once, or in lanes when all starts are known."""

    def __init__(self, chunk: Chunk, lanes: Lanes | None) -> None:
        self._chunk, self._lanes = chunk, lanes
        self._waiting: list[tuple[NDArray[np.float64], int]] = []
        self._random = generator(chunk.options.seed, chunk.value, chunk.block + 1)
        self._equations: dict[int, ShootingEquation] = {}
        self.catalogue = Catalogue(chunk.box)
        self.tried = 0
        for orbit in chunk.known:
            self.catalogue.add(orbit)
        self._known = len(self.catalogue.entries)

    def along(self, number: int, path: NDArray[np.float64]) -> None:
        """Search from states along a transient.

        One transient in m is used for period m, so that all periods take the same time. Newton's method for long
        periods converges from fewer states. It therefore begins later, when the transient is nearer to its attractor.
        For short periods it begins early too, where it may reach orbits that the transient moves away from.
        """
        for period in self._periods(number):
            for place in (_EARLY, _LATE + period)[period > _SHORT :]:
                state = path[min(place, len(path) - 1)]
                if self._lanes is not None or self.catalogue.nearest(state, period)[1] > _THERE:
                    self._begin(state, period)

    def at_return(self, number: int, path: NDArray[np.float64]) -> None:
        """Search from the closest return of a transient that has not settled."""
        for period in self._periods(number):
            if len(path) > 2 * period:
                returns = np.abs((path[period:] - path[:-period]) / self._chunk.box).max(axis=1)
                self._begin(path[int(np.argmin(returns))], period)

    def _periods(self, number: int) -> Iterator[int]:
        return (period for period in self._chunk.options.newton_periods if number % period == 0)

    def _begin(self, start: NDArray[np.float64], period: int) -> None:
        if self._lanes is None:
            self._try(start, period)
        else:
            self._waiting.append((start, period))

    def together(self) -> None:
        """Apply Newton's method in lanes from the starts that wait, and exactly from where it leads.

        Like `_try`, it gives up what leads to an orbit that is already in the catalogue.
        """
        if self._lanes is None or not self._waiting:
            return
        starts, periods = np.array([start for start, _ in self._waiting]), np.array([m for _, m in self._waiting])
        self._waiting.clear()
        away = self.catalogue.nearest_each(starts, periods)[1] > _THERE
        starts, periods = starts[away], periods[away]
        self.tried += len(starts)

        def are_met(which: NDArray[np.intp], states: NDArray[np.float64]) -> NDArray[np.bool_]:
            entries, distances = self.catalogue.nearest_each(states, periods[which])
            near = distances <= _THERE
            for place in np.flatnonzero(near).tolist():
                if (entry := entries[place]) is not None:
                    entry.newton += 1
            return near

        for state, period in zip(newton_in_lanes(self._lanes, starts, periods, are_met), periods.tolist(), strict=True):
            if np.isfinite(state).all():
                entry, distance = self.catalogue.nearest(state, period)
                if entry is not None and distance <= _THERE:
                    entry.newton += 1
                else:
                    self.tried -= 1  # it is counted again
                    self._try(state, period)

    def beside(self) -> None:
        """Search near each orbit found, with all known ones deflated: a second orbit is often near.

        Orbits known beforehand are skipped: orbits near them lie on their branches, or on branches attached to these.
        """
        done = self._known
        while done < min(len(self.catalogue.entries), self._known + _MOST):  # the list grows in the loop
            orbit = self.catalogue.entries[done].orbit
            kick = self._random.normal(size=len(orbit.state))
            kick[2 * orbit.system.size :] = 0.0  # friction would not let an extension be larger
            kick *= _KICK / np.linalg.norm(kick)
            self._try(orbit.state + kick * self._chunk.box, orbit.period, self.catalogue.states(orbit.period))
            done += 1

    def _try(self, start: NDArray[np.float64], period: int, known: NDArray[np.float64] | None = None) -> None:
        """Apply Newton's method from a start, and give up if it leads to an orbit that is already in the catalogue."""
        self.tried += 1
        met: list[Entry] = []

        def is_met(state: NDArray[np.float64]) -> bool:
            entry, distance = self.catalogue.nearest(state, period)
            if entry is not None and distance <= _THERE:
                met.append(entry)
            return bool(met)

        if period not in self._equations:
            self._equations[period] = ShootingEquation(self._chunk.system, None, period)
        state = newton_aside(self._equations[period], start, self._chunk.box, known, is_enough=is_met)
        orbit = None if state is None else exact_orbit(self._chunk.system, period, state)
        if orbit is not None:
            met.append(self.catalogue.add(orbit))
        for entry in met:
            entry.newton += 1


@dataclass(eq=False)
class _Transient:
    """One transient so far."""

    path: list[NDArray[np.float64]]  #: States at the start of each forcing period.
    finest: float = _RETURN  #: Distance of a return, in half-widths of the box, below which it may be settling.
    #: beside, before: The nearest stable orbit at the last examination, and its distance.
    beside: Entry | None = None
    before: float = math.inf


class Settler:
    """Integrator that follows the transients of one system until they settle."""

    def __init__(
        self, system: System, catalogue: Catalogue, periods: int, patience: int, lanes: Lanes | None = None
    ) -> None:
        self._system, self._catalogue, self._periods, self._patience = system, catalogue, periods, patience
        self._flow, self._coefficients, self._lanes = flow_of(system), coefficients_of(system), lanes

    def settle_each(self, states: NDArray[np.float64]) -> Iterator[Settling]:
        """Follow the transients from some states, one after the other as they are asked for, or all at once."""
        if self._lanes is None:
            yield from map(self.settle, states)
            return
        transients, found = [_Transient([state]) for state in states], dict[int, Settling]()
        while waiting := [number for number in range(len(states)) if number not in found]:
            strobes = self._lanes.strobes(np.array([transients[number].path[-1] for number in waiting]), _TOGETHER)
            for number, after in zip(waiting, strobes.transpose(1, 0, 2), strict=True):
                settling = self._examined(transients[number], after)
                if settling is not None and settling.ran_away:
                    settling = self.settle(states[number])  # the exact flow decides whether it diverges
                if settling is not None:
                    found[number] = settling
        yield from (found[number] for number in range(len(states)))

    def settle(self, state: NDArray[np.float64]) -> Settling:
        """Follow the transient from a state until it has settled, has diverged, or shows no sign of settling.

        It has settled if it returns closely and Newton's method finds a stable orbit there. Earlier than that, it has
        settled if it approaches a known stable orbit from one examination to the next.
        """
        transient = _Transient([state])
        try:
            while self._goes_on(transient.path):
                transient.path += list(self._flow.sample(self._coefficients, transient.path[-1], _STROBES).states[1:])
                entry = self._settled(transient)
                if entry is not None:
                    return Settling(np.array(transient.path), entry)
        except FlowError:
            return Settling(np.array(transient.path), None, ran_away=True)
        return Settling(np.array(transient.path), None)

    def _examined(self, transient: _Transient, after: NDArray[np.float64]) -> Settling | None:
        """Return the outcome of a transient within its next states; None if it should be followed further."""
        for states in np.split(after, len(after) // _EVERY):
            if not self._goes_on(transient.path):
                return Settling(np.array(transient.path), None)
            if not np.isfinite(states).all():
                return Settling(np.array(transient.path), None, ran_away=True)
            transient.path += list(states)
            entry = self._settled(transient)
            if entry is not None:
                return Settling(np.array(transient.path), entry)
        return None

    def _settled(self, transient: _Transient) -> Entry | None:
        """Return the stable orbit on which a transient has settled since the last examination; None if it has not."""
        path = transient.path
        entry, distance = self._catalogue.nearest_stable(path[-1])
        if entry is transient.beside and distance < transient.before <= _NEAR:
            return entry
        transient.beside, transient.before = entry, distance
        period = self._returns(path, transient.finest)
        if period:
            entry = self._orbit_near(path[-1], period)
            if entry is not None:
                return entry
            transient.finest = max(transient.finest / 10.0, _FINEST)
        return None

    def _goes_on(self, path: list[NDArray[np.float64]]) -> bool:
        """Return True if a transient should be followed further: it is still short, or its returns shrink."""
        length = len(path) - 1
        if length < max(self._patience, 4 * self._periods):  # before that there are no two halves to compare
            return True
        if length >= _LONGEST * self._patience:
            return False
        if (length - self._patience) % max(_EVERY, self._patience // _DOUBTS // _EVERY * _EVERY) >= _EVERY:
            return True  # the next examination is not due yet
        half = max(self._patience // 2, 2 * self._periods)
        last, before = self._closeness(path[-half:]), self._closeness(path[-2 * half : -half])
        return last < _SHRINKING * before

    def _closeness(self, path: list[NDArray[np.float64]]) -> float:
        """Return the median distance of returns in a section of the path, for the period that returns most closely."""
        states = np.array(path) / self._catalogue.scales
        returns = [np.abs(states[m:] - states[:-m]).max(axis=1) for m in range(1, self._periods + 1) if m < len(states)]
        return min(float(np.median(each)) for each in returns)

    def _returns(self, path: list[NDArray[np.float64]], finest: float) -> int:
        """Return the smallest number of forcing periods after which the last state recurs within `finest`, or 0."""
        last = np.array(path[-self._periods - 1 :]) / self._catalogue.scales
        distances = np.abs(last[-1] - last[-2::-1]).max(axis=1)
        close = np.flatnonzero(distances <= finest)
        return int(close[0]) + 1 if len(close) else 0

    def _orbit_near(self, state: NDArray[np.float64], period: int) -> Entry | None:
        """Return the stable orbit on which a state that nearly returns has settled."""
        entry, distance = self._catalogue.nearest(state, period)
        if entry is None or distance > _NEAR or not entry.orbit.stable:
            equation = ShootingEquation(self._system, None, period)
            exact = newton_aside(equation, state, self._catalogue.scales, options=Deflation(iterations=8))
            orbit = None if exact is None else exact_orbit(self._system, period, exact)
            if orbit is None:
                return None
            entry = self._catalogue.add(orbit)
            distance = float(np.abs((entry.states - state) / self._catalogue.scales).max(axis=1).min())
        if entry.orbit.stable and distance <= _NEAR:
            return entry
        entry.newton += 1
        return None
