"""Settling of many motions by equal steps: which gaps part, how badly, and with which period.

Each lane follows a motion until one of three rules decides. Quiet: no contact has opened or closed for eight periods,
and the rest of the transient, estimated from its contraction, is less than a third of each gap's distance from a
change. Periodic: the section repeats after at most eight periods, and the same holds. Otherwise the motion has no
period: 64 periods or more are evaluated, and means over eight batches give intervals. What a motion does is independent
of those beside it.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.ensemble.lane_code import OF_CONTACT, OF_COORDINATE, OF_SIGNAL, WIDTH
from gapwalk.ensemble.lanes import Lanes, even, steps_of, turn_of
from gapwalk.flow.forces import accelerations, contact_deflections
from gapwalk.flow.motion import acceleration_names, signal_factor
from gapwalk.model.coefficients import ParameterPlane, coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System
from gapwalk.orbit.find import orbit_near

LANE_ERROR = 1e-3
"""Error of a period by equal steps, relative to the size of the motion, where contacts open and close."""
_BLOCK = 6  # forcing periods between two examinations
_APART = 8  # forcing periods between which a transient is compared
_LONGEST = 8  # longest period that is distinguished from none
_ENVELOPE = 6  # of them in succession, whose largest change counts: a mode that oscillates changes little at times
_SAME = 2e-3  # difference of two sections, relative to the range of each coordinate, up to which they are the same
_SAFE = 3.0  # factor by which the distance of a gap from a change exceeds what is left of the transient
_WATCHED, _BATCHES, _STUDENT = 64, 8, 2.365  # periods and batches of a motion without period; 95 % of 7 degrees
TIMES = 8.0
"""Times of the decay of a free vibration over which chaos that excites it is watched."""
LONG = 512
"""Periods over which a motion without period is watched at most: where a label depends on it, or a swing lasts."""
_GLANCE = 32  # periods, the latest, in which a motion without period that is known is recognised
_RARE = 3.0  # closings that are expected in these periods, up to which there may be none: with 95 % confidence
_TRANSIENT, _WARM = 40, 16  # periods before them, and after a small step
_DOUBT = 128  # periods of a motion without period that is none of those known, before it counts as another
_PATIENCE = 400  # the most periods of a transient that shrinks
_SHRINKS = 0.9  # ratio of the changes over `_APART` periods up to which it does
_NEAR = 0.1  # distance from a known motion, relative to its ranges and accelerations, within which one approaches it
_SETTLED = 0.005  # what may be left of the mean square of an acceleration, relative to it
_ENDED = 2e-3  # distance of slow coordinates from where they end, relative to their range
_STILL = 1e-7  # change of an extreme, relative to the width of its gap, that counts as none
_FINER = 4.0  # factor on the steps of motions that failed, or whose labels the error of the steps leaves open
_WITHIN = 0.03  # the same error of an extreme that few periods of a motion without period reach, relative to its range
_LOOK = 256  # periods of a motion without period over which that is decided
_CEASED = 7.0  # -log of the probability with which a gap that parts at random does so early in a watch only
_LEAVES = 2048  # the most periods in which a motion without period that drifts may become another
_DRIFTS = 0.4  # steps between batches, squared, of their squared spread: less is seen once in 1,000 times without drift
_CLEAR = 0.2  # the same difference, of that after fewer periods
_EQUAL = 1e-6  # difference of two sections, as that above, that need not shrink any more
_SUMS = ("total", "drift", "power", "energy", "fourth")  # notes of which the means over a period are kept
_EXTRAPOLATED, _SECTIONS = 12, 12  # periods between extrapolations, and sections of each
_TINY = float(np.finfo(float).tiny)
_SWINGS = 0.03  # share of an acceleration from which a free swing counts
_SHORTEST, _TURNS = -0.08, 0.05  # growth of a free swing over a period, at least, and the angle by which it turns
_CANCELS, _SPREAD = 0.1, 50.0  # what may be left of the changes, of the largest; the most that weights may add up to
_KINDS = (*OF_CONTACT, *OF_COORDINATE, *OF_SIGNAL)


@dataclass(frozen=True, eq=False)
class LaneMotion:
    """A settled motion by equal steps; arrays of contacts have nan for those without stages.

    Figures are those of one period, or means over the periods that were watched where there is none, and then the
    largest in them.
    """

    value: float  #: Value of the parameter.
    state: NDArray[np.float64]  #: shape (state_size,): A state at theta = 0; nan if the motion diverged.
    #: period, waited, watched: Period in forcing periods, 0 if it has none of at most eight; periods of the transient,
    #: and of the figures.
    period: int
    waited: int
    watched: int
    sides: NDArray[np.float64]  #: shape (contacts, 2): Closings per period on the positive and the negative side.
    closed: NDArray[np.bool_]  #: shape (contacts,): True for one that is closed at theta = 0.
    #: peak, power, approach: shape (contacts,): Largest force; mean power that it takes; largest approach velocity.
    peak: NDArray[np.float64]
    power: NDArray[np.float64]
    approach: NDArray[np.float64]
    extremes: NDArray[np.float64]  #: shape (3, n): Least, mean and largest value of each coordinate.
    #: rms, largest, kurtosis: shape (signals,): Root mean square, largest magnitude and kurtosis of accelerations.
    rms: NDArray[np.float64]
    largest: NDArray[np.float64]
    kurtosis: NDArray[np.float64]
    #: shape (signals,): Half the width of the interval of the root mean square at 95 %.
    error: NDArray[np.float64]
    #: parted, margin: shape (contacts,): Watched periods in which it closed; and how far it stays from that: its least
    #: distance, as a share of how far that is below the mean of the least distances of single periods.
    parted: NDArray[np.float64]
    margin: NDArray[np.float64]

    @property
    def diverged(self) -> bool:
        """True if it has diverged."""
        return not np.isfinite(self.state).all()

    def after(self, before: LaneMotion) -> LaneMotion:
        """Return this motion with all periods of the one that it continues as part of its transient."""
        return replace(self, waited=before.waited + before.watched + self.waited)

    def is_like(self, other: LaneMotion) -> bool:
        """Return True if both are the same motion, by what their gaps do and by their accelerations."""
        if self.diverged or other.diverged:
            return self.diverged and other.diverged
        return self.has_like(other.rms, other.error)

    def has_like(self, rms: NDArray[np.float64], error: NDArray[np.float64]) -> bool:
        """Return True if intervals of accelerations overlap: four standard errors, of which an interval has two."""
        within = np.maximum(2.0 * np.hypot(self.error, error), _ALIKE * (self.rms + rms))
        return bool(np.all(np.abs(self.rms - rms) <= within))


_ALIKE = 0.01  # of the sum of two accelerations: half the relative difference up to which they count as equal


def acceleration_rows(system: System) -> NDArray[np.float64]:
    """Return the accelerations by those of the coordinates, 1, and the cosines and sines of all orders."""
    # Their shape is (signals, n + 1 + 2 orders), in the units of the signals.
    assembly, n, orders = system.structure.assembly, system.size, layout_of(system.structure).orders
    names = acceleration_names(system)
    factors = np.array([signal_factor(system, name) for name in names])
    if not isinstance(assembly, TrainAssembly):
        return np.eye(n, n + 1 + 2 * len(orders)) * factors[:, None]
    train = assembly.numbers(system.values)
    quick = [place for place, name in enumerate(assembly.form.inertias) if name not in assembly.form.slow]
    return np.hstack((train.angles, train.driven(orders)))[quick] * factors[:, None]


def _accelerations(energy: NDArray[np.float64], *, is_sample: bool = True) -> tuple[Any, Any]:
    """Return root mean squares from those of successive periods, and half the width of their intervals at 95 %."""
    rms = np.sqrt(energy.mean(axis=0))
    if not is_sample:
        return rms, np.zeros_like(rms)
    spread = energy.reshape(_BATCHES, -1, len(rms)).mean(axis=1).std(axis=0, ddof=1) / math.sqrt(_BATCHES)
    return rms, _STUDENT * spread / (2.0 * np.maximum(rms, _TINY))


def drifts(energy: NDArray[np.float64]) -> bool:
    """Return True if successive batches of mean squares differ less than any two do (von Neumann 1941)."""
    means = energy.reshape(_BATCHES, -1, energy.shape[1]).mean(axis=1)
    steps, spread = ((each**2).sum(axis=0) for each in (np.diff(means, axis=0), means - means.mean(axis=0)))
    return bool(np.any(steps < _DRIFTS * spread))


def has_ceased(closings: NDArray[np.float64]) -> bool:
    """Return True if some gap closed in early periods only, and too often for chance: a transient was watched."""
    closes, watched = closings > 0.0, len(closings)
    last = watched - np.argmax(closes[::-1], axis=0)
    return bool(np.any(closes.sum(axis=0) * np.log(watched / last) > _CEASED))


class Start(NamedTuple):
    """A motion to be followed: anything that names it, the value of the parameter, the system, and its state."""

    key: Any
    value: float
    system: System
    state: NDArray[np.float64]
    known: tuple[LaneMotion, ...] = ()  #: Settled motions at this value, to one of which it may lead.
    is_warm: bool = False  #: True for a state on a settled motion nearby.
    watch: int = _WATCHED  #: Periods over which a motion without period is watched at least; a multiple of eight.


class _SlowModes(NamedTuple):
    """Free vibrations slower than the excitation that outlast some of its periods."""

    multipliers: NDArray[np.complex128]  #: shape (modes,): Factors over a forcing period.
    left: NDArray[np.complex128]  #: shape (modes, 2n): Rows that give their coordinates from a state.
    right: NDArray[np.complex128]  #: shape (2n, modes): States of a unit of each.
    shares: NDArray[np.float64]  #: shape (signals, modes): Accelerations of a unit of each.

    @property
    def longest(self) -> float:
        """The most forcing periods in which one of them falls to 1/e."""
        return float((-1.0 / np.log(np.abs(self.multipliers))).max(initial=0.0))

    def ends(self, sections: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return their coordinates at successive sections, and where these end, in chaos in the mean."""
        own = sections[:, : self.left.shape[1]] @ self.left.T
        return own, (own[1:] - self.multipliers * own[:-1]).mean(axis=0) / (1.0 - self.multipliers)


def slow_modes(system: System, mean: NDArray[np.float64], signals: NDArray[np.float64] | None = None) -> _SlowModes:
    """Return the slow free vibrations about the mean position of a motion; meshes that part are closed for them."""
    n, signals = system.size, acceleration_rows(system) if signals is None else signals
    about, size = np.concatenate((mean, np.zeros(n))), 1e-30  # derivatives by a complex step
    states = about + 1j * size * np.eye(2 * n)
    layout, numbers, assembly = layout_of(system.structure), coefficients_of(system), system.structure.assembly
    loose = (
        {link.name for link in assembly.form.links if not link.always} if isinstance(assembly, TrainAssembly) else ()
    )
    closed = list[list[bool]]()
    for slots, x in zip(layout.contacts, contact_deflections(layout, numbers, 0.0, mean), strict=True):
        first = next((stage.sign for stage in slots.stages if slots.form.name.split(".", maxsplit=1)[0] in loose), 0)
        pressed = (stage.sign * (x - stage.sign * numbers[stage.clearance]) > 0.0 for stage in slots.stages)
        closed.append(
            [
                stage.innermost and stage.sign == first if first else each
                for stage, each in zip(slots.stages, pressed, strict=True)
            ]
        )
    moved = accelerations(layout, numbers, 0.0, states[:, :n], states[:, n:], closed)
    values, right = np.linalg.eig(np.vstack((np.eye(n, 2 * n, n), np.imag(moved).T / size)))
    left, powers = np.linalg.pinv(right), values * 2.0 * np.pi / system.frequency
    turn, lasts = np.abs(powers.imag - np.pi) < np.pi - _TURNS, np.abs(powers.real / _SHORTEST - 0.5) < 0.5
    chosen = np.flatnonzero(turn & lasts)
    values, left, right = values[chosen], left[chosen].astype(complex), right[:, chosen].astype(complex)
    return _SlowModes(np.exp(powers[chosen]), left, right, np.abs(signals[:, :n] @ (right[:n] * values**2)))


def _of_periods(rows: NDArray[np.float64], q: int, over: Callable[..., Any]) -> NDArray[np.float64]:
    """Return the least, mean or largest of each q successive rows."""
    return rows if q == 1 else over(np.lib.stride_tricks.sliding_window_view(rows, q, axis=0), axis=-1)


def starts_at(system: System, states: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]]) -> list[Start]:
    """Return starts by their numbers, each from its state and at its own values of named parameters."""
    plane, known = ParameterPlane(system, tuple(values)), {(): system}
    keys = list(zip(*(each.tolist() for each in values.values()), strict=True)) or [()] * len(states)
    known |= {key: plane.system_at(*key) for key in dict.fromkeys(keys) if key}
    return [Start(k, 0.0, known[key], state) for k, (key, state) in enumerate(zip(keys, states, strict=True))]


def settle_lanes(
    starts: Iterable[Start],
    next_start: Callable[[Start, LaneMotion], Start | None] = lambda start, motion: None,
    *,
    width: int = WIDTH,
    finer: float = 1.0,
    slowest: Sequence[System] = (),
    gaps: Sequence[str] = (),
) -> Iterator[tuple[Start, LaneMotion]]:
    """Follow motions of systems of one structure until they have settled; yield each once it is decided.

    `next_start` returns what the lane of a settled motion does next, such as the next step of a sweep. Lanes of equal
    steps share a register, so that no motion depends on its company: those that its system needs, or those of the
    slowest of some systems. What some gaps do, or all, is checked by exact orbits where steps leave doubts.
    """
    groups, failed = dict[int, deque[Start]](), list[Start]()
    starts = list(starts)
    systems = [*slowest, *(start.system for start in starts)]
    needed = np.array([coefficients_of(each) for each in systems])
    needed = steps_of(layout_of(systems[0].structure), needed).tolist() if systems else []
    every = [even(math.ceil(finer * each)) for each in needed]
    least = max(every[: len(slowest)], default=0)
    for start, own in zip(starts, every[len(slowest) :], strict=True):
        groups.setdefault(max(own, least), deque()).append(start)
    for steps, waiting in sorted(groups.items()):
        taken = [waiting.popleft() for _ in range(min(width, len(waiting)))]
        lanes = _Settling(taken, taken[0].system, finer, steps, gaps)
        while any(start is not None for start in lanes.starts):
            lanes.advance()
            for lane, motion in lanes.decided():
                start = lanes.starts[lane]
                assert start is not None
                if motion.diverged and finer < _FINER:
                    failed.append(start)
                    following = None
                else:
                    following = next_start(start, motion)
                    yield start, motion
                lanes.take(lane, following or (waiting.popleft() if waiting else None))
            lanes.hasten()
    if failed:
        yield from settle_lanes(failed, next_start, width=width, finer=_FINER, slowest=slowest, gaps=gaps)


def settled_again(
    motions: Mapping[Any, LaneMotion],
    system_at: Callable[[float], System],
    *,
    finer: float = 1.0,
    watch: int = _WATCHED,
    gaps: Sequence[str] = (),
) -> dict[Any, LaneMotion]:
    """Continue settled motions, each at its own value, with finer steps or a longer watch."""
    starts = [
        Start(key, motion.value, system_at(motion.value), motion.state, is_warm=True, watch=watch)
        for key, motion in motions.items()
    ]
    systems = [start.system for start in starts]
    return {start.key: motion for start, motion in settle_lanes(starts, finer=finer, slowest=systems, gaps=gaps)}


def slow_places(system: System) -> list[int]:
    """Return the places in a state of the coordinates whose deflection is no gap, and of their rates."""
    n, names = system.size, system.coordinates
    gaps = {slots.form.name.split(".", maxsplit=1)[0] for slots in layout_of(system.structure).contacts if slots.stages}
    assembly = system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        gaps -= {link.name for link in assembly.form.links if link.always}
    own = [k for k in range(n) if names[k] not in gaps]
    return [*own, *(n + k for k in own)]


class _Settling:
    """Lanes, each with the motion that it follows."""

    def __init__(self, starts: list[Start], system: System, finer: float, steps: int, gaps: Sequence[str]) -> None:
        self.starts: list[Start | None] = list(starts)
        self.gaps = gaps
        structure = system.structure
        self.layout = layout_of(structure)
        self.staged = [k for k, slots in enumerate(self.layout.contacts) if slots.stages]
        self.asked = np.array([not gaps or self.layout.contacts[k].form.name in gaps for k in self.staged], dtype=bool)
        coefficients = np.array([coefficients_of(start.system) for start in starts])
        states = np.array([start.state for start in starts])
        self.rows_of = dict[bytes, NDArray[np.float64]]()
        signals = np.array([self._rows(start.system) for start in starts])
        kinds = [kind for kind in _KINDS if kind != "drift" or turn_of(structure) is not None]
        self.lanes = Lanes(structure, coefficients, states, kinds=kinds, signals=signals, finer=finer, steps=steps)
        rows = [kind for kind, _ in self.lanes.code.notes]  # those of a kind follow one another
        begin = {kind: rows.index(kind) if kind in rows else 0 for kind in kinds}
        self.kinds = {kind: slice(first, first + rows.count(kind)) for kind, first in begin.items()}
        self.closes = slice(self.kinds["up"].start, self.kinds["down"].stop)
        self.sums = np.flatnonzero([kind in _SUMS for kind in rows])
        count = len(starts)
        #: The notes of each lane over each period that it was followed, and the states at its end; and their number.
        self.notes, self.strobes = np.zeros((count, _WATCHED, len(rows))), np.zeros((count, _WATCHED, states.shape[1]))
        self.ages, self.waits = [0] * count, [0] * count
        #: The exact orbit of each lane, for which none was looked if it is None.
        self.orbits: list[tuple[NDArray[np.float64], ...] | None] = [None] * count
        self.slow = slow_places(system)
        self.modes = dict[bytes, _SlowModes]()
        self.clear = np.array([self._clearances(row) for row in coefficients]).reshape(count, 2, -1)

    def _rows(self, system: System) -> NDArray[np.float64]:
        """Return the rows of its accelerations; they do not depend on the speed itself, unless loads do."""
        key = system.values[0 if self.layout.frequency_enters else 1 :].tobytes()
        if key not in self.rows_of:
            self.rows_of[key] = acceleration_rows(system)
        return self.rows_of[key]

    def take(self, lane: int, start: Start | None) -> None:
        """Give a lane another motion, or none."""
        self.starts[lane] = start
        self.ages[lane], self.waits[lane], self.orbits[lane] = 0, 0, None
        if start is not None:
            numbers = coefficients_of(start.system)
            self.lanes.put(np.array([lane]), numbers[None], start.state[None], self._rows(start.system)[None])
            self.clear[lane] = self._clearances(numbers)
        else:
            self.lanes.idle(lane)

    def advance(self) -> None:
        """Advance all motions by some forcing periods."""
        notes, states = self.lanes.advance(_BLOCK)
        notes[..., self.sums] /= self.lanes.steps[:, None]
        if max(self.ages) + _BLOCK > self.notes.shape[1]:
            self.notes, self.strobes = (np.concatenate((each, each), axis=1) for each in (self.notes, self.strobes))
        for lane, start in enumerate(self.starts):
            if start is None:
                continue
            age = self.ages[lane] = self.ages[lane] + _BLOCK
            self.notes[lane, age - _BLOCK : age], self.strobes[lane, age - _BLOCK : age] = (
                notes[:, lane],
                states[:, lane],
            )

    def hasten(self) -> None:
        """Take what dies slowly out of the motions that are not decided."""
        for lane, start in enumerate(self.starts):
            age, waits = self.ages[lane], self.waits[lane]
            if start is None or not age or age % _EXTRAPOLATED or waits > _PATIENCE:
                continue
            repeats, is_early = not np.ptp(self._closings(lane, _ENVELOPE), axis=0).any(), waits <= _TRANSIENT
            if is_early and (repeats or not start.is_warm) and self._extrapolate(lane):
                continue
            # where gaps close otherwise in each period, a swing may be what leads a start to another motion
            if age > _EXTRAPOLATED and (repeats or (start.is_warm and is_early and not waits)):
                self._calm(lane, start)

    def _noted(self, lane: int, count: int) -> NDArray[np.float64]:
        """Return the notes of the latest periods."""
        return self.notes[lane, max(self.ages[lane] - count, 0) : self.ages[lane]]

    def _sections(self, lane: int, count: int) -> NDArray[np.float64]:
        """Return the latest sections."""
        return self.strobes[lane, max(self.ages[lane] - count, 0) : self.ages[lane]]

    def _closings(self, lane: int, count: int) -> NDArray[np.float64]:
        """Return the closings on both sides of each gap in the latest periods."""
        return self._noted(lane, count)[:, self.closes]

    def _extrapolate(self, lane: int) -> bool:
        """Take the slow modes of a transient to where they end; return True if that was needed."""
        end = self._slow_end(lane)
        if end is None or self._is_there(lane, end):
            return False
        state = self._sections(lane, 1)[0].copy()
        state[self.slow] = end
        self._restart(lane, state)
        return True

    def _calm(self, lane: int, start: Start) -> None:
        """Take free swings out of chaos, which would last longer than it is watched, and hide where slow modes end."""
        modes = self._modes_of(lane, start)
        own, end = modes.ends(self._sections(lane, _EXTRAPOLATED))
        if self._swing(lane, modes, np.abs(end - own[-1])) > _SWINGS:
            state = self._sections(lane, 1)[0].copy()
            state[self.slow] += 2.0 * np.real(modes.right[self.slow] @ (end - own[-1]))
            self._restart(lane, state)

    def _modes_of(self, lane: int, start: Start) -> _SlowModes:
        mean = self._noted(lane, _EXTRAPOLATED)[:, self.kinds["total"]].mean(axis=0)
        numbers = coefficients_of(start.system)
        x = contact_deflections(self.layout, numbers, 0.0, mean)[self.staged]
        key = numbers.tobytes() + (x < self.clear[lane]).tobytes()
        if key not in self.modes:
            self.modes[key] = slow_modes(start.system, mean, self._rows(start.system))
        return self.modes[key]

    def _swing(self, lane: int, modes: _SlowModes, sizes: NDArray[np.float64]) -> float:
        """Return the largest acceleration of free swings of some sizes, as a share of what is accelerated anyway."""
        energy = self._noted(lane, _EXTRAPOLATED)[:, self.kinds["energy"]].mean(axis=0)
        return float((math.sqrt(2.0) * modes.shares @ sizes / np.sqrt(energy)).max(initial=0.0))

    def _watch(self, lane: int, start: Start) -> int:
        """Return the periods to watch a motion without period: more if chaos excites a swing that lasts."""
        modes, watched = self._modes_of(lane, start), start.watch
        own, end = modes.ends(self._sections(lane, _WATCHED))
        swing = self._swing(lane, modes, np.sqrt((np.abs(own - end) ** 2).mean(axis=0)))
        if swing > _SWINGS or modes.longest > _WATCHED:  # chaos may let one that outlasts the watch grow
            watched = max(watched, _BATCHES * math.ceil(TIMES * modes.longest / _BATCHES))
        return max(start.watch, min(watched, LONG))

    def _restart(self, lane: int, state: NDArray[np.float64]) -> None:
        self.waits[lane], self.ages[lane] = self.waits[lane] + self.ages[lane], 0
        self.lanes.restart(np.array([lane]), state[None])

    def _slow_end(self, lane: int) -> NDArray[np.float64] | None:
        """Return where the slow modes of a transient end, by reduced rank extrapolation; None if that is not known.

        A sum of sections whose changes cancel is a fixed point of linear modes (Eddy 1979; Sidi 1986). Gaps are left
        out: a sum of their deflections would have them overlap.
        """
        # half as many changes as there are numbers: more would cancel in chaos as well
        count = min(_SECTIONS, 2 + len(self.slow) // 2)
        sections = self._sections(lane, count)[:, self.slow]
        changes = np.diff(sections, axis=0)
        largest = np.abs(changes).max(axis=0)
        scaled = changes / np.where(largest <= _STILL * np.abs(sections).max(axis=0), np.inf, largest)
        products = scaled @ scaled.T
        if not (trace := float(np.trace(products))) > 0.0:
            return None
        weights = np.linalg.solve(products + 1e-9 * trace * np.eye(len(products)), np.ones(len(products)))
        weights /= weights.sum()
        left = np.sqrt(max(float(weights @ products @ weights), 0.0) / np.diag(products).max())
        return None if left > _CANCELS or np.abs(weights).sum() > _SPREAD else weights @ sections[1:]

    def _clearances(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the breakpoints of the innermost stages on the negative and the positive side of each contact."""
        found = np.array([[-np.inf], [np.inf]]) * np.ones(len(self.staged))
        for place, contact in enumerate(self.staged):
            for stage in self.layout.contacts[contact].stages:
                if stage.innermost:
                    found[int(stage.sign > 0), place] = stage.sign * numbers[stage.clearance]
        return found

    def decided(self) -> Iterator[tuple[int, LaneMotion]]:
        """Yield the lanes whose motion has settled."""
        lost = self.lanes.diverged
        states = self.lanes.states
        for lane, start in enumerate(self.starts):
            if start is None:
                continue
            if lost[lane]:
                yield lane, self._motion(lane, start, np.full_like(states[lane], np.nan), 0, 1)
                continue
            if found := self.orbits[lane]:
                self.ages[lane] = 1
                yield lane, self._motion(lane, start, found[0], 1, 1)
            elif (there := self._arrives(lane, start)) is not None:
                yield lane, there
            elif (verdict := self._judge(lane, start)) is not None:
                yield lane, self._checked(lane, start, self._motion(lane, start, states[lane].copy(), *verdict))

    def _judge(self, lane: int, start: Start) -> tuple[int, int] | None:
        """Return the period and the number of watched periods once the motion of a lane is decided; else None."""
        age = self.ages[lane]
        if age < 2 * _APART + _ENVELOPE:
            return None
        recent = self._noted(lane, 2 * _APART + _ENVELOPE + 3 * _LONGEST)
        counts = recent[:, self.closes]
        period, shrinks = self._period(lane, counts), 1.0
        if period or not counts[-_APART:].any():
            q = period or 1
            shrinks, left, of_energy, at = self._left(recent, q)
            distance = np.min([np.abs(each - bound) for each in at for bound in self.clear[lane]], axis=0)
            if (
                np.all(_SAFE * left <= distance)
                and np.all(of_energy <= _SETTLED)
                and (q > 1 or (end := self._slow_end(lane)) is None or self._is_there(lane, end))
            ):
                return q, q
        transient = _WARM if start.is_warm else _TRANSIENT
        if age < transient + start.watch:
            return None
        if not period and self._is_at_orbit(lane, start):
            return None
        if age < _PATIENCE and (shrinks < _SHRINKS or self._calms(lane)):
            return None
        if period:
            return period, period
        if age < transient + (watched := self._watch(lane, start)):
            return None
        # what closes alike in all periods, and yet does not repeat, leaves a motion that is unstable
        leaves = watched >= LONG and not np.ptp(self._closings(lane, watched), axis=0).any()
        leaves = leaves or drifts(self._noted(lane, watched)[:, self.kinds["energy"]])
        leaves = leaves or has_ceased(self._closings(lane, watched))
        if leaves and self.waits[lane] + age < _LEAVES:
            self.starts[lane] = start._replace(watch=min(2 * watched, LONG))
            self._restart(lane, self._sections(lane, 1)[0])
            return None
        # chaos that dies out after a hundred periods is no other motion than the one that is known
        about = _accelerations(self._noted(lane, _WATCHED)[:, self.kinds["energy"]])
        is_new = bool(start.known) and not any(each.has_like(*about) for each in start.known)
        return None if is_new and self.waits[lane] + age < _DOUBT else (0, watched)

    def _is_at_orbit(self, lane: int, start: Start) -> bool:
        """Begin at the stable orbit near a motion that closes alike in all periods and yet does not repeat, if one is.

        Equal steps keep a lightly damped orbit with impacts moving by some percent, and a slow mode may outlast any
        watch; the exact flow knows both. What the orbit does in its first period is then taken.
        """
        if self.orbits[lane] is not None or np.ptp(self._closings(lane, start.watch), axis=0).any():
            return False
        self.orbits[lane] = ()
        if (orbit := orbit_near(start.system, 1, self._sections(lane, 1)[0])) is None:
            return False
        self._restart(lane, orbit.state)
        self.orbits[lane] = (orbit.state,)
        return True

    def _checked(self, lane: int, start: Start, motion: LaneMotion) -> LaneMotion:
        """Return a motion with a gap nearer to a change than steps tell as its orbit is, or else as finer steps do."""
        notes, finer = self._noted(lane, motion.watched), self.lanes.finer
        low, high = notes[:, self.kinds["low"]].min(axis=0), notes[:, self.kinds["high"]].max(axis=0)
        apart = np.min([np.abs(each - bound) for each in (low, high) for bound in self.clear[lane]], axis=0)
        often = motion.parted[self.staged] / motion.watched
        is_rare = (often > 0.0) & (often < 0.5) & (not motion.period)
        within = np.where(is_rare, _WITHIN, 3.0 * LANE_ERROR) / finer * (high - low)
        if np.all((apart > within)[self.asked]):
            return motion
        orbit = orbit_near(start.system, motion.period, motion.state) if motion.period else None
        if orbit is None:
            if finer > 1.0:
                return motion
            watch = max(motion.watched, _LOOK)
            again = settled_again({0: motion}, lambda _: start.system, finer=_FINER, watch=watch, gaps=self.gaps)[0]
            return motion if again.diverged else again.after(motion)
        sides, first = motion.sides.copy(), dict[tuple[int, float], int]()
        for switch, (contact, side, _) in enumerate(orbit.system.breakpoints):
            first.setdefault((contact, side), switch)
        for (contact, side), switch in first.items():
            sides[contact, int(side < 0)] = orbit.closings[switch] / motion.period
        closes = np.nansum(sides, axis=1) > 0.0
        return replace(
            motion, sides=sides, parted=np.where(closes, np.maximum(motion.parted, 1.0), 0.0 * motion.parted)
        )

    def _is_there(self, lane: int, end: NDArray[np.float64]) -> bool:
        """Return True if the slow modes are where they end: one that oscillates slowly hardly changes as it turns."""
        (notes,) = self._noted(lane, 1)
        spans = notes[self.kinds["most"]] - notes[self.kinds["least"]]
        half = len(self.slow) // 2
        own = [k for k in range(half) if self.slow[k] != self.lanes.turn]
        apart = np.abs(end - self._sections(lane, 1)[0, self.slow])[own]
        return bool(np.all(apart <= _ENDED * np.maximum(spans[np.array(self.slow)[own]], _TINY)))

    def _arrives(self, lane: int, start: Start) -> LaneMotion | None:
        """Return the known motion that a motion approaches, or repeats: beside it where friction may stick anywhere."""
        for motion in start.known:
            if not (q := motion.period):
                if self._is_amid(lane, motion):
                    return motion
                continue
            if self.ages[lane] < _ENVELOPE + q - 1:
                continue
            scale = self._scale(motion.extremes[2] - motion.extremes[0])
            strobes = self._sections(lane, _APART + _ENVELOPE + q)[:, : len(scale)]
            apart = (np.abs(strobes - motion.state[: len(scale)]) / scale).max(axis=1)
            now, before = (
                _of_periods(each, q, np.min).max() for each in (apart[-_ENVELOPE - q + 1 :], apart[: _ENVELOPE + q - 1])
            )
            shrinks = self.ages[lane] >= 2 * _APART and now <= min(_NEAR, _SHRINKS * before)
            energy = self._noted(lane, q)[:, self.kinds["energy"]].mean(axis=0)
            differs = np.abs(np.sqrt(energy) - motion.rms)
            if (shrinks or now <= _SAME) and np.all(differs <= _NEAR * motion.rms):
                return motion
            closes = self._closings(lane, q).any(axis=0) == (motion.sides[self.staged].T.ravel() > 0.0)
            steps = np.abs(strobes[q:] - strobes[:-q])[-_ENVELOPE:] / scale
            repeats = len(steps) == _ENVELOPE and closes.all() and steps.max() <= _SAME
            if repeats and np.all(differs <= _ALIKE * motion.rms):
                return motion
        return None

    def _is_amid(self, lane: int, motion: LaneMotion) -> bool:
        """Return True if what gaps do after a transient, and accelerations, are those of a motion without period."""
        if self.ages[lane] < _GLANCE or self.waits[lane] + self.ages[lane] < _TRANSIENT + _GLANCE:
            return False
        rms, error = _accelerations(self._noted(lane, _GLANCE)[:, self.kinds["energy"]])
        seen, known = self._closings(lane, _GLANCE).sum(axis=0), _GLANCE * motion.sides[self.staged].T.ravel()
        differs = np.maximum(seen, known)[np.minimum(seen, known) == 0.0] > _RARE
        return bool(not differs.any() and np.all(error <= _NEAR * rms)) and motion.has_like(rms, error)

    def _calms(self, lane: int) -> bool:
        """Return True if the steps between the last sections are at most half as long as those before."""
        strobes = self._sections(lane, _WATCHED)
        steps = np.abs(np.diff(strobes, axis=0))
        third = len(steps) // 3
        early, late = steps[:third].max(axis=0), steps[-third:].max(axis=0)
        return bool(np.any((late < 0.5 * early) & (late > _STILL * np.abs(strobes).max(axis=0))))

    def _period(self, lane: int, counts: NDArray[np.float64]) -> int:
        """Return after how many forcing periods sections and closings repeat; 0 if they do not."""
        rows = [row.tobytes() for row in counts[-2 * _LONGEST :] > 0.0]  # a graze changes their number
        periods = [q for q in range(1, _LONGEST + 1) if rows[-q:] == rows[-2 * q : -q]]
        if not periods:
            return 0
        strobes = self._sections(lane, 4 * _LONGEST)[:, : self.layout.structure.size]
        (notes,) = self._noted(lane, 1)
        scale = self._scale(notes[self.kinds["most"]] - notes[self.kinds["least"]])
        steps = (np.abs(np.diff(strobes, axis=0)) / scale).max(axis=1)
        shorter = np.inf
        for q in periods:
            # chaos comes near a longer motion by chance, and leaves it within some periods
            held, part = min(max(_APART, 3 * q), len(strobes) - q), max(q, _APART // 2)
            apart = (np.abs(strobes[-held:] - strobes[-held - q : -q]) / scale).max(axis=1)
            if q == 1 and apart[-1] <= _SAME:
                return q
            grows = apart[-part:].max() > max(_EQUAL, apart[:part].max())
            if apart.max() <= min(_SAME, _CLEAR * shorter) and not grows:
                # a slow mode that dies away may come back after some periods: the period is that without it
                dies = len(steps) < 3 * _APART or steps[-_ENVELOPE:].max() < _SHRINKS * steps[:_ENVELOPE].max()
                return 0 if dies else q
            shorter = min(shorter, apart.max())
        return 0

    def _scale(self, spans: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the ranges of coordinates as scales, of which the rotation as a whole has none."""
        scale = np.maximum(spans, _TINY)
        if self.lanes.turn is not None:
            scale[self.lanes.turn] = np.inf
        return scale

    def _left(self, recent: NDArray[np.float64], q: int) -> tuple[float, Any, Any, tuple[Any, Any]]:
        """Return the contraction of a transient, and what is left of it by that.

        That is of the extremes of each contact, and of the energy of each signal, relative to it; and the latest
        extremes. The figures are those of q periods; the envelope of their changes over some periods contracts.
        """
        of = (("low", np.min), ("high", np.max), ("energy", np.mean))
        low, high, energy = (_of_periods(recent[:, self.kinds[kind]], q, over) for kind, over in of)
        apart = q * -(-_APART // q)
        width = np.maximum(high[-1] - low[-1], _TINY)
        parts = low / width, high / width, energy / np.maximum(energy[-1], _TINY)
        changes = [np.abs(each[apart:] - each[:-apart]) for each in parts]
        if len(changes[0]) <= apart:
            return 1.0, np.full(len(width), np.inf), np.inf, (low[-1], high[-1])
        now = [each[-_ENVELOPE:].max(axis=0) for each in changes]
        before = [each[:-apart][-_ENVELOPE:].max(axis=0) for each in changes]
        now = [np.where(each <= _STILL, 0.0, each) for each in now]
        largest = max(float(each.max(initial=0.0)) for each in now)
        ratio = largest / max(*(float(each.max(initial=0.0)) for each in before), _TINY)
        # what changes fast at first hides a slow mode: by a ratio below one half nothing is taken for granted
        rest = max(ratio / (1.0 - ratio), 1.0) if ratio < 1.0 else 1.0 / np.finfo(float).eps
        left = [each * rest if each.any() else each for each in now]
        return ratio, np.maximum(left[0], left[1]) * width, left[2], (low[-1], high[-1])

    def _motion(self, lane: int, start: Start, state: NDArray[np.float64], period: int, watched: int) -> LaneMotion:
        notes = self._noted(lane, watched)
        contacts, staged = len(self.layout.contacts), self.staged

        def of_contacts(values: NDArray[np.float64]) -> NDArray[np.float64]:
            found = np.full((contacts, *values.shape[1:]), np.nan)
            found[staged] = values
            return found

        kind = {name: notes[:, rows] for name, rows in self.kinds.items()}
        sides = np.stack((kind["up"].mean(axis=0), kind["down"].mean(axis=0)), axis=1)
        closed = np.zeros(contacts, dtype=bool)
        closed[staged] = np.abs(kind["side"][-1]) > 0.5
        energy, fourth = (kind[name].mean(axis=0) for name in ("energy", "fourth"))
        rms, error = _accelerations(kind["energy"], is_sample=not period and watched >= _BATCHES)
        n_mean = kind["total"].mean(axis=0)
        closings = kind["up"] + kind["down"]
        breakpoints = self.clear[lane][:, None, :]
        distances = np.minimum(*(np.abs(kind[side] - breakpoints).min(axis=0) for side in ("low", "high")))
        least, mean = distances.min(axis=0), distances.mean(axis=0)
        return LaneMotion(
            start.value,
            state,
            period,
            self.waits[lane] + self.ages[lane] - watched,
            watched,
            of_contacts(sides),
            closed,
            of_contacts(kind["peak"].max(axis=0)),
            of_contacts(kind["power"].mean(axis=0)),
            of_contacts(kind["approach"].max(axis=0)),
            np.array([kind["least"].min(axis=0), n_mean, kind["most"].max(axis=0)]),
            rms,
            kind["summit"].max(axis=0),
            fourth / np.maximum(energy**2, _TINY),
            error,
            of_contacts((closings > 0.0).sum(axis=0).astype(float)),
            of_contacts(least / np.maximum(mean - least, _TINY)),
        )
