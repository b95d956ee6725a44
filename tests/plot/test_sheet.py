"""Figures of several panels: one layout, labels placed for it; overlays of several systems; states over a parameter."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import gapwalk as gw
from gapwalk.bifurcation.diagram import Diagram
from tests.studies.diagrams import clutch_loop


@pytest.fixture(scope="module")
def result() -> gw.Result:
    return clutch_loop()


@pytest.fixture(scope="module")
def diagram(result):
    return result.diagram


def labels(ax) -> list[Annotation]:
    return [child for child in ax.get_children() if isinstance(child, Annotation) and child.get_text()]


def hidden(ax) -> int:
    """Number of points of the curves behind the labels of some axes."""
    lines = [line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 2]
    curve = ax.transData.transform(np.vstack(lines))
    boxes = [super(Annotation, label).get_window_extent() for label in labels(ax)]
    return sum(int(box.contains(x, y)) for box in boxes for x, y in curve)


def test_labels_are_placed_for_the_final_layout(diagram) -> None:
    with gw.plot.figure(7.0, 11.0, "A title " * 40) as figure:
        panels = figure.subplots(3)
        for ax in panels:
            ax.set_title("a title that takes room", pad=30.0)
        gw.plot.draw(diagram.branches[:1], ax=panels[0], legend="above")
        gw.plot.draw(diagram, ax=panels[1])
        gw.plot.draw(diagram.branches[:1], ax=panels[2])
        assert not any(labels(ax) for ax in panels)  # not before the end of the block
        before = panels[0].get_position().bounds
    assert panels[0].get_position().bounds != before
    assert figure.get_layout_engine() is None  # it is made once
    assert [bool(labels(ax)) for ax in panels] == [True, True, True]
    assert [hidden(ax) for ax in panels] == [0, 0, 0]
    places = [ax.get_position().bounds for ax in panels]
    figure.draw_without_rendering()
    assert [ax.get_position().bounds for ax in panels] == places


def test_a_diagram_fits_into_a_figure_too(diagram) -> None:
    with gw.plot.figure(8.0, 8.6) as figure:
        gw.plot.draw(diagram, figure=figure)
    assert all(labels(ax) for ax in figure.axes[:2])
    assert figure.get_suptitle() == ""


def test_an_error_in_the_block_leaves_nothing_behind(diagram) -> None:
    with pytest.raises(ZeroDivisionError), gw.plot.figure(4.0, 3.0):
        raise ZeroDivisionError
    ax = gw.plot.draw(diagram.branches[:1])
    assert labels(ax)  # placed at once


def test_a_figure_is_saved_as_it_is(diagram, tmp_path) -> None:
    with gw.plot.figure(4.0, 3.0) as figure:
        gw.plot.draw(diagram.branches[:1], ax=figure.add_subplot())
    gw.plot.save(figure, tmp_path / "a.png", tmp_path / "a.svg")
    gw.plot.save(figure, tmp_path / "b.svg")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    for options in ({"measure": "max"}, {"title": "x"}, {"size": "page"}):
        with pytest.raises(gw.errors.ModelError, match="a figure has its own"):
            gw.plot.save(figure, tmp_path / "c.png", **options)


def test_a_size_is_that_of_the_block(diagram) -> None:
    with gw.plot.sized("column"), gw.plot.figure(8.0, 4.0) as figure:
        gw.plot.draw(diagram.branches[:1], ax=figure.add_subplot())
    assert figure.get_size_inches()[0] == pytest.approx(85.0 / 25.4)


def test_an_overlay_has_a_line_for_each_system(diagram) -> None:
    first, second = diagram.branches[:2]
    ax = gw.plot.overlay({"one": [first], "two": [second]}, "max.q1", within=(0.65, 0.7))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two", "thin: unstable"]
    assert len({line.get_color() for line in ax.lines}) == 2
    assert ax.get_xlim() == (0.65, 0.7)
    inside = (first.values >= 0.65) & (first.values <= 0.7)
    low, high = ax.get_ylim()
    assert low < first.measure("max.q1")[inside].min() < first.measure("max.q1")[inside].max() < high
    # each point of the branch lies on a line, thick where it is stable
    widths = {
        width: np.vstack([line.get_xydata() for line in ax.lines if line.get_linewidth() == width])
        for width in {line.get_linewidth() for line in ax.lines}
    }
    assert len(widths) == 2
    for point in first.points:
        nearest = np.hypot(*(widths[(max if point.stable else min)(widths)] - (point.value, point.measure("max.q1"))).T)
        assert nearest.min() < 1e-9


def test_states_of_all_motions_are_shown(diagram) -> None:
    ax = gw.plot.draw(diagram, "q3", labels=False, legend=False, ax=Figure().add_subplot())
    assert ax.get_ylabel() == "q3(0), once every forcing period"
    assert not labels(ax)
    assert ax.get_legend() is None
    drawn = np.vstack([line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 2])
    for member in diagram.members:
        for point in member.branch.points[::9]:
            for state in point.orbit.strobes(member.period):
                assert np.nanmin(np.hypot(*(drawn - (point.value, state[1])).T)) < 1e-8


def test_periods_that_are_not_in_the_range_are_not_explained(diagram) -> None:
    edge = diagram.within[0]
    ax = gw.plot.draw(diagram, within=(edge, edge + 1e-6), ax=Figure().add_subplot())
    assert "period 2" not in [text.get_text() for text in ax.get_legend().get_texts()]


def test_states_that_there_are_not_are_refused(diagram) -> None:
    with pytest.raises(gw.errors.ModelError, match="no coordinate 'q2'"):
        gw.plot.draw(diagram, "q2", ax=Figure().add_subplot())
    with pytest.raises(gw.errors.ModelError, match="no branches yet"):
        gw.plot.draw(Diagram("frequency", (0.1, 1.0)), ax=Figure().add_subplot())


def test_a_range_without_motions_is_empty_axes(diagram) -> None:
    for ax in (
        gw.plot.draw(diagram, within=(3.0, 4.0), ax=Figure().add_subplot()),
        gw.plot.overlay({"one": diagram.branches[:1]}, within=(3.0, 4.0)),
    ):
        assert ax.get_xlim() == (3.0, 4.0)
