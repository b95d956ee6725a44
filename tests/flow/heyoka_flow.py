"""Flows that heyoka compiles from the same equations: the partner with which the kernel is compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from operator import mul, truediv
from typing import Any
from unittest.mock import patch
from weakref import ref

import heyoka as hy
import numpy as np

from gapwalk.flow import flow, forces
from gapwalk.flow.contact_events import COOLDOWN
from gapwalk.flow.flow import Flow
from gapwalk.taylor.integrator import Array, Outcome
from gapwalk.taylor.symbols import Symbol

_OUTCOMES = {
    hy.taylor_outcome.time_limit: Outcome.REACHED,
    hy.taylor_outcome.step_limit: Outcome.MANY_STEPS,
    hy.taylor_outcome.err_nf_state: Outcome.NOT_FINITE,
}
_OPERATIONS: dict[str, Callable[..., Any]] = {
    "sum": lambda *terms: hy.sum([*terms]),
    "product": mul,
    "quotient": truediv,
    "power": pow,
    **{name: getattr(hy, name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh")},
}


class _Translation:
    """Symbols as expressions of heyoka; some variables have other names."""

    def __init__(self, names: Mapping[Symbol, str], common: _Translation | None = None) -> None:
        self._names, self._common, self._known = names, common, dict[Symbol, Any]()

    def __call__(self, each: Symbol) -> Any:
        if self._common is not None and self._names.keys().isdisjoint(each.leaves):
            return self._common(each)
        found = self._known.get(each)
        if found is None:
            self._known[each] = found = self._translated(each)
        return found

    def _translated(self, each: Symbol) -> Any:
        match each.operation:
            case "number":
                return hy.expression(each.value)
            case "parameter":
                return hy.par[each.value]
            case "variable":
                return hy.expression(self._names.get(each, each.value))
            case "angle":
                return hy.time
            case _:
                return _OPERATIONS[each.operation](*map(self, each.arguments))


class _Call:
    """A callback of one event; each copy of an integrator has its own, with a weak reference to its owner."""

    def __init__(self, index: int) -> None:
        self.index = index
        self.owner: Callable[[], Any] = lambda: None

    def __deepcopy__(self, memo: Any) -> _Call:
        return _Call(self.index)


class _Stop(_Call):
    def __call__(self, _taylor: Any, direction: int) -> bool:
        return self.owner().answers[self.index](direction)

    def __deepcopy__(self, memo: Any) -> _Stop:
        return _Stop(self.index)


class _Turn(_Call):
    def __call__(self, taylor: Any, theta: float, _direction: int) -> None:
        self.owner().turned(self.index, theta)

    def __deepcopy__(self, memo: Any) -> _Turn:
        return _Turn(self.index)


class HeyokaProgram:
    """The arguments of `gapwalk.taylor.program.Program`, as an integrator of heyoka with all columns."""

    def __init__(
        self,
        parameters: int,
        state: Sequence[tuple[Symbol, Symbol]],
        beside: Sequence[tuple[Symbol, Symbol]] = (),
        *,
        columns: int = 0,
        lane: Sequence[tuple[Symbol, Symbol]] = (),
        forced: Sequence[Sequence[Symbol]] = (),
        events: Sequence[Symbol] = (),
        turns: Sequence[Symbol] = (),
    ) -> None:
        self.size, plain = len(state), _Translation({})
        equations = [(plain(variable), plain(rate)) for variable, rate in state]
        for column in range(columns):
            own = _Translation({variable: f"{variable.value}_{column}" for variable, _ in lane}, plain)
            place = column - (columns - len(forced))
            added = forced[place] if place >= 0 else None
            equations += [
                (own(variable), own(rate) if added is None else own(rate) + plain(added[row]))
                for row, (variable, rate) in enumerate(lane)
            ]
        equations += [(plain(variable), plain(rate)) for variable, rate in beside]
        self.taylor = hy.taylor_adaptive(
            equations,
            state=np.zeros(len(equations)),
            pars=np.zeros(parameters),
            t_events=[hy.t_event(plain(each), callback=_Stop(k), cooldown=COOLDOWN) for k, each in enumerate(events)],
            nt_events=[hy.nt_event(plain(each), _Turn(k)) for k, each in enumerate(turns)],
            tol=1e-15,
            compact_mode=True,
        )


class HeyokaIntegrator:
    """An integrator with the interface of `gapwalk.taylor.integrator.Integrator`."""

    def __init__(
        self,
        program: HeyokaProgram,
        answers: Sequence[Callable[[int], bool]],
        turn: Callable[[int, float, list[float]], None] | None = None,
    ) -> None:
        self.answers, self._turn, self._size = answers, turn, program.size
        self._taylor, self._turns = copy(program.taylor), list[list[float]]()
        self.state, self.pars = self._taylor.state, self._taylor.pars
        self._has_events = self._taylor.with_events
        for event in [*self._taylor.t_events, *self._taylor.nt_events] if self._has_events else []:
            event.callback.owner = ref(self)

    @property
    def time(self) -> float:
        return self._taylor.time

    @time.setter
    def time(self, value: float) -> None:
        self._taylor.time = value

    def reset_cooldowns(self) -> None:
        self._turns.clear()
        if self._has_events:
            self._taylor.reset_cooldowns()

    def turned(self, index: int, theta: float) -> None:
        state = self._taylor.update_d_output(theta)[: self._size].tolist()
        if self._turn is None:
            self._turns.append([float(index), theta, *state])
        else:
            self._turn(index, theta, state)

    def turns(self) -> Array:
        return np.array(self._turns).reshape(-1, 2 + self._size)

    def series(self) -> Array:
        self._taylor.step(max_delta_t=0.0, write_tc=True)
        return self._taylor.tc[: self._size]

    def propagate(
        self, stop: float, max_steps: int, longest: float, grid: Array | None = None
    ) -> tuple[Outcome, int, Array]:
        limits = {"max_steps": max_steps, "max_delta_t": longest}
        given = np.zeros(0) if grid is None else np.asarray(grid)
        try:
            if not len(given):
                outcome, _, _, steps, *_ = self._taylor.propagate_until(stop, **limits)
                return _OUTCOMES.get(outcome, Outcome.STOPPED), steps, np.empty((0, len(self.state)))
            angles = np.unique([self.time, *given, stop])
            outcome, _, _, steps, *_, found = self._taylor.propagate_grid(angles, **limits)
        except ValueError:  # a formula overflows at once, and then the time is not finite
            return Outcome.NOT_FINITE, 0, np.empty((0, len(self.state)))
        places = np.searchsorted(angles, given)
        return _OUTCOMES.get(outcome, Outcome.STOPPED), steps, found[places[places < len(found)]]


class HeyokaEvaluator:
    """Functions with the interface of `gapwalk.taylor.integrator.Evaluator`."""

    def __init__(self, functions: Sequence[Symbol], variables: Sequence[Symbol]) -> None:
        translated = _Translation({})
        self._function = hy.cfunc([translated(each) for each in functions], [translated(each) for each in variables])

    def __call__(self, given: Array) -> Array:
        return np.asarray(self._function(np.ascontiguousarray(given)))


@contextmanager
def heyoka() -> Iterator[None]:
    """Context in which flows are made, and integrate, by heyoka."""
    with (
        patch.object(flow, "Program", HeyokaProgram),
        patch.object(flow, "Integrator", HeyokaIntegrator),
        patch.object(forces, "Evaluator", HeyokaEvaluator),
    ):
        yield


class HeyokaFlow(Flow):
    """A flow by heyoka."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        with heyoka():
            super().__init__(*arguments, **options)

    def _lend(self, call: Callable[[Any], Any]) -> Any:
        with heyoka():
            return super()._lend(call)
