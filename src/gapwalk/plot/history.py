"""Time histories, and the loops of contact force over deflection."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System
from gapwalk.motion.flow import PERIOD
from gapwalk.motion.motion import Motion
from gapwalk.plot.style import BLACK, GREY
from gapwalk.plot.words import signal_words

_LINE: dict[str, Any] = {"color": BLACK, "linewidth": 1.1, "solid_joinstyle": "round"}
_STOP: dict[str, Any] = {"color": GREY, "linewidth": 0.8, "linestyle": (0, (4, 2)), "zorder": 1}


def plot_history(motion: Motion, signal: str, *, ax: Axes) -> Axes:
    """Draw a signal of a motion over time in forcing periods, and the breakpoints of the contacts that it meets.

    Parameters
    ----------
    motion
        The motion.
    signal
        As in `Motion.signal`.
    ax
        Where to draw.
    """
    values = motion.signal(signal)
    ax.plot(motion.theta / PERIOD, values, **_LINE)
    low, high = float(values.min()), float(values.max())
    pad = 0.08 * ((high - low) or 1.0)
    for level in breakpoints(motion.system, signal):
        if low - 3 * pad <= level <= high + 3 * pad:
            ax.axhline(level, **_STOP)
            low, high = min(low, level), max(high, level)
    ax.set_xlim(float(motion.theta[0]) / PERIOD, float(motion.theta[-1]) / PERIOD)
    ax.set_ylim(low - pad, high + pad)
    ax.set_xlabel("forcing periods")
    ax.set_ylabel(signal_words(signal, motion.system.units))
    return ax


def plot_loop(motion: Motion, contact: str, *, ax: Axes) -> Axes:
    """Draw the force of a contact over its deflection: the area of the loop is the energy that it costs.

    Parameters
    ----------
    motion
        The motion, over a whole period if it has one.
    contact
        Name of the contact.
    ax
        Where to draw.

    Raises
    ------
    ModelError
        If there is no such contact.
    """
    names = [form.name for form in motion.system.structure.contacts]
    if contact not in names:
        raise ModelError(f"there is no contact {contact!r}; contacts are {', '.join(names) or 'none at all'}")
    index = names.index(contact)
    ax.plot(motion.deflections[:, index], motion.forces[:, index], **{**_LINE, "linewidth": 0.9})
    for level in _levels(motion.system, motion.system.structure.contacts[index]):
        ax.axvline(level, **_STOP)
    units = motion.system.units
    ax.set_xlabel(f"deflection of {signal_words(contact, units)}")
    ax.set_ylabel(f"force of {contact}" + " [N m]" * (units is not None))
    return ax


def breakpoints(system: System, signal: str) -> list[float]:
    """Values of a coordinate at which a contact of that coordinate alone opens or closes."""
    if signal not in system.coordinates:
        return []
    place = system.coordinates.index(signal)
    found = []
    for contact in system.structure.contacts:
        vector = _deflection(system, contact)
        if vector[place] and np.count_nonzero(vector) == 1:
            found += [level / float(vector[place]) for level in _levels(system, contact)]
    return found


def _deflection(system: System, contact: ContactForm) -> NDArray[np.float64]:
    return system.vector(f"{contact.name}.deflection")


def _levels(system: System, contact: ContactForm) -> list[float]:
    return [
        side * system[f"{contact.stage_prefix(stage)}.clearance"]
        for stage in contact.stages
        for side in stage.side.signs
    ]
