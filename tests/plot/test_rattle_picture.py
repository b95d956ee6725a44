"""The picture of rattle on paper: the worst gap, ways of which all motions are crosses, texts that do not meet."""

import io
from dataclasses import replace
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.gap_states import OTHER
from gapwalk.answers.rattle_bands import RattleBands, rattle_picture
from gapwalk.studies import read_studies
from tests.studies.test_complete_response import TRAIN


@pytest.fixture(scope="module")
def found() -> RattleBands:
    """The bands of two gears that rattle without period."""
    (study,) = read_studies(io.StringIO(TRAIN))
    return gw.ask.rattle_bands(study.system, "speed", (800.0, 950.0), steps=3, starts=0, search=0, workers=1)


def test_the_worst_gap_is_drawn_and_ways_without_a_period_are_in_the_legend(found) -> None:
    crosses = tuple(replace(row, period=0) for row in found.severities)
    loudest = max(crosses, key=lambda row: row.rms)
    figure = gw.plot.draw(replace(found, severities=crosses)).figure
    assert loudest.gap in figure.axes[0].get_ylabel()
    words = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
    (milder,) = (each.severity for each in found.worst if each.severity.gap != loudest.gap)
    assert {"speed rising", "speed falling", f"{milder.gap} ({milder.part.partition('.')[0]})"} <= words
    plt.close(figure)
    assert rattle_picture(found).contacts[0] == loudest.gap
    assert [row.split()[0] for row in str(found.summary()).splitlines()[2:4]] == [loudest.gap, milder.gap]
    for gap in found.gaps:
        assert rattle_picture(found, gap).axes == ("speed", f"half.{gap}")


def test_no_line_joins_other_motions_over_what_lies_between(found) -> None:
    row = next(each for each in found.severities if each.met == "rising")
    values = [800.0, 812.5, 825.0, 900.0, 912.5]
    others = [replace(row, met=OTHER, value=value) for value in values]
    more = replace(found, severities=(*found.severities, *others, *[replace(row, value=v) for v in values]))
    (line,) = [
        series
        for panel in rattle_picture(more, row.gap).parts().below
        for series in panel.series
        if (series.look, series.mark) == ("other", "line") and panel.title.startswith("rms")
    ]
    assert np.array_equal(line.x, [800.0, 812.5, 825.0, np.nan, 900.0, 912.5], equal_nan=True)
    assert line.y[0] == row.rms
    assert np.isnan(line.y[3])


@pytest.mark.parametrize(("apart", "shown"), [(0.5, 3), (10.0, 3), (60.0, 4)])
def test_texts_of_ends_do_not_meet(found, apart, shown) -> None:
    (band,) = found.of(found.worst[0].severity.gap)
    inner = replace(band, low=replace(band.low, value=850.0), high=replace(band.high, value=850.0 + apart))
    figure = gw.plot.draw(replace(found, bands=(*found.bands, inner)), gap=band.gap).figure
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts if "end of the range" in text.get_text()]
    assert len(boxes) == shown
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    plt.close(figure)
