"""The stroboscopic picture of a diagram: each motion of period m as m curves, its states a forcing period apart."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gapwalk.bifurcation.diagram import Diagram, Limb
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.model.problem import did_you_mean
from gapwalk.orbit.identity import stroboscopic
from gapwalk.plot.labels import Label, place_labels
from gapwalk.plot.legend import draw_period_legend
from gapwalk.plot.pieces import Piece, cut, joined, padded
from gapwalk.plot.sheet import open_axes, when_laid_out
from gapwalk.plot.size import broken, takes_size
from gapwalk.plot.style import SIZE, birth_options, in_style, period_options
from gapwalk.plot.words import parameter_words, state_words

_NAMED = 16  # names that a picture may hold
_MANY, _MOST = 8, 0.8  # births from which there may be a crowd, and the share of all that is in it
_PART = 0.45  # of the whole range that a crowd covers at most
_PAD = 0.06  # margin of a close-up, as a share of its width
_MARGIN = 0.02  # beside the range of a diagram, as a share of it


@takes_size
def plot_strobes(
    diagram: Diagram,
    coordinate: str | None = None,
    *,
    ax: Axes | None = None,
    labels: bool = True,
    legend: bool = True,
    within: tuple[float, float] | None = None,
) -> Axes:
    """Draw the states of all motions of a diagram once every forcing period: a motion of period m is m curves.

    Parameters
    ----------
    diagram
        The diagram.
    coordinate
        The coordinate that is shown; by default the first.
    ax
        Where to draw; by default in a new figure of pyplot.
    labels
        Whether branches of the two shortest periods have their names beside them.
    legend
        Whether the colours of the periods are explained above the axes.
    within
        Range of the parameter that is shown; by default that of the diagram.

    Returns
    -------
    Axes
        The axes that were drawn in.

    Raises
    ------
    ModelError
        If the diagram has no branches, or its system has no such coordinate.
    """
    if not diagram.limbs:
        raise ModelError("the diagram has no branches yet, so there is nothing to draw")
    system = diagram.branches[0].system
    coordinate = system.coordinates[0] if coordinate is None else coordinate
    if coordinate not in system.coordinates:
        raise ModelError(f"there is no coordinate {coordinate!r}; {did_you_mean(coordinate, system.coordinates)}")
    ax = open_axes(SIZE) if ax is None else ax
    strobes = Strobes(diagram, coordinate)
    left, right = within or diagram.within
    pad = 0.0 if within else _MARGIN * (right - left)
    with in_style():
        strobes.draw(ax)
        ax.set_xlabel(parameter_words(diagram.parameter, system.units))
        ax.set_ylabel(broken(state_words(coordinate, system.units)))
        ax.set(xlim=(left - pad, right + pad), ylim=strobes.extent(left, right))
        ax.set_autoscale_on(False)
        if legend:
            draw_period_legend(ax, strobes.periods_within(left, right), bool(strobes.births))
        if labels:
            when_laid_out(lambda: strobes.draw_names(ax), ax)
    return ax


class Birth(NamedTuple):
    """A special point at which other branches begin or end: parameter, states, and the period of its branch."""

    value: float
    states: NDArray[np.float64]
    period: int


class Strobes:
    """What is drawn of a diagram, in the whole picture and in a close-up alike.

    Parameters
    ----------
    diagram
        The diagram.
    coordinate
        Which coordinate of the states is drawn.
    """

    def __init__(self, diagram: Diagram, coordinate: str) -> None:
        self.diagram, self.coordinate = diagram, coordinate
        self.periods = sorted({limb.period for limb in diagram.limbs})
        self._place = diagram.branches[0].system.coordinates.index(coordinate)
        self.pieces: list[tuple[Limb, list[Piece]]] = [(limb, cut(limb.branch, self._states)) for limb in diagram.limbs]
        self.births = list(self._births())

    def draw(self, ax: Axes) -> None:
        """Draw all curves, short periods over long ones, and where branches are born."""
        for rank, period in reversed(list(enumerate(self.periods))):
            for stable in (False, True):
                curves = [
                    (piece.x, y)
                    for limb, pieces in self.pieces
                    for piece in pieces
                    for y in piece.y.T
                    if limb.period == period and (piece.label == "stable") == stable
                ]
                if curves:
                    options = period_options(rank, stable)
                    ax.plot(*joined(curves), zorder=(4 if stable else 3) - 0.1 * rank, **options)
            births = [birth for birth in self.births if birth.period == period]
            if births:
                values = np.repeat([birth.value for birth in births], period)
                states = np.concatenate([birth.states for birth in births])
                ax.plot(values, states, zorder=5 - 0.1 * rank, **birth_options(rank))

    def draw_names(self, ax: Axes, without: tuple[float, float] | None = None) -> None:
        """Write the names of the branches of the two shortest periods beside them, but in a range of the parameter."""
        counts = Counter(limb.period for limb in self.diagram.limbs)
        named = [period for period in self.periods[:2] if counts[period] > 1 or period != self.periods[0]]
        labels = [
            label
            for limb, pieces in self.pieces
            if limb.period in named and (label := self._label(limb, pieces, ax.get_xlim(), without))
        ]
        if 0 < len(labels) <= _NAMED:
            place_labels(ax, labels, self._curve, np.empty((0, 2)))

    def crowd(self) -> tuple[float, float] | None:
        """The range of the parameter in which most branches are born, if that is only a part of the whole."""
        values = np.sort([birth.value for birth in self.births])
        count = math.ceil(_MOST * len(values))
        if count < _MANY:
            return None
        widths = values[count - 1 :] - values[: len(values) - count + 1]
        first = int(np.argmin(widths))
        low, high = self.diagram.within
        pad = _PAD * widths[first]
        left, right = max(low, values[first] - pad), min(high, values[first + count - 1] + pad)
        return (float(left), float(right)) if right - left < _PART * (high - low) else None

    def extent(self, left: float, right: float) -> tuple[float, float]:
        """The least and the greatest state within a range of the parameter, with a margin."""
        return padded(self._curve[(self._curve[:, 0] >= left) & (self._curve[:, 0] <= right), 1])

    def periods_within(self, left: float, right: float) -> list[int]:
        """List the periods up to the longest one that has points within a range of the parameter."""
        longest = self.periods[0]
        for limb in self.diagram.limbs:
            values = limb.branch.values
            if ((values >= left) & (values <= right)).any():
                longest = max(longest, limb.period)
        return [period for period in self.periods if period <= longest]

    @cached_property
    def _curve(self) -> NDArray[np.float64]:
        """All curves as one, with rows of nan between them, shape (points, 2)."""
        curves = [(piece.x, y) for _, pieces in self.pieces for piece in pieces for y in piece.y.T]
        return np.column_stack(joined(curves))

    def _label(
        self, limb: Limb, pieces: Sequence[Piece], shown: tuple[float, float], without: tuple[float, float] | None
    ) -> Label | None:
        """The name of a branch beside the point at which it is farthest from the others; None if that is not shown."""
        x, y = (np.concatenate(parts) for parts in zip(*((piece.x, piece.y[:, 0]) for piece in pieces), strict=True))
        inside = (x >= shown[0]) & (x <= shown[1])
        if without:
            inside &= (x < without[0]) | (x > without[1])
        if not inside.any():
            return None
        middle = float(np.nanmedian(self._curve[:, 1]))
        best = int(np.argmax(np.where(inside, np.abs(y - middle), -1.0)))
        return Label(limb.name, float(x[best]), float(y[best]))

    def _states(self, point: BranchPoint) -> NDArray[np.float64]:
        return stroboscopic(point.orbit)[:, self._place]

    def _births(self):
        for limb in self.diagram.limbs:
            for index, special in enumerate(limb.branch.special_points):
                if self.diagram.attached(limb.name, index):
                    yield Birth(special.value, self._states(special.point), limb.period)
