"""Pictures of friction and rigid stops: phases below a time history, hysteresis loops, and bars of energy."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from gapwalk.flow.flow import PERIOD
from gapwalk.flow.hysteresis import StickSlip
from gapwalk.orbit.energy import Energy
from gapwalk.plot.motions import draw_history
from gapwalk.plot.picture import AnyFigure, Inches, draws
from gapwalk.plot.style import AXIS, BLACK, BLUE, GREEN, GREY, VERMILLION, stroke

_FILLS = {"slip +": VERMILLION, "slip -": BLUE, "stick": GREY, "held": GREEN}
_ROW = 0.34  # inches of a row of the strip
_MOST = 4  # loops in a row


def _phases_size(found: StickSlip, **_: object) -> Inches:
    return 7.0, 5.2 + _ROW * len(found.elements)


@draws(StickSlip, panels=True, size=_phases_size)
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


def _energy_size(book: Energy, **_: object) -> Inches:
    return 6.4, 1.3 + 0.32 * (len(book.work) + len(book.losses))


@draws(Energy, size=_energy_size)
def draw_energy(book: Energy, ax: Axes, *, power: bool = False) -> None:
    """Draw a bar for each load that does work, and for each element that takes energy."""
    rows = [(each, VERMILLION) for each in book.work] + [(each, BLUE) for each in book.losses]
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
