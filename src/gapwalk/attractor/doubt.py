"""The exact flow has the last word: on motions of a regime map that seem not to be periodic, and on those checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.attractor import AttractorKind
from gapwalk.attractor.classify import classify
from gapwalk.attractor.judge import LONGEST_RETURN, Verdicts
from gapwalk.attractor.regime import Regime
from gapwalk.attractor.settle import SettleOptions, settle
from gapwalk.attractor.swarm import ExactSwarm
from gapwalk.errors import FlowError
from gapwalk.model.system import System

Finding = tuple[int, int]
"""A value of `Regime` and a period, 0 for a motion that is not periodic."""

_SLOW = SettleOptions(max_periods=16, max_period=16)
"""For a motion that seems quasi-periodic: it may spiral into an orbit so slowly that it does not come to rest."""

_LOCKED = SettleOptions(max_periods=4 * LONGEST_RETURN, max_period=LONGEST_RETURN)
"""For an undecided motion: it may be locked to a long period."""

_REGIMES = {
    AttractorKind.PERIODIC: Regime.PERIODIC,
    AttractorKind.QUASI_PERIODIC: Regime.QUASI_PERIODIC,
    AttractorKind.CHAOTIC: Regime.CHAOTIC,
    AttractorKind.UNDECIDED: Regime.UNDECIDED,
}


def settle_doubts(verdicts: Verdicts, systems: Sequence[Callable[[], System]]) -> Verdicts:
    """Look for a stable orbit beside each motion that seems quasi-periodic or is undecided.

    Parameters
    ----------
    verdicts
        What the fast flow says.
    systems
        Gives the system of each motion.
    """
    found = verdicts.copy()
    for regime, options in ((Regime.QUASI_PERIODIC, _SLOW), (Regime.UNDECIDED, _LOCKED)):
        for place in np.flatnonzero(verdicts.regimes == regime).tolist():
            system = systems[place]()
            with suppress(FlowError):
                orbit = settle(system, verdicts.states[place], options).orbit
                if orbit is not None:
                    found.regimes[place], found.periods[place] = Regime.PERIODIC, orbit.period
                    found.states[place] = orbit.state
                    if found.peaks.size:
                        contacts = ExactSwarm(system).contacts(orbit.state[None, :], orbit.period)
                        found.peaks[place], found.impacts[place] = contacts.peaks[0], contacts.impacts[0]
    return found


def take_another_look(system: System, state: NDArray[np.float64]) -> Finding:
    """What the motion from a state is by the exact flow."""
    try:
        attractor = classify(system, state)
    except FlowError:
        return int(Regime.RUNAWAY), 0
    is_periodic = attractor.kind is AttractorKind.PERIODIC
    return int(_REGIMES[attractor.kind]), attractor.period if is_periodic else 0
