"""Run-ups by equal steps, one with its history or many with their extremes: with friction, and with many gaps.

Method: docs/numerics/notes/answers.md
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import SweepBy
from gapwalk.answers.lane_sweep import is_many
from gapwalk.answers.speed_course import SpeedCourse
from gapwalk.attractors.lane_settling import Start, settle_lanes
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lane_code import GRIP, WIDTH, refuse
from gapwalk.ensemble.lane_ramp import PIECES, RampLanes
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.ramp import Ramped
from gapwalk.model.laws.formula import is_computed
from gapwalk.model.system import System
from gapwalk.pieces import tell

_OF_ONE = ("up", "down", "peak", "approach", "side", GRIP)
_OF_MANY = ("least", "most", "up", "down", "peak", "side", GRIP)


def is_by_steps(system: System, by: SweepBy, many: bool = False) -> bool:
    """Return True if run-ups of a system are made by equal steps; raise a ModelError if they cannot be as asked."""
    drags = [form.name for form in system.structure.contacts if many and any(map(is_computed, form.parameters))]
    is_dry = any(form.law.is_dry for form in system.structure.contacts)
    if by is SweepBy.STEPS:
        refuse(system.structure.equations)
    if by is SweepBy.CURVES and is_dry:
        raise ModelError('the exact run-up cannot include dry friction; write by = "steps", or leave the friction out')
    if by is SweepBy.CURVES and drags:
        raise ModelError(
            f'the torque of {drags[0]} changes with the speed, which many run-ups include by = "steps" only; write that'
        )
    return by is SweepBy.STEPS or (by is SweepBy.CHOSEN and (is_dry or bool(drags) or is_many(system)))


def start_by_steps(ramped: Ramped, system: System, phases: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states at some phases of the motion that settles at the speed of a system, shape (phases, state_size)."""
    ((_, motion),) = settle_lanes([Start((), 0.0, system, state_at_rest(system))])
    if motion.diverged:
        raise FlowError("the motion at the first speed diverges")
    found, angles = np.tile(motion.state, (len(phases), 1)), phases % PERIOD
    held = SpeedCourse(np.array([0.0, 1.0]), np.full(2, system[system.structure.pace]))
    for angle in np.unique(angles[angles > 0.0]):
        lanes = RampLanes(ramped, motion.state[None], np.zeros(1), system.frequency)
        for _ in lanes.turns(_Speeds([held], system.structure.frequency), float(angle), PIECES):
            pass
        found[angles == angle] = lanes.states
    return found


class _Speeds:
    """Times and speeds of courses over the angle, from the start of each; the last one fills what is left."""

    def __init__(self, courses: Sequence[SpeedCourse], unit: float) -> None:
        self.courses, self.unit = courses, unit

    def __call__(self, angles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        passed = [course.passed(angles / self.unit) for course in self.courses]
        passed += passed[-1:] * (WIDTH - len(passed))
        time, speed = (np.stack(each, axis=1) for each in zip(*passed, strict=True))
        return time, speed * self.unit


class Stepped(NamedTuple):
    """A run-up by equal steps: states at the samples, forces of friction, and the largest forces."""

    theta: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (samples, 2n)
    friction: NDArray[np.float64]  #: shape (samples, contacts that are friction)
    #: Of each contact: time at which the piece with the largest force begins; that force; impacts, and the fastest.
    peaks: list[tuple[float, float, float, float]]


def run_by_steps(
    ramped: Ramped, course: SpeedCourse, state: NDArray[np.float64], phase: float, samples: int, finer: float = 1.0
) -> Stepped:
    """Run up by equal steps."""
    unit, n = ramped.system.structure.frequency, ramped.system.size
    begun, lowest = np.array([phase]), float(course.speed.min()) * unit
    lanes = RampLanes(ramped, state[None], begun, lowest, kinds=_OF_ONE, sampled=True, finer=finer)
    code, last = lanes.code, float(course.turned[-1]) * unit
    rows = [*range(2 * n), *range(2 * n + len(code.dry), 2 * n + 2 * len(code.dry))]
    theta = np.append(np.arange(int(last / PERIOD * samples - 1e-6) + 1) * (PERIOD / samples), last)
    found, done, notes, times = np.empty((len(theta), len(rows))), 1, [], []
    found[0] = np.concatenate((state[: 2 * n], np.zeros(len(code.dry))))
    for number, turned in enumerate(lanes.turns(_Speeds([course], unit), last, samples)):
        own = turned.samples[:, rows, 0]
        found[done : done + len(own)] = own
        done += len(own)
        tell(done / len(theta))
        notes.append(turned.notes[:, :, 0])
        times.append(turned.times[:-1, 0])
        if not np.isfinite(own[-1]).all():
            raise FlowError(f"the motion diverges, {number} forcing periods after the start")
    if code.dry:  # the force at the start is that of the extension, where it has one; else of the first step
        found[0, 2 * n :] = found[1, 2 * n :]
    noted = np.concatenate(notes)
    largest, total, begun = noted.max(axis=0), noted.sum(axis=0), np.concatenate(times)[noted.argmax(axis=0)]

    def of_all(values: NDArray[np.float64], *kinds: str) -> list[float]:
        known = [[code.notes[kind, k] for kind in kinds if (kind, k) in code.notes] for k in range(contacts)]
        return [float(values[own].sum()) for own in known]

    contacts = len(lanes.layout.contacts)
    tops = of_all(begun, "peak", GRIP), of_all(largest, "peak", GRIP)
    peaks = zip(*tops, of_all(total, "up", "down"), of_all(largest, "approach"), strict=True)
    return Stepped(phase + theta, found[:, : 2 * n], found[:, 2 * n :], list(peaks))


def batch_by_steps(
    ramped: Ramped,
    courses: Sequence[SpeedCourse],
    phases: NDArray[np.float64],
    states: NDArray[np.float64],
    bins: int,
    threads: int = 1,
) -> tuple[Any, ...]:
    """Run up many times by equal steps; return what follows the phases in the record of run-ups.

    The largest forces of some are compared with those by half the step.
    """
    order = np.argsort([float(course.turned[-1]) for course in courses], kind="stable")
    registers = [order[first : first + WIDTH] for first in range(0, len(order), WIDTH)]

    def carried(lanes: NDArray[np.intp], finer: float = 1.0):
        return _register(ramped, [courses[k] for k in lanes], phases[lanes], states[lanes], bins, finer)

    with ThreadPoolExecutor(min(threads, len(registers))) as pool:
        parts = list(pool.map(carried, registers))
    back = np.argsort(order)
    low, high, forces, impacts = (np.concatenate(each)[back] for each in zip(*parts, strict=True))
    some = order[np.unique(np.linspace(0, len(order) - 1, WIDTH).round().astype(int))]
    both = [each.max(axis=1) for each in (forces[some], carried(some, 2.0)[2])]
    size = np.nanmax(both[1], axis=0, initial=0.0)
    apart = (np.abs(both[0] - both[1]) / np.where(size > 0.0, size, 1.0)).max(axis=1, initial=0.0)
    apart = apart[np.isfinite(apart)]
    error = float(np.sqrt(np.mean(apart**2))) if len(apart) else 0.0
    return low, high, forces, impacts, error, float(apart.max(initial=0.0)), len(apart)


def _register(ramped: Ramped, courses: list[SpeedCourse], phases, states, bins: int, finer: float):
    """Run up in one register; return lows, highs, largest forces and impacts in bins."""
    system, unit, count = ramped.system, ramped.system.structure.frequency, len(courses)
    lowest, last = min(float(each.speed.min()) for each in courses), max(float(each.turned[-1]) for each in courses)
    lanes = RampLanes(ramped, states, phases, lowest * unit, kinds=_OF_MANY, finer=finer)
    code, contacts = lanes.code, len(lanes.layout.contacts)
    shapes = [(np.inf, system.size), (-np.inf, system.size), (0.0, contacts), (0.0, contacts), (0.0, contacts)]
    kinds = [("least",), ("most",), ("peak", GRIP), ("up",), ("down",)]
    tables = [np.full((count, bins, size), begin) for begin, size in shapes]
    places = [[(row, own) for (kind, own), row in code.notes.items() if kind in each] for each in kinds]
    merged = (np.minimum.at, np.maximum.at, np.maximum.at, np.add.at, np.add.at)
    durations = np.array([course.duration for course in courses])
    shortest = PERIOD * bins / min(float(each.turned[-1]) for each in courses) / unit  # bins in a forcing period
    pieces = max(PIECES, 2 * int(np.ceil(shortest)))
    runs = np.arange(count)
    for turned in lanes.turns(_Speeds(courses, unit), last * unit, pieces, pieces):
        middle = 0.5 * (turned.times[1:, :count] + turned.times[:-1, :count])
        inside = np.floor(middle / durations * bins).astype(int)
        known = inside < bins
        where = np.broadcast_to(runs, inside.shape)[known], inside[known]
        for table, rows, merge in zip(tables, places, merged, strict=True):
            for row, own in rows:
                merge(table[:, :, own], where, turned.notes[:, row, :count][known])
    for table in tables:
        table[~np.isfinite(table).all(axis=(1, 2))] = np.nan
    tables[2][lanes.diverged] = np.nan
    low, high, forces, up, down = tables
    return low, high, forces, np.stack((up, down), axis=-1)
