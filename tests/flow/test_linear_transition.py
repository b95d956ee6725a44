"""Transition matrices of large systems from their events: against Taylor series, SciPy, and differences of motions."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from scipy.linalg import expm

import gapwalk as gw
from gapwalk.flow import flow as flow_module
from gapwalk.flow.flow import LARGE, PERIOD, Arc, Flow, flow_of
from gapwalk.model.coefficients import coefficients_of, varying
from gapwalk.model.contact import Contact, Side, Stage
from gapwalk.model.loads import Harmonic
from gapwalk.model.system import System
from gapwalk.orbit import floquet
from tests.sampled_verification import verified
from tests.tiers import in_campaign


def chain(size: int, seed: int = 0, *, law: str = "hunt-crossley", damping: float = 0.05, **numbers: float) -> System:
    """A chain of masses with stops of one or two stages, at three of them, and damping of any kind."""
    random = np.random.default_rng(seed)
    stiffness = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    names = [f"x{k}" for k in range(size)]
    stages = [
        [Stage(0.2, 4.0, side=Side.POSITIVE)],
        [Stage(0.1, 2.0)],
        [Stage(0.1, 3.0, name="first"), Stage(0.3, 9.0, name="last")],
    ]
    contacts = [
        Contact(f"stop{k}", {names[place]: 1.0, names[place - 1]: -0.5}, own, law=law, **numbers)
        for k, (place, own) in enumerate(zip((size // 3, size // 2, size - 1), stages, strict=True))
    ]
    return System(
        names,
        stiffness,
        damping * stiffness + 0.4 * damping * np.diag(random.random(size)),
        mass=np.diag(0.5 + random.random(size)),
        contacts=contacts,
        harmonics=[Harmonic(0.8, {names[-1]: 1.0})],
        frequency=0.6,
    )


def flows(system: System, *parameters: str) -> tuple[Flow, Flow]:
    """Return the flow with matrices from events, and the one with Taylor series."""
    own = flow_of(system, *parameters, transition=True)
    with patch.object(flow_module, "LARGE", 10**6):
        flow_module._compile.cache_clear()
        other = flow_of(system, *parameters, transition=True)
    flow_module._compile.cache_clear()
    assert own.is_linear
    assert not other.is_linear
    return own, other


def motion(flow: Flow, system: System, seed: int, *parameters: str) -> Arc:
    state = 0.4 * np.random.default_rng(seed).normal(size=2 * system.size)
    directions = np.array([mask.astype(float) for mask in varying(system, parameters)]) if parameters else None
    return flow.integrate(coefficients_of(system), state, 0.3, 0.3 + PERIOD, directions)


def free(stiffness: np.ndarray, damping: np.ndarray, frequency: float) -> System:
    """A system that never comes to its stop."""
    names = [f"x{k}" for k in range(len(stiffness))]
    far = Contact("stop", {names[0]: 1.0}, [Stage(100.0, 1.0)])
    return System(
        names, stiffness, damping, contacts=[far], harmonics=[Harmonic(0.1, {names[0]: 1.0})], frequency=frequency
    )


CASES = [("hunt-crossley", {}), ("viscous", {"viscous_damping": 0.3})]


@pytest.mark.parametrize(("law", "numbers"), CASES)
@pytest.mark.parametrize("size", [LARGE, 12])
def test_they_are_those_of_taylor_series(size: int, law: str, numbers: dict[str, float]) -> None:
    for seed in range(4):
        system = chain(size, seed, law=law, **numbers)
        parameter = ("frequency", "stop0.stiffness", "stop1.clearance", "damping.x1.x1")[seed]
        own, other = (motion(flow, system, seed, parameter) for flow in flows(system, parameter))
        assert len(own.contacts) >= 4
        assert own.state == pytest.approx(other.state, abs=1e-13)
        assert own.sensitivity == pytest.approx(other.sensitivity, rel=1e-11, abs=1e-11)
        assert own.transition == pytest.approx(other.transition, abs=1e-11 * float(np.abs(other.transition).max()))


@pytest.mark.parametrize(("law", "numbers"), CASES)
def test_they_are_those_of_differences(law: str, numbers: dict[str, float]) -> None:
    system, step = chain(LARGE, 3, law=law, **numbers), 1e-6
    flow, coefficients = flow_of(system, transition=True), coefficients_of(system)
    state = 0.4 * np.random.default_rng(3).normal(size=2 * LARGE)
    assert flow.is_linear
    found = flow.integrate(coefficients, state).transition
    moved = [
        [flow_of(system).integrate(coefficients, state + side * step * each).state for each in np.eye(2 * LARGE)]
        for side in (1.0, -1.0)
    ]
    assert found == pytest.approx((np.array(moved[0]) - moved[1]).T / (2.0 * step), abs=1e-7)


def test_without_contact_they_are_the_exponential() -> None:
    n = LARGE
    system = free(np.diag(np.arange(1.0, n + 1.0)) + 0.1, 0.1 * np.eye(n) + 0.02, 0.7)
    found = flow_of(system, transition=True).integrate(coefficients_of(system), np.full(2 * n, 0.1))
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-system.matrix("stiffness"), -system.matrix("damping")]])
    assert found.transition == pytest.approx(expm(matrix * PERIOD / 0.7), abs=1e-13)


def test_a_system_without_contacts_has_its_linear_response() -> None:
    names, size = [f"x{k}" for k in range(LARGE)], LARGE
    stiffness = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    system = System(names, stiffness, 0.05 * stiffness, harmonics=[Harmonic(0.1, {names[0]: 1.0})], frequency=0.7)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.9)
    for point in (branch.points[0], branch.points[-1]):
        load, w = 0.1 * np.eye(size)[0], point.value
        exact = np.linalg.solve(stiffness - w**2 * np.eye(size) + 1j * w * 0.05 * stiffness, load)
        assert point.orbit.state[:size] == pytest.approx(exact.real, abs=1e-12)
    assert branch.points[-1].value == pytest.approx(0.9)


def test_a_matrix_without_enough_eigenvectors_has_its_exponential_too() -> None:
    n = LARGE
    system = free(np.eye(n), 2.0 * np.eye(n), 2.0)  # critical damping
    found = flow_of(system, transition=True).integrate(coefficients_of(system), np.full(2 * n, 0.1)).transition
    t = PERIOD / 2.0
    exact = np.exp(-t) * np.block([[(1.0 + t) * np.eye(n), t * np.eye(n)], [-t * np.eye(n), (1.0 - t) * np.eye(n)]])
    assert found == pytest.approx(exact, abs=1e-14)


def test_samples_of_a_motion_have_theirs() -> None:
    system = chain(8, 2, law="viscous", viscous_damping=0.2)
    thetas = np.linspace(0.0, PERIOD, 17)
    state = 0.4 * np.random.default_rng(5).normal(size=16)
    own, other = (flow.vary(coefficients_of(system), state, thetas) for flow in flows(system))
    assert own.transitions == pytest.approx(other.transitions, abs=1e-11)
    assert own.states == pytest.approx(other.states, abs=1e-13)


def test_what_is_not_linear_keeps_its_series() -> None:
    crossley = chain(LARGE, impact_damping=0.1)
    linear = chain(LARGE)
    assert not flow_of(crossley, transition=True).is_linear
    assert not flow_of(chain(LARGE - 1), transition=True).is_linear
    assert flow_of(linear, "frequency", transition=True).is_linear


@pytest.mark.slow
@pytest.mark.parametrize(("walk", "sampled"), [(gw.WalkOptions(largest_step=0.1), 2), in_campaign(gw.WalkOptions(), 0)])
def test_a_branch_of_a_long_chain_is_verified(walk: gw.WalkOptions, sampled: int) -> None:
    system = chain(10, 1)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.7, walk=walk)
    assert flow_of(system, "frequency", transition=True).is_linear
    assert branch.special_points
    assert verified(branch, sampled).ok


@pytest.mark.parametrize(("law", "numbers"), [("elastic", {}), ("viscous", {"viscous_damping": 0.2})])
def test_multipliers_of_a_large_chain_are_the_eigenvalues(law: str, numbers: dict[str, float]) -> None:
    size, stiff = 160, 2.0 * np.eye(160) - np.eye(160, k=1) - np.eye(160, k=-1)
    names = [f"x{k}" for k in range(size)]
    contacts = [Contact("stop", {names[-1]: 1.0}, [Stage(0.2, 4.0)], law=law, **numbers)]
    loads = [Harmonic(0.5, {names[-1]: 1.0})]
    system = System(names, stiff, 0.02 * stiff, contacts=contacts, harmonics=loads, frequency=1.0)
    arc = flow_of(system, transition=True).integrate(coefficients_of(system), np.zeros(2 * size), 0.0, PERIOD)
    assert arc.contacts
    assert arc.modes is not None
    assert arc.transition is not None
    with patch.object(floquet.lapack, "dgeev", side_effect=AssertionError("as a dense matrix")):
        found = floquet.multipliers([arc.transition], arc.modes)
    every = np.linalg.eigvals(arc.transition)
    apart = np.abs(found[:, None] - every)
    assert len(found) == 2 * size
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-9
    assert np.allclose(np.abs(found), np.sort(np.abs(every))[::-1], rtol=0.0, atol=1e-9)
