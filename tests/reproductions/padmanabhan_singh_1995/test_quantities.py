"""What the figures of motions show besides: the third inertia, the loops of figure 1, peaks and lines."""

import math

import numpy as np
import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.damping import distance
from reproductions.padmanabhan_singh_1995.quantities import (
    IMPACT,
    LOOPS,
    VISCOUS,
    Range,
    counted,
    force_peaks,
    impact_words,
    lines,
    third_inertia,
)

CASES = ("8a", "4a", "10b")  # no damper in the clutch, whose numbers in the tables are not those of a damper


@pytest.fixture(scope="module")
def orbits():
    return {name: gw.find_orbit(gw.paper.case(name), frequency=0.9) for name in CASES}


@pytest.mark.parametrize("name", CASES)
def test_u3_is_that_of_three_inertias(name: str, orbits) -> None:
    """Inertias (I2 = 1) and one torque are made from the tables, and equations 1 to 3 give u1'' and u2''."""
    orbit = orbits[name]
    system, motion = orbit.system, orbit.motion(64)
    k12, c12, k22 = -system["stiffness.q1.q3"], -system["damping.q1.q3"], system["stiffness.q3.q3"]
    n1, n2 = system["stage2.force.q1"], -system["stage2.force.q3"]
    signal = third_inertia(system)
    k2_i3 = dict(signal.terms)["q3"]
    k2 = k22 - k2_i3
    r, i3 = k12 / k2, k2 / k2_i3
    ia = n2 / n1 * r
    i1 = ia / (1.0 - ia)
    assert i1 * system["mean.q1"] == pytest.approx(i3 * r * system["mean.q3"], rel=1e-12)  # one and the same torque
    clutch = ia * n1 * motion.signal("stage2")
    u1 = system["mean.q1"] + system["harmonic1.amplitude"] * np.cos(motion.theta) - clutch / i1
    u2 = clutch - k12 * motion.signal("q3") - c12 * motion.signal("q3'")
    u3 = r * (signal.of(motion) - system["mean.q3"])
    assert np.abs(u1 - u2 - motion.signal("q1''")).max() < 1e-12
    assert np.abs(u2 - u3 - r * motion.signal("q3''")).max() < 1e-12
    assert abs(orbit.measure("mean.q3") * k2_i3 - system["mean.q3"]) < 1e-10  # the train keeps its speed


def test_the_loops_of_figure_1_cost_the_same() -> None:
    """The loss of impact damping in closed form: beta times the integral of g v^2 over the time of contact."""
    theta = np.linspace(-math.pi / 3, math.pi / 3, 20_001)  # 2 cos(theta) > 1
    loss = np.trapezoid(0.5 * (2.0 * np.cos(theta) - 1.0) * (2.0 * np.sin(theta)) ** 2, theta)
    assert LOOPS[IMPACT].loss == pytest.approx(loss, rel=1e-7)
    assert LOOPS[VISCOUS].loss == pytest.approx(loss, rel=1e-7)


def test_peaks_and_lines_of_a_force() -> None:
    """Counted again in samples, and by a sum over samples."""
    orbit = gw.settle(gw.paper.case("8a"), at={"mean.q1": 0.05, "mean.q3": 0.05, "frequency": 0.35}).orbit
    assert orbit is not None
    force = orbit.motion(4096).signal("stage2")[:-1]
    higher = (force > np.roll(force, 1)) & (force >= np.roll(force, -1)) & (force > 1e-6)
    lower = (force < np.roll(force, 1)) & (force <= np.roll(force, -1)) & (force < -1e-6)
    assert force_peaks(orbit) == (higher.sum(), lower.sum()) == (2, 2)
    theta = 2.0 * np.pi * np.arange(4096) / 4096
    expected = [2.0 * abs(np.mean(force * np.exp(-1j * order * theta))) for order in range(1, 6)]
    assert lines(orbit, "stage2")[:5] == pytest.approx(expected, abs=1e-5)


def test_a_distance_is_that_of_the_logarithms() -> None:
    printed = gw.paper.case("5")
    changed = printed.at({"mean.q1": 0.25 * math.exp(0.3), "frequency": 0.17 * math.exp(-0.4)})
    assert distance(changed, printed) == pytest.approx(0.5)
    assert distance(printed, printed) == 0.0


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ("4+/1-", "4 and 1 impacts (+, − side)"),
        ("closed+", "contact never opens"),
        ("open", "open"),
    ],
)
def test_patterns_of_impacts_are_said_in_words(pattern: str, words: str) -> None:
    assert impact_words(pattern) == words


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.62, 0.85, "0.62–0.85"),
        (-0.30012, -0.28812, "−0.3001 to −0.2881"),
        (-0.3, 0.3, "−0.3–0.3"),
        (0.408201, 0.408234, "0.4082–0.40823"),  # never of no width
    ],
)
def test_ranges_in_words(low: float, high: float, words: str) -> None:
    assert str(Range(low, high)) == words


def test_numbers_with_their_nouns() -> None:
    assert [counted(n, "branch") for n in (0, 1, 2)] == ["0 branches", "1 branch", "2 branches"]
    assert counted(1, "fold") == "1 fold"
