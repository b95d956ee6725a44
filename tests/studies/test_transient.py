"""Whether a transient has settled, and what it has settled to, judged on paths whose future is known."""

import math

import numpy as np
import pytest

from gapwalk.attractors.settle import has_settled
from gapwalk.errors import ModelError
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.studies.sweep_study import Band, Patience, bands_of, let_settle, regime_of
from tests.systems import clutch, linear

BOX = np.ones(2)


def decay(rate: complex, length: int, amplitude: float = 1.0) -> np.ndarray:
    """A path that comes to rest, by a factor of `rate` a forcing period, shape (length + 1, 2)."""
    path = amplitude * rate ** np.arange(length + 1)
    return np.column_stack((path.real, path.imag))


def logistic(growth: float, length: int) -> np.ndarray:
    """The iterates of the logistic map after its transient, shape (length + 1, 1)."""
    x = 0.3
    for _ in range(1000):
        x = growth * x * (1.0 - x)
    path = [x]
    for _ in range(length):
        path.append(growth * path[-1] * (1.0 - path[-1]))
    return np.array(path)[:, None]


@pytest.mark.parametrize("angle", [0.0, math.pi, 1.0, 2.0 * math.pi / 3.0])
@pytest.mark.parametrize("size", [0.5, 0.9, 0.99, 0.998])
def test_a_decay_has_settled_when_it_is_as_close_as_asked(size, angle) -> None:
    rate = size * np.exp(1j * angle)
    lengths = [round(64 * 1.25**k) for k in range(25)]
    length = next(n for n in lengths if has_settled(decay(rate, n), 12, 1e-6))
    distance = size**length
    assert distance < 3e-6
    shorter = lengths[lengths.index(length) - 1] if length > lengths[0] else 0
    assert shorter == 0 or size ** (shorter / 1.6) > 1e-6  # and it is not waited for much longer


def test_a_growth_has_not_settled() -> None:
    for rate in (1.01, -1.01, 1.1, 1.01j):
        assert not has_settled(decay(complex(rate), 200, 1e-7), 12, 1e-6)


def test_chaos_and_tori_have_settled_once_there_is_evidence() -> None:
    for path in (decay(np.exp(1j), 1000), logistic(3.9, 1000)):
        assert any(has_settled(path[:length], 12, 1e-6) for length in (250, 400, 600, 1000))
        assert not has_settled(path[:100], 12, 1e-6)


def test_steady_but_small_returns_are_distrusted() -> None:
    slow = decay(0.9999, 400, 0.1)  # it still has to go 0.1, in steps of 1e-5
    assert not has_settled(slow, 12, 1e-6)


@pytest.mark.parametrize("growth", [3.2, 3.5, 3.55, 3.83])
def test_the_regime_is_the_smallest_period(growth) -> None:
    period = {3.2: 2, 3.5: 4, 3.55: 8, 3.83: 3}[growth]  # of the logistic map, see any textbook
    assert regime_of(logistic(growth, 100), np.ones(1), 12) == f"period {period}"


def test_what_does_not_return_is_not_periodic() -> None:
    assert regime_of(logistic(3.9, 100), np.ones(1), 12) == "not periodic"
    assert regime_of(decay(np.exp(1j), 100), BOX, 12) == "not periodic"
    assert regime_of(decay(np.exp(2j * math.pi / 13), 100), BOX, 12) == "not periodic"  # period 13 was not asked for
    assert regime_of(decay(np.exp(2j * math.pi / 13), 100), BOX, 13) == "period 13"


def test_bands_lie_between_the_values() -> None:
    bands = bands_of(np.array([0.0, 1.0, 2.0, 4.0, 5.0]), ["a", "a", "b", "", "a"])
    assert bands == (Band("a", 0.0, 1.5, 2), Band("b", 1.5, 3.0, 1), Band("a", 4.5, 5.0, 1))


def test_a_linear_system_settles_to_its_closed_form() -> None:
    system = linear()
    found = let_settle(flow_of(system), coefficients_of(system), np.zeros(4), np.ones(4), 4, Patience(tolerance=1e-8))
    assert found.is_settled
    assert np.abs(found.state - steady_state(system)).max() < 3e-8


def test_patience_ends(monkeypatch) -> None:
    system = clutch(frequency=1.9)
    patience = Patience(shortest=20, longest=24)
    found = let_settle(flow_of(system), coefficients_of(system), np.zeros(4), np.ones(4), 4, patience)
    assert not found.is_settled
    assert found.periods == 24


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"shortest": 0}, "shortest is 0; it must be an integer >= 1"),
        ({"longest": 1.5}, "longest is 1.5; it must be an integer"),
        ({"shortest": 100, "longest": 99}, "longest is 99; it must be at least 100"),
        ({"tolerance": 0.0}, "tolerance is 0.0; it must lie between"),
    ],
)
def test_a_patience_that_makes_no_sense(wrong, message) -> None:
    with pytest.raises(ModelError, match=message):
        Patience(**wrong)


def steady_state(system) -> np.ndarray:
    """The state of a linear system at theta = 0 from its complex amplitudes."""
    values, n = dict(system.parameters), system.size

    def matrix(name: str) -> np.ndarray:
        block = system.structure.block(name, n, n)
        return system.values[block].reshape(n, n)

    mass, damping, stiffness = (matrix(name) for name in ("mass", "damping", "stiffness"))
    position = np.linalg.solve(stiffness, system.values[system.structure.block("mean", n)]).astype(complex)
    velocity = np.zeros(n, dtype=complex)
    for harmonic in system.structure.harmonics:
        speed = harmonic.order * system.frequency
        load = system.values[system.structure.block(f"{harmonic.name}.acts_on", n)]
        force = values[f"{harmonic.name}.amplitude"] * np.exp(1j * values[f"{harmonic.name}.phase"]) * load
        amplitude = np.linalg.solve(stiffness - speed**2 * mass + 1j * speed * damping, force)
        position += amplitude
        velocity += 1j * speed * amplitude
    return np.concatenate((position.real, velocity.real))
