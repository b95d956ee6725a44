"""Self-excitation over a range of a parameter: all equilibria, and the periodic motions from their Hopf points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import BranchStart, directions, start_branch, switch
from gapwalk.bifurcation.follow import BranchTracer, join
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, Range, check_range, powers_of_two
from gapwalk.continuation.curve import numbered
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, Tracing, WalkOptions
from gapwalk.errors import ConvergenceError, Interrupted, ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import check_state
from gapwalk.free.equilibrium_walk import HOPF, RestEvent, Rests, equilibria_of, follow_rest
from gapwalk.free.free_shooting import (
    FreeOrbit,
    FreeShooting,
    at_rest,
    check_orbit,
    companion,
    length_at_rest,
    tangents,
    without_excitation,
)
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.system import System, check_system
from gapwalk.notebook import Shown, shows_progress
from gapwalk.orbit.orbit_equation import Newton, solve
from gapwalk.summary import Rows, SummaryParts, remarks, row_of, summarizes

# Beginnings of self-excited motions: at a Hopf point of an equilibrium, or from a state whose motion settles.
#
# Method: docs/numerics/notes/tori.md

_LENGTHS = 10.0  # change of a motion, in lengths of the system, that weighs as much as all of the range
_PUSH = 1e-3  # displacement from the equilibrium, in lengths, from which a motion grows
_TURNS = 400  # largest number of times that the coordinate turns round before the motion must repeat
_SAMPLES = 256  # of a natural period
_REPEATS = 1e-3  # relative difference of states that count as repeated
_SAME = 1e-6  # relative difference of the states of one motion, found over its period and over a part of it
_MOST = 8  # largest number of turns after which a motion repeats
_STILL = 1e-9  # size of a motion, relative to its state, that has died away


def at_hopf(system: System, parameter: str, hopf: RestEvent, within: Range) -> BranchStart:
    """Return the beginning of the periodic motions at a Hopf point."""
    # The branch begins at the equilibrium, as an orbit without amplitude, along the complex eigenvector of its pair:
    # the coordinate that swings most begins at its largest deflection.
    values = {parameter: hopf.value, system.structure.pace: 1.0}
    pace = hopf.frequency / system.at(values).frequency
    there = system.at({**values, system.structure.pace: pace})
    found, shapes = _eigen(there, hopf.point.position)
    shape = shapes[:, np.argmin(np.abs(found - 1j * hopf.frequency))]
    coordinate = int(np.argmax(np.abs(shape[: system.size])))
    shape = shape / shape[coordinate]
    equation = FreeShooting(system.coordinates[coordinate]).pose(there, parameter)
    # at the Hopf point itself a formula may bend at no length: its linear part vanishes
    ends = [there.at({parameter: value}) for value in (within.low, within.high)]
    length = _LENGTHS * max(length_at_rest(each, hopf.point.position) for each in ends)
    scales = powers_of_two(np.append(equation.scales(length, hopf.frequency), min(within.width, within.natural)))
    corrector = Corrector(equation, scales)
    start = np.concatenate((hopf.point.position, np.zeros(system.size), [pace, hopf.value]))
    tangent = np.concatenate((shape.real, [0.0, 0.0])) / scales
    return BranchStart.uncorrected(corrector, start, tangent / np.linalg.norm(tangent), within)


def find_self_excited(
    system: System, start: Sequence[float] | NDArray[np.float64] | None = None, coordinate: str = ""
) -> FreeOrbit:
    """Find the periodic motion without excitation on which the motion from a state settles.

    Parameters
    ----------
    system
        The system; its excitation is left out. Its frequency is not used.
    start
        A state: positions, then velocities. By default a small displacement from an unstable equilibrium, along the
        motion that grows fastest.
    coordinate
        Name of the coordinate that is at rest at the start of the period; by default the one that swings most.

    Returns
    -------
    FreeOrbit
        The motion; its system has the frequency of the motion.

    Raises
    ------
    ModelError
        If something depends on the angle of the excitation, or for an invalid state.
    ConvergenceError
        If the motion dies away, or does not repeat.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "mu*(x*x - 1)*v", mu=1.0)
    >>> orbit = gw.free.find_self_excited(gw.System(["x"], [1.0], contacts=[damper]))
    >>> round(orbit.duration, 9)
    6.663286859
    """
    check_system(system, "find_self_excited")
    free = without_excitation(system)
    if coordinate and coordinate not in free.coordinates:
        raise ModelError(f"coordinate is {coordinate!r}; it must be one of {', '.join(free.coordinates)}")
    state, frequency = _beginning(free) if start is None else (check_state(free, start), _fastest(free))
    free = free.at({free.structure.pace: frequency / free.at({free.structure.pace: 1.0}).frequency})
    return _settled(free, state, coordinate)


def _fastest(system: System) -> float:
    """Return the highest natural frequency about the first equilibrium, or about zero positions."""
    rests = find_equilibria(system).equilibria
    positions = rests[0].position if rests else np.zeros(system.size)
    values = _eigen(system, positions)[0]
    return float(np.abs(values.imag).max()) or float(np.abs(values).max()) or 1.0


def _eigen(system: System, positions: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    layout, coefficients = layout_of(system.structure), coefficients_of(system)
    found = np.linalg.eig(companion(*tangents(layout, coefficients, positions, np.zeros(system.size))))
    return found[0].astype(complex), found[1].astype(complex)


def _beginning(system: System) -> tuple[NDArray[np.float64], float]:
    """Return a state near an unstable equilibrium, and the frequency of the motion that grows there."""
    for rest in find_equilibria(system).equilibria:
        values, shapes = _eigen(system, rest.position)
        growing = np.argmax(values.real)
        if values[growing].real > 0.0:
            frequency = abs(float(values[growing].imag)) or abs(values[growing])
            shape = shapes[:, growing].real
            shape = shape / np.abs(shape[: system.size]).max()
            small = _PUSH * length_at_rest(system, rest.position)
            return np.append(rest.position, np.zeros(system.size)) + small * shape, frequency
    raise ConvergenceError(
        "no equilibrium is unstable, so that no motion grows by itself; give a state from which it does, start = [...]"
    )


def _settled(system: System, state: NDArray[np.float64], coordinate: str) -> FreeOrbit:
    """Integrate until the states at which a coordinate turns round repeat, and find the exact orbit there."""
    flow, coefficients, n = flow_of(system), coefficients_of(system), system.size
    thetas = np.linspace(0.0, PERIOD, _SAMPLES + 1)
    place = system.coordinates.index(coordinate) if coordinate else -1
    turns: list[tuple[float, NDArray[np.float64]]] = []
    error, begins = None, 0.0
    for number in range(4 * _TURNS):
        states = flow.sample(coefficients, state, thetas).states
        if place < 0 and number == 4 * _MOST:
            place = int(np.argmax(np.ptp(states[:, :n], axis=0)))
        state, swing = states[-1], float(np.ptp(states[:, :n], axis=0).max())
        begins = begins or swing
        if swing <= _STILL * max(begins, magnitude(state, system)):
            raise ConvergenceError("the motion dies away: it settles at an equilibrium")
        if place < 0:
            continue
        rates = states[:, n + place]
        for k in np.flatnonzero((rates[:-1] > 0.0) & (rates[1:] <= 0.0)):
            share = rates[k] / (rates[k] - rates[k + 1])
            turns.append(
                (thetas[k] + share * thetas[1] + number * PERIOD, states[k] + share * (states[k + 1] - states[k]))
            )
        repeats = _repeats(turns, system, swing)
        if repeats:
            try:
                found = _exact(system, turns[-1][1], (turns[-1][0] - turns[-1 - repeats][0]) / PERIOD, place)
                return _shortest(found, repeats, place)
            except NumericalError as failed:  # it may settle further
                error, turns = failed, []
        if len(turns) > _TURNS:
            break
    what = f"; Newton's method from its end fails: {error}" if error else ""
    raise ConvergenceError(f"the motion does not repeat: it may be quasi-periodic or chaotic, or settle slowly{what}")


def _repeats(turns: Sequence[tuple[float, NDArray[np.float64]]], system: System, swing: float) -> int:
    """Return after how many turns the motion repeats, within a share of its swing; 0 if it does not."""
    if len(turns) < 2 * _MOST + 2:
        return 0
    last, unit = turns[-1][1], system.state_scales()
    for count in range(1, _MOST + 1):
        off = np.abs((turns[-1 - count][1] - last) / unit).max()
        if off <= _REPEATS * swing:
            return count
    return 0


def _exact(system: System, state: NDArray[np.float64], periods: float, place: int) -> FreeOrbit:
    pace = system.structure.pace
    there = system.at({pace: system[pace] / periods})
    return _solved(there, at_rest(there, state, place), place)


def _solved(there: System, state: NDArray[np.float64], place: int) -> FreeOrbit:
    """Return the exact motion over a period of a system, from a state at which a coordinate is at rest."""
    equation = FreeShooting(there.coordinates[place]).pose(there)
    guess = np.append(state, there[there.structure.pace])
    unknowns, evaluation = solve(equation, guess, 0.0, Newton(iterations=20))
    found = equation.orbit(unknowns, 0.0, evaluation)
    if float(np.ptp(found.extremes[:, :2], axis=1).max()) <= _STILL * magnitude(found.state, found.system):
        raise ConvergenceError("Newton's method leads to an equilibrium")
    return found


def _shortest(orbit: FreeOrbit, turns: int, place: int) -> FreeOrbit:
    """Return a motion over its shortest period: where it settles slowly, a multiple of that may repeat first."""
    system, pace, swing = orbit.system, orbit.system.structure.pace, float(np.ptp(orbit.extremes[place, :2]))
    for parts in range(turns, 1, -1):
        if turns % parts:
            continue
        later = orbit.strobes(2, PERIOD / parts)[-1]
        if np.abs((later - orbit.state) / system.state_scales()).max() > _REPEATS * swing:
            continue
        try:
            found = _solved(system.at({pace: system[pace] * parts}), orbit.state, place)
        except NumericalError:
            continue
        if np.abs((found.state - orbit.state) / system.state_scales()).max() <= _SAME * swing:
            return found
    return orbit


# Self-excited motions along a parameter: equilibria, their Hopf points, and the periodic motions that begin there.
#
# Method: docs/numerics/notes/tori.md

_OWN = 1e-3  # share of the range from which the size of a value of the parameter is a unit of it
_FEW, _MANY = 5, 200  # motions at one value of the parameter after which it is known to stay, and the walk ends
_ONE = 1e-10  # change of the parameter over them, as a share of the range, that is none but for rounding
_SHRUNK = 0.2  # amplitude, as a share of the largest one of a branch, below which a turned motion has shrunk to a rest


@shows_progress(lambda count, point, special: f"{count} motions, at {point.value:.6g}")
def follow_self_excited(
    start: RestEvent | FreeOrbit | SpecialPoint,
    system: System,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    report: Callable[[BranchPoint, list[SpecialPoint]], None] | None = None,
) -> Branch:
    """Follow periodic motions without excitation along a parameter, from a Hopf point or from a known motion.

    Their frequency is an unknown. Amplitude, stability and special points are as for any branch; where a contact is
    first touched, there is a grazing point.

    Parameters
    ----------
    start
        A Hopf point of equilibria, from `follow_rest`; a motion, from `find_self_excited`; or a flip or branch point of
        such motions, for the branch that begins there.
    system
        The system; its excitation is left out.
    parameter
        Name of the parameter.
    to
        The range, as two values. If `start` is a motion, one value is allowed, too: where to stop.
    walk
        Options of the walk.
    report
        Called with each new point and the special points before it.

    Returns
    -------
    Branch
        Its points, special points and ends. It also ends where the motion shrinks to an equilibrium, and after 200
        motions if all exist at one value of the parameter, as about a centre. Other branches begin at its branch
        points.

    Raises
    ------
    ModelError
        For any other start, or the frequency as parameter.
    NumericalError
        If the walk cannot begin.
    Interrupted
        After Ctrl-C; its `found` is the branch so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)
    >>> oscillator = gw.System(["x"], [1.0], contacts=[damper])
    >>> hopf = gw.free.follow_rest(oscillator, "damper.mu", 0.5).hopf_points[0]
    >>> line = gw.free.follow_self_excited(hopf, oscillator, "damper.mu", (-1.0, 1.0))
    >>> round(6.283185307179586 / line.points[-1].orbit.system.frequency, 9)  # the period at mu = 1
    6.663286859
    """
    beginnings = _beginnings(start, without_excitation(system), parameter, to)
    tracing: Tracing = Tracing(beginnings, lambda beginning, state: BranchTracer(beginning, walk, state))
    try:
        for point, special in tracing:
            tracer = tracing.traces[-1]
            if _has_turned(tracer, tracing.steps[-1]):
                _end_at_rest(tracer, tracing.steps[-1])
                continue
            if len(tracing.steps[-1]) in (_FEW, _MANY) and _is_level(tracer, tracing.steps[-1]):
                tracing.steps[-1][:] = [(each, [s for s in had if not s.turns]) for each, had in tracing.steps[-1]]
                tracer.stay_level()
                if len(tracing.steps[-1]) == _MANY:
                    tracer.walk.finish(point, EndReason.CENTRE)
            if tracer.is_level:  # how far its points are from the one value is an error of theirs
                special[:] = [
                    replace(s, uncertainty=s.uncertainty + abs(s.value - tracer.first.value)) for s in special
                ]
            if report is not None:
                report(point, special)
    except KeyboardInterrupt:
        if not tracing.traces:
            raise
        raise Interrupted(join(tracing)) from None
    return join(tracing)


def _beginnings(start: object, system: System, parameter: str, to: float | tuple[float, float]) -> list[BranchStart]:
    if isinstance(start, RestEvent):
        if start.kind != HOPF.name:
            raise ModelError(f"periodic motions begin at a Hopf point, but this is a point where {start.words}")
        if isinstance(to, int | float):
            raise ModelError(
                f"to is {to}; motions from a Hopf point may exist on both sides of it: write a range, such as "
                f"to = ({min(to, start.value):g}, {max(to, start.value):g})"
            )
        within = check_range(start.value, to).along(parameter, system)
        own = abs(start.value)  # where it is small, it is no unit of the parameter
        within = replace(within, natural=own if own > _OWN * within.width else within.width)
        return [at_hopf(system, parameter, start, within)]
    orbit = start.orbit if isinstance(start, SpecialPoint) else start
    check_orbit(orbit)
    assert isinstance(orbit, FreeOrbit)
    method, value = FreeShooting(orbit.coordinate), orbit.system[parameter]
    if isinstance(start, SpecialPoint):
        within = check_range(value, to)
        beginnings = switch(start, parameter, (within.low, within.high), method)
        if not beginnings:
            raise NumericalError(
                f"no branch begins here from {within.low:.6g} to {within.high:.6g}; choose a wider range"
            )
        return beginnings
    return [start_branch(orbit, parameter, to, way, method) for way in directions(value, to)]


def _has_turned(tracer: BranchTracer, steps: Sequence[tuple[BranchPoint, list[SpecialPoint]]]) -> bool:
    """Return True if the coordinate at rest at the start of the period went from its largest to its smallest value."""
    # Then the motion has shrunk to an equilibrium in the last step, and grows again with the opposite phase.
    last, point = (steps[-2][0] if len(steps) > 1 else tracer.first), steps[-1][0]
    if tracer.beginning.singular and last is tracer.first:
        return False
    if bend(_cycle(last)) * bend(_cycle(point)) >= 0.0:
        return False
    sizes = [swing(_cycle(each)) for each, _ in steps]
    return sizes[-1] < _SHRUNK * max(sizes) or len(sizes) < 2


def _is_level(tracer: BranchTracer, steps: Sequence[tuple[BranchPoint, list[SpecialPoint]]]) -> bool:
    """Return True if all motions since a Hopf point exist at one value of the parameter, as about a centre."""
    values = [tracer.first.value, *(each.value for each, _ in steps)]
    return tracer.beginning.singular and max(values) - min(values) <= _ONE * tracer.beginning.within.width


def _end_at_rest(tracer: BranchTracer, steps: list[tuple[BranchPoint, list[SpecialPoint]]]) -> None:
    """End a branch before its last step, in which the motion has shrunk to an equilibrium."""
    turned, _ = steps.pop()
    last = steps[-1][0] if steps else tracer.first
    # amplitudes with their signs pass 0 linearly, and the parameter has its vertex there
    sizes = swing(_cycle(last)), swing(_cycle(turned))
    change = sizes[1] ** 2 - sizes[0] ** 2
    value = (last.value * sizes[1] ** 2 - turned.value * sizes[0] ** 2) / change if change else last.value
    name = tracer.beginning.equation.parameter
    tracer.walk.finish(last, EndReason.AT_REST, f"near {name} = {value:.6g}")


def _cycle(point: BranchPoint) -> FreeOrbit:
    return cast(FreeOrbit, point.orbit)


def bend(orbit: FreeOrbit) -> float:
    """Return the acceleration at theta = 0 of the coordinate that is at rest there."""
    n, layout = orbit.system.size, layout_of(orbit.system.structure)
    found = accelerations(layout, coefficients_of(orbit.system), 0.0, orbit.state[:n], orbit.state[n : 2 * n])
    return float(found[orbit.system.coordinates.index(orbit.coordinate)])


def swing(orbit: FreeOrbit) -> float:
    """Return half the peak to peak of the coordinate that is at rest at theta = 0."""
    place = orbit.system.coordinates.index(orbit.coordinate)
    return 0.5 * float(orbit.extremes[place, 0] - orbit.extremes[place, 1])


_NEAR = 0.02  # share of the range within which a motion that shrinks to an equilibrium ends at a Hopf point


@dataclass(frozen=True, eq=False)
class SelfExcited(Shown):
    """Equilibria over a parameter, and the periodic motions without excitation that begin at their Hopf points."""

    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: Its range.
    rests: tuple[Rests, ...]  #: The equilibria.
    #: Branches of periodic motions, from Hopf points and their centres; the frequency of each motion is that of its
    #: system.
    cycles: tuple[Branch, ...] = ()
    failures: tuple[str, ...] = ()  #: What was not found, with the reasons, in sentences.
    complete: bool = True  #: True if all were followed.

    @property
    def system(self) -> System:
        """The system without excitation."""
        return self.rests[0].system

    @property
    def hopf_points(self) -> tuple[RestEvent, ...]:
        """The Hopf points of all equilibria."""
        return tuple(event for line in self.rests for event in line.hopf_points)

    @property
    def beginnings(self) -> tuple[RestEvent | SpecialPoint, ...]:
        """Where branches of motions begin: the Hopf points, then branch points on families at one value of it."""
        centres = [cycle for cycle in self.cycles if cycle.ends[-1].reason is EndReason.CENTRE]
        points = [each for cycle in centres for each in cycle.special_points if each.kind is Kind.BRANCH_POINT]
        return (*self.hopf_points, *points)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks: where small motions begin to grow although there is no Hopf point."""
        found = []
        for line in self.rests:
            for event in line.events:
                if event.contact and event.after > event.before + 1:
                    found.append(
                        f"at {self.parameter} = {event.value:.6g} {event.words}, and small motions grow from there on "
                        "at once: find the motion on which they settle with gw.free.find_self_excited"
                    )
        return tuple(found)

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return equilibria and motions in words."""
        for line in self.rests:
            yield from line.summary()
        for number, cycle in enumerate(self.cycles, start=1):
            frequencies = [point.orbit.system.frequency for point in cycle.points]
            yield f"motions {number}, frequency {frequencies[0]:.6g} to {frequencies[-1]:.6g}:"
            yield from cycle.summary()
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of motions, their special points, equilibria and their events, with their numbers."""
        return {
            "motions": lambda: numbered("branch", self.cycles, lambda cycle: map(_motion_row, cycle.points)),
            "special": lambda: numbered("branch", self.cycles, lambda cycle: cycle.special_points),
            "equilibria": lambda: numbered("branch", self.rests, Rests.rows),
            "events": lambda: numbered("branch", self.rests, lambda line: line.events),
        }

    def __repr__(self) -> str:
        return (
            f"SelfExcited({self.parameter}, {len(self.rests)} branches of equilibria, {len(self.hopf_points)} Hopf "
            f"points, {len(self.cycles)} branches of motions)"
        )


def _motion_row(point: BranchPoint) -> dict[str, Any]:
    system = point.orbit.system
    own: dict[str, Any] = {
        "frequency": system[system.structure.pace],
        "period": PERIOD * point.orbit.period / system.frequency,
    }
    return {**row_of(point), **own, **{f"half.{name}": point.measure(f"half.{name}") for name in system.coordinates}}


def self_excited(
    system: System,
    parameter: str,
    to: float | tuple[float, float],
    *,
    start: Sequence[float] | NDArray[np.float64] | None = None,
    walk: WalkOptions | None = None,
    report: Callable[[Any], None] | None = None,
) -> SelfExcited:
    """Follow the equilibria of a system along a parameter, and the self-excited motions from their Hopf points.

    Parameters
    ----------
    system
        The system; its excitation is left out.
    parameter
        Name of the parameter.
    to
        The range, as two values, between which the system's value lies; or one value, the end of a range from there.
    start
        Positions near an equilibrium, shape (n,); by default all that `find_equilibria` finds.
    walk
        Options of the walks.
    report
        Called with each equilibrium and each point of a branch of motions.

    Returns
    -------
    SelfExcited
        Equilibria and motions. What could not be followed is in its `failures`.

    Raises
    ------
    ModelError
        For friction on a base at rest, rigid stops, or the frequency as parameter.
    ConvergenceError
        If there is no equilibrium at the start.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)
    >>> found = gw.free.self_excited(gw.System(["x"], [1.0], contacts=[damper]), "damper.mu", 1.0)
    >>> found
    SelfExcited(damper.mu, 1 branches of equilibria, 1 Hopf points, 1 branches of motions)
    """
    check_system(system, "self_excited")
    within = range_of(system, parameter, to)
    rests = list[Rests]()
    for positions in starts(system) if start is None else [np.asarray(start, dtype=float)]:
        if not is_known(rests, system[parameter], positions):
            rests.append(follow_rest(system, parameter, within, start=positions, walk=walk, report=report))
    found = SelfExcited(parameter, within, tuple(rests))
    done, told = 0, None if report is None else lambda point, special: report(point)
    while done < len(found.beginnings):
        beginning, done = found.beginnings[done], done + 1
        if not is_reached(found, beginning):
            found = with_cycle(found, cycle_from(found.system, found.parameter, found.within, walk, beginning, told))
    return found


def range_of(system: System, parameter: str, to: float | tuple[float, float]) -> tuple[float, float]:
    """Return the range of a parameter from the value of a system to another one, or between two, in order."""
    low, high = sorted(to if isinstance(to, tuple) else (system[parameter], to))
    return float(low), float(high)


def starts(system: System) -> list[NDArray[np.float64]]:
    """Return the positions of all equilibria without excitation; raise a ConvergenceError if none are found."""
    return equilibria_of(without_excitation(system))


def is_known(rests: Sequence[Rests], value: float, positions: NDArray[np.float64]) -> bool:
    """Return True if an equilibrium at a value of the parameter lies on a known branch."""
    for line in rests:
        for first, second in zip(line.points[:-1], line.points[1:], strict=True):
            low, high = sorted((first.value, second.value))
            if not low <= value <= high:
                continue
            share = (value - first.value) / (second.value - first.value or 1.0)
            off = np.abs(first.position + share * (second.position - first.position) - positions).max()
            apart = np.abs(second.position - first.position).max()
            if off <= 0.1 * apart + _SAME * max(1e-300, np.abs(positions).max()):
                return True
    return False


def is_reached(found: SelfExcited, hopf: RestEvent | SpecialPoint) -> bool:
    """Return True if a branch of motions has come from another Hopf point to this one, and ended there."""
    low, high = found.within
    if not isinstance(hopf, RestEvent):
        return False
    for cycle in found.cycles:
        last = cycle.points[-1]
        if cycle.ends[-1].reason is not EndReason.AT_REST or abs(last.value - hopf.value) > _NEAR * (high - low):
            continue
        if abs(last.orbit.system.frequency / hopf.frequency - 1.0) < _NEAR:
            return True
    return False


def cycle_from(
    system: System,
    parameter: str,
    within: tuple[float, float],
    walk: WalkOptions | None,
    start: RestEvent | SpecialPoint,
    report: Callable[[Any, Any], None] | None = None,
) -> Branch | str:
    """Return the branch of motions from a beginning, or in words why there is none; a piece of work for any process."""
    try:
        return follow_self_excited(start, system, parameter, within, walk=walk, report=report)
    except NumericalError as error:
        name = "Hopf point" if isinstance(start, RestEvent) else start.kind_words
        return f"from the {name} at {start.value:.6g}: {error}"


def with_cycle(found: SelfExcited, cycle: Branch | str) -> SelfExcited:
    """Return what was found with a branch of motions, or with the reason why there is none."""
    if isinstance(cycle, str):
        return replace(found, failures=(*found.failures, cycle))
    failures = [f"motions {len(found.cycles) + 1}: {end}" for end in cycle.failures]
    return replace(found, cycles=(*found.cycles, cycle), failures=(*found.failures, *failures))
