"""Settling: follow a transient just long enough to decide to which motion it leads.

The numbers of forcing periods after which a motion nearly returns are candidates for its period. A motion that is not
periodic has settled if averages over it no longer change.

Method: docs/numerics/attractors.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Settled
from gapwalk.attractors.convergence import TOLERANCES, Drift, drift_of, recurrences
from gapwalk.attractors.section import Strobe, check_count, size_of
from gapwalk.attractors.trapping_region import Approach, nearby_orbit, pushed_off, watch
from gapwalk.errors import ModelError
from gapwalk.model.system import System, check_system
from gapwalk.orbit.find import initial_state
from gapwalk.orbit.orbit import Orbit

_FIRST = 8  # forcing periods before the first test; the total grows by half before each further test
_STATIONARY = 1024  # the fewest forcing periods after which a motion may count as settled without being periodic
_REST = 1e-3  # size of a motion, relative to the largest so far, below which it may approach a static equilibrium
_KEPT = 1024  # strobes stored in the record
_FAR = 0.01  # distance from an unstable orbit, relative to the motion, above which the motion is not displaced


@dataclass(frozen=True, slots=True)
class SettleOptions:
    """Options of the transient and of the test for settling.

    Parameters
    ----------
    max_periods
        The most forcing periods of the transient (some more may pass while it is compared with an orbit).
    max_period
        The longest period m of the orbits that are searched for.
    tolerance
        Drift of the motion's averages, relative to its size, below which a motion that is not periodic counts as
        settled; a chaotic one may drift by four standard errors.
    """

    max_periods: int = 20_000
    max_period: int = 64
    tolerance: float = 1e-5

    def __post_init__(self) -> None:
        check_count("max_periods", self.max_periods)
        check_count("max_period", self.max_period)
        if not 0.0 < self.tolerance <= 0.1:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 0 and 0.1")


def settle(
    system: System,
    start: str | Sequence[float] | NDArray[np.float64] = "rest",
    options: SettleOptions | None = None,
    *,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Settled:
    """Follow a motion until it has settled.

    A motion is recognised as periodic by the stable orbit next to it and by several returns that contract to this orbit
    as its linearised return map predicts. So a slow transient near a flip or a fold is not mistaken for another motion,
    and the orbit is exact. Any other motion counts as settled when the averages over its last two quarters agree.

    Parameters
    ----------
    system
        The system.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        Length of the transient, and the tests that end it.
    at, **values
        Parameter values to change first: ``settle(system, frequency=0.45)``.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.
    """
    check_system(system, "settle")
    options = options or SettleOptions()
    system = system.at(at, **values)
    return _Transient(system, initial_state(system, start), options).follow()


class _Transient:
    """A transient that is being followed."""

    def __init__(self, system: System, state: NDArray[np.float64], options: SettleOptions) -> None:
        self.strobe, self.options = Strobe(system), options
        self.blocks = [state[None, :]]
        self.periods, self.drift = 0, Drift(np.inf, np.inf, irregular=False, steady=False)
        self.notes: list[str] = []
        self.largest = 0.0  # size of the motion so far

    def follow(self) -> Settled:
        """Test the motion at growing intervals until it is decided to which motion it leads."""
        target = _FIRST
        while True:
            self._advance(min(target, self.options.max_periods) - self.periods)
            approach = self._look()
            if approach is not None:
                return self._arrived(approach)
            if self._is_stationary():
                words = self._words(self.drift.text(self.options.tolerance), *self._returns())
                return self._record(True, None, self.drift.change, words)
            if self.periods >= self.options.max_periods:
                unsettled = f"it had not settled after {self.periods} forcing periods; raise max_periods"
                return self._record(False, None, self.drift.change, self._words(unsettled, *self._returns()))
            target = self.periods + max(_FIRST, self.periods // 2)

    @property
    def state(self) -> NDArray[np.float64]:
        return next(block[-1] for block in reversed(self.blocks) if len(block))

    def _advance(self, count: int) -> None:
        if count > 0:
            self.blocks.append(self.strobe.run(self.state, count))
            self.periods += count
            self.largest = float(size_of(self.strobe.system, self.blocks[-1], self.largest)[0])

    def _tail(self, count: int) -> NDArray[np.float64]:
        states = np.concatenate(self.blocks)
        self.blocks = [states]
        return states[-count:]

    def _look(self) -> Approach | None:
        """Search for orbits of the promising periods, always including period 1; test stable orbits first."""
        tail = self._tail(4 * self.options.max_period)
        scaled, least = tail / size_of(self.strobe.system, tail), _REST * self.largest
        periods = {1, *(each.period for each in recurrences(scaled, self.options.max_period, TOLERANCES.promising))}
        nearby = [nearby_orbit(self.strobe, self.state, period, least) for period in sorted(periods)]
        for orbit in sorted((orbit for orbit in nearby if orbit is not None), key=lambda orbit: not orbit.stable):
            approach = watch(self.strobe, tail[-1], orbit, least)
            if approach.converging or approach.leaving:
                self.blocks.append(approach.strobes)
                self.periods += len(approach.strobes)
            if approach.converging:
                return approach
            if approach.leaving:
                self._leave(approach)
                return None
        return None

    def _leave(self, approach: Approach) -> None:
        """Displace the motion from an unstable orbit, unless it is already far enough away.

        A motion that starts next to an unstable orbit looks settled until it has left that orbit.
        """
        if approach.distance >= _FAR:
            return
        self.notes.append(f"it was displaced from an unstable motion of period {approach.orbit.period} next to it")
        # forget the states before: the motion restarts here, at the same phase
        self.blocks = [pushed_off(approach.orbit, self.state, _REST * self.largest)[None, :]]

    def _is_stationary(self) -> bool:
        remembered = sum(map(len, self.blocks))
        if remembered <= _STATIONARY:
            return False
        tail = self._tail(remembered // 2)
        scaled = tail / size_of(self.strobe.system, tail)
        self.drift = drift_of(scaled, self.options.max_period)
        return self.drift.is_settled(self.options.tolerance)

    def _arrived(self, approach: Approach) -> Settled:
        orbit, rate = approach.orbit, float(np.abs(approach.orbit.multipliers).max())
        how = (
            f"it is {approach.distance:.1e} from a stable orbit of period {orbit.period} (largest multiplier "
            f"{rate:.6g}) and contracts to it"
        )
        return self._record(True, orbit, approach.distance, self._words(how))

    def _words(self, *more: str) -> tuple[str, ...]:
        return (*self.notes, *more)

    def _returns(self) -> tuple[str, ...]:
        """Report a period longer than those that were searched for, if the motion has one."""
        tail = self._tail(_KEPT)
        tail = tail[len(tail) // 2 :]
        tail = tail - tail.mean(axis=0)
        found = recurrences(tail / size_of(self.strobe.system, tail), len(tail) // 2, TOLERANCES.exact)
        longer = [each for each in found if each.period > self.options.max_period]
        return tuple(f"it returns to {d:.1e} after {m} forcing periods: raise max_period" for m, d in longer[:1])

    def _record(self, converged: bool, orbit: Orbit | None, residual: float, evidence: tuple[str, ...]) -> Settled:
        kept = self._tail(_KEPT).copy()
        return Settled(self.strobe.system, kept, self.periods, converged, orbit, float(residual), evidence)
