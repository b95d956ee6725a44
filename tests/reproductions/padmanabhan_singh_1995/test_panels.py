"""Pictures of the paper's figures: their panels, what they show, and in which range."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.figures import Figure, find_figure
from reproductions.padmanabhan_singh_1995.jobs import JOBS
from reproductions.padmanabhan_singh_1995.panels import Balance, Motion, Overlay, Response
from reproductions.padmanabhan_singh_1995.report import compute


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return computed(("12", "13", "17"), tmp_path_factory.mktemp("results"))


def computed(keys, folder):
    with gw.parallel.local_workers(1) as workers:
        return compute([JOBS[key] for key in keys], folder, workers)[0]


def texts(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_figure_13_has_the_paper_s_panels(results) -> None:
    figure = find_figure("13")
    picture = figure.draw(results)
    panels = picture.axes
    assert [ax.get_title("left") for ax in panels] == [
        "a  response",
        "b  about the second resonance",
        "beside the jump",
    ]
    assert panels[1].get_xlim() == figure.panels[1].within
    assert panels[0].get_ylabel() == "amplitude of q1 (half the peak to peak)"
    assert panels[1].get_ylabel() == "q1(0), once every forcing period"
    assert "flip (PD)" in texts(panels[0])
    assert "period 2" in texts(panels[1])
    assert "period 4" not in texts(panels[1])  # those are at lower frequencies
    assert figure.caption in picture.get_suptitle()


def test_a_loop_lies_on_the_orbits_of_the_result(results) -> None:
    """Both states of each orbit of period 2 lie on the curves of panel b."""
    (loop,) = [member.branch for member in results["13"].diagram.members if member.name == "P2-1"]
    ax = find_figure("13").draw(results).axes[1]
    drawn = np.vstack([line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 2])
    for point in loop.points[::7]:
        for state in point.orbit.strobes(2):
            assert np.nanmin(np.hypot(*(drawn - (point.value, state[0])).T)) < 1e-9


def test_an_expanded_view_shows_its_range_only(results) -> None:
    panel = Response(letter="b", jobs=("13",), title="low frequencies", within=(0.3, 0.45))
    (ax,) = Figure("13", "", (panel,)).draw(results).axes
    assert ax.get_xlim() == (0.3, 0.45)
    branch = results["13"].branches[0]
    inside = branch.measure("half.q1")[(branch.values > 0.3) & (branch.values < 0.45)]
    low, high = ax.get_ylim()
    assert low < inside.min() < inside.max() < high < branch.measure("half.q1").max()


def test_an_overlay_names_its_results(results) -> None:
    panel = Overlay(jobs=("12", "13"), title="", within=(0.5, 0.7), names=("heavy", "moderate"))
    (ax,) = Figure("21", "", (panel,)).draw(results).axes
    assert texts(ax) == ["heavy", "moderate", "thin: unstable"]
    assert ax.get_xlim() == (0.5, 0.7)


def test_harmonic_balance_lies_on_the_response(results) -> None:
    orbit = gw.find_orbit(gw.paper.case("12"), frequency=2.0, method=gw.Balance(20))
    balanced = gw.follow(orbit, "frequency", to=0.15, method=gw.Balance(20, error=0.01))
    # a result of which only the branches are looked at
    shown = {"12": results["12"], "13": SimpleNamespace(branches=(balanced,))}
    panel = Balance(jobs=("12", "13"), title="")
    (ax,) = Figure("9", "", (panel,)).draw(shown).axes  # type: ignore[arg-type]
    (circles,) = [line for line in ax.lines if line.get_markevery() == 0.03]
    branch = results["12"].branches[0]
    curve = np.column_stack((branch.values, branch.measure("half.q1")))
    dense = np.vstack([np.linspace(a, b, 40) for a, b in pairwise(curve)])
    size = np.ptp(curve, axis=0)
    far = [np.hypot(*((dense - point) / size).T).min() for point in circles.get_xydata()]
    assert max(far) < 2e-3


def test_two_cases_stand_side_by_side(results) -> None:
    figure = find_figure("10")
    panels = tuple(replace(panel, jobs=("12",) if panel.jobs == ("4a",) else ("13",)) for panel in figure.panels)
    first, second, third, fourth = replace(figure, panels=panels).draw(results).axes
    assert first.get_position().x0 < second.get_position().x0
    assert first.get_position().y0 > third.get_position().y0
    assert fourth.get_xlabel() == "excitation frequency Ω"


def test_a_motion_is_drawn_with_its_section(results) -> None:
    panel = Motion(jobs=("17",), title="")
    picture = Figure("17", "What it is", (panel,)).draw(results)
    assert len(picture.axes) == 4
    assert "What it is" in picture.get_suptitle()


MOTIONS = ("3-viscous", "3-impact", "8-impact", "8-viscous", "8-record")


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    return computed(MOTIONS, tmp_path_factory.mktemp("motions"))


def test_figure_1_rests_on_no_result() -> None:
    first, second = find_figure("1").draw({}).axes
    assert [len(texts(ax)) for ax in (first, second)] == [1, 1]
    assert texts(first)[0].startswith("viscous damping: loss 0.5037")
    assert first.lines[0].get_ydata().min() < -0.3  # it pulls
    assert second.lines[0].get_ydata().min() >= 0.0


def test_figure_3_has_a_row_for_each_signal(motions) -> None:
    picture = find_figure("3").draw(motions)
    assert [ax.get_ylabel() for ax in picture.axes[::2]] == ["q1''", "stage2"]
    assert [text.get_text() for text in picture.legends[0].get_texts()] == ["viscous damping", "impact damping"]
    viscous, impact = picture.axes[0].lines
    assert 0.01 < np.abs(viscous.get_ydata() - impact.get_ydata()).max() < 0.1


def test_a_part_of_figure_3_has_its_row_only(motions) -> None:
    picture = find_figure("3b").draw(motions)
    assert [ax.get_ylabel() for ax in picture.axes] == ["stage2", "amplitude of stage2"]


def test_figure_8_says_that_its_record_is_synthetic(motions) -> None:
    picture = find_figure("8").draw(motions)
    assert "SYNTHETIC" in picture.get_suptitle()
    assert [len(part.axes) for part in picture.subfigs] == [3, 3]
    for part in picture.subfigs:
        history = next(ax for ax in part.axes if ax.get_xlabel() == "forcing periods")
        assert texts(history)[0] == "record (SYNTHETIC, no measurement)"
        assert history.get_ylabel() == "u3''"


def test_a_picture_has_its_layout_when_it_is_drawn(motions) -> None:
    """Saving it does not make the layout again, which takes longer than all the rest."""
    for name in ("1", "3"):
        assert find_figure(name).draw(motions).get_layout_engine() is None
