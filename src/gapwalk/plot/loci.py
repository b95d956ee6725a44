"""Pictures over two parameters: loci of a map with its sections, and families with the curves of special points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Codim2, Codim2Point, Locus
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError
from gapwalk.model.measures import full_measure
from gapwalk.model.words import measure_words, parameter_words
from gapwalk.plot import style
from gapwalk.plot.branches import (
    Label,
    draw_unexplained,
    pieces_of,
    place_labels,
    unexplained_entries,
    unexplained_places,
)
from gapwalk.plot.picture import WIDE, AnyFigure, Finish, draws, write_legend, write_letters
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.branch_family import Connection, Family, Fate

_ONE = 6.0  # distance, in points, below which two symbols of one kind share a name

# without its light end, which is invisible on white; perceptually uniform for any colour vision
_COLOURS = LinearSegmentedColormap.from_list("members", mpl.colormaps["viridis"](np.linspace(0.0, 0.88, 128)))
_SMALL = 0.62  # factor on the symbols of special points, of which a family has many
_ROOM = 0.15  # beside loci, as a share of the range that they reach
_THIN = 0.75  # factor on the line width of members, of which there are several
_MOST_TICKS = 12


_SECTION = style.LineStyle("branches were followed here", "#b9b1a0", "-", 0.7)
_LOST = style.SymbolStyle("not followed further", "", "x", "white", 5.0, width=1.2)
_TURN = style.SymbolStyle("two special points meet", "", "o", "white", 4.6, width=0.9)
_NOWHERE = style.SymbolStyle("leads to no known branch", "", "s", "white", 4.0, style.GREY, 0.9)
_GUESS = style.LineStyle("connected by proximity", style.GREY, (0, (1.0, 2.2)), 1.0)


def _isola() -> dict[str, Any]:
    return style.symbols("|", 9.0, width=1.3) | style.stroke(style.BLACK, 2.0)


@draws(Map, size=(WIDE[0], 5.6), shows="its loci over two parameters")
def draw_map(chart: Map, ax: Axes, *, labels: bool = True, legend: bool = True) -> Finish:
    """Draw all loci of a map in the plane of its two parameters."""
    # A thin line is a section, on which branches were computed; the isolas on it (closed branches) are bars.
    xlim, ylim = _shown(chart)
    ax.set(xlim=xlim, ylim=ylim)
    units = chart.sections[0].branches[0].system.units if chart.branches else None
    ax.set_xlabel(parameter_words(chart.first, units))
    ax.set_ylabel(parameter_words(chart.second, units))
    _draw_sections(ax, chart, labels)
    order, periods = Kind.with_locus(), _periods(chart)
    for locus in chart.loci:
        options = style.locus_options(locus.kind, periods.index(locus.period))
        ax.plot(*_curve(locus).T, zorder=3.0 - 0.1 * order.index(locus.kind), **options)
    found = [point for locus in chart.loci for point in locus.codim2_points]
    for point in found:
        look = style.CODIM2[point.kind]
        ax.plot(*point.values, zorder=5 if look.label else 4, **look.options())
    for place in _lost_ends(chart):
        ax.plot(*place, zorder=5, **_LOST.options())
    if legend:
        write_legend(ax, list(_map_entries(chart, found)))
    return partial(_name, ax, chart, found) if labels else None


@draws(Locus, shows="its curve over two parameters")
def draw_one(locus: Locus, ax: Axes, *, labels: bool = True, legend: bool = True) -> Finish:
    """Draw one locus in the plane of its two parameters."""
    ends = ((column.min(), column.max()) for column in locus.values.T)
    first, second = ((low - _ROOM * (high - low), high + _ROOM * (high - low)) for low, high in ends)
    return draw_map(Map(locus.first, locus.second, (first, second), (locus,)), ax, labels=labels, legend=legend)


def _shown(chart: Map) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges to be shown: the whole plane; of loci that began on one section, the part that they reach."""
    if len(chart.sections) != 1 or not chart.loci:
        return chart.within
    reached = np.vstack([locus.values for locus in chart.loci])
    reached = np.vstack((reached, [reached[0, 0], chart.sections[0].value]))
    ranges = []
    for (low, high), values in zip(chart.within, reached.T, strict=True):
        room = _ROOM * float(np.ptp(values)) or high - low
        ranges.append((max(low, float(values.min()) - room), min(high, float(values.max()) + room)))
    return ranges[0], ranges[1]


def _periods(chart: Map) -> list[int]:
    return sorted({locus.period for locus in chart.loci})


def _curve(locus: Locus) -> NDArray[np.float64]:
    values = locus.values
    return np.vstack((values, values[:1])) if locus.is_closed else values


def _draw_sections(ax: Axes, chart: Map, labels: bool) -> None:
    """Draw the sections, the isolas on them, and unexplained steps of their branches."""
    right = blended_transform_factory(ax.transAxes, ax.transData)
    look = {"color": "#8a8270", "fontsize": "x-small", "clip_on": False}
    for section in chart.sections:
        ax.axhline(section.value, zorder=1.5, **_SECTION.options())
        if labels:
            ax.text(1.006, section.value, f"{section.value:.4g}", transform=right, va="center", **look)
        draw_unexplained(ax, _unexplained(section.branches, section.value), clip_on=False)
    for value, low, high in _isolas(chart):
        ax.plot((low, high), (value, value), zorder=3.5, **_isola())


def _unexplained(branches: Sequence[Branch], value: float) -> list[tuple[float, float]]:
    """Return the places of unexplained steps of branches at a value of the second parameter."""
    return [place for branch in branches for place in unexplained_places(branch, lambda _: np.array([value]))]


def _isolas(chart: Map) -> Iterator[tuple[float, float, float]]:
    """Yield value of the section and range of the first parameter for each isola (closed branch) on a section."""
    for section in chart.sections:
        for branch in section.branches:
            if branch.ends[-1].reason is EndReason.CLOSED:
                yield section.value, float(branch.values.min()), float(branch.values.max())


def _lost_ends(chart: Map) -> list[tuple[float, float]]:
    """Return the ends of loci at which the numerics failed."""
    return [end.values for locus in chart.loci for end in locus.ends if end.reason.is_failure]


def _map_entries(chart: Map, points: list[Codim2Point]) -> Iterator[tuple[str, dict[str, Any]]]:
    periods = _periods(chart)
    for kind in Kind.with_locus():
        for rank, period in enumerate(periods):
            if any(locus.period == period for locus in chart.of_kind(kind)):
                yield (
                    style.locus_style(kind).text + f", period {period}" * (len(periods) > 1),
                    style.locus_options(kind, rank),
                )
    if next(_isolas(chart), None):
        yield "isola (closed branch)", _isola()
    kinds = {point.kind for point in points}
    shown = dict.fromkeys(look for kind, look in style.CODIM2.items() if kind in kinds)
    yield from (look.entry for look in shown)
    if _lost_ends(chart):
        yield _LOST.entry
    yield from unexplained_entries(chart.branches)
    if chart.sections:
        yield _SECTION.entry


def _name(ax: Axes, chart: Map, points: list[Codim2Point]) -> None:
    """Write the short names of points of codimension two next to them; loci that meet in one share its name."""
    named: list[Codim2Point] = []
    unit = ax.figure.dpi / 72.0
    for point in (each for each in points if style.CODIM2[each.kind].label):
        place = ax.transData.transform(point.values)
        known = (ax.transData.transform(other.values) for other in named if other.kind is point.kind)
        if all(np.hypot(*(place - other)) > _ONE * unit for other in known):
            named.append(point)
    if not named:
        return
    gap = np.full((1, 2), np.nan)
    lines = [part for locus in chart.loci if locus.kind is not Kind.GRAZING for part in (_curve(locus), gap)]
    places = np.array([point.values for point in points])
    labels = [Label(style.CODIM2[point.kind].label, *point.values) for point in named]
    place_labels(ax, labels, np.vstack(lines or [places]), places)


@draws(Family, panels=True, size=(WIDE[0], 7.6))
def draw_family(
    family: Family, figure: AnyFigure, measure: str = "half", *, legend: bool = True, title: str = ""
) -> None:
    """Draw a family in two panels: a measure of the motions of all members, and the positions of their special points.

    In the first panel the colour shows the member, and the line style shows stability. The second panel has the
    parameter of the family on its vertical axis: lines connect special points of neighbouring members.
    """
    colours = ScalarMappable(Normalize(min(family.over.axis), max(family.over.axis)), _COLOURS)
    _check(family, measure)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=[1.25, 1.0])
    draw_members(family, panels[0], measure)
    panels[0].set_title(title, wrap=True)
    panels[0].set_xlabel("")
    panels[0].tick_params(labelbottom=True)
    _draw_connections(panels[1], family)
    panels[1].set(xlabel=parameter_words(family.parameter), ylabel=parameter_words(family.over.name))
    panels[1].set_xlim(*family.within)
    panels[1].margins(y=0.05)
    write_letters(panels)
    # the colour bar is next to both panels, so that their widths are equal
    axis = sorted(family.over.axis)
    ticks = axis if len(axis) <= _MOST_TICKS else None
    text = parameter_words(family.over.name)
    bar = figure.colorbar(colours, ax=panels.tolist(), label=text, ticks=ticks, pad=0.015, fraction=0.03, aspect=50)
    bar.ax.minorticks_off()
    if ticks:
        bar.ax.set_yticklabels([f"{value:.4g}" for value in ticks])
    if legend:
        write_legend(figure, list(_family_entries(family)))


def _check(family: Family, measure: str) -> str:
    if not family.branches:
        raise ModelError("the family has no branches yet, so there is nothing to draw")
    measure = full_measure(measure, family.system.coordinates)
    family.branches[0].points[0].measure(measure)  # raises an error if it is not a measure
    return measure


@draws(Family)
def draw_members(family: Family, ax: Axes, measure: str = "half") -> None:
    """Draw a measure of the motions of all members in one panel, each member in its own colour."""
    measure, ranks = _check(family, measure), _ranks(family)
    norm = Normalize(min(family.over.axis), max(family.over.axis))
    for member in family.members:
        color = _COLOURS(norm(member.value))
        for branch in member.branches:
            width = _THIN * (1.0 if ranks[branch.period] == 0 else 0.6)
            for piece in pieces_of(branch, measure):
                look = style.LINES[piece.label]
                ax.plot(piece.x, piece.y, zorder=3, **style.stroke(color, width * look.width, look.line))
            for special in branch.special_points:
                if special.kind is not Kind.GRAZING:
                    ax.plot(special.value, special.point.measure(measure), zorder=5, **_small(special.kind))
            draw_unexplained(ax, unexplained_places(branch, lambda point: np.array([point.measure(measure)])))
    ax.margins(y=0.05)
    ax.set_xlabel(parameter_words(family.parameter))
    ax.set_ylabel(measure_words(measure))


def _draw_connections(ax: Axes, family: Family) -> None:
    """Draw the curves of special points from member to member, and the events along them."""
    ranks = _ranks(family)
    for member in family.members:
        ax.axhline(member.value, zorder=1.5, **_SECTION.options())
        for _, special in member.special_points:
            ax.plot(special.value, member.value, zorder=4, **_small(special.kind))
        draw_unexplained(ax, _unexplained(member.branches, member.value))
    for connection in _connections(family):
        if connection.curve:
            options = (
                _GUESS.options()
                if connection.fate is Fate.NEAR
                else style.locus_options(connection.kind, ranks[connection.period])
            )
            ax.plot(*np.array(connection.curve).T, zorder=2.5 if connection.kind is Kind.GRAZING else 3.0, **options)
        for passage in connection.passages:
            look = style.CODIM2[Codim2(passage.kind)]
            if look.label:
                ax.plot(passage.first, passage.value, zorder=6, **look.options())
        if connection.at is not None and _leads_nowhere(connection):
            ax.plot(
                *(connection.at if connection.fate is Fate.OUTSIDE else connection.curve[-1]),
                zorder=5,
                **_NOWHERE.options(),
            )
        if connection.at is not None and _turns(connection):
            ax.plot(*connection.at, zorder=5, **_TURN.options())


def _leads_nowhere(connection: Connection) -> bool:
    """Return True if a curve leads to a member, but to none of its known branches."""
    return connection.fate is Fate.OUTSIDE or (connection.fate is Fate.MET and connection.end is None)


def _turns(connection: Connection) -> bool:
    """Return True if two special points meet in an event that has no symbol."""
    known = connection.event in list(Codim2) and bool(style.CODIM2[Codim2(connection.event)].label)
    return connection.fate is Fate.MET and not known


def _family_entries(family: Family) -> Iterator[tuple[str, dict[str, Any]]]:
    labels = {each.label for branch in family.branches for each in branch.instabilities}
    for name, look in style.LINES.items():
        if name in labels:
            yield look.text, style.stroke(style.GREY, look.width, look.line)
    ranks = _ranks(family)
    kinds = {(special.kind, special.orbit.period) for branch in family.branches for special in branch.special_points}
    for kind in style.in_order(kind for kind, _ in kinds):
        look = style.symbol_style(kind)
        for period, rank in ranks.items():
            if (kind, period) in kinds:
                line = style.locus_options(kind, rank) if not kind.no_locus else {}
                yield look.text + (f", period {period}" if len(ranks) > 1 else ""), _small(kind) | line
    connections = list(_connections(family))
    events = {passage.kind for connection in connections for passage in connection.passages}
    events |= {connection.event for connection in connections if connection.fate is Fate.MET}
    shown = [look for kind, look in style.CODIM2.items() if kind.value in events and look.label]
    yield from (look.entry for look in shown)
    if any(map(_turns, connections)):
        yield _TURN.entry
    if any(map(_leads_nowhere, connections)):
        yield _NOWHERE.entry
    if any(connection.fate is Fate.NEAR for connection in connections):
        yield _GUESS.entry
    yield from unexplained_entries(family.branches)


def _small(kind: Kind) -> dict[str, Any]:
    return style.symbol_style(kind).options(_SMALL)


def _ranks(family: Family) -> dict[int, int]:
    """Rank the periods that occur, the shortest first."""
    return {period: rank for rank, period in enumerate(sorted({branch.period for branch in family.branches}))}


def _connections(family: Family) -> Iterator[Connection]:
    for connections in (family.connections or {}).values():
        yield from connections
