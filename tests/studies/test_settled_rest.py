"""A part that rests on a rigid stop for ever is said to rest there and not to rattle, pressed on it or not."""

import io

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.gap_states import GapState, gap_state
from gapwalk.explorer.workspace_folder import verdict


def two_parts(
    load: float, *, side: str = "positive", clearance: float = 0.5, scale: float = 1.0, forced: str = "x"
) -> gw.System:
    """A forced oscillator x beside a part y, which nothing but a constant load and damping act on, at a rigid stop."""
    sign = 1.0 if side == "positive" else -1.0
    return gw.System(
        ["x", "y"],
        [[1.0, 0.0], [0.0, 0.0]],
        [[0.2, 0.0], [0.0, 0.3]],
        contacts=[gw.rigid_stop("teeth", {"y": 1.0}, clearance * scale, restitution=0.0, side=side)],
        mean={"y": sign * load * scale},
        harmonics=[gw.Harmonic(0.3 * scale, {forced: 1.0})],
        frequency=1.3,
    )


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("side", ["positive", "negative"])
@pytest.mark.parametrize(("load", "clearance"), [(1.0, 0.5), (0.0, 0.5), (0.0, 0.0)])
def test_a_part_at_its_stop_rests_with_and_without_a_force(load, clearance, side, scale) -> None:
    """A plastic impact leaves a part at its stop, where no force need press it."""
    system, sign = two_parts(load, side=side, clearance=clearance, scale=scale), 1.0 if side == "positive" else -1.0
    settled = gw.settle(system, start=[0.0, 0.5 * sign * clearance * scale, 0.0, sign * clearance * scale])
    orbit = settled.orbit
    assert orbit is not None
    assert orbit.state[1] == pytest.approx(sign * clearance * scale, abs=1e-12 * scale)
    assert orbit.rests(0)
    assert orbit.pattern == f"held{'+' if sign > 0 else '-'}"
    assert gap_state(orbit, "teeth") is GapState.CLOSED
    assert f"rests on teeth {'+' if sign > 0 else '-'} all the time" in verdict(settled)
    amplitude = 0.3 * scale / np.hypot(1.0 - 1.3**2, 0.2 * 1.3)  # of x, which the stop does not disturb
    assert np.abs(orbit.state[0]) <= amplitude * (1 + 1e-9)


def test_a_part_that_leaves_its_stop_and_comes_back_rattles() -> None:
    orbit = gw.settle(two_parts(0.2, forced="y")).orbit
    assert orbit is not None
    assert not orbit.rests(0)
    assert gap_state(orbit, "teeth") is GapState.ONE_SIDE


def test_the_study_says_it() -> None:
    text = (
        'coordinates = ["x", "y"]\nstiffness = [[1.0, 0.0], [0.0, 0.0]]\ndamping = [[0.2, 0.0], [0.0, 0.3]]\n'
        "frequency = 1.3\nmean = { y = 1.0 }\n"
        '[[contact]]\nname = "teeth"\nlaw = "rigid"\ndeflection = { y = 1.0 }\nclearance = 0.5\nrestitution = 0.5\n'
        'side = "positive"\n[[harmonic]]\namplitude = 0.3\nacts_on = { x = 1.0 }\n'
        '[study]\nkind = "settle"\nsignal = "x"\n'
    )
    result = gw.run(gw.read_study(io.StringIO(text)))
    assert "  rests on teeth + all the time" in list(result.finding.summary())
    assert result.finding.document(points=False)["rests"] == ["rests on teeth + all the time"]
