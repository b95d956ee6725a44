"""Two excitations without a common multiple: closed forms of linear systems, long simulations of one with a gap."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.tori.torus_family import TorusEndReason
from tests.tiers import in_campaign, keeps

FILE = """
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.2]]

[[contact]]
name = "stop"
deflection = { x = 1.0 }
side = "positive"
clearance = 0.2
stiffness = 2.0

[[harmonic]]
amplitude = 0.5
acts_on = { x = 1.0 }

[study]
kind = "tori"
parameter = "frequency"
from = 0.9
to = 0.905
tone = { amplitude = 0.1, acts_on = { x = 1.0 }, frequency = 1.2727922 }

[study.walk]
initial_step = 0.1
largest_step = 0.2
"""

GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0


def oscillator(scale=1.0):
    """A linear oscillator with one load, in any unit of length."""
    return gw.System(["x"], [[1.0]], [[0.2]], harmonics=[gw.Harmonic(0.5 * scale, {"x": 1.0})], frequency=1.3)


def response(amplitude, frequency):
    """Complex amplitude of that oscillator."""
    return amplitude / (1.0 - frequency**2 + 0.2j * frequency)


@keeps("1e-05")
@pytest.mark.parametrize("scale", [1.0, 1e-5])
def test_a_linear_oscillator_in_closed_form(scale):
    w, second = 1.3, 1.3 * GOLDEN
    torus = gw.tori.two_tones(oscillator(scale), gw.tori.Tone(0.3 * scale, {"x": 1.0}, second))
    turns = GOLDEN % 1.0
    assert (torus.curves, torus.rotation) == (1, pytest.approx(turns, abs=1e-11))
    # the coordinate of the tone has the phase of the second load
    cosine, sine = torus.states[:, 1], -torus.states[:, 3] / second
    size = np.hypot(cosine, sine)
    assert size == pytest.approx(np.full(torus.count, size[0]), rel=1e-10)
    waves = (cosine + 1j * sine) / size
    first, other = response(0.5 * scale, w), response(0.3 * scale, second)
    assert torus.states[:, 0] == pytest.approx(first.real + (other * waves).real, abs=1e-10 * scale)
    assert torus.states[:, 2] == pytest.approx(
        (1j * w * first).real + (1j * second * other * waves).real, abs=1e-10 * scale
    )
    # the oscillator decays with half its damping
    period = 2.0 * math.pi / w
    assert torus.exponents[:2] == pytest.approx([-0.1 * period] * 2, abs=1e-7)
    assert torus.stable
    assert gw.verify(torus).ok


@pytest.mark.slow
def test_its_amplitude_and_frequency_are_parameters():
    torus = gw.tori.two_tones(oscillator(), gw.tori.Tone(0.3, {"x": 1.0}, 1.3 * GOLDEN))
    family = gw.tori.follow_tori(torus, "tone_load.amplitude", 0.5)
    mean = [point.torus.states[:, 0].mean() for point in family.points]
    assert mean == pytest.approx([response(0.5, 1.3).real] * len(mean), abs=1e-10)
    swing = np.abs(family.points[-1].torus.states[:, 0] - mean[-1]).max()
    assert swing == pytest.approx(abs(response(0.5, 1.3 * GOLDEN)), rel=1e-2)
    moved = gw.tori.follow_tori(torus, "tone.frequency", 2.12)
    (crossed,) = [each for each in moved.events if each.ratio_words in ("5/8", "3/8")]
    assert (crossed.value, crossed.window) == (pytest.approx(1.3 * 1.625, abs=1e-8), None)  # nothing locks
    assert moved.rotations == pytest.approx(moved.values / 1.3 % 1.0, abs=1e-10)


# the first three were refused as no torus, turned the other way, or counted as three curves
@pytest.mark.parametrize(
    ("damping", "frequency", "second"),
    [(0.00576, 2.993, 10.8677), (0.01936, 1.3448, 2.0304), (0.00204, 1.1558, 3.2377), (0.0024, 1.9, 1.1003)],
)
def test_weak_damping_leaves_one_curve(damping, frequency, second):
    mass = gw.System(["x"], [[1.0]], [[damping]], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=frequency)
    torus = gw.tori.two_tones(mass, gw.tori.Tone(0.05, {"x": 1.0}, second))
    assert (torus.curves, torus.rotation) == (1, pytest.approx(second / frequency % 1.0, abs=1e-10))
    waves = [size / (1.0 - w**2 + 1j * damping * w) for size, w in ((0.1, frequency), (0.05, second))]
    psi = np.angle(torus.states[:, 1] - 1j * torus.states[:, 3] / second)
    expected = waves[0].real + (waves[1] * np.exp(1j * psi)).real
    assert torus.states[:, 0] == pytest.approx(expected, abs=1e-9 * max(map(abs, waves)))


def test_a_motion_of_twice_the_period_has_two_curves():
    """A stop in the way of a strong load: its motion repeats after two periods, and a weak second tone rides on it."""
    stop = gw.stop("stop", {"x": 1.0}, clearance=0.0, stiffness=30.0)
    mass = gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=[gw.Harmonic(0.5, {"x": 1.0})])
    mass = mass.at(frequency=3.0)
    orbit = gw.settle(mass).orbit
    assert orbit is not None
    assert orbit.period == 2
    ratio = 1.0 / GOLDEN
    torus = gw.tori.two_tones(mass, gw.tori.Tone(1e-3, {"x": 1.0}, ratio * mass.frequency))
    assert (torus.curves, torus.rotation, torus.stable) == (2, pytest.approx(2.0 * ratio % 1.0, abs=1e-10), True)


@pytest.mark.slow
def test_a_mass_that_hits_a_stop_as_simulated():
    """SciPy integrates the equations with both loads in time, written down here; its motion lies on the torus."""
    w, second = 0.9, 0.9 * math.sqrt(2.0)
    stop = gw.stop("stop", {"x": 1.0}, clearance=0.2, stiffness=2.0)
    mass = gw.System(["x"], [[1.0]], [[0.2]], contacts=[stop], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=w)
    torus = gw.tori.two_tones(mass, gw.tori.Tone(0.1, {"x": 1.0}, second))
    assert (torus.stable, torus.touches) == (True, (2, 2))
    assert torus.error < 1e-9

    def moved(t, state):
        load = 0.5 * math.cos(w * t) + 0.1 * math.cos(second * t)
        return [state[1], load - state[0] - 0.2 * state[1] - 2.0 * max(state[0] - 0.2, 0.0)]

    times = 2.0 * math.pi / w * np.arange(40, 81)
    run = solve_ivp(moved, (0.0, times[-1]), [0.0, 0.0], "DOP853", t_eval=times, rtol=1e-11, atol=1e-11, max_step=0.02)
    start = np.angle(torus.states[0, 1] - 1j * torus.states[0, 3] / second)
    on_torus = np.array([torus.state(second * t - start)[[0, 2]] for t in times])
    simulated = run.y.T
    assert simulated == pytest.approx(on_torus, abs=1e-7)


@pytest.mark.parametrize("is_verified", [False, in_campaign(True)])
def test_in_a_model_file(tmp_path, is_verified):
    file = tmp_path / "two.toml"
    file.write_text(FILE)
    result = gw.run(gw.read_study(file), tmp_path / "two.gapwalk")
    assert result.finding is not None
    found = result.finding.record
    (family,) = found.families
    assert len(family.points) < 10  # in the large steps of the file
    assert (found.starts, found.complete, family.ends[1].reason) == ((), True, TorusEndReason.RANGE)
    assert family.rotations == pytest.approx(1.2727922 / family.values - 1.0, abs=1e-9)
    again = gw.open_result(tmp_path / "two.gapwalk").finding
    assert again is not None
    assert again.record.families[0].values == pytest.approx(family.values)
    assert str(found.summary()).splitlines()[0] == "1 family of tori"
    assert found.plot().figure.axes
    assert not is_verified or gw.verify(result).ok
    file.write_text(FILE.replace("x = 1.0 }, frequency", "y = 1.0 }, frequency"))
    with pytest.raises(ModelError, match="no coordinate"):
        gw.run(gw.read_study(file), tmp_path / "other.gapwalk")


def test_what_is_no_second_tone():
    with pytest.raises(ModelError, match=r"3/2 of that of the excitation.*orders 2 and 3"):
        gw.tori.two_tones(oscillator(), gw.tori.Tone(0.3, {"x": 1.0}, 1.95))
    with pytest.raises(ModelError, match="acts on 'y', which is no coordinate; they are x"):
        gw.tori.Tone(0.3, {"y": 1.0}, 2.0).onto(oscillator())
    with pytest.raises(ModelError, match=r"'harmonic1' is taken.*name='drive'"):
        gw.tori.Tone(0.3, {"x": 1.0}, 2.0, name="harmonic1").onto(oscillator())
    with pytest.raises(ModelError, match="must be a number > 0"):
        gw.tori.Tone(0.3, {"x": 1.0}, 0.0)
    with pytest.raises(ModelError, match="acts on nothing"):
        gw.tori.Tone(0.3, {}, 1.0)
