"""Decisions by the exact flow on motions of a regime map: those that seem not to be periodic, and random samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import AttractorKind
from gapwalk.attractors.classify import classify
from gapwalk.attractors.many_motions import ExactMotions
from gapwalk.attractors.regime import Regime
from gapwalk.attractors.regime_judge import LONGEST_RETURN, Verdicts
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.errors import FlowError
from gapwalk.model.system import System

Finding = tuple[int, int]
"""A value of `Regime` and a period, 0 for a motion that is not periodic."""

_SLOW = SettleOptions(max_periods=16, max_period=16)
"""For a motion that seems quasi-periodic: it may spiral into an orbit so slowly that it has not converged yet."""

_LOCKED = SettleOptions(max_periods=4 * LONGEST_RETURN, max_period=LONGEST_RETURN)
"""For an undecided or contracting motion: it may be locked to a long period."""

_CONTRACTING = -1e-3
"""Exponent per forcing period below which a motion that seems quasi-periodic may be locked to a long period."""

_REGIMES = {
    AttractorKind.PERIODIC: Regime.PERIODIC,
    AttractorKind.QUASI_PERIODIC: Regime.QUASI_PERIODIC,
    AttractorKind.CHAOTIC: Regime.CHAOTIC,
    AttractorKind.UNDECIDED: Regime.UNDECIDED,
}


def settle_doubts(verdicts: Verdicts, systems: Sequence[Callable[[], System]]) -> Verdicts:
    """Search for a stable orbit near each motion that seems quasi-periodic or is undecided.

    Parameters
    ----------
    verdicts
        Classification by the fast flow.
    systems
        Functions that return the system of each motion.
    """
    found = verdicts.copy()
    is_locked = (verdicts.regimes == Regime.UNDECIDED) | (verdicts.exponents < _CONTRACTING)
    for place in np.flatnonzero(np.isin(verdicts.regimes, (Regime.QUASI_PERIODIC, Regime.UNDECIDED))).tolist():
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
    try:
        attractor = classify(system, state)
    except FlowError:
        return int(Regime.RUNAWAY), 0
    is_periodic = attractor.kind is AttractorKind.PERIODIC
    return int(_REGIMES[attractor.kind]), attractor.period if is_periodic else 0
