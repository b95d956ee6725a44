"""Orders are those that the user wrote: where a train has a speed, they are counted per turn of that shaft."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

import gapwalk as gw
from gapwalk.attractors import compare_motions as agreement
from gapwalk.attractors.spectrum import line_name
from gapwalk.errors import ModelError
from gapwalk.plot import draw
from gapwalk.plot.picture import card_of

INERTIA, STIFFNESS, DAMPING = 0.01, 40.0, 0.2
TORQUES = {2: 10.0, 4: 3.0, 6: 1.0}
RPM = 902.0


@pytest.fixture(scope="module")
def system() -> gw.System:
    """A disc on the wall, shaken at three orders of a shaft that turns at 902 rpm."""
    shaft = gw.train.Shaft(
        "shaft", ("disc", "ground"), stiffness=f"{STIFFNESS} N m/rad", damping=f"{DAMPING} N m s/rad"
    )
    harmonics = [gw.Harmonic(f"{size} N m", {"disc": 1.0}, order) for order, size in TORQUES.items()]
    return gw.train.Train(
        [gw.train.Inertia("disc", f"{INERTIA} kg m^2")], [shaft], harmonics=harmonics, speed=f"{RPM} rpm"
    ).system()


@pytest.fixture(scope="module")
def orbit(system):
    return gw.find_orbit(system)


def torque(order: int) -> float:
    """Of the shaft at an order, by the closed form."""
    w = order * RPM * 2.0 * math.pi / 60.0
    return TORQUES[order] * abs((STIFFNESS + 1j * w * DAMPING) / (STIFFNESS - INERTIA * w * w + 1j * w * DAMPING))


def test_lines_of_a_spectrum_stand_at_the_orders_of_the_torques(orbit) -> None:
    found = gw.analysis.spectrum(orbit, "shaft.torque")
    for order in TORQUES:
        assert found.amplitude(order) == pytest.approx(torque(order), rel=1e-9)
    assert found.amplitude(1) == found.amplitude(3) == 0.0
    assert {peak.name: peak.order for peak in found.peaks(3)} == {"order 2": 2.0, "order 4": 4.0, "order 6": 6.0}
    assert "speed 902 rpm" in repr(found)


def test_measures_and_waterfalls_count_in_the_same_way(orbit) -> None:
    for order in TORQUES:
        assert orbit.measure(f"h{order}.shaft.torque") == pytest.approx(torque(order), rel=1e-9)
    with pytest.raises(ModelError, match="a period-1 orbit has harmonics of multiples of order 2, not of 1"):
        orbit.measure("h1.shaft.torque")
    found = gw.analysis.waterfall([orbit], "shaft.torque", top=6, parameter="speed")
    assert found.orders.tolist() == [0.0, 2.0, 4.0, 6.0]
    np.testing.assert_allclose(found.amplitudes[0, 1:], [torque(order) for order in TORQUES], rtol=1e-4)
    ax = draw(found, ax=Figure().add_subplot())
    assert ax.get_ylabel() == "order (per turn of disc)"


def test_two_motions_are_compared_line_by_line_at_the_same_orders(system, orbit) -> None:
    other = gw.find_orbit(system.at({"shaft.damping": 0.4}))
    (pair,) = gw.analysis.contrast(orbit, other, ["shaft.torque"]).pairs
    assert [line.order for line in pair.agreement.lines[:3]] == [2.0, 4.0, 6.0]
    assert pair.agreement.lines[0].first == pytest.approx(torque(2), rel=1e-6)
    figure = gw.analysis.contrast(orbit, other, ["shaft.torque"], names=("soft", "hard")).plot(figure=Figure()).figure
    assert figure.get_suptitle() == "soft and hard at speed = 902 rpm"
    assert figure.axes[1].get_xlabel() == "order (per turn of disc)"


def test_orders_of_an_agreement_are_counted_not_the_angles() -> None:
    theta = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    found = agreement.agreement(theta, np.cos(theta), np.cos(theta), np.array([1.0]), turns=2)
    assert [(line.order, round(line.first, 9)) for line in found.lines] == [(2.0, 1.0)]


@pytest.mark.slow
def test_what_is_printed_and_drawn_says_the_speed_and_the_orders(system, orbit) -> None:
    settled = gw.settle(system)
    for value in (system, orbit, settled, gw.classify(system)):
        assert "902 rpm" in repr(value)
        assert "frequency" not in repr(value)
        assert "188.9" not in repr(value)  # twice the speed, in rad/s
    for value in (system, orbit, settled):
        card = card_of(value)
        assert "902" in card
        assert "188.9" not in card
    assert "of order 2, harmonic4 of order 4, harmonic6 of order 6" in card_of(system)
    figure = draw(settled, figure=Figure(layout="constrained"))
    assert "speed = 902 rpm" in figure.get_suptitle()
    ax = draw(gw.analysis.spectrum(orbit, "shaft.torque"), ax=Figure(figsize=(6, 4)).add_subplot())
    assert ax.get_xlabel() == "order (per turn of disc)"
    assert {text.get_text() for text in ax.texts} >= {"2", "4"}


def test_orders_without_a_speed_are_multiples_of_the_frequency() -> None:
    system = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(1.0, {"x": 1.0}, 2)], frequency=0.8)
    orbit = gw.find_orbit(system)
    found = gw.analysis.spectrum(orbit, "x")
    exact = abs(1.0 / (1.0 - 1.6**2 + 0.16j))
    assert found.peaks(1)[0][:2] == ("2W", 2.0)
    assert [found.amplitude(2), orbit.measure("h2.x")] == pytest.approx([exact, exact], rel=1e-9)
    assert repr(orbit).startswith("Orbit(period 1 at frequency 0.8, ")


def test_names_of_lines() -> None:
    assert [line_name(order, (1, 2, 3), turns=2) for order in (0, 2, 1, 2 / 3)] == [
        "mean",
        "order 2",
        "order 1",
        "order 2/3",
    ]
    assert line_name(1.2345, (1,), turns=2) == "order 1.234"
    assert [line_name(order, (1, 3)) for order in (2, 5 / 3, 0.231)] == ["2W", "5W/3", "0.231W"]
