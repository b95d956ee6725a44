"""Hundreds of special points in print: no mark hides another, and labels stay on the sheet."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.collections import PathCollection

import gapwalk as gw
from gapwalk.bifurcation.special_point import Kind
from gapwalk.plot.picture import picture_of
from gapwalk.plot.style import sized
from tests.systems import clutch
from tests.tiers import keeps

SYMBOLS = ("o", "D", "*")  # of folds and clusters, flips, and Neimark-Sacker points
KINDS = (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER)


@cache
def crowded() -> gw.Branch:
    """A response with 320 special points, as of a chain of ten masses: 240 grazes, and 80 others in four heaps."""
    branch = gw.follow(gw.find_orbit(clutch(frequency=1.2)), "frequency", 0.7)
    one = next(iter(branch.special_points), None)
    assert one is not None
    points, special = branch.points, []
    for number in range(320):
        in_heap = number % 4 == 0 and number % 16 > 0
        place = (number // 80) * len(points) // 4 + number % 3 if in_heap else number * len(points) // 320
        point = points[min(place, len(points) - 1)]
        kind = KINDS[number % 3] if number % 4 == 0 else Kind.GRAZING
        special.append(replace(one, kind=kind, point=point, before=point.instability, after=point.instability))
    return replace(branch, special_points=tuple(sorted(special, key=lambda each: each.point.arclength)))


@pytest.mark.parametrize("size", ["screen", "page", "column"])
def test_no_mark_hides_another(size) -> None:
    branch = crowded()
    with sized(size):
        figure = picture_of(branch, "q1", closeup=False)
    (ax,) = figure.axes
    unit = 72.0 / figure.dpi
    marks = [line for line in ax.lines if line.get_marker() in SYMBOLS and line.get_linestyle() == "None"]
    places = np.vstack([ax.transData.transform(line.get_xydata()) * unit for line in marks])
    away = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    np.fill_diagonal(away, np.inf)
    numbers = [int(text.get_text()) for text in ax.texts if text.get_text().isdigit()]
    # in points: symbols are 5 to 8 wide; only two at one place may lie on one another
    close = away < 5.0
    assert close.sum(axis=1).max(initial=0) <= 1
    assert len(places) - len(numbers) >= 8
    (ticks,) = [each for each in ax.collections if isinstance(each, PathCollection)]
    grazes = ticks.get_offsets() @ np.diag([1.0, 1.0])
    spots = ax.transData.transform(grazes) * unit
    near = np.hypot(*(spots[:, None] - spots[None]).transpose(2, 0, 1))
    np.fill_diagonal(near, np.inf)
    assert near.min() >= 2.5 - 1e-9
    assert len(spots) >= 20
    # the numbers count points with letters, of which none is lost
    single = sum(np.size(line.get_xdata()) for line in marks) - len(numbers)
    assert sum(numbers) + single == sum(each.kind is not Kind.GRAZING for each in branch.special_points)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"fold (LP)", "flip (PD)", "Neimark\N{EN DASH}Sacker (NS)", "number of points there"} <= set(texts)


@keeps("column")
@pytest.mark.parametrize("size", ["screen", "page", "column", "slide"])
def test_the_label_of_the_axis_and_the_legend_stay_on_the_sheet(size) -> None:
    with sized(size):
        figure = picture_of(crowded(), "q1")
    ax = figure.axes[0]
    figure.draw_without_rendering()
    label, legend = ax.yaxis.label.get_window_extent(), figure.legends[0].get_window_extent()
    assert label.y0 >= 0.0
    assert label.y1 <= figure.bbox.height
    assert legend.x0 >= 0.0
    assert legend.x1 <= figure.bbox.width
    assert ax.get_window_extent().height > 0.38 * figure.bbox.height
