"""Source text written by arithmetic, run as Python, against the arithmetic of floats."""

import math

import numpy as np
import pytest

from gapwalk.ensemble.force_source import FUNCTIONS, Sheet, Switch, Term, clipped, floor, smooth_step
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, formula_of


def run(sheet: Sheet, result: Term, **values: float) -> float:
    names = {"np": np, **values}
    exec("\n".join(sheet.lines(result)), names)
    return names[result.text] if result.text in names else values[result.text]


@pytest.mark.parametrize(
    "text",
    [
        "x + y - 2*x/y", "2 - x", "2/x", "-x**3 + y**-2", "sin(x)*cos(y) + exp(-x) - log(y)", "sqrt(y)*tanh(x)",
        "abs(x - y)", "max(x, y, 2)", "min(x - 1, -y)", "max(x, 0)**1.5 + max(-x, 0)**1.3", "y**0.5 + 2**x + y**x",
        "abs(abs(x) - 1)", "x**0 + 0*x + (x - x)", "min(exp(800*x), 3) + min(1/x, 3)", "abs(x)**2.5",
    ],
)  # fmt: skip
@pytest.mark.parametrize(("x", "y"), [(0.3, 1.7), (-0.8, 0.4), (1.0, 1.0)])
def test_a_formula_writes_lines_of_its_value(text, x, y):
    formula, sheet = formula_of(text, ("x", "y")), Sheet()
    terms = {name: sheet.name(name) for name in ("x", "y")}
    modes = [0.0] * formula.mode_count
    for mode in range(formula.mode_count):
        modes[mode] = Switch.of(formula.guards(terms, FUNCTIONS, modes)[mode])
    value = formula.value(terms, FUNCTIONS, modes)
    numbers = {"x": x, "y": y}
    with np.errstate(over="ignore"):
        expected = formula.value(numbers, NUMPY_FUNCTIONS, formula.modes_at(numbers, NUMPY_FUNCTIONS))
        found = run(sheet, value, **numbers) if isinstance(value, Term) else value
    assert found == pytest.approx(expected, rel=1e-14, abs=1e-14)


def test_lines_that_nothing_needs_are_left_out_and_equal_ones_are_written_once():
    sheet = Sheet()
    x = sheet.name("x")
    x / 3.0
    assert sheet.lines((x * x) + (x * x)) == ["e1 = x * x", "e2 = e1 + e1"]
    assert run(sheet, clipped(x) + floor(x), x=2.5) == 3.0


@pytest.mark.parametrize("t", [0.0, 0.21, 0.5, 0.99, -1.37])
def test_samples_of_a_smoothed_jump_sum_to_its_integral(t):
    """Against integrals of 1 and of s, of a wave that decays, and with the order of the error."""
    nodes = np.arange(-40.0, 41.0)
    samples = smooth_step(nodes - t, lambda u: np.clip(u, 0.0, 1.0))
    low, high = nodes < -30, nodes > 30
    assert samples[low].tolist() == [0.0] * low.sum()
    assert samples[high] == pytest.approx(1.0, abs=1e-15)
    errors = []
    for h in (0.2, 0.1, 0.05):
        times = np.arange(-2000, 2001) * h
        sums = h * np.sum(smooth_step(times / h - t, lambda u: np.clip(u, 0.0, 1.0)) * np.exp(-((times - 0.3) ** 2)))
        errors.append(abs(sums - math.sqrt(math.pi) / 2 * math.erfc(t * h - 0.3)))
    assert errors[0] < 6e-4
    assert errors[1] < errors[0] / 6 or errors[1] < 1e-6
    assert errors[2] < errors[1] / 6 or errors[2] < 1e-6
