"""Statements of the paper on its method, in its conclusions (section 7)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import Finding, claim
from reproductions.padmanabhan_singh_1995.quantities import Array, main_branch

_PLACES = 25  # orbits at which Broyden's method is tried
_NUDGE = 0.05  # relative distance of its start from the orbit
_STEP = 1e-6  # of the differences
_STEPS, _SMALL = 60, 1e-9  # its steps at most, and the residual at which it ends


@claim("summary-newton", "Quasi-Newton methods approximate the Jacobian too badly to judge stability.", "13")
def _quasi_newton(result: gw.Result) -> Finding:
    """Broyden's method on figure 13, with the exact Jacobian of one orbit as the first guess for the next."""
    branch = main_branch(result)
    points = [branch.points[i] for i in np.linspace(0, len(branch.points) - 1, _PLACES + 1).astype(int)]
    apart, wrong, failed = [], [], 0
    for before, point in pairwise(points):
        jacobian = _broyden(point.orbit, _monodromy(before.orbit) - np.eye(4))
        if jacobian is None:
            failed += 1
            continue
        found = float(np.abs(np.linalg.eigvals(jacobian + np.eye(4))).max())
        exact = float(np.abs(point.orbit.multipliers).max())
        apart.append(abs(found - exact))
        wrong += [f"{found:.3f} for {exact:.3f}"] if (found - 1.0) * (exact - 1.0) < 0.0 else []
    return Finding(
        bool(wrong),
        f"stability wrong at {len(wrong)} of {len(apart)} orbits ({', '.join(wrong)}), median error "
        f"{np.median(apart):.2g}",
        f"it does not converge at {failed} more" if failed else "",
        short=f"wrong at {len(wrong)} of {len(apart)}" if len(wrong) < 0.5 * len(apart) else "",
    )


def _monodromy(orbit: gw.Orbit) -> Array:
    """The Jacobian of the map over one period, by differences."""
    steps = _STEP * np.eye(len(orbit.state))
    ends = [[_after(orbit.system, orbit.state + sign * step) for sign in (1, -1)] for step in steps]
    return np.array([(one - two) / (2.0 * _STEP) for one, two in ends]).T


def _after(system: gw.System, state: Array) -> Array:
    motion = gw.integrate(system, state, 1, 1)
    return motion.states[-1]


def _broyden(orbit: gw.Orbit, jacobian: Array) -> Array | None:
    """Return the Jacobian with which Broyden's method ends; None if it does not converge."""

    def residual(state: Array) -> Array:
        return _after(orbit.system, state) - state

    state = orbit.state * (1.0 + _NUDGE)
    value = residual(state)
    for _ in range(_STEPS):
        step = -np.linalg.solve(jacobian, value)
        state = state + step
        after = residual(state)
        jacobian = jacobian + np.outer(after - value - jacobian @ step, step) / (step @ step)
        value = after
        if np.abs(value).max() < _SMALL:
            return jacobian
        if not np.isfinite(value).all() or np.abs(state).max() > 1e3:
            return None
    return None


@claim("summary-dimension", "The number of equations grows tremendously with the dimension, by those of the Jacobian.")
def _dimension() -> Finding:
    """With n first-order equations the Jacobian has n^2 more; a chain of 50 masses with a stop is beyond that limit."""
    count = 50
    small, large = (n + n * n for n in (4, 2 * count))
    springs = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    chain = gw.System(
        [f"x{i}" for i in range(1, count + 1)],
        mass=np.eye(count),
        damping=0.05 * springs,
        stiffness=springs,
        contacts=[gw.stop("stop", {"x1": 1.0}, 0.2, 5.0)],
        harmonics=[gw.Harmonic(0.6, {"x1": 1.0})],
        frequency=0.9,
    )
    orbit = gw.find_orbit(chain)
    return Finding(
        large > 100 * small,
        f"n + n² = {small} for n = 4, {large} for {count} masses",
        f"no limit today: an orbit of {count} masses (contacts {orbit.pattern}) has its {len(orbit.multipliers)} "
        "multipliers, by exact transition matrices",
    )
