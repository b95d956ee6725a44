"""A settled motion in one picture: time history, spectrum, section, and the loop of the contact force.

The arrangement is that of figures 17 to 19 of the paper, and the loop of its figures 5 and 6.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.figure import Figure, SubFigure

from gapwalk.attractor.attractor import Attractor
from gapwalk.attractor.section import strobe
from gapwalk.attractor.settled import Settled
from gapwalk.attractor.spectrum import SpectrumOptions, spectrum
from gapwalk.motion.motion import integrate
from gapwalk.motion.signal import contact_to_show
from gapwalk.plot.history import plot_history, plot_loop
from gapwalk.plot.section import plot_section
from gapwalk.plot.sheet import open_window
from gapwalk.plot.size import points, takes_size
from gapwalk.plot.spectrum import plot_spectrum
from gapwalk.plot.style import in_style
from gapwalk.plot.words import value_words

SIZE = (9.0, 5.8)
_LONG = 24  # forcing periods of a time history, at least, where the motion does not repeat sooner
_POINTS = 2000  # of the section of a motion without period
_SMOOTH = 512  # samples a forcing period


@takes_size
def plot_settled(
    motion: Settled | Attractor,
    signal: str | None = None,
    *,
    phase: float = 0.0,
    contact: str | None = None,
    options: SpectrumOptions | None = None,
    title: str | None = None,
    figure: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw a settled motion: time history, spectrum, section, and the loop of a contact's force.

    Parameters
    ----------
    motion
        Where a motion has settled, or an attractor.
    signal
        The signal of history and spectrum; by default the first coordinate.
    phase
        Phase of the excitation at which the section is taken, in radians.
    contact
        The contact whose loop is drawn; by default the one that the signal names, else one that touches.
    options
        Of the spectrum.
    title
        By default what kind of motion it is, and at which frequency.
    figure
        Where to draw; by default a new figure of pyplot.

    Raises
    ------
    ModelError
        If there is no such signal or contact.
    """
    if figure is None:
        figure = open_window(SIZE)
    with in_style():
        _draw(figure, _as_settled(motion), signal, phase, contact, options)
        figure.suptitle(
            title if title is not None else _title(motion), x=0.01, ha="left", fontsize=points(10.5), wrap=True
        )
    return figure


def _draw(
    figure: Figure | SubFigure,
    settled: Settled,
    signal: str | None,
    phase: float,
    contact: str | None,
    options: SpectrumOptions | None,
) -> None:
    system = settled.system
    signal = signal or system.coordinates[0]
    contacts = system.structure.contacts
    lower: list[Any] = ["spectrum", "section", *(["loop"] if contacts else [])]
    widths = [1.25, 1.0, 1.0][: len(lower)]
    axes = figure.subplot_mosaic(
        [cast(list[Any], ["history"] * len(lower)), lower],
        width_ratios=widths,
        height_ratios=[1.0, 1.25],  # type: ignore[arg-type]
    )
    period = settled.period or 0
    length = period * max(1, -(-6 // period)) if period else _LONG
    plot_history(integrate(system, settled.state, max(length, 6), _SMOOTH), signal, ax=axes["history"])
    points = strobe(system, settled.state, period or _POINTS, phase)
    base = signal.rstrip("'") if signal.rstrip("'") in system.coordinates else system.coordinates[0]
    plot_section(points, base, f"{base}'", ax=axes["section"])
    if contacts:
        turns = integrate(system, settled.state, period or _LONG, _SMOOTH)
        shown = contact or contacts[contact_to_show(system, signal, np.abs(turns.forces).max(axis=0))].name
        plot_loop(turns, shown, ax=axes["loop"])
    plot_spectrum(spectrum(settled, signal, options), ax=axes["spectrum"])


def _as_settled(motion: Settled | Attractor) -> Settled:
    if isinstance(motion, Settled):
        return motion
    return Settled(motion.system, motion.strobes, 0, True, motion.orbit, 0.0, motion.evidence)


def _title(motion: Settled | Attractor) -> str:
    structure = motion.system.structure
    where = f"at {value_words(motion.system[structure.pace], structure.pace, structure.units)}"
    if isinstance(motion, Attractor):
        kind = f"period {motion.period}" if motion.orbit is not None else motion.kind.value
        return f"{kind[0].upper()}{kind[1:]} motion {where}"
    return f"Motion of period {motion.period} {where}" if motion.period else f"Motion without period {where}"
