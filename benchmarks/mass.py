"""Many trajectories of figure 15: the batch integrator compared with a hand-written SIMD kernel, and with SciPy."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint

from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.simd import STEPS, SimdClutch
from benchmarks.stopwatch import cpu_seconds, fastest, side_by_side
from gapwalk import System, paper
from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.ensemble import kernel_source as kernels
from gapwalk.ensemble.batch_flow import batch_of
from gapwalk.ensemble.kernel_source import Form, Source
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of

GROUP = "Batch integrator of figure 15 at W = 0.45, a trajectory and forcing period"
_TRAJECTORIES = 1024
_COMPARED = 200  # trajectories that are compared with the exact flow
_SCIPY_TOLERANCE = 1e-6
_SPREAD = 1e-6  # of the frequencies, where each trajectory has its own


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    system = paper.case("15").at(frequency=0.45)
    states = np.random.default_rng(15).uniform((-4, -4, -2, -2), (4, 4, 2, 2), (_TRAJECTORIES, 4))
    return [
        measure_core(system, states, effort),
        measure_scipy(system, states, effort),
        measure_parameters(system, states, effort),
        measure_threads(system, states, effort),
        measure_compiling(system),
        measure_loading(system),
    ]


def measure_core(system: System, states: NDArray[np.float64], effort: Effort) -> Row:
    """Measure one core, including the checks of the error; the baseline has a different error."""
    flow, baseline, periods = batch_flow_of(system, BatchOptions(threads=1)), SimdClutch(system), effort.mass_periods
    exact = _exact(system, states[:_COMPARED])
    mine = _error(flow.run(states, 1).states[:_COMPARED], exact)
    theirs = _error(baseline.run(states, 1)[:_COMPARED], exact)
    run = flow.run(states, periods)
    seconds, other = side_by_side([lambda: flow.run(states, periods), lambda: baseline.run(states, periods)], effort)
    share = periods * len(states)
    note = (
        f"{run.steps} steps a period; stated error {run.error:.2g}, of the largest value of each component. Over these "
        f"states' first period the rms error is {mine:.2g}, that of the baseline ({STEPS} steps) {theirs:.2g}"
    )
    targets = (Target(0.3e-6), Target(1.0, "ratio"))
    counts = {"steps": run.steps, "stated error": run.error, "rms error": mine, "rms error of the baseline": theirs}
    return Row(GROUP, "one core", seconds / share, other / share, "SIMD RK4, numba", targets, counts, note)


def measure_scipy(system: System, states: NDArray[np.float64], effort: Effort) -> Row:
    """Measure the same compared with SciPy's LSODA, one trajectory after the other."""
    flow, periods = batch_flow_of(system, BatchOptions(threads=1)), effort.mass_periods
    slope, state = _slope(system), states[0]
    ends = np.array([0.0, 2.0 * np.pi / system.frequency])

    def theirs() -> NDArray[np.float64]:
        return odeint(slope, state, ends, rtol=_SCIPY_TOLERANCE, atol=_SCIPY_TOLERANCE)[-1]

    error = _error(theirs(), _exact(system, state[None])[0])
    seconds, baseline = side_by_side([lambda: flow.run(states, periods), theirs], effort)
    note = f"LSODA from Python at a tolerance of {_SCIPY_TOLERANCE:g}; its rms error over this period is {error:.2g}"
    each, targets = seconds / (periods * len(states)), (Target(1000.0, "ratio"),)
    return Row(GROUP, "one core, beside SciPy", each, baseline, "odeint", targets, note=note)


def measure_parameters(system: System, states: NDArray[np.float64], effort: Effort) -> Row:
    """Measure trajectories with different frequencies, as for a regime map."""
    flow, periods = batch_flow_of(system, BatchOptions(threads=1)), effort.mass_periods
    frequencies = system.frequency + _SPREAD * np.arange(len(states))

    def ours() -> None:
        flow.run(states, periods, parameters={"frequency": frequencies})

    return Row(GROUP, "one core, a system for each trajectory", fastest(ours, effort) / (periods * len(states)))


def measure_threads(system: System, states: NDArray[np.float64], effort: Effort) -> Row:
    """Measure the wall time of two threads compared with one."""
    periods = effort.mass_periods
    one, two = (
        _least_wall(lambda count=count: batch_flow_of(system, BatchOptions(threads=count)).run(states, periods), effort)
        for count in (1, 2)
    )
    share = periods * len(states)
    note = "wall time of both, which says something only while two cores are free"
    return Row(GROUP, "two threads", two / share, one / share, "one thread", (Target(1.8, "ratio"),), note=note)


def measure_compiling(system: System) -> Row:
    """Measure the compilation of the kernel from scratch."""
    text = Source(_form(system)).text

    def ours() -> None:
        kernels._machine_code(text)

    ours()
    return Row(GROUP, "compiling the kernel", min(cpu_seconds(ours) for _ in range(3)), targets=(Target(3.0),))


def measure_loading(system: System) -> Row:
    """Measure the loading of the kernel from the disk, as in the second process that needs it."""
    form = _form(system)

    def ours() -> None:
        kernels._compile.cache_clear()
        kernels.kernel_of(form)

    ours()
    return Row(GROUP, "loading a kernel that is kept", min(cpu_seconds(ours) for _ in range(5)))


def _form(system: System) -> Form:
    crowd = batch_of(system, np.zeros((1, 2 * system.size)), {})
    return Form(system.structure, crowd.pattern, crowd.linear.basis is not None, True, False)


def _least_wall(work: Callable[[], object], effort: Effort) -> float:
    least = float("inf")
    for _ in range(effort.repeats):
        begun = time.perf_counter()
        work()
        least = min(least, time.perf_counter() - begun)
    return least


def _exact(system: System, states: NDArray[np.float64]) -> NDArray[np.float64]:
    flow, coefficients = flow_of(system), coefficients_of(system)
    return np.array([flow.integrate(coefficients, state).state for state in states])


def _error(found: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean((found - exact) ** 2)))


def _slope(system: System) -> Callable[[NDArray[np.float64], float], tuple[float, ...]]:
    """Return the right-hand side over time, in plain floats."""
    (k11, k12), (k21, k22) = system.matrix("stiffness").tolist()
    (c11, c12), (c21, c22) = system.matrix("damping").tolist()
    m1, m3, n1, n3 = (system[name] for name in ("mean.q1", "mean.q3", "stage2.force.q1", "stage2.force.q3"))
    b, beta = system["stage2.clearance"], system["stage2.impact_damping"]
    amplitude, frequency, cosine = system["harmonic1.amplitude"], system.frequency, np.cos

    def slope(z: NDArray[np.float64], t: float) -> tuple[float, ...]:
        q1, q3, v1, v3 = z.tolist()
        g = q1 - b if q1 > b else q1 + b if q1 < -b else 0.0
        f = g + beta * abs(g) * v1
        a1 = m1 + amplitude * cosine(frequency * t) - k11 * q1 - k12 * q3 - c11 * v1 - c12 * v3 - n1 * f
        return v1, v3, a1, m3 - k21 * q1 - k22 * q3 - c21 * v1 - c22 * v3 - n3 * f

    return slope
