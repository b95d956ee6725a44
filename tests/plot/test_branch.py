"""Pictures of branches: what is drawn where, and that nothing stands in the way of anything."""

from itertools import combinations, pairwise

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.measures import full_measure
from gapwalk.model.words import measure_words
from gapwalk.plot import draw, save
from gapwalk.plot.branches import pieces_of
from gapwalk.plot.picture import picture_of
from gapwalk.studies.response_study import ResponseOptions
from tests.studies.studies import stop_study
from tests.systems import clutch


@pytest.fixture(scope="module")
def response() -> gw.Result:
    """Figure 13: folds, flips, Neimark-Sacker and grazing points."""
    study = gw.Study(clutch(frequency=2.0), ResponseOptions("frequency", 2.0, 0.15, "half.q1"), "Costs $5, 50 %")
    return gw.run(study)


@pytest.fixture
def axes():
    return Figure(layout="constrained").add_subplot()


def test_a_branch_is_cut_exactly_at_its_special_points(response) -> None:
    (branch,) = response.branches
    pieces = pieces_of(branch, "half.q1")
    changes = [special for special in branch.special_points if special.before.label != special.after.label]
    assert [piece.label for piece in pieces] == [changes[0].before.label, *(each.after.label for each in changes)]
    for (one, other), special in zip(pairwise(pieces), changes, strict=True):
        meeting = (special.value, special.point.measure("half.q1"))
        assert (one.x[-1], one.y[-1]) == meeting
        assert (other.x[0], other.y[0]) == meeting


def test_the_drawn_line_goes_through_every_point(response) -> None:
    (branch,) = response.branches
    pieces = pieces_of(branch, "max.q3")
    x, y = (np.concatenate([getattr(piece, axis) for piece in pieces]) for axis in "xy")
    for point in branch.points:
        distance = np.abs(x - point.value) + np.abs(y - point.measure("max.q3"))
        assert distance.min() < 1e-12
    step = np.abs(np.diff(branch.measure("max.q3"))).max()
    assert y.max() <= branch.measure("max.q3").max() + step / 4  # smooth, but not beyond what was computed


def test_labels_hide_neither_one_another_nor_the_symbols(response) -> None:
    figure = picture_of(response)
    figure.draw_without_rendering()
    labelled = [*figure.axes, *figure.axes[0].child_axes]
    boxes = [text.get_window_extent() for ax in labelled for text in ax.texts]
    bifurcations = [each for each in response.branches[0].special_points if each.kind is not gw.Kind.GRAZING]
    assert len(boxes) == len(bifurcations)
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    for ax in labelled:
        symbols = [line for line in ax.lines if len(line.get_xdata()) == 1 and line.get_marker() in ("o", "D", "*")]
        places = ax.transData.transform([(line.get_xdata()[0], line.get_ydata()[0]) for line in symbols])
        for text in ax.texts:
            box = text.get_window_extent()
            assert not [place for place in places if box.contains(*place)]


def test_a_crowd_of_special_points_is_enlarged_where_nothing_is_hidden(response) -> None:
    figure = picture_of(response)
    figure.draw_without_rendering()
    ax = figure.axes[0]
    (closeup,) = ax.child_axes
    frame = closeup.get_window_extent()
    (branch,) = response.branches
    curve = ax.transData.transform(np.column_stack((branch.values, branch.measure("half.q1"))))
    assert not [place for place in curve if frame.contains(*place)]


def test_what_is_drawn_is_explained(response, axes) -> None:
    (branch,) = response.branches
    assert branch.plot("q3", ax=axes) is axes
    assert axes.get_xlabel() == "excitation frequency Ω"
    assert axes.get_ylabel() == "amplitude of q3 (half the peak to peak)"
    texts = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert texts[:4] == ["stable", "unstable, beyond −1", "unstable, beyond +1", "unstable, complex pair"]
    # the Neimark-Sacker points lie on one another, so a number is drawn in their place
    assert texts[4:] == ["fold (LP)", "flip (PD)", "grazing", "number of points there"]
    assert sorted(int(text.get_text()) for text in axes.texts if text.get_text().isdigit()) == [3]


def test_the_legend_lists_what_is_within_the_axes(response) -> None:
    (branch,) = response.branches
    low, high = 1.0, 1.1  # there the response is stable, and has no special point
    assert not [special for special in branch.special_points if low <= special.value <= high]
    figure = picture_of(branch, "q1", within=(low, high))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stable"]


def test_measures_have_short_names() -> None:
    assert full_measure("half", ("q1", "q3")) == "half.q1"
    assert full_measure("q3", ("q1", "q3")) == "half.q3"
    assert full_measure("max", ("q1", "q3")) == "max.q1"
    assert full_measure("h1/2.q3", ("q1", "q3")) == "h1/2.q3"
    assert measure_words("h1/2.q3") == "amplitude of harmonic 1/2 of q3"


def test_several_branches_share_axes(response, axes) -> None:
    (branch,) = response.branches
    draw(branch, ax=axes, labels=False, legend=False)
    lines = len(axes.lines)
    draw(branch, "max.q1", ax=axes, labels=False, legend=False)
    assert len(axes.lines) == 2 * lines
    assert axes.get_ylim()[1] > branch.measure("max.q1").max()


def test_an_unknown_measure_is_refused(response, axes) -> None:
    with pytest.raises(ModelError, match="no measure"):
        response.branches[0].plot("loudness.q1", ax=axes)


def test_a_branch_of_few_points_can_be_drawn(tmp_path) -> None:
    study = stop_study(end=0.701)
    save(gw.run(study), tmp_path / "few.png")
    branch = gw.run(study).branches[0]
    first = gw.Branch(branch.parameter, branch.period, branch.points[:1], (), branch.ends)
    save(first, tmp_path / "one.png")


@pytest.mark.slow
def test_files_are_equal_for_equal_results(response, tmp_path) -> None:
    for name in ("a", "b"):
        save(response, tmp_path / f"{name}.png", tmp_path / f"{name}.svg")
    for ending in ("png", "svg"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()


def test_the_style_of_the_users_own_pictures_is_left_alone(response, axes) -> None:
    before = dict(mpl.rcParams)
    response.branches[0].plot(ax=axes)
    assert dict(mpl.rcParams) == before
