"""Pictures of rattle: bands shaded over the response with severity below, and maps of two parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gapwalk.answers.gap_states import GapState
from gapwalk.answers.rattle_bands import RattleBands, RattleMap, Severity, cell_word
from gapwalk.answers.settled_sweep import Direction, Stretch
from gapwalk.answers.shown_measure import moved_by
from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.words import parameter_words
from gapwalk.plot.cells import draw_loci, fill_colors
from gapwalk.plot.picture import AnyFigure, Finish, Inches, draws, write_answer, write_legend, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREEN, GREY, VERMILLION, points, stroke, symbols

_TINTS = {GapState.ONE_SIDE: "#fbe3c4", GapState.BOTH_SIDES: "#f2b98a"}  # in grey, the second is clearly darker
# periodic, and not periodic: the same hue, darker
_CELLS = {
    GapState.CLOSED: ("#e3ebf2", "#a9bccd"),
    GapState.OPEN: ("#ffffff", "#d0d0d0"),
    GapState.ONE_SIDE: ("#fbe3c4", "#d9a75c"),
    GapState.BOTH_SIDES: ("#f2b98a", "#b5602a"),
}
_DIVERGED, _UNDONE = "#3a3a3a", "#f4f4f4"
_WORDS = {
    GapState.CLOSED: "closed (quiet)",
    GapState.OPEN: "open (quiet)",
    GapState.ONE_SIDE: "one side",
    GapState.BOTH_SIDES: "both sides",
}
_MAP: Inches = (8.0, 6.0)
_WAYS = {str(Direction.UP): (BLUE, "-"), str(Direction.DOWN): (VERMILLION, (0, (4, 2)))}
_OTHER = (GREEN, (0, (1, 1)))
_SIZE: Inches = (8.0, 9.0)
_WATCHED, _SAMPLES = 16, 64  # forcing periods of a motion without period, and samples of each
_CLOSE = 0.12  # share of the range below which the labels of two ends would touch


@draws(RattleBands, panels=True, size=_SIZE)
def draw_rattle(found: RattleBands, figure: AnyFigure, gap: str | None = None, *, title: str = "") -> Finish:
    """Draw the bands of one gap over the response, and the peak force and the impacts along them."""
    gap = _checked(found, gap)
    panels = figure.subplots(3, 1, sharex=True, height_ratios=[1.25, 1.0, 0.8])
    write_answer(figure, title, [found.sentence(gap)])
    write_letters(panels)
    draw_bands(found, panels[0], gap)
    units = found.system.units
    strikes = all(math.isnan(row.peak) for row in found.severities if row.gap == gap and row.state.rattles)
    speed = f"approach velocity{f' [{units.state(chr(39))}]' if units else ''}"
    force = "peak torque [N m]" if units else "peak force"
    _draw_severity(found, panels[1], gap, "approach" if strikes else "peak", speed if strikes else force)
    many = "impacts per s" if units else "impacts per time"
    _draw_severity(found, panels[2], gap, "per_second", many)
    for ax in panels[:-1]:
        ax.set_xlabel("")
    write_legend(figure, list(_entries(found, gap)))
    return partial(_write_ends, panels[0], found, gap)


@draws(RattleBands)
def draw_bands(found: RattleBands, ax: Axes, gap: str | None = None) -> None:
    """Draw the response of the settled motions with the bands of one gap shaded, in one panel."""
    gap = _checked(found, gap)
    _shade(found, ax, gap)
    measure = f"half.{moved_by(found.system, gap)[0]}"
    for sweep in found.sweeps:
        color, dashes = _line(sweep.met)
        for piece in sweep.pieces:
            if isinstance(piece, Stretch):
                x = [point.value for point in piece.points]
                y = [point.measure(measure) for point in piece.points]
                ax.plot(x, y, **stroke(color, 1.4, dashes, zorder=4))
            else:
                motion = piece.motion.motion(_WATCHED, _SAMPLES)
                along = motion.q[:, found.system.coordinates.index(measure.partition(".")[2])]
                mark = symbols("o" if piece.motion.orbit else "x", 3.5, color, color)
                ax.plot([piece.value], [0.5 * np.ptp(along)], zorder=5, **mark)
    units = found.system.units
    signal = measure.partition(".")[2]
    words = f"amplitude of {signal}" + (f" [{units.signal(signal)[1]}]" if units else "")
    ax.set(ylabel=words, xlabel=parameter_words(found.parameter, units))
    ax.set_xlim(*found.within)
    ax.set_ylim(bottom=0.0)


def _checked(found: RattleBands, gap: str | None) -> str:
    name = found.gaps[0] if gap is None else gap
    if name not in found.gaps:
        raise ModelError(f"gap is {gap!r}; {did_you_mean(name, found.gaps)}")
    return name


def _shade(found: RattleBands, ax: Axes, gap: str) -> None:
    for band in found.of(gap):
        for state, tint in _TINTS.items():  # where motions of both kinds exist, the worse one shows
            for span in band.spans:
                if span.state is state:
                    ax.axvspan(span.low.value, span.high.value, color=tint, linewidth=0, zorder=0)
        for end in (band.low, band.high):
            ax.axvline(end.value, **stroke(GREY, 0.8, ":" if not end.is_located else "-", zorder=1))


def _draw_severity(found: RattleBands, ax: Axes, gap: str, what: str, words: str) -> None:
    _shade(found, ax, gap)
    for sweep in found.sweeps:
        color, dashes = _line(sweep.met)
        rows = [row for row in found.severities if row.gap == gap and row.met == sweep.met]
        x, y = [row.value for row in rows], [getattr(row, what) for row in rows]
        ax.plot(x, y, **stroke(color, 0.8, dashes, zorder=3))
        for is_periodic, marker in ((True, "o"), (False, "x")):
            own = [(row.value, getattr(row, what)) for row in rows if (row.period > 0) is is_periodic]
            if own:
                ax.plot(*np.array(own).T, zorder=4, **symbols(marker, 2.6 if is_periodic else 4.0, color, color))
    worst = next((each.severity for each in found.worst if each.severity.gap == gap), None)
    if worst is not None and what != "per_second":
        ax.plot([worst.value], [getattr(worst, what)], zorder=6, **symbols("*", 11.0, "#f3c55b", BLACK))
    ax.set(ylabel=words, xlabel=parameter_words(found.parameter, found.system.units))
    ax.set_ylim(0.0, 1.08 * ax.get_ylim()[1])


def _entries(found: RattleBands, gap: str) -> Iterator[tuple[str, Any]]:
    for sweep in found.sweeps:
        if sweep.name:
            continue
        color, dashes = _line(sweep.met)
        name = found.parameter.rpartition(".")[2].replace("_", " ")
        yield f"{name} {sweep.direction}", stroke(color, 1.4, dashes)
    if any(sweep.name for sweep in found.sweeps):
        yield "other motions", stroke(_OTHER[0], 1.4, _OTHER[1])
    if any(_is_wild(row) for row in found.severities):
        yield "not periodic, or of long period", symbols("x", 4.0, BLACK, BLACK)
    seen = {span.state for band in found.of(gap) for span in band.spans}
    words = {GapState.ONE_SIDE: "rattles on one side", GapState.BOTH_SIDES: "on both sides"}
    yield from ((words[state], tint) for state, tint in _TINTS.items() if state in seen)
    if found.worst:
        yield "worst", symbols("*", 9.0, "#f3c55b", BLACK)


def _line(met: str) -> tuple[str, Any]:
    return _WAYS.get(met, _OTHER)


def _is_wild(row: Severity) -> bool:
    return row.period == 0


def _write_ends(ax: Axes, found: RattleBands, gap: str) -> None:
    """Write the ends of the bands above the first panel, where they do not touch each other."""
    low, high = found.within
    last = -math.inf
    for end in (end for band in found.of(gap) for end in (band.low, band.high)):
        if (end.value - last) / (high - low) < _CLOSE:
            continue
        last = end.value
        text = f"{end.value:.6g}\n{end.kind}"
        ax.annotate(
            text,
            (end.value, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0.0, 3.0),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=points(7.5),
            annotation_clip=False,
        )


@draws(RattleMap, size=_MAP)
def draw_rattle_map(found: RattleMap, ax: Axes, gap: str | None = None) -> None:
    """Draw the state of one gap in the plane of two parameters, with the exact borders over the cells."""
    name = found.gaps[0] if gap is None else gap
    if name not in found.gaps:
        raise ModelError(f"gap is {gap!r}; {did_you_mean(name, found.gaps)}")
    states, is_periodic = found.codes[..., found.gaps.index(name)], found.periods > 0
    codes, entries = np.zeros(states.shape), []
    kinds = [(state.code, periodic) for state in GapState for periodic in (True, False)]
    for code, periodic in [*kinds, (-1, False), (-2, False)]:
        own = (states == code) & (is_periodic == periodic)
        if own.any():
            codes[own] = len(entries)
            entries.append(_cell_entry(code, periodic))
    units = found.system.units
    words = parameter_words(found.first, units), parameter_words(found.second, units)
    fill_colors(ax, codes, [color for _, color in entries], found.within, words)
    lines = [(f"border: {text}", options) for text, options in draw_loci(ax, found, found.loci)]
    ax.set_title(f"rattle of {name}", wrap=True)
    note = f"checked with the exact flow: {len(found.different)} of {found.checked} cells differed"
    write_legend(ax, [*entries, *lines], note=note if found.checked else "not checked with the exact flow")


def _cell_entry(code: int, periodic: bool) -> tuple[str, str]:
    if code < 0:
        return cell_word(code, True), _DIVERGED if code == -1 else _UNDONE
    state = list(GapState)[code]
    return _WORDS[state] + ("" if periodic else ", not periodic"), _CELLS[state][0 if periodic else 1]
