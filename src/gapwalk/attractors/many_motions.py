"""Flows of many motions, of one system or each with its own parameter values, for basins and regime maps.

`ExactMotions` integrates one motion after the other. `BatchMotions` uses the batch integrator. A regime map calls it a
thousand times for the same systems, so the steps (one scheme for each system) are chosen once. The error is monitored
in each call: the first period of a few motions is compared with the exact flow.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.rattle import innermost_switches
from gapwalk.attractors.section import Strobe
from gapwalk.ensemble.batch import Batch, BatchOptions, batch_of
from gapwalk.ensemble.batch_flow import LIMIT, BatchFlow, BlockPlan, Blocks, Trial, batch_flow_of, judge
from gapwalk.ensemble.kernel_source import Form, Source
from gapwalk.errors import FlowError, UnfitError
from gapwalk.flow.motion import integrate
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

_SAMPLES = 512  # per forcing period, for peaks of forces
_PILOT = 256  # motions among which those are for which the steps are chosen
_PILOT_PERIODS = 64
_EASED = 16  # the same for motions whose transients have ended
_LOOKS = 2  # motions per call that are compared with the exact flow
_SEED = 1995


class ManyMotions(Protocol):
    """The flow of many motions; the state of a motion that cannot be integrated becomes nan."""

    @property
    def error(self) -> float:
        """The largest error over one forcing period that was measured, relative to the size of the motion."""
        ...

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """Advance the states, shape (count, state_size), by some forcing periods."""
        ...

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """Return the states at the start of each of some periods that follow the first `after` ones.

        Their shape is (periods, count, state_size); the first is one period after them.
        """
        ...

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """Compute contact forces and impacts over some forcing periods."""
        ...

    def part(self, which: NDArray[np.intp]) -> ManyMotions:
        """Return the flow of some of the motions."""
        ...

    def eased(self, states: NDArray[np.float64]) -> ManyMotions:
        """Return the flow of the same motions from states after their transients, which may need fewer steps."""
        ...


class ContactFigures(NamedTuple):
    """Contact forces and impacts of many motions.

    Attributes
    ----------
    states : shape (count, state_size)
        States at the end.
    peaks : shape (count, contacts)
        Largest magnitude of each contact force.
    impacts : shape (count, contacts)
        Closings of a contact per forcing period, on both sides together.
    sides : shape (count, contacts, 2)
        The same on the positive and on the negative side.
    """

    states: NDArray[np.float64]
    peaks: NDArray[np.float64]
    impacts: NDArray[np.float64]
    sides: NDArray[np.float64]


def motions_of(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None = None,
    error: float = 1e-4,
    periods: int = _PILOT_PERIODS,
) -> ManyMotions:
    """Create the flow of many motions: the batch integrator, or the exact flow where that is faster or the only one.

    Parameters
    ----------
    system
        The system.
    states : shape (count, state_size)
        Initial states of the motions; the steps are chosen on some of them.
    values
        Parameter values by name, each of shape (count,), one for each motion; without any, the number of motions may
        vary.
    error
        The allowed error, as in `BatchOptions`.
    periods
        Forcing periods over which the steps are chosen: all of those over which the motions are followed, or so many
        that most transients have ended.
    """
    batch = batch_of(system, states, values or {})
    pilot = batch.some(np.unique(np.linspace(0, batch.count - 1, _PILOT).astype(int)))
    try:
        steps = _flow_of(system, error).steps_for(pilot, periods)
    except (FlowError, UnfitError):  # too stiff; or friction that sticks rigidly, and other laws without a kernel
        return ExactMotions(system, values)
    block_plan = BlockPlan(batch.linear, batch.pattern, steps)
    return BatchMotions(batch, block_plan, None if block_plan.shared else np.arange(batch.count), [], error)


def _flow_of(system: System, error: float) -> BatchFlow:
    return batch_flow_of(system, BatchOptions(error=error, threads=1))


def has_kernel(system: System) -> bool:
    """Return True if the batch integrator can include a system."""
    try:
        Source(Form(system.structure, (coefficients_of(system) != 0.0).tobytes(), False, True, False))
    except UnfitError:
        return False
    return True


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
        sides = np.full((*peaks.shape, 2), np.nan)
        names, innermost = [contact.name for contact in self.system.structure.contacts], innermost_switches(self.system)
        for index in np.flatnonzero(finite_rows(states)).tolist():
            try:
                motion = integrate(self._system(index), states[index], periods, _SAMPLES)
            except FlowError:
                continue
            ends[index] = motion.states[-1]
            peaks[index] = np.abs(motion.forces).max(axis=0)
            sides[index] = 0.0
            for contact, side, switch in innermost:
                entries = [event for event in motion.events if event.enters and event.switch == switch]
                sides[index, names.index(contact), 0 if side > 0 else 1] = len(entries) / periods
        return ContactFigures(ends, peaks, sides.sum(axis=2), sides)

    def part(self, which: NDArray[np.intp]) -> ExactMotions:
        """See `ManyMotions.part`."""
        return ExactMotions(self.system, {name: values[which] for name, values in self.values.items()})

    def eased(self, states: NDArray[np.float64]) -> ExactMotions:
        """See `ManyMotions.eased`."""
        return self

    def _system(self, index: int) -> System:
        if not self.values:
            return self.system
        return self.system.at({name: float(values[index]) for name, values in self.values.items()})


def finite_rows(states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the states, shape (count, state_size), of motions that have not diverged."""
    return np.asarray(np.isfinite(states).all(axis=1))


class BatchMotions:
    """The flow of many motions by the batch integrator, in one thread.

    Parameters
    ----------
    batch
        The systems: one for all motions, or one for each motion.
    block_plan
        Steps of the systems.
    lanes
        Index of the system of each motion; None if one system serves all.
    trials
        Comparisons with the exact flow, each with its system; shared by all parts of this object.
    allowed
        The allowed error, as in `BatchOptions`.
    """

    def __init__(
        self,
        batch: Batch,
        block_plan: BlockPlan,
        lanes: NDArray[np.intp] | None,
        trials: list[tuple[Trial, System]],
        allowed: float,
    ) -> None:
        self._batch, self._block_plan, self._lanes, self._trials = batch, block_plan, lanes, trials
        self._allowed = allowed
        self._random = np.random.default_rng(_SEED)

    @property
    def steps(self) -> int:
        """Steps per forcing period; the motion that needs most sets them for all."""
        return self._block_plan.steps

    @property
    def error(self) -> float:
        """See `ManyMotions.error`."""
        systems = [system for _, system in self._trials]
        numbered = [trial._replace(lane=index) for index, (trial, _) in enumerate(self._trials)]
        return judge(numbered, systems.__getitem__, LIMIT).error

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """See `ManyMotions.advance`."""
        ends = np.full(states.shape, np.nan)
        if run := self._run(states, periods):
            which, blocks = run
            ends[which] = blocks.states
        return ends

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """See `ManyMotions.strobes`; computed in one run, because each run starts with a small error of its own."""
        track = np.full((periods, *states.shape), np.nan)
        if run := self._run(states, after + 1):
            which, blocks = run
            for row in track[:-1]:
                row[which] = blocks.states
                blocks.advance(1)
            track[-1, which] = blocks.states
        return track

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """See `ManyMotions.contacts`."""
        ends = np.full(states.shape, np.nan)
        peaks = np.full((len(states), len(self._batch.systems[0].structure.contacts)), np.nan)
        sides = np.full((*peaks.shape, 2), np.nan)
        if run := self._run(states, periods, survey=True):
            which, blocks = run
            survey = blocks.survey(periods)
            ends[which], peaks[which], sides[which] = blocks.states, survey.peak_force, survey.impacts
        return ContactFigures(ends, peaks, sides.sum(axis=2), sides)

    def part(self, which: NDArray[np.intp]) -> BatchMotions:
        """See `ManyMotions.part`."""
        lanes = None if self._lanes is None else self._lanes[which]
        return BatchMotions(self._batch, self._block_plan, lanes, self._trials, self._allowed)

    def eased(self, states: NDArray[np.float64]) -> BatchMotions:
        """See `ManyMotions.eased`; its error is that of the motions from these states alone."""
        which = np.flatnonzero(finite_rows(states))
        if not len(which):
            return self
        which = which[np.unique(np.linspace(0, len(which) - 1, _PILOT).astype(int))]
        lanes = np.zeros(len(which), dtype=np.intp) if self._lanes is None else self._lanes[which]
        pilot = Batch(states[which], self._batch.systems, self._batch.places[lanes])
        try:
            # a motion that still closes contacts may not be among those compared
            steps = _flow_of(self._batch.systems[0], self._allowed).steps_for(pilot, _EASED, may_be_few=False)
        except FlowError:
            return self
        block_plan = self._block_plan
        if steps < block_plan.steps:
            block_plan = BlockPlan(block_plan.linear, block_plan.pattern, steps)
        return BatchMotions(self._batch, block_plan, self._lanes, [], self._allowed)

    def _run(
        self, states: NDArray[np.float64], periods: int, survey: bool = False
    ) -> tuple[NDArray[np.intp], Blocks] | None:
        """Advance the motions that have not diverged; compare some of them with the exact flow in the first period.

        Returns the indices of these motions, and their blocks; None if all have diverged.
        """
        which = np.flatnonzero(finite_rows(states))
        count = len(which)
        if not count:
            return None
        if count == 1:  # a single lane would need another compiled kernel
            which = np.repeat(which, 2)
        lanes = np.zeros(len(which), dtype=np.intp) if self._lanes is None else self._lanes[which]
        block_plan = self._block_plan if self._block_plan.shared else self._block_plan.some(lanes)
        blocks = Blocks(block_plan, states[which], 0, 0, survey, 1)
        if survey:
            blocks.begin_survey()
        blocks.advance(1)
        after = blocks.states
        for index in self._random.choice(count, min(_LOOKS, count), replace=False):
            trial = Trial(0, states[which[index]], after[index])
            self._trials.append((trial, self._batch.system(int(lanes[index]))))
        if periods > 1:
            blocks.advance(periods - 1)
        return which, blocks
