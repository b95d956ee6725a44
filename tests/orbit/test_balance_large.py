"""Harmonic balance of systems of many degrees of freedom: stability in eigenvectors, against other ways to have it."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from gapwalk import Balance, Harmonic, System, backlash, find_orbit
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.orbit.harmonic_balance import balance_equation as equation
from gapwalk.orbit.harmonic_balance.compliance import poles_of
from gapwalk.orbit.harmonic_balance.linear_part import linear_of


def chain(size: int, damping: np.ndarray | None = None, frequency: float = 0.5) -> System:
    """A chain of masses between two walls with two gaps to ground, driven in its middle."""
    names = tuple(f"q{index}" for index in range(size))
    stiffness = (size / 10.0) ** 2 * (2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    places = names[size // 3], names[2 * size // 3]
    gaps = [backlash(f"gap{k}", {q: 1.0}, 0.1 + 0.05 * k, 5.0, impact_damping=0.1) for k, q in enumerate(places)]
    damping = 0.05 * np.eye(size) + 0.01 * stiffness if damping is None else damping
    return System(
        names,
        stiffness,
        damping,
        contacts=gaps,
        harmonics=[Harmonic(0.1 * size, {names[size // 2]: 1.0})],
        frequency=frequency,
    )


def uneven(size: int) -> np.ndarray:
    """Damping that couples the modes."""
    return np.diag(0.05 + 0.1 * (np.arange(size) % 3))


@pytest.mark.parametrize("damping", [None, uneven(18)])
def test_multipliers_in_eigenvectors_are_those_of_the_full_variational_pass(damping, monkeypatch) -> None:
    system = chain(18, damping)
    orbit = find_orbit(system, start="rest", method=Balance(8, error=1.0))
    assert all(orbit.closings)
    monkeypatch.setattr(equation, "_MANY", 10**6)
    full = find_orbit(system, start="rest", method=Balance(8, error=1.0))
    assert len(orbit.multipliers) == len(full.multipliers) == 36
    assert np.sort_complex(orbit.multipliers) == pytest.approx(np.sort_complex(full.multipliers), abs=4e-5)


def test_leading_multipliers_need_the_slow_eigenvectors_alone() -> None:
    system = chain(60)
    orbit = find_orbit(system, start="rest", method=Balance(5, error=1.0))
    assert all(orbit.closings)
    assert len(orbit.multipliers) < 120
    kept, equation._FASTEST = equation._FASTEST, 100.0
    try:
        full = find_orbit(system, start="rest", method=Balance(5, error=1.0))
    finally:
        equation._FASTEST = kept
    assert len(full.multipliers) == 120
    assert np.abs(orbit.multipliers[:4]) == pytest.approx(np.abs(full.multipliers[:4]), abs=5e-3)


@pytest.mark.parametrize("damping", [None, uneven(12)])
def test_poles_give_the_flexibility_of_a_matrix_inverse(damping) -> None:
    system = chain(12, damping)
    linear = linear_of(layout_of(system.structure), coefficients_of(system))
    poles = poles_of(linear, np.zeros(2))
    assert poles is not None
    stiffness = system.matrix("stiffness")
    for w in (0.0, 0.7, 5.0):
        dynamic = stiffness - w**2 * np.eye(12) + 1j * w * system.matrix("damping")
        expected = linear.deflections @ np.linalg.solve(dynamic, linear.contacts)
        found = (poles.residues / (1j * w - poles.values)[:, None, None]).sum(axis=0)
        assert found == pytest.approx(expected, abs=1e-11)
        # a few eigenvectors and the others at rest are exact at rest, and near it
        few = poles.below(0.6 * np.abs(poles.values).max())
        near = (few.residues / (1j * w - few.values)[:, None, None]).sum(axis=0) + few.residual
        assert len(few.values) < 24
        if w < 1.0:
            assert near == pytest.approx(expected, abs=0.07 * w**2 + 1e-11)


def test_a_defective_linear_part_is_solved_line_by_line() -> None:
    """A critically damped mode has one eigenvector for two eigenvalues: no sum over eigenvalues, but a response."""
    system = System(
        ("x",),
        [[1.0]],
        [[2.0]],
        contacts=[backlash("gap", {"x": 1.0}, 0.0, 0.0)],
        harmonics=[Harmonic(0.8, {"x": 1.0})],
        frequency=0.7,
    )
    assert poles_of(linear_of(layout_of(system.structure), coefficients_of(system)), np.zeros(1)) is None
    orbit = find_orbit(system, start="rest", method=Balance(2))
    line = 0.8 / (1.0 - 0.49 + 1.4j)
    assert orbit.state == pytest.approx([line.real, (0.7j * line).real], abs=1e-14)


def test_sparse_matrices_are_taken() -> None:
    dense = chain(20)
    sparse = System(
        dense.coordinates,
        csr_array(dense.matrix("stiffness")),
        csr_array(dense.matrix("damping")),
        contacts=[
            backlash(f"gap{k}", {q: 1.0}, 0.1 + 0.05 * k, 5.0, impact_damping=0.1) for k, q in enumerate(("q6", "q13"))
        ],
        harmonics=[Harmonic(2.0, {"q10": 1.0})],
        frequency=0.5,
    )
    assert sparse == dense
