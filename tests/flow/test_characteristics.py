"""Forces over deflections and numbers over the angle, against formulas written here."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.flow.characteristics import characteristics_of
from gapwalk.model.contact import Side, force


def one(*contacts, harmonics=(), **more) -> gw.System:
    return gw.System(["x"], [[1.0]], [[0.1]], contacts=contacts, harmonics=harmonics, **more)


def test_the_force_of_stages_is_their_sum_with_both_sides_of_a_step():
    contact = gw.Contact(
        "stop",
        {"x": 1.0},
        [
            gw.Stage(0.5, 2.0, side=Side.POSITIVE, name="inner", numbers={"preload": 0.6}),
            gw.Stage(1.0, 3.0, side=Side.POSITIVE, name="outer"),
        ],
        law="piecewise",
    )
    (curve,) = characteristics_of(one(contact)).forces
    x = curve.x
    wanted = np.where(x > 0.5, 0.6 + 2.0 * (x - 0.5), 0.0) + np.where(x > 1.0, 3.0 * (x - 1.0), 0.0)
    np.testing.assert_allclose(curve.force, wanted, atol=1e-12)
    assert curve.breakpoints == (0.5, 1.0)
    assert np.ptp(curve.force[np.abs(x - 0.5) < 1e-6]) == pytest.approx(0.6)
    assert x[0] < 0.0 < -x[0] < x[-1]  # nothing acts on the left


def test_the_band_is_the_force_at_the_extremes_of_a_stiffness_that_varies():
    mesh = gw.backlash("mesh", {"x": 1.0}, clearance=1.0, stiffness=2.0)
    teeth = gw.loads.Rectangle(0.2, {"mesh.stiffness": 1.0}, order=3, share=0.6)
    error = gw.Harmonic(0.05, order=3, varies="mesh.deflection", phase=0.3)
    found = characteristics_of(one(mesh, harmonics=[teeth, error]))
    (curve,) = found.forces
    depth = np.sign(curve.x) * np.maximum(np.abs(curve.x) - 1.0, 0.0)
    low, high = np.sort([2.0 * 1.2 * depth, 2.0 * 0.7 * depth], axis=0)
    np.testing.assert_allclose(curve.band, (low, high), atol=1e-12)
    stiffness = next(each for each in found.variations if each.parameter == "mesh.stiffness")
    displacement = next(each for each in found.variations if each.parameter == "mesh.deflection")
    assert stiffness.repeats == displacement.repeats == 3
    above = np.cos(3 * stiffness.theta) - np.cos(0.6 * np.pi)
    beside = np.abs(above) > 1e-12  # an angle of the jump itself has either value
    np.testing.assert_allclose(stiffness.values[0][beside], np.where(above > 0.0, 2.4, 1.4)[beside], atol=1e-12)
    assert np.count_nonzero(~beside) < 3
    np.testing.assert_allclose(
        displacement.values[0], 0.05 * np.cos(3 * displacement.theta + 0.3), rtol=0.0, atol=1e-14
    )


def test_a_formula_of_the_rate_alone_is_a_curve_over_the_rate_and_several_deflections_are_listed():
    both = {"r": {"x": 1.0}, "s": {"x": 2.0}}
    system = one(
        force("drag", {"x": 1.0}, "c*v*abs(v)", c=0.2),
        force("pol", {"x": 1.0}, "-mu*(1 - x**2)*v", mu=0.3),
        force("coupled", both, "k*r*s**2", acts_on={"x": 1.0}, k=1.0),
    )
    found = characteristics_of(system)
    drag, pol = found.forces
    assert drag.over_rate
    assert not drag.is_at_zero
    np.testing.assert_allclose(drag.force, 0.2 * drag.x * np.abs(drag.x), atol=1e-12)
    assert pol.over_rate
    assert pol.is_at_zero
    np.testing.assert_allclose(pol.force, -0.3 * pol.x, atol=1e-12)
    assert [name for name, _ in found.others] == ["coupled"]


def test_equal_contacts_share_a_curve():
    contacts = [gw.stop(f"stop{number}", {"x": 1.0}, 1.0, 5.0) for number in range(4)]
    (curve,) = characteristics_of(one(*contacts)).forces
    assert curve.names == ("stop0", "stop1", "stop2", "stop3")


def test_loads_are_those_at_the_frequency_with_their_mean():
    system = one(harmonics=[gw.Harmonic(0.5, {"x": 2.0}, order=2, growth=2, at=3.0)], mean={"x": 0.25}, frequency=6.0)
    loads = characteristics_of(system).loads
    assert loads is not None
    assert loads.repeats == 2
    np.testing.assert_allclose(loads.values[0], 0.25 + 2.0 * 0.5 * 4.0 * np.cos(2 * loads.theta), atol=1e-12)
    assert loads.means[0] == pytest.approx(0.25)


def test_in_a_train_the_spring_of_a_shaft_that_acts_always_belongs_to_its_force():
    shaft = gw.train.Shaft("clutch", ("a", "b"), stiffness=80.0, damping=0.5, stages=(gw.Stage(0.1, 1100.0),))
    inertias = [gw.train.Inertia("a", 1.0), gw.train.Inertia("b", 2.0)]
    (curve,) = characteristics_of(gw.train.Train(inertias, [shaft]).system()).forces
    beyond = np.sign(curve.x) * np.maximum(np.abs(curve.x) - 0.1, 0.0)
    np.testing.assert_allclose(curve.force, 80.0 * curve.x + 1100.0 * beyond, atol=1e-9)
