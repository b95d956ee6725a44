"""How long a flow takes to compile, the first time ever and from heyoka's cache on disk; and harmonic balance."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import heyoka as hy

from benchmarks.clutch import ScipyClutch
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.start import once
from benchmarks.stopwatch import cpu_seconds, fastest
from gapwalk import find_orbit, paper
from gapwalk.flow import flow as flows

GROUP = "Compiling the flow of figure 13"
_KERNELS = ["-m", "gapwalk.orbit.harmonic_balance.compile_kernels"]
_COLD = 3  # repeats; a compilation is long enough to measure with few

Build = Callable[[], object]


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    orbit = find_orbit(paper.case("13"), frequency=0.5)
    system, clutch = orbit.system, ScipyClutch(orbit.system)
    plain = fastest(lambda: clutch.period(orbit.state, 0.5), effort)
    full = fastest(lambda: clutch.period_with_sensitivities(orbit.state, 0.5), effort)
    repeats = min(effort.repeats, _COLD)
    return [
        *_rows("state", lambda: flows.flow_of(system), plain, repeats),
        *_rows(
            "state, transition matrix, one parameter",
            lambda: flows.flow_of(system, "frequency", transition=True),
            full,
            repeats,
        ),
        kernels_row(),
    ]


def kernels_row() -> Row:
    """Measure a process that compiles the kernels of harmonic balance, and one that finds them stored."""
    with tempfile.TemporaryDirectory() as folder:
        cold = once(_KERNELS, NUMBA_CACHE_DIR=folder)
        warm = once(_KERNELS, NUMBA_CACHE_DIR=folder)
    note = "`make` compiles them while it installs, so that the first harmonic balance finds them stored"
    return Row(GROUP, "kernels of harmonic balance: stored", warm, cold, "cold", (Target(2.0),), note=note)


def cold_seconds(build: Build, repeats: int = 1) -> float:
    """Return the CPU seconds to build and compile a flow on a machine without any cache."""
    with _disk_cache(None):
        return _least(build, repeats)


def warm_seconds(build: Build, repeats: int = _COLD) -> float:
    """Return the CPU seconds to build a flow whose compiled code is in a cache on disk of our own."""
    with tempfile.TemporaryDirectory() as folder, _disk_cache(folder):
        _least(build, 1)
        return _least(build, repeats)


def _rows(what: str, build: Build, period: float, repeats: int) -> list[Row]:
    cold, warm = cold_seconds(build, repeats), warm_seconds(build)
    counts = {"periods by SciPy": cold / period}
    note = f"as long as {cold / period:.0f} of these forcing periods take SciPy"
    return [Row(GROUP, f"{what}: cold", cold, counts=counts, note=note), Row(GROUP, f"{what}: from the cache", warm)]


def _least(build: Build, repeats: int) -> float:
    least = float("inf")
    for _ in range(repeats):
        _forget()
        least = min(least, cpu_seconds(build))
    return least


def _forget() -> None:
    """Empty gapwalk's cache of flows and heyoka's cache of compiled code, both of this process."""
    flows._compile.cache_clear()
    hy.llvm_state.clear_memcache()


@contextmanager
def _disk_cache(folder: str | None) -> Iterator[None]:
    """Let heyoka keep compiled code in this folder, or nowhere, within the context."""
    state = hy.llvm_state
    enabled, path = state.get_diskcache_enabled(), state.get_diskcache_path()
    state.set_diskcache_enabled(folder is not None)
    if folder is not None:
        state.set_diskcache_path(folder)
    try:
        yield
    finally:
        state.set_diskcache_path(path)
        state.set_diskcache_enabled(enabled)
        _forget()
