"""Damping by proportion and by modal ratios, in Python and in model files."""

import math

import numpy as np
import pytest
import scipy.linalg

from gapwalk.errors import ModelError
from gapwalk.model import ModalDamping, ProportionalDamping, System
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import parse_source

MASS = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.5]])
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 4.0]])
FREE = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
NAMES = ("a", "b", "c")


def test_proportional_damping_is_a_share_of_mass_and_of_stiffness() -> None:
    system = System(NAMES, STIFFNESS, ProportionalDamping(mass=0.02, stiffness=0.003), MASS)
    assert system.matrix("damping") == pytest.approx(0.02 * MASS + 0.003 * STIFFNESS)
    assert system["damping.a.b"] == pytest.approx(0.02 * 0.3 - 0.003)


@pytest.mark.parametrize("ratios", [0.02, (0.01, 0.02), (0.01, 0.02, 0.5, 0.7), np.array([0.03])])
def test_modal_damping_gives_the_eigenvalues_their_ratios(ratios) -> None:
    system = System(NAMES, STIFFNESS, ModalDamping(ratios), MASS)
    generator = np.block([
        [np.zeros((3, 3)), np.eye(3)],
        [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, system.matrix("damping"))],
    ])  # fmt: skip
    values = np.linalg.eigvals(generator)
    values = values[values.imag > 0.0][np.argsort(np.abs(values[values.imag > 0.0]))]
    given = list(np.atleast_1d(ratios))[:3]
    given += [given[-1]] * (3 - len(given))
    assert -values.real / np.abs(values) == pytest.approx(given)
    assert np.abs(values) ** 2 == pytest.approx(scipy.linalg.eigh(STIFFNESS, MASS, eigvals_only=True))


def test_a_motion_as_a_whole_is_not_damped_by_ratios() -> None:
    damping = System(NAMES, FREE, ModalDamping(0.1)).matrix("damping")
    assert damping @ np.ones(3) == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.linalg.matrix_rank(damping, tol=1e-8) == 2


@pytest.mark.parametrize(
    ("damping", "stiffness", "words"),
    [
        (ModalDamping(0.1), [[1, 0.5], [0, 1]], "stiffness matrix is not symmetric"),
        (ModalDamping(0.1), [[-1, 0], [0, 1]], "grows by itself"),
        (ModalDamping(0.1), [[math.nan, 0], [0, 1]], "must be a finite number"),
        (ModalDamping(0.1), [[1, 0, 0], [0, 1, 0]], "stiffness has shape (2, 3)"),
    ],
)
def test_a_damping_that_makes_no_sense_is_refused(damping, stiffness, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        System(("a", "b"), stiffness, damping)
    assert words in str(caught.value)


def test_a_mass_that_is_not_positive_has_no_modes() -> None:
    with pytest.raises(ModelError, match="not positive definite"):
        System(("a", "b"), np.eye(2), ModalDamping(0.1), [[1.0, 2.0], [2.0, 1.0]])


@pytest.mark.parametrize("ratios", [-0.1, (0.1, -0.1), (), "half", (0.1, "x"), math.inf, True, {0.1}])
def test_a_ratio_is_a_number_that_is_not_negative(ratios) -> None:
    with pytest.raises(ModelError, match="ratios"):
        ModalDamping(ratios)


MODEL = 'coordinates = ["a", "b", "c"]\nstiffness = [[3, -1, 0], [-1, 2, -1], [0, -1, 4]]\nfrequency = 1.0\n'


@pytest.mark.parametrize(
    ("line", "law"),
    [
        ("damping = { mass = 0.02, stiffness = 0.003 }", ProportionalDamping(0.02, 0.003)),
        ("damping = { stiffness = 0.003 }", ProportionalDamping(stiffness=0.003)),
        ("damping = { ratios = 0.02 }", ModalDamping(0.02)),
        ("[damping]\nratios = [0.01, 0.02]", ModalDamping((0.01, 0.02))),
    ],
)
def test_a_model_file_may_give_a_law(line: str, law) -> None:
    model, problems = check_model(parse_source(MODEL + line, "m.toml"))
    assert not problems
    assert model is not None
    assert model.system == System(NAMES, STIFFNESS, law)


@pytest.mark.parametrize(
    ("line", "path", "words"),
    [
        ("damping = { ratios = 0.1, mass = 0.1 }", "damping", "leave one of the two out"),
        ("damping = { ratio = 0.1 }", "damping.ratio", "did you mean ratios?"),
        ("damping = { ratios = [] }", "damping.ratios", "a list of 1 or more"),
        ("damping = { ratios = [0.1, -1] }", "damping.ratios[1]", ">= 0"),
        ('damping = { mass = "little" }', "damping.mass", "must be a number"),
    ],
)
def test_a_wrong_law_in_a_file_has_one_problem(line: str, path: str, words: str) -> None:
    (problem,) = check_model(parse_source(MODEL + line, "m.toml"))[1]
    assert (problem.line, problem.path) == (4, path)
    assert words in problem.message
