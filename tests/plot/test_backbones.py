"""Pictures of backbones, loci and settled motions: lines without corners of their own, and labels that fit."""

import io

import numpy as np
import pytest
from scipy.special import ellipk

import gapwalk as gw
from gapwalk.free.island_births import Backbones
from gapwalk.plot.picture import new_sheet, picture_of, write_legend
from gapwalk.plot.style import sized
from tests.free.test_backbone import oscillator


def duffing(x):
    """The frequency of ``x'' + x + x^3 = 0`` at the amplitude x, by an elliptic integral."""
    return np.pi * np.sqrt(1.0 + x**2) / (2.0 * ellipk(x**2 / (2.0 * (1.0 + x**2))))


def test_a_backbone_is_drawn_as_its_closed_form_between_its_points_too() -> None:
    cubic = gw.force("spring", {"x": 1.0}, law="x*x*x")
    line = gw.free.backbone(oscillator(1.0, cubic), 1, (0.5, 4.0))
    figure = picture_of(line)
    values, heights = figure.axes[0].lines[0].get_data()
    drawn = np.abs(values - duffing(heights)).max()
    middles = 0.5 * (line.half("x")[1:] + line.half("x")[:-1])
    chords = np.abs(0.5 * (line.values[1:] + line.values[:-1]) - duffing(middles)).max()
    assert len(values) > 3 * len(line.values)
    assert drawn < 0.2 * chords


def test_a_backbone_keeps_the_corner_at_which_a_contact_closes() -> None:
    stop = gw.stop("stop", {"x": 1.0}, clearance=1.0, stiffness=20.0)
    line = gw.free.backbone(oscillator(1.0, stop), 1, (0.5, 2.5))
    values, heights = picture_of(line).axes[0].lines[0].get_data()
    assert values[heights < 0.99] == pytest.approx(np.ones((heights < 0.99).sum()), abs=1e-9)
    touching = heights > 1.0 + 1e-9
    assert values[touching].min() >= 1.0 - 1e-9


def test_the_frequency_is_that_of_a_free_vibration_unless_a_response_shares_its_axis() -> None:
    cubic = gw.force("spring", {"x": 1.0}, law="x*x*x")
    system = oscillator(1.0, cubic)
    line = gw.free.backbone(system, 1, (0.5, 1.5))
    assert picture_of(line).axes[0].get_xlabel() == "frequency of the free vibration"
    branch = gw.follow(gw.find_orbit(system.at(frequency=0.5)), "frequency", to=0.6)
    assert picture_of(line, response=branch).axes[0].get_xlabel() == "frequency"


def fits(figure) -> bool:
    """Whether all labels of axes are inside the picture, and none reaches over another."""
    figure.draw_without_rendering()
    boxes = [
        axis.label.get_window_extent() for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if axis.label.get_text()
    ]
    whole, slack = figure.bbox, 2.0
    inside = all(
        box.x0 >= -slack and box.y0 >= -slack and box.x1 <= whole.width + slack and box.y1 <= whole.height + slack
        for box in boxes
    )
    return inside and not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


@pytest.mark.parametrize("size", ["column", "screen"])
def test_labels_of_settled_motions_and_backbones_fit(size) -> None:
    stop = gw.stop("stop", {"a": 1.0}, clearance=1.0, stiffness=20.0)
    load = [gw.Harmonic(0.1, {"b": 1.0})]
    two = gw.System(
        ["a", "b"], [[1.0, -1.0], [-1.0, 2.0]], [0.05, 0.05], contacts=[stop], harmonics=load, frequency=0.7
    )
    lines = Backbones((gw.free.backbone(two, 1, (0.5, 0.8)),))
    with sized(size):
        for record in (gw.settle(gw.paper.case("15"), frequency=0.45), lines):
            figure = picture_of(record)
            assert all(ax.get_window_extent().width > 0.15 * figure.bbox.width for ax in figure.axes)
            assert fits(figure)


LOCUS = """
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.1]]
[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 20.0
side = "positive"
[[harmonic]]
amplitude = 0.5
acts_on = { x = 1.0 }
[study]
kind = "locus"
of = "fold"
near = 1.4
parameter = "frequency"
from = 1.0
to = 3.5
second = { parameter = "harmonic1.amplitude", from = 0.05, to = 9.0 }
"""


def test_a_locus_fills_its_picture() -> None:
    """A locus that began on one section: the part of the plane that it reaches, with some room."""
    result = gw.run(gw.read_study(io.StringIO(LOCUS)))
    chart = result.map
    assert chart is not None
    (ax,) = picture_of(result).axes
    reached = np.vstack([locus.values for locus in chart.loci])
    for (low, high), values, whole in zip((ax.get_xlim(), ax.get_ylim()), reached.T, chart.within, strict=True):
        assert whole[0] <= low <= values.min()
        assert values.max() <= high <= whole[1]
        assert np.ptp(values) > 0.7 * (high - low)


def test_a_legend_has_rows_of_equal_length() -> None:
    figure = new_sheet()
    write_legend(figure, [(f"an entry of the legend {k}", "#fbe3c4") for k in range(6)])
    assert figure.legends[0]._ncols == 3
