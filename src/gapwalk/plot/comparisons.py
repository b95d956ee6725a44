"""Pictures of comparisons: two motions, a record with a motion, and two results of studies.

The first motion is black, the second wine-red; the first of two results is pale.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from gapwalk.attractors.compare_motions import Contrast, LinePair, SignalPair
from gapwalk.bifurcation.special_point import Kind
from gapwalk.flow.flow import PERIOD
from gapwalk.measurement.fit import Alignment, Fit
from gapwalk.model.measures import full_measure
from gapwalk.model.units import Units
from gapwalk.model.words import measure_words, order_words, pace_words, parameter_words, signal_words
from gapwalk.orbit.orbit import signal_along
from gapwalk.plot import style
from gapwalk.plot.branches import pieces_of
from gapwalk.plot.picture import WIDE, AnyFigure, Inches, draws, write_heading, write_legend
from gapwalk.studies.compare import ResultComparison
from gapwalk.studies.result import Result

_DEPTH = 1e-3  # smallest line that is shown, relative to the largest
_SHIFT, _WIDEST = 0.007, 0.16  # half the distance of paired lines: relative to the picture; at most, to their order
_LEAST = 5.0  # smallest upper limit of the order axis

_SHOWN = 3  # periods of the orbit in the history of a record
_SMOOTH = 600  # points of the computed history per period of the orbit
_FEW = 120  # samples per period of the orbit up to which they are drawn as dots

_FIRST, _SECOND = (
    style.LineStyle("", style.BLACK, "-", 1.2),
    style.LineStyle("", style.SECOND, style.SEVERAL[1].dashes, 1.2),
)
_PALE, _THIN = (
    style.LineStyle("", style.FIRST, "-", 4.6),
    style.LineStyle("", style.BLACK, "-", 1.1),
)  # of the two results
_UNSTABLE = style.LineStyle("unstable in the second", style.BLACK, (0, (3.2, 1.6)), 1.1)
_TOLERANCE = style.LineStyle("tolerance", style.GREY, (0, (5, 2)), 1.0)
_RING = style.SymbolStyle("only in one result", "", "o", "none", 12.0, style.SECOND, 1.1)

_ZERO = 1e-12  # fraction of the ranges, below which a distance is drawn with this value


def _draw_lines(ax: Axes, lines: Sequence[LinePair], signal: str, units: Units | None) -> None:
    """Draw the amplitudes of two line spectra in pairs over their orders, which the units count."""
    orders, first, second, _ = np.array(lines).T
    amplitudes = np.array([first, second], dtype=float)
    largest = float(amplitudes.max(initial=0.0)) or 1.0
    floor = _DEPTH * largest
    notable = np.flatnonzero(amplitudes.max(axis=0) > 3.0 * floor)
    last = int(notable[-1]) if len(notable) else 0
    shown = slice(0, max(last + 1, int(np.searchsorted(orders, _LEAST, side="right"))))
    top = float(orders[shown][-1]) + 0.6 * max(1.0, float(orders[0]))
    gap = min(_SHIFT * top, _WIDEST * float(orders[0]))
    for shift, heights, color, marker in (
        (-gap, amplitudes[0, shown], style.BLACK, style.symbols("o", 3.2, style.BLACK)),
        (gap, amplitudes[1, shown], style.SECOND, style.symbols("s", 3.2, edge=style.SECOND)),
    ):
        tops = np.maximum(heights, floor)
        ax.vlines(orders[shown] + shift, floor, tops, color=color, linewidth=style.points(1.1))
        ax.plot(orders[shown] + shift, tops, **marker)
    _set_spectrum(ax, top, (floor, 2.5 * largest), signal, units)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def _set_spectrum(ax: Axes, top: float, heights: tuple[float, float], signal: str, units: Units | None) -> None:
    ax.set_yscale("log")
    ax.set(
        xlim=(0.0, top), ylim=heights, xlabel=order_words(units), ylabel=f"amplitude of {signal_words(signal, units)}"
    )


# ------------------------------------------------------------------------------------------------------ two motions


# a row for each signal, and title and legend
@draws(Contrast, panels=True, size=lambda found, **_: (9.5, 2.9 * len(found.pairs) + 0.5))
def draw_contrast(found: Contrast, figure: AnyFigure, *, title: str | None = None) -> None:
    """Draw two motions for comparison, a row for each signal: histories on the left, spectra on the right."""
    axes = figure.subplots(len(found.pairs), 2, squeeze=False, width_ratios=[1.35, 1.0])
    for (left, right), pair in zip(axes, found.pairs, strict=True):
        for values, options in zip(pair.histories, (_FIRST.options(), _SECOND.options()), strict=True):
            left.plot(pair.theta / PERIOD, values, **options)
        left.set_xlim(float(pair.theta[0]) / PERIOD, float(pair.theta[-1]) / PERIOD)
        left.set(xlabel="forcing periods", ylabel=signal_words(pair.signal, pair.spectra[0].system.units))
        if pair.agreement is not None:
            text = f"rms difference {pair.agreement.relative:.2g}, correlation {pair.agreement.correlation:.4f}"
            left.set_title(text, fontsize=style.points(8.5))
        _draw_spectra(right, pair)
    write_legend(figure, list(zip(found.names, (_FIRST.options(), _SECOND.options()), strict=True)))
    write_heading(figure, _contrast_title(found) if title is None else title)


def _draw_spectra(ax: Axes, pair: SignalPair) -> None:
    units = pair.spectra[0].system.units
    if pair.agreement is not None:
        _draw_lines(ax, pair.agreement.lines, pair.signal, units)
        return
    largest = max(float(found.amplitudes[1:].max()) for found in pair.spectra)
    for found, look in zip(pair.spectra, (_FIRST, _SECOND), strict=True):
        ax.plot(found.orders[1:], found.amplitudes[1:], **look.options(0.7))
    top = 8.0 * float(pair.spectra[0].system.turns or 1)
    _set_spectrum(ax, top, (1e-4 * largest, 3.0 * largest), pair.signal, units)


def _contrast_title(found: Contrast) -> str:
    first, second = (pace_words(motion.system) for motion in found.motions)
    where = first if first == second else f"{first} and {second.partition(' = ')[2]}"
    return f"{found.names[0]} and {found.names[1]} at {where}"


# ------------------------------------------------------------------------------------------- a record and a motion


def _alignment_size(found: Alignment | Fit | Sequence[Alignment], **_: object) -> Inches:
    return 9.5, 6.0 * (len(found) if isinstance(found, (list, tuple)) else 1)


@draws(Alignment, Fit, panels=True, size=_alignment_size, shows="its own signal", several=True)
def draw_alignment(
    found: Alignment | Fit | Sequence[Alignment],
    figure: AnyFigure,
    *,
    names: Sequence[str] = (),
    title: str | None = None,
) -> None:
    """Draw a record over the computed motion: history, spectral lines, and the residual over the phase."""
    if isinstance(found, (list, tuple)):
        write_heading(figure, title or "")
        parts = figure.subfigures(len(found), 1, squeeze=False)[:, 0]
        for place, (part, each) in enumerate(zip(parts, found, strict=True)):
            draw_alignment(each, part, title=names[place] if place < len(names) else None)
        return
    found = found.after if isinstance(found, Fit) else found
    assert isinstance(found, Alignment)
    axes = figure.subplot_mosaic(
        [["history", "history"], ["lines", "rest"]],  # type: ignore[list-item]
        height_ratios=[1.15, 1.0],  # type: ignore[arg-type]
    )
    _draw_record(axes["history"], found)
    _draw_lines(axes["lines"], found.agreement.lines, found.signal.name, found.orbit.system.units)
    _draw_rest(axes["rest"], found)
    agreed = found.agreement
    words = f"rms error {agreed.rms:.4g} ({agreed.relative:.2%} of the record's), correlation {agreed.correlation:.5f}"
    write_heading(figure, words if title is None else f"{title}\n{words}")


def _draw_record(ax: Axes, found: Alignment) -> None:
    """Draw the first periods of the record, and the computed motion at the same phases."""
    length = PERIOD * found.orbit.period
    shown = found.theta <= found.theta[0] + min(_SHOWN, found.periods) * length
    theta = found.theta[shown]
    measured = style.symbols("o", 2.4, style.BLACK) if np.count_nonzero(shown) <= _FEW * _SHOWN else _FIRST.options()
    ax.plot(theta / PERIOD, found.measured[shown], **measured)
    fine = np.linspace(theta[0], theta[-1], _SMOOTH * min(_SHOWN, found.periods))
    whole = signal_along(found.orbit, found.signal, length * np.arange(_SMOOTH) / _SMOOTH)
    ax.plot(fine / PERIOD, signal_along(found.orbit, found.signal, fine) - whole.mean(), **_SECOND.options())
    ax.set(xlim=(theta[0] / PERIOD, theta[-1] / PERIOD), xlabel="forcing periods")
    ax.set_ylabel(signal_words(found.signal.name, found.orbit.system.units))
    name = f"record ({found.record.name})".replace("$", r"\$")
    entries = [(name, measured), (f"computed at {pace_words(found.orbit.system)}", _SECOND.options())]
    write_legend(ax, entries, "above")


def _draw_rest(ax: Axes, found: Alignment) -> None:
    """Draw the residual over the phase in the period of the orbit: noise has no pattern there, a model error has."""
    phase = (found.theta / PERIOD) % found.orbit.period
    ax.axhline(0.0, **style.AXIS.options())
    ax.plot(phase, found.measured - found.computed, **style.dots(4.0))
    ax.set(xlim=(0.0, found.orbit.period), xlabel="phase in the motion, forcing periods")
    ax.set_ylabel("measured minus computed")


# ------------------------------------------------------------------------------------------ two results of studies


@draws(ResultComparison, panels=True, size=(WIDE[0], 6.4))
def draw_comparison(
    found: ResultComparison,
    figure: AnyFigure,
    measure: str | None = None,
    *,
    tolerance: float | None = None,
    names: tuple[str, str] = ("the first", "the second"),
    title: str | None = None,
) -> None:
    """Draw two results in one picture, and below them their distance over the parameter."""
    first, second = found.results
    units = first.system.units
    full = full_measure(measure or first.walked.measure, first.system.coordinates)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.4))
    above.set_title(first.title.replace("$", r"\$") if title is None else title, wrap=True)
    if first.map is not None:
        for result, options in ((first, _PALE.options()), (second, _THIN.options())):
            for locus in result.map.loci if result.map else ():
                above.plot(*locus.values.T, **options)
        above.set_ylabel(parameter_words(found.parameters[-1], units))
    else:
        _draw_branches(above, first, full, is_first=True)
        _draw_branches(above, second, full, is_first=False)
        _ring_lone(above, found, full)
        above.set_ylabel(measure_words(full, units))
    _draw_distances(below, found, tolerance)
    below.set_xlabel(parameter_words(found.parameters[0], units))
    below.set_ylabel("distance / ranges")
    write_legend(figure, _comparison_entries(found, names, tolerance))


def _draw_branches(ax: Axes, result: Result, measure: str, is_first: bool) -> None:
    for branch in result.branches:
        for piece in pieces_of(branch, measure):
            look = _PALE if is_first else _THIN if piece.label == "stable" else _UNSTABLE
            ax.plot(piece.x, piece.y, **look.options(zorder=2 if is_first else 3))
        for special in branch.special_points:
            ax.plot(special.value, special.point.measure(measure), **_symbol(special.kind, is_first))


def _symbol(kind: Kind, is_first: bool) -> dict[str, Any]:
    """Return the symbol of a special point: large and pale for the first result, small and filled for the second."""
    look = style.symbol_style(kind)
    if is_first:
        return style.symbols(look.marker, look.size + 4.0, edge=style.FIRST, width=1.2, zorder=4)
    return style.symbols(look.marker, look.size - 0.5, look.color, look.edge, 0.6, zorder=5)


def _ring_lone(ax: Axes, found: ResultComparison, measure: str) -> None:
    """Mark special points and the middles of branches that only one result has."""
    for side, (result, lone) in enumerate(zip(found.results, found.only, strict=True)):
        branches = dict(zip(result.names, result.branches, strict=True))
        for pair in found.pairs:
            branch, alone = branches.get(pair.names[side]), {each.values[0] for each in pair.only[side]}
            for special in branch.special_points if branch else ():
                if special.value in alone:
                    ax.plot(special.value, special.point.measure(measure), **_RING.options(zorder=6))
        for name in lone:
            point = branches[name].points[len(branches[name].points) // 2]
            ax.plot(point.value, point.measure(measure), **_RING.options(zorder=6))


def _draw_distances(ax: Axes, found: ResultComparison, tolerance: float | None) -> None:
    """Draw the distance of each point from the other result, and of each special point from its counterpart."""
    for pair in found.pairs:
        ax.plot(pair.places[:, 0], np.maximum(pair.distances, _ZERO), **style.dots(4.6, style.GREY, zorder=2))
        for shift in pair.shifts:
            word = shift.label.partition(" ")[0]
            options = (
                _symbol(Kind.named(word), False)
                if word in Kind.known()
                else style.symbols("o", 4.0, style.GREY, style.GREY)
            )
            ax.plot(shift.first[0], max(shift.share, _ZERO), **options)
    if tolerance is not None:
        ax.axhline(tolerance, **_TOLERANCE.options())
    ax.set_yscale("log")


def _comparison_entries(
    found: ResultComparison, names: tuple[str, str], tolerance: float | None
) -> list[tuple[str, dict[str, Any]]]:
    entries = [(names[0], _PALE.options()), (names[1], _THIN.options())]
    if found.results[0].map is None:
        entries.append(_UNSTABLE.entry)
    words = {shift.label.partition(" ")[0] for pair in found.pairs for shift in pair.shifts}
    entries += [(style.symbol_style(kind).text, _symbol(kind, False)) for kind in Kind.known() if kind in words]
    entries.append(("distance", style.dots(8.0, style.GREY)))
    if any(found.only) or any(any(pair.only) for pair in found.pairs):
        entries.append((_RING.text, _RING.options(0.7)))
    if tolerance is not None:
        entries.append((f"tolerance {tolerance:g}", _TOLERANCE.options()))
    return entries
