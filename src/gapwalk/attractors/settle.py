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
from gapwalk.attractors.section import Strobe, check_count, size_of
from gapwalk.attractors.settling_judge import TOLERANCES, Drift, drift_of, exact_returns, recurrences
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

    Examples
    --------
    >>> gw.settle(system, options=gw.SettleOptions(tolerance=1e-3)).converged
    True
    """

    #: The most forcing periods of the transient (some more may pass while it is compared with an orbit).
    max_periods: int = 20_000
    max_period: int = 64  #: The longest period m of the orbits that are searched for.
    #: Drift of the motion's averages, relative to its size, below which a motion that is not periodic counts as
    #: settled; a chaotic one may drift by four standard errors.
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

    Returns
    -------
    Settled
        The motion after its transient.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.

    Notes
    -----
    Averages of a motion that is not periodic: Das, Saiki, Sander and Yorke (2017), Nonlinearity 30, 4111-4140; their
    errors for chaotic motion: Flyvbjerg and Petersen (1989), Journal of Chemical Physics 91, 461-466.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=0.5
    ... )
    >>> gw.settle(mass).orbit.period
    1
    """
    check_system(system, "settle")
    options = options or SettleOptions()
    system = system.at(at, **values)
    return _Transient(system, initial_state(system, start), options).follow()


class _Transient:
    """A transient that is being followed, with its strobes since the start or since it was displaced."""

    def __init__(self, system: System, state: NDArray[np.float64], options: SettleOptions) -> None:
        self.strobe, self.options = Strobe(system), options
        self.states, self.periods = state[None, :], 0
        self.drift = Drift(np.inf, np.inf, irregular=False, steady=False)
        self.notes: list[str] = []
        self.largest = 0.0  # size of the motion so far

    def follow(self) -> Settled:
        """Test the motion at growing intervals until it is decided to which motion it leads."""
        target, options = _FIRST, self.options
        while True:
            self._advance(min(target, options.max_periods) - self.periods)
            approach = self._look()
            if approach is not None:
                orbit, rate = approach.orbit, float(np.abs(approach.orbit.free_multipliers).max())
                how = f"it is {approach.distance:.1e} from a stable orbit of period {orbit.period}"
                how += f" (largest multiplier {rate:.6g}) and contracts to it"
                return self._record(True, orbit, approach.distance, how)
            if self._is_stationary():
                return self._record(True, None, self.drift.change, self.drift.text(options.tolerance))
            if self.periods >= options.max_periods:
                unsettled = f"it had not settled after {self.periods} forcing periods; raise max_periods"
                return self._record(False, None, self.drift.change, unsettled)
            target = self.periods + max(_FIRST, self.periods // 2)

    def _advance(self, count: int) -> None:
        if count > 0:
            more = self.strobe.run(self.states[-1], count)
            self.states, self.periods = np.vstack((self.states, more)), self.periods + count
            self.largest = float(size_of(self.strobe.system, more, self.largest)[0])

    def _look(self) -> Approach | None:
        """Search for orbits of the promising periods, always including period 1; test stable orbits first."""
        tail, least = self.states[-4 * self.options.max_period :], _REST * self.largest
        scaled = tail / size_of(self.strobe.system, tail)
        periods = {1, *(each.period for each in recurrences(scaled, self.options.max_period, TOLERANCES.promising))}
        nearby = [nearby_orbit(self.strobe, tail[-1], period, least) for period in sorted(periods)]
        for orbit in sorted((orbit for orbit in nearby if orbit is not None), key=lambda orbit: not orbit.stable):
            approach = watch(self.strobe, tail[-1], orbit, least)
            if approach.converging or approach.leaving:
                self.states = np.vstack((self.states, approach.strobes))
                self.periods += len(approach.strobes)
            if approach.converging:
                return approach
            if approach.leaving:
                # a motion that starts next to an unstable orbit looks settled until it has left that orbit
                if approach.distance < _FAR:
                    self.notes.append(f"it was displaced from an unstable motion of period {orbit.period} next to it")
                    # forget the states before: the motion restarts here, at the same phase
                    self.states = pushed_off(orbit, self.states[-1], least)[None, :]
                return None
        return None

    def _is_stationary(self) -> bool:
        if len(self.states) <= _STATIONARY:
            return False
        tail = self.states[-(len(self.states) // 2) :]
        self.drift = drift_of(tail / size_of(self.strobe.system, tail), self.options.max_period)
        return self.drift.is_settled(self.options.tolerance)

    def _record(self, converged: bool, orbit: Orbit | None, residual: float, how: str) -> Settled:
        kept, evidence = self.states[-_KEPT:].copy(), (*self.notes, how)
        if orbit is None:  # its period may be longer than those that were searched for
            found = exact_returns(self.strobe.system, kept[len(kept) // 2 :])
            for period, away in [each for each in found if each.period > self.options.max_period][:1]:
                evidence += (f"it returns to {away:.1e} after {period} forcing periods: raise max_period",)
        return Settled(self.strobe.system, kept, self.periods, converged, orbit, float(residual), evidence)
