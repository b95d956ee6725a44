"""Verification of tori: another integrator carries their curves into themselves, and contracts volumes as stated.

The phases at which a curve is tried lie between its samples. Method: docs/numerics/tori.md
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gapwalk.attractors.section import Strobe
from gapwalk.orbit.orbit import Orbit
from gapwalk.tori.closed_curve import TURN, at_phases
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_family import TorusFamily
from gapwalk.verification.dop853 import carry
from gapwalk.verification.verification import Advance, Check, Ledger, Spot

_LEAST = 1e-9  # error of the other integrator, relative to the motion
_PHASES = 65  # the most phases at which a curve is tried
_BETWEEN = 0.37  # their place between the samples
_GROWTH = 1e-5  # error of a sum of exponents, beside the stated one


def verify_families(ledger: Ledger, named: Iterable[tuple[str, TorusFamily]], report: Advance | None = None) -> None:
    """Verify all tori of some families."""
    tori = [(name, place, point) for name, family in named for place, point in enumerate(family.points)]
    for count, (name, place, point) in enumerate(tori, start=1):
        verify_torus(ledger, point.torus, Spot(name, f"torus {place}", point.value))
        if report is not None:
            report("tori", count, len(tori))


def verify_torus(ledger: Ledger, torus: Torus, spot: Spot) -> None:
    """Enter how far another integrator carries phases between the samples from the curve, in units of its stated error.

    The sum of the exponents must be the mean of the logarithm by which it finds volumes to change.
    """
    count = min(torus.count, _PHASES)
    psi = TURN * (np.arange(count) + _BETWEEN) / count
    system, strobe = torus.system, Strobe(torus.system)
    starts, unit = at_phases(torus.states, psi), system.state_scales()
    motions, blank = [], np.zeros(system.state_size, complex)
    for state in starts:
        arc = strobe.arc(state, torus.curves)
        motions.append(Orbit(system, torus.curves, state, blank, tuple(arc.contacts), math.inf, arc.steps))
    rounds = carry(motions, closes=False)
    reached = np.array([each.end for each in rounds])
    expected = at_phases(torus.states, psi + TURN * torus.rotation)
    away = float(np.abs((reached - expected) / unit).max() / np.abs(torus.states / unit).max())
    ledger.enter(Check.INVARIANCE, spot, away / (2.0 * torus.error + _LEAST), f"{away:.1e} of the motion")
    contractions = np.array([each.contraction for each in rounds])
    off = abs(float(contractions.mean() - torus.exponents.sum()))
    # where a contact grazes, the mean over few phases is inaccurate itself: those over every other phase tell how much
    rough = abs(float(contractions[::2].mean() - contractions[1::2].mean()))
    allowed = _GROWTH + 3.0 * torus.exponent_error * len(torus.exponents) + rough
    ledger.enter(Check.VOLUME, spot, Check.VOLUME.bound * off / allowed, f"{off:.1e} in the sum of exponents")
