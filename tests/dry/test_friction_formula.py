"""Friction whose limit is a formula: of the slip rate, on a belt, and of the load."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw


def oscillator(friction: object, **more: object) -> gw.System:
    return gw.System(["x"], mass=[[1.0]], stiffness=[[1.0]], contacts=[friction], **more)  # type: ignore[list-item]


@pytest.mark.parametrize(("amplitude", "largest"), [(1.2, 1.96630022243), (2.0, 2.0767806884189)])
def test_falling_friction_is_as_by_an_integrator_from_event_to_event(amplitude: float, largest: float) -> None:
    dry = gw.friction("dry", {"x": 1.0}, "Fs/(1+d*abs(v))", numbers={"Fs": 1.0, "d": 1.0})
    loads = [gw.Harmonic(amplitude, {"x": 1.0})]
    orbit = gw.settle(oscillator(dry, damping=[[0.05]], harmonics=loads, frequency=0.5)).orbit
    assert orbit.measure("max.x") == pytest.approx(largest, abs=1e-9)  # DOP853 with events
    assert gw.verify(orbit).ok


def test_the_speed_of_the_belt_is_one_number() -> None:
    belt = gw.friction("belt", {"x": 1.0}, "1/(1+d*abs(v))", numbers={"d": 3.0}, speed=0.2)
    system = oscillator(belt)
    assert [name for name in system.structure.names if name.endswith("speed")] == ["belt.speed"]
    found = gw.free.find_self_excited(system, start=[0.0, 0.1])
    assert found.duration == pytest.approx(12.00103129483, abs=1e-9)  # DOP853 with events
    assert found.measure("max.x") == pytest.approx(1.13394467644, abs=1e-9)
    faster = gw.free.find_self_excited(system.at({"belt.speed": 0.3}), start=[0.0, 0.1])
    assert faster.duration == pytest.approx(period_on_belt(0.3), rel=1e-8)


def test_a_file_has_the_formula_in_one_line(tmp_path) -> None:
    path, lines = tmp_path / "belt.toml", 'limit = "1/(1+d*abs(v))"\nnumbers = { d = 3.0 }\nspeed = 0.2\n'
    head = 'coordinates = ["x"]\nmass = [[1.0]]\nstiffness = [[1.0]]\n\n[[friction]]\nname = "belt"\n'
    text = f"{head}deflection = {{ x = 1.0 }}\n{lines}"
    path.write_text(text)
    found = gw.free.find_self_excited(gw.read_model(path), start=[0.0, 0.1])
    assert found.duration == pytest.approx(12.00103129483, abs=1e-9)  # DOP853 with events
    for wrong, words in (('"1/(1+d"', "never closed"), ("0.3", "limit is no formula"), ("-1.0", "must be >= 0")):
        path.write_text(text.replace('"1/(1+d*abs(v))"', wrong))
        with pytest.raises(gw.errors.ModelError, match=words):
            gw.read_model(path)


def period_on_belt(speed: float) -> float:
    """The duration of stick and slip at a speed of the belt: it sticks until the spring pulls with 1."""

    def slip(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -y[0] + 1.0 / (1.0 + 3.0 * (speed - y[1]))]

    def again(t: float, y: np.ndarray) -> float:
        return y[1] - speed + 1e-9 * (t < 1e-3) - 1e-13

    again.terminal, again.direction = True, 1  # type: ignore[attr-defined]
    found = solve_ivp(slip, (0.0, 50.0), [1.0, speed * (1 - 1e-12)], "DOP853", events=again, rtol=1e-13, atol=1e-14)
    return float(found.t[-1] + (1.0 - found.y[0, -1]) / speed)


def test_the_load_grows_with_the_deflection() -> None:
    pad = gw.friction("pad", {"x": 1.0}, "mu*(n0 + k*x)", numbers={"mu": 0.2, "n0": 1.0, "k": 0.5})
    motion = gw.integrate(oscillator(pad), np.array([1.5, 0.0]), 0.3, samples=2000)
    # while it slips backwards x'' = -x + mu (n0 + k x): a harmonic motion about another place
    root, middle = np.sqrt(1.0 - 0.1), 0.2 / 0.9
    np.testing.assert_allclose(motion.q[:, 0], middle + (1.5 - middle) * np.cos(root * motion.time), atol=1e-12)


@pytest.mark.parametrize(
    ("limit", "numbers", "start", "where"),
    [
        ("mu*(n0 + k*x)", {"mu": 0.2, "n0": 1.0, "k": 0.5}, [3.0, 0.0], -2.0),  # the load at the way back
        ("1 - 0.5*abs(v)", {}, [4.0, 0.0], None),  # at the largest speed, between two changes of direction
    ],
)
def test_a_limit_that_becomes_negative_is_refused(
    limit: str, numbers: dict[str, float], start: list[float], where: float | None
) -> None:
    system = oscillator(gw.friction("pad", {"x": 1.0}, limit, numbers=numbers))
    with pytest.raises(gw.errors.FlowError, match=r"limit of friction 'pad', .*, becomes negative at x = ") as error:
        gw.integrate(system, np.array(start), 1.0)
    found = dict(re.findall(r"\b([xv]) = (-?[\d.]+)", str(error.value)))
    assert float(found["x" if where else "v"]) == pytest.approx(where or -2.0, abs=1e-3)
    assert '"max(..., 0)"' in str(error.value)
    allowed = oscillator(gw.friction("pad", {"x": 1.0}, f"max({limit}, 0)", numbers=numbers))
    motion = gw.integrate(allowed, np.array(start), 1.0)
    energy = (motion.states**2).sum(axis=1)
    assert (np.diff(energy) <= 1e-12).all()  # friction only takes energy
    with pytest.raises(gw.errors.FlowError, match="becomes negative"):
        gw.integrate(system, np.array([-4.0, 3.0]), 0.1)  # where the motion begins


def test_a_formula_that_acts_on_the_system_may_pull() -> None:
    load = gw.force("load", {"x": 1.0}, "k*x", numbers={"k": 1.0})
    with pytest.raises(gw.errors.ModelError, match="may pull"):
        gw.System(["x"], [[1.0]], contacts=[load, gw.friction("dry", {"x": 1.0}, coefficient=0.3, normal="load")])


def test_impacts_in_periods_are_a_label() -> None:
    stop = gw.rigid_stop("stop", {"x": 1.0}, 0.0, restitution=0.8, side="positive")
    load = [gw.Harmonic(1.0, {"x": 1.0})]
    orbit = gw.settle(oscillator(stop, damping=[[0.2]], harmonics=load, frequency=2.7)).orbit
    assert orbit.period == 2  # it has doubled its period at 2.6639 (Shaw and Holmes 1983)
    assert orbit.z == f"{sum(event.enters for event in orbit.events)}/2"
