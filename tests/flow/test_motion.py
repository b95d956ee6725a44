"""Sampled motions: histories, forces, the contact log, and their refusals."""

import numpy as np
import pytest

from gapwalk.errors import ModelError
from gapwalk.flow import integrate
from tests.independent import acceleration, contact_force
from tests.independent import integrate as reference
from tests.systems import clutch, linear, viscous_stop

STATE = [1.5, 0.3, -0.4, 0.2]


@pytest.mark.slow
def test_samples_agree_with_an_independent_integrator():
    system = clutch()
    motion = integrate(system, STATE, periods=2, samples=32)
    assert motion.theta.shape == (65,)
    expected = reference(system, STATE, 2, max_step=0.005, t_eval=motion.time)
    assert np.hstack((motion.q, motion.v)) == pytest.approx(expected, abs=1e-8)


def test_accelerations_and_forces_obey_the_equations_of_motion():
    for system, state in ((clutch(), STATE), (viscous_stop(), [0.2, 0.5]), (linear(), STATE)):
        motion = integrate(system, state, samples=50)
        for k in range(0, 51, 7):
            assert motion.a[k] == pytest.approx(
                acceleration(system, motion.time[k], motion.q[k], motion.v[k]), abs=1e-12
            )
        for index, form in enumerate(system.structure.contacts):
            e = system.values[system.structure.block(f"{form.name}.deflection", system.size)]
            expected = [
                contact_force(form, system.parameters, q @ e, v @ e) for q, v in zip(motion.q, motion.v, strict=True)
            ]
            assert motion.forces[:, index] == pytest.approx(expected, abs=1e-12)


def test_contact_log_says_which_when_which_side_and_how_fast():
    system = clutch()
    motion = integrate(system, [1.5, 0.3, -1.4, 0.2], periods=1)
    assert motion.contacts
    for record in motion.contacts:
        assert record.contact == "stage2"
        at = integrate(system, [1.5, 0.3, -1.4, 0.2], periods=record.theta / (2 * np.pi), samples=64)
        assert at.q[-1, 0] == pytest.approx(record.side * 1.0, abs=1e-10)
        assert at.v[-1, 0] == pytest.approx(record.velocity, abs=1e-9)
        assert record.closes == (record.side * record.velocity > 0)
        assert record.time == pytest.approx(record.theta / 0.5)


def test_signals_by_name():
    motion = integrate(clutch(), STATE)
    assert motion.signal("q3") is not None
    assert motion.signal("q3'") == pytest.approx(motion.v[:, 1])
    assert motion.signal("q1''") == pytest.approx(motion.a[:, 0])
    assert motion.signal("stage2") == pytest.approx(motion.forces[:, 0])
    with pytest.raises(ModelError, match=r"no signal 'q2'; did you mean q1 or q3"):
        motion.signal("q2")


@pytest.mark.parametrize("state", [[1.0], [1, 2, 3, float("nan")], "zero", [[[1, 2, 3, 4]]], None])
def test_a_wrong_state_is_refused(state):
    with pytest.raises(ModelError, match="4 finite numbers"):
        integrate(clutch(), state)


@pytest.mark.parametrize(
    ("periods", "samples", "text"),
    [(-6.0, 400, "periods is -6.0"), (0, 8, "periods is 0"), (np.nan, 8, "periods is nan"), (2.0, 0, "samples is 0")],
)
def test_a_motion_is_followed_forwards(periods, samples, text):
    with pytest.raises(ModelError, match=text):
        integrate(linear(), np.zeros(2), periods, samples)
