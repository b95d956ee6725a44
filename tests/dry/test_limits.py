"""Limits: a Jenkins element of great stiffness is Coulomb friction, and a stiff damped stop is a rigid one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.model.contact import Contact, Side, Stage, friction

STIFFNESSES = (1e3, 1e4, 1e5, 1e6)


def orders(errors: list[float]) -> np.ndarray:
    """Return the order of convergence in 1/k between each two neighbouring stiffnesses, ten times apart."""
    return -np.diff(np.log10(errors))


def braked(frequency: float, **more: float) -> gw.System:
    """A mass on a spring with Coulomb friction, or with a spring in series to it."""
    brake = friction("brake", {"x": 1.0}, 0.6, **more)
    load = gw.Harmonic(1.0, {"x": 1.0})
    return gw.System(["x"], [[1.0]], [[0.05]], contacts=[brake], harmonics=[load], frequency=frequency)


def softened(frequency: float) -> tuple[gw.Orbit, list[float]]:
    """Return the motion with Coulomb friction, and how far those with stiff Jenkins elements are from its amplitude."""
    rigid = gw.find_orbit(braked(frequency))
    soft = [gw.find_orbit(braked(frequency, stiffness=stiffness)) for stiffness in STIFFNESSES]
    return rigid, [abs(each.extremes[0, 0] - rigid.extremes[0, 0]) for each in soft]


def test_a_stiffer_jenkins_element_is_nearer_to_coulomb_friction_by_half_an_order_where_that_slips_back_at_once():
    """After the rate a t the force turns round over the distance a t^2 / 2 = 2 limit / k: t goes as k^(-1/2)."""
    rigid, errors = softened(0.8)
    assert [event.slip for event in rigid.slips] == [1, -1, 1]
    assert orders(errors) == pytest.approx(0.5 * np.ones(3), abs=0.01)


def test_a_stiffer_jenkins_element_is_nearer_to_coulomb_friction_by_one_order_where_that_sticks():
    """In stick the element swings about a place that is as far away as limit / k."""
    rigid, errors = softened(0.4)
    assert [event.slip for event in rigid.slips] == [1, 0, -1, 0, 1]
    assert np.all(errors * np.array(STIFFNESSES) < 2.0)
    assert np.all(orders(errors) > 0.95)


def struck(wall: Contact) -> gw.System:
    """COCO's impact oscillator, with a wall at 1 (elements.md: the rate after the impact is -1.3565863500759)."""
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=[wall], harmonics=[gw.Harmonic(1.0, {"x": 1.0})], frequency=1.0)


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a spring and dashpot from which a free mass leaves with this share of its rate.

    It leaves after half a period of their free vibration: restitution = exp(-pi z / sqrt(1 - z^2)).
    """
    log = math.log(restitution)
    return -log / math.hypot(math.pi, log)


def test_a_stiffer_stop_with_the_damping_of_a_restitution_is_nearer_to_a_rigid_one_by_half_an_order():
    """The contact lasts pi sqrt(m / k)."""
    restitution = 0.8
    stages = [Stage(1.0, side=Side.POSITIVE)]
    rigid = gw.find_orbit(struck(Contact("wall", {"x": 1.0}, stages, law="rigid", restitution=restitution)))
    (impact,) = rigid.events
    assert restitution * impact.velocity == pytest.approx(1.3565863500759, rel=1e-10)
    errors = []
    for stiffness in STIFFNESSES:
        damping = 2.0 * damping_ratio(restitution) * math.sqrt(stiffness)
        stages = [Stage(1.0, stiffness, side=Side.POSITIVE)]
        wall = Contact("wall", {"x": 1.0}, stages, law="viscous", viscous_damping=damping)
        soft = gw.find_orbit(struck(wall), start=rigid.state)
        assert soft.closings == (1,)
        errors.append(abs(soft.extremes[0, 1] - rigid.extremes[0, 1]))
    assert orders(errors) == pytest.approx(0.5 * np.ones(3), abs=0.03)
    assert errors[-1] < 2e-3
