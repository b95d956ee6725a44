"""Compiled functions of a state by which friction and held stops are decided, and derivatives of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.constraints import Constraint
from gapwalk.flow.equations import Equations
from gapwalk.flow.flow_cache import kept

Array = NDArray[np.float64]


class CompiledReadings:
    """The compiled readings of some equations, which all their integrators share, and derivatives of them."""

    def __init__(self, equations: Equations) -> None:
        self._equations = equations
        self._table: tuple[Any, Array] | None = None  # the last one, with what it is for
        self.state = [*equations.positions, *equations.velocities, *equations.extensions]
        self.readings, self.used = self._of_one_array(
            [*self.state[: 2 * equations.layout.structure.size], *equations.readings]
        )
        """The readings, and the run-time parameters on which they depend."""
        memories = equations.layout.structure.memories
        self.follows = any(equations.creep(contact) != hy.expression(0.0) for contact in memories)
        """True if a spring follows a limit that is not constant: its rate depends on the modes of all friction."""

    def _of_one_array(self, functions: list[hy.expression]) -> tuple[Any, slice]:
        """Compile functions of the state, the angle and run-time parameters, in one array; return which parameters.

        heyoka calls such a function twice as fast as one of a state, a time and parameters.
        """
        used = {int(str(each).removeprefix("p")) for function in functions for each in hy.get_params(function)}
        places = range(min(used, default=0), max(used, default=-1) + 1)
        angle, numbers = hy.make_vars("angle"), {hy.par[k]: hy.make_vars(f"number{k - places.start}") for k in places}
        given = hy.subs(functions, {hy.time: angle, **numbers})
        return hy.cfunc(given, vars=[*self.state, angle, *numbers.values()]), slice(places.start, places.stop)

    @cached_property
    def decisions(self) -> tuple[Any, slice]:
        """The function of `Equations.decisions`, and the run-time parameters on which it depends."""
        return self._of_one_array(self._equations.decisions)

    @cached_property
    def _is_plain(self) -> bool:
        """True if deflections alone decide which stages are closed, and nothing else has a mode."""
        layout = self._equations.layout
        varies = any(slots.sway is not None or any(stage.waves for stage in slots.stages) for slots in layout.contacts)
        return not (self._equations.modes or layout.cycles or self._equations.formulas or varies)

    def along(self, coefficients: Array, states: Array, thetas: Array, slips: Array) -> Array | None:
        """Return the columns of the accelerations, then `Readings.friction` of all contacts, at samples of a motion.

        Shapes: `states`, `thetas` (samples, state_size), (samples,); `slips` (contacts that are friction,).
        """
        if not self._is_plain:
            return None
        equations, n, size = self._equations, self._equations.layout.structure.size, states.shape[1]
        numbers = np.zeros(equations.first_coefficient + len(equations.active))
        numbers[equations.first_slip : equations.first_slip + len(slips)] = slips
        numbers[equations.first_stick : equations.first_stick + len(slips)] = slips == 0
        numbers[equations.length] = 1.0
        numbers[equations.first_coefficient :] = coefficients[equations.active]
        given = np.empty((size + 1 + self.used.stop - self.used.start, len(states)))
        given[:size], given[size], given[size + 1 :] = states.T, thetas, numbers[self.used][:, None]
        first = size + 1 - self.used.start + equations.first_switch
        for row, (contact, place) in enumerate(equations.switches, start=first):
            if size < row < len(given):
                slots = equations.layout.contacts[contact]
                stage = slots.stages[place]
                deflections = states[:, :n] @ coefficients[slots.deflection]
                given[row] = stage.sign * deflections > coefficients[stage.clearance]
        return self.readings(given)[: equations.layout.accelerations.shape[1] + 3 * len(slips)].T

    def table(self, coefficients: Array, held: Sequence[int]) -> Array:
        """Return the rows by which accelerations, then reactions, follow from the columns of `along`."""
        key = coefficients[1:].tobytes(), tuple(held)
        if self._table is None or self._table[0] != key:
            layout = self._equations.layout
            own = Constraint(layout, coefficients, held).coefficients()
            found = np.vstack((own[layout.accelerations], own[layout.reactions]))
            found[:, : 2 * layout.structure.size + len(layout.contacts)] *= -1.0
            self._table = key, found
        return self._table[1]

    @cached_property
    def _tangents(self) -> Any:
        variables, expressions = self._equations.tangents
        with kept(f"{self._equations.text} tangents"):
            return hy.cfunc(expressions, vars=variables)

    def tangents(self, state: Array, parameters: Array, theta: float, changes: Sequence[Array]) -> Array:
        """Return the derivatives of what the accelerations consist of, and of the limits, along some changes."""
        function = self._tangents
        given = parameters[: function.nparams]
        return np.array([function(np.concatenate((state, each)), pars=given, time=theta) for each in changes])
