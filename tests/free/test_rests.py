"""Equilibria along a parameter against closed forms: folds, Hopf points, and corners where contacts change."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.free.equilibrium_walk import BORDER, CROSSING, Rests


def kinds(rests: Rests) -> list[str]:
    return [event.kind for event in rests.events]


def test_a_buckled_beam_has_the_folds_of_its_cubic():
    """``x^3 - x = F`` turns where ``3 x^2 = 1``: at ``F = -+2 / (3 sqrt 3)``."""
    beam = gw.force("beam", {"x": 1.0}, "x*x*x - p*x", p=1.0)
    rests = gw.free.follow_rest(gw.System(["x"], [0.0], [0.1], contacts=[beam]), "mean.x", (-3.0, 3.0), start=[1.0])
    assert kinds(rests) == ["fold", "fold"]
    found = np.sort([event.value for event in rests.events])
    assert found == pytest.approx(np.array([-2.0, 2.0]) / np.sqrt(27.0), abs=1e-12)
    assert [(event.before, event.after) for event in rests.events] == [(0, 1), (1, 0)]
    x = rests.coordinate("x")
    assert x**3 - x == pytest.approx(rests.values, abs=1e-11)
    assert all(point.stable == (3.0 * place**2 > 1.0) for point, place in zip(rests.points, x, strict=True))


def test_other_equilibria_cross_where_the_beam_buckles():
    beam = gw.force("beam", {"x": 1.0}, "x*x*x - p*x", p=-1.0)
    rests = gw.free.follow_rest(gw.System(["x"], [0.0], [0.1], contacts=[beam]), "beam.p", 1.0)
    (event,) = rests.events
    assert event.kind == CROSSING.name
    assert event.value == pytest.approx(0.0, abs=1e-9)
    assert event.after == 1


def test_a_contact_closes_and_the_slope_changes():
    """Pressed against a stop: ``x = F`` up to 1, then ``x + 3 (x - 1) = F``."""
    stop = gw.stop("stop", {"x": 1.0}, 1.0, 3.0)
    rests = gw.free.follow_rest(gw.System(["x"], [1.0], [0.1], contacts=[stop]), "mean.x", 4.0)
    (event,) = rests.events
    assert (event.kind, event.contact, event.closes, event.turns) == (BORDER, "stop+", True, False)
    assert event.value == pytest.approx(1.0, abs=1e-13)
    f = rests.values
    assert rests.coordinate("x") == pytest.approx(np.where(f < 1.0, f, (f + 3.0) / 4.0), abs=1e-12)
    after = rests.points[-1]
    assert np.sort(after.eigenvalues.imag) == pytest.approx([-np.sqrt(4.0 - 0.05**2), np.sqrt(4.0 - 0.05**2)])
    assert (rests.points[0].pattern, after.pattern) == ("open", "closed+")
    assert gw.verify(rests).ok


def test_equilibria_turn_back_where_a_contact_opens():
    """A negative stiffness within a gap: ``-x = F`` inside, ``2 x -+ 3 = F`` outside. It snaps through at F = -+1."""
    gap = gw.backlash("gap", {"x": 1.0}, clearance=1.0, stiffness=3.0)
    rests = gw.free.follow_rest(gw.System(["x"], [-1.0], [0.1], contacts=[gap]), "mean.x", (-2.0, 2.0), start=[0.0])
    assert sorted(event.value for event in rests.events) == pytest.approx([-1.0, 1.0], abs=1e-13)
    assert all(event.turns and event.kind == BORDER for event in rests.events)
    assert {event.before + event.after for event in rests.events} == {1}
    assert [event.closes for event in rests.events] == [False, True]  # in the direction of the walk
    assert "turn back" in str(rests.summary())
    assert sorted([rests.values[0], rests.values[-1]]) == [-2.0, 2.0]


@pytest.mark.parametrize("to", [1.0, -1.0])
def test_it_begins_where_a_contact_without_clearance_just_touches(to):
    stop = gw.stop("stop", {"x": 1.0}, 0.0, 30.0)
    rests = gw.free.follow_rest(gw.System(["x"], [1.0], [0.1], contacts=[stop]), "mean.x", to)
    assert rests.coordinate("x") == pytest.approx(rests.values / (31.0 if to > 0.0 else 1.0), abs=1e-13)
    assert rests.values[-1] == to


def test_the_clearance_itself_is_followed():
    """Pressed by 2 against a stop at c: ``x + 3 (x - c) = 2`` up to c = 2, where it lets go."""
    stop = gw.stop("stop", {"x": 1.0}, 1.0, 3.0)
    system = gw.System(["x"], [1.0], [0.1], contacts=[stop], mean={"x": 2.0})
    rests = gw.free.follow_rest(system, "stop.clearance", 4.0)
    (event,) = rests.events
    assert (event.value, event.closes) == (pytest.approx(2.0, abs=1e-12), False)
    c = rests.values
    assert rests.coordinate("x") == pytest.approx(np.where(c < 2.0, (2.0 + 3.0 * c) / 4.0, 2.0), abs=1e-12)


def test_two_contacts_close_one_after_the_other():
    """Two masses in a row: each contact adds its stiffness once it is closed, against a solver of each piece."""
    stops = [gw.stop("one", {"a": 1.0}, 0.5, 4.0), gw.stop("two", {"b": 1.0}, 0.4, 9.0)]
    stiffness = np.array([[2.0, -1.0], [-1.0, 1.5]])
    rests = gw.free.follow_rest(gw.System(["a", "b"], stiffness, np.eye(2) * 0.1, contacts=stops), "mean.a", 5.0)
    assert [event.contact for event in rests.events] == ["one+", "two+"]
    for point in rests.points:
        x = point.position
        depths = np.maximum(x - [0.5, 0.4], 0.0)
        assert stiffness @ x + [4.0, 9.0] * depths == pytest.approx([point.value, 0.0], abs=1e-11)


def test_whirl_begins_where_the_eigenvalues_say():
    """A rotor in a bearing with cross-coupling k1, k2: it is unstable from ``k1 k2 = c^2 k`` on, at ``sqrt k``."""
    c, k, k2 = 0.1, 1.44, 0.2
    rotor = gw.System(["x", "y"], [[k, 0.0], [-k2, k]], [[c, 0.0], [0.0, c]])
    rests = gw.free.follow_rest(rotor, "stiffness.x.y", 0.2)
    (hopf,) = rests.hopf_points
    assert hopf.value == pytest.approx(c**2 * k / k2, abs=1e-12)
    assert hopf.frequency == pytest.approx(np.sqrt(k), abs=1e-12)
    assert (hopf.before, hopf.after) == (0, 2)
    for point in rests.points[::10]:
        matrix = np.array([[k, point.value], [-k2, k]])
        whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-matrix, -c * np.eye(2)]])
        assert sorted(point.eigenvalues.real) == pytest.approx(sorted(np.linalg.eigvals(whole).real), abs=1e-12)


def test_flutter_begins_where_a_contact_closes():
    """A contact whose force acts along another vector couples two modes: motions grow from the corner on."""
    stop = gw.stop("seal", {"a": 1.0, "b": 1.0}, 0.5, 0.5, force={"a": 1.0, "b": -1.0})
    system = gw.System(["a", "b"], [[1.0, 0.0], [0.0, 1.1]], [[0.02, 0.0], [0.0, 0.02]], contacts=[stop])
    found = gw.free.self_excited(system, "mean.a", 1.0)
    (event,) = found.rests[0].events
    assert (event.kind, event.before, event.after) == (BORDER, 0, 2)
    assert event.value == pytest.approx(0.5, abs=1e-12)
    assert "small motions grow" in found.notes[0]
    assert not found.cycles


def test_a_belt_with_coulomb_friction():
    """Friction that slips at rest is a constant force: ``k x = limit``; a base at rest is refused."""
    belt = gw.friction("belt", {"x": 1.0}, 0.4, speed=1.0)
    system = gw.System(["x"], [2.0], [0.3], contacts=[belt])
    rests = gw.free.follow_rest(system, "belt.limit", 1.0)
    assert rests.coordinate("x") == pytest.approx(rests.values / 2.0, abs=1e-13)
    with pytest.raises(ModelError, match=r"Give the base a speed \(belt\.speed\)"):
        gw.free.follow_rest(system.at({"belt.speed": 0.0}), "belt.limit", 1.0)
    with pytest.raises(ModelError, match="continuum"):
        gw.free.follow_rest(system, "belt.speed", 0.0)


def test_what_has_no_equilibria_is_refused():
    wall = gw.System(["x"], [1.0], [0.1], contacts=[gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8)])
    with pytest.raises(ModelError, match="replace it by a stiff one"):
        gw.free.follow_rest(wall, "mean.x", 1.0)
    plain = gw.System(["x"], [1.0], [0.1], harmonics=[gw.Harmonic(0.1, {"x": 1.0})])
    with pytest.raises(ModelError, match="belongs to the excitation"):
        gw.free.follow_rest(plain, "frequency", 2.0)
    with pytest.raises(ModelError, match="write 1 positions"):
        gw.free.follow_rest(plain, "mean.x", 2.0, start=[0.0, 1.0])
    lost = gw.force("away", {"x": 1.0}, "1 + x*x")
    with pytest.raises(ConvergenceError, match="equilibrium"):
        gw.free.follow_rest(gw.System(["x"], [0.0], [0.1], contacts=[lost]), "mean.x", (-1.0, 0.0))


def test_a_formula_and_its_motion_agree_on_stability():
    """Near a Hopf point, the growth that the eigenvalues state is that of an integrated motion."""
    mu, w = 0.01, 1.0
    damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=mu)
    rests = gw.free.follow_rest(gw.System(["x"], [w**2], contacts=[damper]), "damper.mu", 0.02)
    found = solve_ivp(lambda t, y: [y[1], -y[0] + mu * y[1]], (0.0, 20.0), [1.0, 0.0], rtol=1e-10, atol=1e-12)
    point = rests.points[0]
    predicted = np.exp(point.growth * 20.0) * np.cos(point.frequency * 20.0)
    assert found.y[0, -1] == pytest.approx(predicted, abs=0.02)
