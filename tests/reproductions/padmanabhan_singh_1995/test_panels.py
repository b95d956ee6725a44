"""Pictures of the paper's figures: what each panel shows, in which range, and what the paper says of it."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.figures import find_figure
from reproductions.padmanabhan_singh_1995.jobs import JOBS
from reproductions.padmanabhan_singh_1995.panels import (
    Balance,
    Fact,
    ForceLoop,
    History,
    Loops,
    Overlay,
    Response,
    Section,
    Spectrum,
    Through,
)
from reproductions.padmanabhan_singh_1995.quantities import IMPACT, VISCOUS
from reproductions.padmanabhan_singh_1995.report import compute


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return computed(("12", "13", "17"), tmp_path_factory.mktemp("results"))


def computed(keys, folder):
    with gw.parallel.local_workers(1) as workers:
        return compute([JOBS[key] for key in keys], folder, workers)[0]


def drawn(panel, results):
    """The axes of a panel."""
    return panel.picture([results[key] for key in panel.jobs]).axes[0]


def texts(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def written(ax) -> list[str]:
    return [text.get_text() for text in ax.texts]


@pytest.mark.slow
def test_figure_13_has_the_paper_s_panels(results) -> None:
    response, loops, jump = (drawn(panel, results) for panel in find_figure("13").panels)
    assert loops.get_xlim() == (1.14, 1.36)
    assert jump.get_xlim() == (0.58, 0.84)
    assert response.get_xlabel() == "excitation frequency Ω"
    assert loops.get_ylabel() == "q1 at the beginning of each period"
    assert "paper: flips 0.62 to 0.85" in written(response)


def test_what_the_paper_says_is_drawn_in_its_range(results) -> None:
    ax = drawn(find_figure("13").panels[0], results)
    (bar,) = [line for line in ax.lines if line.get_linewidth() == 3.0]
    assert list(bar.get_xdata()) == [0.62, 0.85]
    highest = max(line.get_ydata().max() for line in ax.lines if line is not bar and len(line.get_xdata()) > 9)
    assert bar.get_ydata()[0] > highest  # above the curves
    assert bar.get_ydata()[0] < ax.get_ylim()[1]


def test_a_place_may_be_a_share_of_the_main_peak(results) -> None:
    branch = results["13"].branches[0]
    peak = branch.values[np.argmax(branch.measure("half.q1"))]
    assert Fact("", 0.5, of_peak="share").places([results["13"]]) == pytest.approx((0.5 * peak, 0.5 * peak))
    assert Fact("", 0.6, of_peak="beyond").places([results["13"]]) == pytest.approx((0.6 + peak, 0.6 + peak))


def test_words_of_the_paper_do_not_meet(results) -> None:
    facts = (Fact("a long sentence about a place", 0.6), Fact("another one beside it", 0.65), Fact("far", 1.8))
    ax = drawn(Response(title="", jobs=("12",), facts=facts), results)
    renderer = ax.figure.canvas.get_renderer()
    boxes = [text.get_window_extent(renderer) for text in ax.texts if text.get_text() in {fact.text for fact in facts}]
    assert len(boxes) == 3
    assert not any(one.overlaps(other) for place, one in enumerate(boxes) for other in boxes[:place])


def test_a_loop_lies_on_the_orbits_of_the_result(results) -> None:
    """Both states of each orbit of period 2 lie on the curves of panel b."""
    (loop,) = [member.branch for member in results["13"].diagram.members if member.name == "P2-1"]
    ax = drawn(find_figure("13").panels[1], results)
    states = np.vstack([line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 2])
    for point in loop.points[::7]:
        for state in point.orbit.strobes(2):
            assert np.nanmin(np.hypot(*(states - (point.value, state[0])).T)) < 1e-9


def test_loops_tell_kinds_of_instability_apart(results) -> None:
    """Motions of period 2 lose their stability beyond +1 at folds, beyond -1 at flips, and by pairs."""
    found = {
        label
        for member in results["13"].diagram.members
        if member.period <= 2
        for label in (point.instability.label for point in member.branch.points)
    }
    ax = drawn(Loops(title="", jobs=("13",), most=2), results)
    dashes = {(line.get_color(), line.get_linestyle()) for line in ax.lines if len(line.get_xdata()) > 2}
    assert found >= {"stable", "above", "below", "pair"}
    assert len(dashes) >= 5  # stable motions of both periods, and three kinds of instability


def test_longer_periods_are_left_out(results) -> None:
    def curves(most):
        ax = drawn(Loops(title="", jobs=("13",), most=most), results)
        return sum(len(line.get_xdata()) for line in ax.lines)

    assert curves(1) < curves(2)


def test_an_expanded_view_shows_its_range_only(results) -> None:
    ax = drawn(Response(letter="b", jobs=("13",), title="low frequencies", within=(0.3, 0.45)), results)
    assert ax.get_xlim() == (0.3, 0.45)
    branch = results["13"].branches[0]
    inside = branch.measure("half.q1")[(branch.values > 0.3) & (branch.values < 0.45)]
    low, high = ax.get_ylim()
    assert low < inside.min() < inside.max() < high < branch.measure("half.q1").max()


def test_figure_4_is_on_one_scale() -> None:
    panels = find_figure("4").panels
    assert len({(panel.heights, panel.log) for panel in panels[:3]}) == 1
    low, high = panels[0].heights
    assert low < 5.39
    assert high > 23.9  # the peaks of both models


def test_an_overlay_names_its_results(results) -> None:
    panel = Overlay(jobs=("12", "13"), title="", within=(0.5, 0.7), names=("heavy", "moderate"))
    ax = drawn(panel, results)
    assert texts(ax) == ["heavy", "moderate", "thin: unstable"]
    assert ax.get_xlim() == (0.5, 0.7)


def test_a_branch_alone(results) -> None:
    ax = drawn(Through(jobs=("13",), title=""), results)
    first = results["13"].branches[0].values
    xs = np.concatenate([line.get_xdata() for line in ax.lines if len(line.get_xdata()) > 9])
    assert (np.nanmin(xs), np.nanmax(xs)) == pytest.approx((first.min(), first.max()))


def test_harmonic_balance_lies_on_the_response(results) -> None:
    orbit = gw.find_orbit(gw.paper.case("12"), frequency=2.0, method=gw.Balance(20))
    balanced = gw.follow(orbit, "frequency", to=0.15, method=gw.Balance(20, error=0.01))
    # a result of which only the branches are looked at
    shown = {"12": results["12"], "13": SimpleNamespace(branches=(balanced,))}
    ax = drawn(Balance(jobs=("12", "13"), title=""), shown)
    (circles,) = [line for line in ax.lines if line.get_markevery() == 0.03]
    branch = results["12"].branches[0]
    curve = np.column_stack((branch.values, branch.measure("half.q1")))
    dense = np.vstack([np.linspace(a, b, 40) for a, b in pairwise(curve)])
    size = np.ptp(curve, axis=0)
    far = [np.hypot(*((dense - point) / size).T).min() for point in circles.get_xydata()]
    assert max(far) < 2e-3


def test_a_settled_motion_is_drawn_as_the_paper_does(results) -> None:
    history, spectrum, section, loop = (
        drawn(kind(jobs=("17",), title=""), results) for kind in (History, Spectrum, Section, ForceLoop)
    )
    assert history.get_xlabel() == "forcing periods"
    assert spectrum.get_yscale() == "log"
    assert section.get_ylabel() == "rate of q1"
    motion = results["17"].finding.attractor.orbit.motion(512)
    (line,) = [line for line in loop.lines if len(line.get_xdata()) > 100]
    assert line.get_xdata().max() == pytest.approx(motion.signal("q1").max(), rel=1e-4)


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    return computed(("3-viscous", "3-impact"), tmp_path_factory.mktemp("motions"))


def test_figure_1_rests_on_no_result_and_has_one_scale() -> None:
    first, second = (drawn(panel, {}) for panel in find_figure("1").panels)
    assert first.get_ylim() == second.get_ylim()
    assert first.get_title("left") == second.get_title("left") == "loss 0.504 per cycle"
    assert first.lines[0].get_ydata().min() < -0.3  # it pulls
    assert second.lines[0].get_ydata().min() >= 0.0


def test_figure_2_has_the_machine_and_the_torque_of_its_clutch() -> None:
    drawing, torque = (drawn(panel, {}) for panel in find_figure("2").panels)
    assert {"flywheel", "hub", "rest", "clutch", "shaft"} <= set(written(drawing))
    curves = [line for line in torque.lines if len(line.get_xdata()) > 9]
    for line, (first, second) in zip(curves, ((0.0, 1.0), (0.1, 0.9), (0.4, 0.6)), strict=True):
        # by hand: the first stage alone up to the clearance of 1, both beyond it
        assert np.interp([0.5, 2.0], *line.get_xydata().T) == pytest.approx([0.5 * first, 2.0 * first + second])


def test_figure_3_begins_at_rest(motions) -> None:
    acceleration, force = (drawn(panel, motions) for panel in find_figure("3").panels)
    assert texts(acceleration) == [VISCOUS, IMPACT]
    for line in force.lines[:3:2]:
        assert line.get_ydata()[0] == 0.0  # at rest in the gap
        assert line.get_xdata()[-1] == 20.0
    triangles = [line.get_xdata() for line in force.lines if line.get_marker() == "^"]
    # an independent program: .41 2.63 4.99 7.11 with impact damping
    assert triangles[1] == pytest.approx([0.41, 2.63, 4.99, 7.11], abs=6e-3)


def test_a_picture_has_its_layout_when_it_is_drawn(motions) -> None:
    """Saving it does not make the layout again, which takes longer than all the rest."""
    for panel in (*find_figure("1").panels, *find_figure("3").panels):
        assert panel.picture([motions[key] for key in panel.jobs]).get_layout_engine() is None
