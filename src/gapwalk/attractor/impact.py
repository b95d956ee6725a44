"""Impacts: each time that a contact closes, with its approach velocity, its peak force and the energy it costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.quadrature import Quadrature, largest
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.motion.forces import contact_deflections, contact_forces
from gapwalk.motion.motion import switch_names
from gapwalk.motion.switching import ContactEvent


@dataclass(frozen=True, slots=True)
class Impact:
    """One closing of the innermost stage of a contact, to its next opening.

    Attributes
    ----------
    contact, side
        Which contact, and on which side: +1 or -1.
    theta
        When it closes, in radians of the excitation.
    duration
        How long it stays closed, in units of time.
    velocity
        Approach velocity: the size of the rate of the deflection when it closes.
    peak
        The largest size of the contact force.
    loss
        Energy lost: the integral over the closure of the force of the damping law times the rate of the deflection, in
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
    """The impacts of a motion that close and open again within it, in the order of their closing.

    Integrate an orbit over two of its periods to see those that last across its end.
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
    """Power that the damping law of each contact takes out at each node, shape (nodes, contacts)."""
    layout, coefficients, motion = layout_of(system.structure), coefficients_of(system), along.motion
    springs = contact_forces(layout, coefficients, motion.q, np.zeros_like(motion.v))
    rates = contact_deflections(layout, coefficients, motion.v)
    return (motion.forces - springs) * rates


def _innermost(system: System) -> list[tuple[str, int, int]]:
    """Contact, side and switch of the innermost stage on each side of each contact."""
    found: dict[tuple[str, int], int] = {}
    for switch, (contact, _, side) in enumerate(switch_names(system)):
        found.setdefault((contact, side), switch)
    return [(contact, side, switch) for (contact, side), switch in found.items()]


def _closures(events: Sequence[ContactEvent], switch: int) -> list[tuple[ContactEvent, ContactEvent]]:
    """Each closing of one switch with the opening that follows it."""
    own = [event for event in events if event.switch == switch]
    return [(one, other) for one, other in pairwise(own) if one.enters and not other.enters]


def _peak(along: Quadrature, inside: NDArray[np.intp], place: int) -> float:
    return largest(along, inside, lambda motion: np.abs(motion.forces[:, place]))
