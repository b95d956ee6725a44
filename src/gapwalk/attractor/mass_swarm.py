"""Many motions side by side by the mass flow: what basins and regime maps are made with.

A regime map calls the flow a thousand times for the same systems, so its steps, one scheme for each system, are made
once, and the error is looked at in passing: the first period of each call, of a few motions, beside the exact flow.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractor.swarm import ContactFigures, ExactSwarm, Swarm
from gapwalk.errors import FlowError
from gapwalk.model.system import System
from gapwalk.motion.mass.blocks import LIMIT, Blocks, Fleet
from gapwalk.motion.mass.crowd import Crowd, crowd_of
from gapwalk.motion.mass.flow import mass_flow_of
from gapwalk.motion.mass.options import MassOptions
from gapwalk.motion.mass.trial import Trial, judge

_PILOT = 256  # motions on which the steps are chosen
_PILOT_PERIODS = 64
_LOOKS = 2  # motions of a call that are compared with the exact flow
_SEED = 1995


class MassSwarm:
    """The mass flow of many motions, in one thread.

    Parameters
    ----------
    crowd
        The motions' systems: one for all, or one for each.
    fleet
        The steps.
    trials
        What was compared with the exact flow, with the systems: shared by all parts of a swarm.
    """

    def __init__(self, crowd: Crowd, fleet: Fleet, trials: list[tuple[Trial, System]]) -> None:
        self._crowd, self._fleet, self._trials = crowd, fleet, trials
        self._random = np.random.default_rng(_SEED)

    @property
    def error(self) -> float:
        """See `Swarm.error`."""
        systems = [system for _, system in self._trials]
        numbered = [trial._replace(lane=index) for index, (trial, _) in enumerate(self._trials)]
        return judge(numbered, systems.__getitem__, LIMIT).error

    def advance(self, states: NDArray[np.float64], periods: int) -> NDArray[np.float64]:
        """See `Swarm.advance`."""
        ends = np.full(states.shape, np.nan)
        finite = np.isfinite(states).all(axis=1)
        if finite.any():
            ends[finite] = self._run(states, finite, periods).states
        return ends

    def strobes(self, states: NDArray[np.float64], periods: int, after: int = 0) -> NDArray[np.float64]:
        """See `Swarm.strobes`; all in one run, for each run begins with a small error of its own."""
        track = np.full((periods, *states.shape), np.nan)
        finite = np.isfinite(states).all(axis=1)
        if not finite.any():
            return track
        blocks = self._run(states, finite, after + 1)
        for row in track[:-1]:
            row[finite] = blocks.states
            blocks.advance(1)
        track[-1, finite] = blocks.states
        return track

    def contacts(self, states: NDArray[np.float64], periods: int) -> ContactFigures:
        """See `Swarm.contacts`."""
        ends = np.full(states.shape, np.nan)
        peaks = np.full((len(states), len(self._crowd.systems[0].structure.contacts)), np.nan)
        impacts = peaks.copy()
        finite = np.isfinite(states).all(axis=1)
        if finite.any():
            blocks = self._run(states, finite, periods, survey=True)
            survey = blocks.survey(periods)
            ends[finite], peaks[finite] = blocks.states, survey.peak_force
            impacts[finite] = survey.impacts.sum(axis=2)
        return ContactFigures(ends, peaks, impacts)

    def part(self, which: NDArray[np.intp]) -> MassSwarm:
        """See `Swarm.part`."""
        if self._fleet.shared:
            return self
        return MassSwarm(self._crowd.some(which), self._fleet.some(which), self._trials)

    def _run(
        self, states: NDArray[np.float64], finite: NDArray[np.bool_], periods: int, survey: bool = False
    ) -> Blocks:
        """Carry the motions that have not run away, and look at some of them in the first period."""
        lanes = np.flatnonzero(finite)
        fleet = self._fleet if self._fleet.shared else self._fleet.some(lanes)
        blocks = Blocks(fleet, states[lanes], 0, 0, survey, 1)
        if survey:
            blocks.begin_survey()
        blocks.advance(1)
        after = blocks.states
        for index in self._random.choice(len(lanes), min(_LOOKS, len(lanes)), replace=False):
            lane = int(lanes[index])
            self._trials.append((Trial(lane, states[lane], after[index]), self._crowd.system(lane)))
        if periods > 1:
            blocks.advance(periods - 1)
        return blocks


def swarm_of(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None = None,
    error: float = 1e-4,
) -> Swarm:
    """The mass flow of many motions, or the exact flow of them where the mass flow would be the slower one.

    Parameters
    ----------
    system
        The system.
    states : shape (count, 2n)
        Where the motions begin; the steps are chosen on some of them.
    values
        Parameter values by name, each of shape (count,), one for each motion; if there are none, there may be any
        number of motions.
    error
        The error that is allowed, as in `MassOptions`.
    """
    crowd = crowd_of(system, states, values or {})
    pilot = crowd.some(np.unique(np.linspace(0, crowd.count - 1, _PILOT).astype(int)))
    parameters = {name: np.array([pilot.system(lane)[name] for lane in range(pilot.count)]) for name in values or {}}
    try:
        flow = mass_flow_of(system, MassOptions(error=error, threads=1))
        steps = flow.run(pilot.states, _PILOT_PERIODS, parameters=parameters).steps
    except FlowError:
        return ExactSwarm(system, values)
    return MassSwarm(crowd, Fleet(crowd.linear, crowd.pattern, steps), [])
