"""Figures of a rattling motion: impacts, contact forces, energy loss and impulsiveness.

An impact is a closing of a contact, with its approach velocity, peak force and energy loss. Integrals along the motion
are accurate to rounding by Gauss's rule, since it is analytic between contact events, kinks of laws and jumps of loads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.settle import Settled
from gapwalk.errors import ModelError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles, contact_deflections, contact_force
from gapwalk.flow.motion import Quadrature, acceleration_names, quadrature, signal_factor, switch_names
from gapwalk.model.bounds import Counted, check
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System
from gapwalk.orbit.energy import impact_losses
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows, SummaryText, Table

_PERIODS = 256  # forcing periods over which a motion without period is evaluated


@dataclass(frozen=True, repr=False)
class Rattle:
    """Impacts, contact forces, energy and impulsiveness of one settled motion. It prints as three tables.

    Notes
    -----
    In a system with units, velocities are in the unit of angles per second, accelerations in rad/s^2, forces in N m,
    energies in J, and powers in W.
    """

    system: System  #: The system that moves.
    periods: int  #: Number of forcing periods that were evaluated.
    sides: tuple[SideRattle, ...]  #: Impacts by contact and side.
    contacts: tuple[ContactLoad, ...]  #: Forces by contact.
    #: Impulsiveness by coordinate, then, in a drive train, by inertia (``gear1.acceleration``). The kurtosis of the
    #: acceleration of a coordinate serves as the rattle index.
    coordinates: tuple[Impulsiveness, ...]
    impacts: tuple[Impact, ...]  #: All impacts.

    @property
    def index(self) -> float:
        """The rattle index: the largest kurtosis of any coordinate's acceleration; nan where one has impulses."""
        return float(np.max([each.kurtosis for each in self.coordinates[: self.system.size]]))

    def summary(self) -> SummaryText:
        """Return the tables of impacts, of forces and of accelerations."""
        units = self.system.units
        velocity = units.state("'") if units else ""

        def of(name: str, unit: str) -> str:
            return f">{name} [{unit}]" if units else f">{name}"

        peak = of("peak force", "N m")
        speeds, losses = (of("velocity", velocity), of("fastest", velocity)), (of("loss", "J"), of("costliest", "J"))
        sides = [
            (s.contact, f"{s.side:+d}", s.impacts, s.velocity, s.fastest, s.peak, s.impulse, s.loss, s.costliest)
            for s in self.sides
        ]
        loads = [(c.contact, c.closed, c.peak, c.rms, c.power) for c in self.contacts]
        signals = [(self._signal(k), c.rms, c.peak, c.crest, c.kurtosis) for k, c in enumerate(self.coordinates)]
        named = [(f"{name} [{units.signal(name)[1]}]" if units else name, *row) for name, *row in signals]
        heads = ("impacts", ">side", ">a period", *speeds, peak, of("impulse", "N m s"), *losses)
        tables = (
            _table(heads, sides, spare=[heads[k] for k in (8, 6, 3, 7, 4)]),
            _table(("contact", ">closed", peak, of("rms force", "N m"), of("power", "W")), loads),
            _table(("acceleration", ">rms", ">peak", ">crest factor", ">kurtosis"), named),
        )
        return SummaryText([part for table in tables if table.rows for part in ("", table)][1:])

    def _signal(self, place: int) -> str:
        """Return the name of an acceleration by its place among them."""
        name = self.coordinates[place].coordinate
        return f"{name}''" if place < self.system.size else name

    def signal_rows(self) -> Rows:
        """Return the rows of accelerations, each with its unit in a system that has units."""
        units = self.system.units
        yield (*(field.name for field in fields(Impulsiveness)), *(["unit"] if units else []))
        for k, each in enumerate(self.coordinates):
            yield (*astuple(each), *([units.signal(self._signal(k))[1]] if units else []))

    def __repr__(self) -> str:
        return str(self.summary())


@dataclass(frozen=True, slots=True)
class Impact:
    """One closure of the innermost stage of a contact, from closing to opening."""

    #: contact, side: Name of the contact, and its side: +1 or -1.
    contact: str
    side: int
    theta: float  #: Angle of the excitation at closing, in radians.
    duration: float  #: Duration of the closure, in units of time.
    velocity: float  #: Approach velocity: magnitude of the rate of the deflection at closing.
    peak: float  #: Largest magnitude of the contact force; nan on a rigid stop, where it is an impulse.
    #: Energy loss: on a rigid stop that of kinetic energy; otherwise the integral over the closure of the force of the
    #: damping law times the rate of the deflection. In units of the contact force times the deflection.
    loss: float
    impulse: float = math.nan  #: Magnitude of the integral of the contact force over the time of the closure.


@dataclass(frozen=True, slots=True)
class SideRattle:
    """The impacts of one contact on one side."""

    #: contact, side: Name of the contact, and its side: +1 or -1.
    contact: str
    side: int
    impacts: float  #: Impacts per forcing period.
    #: velocity, fastest: Mean and largest approach velocity.
    velocity: float
    fastest: float
    peak: float  #: Largest magnitude of the contact force; nan on a rigid stop that is struck.
    #: loss, costliest: Mean and largest energy loss of an impact, in units of the contact force times the deflection.
    loss: float
    costliest: float
    impulse: float = math.nan  #: Mean magnitude of the impulse of an impact.


@dataclass(frozen=True, slots=True)
class ContactLoad:
    """The force of one contact over the whole motion."""

    contact: str  #: Name of the contact.
    closed: float  #: Fraction of the time for which it is closed; nan for a force without stages, such as a formula.
    #: peak, rms: Largest magnitude and root mean square of its force; nan on a rigid stop that is struck.
    peak: float
    rms: float
    power: float  #: Mean power dissipated by its damping law.


@dataclass(frozen=True, slots=True)
class Impulsiveness:
    """The impulsiveness of the acceleration of one coordinate."""

    coordinate: str  #: Name of the coordinate, or of the acceleration of an inertia.
    #: rms, peak: Root mean square and largest magnitude of its acceleration, about its mean (zero for a settled
    #: motion).
    rms: float
    peak: float
    #: Crest factor, peak over rms (ISO 2631-1:1997, there of the weighted acceleration): 1.41 for a harmonic motion.
    #: All four are nan where a rigid stop gives it impulses.
    crest: float
    #: Fourth moment over the square of the second (Dyer and Stewart 1978, J. Mech. Des. 100, 229-235): 1.5 for a
    #: harmonic motion, 3 for Gaussian noise, more for rattle.
    kurtosis: float


def rattle(motion: Orbit | Settled, periods: int = _PERIODS) -> Rattle:
    """Compute impacts, contact forces, energy and impulsiveness of a settled motion.

    Parameters
    ----------
    motion
        An orbit or a settled motion.
    periods
        Number of forcing periods over which a motion without period is evaluated; for an orbit its own period is used.

    Returns
    -------
    Rattle
        Impacts, forces, energy and impulsiveness.

    Raises
    ------
    FlowError
        If the motion diverges.

    Notes
    -----
    Kurtosis as a rattle index: Dyer and Stewart (1978), Journal of Mechanical Design 100, 229-235. Crest factor: ISO
    2631-1:1997.

    Examples
    --------
    >>> found = gw.analysis.rattle(impacting)
    >>> found.sides[0].impacts, round(found.sides[0].velocity, 6)
    (1.0, 1.377284)
    """
    check("periods", periods, Counted)
    system, period = motion.system, motion.period
    along = quadrature(system, motion.state, period or periods)
    if period:  # two periods, so that an impact across the end is complete
        found = impacts(system, quadrature(system, motion.state, 2 * period), before=PERIOD * period)  # each once
    else:
        found = impacts(system, along)
    length, found = period or periods, _in_units(system, found)
    return Rattle(
        system, length, _sides(system, found, length), _loads(system, along, found), _impulsiveness(along), found
    )


def impacts(system: System, along: Quadrature, before: float = math.inf) -> tuple[Impact, ...]:
    """Return the impacts that begin before an angle and end within a motion, in the order of their closing."""
    # To include impacts that last across the end of an orbit, integrate the orbit over two of its periods.
    losses, forces = damping_power(system, along) * along.weights[:, None], along.motion.forces
    names, theta = [form.name for form in system.structure.contacts], along.motion.theta
    found = []
    for contact, side, switch in innermost_switches(system):
        place = names.index(contact)
        if system.structure.contacts[place].law.rebounds:
            found += (each for each in _strikes(system, along, (contact, side, switch)) if each.theta < before)
            continue
        for closes, opens in _closures(along.motion.events, switch):
            if closes.theta >= before:
                continue
            first, last = int(theta.searchsorted(closes.theta, "right")), int(theta.searchsorted(opens.theta))
            duration = (opens.theta - closes.theta) / system.frequency
            peak = along.largest_size(forces[:, place], first, last)
            loss = float(losses[first:last, place].sum())
            impulse = abs(float(forces[first:last, place] @ along.weights[first:last]))
            found.append(Impact(contact, side, closes.theta, duration, abs(closes.velocity), peak, loss, impulse))
    return tuple(sorted(found, key=lambda impact: impact.theta))


def _strikes(system: System, along: Quadrature, place: tuple[str, int, int]) -> Iterator[Impact]:
    """Yield the impacts on a rigid stop; their force is an impulse, and so without a peak."""
    contact, side, switch = place
    sizes = dict(zip(*(each.tolist() for each in along.motion.impulses(f"{contact}.force")), strict=True))
    try:
        losses = impact_losses(system, along)
    except ModelError:  # no kinetic energy is known
        losses = {}
    for event in along.motion.events:
        if event.switch == switch and event.enters:
            lost = losses.get((event.theta, system.structure.breakpoints[switch].contact), math.nan)
            impulse = abs(sizes.get(event.theta, 0.0)) / system.frequency
            yield Impact(contact, side, event.theta, 0.0, abs(event.velocity), math.nan, lost, impulse)


def damping_power(system: System, along: Quadrature) -> NDArray[np.float64]:
    """Compute the power dissipated by the damping law of each contact at each node, shape (nodes, contacts)."""
    # It is the part of the force that vanishes with all rates, times the rate of the deflection; for a formula of
    # several deflections, or one that acts elsewhere, times the rate along the vector on which it acts.
    layout, coefficients, motion = layout_of(system.structure), coefficients_of(system), along.motion
    angles = Angles(layout, coefficients, motion.theta)
    rates = contact_deflections(layout, coefficients, motion.theta, motion.v, derivative=1)
    springs = np.zeros_like(motion.forces)
    for place, slots in enumerate(layout.contacts):
        if slots.form.law.is_dry:  # all of its force is of its slip, and what a spring takes returns
            rates[:, place] -= coefficients[slots.numbers["speed"]]
            continue
        if slots.form.law.rebounds:  # its force holds, and impacts are apart
            rates[:, place] = 0.0
            continue
        # at rest: a prescribed displacement has a rate of its own, which is none of the motion
        moves = [
            (motion.q @ coefficients[vector] + angles.sway(slots, argument), np.zeros(len(motion.theta)))
            for argument, vector in enumerate(slots.deflections)
        ]
        springs[:, place] = contact_force(slots, angles, moves)
        if not slots.stages and (slots.deflections[1:] or not slots.form.reciprocal):
            rates[:, place] = motion.v @ system.vector(slots.form.push)  # of the point on which a formula acts
    return (motion.forces - springs) * rates


def innermost_switches(system: System) -> list[tuple[str, int, int]]:
    """List contact, side and switch of the innermost stage on each side of each contact."""
    found: dict[tuple[str, int], int] = {}
    for switch, (contact, _, side) in enumerate(switch_names(system)):
        found.setdefault((contact, side), switch)
    return [(contact, side, switch) for (contact, side), switch in found.items()]


def _closures(events: Sequence[ContactEvent], switch: int) -> list[tuple[ContactEvent, ContactEvent]]:
    """Pair each closing of one switch with the opening that follows it."""
    own = [event for event in events if event.switch == switch]
    return [(one, other) for one, other in pairwise(own) if one.enters and not other.enters]


def _in_units(system: System, found: tuple[Impact, ...]) -> tuple[Impact, ...]:
    """Convert the energies of impacts to J if the system has units; velocities stay as in states."""
    if system.units is None:
        return found
    unit = system.units.angle
    return tuple(replace(each, loss=unit * each.loss) for each in found)


def _sides(system: System, found: tuple[Impact, ...], periods: int) -> tuple[SideRattle, ...]:
    rows = []
    for contact in system.structure.contacts:
        signs = {sign for stage in contact.stages for sign in stage.side.signs}
        for side in sorted(signs, reverse=True):
            own = [impact for impact in found if impact.contact == contact.name and impact.side == side]
            velocity, peak, loss, impulse = (
                np.array([getattr(impact, name) for impact in own] or [0.0])
                for name in ("velocity", "peak", "loss", "impulse")
            )
            means = float(velocity.mean()), float(velocity.max()), float(peak.max()), float(loss.mean())
            rows.append(
                SideRattle(contact.name, side, len(own) / periods, *means, float(loss.max()), float(impulse.mean()))
            )
    return tuple(rows)


def _loads(system: System, along: Quadrature, found: tuple[Impact, ...]) -> tuple[ContactLoad, ...]:
    forces, share = along.motion.forces, along.weights / along.weights.sum()
    rms, power = np.sqrt(share @ forces**2), share @ damping_power(system, along)
    closed = share @ (forces != 0.0)
    unit = 1.0 if system.units is None else system.units.angle  # a torque times a velocity is in W
    rows = []
    for k, contact in enumerate(system.structure.contacts):
        own = [impact for impact in found if impact.contact == contact.name]
        peaks = [impact.peak for impact in own if not contact.law.rebounds]
        lost = sum(impact.loss for impact in own) / along.weights.sum() if contact.law.rebounds else 0.0
        peak = max([float(np.abs(forces[:, k]).max()), *peaks])
        peak, size = (math.nan, math.nan) if contact.law.rebounds and own else (peak, float(rms[k]))
        share_closed = float(closed[k]) if contact.stages else math.nan
        rows.append(ContactLoad(contact.name, share_closed, peak, size, unit * float(power[k]) + float(lost)))
    return tuple(rows)


def _impulsiveness(along: Quadrature) -> tuple[Impulsiveness, ...]:
    share = along.weights / along.weights.sum()
    mean = share @ along.motion.a
    varying = along.motion.a - mean
    second, fourth = share @ varying**2, share @ varying**4
    rows = []
    system = along.motion.system
    unit = signal_factor(system, "''")
    for k, name in enumerate(system.coordinates):
        if len(along.motion.impulses(f"{name}''")[0]):
            rows.append(Impulsiveness(name, math.nan, math.nan, math.nan, math.nan))
            continue
        rms = unit * float(np.sqrt(second[k]))
        peak = unit * along.largest_size(varying[:, k])
        crest, kurtosis = (peak / rms, float(fourth[k] / second[k] ** 2)) if rms > 0.0 else (0.0, 0.0)
        rows.append(Impulsiveness(name, rms, peak, crest, kurtosis))
    if isinstance(system.structure.assembly, TrainAssembly):
        rows += [_of_part(along, name, share) for name in acceleration_names(system)]
    return tuple(rows)


def _of_part(along: Quadrature, name: str, share: NDArray[np.float64]) -> Impulsiveness:
    """Return the impulsiveness of an inertia of a train, in the unit of its acceleration."""
    if len(along.motion.impulses(name)[0]):
        return Impulsiveness(name, math.nan, math.nan, math.nan, math.nan)
    values = along.motion.signal(name)
    values = values - share @ values
    rms, peak = float(np.sqrt(share @ values**2)), along.largest_size(values)
    crest, kurtosis = (peak / rms, float(share @ values**4) / rms**4) if rms > 0.0 else (0.0, 0.0)
    return Impulsiveness(name, rms, peak, crest, kurtosis)


def _table(head: tuple[str, ...], rows: Sequence[tuple], spare: Sequence[str] = ()) -> Table:
    """Return a table of texts and numbers."""
    cells = [
        [each if isinstance(each, str) else "-" if math.isnan(each) else f"{each:.4g}" for each in row] for row in rows
    ]
    return Table(head, cells, spare=spare)
