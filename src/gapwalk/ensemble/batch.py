"""Input and output of the batch integrator: a batch of states with their systems, options, and results."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.ensemble.scheme import Linear
from gapwalk.ensemble.start import check_stops
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System

MOST_STEPS = 20_000
"""Steps per forcing period above which the exact flow is faster."""


@dataclass(frozen=True, eq=False)
class Batch:
    """A batch of states, each with its system."""

    #: shape (N, state size): Positions, then velocities, then extensions of Jenkins elements.
    states: NDArray[np.float64]
    systems: tuple[System, ...]  #: The different systems, of equal structure.
    places: NDArray[np.intp]  #: shape (N,): Index of the system of each state.

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


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """Accuracy and threads of the batch integrator.

    Examples
    --------
    >>> gw.analysis.BatchOptions(error=1e-6, threads=1).thread_count
    1
    """

    #: The allowed error over one forcing period: the root mean square, over the trajectories and periods that are
    #: compared with the exact flow, of the largest difference in any component of the state, in units of the largest
    #: value of that component.
    error: float = 1e-4
    #: Steps per forcing period. By default they are chosen for `error`; if given, the error is only reported.
    steps: int | None = None
    sample: int = 16  #: Number of trajectories that are compared with the exact flow, at several times of each run.
    threads: int | None = None  #: Number of threads; by default all local cores. The result does not depend on it.

    def __post_init__(self) -> None:
        if not 1e-10 <= self.error <= 0.1:
            raise ModelError(
                f"error is {self.error}; it must be a number from 1e-10 to 0.1. For motions exact to rounding use "
                "gapwalk.integrate"
            )
        for name, least, most in (("steps", 8, MOST_STEPS), ("sample", 1, 10_000), ("threads", 1, 4096)):
            value = getattr(self, name)
            if value is None and name != "sample":
                continue
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise ModelError(f"{name} is {value!r}; it must be an integer from {least} to {most}")

    @property
    def thread_count(self) -> int:
        """Number of threads."""
        if self.threads is not None:
            return self.threads
        if hasattr(os, "sched_getaffinity"):  # not on macOS
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1


@dataclass(frozen=True, eq=False)
class BatchSurvey:
    """Extremes, forces and impacts of trajectories over the last forcing periods of a run; NaN if one diverged.

    Examples
    --------
    >>> flow = gw.parallel.batch_flow_of(system.at(frequency=1.1))
    >>> flow.run(np.zeros((1, 2)), periods=40, survey=8).survey.impacts[0, 0]  # positive side, negative side
    array([1., 0.])
    """

    periods: int  #: Number of surveyed forcing periods.
    #: low, high: shape (N, n): Smallest and largest value of each coordinate.
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    #: shape (N, contacts): Largest magnitude of each contact force; 0 for a rigid stop, whose impacts have no force.
    peak_force: NDArray[np.float64]
    #: shape (N, contacts, 2): Contacts per forcing period: entries into the innermost stage of each contact on the
    #: positive and on the negative side. A contact that lasts less than a step may be missed. Of the impacts of a rigid
    #: stop that follow each other within a step, the first is counted.
    impacts: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchRun:
    """Many trajectories after some forcing periods, at a stated accuracy.

    Examples
    --------
    >>> found = gw.parallel.batch_flow_of(system).run(np.zeros((3, 2)), periods=4, every=2)
    >>> found.strobes.shape, found.error < 1e-4
    ((2, 3, 2), True)
    """

    #: shape (N, state size): Positions, then velocities, then extensions of Jenkins elements, at the end; NaN for
    #: trajectories that diverged.
    states: NDArray[np.float64]
    ran_away: NDArray[np.bool_]  #: shape (N,), bool: True for trajectories that diverged.
    #: shape (noted, N, state size), or None: States every so many forcing periods, if requested.
    strobes: NDArray[np.float64] | None
    survey: BatchSurvey | None  #: Extremes, contacts and largest forces, if requested.
    #: Error over one forcing period, from comparison with the exact flow on trajectories of this run; see
    #: `BatchOptions`.
    error: float
    #: The largest error of a compared trajectory and period: near-grazing and unstable motions amplify it.
    worst: float
    trials: int  #: Number of comparisons (one trajectory over one period each).
    steps: int  #: Steps per forcing period.


def batch_of(system: System, states: ArrayLike, parameters: Mapping[str, ArrayLike]) -> Batch:
    """Create a batch from states of a system, with parameters that may differ from state to state."""
    array = _states(system, states)
    columns = {name: _column(system, name, values, len(array)) for name, values in parameters.items()}
    batch = Batch(array, (system,), np.zeros(len(array), dtype=np.intp))
    if columns:
        rows, places = np.unique(np.stack(list(columns.values()), axis=1), axis=0, return_inverse=True)
        systems = tuple(system.at(dict(zip(columns, row.tolist(), strict=True))) for row in rows)
        batch = Batch(array, systems, places.reshape(-1))
    check_stops(batch.linear, array)
    return batch


def _states(system: System, states: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.array(states, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[-1] != system.state_size or not len(array) or not np.all(np.isfinite(array)):
        extensions = [f"extension of {system.structure.contacts[index].name}" for index in system.structure.memories]
        order = ", ".join([*system.coordinates, *(f"{name}'" for name in system.coordinates), *extensions])
        raise ModelError(
            f"states must be an array of finite numbers, a row for each trajectory with {system.state_size} of them "
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
