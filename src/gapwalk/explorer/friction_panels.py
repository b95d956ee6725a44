"""Panels of dry friction and rigid stops: phases of slip and stick, impacts, and the energy of each element."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Settled
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.flow.dry_motion import is_dry
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion, sample
from gapwalk.flow.stick_slip import MODES, StickSlip, stick_slip
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System
from gapwalk.model.words import signal_words
from gapwalk.orbit.energy import Energy, EnergyItem, energy
from gapwalk.orbit.orbit import Orbit

_BESIDE = 1e-5  # radians before and after an event, at which a motion is sampled; orbits know their events to 1e-8
_EVENTS = 400  # of a period, beside which it is sampled
_BOOKED = 60  # coordinates of a system whose energy is computed at a click
_NOTHING = 1e-12  # of the work, below which an energy is rounding


def is_element(form: ContactForm) -> bool:
    """Return True for dry friction and for rigid stops."""
    return form.law.is_dry or form.law.rebounds


def sampled_with_corners(orbit: Orbit, count: int) -> Motion:
    """Sample one period, evenly but also just before and after each event, where forces and rates may jump."""
    if not orbit.is_exact or not is_dry(orbit.system.structure):
        return orbit.motion(count)
    end = PERIOD * orbit.period
    events = np.array(sorted({event.theta for event in (*orbit.slips, *orbit.events)})[:_EVENTS])
    even = end * np.arange(count * orbit.period + 1) / (count * orbit.period)
    theta = np.unique(np.concatenate((even, events - _BESIDE, events + _BESIDE)))
    return sample(orbit.system, orbit.state, theta[(theta >= 0.0) & (theta <= end)])


def phases_of(sampled: Motion) -> StickSlip | None:
    """Return the phases of dry friction and rigid stops; None if the system has neither."""
    return stick_slip(sampled) if is_dry(sampled.system.structure) else None


def elements_of(found: StickSlip) -> dict[str, Any]:
    """Return phases and impacts for the page."""
    names = list(found.elements)
    return {
        "names": names,
        "phases": [
            [names.index(each.element), each.mode, each.start / PERIOD, each.end / PERIOD] for each in found.phases
        ],
        "strikes": [[names.index(each.element), each.theta / PERIOD, each.velocity] for each in found.strikes],
        "shares": [_shares(found, name) for name in names],
    }


def _shares(found: StickSlip, name: str) -> dict[str, float]:
    shares = {mode: found.share(name, mode) for mode in (*MODES.values(), "held")}
    return {mode: share for mode, share in shares.items() if share}


def element_curve(sampled: Motion, index: int) -> dict[str, NDArray[np.float64]]:
    """Return the curves that the page draws of an element, besides force and deflection.

    It is the ``rate`` of the deflection of a rigid stop, whose force is no curve; and, if friction sticks by a spring,
    the position of its ``slider``: the deflection less the extension of that spring.
    """
    system, form = sampled.system, sampled.system.structure.contacts[index]
    memories = system.structure.memories
    if index in memories:
        return {"slider": sampled.deflections[:, index] - sampled.z[:, memories.index(index)]}
    return {"rate": sampled.deflection_rate(index)} if form.law.rebounds else {}


def energy_table(motion: Orbit | Settled) -> dict[str, Any]:
    """Return work and losses of a motion in one of its periods, or the reason why they are not known."""
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    try:
        if orbit is None:
            raise ModelError("this motion does not repeat itself, so its energy does not return")
        book = energy(_of_small(orbit))
    except GapwalkError as error:
        return {"work": [], "losses": [], "unit": "", "imbalance": 0.0, "reason": str(error)}
    return {
        "work": [_item(book, each) for each in book.work],
        "losses": [_item(book, each) for each in book.losses],
        "unit": "" if book.system.units is None else "J",
        "imbalance": book.imbalance,
        "reason": "",
    }


def _of_small(orbit: Orbit) -> Orbit:
    size = orbit.system.size
    if size > _BOOKED:
        raise ModelError(
            f"the page computes the energy of at most {_BOOKED} coordinates, and here are {size}; in Python: "
            "gw.analysis.energy(orbit)"
        )
    return orbit


def _item(book: Energy, item: EnergyItem) -> list[str | float]:
    total = max(sum(abs(each.energy) for each in items) for items in (book.work, book.losses))
    is_rounding = abs(item.energy) <= _NOTHING * total
    return [item.element, item.kind, 0.0 if is_rounding else item.energy, 0.0 if is_rounding else item.share]


def log_of(sampled: Motion, found: StickSlip | None, most: int) -> list[dict[str, Any]]:
    """Return the contact log: where stages close and open, stops are struck and held, and friction slips and sticks."""
    entries: list[tuple[float, str, str, float | None]] = []
    rigid = {form.name for form in sampled.system.structure.contacts if form.law.rebounds}
    for event in sampled.contacts:
        name, is_rigid = f"{event.contact}.{event.stage}" if event.stage else event.contact, event.contact in rigid
        if event.closes or not is_rigid:  # a stop is released, which is said below
            what = "is struck" if is_rigid else "closes" if event.closes else "opens"
            entries.append((event.theta, f"{name} {'+' if event.side > 0 else '-'}", what, event.velocity))
    first, last = float(sampled.theta[0]), float(sampled.theta[-1])
    for phase in found.phases if found is not None else ():
        if phase.start > first:
            entries.append((phase.start, phase.element, _BEGINS[phase.mode], None))
        if phase.mode == "held" and phase.end < last:
            entries.append((phase.end, phase.element, "is released", None))
    entries.sort(key=lambda entry: entry[0])
    return [
        {"periods": theta / PERIOD, "contact": name, "what": what, "velocity": velocity}
        for theta, name, what, velocity in entries[:most]
    ]


_BEGINS = {"slip +": "slips +", "slip -": "slips -", "stick": "sticks", "held": "is held"}


def axis_words(system: System, form: ContactForm) -> tuple[str, str]:
    """Return the labels of deflection and force of a contact, with their units."""
    return f"deflection of {signal_words(form.name, system.units)}", "force" + " [N m]" * (system.units is not None)
