"""Natural vibrations compared with other ways to compute them, and doubts about damping."""

import numpy as np
import pytest
from scipy.linalg import eigh

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.modes import dissipation_doubts
from tests.systems import clutch, linear, viscous_stop


def test_they_are_those_of_scipy() -> None:
    system = linear()
    modes = gw.find_modes(system)
    squares, vectors = eigh(system.matrix("stiffness"), system.matrix("mass"))
    assert modes.frequencies**2 == pytest.approx(squares, rel=1e-13)
    for shape, vector in zip(modes.shapes.T, vectors.T, strict=True):
        assert np.abs(shape).max() == shape.max() == 1.0
        assert abs(shape @ vector) == pytest.approx(np.linalg.norm(shape) * np.linalg.norm(vector))


def test_light_damping_is_that_of_the_damped_system() -> None:
    system = linear(damping=1e-5)
    mass = system.matrix("mass")
    matrix = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-np.linalg.solve(mass, system.matrix("stiffness")), -np.linalg.solve(mass, system.matrix("damping"))],
        ]
    )
    values = sorted(np.linalg.eigvals(matrix), key=lambda value: value.imag)[2:]
    expected = [-value.real / abs(value) for value in values]
    assert gw.find_modes(system).damping_ratios == pytest.approx(expected, rel=1e-8)


def test_a_system_of_unsymmetric_matrices_has_its_vibrations_too() -> None:
    system = clutch()
    closed = system.matrix("stiffness") + np.outer([0.9, -0.54], [1.0, 0.0])
    for at, matrix in (("open", system.matrix("stiffness")), ("closed", closed)):
        modes = gw.find_modes(system, at)
        assert modes.frequencies**2 == pytest.approx(sorted(np.linalg.eigvals(matrix)), rel=1e-12)
        np.testing.assert_allclose(matrix @ modes.shapes, modes.shapes * modes.frequencies**2, atol=1e-13)
        # to first order, each decays by its share of critical damping
        names = [name for name in system.structure.names if name.startswith("damping.")]
        light = system.at({name: 1e-5 * system[name] for name in names})
        block = np.block([[np.zeros((2, 2)), np.eye(2)], [-matrix, -light.matrix("damping")]])
        decays = sorted(np.linalg.eigvals(block), key=lambda value: value.imag)[2:]
        ratios = [-value.real / abs(value) for value in decays]
        assert gw.find_modes(light, at).damping_ratios == pytest.approx(ratios, rel=1e-6)


def test_at_rest_contacts_damp_as_they_are_loaded() -> None:
    mesh = gw.backlash("mesh", {"x": 1.0}, 0.1, 9.0, impact_damping=0.2)
    system = gw.System(["x"], [[0.0]], mass=[[4.0]], contacts=[mesh], mean={"x": 1.5})
    (rest,) = gw.find_equilibria(system).equilibria
    modes = gw.find_modes(system, rest)
    assert modes.frequencies == pytest.approx([1.5])
    assert modes.damping_ratios == pytest.approx([0.2 * 1.5 / (2 * 4.0 * 1.5)])  # beta |f| over 2 m omega
    stop = viscous_stop()
    assert gw.find_modes(stop).damping_ratios == pytest.approx([(0.08 + 0.4) / (2 * 3.0)])
    assert gw.find_modes(stop, "open").damping_ratios == pytest.approx([0.08 / 2])


def test_what_nothing_drives_back_has_no_frequency() -> None:
    mesh = gw.backlash("mesh", {"x": 1.0}, 0.1, 9.0)
    system = gw.System(["x", "y"], [[0.0, 0.0], [0.0, 4.0]], contacts=[mesh])
    modes = gw.find_modes(system, "open")
    assert modes.frequencies.tolist() == [0.0, 2.0]
    assert np.isnan(modes.damping_ratios[0])
    falls = gw.find_modes(gw.System(["x", "y"], [[-1.0, 0.0], [0.0, 4.0]]))
    assert np.isnan(falls.frequencies[0])
    assert falls.frequencies[1] == 2.0


def test_a_free_train_vibrates_without_momentum() -> None:
    train = gw.train.Train(
        [gw.train.Inertia("a", 0.3), gw.train.Inertia("b", 0.1), gw.train.Inertia("c", 2.0)],
        [gw.train.Shaft("ab", ("a", "b"), stiffness=5.0)],
        [gw.train.Gear("bc", ("b", "c"), 3.0, stiffness=40.0, clearance=0.1)],
    )
    system = train.system()
    modes = gw.find_modes(system)
    assert modes.inertias == ("a", "b", "c")
    speeds = np.array([1.0, 1.0, 1.0 / 3.0])
    np.testing.assert_allclose((np.array([0.3, 0.1, 2.0]) * speeds) @ modes.angles, 0.0, atol=1e-14)
    np.testing.assert_allclose(modes.angles[0] - modes.angles[1], modes.shapes[0], atol=1e-14)
    np.testing.assert_allclose(modes.angles[1] - 3.0 * modes.angles[2], modes.shapes[1], atol=1e-14)
    # all three inertias with their rigid-body motion, written down at once
    rows = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -3.0]])
    squares = eigh(rows.T @ np.diag([5.0, 40.0]) @ rows, np.diag([0.3, 0.1, 2.0]), eigvals_only=True)
    assert modes.frequencies**2 == pytest.approx(squares[1:], rel=1e-12)


def test_another_word_is_refused() -> None:
    with pytest.raises(ModelError, match="did you mean closed"):
        gw.find_modes(linear(), "close")


@pytest.mark.parametrize(
    ("damping", "words"),
    [
        ([[0.1, 0.0], [0.0, 0.1]], ""),
        ([[0.1, -0.1], [-0.1, 0.1]], ""),
        ([[0.0, 0.0], [0.0, 0.0]], "damping is zero"),
        ([[0.1, 0.0], [0.0, -0.04]], "at the rate -0.02 "),
        ([[0.1, 0.3], [0.3, 0.1]], "damping is negative"),
    ],
)
def test_damping_that_takes_no_energy_out_is_told(damping, words):
    doubts = dissipation_doubts(gw.System(["a", "b"], [[2, -1], [-1, 2]], damping, [[1.0, 0.0], [0.0, 2.0]]))
    assert len(doubts) == bool(words)
    assert words in "".join(doubts)


def test_a_contact_that_feeds_energy_in_is_told():
    assert dissipation_doubts(clutch()) == []
    assert "stage2.impact_damping is -0.1" in dissipation_doubts(clutch(**{"stage2.impact_damping": -0.1}))[0]
