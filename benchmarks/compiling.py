"""How long compiled code lets a first answer wait: without anything kept, with it, and for each new system."""

from __future__ import annotations

import tempfile
from collections.abc import Callable

from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.start import once
from benchmarks.stopwatch import cpu_seconds
from gapwalk import find_orbit, paper
from gapwalk.flow import flow as flows

GROUP = "Compiled code"
_KERNELS = ["-m", "gapwalk.orbit.harmonic_balance.compile_kernels"]
_COLD = 3  # repeats; each is long enough to measure with few
_FIRST_MOTION = """\
import gapwalk as gw
gw.integrate(gw.paper.case("13").at(frequency=0.5), [0.0] * 4, periods=1)
"""

Build = Callable[[], object]


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    system = find_orbit(paper.case("13"), frequency=0.5).system
    repeats = min(effort.repeats, _COLD)
    return [
        first_motion_row(),
        Row(GROUP, "figure 13: state", build_seconds(lambda: flows.flow_of(system), repeats)),
        Row(
            GROUP,
            "figure 13: state, transition matrix, one parameter",
            build_seconds(lambda: flows.flow_of(system, "frequency", transition=True), repeats),
        ),
        kernels_row(),
    ]


def first_motion_row() -> Row:
    """Measure the first motion of a new process: with an empty cache folder, and from what that process kept."""
    with tempfile.TemporaryDirectory() as folder:
        cold, warm = (once(["-c", _FIRST_MOTION], XDG_CACHE_HOME=folder) for _ in range(2))
    note = "`make` compiles the kernel of the flow while it installs; it serves every system"
    return Row(GROUP, "first motion of a new process", warm, cold, "empty cache", (Target(0.9),), note=note)


def kernels_row() -> Row:
    """Measure a process that compiles all kernels, and one that finds them kept."""
    with tempfile.TemporaryDirectory() as folder:
        cold, warm = (once(_KERNELS, NUMBA_CACHE_DIR=folder, XDG_CACHE_HOME=folder) for _ in range(2))
    return Row(GROUP, "all kernels: kept", warm, cold, "cold", (Target(2.0),))


def build_seconds(build: Build, repeats: int = _COLD) -> float:
    """Return the CPU seconds to make the flow of a system that is new to the process."""
    least = float("inf")
    for _ in range(repeats):
        flows._compile.cache_clear()
        least = min(least, cpu_seconds(build))
    return least
