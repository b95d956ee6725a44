"""Figures of a rattling motion: impacts, contact forces, energy loss and impulsiveness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gapwalk.attractors.impact import Impact, damping_power, impacts
from gapwalk.attractors.quadrature import Quadrature, largest, quadrature
from gapwalk.attractors.settled import Settled
from gapwalk.attractors.strobe import check_count
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import signal_factor
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.orbit.orbit import Orbit

_OF_SIDES = ("velocity", "fastest", "peak force", "loss", "costliest")
_OF_CONTACTS = ("peak force", "rms force", "power")
_OF_SIGNALS = ("rms", "peak")
_UNITS = dict(
    zip(
        (*_OF_SIDES, *_OF_CONTACTS[1:], *_OF_SIGNALS),
        ("", "", "N m", "J", "J", "N m", "W", "rad/s^2", "rad/s^2"),
        strict=True,
    )
)
_PERIODS = 256  # forcing periods over which a motion without period is evaluated


@dataclass(frozen=True, slots=True)
class SideRattle:
    """The impacts of one contact on one side.

    Attributes
    ----------
    contact, side
        Name of the contact, and its side: +1 or -1.
    impacts
        Impacts per forcing period.
    velocity, fastest
        Mean and largest approach velocity.
    peak
        Largest magnitude of the contact force.
    loss, costliest
        Mean and largest energy loss of an impact, in units of the contact force times the deflection.
    """

    contact: str
    side: int
    impacts: float
    velocity: float
    fastest: float
    peak: float
    loss: float
    costliest: float


@dataclass(frozen=True, slots=True)
class ContactLoad:
    """The force of one contact over the whole motion.

    Attributes
    ----------
    contact
        Name of the contact.
    closed
        Fraction of the time for which it is closed.
    peak, rms
        Largest magnitude and root mean square of its force.
    power
        Mean power dissipated by its damping law.
    """

    contact: str
    closed: float
    peak: float
    rms: float
    power: float


@dataclass(frozen=True, slots=True)
class Impulsiveness:
    """The impulsiveness of the acceleration of one coordinate.

    Attributes
    ----------
    coordinate
        Name of the coordinate.
    rms, peak
        Root mean square and largest magnitude of its acceleration, about its mean (zero for a settled motion).
    crest
        Crest factor, peak over rms (ISO 2631-1:1997, there of the weighted acceleration): 1.41 for a harmonic motion.
    kurtosis
        Fourth moment over the square of the second (Dyer and Stewart 1978, J. Mech. Des. 100, 229-235): 1.5 for a
        harmonic motion, 3 for Gaussian noise, more for rattle.
    """

    coordinate: str
    rms: float
    peak: float
    crest: float
    kurtosis: float


@dataclass(frozen=True, repr=False)
class Rattle:
    """Impacts, contact forces, energy and impulsiveness of one settled motion. It prints as three tables.

    Attributes
    ----------
    system
        The system that moves.
    periods
        Number of forcing periods that were evaluated.
    sides
        Impacts by contact and side.
    contacts
        Forces by contact.
    coordinates
        Impulsiveness by coordinate. The kurtosis of the acceleration serves as the rattle index.
    impacts
        All impacts.

    Notes
    -----
    In a system with units, velocities are in the unit of angles per second, accelerations in rad/s^2, forces in N m,
    energies in J, and powers in W.
    """

    system: System
    periods: int
    sides: tuple[SideRattle, ...]
    contacts: tuple[ContactLoad, ...]
    coordinates: tuple[Impulsiveness, ...]
    impacts: tuple[Impact, ...]

    @property
    def index(self) -> float:
        """The rattle index: the largest kurtosis of any coordinate's acceleration."""
        return max(each.kurtosis for each in self.coordinates)

    def __repr__(self) -> str:
        sides = [
            (f"{s.contact} {s.side:+d}", s.impacts, s.velocity, s.fastest, s.peak, s.loss, s.costliest)
            for s in self.sides
        ]
        loads = [(c.contact, c.closed, c.peak, c.rms, c.power) for c in self.contacts]
        units = self.system.units
        signals = [(f"{c.coordinate}''", c.rms, c.peak, c.crest, c.kurtosis) for c in self.coordinates]
        return "\n\n".join(
            (
                _table(_headed(("impacts", "a period", *_OF_SIDES), units), sides),
                _table(_headed(("contact", "closed", *_OF_CONTACTS), units), loads),
                _table(_headed(("signal", *_OF_SIGNALS, "crest factor", "kurtosis"), units), signals),
            )
        )


def rattle(motion: Orbit | Settled, periods: int = _PERIODS) -> Rattle:
    """Compute impacts, contact forces, energy and impulsiveness of a settled motion.

    Parameters
    ----------
    motion
        An orbit or a settled motion.
    periods
        Forcing periods over which a motion without period is evaluated; an orbit is evaluated over its own period.

    Raises
    ------
    FlowError
        If the motion diverges.
    """
    check_count("periods", periods)
    system, period = motion.system, motion.period
    along = quadrature(system, motion.state, period or periods)
    if period:  # two periods, so that an impact across the end is complete
        twice = impacts(system, quadrature(system, motion.state, 2 * period))
        found = _once(twice, PERIOD * period)
    else:
        found = impacts(system, along)
    length, found = period or periods, _in_units(system, found)
    return Rattle(
        system, length, _sides(system, found, length), _loads(system, along, found), _impulsiveness(along), found
    )


def _in_units(system: System, found: tuple[Impact, ...]) -> tuple[Impact, ...]:
    """Convert the energies of impacts to J if the system has units; velocities stay as in states."""
    if system.units is None:
        return found
    unit = system.units.angle
    return tuple(replace(each, loss=unit * each.loss) for each in found)


def _once(found: tuple[Impact, ...], end: float) -> tuple[Impact, ...]:
    """Select the impacts of two periods that begin in the first one, so that each appears once."""
    return tuple(impact for impact in found if impact.theta < end)


def _sides(system: System, found: tuple[Impact, ...], periods: int) -> tuple[SideRattle, ...]:
    rows = []
    for contact in system.structure.contacts:
        for side in _sides_of(contact):
            own = [impact for impact in found if impact.contact == contact.name and impact.side == side]
            velocity, peak, loss = (
                np.array([getattr(impact, name) for impact in own] or [0.0]) for name in ("velocity", "peak", "loss")
            )
            means = float(velocity.mean()), float(velocity.max()), float(peak.max()), float(loss.mean())
            rows.append(SideRattle(contact.name, side, len(own) / periods, *means, float(loss.max())))
    return tuple(rows)


def _sides_of(contact: ContactForm) -> list[int]:
    return [side for side in (1, -1) if any(side in stage.side.signs for stage in contact.stages)]


def _loads(system: System, along: Quadrature, found: tuple[Impact, ...]) -> tuple[ContactLoad, ...]:
    forces, share = along.motion.forces, along.weights / along.weights.sum()
    rms, power = np.sqrt(share @ forces**2), share @ damping_power(system, along)
    closed = share @ (forces != 0.0)
    unit = 1.0 if system.units is None else system.units.angle  # a torque times a velocity is in W
    rows = []
    for k, contact in enumerate(system.structure.contacts):
        peaks = [impact.peak for impact in found if impact.contact == contact.name]
        peak = max([float(np.abs(forces[:, k]).max()), *peaks])
        rows.append(ContactLoad(contact.name, float(closed[k]), peak, float(rms[k]), unit * float(power[k])))
    return tuple(rows)


def _impulsiveness(along: Quadrature) -> tuple[Impulsiveness, ...]:
    share = along.weights / along.weights.sum()
    mean = share @ along.motion.a
    varying = along.motion.a - mean
    second, fourth = share @ varying**2, share @ varying**4
    nodes = np.arange(len(share))
    rows = []
    unit = signal_factor(along.motion.system, "''")
    for k, name in enumerate(along.motion.system.coordinates):
        rms = unit * float(np.sqrt(second[k]))
        peak = unit * largest(along, nodes, lambda motion, k=k: np.abs(motion.a[:, k] - mean[k]))
        crest, kurtosis = (peak / rms, float(fourth[k] / second[k] ** 2)) if rms > 0.0 else (0.0, 0.0)
        rows.append(Impulsiveness(name, rms, peak, crest, kurtosis))
    return tuple(rows)


def _headed(head: tuple[str, ...], units: Units | None) -> tuple[str, ...]:
    """Add the units to the headings of the columns."""
    if units is None:
        return head
    known = _UNITS | dict.fromkeys(_OF_SIDES[:2], units.state("'"))
    return tuple(f"{name} [{known[name]}]" if name in known else name for name in head)


def _table(head: tuple[str, ...], rows: list[tuple]) -> str:
    """Format a text table: first column flush left, numbers flush right."""
    cells = [head, *((row[0], *(f"{value:.4g}" for value in row[1:])) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))])
        for row in cells
    ]
    return "\n".join(line.rstrip() for line in lines)
