"""The paper's parameter sets: against rows typed again, and against its equations of motion written by hand."""

import math
import re

import numpy as np
import pytest

from gapwalk.errors import ModelError
from gapwalk.paper import DampingReading, SlopeReading, case, describe, frequency_responses, names, parameter_set

# Typed again from tables 1 to 3, matrices as they are printed there (mass matrix the identity):
# figure: (K11 -K12 -K21 K22), (C11 -C12 -C21 C22), beta, n1, n2, Tm1, Tm2, Te1, Te2, p, phi in degrees
ROWS = {
    "3-impact": ((0, -0.6, 0, 1.1), (0, -0.04, 0, 0.06), 0.075, 1.0, 0.6, 0.5, 0.25, 0.25, 0, 2, 0),
    "4b": ((0, -0.6, 0, 1.1), (0.04, -0.04, -0.04, 0.06), 0, 1.0, 0.6, 0.5, 0.25, 0.25, 0, 2, 0),
    "5": ((0, -0.6, 0, 1.1), (0, -0.04, 0, 0.06), 0.1, 1.0, 0.6, 0.25, 0.25, 0.25, 0, 2, 0),
    "7-viscous": ((0, -0.6, 0, 1.1), (0.04, -0.04, -0.04, 0.06), 0, 1.0, 0.6, 0.25, 0.25, 0.25, 0, 2, 0),
    "9a": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.25, 0.5, 0.25, 0, 2, 0),
    "9b": ((0.4, -0.6, -0.24, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.6, 0.36, 0.25, 0.5, 0.25, 0, 2, 0),
    "10a": ((0, -0.6, 0, 1.1), (0, -0.04, 0, 0.06), 0.075, 1.0, 0.6, 0.5, 0.25, 0.25, 0, 2, 0),
    "10b": ((0, -0.6, 0, 1.1), (0, -0.04, 0, 0.06), 0.075, 0.8, 0.48, 0.5, 0.25, 0.25, 0, 2, 0),
    "11a": ((0, -0.3, 0, 1.1), (0, -0.02, 0, 0.06), 0.075, 0.7, 0.3, 0.25, 0.5, 0.25, 0, 2, 0),
    "11b": ((0, -0.06, 0, 1.1), (0, -0.04, 0, 0.06), 0.075, 0.6, 1.0, 0.25, 0.5, 0.25, 0, 2, 0),
    "12": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.5, 0.25, 0.25, 0, 2, 0),
    "13": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.25, 0.25, 0.25, 0, 2, 0),
    "14": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.25, 0.5, 0.25, 0, 2, 0),
    "15": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.25, 0.25, 0.5, 0, 2, 0),
    "20a": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.5, 0.25, 0.25, 0.1, 2, 0),
    "20b": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.5, 0.25, 0.25, 0.1, 2, 120),
    "22": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.5, 0.25, 0.25, 0.1, 2, 180),
    "23b": ((0.4, -0.6, -0.24, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.6, 0.36, 0.25, 0.5, 0.25, 0.1, 2, 0),
    "24": ((0.4, -0.6, -0.24, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.6, 0.36, 0.25, 0.5, 0.5, 0, 2, 0),
    "25": ((0.4, -0.6, -0.24, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.6, 0.36, 0.25, 0.5, 0.5, 0.1, 2, 0),
    "26b": ((0.4, -0.6, -0.24, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.6, 0.36, 0.25, 0.5, 0.25, 0.1, 3, 0),
    "28": ((0.1, -0.6, -0.06, 1.1), (0.04, -0.04, -0.04, 0.06), 0.05, 0.9, 0.54, 0.25, 0.25, 0.25, 0.1, 2, 0),
    "29": ((0, -0.6, 0, 1.1), (0, -0.04, 0, 0.06), 0.075, 1.0, 0.6, 0.25, 0.25, 0.25, 0.1, 2, 0),
}  # fmt: skip
STATES = np.random.default_rng(1995).normal(scale=2.0, size=(12, 5))  # q1, q2, q3, q4, tau


def by_hand(row, slope: str, damping: str, W: float, q1, q2, q3, q4, tau) -> tuple[float, float]:
    """q2' and q4' as section 2 of the paper's reading gives them."""
    (k11, k12, k21, k22), (c11, c12, c21, c22), beta, n1, n2, tm1, tm2, te1, te2, p, phi = row
    s = 1.0 if slope == "reduced" else 1.0 - k11
    g = s * (q1 + 1) if q1 <= -1 else s * (q1 - 1) if q1 >= 1 else 0.0
    f = g + beta * abs(g) * q2 if damping == "dissipative" else g * (1 + beta * q2)
    excitation = te1 * math.cos(W * tau) + te2 * math.cos(p * W * tau + math.radians(phi))
    first = -k11 * q1 - c11 * q2 - k12 * q3 - c12 * q4 - n1 * f + tm1 + excitation  # the matrices have -K12, -C12
    second = -k21 * q1 - c21 * q2 - k22 * q3 - c22 * q4 + n2 * f + tm2
    return first, second


def by_matrices(system, q1, q2, q3, q4, tau) -> np.ndarray:
    """M^-1 (loads - C v - K q - d f) from the named values of the system."""
    q, v = np.array([q1, q3]), np.array([q2, q4])
    vector = {
        what: np.array([system[f"{what}.q1"], system[f"{what}.q3"]])
        for what in ("mean", "stage2.deflection", "stage2.force")
    }
    loads = vector["mean"].copy()
    for form in system.structure.harmonics:
        acts_on = np.array([system[f"{form.name}.acts_on.q1"], system[f"{form.name}.acts_on.q3"]])
        phase = form.order * system.frequency * tau + system[f"{form.name}.phase"]
        loads += system[f"{form.name}.amplitude"] * math.cos(phase) * acts_on
    x, rate = vector["stage2.deflection"] @ q, vector["stage2.deflection"] @ v
    gap = abs(x) - system["stage2.clearance"]
    g = math.copysign(system["stage2.stiffness"] * gap, x) if gap > 0 else 0.0
    (form,) = system.structure.contacts
    size = abs(g) if form.law.name == "hunt-crossley" else g
    f = g + system["stage2.impact_damping"] * size * rate
    balance = loads - system.matrix("damping") @ v - system.matrix("stiffness") @ q - vector["stage2.force"] * f
    return np.linalg.solve(system.matrix("mass"), balance)


@pytest.mark.parametrize("damping", ["dissipative", "as-printed"])
@pytest.mark.parametrize("slope", ["reduced", "literal"])
@pytest.mark.parametrize("name", ROWS)
def test_the_equations_of_motion_are_those_of_the_paper(name: str, slope: str, damping: str) -> None:
    system = case(name, slope=slope, damping=damping)
    touching = 0
    for state in STATES:
        np.testing.assert_allclose(
            by_matrices(system, *state), by_hand(ROWS[name], slope, damping, system.frequency, *state), rtol=1e-13
        )
        touching += abs(state[0]) > 1
    assert 3 <= touching <= 9  # states on both sides of the gap and in it
    assert {math.copysign(1, state[0]) for state in STATES if abs(state[0]) > 1} == {1.0, -1.0}


def test_a_second_harmonic_is_there_only_where_it_acts() -> None:
    for name in names():
        forms = [form.name for form in case(name).structure.harmonics]
        second = parameter_set(name).second
        assert forms == (["harmonic1", f"harmonic{second[1]}"] if second else ["harmonic1"])
    assert [form.name for form in case("26b").structure.harmonics] == ["harmonic1", "harmonic3"]


def test_systems_of_one_kind_share_their_structure() -> None:
    structures = {case(name).structure for name in names()}
    assert len(structures) == 3  # with one harmonic, with the second, with the third


@pytest.mark.parametrize(
    ("name", "frequency"),
    [("3-impact", 1.5), ("3-viscous", 1.5), ("5", 0.17), ("6", 0.17), ("7-impact", 0.17), ("8a", 0.17), ("17", 0.63),
     ("18", 0.634), ("19", 0.636), ("27", 0.25), ("28", 0.255), ("29", 0.35), ("13", 1.9), ("16", 1.9)],
)  # fmt: skip
def test_a_figure_has_its_frequency(name: str, frequency: float) -> None:
    assert case(name).frequency == frequency


def test_the_frequency_responses_are_those_of_the_paper() -> None:
    listed = "4a 4b 9a 9b 10a 10b 11a 11b 12 13 14 15 20a 20b 22 23a 23b 24 25 26a 26b"
    assert frequency_responses() == tuple(listed.split())


@pytest.mark.parametrize(
    ("alias", "name"),
    [("10a", "4a"), ("7-impact", "5"), ("8a", "5"),
     ("7-viscous", "6"), ("14", "9a"), ("16", "15"), ("17", "15"), ("18", "15"), ("19", "15"),
     ("21-zero-phase", "20a"), ("21-120-degrees", "20b"), ("23a", "9b"), ("26a", "9b"), ("28", "27")],
)  # fmt: skip
def test_figures_that_share_a_set(alias: str, name: str) -> None:
    assert case(alias).at(frequency=1.0) == case(name).at(frequency=1.0)


def test_every_figure_of_the_tables_is_there() -> None:
    numbers = {int(re.match(r"\d+", name)[0]) for name in names()}
    assert numbers == {*range(3, 30)}


def test_guesses_are_flagged() -> None:
    guesses = {name for name in names() if describe(name).startswith("GUESS")}
    assert guesses == {"8a", "11a", "11b"}
    assert "beta" in describe("8a")
    assert case("8a")["stage2.impact_damping"] == 0.1
    assert "K11 = 0.1" in describe("12")
    assert "Te1" in describe("27")
    assert describe("13") == ""


@pytest.mark.parametrize("name", ["11a", "11b"])
def test_the_resonances_of_figure_11_are_as_far_apart_as_its_note_says(name: str) -> None:
    system = case(name)
    force = np.array([system["stage2.force.q1"], system["stage2.force.q3"]])
    touching = system.matrix("stiffness") + np.outer(force, [1.0, 0.0])
    low, high = np.sqrt(np.sort(np.linalg.eigvals(touching).real))
    assert f"but are {high - low:.2f}" in describe(name)


def test_readings_may_be_members_or_words() -> None:
    assert case("13", slope=SlopeReading.LITERAL) == case("13", slope="literal")
    assert case("13", damping=DampingReading.AS_PRINTED) == case("13", damping="as-printed")
    assert case("13", slope="literal")["stage2.stiffness"] == 0.9
    assert case("10a", slope="literal") == case("10a")  # pure backlash: kappa = 0
    (form,) = case("13", damping="as-printed").structure.contacts
    assert form.law.name == "hunt-crossley-as-printed"


@pytest.mark.parametrize("name", ["20(a)", "20A", "figure 20a", "Fig. 20 a", "fig20a"])
def test_names_may_be_written_in_many_ways(name: str) -> None:
    assert case(name) == case("20a")


@pytest.mark.parametrize(
    ("name", "hint"),
    [("20", "did you mean 20a or 20b?"), ("3", "did you mean 3-impact or 3-viscous?"), ("30", ""), ("", ""),
     ("21", "21-zero-phase or 21-120-degrees"), ("3-impct", "did you mean 3-impact")],
)  # fmt: skip
def test_an_unknown_figure_is_refused(name: str, hint: str) -> None:
    with pytest.raises(ModelError, match="the paper has no figure") as error:
        case(name)
    assert hint in str(error.value)
    for known in names():
        assert known in str(error.value)


def test_an_unknown_reading_is_refused() -> None:
    with pytest.raises(ModelError, match="slope is 'steep'; it must be 'reduced' or 'literal'"):
        case("13", slope="steep")
    with pytest.raises(ModelError, match="damping is 'none'; it must be 'dissipative' or 'as-printed'"):
        case("13", damping="none")
