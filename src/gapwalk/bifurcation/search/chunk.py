"""One piece of a search: a block of starts at one value of the parameter, worked off by a pure function."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.search.catalogue import Catalogue, Entry, exact_orbit
from gapwalk.bifurcation.search.deflation import newton_aside
from gapwalk.bifurcation.search.options import SearchOptions
from gapwalk.bifurcation.search.settling import Settler, Settling
from gapwalk.bifurcation.search.starts import generator
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation

_EARLY = 1  # forcing periods after which the state of a transient is a start of Newton's method for short periods
_SHORT = 3  # the longest of them
_LATE = 2  # forcing periods, besides those sought, after which it is a start for any
_THERE = 1e-2  # distance from a known orbit within which Newton's method would only come back to it
_FEW = 0.25  # share of the starts that get more patience if no more than that have not settled
_PATIENCE = 5  # times the patience that they get
_MOST = 40  # new orbits beside which others are looked for: without damping there are whole families of them
_KICK = 0.1  # how far from a known orbit the search for its neighbours begins, in half-widths of the box


@dataclass(frozen=True, eq=False)
class Chunk:
    """A block of starts at one value of the parameter.

    Attributes
    ----------
    value
        The value of the parameter.
    block
        Number of the block among those of this value.
    system
        The system at that value.
    box : shape (2n,)
        Half-widths of the box of states.
    starts : shape (count, 2n)
        The starts.
    known
        Orbits that are known to exist at that value.
    options
        How thoroughly to search.
    """

    value: float
    block: int
    system: System
    box: NDArray[np.float64]
    starts: NDArray[np.float64]
    known: tuple[Orbit, ...]
    options: SearchOptions


@dataclass(frozen=True, eq=False)
class Catch:
    """What one chunk has found: orbits with their hits from transients and from Newton's method, and the rest.

    Attributes
    ----------
    orbits
        Each orbit with the number of transients that settled to it, and of Newton's iterations that ended on it.
    unsettled : shape (count, 2n)
        Last states of the transients that did not become periodic.
    ran_away
        Transients that could not be followed.
    newton_starts
        How often Newton's method was started.
    """

    orbits: tuple[tuple[Orbit, int, int], ...]
    unsettled: NDArray[np.float64]
    ran_away: int
    newton_starts: int


def search_chunk(chunk: Chunk) -> Catch:
    """Work off one chunk. The result depends on the chunk alone, so chunks can be mapped over processes.

    Every start is let settle. From the transients, states by the way are starts of Newton's method for orbits of
    several periods, stable or not. Last, Newton's method with deflation looks for orbits beside each new one.
    """
    hunt, options = _Hunt(chunk), chunk.options
    settler = Settler(chunk.system, hunt.catalogue, options.periods, options.patience)
    every = math.ceil(options.starts / options.newton_starts) if options.newton_starts else 0
    unsettled, ran_away = [], 0
    for number, start in enumerate(chunk.starts, chunk.block * options.block):
        settling = settler.settle(start)
        if settling.entry is not None:
            settling.entry.settled += 1
        elif settling.ran_away:
            ran_away += 1
        else:
            unsettled.append(settling.path[-1])
        if every and number % every == 0:
            hunt.along(number // every, settling)
    if len(unsettled) <= _FEW * len(
        chunk.starts
    ):  # where most have settled, a few may be lingering by a chaotic saddle
        unsettled = _settled_late(unsettled, chunk, hunt.catalogue)
    if every:
        hunt.beside()
    found = tuple((entry.orbit, entry.settled, entry.newton) for entry in hunt.catalogue.entries)
    last = np.array(unsettled).reshape(-1, len(chunk.box))
    return Catch(tuple(each for each in found if each[1] or each[2]), last, ran_away, hunt.tried)


def _settled_late(states: list[NDArray[np.float64]], chunk: Chunk, catalogue: Catalogue) -> list[NDArray[np.float64]]:
    """Follow transients on with more patience; the last states of those that have not settled even so."""
    settler = Settler(chunk.system, catalogue, chunk.options.periods, _PATIENCE * chunk.options.patience)
    unsettled = []
    for state in states:
        settling = settler.settle(state)
        if settling.entry is None:
            unsettled.append(settling.path[-1])
        else:
            settling.entry.settled += 1
    return unsettled


class _Hunt:
    """Looks for orbits, stable or not, by Newton's method."""

    def __init__(self, chunk: Chunk) -> None:
        self._chunk = chunk
        self._random = generator(chunk.options.seed, chunk.value, chunk.block + 1)
        self._equations: dict[int, ShootingEquation] = {}
        self.catalogue = Catalogue(chunk.box)
        self.tried = 0
        for orbit in chunk.known:
            self.catalogue.add(orbit)
        self._known = len(self.catalogue.entries)

    def along(self, number: int, settling: Settling) -> None:
        """From states along a transient; where it has not settled, from where it came back most closely too.

        One transient in m serves period m, so that all periods have the same time. Newton's method for long periods
        reaches less far, so it begins later, when the transient is nearer to where it leads; that for short periods
        begins early too, where it may reach orbits from which the transient leads away.
        """
        path = settling.path
        for period in self._chunk.options.newton_periods:
            if number % period:
                continue
            for place in (_EARLY, _LATE + period)[period > _SHORT :]:
                state = path[min(place, len(path) - 1)]
                if self.catalogue.nearest(state, period)[1] > _THERE:
                    self._try(state, period)
            if settling.entry is None and len(path) > 2 * period:
                returns = np.abs((path[period:] - path[:-period]) / self._chunk.box).max(axis=1)
                self._try(path[int(np.argmin(returns))], period)

    def beside(self) -> None:
        """From a little beside each orbit met, all known ones deflated: where one is, a partner is often near.

        Not beside those that were known before: what is near them is on their branches, or attached to these.
        """
        done = self._known
        while done < min(len(self.catalogue.entries), self._known + _MOST):  # it grows
            orbit = self.catalogue.entries[done].orbit
            kick = self._random.normal(size=len(orbit.state))
            kick *= _KICK / np.linalg.norm(kick)
            self._try(orbit.state + kick * self._chunk.box, orbit.period, self.catalogue.states(orbit.period))
            done += 1

    def _try(self, start: NDArray[np.float64], period: int, known: NDArray[np.float64] | None = None) -> None:
        """Newton's method from a start, given up where it leads to an orbit that was met before."""
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
