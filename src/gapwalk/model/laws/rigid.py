"""A rigid stop: impacts with a coefficient of restitution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.law import CLEARANCE, Law
from gapwalk.model.parameter import Parameter


class Rigid(Law):
    """A rigid stop: where the deflection reaches its clearance, the rate is reversed, ``v+ = -restitution v-``.

    Between impacts it has no force. Impacts that follow each other ever faster end in a contact that is held; its force
    is a reaction, and it ends where that force would pull.

    Examples
    --------
    >>> gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8).law
    Rigid()
    """

    name, words = "rigid", "rigid stops with a coefficient of restitution"
    parameters = (Parameter("restitution", None, "it is the rate after an impact over that before it", None, 0.0),)
    stage_parameters = (CLEARANCE,)

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse a restitution that feeds energy in."""
        if not 0.0 <= numbers["restitution"] <= 1.0:
            yield f"restitution is {numbers['restitution']:g}; it must lie between 0 and 1"

    def rebound(self, rate: Any, numbers: Mapping[str, Any]) -> Any:
        """See `Law.rebound`."""
        return -numbers["restitution"] * rate

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """Return 0: its force is an impulse, or a reaction."""
        return 0.0 * rate
