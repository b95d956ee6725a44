"""A run-up: the exact motion while the speed changes as a given function of time.

The angle of the excitation is the independent variable, as everywhere in the flow. In each piece of constant
acceleration the speed is a closed function of the angle (`gapwalk.flow.ramp`), so the motion is integrated to rounding,
with exact contact events, period by period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.answers.jump_delay import JumpDelay, jump_delays
from gapwalk.answers.speed_course import Piece, SpeedCourse, angles_of, pieces_of
from gapwalk.attractors.order_tracking import Tracked
from gapwalk.attractors.rattle import innermost_switches
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.sound import RATE, Sound, instants, second_of, unit_of
from gapwalk.attractors.spectrum import Waterfall
from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.flow.contact_events import ContactEvent
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import contact_deflections, contact_forces
from gapwalk.flow.motion import check_state, force_of, integrate, signal_factor, train_histories, train_signals
from gapwalk.flow.ramp import Ramped
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System, check_system
from gapwalk.model.words import parameter_symbol, parameter_words, value_words
from gapwalk.notebook import Shown
from gapwalk.summary import SummaryParts, Table, summarizes

_REFINED = 256  # samples of an interval in which the largest force is looked for
_BLOCK = 1 << 17  # samples of a sound that are computed at once
_TOPS = 6  # of the largest samples of a force, around each of which it is looked for


class ForcePeak(NamedTuple):
    """The largest magnitude of a contact's force in a run-up.

    Examples
    --------
    >>> peak = run.peaks[0]
    >>> peak.contact, round(peak.force, 4), peak.impacts
    ('stop', 8.8825, 8)
    """

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
    """The motion during a run-up, sampled, exact at each sample.

    Examples
    --------
    >>> run.signal("x").shape == run.time.shape, run.peaks[0].contact
    (True, 'stop')
    >>> round(run.peaks[0].force, 4), round(run.peaks[0].speed, 4)
    (8.8825, 1.4774)
    """

    system: System  #: The system; its own speed plays no role.
    course: SpeedCourse  #: Speed over time.
    samples: int  #: Samples per forcing period; those at knots of the course and at the end are further ones.
    #: shape (samples,): Angle of the excitation, in radians; it does not begin again with each period.
    theta: NDArray[np.float64]
    #: time, speed: shape (samples,): Time, and the first parameter of the system, such as its speed in rpm.
    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    states: NDArray[np.float64]  #: shape (samples, 2n): Positions, then velocities.
    events: tuple[ContactEvent, ...]  #: The crossings of breakpoints, in order.
    peaks: tuple[ForcePeak, ...]  #: The largest force of each contact.

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        count = len(self.theta)
        if not (self.time.shape == self.speed.shape == (count,) and self.states.shape == (count, 2 * self.system.size)):
            raise ValueError("the samples of a run-up do not fit together")

    @property
    def complete(self) -> bool:
        """True: a run-up has one part."""
        return True

    @property
    def signals(self) -> list[str]:
        """Names of all signals."""
        system = self.system
        names = [f"{name}{dashes}" for dashes in ("", "'", "''") for name in system.coordinates]
        names += [force_of(form) for form in system.structure.contacts]
        assembly = system.structure.assembly
        displaced = isinstance(assembly, TrainAssembly) and any(each.displaces for each in assembly.form.torques)
        return names + [name for name in train_signals(system.structure) if name.endswith(".torque") and not displaced]

    def signal(self, name: str) -> NDArray[np.float64]:
        """Return one time history, shape (samples,).

        Parameters
        ----------
        name
            A coordinate, its velocity (``"q1'"``) or acceleration (``"q1''"``), the force of a contact
            (``"stop.force"``), or the torque of a link of a train (``"clutch.torque"``).

        Returns
        -------
        array, shape (samples,)
            In the unit of the signal.
        """
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
        q, v = np.split(self.states, 2, axis=1)
        found = train_histories(self.system, self.theta, q, v, np.zeros_like(q), self.forces)
        return found[:, train_signals(self.system.structure).index(name)]

    def tracked(self, signal: str) -> Tracked:
        """Return a signal over the angle of the excitation, for order tracking.

        Parameters
        ----------
        signal
            Name of a signal, as in `signal`.
        """
        return Tracked(self.system, signal, self.samples, self.theta, self.time, self.speed, self.signal(signal))

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
        return _forces(self.system, self.theta, self.states)

    @cached_property
    def accelerations(self) -> NDArray[np.float64]:
        """Accelerations ``q''`` over time, shape (samples, n), in consistent units."""
        ramped, unit, course = Ramped(self.system), self.system.structure.frequency, self.course
        piece = np.clip(np.searchsorted(course.time, self.time, side="right") - 1, 0, len(course.rates) - 1)
        q, v = np.split(self.states, 2, axis=1)
        return ramped.accelerations(self.theta, q, v, self.forces, self.speed * unit, course.rates[piece] * unit)

    @cached_property
    def deflections(self) -> NDArray[np.float64]:
        """Deflections of the contacts, shape (samples, contacts)."""
        layout = layout_of(self.system.structure)
        return contact_deflections(layout, coefficients_of(self.system), self.theta, self.states[:, : self.system.size])

    def envelope(self, signal: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, smallest and largest value of a signal in each forcing period, shapes (periods,).

        Parameters
        ----------
        signal
            Name of a signal, as in `signal`.

        Returns
        -------
        speed, low, high : array, shape (periods,)
            The speed in the middle of each period, and the extremes in it.
        """
        return self.tracked(signal).extremes()

    def half(self, coordinate: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return speed, and half the range of a signal, in each forcing period: the measure ``half.X`` of orbits.

        Parameters
        ----------
        coordinate
            Name of a signal, as in `signal`.

        Returns
        -------
        speed, half : array, shape (periods,)
            The speed in the middle of each period, and half the range.
        """
        speed, low, high = self.envelope(coordinate)
        return speed, 0.5 * (high - low)

    def delays(self, branch: Branch, coordinate: str) -> tuple[JumpDelay, ...]:
        """Compare the jumps of the run-up with the folds of a branch over the speed.

        At each fold that a slow sweep in the same direction would meet, the run-up has jumped where half its range is
        first closer to that of the other stable motion at the speed of the fold than to that of the fold.

        Parameters
        ----------
        branch
            A response over the speed.
        coordinate
            The coordinate by which motions differ.
        """
        return jump_delays(self, branch, coordinate)

    def waterfall(self, signal: str, top: float = 10.0, periods: int = 8, overlap: float = 0.75) -> Waterfall:
        """Compute spectra over orders in windows of some forcing periods, along the run-up.

        The motion is sampled evenly over the angle, so orders stay lines while the speed changes. The spectra are over
        the speed, or over the time if the speed is held or turns back.

        Parameters
        ----------
        signal
            As in `signal`.
        top
            Highest order.
        periods
            Length of a window; the resolution is one order over this number (four of them for Hann's window).
        overlap
            Share of a window that the next one repeats.
        """
        return self.tracked(signal).waterfall(top, periods, overlap, over_speed=self.course.is_invertible)

    def at(self, times: ArrayLike) -> RunUp:
        """Return the run-up at other instants, by the exact flow from the samples before them."""
        wanted = np.asarray(times, dtype=float)
        last = float(self.time[-1])
        if wanted.ndim != 1 or not len(wanted) or not np.all(np.diff(wanted) > 0.0):
            raise ModelError("times must be a list of increasing numbers, as in times=[0.0, 0.1]")
        if wanted[0] < 0.0 or wanted[-1] > last * (1.0 + 1e-12):
            raise ModelError(f"times go from {wanted[0]:g} to {wanted[-1]:g}; the run-up lasts from 0 to {last:g}")
        ramped, speed = Ramped(self.system), self.course.at(wanted)
        theta = self.theta[0] + speed[1] * self.system.structure.frequency
        theta = np.minimum(theta, self.theta[-1])
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
        """Return a signal as a sound, at its true pitch and level; see `gapwalk.analysis.sound`.

        Parameters
        ----------
        signal
            As in `signal`; by default the acceleration of `loudest`.
        rate, second
            As in `gapwalk.analysis.sound`.
        """
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
            f"run-up over {symbol} from {self.course.speed[0]:.6g} to {self.course.speed[-1]:.6g} in "
            f"{self.course.duration:.6g}{' s' if units else ''}: "
            f"{(self.theta[-1] - self.theta[0]) / PERIOD:.4g} forcing periods, {len(self.events)} contact events"
        )
        yield from self.sentences
        rows = [
            (each.contact, f"{each.force:.6g}", f"{each.speed:.6g}", f"{each.time:.6g}", f"{each.impacts}",
             f"{each.fastest:.4g}")
            for each in self.peaks
        ]  # fmt: skip
        if rows:
            yield Table(
                ["contact", ">peak force", f">{parameter_words(pace, units)}", ">time", ">impacts", ">fastest"], rows
            )

    @property
    def sentences(self) -> tuple[str, ...]:
        """The largest force of each contact that touches, in sentences."""
        units, pace = self.system.units, self.system.structure.pace
        unit = " N m" if units else ""
        return tuple(
            f"{each.contact}: at most {abs(each.force):.4g}{unit}, at {value_words(each.speed, pace, units, 6)}; "
            f"{each.impacts} impacts"
            for each in self.peaks
            if each.force
        )

    def __repr__(self) -> str:
        return f"RunUp({self.course!r}, {len(self.events)} contact events)"


def run_up(
    system: System,
    speed: SpeedCourse,
    *,
    state: Sequence[float] | NDArray[np.float64] | None = None,
    phase: float = 0.0,
    samples: int = 512,
) -> RunUp:
    """Compute the exact motion while the speed changes as a given function of time.

    Parameters
    ----------
    system
        The system; its own value of the first parameter plays no role.
    speed
        The speed over time, as from `SpeedCourse.ramp`.
    state : shape (2n,)
        Positions and velocities at the start; by default the motion that settles at the first speed, from rest.
    phase
        Angle of the excitation at the start, in radians.
    samples
        Samples per forcing period.

    Returns
    -------
    RunUp
        The motion, with all contact events and the largest force of each contact.

    Raises
    ------
    ModelError
        If the system cannot run up (dry friction, rigid stops, factors over the speed), or the state is none.
    FlowError
        If the motion diverges.

    Notes
    -----
    Loads follow the angle of the excitation, and those that grow with the speed follow it at once. If a reaction holds
    the speed of a train, it also supplies the torque that runs the train up, ``sum(J r^2) a``: the inertias that hang
    on it pull back. `speed` is then that of the first inertia.

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
    if isinstance(samples, bool) or not isinstance(samples, int) or not 16 <= samples <= 65_536:
        raise ModelError(f"samples is {samples!r}; it must be an integer from 16 to 65,536 per forcing period")
    if not isinstance(speed, SpeedCourse):
        raise ModelError(
            f"speed is {speed!r}; write gw.ask.SpeedCourse.ramp(700, 1100, 100), or gw.ask.SpeedCourse(time, speed)"
        )
    ramped = Ramped(system)
    pace = system.structure.pace
    first = system.at({pace: float(speed.speed[0])})
    for end in (speed.speed.min(), speed.speed.max()):
        system.at({pace: float(end)})
    begun = start_at(first, phase) if state is None else check_state(first, state)
    thetas = angles_of(system, speed, phase, samples)
    now: NDArray[np.float64] = np.asarray(begun, dtype=float)
    rows, times, events, intervals = [now], [0.0], [], []
    for piece in pieces_of(system, speed, thetas):
        found = ramped.sample(now, piece.angles, piece.speed, piece.acceleration)
        now = found.states[-1]
        rows += list(found.states[1:])
        times += piece.times(piece.angles[1:]).tolist()
        events += [event._replace(theta=event.theta + piece.turn) for event in found.contacts]
        intervals.append(piece)
    states, time = np.array(rows), np.array(times)
    peaks = _peaks(ramped, thetas, states, intervals, events)
    return RunUp(first, speed, samples, thetas, time, speed.at(time)[0], states, tuple(events), peaks)


def start_at(system: System, phase: float) -> NDArray[np.float64]:
    """Return the state at a phase of the motion that settles from rest."""
    settled = settle(system, "rest", SettleOptions())
    if phase % PERIOD == 0.0:
        return settled.state
    return integrate(system, settled.state, phase % PERIOD / PERIOD, 16).states[-1]


def _forces(system: System, theta: NDArray[np.float64], states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the contact forces, which depend on the state and the angle alone."""
    q, v = np.split(states, 2, axis=1)
    return contact_forces(layout_of(system.structure), coefficients_of(system), theta, q, v)


def _peaks(ramped: Ramped, thetas, states, intervals: list[Piece], events: list[ContactEvent]) -> tuple[ForcePeak, ...]:
    """Find the largest force of each contact, between samples too."""
    system = ramped.system
    contacts = system.structure.contacts
    if not contacts:
        return ()
    forces, starts = np.abs(_forces(system, thetas, states)), [each.angles[0] + each.turn for each in intervals]
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
            pace = float(np.sqrt(piece.speed**2 + 2.0 * piece.acceleration * (begin - piece.angles[0])))
            moved = ramped.sample(states[left], fine, pace, piece.acceleration).states
            values = _forces(system, fine, moved)[:, number]
            top = int(np.argmax(np.abs(values)))
            if abs(values[top]) > abs(best[0]):
                best = (float(values[top]), float(fine[top] + piece.turn), piece)
        force, theta, piece = best
        time = float(piece.times(np.array([theta - piece.turn]))[0])
        speed = np.sqrt(piece.speed**2 + 2.0 * piece.acceleration * (theta - piece.turn - piece.angles[0]))
        speed = float(speed) / system.structure.frequency
        found.append(ForcePeak(form.name, force, speed, time, theta, len(hits), max(hits, default=0.0)))
    return tuple(found)
