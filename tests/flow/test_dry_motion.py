"""Forces and accelerations along motions with friction and rigid stops satisfy the equations of motion."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.motion import Motion, modes_at, sample, signal_names
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import friction
from tests.flow.dry_systems import SYSTEMS, beginning

THETA = np.linspace(0.0, 20.0, 1501)


def imbalance(motion):
    """Return the largest residual of the equations of motion, written from the named values of the system."""
    system, values = motion.system, motion.system.parameters
    mass, damping, stiffness = (system.matrix(each) for each in ("mass", "damping", "stiffness"))
    left = motion.a @ mass.T + motion.v @ damping.T + motion.q @ stiffness.T
    for place, form in enumerate(system.structure.contacts):
        left += np.outer(motion.forces[:, place], system.vector(form.push))
    right = np.zeros_like(left) + system.vector("mean")
    for each in system.structure.harmonics:
        wave = values[f"{each.name}.amplitude"] * np.cos(each.order * motion.theta + values[f"{each.name}.phase"])
        right += np.outer(wave, system.vector(each.shape))
    return np.abs(left - right).max()


@pytest.mark.parametrize("name", SYSTEMS)
def test_forces_satisfy_the_equations_of_motion(name):
    motion = sample(SYSTEMS[name], beginning(SYSTEMS[name]), THETA)
    assert imbalance(motion) < 1e-12


@pytest.mark.parametrize("name", SYSTEMS)
def test_acceleration_is_the_slope_of_the_velocity(name):
    system = SYSTEMS[name]
    fine = np.linspace(0.0, 20.0, 20001)
    motion = sample(system, beginning(system), fine)
    slope = (motion.v[2:] - motion.v[:-2]) / (motion.time[2:] - motion.time[:-2])[:, None]
    apart = np.abs(slope - motion.a[1:-1]).max(axis=1)
    # a jump of the acceleration spoils the two differences beside it
    events = {e.theta for e in (*motion.slips, *motion.events, *motion.holds)}
    smooth = np.ones(len(apart), dtype=bool)
    for theta in events:
        smooth &= np.abs(fine[1:-1] - theta) > 2.1 * fine[1]
    assert smooth.sum() > 10000
    assert apart[smooth].max() < 2e-5


@pytest.mark.parametrize("name", SYSTEMS)
def test_modes_and_forces_belong_together(name):
    system = SYSTEMS[name]
    motion = sample(system, beginning(system), THETA)
    for place, contact in enumerate(c for c, form in enumerate(system.structure.contacts) if form.law.is_dry):
        form = system.structure.contacts[contact]
        slip, force = motion.slip[:, place], motion.forces[:, contact]
        rate = motion.v @ system.vector(form.vectors[0]) - system[f"{form.name}.speed"]
        if form.law.by == "limit":
            assert (slip * rate).min() > -1e-12
            limit = system[f"{form.name}.limit"]
            breakaway = limit * (1.0 if form.law.has_memory else system[f"{form.name}.static"])
            assert np.abs(force[slip != 0] - limit * slip[slip != 0]).max(initial=0.0) < 1e-12
            assert np.abs(force).max() <= breakaway * (1.0 + 1e-11)
        if not form.law.has_memory:
            assert np.abs(rate[slip == 0]).max(initial=0.0) < 1e-12
    for number, (contact, switch) in enumerate(system.structure.reactions):
        held = motion.modes.held[:, number]
        if switch >= 0 and held.any():
            side = system.structure.breakpoints[switch].side
            assert (side * motion.forces[held, contact]).min() > -1e-12
            clearance = system[f"{system.structure.contacts[contact].name}.clearance"]
            assert np.abs(motion.deflections[held, contact] - side * clearance).max() < 1e-11


@pytest.mark.parametrize("name", SYSTEMS)
def test_modes_of_single_states_are_those_of_the_log(name):
    system = SYSTEMS[name]
    motion = sample(system, beginning(system), THETA)
    few = np.arange(3, len(THETA), 37)
    alone = Motion.of(system, motion.theta[few], motion.states[few])
    assert np.array_equal(alone.slip, motion.slip[few])
    assert np.abs(alone.forces - motion.forces[few]).max() < 1e-9
    assert np.abs(alone.a - motion.a[few]).max() < 1e-9


def test_a_stop_that_holds_carries_the_load():
    system = SYSTEMS["chatter"]
    motion = sample(system, beginning(system), THETA)
    held = motion.modes.held[:, 0]
    assert 0.1 < held.mean() < 0.9
    expected = np.cos(motion.theta) - 0.2 * motion.q[:, 0] - 0.1 * motion.v[:, 0]
    assert np.abs(motion.forces[held, 0] - expected[held]).max() < 1e-12
    assert np.abs(motion.forces[~held, 0]).max() == 0.0


def test_signals_of_friction_have_names():
    system = SYSTEMS["iwan"]
    motion = sample(system, beginning(system), THETA)
    names = signal_names(system)
    assert [name for name in names if name.endswith((".slip", ".extension"))] == [
        "f.extension",
        "g.extension",
        "f.slip",
        "g.slip",
        "h.slip",
    ]
    assert np.array_equal(motion.signal("h.slip"), motion.slip[:, 2])
    assert np.abs(motion.signal("g.force") - system["g.stiffness"] * motion.signal("g.extension")).max() < 1e-14
    assert set(motion.signal("f.slip")) == {-1.0, 0.0, 1.0}
    with pytest.raises(ModelError, match="no signal"):
        motion.signal("h.extension")


@pytest.mark.parametrize("name", ["stick", "iwan", "two rigid", "chatter", "normal spring"])
def test_slopes_of_signals_equal_differences(name):
    system = SYSTEMS[name]
    motion = sample(system, beginning(system), THETA[:400])
    along = np.cos(np.arange(len(motion.theta) * system.state_size)).reshape(len(motion.theta), -1)
    step = 1e-6
    for signal in [f"{system.coordinates[-1]}''", *(f"{form.name}.force" for form in system.structure.contacts)]:
        wanted = gw.measure.Signal(((signal, 1.0),)).slope(motion, along)
        sides = []
        for sign in (1.0, -1.0):
            moved = motion.states + sign * step * along
            other = Motion.of(system, motion.theta, moved, motion.events, motion.slips, motion.holds)
            sides.append(other.signal(signal))
        assert np.abs((sides[0] - sides[1]) / (2.0 * step) - wanted).max() < 1e-8


def test_modes_of_no_states():
    system = SYSTEMS["iwan"]
    modes = modes_at(layout_of(system.structure), coefficients_of(system), np.zeros(0), np.zeros((0, 6)))
    assert modes.slips.shape == (0, 3)
    assert modes.held.shape == (0, 1)


def den_hartog(r, f):
    """Return the amplitude over the static deflection (Den Hartog 1931): the motion does not stick."""
    response = 1.0 / abs(1.0 - r**2)
    turn = math.sin(math.pi / r) / (r * (1.0 + math.cos(math.pi / r)))
    return math.sqrt(response**2 - (f * turn) ** 2)


@pytest.mark.parametrize(("r", "amplitude"), [(0.8, 2.626104875724), (1.2, 2.072384268013)])
def test_extremes_where_friction_turns(r, amplitude):
    system = gw.System(
        ("x",),
        [[1.0]],
        contacts=[friction("f", {"x": 1.0}, 0.3)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=r,
    )
    orbit = gw.find_orbit(system)
    high, low, mean, _ = orbit.extremes[0]
    assert high == pytest.approx(amplitude, abs=1e-11)
    assert low == pytest.approx(-amplitude, abs=1e-11)
    assert abs(mean) < 1e-11
    assert orbit.measure("half.x") == pytest.approx(amplitude, abs=1e-11)
    assert amplitude == pytest.approx(den_hartog(r, 0.3), abs=1e-11)
    thetas, values = orbit.turns[0]
    assert len(thetas) == 2
    assert np.abs(np.abs(values) - amplitude).max() < 1e-11


@pytest.mark.parametrize("name", SYSTEMS)
def test_extremes_are_those_of_dense_samples(name):
    system = SYSTEMS[name]
    settled = sample(system, beginning(system), np.array([0.0, 40 * math.tau])).states[-1]
    orbit = gw.find_orbit(system, start=settled)
    motion = orbit.motion(20000)
    bound = 3e-4 if motion.impacts else 1e-6  # the samples miss the corner of an impact
    assert np.abs(orbit.extremes[:, 0] - motion.q.max(axis=0)).max() < bound
    assert np.abs(orbit.extremes[:, 1] - motion.q.min(axis=0)).max() < bound
    assert np.all(orbit.extremes[:, 0] >= motion.q.max(axis=0) - 1e-12)
    assert np.all(orbit.extremes[:, 1] <= motion.q.min(axis=0) + 1e-12)
    for contact, (thetas, values) in enumerate(orbit.turns):
        deflection = motion.deflections[:, contact]
        if np.ptp(deflection) > 1e-9:
            assert max(values) == pytest.approx(deflection.max(), abs=bound)
            assert min(values) == pytest.approx(deflection.min(), abs=bound)
        assert len(thetas) <= 16 + 2 * len(motion.impacts)  # none of rounding, while friction sticks
