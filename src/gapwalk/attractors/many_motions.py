"""Flows of many motions, of one system or each with its own parameter values, for basins and regime maps.

`ExactMotions` integrates one motion after the other. `BatchMotions` uses the batch integrator. A regime map calls it a
thousand times for the same systems, so the steps (one scheme for each system) are chosen once. The error is monitored
in each call: a period of a few motions is compared with the exact flow. What was done with too large an error is done
again with more steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.rattle import innermost_switches
from gapwalk.attractors.section import Strobe
from gapwalk.ensemble.batch_flow import (
    LIMIT,
    MOST_STEPS,
    Batch,
    BatchFlow,
    BatchOptions,
    BlockPlan,
    Blocks,
    Trial,
    batch_flow_of,
    batch_of,
    closed_in,
    judge,
    revised,
)
from gapwalk.ensemble.kernel_source import Form, Linear, Source
from gapwalk.ensemble.lane_code import LABELS
from gapwalk.ensemble.lanes import Lanes, prefers_lanes
from gapwalk.errors import FlowError, UnfitError
from gapwalk.flow.motion import integrate
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.structure import Structure
from gapwalk.model.system import System

_SAMPLES = 512  # per forcing period, for peaks of forces
_PILOT = 256  # motions among which those are for which the steps are chosen
_PILOT_PERIODS = 64
_EASED = 16  # the same for motions whose transients have ended
_LOOKS = 2  # motions per call that are compared with the exact flow
_SEED = 1995
_Done = TypeVar("_Done")


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
        """Return the states at the start of each of some periods that follow the first `after` ones."""
        # Their shape is (periods, count, state_size); the first is one period after them.
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

    def finer(self) -> ManyMotions | None:
        """Return the flow with more steps if the error that was measured is larger than allowed; otherwise None."""
        ...


def enough(motions: ManyMotions, work: Callable[[ManyMotions], _Done]) -> tuple[_Done, float]:
    """Do work with the flow of many motions, again with more steps while the error is too large; return the error."""
    # The steps are chosen on some motions. Others may close a contact that these never close.
    done = work(motions)
    while (finer := motions.finer()) is not None:
        motions, done = finer, work(finer)
    return done, motions.error


class ContactFigures(NamedTuple):
    """Contact forces and impacts of many motions."""

    states: NDArray[np.float64]  #: shape (count, state_size): States at the end.
    peaks: NDArray[np.float64]  #: shape (count, contacts): Largest magnitude of each contact force.
    #: shape (count, contacts): Closings of a contact per forcing period, on both sides together.
    impacts: NDArray[np.float64]
    sides: NDArray[np.float64]  #: shape (count, contacts, 2): The same on the positive and on the negative side.
    closed: NDArray[np.bool_]  #: shape (count, contacts), bool: True for a contact that is closed at the end.


def motions_of(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None = None,
    error: float = 1e-4,
    periods: int = _PILOT_PERIODS,
) -> ManyMotions:
    """Create the flow of many motions: the batch integrator, or the exact flow where that is faster or the only one."""
    # Shapes: `states` (count, state_size).
    batch = batch_of(system, states, values or {})
    if prefers_lanes(system):
        return LaneMotions(system.structure, batch.coefficients)
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
    """Return True if many motions of a system can be integrated at once."""
    if prefers_lanes(system):
        return True
    try:
        Source(Form(system.structure, (coefficients_of(system) != 0.0).tobytes(), False, True, False))
    except UnfitError:
        return False
    return True


class ExactMotions:
    """The exact flow of many motions, integrated one after the other."""

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
        sides, closed = np.full((*peaks.shape, 2), np.nan), np.zeros(peaks.shape, dtype=bool)
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
            here = Linear(layout_of(self.system.structure), coefficients_of(self._system(index))[None])
            closed[index] = closed_in(here, ends[index][None])[0]
        return ContactFigures(ends, peaks, sides.sum(axis=2), sides, closed)

    def part(self, which: NDArray[np.intp]) -> ExactMotions:
        """See `ManyMotions.part`."""
        return ExactMotions(self.system, {name: values[which] for name, values in self.values.items()})

    def eased(self, states: NDArray[np.float64]) -> ExactMotions:
        """See `ManyMotions.eased`."""
        return self

    def finer(self) -> None:
        """See `ManyMotions.finer`."""
        return

    def _system(self, index: int) -> System:
        if not self.values:
            return self.system
        return self.system.at({name: float(values[index]) for name, values in self.values.items()})


class LaneMotions:
    """The flow of many motions by equal steps without events (`gapwalk.ensemble.lanes`)."""

    def __init__(self, structure: Structure, coefficients: NDArray[np.float64]) -> None:
        self._structure, self._coefficients, self._error = structure, coefficients, 0.0

    @property
    def error(self) -> float:
        """See `ManyMotions.error`: the difference to steps of half the length."""
        return self._error

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """See `ManyMotions.advance`."""
        return self.strobes(states, 1, periods - 1)[-1]

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """See `ManyMotions.strobes`."""
        track = np.full((periods, *states.shape), np.nan)
        if run := self._begin(states, ()):
            which, lanes = run
            for period in range(after + periods):
                lanes.advance()
                if period >= after:
                    track[period - after, which] = np.where(lanes.diverged[:, None], np.nan, lanes.states)
        return track

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """See `ManyMotions.contacts`."""
        contacts = self._structure.equations.contacts
        ends, peaks = np.full(states.shape, np.nan), np.full((len(states), len(contacts)), np.nan)
        sides, closed = np.full((*peaks.shape, 2), np.nan), np.zeros(peaks.shape, dtype=bool)
        if run := self._begin(states, (*LABELS, "peak")):
            which, lanes = run
            staged = np.flatnonzero([bool(contact.stages) for contact in contacts])
            own, most = np.zeros((len(which), len(staged), 2)), np.zeros((len(which), len(staged)))
            for _ in range(periods):
                lanes.advance()
                own += np.stack((lanes.note("up"), lanes.note("down")), axis=2)
                most = np.maximum(most, lanes.note("peak"))
            gone = lanes.diverged
            ends[which] = np.where(gone[:, None], np.nan, lanes.states)
            sides[which] = 0.0
            sides[np.ix_(which, staged)] = np.where(gone[:, None, None], np.nan, own / periods)
            peaks[np.ix_(which, staged)] = np.where(gone[:, None], np.nan, most)
            closed[np.ix_(which, staged)] = np.abs(lanes.note("side")) > 0.5
        return ContactFigures(ends, peaks, sides.sum(axis=2), sides, closed)

    def part(self, which: NDArray[np.intp]) -> LaneMotions:
        """See `ManyMotions.part`."""
        return LaneMotions(self._structure, self._coefficients[which])

    def eased(self, states: NDArray[np.float64]) -> LaneMotions:
        """See `ManyMotions.eased`."""
        return self

    def finer(self) -> None:
        """See `ManyMotions.finer`."""
        return

    def _begin(self, states: NDArray[np.float64], kinds: Sequence[str]) -> tuple[NDArray[np.intp], Lanes] | None:
        """Return the motions that have not diverged, and their lanes at theta = 0."""
        which = np.flatnonzero(finite_rows(states))
        if not len(which):
            return None
        if not self._error:
            few = which[np.unique(np.linspace(0, len(which) - 1, _LOOKS * 4).astype(int))]
            ends = []
            for finer in (1.0, 2.0):
                lanes = Lanes(self._structure, self._coefficients[few], states[few], kinds=(), finer=finer)
                lanes.advance()
                ends.append(lanes.states)
            scale = np.maximum(np.abs(ends[1]).max(axis=0), np.finfo(float).tiny)
            self._error = float(np.sqrt(np.mean((np.abs(ends[0] - ends[1]) / scale).max(axis=1) ** 2)))
        return which, Lanes(self._structure, self._coefficients[which], states[which], kinds=kinds)


def finite_rows(states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the states, shape (count, state_size), of motions that have not diverged."""
    return np.asarray(np.isfinite(states).all(axis=1))


class BatchMotions:
    """The flow of many motions by the batch integrator, in one thread."""

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
        self._measured = 0, 0.0  # number of trials, and their error

    @property
    def steps(self) -> int:
        """Steps per forcing period; the motion that needs most sets them for all."""
        return self._block_plan.steps

    @property
    def error(self) -> float:
        """See `ManyMotions.error`."""
        if self._measured[0] == len(self._trials):
            return self._measured[1]
        systems = [system for _, system in self._trials]
        numbered = [trial._replace(lane=index) for index, (trial, _) in enumerate(self._trials)]
        self._measured = len(numbered), judge(numbered, systems.__getitem__, LIMIT).error
        return self._measured[1]

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
        sides, closed = np.full((*peaks.shape, 2), np.nan), np.zeros(peaks.shape, dtype=bool)
        if run := self._run(states, periods, survey=True):
            which, blocks = run
            survey = blocks.survey(periods)
            ends[which], peaks[which], sides[which] = blocks.states, survey.peak_force, survey.impacts
            closed[which] = closed_in(blocks.block_plan.linear, blocks.states)
            self._compare_loaded(which, blocks, survey.peak_force)
        return ContactFigures(ends, peaks, sides.sum(axis=2), sides, closed)

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
            steps = _flow_of(self._batch.systems[0], self._allowed).steps_for(pilot, _EASED)
        except FlowError:
            return self
        return self._in(min(steps, self.steps))

    def finer(self) -> BatchMotions | None:
        """See `ManyMotions.finer`."""
        if self.error <= self._allowed or self.steps >= MOST_STEPS:
            return None
        return self._in(max(revised(self.steps, self.error, self._allowed), min(self.steps + 4, MOST_STEPS)))

    def _in(self, steps: int) -> BatchMotions:
        """Return the flow of the same motions in a number of steps, with an error of its own."""
        plan = self._block_plan
        if steps != plan.steps:
            plan = BlockPlan(plan.linear, plan.pattern, steps)
        return BatchMotions(self._batch, plan, self._lanes, [], self._allowed)

    def _run(
        self, states: NDArray[np.float64], periods: int, survey: bool = False
    ) -> tuple[NDArray[np.intp], Blocks] | None:
        """Advance the motions that have not diverged; compare some of them with the exact flow in the first period."""
        # Returns the indices of these motions, and their blocks; None if all have diverged.
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
        self._compare(which, states[which], blocks.states, self._random.permutation(count)[:_LOOKS])
        if periods > 1:
            blocks.advance(periods - 1)
        return which, blocks

    def _compare_loaded(self, which: NDArray[np.intp], blocks: Blocks, peaks: NDArray[np.float64]) -> None:
        """Compare some motions that load each contact over one more period: a random motion may load none."""
        loaded = [self._random.permutation(np.flatnonzero(peak > 0.0))[:_LOOKS] for peak in peaks[: len(which)].T]
        if len(places := np.unique(np.concatenate([np.empty(0, dtype=np.intp), *loaded]))):
            before = blocks.states
            blocks.advance(1)
            self._compare(which, before, blocks.states, places)

    def _compare(
        self,
        which: NDArray[np.intp],
        before: NDArray[np.float64],
        after: NDArray[np.float64],
        places: NDArray[np.intp],
    ) -> None:
        """Keep trials of some of the motions that were advanced, by their places among them."""
        for place in places.tolist():
            if np.isfinite(before[place]).all():
                lane = 0 if self._lanes is None else int(self._lanes[which[place]])
                self._trials.append((Trial(0, before[place], after[place]), self._batch.system(lane)))
