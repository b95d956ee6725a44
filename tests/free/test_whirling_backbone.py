"""Backbones with gyroscopic terms: they begin at the modes, repeat, and keep their energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from tests.bifurcation.alike.kinds import rotor as rotor_machine
from tests.gyroscopic import eigenvalues, gyroscopic_system
from tests.tiers import keeps

STIFFNESS, DAMPING = np.diag([2.0, 3.0]), np.array([[0.02, 1.0], [-1.0, 0.02]])


def rotor(clearance: float = 2.0) -> gw.System:
    stop = gw.backlash("stop", {"x": 1.0}, clearance, 20.0)
    load = [gw.Harmonic(0.01, {"x": 1.0})]
    return gw.System(["x", "y"], STIFFNESS, DAMPING, contacts=[stop], harmonics=load, frequency=0.5)


@keeps("2")
@pytest.mark.parametrize("mode", [1, 2])
def test_it_begins_at_the_mode_and_repeats(mode: int) -> None:
    system = rotor()
    line = gw.free.backbone(system, mode, options=gw.free.BackboneOptions(largest_amplitude=3.0))
    assert line.values[0] == pytest.approx(eigenvalues(system)[mode - 1], rel=1e-11)
    assert line.points[-1].amplitude > 6.0
    assert line.points[-1].touches == 4
    assert line.values[-1] > line.values[0]
    for point in (line.points[0], line.points[-1]):  # by SciPy, without losses
        turning = 0.5 * (DAMPING - DAMPING.T)

        def change(_: float, state: np.ndarray, turning: np.ndarray = turning) -> np.ndarray:
            q, v = state[:2], state[2:]
            depth = np.sign(q[0]) * max(abs(q[0]) - 2.0, 0.0)
            return np.append(v, -STIFFNESS @ q - turning @ v - [20.0 * depth, 0.0])

        period = 2.0 * np.pi / point.value
        end = solve_ivp(change, (0.0, period), point.state, rtol=1e-10, atol=1e-11, max_step=0.01).y
        assert end[:, -1] == pytest.approx(point.state, abs=1e-5)
        assert 0.5 * np.ptp(end[:2], axis=1) == pytest.approx(point.half, abs=1e-3)
        q, v = np.split(point.state, 2)
        energy = 0.5 * v @ v + 0.5 * q @ STIFFNESS @ q + 10.0 * max(abs(q[0]) - 2.0, 0.0) ** 2
        assert point.energy == pytest.approx(energy, rel=1e-9)


def test_without_losses_keeps_what_loses_no_energy() -> None:
    free = gw.free.without_losses(rotor())
    assert free.matrix("damping").tolist() == [[0.0, 1.0], [-1.0, 0.0]]


def test_a_release_at_rest_is_refused() -> None:
    with pytest.raises(ModelError, match="does not come to rest again; write the number of a mode"):
        gw.free.backbone(rotor(), [1.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_rotors_drawn_at_random(seed: int) -> None:
    system = gyroscopic_system(np.random.default_rng(seed))
    line = gw.free.backbone(system, 2, options=gw.free.BackboneOptions(largest_amplitude=4.0))
    assert line.values[0] == pytest.approx(eigenvalues(system)[1], rel=1e-9)
    point = line.points[len(line.points) // 2]
    motion = line.motion(point)
    assert motion.q[-1] == pytest.approx(motion.q[0], abs=1e-9)


@pytest.mark.slow
def test_it_goes_on_beyond_a_touch_that_turns_it_sharply() -> None:
    """Where a mode is 28 times slower than another one, the first touch turns the branch by 1 rad within 1e-5."""
    system = rotor_machine(3).system
    walk = gw.WalkOptions(largest_step=0.02, max_points=45)
    line = gw.free.backbone(system, 1, options=gw.free.BackboneOptions(walk=walk))
    assert "max_points" in line.ends[1].reason_words
    assert line.points[-1].touches == 4
    assert line.values[-1] > line.values[0]
    motion = line.motion(line.points[-1])
    assert motion.q[-1] == pytest.approx(motion.q[0], abs=1e-9)
