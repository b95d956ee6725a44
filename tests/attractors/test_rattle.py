"""Impacts, forces, energy and impulsiveness: closed forms, energy balances, SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import gapwalk as gw
from gapwalk.attractors import rattle, settle
from gapwalk.attractors.rattle import impacts, quadrature
from gapwalk.errors import ModelError
from gapwalk.flow.motion import sample
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from tests.flow.dry_systems import SYSTEMS, beginning
from tests.model.drivetrain.trains import by_hand, physical
from tests.systems import clutch, linear, viscous_stop


def ball(law: str, coefficient: float, mass: float = 2.0) -> System:
    """A free mass that meets a wall of stiffness 50 at x = 0.3."""
    damping = {"impact_damping": coefficient} if law == "hunt-crossley" else {"viscous_damping": coefficient}
    wall = Contact("wall", {"x": 1.0}, (Stage(0.3, 50.0, side=Side.POSITIVE),), None, law, **damping)
    return System(("x",), [[0.0]], mass=[[mass]], contacts=[wall], frequency=1.0)


@pytest.mark.parametrize(("law", "coefficient"), [("hunt-crossley", 0.4), ("viscous", 1.5)])
@pytest.mark.parametrize("speed", [0.7, 2.0])
def test_an_impact_costs_the_kinetic_energy_that_is_lost(law, coefficient, speed):
    system = ball(law, coefficient)
    along = quadrature(system, np.array([0.0, speed]), 1)
    (impact,) = impacts(system, along)
    out = along.motion.v[-1, 0]
    assert impact.velocity == pytest.approx(speed, abs=1e-12)
    assert (impact.contact, impact.side) == ("wall", 1)
    assert out < 0
    # what the spring still holds when the stop opens is nothing: it opens at its breakpoint
    assert impact.loss == pytest.approx(0.5 * 2.0 * (speed**2 - out**2), rel=1e-11)


def test_peak_force_and_duration_agree_with_scipy():
    system = ball("hunt-crossley", 0.4)
    (impact,) = impacts(system, quadrature(system, np.array([0.0, 2.0]), 1))

    def force(y):
        return 50 * y[0] + 0.4 * 50 * np.abs(y[0]) * y[1]

    def opens(t, y):
        return y[0] + (t < 1e-3)

    opens.terminal = True
    found = solve_ivp(
        lambda t, y: [y[1], -force(y) / 2],
        (0, 2),
        [0, 2.0],
        "DOP853",
        events=opens,
        rtol=1e-12,
        atol=1e-13,
        max_step=1e-3,
    )
    assert impact.duration == pytest.approx(found.t_events[0][0], rel=1e-9)
    assert impact.theta == pytest.approx(0.15)
    assert impact.peak == pytest.approx(force(found.y).max(), rel=1e-6)


def test_the_energy_that_goes_in_comes_out():
    # viscous stop of one mass: excitation power = structural damping + damping of the contact
    orbit = gw.find_orbit(viscous_stop())
    along = quadrature(orbit.system, orbit.state, orbit.period)
    v, theta = along.motion.v[:, 0], along.motion.theta
    fed = along.weights @ (0.6 * np.cos(theta) * v)
    damped = 0.08 * along.weights @ v**2
    found = rattle(orbit)
    span = 2 * np.pi * orbit.period / orbit.system.frequency
    assert found.contacts[0].power * span == pytest.approx(fed - damped, rel=1e-10)
    assert sum(impact.loss for impact in found.impacts) == pytest.approx(fed - damped, rel=1e-10)


@pytest.mark.parametrize("frequency", [0.45, 0.82])
def test_impacts_of_an_orbit_are_all_counted_once(frequency):
    orbit = settle(gw.paper.case("15"), frequency=frequency).orbit
    assert orbit is not None
    found = rattle(orbit)
    assert found.periods == 3
    for row, count in zip(found.sides, orbit.closings, strict=True):
        assert row.impacts * 3 == count
    closing = sorted(event.theta for event in orbit.events if event.enters)
    assert [impact.theta for impact in found.impacts] == pytest.approx(closing, abs=1e-9)
    load = found.contacts[0]
    assert load.rms == pytest.approx(orbit.measure("rms.stage2"), rel=1e-6)
    assert load.peak == pytest.approx(max(orbit.measure("max.stage2"), -orbit.measure("min.stage2")), rel=1e-5)
    loss = sum(impact.loss for impact in found.impacts)
    assert load.power == pytest.approx(loss / (6 * np.pi / frequency), rel=1e-9)
    assert found.coordinates[0].rms == pytest.approx(orbit.measure("rms.q1''"), rel=1e-6)


def test_a_harmonic_motion_is_not_impulsive():
    system = System(("x",), [[1.0]], [[0.1]], harmonics=[Harmonic(1.0, {"x": 1.0})], frequency=0.7)
    found = rattle(gw.find_orbit(system))
    (x,) = found.coordinates
    assert x.crest == pytest.approx(np.sqrt(2), abs=1e-7)
    assert x.kurtosis == pytest.approx(1.5, abs=1e-9)
    assert x.rms == pytest.approx(abs(0.49 / (1 - 0.49 + 0.07j)) / np.sqrt(2), abs=1e-10)
    assert found.index == x.kurtosis
    assert found.sides == found.contacts == found.impacts == ()


def test_kurtosis_agrees_with_quadrature_by_scipy():
    orbit = gw.find_orbit(linear())
    found = rattle(orbit).coordinates[0]
    lines = gw.analysis.spectrum(orbit, "a''").values

    def acceleration(theta):
        return (lines[1] * np.exp(1j * theta) + lines[3] * np.exp(3j * theta)).real

    second, fourth = (quad(lambda t, p=p: acceleration(t) ** p, 0, 2 * np.pi)[0] / (2 * np.pi) for p in (2, 4))
    assert found.kurtosis == pytest.approx(fourth / second**2, rel=1e-8)
    thetas = np.linspace(0, 2 * np.pi, 20_001)
    assert found.peak == pytest.approx(np.abs(acceleration(thetas)).max(), rel=1e-7)


def test_a_motion_that_never_opens_has_no_impacts():
    orbit = gw.find_orbit(clutch(frequency=0.17))
    assert orbit.pattern == "closed+"
    found = rattle(orbit)
    assert [row.impacts for row in found.sides] == [0.0, 0.0]
    assert found.contacts[0].closed == 1.0
    assert found.contacts[0].power > 0


def test_a_chaotic_motion_and_the_table():
    settled = settle(gw.paper.case("15"), frequency=0.4)
    found = rattle(settled, 64)
    assert found.periods == 64
    assert found.index > 3.0  # more impulsive than noise
    assert 0.5 < found.sides[0].impacts < 2.0
    assert found.sides[0].fastest > found.sides[0].velocity > 0
    assert found.sides[0].costliest > found.sides[0].loss > 0
    lines = repr(found).splitlines()
    head = ["impacts", "a", "period", "velocity", "fastest", "peak", "force", "impulse", "loss", "costliest"]
    assert lines[0].split() == head
    assert lines[1].startswith("stage2 +1")
    assert len({len(line) for line in lines[:3]}) == 1  # columns in line
    assert f"{found.coordinates[0].kurtosis:.4g}" in lines[-2]
    with pytest.raises(ModelError, match="periods is 0"):
        rattle(settled, 0)


def test_a_drive_train_with_units_rattles_in_joules_and_degrees() -> None:
    """Its numbers are those of the train in SI units."""
    found = gw.analysis.rattle(gw.find_orbit(physical("900 rpm").system()))
    same = gw.analysis.rattle(gw.find_orbit(by_hand(900.0).system()))
    for first, second in zip(found.sides + found.contacts, same.sides + same.contacts, strict=True):
        for name in ("velocity", "fastest", "peak", "loss", "costliest", "rms", "power"):
            if hasattr(first, name):
                unit = math.radians(1.0) if name in ("velocity", "fastest") else 1.0  # deg/s, as in states
                found_here = unit * getattr(first, name)
                assert found_here == pytest.approx(getattr(second, name), rel=1e-8, abs=1e-12), name
    for first, second in zip(found.coordinates, same.coordinates, strict=True):
        assert (first.rms, first.peak) == pytest.approx((second.rms, second.peak), rel=1e-8)
    assert found.sides[0].loss > 0.0
    assert "peak force [N m]" in repr(found)
    assert "velocity [deg/s]" in repr(found)
    assert "[" not in repr(same)


@pytest.mark.parametrize("name", ["impact", "chatter", "stick", "jenkins", "belt", "stages"])
def test_powers_are_those_of_the_energy(name):
    system = SYSTEMS[name]
    state = sample(system, beginning(system), np.array([0.0, 60 * math.tau])).states[-1]
    orbit = gw.find_orbit(system, start=state)
    found, book = gw.analysis.rattle(orbit), gw.analysis.energy(orbit)
    for contact in found.contacts:
        powers = [each.power for each in book.losses if each.element == contact.contact]
        assert contact.power == pytest.approx(sum(powers), rel=1e-10)


def test_impacts_on_a_rigid_stop_are_counted():
    orbit = gw.find_orbit(SYSTEMS["impact"])
    found = gw.analysis.rattle(orbit)
    struck = [event.velocity for event in orbit.events if event.enters]
    assert [impact.velocity for impact in found.impacts] == pytest.approx(struck, rel=1e-12)
    losses = [0.5 * (1.0 - 0.8**2) * velocity**2 for velocity in struck]
    assert [impact.loss for impact in found.impacts] == pytest.approx(losses, rel=1e-10)
    assert all(math.isnan(impact.peak) and impact.duration == 0.0 for impact in found.impacts)
    assert [impact.impulse for impact in found.impacts] == pytest.approx([1.8 * each for each in struck], rel=1e-10)
    figures = [each for row in (*found.contacts, *found.coordinates) for each in (row.peak, row.rms)]
    assert math.isnan(found.index)
    assert all(math.isnan(each) for each in figures)  # an impulse has neither a peak nor a mean square
    assert "inf" not in repr(found)


def test_the_impulses_of_a_stop_balance_the_momentum_of_a_period():
    system = viscous_stop(2.0).at({"mean.x": 0.3})
    orbit = gw.find_orbit(system)
    (side,) = (each for each in gw.analysis.rattle(orbit).sides if each.impacts)
    period = 2.0 * math.pi * orbit.period / system.frequency
    given = (0.3 - system["stiffness.x.x"] * orbit.measure("mean.x")) * period
    assert side.impulse * side.impacts * orbit.period == pytest.approx(given, rel=1e-9)
