"""A run-up: the motion while the speed changes as a given function of time.

The angle of the excitation is the independent variable, as everywhere in the flow. In each piece of constant
acceleration the speed is a closed function of the angle (`gapwalk.flow.ramp`), so the motion is integrated to rounding,
with exact contact events, period by period. With dry friction, or with many gaps, equal steps without events take its
place (`gapwalk.answers.lane_run_up`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from gapwalk.answers.gap_states import SweepBy
from gapwalk.answers.lane_run_up import Stepped, is_by_steps, run_by_steps, start_by_steps
from gapwalk.answers.speed_course import Piece, SpeedCourse, angles_of, pieces_of
from gapwalk.attractors.rattle import innermost_switches
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.spectrum import RATE, Sound, Tracked, Waterfall, instants, second_of, turns_of, unit_of
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds import Kind
from gapwalk.ensemble.batch_flow import LIMIT, MOST_STEPS, BatchOptions, first_guess, past_numbers, revised
from gapwalk.ensemble.force_source import LANES
from gapwalk.ensemble.kernel_source import HISTORY, Form, Linear, kernel_of, scheme_of
from gapwalk.ensemble.lane_ramp import PIECES
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import contact_deflections, contact_forces
from gapwalk.flow.motion import assembled_histories, assembled_signals, check_state, force_of, integrate, signal_factor
from gapwalk.flow.ramp import Ramped
from gapwalk.model.bounds import check
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System, check_system
from gapwalk.model.words import parameter_symbol, parameter_words, value_words
from gapwalk.notebook import Shown
from gapwalk.pieces import tell
from gapwalk.summary import SummaryParts, Table, summarizes

# Jumps of a run-up beside the folds of the response, at which a slow sweep would jump.

_BESIDE = 6  # points of a branch next to a fold, which lie on one side of it
_NEAR = 0.25  # share of a jump by which a motion may differ from that at the fold and still follow the branch
_OTHER = 0.05  # share of the range of a branch by which another motion differs from that at a fold


class JumpDelay(NamedTuple):
    """A jump that a run-up makes after the fold of a branch at which a slow sweep would jump."""

    fold: float  #: Speed of the fold.
    #: Speed at which the run-up is half way between the motions before and after. NaN if it never is, or if it does not
    #: follow the branch up to the fold.
    jump: float
    delay: float  #: Time from the fold to the jump.

    def words(self, system: System) -> str:
        """Return the jump and its delay as a sentence."""
        pace, units = system.structure.pace, system.units
        fold = f"the fold at {value_words(self.fold, pace, units, 6)}, where a slow sweep jumps"
        if np.isnan(self.jump):
            return f"no jump after {fold}: the motion left the response before the fold, or did not jump beyond it"
        late = f"{self.delay:.3g} s" if units else f"a time of {self.delay:.4g}"
        return f"jump at {value_words(self.jump, pace, units, 6)}, {late} after {fold}"


def jump_delays(run: RunUp, branch: Branch, coordinate: str) -> tuple[JumpDelay, ...]:
    """Compare the jumps of a run-up with the folds of a branch, as in `RunUp.delays`."""
    pace, measure = run.system.structure.pace, f"half.{coordinate}"
    if branch.parameter != pace:
        raise ModelError(f"the branch is over {branch.parameter}; a run-up needs a response over {pace}")
    if not run.course.is_one_way:
        raise ModelError("the speed changes its direction; delays are computed only where it rises or falls throughout")
    sign = np.sign(run.course.speed[-1] - run.course.speed[0])
    speed, half = run.half(coordinate)
    values = np.array([point.value for point in branch.points])
    sizes = np.array([point.measure(measure) for point in branch.points])
    stable = np.array([point.orbit.stable for point in branch.points])
    found = []
    for special in branch.special_points:
        if special.kind is not Kind.FOLD or not speed.min() < special.value < speed.max():
            continue
        before = special.point.measure(measure)
        far = np.hypot((values - special.value) / np.ptp(values), (sizes - before) / (np.ptp(sizes) or 1.0))
        beside = np.argsort(far, kind="stable")[:_BESIDE]
        if sign * (np.mean(values[beside]) - special.value) > 0.0 or not stable[beside].any():
            continue  # a stable motion ends there for the other direction, or none does
        steps = np.flatnonzero(
            stable[:-1] & stable[1:] & ((values[:-1] < special.value) != (values[1:] < special.value))
        )
        shares = (special.value - values[steps]) / (values[steps + 1] - values[steps])
        others = sizes[steps] + shares * (sizes[steps + 1] - sizes[steps])
        others = others[np.abs(others - before) > _OTHER * np.ptp(sizes)]
        if not len(others):
            continue
        after = others[np.argmin(np.abs(others - before))]
        beyond, is_after = sign * (speed - special.value) > 0.0, np.abs(half - after) < np.abs(half - before)
        jumped = np.flatnonzero(beyond & is_after)
        follows = np.abs(half[~beyond][-1] - before) < _NEAR * abs(after - before)  # in the last period before it
        jump = float(speed[jumped[0]]) if len(jumped) and follows else float("nan")
        times = np.interp([special.value, jump], *_increasing(run.speed, run.time))
        found.append(JumpDelay(special.value, jump, float(times[1] - times[0])))
    return tuple(found)


def _increasing(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return (x, y) if x[-1] > x[0] else (x[::-1], y[::-1])


_REFINED = 256  # samples of an interval in which the largest force is looked for
_PART = 1 << 11  # samples that are evaluated at once: few enough for one thread
_BLOCK = 1 << 17  # samples of a sound that are computed at once
_TOPS = 6  # of the largest samples of a force, around each of which it is looked for


class ForcePeak(NamedTuple):
    """The largest magnitude of a contact's force in a run-up."""

    contact: str  #: Name of the contact.
    force: float  #: The force there, with its sign, in the unit of the force.
    #: speed, time, theta: Instant of it.
    speed: float
    time: float
    theta: float
    impacts: int  #: Closures of the innermost stages during the run-up.
    fastest: float  #: Largest approach velocity of them; 0 without any.


@dataclass(frozen=True, eq=False, repr=False)
class RunUp(Shown):
    """The motion during a run-up, sampled; exact at each sample unless it was made by equal steps."""

    system: System  #: The system; its own speed is not used.
    course: SpeedCourse  #: Speed over time.
    samples: int  #: Samples per forcing period; there are more at the points of `course` and at the end.
    #: shape (samples,): Angle of the excitation, in radians; it grows beyond 2 pi.
    theta: NDArray[np.float64]
    #: time, speed: shape (samples,): Time, and the first parameter of the system, such as its speed in rpm.
    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (samples, 2n): Positions, then velocities.
    events: tuple[ContactEvent, ...]  #: The crossings of breakpoints, in order; empty if made by equal steps.
    peaks: tuple[ForcePeak, ...]  #: The largest force of each contact.
    #: shape (samples, contacts that are friction): Forces of dry friction; None unless it was made by equal steps.
    friction: NDArray[np.float64] | None = None

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        count = len(self.theta)
        parts = self.states.shape == (count, 2 * self.system.size) and self._friction.shape == (count, len(self._dry))
        if not (parts and self.time.shape == self.speed.shape == (count,)):
            raise ValueError("the samples of a run-up do not fit together")

    @property
    def complete(self) -> bool:
        """True: a run-up has one part."""
        return True

    @property
    def by_steps(self) -> bool:
        """True if it was made by equal steps, without contact events."""
        return self.friction is not None

    @property
    def _dry(self) -> list[int]:
        return [place for place, form in enumerate(self.system.structure.contacts) if form.law.is_dry]

    @property
    def _friction(self) -> NDArray[np.float64]:
        return np.zeros((len(self.theta), 0)) if self.friction is None else self.friction

    @property
    def signals(self) -> list[str]:
        """Names of all signals."""
        system = self.system
        names = [f"{name}{dashes}" for dashes in ("", "'", "''") for name in system.coordinates]
        names += [force_of(form) for form in system.structure.contacts]
        assembly = system.structure.assembly
        if not isinstance(assembly, TrainAssembly):
            return names + assembled_signals(system.structure)
        if any(each.displaces for each in assembly.form.torques):
            return names
        # without drags, angles and speeds are known by the loads of one speed alone
        all_known = assembly.form.has_turn or not assembly.form.is_free
        known = [
            each for each in assembled_signals(system.structure) if all_known or not each.endswith((".angle", ".speed"))
        ]
        return names + known

    def signal(self, name: str) -> NDArray[np.float64]:
        """Return one time history, shape (samples,)."""
        known = self.signals
        if name not in known:
            raise ModelError(f"a run-up has no signal {name!r}; {did_you_mean(name, known, 'signals are')}")
        size, place = self.system.size, known.index(name)
        if place < 2 * size:
            return self.states[:, place]
        if place < 3 * size:
            return self.accelerations[:, place - 2 * size] * signal_factor(self.system, name)
        if name.endswith(".force"):
            return self.forces[:, place - 3 * size]
        return self._of_train[:, assembled_signals(self.system.structure).index(name)] * signal_factor(
            self.system, name
        )

    @cached_property
    def _of_train(self) -> NDArray[np.float64]:
        """All signals of an assembly; each is a parabola of the speed at given states, as loads and drags are."""
        pace = self.system.structure.pace
        nodes = np.array([0.5, 1.0, 1.5]) * self.system[pace]
        systems = [self.system.at({pace: node}) for node in nodes]
        places = [np.delete(nodes, place) for place in range(len(nodes))]

        def histories(own: slice) -> NDArray[np.float64]:
            (q, v), speed, total = np.split(self.states[own], 2, axis=1), self.speed[own], 0.0
            for system, node, others in zip(systems, nodes, places, strict=True):
                weight = np.prod([(speed - other) / (node - other) for other in others], axis=0)
                known = assembled_histories(system, self.theta[own], q, v, self.accelerations[own], self.forces[own])
                total = total + weight[:, None] * known
            return np.asarray(total)

        return self._by_parts(histories)

    def _by_parts(self, function: Callable[[slice], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Evaluate a function of the samples part by part, for which little memory suffices."""
        first = function(slice(0, _PART))
        found = np.empty((len(self.theta), first.shape[1]))
        found[:_PART] = first
        for start in range(_PART, len(found), _PART):
            found[start : start + _PART] = function(slice(start, start + _PART))
        return found

    def tracked(self, signal: str) -> Tracked:
        """Return a signal over the angle of the excitation, for order tracking."""
        part = signal.removesuffix("''").removesuffix(".acceleration")
        rates = [each for each in (f"{part}'", f"{part}.speed") if part != signal and each in self.signals]
        integral = None
        if rates:
            unit = 1.0 if rates[0].endswith("'") else signal_factor(self.system, rates[0])
            integral = self.signal(rates[0]) * (signal_factor(self.system, signal) / unit)
        return Tracked(
            self.system, signal, self.samples, self.theta, self.time, self.speed, self.signal(signal), integral
        )

    @property
    def loudest(self) -> str:
        """The coordinate that the contact with the largest force deflects most; else the first one."""
        names = self.system.coordinates
        place = int(np.argmax([abs(each.force) for each in self.peaks])) if self.peaks else 0
        if not self.peaks or not self.peaks[place].force:
            return names[0]
        layout, numbers = layout_of(self.system.structure), coefficients_of(self.system)
        return names[int(np.argmax(np.abs(numbers[layout.contacts[place].deflection])))]

    def coordinate_of(self, signal: str) -> str:
        """Return the coordinate of a signal such as ``"q1'"``; for a force or torque, `loudest`."""
        name = signal.rstrip("'")
        return name if name in self.system.coordinates else self.loudest

    @cached_property
    def forces(self) -> NDArray[np.float64]:
        """Contact forces, shape (samples, contacts)."""
        ramped, pace = Ramped(self.system), self.speed * self.system.structure.frequency
        found = self._by_parts(lambda own: ramped.forces(self.theta[own], self.states[own], pace[own]))
        found[:, self._dry] = self._friction
        return found

    @cached_property
    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations ``q''`` over time, shape (samples, n), in consistent units."""
        ramped, unit, course = Ramped(self.system), self.system.structure.frequency, self.course
        piece = np.clip(np.searchsorted(course.time, self.time, side="right") - 1, 0, len(course.rates) - 1)
        rates = course.rates[piece] * unit

        def accelerations(own: slice) -> NDArray[np.float64]:
            q, v = np.split(self.states[own], 2, axis=1)
            return ramped.accelerations(self.theta[own], q, v, self.forces[own], self.speed[own] * unit, rates[own])

        return self._by_parts(accelerations)

    @cached_property
    def deflections(self) -> NDArray[np.float64]:
        """Deflections of the contacts, shape (samples, contacts)."""
        layout = layout_of(self.system.structure)
        return contact_deflections(layout, coefficients_of(self.system), self.theta, self.states[:, : self.system.size])

    def envelope(self, signal: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, smallest and largest value of a signal in each forcing period, shapes (periods,)."""
        return self.tracked(signal).extremes()

    def half(self, coordinate: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, and half the range of a signal, in each forcing period: the measure ``half.X`` of orbits."""
        speed, low, high = self.envelope(coordinate)
        return speed, 0.5 * (high - low)

    def delays(self, branch: Branch, coordinate: str) -> tuple[JumpDelay, ...]:
        """Compare the jumps of the run-up with the folds of a branch over the speed."""
        # At each fold that a slow sweep in the same direction would meet, the run-up has jumped where half its range is
        # first closer to that of the other stable motion at the speed of the fold than to that of the fold.
        return jump_delays(self, branch, coordinate)

    def waterfall(self, signal: str, top: float = 10.0, periods: int | None = None, overlap: float = 0.75) -> Waterfall:
        """Compute spectra over orders in windows of some forcing periods, along the run-up."""
        # By default the windows are 8 turns of the reference shaft long; without a speed, 8 forcing periods. The motion
        # is sampled evenly over the angle, so orders stay lines while the speed changes. The spectra are over the
        # speed, or over the time if the speed is held or turns back.
        periods = turns_of(self.system, 8) if periods is None else periods
        return self.tracked(signal).waterfall(top, periods, overlap, over_speed=self.course.is_invertible)

    def at(self, times: ArrayLike) -> RunUp:
        """Return the run-up at other instants, by the exact flow from the samples before them, or between them."""
        wanted = np.asarray(times, dtype=float)
        last = float(self.time[-1])
        if wanted.ndim != 1 or not len(wanted) or not np.all(np.diff(wanted) > 0.0):
            raise ModelError("times must be a list of increasing numbers, as in times=[0.0, 0.1]")
        if wanted[0] < 0.0 or wanted[-1] > last * (1.0 + 1e-12):
            raise ModelError(f"times go from {wanted[0]:g} to {wanted[-1]:g}; the run-up lasts from 0 to {last:g}")
        ramped, speed = Ramped(self.system), self.course.at(wanted)
        theta = self.theta[0] + speed[1] * self.system.structure.frequency
        theta = np.minimum(theta, self.theta[-1])
        if self.by_steps:
            begun = min(int(np.searchsorted(self.time, wanted[0], side="right")), len(self.time) - 1) - 1
            near = slice(begun, max(int(np.searchsorted(self.time, wanted[-1])), begun + 1) + 1)
            slopes = np.hstack((self.states[near, self.system.size :], self.accelerations[near]))
            known = CubicHermiteSpline(self.time[near], self.states[near], slopes)
            friction = np.empty((len(wanted), len(self._dry)))
            for column, each in zip(friction.T, self._friction.T, strict=True):
                column[:] = np.interp(wanted, self.time, each)
            return replace(self, theta=theta, time=wanted, speed=speed[0], states=known(wanted), friction=friction)
        states, done = np.empty((len(wanted), self.states.shape[1])), 0
        for piece in pieces_of(self.system, self.course, self.theta):
            begun = piece.angles[0] + piece.turn
            end = int(np.searchsorted(theta, piece.angles[-1] + piece.turn, side="right"))
            own = theta[done:end] - piece.turn
            if not len(own):
                continue
            start = int(np.searchsorted(self.theta, begun - 1e-9))
            late = own > piece.angles[0] + 1e-12
            angles = np.concatenate((piece.angles[:1], own[late]))
            found = ramped.sample(self.states[start], angles, piece.speed, piece.acceleration).states
            states[done:end] = np.concatenate((np.repeat(found[:1], np.sum(~late), axis=0), found[1:]))
            done = end
        return replace(self, theta=theta, time=wanted, speed=speed[0], states=states)

    def sound(self, signal: str = "", *, rate: int = RATE, second: float | None = None) -> Sound:
        """Return a signal as a sound, at its true pitch and level; see `gapwalk.analysis.sound`."""
        signal, system = signal or f"{self.loudest}''", self.system
        lasts = second_of(system, second)
        times = instants(float(self.time[-1]) / lasts, rate) * lasts
        parts = [self.at(times[k : k + _BLOCK]).signal(signal) for k in range(0, len(times), _BLOCK)]
        return Sound(signal, unit_of(system, signal), rate, np.concatenate(parts), lasts)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the course, and the largest force of each contact with its impacts."""
        units, pace = self.system.units, self.system.structure.pace
        symbol = parameter_symbol(pace, units)
        yield (
            f"run-up over {symbol} {self.course.words} in "
            f"{self.course.duration:.6g}{' s' if units else ''}: "
            f"{(self.theta[-1] - self.theta[0]) / PERIOD:.4g} forcing periods, "
            + ("by equal steps" if self.by_steps else f"{len(self.events)} contact events")
        )
        yield from self.sentences
        rows = [
            (each.contact, f"{each.force:.6g}", f"{each.speed:.6g}", f"{each.time:.6g}", f"{each.impacts}",
             f"{each.fastest:.4g}")
            for each in self.peaks
        ]  # fmt: skip
        if rows:
            rate = unit_of(self.system, f"{self.peaks[0].contact}'")
            force, time, fastest = (f" [{unit}]" if units else "" for unit in ("N m", "s", rate))
            heads = [f">peak force{force}", f">{parameter_words(pace, units)}", f">time{time}", ">impacts"]
            yield Table(["contact", *heads, f">fastest{fastest}"], rows)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The largest force of each contact that touches, in sentences; that of friction is its limit, and left out."""
        units, pace = self.system.units, self.system.structure.pace
        unit = " N m" if units else ""
        return tuple(
            f"{each.contact}: at most {abs(each.force):.4g}{unit}, at {value_words(each.speed, pace, units, 6)}"
            + f"; {each.impacts} impacts" * (each.impacts > 0)
            for place, each in enumerate(self.peaks)
            if each.force and place not in self._dry
        )

    def __repr__(self) -> str:
        return f"RunUp({self.course!r}, {'by equal steps' if self.by_steps else f'{len(self.events)} contact events'})"


def run_up(
    system: System,
    speed: SpeedCourse,
    *,
    state: Sequence[float] | NDArray[np.float64] | None = None,
    phase: float = 0.0,
    samples: int = 512,
    by: SweepBy = SweepBy.CHOSEN,
) -> RunUp:
    """Compute the motion while the speed changes as a given function of time, exactly or by equal steps.

    Parameters
    ----------
    system
        The system; its own value of the frequency or speed is not used.
    speed
        The speed over time, as from `SpeedCourse.ramp`.
    state : shape (state_size,)
        Positions, velocities and extensions of friction springs at the start; by default those of the motion on which
        the system settles from rest at the first speed.
    phase
        Angle of the excitation at the start, in radians.
    samples
        Samples per forcing period.
    by
        ``"curves"`` for the exact motion; ``"steps"`` for equal time steps, which suit dry friction and many contacts;
        ``"chosen"`` for steps if there is dry friction, or more than one gap with more than three coordinates.

    Returns
    -------
    RunUp
        The motion, with all contact events and the largest force of each contact.

    Raises
    ------
    ModelError
        If the system cannot run up (rigid stops, friction that is larger at rest, factors over the speed), or `state`
        is no state of the system.
    FlowError
        If the motion diverges.

    Notes
    -----
    Loads follow the angle of the excitation, and their sizes the present speed. If a reaction torque holds the speed of
    a train, it also supplies ``sum(J r^2) a``: the torque that gives the inertias J at ratios r the acceleration a.
    With such a torque, `speed` is the speed of the first inertia.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=1.0
    ... )
    >>> run = gw.ask.run_up(mass, gw.ask.SpeedCourse.ramp(0.5, 1.5, 0.01))
    >>> round(float(run.time[-1]), 9)
    100.0
    """
    check_system(system, "run_up")
    check("samples", samples, Annotated[int, Ge(16), Le(65_536)])
    if not isinstance(speed, SpeedCourse):
        raise ModelError(
            f"speed is {speed!r}; write gw.ask.SpeedCourse.ramp(700, 1100, 100), or gw.ask.SpeedCourse(time, speed)"
        )
    ramped = Ramped(system)
    pace = system.structure.pace
    first = system.at({pace: float(speed.speed[0])})
    for end in (speed.speed.min(), speed.speed.max()):
        system.at({pace: float(end)})
    if is_by_steps(first, SweepBy(by)):
        begun = start_by_steps(ramped, first, np.array([phase]))[0] if state is None else check_state(first, state)
        return _stepped(first, speed, run_by_steps(ramped, speed, begun, phase, samples), samples)
    begun = start_at(first, phase) if state is None else check_state(first, state)
    thetas = angles_of(system, speed, phase, samples)
    now: NDArray[np.float64] = np.asarray(begun, dtype=float)
    rows, times, events, intervals = [now], [0.0], [], []
    for piece in pieces_of(system, speed, thetas):
        tell(times[-1] / float(speed.time[-1] - speed.time[0]))
        found = ramped.sample(now, piece.angles, piece.speed, piece.acceleration)
        now = found.states[-1]
        rows += list(found.states[1:])
        times += piece.times(piece.angles[1:]).tolist()
        events += [event._replace(theta=event.theta + piece.turn) for event in found.contacts]
        intervals.append(piece)
    states, time = np.array(rows), np.array(times)
    peaks = _peaks(ramped, thetas, states, intervals, events)
    return RunUp(first, speed, samples, thetas, time, speed.at(time)[0], states, tuple(events), peaks)


def _stepped(first: System, course: SpeedCourse, found: Stepped, samples: int) -> RunUp:
    """Return a run-up by equal steps as a record."""
    unit = first.structure.frequency
    time, speed = course.passed((found.theta - found.theta[0]) / unit)
    run = RunUp(first, course, samples, found.theta, time, speed, found.states, (), (), found.friction)
    peaks = []
    for number, (form, (begun, most, impacts, fastest)) in enumerate(
        zip(first.structure.contacts, found.peaks, strict=True)
    ):
        piece = int(np.searchsorted(time, begun))
        own = slice(max(piece - 1, 0), piece + samples // PIECES + 2) if most else slice(0, None)
        near = own.start + int(np.argmax(np.abs(run.forces[own, number])))
        force, v, t, theta = (float(each[near]) for each in (run.forces[:, number], speed, time, found.theta))
        force = math.copysign(max(most, abs(force)), force)  # that of a step between samples may be larger
        peaks.append(ForcePeak(form.name, force, v, t, theta, int(impacts), fastest))
    return replace(run, peaks=tuple(peaks))


def start_at(system: System, phase: float) -> NDArray[np.float64]:
    """Return the state at a phase of the motion that settles from rest."""
    settled = settle(system, "rest", SettleOptions())
    if phase % PERIOD == 0.0:
        return settled.state
    return integrate(system, settled.state, phase % PERIOD / PERIOD, 16).states[-1]


def _peaks(ramped: Ramped, thetas, states, intervals: list[Piece], events: list[ContactEvent]) -> tuple[ForcePeak, ...]:
    """Find the largest force of each contact, between samples too."""
    system = ramped.system
    contacts = system.structure.contacts
    if not contacts:
        return ()
    starts = [each.angles[0] + each.turn for each in intervals]
    paces = np.concatenate(
        [intervals[0].paces(intervals[0].angles[:1]), *(each.paces(each.angles[1:]) for each in intervals)]
    )
    forces = np.abs(ramped.forces(thetas, states, paces))
    inner = innermost_switches(system)
    found = []
    for number, form in enumerate(contacts):
        own = {switch for contact, _, switch in inner if contact == form.name}
        hits = [abs(event.velocity) for event in events if event.switch in own and event.enters]
        best = (0.0, float(thetas[0]), intervals[0])
        tops = np.argsort(-forces[:, number], kind="stable")[:_TOPS]
        for left in sorted({max(0, int(top) - side) for top in tops for side in (0, 1)}):
            if left + 1 >= len(thetas):
                continue
            piece = intervals[int(np.searchsorted(starts, thetas[left] + 1e-9, side="right")) - 1]
            begin = thetas[left] - piece.turn
            fine = np.linspace(begin, thetas[left + 1] - piece.turn, _REFINED)
            paces = piece.paces(fine)
            moved = ramped.sample(states[left], fine, float(paces[0]), piece.acceleration).states
            values = ramped.forces(fine, moved, paces)[:, number]
            top = int(np.argmax(np.abs(values)))
            if abs(values[top]) > abs(best[0]):
                best = (float(values[top]), float(fine[top] + piece.turn), piece)
        force, theta, piece = best
        time = float(piece.times(np.array([theta - piece.turn]))[0])
        speed = float(piece.paces(theta - piece.turn)) / system.structure.frequency
        found.append(ForcePeak(form.name, force, speed, time, theta, len(hits), max(hits, default=0.0)))
    return tuple(found)


# Many run-ups at once: the batch integrator with steps of equal time, and loads that are tabulated lane by lane.
#
# The matrices of the linear part do not depend on the speed, only the loads do. So over steps of equal time the scheme
# of the batch integrator stays the same for the whole run-up, and the loads enter as a table of what they contribute
# to the state of each lane over each step: Duhamel's integral over the cubic through values and slopes of the loads at
# both ends (Hermite), exact for the linear part. The angle is a closed function of time, so it has no error. Each
# run-up is divided into equal times (bins), so that the speed at a bin is the same for run-ups of all rates.

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
            "run-ups in a batch cannot include loads that vary a contact's parameter; use gapwalk.ask.run_up for each"
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
        """Compute the contribution of the loads to each of some steps, shape (steps, 2n, lanes)."""
        # Along a ramp they are analytic functions of the time at which a step begins, so they are interpolated between
        # Chebyshev points, as many as half the angle that the highest order turns by, and some for accuracy.
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
