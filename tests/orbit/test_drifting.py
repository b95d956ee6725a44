"""Motions that are periodic up to a translation: against closed forms and SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gapwalk as gw

MASS, DRAG, MEAN, FORCE, FREQUENCY = 2.0, 0.3, 0.15, 1.3, 0.8
RUB, PUSH = 0.3, 0.1


def sled() -> gw.System:
    """A mass that drag alone resists, under a mean load and a harmonic one."""
    return gw.System(
        ["x"],
        mass=[[MASS]],
        stiffness=[[0.0]],
        damping=[[DRAG]],
        mean={"x": MEAN},
        harmonics=[gw.Harmonic(FORCE, {"x": 1.0})],
        frequency=FREQUENCY,
    )


def rubbing() -> gw.System:
    """A mass on the ground with dry friction, under a mean load that alone would not move it."""
    return gw.System(
        ["x"],
        mass=[[1.0]],
        stiffness=[[0.0]],
        mean={"x": PUSH},
        contacts=[gw.friction("ground", {"x": 1.0}, RUB)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=1.0,
    )


def capsule(frequency: float = 0.9) -> gw.System:
    """A mass on a spring in a capsule that slides on the ground by dry friction, with an elastic wall inside."""
    return gw.System(
        ["capsule", "mass"],
        mass=[5.0, 1.0],
        stiffness=[[1.0, -1.0], [-1.0, 1.0]],
        damping=[[0.1, -0.1], [-0.1, 0.1]],
        contacts=[
            gw.friction("ground", {"capsule": 1.0}, 0.3),
            gw.stop("wall", {"mass": 1.0, "capsule": -1.0}, 0.3, 20.0),
        ],
        harmonics=[gw.Harmonic(1.0, {"mass": 1.0, "capsule": -1.0})],
        frequency=frequency,
    )


def pushed(speed: float) -> tuple[float, float]:
    """Return the speed of the rubbing mass after a period, and its progress, by SciPy from turn to turn."""

    def turn(_: float, y: np.ndarray) -> float:
        return y[1]

    setattr(turn, "terminal", True)  # noqa: B010 - as SciPy asks for it
    state, now, sign = np.array([0.0, speed]), 0.0, np.sign(speed)
    while now < 2.0 * np.pi:
        setattr(turn, "direction", -sign)  # noqa: B010
        found = solve_ivp(
            lambda t, y, sign=sign: [y[1], np.cos(t) + PUSH - RUB * sign],
            (now, 2.0 * np.pi),
            state,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            events=turn,
        )
        now, state = float(found.t[-1]), found.y[:, -1]
        sign = -sign if found.status == 1 else sign  # the load exceeds friction wherever it turns: it never sticks
    return float(state[1]), float(state[0])


def test_drag_under_a_mean_load_is_a_drift_in_closed_form() -> None:
    orbit = gw.find_orbit(sled())
    period = 2.0 * np.pi / FREQUENCY
    assert orbit.drift == pytest.approx([MEAN / DRAG * period], rel=1e-11)
    assert orbit.measure("drift.x") == pytest.approx(MEAN / DRAG * period, rel=1e-11)
    swing = FORCE / (-MASS * FREQUENCY**2 + 1j * DRAG * FREQUENCY)
    assert orbit.state == pytest.approx([0.0, MEAN / DRAG + (1j * FREQUENCY * swing).real], abs=1e-11)
    assert np.sort(np.abs(orbit.multipliers)) == pytest.approx([np.exp(-DRAG / MASS * period), 1.0])
    assert orbit.stable
    branch = gw.follow(orbit, "frequency", (0.5, 1.2))
    assert branch.ends[-1].reason_words == "the end of the range was reached"
    assert branch.measure("drift.x") == pytest.approx(MEAN / DRAG * 2.0 * np.pi / branch.values, rel=1e-10)


def test_dry_friction_lets_a_mass_progress_as_scipy_says() -> None:
    orbit = gw.find_orbit(rubbing())
    speed = float(brentq(lambda each: pushed(each)[0] - each, 0.01, 1.0, xtol=1e-13))
    assert orbit.state == pytest.approx([0.0, speed], abs=1e-9)
    assert orbit.drift == pytest.approx([pushed(speed)[1]], abs=1e-9)
    slope = (pushed(speed + 1e-5)[0] - pushed(speed - 1e-5)[0]) / 2e-5
    assert orbit.free_multipliers[0].real == pytest.approx(slope, abs=1e-7)


def test_a_capsule_settles_on_the_orbit_whose_progress_a_transient_has() -> None:
    system = capsule()
    orbit = gw.find_orbit(system)
    strobes = gw.integrate(system, np.zeros(4), periods=60, samples=1).q
    assert orbit.drift == pytest.approx(strobes[-1] - strobes[-2], abs=1e-9)
    settled = gw.settle(system, start=[7.0, 7.0, 0.0, 0.0])  # far from where the orbit's position is taken
    assert settled.orbit is not None
    assert settled.orbit.drift == pytest.approx(orbit.drift, abs=1e-9)
    assert gw.classify(system).label == "P1"


def test_a_capsule_is_followed_through_folds_and_sliding_and_doubles_its_period() -> None:
    branch = gw.follow(gw.find_orbit(capsule(1.0)), "frequency", (0.99, 1.06))
    assert [end.reason_words for end in branch.ends] == ["the end of the range was reached"] * 2
    assert not branch.unexplained
    first, second = branch.special("flip")
    doubled = gw.settle(capsule(0.5 * (first.value + second.value))).orbit
    assert doubled is not None
    assert doubled.period == 2
    strobes = gw.integrate(doubled.system, doubled.state, periods=4, samples=1).q
    assert strobes[4] - strobes[2] == pytest.approx(doubled.drift, abs=1e-8)
    assert abs((strobes[1] - strobes[0])[0] - (strobes[2] - strobes[1])[0]) > 1e-4
    assert any(point.measure("drift.capsule") > 0.02 for point in branch.points)


@pytest.mark.parametrize("system", [sled(), rubbing(), capsule()], ids=["sled", "rubbing", "capsule"])
def test_another_integrator_confirms_the_drift(system):
    found = gw.settle(system).orbit
    assert abs(found.drift[0]) > 1e-3
    assert gw.verify(gw.follow(found, "frequency", system["frequency"] * np.array([0.995, 1.005]))).ok
