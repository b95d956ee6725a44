"""Designs against closed forms of the linear oscillator, and the derivatives of goals against designs walked again."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import gapwalk as gw
from gapwalk.answers.design import design_picture
from gapwalk.answers.goals import MARGIN, peaks
from gapwalk.answers.least_change import DesignProblem, LeastChangeOptions
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.studies import read_studies
from tests.studies.test_complete_response import TRAIN

IDLE = Path(__file__).resolve().parents[2] / "examples" / "idle.toml"
GAP, DAMPING, LOAD = 1.0, 0.1, 0.15
NAMES = ("stage2.clearance", "stage2.stiffness", "harmonic1.amplitude")


def stopped() -> System:
    """A mass on a spring, shaken so that it touches a soft stop near its resonance."""
    stop = Contact("stop", {"x": 1.0}, (Stage(GAP, 1.5, side=Side.POSITIVE),))
    return System(
        ["x"], [[1.0]], damping=[[DAMPING]], contacts=[stop], harmonics=[Harmonic(LOAD, {"x": 1.0})], frequency=0.7
    )


def quick(**more) -> dict:
    return {"starts": 0, "search_values": 0, "walk": gw.WalkOptions(largest_step=0.05), **more}


@pytest.fixture(scope="module")
def quiet():
    """The least change of load and clearance with which the stop is never touched."""
    goal = gw.ask.Quiet("stop", (0.7, 1.5))
    changes = {"harmonic1.amplitude": 0.5, "stop.clearance": 0.5}
    return gw.ask.design(stopped(), changes, goal, "frequency", (0.7, 1.5), **quick())


def test_a_quiet_design_is_the_nearest_point_of_a_closed_form(quiet):
    # open as long as load <= c * gap: with u of the load and v of the gap, LOAD (1 + u) = c GAP (1 + v)
    lowest = (1.0 - MARGIN) * DAMPING * math.sqrt(1.0 - DAMPING**2 / 4.0)  # 1 over the peak of the linear response
    share = lowest * GAP / LOAD  # 1 + u = share (1 + v), the nearest point of a line
    u, v = np.array([1.0, -share]) * (share - 1.0) / (1.0 + share**2)
    assert quiet.is_reached
    assert [each.percent / 100.0 for each in quiet.changes] == pytest.approx([u, v], abs=1e-5)
    assert quiet.change == pytest.approx(math.hypot(u, v), abs=1e-5)
    assert quiet.judged[0].before < -0.1 < MARGIN - 1e-6 < quiet.judged[0].after < MARGIN + 1e-4
    assert not any(each.kind == "grazing" for each in quiet.response.special_points)


def test_it_describes_itself(quiet):
    assert quiet.sentence.startswith("stop quiet between Ω = 0.7 and 1.5: change ")
    assert "reached" in str(quiet.summary())
    assert {name: len(list(rows())) for name, rows in quiet.tables().items()} == {
        "changes": 3,
        "goals": 2,
        "searches": 3,
    }


def test_goals_that_stand_against_each_other_are_named():
    goals = (gw.ask.Resonance(1, above=1.9, at="closed"), gw.ask.Resonance(1, below=1.3, at="closed"))
    found = gw.ask.design(stopped(), {"stop.stiffness": 0.9}, goals, "frequency", (0.7, 0.75), **quick())
    assert not found.is_reached
    assert found.sentence.startswith("not reached within the limits: ")
    # with the stop closed the stiffness is 1 + k
    for goal, limit in zip(found.judged, (1.9, 1.3), strict=True):
        other = 1.3 if limit == 1.9 else 1.9
        needed = abs(other**2 * (1.0 + (1e-3 if other == 1.9 else -1e-3)) ** 2 - 2.5) / 1.5
        assert goal.without == pytest.approx(needed, rel=1e-4)


def sprung() -> System:
    """A mass on a spring of 1 and a contact without a gap of 0.5: a linear oscillator, whose contact has a force."""
    spring = Contact("spring", {"x": 1.0}, (Stage(0.0, 0.5),))
    loads = {"mean": {"x": 0.3}, "harmonics": [Harmonic(0.2, {"x": 1.0})]}
    return System(["x"], [[1.0]], damping=[[0.1]], contacts=[spring], frequency=0.8, **loads)


@pytest.mark.slow
def test_the_least_change_for_a_peak_is_that_of_a_closed_form():
    def margin(u):  # the contact carries a third of the mean load, and half of the displacement
        damping = 0.1 * (1.0 + u[1])
        peak = 0.2 * (1.0 + u[0]) / (damping * math.sqrt(1.5 - damping**2 / 4.0))
        return 0.6 - 0.5 * (peak + 0.3 / 1.5 * (1.0 + u[2]))

    goal = gw.ask.PeakBelow("spring", 0.6, (0.8, 1.6))
    names = {"harmonic1.amplitude": 0.6, "damping.x.x": 0.6, "mean.x": 0.6}
    found = gw.ask.design(sprung(), names, goal, "frequency", (0.8, 1.6), **quick(margin=0.0))
    best = minimize(lambda u: u @ u, np.zeros(3), constraints={"type": "ineq", "fun": margin}, tol=1e-12).x
    assert margin(np.zeros(3)) < -0.1
    assert found.is_reached
    assert [each.percent / 100.0 for each in found.changes] == pytest.approx(best, abs=2e-5)
    assert "1 search, 1 of which reached the goals" in str(found.summary())


def test_a_peak_counts_whichever_sign_it_has():
    orbit = gw.find_orbit(sprung())
    up = peaks(orbit, "spring")
    down = peaks(gw.find_orbit(sprung().at({"mean.x": -0.3})), "spring")
    assert up == pytest.approx(down[::-1], rel=1e-9)
    assert up[0] > up[1]


def gearbox() -> gw.System:
    """The idling gearbox: a clutch whose stages stay open, and a loose gear that rattles over a band of speeds."""
    return gw.read_study(IDLE, name="rattle").system


def test_the_peak_of_a_link_is_its_whole_torque():
    orbit = gw.find_orbit(gearbox().at(speed=1100.0))
    torque = orbit.motion(4000).signal("clutch.torque")
    assert peaks(orbit, "clutch") == pytest.approx((torque.max(), -torque.min()), abs=2e-6)
    assert not orbit.motion().signal("clutch.force").any()  # that of its stages alone


def test_a_gear_is_quieted_from_inside_its_band_of_rattle():
    # its present motion rattles chaotically there; the threshold study follows the locus of grazing instead
    problem = DesignProblem(
        gw.find_orbit(gearbox().at(speed=1010.0)),
        "speed",
        940.0,
        (gw.ask.Change("mean.gear", 1.0),),
        (gw.ask.Quiet("mesh", (945.0, 1010.0)),),
        LeastChangeOptions(starts=0, margin=0.0),
    )
    route = problem.route(("closed on the positive side",), 0)
    assert route.is_reached
    assert route.values[0] == pytest.approx(-3.165219187, abs=2e-5)
    assert problem.ways() == [("closed on the positive side",), ("closed on the negative side",), ("open",)]


def test_a_resonance_is_that_about_rest():
    # the first natural frequency of two inertias on the clutch's first spring alone, its stages open at rest
    goal, system = gw.ask.Resonance(1, below=600.0, order=2), gearbox()
    hub = 0.004 + 0.002  # the mesh is 40 times as stiff
    stiffness = system["clutch.stiffness"] * 180.0 / math.pi
    turns = math.sqrt(stiffness * (1.0 / 0.14 + 1.0 / hub)) / (2.0 * math.pi)
    assert goal.value(system) == pytest.approx(60.0 * turns / 2.0, rel=5e-3)
    assert gw.ask.Resonance(1, below=600.0, order=2, at="closed").value(system) > 1.7 * goal.value(system)
    found = gw.ask.design(system, {"clutch.stiffness": 0.9}, goal, "speed", (1100.0, 1090.0), **quick(margin=0.0))
    assert found.changes[0].after == pytest.approx(4.0 * (600.0 / goal.value(system)) ** 2, rel=3e-3)
    assert goal.value(found.system) == pytest.approx(600.0, rel=1e-5)


@pytest.mark.slow
def test_an_isolated_branch_refuses_a_design():
    # the response of figure 27 has no fold below an amplitude of 0.43, but an isolated branch ends at 0.2614
    system, goal = gw.paper.case("27").at({"harmonic1.amplitude": 0.35}), gw.ask.NoPoint("fold", (0.2, 0.3))
    options = quick(search_values=(0.22,), search=gw.SearchOptions(starts=16, newton_starts=16))
    found = gw.ask.design(system, {"mean.q1": 0.1}, goal, "harmonic1.amplitude", (0.35, 0.18), **options)
    assert found.judged[0].is_reached
    assert not found.is_reached
    assert len(found.isolated) == 1
    assert "an isolated branch has a fold at 0.261" in found.sentence
    assert found.sentence.startswith("not proved: ")


@pytest.mark.slow
def test_folds_leave_a_band_by_the_least_change():
    system = gw.paper.case("13").at(frequency=0.71)
    lead = gw.find_orbit(system)
    changes = tuple(gw.ask.Change(name) for name in NAMES)
    problem = DesignProblem(lead, "frequency", 0.55, changes, (gw.ask.NoPoint("fold", (0.60, 0.66)),))
    route = problem.route(("below",), 0)
    assert route.is_reached
    u = problem.relative(route.values)
    upper = problem.response(u).branch.special("fold")[-1]
    assert upper.value == pytest.approx(0.60 - 1e-3 * 0.06, abs=1e-9)
    # at the least change, the relative changes are parallel to the gradient of the fold that stops at the band
    slopes = upper.gradient(*NAMES).slopes * problem.scales
    assert np.abs(u @ slopes) == pytest.approx(np.linalg.norm(u) * np.linalg.norm(slopes), rel=1e-6)


@pytest.mark.slow
def test_the_slopes_of_a_vanishing_fold_are_those_of_designs_walked_again():
    lead = gw.find_orbit(gw.paper.case("13").at(frequency=0.71))
    goal = gw.ask.NoPoint("fold", (0.60, 0.66))
    problem = DesignProblem(lead, "frequency", 0.55, tuple(gw.ask.Change(name) for name in NAMES), (goal,))
    need = min(goal.needs(problem.response(np.zeros(3)), "vanish", 0.0), key=lambda each: each.margin)
    for k in range(3):
        step = np.zeros(3)
        step[k] = 2e-3
        pair = [
            min(each.margin for each in goal.needs(problem.response(sign * step), "vanish", 0.0))
            for sign in (-1.0, 1.0)
        ]
        assert need.slopes[k] == pytest.approx((pair[1] - pair[0]) / 4e-3, rel=2e-2)


@pytest.mark.parametrize(
    ("changes", "goal", "words"),
    [
        ({}, gw.ask.Resonance(1, below=1.0), "no parameter may change"),
        ({"frequency": 0.5}, gw.ask.Resonance(1, below=1.0), "the parameter of the response itself"),
        ({"mean.x": 0.5}, gw.ask.Resonance(1, below=1.0), "write its limits"),
        ({"stop.stiffness": 0.5}, gw.ask.Resonance(2, below=1.0), "the system has 1"),
        ({"stop.stiffness": 0.5}, gw.ask.Quiet("gap", (0.7, 0.8)), "no contact"),
        ({"stop.stiffness": 0.5}, gw.ask.NoPoint("fold", (0.5, 0.8)), "inside the range"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, goal, words):
    with pytest.raises(ModelError, match=words):
        gw.ask.design(stopped(), changes, goal, "frequency", (0.7, 0.9), **quick())


@pytest.mark.slow
def test_a_stopped_design_continues_to_the_same(tmp_path, quiet):
    goal, changes = gw.ask.Quiet("stop", (0.7, 1.5)), {"harmonic1.amplitude": 0.5, "stop.clearance": 0.5}
    output, seen = tmp_path / "design.gapwalk", []

    def stop(part, _):
        seen.append(part)
        if len(seen) == 2:
            raise KeyboardInterrupt

    how = {**quick(), "output": output}
    with pytest.raises(Interrupted) as stopped_at:
        gw.ask.design(stopped(), changes, goal, "frequency", (0.7, 1.5), report=stop, **how)
    assert stopped_at.value.found is None  # two designs were tried, and are stored: no search has ended
    again = gw.ask.design(stopped(), changes, goal, "frequency", (0.7, 1.5), report=lambda *_: seen.append(0), **how)
    assert len(seen) == sum(route.steps for route in quiet.routes) + len(quiet.routes) + 1
    assert again.routes == quiet.routes
    assert again.system == quiet.system
    assert gw.open_result(output).changes == quiet.changes


GEARS = (
    TRAIN[: TRAIN.index("[study]")]
    + """
[study]
kind = "design"
parameter = "speed"
from = "1040 rpm"
to = "1100 rpm"
changes = [{ parameter = "springs.stiffness", by = 0.3 }, { parameter = "flywheel.inertia", by = 0.3 }]
goals = [{ quiet = ["mesh2", "mesh1"] }]
starts = 0
workers = 1
"""
)
"""Two loose gears, whose motion has no period where the range begins."""


def rattling(system: gw.System) -> set[str]:
    """Gaps that part in settled motions over the range, by slow sweeps of equal steps."""
    found = gw.ask.rattle_bands(system, "speed", (1040.0, 1100.0), steps=3, starts=0, search=0, workers=1)
    return {band.gap for band in found.bands}


def test_a_train_that_rattles_without_period_is_made_quiet(tmp_path) -> None:
    (study,) = read_studies(io.StringIO(GEARS))
    assert rattling(study.system) == {"mesh1", "mesh2"}
    gw.run(study, tmp_path / "gears.gapwalk")
    found = gw.open_result(tmp_path / "gears.gapwalk").finding.record
    assert found.is_reached
    assert found.sentence.startswith("mesh2, mesh1 quiet between speed = 1040 and 1100 rpm: change ")
    assert found.response_before is None
    assert found.system.structure == study.system.structure
    assert rattling(found.system) == set()
    orbit = gw.find_orbit(found.system.at(speed=1040.0))
    assert orbit.stable
    assert min(orbit.motion().signal("mesh1.torque")) > 0.0
    nearly = {each.name: 0.4 * each.before + 0.6 * each.after for each in found.changes}
    assert rattling(study.system.at(nearly))  # it is the least change
    assert [each.name for each in design_picture(found).curves] == ["after"]


def test_a_gap_that_others_shake_is_not_called_quiet() -> None:
    (study,) = read_studies(io.StringIO(GEARS.replace(', "mesh1"]', "]").replace('gear1 = "-0.4', 'gear1 = "-0.2')))
    found = gw.run(study).finding.record
    assert not found.is_reached
    assert "mesh2" in rattling(found.system)
    assert 'they need goals too: { quiet = "mesh1" }' in found.sentence
    assert found.judged[0].after >= 0.0  # with all flanks held
    assert found.judged[0].verdict == "rattles"
