"""Further starts for an orbit if the end of a transient leads to none, since an unstable orbit attracts nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import NumericalError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.carry_orbit import carry
from gapwalk.orbit.orbit import Orbit

_STROBES = 64  # number of orbit periods of the settled motion that are sampled
_NEAREST = 4  # number of its states that are tried
_RATIOS = (1.25, 0.8, 1.6, 0.625, 2.5, 0.4)  # of the frequency at which an orbit is sought and followed from there

Starts = Iterator[tuple[str, Callable[[], NDArray[np.float64]]]]


def other_starts(
    system: System, period: int, settled: NDArray[np.float64] | None, find: Callable[[System], Orbit]
) -> Starts:
    """Yield states near which an orbit may be, the cheapest first: a description of each, and a function for it.

    If the orbit is unstable, the motion settles on another one around it, or on chaos. Such motions come near the orbit
    now and then, and it lies near their mean. Otherwise it is found at a frequency at which it is stable, and followed
    to this one.

    Parameters
    ----------
    system
        The system.
    period
        m: forcing periods after which the orbit repeats.
    settled
        End of the transient from rest; None if it diverges.
    find
        Function that finds an orbit of another system by a transient, or raises a `NumericalError`.
    """
    if settled is not None:
        states = _strobes(system, period, settled)
        if states is not None:
            nearest = np.argsort(np.linalg.norm(np.diff(states, axis=0), axis=1))[:_NEAREST]
            yield from (("states that nearly repeat", lambda state=state: state) for state in states[nearest])
            yield "their mean", lambda: states.mean(axis=0)
    yield "rest", lambda: np.zeros(2 * system.size)
    name = system.structure.names[0]
    for ratio in _RATIOS:
        other = system.at({name: ratio * system[name]})
        yield f"{name} {other[name]:.4g}", lambda other=other: carry(find(other), system, [name]).state
    if system.structure.contacts:
        yield "harmonic balance", lambda: _balanced(system, period)


def _strobes(system: System, period: int, state: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return states of a motion at intervals of an orbit's period, shape (_STROBES, 2n); None if it diverges."""
    flow, coefficients, states = flow_of(system), coefficients_of(system), [state]
    try:
        for _ in range(_STROBES - 1):
            states.append(flow.integrate(coefficients, states[-1], 0.0, PERIOD * period).state)
    except NumericalError:
        return None
    return np.array(states)


def _balanced(system: System, period: int) -> NDArray[np.float64]:
    """Return the state of an orbit by harmonic balance, with rest as the start."""
    from gapwalk.orbit.harmonic_balance import Balance  # imported late: slow to import, and rarely needed
    from gapwalk.orbit.newton import solve

    equation = Balance(harmonics=10).pose(system, None, period)
    unknowns, evaluation = solve(equation, equation.start(np.zeros(2 * system.size)), 0.0)
    return equation.orbit(unknowns, 0.0, evaluation).state
