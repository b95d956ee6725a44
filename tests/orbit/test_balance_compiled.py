"""How the kernels of harmonic balance are compiled: only for harmonic balance, and wherever they can be kept."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from gapwalk.orbit.harmonic_balance import kernels as compiled


@pytest.mark.slow
def test_shooting_and_the_command_load_no_kernels() -> None:
    program = (
        "import sys, gapwalk, gapwalk.cli, gapwalk.studies; from gapwalk.paper import case; "
        "orbit = gapwalk.find_orbit(case('9b'), frequency=1.9); "
        "gapwalk.follow(orbit, 'frequency', to=1.85); gapwalk.Balance(); sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_kernel_is_compiled_where_nothing_can_be_kept(monkeypatch) -> None:
    asked = []

    def njit(*signature, cache: bool = False, **options):
        asked.append(cache)
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: function

    monkeypatch.setattr(compiled, "numba", SimpleNamespace(njit=njit))
    assert compiled.kernel("f8(f8)")(abs)(-2.0) == 2.0
    assert asked == [True, False]


def test_other_errors_of_the_compiler_are_not_hidden(monkeypatch) -> None:
    def njit(*signature, **options):
        raise TypeError("no such type")

    monkeypatch.setattr(compiled, "numba", SimpleNamespace(njit=njit))
    with pytest.raises(TypeError, match="no such type"):
        compiled.kernel("f8(f8)")(abs)


SMALL = """
import numpy as np
from gapwalk.orbit.harmonic_balance.kernels import kernel, part

@part
def term(x, k):
    return np.cos(k * x) / (k + 0.1) + x * np.exp(-k * x)

@kernel("f8(f8[::1])")
def total(x):
    found = 0.0
    for k in range(x.size):
        found = found * x[k] + term(x[k], k)
    return found

print(total(np.random.default_rng(1).normal(size=50)).hex())
"""


@pytest.mark.slow
def test_a_kernel_that_was_kept_computes_the_same_bits(tmp_path) -> None:
    script = tmp_path / "small.py"
    script.write_text(SMALL, encoding="utf-8")
    twice_the_same([sys.executable, str(script)], tmp_path / "kept")


@pytest.mark.slow
def test_kernels_that_were_kept_compute_the_same_bits(tmp_path) -> None:
    """A part that is called may be another copy in the process that compiles it than in those that load it."""
    program = (
        "import gapwalk as gw; from gapwalk.paper import case; "
        "start = gw.find_orbit(case('9b'), frequency=1.0); method = gw.Balance(8, error=1.0); "
        "branch = gw.follow(start, 'frequency', to=0.8, method=method); "
        "print([(point.x.tobytes().hex(), point.orbit.multipliers.tobytes().hex()) for point in branch.points])"
    )
    twice_the_same([sys.executable, "-c", program], tmp_path)


def twice_the_same(command: list[str], folder: Path) -> None:
    """What a program prints as it compiles its kernels is what it prints as it loads them."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": os.pathsep.join(sys.path)}

    def run() -> bytes:
        return subprocess.run(command, check=True, capture_output=True, env=environment).stdout

    compiling = run()
    assert list(folder.rglob("*.nbc"))
    assert run() == compiling
