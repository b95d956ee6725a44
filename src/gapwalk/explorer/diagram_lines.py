"""Lines of a diagram on the page, and the quantities of its axes: parameters, measures, peak forces, impacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from gapwalk.answers.goals import peaks
from gapwalk.answers.order_map import orders_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusPoint
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.flow.motion import force_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System
from gapwalk.model.words import coordinate_words, measure_words, parameter_words, state_words
from gapwalk.orbit.orbit import MEASURES, Orbit
from gapwalk.picture_parts import NATURAL_FREQUENCY, SECTION, START

MEASURE = "measure:"
"""Prefix of a measure that has the name of a parameter: ``mean.q1`` alone is a mean load."""

PEAK, IMPACTS = "peak.", "impacts."
"""Prefixes of the largest magnitude of the force of a contact, and of its impacts per second: ``peak.stop``."""

_CONTACTS = 12  # whose forces and impacts can be chosen; inertias, whose accelerations can be
_ORDERS = 3  # of which the amplitudes can be chosen


class Line(NamedTuple):
    """A branch or a locus, as the page shows it."""

    name: str  #: Its name.
    parameter: str  #: Parameter of the branch; of a locus, the first one.
    within: tuple[float, float]  #: Range of the parameter.
    period: int  #: m, forcing periods of its orbits.
    #: points, special_points: Its points so far, and its special points; of a locus, the points of codimension two.
    points: Sequence[BranchPoint | LocusPoint]
    special_points: Sequence[SpecialPoint | Codim2Point]
    kind: Kind | None = None  #: Kind of the special points of a locus; None for a branch.
    second: str = ""  #: The second parameter of a locus; otherwise empty.
    is_earlier: bool = False  #: True for a branch of the system before the change that an answer proposes.


def line_of(name: str, curve: Branch | Locus, within: tuple[float, float]) -> Line:
    """Return a branch or a locus as a line of the page."""
    if isinstance(curve, Branch):
        return Line(name, curve.parameter, within, curve.period, curve.points, curve.special_points)
    points = curve.points, curve.codim2_points
    return Line(name, curve.first, within, curve.period, *points, curve.kind, curve.second)


def contact_quantities(system: System) -> list[str]:
    """Return the peak forces of the contacts, and the impacts of those that have a gap; a rigid stop has no force."""
    forms = list(enumerate(system.structure.contacts))[:_CONTACTS]
    forces = [f"{PEAK}{form.name}" for _, form in forms if not form.law.rebounds]
    return [*forces, *(f"{IMPACTS}{form.name}" for place, form in forms if _gaps(system, place))]


def inertia_measures(system: System) -> list[str]:
    """Return measures of the accelerations of the inertias of a train: root mean square, and orders of the loads."""
    assembly = system.structure.assembly
    names = assembly.form.inertias[:_CONTACTS] if isinstance(assembly, TrainAssembly) else ()
    orders = [f"order{Fraction(order).limit_denominator()}" for order in orders_of(system)[:_ORDERS]]
    return [f"{kind}.{name}.acceleration" for name in names for kind in ("rms", *orders)]


def measure_name(measure: str, system: System) -> str:
    """Return the name of a measure in requests, which differs from those of parameters (see `MEASURE`)."""
    return f"{MEASURE}{measure}" if measure in system.parameters else measure


def quantity_words(names: Iterable[str], system: System) -> list[dict[str, str]]:
    """Describe quantities for the page: names as in requests, and words with units."""
    return [{"name": name, "words": _words(name, system)} for name in names]


def _words(name: str, system: System) -> str:
    if name in system.parameters:
        return parameter_words(name, system.units)
    if name.startswith(SECTION):
        return state_words(name.removeprefix(SECTION), system.units)
    if name.startswith(START):
        return f"{coordinate_words(name.removeprefix(START), system.units)} at the start"
    units = system.units
    if name == NATURAL_FREQUENCY:
        return f"natural frequency [{'Hz' if units else 'angular'}]"
    if contact := _contact(PEAK, name, system):
        form = system.structure.contacts[contact - 1]
        unit = units.signal(force_of(form))[1] if units else ""
        return f"peak torque of {form.name} [{unit}]" if unit else f"peak force of {form.name}"
    if contact := _contact(IMPACTS, name, system):
        many = "per second" if units else "per unit of time"
        return f"impacts {many} on {system.structure.contacts[contact - 1].name}"
    return measure_words(name.removeprefix(MEASURE), units)


def _contact(prefix: str, name: str, system: System) -> int:
    """Return 1 + the index of the contact of a quantity; 0 if it has another name."""
    if not name.startswith(prefix) or name in system.parameters:
        return 0
    names = [form.name for form in system.structure.contacts]
    own = name.removeprefix(prefix)
    return 1 + names.index(own) if own in names else 0


def _gaps(system: System, place: int) -> list[int]:
    """Return the switches of a contact at which its innermost gap closes, on one side and on the other."""
    innermost: dict[int, int] = {}
    for switch, (own, side, _) in enumerate(system.breakpoints):
        if own == place and not system.gapless[switch]:
            innermost.setdefault(side, switch)
    return list(innermost.values())


def _impacts(orbit: Orbit, place: int) -> float:
    """Return the impacts of a contact per unit of time; nan where a rigid stop is held: they are infinitely many."""
    gaps = _gaps(orbit.system, place)
    if any(switch in orbit.chatters for switch in gaps):
        return math.nan
    return sum(orbit.closings[switch] for switch in gaps) / orbit.period * orbit.system.frequency / (2.0 * math.pi)


def quantity(orbit: Orbit, name: str) -> float:
    """Return a parameter, a state at the start, a measure, or what a contact does, by name (see the prefixes above)."""
    state = name.removeprefix(SECTION)
    if state != name and state in orbit.system.state_names:
        return float(orbit.state[orbit.system.state_names.index(state)])
    if contact := _contact(PEAK, name, orbit.system):
        return max(peaks(orbit, force_of(orbit.system.structure.contacts[contact - 1])))
    if contact := _contact(IMPACTS, name, orbit.system):
        return _impacts(orbit, contact - 1)
    return orbit.system[name] if name in orbit.system.parameters else orbit.measure(name.removeprefix(MEASURE))


def is_at_hand(orbit: Orbit, name: str) -> bool:
    """Return True if a quantity is known without an integration."""
    if name in orbit.system.parameters or name.startswith(SECTION):
        return True
    kind, _, signal = name.removeprefix(MEASURE).partition(".")
    return kind in MEASURES and signal in orbit.system.coordinates and "extremes" in vars(orbit)
