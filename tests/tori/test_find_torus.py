"""Single tori, against closed forms and rotation numbers of long simulations."""

from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from tests.tiers import in_campaign
from tests.tori.closed_forms import one_circle

# (case, W, m, rotation number): weighted averages over 2,000 strobes of long simulations, then Newton's method of a
# trial in plain NumPy with the same flow (it agreed to all digits with N = 33 and 65)
TORI = [
    ("15", 1.12, 2, 0.11223165401302),
    in_campaign("15", 1.165, 2, 0.15950017588650),
    in_campaign("15", 0.855, 3, 1.0 - 0.68703550850244),
    in_campaign("13", 0.672, 2, 0.31612600556372),
]


@pytest.fixture(scope="module")
def torus() -> gw.tori.Torus:
    """A torus of figure 13."""
    return gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))


@pytest.mark.parametrize(("name", "frequency", "curves", "rotation"), TORI)
def test_tori_of_the_paper(name, frequency, curves, rotation):
    torus = gw.tori.find_torus(gw.settle(gw.paper.case(name), frequency=frequency))
    assert torus.curves == curves
    assert torus.rotation == pytest.approx(rotation, abs=1e-10)
    assert torus.error < 1e-9
    assert torus.stable
    assert gw.verify(torus).ok


def test_a_circle_in_closed_form():
    system = one_circle()
    torus = gw.tori.find_torus(gw.settle(system, [0.3, 0.2, 0.1, 0.0]))
    turns = 1.0 / system.frequency % 1.0
    assert min(abs(torus.rotation - turns), abs(1.0 - torus.rotation - turns)) < 1e-11
    assert torus.states[:, 0] ** 2 + torus.states[:, 2] ** 2 == pytest.approx(np.ones(torus.count), abs=1e-11)
    # x contracts to the circle with the mean rate 1, y decays with half its damping
    period = 2.0 * np.pi / system.frequency
    assert torus.exponents == pytest.approx(np.array([-0.1, -0.1, -1.0]) * period, abs=1e-8)
    assert torus.measure("max.x") == pytest.approx(1.0, abs=1e-2)
    assert gw.verify(torus).ok


def test_strobes_follow_the_motion(torus):
    motion = gw.analysis.strobe(torus.system, torus.state(0.0), 40)
    assert torus.strobes(40) == pytest.approx(motion.states, abs=1e-7)


def test_a_changed_torus_does_not_pass(torus):
    assert torus.rotation == pytest.approx(0.31612600556372, abs=1e-10)
    assert not gw.verify(replace(torus, states=1.0001 * torus.states)).ok
    assert not gw.verify(replace(torus, rotation=torus.rotation + 1e-6)).ok
    assert not gw.verify(replace(torus, exponents=torus.exponents + 1e-3)).ok


def test_motions_without_a_torus_are_refused():
    with pytest.raises(ConvergenceError, match=r"periodic \(period 1\).*gw.tori.follow_tori"):
        gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=1.5))
    brake = gw.friction("brake", {"x": 1.0}, 0.3)
    system = gw.System(["x"], [1.0], [0.1], [1.0], contacts=[brake], harmonics=[gw.Harmonic(1.0, {"x": 1.0})])
    with pytest.raises(ModelError, match="dry friction or rigid stops are not computed"):
        gw.tori.find_torus(gw.settle(system, frequency=1.3))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"accuracy": 0.0}, "between 1e-13 and 1e-2"),
        ({"samples": 4}, "from 9 to 4097"),
        ({"samples": 99, "max_samples": 33}, "more than max_samples"),
    ],
)
def test_options_are_checked(changes, words):
    with pytest.raises(ModelError, match=words):
        gw.tori.TorusOptions(**changes)
