"""Search for one orbit from a start: from rest, from a given state, or from a settled transient."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.length_unit import magnitude
from gapwalk.flow.motion import check_state
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.dissipation import dissipation_doubts
from gapwalk.model.system import System, check_system
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.newton import Newton, solve
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import OrbitEquation
from gapwalk.orbit.other_starts import other_starts
from gapwalk.orbit.shooting import ShootingEquation

_TRANSIENT = 400  # largest number of forcing periods before Newton's method starts
_SETTLED = 1e-4  # relative change over one orbit below which Newton's method starts


def find_orbit(
    system: System,
    period: int = 1,
    start: str | Sequence[float] | NDArray[np.float64] = "settle",
    *,
    method: Method | None = None,
    newton: Newton | None = None,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Orbit:
    """Find a periodic orbit.

    Parameters
    ----------
    system
        The system.
    period
        m: forcing periods after which the orbit repeats.
    start
        ``"rest"``: Newton's method from the state zero. ``"settle"``: Newton's method from the end of a transient from
        rest. If that finds no orbit, other starts are tried: states of the settled motion that nearly repeat, their
        mean, rest, orbits at other frequencies that are followed to this one, and harmonic balance. Or a state, 2n
        numbers: positions, then velocities, at theta = 0.
    method
        Discretisation of the orbit: `Shooting` (the default) or `Balance`.
    newton
        Options of Newton's method.
    at, **values
        Parameter values to change first: ``find_orbit(system, frequency=1.9)``.

    Raises
    ------
    ModelError
        For an invalid start, period or parameter.
    ConvergenceError
        If no orbit is found; the message lists the starts that were tried.
    """
    check_system(system, "find_orbit")
    system = system.at(at, **values)
    equation = chosen(method).pose(system, None, period)
    if not (isinstance(start, str) and start == "settle"):
        return _solved(equation, equation.start(initial_state(system, start, period)), newton)
    return _found(equation, newton)


def _found(equation: OrbitEquation, newton: Newton | None) -> Orbit:
    """Return the orbit found from a transient, or else the first found from another start."""
    system, period, settled = equation.system, equation.period, None
    doubts = dissipation_doubts(system)
    try:
        settled = settle(system, np.zeros(2 * system.size), period)
        return _solved(equation, equation.start(settled), newton)
    except NumericalError as error:
        if settled is None and not doubts:  # if the transient diverges, other starts do not help
            raise
        first = error

    def settled_at(other: System) -> Orbit:
        return _solved(ShootingEquation(other, None, period), settle(other, np.zeros(2 * other.size), period), newton)

    tried = ["a transient from rest"]
    for words, state in other_starts(system, period, settled, settled_at):
        try:
            return _solved(equation, equation.start(state()), newton)
        except NumericalError:
            if words not in tried:
                tried.append(words)
    why = ". ".join(f"{doubt[0].upper()}{doubt[1:]}" for doubt in doubts)
    raise ConvergenceError(
        f"no period-{period} orbit found. Tried as starts: {', '.join(tried)} (the first: {first}). "
        f"{why or _advice(system.structure.names[0], period)}"
    ) from first


def _advice(name: str, period: int) -> str:
    return (
        f"Give a state near the orbit (start = [...]), follow it from another value of {name}, or look for another "
        f"period (period = {2 * period}): `gapwalk.settle` shows what the motion settles on"
    )


def _solved(equation: OrbitEquation, guess: NDArray[np.float64], newton: Newton | None) -> Orbit:
    """Return the orbit nearest to a guess, refining the equation as necessary."""
    unknowns, evaluation = solve(equation, guess, 0.0, newton)
    orbit = equation.orbit(unknowns, 0.0, evaluation)
    doubt = equation.doubt(orbit)
    if not doubt:
        return orbit
    finer = equation.finer()
    if finer is None:
        raise ConvergenceError(doubt)
    return _solved(finer, finer.unknowns(orbit), newton)


def initial_state(system: System, start: str | Sequence[float] | NDArray[np.float64], period: int = 1):
    """Return the state at theta = 0 of a start, shape (2n,)."""
    if not isinstance(start, str):
        return check_state(system, start)
    if start == "rest":
        return np.zeros(2 * system.size)
    if start == "settle":
        return settle(system, np.zeros(2 * system.size), period)
    raise ModelError(f'start is {start!r}; write "rest", "settle" or a state of {2 * system.size} numbers')


def settle(system: System, state: NDArray[np.float64], period: int = 1) -> NDArray[np.float64]:
    """Integrate the transient from a state until it nearly repeats after `period` forcing periods."""
    flow, coefficients = flow_of(system), coefficients_of(system)
    for _ in range(max(1, _TRANSIENT // period)):
        following = flow.integrate(coefficients, state, 0.0, PERIOD * period).state
        if np.abs(following - state).max() <= _SETTLED * magnitude(following, system):
            return following
        state = following
    return state
