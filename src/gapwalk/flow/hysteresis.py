"""Hysteresis: the loop of a contact's force under a harmonic deflection, and the energy that it dissipates."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.flow.motion import Motion, is_dry
from gapwalk.model.bounds import Finite, Positive, check
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.contact import Contact, ContactForm
from gapwalk.model.laws import Law
from gapwalk.model.system import System, check_system
from gapwalk.notebook import Pictured, Shown
from gapwalk.summary import SummaryParts, Table, summarizes

_NODES, _WIDEST = 20, PERIOD / 8  # of Gauss's rule: between breakpoints the force is a trigonometric polynomial
_GRID, _HALVINGS = 4096, 52  # phases at which the modes of a law are compared, and bisections between two of them
_JUMP = 1e-9  # rad: distance from a breakpoint of the samples on both sides, which show a jump of the force


@dataclass(frozen=True, eq=False)
class Hysteresis(Pictured):
    """The force of a contact while its deflection is ``mean + amplitude * cos(theta)``, over one cycle."""

    #: contact, law: Name of the contact, and its force law.
    contact: str
    law: Law
    #: amplitude, mean, frequency: Amplitude, mean and angular frequency of the deflection.
    amplitude: float
    mean: float
    frequency: float
    breakpoints: tuple[float, ...]  #: Deflections at which a stage opens or closes, increasing.
    #: theta, deflection, rate, force: shape (samples,): Phase in radians, deflection, its rate, and the force.
    theta: NDArray[np.float64]
    deflection: NDArray[np.float64]
    rate: NDArray[np.float64]
    force: NDArray[np.float64]
    #: Energy dissipated per cycle, the area of the loop: ``integral of f dx``. Negative if the law feeds energy in.
    loss: float

    @property
    def equivalent_damping(self) -> float:
        """Viscous damping with the same loss: ``loss / (pi W amplitude^2)``."""
        # It is the damping of the describing function, so it does not depend on the frequency.
        return self.loss / (math.pi * self.frequency * self.amplitude**2)


def hysteresis(
    system: System | Contact,
    amplitude: float,
    contact: str | None = None,
    *,
    mean: float = 0.0,
    frequency: float | None = None,
    samples: int = 720,
) -> Hysteresis:
    """Compute the loop of force over deflection of a contact under a harmonic deflection (paper, figure 1).

    Parameters
    ----------
    system
        A system, or a contact alone.
    amplitude, mean
        Amplitude and mean of the deflection ``mean + amplitude * cos(theta)``.
    contact
        Name of the contact; optional if there is only one.
    frequency
        Angular frequency; by default that of the system (1 for a contact alone).
    samples
        Samples of the loop.

    Returns
    -------
    Hysteresis
        The loop, and its loss.

    Raises
    ------
    ModelError
        If there is no such contact, its force depends on several deflections, or an amplitude or a frequency is not
        valid.

    Notes
    -----
    Parameters that vary over the angle of the excitation have their mean values, and prescribed displacements are zero.

    Examples
    --------
    >>> round(gw.analysis.hysteresis(system, amplitude=1.2, frequency=1.0).loss, 6)
    0.058052
    """
    if isinstance(system, Contact):  # a system of one coordinate, its deflection
        alone = replace(system, deflection={"x": 1.0}, force=None)
        system = System(("x",), [[0.0]], contacts=[alone])
    check_system(system, "hysteresis")
    name, form, slots = pick_contact(system, contact)
    frequency = system.frequency if frequency is None else frequency
    check("amplitude", amplitude, Positive)
    check("frequency", frequency, Positive)
    check("mean", mean, Finite)
    if slots.deflections[1:]:
        raise ModelError(
            f"{name!r} depends on {len(slots.deflections)} deflections ({', '.join(form.law.arguments)}), so it has no "
            "loop over one of them; plot the loop of a motion, as in gw.plot.draw(orbit.motion(), contact=...)"
        )
    if form.law.is_dry or form.law.rebounds:
        raise ModelError(
            f"{name!r} is {form.law.words}: its force depends on what happened before, or is an impulse, so it has no "
            "loop by itself; draw that of a motion: gw.plot.draw(gw.analysis.stick_slip(orbit)), and its loss is in "
            "gw.analysis.energy(orbit)"
        )
    layout = layout_of(system.structure)
    coefficients = steady(layout, coefficients_of(system))
    levels = sorted({stage.sign * float(coefficients[stage.clearance]) for stage in slots.stages})
    met = [math.acos((level - mean) / amplitude) for level in levels if abs(level - mean) < amplitude]

    def moved(theta: NDArray[np.float64]):
        x, rate = mean + amplitude * np.cos(theta), -amplitude * frequency * np.sin(theta)
        return x, rate, Angles(layout, coefficients, np.zeros_like(theta))

    def cycle(theta: NDArray[np.float64]):
        x, rate, angles = moved(theta)
        return x, rate, contact_force(slots, angles, [(x, rate)])

    def modes(theta: NDArray[np.float64]) -> NDArray[np.bool_]:
        x, rate, angles = moved(theta)
        found = stages_of(slots, angles, [(x, rate)]).modes
        return np.stack([np.broadcast_to(each, theta.shape) for each in found]) > 0.0

    kinks = _changes(modes) if form.law.mode_count else []
    edges = np.array(sorted({0.0, PERIOD, *met, *(PERIOD - angle for angle in met), *kinks}))
    nodes, weights = _nodes(edges)
    _, rate, force = cycle(nodes)
    loss = float(weights @ (force * rate)) / frequency
    inner = edges[1:-1]
    theta = np.unique(np.concatenate((np.linspace(0.0, PERIOD, samples + 1), inner - _JUMP, inner + _JUMP)))
    x, rate, force = cycle(theta)
    return Hysteresis(name, form.law, amplitude, mean, frequency, tuple(levels), theta, x, rate, force, loss)


def _changes(modes: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> list[float]:
    """Return the phases of a cycle at which the modes of a law change, by bisection."""
    theta = np.linspace(0.0, PERIOD, _GRID + 1)
    states = modes(theta)
    which, places = np.nonzero(states[:, 1:] != states[:, :-1])
    low, high, before = theta[places], theta[places + 1], states[which, places]
    for _ in range(_HALVINGS if len(which) else 0):
        middle = 0.5 * (low + high)
        same = modes(middle)[which, np.arange(len(which))] == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high.tolist()


def steady(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients of a system whose numbers do not vary over the angle: they have their mean values."""
    found = coefficients.copy()
    for slots in layout.contacts:
        for waves in (slots.waves, *(stage.waves for stage in slots.stages)):
            for wave in waves.values():
                found[wave.lines] = 0.0
    for cycle in layout.cycles:
        found[[cycle.low, cycle.high]] = 0.0
    return found


def pick_contact(system: System, name: str | None) -> tuple[str, ContactForm, ContactSlots]:
    """Return the contact of a name, or the only one: its name, form and coefficient slots; else a ModelError."""
    known = [form.name for form in system.structure.contacts]
    if name is None and len(known) == 1:
        name = known[0]
    if name not in known:
        given = "no contact is named" if name is None else f"there is no contact {name!r}"
        raise ModelError(f"{given}; contacts are {', '.join(known) or 'none at all'}")
    place = known.index(name)
    return name, system.structure.contacts[place], layout_of(system.structure).contacts[place]


def _nodes(edges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes and weights of Gauss's rule between the edges."""
    knots = [np.linspace(a, b, 2 + int((b - a) / _WIDEST))[:-1] for a, b in pairwise(edges)]
    starts = np.append(np.concatenate(knots), edges[-1])
    widths, (nodes, weights) = np.diff(starts), leggauss(_NODES)
    return (starts[:-1, None] + 0.5 * widths[:, None] * (nodes + 1.0)).ravel(), np.outer(0.5 * widths, weights).ravel()


# Phases of dry friction and of rigid stops along a motion: when they slip, stick, are held, or are struck.

_SAMPLES = 2048  # per forcing period, which show the corners of loops

MODES = {1: "slip +", -1: "slip -", 0: "stick"}
"""Modes of dry friction in words; a rigid stop may be ``held``."""


class Moves(Protocol):
    """A record with a motion, such as an orbit."""

    def motion(self, samples: int | None = None) -> Motion:
        """Return the motion, with a number of samples per forcing period."""
        ...


@dataclass(frozen=True, slots=True)
class Phase:
    """An interval in which a contact has one mode."""

    element: str  #: Name of the contact.
    mode: str  #: ``slip +``, ``slip -``, ``stick``, or ``held`` for a rigid stop.
    #: start, end: Angles of the excitation, in radians.
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Strike:
    """An impact on a rigid stop."""

    element: str  #: Name of the contact.
    theta: float  #: Angle of the excitation, in radians.
    velocity: float  #: Rate of the deflection just before it.


@dataclass(frozen=True, eq=False)
class StickSlip(Shown):
    """The phases of dry friction and rigid stops along a motion."""

    motion: Motion  #: The motion.
    phases: tuple[Phase, ...]  #: All phases, contact by contact, in their order.
    strikes: tuple[Strike, ...]  #: The impacts on rigid stops.

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of the contacts that are friction or rigid stops, in the order of the model."""
        structure = self.motion.system.structure
        return tuple(form.name for form in structure.contacts if form.law.is_dry or form.law.rebounds)

    def share(self, element: str, mode: str) -> float:
        """Return the fraction of the time in which an element has a mode: ``"slip +"``, ``"slip -"``, ``"stick"``."""
        if element not in self.elements:
            raise ModelError(f"there is no friction or rigid stop {element!r}; there are {', '.join(self.elements)}")
        if mode not in (known := [*MODES.values(), "held"]):
            raise ModelError(f"{mode!r} is no mode; modes are {', '.join(known)}")
        own = [each.end - each.start for each in self.phases if (each.element, each.mode) == (element, mode)]
        return sum(own) / float(np.ptp(self.motion.theta))

    @summarizes
    def summary(self) -> SummaryParts:
        """See `Described.summary`."""
        rows = []
        for name in self.elements:
            shares = [self.share(name, mode) for mode in (*MODES.values(), "held")]
            struck = sum(each.element == name for each in self.strikes)
            rows.append((name, *(f"{100 * each:.2f} %" if each else "" for each in shares), str(struck or "")))
        yield "share of the time:"
        yield Table(("element", *(f">{mode}" for mode in (*MODES.values(), "held")), ">impacts"), rows)

    def __repr__(self) -> str:
        return f"StickSlip({len(self.phases)} phases and {len(self.strikes)} impacts of {', '.join(self.elements)})"


def stick_slip(motion: Motion | Moves) -> StickSlip:
    """Find the phases of dry friction and rigid stops along a motion.

    Parameters
    ----------
    motion
        A sampled motion, or an orbit, of which one period is taken.

    Returns
    -------
    StickSlip
        The phases, and the impacts.

    Raises
    ------
    ModelError
        If the system has no dry friction and no rigid stops, or the motion was sampled without the log of its events.

    Examples
    --------
    >>> found = gw.analysis.stick_slip(slipping)
    >>> round(found.share("brake", "stick"), 6)
    0.099131
    """
    sampled = motion if isinstance(motion, Motion) else motion.motion(_SAMPLES)
    structure, end = sampled.system.structure, float(sampled.theta[-1])
    if not is_dry(structure):
        raise ModelError("the system has no dry friction and no rigid stops, so nothing sticks or is held")
    if not (sampled.holds or sampled.slips):  # harmonic balance logs slip and stick alone, and nothing is held
        raise ModelError("the motion has no log of its friction; integrate it, as orbit.motion() and gw.integrate do")
    names, phases = [form.name for form in structure.contacts], list[Phase]()

    def add(name: str, marks: list[tuple[float, str]]) -> None:
        for place, (start, mode) in enumerate(marks):
            stop = marks[place + 1][0] if place + 1 < len(marks) else end
            if not mode or stop <= start:
                continue
            last = phases[-1] if phases else None
            if last is not None and (last.element, last.mode, last.end) == (name, mode, start):
                phases[-1] = Phase(name, mode, last.start, stop)
            else:
                phases.append(Phase(name, mode, start, stop))

    for contact in range(len(names)):
        if contact in structure.friction:
            marks = [(each.theta, MODES[each.slip]) for each in sampled.slips if each.contact == contact]
            add(names[contact], _without_idle(sampled, contact, marks))
        own = {number for number, (k, switch) in enumerate(structure.reactions) if k == contact and switch >= 0}
        if own:
            add(names[contact], [(each.theta, "held" if own & {*each.reactions} else "") for each in sampled.holds])
    breakpoints = structure.breakpoints
    struck = [(breakpoints[each.switch].contact, each) for each in sampled.events if each.enters]
    strikes = [
        Strike(names[contact], each.theta, each.velocity)
        for contact, each in struck
        if structure.contacts[contact].law.rebounds
    ]
    return StickSlip(sampled, tuple(phases), tuple(strikes))


def _without_idle(motion: Motion, contact: int, marks: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Leave out where friction of stages, or by a force, has none, because the other contact is open."""
    structure = motion.system.structure
    if (host := structure.host(contact)) is None:
        return marks
    changes = [each.theta for each in motion.events if structure.breakpoints[each.switch].contact == host]
    starts, force, found = [start for start, _ in marks], motion.forces[:, contact], []
    for start in sorted({*starts, *changes}):
        stop = min((each for each in (*starts, *changes) if each > start), default=math.inf)
        mode = marks[bisect_right(starts, start) - 1][1]
        inside = (motion.theta > start) & (motion.theta < stop)
        found.append((start, mode if force[inside].any() or not inside.any() else ""))
    return found
