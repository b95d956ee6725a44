"""The picture of a sweep: all points, small files, strips of regimes, and time."""

import io

import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure

from gapwalk.errors import ModelError
from gapwalk.plot import draw
from gapwalk.plot.picture import picture_of
from gapwalk.studies.sweep_study import Lane, Sweep, Way
from tests.systems import clutch


def sweep_of(regimes: list[list[str]], points: int = 20, ways=(Way.UP, Way.DOWN)) -> Sweep:
    """A sweep with made-up section points."""
    shape = len(regimes), len(regimes[0])
    sections = np.random.default_rng(1).normal(size=(*shape, points, 4))
    sections[np.array(regimes) == ""] = np.nan
    starts = [index // len(ways) + 1 for index in range(len(regimes))]
    lanes = tuple(Lane(way, start, np.zeros(4)) for way, start in zip([*ways] * max(starts), starts, strict=False))
    values = np.linspace(0.2, 1.2, shape[1])
    counts = np.full(shape, 48)
    return Sweep(clutch(), "frequency", values, lanes, sections, counts, counts > 0, np.array(regimes, "<U16"), True)


def texts(ax) -> list[str]:
    return [text.get_text() for text in ax.texts]


def test_every_point_is_drawn_and_every_band_is_named() -> None:
    regimes = ["period 1"] * 40 + ["period 3"] * 20 + ["chaotic"] * 30 + ["diverges"] + [""] * 9
    figure = picture_of(sweep_of([regimes, ["period 1"] * 100]), title="A title")
    strips, ax = figure.axes
    assert [line.get_xdata().size for line in ax.lines] == [100 * 20, 91 * 20]  # up lies over down
    assert all(line.get_rasterized() for line in ax.lines)
    assert texts(strips) == ["P1", "P3", "chaotic", "P1"]  # the last band is too narrow for words
    assert [tick.get_text() for tick in strips.get_yticklabels()] == ["up", "down"]
    assert strips.get_title(loc="left") == "A title"
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["up", "down (beneath)", "period 1", "period 3", "chaotic", "diverges"]
    low, high = 0.2, 0.2 + 0.5 * (39 + 40) / 99
    first = strips.patches[0]
    assert (first.get_x(), first.get_x() + first.get_width()) == pytest.approx((low, high))
    assert not [child for child in strips.get_children() if isinstance(child, PatchCollection)]


def test_a_hundred_thousand_points_are_few_things_to_draw() -> None:
    found = sweep_of([["not periodic"] * 1000, ["not periodic"] * 1000], points=100)
    figure = picture_of(found, "q3'")
    assert len(figure.findobj()) < 1000
    svg = io.BytesIO()
    figure.savefig(svg, format="svg")
    assert len(svg.getvalue()) < 2e6
    assert figure.axes[1].get_ylabel().startswith("q3'(0)")


def test_long_periods_share_a_colour_and_many_starts_the_strips() -> None:
    found = sweep_of([["period 9"] * 20, ["period 12"] * 20] * 8, ways=(Way.UP, Way.AGAIN))
    strips = picture_of(found).axes[0]
    assert [tick.get_text() for tick in strips.get_yticklabels()] == [
        f"{way} {start} of 8" for start in range(1, 7) for way in ("up", "again")
    ]
    few = picture_of(sweep_of([["period 1"] * 20] * 4)).axes[0]
    assert [tick.get_text() for tick in few.get_yticklabels()] == ["up 1", "down 1", "up 2", "down 2"]
    assert len({patch.get_facecolor() for patch in strips.patches if patch.get_fill()}) == 1
    assert "period 9 and more" in [text.get_text() for text in strips.figure.legends[0].get_texts()]


def test_it_is_drawn_where_it_is_asked_for() -> None:
    figure = Figure(layout="constrained")
    assert sweep_of([["period 1"] * 5]).plot(figure=figure, legend=False) is figure.axes[0]
    assert not figure.legends
    part = Figure(layout="constrained").subfigures(1, 2)[0]
    assert draw(sweep_of([["period 1"] * 5]), figure=part) is part.axes[0]


def test_what_cannot_be_drawn() -> None:
    with pytest.raises(ModelError, match="no section points yet"):
        picture_of(sweep_of([[""] * 5]))
    with pytest.raises(ModelError, match="no coordinate 'x'"):
        picture_of(sweep_of([["period 1"] * 5]), "x")
