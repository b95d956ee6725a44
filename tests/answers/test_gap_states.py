"""States of gaps in single motions, against the closed form of the motion without impacts."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.gap_states import GapState, chosen_gaps, gap_state, judge_gaps, known_gaps, state_codes, usual_gaps
from gapwalk.errors import ModelError
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from tests.systems import clutch

STIFFNESS, AMPLITUDE, FREQUENCY = 50.0, 0.3, 2.0


def suspended(mean: float, side: Side = Side.BOTH) -> System:
    """A mass on a weak spring between stops at -0.5 and +0.5, pushed by a mean force and shaken."""
    stop = Contact("stop", {"x": 1.0}, (Stage(0.5, STIFFNESS, side=side),))
    load = Harmonic(AMPLITUDE, {"x": 1.0})
    return System(
        ["x"], [[1.0]], damping=[[0.2]], contacts=[stop], harmonics=[load], mean={"x": mean}, frequency=FREQUENCY
    )


def size(stiffness: float) -> float:
    """Return the amplitude of the linear oscillator."""
    return AMPLITUDE / abs(stiffness - FREQUENCY**2 + 0.2j * FREQUENCY)


@pytest.mark.parametrize("side", [Side.BOTH, Side.POSITIVE])
def test_a_gap_is_quiet_exactly_where_the_linear_motion_stays_off_its_ends(side):
    # open: x = mean + size cos; closed on the positive stop: 51 x = mean + 25 + force
    touches, opens = 0.5 - size(1.0), 0.5 + 51.0 * size(51.0)
    for mean, expected in [(0.0, GapState.OPEN), (0.99 * touches, GapState.OPEN), (1.01 * opens, GapState.CLOSED)]:
        rest = mean if expected is GapState.OPEN else (mean + 0.5 * STIFFNESS) / (1.0 + STIFFNESS)
        assert gap_state(gw.settle(suspended(mean, side), [rest, 0.0]).orbit, "stop") is expected
    for mean in (1.02 * touches, 0.98 * opens):
        motion = gw.settle(suspended(mean, side)).motion(128)
        assert gap_state(motion, "stop").rattles


def test_a_strong_load_hits_both_sides():
    orbit = gw.settle(suspended(0.0).at({"harmonic1.amplitude": 3.0})).orbit
    assert gap_state(orbit, "stop") is GapState.BOTH_SIDES
    assert gap_state(orbit.motion(), "stop") is GapState.BOTH_SIDES


def test_a_contact_without_a_gap_is_refused_by_name():
    assert known_gaps(clutch()) == usual_gaps(clutch()) == ("stage2",)
    with pytest.raises(ModelError, match=r"no contact of the system; did you mean stop\?"):
        chosen_gaps(suspended(0.0), "stpo")
    pressed = suspended(0.0).at({"stop.clearance": 0.0})
    with pytest.raises(ModelError, match="no contact of the system has a gap"):
        chosen_gaps(pressed)


def test_codes_of_many_motions():
    impacts = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.5], [2.0, 1.0], [np.nan, np.nan]])
    loaded = np.array([True, False, True, True, True, False])
    assert state_codes(impacts, loaded).tolist() == [0, 1, 2, 2, 3, -1]


def test_a_mass_that_a_rigid_stop_holds_is_closed():
    """It stays on the stop where the load never pulls, bounces where it pulls at times, and else hangs free."""
    stop = gw.rigid_stop("stop", {"x": 1.0}, 0.5, restitution=0.5)
    load = Harmonic(0.2, {"x": 1.0})
    system = System(["x"], [[0.01]], damping=[[0.05]], contacts=[stop], harmonics=[load], frequency=1.0)
    pulls = 0.2 + 0.01 * 0.5  # mean load below which the load and the spring pull at times
    means = np.array([-0.4, 0.15, 0.95 * pulls, 1.05 * pulls, 1.0])
    found = judge_gaps(system, np.tile([0.4, 0.0], (5, 1)), {"mean.x": means}, ["stop"], 300)
    expected = [GapState.OPEN, GapState.ONE_SIDE, GapState.ONE_SIDE, GapState.CLOSED, GapState.CLOSED]
    assert [list(GapState)[code] for code in found.codes[:, 0]] == expected
    assert np.isnan(found.peaks).all()  # an impact has no peak of force


def test_a_gap_that_few_motions_nearly_touch_is_open_in_all():
    """The response is below the clearance everywhere, so the linear motion is exact."""
    amplitude, damping = 0.1312356611439015, 0.15027424644732015
    assert amplitude / damping < 0.9
    stop = Contact("s", {"x": 1.0}, (Stage(1.0, 9.723607772353462, side=Side.POSITIVE),))
    system = System(
        ["x"], [[1.0]], damping=[[damping]], contacts=[stop], harmonics=[Harmonic(0.1, {"x": 1.0}, name="a")]
    )
    grid = np.meshgrid(np.linspace(0.601, 1.868, 20), np.linspace(0.02, amplitude, 20))
    values = dict(zip(("frequency", "a.amplitude"), (each.ravel() for each in grid), strict=True))
    found = judge_gaps(system, np.zeros((400, 2)), values, ["s"], 300)
    assert set(found.codes[:, 0].tolist()) == {GapState.OPEN.code}
    assert found.error < 1e-4
    response = values["a.amplitude"] / (1.0 - values["frequency"] ** 2 + 1j * damping * values["frequency"])
    assert found.states[:, 0] == pytest.approx(response.real, abs=1e-3)
    assert not found.peaks.any()
