"""Rattle bands against closed forms of the quiet motion, and against simulations by SciPy."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.answers.gap_states import RANGE, BandEnd, GapState
from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.studies.rattle_study import RattleStudy

GAP, STOP, DAMPING, LOAD = 1.0, 1.5, 0.1, 0.15
IDLE = Path(__file__).resolve().parents[2] / "examples" / "idle.toml"


def stopped() -> System:
    """A mass on a spring, shaken so that it touches a soft stop near its resonance."""
    stop = Contact("stop", {"x": 1.0}, (Stage(GAP, STOP, side=Side.POSITIVE),))
    return System(
        ["x"], [[1.0]], damping=[[DAMPING]], contacts=[stop], harmonics=[Harmonic(LOAD, {"x": 1.0})], frequency=0.5
    )


def touches() -> tuple[float, float]:
    """Return the frequencies at which the amplitude of the linear oscillator is the gap."""
    above = lambda W: LOAD / abs(1.0 - W**2 + 1j * DAMPING * W) - GAP  # noqa: E731
    top = math.sqrt(1.0 - DAMPING**2 / 2.0)
    return brentq(above, 0.5, top, xtol=1e-14), brentq(above, top, 2.0, xtol=1e-14)


@pytest.fixture(scope="module")
def bands():
    return gw.ask.rattle_bands(stopped(), "frequency", (0.7, 1.5), "stop", starts=16, workers=1)


def test_the_ends_are_grazing_points_of_the_linear_motion_and_a_jump(bands):
    low, high = touches()
    (rising,), (falling,), (union,) = (bands.of("stop", met) for met in ("rising", "falling", "any"))
    assert rising.low.value == pytest.approx(low, abs=1e-10)
    assert rising.low.kind == falling.low.kind == falling.high.kind == "grazing"
    assert falling.low.value == pytest.approx(low, abs=1e-10)
    assert falling.high.value == pytest.approx(high, abs=1e-10)
    # the stop hardens: a rising frequency carries the motion past the place where it would touch
    assert rising.high.value > high + 0.005
    assert rising.high.kind == "fold"
    assert (union.low.value, union.high.value) == (pytest.approx(low, abs=1e-10), rising.high.value)
    assert rising.states == (GapState.ONE_SIDE,)


def test_the_jump_is_where_a_carried_simulation_falls_off(bands):
    jump = bands.of("stop", "rising")[0].high.value
    carried = bands.sweeps[0].stretches[0].points[-2].orbit
    assert carried.system.frequency < jump

    def peak(W: float, state: np.ndarray, periods: int) -> float:
        def rates(t, y):
            push = STOP * max(y[0] - GAP, 0.0)
            return [y[1], LOAD * math.cos(W * t) - y[0] - DAMPING * y[1] - push]

        turn = 2.0 * math.pi / W
        late = np.linspace((periods - 2) * turn, periods * turn, 400)
        found = solve_ivp(rates, (0.0, late[-1]), state, t_eval=late, method="LSODA", rtol=1e-7, atol=1e-9)
        return float(found.y[0].max())

    assert peak(jump - 1e-3, carried.state, 150) > GAP
    assert peak(jump + 1e-3, carried.state, 150) < GAP


def test_what_moves_an_end_is_the_slope_of_the_closed_form(bands):
    # at A(W) = gap, the load and the gap enter by their ratio alone
    end = bands.of("stop")[0].low
    movers = {each.name: each for each in end.movers}
    W = end.value
    size2 = (1.0 - W**2) ** 2 + (DAMPING * W) ** 2
    by_frequency = -LOAD * size2**-1.5 * (-2.0 * W * (1.0 - W**2) + DAMPING**2 * W)
    assert movers["stop.clearance"].slope == pytest.approx(1.0 / by_frequency, rel=1e-8)
    assert movers["stop.clearance"].share == pytest.approx(-movers["harmonic1.amplitude"].share, rel=1e-8)


def test_a_sentence_says_where_only_the_range_begins_and_which_ends_are_vague(bands):
    (band,) = bands.of()
    low, high, vague = BandEnd(0.7, RANGE), BandEnd(1.5, RANGE), BandEnd(1.21, "between samples", 0.04)
    for ends, text in (
        ({"low": low}, "stop rattles from the beginning of the range, 0.7, to "),
        ({"low": low, "high": high}, "stop rattles over the whole range, 0.7 to 1.5; "),
        ({"high": high}, "to the end of the range, 1.5; "),
        ({"high": vague}, " to 1.21 ± 0.04; "),
    ):
        assert text in dataclasses.replace(bands, bands=(dataclasses.replace(band, **ends),)).sentence("stop")
    assert "±" not in bands.sentence("stop").partition(";")[0]  # the ends are known better than six digits


def test_severity_and_the_worst_motion(bands):
    (worst,) = bands.worst
    assert worst.severity.peak == max(row.peak for row in bands.severities)
    assert 0.0 < worst.share < 1.0  # the quiet motion coexists just before the jump
    assert bands.sentence("stop").endswith("; a motion in which stop is open exists there too (met falling)")
    assert worst.severity.impacts == 1.0
    assert worst.severity.level == pytest.approx(20.0 * math.log10(worst.severity.rms))
    rows = list(bands.tables()["severity"]())
    assert len(rows) == 1 + len(bands.severities)
    text = str(bands.summary())
    assert text.startswith("stop rattles from 0.9")
    assert "fold" in text


def test_a_quiet_gap_is_said_to_be_quiet():
    quiet = gw.ask.rattle_bands(stopped(), "frequency", (0.5, 0.8), workers=1)
    assert str(quiet.summary()).splitlines()[0] == "stop is quiet (open) from 0.5 to 0.8"
    assert not quiet.bands
    assert not quiet.worst


def test_a_rattling_motion_that_no_sweep_meets_is_found_from_random_starts():
    high = touches()[1]
    within = (high + 4e-4, high + 0.03)
    size = LOAD / (1.0 - within[0] ** 2 + 1j * DAMPING * within[0])
    quiet = (size.real, (1j * within[0] * size).real)  # the linear motion, which does not touch
    options = {"search": 3, "starts": 16}
    found = gw.ask.rattle_bands(stopped(), "frequency", within, start=quiet, **options, workers=1)
    assert not found.of("stop", "rising")
    assert not found.of("stop", "falling")
    (band,) = found.of("stop")
    assert band.low.value == within[0]
    assert (band.high.kind, band.low.kind) == ("fold", "end of the range")
    assert band.high.value == pytest.approx(high + 0.00998598, abs=1e-7)  # the jump of the sweep that comes from below
    assert {row.met for row in found.severities if row.state.rattles} == {"other"}
    assert found.worst[0].severity.met == "other"
    assert any("led to 1 motion beyond those of the sweeps" in note for note in found.notes)


def test_a_file_stores_it_and_a_stopped_run_goes_on(tmp_path):
    whole = gw.ask.rattle_bands(stopped(), "frequency", (0.95, 1.05), workers=1, output=tmp_path / "whole.gw")

    def stop(*news):
        raise KeyboardInterrupt

    with pytest.raises(gw.errors.Interrupted) as caught:
        gw.ask.rattle_bands(stopped(), "frequency", (0.95, 1.05), workers=1, output=tmp_path / "part.gw", report=stop)
    assert not caught.value.found.complete
    assert [str(each.direction) for each in caught.value.found.sweeps] == ["rising"]
    again = gw.ask.rattle_bands(stopped(), "frequency", (0.95, 1.05), workers=1, output=tmp_path / "part.gw")
    for one in (again, gw.open_result(tmp_path / "whole.gw")):
        assert str(one.summary()) == str(whole.summary())
        assert [end.value for band in one.bands for end in (band.low, band.high)] == [
            end.value for band in whole.bands for end in (band.low, band.high)
        ]
        assert repr(one.severities) == repr(whole.severities)
    assert json.dumps(RattleStudy("frequency", 0.9, 1.1).document(whole, points=True), allow_nan=False)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"to": (1.0, 0.5)}, "write the smaller value first"),
        ({"gaps": "stpo"}, "did you mean stop"),
        ({"parameter": "frequncy"}, "frequency"),
    ],
)
def test_wrong_requests_are_refused(changes, message):
    asked = {"parameter": "frequency", "to": (0.7, 1.2), "gaps": "stop"} | changes
    with pytest.raises(ModelError, match=message):
        gw.ask.rattle_bands(stopped(), **asked)


def simulated_mesh(speed: float, periods: int = 90) -> np.ndarray:
    """Return the deflection of the gearbox's mesh, in degrees, over the last periods of a simulation by SciPy.

    The equations are those of three inertias, typed from the table of the model.
    """
    inertias, degree = np.array([0.14, 0.004, 0.002]), math.pi / 180.0
    pace = 2.0 * math.pi * speed / 60.0
    gap, drag, beta = 0.1 * degree, 2.0, 0.1
    orders = ((2, 20.0, 0.0), (4, 8.0, 60.0), (6, 3.0, 100.0))

    def rates(t, y):
        twist, slack = y[0] - y[1], y[1] - y[2]
        turning, closing = y[3] - y[4], y[4] - y[5]
        clutch = 4.0 / degree * twist + 0.1 * turning
        for clearance, stiffness in ((4.0, 8.0), (10.0, 28.0), (-3.0, 8.0), (-8.0, 28.0)):
            beyond = twist - clearance * degree
            clutch += stiffness / degree * beyond * (beyond * clearance > 0.0)
        spring = 1e4 * (max(slack - gap, 0.0) + min(slack + gap, 0.0))
        mesh = spring + beta * abs(spring) * closing
        shaken = sum(size * math.cos(order * pace * t + phase * degree) for order, size, phase in orders)
        torques = np.array([shaken + drag - clutch, clutch - mesh, mesh - drag])
        return np.concatenate((y[3:], torques / inertias))

    turn = math.pi / pace  # of the second order
    late = np.linspace((periods - 10) * turn, periods * turn, 10 * 400)
    rest = np.array([drag / 4.0 * degree + gap + drag / 1e4, gap + drag / 1e4, 0.0, 0.0, 0.0, 0.0])
    found = solve_ivp(rates, (0.0, late[-1]), rest, method="DOP853", t_eval=late, rtol=1e-8, atol=1e-12)
    return (found.y[1] - found.y[2]) / degree


@pytest.mark.slow
def test_the_idling_gearbox_rattles_where_simulations_do():
    study = gw.read_study(IDLE, name="rattle")
    found = gw.run(study).finding.record
    (band,) = found.of("mesh")
    assert band.low.value == pytest.approx(898.377, abs=5e-4)
    assert band.high.value == pytest.approx(1001.53, abs=5e-3)
    assert band.low.kind == band.high.kind == "grazing"
    assert max(band.low.error, band.high.error) < 1e-6
    assert found.sentence("mesh").startswith("mesh rattles from 898.377 to 1001.53 rpm; worst at ")
    # beside the borders, outside and inside: a simulation opens the mesh if the band contains its speed
    beside = 0.05
    for speed in (850.0, band.low.value - beside, band.high.value + beside, 1080.0):
        assert simulated_mesh(speed).min() > 0.1, speed
    for speed in (band.low.value + beside, band.high.value - beside):
        deflection = simulated_mesh(speed)
        assert -0.1 < deflection.min() < 0.1 < deflection.max(), speed
    # and on both sides where the band says so
    (both,) = [span for span in found.of("mesh", "rising")[0].spans if span.state is GapState.BOTH_SIDES]
    assert both.low.value < 950.0 < both.high.value
    deflection = simulated_mesh(950.0)
    assert deflection.min() < -0.1
    assert deflection.max() > 0.1


def test_a_share_of_a_chaotic_motion_does_not_depend_on_the_sample():
    """All starts rattle for ever, each with another largest force in its own window."""
    stop = Contact("stop", {"x": 1.0}, (Stage(0.1, 30.0, side=Side.POSITIVE),))
    load = Harmonic(0.6, {"x": 1.0})
    system = System(["x"], [[1.0]], damping=[[0.05]], contacts=[stop], harmonics=[load], frequency=2.4)
    options = {"steps": 2, "patience": 32, "search": 0, "starts": 8}
    found = gw.ask.rattle_bands(system, "frequency", (2.38, 2.39), **options, workers=1)
    (worst,) = found.worst
    assert (worst.share, worst.starts, worst.motion, worst.severity.period) == (1.0, 8, "chaotic", 0)
    low = 100 * 0.025 ** (1 / 8)  # Clopper and Pearson, all of eight
    assert worst.words == f"8 of 8 random starts lead to rattle; with 95 % confidence, {low:.3g} to 100 % of all do"
    text = found.sentence("stop")
    assert f"worst near {worst.severity.value:.6g}: peak force about {worst.severity.peak:.3g}, " in text
    assert "chaotic" in text


def test_on_a_rigid_stop_the_worst_motion_has_the_fastest_impacts():
    stop = gw.rigid_stop("teeth", {"x": 1.0}, 1.0, 0.5, side="positive")
    load = gw.Harmonic(0.8, {"x": 1.0})
    system = gw.System(["x"], [[1.0]], [[0.3]], contacts=[stop], harmonics=[load], frequency=0.8)
    options = {"starts": 0, "search": 0}
    found = gw.ask.rattle_bands(system, "frequency", (0.76, 0.8), gaps="teeth", **options)
    rows = [row for row in found.severities if row.state.rattles]
    (worst,) = found.worst
    assert all(math.isnan(row.peak) for row in rows)  # the force of an impact is an impulse
    assert worst.severity.approach == max(row.approach for row in rows)
    sweep = found.sweeps[0].stretches[0].points[-1].orbit
    speed = max(event.velocity for event in sweep.events if event.enters)
    assert worst.severity.approach == pytest.approx(speed, rel=1e-9)
    assert "inf" not in f"{found.sentence('teeth')} {found.summary()}"
    assert all(math.isnan(each) for row in rows for each in (row.rms, row.kurtosis, row.level))
    assert "with the fastest impacts" in str(found.summary())
