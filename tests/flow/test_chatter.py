"""Impacts that follow each other ever faster, summed at once, against those followed one by one and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.impacts import Impacts, Stop, sum_chatter
from gapwalk.model.coefficients import coefficients_of
from gapwalk.orbit.shooting import Shooting


def pressed(restitution: float, side: int, unit: float) -> gw.System:
    """Two masses, of which loads press one on its stop, with a soft contact of the other."""
    stop = gw.rigid_stop("teeth", {"x": 1.0}, 0.5 * unit, restitution, side="positive" if side > 0 else "negative")
    soft = gw.Contact("soft", {"y": 1.0}, [gw.Stage(0.2 * unit, 2.0)])
    return gw.System(
        ["x", "y"], [[0.5, -0.4], [-0.4, 0.9]], 0.3 * np.eye(2), mass=np.diag([1.0, 0.7]), contacts=[stop, soft],
        mean={"x": side * unit, "y": 0.1 * side * unit},
        harmonics=[gw.Harmonic(0.5 * unit, {"x": 1.0}), gw.Harmonic(0.1 * unit, {"y": 1.0}, 3)], frequency=0.9,
    )  # fmt: skip


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9, 0.99])
def test_a_ball_comes_to_rest_where_the_geometric_series_ends(restitution: float) -> None:
    gravity, speed = 3.0, 0.2 * (1.0 - restitution)
    stop = Stop(
        np.ones(1), np.ones(1), 1, restitution, lambda theta: (0.0, 0.0), lambda theta, q, v: gravity + 0.0 * q, 1.0
    )
    found = sum_chatter(stop, np.array(2.0), np.ones(1), np.array([-speed]))
    assert found is not None
    lasts = 2.0 * speed / gravity / (1.0 - restitution)
    rounding = 1e-14 + np.finfo(float).eps / (1.0 - restitution)  # which the series amplifies; processors differ
    theta, state, integrals = found.after(stop)
    assert float(theta) == pytest.approx(2.0 + lasts, abs=rounding)
    assert state == pytest.approx([1.0, 0.0], abs=1e-15)
    times, rates = found.impacts(restitution, 1e-6)
    left = lasts * restitution ** np.arange(1.0, len(times) + 1.0)
    assert times == pytest.approx(2.0 + lasts - left, abs=rounding)
    assert rates == pytest.approx(speed * restitution ** np.arange(len(times)), abs=1e-14)
    heights = gravity * (2.0 * speed / gravity) ** 3 / 12.0 / (1.0 - restitution**3)  # areas of all flights
    assert float(integrals[0]) == pytest.approx(lasts - heights, abs=1e-13)


def test_a_chatter_under_varying_loads_is_that_of_another_integrator() -> None:
    """Flights by DOP853 until the rest of them takes 1e-7 rad, in the distance from the stop."""

    def pull(theta, x, v):
        return 3.0 - 0.5 * x - 0.6 * v + 0.4 * np.cos(theta)

    restitution, theta, v = 0.5, 2.0, -0.06
    stop = Stop(
        np.ones(1), np.ones(1), 1, restitution, lambda angle: (0.0, 0.0),
        lambda angle, q, v: pull(angle[..., None], q, v), 1.0,
    )  # fmt: skip
    found = sum_chatter(stop, np.array(theta), np.ones(1), np.array([v]))
    while (flight := -2.0 * v / pull(theta, 1.0, v)) > 1e-7:

        def lands(t, y):
            return y[0]

        lands.terminal, lands.direction = True, 1.0
        flown = solve_ivp(
            lambda t, y: [y[1], pull(t, 1.0 + y[0], y[1])], (theta, theta + 2.0 * flight), [0.0, v], "DOP853",
            events=lands, rtol=1e-13, atol=1e-20, max_step=flight / 5.0, first_step=flight / 50.0,
        )  # fmt: skip
        theta, v = float(flown.t[-1]), -restitution * float(flown.y[1, -1])
    assert found is not None
    assert float(found.after(stop)[0]) == pytest.approx(theta + flight / (1.0 - restitution), abs=1e-13)


@pytest.mark.parametrize(("restitution", "side", "unit"), [(0.9, 1, 1.0), (0.6, -1, 1e9)])
@pytest.mark.parametrize("parameter", ["teeth.restitution", "harmonic1.amplitude"])
def test_a_summed_chatter_is_the_one_that_is_followed(
    restitution: float, side: int, unit: float, parameter: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, state = pressed(restitution, side, unit), unit * np.array([0.1, 0.0, 0.2 * side, 0.1])
    coefficients, direction = Shooting().pose(system, parameter).coefficients(system[parameter])
    flow, surveyor = flow_of(system, parameter, transition=True), flow_of(system, survey=True)

    def found():
        arc = flow.integrate(coefficients, state, 0.0, 2.0 * PERIOD, direction)
        return arc, surveyor.survey(coefficients, state, PERIOD * np.arange(3.0))[0]

    summed, means = found()
    begin = Impacts.begin
    monkeypatch.setattr(Impacts, "begin", lambda self, _, watched, unit: begin(self, np.zeros(0), watched, unit))
    followed, expected = found()
    assert summed.steps < 0.7 * followed.steps  # an impact that is followed begins a step
    assert summed.state == pytest.approx(followed.state, abs=1e-13 * unit)
    assert summed.transition == pytest.approx(followed.transition, abs=1e-11)
    size = np.abs(followed.sensitivity).max()
    assert summed.sensitivity == pytest.approx(followed.sensitivity, abs=1e-11 * size)
    assert means == pytest.approx(expected, rel=1e-12)
    angles = np.array([event.theta for event in summed.contacts])
    lost = [event for event in followed.contacts if np.abs(angles - event.theta).min() > 1e-10]
    assert len(lost) <= 2  # of the last ones, that take 1e-6 rad together
    assert abs(len(summed.contacts) - len(followed.contacts)) <= 2


@pytest.mark.parametrize(("restitution", "side", "unit"), [(0.9, 1, 1.0), (0.95, -1, 1e9)])
@pytest.mark.parametrize("parameter", ["teeth.restitution", "harmonic1.amplitude"])
def test_a_chatter_is_summed_up_to_a_place_among_its_impacts(
    restitution: float, side: int, unit: float, parameter: str
) -> None:
    """Where a period ends among the impacts of a chatter, those before it are summed, with their derivatives."""
    system, state = pressed(restitution, side, unit), unit * np.array([0.1, 0.0, 0.2 * side, 0.1])
    coefficients, direction = Shooting().pose(system, parameter).coefficients(system[parameter])
    flow = flow_of(system, parameter, transition=True)
    whole = flow.integrate(coefficients, state, 0.0, 3.0 * PERIOD, direction, sums=False)
    angles = [each.theta for each in whole.impacts]
    gaps = np.diff(angles)
    (first, *_) = np.flatnonzero((gaps < 4e-4) & (gaps > 1e-4))  # impacts follow each other at 1e-4 rad
    stop = 0.5 * (angles[first] + angles[first + 1])
    summed, followed = (flow.integrate(coefficients, state, 0.0, stop, direction, sums=each) for each in (True, False))
    assert summed.steps < 0.8 * followed.steps
    assert summed.state == pytest.approx(followed.state, abs=1e-13 * unit)
    assert summed.transition == pytest.approx(followed.transition, abs=1e-11)
    size = np.abs(followed.sensitivity).max()
    assert summed.sensitivity == pytest.approx(followed.sensitivity, abs=1e-11 * size)
    assert [(each.switch, each.enters) for each in summed.contacts] == [
        (each.switch, each.enters) for each in followed.contacts
    ]
    found, expected = ([(each.theta, each.velocity / unit) for each in arc.contacts] for arc in (summed, followed))
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-11)


def test_a_chatter_too_long_for_its_nodes_is_given_up_soon() -> None:
    """A pull that swings 30 times faster than the chatter lasts is no polynomial of the nodes."""
    asked = list[int]()

    def turning(theta, q, v):
        asked.append(1)
        return 3.0 + np.cos(30.0 * theta)[..., None] + 0.0 * q

    stop = Stop(np.ones(1), np.ones(1), 1, 0.9, lambda theta: (0.0, 0.0), turning, 1.0)
    assert sum_chatter(stop, np.array(2.0), np.ones(1), np.array([-0.05])) is None
    assert len(asked) <= 6  # without a look at the nodes all 30 repetitions, or the 20 in which it settles


def teeth(amplitude: float) -> gw.System:
    """Rigid teeth that a mean load presses together, and a harmonic load lifts off."""
    stop = gw.rigid_stop("teeth", {"x": 1.0}, 0.5, 0.9)
    return gw.System(["x"], [[0.0]], [[0.6]], contacts=[stop], mean={"x": 0.4},
                     harmonics=[gw.Harmonic(amplitude, {"x": 1.0}, name="load")], frequency=1.0)  # fmt: skip


def test_the_work_at_an_impact_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    system = teeth(0.5)
    flow, asked, resets = flow_of(system, "load.amplitude", transition=True), list[int](), list[int]()
    coefficients, direction = Shooting().pose(system, "load.amplitude").coefficients(0.5)
    integrator = flow._take()
    dry, read, reset = integrator._switchboard.dry, integrator._switchboard.dry._read, Impacts._reset
    monkeypatch.setattr(dry, "_read", lambda given: (asked.append(1), read(given))[1])
    monkeypatch.setattr(Impacts, "_reset", lambda self, *given: (resets.append(1), reset(self, *given))[1])
    arc = integrator.integrate(coefficients, np.array([0.0, 0.0]), 0.0, 4.0 * PERIOD, direction)
    assert len(arc.impacts) > 20
    assert len(asked) <= 2.2 * len(arc.impacts) + 10  # before and after each of them; 6 before values were kept
    assert len(resets) <= 2.2 * len(arc.impacts)  # itself, and all its derivatives at once; 4 before


def test_motions_without_rigid_stops_begin_no_sums(monkeypatch: pytest.MonkeyPatch) -> None:
    soft = gw.Contact("soft", {"x": 1.0}, [gw.Stage(0.2, 2.0)])
    system = gw.System(
        ["x"], [[1.0]], [[0.1]], contacts=[soft], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=1.0
    )
    flow, surveyor = flow_of(system), flow_of(system, survey=True)
    for each in (flow, surveyor):
        each._lend(lambda integrator: None)
    begun = list[int]()
    monkeypatch.setattr(Impacts, "begin", lambda *given: begun.append(1))
    state, coefficients = np.array([0.1, 0.0]), coefficients_of(system)
    assert flow.integrate(coefficients, state).contacts
    surveyor.survey(coefficients, state, PERIOD * np.arange(2.0))
    assert not begun


def test_a_sampled_motion_has_all_impacts_after_a_walk_has_summed_them() -> None:
    system, state = pressed(0.9, 1, 1.0), np.array([0.1, 0.0, 0.2, 0.1])
    coefficients = coefficients_of(system)
    flow = flow_of(system)
    arc = flow.integrate(coefficients, state, 0.0, 2.0 * PERIOD)
    sampled = flow.sample(coefficients, state, np.linspace(0.0, 2.0 * PERIOD, 5000))
    assert len(sampled.impacts) > len(arc.impacts)
    assert sampled.states[-1] == pytest.approx(arc.state, abs=1e-13)
    assert sampled.states[:, 0].max() <= 0.5 + 1e-14
