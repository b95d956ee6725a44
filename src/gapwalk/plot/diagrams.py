"""Pictures of diagrams: a measure of all motions, and their stroboscopic states.

In the stroboscopic picture a motion of period m gives m curves, its states one forcing period apart.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property, partial
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.words import full_measure, parameter_words, state_words
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.plot.branches import (
    Label,
    Piece,
    cut,
    draw_branches,
    draw_unexplained,
    extent_of,
    joined,
    place_labels,
    unexplained_entries,
)
from gapwalk.plot.branches import unexplained_places as places_of
from gapwalk.plot.picture import AnyFigure, Finish, Inches, draws, stacked, write_heading, write_legend, write_letters
from gapwalk.plot.style import GREY, SHADE, birth_options, broken, period_options

Range = tuple[float, float]

_NAMED = 16  # most names in a picture
_MANY, _MOST = 8, 0.8  # fewest branch origins for a close-up, and the fraction of all origins that it must contain
_PART = 0.45  # largest fraction of the whole range for a close-up
_PAD = 0.06  # margin of a close-up, as a fraction of its width


class Birth(NamedTuple):
    """A special point at which other branches begin or end: parameter, point, and the period of its branch."""

    value: float
    point: BranchPoint
    period: int


def births_of(diagram: Diagram) -> Iterator[Birth]:
    """Yield the special points of a diagram at which other branches begin or end."""
    for member in diagram.members:
        for index, special in enumerate(member.branch.special_points):
            if diagram.attached(member.name, index):
                yield Birth(special.value, special.point, member.period)


def crowded_range(values: Sequence[float], within: Range) -> Range | None:
    """Return the range of the parameter in which most branches begin, if it is only a part of the whole range."""
    births = np.sort(values)
    count = math.ceil(_MOST * len(births))
    if count < _MANY:
        return None
    widths = births[count - 1 :] - births[: len(births) - count + 1]
    first = int(np.argmin(widths))
    low, high = within
    pad = _PAD * widths[first]
    left, right = max(low, births[first] - pad), min(high, births[first + count - 1] + pad)
    return (float(left), float(right)) if right - left < _PART * (high - low) else None


def _closeup(diagram: Diagram, closeup: Range | Literal[False] | None) -> Range | None:
    if closeup is None:
        return crowded_range([birth.value for birth in births_of(diagram)], diagram.within)
    return closeup or None


def _size(diagram: Diagram, closeup: Range | Literal[False] | None = None, **_: object) -> Inches:
    return stacked(3 if _closeup(diagram, closeup) else 2)


@draws(Diagram, panels=True, size=_size)
def draw_diagram(
    diagram: Diagram,
    figure: AnyFigure,
    measure: str = "half",
    *,
    labels: bool = True,
    legend: bool = True,
    closeup: Range | Literal[False] | None = None,
    title: str = "",
) -> Finish:
    """Draw a diagram in two panels over its parameter, and a third one for a close-up.

    The first panel shows a measure of all motions; the second one shows their states once per forcing period, so that
    a motion of period m gives m curves.
    """
    if not diagram.members:
        raise ModelError("the diagram has no branches yet, so there is nothing to draw")
    measure = full_measure(measure, diagram.branches[0].system.coordinates)
    crowd = _closeup(diagram, closeup)
    strobes = Strobes(diagram, measure.partition(".")[2])
    panels = figure.subplots(3 if crowd else 2, 1, height_ratios=[1.0] + [1.25] * (2 if crowd else 1))
    write_heading(figure, title)
    write_letters(panels)
    for panel in panels[1:]:
        strobes.draw(panel)
    # panels a and b cover the same range; panel c covers the close-up, which is shaded in b
    panels[1].margins(x=0.02, y=0.06)
    panels[1].autoscale_view()
    panels[0].sharex(panels[1])
    if crowd:
        panels[1].axvspan(*crowd, color=SHADE, linewidth=0, zorder=0.5)
        panels[2].set(xlim=crowd, ylim=extent_of(strobes.curve, *crowd))
        panels[2].set_title("the shaded range of b", fontsize="small")
    for panel in panels[1:]:
        panel.set_autoscale_on(False)
    if legend:
        strobes.write_legend(panels[1])
    above = "above" if legend else False
    finish = draw_branches(diagram.branches, panels[0], measure, labels=labels, legend=above, closeup=True)
    return partial(_finish, finish, strobes, panels[1:] if labels else [], crowd)


def _finish(finish: Finish, strobes: Strobes, panels: Sequence[Axes], crowd: Range | None) -> None:
    if finish:
        finish()
    for panel, without in zip(panels, (crowd, None), strict=False):
        strobes.draw_names(panel, without=without)


@draws(Diagram)
def draw_strobes(
    diagram: Diagram,
    ax: Axes,
    measure: str = "",
    *,
    labels: bool = True,
    legend: bool = True,
    within: Range | None = None,
) -> Finish:
    """Draw one panel of a diagram: the states of all motions once per forcing period, or a measure of them."""
    if not diagram.members:
        raise ModelError("the diagram has no branches yet, so there is nothing to draw")
    coordinates = diagram.branches[0].system.coordinates
    if measure and measure not in coordinates:
        if "." not in full_measure(measure, coordinates):
            raise ModelError(f"there is no coordinate {measure!r}; {did_you_mean(measure, coordinates)}")
        return draw_branches(diagram.branches, ax, measure, labels=labels, legend=legend, within=within)
    strobes = Strobes(diagram, measure)
    strobes.draw(ax)
    left, right = within or diagram.within
    pad = 0.0 if within else 0.02 * (right - left)
    ax.set(xlim=(left - pad, right + pad), ylim=extent_of(strobes.curve, left, right))
    ax.set_autoscale_on(False)
    if legend:
        strobes.write_legend(ax, (left, right))
    return partial(strobes.draw_names, ax) if labels else None


class Strobes:
    """Curves of the states of a diagram, for the whole picture and for a close-up."""

    def __init__(self, diagram: Diagram, coordinate: str) -> None:
        self.system = diagram.branches[0].system
        names = self.system.coordinates
        self.diagram, self.coordinate = diagram, coordinate if coordinate in names else names[0]
        self.periods = sorted({member.period for member in diagram.members})
        self._place = names.index(self.coordinate)
        self.pieces: list[tuple[DiagramBranch, list[Piece]]] = [
            (member, cut(member.branch, self._states)) for member in diagram.members
        ]
        self.births = list(births_of(diagram))

    def draw(self, ax: Axes) -> None:
        """Draw all curves (short periods over long ones), origins of branches, and unexplained steps."""
        for rank, period in reversed(list(enumerate(self.periods))):
            for stable in (False, True):
                curves = [
                    (piece.x, y)
                    for member, pieces in self.pieces
                    for piece in pieces
                    for y in piece.y.T
                    if member.period == period and (piece.label == "stable") == stable
                ]
                if curves:
                    options = period_options(rank, stable)
                    ax.plot(*joined(curves), zorder=(4 if stable else 3) - 0.1 * rank, **options)
            births = [birth for birth in self.births if birth.period == period]
            if births:
                values = np.repeat([birth.value for birth in births], period)
                states = np.concatenate([self._states(birth.point) for birth in births])
                ax.plot(values, states, zorder=5 - 0.1 * rank, **birth_options(rank))
        for member in self.diagram.members:
            draw_unexplained(ax, places_of(member.branch, self._states))
        ax.set_xlabel(parameter_words(self.diagram.parameter, self.system.units))
        ax.set_ylabel(broken(state_words(self.coordinate, self.system.units)))

    def write_legend(self, ax: Axes, within: Range | None = None) -> None:
        """Write a legend of the colours of periods above the axes, up to the longest period within a range."""
        low, high = within or (-math.inf, math.inf)
        periods = {
            member.period
            for member in self.diagram.members
            if ((member.branch.values >= low) & (member.branch.values <= high)).any()
        }
        shown = [period for period in self.periods if period <= max(periods, default=0)]
        entries = [(f"period {period}", period_options(rank, stable=True)) for rank, period in enumerate(shown)]
        for text, stable in (("stable", True), ("unstable", False)):
            entries.append((text, period_options(0, stable) | {"color": GREY}))
        if self.births:
            entries.append(("a branch begins or ends", birth_options(0)))
        write_legend(ax, entries + unexplained_entries(self.diagram.branches), "above")

    def draw_names(self, ax: Axes, without: Range | None = None) -> None:
        """Write names next to the branches of the two shortest periods, outside of a given range of the parameter."""
        counts = Counter(member.period for member in self.diagram.members)
        named = [period for period in self.periods[:2] if counts[period] > 1 or period != self.periods[0]]
        labels = [
            label
            for member, pieces in self.pieces
            if member.period in named and (label := self._label(member, pieces, ax.get_xlim(), without))
        ]
        if 0 < len(labels) <= _NAMED:
            place_labels(ax, labels, self.curve, np.empty((0, 2)))

    @cached_property
    def curve(self) -> NDArray[np.float64]:
        """All curves joined, with rows of nan between them, shape (points, 2)."""
        curves = [(piece.x, y) for _, pieces in self.pieces for piece in pieces for y in piece.y.T]
        return np.column_stack(joined(curves))

    def _label(
        self, member: DiagramBranch, pieces: Sequence[Piece], shown: Range, without: Range | None
    ) -> Label | None:
        """Return the name of a branch at its point farthest from the other curves; None if that is not shown."""
        x, y = (np.concatenate(parts) for parts in zip(*((piece.x, piece.y[:, 0]) for piece in pieces), strict=True))
        inside = (x >= shown[0]) & (x <= shown[1])
        if without:
            inside &= (x < without[0]) | (x > without[1])
        if not inside.any():
            return None
        middle = float(np.nanmedian(self.curve[:, 1]))
        best = int(np.argmax(np.where(inside, np.abs(y - middle), -1.0)))
        return Label(member.name, float(x[best]), float(y[best]))

    def _states(self, point: BranchPoint) -> NDArray[np.float64]:
        return stroboscopic(point.orbit)[:, self._place]
