"""A batch of states, each with its system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.ensemble.scheme import Linear
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System


@dataclass(frozen=True, eq=False)
class Batch:
    """A batch of states, each with its system.

    Parameters
    ----------
    states : shape (N, 2n)
        Positions, then velocities.
    systems
        The different systems, of equal structure.
    places : shape (N,)
        Index of the system of each state.
    """

    states: NDArray[np.float64]
    systems: tuple[System, ...]
    places: NDArray[np.intp]

    @property
    def count(self) -> int:
        """Number N of states."""
        return len(self.states)

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return np.array([coefficients_of(system) for system in self.systems])

    @cached_property
    def linear(self) -> Linear:
        """The linear part: one for all if all states have the same system, otherwise one for each state."""
        shared = len(self.systems) == 1
        return Linear(
            layout_of(self.systems[0].structure), self._coefficients if shared else self._coefficients[self.places]
        )

    @cached_property
    def pattern(self) -> bytes:
        """Coefficients that differ from zero in any of the systems, as bytes of an array of bool."""
        return (self._coefficients != 0).any(axis=0).tobytes()

    def system(self, lane: int) -> System:
        """Return the system of one state."""
        return self.systems[self.places[lane]]

    def some(self, lanes: NDArray[np.intp]) -> Batch:
        """Select some of the states."""
        return Batch(self.states[lanes], self.systems, self.places[lanes])


def batch_of(system: System, states: ArrayLike, parameters: Mapping[str, ArrayLike]) -> Batch:
    """Create a batch from states of a system, with parameters that may differ from state to state.

    Raises
    ------
    ModelError
        If the states or the parameters have the wrong shape, or a system cannot have such values.
    """
    array = _states(system, states)
    columns = {name: _column(system, name, values, len(array)) for name, values in parameters.items()}
    if not columns:
        return Batch(array, (system,), np.zeros(len(array), dtype=np.intp))
    rows, places = np.unique(np.stack(list(columns.values()), axis=1), axis=0, return_inverse=True)
    systems = tuple(system.at(dict(zip(columns, row.tolist(), strict=True))) for row in rows)
    return Batch(array, systems, places.reshape(-1))


def _states(system: System, states: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.array(states, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[-1] != 2 * system.size or not len(array) or not np.all(np.isfinite(array)):
        order = ", ".join([*system.coordinates, *(f"{name}'" for name in system.coordinates)])
        raise ModelError(
            f"states must be an array of finite numbers, a row for each trajectory with {2 * system.size} of them "
            f"({order}), not one of shape {array.shape}"
        )
    return array


def _column(system: System, name: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
    system.structure.place(name)
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{name} is {values!r}; it must be numbers, one for each trajectory") from None
    if column.shape not in ((), (count,)):
        raise ModelError(f"{name} has shape {column.shape}; there are {count} trajectories, so it must be ({count},)")
    return np.broadcast_to(column, (count,))
