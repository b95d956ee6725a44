"""Continuation of an orbit to other parameter values on its branch, by small steps along the exact tangent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapwalk.errors import ConvergenceError, FlowError, ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.newton import Newton, solve
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.sensitivity import sensitivity
from gapwalk.orbit.shooting import Shooting

_NEWTON = Newton(iterations=6, halvings=0)  # from a good guess two or three iterations suffice
_ASTRAY = 0.35  # distance of the orbit from the guess, relative to the step, beyond which it may be on another branch
_CLOSE = 1e-7  # distance, relative to the state, below which the guess is the orbit
_SHORTEST = 1.0 / 16384  # smallest step, as a share of the whole change


def carry(orbit: Orbit, system: System, names: Sequence[str] = ()) -> Orbit:
    """Follow an orbit along a straight line in parameter space, and return the orbit of its branch at the other end.

    Parameters
    ----------
    orbit
        The orbit.
    system
        A system of the same structure, with the values at which the orbit is required.
    names
        Parameters that may differ; by default those that do. Many calls with the same names share one compiled flow.

    Raises
    ------
    ModelError
        If the two systems differ in structure, or in other parameters than those named.
    ConvergenceError
        If the branch does not extend that far, because it turns back at a fold or crosses another one; the message says
        how far it could be followed.
    """
    origin = orbit.system
    if system.structure != origin.structure:
        raise ModelError("an orbit can be followed only to other parameter values of its own system")
    known = origin.structure.names
    differing = [known[place] for place in np.flatnonzero(origin.values != system.values).tolist()]
    names = list(names) or differing
    if not set(differing) <= set(names):
        raise ModelError(f"the systems differ by {', '.join(differing)}, but only {', '.join(names)} may change")
    change = np.array([system[name] - origin[name] for name in names])
    share, step = 0.0, 1.0
    while share < 1.0:
        step = min(step, 1.0 - share)
        target = system if share + step == 1.0 else _between(origin, system, share + step)
        try:
            orbit, share, step = _step(orbit, target, names, change * step), share + step, 1.5 * step
        except NumericalError:
            step *= 0.5
        if step < _SHORTEST and share < 1.0:
            where = ", ".join(f"{name} = {orbit.system[name]:.6g}" for name in names)
            raise ConvergenceError(
                f"the orbit was lost on the way: its branch could be followed only up to {where}. Call `follow` along "
                "one of the parameters to see why: there may be a fold, at which it turns back"
            )
    return orbit


def _step(orbit: Orbit, target: System, names: list[str], change) -> Orbit:
    """Take one step along the tangent and correct its end; refuse it if the correction leads elsewhere."""
    moved = sensitivity(orbit, names).state @ change
    equation = Shooting().pose(target, None, orbit.period)
    try:
        state, evaluation = solve(equation, orbit.state + moved, 0.0, _NEWTON)
    except FlowError as error:
        raise ConvergenceError(str(error)) from error
    # positions and velocities have equal weight when measured over theta
    unit = np.repeat([1.0, 1.0 / target.frequency], target.size)
    missed = np.linalg.norm(unit * (state - orbit.state - moved))
    if missed > _ASTRAY * np.linalg.norm(unit * moved) + _CLOSE * np.linalg.norm(unit * state):
        raise ConvergenceError("the next orbit lies far from the tangent; the branch bends sharply here, or has a fold")
    return equation.orbit(state, 0.0, evaluation)


def _between(first: System, second: System, share: float) -> System:
    return System.from_values(first.structure, (1.0 - share) * first.values + share * second.values)
