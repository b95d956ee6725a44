"""Ends of quiet bands from the held flank: against closed forms, references, and the motions of the true system."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.answers.gap_states import GapState, gap_state
from gapwalk.answers.held_flank import JUMP, QuietLimits, quiet_limits
from gapwalk.errors import ConvergenceError, ModelError
from tests.tiers import in_campaign

FILE = Path(__file__).parents[1] / "data/train_a.toml"
STIFFNESS, CLEARANCE, MEAN, AMPLITUDE, DAMPING = 50.0, 0.5, 2.0, 0.6, 0.4


def pressed(mean: float = MEAN, amplitude: float = AMPLITUDE, beta: float = 0.0) -> gw.System:
    """A mass on a weak spring, pressed on one of two stops and shaken."""
    stop = gw.backlash("stop", {"x": 1.0}, CLEARANCE, STIFFNESS, impact_damping=beta)
    load = gw.Harmonic(amplitude, {"x": 1.0})
    return gw.System(
        ["x"], mass=[[1.0]], damping=[[DAMPING]], stiffness=[[1.0]], contacts=[stop], harmonics=[load], mean={"x": mean}
    )


def least(frequency: float, stiffness: float = STIFFNESS, amplitude: float = AMPLITUDE, mean: float = MEAN) -> float:
    """Return the least force of the held stop: the preload less the amplitude."""
    total = 1.0 + stiffness
    size = amplitude / abs(total - frequency**2 + 1j * DAMPING * frequency)
    return stiffness * ((mean + stiffness * CLEARANCE) / total - CLEARANCE - size)


def ends_in_closed_form(**more: float) -> list[float]:
    """Return the ends of the band in which the held stop would pull, around the resonance."""
    return [brentq(lambda w: least(w, **more), *pair, xtol=1e-13) for pair in ((3.0, 7.0), (7.3, 14.0))]


@pytest.mark.parametrize("mean", [MEAN, -MEAN])
def test_both_ends_of_a_resonance_are_those_of_the_closed_form(mean: float) -> None:
    found = quiet_limits(pressed(mean), "frequency", (3.0, 14.0))
    ((low, high),) = found.restless
    (limit,) = found.limits
    assert [low.value, high.value] == pytest.approx(ends_in_closed_form(), abs=1e-10)
    assert limit.exact == (low, high)
    assert limit.side == np.sign(mean)
    assert max(low.error, high.error) < 1e-7
    # the curve of the least force, to the residual of a walk
    np.testing.assert_allclose(limit.forces, [least(value) for value in found.values], atol=1e-6)
    assert not found.notes


def test_a_narrow_dip_between_two_steps_is_found() -> None:
    stop = pressed(amplitude=0.41 * MEAN / 5.0).at({"damping.x.x": 0.06})
    found = quiet_limits(stop, "frequency", (3.0, 14.0))
    ((low, high),) = found.restless
    assert low.value < np.sqrt(51.0) < high.value < low.value + 2.0


def test_gradients_of_an_end_are_those_of_the_closed_form() -> None:
    (limit,) = quiet_limits(pressed(), "frequency", (7.2, 14.0)).limits
    (end,) = limit.exact
    assert end.special is not None
    exact, movers = end.special.gradient(), end.with_movers().movers
    assert {mover.name: mover.slope for mover in movers} == {name: exact[name] for name in exact.names}
    for name, key in {"stop.stiffness": "stiffness", "harmonic1.amplitude": "amplitude", "mean.x": "mean"}.items():
        value, step = {"stiffness": STIFFNESS, "amplitude": AMPLITUDE, "mean": MEAN}[key], 1e-5
        one, other = (ends_in_closed_form(**{key: value * (1.0 + sign * step)})[1] for sign in (-1, 1))
        assert exact[name] == pytest.approx((other - one) / (2.0 * step * value), rel=1e-6)


@pytest.mark.parametrize("beta", [0.0, 0.3])
def test_the_true_system_is_quiet_above_the_end_and_rattles_below(beta: float) -> None:
    # by SciPy, from the equation itself: Hunt and Crossley's damping acts while the stop is touched
    found = quiet_limits(pressed(beta=beta), "frequency", (7.2, 14.0))
    ((_, end),) = found.restless
    assert end.special is not None
    state = end.special.orbit.state

    def opened(frequency: float) -> float:
        def rates(t: float, y: np.ndarray) -> list[float]:
            depth = abs(y[0]) - CLEARANCE
            force = np.sign(y[0]) * STIFFNESS * depth + beta * STIFFNESS * depth * y[1] if depth > 0.0 else 0.0
            return [y[1], MEAN + AMPLITUDE * np.cos(frequency * t) - DAMPING * y[1] - y[0] - force]

        span, dense = 2.0 * np.pi / frequency, np.linspace(0.0, 1.0, 400)
        run = solve_ivp(rates, (0.0, 12.0 * span), state, "DOP853", (11.0 + dense) * span, rtol=1e-10, atol=1e-13)
        return float(run.y[0].min() - CLEARANCE)

    assert opened(end.value * (1.0 + 1e-4)) > 0.0
    assert opened(end.value * (1.0 - 1e-4)) < 0.0


def test_damping_does_not_grow_with_the_depth_of_the_pull() -> None:
    # with beta g v where the spring pulls, the damping would be negative, and the held motion diverge
    found = quiet_limits(pressed(amplitude=40.0, beta=5.0), "frequency", (6.0, 9.0))
    assert [(low.kind, high.kind) for low, high in found.restless] == [("end of the range", "end of the range")]
    assert found.limits[0].forces.min() < -20.0


@cache
def train() -> QuietLimits:
    """The held response of train A around the end of its band."""
    return quiet_limits(gw.read_model(str(FILE)), "speed", (970.0, 1010.0))


def test_the_end_of_train_a_is_that_of_the_reference() -> None:
    found = train()
    (end,) = found.limits[0].exact
    assert 989.096 < end.value < 989.104
    assert found.restless == ((found.limits[0].lifts[0][0], end),)
    assert [limit.gap for limit in found.limits] == ["mesh1", "mesh2", "mesh3", "mesh5", "mesh4"]
    assert all(limit.side == 1 for limit in found.limits)
    assert not any(limit.lifts for limit in found.limits[1:])  # rattle of the others follows impacts of the first
    assert "clutch_friction never slips at speed = 989.0984 rpm" in found.notes[0]
    assert end.special is not None
    assert end.special.orbit.stable


@pytest.mark.slow
def test_gradients_of_train_a_are_differences_of_its_end() -> None:
    (end,) = train().limits[0].exact
    slopes = {mover.name: mover.slope for mover in end.with_movers().movers}
    system, name = gw.read_model(str(FILE)), "mesh1.ratio"
    moved = system.at({name: system[name] * (1.0 + 1e-4)})
    (there,) = quiet_limits(moved, "speed", (985.0, 995.0), "mesh1").limits[0].exact
    assert there.value - end.value == pytest.approx(slopes[name] * system[name] * 1e-4, rel=1e-3)


@pytest.mark.slow
def test_the_whole_range_of_train_a() -> None:
    found = quiet_limits(gw.read_model(str(FILE)), "speed", (700.0, 1500.0))
    ((begin, end),) = found.restless
    assert begin.kind == "end of the range"
    assert 989.096 < end.value < 989.104
    (lift,) = found.limits[1].lifts
    assert lift[1].value == pytest.approx(759.0, abs=1.0)  # the held teeth: the true mesh rattles up to 946
    assert not found.limits[1].exact


GEARS = """
title = "two loose gears"
speed = "900 rpm"
reaction = "flywheel"
mean = {{ one = "{one} N m", two = "{two} N m" }}
[[inertia]]
name = "flywheel"
inertia = "0.1 kg m^2"
[[inertia]]
name = "input"
inertia = "0.006 kg m^2"
[[inertia]]
name = "one"
inertia = "0.003 kg m^2"
[[inertia]]
name = "two"
inertia = "0.002 kg m^2"
[[shaft]]
name = "clutch"
between = ["flywheel", "input"]
stiffness = "120 N m/rad"
damping = "0.3 N m s/rad"
[[gear]]
name = "mesh1"
between = ["input", "one"]
ratio = 2.0
clearance = "0.001 rad"
stiffness = "20000 N m/rad"
impact_damping = "0.2 s/rad"
[[gear]]
name = "mesh2"
between = ["input", "two"]
ratio = 1.2
clearance = "0.001 rad"
stiffness = "20000 N m/rad"
impact_damping = "0.2 s/rad"
[[harmonic]]
name = "second"
order = 2
amplitude = "60 N m"
acts_on = {{ flywheel = 1.0 }}
"""


def gears(folder: Path, one: float, two: float) -> gw.System:
    """A small gearbox with the drags of two loose gears."""
    file = folder / "gears.toml"
    file.write_text(GEARS.format(one=one, two=two))
    return gw.read_model(str(file))


@pytest.mark.parametrize("signs", [(-1, 1), in_campaign((1, -1))])
def test_gears_are_held_on_the_flank_on_which_their_drag_presses(signs: tuple[int, int], tmp_path) -> None:
    system = gears(tmp_path, 0.4 * signs[0], 0.5 * signs[1])
    found = quiet_limits(system, "speed", (1800.0, 2500.0))
    assert [limit.side for limit in found.limits] == [-sign for sign in signs]
    assert all(limit.forces.min() > 0.0 for limit in found.limits)


@pytest.mark.slow
@pytest.mark.parametrize("signs", [(-1, -1), (-1, 1), (1, -1)])
def test_the_true_train_is_quiet_above_the_end_and_rattles_below(signs: tuple[int, int], tmp_path) -> None:
    system = gears(tmp_path, 0.4 * signs[0], 0.5 * signs[1])
    found = quiet_limits(system, "speed", (900.0, 2500.0))
    ((_, end),) = found.restless
    (first,) = [limit for limit in found.limits if end in limit.exact]
    assert end.special is not None
    state = end.special.orbit.state
    above = gw.find_orbit(system.at({"speed": end.value * (1.0 + 1e-5)}), start=state)
    assert [gap_state(above, limit.gap) for limit in found.limits] == [GapState.CLOSED] * 2
    assert above.stable
    below = gw.settle(system.at({"speed": end.value * (1.0 - 1e-4)}), state)
    assert gap_state(below.orbit or below.motion(64), first.gap).rattles


def test_a_gear_that_nothing_presses_floats(tmp_path) -> None:
    found = quiet_limits(gears(tmp_path, -0.4, 0.0), "speed", (1800.0, 2500.0))
    assert [limit.side for limit in found.limits] == [1, 0]
    assert not found.limits[1].lifts
    assert not found.limits[1].forces.any()
    assert found.notes == ("nothing presses mesh2 on a flank: only a simulation shows whether it rattles",)


def test_where_another_part_makes_the_held_motion_jump_the_curve_ends() -> None:
    # a stiffening spring bends the resonance over; the held stop belongs to the second mass
    bent = gw.System(
        ["x", "y"],
        mass=np.eye(2),
        damping=np.diag([0.1, 0.4]),
        stiffness=np.diag([1.0, 1.0]),
        contacts=[
            gw.Contact("hard", {"x": 1.0}, [gw.Stage(0.0, 1.0, 2.0)]),
            gw.backlash("stop", {"y": 1.0}, CLEARANCE, STIFFNESS),
        ],
        harmonics=[gw.Harmonic(0.8, {"x": 1.0, "y": 0.1})],
        mean={"y": MEAN},
    )
    rising = quiet_limits(bent, "frequency", (0.8, 5.0), "stop", rising=True)
    falling = quiet_limits(bent, "frequency", (0.8, 5.0), "stop")
    assert falling.within[0] > 0.8
    assert falling.within[1] == 5.0
    assert rising.within[0] == 0.8
    assert rising.within[1] > falling.within[0]  # both motions exist between
    assert "the motion jumps at" in falling.notes[0]
    assert JUMP == "jump"


def test_bad_input_is_refused_in_words() -> None:
    free = gw.System(["x"], mass=[[1.0]], damping=[[0.1]], stiffness=[[1.0]], harmonics=[gw.Harmonic(0.1, {"x": 1.0})])
    with pytest.raises(ModelError, match="no contact of the system has a gap"):
        quiet_limits(free, "frequency", (1.0, 2.0))
    with pytest.raises(ModelError, match="no contact of the system"):
        quiet_limits(pressed(), "frequency", (1.0, 2.0), "stpo")
    with pytest.raises(ModelError, match="has no width"):
        quiet_limits(pressed(), "frequency", (2.0, 2.0))
    with pytest.raises(ModelError, match="speeed"):
        quiet_limits(pressed(), "speeed", (1.0, 2.0))
    rigid = gw.System(
        ["x"],
        mass=[[1.0]],
        damping=[[0.1]],
        stiffness=[[1.0]],
        contacts=[gw.rigid_stop("wall", {"x": 1.0}, 0.5, 0.6)],
        harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
    )
    with pytest.raises(ModelError, match="wall is a rigid stop, which no spring can hold closed"):
        quiet_limits(rigid, "frequency", (1.0, 2.0))
    with pytest.raises(ModelError, match="does not press stop on the same flank over the whole range"):
        quiet_limits(pressed(), "mean.x", (-2.0, 2.0))
    driven = gw.System(
        ["x"],
        mass=[[1.0]],
        damping=[[0.1]],
        stiffness=[[0.0]],
        contacts=[gw.stop("stop", {"x": 1.0}, 0.5, 20.0, side="positive")],
        harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
        mean={"x": -1.0},
    )
    with pytest.raises(ConvergenceError, match="no static equilibrium"):
        quiet_limits(driven, "frequency", (1.0, 2.0))
