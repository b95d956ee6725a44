"""Values, modes and derivatives of formulas: by numbers, arrays, symbols and source text."""

from __future__ import annotations

import itertools
import math
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Formula, formula_of
from gapwalk.model.laws.law import Symbols
from tests.model.laws.symbolic import HEYOKA, evaluated
from tests.model.laws.test_grammar import NAMES, VARIABLES, read, texts

SMOOTH = "k*x + a*x**3 - k*(1 - x**2)*v"
KINKS = (
    "k*abs(x - gap)*v",
    "max(x - gap, 0)**2 + min(x + gap, 0)",
    "max(x, v, k, -x)*min(x, v)",
    "max(abs(x), abs(v)) - abs(max(x, 0) - v**2)",
    "k*max(x - gap, 0)**1.5*(1 + a*v) - max(-x - gap, 0)**2.2",
    "abs(v)**1.75*tanh(v/gap) + exp(-(x/gap)**2)",
    "sin(x)*cos(v)/sqrt(1 + x**2) + log(2 + cos(x))**-2",
    "max(0, x*v - max(x, v)/(1 + x**2))**(5/2)",
    "(3 + tanh(x))**k + 2**v",
)


def at(text: str, **names: Any) -> Any:
    formula = formula_of(text, VARIABLES)
    return formula.value(names, NUMPY_FUNCTIONS, formula.modes_at(names, NUMPY_FUNCTIONS))


def python(text: str, names: dict[str, float]) -> float:
    """Evaluate a formula with Python's own arithmetic."""
    known = {name: getattr(math, name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh", "pi")}
    return eval(text, known, names)


@pytest.mark.parametrize("text", KINKS)
def test_arrays_give_what_python_gives(text: str) -> None:
    x, v = np.random.default_rng(1).normal(size=(2, 4, 50))
    numbers = {"k": 1.5, "a": 0.3, "gap": 0.4}
    wanted = [python(text, {"x": p, "v": q, **numbers}) for p, q in zip(x.flat, v.flat, strict=True)]
    np.testing.assert_allclose(at(text, x=x, v=v, **numbers).ravel(), wanted, rtol=1e-12, atol=1e-13)
    single = at(text, x=float(x[0, 0]), v=float(v[0, 0]), **numbers)
    assert np.ndim(single) == 0
    assert single == pytest.approx(wanted[0], rel=1e-12)


@pytest.mark.parametrize("text", [SMOOTH, *KINKS])
@pytest.mark.parametrize("width", [None, 0.3])
def test_a_complex_step_gives_the_derivative_of_the_expression(text: str, width: float | None) -> None:
    formula, rng = formula_of(text, VARIABLES), np.random.default_rng(2)
    numbers = {"k": 1.5, "a": 0.3, "gap": 0.4} | ({"_edge": width} if width else {})
    for name, (x, v) in itertools.product(("x", "v", "k", "gap"), rng.normal(size=(6, 2)).tolist()):
        if name not in (*formula.variables, *formula.parameters):
            continue
        real = {**numbers, "x": x, "v": v}
        stepped: dict[str, Any] = {**real, name: real[name] + 1e-30j}
        modes = formula.modes_at(stepped, NUMPY_FUNCTIONS)
        value = formula.value(stepped, NUMPY_FUNCTIONS, modes)
        exact, slope = evaluated(formula, real, modes, by=name)
        assert value.real == pytest.approx(exact, rel=1e-12, abs=1e-13)
        assert value.imag / 1e-30 == pytest.approx(slope, rel=1e-11, abs=1e-11)


@given(texts, texts, texts, st.sampled_from(["min({}, {}, {})", "abs({}) - max({}, {})", "max({}*{}, abs({}), 1)"]))
def test_the_modes_are_the_signs_of_the_guards(first: str, second: str, third: str, kinks: str) -> None:
    formula = read(kinks.format(first, second, third))
    assume(isinstance(formula, Formula) and formula.mode_count > 0)
    assert isinstance(formula, Formula)
    with np.errstate(all="ignore"):
        modes = formula.modes_at(NAMES, NUMPY_FUNCTIONS)
        guards = formula.guards(NAMES, NUMPY_FUNCTIONS, modes)
        assert len(modes) == len(guards) == formula.mode_count
        assume(np.all(np.isfinite(guards)))
        assert modes == [float(guard > 0.0) for guard in guards]
        for index in range(len(modes)):  # a guard depends on modes before its own
            others = [*modes[:index], *(1.0 - mode for mode in modes[index:])]
            assert formula.guards(NAMES, NUMPY_FUNCTIONS, others)[index] == guards[index]


@pytest.mark.parametrize(
    ("text", "guards"),
    [
        ("max(x - gap, 0) + abs(gap - x) + max(x, gap)*min(gap, x)", [-0.75]),
        ("max(-k*x, 0) + max(k*x, 0)", [2.0]),
        ("abs(x)*abs(-x)", [1.0]),
        ("max(x, 0)**1.5 + max(x, 0)**2.5", [1.0, 1.0]),
        ("abs(x)**1.5", [1.0, 1.0, -1.0]),
        ("max(x + v, v)", [1.0]),
        ("max(2, 3)*x + max(x, x)", []),
        ("max(abs(x), v, 0)", [1.0, 4.0, 1.0]),
        ("max(k, gap)*x", [0.25 - 2.0]),
    ],
)
def test_kinks_at_one_place_have_one_mode(text: str, guards: list[float]) -> None:
    formula, numbers = formula_of(text, VARIABLES), {"x": 1.0, "v": -3.0, "k": 2.0, "gap": 0.25}
    modes = formula.modes_at(numbers, NUMPY_FUNCTIONS)
    assert formula.guards(numbers, NUMPY_FUNCTIONS, modes) == guards
    for x in (-2.0, -0.5, 0.0, 0.25, 0.5):
        wanted = python(text, {**numbers, "x": x})
        assert at(text, **{**numbers, "x": x}) == pytest.approx(wanted, rel=1e-14, abs=0.0)


def test_whole_powers_are_exact_at_0() -> None:
    formula, x = formula_of("x**3", VARIABLES), hy.make_vars("x")
    derivatives = [formula.value({"x": x}, HEYOKA, [])]
    for _ in range(3):
        derivatives.append(hy.diff(derivatives[-1], x))
    function = hy.cfunc([hy.expression(0.0) + each for each in derivatives], [x])
    assert function([0.0]).tolist() == [0.0, 0.0, 0.0, 6.0]
    assert at("x**3", x=0.0 + 1e-30j).imag == pytest.approx(0.0, abs=1e-80)
    assert at("x**-3", x=-2.0) == -0.125
    assert at("x**0", x=0.0) == 1.0


def test_a_fractional_power_of_a_positive_part_is_exact() -> None:
    u = np.array([-3.0, -1e-300, -0.0, 0.0, 1e-300, 1e-12, 0.3, 2.0, 1e3])
    wanted = np.where(u > 0.0, np.abs(u) ** 1.5, 0.0)
    assert np.array_equal(at("max(x, 0)**1.5", x=u), wanted)
    assert np.array_equal(at("max(0, x)**(3/2)", x=u, _edge=0.0), wanted)
    np.testing.assert_allclose(at("abs(x)**1.5", x=u), np.abs(u) ** 1.5, rtol=1e-15)
    slopes = at("max(x, 0)**1.5", x=u + 1e-40j).imag / 1e-40
    np.testing.assert_allclose(slopes, np.where(u > 0.0, 1.5 * np.abs(u) ** 0.5, 0.0), rtol=1e-14, atol=1e-19)


@pytest.mark.parametrize("power", [1.0625, 1.5, 2.5, 9.5])
def test_the_edge_joins_smoothly(power: float) -> None:
    text, width = f"max(x, 0)**{power}", 0.125
    x = hy.make_vars("x")
    formula = formula_of(text, VARIABLES)
    inside, outside = (
        [hy.cfunc([each], [x]) for each in _derivatives(formula, x, width, modes)] for modes in ((1.0, 0.0), (1.0, 1.0))
    )
    for order in range(3):
        wanted = math.prod(power - j for j in range(order)) * width ** (power - order)
        assert inside[order]([width])[0] == pytest.approx(wanted, rel=1e-9)
        assert outside[order]([width])[0] == pytest.approx(wanted, rel=1e-13)
    assert inside[0]([0.0])[0] == 0.0
    off = [hy.cfunc([each], [x]) for each in _derivatives(formula, x, width, (0.0, 0.0))]
    for u in (-1e6, -1.0, 0.0):
        assert [each([u])[0] for each in off] == [0.0, 0.0, 0.0]  # neither infinite nor not a number
    near = np.linspace(0.0, width, 200)
    np.testing.assert_allclose(at(text, x=near, _edge=width), near**power, atol=1e-3 * width**power)
    np.testing.assert_array_equal(at(text, x=-near, _edge=width), 0.0)
    far = np.linspace(1.01, 30.0, 99) * width
    np.testing.assert_array_equal(at(text, x=far, _edge=width), far**power)


def _derivatives(formula: Formula, x: Any, width: float, modes: tuple[float, ...]) -> list[Any]:
    switches = [hy.par[index] for index in range(len(modes))]
    given = {switch: hy.expression(mode) for switch, mode in zip(switches, modes, strict=True)}
    found = [formula.value({"x": x, "_edge": hy.par[9]}, HEYOKA, switches)]
    for _ in range(2):
        found.append(hy.diff(found[-1], x))
    return [hy.subs(each, {**given, hy.par[9]: hy.expression(width)}) + 0.0 * x for each in found]


def test_edges_may_have_widths_of_their_own() -> None:
    formula = formula_of("max(x, 0)**1.5 + max(v, 0)**1.5 + abs(x)**2.5", VARIABLES)
    assert formula.edge_widths == ("x", "v")
    numbers = {"x": 0.1, "v": 0.1, "_edge": (0.2, 0.01)}
    modes = formula.modes_at(numbers, NUMPY_FUNCTIONS)
    assert modes == [1.0, 0.0, 1.0, 1.0, 0.0]
    assert formula.guards(numbers, NUMPY_FUNCTIONS, modes) == pytest.approx([0.1, -0.1, 0.1, 0.09, -0.3])


def test_the_places_where_a_formula_ends_are_listed() -> None:
    formula = formula_of("sqrt( x)*log(k) + (x - v)**a + sqrt(2) + 2**a", VARIABLES)
    assert [tuple(edge) for edge in formula.edges] == [("sqrt", "x", 1), ("log", "k", 10), ("**", "x - v", 19)]
    first, _, last = (edge.words for edge in formula.edges)
    assert "sqrt of a negative number, at column 1" in first
    assert "sqrt((x)**2 + 1e-6)" in first
    assert "write max(x - v, 0)**1.5" in last
    formula_of("sqrt((x)**2 + 1e-6) + max(x - v, 0)**1.5", VARIABLES)  # what they say can be written


def test_symbols_give_the_closed_form_of_a_polynomial() -> None:
    formula = formula_of("(k*x + a*x**3)/2 - k*(1 - x**2)*v + v*(2*k)", VARIABLES)
    symbols = {name: Symbols.of(name) for name in ("x", "v", "k", "a")}
    force = formula.value(symbols, {}, [])
    assert force.products == {
        (("k",), ("x",)): 0.5,
        (("a",), ("x",), ("x",), ("x",)): 0.5,
        (("k",), ("v",)): 1.0,
        (("k",), ("v",), ("x",), ("x",)): 1.0,
    }


@pytest.mark.parametrize("text", ["k/x", "x**-2", "k/(1 + x)"])
def test_a_quotient_of_symbols_is_refused(text: str) -> None:
    with pytest.raises(TypeError):
        formula_of(text, VARIABLES).value({name: Symbols.of(name) for name in ("x", "k")}, {}, [])


class Source(str):
    """Arithmetic that writes source text, as that of a compiled kernel."""

    __slots__ = ()

    def __add__(self, other: object) -> Source:
        return Source(f"({self} + {other})")

    def __radd__(self, other: object) -> Source:
        return Source(f"({other} + {self})")

    def __sub__(self, other: object) -> Source:
        return Source(f"({self} - {other})")

    def __rsub__(self, other: object) -> Source:
        return Source(f"({other} - {self})")

    def __mul__(self, other: object) -> Source:
        return Source(f"({self} * {other})")

    def __rmul__(self, other: object) -> Source:
        return Source(f"({other} * {self})")

    def __truediv__(self, other: object) -> Source:
        return Source(f"({self} / {other})")

    def __rtruediv__(self, other: object) -> Source:
        return Source(f"({other} / {self})")

    def __neg__(self) -> Source:
        return Source(f"(-{self})")


@pytest.mark.parametrize("text", [SMOOTH, *KINKS])
def test_a_formula_writes_source_text(text: str) -> None:
    formula, numbers = formula_of(text, VARIABLES), {"k": 1.5, "a": 0.3, "gap": 0.4, "x": 0.9, "v": -0.7}
    modes = formula.modes_at(numbers, NUMPY_FUNCTIONS)
    functions = {name: lambda *those, name=name: Source(f"{name}({', '.join(map(str, those))})") for name in HEYOKA}
    symbols = [Source(f"m{index}") for index in range(len(modes))]
    source = formula.value({name: Source(name) for name in numbers}, functions, symbols)
    names = {**numbers, **{str(symbol): mode for symbol, mode in zip(symbols, modes, strict=True)}}
    assert eval(source, dict(NUMPY_FUNCTIONS), names) == pytest.approx(python(text, numbers), rel=1e-13)


def test_real_and_complex_arrays_have_the_same_modes() -> None:
    x: NDArray = np.linspace(-1.0, 1.0, 11)
    formula = formula_of("max(x, 0)*abs(x - 0.2)", VARIABLES)
    real, complex_ = (formula.modes_at({"x": each}, NUMPY_FUNCTIONS) for each in (x, x + 1e-30j))
    np.testing.assert_array_equal(real, complex_)
