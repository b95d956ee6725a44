"""Beginnings of self-excited motions: at a Hopf point of an equilibrium, or from a state whose motion settles.

Method: docs/numerics/self-excited.md
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import BranchStart
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.walk_scales import Range, powers_of_two
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.length_unit import magnitude
from gapwalk.flow.motion import check_state
from gapwalk.free.free_shooting import FreeOrbit, FreeShooting, at_rest
from gapwalk.free.rest_record import RestEvent
from gapwalk.free.small_motions import companion, length_at_rest, tangents
from gapwalk.free.undriven import without_excitation
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.system import System, check_system
from gapwalk.orbit.orbit_equation import Newton, solve

_LENGTHS = 10.0  # change of a motion, in lengths of the system, that weighs as much as all of the range
_SMALL = 1e-3  # displacement from the equilibrium, in lengths, from which a motion grows
_TURNS = 400  # largest number of times that the coordinate turns round before the motion must repeat
_SAMPLES = 256  # of a natural period
_REPEATS = 1e-3  # relative difference of states that count as repeated
_SAME = 1e-6  # relative difference of the states of one motion, found over its period and over a part of it
_MOST = 8  # largest number of turns after which a motion repeats
_STILL = 1e-9  # size of a motion, relative to its state, that has died away


def at_hopf(system: System, parameter: str, hopf: RestEvent, within: Range) -> BranchStart:
    """Return the beginning of the periodic motions at a Hopf point.

    The branch begins at the equilibrium, as an orbit without amplitude, along the complex eigenvector of its pair: the
    coordinate that swings most begins at its largest deflection.
    """
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
        The motion; the frequency of its system is its own.

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
            small = _SMALL * length_at_rest(system, rest.position)
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
