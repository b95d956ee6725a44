"""Brent's method: the same places as SciPy's, bit for bit, and no slow imports before they are needed."""

import math
import random
import subprocess
import sys

import pytest
from scipy.optimize import brentq

from gapwalk.bracketed_root import find_root, zero_between_signs
from gapwalk.errors import ConvergenceError


def functions(number: int):
    """A function with a zero in its range, with any size of its values: smooth, steep, flat, or a jump."""
    chance = random.Random(number)
    place, bend = chance.uniform(-1.0, 1.0), chance.uniform(-2.0, 2.0)
    size = 10.0 ** chance.choice((0, 0, -200, 200))
    kinds = (
        lambda x: size * (x - place) * (1.0 + bend * bend * x * x),
        lambda x: size * math.tanh(30.0 * (x - place)),
        lambda x: size * (x - place) ** 5,
        lambda x: math.copysign(size, x - place),
        lambda x: math.expm1(3.0 * x) - math.expm1(3.0 * place),
    )
    ends = place - chance.uniform(0.01, 3.0), place + chance.uniform(0.01, 3.0)
    errors = 10.0 ** chance.uniform(-15, -2), max(1e-15, 10.0 ** chance.uniform(-15, -3))
    return kinds[number % len(kinds)], ends, errors, chance.choice((5, 20, 100))


@pytest.mark.parametrize("first", range(0, 1000, 250))
def test_the_places_are_those_of_scipy(first: int) -> None:
    for number in range(first, first + 250):
        function, ends, (absolute, relative), most = functions(number)
        theirs, ours = [], []
        place, report = brentq(
            lambda x, f=function, seen=theirs: seen.append(x) or f(x),
            *ends,
            xtol=absolute,
            rtol=relative,
            maxiter=most,
            full_output=True,
            disp=False,
        )
        root = find_root(
            lambda x, f=function, seen=ours: seen.append(x) or f(x),
            *ends,
            absolute=absolute,
            relative=relative,
            most=most,
        )
        assert (root.place, root.converged, ours) == (place, report.converged, theirs), number


@pytest.mark.parametrize("ends", [(0.0, 1.0), (-1.0, 0.0)])
def test_an_end_may_be_the_zero(ends: tuple[float, float]) -> None:
    assert find_root(lambda x: x, *ends) == (0.0, True)


def test_what_has_no_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="equal signs at both ends of the interval: 2 and 5"):
        find_root(lambda x: 1.0 + x * x, 1.0, 2.0)
    with pytest.raises(ValueError, match=r"has no value at 1\.0"):
        find_root(lambda x: math.nan if x == 1.0 else -1.0, 0.0, 1.0)
    with pytest.raises(ConvergenceError, match="between 0 and 1 in 3 iterations"):
        zero_between_signs(lambda x: x**3 - 0.1, 0.0, 1.0, most=3)


def test_a_branch_needs_no_slow_import() -> None:
    """It took a quarter of a second of CPU time before the first special point."""
    script = (
        "import sys, gapwalk as gw\n"
        "orbit = gw.find_orbit(gw.paper.case('13'), frequency=0.9)\n"
        "branch = gw.follow(orbit, 'frequency', 0.8)\n"
        "print(len(branch.special_points), *({'scipy.optimize'} & {*sys.modules}))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    count, *loaded = done.stdout.split()
    assert int(count) > 0
    assert loaded == []
