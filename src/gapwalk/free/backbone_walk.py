"""Continuation of free vibrations along their backbone, from a linear mode or from a release at rest.

Method: docs/numerics/backbones.md
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, cast

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason, Walk
from gapwalk.continuation.walk_scales import check_range, powers_of_two
from gapwalk.continuation.zero_in_step import zero_in_step
from gapwalk.errors import ConvergenceError, Interrupted, ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.free.backbone_equation import free_equation
from gapwalk.free.backbone_record import Backbone, BackboneEnd, BackboneEvent, BackboneEventKind, BackbonePoint
from gapwalk.free.conservative import without_losses
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.modes import find_modes
from gapwalk.model.spring import springs_of
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import Equation

_SHARE = 0.5  # amplitude of the first vibration, as a share of the first gap that it would close
_TINY = 1e-3  # that of a system without gaps, in units of length
_SAMPLES = 400  # of a released motion, until it comes to rest again
_HALF_PERIODS = 4.0  # time for which a released motion is followed, in slowest half periods
_LEVEL = 1e-11  # component of the tangent along the frequency that is rounding: within gaps it does not change
_ROUNDING = 1e-14  # of a frequency, relative to it
_LENGTHS = 10.0  # change of the positions, in clearances, that weighs as much as all of the range


@dataclass(frozen=True, slots=True)
class BackboneOptions:
    """Options of a backbone.

    Examples
    --------
    >>> gw.free.BackboneOptions(largest_amplitude=5.0).largest_amplitude
    5.0
    """

    #: Amplitude at which it ends, in clearances (in units of length for a system without gaps).
    largest_amplitude: Annotated[float, Gt(0)] = 20.0
    #: Options of the steps.
    walk: WalkOptions = field(default_factory=lambda: WalkOptions(largest_step=0.02, max_points=2000))

    def __post_init__(self) -> None:
        if not self.largest_amplitude > 0.0:
            raise ModelError(f"largest_amplitude is {self.largest_amplitude!r}; it must be > 0")


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

    The motions are those that swing between two places of rest; with gyroscopic terms, which lose no energy, those that
    whirl. They include the nonlinear normal modes, and internal resonances as turns of the frequency. The mean load
    remains.

    Parameters
    ----------
    system
        The system; its damping and excitation are left out by `without_losses`.
    start
        Number of a linear mode about the equilibrium, from 1, with the vibrations that begin at it; or positions from
        which the system is released at rest, as a guess, where there is no linear mode (free flight in a gap).
    to
        Range of the frequency; by default a fifth to five times the first one.
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
    walks = [_Walked(first, Walk(first, within, corrector, options.walk, trust=0.0, branched=True), limit)]
    if not mode:  # towards smaller motions too
        back = replace(first, tangent=-first.tangent, determinant=-first.determinant, memo={})
        walks.insert(0, _Walked(back, Walk(back, within, corrector, options.walk, trust=0.0, branched=True), limit))
    try:
        for each in walks:
            each.to_end(report)
    except KeyboardInterrupt:
        raise Interrupted(_record(free, mode, walks)) from None
    return _record(free, mode, walks)


def _record(system: System, mode: int, walks: Sequence[_Walked]) -> Backbone:
    """Return the backbone of one walk, or of one towards smaller motions and one towards larger motions."""
    *back, ahead = walks
    points, events, begins = list(ahead.points), list(ahead.events), ahead.start
    for each in back:
        points = [*reversed(each.points[1:]), *points]
        events = [*reversed(each.events), *events]
        begins = each.end
    return Backbone(system, mode, tuple(points), tuple(events), (begins, ahead.end))


def _of_mode(system: System, mode: int, unit: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return a state of a small vibration in a linear mode, that from the stable equilibrium, and its frequency."""
    rests = [each for each in find_equilibria(system).equilibria if each.stable]
    if not rests:
        raise ModelError("the system has no stable equilibrium to vibrate about; give positions to release it from")
    rest = rests[0]
    modes = find_modes(system, rest)
    if not 1 <= mode <= len(modes.frequencies):
        raise ModelError(f"start is {mode}; the system has the modes 1 to {len(modes.frequencies)}")
    frequency = float(modes.frequencies[mode - 1])
    if not frequency > 0.0:
        raise ModelError(
            f"mode {mode} has no frequency about the equilibrium: it moves without stiffness; give positions to "
            "release the system from, beyond a gap, as in backbone(system, [2.0, 0.0])"
        )
    shape = modes.shapes[:, mode - 1]
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
    found = corrector.correct(x, normal)
    if found is None:
        what = f"mode {mode}" if mode else f"the release from {away.tolist()}"
        raise ConvergenceError(f"no free vibration was found at {what}; try other positions")
    return corrector.point(found, normal, 0.0)


class _Walked:
    """A walk along a backbone in one direction: its points, and the events between them."""

    def __init__(self, first: BranchPoint, walk: Walk, largest: float) -> None:
        self.walk, self.corrector, self.largest, self._last = walk, walk.corrector, largest, first
        self.points, self.events = [_vibration(first)], list[BackboneEvent]()
        self.start = BackboneEnd("the backbone begins here", first.value)
        self.end = BackboneEnd("the walk was stopped before its end", first.value)

    def to_end(self, report: Callable[[BackbonePoint], None] | None) -> None:
        """Walk to the end."""
        for point in self.walk:
            slopes = float(self._last.tangent[-1]), float(point.tangent[-1])
            if slopes[0] * slopes[1] < 0.0 and min(map(abs, slopes)) > _LEVEL:
                self._locate(point, BackboneEventKind.TURN, lambda each: float(each.tangent[-1]))
            elif self._last.determinant * point.determinant < 0.0:
                self._locate(point, BackboneEventKind.CROSSING, lambda each: each.determinant)
            self.points.append(_vibration(point))
            self._last = point
            if report is not None:
                report(self.points[-1])
            if self.points[-1].amplitude > self.largest:
                self.end = BackboneEnd("the largest amplitude was reached", point.value)
                return
        end = self.walk.end
        assert end is not None
        is_failure = end.reason in (EndReason.STEP, EndReason.POINTS)
        self.end = BackboneEnd(end.reason_words, self.walk.point.value, is_failure)

    def _locate(self, after: BranchPoint, kind: BackboneEventKind, function: Callable[[BranchPoint], float]) -> None:
        _, point, width = zero_in_step(self._last, after, self.corrector, function)
        self.events.append(BackboneEvent(kind, _vibration(point), width + _ROUNDING * abs(point.value)))


def _vibration(point: BranchPoint) -> BackbonePoint:
    return cast(BackbonePoint, cast(object, point.orbit))
