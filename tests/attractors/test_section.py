"""Sections: closed forms, SciPy's own events, and the contact log."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors import Crossing, Plane, impact_plane, section, settle, strobe
from gapwalk.errors import ModelError
from gapwalk.flow.motion import integrate
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from tests.attractors.references import figure15, strobes
from tests.systems import linear, viscous_stop


@pytest.fixture(scope="module")
def free() -> System:
    """x'' + x = 0 seen by a clock of W = 1: x = a cos t + v sin t."""
    return System(("x",), [[1.0]], frequency=1.0)


def test_a_plane_is_met_at_the_angles_of_the_closed_form(free):
    found = section(free, [2.0, 0.0], Plane({"x": 1.0}, 1.0), 3)  # 2 cos t = 1, rising
    assert found.theta == pytest.approx(2 * np.pi * np.arange(1, 4) - np.pi / 3, abs=1e-12)
    assert found.signal("x") == pytest.approx([1.0] * 3, abs=1e-12)
    assert found.signal("x'") == pytest.approx([np.sqrt(3)] * 3, abs=1e-12)
    assert found.signal("x''") == pytest.approx([-1.0] * 3, abs=1e-12)
    assert found.phase == pytest.approx([5 * np.pi / 3] * 3)
    down = section(free, [2.0, 0.0], Plane({"x": 1.0}, 1.0, Crossing.DOWNWARDS), 3)
    assert down.theta == pytest.approx(2 * np.pi * np.arange(3) + np.pi / 3, abs=1e-12)
    assert len(section(free, [2.0, 0.0], Plane({"x": 1.0}, 1.0, Crossing.BOTH), 3)) == 6


def test_two_crossings_within_a_sample_are_found(free):
    # the top of the cosine reaches above the plane for a thousandth of a period only
    level = 2 * np.cos(3e-3)
    found = section(free, [0.0, 2.0], Plane({"x": 1.0}, level, Crossing.BOTH), 2)  # 2 sin t
    expected = np.pi / 2 + np.array([-3e-3, 3e-3])
    assert found.theta == pytest.approx([*expected, *(expected + 2 * np.pi)], abs=1e-9)
    assert len(section(free, [0.0, 2.0], Plane({"x": 1.0}, 2.0 + 1e-6, Crossing.BOTH), 2)) == 0


def test_a_start_on_the_plane_is_no_crossing(free):
    found = section(free, [1.0, 1.0], Plane({"x": 1.0}, 1.0, Crossing.BOTH), 1)  # sqrt(2) cos(t - pi/4)
    assert found.theta == pytest.approx([np.pi / 2], abs=1e-12)
    rest = section(free, [1.0, 0.0], Plane({"x'": 1.0}, 0.0, Crossing.BOTH), 2)
    assert rest.theta == pytest.approx(np.pi * np.arange(1, 4), abs=1e-12)


def test_an_oblique_plane_of_positions_and_velocities(free):
    found = section(free, [1.0, 0.0], Plane({"x": 1.0, "x'": -2.0}, 0.5), 1)  # cos t + 2 sin t = 0.5, rising
    angle = np.arctan2(2, 1) - np.arccos(0.5 / np.sqrt(5)) + 2 * np.pi
    assert found.theta == pytest.approx([angle], abs=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_impacts_are_those_of_the_contact_log(side):
    settled = settle(gw.paper.case("15"), frequency=0.4)
    found = section(settled.system, settled.state, impact_plane(settled.system, "stage2", side), 12)
    log = integrate(settled.system, settled.state, 12).contacts
    closing = [record for record in log if record.closes and record.side == side]
    assert len(closing) > 5
    assert found.theta == pytest.approx([record.theta for record in closing], abs=1e-8)
    assert found.signal("q1") == pytest.approx([side] * len(closing), abs=1e-12)
    assert found.signal("q1'") == pytest.approx([record.velocity for record in closing], abs=1e-7)
    opening = section(settled.system, settled.state, impact_plane(settled.system, "stage2", side, closes=False), 12)
    assert opening.theta == pytest.approx([r.theta for r in log if not r.closes and r.side == side], abs=1e-8)


@pytest.mark.parametrize("phase", [0.0, 1.3])
def test_strobes_agree_with_scipy(phase):
    system = gw.paper.case("15").at(frequency=0.82)
    found = strobe(system, [1.0, 0.5, 0.1, -0.2], 4, phase)
    first = integrate(system, np.array([1.0, 0.5, 0.1, -0.2]), phase / (2 * np.pi)).q[-1] if phase else [1.0, 0.5]
    assert found.states[0, :2] == pytest.approx(first, abs=1e-12)
    assert found.phase == pytest.approx([phase] * 4)

    def later(t, y):
        return figure15(0.82)(t + phase / 0.82, y)

    assert strobes(later, 0.82, found.states[0], 3) == pytest.approx(found.states[1:], abs=1e-7)


def test_what_makes_no_sense_is_refused(free):
    with pytest.raises(ModelError, match=r"phase is 7\.0"):
        strobe(free, [1.0, 0.0], phase=7.0)
    with pytest.raises(ModelError, match="periods is 0"):
        strobe(free, [1.0, 0.0], 0)
    with pytest.raises(ModelError, match=r"periods is 0\.5"):
        section(free, [1.0, 0.0], Plane({"x": 1.0}), 0.5)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"names 'y'; it must be one of x, x'"):
        section(free, [1.0, 0.0], Plane({"y": 1.0}))
    with pytest.raises(ModelError, match="normal of a plane is zero"):
        Plane({"x": 0.0})
    with pytest.raises(ModelError, match="'upwards', 'downwards', 'both'"):
        Plane({"x": 1.0}, crossing="sideways")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="there is no contact 'wall'; contacts are stop"):
        impact_plane(viscous_stop(), "wall")
    with pytest.raises(ModelError, match="no stage of 'stop' acts on the side -1"):
        impact_plane(viscous_stop(), "stop", -1)
    with pytest.raises(ModelError, match="there is no contact"):
        impact_plane(linear(), "stop")


def test_planes_in_words():
    assert Plane({"q1": 1.0}, 1.0).text == "q1 = 1, upwards"
    assert Plane({"q1": 1.0, "q3'": -0.5}, 0.2, Crossing.BOTH).text == "q1 − 0.5 q3' = 0.2"
    far = Contact("far", {"a": 1.0, "b": -2.0}, (Stage(0.7, side=Side.NEGATIVE),))
    system = System(("a", "b"), np.eye(2), contacts=[far], harmonics=[Harmonic(1.0, {"a": 1.0})])
    assert impact_plane(system, "far", -1).text == "a − 2 b = -0.7, downwards"
