"""Many run-ups at once: the batch integrator with steps of equal time, and loads that are tabulated lane by lane.

The matrices of the linear part do not depend on the speed, only the loads do. So over steps of equal time the scheme
of the batch integrator stays the same for the whole run-up, and the loads enter as a table of what they contribute to
the state of each lane over each step: Duhamel's integral over the cubic through values and slopes of the loads at both
ends (Hermite), exact for the linear part. The angle is a closed function of time, so it has no error. Each run-up is
divided into equal times (bins), so that the speed at a bin is the same for run-ups of all rates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gapwalk.answers.speed_course import SpeedCourse, angles_of, pieces_of
from gapwalk.ensemble.batch import MOST_STEPS, BatchOptions
from gapwalk.ensemble.batch_flow import LIMIT, first_guess, revised
from gapwalk.ensemble.force_source import LANES
from gapwalk.ensemble.kernel import kernel_of
from gapwalk.ensemble.kernel_source import Form
from gapwalk.ensemble.scheme import HISTORY, Linear, scheme_of
from gapwalk.ensemble.start import past_numbers
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import contact_forces
from gapwalk.flow.ramp import Ramped
from gapwalk.model.coefficients import layout_of

_SEED = 1905
_PLACES = 4  # of each run-up that is compared with the exact flow
_TABLE = 1000  # most steps of a table of loads: 2 MB for two degrees of freedom
_SPARE_NODES = 16
_NOMINAL = 64  # steps per nominal turn, which gives the scheme its step
_LEAST_SCALE = 1e-12
_SPREAD = 3.0  # largest ratio of the durations of the run-ups of a block


@dataclass(frozen=True, eq=False)
class BatchedRunUps:
    """Extremes, forces and impacts of many run-ups in bins of time."""

    #: low, high: shape (runs, bins, n): Smallest and largest value of each coordinate.
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    forces: NDArray[np.float64]  #: shape (runs, bins, contacts): Largest magnitude of each contact force.
    #: shape (runs, bins, contacts, 2): Closures of the innermost stages, on the positive and on the negative side.
    impacts: NDArray[np.float64]
    #: shape (runs, bins + 1, 2n): States at the ends of the bins; NaN once a motion has diverged.
    states: NDArray[np.float64]
    #: error, worst, trials: As in `BatchRun`, over one forcing period or one bin, whichever is longer.
    error: float
    worst: float
    trials: int
    steps: float  #: Steps per unit of time.


def run_batch(
    ramped: Ramped,
    courses: Sequence[SpeedCourse],
    phases: NDArray[np.float64],
    states: NDArray[np.float64],
    bins: int,
    options: BatchOptions,
) -> BatchedRunUps:
    """Integrate run-ups, and repeat them with shorter steps until the error is as small as allowed."""
    structure = ramped.system.structure
    if structure.equations.variations:
        raise ModelError(
            "run-ups in a batch cannot include loads that vary a number of a contact; use gapwalk.ask.run_up, singly"
        )
    fastest = max(course.speed.max() for course in courses) * structure.frequency
    linear = Linear(layout_of(structure), ramped.coefficients(fastest, 0.0)[None])
    per_time = first_guess(linear, options.error, states) * fastest / (2.0 * math.pi)
    if options.steps is not None:
        per_time = options.steps * fastest / (2.0 * math.pi)
    few = np.sort(np.random.default_rng(_SEED).permutation(len(courses))[:LANES])
    pilot = len(courses) > 4 * LANES and options.steps is None
    while True:
        chosen = few if pilot else np.arange(len(courses))
        found = _carry(
            ramped, [courses[k] for k in chosen.tolist()], phases[chosen], states[chosen], bins, options, per_time
        )
        if options.steps is not None or not found.error > options.error:
            if not pilot:
                return found
            pilot = False
            continue
        steps = round(per_time * 2.0 * math.pi / fastest)
        if steps >= MOST_STEPS:
            raise FlowError(
                f"the error of the run-ups is {found.error:.2g} with {steps} steps per forcing period, but "
                f"{options.error:g} was requested; allow a larger error (BatchOptions(error=...)), or use "
                "gapwalk.ask.run_up, singly"
            )
        per_time = max(revised(steps, found.error, options.error), steps + 4) * fastest / (2.0 * math.pi)


def _carry(ramped, courses, phases, states, bins, options: BatchOptions, per_time: float) -> BatchedRunUps:
    """Integrate all run-ups with some steps per unit of time, block by block, and compare some with the exact flow."""
    order = np.argsort([course.duration for course in courses], kind="stable")  # lanes of a block take equal steps
    blocks = [order[start : start + LANES] for start in range(0, len(order), LANES)]
    system, n = ramped.system, ramped.system.size
    count, contacts = len(courses), len(system.structure.contacts)
    shapes = [(n,), (n,), (contacts,), (contacts, 2)]
    tallies = [np.full((count, bins, *shape), np.nan) for shape in shapes]
    strobes = np.full((count, bins + 1, 2 * n), np.nan)

    def work(lanes: NDArray[np.intp]) -> None:
        block = _Block(ramped, [courses[k] for k in lanes], phases[lanes], states[lanes], bins, per_time)
        strobes[lanes, 0] = states[lanes]
        for number in range(bins):
            rows = block.advance(number)
            strobes[lanes, number + 1] = block.states
            for table, part in zip(tallies, rows, strict=True):
                table[lanes, number] = part.reshape(len(lanes), *table.shape[2:])

    threads = min(options.thread_count, len(blocks))
    if threads == 1:
        for lanes in blocks:
            work(lanes)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, blocks))
    error, worst, trials = _judge(ramped, courses, phases, strobes, bins, options.sample)
    low, high, forces, impacts = tallies
    return BatchedRunUps(low, high, forces, impacts, strobes, error, worst, trials, per_time)


class _Block:
    """Run-ups in the lanes of one block of the kernel."""

    def __init__(self, ramped: Ramped, courses: list[SpeedCourse], phases, states, bins: int, per_time: float) -> None:
        self.ramped, self.count = ramped, len(courses)
        padded = np.minimum(np.arange(LANES), self.count - 1)
        self.courses, self.phases = [courses[k] for k in padded], phases[padded]
        system = ramped.system
        self.layout, self.unit, self.n = layout_of(system.structure), system.structure.frequency, system.size
        durations = np.array([course.duration for course in self.courses])
        self.per_bin = max(1, math.ceil(durations.max() / bins * per_time))
        self.bin = durations / bins
        self.span = self.bin / self.per_bin
        self.per_table = math.ceil(self.per_bin / math.ceil(self.per_bin / _TABLE))
        self.is_ramp = all(len(course.time) == 2 for course in self.courses)
        self.first, last = (np.array([course.speed[end] for course in self.courses]) for end in (0, -1))
        self.rate = (last - self.first) / durations
        self.highest = np.array([course.speed.max() for course in self.courses]) * self.unit
        speeds = np.array([course.speed[0] for course in self.courses]) * self.unit
        coefficients = np.tile(ramped.coefficients(speeds[0], 0.0), (LANES, 1))
        coefficients[:, 0] = self.span * _NOMINAL / (2.0 * math.pi)
        pattern = (ramped.growth != 0.0).any(axis=0)
        pattern[self.means] = True  # the loads of the table reach all of them
        pattern[0] = True
        linear = Linear(self.layout, coefficients)
        self.basis = linear.basis
        form = Form(system.structure, pattern.tobytes(), self.basis is not None, False, True, True)
        self.kernel = kernel_of(form)
        source = self.kernel.source
        self.numbers = np.ascontiguousarray(source.numbers(scheme_of(linear, _NOMINAL), linear)).ravel()
        self.weights = self._weights(linear)
        self.data = np.zeros((source.height, LANES))
        begun = states[padded]
        modal = begun if self.basis is None else np.linalg.solve(self.basis, begun[:, :, None])[:, :, 0]
        rows = [modal.T, self._history(linear, begun, speeds), past_numbers(linear, begun)]
        known = np.concatenate(rows)
        self.data[: len(known)] = known
        self.left, self.last = np.full(LANES, -1, dtype=np.int64), self.data[: 2 * self.n].copy()
        self.record, self.stop = np.zeros((0, 2 * self.n, LANES)), np.zeros(1, dtype=np.int64)

    @cached_property
    def means(self) -> NDArray[np.intp]:
        """Slots of the constant accelerations."""
        return self.layout.accelerations[:, 2 * self.n + len(self.layout.contacts)]

    @property
    def states(self) -> NDArray[np.float64]:
        """States of the lanes now, shape (lanes in use, 2n)."""
        found = self.data[: 2 * self.n].T
        if self.basis is not None:
            found = (self.basis @ found[:, :, None])[:, :, 0]
        return found[: self.count]

    def advance(self, number: int) -> list[NDArray[np.float64]]:
        """Advance all lanes over one bin; return the lows, the highs, the largest forces and the impacts in it."""
        rows = self.kernel.source.tally_rows
        self.data[rows["low"] : rows["high"]] = np.inf
        self.data[rows["high"] : rows["peak"]] = -np.inf
        self.data[rows["peak"] : rows["end"]] = 0.0
        for start in range(0, self.per_bin, self.per_table):
            steps = min(self.per_table, self.per_bin - start)
            table = self._table(number * self.bin + start * self.span, steps)
            self.kernel.advance(
                self.data.reshape(-1), self.numbers, table.reshape(-1), 0, 1, steps, 0, self.record, self.left,
                self.last, LIMIT, self.stop,
            )  # fmt: skip
        values = self.data.T[: self.count].copy()
        values[self.left[: self.count] >= 0] = np.nan
        return [values[:, first:stop] for first, stop in pairwise(rows.values())]

    def _table(self, begun: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Compute the contribution of the loads to each of some steps, shape (steps, 2n, lanes).

        Along a ramp they are analytic functions of the time at which a step begins, so they are interpolated between
        Chebyshev points, as many as half the angle that the highest order turns by, and some for accuracy.
        """
        if not self.is_ramp:
            return self._contributions(begun + np.arange(steps)[:, None] * self.span)
        orders = max(self.layout.orders, default=1)
        angle = float((self.highest * self.span).max()) * orders * steps
        nodes = math.ceil(angle / 2.0) + _SPARE_NODES
        if nodes >= steps:
            return self._contributions(begun + np.arange(steps)[:, None] * self.span)
        points, between = _interpolation(nodes, steps)
        known = self._contributions(begun + points[:, None] * self.span)
        return (between @ known.reshape(nodes, -1)).reshape(steps, 2 * self.n, LANES)

    def _contributions(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the contribution of the loads to steps that begin at some times, shape (times, 2n, lanes)."""
        table, buffer = np.zeros((len(times), 2 * self.n, LANES)), np.empty(times.shape)
        for end, since in enumerate((times, times + self.span)):
            value, slope = self._loads(*self._motion(since))
            slope *= self.span
            for weights, part in ((self.weights[end], value), (self.weights[2 + end], slope)):
                for row in range(2 * self.n):
                    for column in range(self.n):
                        np.multiply(part[column], weights[:, row, column], out=buffer)
                        table[:, row] += buffer
        return table

    def _motion(self, times: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
        """Return speed W, angle and acceleration dW/dt of each lane at some times, shape (times, lanes)."""
        if self.is_ramp:
            first, rate = self.first, self.rate
            speed, turned = first + rate * times, times * (first + 0.5 * rate * times)
        else:
            rate = np.zeros_like(times)
            pairs = []
            for lane, course in enumerate(self.courses):
                inside = np.minimum(times[:, lane], course.duration)
                pairs.append(course.at(inside))
                place = np.clip(np.searchsorted(course.time, inside, side="right") - 1, 0, len(course.time) - 2)
                rate[:, lane] = course.rates[place]
            speed, turned = (np.stack(each, axis=1) for each in zip(*pairs, strict=True))
        return speed * self.unit, self.phases + turned * self.unit, np.broadcast_to(rate * self.unit, times.shape)

    def _loads(self, speed, theta, rate) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the accelerations by the loads, and their slopes over time, shape (n, ..., lanes)."""
        count = len(self.layout.orders)
        rows = self.layout.accelerations[:, 2 * self.n + len(self.layout.contacts) :]
        turn = np.empty((2, *theta.shape))
        turn[0], turn[1] = np.cos(theta), np.sin(theta)
        waves, known = np.empty((2 * count, *theta.shape)), {1: (turn[0], turn[1])}
        for place, order in enumerate(self.layout.orders):
            waves[place], waves[count + place] = _multiple(order, known)
        flat = waves.reshape(2 * count, -1)
        shape = (self.n, *theta.shape)
        value, slope, scale = np.zeros(shape), np.zeros(shape), np.ones_like(speed)
        orders = np.array(self.layout.orders, dtype=float)
        for power, growth in enumerate(self.ramped.growth):
            numbers = growth[rows]
            if power and not numbers.any():
                continue
            scale = speed**power
            cosines, sines = numbers[:, 1 : 1 + count], numbers[:, 1 + count :]
            here = (numbers[:, 1:] @ flat).reshape(shape) + numbers[:, 0].reshape(-1, *[1] * theta.ndim)
            turning = (np.hstack((sines * orders, -cosines * orders)) @ flat).reshape(shape) * speed
            value += here * scale if power else here
            slope += turning * scale if power else turning
            if power:
                slope += power * here * speed ** (power - 1) * rate
        value += self.ramped.carried.reshape(-1, *[1] * theta.ndim) * rate
        return value, slope

    def _weights(self, linear: Linear) -> list[NDArray[np.float64]]:
        """Compute the contributions of values and slopes (times the step) of the loads, at the start and the end."""
        n, n2 = self.n, 2 * self.n
        matrix = np.zeros((LANES, n2 + 4 * n, n2 + 4 * n))
        matrix[:, :n2, :n2] = linear.matrix * self.span[:, None, None]
        matrix[:, n:n2, n2 : n2 + n] = np.eye(n) * self.span[:, None, None]
        for row in range(3 * n):
            matrix[:, n2 + row, n2 + n + row] = 1.0
        carried = expm(matrix)
        m = [carried[:, :n2, n2 + n * j : n2 + n * (j + 1)] * math.factorial(j) for j in range(4)]
        found = [m[0] - 3 * m[2] + 2 * m[3], 3 * m[2] - 2 * m[3], m[1] - 2 * m[2] + m[3], m[3] - m[2]]
        return found if self.basis is None else [np.linalg.solve(self.basis, each) for each in found]

    def _history(self, linear: Linear, states, speeds) -> NDArray[np.float64]:
        """Compute the contact forces at the start and before it, where the speed was the first one."""
        contacts = len(self.layout.contacts)
        found = np.zeros((HISTORY, contacts, LANES))
        if not contacts:
            return found.reshape(0, LANES)
        coefficients, still = linear.coefficients, np.zeros(LANES)

        def forces(y, theta):
            return contact_forces(self.layout, coefficients[0], theta, y[:, : self.n], y[:, self.n :])

        def slopes(y, theta):
            moved = np.einsum("lij,lj->li", linear.matrix, y) + np.einsum("lik,lk->li", linear.push, forces(y, theta))
            moved[:, self.n :] += self._loads(speeds, theta, still)[0].T
            return moved

        y, theta, h, turn = states, self.phases, -self.span[:, None], -self.span * speeds
        for number in range(HISTORY):
            found[number] = forces(y, theta).T
            k1 = slopes(y, theta)
            k2 = slopes(y + h / 2 * k1, theta + turn / 2)
            k3 = slopes(y + h / 2 * k2, theta + turn / 2)
            k4 = slopes(y + h * k3, theta + turn)
            y, theta = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), theta + turn
        return found.reshape(HISTORY * contacts, LANES)


def _multiple(order: int, known: dict[int, tuple[NDArray, NDArray]]) -> tuple[NDArray, NDArray]:
    """Return cosine and sine of a multiple of an angle, from those of lower ones."""
    if order not in known:
        (c1, s1), (c2, s2) = _multiple(order // 2, known), _multiple(order - order // 2, known)
        known[order] = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    return known[order]


@lru_cache(maxsize=64)
def _interpolation(nodes: int, steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Chebyshev points, in steps, and the matrix from values there to those at the beginnings of the steps."""
    points = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    places = np.linspace(-1.0, 1.0, steps)
    here, there = (np.polynomial.chebyshev.chebvander(x, nodes - 1) for x in (points, places))
    return (points + 1.0) / 2.0 * (steps - 1), there @ np.linalg.inv(here)


def _judge(ramped: Ramped, courses, phases, strobes, bins: int, sample: int) -> tuple[float, float, int]:
    """Compare some stretches of some run-ups with the exact flow; see `BatchOptions.error`."""
    random, n = np.random.default_rng(_SEED + 1), ramped.system.size
    lanes = random.choice(len(courses), min(sample, len(courses)), replace=False)
    differences, sizes = [], []
    for lane in lanes:
        course = courses[int(lane)]
        slow = PERIOD / (float(course.speed.min()) * ramped.system.structure.frequency)
        length = min(bins, max(1, math.ceil(slow / course.duration * bins)))
        for start in random.integers(0, bins - length + 1, _PLACES):
            before, after = strobes[lane, start], strobes[lane, start + length]
            if not np.all(np.isfinite(after)):
                continue
            times = course.duration / bins * np.array([start, start + length])
            path = exact_between(ramped, course, float(phases[lane]), before, float(times[0]), float(times[1]))
            differences.append(np.abs(after - path[-1]))
            sizes.append(np.abs(path).max(axis=0))
    if not differences:
        return 0.0, 0.0, 0
    scale = np.array(sizes).max(axis=0)
    for part in (slice(0, n), slice(n, 2 * n)):
        scale[part] = np.maximum(scale[part], max(scale[part].max() * _LEAST_SCALE, np.finfo(float).tiny))
    errors = (np.array(differences) / scale).max(axis=1)
    return float(np.sqrt(np.mean(errors**2))), float(errors.max()), len(errors)


def exact_between(
    ramped: Ramped, course: SpeedCourse, phase: float, state: NDArray[np.float64], start: float, stop: float
) -> NDArray[np.float64]:
    """Integrate a part of a run-up exactly, from one time to another; return states along it, the last at the end."""
    inside = course.time[(course.time > start + 1e-12 * stop) & (course.time < stop * (1.0 - 1e-12))]
    times = np.concatenate(([start], inside, [stop]))
    speeds, turned = course.at(times)
    part = SpeedCourse(times - start, speeds)
    begun = (phase + turned[0] * ramped.system.structure.frequency) % PERIOD
    rows = [state]
    for piece in pieces_of(ramped.system, part, angles_of(ramped.system, part, begun, 32)):
        rows += list(ramped.sample(rows[-1], piece.angles, piece.speed, piece.acceleration).states[1:])
    return np.array(rows)
