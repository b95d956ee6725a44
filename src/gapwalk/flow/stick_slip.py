"""Phases of dry friction and of rigid stops along a motion: when they slip, stick, are held, or are struck."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.flow.dry_motion import is_dry
from gapwalk.flow.motion import Motion
from gapwalk.notebook import Shown
from gapwalk.summary import SummaryParts, Table, summarizes

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
    """An interval in which a contact has one mode.

    Examples
    --------
    >>> phase = gw.analysis.stick_slip(slipping).phases[1]
    >>> phase.element, phase.mode, round(phase.start, 6)
    ('brake', 'stick', 0.49058)
    """

    element: str  #: Name of the contact.
    mode: str  #: ``slip +``, ``slip -``, ``stick``, or ``held`` for a rigid stop.
    #: start, end: Angles of the excitation, in radians.
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Strike:
    """An impact on a rigid stop.

    Examples
    --------
    >>> bouncing = gw.System(["x"], [[1.0]], contacts=[gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8)])
    >>> strike = gw.analysis.stick_slip(gw.integrate(bouncing, np.array([0.0, 2.0]), 0.5)).strikes[0]
    >>> strike.element, round(strike.velocity, 6)
    ('wall', 1.732051)
    """

    element: str  #: Name of the contact.
    theta: float  #: Angle of the excitation, in radians.
    velocity: float  #: Rate of the deflection just before it.


@dataclass(frozen=True, eq=False)
class StickSlip(Shown):
    """The phases of dry friction and rigid stops along a motion.

    Examples
    --------
    >>> found = gw.analysis.stick_slip(slipping)
    >>> found.elements, [phase.mode for phase in found.phases]
    (('brake',), ['slip +', 'stick', 'slip -', 'stick', 'slip +'])
    """

    motion: Motion  #: The motion.
    phases: tuple[Phase, ...]  #: All phases, contact by contact, in their order.
    strikes: tuple[Strike, ...]  #: The impacts on rigid stops.

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of the contacts that are friction or rigid stops, in the order of the model."""
        structure = self.motion.system.structure
        return tuple(form.name for form in structure.contacts if form.law.is_dry or form.law.rebounds)

    def share(self, element: str, mode: str) -> float:
        """Return the fraction of the time in which an element has a mode: ``"slip +"``, ``"slip -"``, ``"stick"``.

        Parameters
        ----------
        element
            Name of the contact.
        mode
            ``"slip +"``, ``"slip -"``, ``"stick"``; ``"held"`` for a rigid stop.
        """
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
        If the system has no dry friction and no rigid stops, or the motion was sampled without its log.

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
