"""Records of a backbone: its free vibrations, what happens along it, and why it ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, Zero, check_range, powers_of_two
from gapwalk.continuation.curve import Curve, CurveEvent, CurveTrace, Happens, crossing, joined, reason_first, turn
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Tracing, Walk, WalkOptions
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.equations import smallness
from gapwalk.flow.flow import PERIOD, Flow, flow_of
from gapwalk.flow.motion import Motion, integrate
from gapwalk.free.free_shooting import FreeEquation, FreeShooting, damping_values, potential_of, without_losses
from gapwalk.model.bounds import Bounded, Positive
from gapwalk.model.coefficients import WAY, ParameterLine, coefficients_of, on_the_way
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.modes import find_modes
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import Equation, Evaluation
from gapwalk.orbit.sticking import transition_of

_GROWS = 1e-5  # modulus of a multiplier beyond 1 that is not rounding: two of them are 1, as a double eigenvalue


@dataclass(frozen=True, eq=False)
class BackbonePoint:
    """One free vibration."""

    stuck = ()  # contacts whose friction never slips
    _row: ClassVar = "frequency=value energy amplitude stable touches"

    value: float  #: The frequency, in the unit of the model.
    #: start, rates: shape (n,): Positions and velocities at the start: at rest, if there are no gyroscopic terms.
    start: NDArray[np.float64]
    rates: NDArray[np.float64]
    #: shape (n,): Half the distance between the places of rest for each coordinate; half its peak to peak where a
    #: motion whirls.
    half: NDArray[np.float64]
    energy: float  #: Energy, without that at zero positions; nan if the equations do not show it (see `potential_of`).
    multipliers: NDArray[np.complex128]  #: shape (2n,): Floquet multipliers, largest modulus first; two of them are 1.
    touches: int  #: Number of contact events in a period.

    @property
    def amplitude(self) -> float:
        """That of `half` of the coordinate that swings most."""
        return float(self.half.max())

    @property
    def state(self) -> NDArray[np.float64]:
        """The state at the start: positions, then velocities; shape (2n,)."""
        return np.append(self.start, self.rates)

    @property
    def stable(self) -> bool:
        """True if no multiplier is outside the unit circle."""
        return bool(np.abs(self.multipliers).max() <= 1.0 + _GROWS)

    def __repr__(self) -> str:
        return f"BackbonePoint({self.value:.10g}, amplitude {self.amplitude:.6g}, {self.touches} contact events)"


@dataclass(frozen=True, eq=False, repr=False)
class BackboneEvent(CurveEvent):
    """Free vibration at which a backbone turns, as near an internal resonance, or at which another one crosses."""

    _row: ClassVar = "kind frequency=point.value uncertainty energy=point.energy amplitude=point.amplitude"

    kind: str  #: What happens.
    point: BackbonePoint  #: The free vibration.
    uncertainty: float  #: Estimated error of its frequency.

    @property
    def value(self) -> float:
        """The frequency."""
        return self.point.value


@dataclass(frozen=True, eq=False)
class Backbone(Curve):
    """Free vibrations of one family: how frequency and amplitude belong together without damping and excitation."""

    _end_words = staticmethod(reason_first)
    _words: ClassVar = {
        "what": "{0.kind}",
        ">frequency": "{0.value:.9g}",
        ">±": "{0.uncertainty:.0e}",
        ">amplitude": "{0.point.amplitude:.6g}",
    }

    system: System  #: The system without losses.
    mode: int  #: Number of the linear mode from which it begins, from 1; 0 if it began at a given release.
    points: tuple[BackbonePoint, ...]  #: The free vibrations, from the beginning on.
    events: tuple[BackboneEvent, ...]  #: Turns of the frequency, and crossings.
    ends: tuple[End, End]  #: Its two ends.

    @property
    def energies(self) -> NDArray[np.float64]:
        """The energy at each point, shape (points,)."""
        return np.array([point.energy for point in self.points])

    def half(self, coordinate: str) -> NDArray[np.float64]:
        """Return half the peak to peak of a coordinate between the places of rest, at each point."""
        place = self.system.coordinates.index(coordinate)
        return np.array([point.half[place] for point in self.points])

    def motion(self, point: BackbonePoint, samples: int = 256) -> Motion:
        """Return the motion of a point over a period, sampled."""
        system = self.system.at({self.system.structure.pace: point.value})
        return integrate(system, point.state, 1, samples)

    @property
    def name(self) -> str:
        """The backbone with the mode from which it begins, in words."""
        return f"backbone of mode {self.mode}" if self.mode else "backbone"

    @property
    def _range_words(self) -> str:
        first, last, stable = self.points[0], self.points[-1], sum(point.stable for point in self.points)
        return (
            f"{self.name}: {len(self.points)} free vibrations, frequency {first.value:.8g} to {last.value:.8g}, "
            f"amplitude {first.amplitude:.4g} to {last.amplitude:.4g}; {stable} are stable"
        )

    def __repr__(self) -> str:
        return (
            f"Backbone({len(self.points)} free vibrations, {self.points[0].value:.6g} to {self.points[-1].value:.6g})"
        )


# Free vibrations as equations: motions that start at rest and come to rest again after half a period.
#
# Without losses a motion runs backwards as well as forwards. One that is at rest at two instants half a period apart
# repeats: it swings from one place of rest to the other and back the same way (a "brake orbit"; Vakakis et al. 1996,
# Normal Modes and Localization in Nonlinear Systems; Kerschen et al. 2009, Mech. Syst. Signal Process. 23, 170-194).
# So n positions at rest and the frequency satisfy n equations, without a phase to fix or a multiplier 1 to remove:
#
#     v(T/2; q0, W) = 0
#
# With gyroscopic terms a motion that runs backwards is one of the rotor that turns the other way, and vibrations whirl
# without coming to rest. They are periodic motions of the system with a damping that is an unknown too, and comes out
# as zero, because the energy returns (Munoz-Almaraz et al. 2003, Physica D 181, 1-38).
#
# Method: docs/numerics/notes/tori.md


@dataclass(frozen=True, eq=False)
class BackboneEquation:
    """Equations of free vibrations in n positions at rest, along the frequency.

    The residual is the velocity after half a period, divided by the frequency.
    """

    system: System  #: A system without losses, from `without_losses`.
    tolerance: float = 1e-12  #: Largest residual of a free vibration, relative to its positions.

    @property
    def parameter(self) -> str:
        """Name of the frequency among the parameters."""
        return self.system.structure.pace

    @cached_property
    def _line(self) -> ParameterLine:
        return ParameterLine(self.system, self.parameter)

    @cached_property
    def _flow(self) -> Flow:
        return flow_of(self.system, self.parameter, transition=True)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at positions of rest and a frequency; the evidence is half of the motion."""
        size = self.system.size
        coefficients, direction = self._line.coefficients(value)
        state = np.append(unknowns, np.zeros(size))
        arc = self._flow.integrate(coefficients, state, 0.0, 0.5 * PERIOD, direction)
        frequency = self._line.system_at(value).frequency
        pace = frequency / value  # of the parameter, which may have another unit
        residual = arc.state[size:] / frequency
        assert arc.sensitivity is not None
        by_frequency = arc.sensitivity[size:] / frequency - residual * pace / frequency
        return Evaluation(residual, transition_of(arc)[size:, :size] / frequency, by_frequency, arc)

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BackbonePoint:
        """Return the free vibration of a solution."""
        # The second half of a motion is the first, backwards, so that the monodromy matrix is ``R A^-1 R A`` with the
        # transition matrix A of the first half, and R, which turns velocities round.
        arc, size = evaluation.evidence, self.system.size
        half = transition_of(arc)
        turn = np.diag(np.repeat([1.0, -1.0], size))
        multipliers = np.linalg.eigvals(turn @ np.linalg.solve(half, turn @ half)).astype(complex)
        energy = potential_of(self.system, unknowns) - potential_of(self.system, np.zeros(size))
        order = np.argsort(-np.abs(multipliers))
        half = 0.5 * np.abs(unknowns - arc.state[:size])
        still = np.zeros(size)
        return BackbonePoint(value, unknowns.copy(), still, half, energy, multipliers[order], 2 * len(arc.contacts))

    def unknowns(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of a motion that begins at a state."""
        return state[: self.system.size]

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the positions."""
        return np.full(self.system.size, max(length, smallness(self.system)) * np.sqrt(self.system.size))


@dataclass(frozen=True, eq=False)
class WhirlEquation:
    """Equations of free vibrations with gyroscopic terms, in their states and a damping, along the frequency."""

    system: System  #: A system without losses, from `without_losses`.
    coordinate: int  #: Number of the coordinate that is at rest at the start.
    tolerance: float = 1e-11  #: Largest residual of a free vibration, relative to its state.

    @property
    def parameter(self) -> str:
        """Name of the frequency among the parameters."""
        return self.system.structure.pace

    @cached_property
    def _free(self) -> FreeEquation:
        """The equation of the motions damped in proportion to the mass; the parameter is a damping ratio."""
        system = self.system
        damping = system.matrix("damping") + 2.0 * system.frequency * system.matrix("mass")
        damped = on_the_way(system, damping_values(system, damping))
        return FreeShooting(system.coordinates[self.coordinate]).pose(damped, WAY)

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at a state with a damping and a frequency; see `FreeEquation.evaluate`."""
        found = self._free.evaluate(np.append(unknowns[:-1], value), float(unknowns[-1]))
        assert found.by_parameter is not None
        by_unknowns = np.column_stack((found.by_unknowns[:, :-1], found.by_parameter))
        return found._replace(by_unknowns=by_unknowns, by_parameter=found.by_unknowns[:, -1])

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> BackbonePoint:
        """Return the free vibration of a solution."""
        size, system = self.system.size, self.system
        orbit = self._free.orbit(np.append(unknowns[:-1], value), float(unknowns[-1]), evaluation)
        q, v = np.split(unknowns[:-1].copy(), [size])
        energy = (
            potential_of(system, q) - potential_of(system, np.zeros(size)) + 0.5 * float(v @ system.matrix("mass") @ v)
        )
        half = 0.5 * np.ptp(orbit.extremes[:size, :2], axis=1)
        return BackbonePoint(value, q, v, half, energy, orbit.multipliers, len(orbit.events))

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the states and of the damping."""
        size = max(length, smallness(self.system))
        return np.append(self.system.state_scales(size) * np.sqrt(self.system.size), 1.0)

    def unknowns(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of a motion that begins at a state."""
        return np.append(state, 0.0)


def free_equation(system: System, coordinate: int) -> BackboneEquation | WhirlEquation:
    """Return the equation of free vibrations of a system without losses."""
    return WhirlEquation(system, coordinate) if system.matrix("damping").any() else BackboneEquation(system)


# Continuation of free vibrations along their backbone, from a linear mode or from a release at rest.
#
# Method: docs/numerics/notes/tori.md

_SHARE = 0.5  # amplitude of the first vibration, as a share of the first gap that it would close
_TINY = 1e-3  # that of a system without gaps, in units of length
_SAMPLES = 400  # of a released motion, until it comes to rest again
_HALF_PERIODS = 4.0  # time for which a released motion is followed, in slowest half periods
_ROUNDING = 1e-14  # of a frequency, relative to it
_LENGTHS = 10.0  # change of the positions, in clearances, that weighs as much as all of the range

CROSSING = crossing("another backbone crosses")
# within gaps the frequency does not change: the component of the tangent along it is rounding
TURN = turn("the frequency turns", 1e-11, hides=CROSSING.name)
EVENTS = (TURN.name, CROSSING.name)
"""All kinds of events, in the order of legends."""


@dataclass(frozen=True, slots=True)
class BackboneOptions(Bounded):
    """Options of a backbone.

    Examples
    --------
    >>> gw.free.BackboneOptions(largest_amplitude=5.0).largest_amplitude
    5.0
    """

    #: Amplitude at which the backbone ends, in clearances (in units of length for a system without gaps).
    largest_amplitude: Positive = 20.0
    #: Options of the steps.
    walk: WalkOptions = field(default_factory=lambda: WalkOptions(largest_step=0.02, max_points=2000))


@shows_progress(lambda count, point: f"{count} free vibrations, at {point.value:.6g}")
def backbone(
    system: System,
    start: int | Sequence[float] | NDArray[np.float64] = 1,
    to: tuple[float, float] | None = None,
    *,
    options: BackboneOptions | None = None,
    report: Callable[[BackbonePoint], None] | None = None,
) -> Backbone:
    """Follow the free vibrations of a system without damping and excitation: the backbone of its resonances.

    The motions swing between two positions of rest; with gyroscopic terms, they whirl. Nonlinear normal modes are among
    them; at an internal resonance the frequency turns back. The mean load of the system is kept.

    Parameters
    ----------
    system
        The system; its damping and excitation are left out by `without_losses`.
    start
        Number of a linear mode about the equilibrium, from 1, at which the vibrations begin; or, where there is no
        linear mode (free flight in a gap), a guess of positions from which the system is released at rest.
    to
        Range of the frequency; by default from a fifth of the first frequency to five times that.
    options
        Largest amplitude, and options of the steps.
    report
        Called with each free vibration.

    Returns
    -------
    Backbone
        The free vibrations, with turns, crossings and both ends.

    Raises
    ------
    ModelError
        For a system with friction, rigid stops or forces that lose energy, an unknown mode, or a release at rest with
        gyroscopic terms.
    ConvergenceError
        If no free vibration is found at the start.
    Interrupted
        After Ctrl-C; its `found` is the backbone so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"],
    ...     mass=[1.0],
    ...     damping=[0.1],
    ...     stiffness=[1.0],
    ...     contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 8.0)],
    ...     harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
    ...     frequency=0.5,
    ... )
    >>> line = gw.free.backbone(mass)
    >>> bool(line.values[-1] > line.values[0])
    True
    """
    check_system(system, "backbone")
    options = options or BackboneOptions()
    free = without_losses(system)
    unit = max((slope.clearance for spring in springs_of(free) for slope in spring.slopes), default=0.0) or 1.0
    mode = start if isinstance(start, int) and not isinstance(start, bool) else 0
    if mode:
        state, away, frequency = _of_mode(free, mode, unit)
    else:
        state, frequency = _released(free, np.asarray(start, dtype=float))
        away = state
    pace = free.structure.pace
    first_value = frequency * free[pace] / free.frequency
    within = check_range(first_value, to or (0.2 * first_value, 5.0 * first_value)).along(pace, free)
    equation = free_equation(free.at({pace: first_value}), int(np.argmax(np.abs(away[: free.size]))))
    scales = powers_of_two(np.append(equation.scales(_LENGTHS * unit), within.width))
    corrector = Corrector(cast(Equation, cast(object, equation)), scales)
    first = _first(corrector, equation.unknowns(state), equation.unknowns(away), first_value, mode)
    limit = options.largest_amplitude * unit
    beginnings = [first]
    if not mode:  # towards smaller motions too
        beginnings.insert(0, replace(first, tangent=-first.tangent, determinant=-first.determinant, memo={}))

    def trace(beginning: BranchPoint, _: object) -> _BackboneTrace:
        return _BackboneTrace(Walk(beginning, within, corrector, options.walk, trust=0.0, branched=True), limit)

    def record(tracing: Tracing[BranchPoint, Any, Any]) -> Backbone:
        begin = End(EndReason.BEGINS, first.value)
        return Backbone(free, mode, *joined(tracing, begin, lambda point: point, lambda event: event))

    told = None if report is None else lambda point, _: report(point)
    return Tracing(beginnings, trace).to_end(record, told)


def _of_mode(system: System, mode: int, unit: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return a state of a small vibration in a linear mode, that from the stable equilibrium, and its frequency."""
    rests = [each for each in find_equilibria(system).equilibria if each.stable]
    if not rests:
        raise ModelError("the system has no stable equilibrium to vibrate about; give positions to release it from")
    rest = rests[0]
    modes = find_modes(system, rest)
    places = np.flatnonzero(modes.numbers == mode) if mode > 0 else np.zeros(0, int)
    if not len(places):
        count, more = modes.numbers.max(initial=0), ""
        if count < len(modes):
            more = "; what moves without stiffness has none: give positions to release the system from, beyond a gap, "
            more += "as in backbone(system, [2.0, 0.0])"
        raise ModelError(f"start is {mode}; the system has the modes 1 to {count}{more}")
    frequency, shape = float(modes.frequencies[places[0]]), modes.shapes[:, places[0]]
    room = [
        abs(slope.sign * slope.clearance - at) / abs(swing)
        for form, spring in zip(system.structure.contacts, springs_of(system), strict=True)
        for vector in [system.vector(form.vectors[0])]
        for at, swing in [(float(vector @ rest.position), abs(complex(vector @ shape)))]
        for slope in spring.slopes
        if abs(swing) > 1e-9
    ]
    amplitude = _SHARE * min([each for each in room if each > 0.0], default=2.0 * _TINY * unit)
    away = np.asarray(amplitude * np.append(shape.real, (1j * frequency * shape).real), dtype=np.float64)
    return np.append(rest.position, np.zeros(system.size)) + away, away, frequency


def _released(system: System, positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return state and frequency of the motion from a release: half a period passes until it is nearly at rest."""
    check_released(system)
    if positions.shape != (system.size,):
        raise ModelError(
            f"start has the shape {positions.shape}; write {system.size} positions, or the number of a mode"
        )
    flow, coefficients = flow_of(system), coefficients_of(system)
    thetas = np.linspace(0.0, PERIOD * _HALF_PERIODS, _SAMPLES)
    state = np.append(positions, np.zeros(system.size))
    states = flow.sample(coefficients, state, thetas).states
    place = int(np.argmax(np.abs(states[:, system.size :]).max(axis=0)))
    rates = states[:, system.size + place]
    turns = np.flatnonzero((rates[1:-1] * rates[2:] <= 0.0) & (np.abs(rates[1:-1]) > 0.0)) + 1
    if not len(turns):
        raise ConvergenceError(
            f"the motion released from {positions.tolist()} does not come to rest within {_HALF_PERIODS:g} periods of "
            f"the frequency {system.frequency:g}; give the system a lower frequency"
        )
    k = int(turns[0])
    theta = thetas[k] + (thetas[k + 1] - thetas[k]) * rates[k] / (rates[k] - rates[k + 1])
    return state, float(system.frequency * 0.5 * PERIOD / theta)


def check_released(system: System) -> None:
    """Raise a ModelError if a system without losses has gyroscopic terms: it does not come to rest again."""
    if system.matrix("damping").any():
        raise ModelError(
            "with gyroscopic terms a system that is released at rest does not come to rest again; write the number of "
            "a mode instead, as in backbone(system, 1), or modes = [1] in a study"
        )


def _first(
    corrector: Corrector, unknowns: NDArray[np.float64], away: NDArray[np.float64], value: float, mode: int
) -> BranchPoint:
    """Return the first point, whose size along a direction is kept, with the tangent along it."""
    x = np.append(unknowns, value) / corrector.scales
    normal = np.append(away / corrector.scales[:-1], 0.0)
    normal /= np.linalg.norm(normal)
    found = corrector.point_near(x, normal)
    if found is None:
        what = f"mode {mode}" if mode else f"the release from {away.tolist()}"
        raise ConvergenceError(f"no free vibration was found at {what}; try other positions")
    return found


class _BackboneTrace(CurveTrace):
    """Trace of a backbone in one direction, up to a largest amplitude."""

    kinds = (TURN, CROSSING)

    def __init__(self, walk: Walk, largest: float) -> None:
        super().__init__(walk)
        self._largest = largest

    def taken(self, point: BranchPoint) -> tuple[Any, list[Any]]:
        """Go on to a point, which is the last one if its amplitude is too large."""
        vibration, events = super().taken(point)
        if vibration.amplitude > self._largest:
            self.end = End(EndReason.AMPLITUDE, point.value)
        return vibration, events

    def event(self, kind: Happens, zero: Zero, after: BranchPoint) -> BackboneEvent:
        """Return a turn or a crossing."""
        vibration = cast(BackbonePoint, cast(object, zero.point.orbit))
        return BackboneEvent(kind.name, vibration, zero.width + _ROUNDING * abs(zero.point.value))
