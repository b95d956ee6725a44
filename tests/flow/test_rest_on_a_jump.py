"""Rest on a breakpoint at which a force jumps: both sides push towards it, and a motion cannot be followed there."""

import numpy as np
import pytest

import gapwalk as gw

LOAD = gw.Harmonic(0.1, {"x": 1.0})


def mass(mean: float, *stages: gw.Stage) -> gw.System:
    contact = gw.Contact("p", {"x": 1.0}, stages, law="piecewise")
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=[contact], mean={"x": mean}, harmonics=[LOAD], frequency=0.7)


def preloaded(mean: float, side: str = "positive") -> gw.System:
    return mass(mean, gw.Stage(1.0, 2.0, side=side, numbers={"preload": 1.0}))


@pytest.mark.parametrize(("mean", "side", "sign"), [(1.5, "positive", 1.0), (-1.5, "negative", -1.0)])
def test_a_motion_that_comes_to_rest_on_a_jump_is_refused_with_the_place(mean, side, sign):
    system = preloaded(mean, side)
    words = rf"comes to rest on the breakpoint {sign:g} of p, where the force jumps and both sides push towards it"
    with pytest.raises(gw.errors.FlowError, match=rf"at theta = 0 the motion {words}"):
        gw.integrate(system, np.array([sign, 0.0]))
    with pytest.raises(gw.errors.FlowError, match=words):  # it bounces on the jump ever faster
        gw.integrate(system, np.array([0.9 * sign, 0.0]), periods=50)


def test_a_motion_at_rest_on_a_jump_goes_on_if_one_side_pushes_it_away():
    for mean, sign in ((0.8, -1.0), (2.3, 1.0)):  # less than the spring holds; more than the spring and the preload
        motion = gw.integrate(preloaded(mean), np.array([1.0, 0.0]), periods=0.1)
        assert (motion.q[1:, 0] - 1.0 > 0.0).all() if sign > 0.0 else (motion.q[1:, 0] < 1.0).all()


def test_a_jump_of_a_width_as_the_message_advises_holds_the_motion_within_it():
    width = 1e-3
    soft = gw.Stage(1.0, 2.0 + 1.0 / width, side="positive", name="begin")
    orbit = gw.find_orbit(mass(1.5, soft, gw.Stage(1.0 + width, -1.0 / width, side="positive", name="end")))
    assert orbit.stable
    largest, smallest, *_ = orbit.extremes[0]
    assert 1.0 < smallest < largest < 1.0 + width
    # the spring in the width balances the loads of 1.5 - 1 and of 0.1, as its period is far shorter than theirs
    assert (largest - 1.0) * (2.0 + 1.0 / width) == pytest.approx(0.6, rel=2e-2)
