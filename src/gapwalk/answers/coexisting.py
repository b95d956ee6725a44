"""Settled motions that slow sweeps do not meet: found from random starts, and followed as far as they are stable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gapwalk.answers.gap_states import judge_gaps
from gapwalk.answers.settled_sweep import Direction, Sample, SettledSweep, SlowSweepOptions, Stretch, stable_stretch
from gapwalk.attractors.many_motions import finite_rows
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.isolated.search_options import spread_starts, state_box
from gapwalk.errors import FlowError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, is_same

OTHER = "other"
"""How motions are met that no sweep meets."""
_ALIKE = 0.02  # difference of peak forces, relative to them, up to which motions from several starts count as one


def other_motions(
    system: System,
    sweeps: Sequence[SettledSweep],
    gaps: Sequence[str],
    values: int,
    starts: int,
    seed: int,
    options: SlowSweepOptions,
) -> tuple[list[SettledSweep], list[str]]:
    """Search for settled motions that no sweep has met, and follow them in both directions while they are stable.

    At each of some values of the parameter, motions from random starts are followed by the batch integrator until they
    have settled. Those whose gaps or peak forces differ are settled by the exact flow, and compared with the sweeps.
    """
    if not values or not starts or not sweeps:
        return [], []
    parameter, within = sweeps[0].parameter, sweeps[0].within
    low, high = within
    found: list[SettledSweep] = []
    notes: list[str] = []
    for number, value in enumerate(np.linspace(low, high, values + 2)[1:-1].tolist()):
        here = system.at({parameter: value})
        try:
            settled = list(_settled(here, gaps, starts, seed + number, options))
        except FlowError as error:
            notes.append(f"{parameter} = {value:.6g}: {error}")
            continue
        for state in settled:
            try:
                motion = settle(here, state, SettleOptions(max_periods=options.patience, max_period=8))
                orbit = motion.orbit
                if orbit is None or orbit.period > options.longest:
                    continue
                if any(_passes(sweep, orbit, value) for sweep in (*sweeps, *found)):
                    continue
                for direction in Direction:
                    end = within[1] if direction is Direction.UP else within[0]
                    stretch, _ = stable_stretch(orbit, parameter, end, options.walk)
                    found.append(SettledSweep(parameter, within, direction, (stretch,), (), name=OTHER))
            except (NumericalError, FlowError) as error:
                notes.append(f"{parameter} = {value:.6g}: a motion from a random start: {error}")
    count = len(found) // len(Direction)
    what = "no motion that the sweeps had not met" if not count else f"{count} that the sweeps had not met"
    notes.append(f"{starts} random starts at each of {values} values led to {what}")
    return found, notes


def _settled(
    system: System, gaps: Sequence[str], starts: int, seed: int, options: SlowSweepOptions
) -> Iterator[np.ndarray]:
    """Yield a state of each periodic motion on which random starts settle, distinguished by period, gaps and force.

    Motions without period, or of a long one, are left to the samples of the sweeps.
    """
    states = np.array(spread_starts([system], state_box(system), starts, seed, 0.0))
    found = judge_gaps(system, states, None, gaps, options.patience)
    known: list[tuple[int, tuple[int, ...], np.ndarray]] = []
    is_short = (found.periods > 0) & (found.periods <= options.longest)
    for index in np.flatnonzero(finite_rows(found.states) & is_short).tolist():
        own = int(found.periods[index]), tuple(found.codes[index].tolist()), found.peaks[index]
        alike = (each[2] for each in known if own[:2] == each[:2])
        if any(np.allclose(own[2], each, rtol=_ALIKE, atol=0.0, equal_nan=True) for each in alike):
            continue
        known.append(own)
        yield found.states[index]


def _passes(sweep: SettledSweep, orbit: Orbit, value: float) -> bool:
    """Return True if a sweep passes through an orbit."""
    for piece in sweep.pieces:
        if isinstance(piece, Sample):
            if piece.value == value and piece.motion.orbit is not None and is_same(piece.motion.orbit, orbit):
                return True
            continue
        covers = min(piece.begin, piece.end) <= value <= max(piece.begin, piece.end)
        if covers and piece.branch.period == orbit.period and _is_on(piece, orbit, value):
            return True
    return False


def _is_on(stretch: Stretch, orbit: Orbit, value: float) -> bool:
    near = min(stretch.points, key=lambda point: abs(point.value - value)).orbit
    try:
        there = find_orbit(orbit.system, orbit.period, near.state)
    except NumericalError:
        return False
    return is_same(there, orbit)
