"""Find one orbit from a start: from rest, from a given state, or from a settled transient."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.dissipation import dissipation_doubts
from gapwalk.model.system import System, check_system
from gapwalk.motion.flow import PERIOD, flow_of
from gapwalk.motion.motion import check_state
from gapwalk.motion.unit import magnitude
from gapwalk.orbit.equation import OrbitEquation
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.newton import Newton, solve
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import ShootingEquation
from gapwalk.orbit.starts import other_starts

_TRANSIENT = 400  # forcing periods at most; Newton takes over from wherever the motion has come to by then
_SETTLED = 1e-4  # relative change over one orbit at which Newton takes over


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
        ``"rest"``: Newton's method from the state zero. ``"settle"``: from where a transient from rest has come to; if
        that leads to no orbit, other starts follow by themselves: states of the settled motion that nearly repeat,
        their mean, rest, orbits of other frequencies that are carried here, and harmonic balance. Or a state, 2n
        numbers: positions, then velocities, at theta = 0.
    method
        How the orbit is posed: `Shooting` (the default) or `Balance`.
    newton
        How to iterate.
    at, **values
        Parameter values to change first: ``find_orbit(system, frequency=1.9)``.

    Raises
    ------
    ModelError
        For a start, period or parameter that makes no sense.
    ConvergenceError
        If no orbit is found; the message says from which starts.
    """
    check_system(system, "find_orbit")
    system = system.at(at, **values)
    equation = chosen(method).pose(system, None, period)
    if not (isinstance(start, str) and start == "settle"):
        return _solved(equation, equation.start(initial_state(system, start, period)), newton)
    return _found(equation, newton)


def _found(equation: OrbitEquation, newton: Newton | None) -> Orbit:
    """The orbit that a transient leads to, or else the first that another start leads to."""
    system, period, settled = equation.system, equation.period, None
    doubts = dissipation_doubts(system)
    try:
        settled = settle(system, np.zeros(2 * system.size), period)
        return _solved(equation, equation.start(settled), newton)
    except NumericalError as error:
        if settled is None and not doubts:  # what no motion can be followed in has no orbit that can
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
        f"Give a state near the orbit (start = [...]), walk to it from another value of {name}, or look for another "
        f"period (period = {2 * period}): `gapwalk.settle` shows what the motion settles on"
    )


def _solved(equation: OrbitEquation, guess: NDArray[np.float64], newton: Newton | None) -> Orbit:
    """The orbit nearest to a guess, as finely resolved as it takes."""
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
    """The state at theta = 0 that a start stands for, shape (2n,)."""
    if not isinstance(start, str):
        return check_state(system, start)
    if start == "rest":
        return np.zeros(2 * system.size)
    if start == "settle":
        return settle(system, np.zeros(2 * system.size), period)
    raise ModelError(f'start is {start!r}; write "rest", "settle" or a state of {2 * system.size} numbers')


def settle(system: System, state: NDArray[np.float64], period: int = 1) -> NDArray[np.float64]:
    """Let the transient from a state die away, until it nearly repeats after `period` forcing periods."""
    flow, coefficients = flow_of(system), coefficients_of(system)
    for _ in range(max(1, _TRANSIENT // period)):
        following = flow.integrate(coefficients, state, 0.0, PERIOD * period).state
        if np.abs(following - state).max() <= _SETTLED * magnitude(following, system):
            return following
        state = following
    return state
