"""Flows of many motions, of one system or each with its own parameter values; here integrated one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.strobe import Strobe
from gapwalk.errors import FlowError
from gapwalk.flow.motion import integrate, switch_names
from gapwalk.model.system import System

_SAMPLES = 512  # per forcing period, for peaks of forces


class ContactFigures(NamedTuple):
    """Contact forces and impacts of many motions.

    Attributes
    ----------
    states : shape (count, 2n)
        States at the end.
    peaks : shape (count, contacts)
        Largest magnitude of each contact force.
    impacts : shape (count, contacts)
        Closings of a contact per forcing period, on both sides together.
    """

    states: NDArray[np.float64]
    peaks: NDArray[np.float64]
    impacts: NDArray[np.float64]


class ManyMotions(Protocol):
    """The flow of many motions; the state of a motion that cannot be integrated becomes nan."""

    @property
    def error(self) -> float:
        """The largest error over one forcing period that was measured, relative to the size of the motion."""
        ...

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """Advance the states, shape (count, 2n), by some forcing periods."""
        ...

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """Return the states 1, 2, ... forcing periods after the first `after` ones, shape (periods, count, 2n)."""
        ...

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """Compute contact forces and impacts over some forcing periods."""
        ...

    def part(self, which: NDArray[np.intp]) -> ManyMotions:
        """Return the flow of some of the motions."""
        ...


def finite_rows(states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the states, shape (count, 2n), of motions that have not diverged."""
    return np.asarray(np.isfinite(states).all(axis=1))


class ExactMotions:
    """The exact flow of many motions, integrated one after the other.

    Parameters
    ----------
    system
        The system.
    values
        Parameter values by name, each of shape (count,), one for each motion; without any, the number of motions may
        vary.
    """

    error = 0.0

    def __init__(self, system: System, values: Mapping[str, NDArray[np.float64]] | None = None) -> None:
        self.system, self.values = system, dict(values or {})

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """See `ManyMotions.advance`."""
        ends = np.full(states.shape, np.nan)
        for index in np.flatnonzero(finite_rows(states)).tolist():
            with suppress(FlowError):  # it stays nan
                ends[index] = Strobe(self._system(index)).arc(states[index], periods).state
        return ends

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """See `ManyMotions.strobes`."""
        track = np.empty((periods, *states.shape))
        states = self.advance(states, after) if after else states
        for period in range(periods):
            track[period] = states = self.advance(states, 1)
        return track

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """See `ManyMotions.contacts`."""
        ends = np.full(states.shape, np.nan)
        peaks = np.full((len(states), len(self.system.structure.contacts)), np.nan)
        impacts = np.full(peaks.shape, np.nan)
        for index in np.flatnonzero(finite_rows(states)).tolist():
            try:
                motion = integrate(self._system(index), states[index], periods, _SAMPLES)
            except FlowError:
                continue
            ends[index] = np.concatenate((motion.q[-1], motion.v[-1]))
            peaks[index] = np.abs(motion.forces).max(axis=0)
            impacts[index] = _closings(self.system, motion.events) / periods
        return ContactFigures(ends, peaks, impacts)

    def part(self, which: NDArray[np.intp]) -> ExactMotions:
        """See `ManyMotions.part`."""
        return ExactMotions(self.system, {name: values[which] for name, values in self.values.items()})

    def _system(self, index: int) -> System:
        if not self.values:
            return self.system
        return self.system.at({name: float(values[index]) for name, values in self.values.items()})


def _closings(system: System, events) -> NDArray[np.float64]:
    """Count the closings of the innermost stages of each contact."""
    places = {contact.name: index for index, contact in enumerate(system.structure.contacts)}
    innermost: dict[tuple[str, int], int] = {}
    for switch, (name, _, side) in enumerate(switch_names(system)):
        innermost.setdefault((name, side), switch)
    counts = np.zeros(len(places))
    for (name, _), switch in innermost.items():
        counts[places[name]] += sum(event.enters and event.switch == switch for event in events)
    return counts
