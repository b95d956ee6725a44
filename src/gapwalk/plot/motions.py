"""Pictures of motions: time history, contact loop, spectrum, section; hysteresis loops, waterfalls and mode shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, LogNorm, Normalize
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, MultipleLocator
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import NDArray

from gapwalk.attractors.section import Section
from gapwalk.attractors.settle import Attractor, Settled
from gapwalk.attractors.spectrum import Spectrum, SpectrumOptions, Waterfall, spectrum
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles
from gapwalk.flow.hysteresis import Hysteresis, StickSlip, stick_slip
from gapwalk.flow.motion import Motion, contact_to_show, integrate
from gapwalk.meanings import color_of
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.modes import Modes
from gapwalk.model.system import System
from gapwalk.model.words import line_words, order_words, pace_words, parameter_words, signal_words
from gapwalk.orbit.energy import Energy
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.branches import Label, place_labels
from gapwalk.plot.picture import (
    NARROW,
    WIDE,
    AnyFigure,
    Finish,
    Inches,
    draws,
    is_narrow,
    write_heading,
    write_legend,
    write_letters,
)
from gapwalk.plot.style import (
    AXIS,
    BLACK,
    FIRST,
    GREY,
    GUIDE,
    LISTED,
    SECOND,
    SEVERAL,
    broken,
    dots,
    points,
    sheet_size,
    stroke,
    symbols,
)
from gapwalk.tori.torus import TURN, Torus, at_phases

_SPECTRUM_DEPTH = 1e-4  # smallest line that is shown, relative to the largest
_NAMED, _NOTABLE = 5, 0.03  # most lines with names, and their smallest height, relative to the largest
_HIGHEST = 8  # lines, the highest, of which none is left out at the right
_FEW = 33  # number of points of a section from which they are drawn as dots

_LONG = 24  # forcing periods of a time history of a motion without period
_SMOOTH = 512  # samples per forcing period


_WATERFALL_DEPTH = 1e-3  # smallest amplitude with a colour, relative to the largest
_TICKS = 8
Levels = tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], float]
"""A function from amplitudes to levels in dB, and the range of the levels that is shown."""
_COLOURS = "viridis_r"  # perceptually uniform for any colour vision

_MODES = 6  # most modes that are shown
_PLACES = 40  # most inertias of a train, or coordinates, with names below


@draws(Motion, Orbit, Settled, Attractor)
def draw_history(
    motion: Motion | Orbit | Settled | Attractor, ax: Axes, signal: str | None = None, *, contact: str | None = None
) -> None:
    """Draw a signal of a motion over time with the breakpoints of contacts; or the force-deflection loop of a contact.

    Phases in which friction sticks, or a rigid stop is held, are shaded. Where a rigid stop strikes, its force and
    accelerations have no finite value; their impulses are stems.
    """
    if isinstance(motion, Attractor):
        motion = _as_settled(motion)
    motion = motion if isinstance(motion, Motion) else motion.motion()
    if contact is not None:
        _draw_loop(motion, contact, ax)
        return
    signal = signal or motion.system.coordinates[0]
    values = motion.signal(signal)
    ax.plot(motion.theta / PERIOD, values, **stroke(BLACK, 1.1, solid_joinstyle="round"))
    low, high = float(values.min()), float(values.max())
    pad = 0.08 * ((high - low) or 1.0)
    for levels in breakpoints(motion, signal):
        if low - 3 * pad <= levels.max() and levels.min() <= high + 3 * pad:
            if np.ptp(levels):
                ax.plot(motion.theta / PERIOD, levels, **GUIDE.options(zorder=1))
            else:
                ax.axhline(levels[0], **GUIDE.options(zorder=1))
            low, high = min(low, float(levels.min())), max(high, float(levels.max()))
    _shade_rest(motion, ax)
    ax.set_xlim(float(motion.theta[0]) / PERIOD, float(motion.theta[-1]) / PERIOD)
    ax.set_ylim(low - pad, high + pad)
    ax.set_xlabel("forcing periods")
    ax.set_ylabel(broken(signal_words(signal, motion.system.units), 72.0 * ax.bbox.height / ax.figure.dpi))
    _draw_impulses(motion, signal, ax, alone=not values.any())


def _draw_impulses(motion: Motion, signal: str, ax: Axes, *, alone: bool) -> None:
    """Draw the impulses of a signal where rigid stops strike, as stems over a scale of their own with the same zero."""
    theta, sizes = motion.impulses(signal)
    if not len(theta):
        return
    sizes = sizes / motion.system.frequency
    low, high = ax.get_ylim()
    most = max(abs(low), abs(high))
    low, high = min(low, -most if sizes.min() < 0.0 else low), max(high, most if sizes.max() > 0.0 else high)
    ax.set_ylim(low, high)
    if alone:  # the curve would be a line at 0
        ax.lines[0].remove()
        ax.set_ylabel("")
        ax.axhline(0.0, **AXIS.options(zorder=1))
    bars = ax if alone else ax.twinx()
    bars.vlines(theta / PERIOD, 0.0, sizes, color=SECOND, linewidth=points(1.3), zorder=4)
    bars.plot(theta / PERIOD, sizes, **symbols("o", 3.4, SECOND, SECOND, zorder=5))
    scale = 1.1 * float(np.abs(sizes).max()) / most
    bars.set_ylim(low * scale, high * scale)
    bars.grid(visible=False)
    units = motion.system.units
    unit = {"N m": " [N m s]", "rad/s^2": " [rad/s]"}[units.signal(signal)[1]] if units else ""
    bars.set_ylabel(f"impulse of {signal}{unit}", color=SECOND)


def _shade_rest(motion: Motion, ax: Axes) -> None:
    """Shade the phases of a time history in which friction sticks or a stop is held."""
    for phase in stick_slip(motion).phases if motion.holds or motion.slips else ():
        if phase.mode in ("stick", "held"):
            ax.axvspan(phase.start / PERIOD, phase.end / PERIOD, color=GREY, alpha=0.16, linewidth=0, zorder=0)


def _draw_loop(motion: Motion, contact: str, ax: Axes) -> None:
    system = motion.system
    names = [form.name for form in system.structure.contacts]
    if contact not in names:
        raise ModelError(f"there is no contact {contact!r}; contacts are {', '.join(names) or 'none at all'}")
    index = names.index(contact)
    rebounds = system.structure.contacts[index].law.rebounds
    values = motion.deflection_rate(index) if rebounds else motion.forces[:, index]
    ax.plot(motion.deflections[:, index], values, **stroke(BLACK, 0.9, solid_joinstyle="round"))
    for level in _levels(system, index):
        ax.axvline(level, **GUIDE.options(zorder=1))
    arguments = system.structure.contacts[index].law.arguments
    first = f"deflection {arguments[0]} of" if arguments[1:] else "deflection of"
    words = f"{first} {signal_words(contact, system.units)}"
    ax.set_xlabel(words.replace(f" of {contact}", "") if is_narrow(ax.figure) else words)
    rate = "rate of the deflection" + (f" [{system.units.state(chr(39))}]" if system.units else "")
    ax.set_ylabel(rate if rebounds else f"force of {contact}" + " [N m]" * (system.units is not None))


def breakpoints(motion: Motion, signal: str) -> list[NDArray[np.float64]]:
    """Return the values of a coordinate at which a contact that depends only on it opens or closes, at each sample."""
    # They move with a displacement that is prescribed in the deflection.
    system = motion.system
    if signal not in system.coordinates:
        return []
    place = system.coordinates.index(signal)
    layout, found = layout_of(system.structure), []
    angles = Angles(layout, coefficients_of(system), motion.theta)
    for index, slots in enumerate(layout.contacts):
        vector = system.vector(slots.form.vectors[0])
        if vector[place] and np.count_nonzero(vector) == 1:
            sway = angles.sway(slots) + np.zeros(len(motion.theta))
            found += [(level - sway) / float(vector[place]) for level in _levels(system, index)]
    return found


def _levels(system: System, index: int) -> list[float]:
    return [side * clearance for contact, side, clearance in system.breakpoints if contact == index]


@draws(Section)
def draw_section(
    found: Section, ax: Axes, first: str | None = None, second: str | None = None, *, heading: bool = True
) -> None:
    """Draw a section of a motion: a few points for an orbit, closed curves for a torus, a point cloud for chaos."""
    first = first or found.system.coordinates[0]
    second = second or f"{first}'"
    x, y = found.signal(first), found.signal(second)
    cloud = dots(float(np.clip(60.0 / np.sqrt(max(len(x), 1)), 0.7, 3.0)))
    ax.plot(x, y, **(symbols("o", 5.5, BLACK, width=1.0) if len(x) < _FEW else cloud))
    for limits, values in ((ax.set_xlim, x), (ax.set_ylim, y)):
        low, high = (float(values.min()), float(values.max())) if len(values) else (-1.0, 1.0)
        pad = 0.12 * (high - low) or 0.1 * max(1.0, abs(high))
        limits(low - pad, high + pad)
    ax.set_xlabel(signal_words(first, found.system.units))
    ax.set_ylabel(signal_words(second, found.system.units))
    if heading:
        broken = "\n" if is_narrow(ax.figure) else " "
        ax.set_title(f"section at{broken}{found.text}", fontsize="small")


@draws(Spectrum)
def draw_spectrum(found: Spectrum, ax: Axes, *, top: float | None = None, labels: bool = True) -> Finish:
    """Draw the amplitudes of a spectrum over its orders: exact lines for periodic motions, curves for all others."""
    heights = found.amplitudes.copy()
    heights[0] = abs(heights[0])
    largest = float(heights[1:].max()) if len(heights) > 1 else 0.0
    floor = _SPECTRUM_DEPTH * (largest or 1.0)
    top = top or _top(found, largest)
    shown = (found.orders > 0) & (found.orders <= top)
    orders, heights = found.orders[shown], np.maximum(heights[shown], floor)
    if found.period:
        ax.vlines(orders, floor, heights, color=BLACK, linewidth=1.2)
        ax.plot(orders, heights, **symbols("o", 2.6, BLACK))
    else:
        ax.plot(orders, heights, **stroke(BLACK, 0.8))
    ax.set_yscale("log")
    ax.set_xlim(0.0, top)
    ax.set_ylim(floor, 4.0 * (largest or 1.0))
    ax.xaxis.set_major_locator(MultipleLocator(max(1.0, np.ceil(top / 8))))
    ax.set_xlabel(order_words(found.system.units))
    words = f"amplitude of {signal_words(found.signal, found.system.units)}"
    ax.set_ylabel(broken(words, 72.0 * ax.bbox.height / ax.figure.dpi))
    named = [
        Label(line_words(peak.name), peak.order, peak.amplitude)
        for peak in found.peaks(_NAMED, _NOTABLE)
        if peak.order <= top and "." not in peak.name
    ]
    stems = np.column_stack((np.full_like(heights, floor), heights, heights)).ravel()
    curve, ends = np.column_stack((np.repeat(orders, 3), stems)), np.column_stack((orders, heights))
    return partial(place_labels, ax, named, curve, ends) if labels else None


def _top(found: Spectrum, largest: float) -> float:
    notable = found.orders[found.amplitudes > 30 * _SPECTRUM_DEPTH * largest]
    unit = float(found.system.turns or 1)
    strongest = max((each.order for each in found.peaks(_HIGHEST) if each.order in notable), default=0.0)
    most = max(12.0, strongest / unit)
    return unit * float(np.ceil(min(max(float(notable.max(initial=0.0)) / unit, 2.0), most) + 0.3))


def _settled_size(motion: Settled | Attractor, *_: object, **__: object) -> Inches:
    if sheet_size(9.0, 5.8)[0] >= NARROW:
        return 9.0, 5.8
    return 9.0, 12.0 if _as_settled(motion).system.structure.contacts else 14.0


@draws(Settled, Attractor, panels=True, size=_settled_size)
def draw_settled(
    motion: Settled | Attractor,
    figure: AnyFigure,
    signal: str | None = None,
    *,
    phase: float = 0.0,
    contact: str | None = None,
    options: SpectrumOptions | None = None,
    title: str | None = None,
) -> Finish:
    """Draw a settled motion: time history, spectrum, section, and the loop of a contact's force."""
    # The layout follows figures 17 to 19 of Padmanabhan and Singh (1995), and the loop follows their figures 5 and 6.
    write_heading(figure, _settled_title(motion) if title is None else title)
    settled = _as_settled(motion)
    system = settled.system
    signal = signal or system.coordinates[0]
    contacts = system.structure.contacts
    lower: list[Any] = ["spectrum", "section", *(["loop"] if contacts else [])]
    if is_narrow(figure):
        rows = [["history"] * 2, ["spectrum"] * 2, lower[1:] * (3 - len(lower[1:]))]
        axes = figure.subplot_mosaic(cast(list[Any], rows), height_ratios=[1.0, 1.0, 1.25])  # type: ignore[arg-type]
    else:
        axes = figure.subplot_mosaic(
            [cast(list[Any], ["history"] * len(lower)), lower],
            width_ratios=[1.25, 1.0, 1.0][: len(lower)],
            height_ratios=[1.0, 1.25],  # type: ignore[arg-type]
        )
    period = settled.period or 0
    length = period * -(-6 // period) if period else _LONG
    draw_history(integrate(system, settled.state, max(length, 6), _SMOOTH), axes["history"], signal)
    base = signal.rstrip("'") if signal.rstrip("'") in system.coordinates else system.coordinates[0]
    draw_section(settled.section(phase), axes["section"], base)
    if contacts:
        turns = integrate(system, settled.state, period or _LONG, _SMOOTH)
        place = contact_to_show(system, signal, np.abs(turns.forces).max(axis=0), turns.events)
        shown = contact or contacts[place].name
        _draw_loop(turns, shown, axes["loop"])
    return draw_spectrum(spectrum(settled, signal, options), axes["spectrum"])


def _as_settled(motion: Settled | Attractor) -> Settled:
    if isinstance(motion, Settled):
        return motion
    return Settled(motion.system, motion.strobes, 0, True, motion.orbit, 0.0, motion.evidence)


def _settled_title(motion: Settled | Attractor) -> str:
    where = f"at {pace_words(motion.system)}"
    if isinstance(motion, Attractor):
        kind = f"period {motion.period}" if motion.orbit is not None else motion.kind.value
        return f"{kind[0].upper()}{kind[1:]} motion {where}"
    return f"Motion of period {motion.period} {where}" if motion.period else f"Motion without period {where}"


@draws(Hysteresis, size=(6.0, 4.4), several=True)
def draw_hysteresis(loops: Hysteresis | Sequence[Hysteresis], ax: Axes, names: Sequence[str] = ()) -> None:
    """Draw one or several loops of contact force over deflection: the area is the energy dissipated per cycle."""
    loops = [loops] if isinstance(loops, Hysteresis) else list(loops)
    entries = []
    for place, loop in enumerate(loops):
        options = stroke(LISTED[place % len(LISTED)][0], 1.3, LISTED[place % len(LISTED)][1])
        ax.plot(loop.deflection, loop.force, **options)
        name = names[place] if place < len(names) else loop.law.name
        entries.append((f"{name}: loss {loop.loss:.4g} per cycle", options))
    ax.axhline(0.0, **AXIS.options(zorder=1))
    for level in sorted({level for loop in loops for level in loop.breakpoints}):
        if any(loop.deflection.min() < level < loop.deflection.max() for loop in loops):
            ax.axvline(level, **GUIDE.options(zorder=1))
    ax.set_xlabel("deflection")
    ax.set_ylabel("contact force")
    write_legend(ax, entries, "inside")


@draws(Waterfall)
def draw_waterfall(found: Waterfall, ax: Axes, *, depth: float = _WATERFALL_DEPTH) -> None:
    """Draw the amplitudes of all orders along a branch as colours, on a logarithmic scale."""
    # The horizontal axis is the path along the branch; a dashed line marks each fold, where the parameter reverses.
    mesh = fill_waterfall(found, ax, depth)
    ax.figure.colorbar(
        mesh, ax=ax, label=f"amplitude of {signal_words(found.signal, found.units)}", pad=0.02, extend="min"
    )


def fill_waterfall(
    found: Waterfall, ax: Axes, depth: float = _WATERFALL_DEPTH, levels: Levels | None = None, *, in_hertz: bool = False
) -> Any:
    """Draw a waterfall without the bar of its colours; return the colours.

    With a function from amplitudes to levels in dB, and their range, colours are levels.
    """
    steps = np.diff(found.values)
    places = np.concatenate(([0.0], np.cumsum(np.maximum(np.abs(steps), 1e-12))))  # along the branch
    turns = 1 + np.flatnonzero(steps[:-1] * steps[1:] < 0.0)
    heights = found.amplitudes[:, 1:]
    largest = float(heights.max()) or 1.0
    spacing = float(found.orders[1]) if len(found.orders) > 1 else 1.0
    middles = 0.5 * (places[:-1] + places[1:])
    ends = np.concatenate((places[:1], middles, places[-1:])) if len(middles) else places[0] + np.array([-0.5, 0.5])
    if levels is None:
        norm: Any = LogNorm(depth * largest, largest)
        cells = np.maximum(heights.T, 0.1 * depth * largest)
    else:
        top = float(levels[0](np.array(largest)))
        norm, cells = Normalize(top - levels[1], top), np.maximum(levels[0](heights.T), top - 2.0 * levels[1])
    upwards = np.append(found.orders[1:] - 0.5 * spacing, found.orders[-1] + 0.5 * spacing)
    if in_hertz:
        pitch = np.interp(ends, places, found.pitch)
        ends, upwards = np.broadcast_to(ends, (len(upwards), len(ends))), np.outer(upwards, pitch)
    mesh = ax.pcolormesh(
        ends, upwards, cells, norm=norm, cmap=mpl.colormaps[_COLOURS].with_extremes(under="white"), rasterized=True
    )
    for turn in turns:
        ax.axvline(float(places[turn]), **GUIDE.options())
    marks = _marks(found.values, places, turns)
    ax.set_xticks([x for x, _ in marks], [text for _, text in marks])
    ax.grid(visible=False)
    time = "time" + " [s]" * bool(found.units)
    words = time if found.parameter == "time" else parameter_words(found.parameter, found.units)
    ax.set_xlabel(words + (", along the branch" if len(turns) else ""))
    hertz = "frequency [Hz]" if found.units else "angular frequency"
    ax.set_ylabel(hertz if in_hertz else order_words(found.units))
    return mesh


def _marks(
    values: NDArray[np.float64], places: NDArray[np.float64], turns: NDArray[np.intp]
) -> list[tuple[float, str]]:
    """Return ticks with the parameter's values: round numbers between the folds, not too close to each other."""
    rounds = MaxNLocator(_TICKS).tick_values(float(values.min()), float(values.max()))
    marks: list[tuple[float, str]] = []
    for first, last in pairwise([0, *turns.tolist(), len(values) - 1]):
        part = slice(first, last + 1)
        order = np.argsort(values[part])
        inside = [v for v in rounds if values[part].min() <= v <= values[part].max()]
        at = np.interp(inside, values[part][order], places[part][order])
        marks += [(float(x), f"{v:.6g}") for x, v in zip(at, inside, strict=True)]
    least = (places[-1] - places[0]) / 20 if len(places) > 1 else 1.0
    shown: list[tuple[float, str]] = []
    for mark in sorted(marks):
        if not shown or mark[0] - shown[-1][0] > least:
            shown.append(mark)
    return shown


@draws(Modes, panels=True, size=lambda modes, **_: (WIDE[0], 0.8 + 1.05 * min(len(modes), _MODES)))
def draw_modes(modes: Modes, figure: AnyFigure, system: System, *, title: str = "") -> None:
    """Draw the modes of lowest frequency, one panel each: along the inertias of a drive train, or by coordinates."""
    write_heading(figure, title)
    panels = figure.subplots(min(len(modes), _MODES), 1, sharex=True, squeeze=False)[:, 0]
    assembly = system.structure.assembly
    held = isinstance(assembly, TrainAssembly) and any(
        assembly.form.ground in link.ends for link in assembly.form.links if not (link.drag or link.loose)
    )
    names = (*(modes.inertias or modes.coordinates), *["ground"] * held)
    for number, ax in enumerate(panels):
        _draw_mode(system, modes, number, ax, len(names))
        frequency = modes.frequencies[number]
        rate = f"{frequency / (2 * math.pi):.4g} Hz" if system.units else f"{frequency:.4g}"
        text = "no vibration" if math.isnan(frequency) else rate
        ax.set_ylabel(f"{modes.numbers[number] or '-'}\n{text}", rotation=0, ha="right", va="center")
        ax.axhline(0.0, **AXIS.options())
        ax.set_ylim(-1.25, 1.25)
        ax.set_yticks([-1, 0, 1])
    if len(names) <= _PLACES:
        panels[-1].set_xticks(range(len(names)), names, rotation=35 if len(names) > 6 else 0, ha="center")
    kind = "" if system.units else " (angular)"
    quantity = "angles referred to the first inertia" if modes.inertias else "coordinates"
    quantity += " (open circles: a quarter of a period later)" if np.iscomplexobj(modes.shapes) else ""
    if isinstance(assembly, TrainAssembly) and any(link.contact and not link.loose for link in assembly.form.links):
        quantity += " (grey: through contacts)"
    panels[-1].set_xlabel(f"{quantity}; left: natural frequencies{kind}")


def _draw_mode(system: System, modes: Modes, number: int, ax: Axes, places: int) -> None:
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        # Angles referred to the first inertia, the largest of them 1, so that the line is continuous across gears.
        heights = modes.angles[:, number] / assembly.numbers(system.values).referring
        heights = np.append(heights / np.abs(heights).max(), 0.0)[:places]
        for link in (each for each in assembly.form.links if not (each.drag or each.loose)):  # those with a stiffness
            ends = list(link.ends)
            ax.plot(ends, heights[ends], **stroke(GREY if link.contact else BLACK, 1.4))
    else:
        heights = modes.shapes[:, number].real
        if np.iscomplexobj(modes.shapes):
            ax.plot(-modes.shapes[:, number].imag, **symbols("o", 5))
        ax.vlines(range(len(heights)), 0.0, heights, color=BLACK, linewidth=1.4)
    ax.plot(heights, **symbols("o", 4, BLACK))


# Pictures of friction and rigid stops: phases below a time history, hysteresis loops, and bars of energy.

_FILLS = {"slip +": FIRST, "slip -": SECOND, "stick": "#b9b9b9", "held": GREY}
_ROW = 0.34  # inches of a row of the strip
_MOST = 4  # loops in a row


@draws(StickSlip, panels=True, size=lambda found, **_: (7.0, 5.2 + _ROW * len(found.elements)))
def draw_stick_slip(
    found: StickSlip, figure: AnyFigure, signal: str | None = None, *, loops: tuple[str, ...] | None = None
) -> None:
    """Draw a time history with stick phases shaded, a strip of the modes of each element below, and their loops."""
    motion, names = found.motion, found.elements
    shown = loops if loops is not None else names[:_MOST]
    outer = figure.add_gridspec(2 if shown else 1, 1, height_ratios=[3.0, 2.2] if shown else [1.0])
    upper = outer[0].subgridspec(2, 1, height_ratios=[2.2, 0.25 + 0.28 * len(names)], hspace=0.08)
    history = figure.add_subplot(upper[0])
    strip = figure.add_subplot(upper[1], sharex=history)
    draw_history(motion, history, signal)
    history.set_xlabel("")
    history.tick_params(labelbottom=False)
    draw_strip(found, strip, history)
    if shown:
        lower = outer[1].subgridspec(1, len(shown))
        for place, name in enumerate(shown):
            draw_history(motion, figure.add_subplot(lower[place]), contact=name)


def draw_strip(found: StickSlip, ax: Axes, above: Axes) -> None:
    """Draw a row for each element: bars of its modes, and ticks where it is struck; the legend is above other axes."""
    names, used = found.elements, list[str]()
    for phase in found.phases:
        row = len(names) - 1 - names.index(phase.element)
        width = (phase.end - phase.start) / PERIOD
        ax.broken_barh([(phase.start / PERIOD, width)], (row - 0.36, 0.72), facecolors=_FILLS[phase.mode], linewidth=0)
        used.append(phase.mode)
    for strike in found.strikes:
        row = len(names) - 1 - names.index(strike.element)
        ax.vlines(strike.theta / PERIOD, row - 0.42, row + 0.42, color=BLACK, linewidth=0.9)
    ax.set_yticks(range(len(names)), names[::-1])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.grid(visible=False)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("forcing periods")
    entries = [Patch(facecolor=colour, label=mode) for mode, colour in _FILLS.items() if mode in used]
    if found.strikes:
        entries.append(ax.plot([], [], **stroke(BLACK, 0.9), label="impact")[0])  # type: ignore[arg-type]
    above.legend(handles=entries, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False)


@draws(Energy, size=lambda book, **_: (6.4, 1.3 + 0.32 * (len(book.work) + len(book.losses))))
def draw_energy(book: Energy, ax: Axes, *, power: bool = False) -> None:
    """Draw a bar for each load that does work, and for each element that takes energy."""
    rows = [(each, FIRST) for each in book.work] + [(each, SECOND) for each in book.losses]
    for place, (item, colour) in enumerate(rows):
        value = item.power if power else item.energy
        ax.barh(-place - 0.6 * (place >= len(book.work)), value, height=0.66, color=colour, linewidth=0)
        ax.annotate(
            f"{value:.4g}",
            (max(value, 0.0), -place - 0.6 * (place >= len(book.work))),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize="small",
        )
    labels = [item.element if item.kind in item.element else f"{item.element}: {item.kind}" for item, _ in rows]
    ax.set_yticks([-place - 0.6 * (place >= len(book.work)) for place in range(len(rows))], labels)
    ax.tick_params(axis="y", length=0)
    ax.axvline(0.0, **AXIS.options())
    ax.grid(visible=False, axis="y")
    ax.margins(x=0.16)
    units = book.system.units is not None
    what = "mean power" + " [W]" * units if power else "energy in one period of the orbit" + " [J]" * units
    ax.set_xlabel(f"{what}: work of loads, and losses")


# Picture of one torus: in the stroboscopic section, and as a surface in space.

_PALE = "#7fcfb8"  # the green of tori, pale
_CURVES = (color_of("pair"), *(each.color for each in SEVERAL))
_FINE = 400  # points of a curve
_ANGLES = 48  # angles of the excitation in a picture in space, per forcing period


@draws(Torus, panels=True, size=lambda torus, *_, **__: (3.2 * min(torus.curves, _MOST) + 4.4, 4.2))
def draw_torus(torus: Torus, figure: AnyFigure, coordinate: str = "", *, title: str = "") -> None:
    """Draw each curve of a torus in the stroboscopic section, and the torus in space."""
    names, units = torus.system.coordinates, torus.system.units
    coordinate = coordinate or names[0]
    place = names.index(coordinate)
    rate = torus.system.size + place
    count = min(torus.curves, _MOST)
    grid = figure.add_gridspec(1, count + 1, width_ratios=[*[1.0] * count, 1.4])
    write_heading(figure, title)
    panels = [figure.add_subplot(grid[number]) for number in range(count)]
    for number, (panel, curve) in enumerate(zip(panels, torus.sections, strict=False)):
        closed = at_phases(curve, np.linspace(0.0, TURN, _FINE))
        panel.plot(closed[:, place], closed[:, rate], **stroke(_CURVES[number], 1.4, "-"))
        panel.set_xlabel(signal_words(coordinate, units))
        panel.margins(0.08)
        panel.xaxis.set_major_locator(MaxNLocator(4))
        if count > 1:
            panel.set_title(f"forcing period {number + 1} of {torus.curves}", fontsize="small")
    panels[0].set_ylabel(signal_words(f"{coordinate}'", units))
    write_letters(panels)
    space = figure.add_subplot(grid[count], projection="3d")
    assert isinstance(space, Axes3D)
    _draw_surface(space, torus, place, rate)


def _draw_surface(space: Axes3D, torus: Torus, place: int, rate: int) -> None:
    """Draw the torus as a surface: position and velocity turn about an axis with the angle of the excitation."""
    states = torus.surface(_ANGLES)
    angles = np.linspace(0.0, PERIOD, states.shape[0])[:, None]  # one turn for all m forcing periods
    x, y = states[:, :, place], states[:, :, rate] / torus.system.frequency
    middle, size = x.mean(), float(max(np.ptp(x), np.ptp(y)))
    radius = 1.6 * size + x - middle
    light = LightSource(azdeg=315, altdeg=50)
    space.plot_surface(
        radius * np.cos(angles), radius * np.sin(angles), y,
        color=_PALE, lightsource=light, linewidth=0, rcount=states.shape[0], ccount=states.shape[1],
    )  # fmt: skip
    widths = [float(np.ptp(each)) for each in (radius * np.cos(angles), radius * np.sin(angles), y)]
    space.set_box_aspect(widths, zoom=1.35)
    space.set_axis_off()
    space.view_init(elev=38.0, azim=-60.0)
    space.set_title(
        "once round: " + ("one forcing period" if torus.curves == 1 else f"{torus.curves} forcing periods"),
        fontsize="small",
    )
