"""Pictures of settled motions: history, spectrum, section, loop, and the waterfall."""

import io

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.attractors import LyapunovOptions, SpectrumOptions, classify, settle, spectrum, strobe, waterfall
from gapwalk.errors import ModelError
from gapwalk.plot import draw
from tests.systems import clutch, far_and_near, linear
from tests.tiers import keeps


@pytest.fixture(scope="module")
def three():
    return settle(gw.paper.case("15"), frequency=0.45)


@pytest.fixture
def ax():
    return Figure(figsize=(6, 4), layout="constrained").add_subplot()


def rendered(figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=60)
    return content.getvalue()


def test_a_period_three_motion_in_four_panels(three):
    figure = draw(three, figure=Figure(figsize=(9, 6), layout="constrained")).figure
    assert len(figure.axes) == 4
    labels = {ax.get_xlabel() for ax in figure.axes}
    assert labels == {"forcing periods", "multiples of the excitation frequency Ω", "q1", "deflection of stage2"}
    history, section = figure.axes[0], next(ax for ax in figure.axes if ax.get_xlabel() == "q1")
    x, y = history.lines[0].get_data()
    assert x[-1] == 6.0
    assert np.interp(3.0, x, y) == pytest.approx(three.state[0], abs=1e-3)
    points = np.column_stack(section.lines[0].get_data())
    assert points[0] == pytest.approx(three.state[[0, 2]])
    assert len(points) == 3
    assert "period 3 at Ω = 0.45" in figure.get_suptitle()
    assert len(rendered(figure)) > 10_000


@pytest.mark.parametrize(("frequency", "word"), [(1.12, "Quasi-periodic"), (0.4, "Chaotic")])
def test_tori_and_chaos_are_drawn_too(frequency, word):
    options = gw.ClassifyOptions(lyapunov=LyapunovOptions(max_periods=2048))  # enough to tell, and to draw
    found = classify(gw.paper.case("15"), "rest", options, frequency=frequency)
    figure = draw(found, "q3''", figure=Figure(figsize=(9, 6), layout="constrained")).figure
    assert figure.get_suptitle().startswith(word)
    section = next(ax for ax in figure.axes if ax.get_xlabel() == "q3")
    assert len(section.lines[0].get_xdata()) == 2000
    assert len(rendered(figure)) > 10_000


def test_without_contacts_there_is_no_loop():
    figure = draw(settle(linear()), figure=Figure(layout="constrained")).figure
    assert len(figure.axes) == 3
    rendered(figure)


@keeps("options0-near", "options4-far")
@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ({}, "near"),
        ({"signal": "x''"}, "near"),
        ({"signal": "y"}, "other"),  # it touches too, and acts on that coordinate
        ({"signal": "far.force"}, "far"),
        ({"contact": "far"}, "far"),
    ],
)
def test_the_loop_is_that_of_a_contact_that_is_named_or_touches(options, shown):
    settled = settle(far_and_near())
    figure = draw(settled, **options, figure=Figure(layout="constrained")).figure
    (loop,) = [ax for ax in figure.axes if ax.get_xlabel().startswith("deflection")]
    assert loop.get_ylabel() == f"force of {shown}"
    assert (np.ptp(loop.lines[0].get_ydata()) > 0.0) == (shown != "far")


def test_history_shows_the_gap(three, ax):
    draw(three.motion(), "q1", ax=ax)
    assert [line.get_ydata()[0] for line in ax.lines[1:]] == [1.0, -1.0]
    draw(three.motion(), "q3", ax=(other := Figure().add_subplot()))
    assert len(other.lines) == 1
    with pytest.raises(ModelError, match="no signal"):
        draw(three.motion(), "q2", ax=ax)


def test_the_area_of_the_loop_is_the_energy_that_is_lost(three, ax):
    draw(three.motion(samples=4096), contact="stage2", ax=ax)
    x, f = ax.lines[0].get_data()
    area = np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(x))
    report = gw.analysis.rattle(three)
    assert area == pytest.approx(sum(impact.loss for impact in report.impacts), rel=1e-4)
    assert sorted(line.get_xdata()[0] for line in ax.lines[1:]) == [-1.0, 1.0]


def test_a_loop_of_no_contact(three, ax):
    with pytest.raises(ModelError, match="there is no contact 'stage3'; contacts are stage2"):
        draw(three.motion(), contact="stage3", ax=ax)
    with pytest.raises(ModelError, match="there is no contact 'stage3'"):
        draw(three, contact="stage3", figure=Figure(layout="constrained"))


def test_the_spectrum_shows_and_names_its_lines(three, ax):
    found = spectrum(three, "q1")
    draw(found, ax=ax, top=4.0)
    orders, heights = ax.lines[0].get_data()
    assert orders == pytest.approx(np.arange(1, 13) / 3)
    assert heights[2] == pytest.approx(found.amplitude(1.0))
    names = {text.get_text() for text in ax.texts}
    assert {"Ω", "4Ω/3"} <= names
    assert ax.get_yscale() == "log"


def test_a_spectrum_of_chaos_names_only_what_has_a_name(ax):
    settled = settle(gw.paper.case("15"), frequency=0.4)
    draw(spectrum(settled, "q1", SpectrumOptions(periods=64)), ax=ax)
    names = {text.get_text() for text in ax.texts}
    assert "Ω" in names
    assert not any("." in name for name in names)


def test_a_spectrum_of_rest_can_be_drawn(ax):
    still = settle(gw.System(("x",), [[1.0]], [[0.1]]), [1.0, 0.0])
    draw(spectrum(still, "x"), ax=ax)
    rendered(ax.figure)


def test_a_section_says_where_it_is_taken(three, ax):
    draw(strobe(three.system, three.state, 3, np.pi), "q3", "q3'", ax=ax)
    assert ax.get_title("left") == "section at phase 0.5 of the period"
    assert len(ax.lines[0].get_xdata()) == 3


@pytest.mark.slow
def test_the_waterfall_goes_round_its_folds():
    branch = gw.follow(gw.find_orbit(clutch(frequency=0.9)), "frequency", to=0.6)
    found = waterfall(branch, "q1", 5)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(found.values)))) + 1
    assert len(turns) == 2
    ax = draw(found, ax=Figure(layout="constrained").add_subplot())
    assert len(ax.lines) == 2
    (mesh,) = (child for child in ax.collections if isinstance(child, QuadMesh))
    assert mesh.get_array().shape == (5, len(found.values))
    assert np.asarray(mesh.get_array())[0] == pytest.approx(found.amplitudes[:, 1], rel=1e-12, abs=1e-3)
    places = np.concatenate(([0], np.cumsum(np.abs(np.diff(found.values)))))
    assert [line.get_xdata()[0] for line in ax.lines] == pytest.approx(places[turns])
    for tick, text in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True):
        near = int(np.argmin(np.abs(places - tick)))
        assert found.values[near] == pytest.approx(float(text.get_text()), abs=0.02)
    assert "along the branch" in ax.get_xlabel()
    assert len(rendered(ax.figure)) > 5_000


def test_a_settled_motion_draws_itself(three):
    import matplotlib.pyplot as plt

    with mpl.rc_context({"figure.dpi": 50}):
        figure = three.plot("q1'").figure
    assert len(figure.axes) == 4
    plt.close(figure)


def test_the_force_of_a_rigid_stop_is_drawn_as_its_impulses(ax):
    wall = gw.rigid_stop("wall", {"x": 1.0}, clearance=1.0, restitution=0.8)
    load = gw.Harmonic(0.5, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[load], frequency=0.8)
    motion = gw.integrate(system, np.array([0.0, 1.0]), 4)
    draw(motion, ax=ax, signal="wall.force")
    jumps = [before[0] - after[0] for before, after in (impact.velocities for impact in motion.impacts)]
    heights = [path[1, 1] for path in ax.collections[0].get_segments()]
    assert len(jumps) > 1
    assert heights == pytest.approx(jumps, rel=1e-9)  # the impulse on a mass of 1
