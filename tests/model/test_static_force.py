"""Static forces of any law: rests and small motions beside closed forms and SciPy."""

import warnings

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import gapwalk as gw
from gapwalk.cli.modes_command import variation_lines
from gapwalk.errors import ModelError
from gapwalk.flow.forces import accelerations
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import force, stop
from gapwalk.model.equilibria import real_roots
from gapwalk.model.modes import find_modes
from gapwalk.model.static_force import StaticForce, formulas_of
from tests.tiers import keeps

MICRO = 1e-6  # another unit of length


def one(text: str, *more: gw.Contact, mean: float = 0.0, stiffness: float = 0.0, **numbers: float) -> gw.System:
    """A mass with a force by a formula."""
    contacts = [force("spring", {"x": 1.0}, text, **numbers), *more]
    loads = [gw.Harmonic(0.1, {"x": 1.0})]
    return gw.System(["x"], [[stiffness]], contacts=contacts, mean={"x": mean}, harmonics=loads)


def formula(text: str, **numbers: float) -> StaticForce:
    (found,) = formulas_of(one(text, **numbers))
    return found


def positions(system: gw.System) -> list[float]:
    return sorted(each.position.item() for each in gw.find_equilibria(system).equilibria)


def test_a_tangent_is_exact() -> None:
    found = formula("k*sin(x) - mu*(1 - x**2)*v", k=2.0, mu=0.3).at(np.array([0.4]))
    assert found.force == pytest.approx(2.0 * np.sin(0.4), rel=1e-15)
    assert found.stiffness.item() == pytest.approx(2.0 * np.cos(0.4), rel=1e-15)
    assert found.damping.item() == pytest.approx(-0.3 * (1.0 - 0.16), rel=1e-15)


def test_several_deflections_have_a_slope_each() -> None:
    spring = force("f", {"r": {"p": 1.0}, "s": {"q": 2.0, "p": -1.0}}, "a*r*s**2", acts_on={"p": 3.0}, a=0.5)
    system = gw.System(["p", "q"], np.eye(2), contacts=[spring])
    (found,) = formulas_of(system)
    tangent = found.at(np.array([0.3, 0.7]))  # r = 0.3, s = 1.1
    assert tangent.stiffness == pytest.approx([0.5 * 1.21, 2 * 0.5 * 0.3 * 1.1], rel=1e-14)
    assert found.polynomial == {(1, 2, 0, 0): 0.5}
    many = found.at(np.array([[0.3, 0.7], [0.0, 0.0]]))
    assert many.stiffness[0] == pytest.approx(tangent.stiffness)
    assert many.force.tolist() == [pytest.approx(float(tangent.force)), 0.0]


@pytest.mark.parametrize(
    ("text", "polynomial", "statics"),
    [
        (
            "(x + 1)**3",
            {(3, 0): 1.0, (2, 0): 3.0, (1, 0): 3.0, (0, 0): 1.0},
            {(3,): 1.0, (2,): 3.0, (1,): 3.0, (0,): 1},
        ),
        ("x + 2*v*abs(v)", None, {(1,): 1.0}),
        ("x*v", {(1, 1): 1.0}, {}),
        ("sin(x)", None, None),
        ("sin(2)*0 + x/4", {(1, 0): 0.25}, {(1,): 0.25}),
        ("x + abs(x)", None, None),
    ],
)
def test_polynomials_are_recognised(text: str, polynomial, statics) -> None:
    assert formula(text).polynomial == polynomial
    assert formula(text).statics == statics


def test_where_a_formula_has_no_value_there_is_none() -> None:
    for text in ("log(x)", "1/x", "sqrt(x - 1)", "sqrt(x)", "v*sqrt(x) + sqrt(v)"):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert not formula(text).at(np.zeros(1)).is_finite
    assert formula("x*sqrt(x)").at(np.zeros(1)).is_finite  # its slope is 1.5 sqrt(x)
    assert formula("log(x)").at(np.array([[-1.0], [2.0]])).is_finite.tolist() == [False, True]


@pytest.mark.parametrize("unit", [1.0, MICRO, 1e4])
def test_a_double_well_has_three_rests(unit: float) -> None:
    system = one("k*x + b*x**3", k=-1.0, b=4.0 / unit**2)
    rest = gw.find_equilibria(system)
    assert rest.complete
    assert [each.position.item() / unit for each in rest.equilibria] == pytest.approx([-0.5, 0.5, 0.0], abs=1e-14)
    assert [each.stable for each in rest.equilibria] == [True, True, False]
    frequencies = [find_modes(system, each).frequencies.item() for each in rest.equilibria]
    assert frequencies[:2] == pytest.approx([np.sqrt(2.0)] * 2)  # the slope is k + 3 b x^2 = 2
    assert np.isnan(frequencies[2])


def test_helmholtz_and_duffing_under_load_have_the_roots_of_a_cubic() -> None:
    system = one("k*x + a*x**2 + b*x**3", k=1.0, a=3.0, b=2.0, mean=-0.02)
    roots = np.sort(np.roots([2.0, 3.0, 1.0, 0.02]).real)
    assert np.isreal(np.roots([2.0, 3.0, 1.0, 0.02])).all()
    assert positions(system) == pytest.approx(roots.tolist(), rel=1e-12)


def test_a_stop_takes_a_well_s_place() -> None:
    system = one("k*x + b*x**3", stop("stop", {"x": 1.0}, 0.5, 5.0), k=-1.0, b=1.0)
    rest = gw.find_equilibria(system)
    at_stop = brentq(lambda x: -x + x**3 + 5.0 * (x - 0.5), 0.5, 1.0, xtol=1e-15)
    assert rest.complete
    assert positions(system) == pytest.approx([-1.0, 0.0, at_stop], abs=1e-14)
    assert str(rest.equilibria[0]) == f"spring at {at_stop:.4g}, stop closed+"


@pytest.mark.parametrize("load", [0.0, 1.0])
def test_a_pendulum_has_many_rests_and_those_nearest_are_listed(load: float) -> None:
    rest = gw.find_equilibria(one("k*sin(x)", k=2.0, mean=load))
    first = np.arcsin(load / 2.0)
    expected = [turn * np.pi + (first if turn % 2 == 0 else -first) for turn in range(-5, 6)]
    expected = sorted(expected, key=abs)[:9]
    assert not rest.complete
    assert sorted(each.position.item() for each in rest.equilibria) == pytest.approx(sorted(expected), abs=1e-13)
    assert all(each.stable == (np.cos(each.position.item()) > 0) for each in rest.equilibria)


@pytest.mark.parametrize("unit", [1.0, MICRO])
def test_a_logarithm_has_its_rest(unit: float) -> None:
    system = one("k*log(x/a)", k=2.0, a=unit, mean=1.0)
    assert positions(system) == pytest.approx([unit * np.exp(0.5)], rel=1e-14)
    with pytest.raises(ModelError, match="'spring' has no finite value and slope at zero deflection"):
        find_modes(system, "closed")


def test_drag_restores_nothing() -> None:
    free = gw.find_equilibria(one("c*v*abs(v)", c=0.3))
    assert free.complete
    assert [each.loose for each in free.equilibria] == [1]
    (held,) = gw.find_equilibria(one("c*v*abs(v)", c=0.3, mean=1.0, stiffness=4.0)).equilibria
    assert held.position.item() == pytest.approx(0.25)
    assert not gw.find_equilibria(one("c*v*abs(v)", c=0.3, mean=1.0))


def test_stability_includes_damping_kinks_and_what_has_no_slope() -> None:
    def states(text: str, **numbers: float) -> list[tuple[bool, int]]:
        return [(each.stable, each.loose) for each in gw.find_equilibria(one(text, **numbers)).equilibria]

    assert states("x - mu*(1 - x**2)*v", mu=0.1) == [(False, 0)]
    assert states("b*x**3", b=1.0) == [(True, 0)]
    assert states("b*x**3", b=-1.0) == [(False, 0)]
    assert states("max(-x, 2*x)") == [(False, 0)]
    assert states("min(x, 2*x)") == [(True, 0)]
    assert states("k*max(x - 1, 0)**1.5", k=2.0) == [(True, 1)]


def test_varied_numbers_have_their_mean_and_displacements_are_zero() -> None:
    still = one("k*x + b*x**3", k=1.0, b=0.5, mean=0.4)
    loads = [
        gw.Harmonic(0.5, varies={"spring.k": 1.0}, name="a"),
        gw.Harmonic(0.5, varies={"spring.deflection": 1.0}, name="b"),
    ]
    contacts = [force("spring", {"x": 1.0}, "k*x + b*x**3", k=1.0, b=0.5)]
    system = gw.System(["x"], [[0.0]], contacts=contacts, mean={"x": 0.4}, harmonics=loads)
    assert positions(system) == positions(still)
    assert variation_lines(still) == []
    (line,) = variation_lines(system)
    assert "spring.k at the mean value, spring.deflection without prescribed displacement" in line


def _random(seed: int) -> tuple[gw.System, float]:
    rng = np.random.default_rng(seed)
    texts = (
        "b*x**3 - a*x",
        "a*sin(b*x)",
        "a*x + b*x*abs(x)",
        "b*max(x - a, 0)**1.5 + x",
        "a*x*exp(-b*x**2) + b*v*x**2",
    )
    n, unit = int(rng.integers(1, 4)), 10.0 ** float(rng.choice([-6.0, 0.0, 3.0]))
    names = [f"q{number}" for number in range(n)]
    contacts = [
        force(f"f{k}", {name: rng.normal() / unit for name in names}, str(rng.choice(texts)), a=a, b=b)
        for k, (a, b) in enumerate(rng.uniform(0.3, 2.0, (2, 2)).tolist())
    ]
    if n > 1:
        along = {"q0": 1.0 / unit, "q1": 0.3 / unit}
        both = {"r": {"q0": 1.0 / unit}, "s": {"q1": 1.0 / unit}}
        contacts.append(force("g", both, "c*r*s**2 + d*r", acts_on=along, c=float(rng.normal()), d=0.2))
    contacts.append(stop("stop", {"q0": 1.0}, 0.7 * unit, 3.0 / unit**2))
    part = rng.normal(size=(n, n))
    stiffness = (0.3 * part @ part.T + 0.1 * np.eye(n)) / unit**2
    mean = {name: 0.3 * float(rng.normal()) / unit for name in names}
    return gw.System(names, stiffness, 0.1 * stiffness, contacts=contacts, mean=mean), unit


@keeps("7")
@pytest.mark.parametrize("seed", range(8))
def test_random_systems_rest_where_scipy_finds_it(seed: int) -> None:
    """Every rest is one by the forces of the flow; SciPy finds few others; slopes and stability by differences."""
    system, unit = _random(seed)
    layout, coefficients, n = layout_of(system.structure), coefficients_of(system), system.size

    def pull(x: np.ndarray, v: np.ndarray | float = 0.0) -> np.ndarray:
        return unit * accelerations(layout, coefficients, 0.0, unit * np.asarray(x), np.zeros(n) + unit * v)

    rest = gw.find_equilibria(system)
    found = [each.position / unit for each in rest.equilibria]
    for each, x in zip(rest.equilibria, found, strict=True):
        assert np.abs(pull(x)).max() < 1e-10
        step, ways = 1e-5, np.eye(n)
        stiffness = -np.transpose([(pull(x + step * way) - pull(x - step * way)) / (2 * step) for way in ways])
        damping = -np.transpose([(pull(x, step * way) - pull(x, -step * way)) / (2 * step) for way in ways])
        np.testing.assert_allclose(each.stiffness * unit**2, stiffness, atol=1e-5 * np.abs(stiffness).max())
        np.testing.assert_allclose(each.damping * unit**2, damping, atol=1e-5 * np.abs(damping).max())
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness / unit**2, -damping / unit**2]])
        values = np.linalg.eigvals(matrix)
        assert each.stable == (values.real.max() < 1e-6 * np.abs(values).max())
    rng, others = np.random.default_rng(seed), 0
    for start in rng.uniform(-2.0, 2.0, (40, n)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            x, _, converged, _ = fsolve(pull, start, full_output=True, xtol=1e-12)
        if converged == 1 and np.abs(pull(x)).max() < 1e-10 and len(found) < 9:
            others += not any(np.abs(x - known).max() < 1e-5 for known in found)
    assert others == 0


def test_real_roots_are_those_of_the_factors() -> None:
    rng = np.random.default_rng(3)
    for scale in (1e-6, 1.0, 1e5):
        roots = np.sort(rng.normal(size=4)) * scale
        polynomial = np.polynomial.Polynomial.fromroots(roots) * np.polynomial.Polynomial([scale**2, 0.0, 1.0])
        assert real_roots(polynomial) == pytest.approx(roots.tolist(), rel=1e-8)
    assert real_roots(np.polynomial.Polynomial([1.0, 0.0, 1.0])) == []
    assert real_roots(np.polynomial.Polynomial([0.0, 0.0, 0.0, 2.0])) == [0.0]
    assert real_roots(np.polynomial.Polynomial([0.0, -2.0, 1.0])) == pytest.approx([0.0, 2.0])
