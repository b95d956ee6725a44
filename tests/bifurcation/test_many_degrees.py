"""Special points of systems of many degrees of freedom, whose test functions must not drown."""

from itertools import pairwise

import numpy as np
import pytest

from gapwalk import Balance, Harmonic, Kind, System, WalkOptions, backlash, find_orbit, follow
from gapwalk.bifurcation.kinds.critical_multipliers import bounded_product, pair_factors
from gapwalk.orbit.floquet import classify

BIFURCATIONS = (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.BRANCH_POINT)


def rod(size: int) -> System:
    """A rod between two walls, cut into masses, with two gaps to ground."""
    names = tuple(f"q{index}" for index in range(size))
    stiffness = (size / 20.0) ** 2 * (2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    damping = 0.02 * np.eye(size) + 0.002 * stiffness
    places = names[size // 4], names[3 * size // 4]
    gaps = [
        backlash(f"gap{k}", {q: 1.0}, 0.3 + 0.05 * k, 0.2 * size, impact_damping=0.05) for k, q in enumerate(places)
    ]
    return System(
        names,
        stiffness,
        damping,
        contacts=gaps,
        harmonics=[Harmonic(0.3 * size / 20.0, {names[size // 20]: 1.0})],
        frequency=0.27,
    )


@pytest.mark.slow
def test_every_pair_that_leaves_the_unit_circle_has_its_special_point() -> None:
    method = Balance(5, error=1.0)
    orbit = find_orbit(rod(40), start="rest", method=method)
    branch = follow(orbit, "frequency", to=0.34, method=method, walk=WalkOptions(largest_step=0.02))
    special = [each for each in branch.special_points if each.kind in BIFURCATIONS]
    assert len(branch.special(Kind.NEIMARK_SACKER)) >= 2
    marks = [each.point.arclength for each in special]
    for before, after in pairwise(branch.points):
        # real multipliers at +1 are left out: with so few harmonics they pass it off the fold by the truncation
        if before.instability.pairs != after.instability.pairs:
            assert any(before.arclength <= mark <= after.arclength for mark in marks)


def test_of_many_factors_the_smallest_give_the_size_and_all_of_them_the_sign() -> None:
    rng = np.random.default_rng(5)
    inside = 0.9 * np.sqrt(rng.uniform(size=100)) * np.exp(1j * rng.uniform(0.1, 3.0, size=100))
    for angle, radius, sign in ((2.0, 0.99, 1.0), (2.0, 1.01, -1.0)):
        mu = np.append(inside, radius * np.exp(1j * angle))
        mu = np.concatenate((mu, mu.conj()))
        value = bounded_product(pair_factors(mu))
        assert value * sign > 0.0
        assert abs(value) > 1e-12
        assert classify(mu).pairs == (sign < 0.0)


def test_few_multipliers_are_all_multiplied() -> None:
    mu = np.array([0.5 + 0.6j, 0.5 - 0.6j, -0.3, 0.2])
    expected = np.prod([mu[i] * mu[j] - 1.0 for i in range(4) for j in range(i)])
    factors = np.array([mu[i] * mu[j] - 1.0 for i in range(4) for j in range(i)])
    bounded = np.prod(factors / np.maximum(1.0, np.abs(factors)))
    assert bounded_product(pair_factors(mu)) == pytest.approx(bounded.real, abs=1e-14)
    assert np.sign(expected.real) == np.sign(bounded.real)
