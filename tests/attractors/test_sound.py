"""Sounds of settled motions: pitch and level are those of closed forms, and levels compare as the motions do."""

import io
import math

import numpy as np
import pytest
from scipy.io import wavfile

import gapwalk as gw
from gapwalk.analysis import sound
from gapwalk.attractors.spectrum import SECOND
from gapwalk.errors import ModelError
from gapwalk.studies import read_studies
from tests.explorer.conftest import CLUTCH

DAMPING, FORCE = 0.05, 0.3


def linear(frequency: float) -> gw.Orbit:
    system = gw.System(
        ["x"], mass=[1.0], damping=[2.0 * DAMPING], stiffness=[1.0],
        harmonics=[gw.Harmonic(FORCE, {"x": 1.0})], frequency=frequency,
    )  # fmt: skip
    return gw.find_orbit(system)


def read(content: bytes) -> tuple[int, np.ndarray]:
    """Rate and samples of a WAV file between -1 and 1, by SciPy."""
    rate, values = wavfile.read(io.BytesIO(content))
    return rate, values / 2.0**31


def pitch(rate: int, values: np.ndarray) -> float:
    """The frequency of the highest line in Hz, by a parabola through the logarithms with a Gaussian window."""
    count = len(values)
    window = np.exp(-0.5 * ((np.arange(count) - count / 2) / (count / 8)) ** 2)
    lines = np.log(np.abs(np.fft.rfft(values * window)) + 1e-300)
    k = int(np.argmax(lines))
    a, b, c = lines[k - 1 : k + 2]
    return (k + 0.5 * (a - c) / (a - 2.0 * b + c)) * rate / count


@pytest.mark.parametrize("frequency", [0.4, 1.0, 1.7])
def test_pitch_and_level_of_a_linear_oscillator_are_the_closed_form(frequency) -> None:
    heard = sound(linear(frequency), "x''", 2.0)
    amplitude = frequency**2 * FORCE / math.hypot(1.0 - frequency**2, 2.0 * DAMPING * frequency)
    rate, values = read(heard.wav(10.0))
    assert pitch(rate, values) == pytest.approx(90.0 * frequency, abs=1e-3)  # frequency 1 is heard at 90 Hz
    assert 10.0 * np.abs(values).max() == pytest.approx(amplitude, rel=1e-4)
    assert heard.level == pytest.approx(amplitude / math.sqrt(2.0), rel=1e-3)


def test_the_pitch_of_a_train_is_that_of_its_speed() -> None:
    """Second order of 950 rpm: 31.667 Hz."""
    train = gw.read_study(
        io.StringIO(
            'speed = "950 rpm"\n'
            'inertia = [{ name = "a", inertia = "1 kg m^2" }, { name = "b", inertia = "2 kg m^2" }]\n'
            'shaft = [{ name = "s", between = ["a", "b"], stiffness = "900 N m/rad", damping = "5 N m s/rad" }]\n'
            '[[harmonic]]\norder = 2\namplitude = "7 N m"\nacts_on = { a = 1.0 }\n'
            '[study]\nkind = "response"\nparameter = "speed"\nfrom = "950 rpm"\nto = "900 rpm"\n'
        )
    ).system
    heard = sound(gw.find_orbit(train), "s.torque", 4.0)
    rate, values = read(heard.wav())
    assert pitch(rate, values) == pytest.approx(2.0 * 950.0 / 60.0, abs=1e-3)
    assert heard.unit == "N m"
    with pytest.raises(ModelError, match="its time is in seconds"):
        sound(gw.find_orbit(train), "s.torque", second=2.0)


def test_quiet_and_rattling_motions_are_as_differently_loud_as_they_are() -> None:
    """The levels of two motions that exist at one frequency; by Parseval's sum over their exact spectra."""
    study = next(iter(read_studies(CLUTCH)))
    (branch,) = gw.run(study).branches
    stable = [point for point in branch.points if point.stable]
    rest, hits = (select(stable, key=lambda point: point.orbit.measure("half.q1")) for select in (min, max))
    assert hits.orbit.measure("half.q1") > 3.0 * rest.orbit.measure("half.q1")
    name = f"{study.system.coordinates[0]}''"
    levels, true = [], []
    for point in (rest, hits):
        heard = sound(point.orbit, name, 4.0)
        _, values = read(heard.wav(100.0))
        levels.append(float(np.sqrt(np.mean(values**2))))
        lines = gw.analysis.spectrum(point.orbit, name, gw.analysis.SpectrumOptions(tolerance=1e-9)).amplitudes[1:]
        true.append(float(np.sqrt(np.sum(lines**2) / 2.0)))
    assert levels[1] / levels[0] == pytest.approx(true[1] / true[0], rel=2e-3)
    assert 100.0 * levels[1] == pytest.approx(true[1], rel=2e-3)


def test_impacts_of_rigid_stops_are_heard_as_their_impulses() -> None:
    """The velocity of a periodic motion returns, so that its acceleration with all impulses has no mean."""
    system = gw.System(
        ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0],
        contacts=[gw.rigid_stop("wall", {"x": 1.0}, 0.3, 0.6)],
        harmonics=[gw.Harmonic(0.6, {"x": 1.0})], frequency=1.3,
    )  # fmt: skip
    orbit = gw.find_orbit(system)
    motion = orbit.motion(256)
    jumps = motion.impulses("x''")[1] / system.frequency
    assert len(jumps)
    assert np.abs(jumps).min() > 0.05
    rate, count = 48_000, 90  # periods
    seconds = count * 2.0 * np.pi / system.frequency / SECOND
    heard = sound(orbit, "x''", seconds, rate=rate)
    smooth = np.abs(motion.a[:, 0]).max()
    assert heard.peak > 3.0 * smooth
    assert abs(heard.values.mean()) < 0.01 * np.abs(jumps).sum() * system.frequency / (2.0 * np.pi)


def test_a_sound_that_does_not_fit_is_refused_with_what_to_write() -> None:
    heard = sound(linear(1.0), "x''", 0.5)
    with pytest.raises(ModelError, match=r"above the full scale of 1: .* full_scale=5 or more"):
        heard.wav(1.0)
    assert heard.full_scale == 5.0
    assert b"x'', full scale 5\0" in heard.wav()
    with pytest.raises(ModelError, match="no signal"):
        sound(linear(1.0), "y")
    with pytest.raises(ModelError, match="seconds is 0"):
        sound(linear(1.0), "x", 0)
    with pytest.raises(ModelError, match="rate is 10"):
        sound(linear(1.0), "x", rate=10)
