"""Pictures of diagrams: panels, colours of periods, where branches are born, and restraint."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError
from gapwalk.meanings import period_color
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.plot import draw, save
from gapwalk.plot.branches import births_of, crowded_range
from gapwalk.plot.picture import picture_of
from gapwalk.plot.style import LINES
from tests.studies.diagrams import clutch_loop


@pytest.fixture(scope="module")
def result() -> gw.Result:
    return clutch_loop()


@pytest.fixture(scope="module")
def figure(result) -> Figure:
    figure = picture_of(result, strobes=True)
    figure.draw_without_rendering()
    return figure


def legend_of(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_there_are_two_panels_over_one_range(figure) -> None:
    upper, lower = figure.axes
    assert upper.get_xlim() == lower.get_xlim()
    assert upper.get_ylabel() == "amplitude of q1 (half the peak to peak)"
    assert lower.get_ylabel() == "q1(0), once every forcing period"
    assert upper.get_xlabel() == lower.get_xlabel() == "excitation frequency Ω"
    assert figure.get_suptitle() == "Second resonance"


def test_what_is_drawn_is_explained(figure) -> None:
    upper, lower = figure.axes
    assert legend_of(upper) == ["period 1", "period 2", "period 4", "stable", "unstable", "a branch begins or ends"]
    assert lower.get_legend() is None
    assert upper.get_legend().get_title().get_text() == "P2-1: first branch of period 2"


def test_all_motions_are_drawn_in_the_measure(result) -> None:
    (ax,) = picture_of(result).axes
    drawn = np.concatenate([line.get_xydata() for line in ax.lines])
    drawn = drawn[~np.isnan(drawn).any(axis=1)]
    for member in result.diagram.members:
        for point in member.branch.points[::7]:
            assert np.abs(drawn - (point.value, point.measure("half.q1"))).max(axis=1).min() < 1e-12


def test_only_stable_motions_up_to_a_period(result) -> None:
    (ax,) = picture_of(result, stable=True, up_to=2).axes
    assert legend_of(ax) == ["period 1", "period 2"]
    assert not [line for line in ax.lines if line.get_marker() == "D"]
    drawn = np.concatenate([line.get_xydata() for line in ax.lines])
    drawn = drawn[~np.isnan(drawn).any(axis=1)]
    points = [point for member in result.diagram.members if member.period <= 2 for point in member.branch.points]
    for stable in (True, False):
        own = [(point.value, point.measure("half.q1")) for point in points if point.stable is stable]
        near = [np.abs(drawn - each).max(axis=1).min() < 1e-12 for each in own]
        assert len(near) > 10
        assert all(near) if stable else sum(near) <= 2  # where branches begin at a flip
    with pytest.raises(ModelError, match="no branches of period 0 or shorter"):
        picture_of(result, up_to=0)


def test_the_legend_lists_what_is_within_the_axes(result) -> None:
    low, high = result.diagram.within
    ax = Figure().subplots()
    draw(result.diagram, "q1", ax=ax, within=(low, low + 0.02 * (high - low)))
    inside = {
        f"period {member.period}"
        for member in result.diagram.members
        if (member.branch.values <= low + 0.02 * (high - low)).any()
    }
    assert {text for text in legend_of(ax) if text.startswith("period")} == inside
    assert len(inside) < 3


def test_a_motion_of_period_m_is_m_curves(result, figure) -> None:
    lines = [line for line in figure.axes[1].lines if line.get_marker() == "None"]
    for member in result.diagram.members:
        own = [line for line in lines if line.get_color() == period_color(member.period)]
        drawn = np.concatenate([line.get_xydata() for line in own])
        broken = np.isnan(drawn).any(axis=1)
        assert broken[-1]
        assert np.count_nonzero(broken) % member.period == 0
        drawn = drawn[~broken]
        for point in member.branch.points[::7]:
            for state in stroboscopic(point.orbit)[:, 0]:
                assert np.abs(drawn - (point.value, state)).max(axis=1).min() < 1e-12
        stable = [line for line in own if line.get_linestyle() == "-"]
        assert bool(stable) == any(point.stable for point in member.branch.points)


def test_branches_are_marked_where_they_are_born(result, figure) -> None:
    marks = [line.get_xydata() for line in figure.axes[1].lines if line.get_marker() == "D"]
    members = result.diagram.members[1:]
    flips = {
        result.diagram[o.parent].branch.special_points[o.special].value for member in members for o in member.origins
    }
    assert {value for mark in marks for value in mark[:, 0].tolist()} == flips
    assert sorted(len(mark) for mark in marks) == [2, 4]  # a line for each period: two births, of one and of two states


def test_only_the_loops_of_the_second_period_have_names(figure) -> None:
    assert [text.get_text() for text in figure.axes[1].texts] == ["b", "P2-1"]


def test_a_part_can_be_enlarged(result) -> None:
    figure = Figure(layout="constrained")
    options = {"closeup": (0.68, 0.69), "labels": False, "legend": False, "strobes": True}
    assert result.diagram.plot("q3", figure=figure, **options) is figure.axes[0]
    upper, middle, lower = figure.axes
    assert middle.get_xlim() == (0.68, 0.69)
    assert lower.get_xlim() == upper.get_xlim()
    assert lower.get_ylabel() == "q3(0), once every forcing period"
    assert upper.get_ylabel() == middle.get_ylabel() == "amplitude of q3 (half the peak to peak)"
    assert not [text for ax in figure.axes for text in ax.texts if text.get_text().startswith("P")]


def test_a_crowd_is_enlarged_by_itself(result) -> None:
    low, high = result.diagram.within
    births = [birth.value for birth in births_of(result.diagram)]
    assert births
    assert crowded_range(births, (low, high)) is None  # four are no crowd
    left, right = crowded_range([low, *np.linspace(0.66, 0.68, 9), high], (low, high))
    assert low < left < 0.66
    assert 0.68 < right < high
    assert crowded_range(list(np.linspace(low, high, 20)), (low, high)) is None  # everywhere is no crowd


def test_many_loops_have_no_names(result, monkeypatch) -> None:
    monkeypatch.setattr("gapwalk.plot.branches._NAMED", 0)
    assert [text.get_text() for text in picture_of(result).axes[0].texts] == []


def test_a_diagram_that_is_not_complete_can_be_drawn(result, tmp_path) -> None:
    first = Diagram("frequency", result.diagram.within, result.diagram.members[:1])
    save(first, tmp_path / "first.png")
    assert (tmp_path / "first.png").stat().st_size > 10_000
    with pytest.raises(ModelError, match="nothing to draw"):
        draw(Diagram("frequency", (0.1, 0.2)))
    with pytest.raises(ModelError, match="no measure"):
        picture_of(result, measure="loudness.q1")


def test_files_are_equal_for_equal_results(result, tmp_path) -> None:
    for name in ("a", "b"):
        save(result, tmp_path / f"{name}.png", tmp_path / f"{name}.svg")
    for ending in ("png", "svg"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_unstable_motions_may_have_the_line_of_their_kind(result) -> None:
    ax = Figure().subplots()
    draw(result.diagram, "q1", ax=ax, instabilities=True)
    branches = result.diagram.branches
    kinds = {point.instability.label for branch in branches for point in branch.points} - {"stable", "neutral"}
    assert legend_of(ax)[3 : 3 + len(kinds)] == [text for kind, text in WORDS.items() if kind in kinds]
    colours = {line.get_color() for line in ax.lines}
    assert {LINES[kind].color for kind in kinds} <= colours
    assert {period_color(rank) for rank in (1, 2, 4)} <= colours  # stable motions keep those of their periods


WORDS = {"below": "unstable, beyond −1", "above": "unstable, beyond +1", "pair": "unstable, complex pair"}
