"""Formulas as symbolic expressions, for tests: their values and derivatives, and motions under their force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Formula

HEYOKA: dict[str, Any] = {
    **{name: getattr(hy, name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh")},
    "pow": lambda base, exponent: (base if isinstance(base, hy.expression) else hy.expression(base)) ** exponent,
}


def evaluated(formula: Formula, numbers: Mapping[str, float], modes: Sequence[Any], by: str) -> tuple[float, float]:
    """Evaluate a formula and its derivative by one of its names, in given modes."""
    names = [*numbers]
    symbols = {name: hy.make_vars(f"symbol_{name}") for name in names}
    switches = [hy.make_vars(f"mode_{index}") for index in range(len(modes))]
    value = formula.value(symbols, HEYOKA, switches) + 0.0
    function = hy.cfunc([value, hy.diff(value, symbols[by])], [*symbols.values(), *switches])
    first, second = function(np.array([*(numbers[name] for name in names), *modes]))
    return float(first), float(second)


class Passage(NamedTuple):
    """A motion of one mass up to some time: its state, transition matrix, events, and number of steps."""

    time: float
    state: NDArray
    transition: NDArray
    events: list[tuple[int, int, float]]
    steps: int


def move(
    formula: Formula,
    numbers: Mapping[str, float],
    start: tuple[float, float],
    until: float | None = None,
    drive: Any = 0.0,
    modes: Sequence[float] | None = None,
) -> Passage:
    """Move a unit mass by ``x'' = drive - formula``, with an event at each guard; by default until one opens the first.

    The transition matrix is that of the smooth pieces, which is exact where the force is continuous.
    """
    motion, crossed = _integrator(formula, tuple(numbers), drive)
    if modes is None:
        plain = {**numbers, "x": start[0], "v": start[1], "x'": start[1]}
        modes = [float(mode) for mode in formula.modes_at(plain, NUMPY_FUNCTIONS)]
    crossed.clear()
    motion.reset_cooldowns()
    motion.time, motion.state[:] = 0.0, [*start, 1.0, 0.0, 0.0, 1.0]
    motion.pars[:] = [*modes, *numbers.values()]
    steps = 0
    while until is None or motion.time < until:
        outcome, _ = motion.step() if until is None else motion.step(max_delta_t=until - motion.time)
        steps += 1
        assert outcome != hy.taylor_outcome.err_nf_state
        assert steps < 100_000
        if until is None and crossed and crossed[-1][:2] == (0, -1):
            break
    state = motion.state.copy()
    return Passage(motion.time, state[:2], state[2:].reshape(2, 2).T, [*crossed], steps)


@cache
def _integrator(formula: Formula, names: tuple[str, ...], drive: Any) -> tuple[Any, list[tuple[int, int, float]]]:
    """Compile an integrator with the modes and the numbers as parameters, and the list of its events."""
    x, v = hy.make_vars("x", "v")
    switches = [hy.par[index] for index in range(formula.mode_count)]
    numbers = {name: hy.par[len(switches) + index] for index, name in enumerate(names)}
    environment = {**numbers, "x": x, "v": v, "x'": v}
    force = formula.value(environment, HEYOKA, switches)
    equations = [(x, v), (v, drive - force)]
    for a, b in (hy.make_vars(f"a{j}", f"b{j}") for j in range(2)):
        equations += [(a, b), (b, -hy.diff(force, x) * a - hy.diff(force, v) * b)]
    crossed: list[tuple[int, int, float]] = []

    def flip(index: int) -> Any:
        def callback(integrator: Any, direction: int) -> bool:
            integrator.pars[index] = 1.0 if direction > 0 else 0.0
            found.append((index, direction, integrator.time))
            return True

        found = crossed
        return callback

    guards = formula.guards(environment, HEYOKA, switches)
    events = [hy.t_event(guard, callback=flip(index)) for index, guard in enumerate(guards)]
    pars = [0.0] * (len(switches) + len(numbers))
    start = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]
    return hy.taylor_adaptive(equations, start, pars=pars, t_events=events, compact_mode=True), crossed
