"""Pictures of families: a line for each part of each member, and one for each way between members."""

import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.plot.branches import pieces_of
from gapwalk.plot.picture import picture_of
from gapwalk.studies.branch_family import Family
from tests.computed import opened
from tests.studies.families import family_file
from tests.systems import clutch


@pytest.fixture(scope="module")
def family() -> Family:
    finding = opened(family_file()).finding
    assert finding is not None
    return finding.record


def lines(ax) -> list:
    """The lines of an axes that are no symbols and no sections."""
    return [line for line in ax.lines if line.get_linestyle() != "None" and len(line.get_xdata()) > 2]


def test_each_member_has_its_colour_and_stability_its_line(family) -> None:
    figure = picture_of(family, "half.q1", title="A title")
    top, bottom, bar = figure.axes
    pieces = [piece for branch in family.branches for piece in pieces_of(branch, "half.q1")]
    assert len(lines(top)) == len(pieces) == 9
    assert (
        len({line.get_color() if isinstance(line.get_color(), str) else tuple(line.get_color()) for line in lines(top)})
        == 3
    )
    solid = [line.get_linestyle() == "-" for line in lines(top)]
    assert solid == [piece.label == "stable" for piece in pieces]
    assert top.get_title(loc="left") == "A title"
    assert [text.get_text() for text in bar.get_yticklabels()] == ["0.25", "0.35", "0.5"]
    assert bottom.get_ylabel() == "mean load on q3"


def test_joined_special_points_are_lines_through_them(family) -> None:
    bottom = picture_of(family).axes[1]
    drawn = lines(bottom)
    assert len(drawn) == sum(len(connections) for connections in (family.connections or {}).values()) == 8
    ends = {(round(float(x), 9), float(y)) for line in drawn for x, y in (line.get_xydata()[0], line.get_xydata()[-1])}
    for point_path in family.point_paths:
        for place in point_path.places:
            assert (round(family.special(place).value, 9), family.value(place)) in ends


def test_the_legend_tells_what_there_is() -> None:
    found = gw.family(clutch(), "frequency", (1.4, 1.15), {"mean.q1": (0.43, 0.44)}, workers=1)
    figure = found.plot(figure=Figure(layout="constrained")).figure
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["stable", "unstable, beyond −1", "flip (PD)", "grazing", "two special points meet"]


def test_a_family_without_branches_has_no_picture(family) -> None:
    empty = Family(family.system, family.parameter, family.within, family.over)
    with pytest.raises(ModelError, match="there is nothing to draw"):
        picture_of(empty)
    with pytest.raises(ModelError, match="q9"):
        picture_of(family, "half.q9")
