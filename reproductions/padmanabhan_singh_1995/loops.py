"""The force of a contact under a harmonic deflection by both damping laws, as figure 1 of the paper compares them."""

from __future__ import annotations

from gapwalk.model.contact import Contact, DampingLaw, Side, Stage
from gapwalk.motion.hysteresis import Hysteresis, hysteresis

VISCOUS, IMPACT = "viscous damping", "impact damping"

_STOP = (Stage(clearance=1.0, side=Side.POSITIVE),)
_BETA = 0.5  # larger than in any set of the paper, for the loop to be seen
_AMPLITUDE = 2.0  # twice the clearance


def _loops() -> dict[str, Hysteresis]:
    """Both loops; the damper costs as much a cycle as the impact damping, which is what makes them comparable."""
    impact = hysteresis(Contact("stop", {"x": 1.0}, _STOP, None, DampingLaw.HUNT_CROSSLEY, _BETA), _AMPLITUDE)
    unit = hysteresis(Contact("stop", {"x": 1.0}, _STOP, None, DampingLaw.VISCOUS, 0.0, 1.0), _AMPLITUDE)
    damper = impact.loss / unit.loss
    viscous = hysteresis(Contact("stop", {"x": 1.0}, _STOP, None, DampingLaw.VISCOUS, 0.0, damper), _AMPLITUDE)
    return {VISCOUS: viscous, IMPACT: impact}


LOOPS = _loops()
"""By the names of the laws. The paper prints no numbers for them; the clearance is 1, as in its tables."""
