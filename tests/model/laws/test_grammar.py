"""The grammar of force expressions, beside Python's own; its errors; hostile input."""

from __future__ import annotations

import math
import pickle
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gapwalk.errors import ModelError
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Formula, FormulaError, formula_of

VARIABLES = ("x", "x'", "v", "y")
NAMES = {"x": 1.25, "v": -0.75, "y": 3.0, "k": 0.5, "a": -2.0, "gap_1": 0.125}
PYTHON = {name: getattr(math, name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh", "pi")}
PYTHON |= {"abs": abs, "min": min, "max": max, "__builtins__": {}}


def value(formula: Formula, names: dict[str, float]) -> Any:
    return formula.value(names, NUMPY_FUNCTIONS, formula.modes_at(names, NUMPY_FUNCTIONS))


def read(text: str) -> Formula | FormulaError:
    try:
        return formula_of(text, VARIABLES)
    except FormulaError as error:
        return error


class Tracked(float):
    """A number that remembers the largest magnitude of all results that it had a part in."""

    largest = 0.0

    @staticmethod
    def _of(result: Any) -> Any:
        if isinstance(result, complex) or not math.isfinite(result):
            raise OverflowError
        Tracked.largest = max(Tracked.largest, abs(result))
        return Tracked(result)


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "pow", "rpow", "neg", "abs"):
    _plain = getattr(float, f"__{_name}__")
    setattr(Tracked, f"__{_name}__", lambda *those, plain=_plain: Tracked._of(plain(*map(float, those))))

spaces = st.sampled_from(["", " ", "  "])
leaves = st.one_of(st.sampled_from([*NAMES, "pi"]), st.sampled_from(["2", "1.5", ".5", "3.", "25e-2", "1E1", "0.125"]))


def _larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    functions = st.sampled_from(["sin", "cos", "exp", "tanh", "abs", "sqrt", "log"])
    return st.one_of(
        st.builds(lambda a, o, s, b: f"{a}{s}{o}{s}{b}", inner, st.sampled_from("+-*/"), spaces, inner),
        st.builds(lambda a, s: f"({s}{a})", inner, spaces),
        st.builds(lambda sign, a: f"{sign}{a}", st.sampled_from("+-"), inner),
        st.builds(lambda a, n: f"{a}**{n}", inner, st.sampled_from(["2", "3", "-1", "-2", "0", "2**2", "(4 - 1)"])),
        st.builds(lambda f, a: f"{f}({a})", functions, inner),
        st.builds(lambda f, a: f"{f}({', '.join(a)})", st.sampled_from(["min", "max"]), st.lists(inner, min_size=2)),
    )


texts = st.recursive(leaves, _larger, max_leaves=12)


@given(texts)
def test_a_formula_means_what_it_means_in_python(text: str) -> None:
    Tracked.largest = 0.0
    try:
        wanted = eval(text, PYTHON, {name: Tracked(number) for name, number in NAMES.items()})
        assume(Tracked.largest < 1e3 and math.isfinite(wanted))
    except (ArithmeticError, ValueError, TypeError):
        assume(False)
        raise
    formula = read(text)
    if isinstance(formula, FormulaError):
        assert any(
            words in formula.reason for words in ("infinite", "at most", "cannot be computed", "zero", "touches 0")
        )
        return
    assert value(formula, NAMES) == pytest.approx(wanted, rel=1e-8, abs=1e-8)
    again = formula_of(formula.text, VARIABLES)
    assert again == formula
    assert hash(again) == hash(formula)
    assert again.text == formula.text
    assert value(again, NAMES) == value(formula, NAMES)
    assert pickle.loads(pickle.dumps(formula)) == formula


@given(st.text(alphabet="xvk'23.e+-*/()^,| \n_absminmxqrt", max_size=60))
def test_any_text_is_a_formula_or_an_error_with_a_column(text: str) -> None:
    formula = read(text)
    if isinstance(formula, FormulaError):
        assert 1 <= formula.column <= len(text) + 1
        assert str(formula).splitlines()[-1].strip() == "^"
    else:
        assert read(formula.text) == formula


@given(st.text(max_size=40))
def test_any_unicode_text_is_a_formula_or_an_error(text: str) -> None:
    assert str(read(text))


def test_names_are_told_apart() -> None:
    formula = formula_of("mu*x' + k*(x - gap)*y + mu*pi", VARIABLES)
    assert formula.parameters == ("mu", "k", "gap")
    assert formula.variables == ("x'", "x", "y")
    assert formula == formula_of(" mu * x'+(k*(x-gap)*y)+mu*pi", VARIABLES)
    assert formula != formula_of("mu*x' + k*(x - gap)*y + mu*3", VARIABLES)
    assert formula != formula_of("mu*x' + k*(x - gap)*y + mu*pi", ("x", "x'"))
    assert len({formula, formula_of(formula.text, VARIABLES)}) == 1


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("", 1, 'write for example "k*x + c*v"'),
        ("  ", 1, "empty"),
        ("k*x^3", 4, "write **"),
        ("k + 2x", 6, "write 2*x"),
        ("2(x + 1)", 2, "write 2*(...)"),
        ("(x)(y)", 4, "write (...)*(...)"),
        ("x y", 3, "write x*y"),
        ("x (y)", 1, "write x*(...)"),
        ("x(1)", 1, "x is not a function: write x*(...)"),
        ("k*cosh(x)", 3, "write (exp(x) + exp(-x))/2"),
        ("arcoth(x)", 1, "The functions are sin, cos, exp, log, sqrt, tanh, abs, min, max"),
        ("tahn(x)", 1, "did you mean tanh?"),
        ("mu*sign(v)", 4, "a force that jumps with the rate is dry friction, which is a [[friction]]"),
        ("sgn(v)", 1, "dry friction"),
        ("tan(x)", 1, "write sin(x)/cos(x)"),
        ("ln(x)", 1, "write log(x)"),
        ("pow(x, 2)", 1, "write a**b"),
        ("k*(x + 1", 3, "never closed"),
        ("k*x + 1)", 8, "never opened"),
        ("max(x, 0", 4, "never closed"),
        ("k*sin", 3, "sin is a function: write sin(x)"),
        ("max + 1", 1, "write max(x, 0)"),
        ("sin()", 1, "one argument, not 0"),
        ("sin(x, y)", 1, "one argument, not 2"),
        ("1 + max(x)", 5, "two to 20 arguments, not 1"),
        ("max(x,)", 7, "')'"),
        ("1,5*x", 2, "write a decimal point: 1.5"),
        ("x, y", 2, "only min and max"),
        ("x +", 4, "the formula ends"),
        ("* x", 1, "there is '*'"),
        ("x***2", 4, "there is '*'"),
        ("x//2", 2, "write /"),
        ("x = 3", 3, "right of ="),
        ("x if v else y", 3, "write min, max or abs"),
        ("x > 0", 3, "write min, max or abs"),
        ("|x|", 1, "write abs(x)"),
        ("k·x", 2, "write *"),
        ("k − x", 3, "minus sign of the keyboard"),
        ("x²", 2, "write x**2"),
        ("π*x", 1, "write pi"),
        ("1_000*x", 2, "write 1000"),
        ("_edge", 1, "underscore"),
        ("x''", 3, "apostrophe"),
        ("k'*x", 1, "the rates are x'"),
        ("2e*x", 2, "write 2e3 or 2*e"),
        ("0x10", 2, "write 0*x10"),
        ("1.2.3", 4, "write 1.2*.3"),
        ("1e999*x", 1, "cannot be computed"),
        ("x/0", 2, "division by zero"),
        ("x + (-8)**(1/3)", 9, "cannot be computed"),
        ("x**1000", 2, "at most 100"),
        ("max(x, 0)**0.5", 10, "infinite slope"),
        ("max(0, x)**-1", 10, "infinite value"),
        ("max(x, 0)**n", 10, "the exponent n must be a number"),
        ("abs(x)**n", 7, "the exponent n must be a number"),
        ("abs(x)**.5", 7, "write a number above 1: abs(x)**1.5"),
        ("max(x, 0)**10.5", 10, "write a whole number"),
        ("min(x, 0)**1.5", 10, "write -max(-x, 0)**1.5"),
        ("sqrt(max(x, 0))", 1, "infinite slope"),
        ("log(abs(x))", 1, "infinite value"),
        ("k*sqrt((x - y)**2)", 3, "write abs(x - y) for the root of a square"),
        ("(x**2)**0.75", 7, "touches 0"),
        ("(-2)**k", 5, "the base must be positive"),
        ("x +\n  2y", 4, "line 2, column 4"),
    ],
)
def test_an_error_has_the_column_and_the_correction(text: str, column: int, words: str) -> None:
    with pytest.raises(FormulaError) as caught:
        formula_of(text, VARIABLES)
    error = caught.value
    assert words in str(error)
    assert error.column == column
    _, shown, caret = str(error).split("\n")
    assert caret.index("^") == column - 1 + 4
    assert shown.strip() in text
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.reason, again.column) == (str(error), error.reason, error.column)


def test_the_caret_stays_below_its_place_in_a_long_line() -> None:
    with pytest.raises(FormulaError, match="write") as caught:
        formula_of("x + " * 60 + "2y" + " + x" * 60, VARIABLES)
    _, shown, caret = str(caught.value).split("\n")
    assert caught.value.column == 242
    assert shown[caret.index("^") - 1 :].startswith("2y")
    assert len(shown) < 110


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x + " * 600 + "x", "2000 characters"),
        ("x+" * 600 + "x", "500 numbers, names and operations"),
        ("(" * 51 + "x" + ")" * 51, "50 parentheses"),
        ("-" * 51 + "x", "50 parentheses"),
        ("**".join(["1"] * 53), "50 parentheses"),
        ("sin(" * 51 + "x" + ")" * 51, "50 parentheses"),
        ("(" * 40 + "x" + "**9)" * 40, "at most 2000 operations"),
        ("max(" * 20 + "x - 1" + ", 0)**1.5" * 20, "at most 2000 operations"),
        ("abs(" * 20 + "x - 1" + ")**1.5" * 20, "at most 2000 operations"),
        ("max(" * 10 + "x" + ",y,x-1,x+2,v,y*x,k,m,n,p,q)" * 10, "at most 100 operations stand inside"),
        ("max(" + "x," * 20 + "x)", "two to 20 arguments"),
        ("9**9**9**9*x", "at most 100"),
        ("(" * 1999, "50 parentheses"),
        ("9" * 1999, "cannot be computed"),
    ],
)
def test_hostile_text_is_refused(text: str, words: str) -> None:
    with pytest.raises(FormulaError, match=r"(?s)" + words.replace("(", r"\(")):
        formula_of(text, VARIABLES)


def test_the_largest_formulas_are_read_and_evaluated() -> None:
    deep = formula_of("(-" * 25 + "x" + ")" * 25, VARIABLES)
    assert value(deep, NAMES) == -1.25
    wide = formula_of("+".join(["x"] * 499), VARIABLES)
    assert value(wide, NAMES) == 499 * 1.25
    several = formula_of("max(" * 9 + "x" + ", y, 1, k)" * 9, VARIABLES)
    assert value(several, NAMES) == 3.0


@pytest.mark.parametrize("variables", [("sin",), ("pi",), ("max'",)])
def test_a_variable_cannot_have_the_name_of_a_function(variables: tuple[str, ...]) -> None:
    with pytest.raises(ModelError, match="a variable cannot have the name"):
        formula_of("x", variables)


def test_a_formula_is_a_text() -> None:
    with pytest.raises(FormulaError, match="a formula is a text, not 3"):
        formula_of(3, VARIABLES)  # pyright: ignore[reportArgumentType]
