"""Impacts: closings of a contact, each with its approach velocity, peak force and energy loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.quadrature import Quadrature, largest
from gapwalk.flow.forces import contact_deflections, contact_forces
from gapwalk.flow.motion import switch_names
from gapwalk.flow.switching import ContactEvent
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System


@dataclass(frozen=True, slots=True)
class Impact:
    """One closure of the innermost stage of a contact, from closing to opening.

    Attributes
    ----------
    contact, side
        Name of the contact, and its side: +1 or -1.
    theta
        Angle of the excitation at closing, in radians.
    duration
        Duration of the closure, in units of time.
    velocity
        Approach velocity: magnitude of the rate of the deflection at closing.
    peak
        Largest magnitude of the contact force.
    loss
        Energy loss: the integral over the closure of the force of the damping law times the rate of the deflection, in
        units of the contact force times the deflection.
    """

    contact: str
    side: int
    theta: float
    duration: float
    velocity: float
    peak: float
    loss: float


def impacts(system: System, along: Quadrature) -> tuple[Impact, ...]:
    """Return the impacts that begin and end within a motion, in the order of their closing.

    To include impacts that last across the end of an orbit, integrate the orbit over two of its periods.
    """
    losses = damping_power(system, along) * along.weights[:, None]
    names = [form.name for form in system.structure.contacts]
    found = []
    for contact, side, switch in _innermost(system):
        place = names.index(contact)
        for closes, opens in _closures(along.motion.events, switch):
            inside = np.flatnonzero((along.motion.theta > closes.theta) & (along.motion.theta < opens.theta))
            duration = (opens.theta - closes.theta) / system.frequency
            peak, loss = _peak(along, inside, place), float(losses[inside, place].sum())
            found.append(Impact(contact, side, closes.theta, duration, abs(closes.velocity), peak, loss))
    return tuple(sorted(found, key=lambda impact: impact.theta))


def damping_power(system: System, along: Quadrature) -> NDArray[np.float64]:
    """Compute the power dissipated by the damping law of each contact at each node, shape (nodes, contacts)."""
    layout, coefficients, motion = layout_of(system.structure), coefficients_of(system), along.motion
    springs = contact_forces(layout, coefficients, motion.q, np.zeros_like(motion.v))
    rates = contact_deflections(layout, coefficients, motion.v)
    return (motion.forces - springs) * rates


def _innermost(system: System) -> list[tuple[str, int, int]]:
    """List contact, side and switch of the innermost stage on each side of each contact."""
    found: dict[tuple[str, int], int] = {}
    for switch, (contact, _, side) in enumerate(switch_names(system)):
        found.setdefault((contact, side), switch)
    return [(contact, side, switch) for (contact, side), switch in found.items()]


def _closures(events: Sequence[ContactEvent], switch: int) -> list[tuple[ContactEvent, ContactEvent]]:
    """Pair each closing of one switch with the opening that follows it."""
    own = [event for event in events if event.switch == switch]
    return [(one, other) for one, other in pairwise(own) if one.enters and not other.enters]


def _peak(along: Quadrature, inside: NDArray[np.intp], place: int) -> float:
    return largest(along, inside, lambda motion: np.abs(motion.forces[:, place]))
