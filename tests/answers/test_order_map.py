"""Order maps: signals with known orders, linear trains in closed form, and train A beside its settled motion."""

import functools
import io
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.answers.order_map import OrderMap, order_map
from gapwalk.attractors.spectrum import Tracked, turns_of
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.plot import draw

FILE = Path(__file__).parents[1] / "data/train_a.toml"
INERTIAS, STIFFNESS, DAMPING = (0.1, 0.02), 900.0, 0.6
TORQUES = {2: 10.0, 4: 3.0}
GEAR = 0.05  # m


@functools.cache
def linear() -> gw.System:
    """Two discs with a shaft between them, shaken at orders 2 and 4 of the first."""
    parts = gw.train
    return parts.Train(
        [parts.Inertia("drive", f"{INERTIAS[0]} kg m^2"), parts.Inertia("gear", f"{INERTIAS[1]} kg m^2", f"{GEAR} m")],
        [parts.Shaft("shaft", ("drive", "gear"), stiffness=f"{STIFFNESS} N m/rad", damping=f"{DAMPING} N m s/rad")],
        harmonics=[gw.Harmonic(f"{size} N m", {"drive": 1.0}, order) for order, size in TORQUES.items()],
        speed="900 rpm",
    ).system()


def closed(order: int, rpm: float) -> float:
    """Return the acceleration of the gear at an order, in m/s^2."""
    w = order * rpm * 2.0 * math.pi / 60.0
    link = STIFFNESS + 1j * w * DAMPING
    a, b = (link - inertia * w**2 for inertia in INERTIAS)
    return GEAR * w**2 * abs(TORQUES[order] * link / (a * b - link**2))


def tracked(signal, samples: int = 512, turns: int = 60, first: float = 800.0, last: float = 1000.0) -> Tracked:
    """Return a function of the angle of the shaft as a signal of a run-up of even acceleration over the angle."""
    system = linear()
    theta = PERIOD * np.arange(2 * turns * samples + 1) / samples  # two periods of the excitation in each turn
    speed = np.sqrt(np.linspace(first**2, last**2, len(theta)))
    time = np.cumsum(np.append(0.0, np.diff(theta) / (speed[1:] * system.structure.frequency)))
    return Tracked(system, "gear.acceleration", samples, theta, time, speed, signal(theta / 2.0))


def test_known_orders_come_out_with_their_amplitudes() -> None:
    """Orders 2, 4.5 and 7.25 of the shaft, and a mean; amplitudes to 1e-3 (they are exact on lines)."""
    sizes = {2.0: 3.0, 4.5: 0.4, 7.25: 0.05}
    found = tracked(lambda turn: 1.5 + sum(size * np.cos(order * turn + order) for order, size in sizes.items()))
    spectra = found.waterfall(12.0, turns_of(found.system, 8))
    assert spectra.orders[1] == pytest.approx(0.125)
    for order, size in sizes.items():
        assert spectra.cut(order) == pytest.approx(size, rel=1e-3)
    assert spectra.amplitudes[:, 0] == pytest.approx(1.5, rel=1e-6)
    assert spectra.overall == pytest.approx(math.sqrt(0.5 * sum(size**2 for size in sizes.values())), rel=1e-6)
    assert len(spectra.values) == (60 - 8) // 2 + 1  # 75 % overlap
    assert spectra.window == "Hann window of 8 turns, 75% overlap, lines 0.125 apart"
    between = tracked(lambda turn: np.cos(3.0625 * turn)).waterfall(12.0, 16)  # half way between two lines
    assert between.amplitudes.max() == pytest.approx(8.0 / (3.0 * math.pi), rel=1e-3)  # scalloping of Hann, 1.42 dB


def test_the_band_of_rattle_is_that_of_its_frequencies() -> None:
    """Order 60 is 800 Hz at 800 rpm: inside; order 20 is 333 Hz at most: outside."""
    found = tracked(lambda turn: 2.0 * np.cos(60.0 * turn) + 5.0 * np.cos(20.0 * turn)).waterfall(12.0, 16)
    assert found.band == pytest.approx(2.0 / math.sqrt(2.0), rel=1e-6)
    assert found.overall == pytest.approx(math.sqrt((4.0 + 25.0) / 2.0), rel=1e-6)
    assert found.pitch == pytest.approx(found.values / 60.0)
    coarse = tracked(lambda turn: np.cos(2.0 * turn), samples=128).waterfall(12.0, 16)
    assert np.isnan(coarse.band).all()  # 128 samples of a period of 27 Hz resolve 1,700 Hz


@functools.cache
def mapped() -> tuple[gw.System, OrderMap]:
    system = linear()
    run = gw.ask.run_up(system, gw.ask.SpeedCourse.ramp(700.0, 950.0, 25.0), samples=512)
    return system, order_map(run, "gear.acceleration", 8.0)


def test_the_cuts_of_a_slow_run_up_are_the_closed_form() -> None:
    _, found = mapped()
    assert found.cuts == (2.0, 4.0)
    for order in TORQUES:
        wanted = np.array([closed(order, rpm) for rpm in found.values])
        np.testing.assert_allclose(found.spectra.cut(order), wanted, rtol=5e-3)
    assert found.spectra.overall == pytest.approx(
        np.hypot(*map(found.spectra.cut, found.cuts)) / math.sqrt(2.0), rel=1e-3
    )


def test_levels_peaks_and_tables() -> None:
    _, found = mapped()
    assert found.unit == "dB re 1e-6 m/s^2"
    peak = found.peaks[0]
    sizes = found.spectra.cut(2)
    assert (peak.order, peak.amplitude) == (2.0, sizes.max())
    assert peak.value == found.values[np.argmax(sizes)]
    assert peak.level == pytest.approx(20.0 * math.log10(sizes.max() / math.sqrt(2.0) / 1e-6), abs=1e-9)
    rows = [*found.tables()["cuts"]()]
    assert rows[0] == ["speed", "order 2", "order 4", "overall", "rattle"]
    assert len(rows) == 1 + len(found.values)
    assert "Hann window of 8 turns" in str(found.summary())


def test_both_pictures_are_drawn() -> None:
    _, found = mapped()
    for hertz, words in ((False, "order"), (True, "frequency [Hz]")):
        figure = Figure(figsize=(8, 6.4))
        draw(found, figure=figure, hertz=hertz)
        above, below = figure.axes[:2]
        assert above.get_ylabel() == words
        assert below.get_ylabel() == "level [dB re 1e-6 m/s^2]"
        mesh = above.collections[0]
        assert mesh.norm.vmax - mesh.norm.vmin == pytest.approx(60.0)


@pytest.mark.slow
def test_the_map_of_a_branch_has_exact_lines() -> None:
    system, _ = mapped()
    branch = gw.follow(gw.find_orbit(system.at(speed=1000.0)), "speed", 1004.0)
    found = order_map(branch, "gear.acceleration", 8.0)
    for order in TORQUES:
        wanted = [closed(order, rpm) for rpm in found.values]
        np.testing.assert_allclose(found.spectra.cut(order), wanted, rtol=1e-6)
    orbits = [point.orbit for point in branch.points]
    assert order_map(orbits, "gear.acceleration", 8.0).values == pytest.approx(found.values)


def test_what_a_map_does_not_have_is_told() -> None:
    system, found = mapped()
    with pytest.raises(ModelError, match="order 11 is not in these spectra; they go up to order 8"):
        found.spectra.cut(11.0)
    with pytest.raises(ModelError, match="needs a run-up, a branch, or at least one orbit"):
        order_map([], "gear.acceleration")
    short = gw.ask.run_up(system, gw.ask.SpeedCourse.ramp(700.0, 710.0, 40.0))
    with pytest.raises(ModelError, match="less than a window"):
        order_map(short, "gear.acceleration")


@pytest.mark.slow
def test_train_a_in_a_slow_run_up_has_the_orders_of_its_settled_motion() -> None:
    """Without its dry friction, which a run-up refuses; at 1,000 rpm all teeth stay closed."""
    text = "\n".join(line for line in FILE.read_text().splitlines() if not line.startswith("hysteresis"))
    system = gw.read_model(io.StringIO(text))
    begun, settled = (gw.find_orbit(system.at(speed=rpm)) for rpm in (990.0, 1000.0))
    course = gw.ask.SpeedCourse.ramp(990.0, 1010.0, 10.0)
    run = gw.ask.run_up(system, course, state=begun.state)
    for inertia in ("flywheel", "input", "gear1", "gear2", "gear5"):
        found = order_map(run, f"{inertia}.acceleration", 12.0)
        for order in (2, 4, 6):
            size = float(np.interp(1000.0, found.values, found.spectra.cut(order)))
            assert size == pytest.approx(settled.measure(f"order{order}.{inertia}.acceleration"), rel=5e-3)
