"""The coefficients of the flow: against the matrices they come from, and their derivatives against differences."""

import numpy as np
import pytest

from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.coefficients import ParameterLine, coefficients_of, layout_of, load_sizes

MASS = np.array([[2.0, 0.3, -0.1], [0.2, 1.5, 0.4], [0.0, -0.3, 1.2]])
STIFFNESS = np.array([[1.1, -0.6, 0.2], [-0.06, 1.3, 0.1], [0.4, 0.5, 2.0]])
DAMPING = np.array([[0.04, -0.03, 0.01], [-0.02, 0.06, 0.0], [0.01, 0.02, 0.05]])
DEFLECTION, FORCE = np.array([1.0, -0.7, 0.0]), np.array([0.9, 0.0, -0.54])
STOP = np.array([0.0, 0.2, 1.0])
MEAN = np.array([0.25, 0.5, -0.1])
NAMES = ("a", "b", "c")


def by_name(vector) -> dict[str, float]:
    return dict(zip(NAMES, vector.tolist(), strict=True))


SYSTEM = System(
    NAMES,
    stiffness=STIFFNESS,
    damping=DAMPING,
    mass=MASS,
    contacts=[
        Contact(
            "clutch",
            by_name(DEFLECTION),
            (Stage(0.5, 1.0, 0.1, Side.BOTH, "soft"), Stage(1.5, 3.0, 0.2, Side.POSITIVE, "hard")),
            by_name(FORCE),
            "hunt-crossley",
            impact_damping=0.07,
        ),
        Contact("stop", by_name(STOP), (Stage(0.3, 5.0, 0.6, Side.NEGATIVE),)),
        Contact(
            "buffer", {"b": 1.0}, (Stage(0.2, 4.0),), None, "viscous", viscous_damping=0.08
        ),
    ],
    mean=by_name(MEAN),
    harmonics=[
        Harmonic(0.25, {"a": 1.0, "c": 0.5}, 1, 0.3),
        Harmonic(0.15, {"b": -1.0}, 3, 1.2),
        Harmonic(0.35, {"b": 0.4, "c": 0.2}, 1, -0.4, "side"),
    ],
    frequency=0.8,
)  # fmt: skip


def test_accelerations_are_those_of_the_equations_of_motion() -> None:
    layout = layout_of(SYSTEM.structure)
    first, third = np.exp(0.3j) * 0.25 * np.array([1, 0, 0.5]), np.exp(1.2j) * 0.15 * np.array([0, -1, 0])
    first = first + np.exp(-0.4j) * 0.35 * np.array([0, 0.4, 0.2])
    loads = np.column_stack(  # Re(c exp(i h theta)) = Re(c) cos(h theta) - Im(c) sin(h theta)
        (STIFFNESS, DAMPING, FORCE, STOP, [0, 1, 0], MEAN, first.real, third.real, -first.imag, -third.imag)
    )
    assert layout.orders == (1, 3)
    np.testing.assert_allclose(
        coefficients_of(SYSTEM)[layout.accelerations], np.linalg.inv(MASS) @ loads, rtol=1e-13, atol=1e-15
    )


def test_the_first_coefficient_is_the_time_per_angle() -> None:
    assert coefficients_of(SYSTEM)[0] == 1 / 0.8


def test_contacts_keep_their_numbers() -> None:
    values = coefficients_of(SYSTEM)
    clutch, stop, buffer = layout_of(SYSTEM.structure).contacts
    np.testing.assert_array_equal(values[clutch.deflection], DEFLECTION)
    np.testing.assert_array_equal(values[stop.deflection], STOP)
    stages = [
        (stage.sign, *(values[slot] for slot in stage.numbers.values())) for stage in (*clutch.stages, *stop.stages)
    ]
    assert stages == [(1, 0.5, 1.0, 0.1), (-1, 0.5, 1.0, 0.1), (1, 1.5, 3.0, 0.2), (-1, 0.3, 5.0, 0.6)]
    assert [[values[slot] for slot in contact.numbers.values()] for contact in (clutch, stop, buffer)] == [
        [0.07],
        [],
        [0.08],
    ]
    np.testing.assert_allclose(values[clutch.force], np.linalg.solve(MASS, FORCE), rtol=1e-13)


def test_no_coefficient_has_two_meanings() -> None:
    layout = layout_of(SYSTEM.structure)
    places = [0, *layout.accelerations.ravel()]
    for contact in layout.contacts:
        places.extend(contact.deflection)
        for stage in contact.stages:
            places.extend(stage.numbers.values())
        places.extend(contact.numbers.values())
    assert sorted(places) == list(range(len(coefficients_of(SYSTEM))))


@pytest.mark.parametrize("name", SYSTEM.structure.names)
def test_derivatives_agree_with_differences(name: str) -> None:
    value, step = SYSTEM[name], 1e-5
    line = ParameterLine(SYSTEM, name)
    coefficients, slope = line.coefficients(value)
    np.testing.assert_allclose(coefficients, coefficients_of(SYSTEM), rtol=1e-15)
    # From the flat vector, so that the difference passes where a system could not be (a negative clearance).
    place = SYSTEM.structure.place(name)
    ends = []
    for sign in (1, -1):
        values = SYSTEM.values.copy()
        values[place] += sign * step
        ends.append(layout_of(SYSTEM.structure).compute(values))
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-8, atol=2e-9)
    assert np.any(slope), f"nothing depends on {name}"


def test_a_line_reaches_other_values() -> None:
    line = ParameterLine(SYSTEM, "mass.a.b")
    coefficients, _ = line.coefficients(0.7)
    assert line.system_at(0.7)["mass.a.b"] == 0.7
    np.testing.assert_allclose(coefficients, coefficients_of(SYSTEM.at({"mass.a.b": 0.7})), rtol=1e-14)
    np.testing.assert_allclose(
        ParameterLine(SYSTEM, "frequency").coefficients(2.0)[0], coefficients_of(SYSTEM.at(frequency=2.0)), rtol=0
    )


def test_a_system_without_contacts_and_excitation_has_coefficients() -> None:
    system = System(["x"], [[4.0]], mass=[[2.0]], frequency=2.0)
    np.testing.assert_array_equal(coefficients_of(system), [0.5, 2.0, 0.0, 0.0])


def test_the_sizes_of_loads_add_at_equal_orders() -> None:
    loads = [
        Harmonic(0.3, {"x": 1.0}),
        Harmonic(0.5, {"y": 1.0}, name="other"),
        Harmonic(0.7, {"x": 1.0}, 4, phase=0.2),
    ]
    assert load_sizes(System(["x", "y"], np.eye(2), harmonics=loads)) == pytest.approx({1: 0.8, 4: 0.7})
