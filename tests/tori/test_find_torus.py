"""Single tori, against closed forms and rotation numbers of long simulations."""

from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.tori.torus import Torus
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
def torus() -> Torus:
    """A torus of figure 13."""
    return gw.tori.find_torus(gw.settle(gw.paper.case("13"), frequency=0.672))


@pytest.mark.slow
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
    wall = gw.rigid_stop("wall", {"x": 1.0}, clearance=0.5, restitution=0.8)
    system = gw.System(["x"], [1.0], [0.1], [1.0], contacts=[wall], harmonics=[gw.Harmonic(1.0, {"x": 1.0})])
    with pytest.raises(ModelError, match="dry friction or rigid stops are not computed"):
        gw.tori.find_torus(gw.settle(system, frequency=1.3))


def test_free_motions_are_refused():
    """Without excitation there are no strobes; the motion of x loses its stability where y is no longer damped."""
    circle = gw.force("circle", {"x": 1.0}, "(x*x + v*v - 1)*v")
    system = gw.System(["x", "y"], [1.0, 1.0], [0.0, 0.1], [1.0, 2.0], contacts=[circle], frequency=1.3)
    with pytest.raises(ModelError, match=r"nothing excites this system.*gw.free.follow_self_excited"):
        gw.tori.find_torus(gw.settle(system, [1.0, 0.5, 0.0, 0.0]))
    motion = gw.free.find_self_excited(system, [1.0, 0.0, 0.0, 0.0])
    branch = gw.free.follow_self_excited(motion, system, "damping.y.y", -0.1)
    (point,) = branch.special(gw.Kind.NEIMARK_SACKER)
    assert point.value == pytest.approx(0.0, abs=1e-8)
    with pytest.raises(ModelError, match="Neimark-Sacker points are not computed"):
        gw.tori.follow_tori(point, "damping.y.y", (-0.1, 0.1))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"accuracy": 0.0}, "a number from 1e-13 to 0.01"),
        ({"samples": 4}, "from 9 to 4,097"),
        ({"samples": 99, "max_samples": 33}, "more than max_samples"),
    ],
)
def test_options_are_checked(changes, words):
    with pytest.raises(ModelError, match=words):
        gw.tori.TorusOptions(**changes)


@pytest.mark.parametrize("pace", [in_campaign(0.5), 0.8, in_campaign(1.0), in_campaign(1.2), in_campaign(1.5)])
def test_the_torus_demo_of_coco(pace):
    """``x' = -Om y + x g, y' = Om x + y g`` with ``g = 1 + r (cos om t - 1)``, whose torus has a known radius.

    These equations of first order, ``q' = f(q, t)``, are a manifold of the equations of second order
    ``q'' = df/dt - (q' - f) / 2``, to which all motions of the latter contract.
    """
    om = pace / 1.51111
    r = "((x*x + y*y)**0.5)"
    g = f"(1 + {r}*(c - 2))"  # c is 1 + cos(pace t)
    slope = f"((x*x' + y*y')/{r}*(c - 2) + {r}*pace*(s - 1))"  # dg/dt; s is 1 - sin(pace t)
    laws = {
        "x": f"om*y' - x'*{g} - x*{slope} + (x' + om*y - x*{g})/2",
        "y": f"-om*x' - y'*{g} - y*{slope} + (y' - om*x - y*{g})/2",
    }
    both, numbers = {"x": {"x": 1.0}, "y": {"y": 1.0}}, {"om": om, "pace": pace, "c": 1.0, "s": 1.0}
    forces = [gw.force(f"f{at}", both, law, acts_on={at: 1.0}, numbers=numbers) for at, law in laws.items()]
    waves = [
        gw.Harmonic(1.0, varies={"fx.c": 1.0, "fy.c": 1.0}, name="cosine"),
        gw.Harmonic(1.0, varies={"fx.s": 1.0, "fy.s": 1.0}, phase=np.pi / 2, name="sine"),
    ]
    demo = gw.System(["x", "y"], np.zeros((2, 2)), contacts=forces, harmonics=waves, frequency=pace)

    def radius(theta):
        return (1.0 + pace**2) / (1.0 + pace**2 - np.cos(theta) - pace * np.sin(theta))

    first = radius(0.0)
    torus = gw.tori.find_torus(gw.settle(demo, [0.9 * first, 0.0, 0.0, om * first]))
    turns = 1.0 / 1.51111
    assert min(abs(torus.rotation - turns), abs(1.0 - torus.rotation - turns)) < 1e-10
    thetas = np.linspace(0.0, 2.0 * np.pi, 17)
    surface = torus.surface(16)
    expected = np.repeat(radius(thetas)[:, None], surface.shape[1], axis=1)
    assert np.hypot(surface[:, :, 0], surface[:, :, 1]) == pytest.approx(expected, rel=1e-10)
    assert torus.error < 1e-10
    assert torus.exponents == pytest.approx(np.array([-0.5, -0.5, -1.0]) * 2.0 * np.pi / pace, abs=1e-6)
