"""Accurate integrals along a motion: it is analytic between contact events, so Gauss's rule converges to rounding."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.motion import Motion, sample
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

_ORDER = 12  # nodes in each interval
_WIDEST = PERIOD / 32  # largest width of an interval
_NARROWEST = 1e-9  # narrower intervals between events are omitted


class Quadrature(NamedTuple):
    """A motion at the nodes of Gauss's rule.

    Attributes
    ----------
    motion
        The motion; its samples are the nodes, and its events the crossings of breakpoints.
    weights : shape (nodes,)
        Weights of the nodes over time (not theta); their sum is the duration of the motion.
    """

    motion: Motion
    weights: NDArray[np.float64]


def quadrature(system: System, state: NDArray[np.float64], periods: int) -> Quadrature:
    """Integrate the motion from a state at theta = 0 and sample it at Gauss nodes over some forcing periods."""
    end = PERIOD * periods
    events = sample(system, state, np.array([0.0, end])).events
    edges = np.unique(np.concatenate(([0.0], [event.theta for event in events], [end])))
    edges = edges[np.concatenate(([True], np.diff(edges) > _NARROWEST))]
    parts = [np.linspace(a, b, 1 + int(np.ceil((b - a) / _WIDEST)))[:-1] for a, b in pairwise(edges)]
    starts = np.concatenate(parts)
    widths = np.diff(np.append(starts, end))
    nodes, weights = leggauss(_ORDER)
    thetas = (starts[:, None] + 0.5 * widths[:, None] * (nodes + 1.0)).ravel()
    integrated = sample(system, state, np.concatenate(([0.0], thetas)))
    motion = Motion(system, thetas, integrated.q[1:], integrated.v[1:], events)
    return Quadrature(motion, (0.5 * widths[:, None] * weights).ravel() / system.frequency)


def largest(along: Quadrature, nodes: NDArray[np.intp], function: Callable[[Motion], NDArray[np.float64]]) -> float:
    """Find the largest value of a function of the motion near some successive nodes, refined on the exact flow.

    Parameters
    ----------
    along
        The motion.
    nodes
        Indices of the nodes among which the maximum is sought; for none the result is 0.
    function
        A function that returns its values, shape (samples,), for a motion.
    """
    from scipy.optimize import minimize_scalar  # imported late: it takes long

    if not len(nodes):
        return 0.0
    motion = along.motion
    values = function(motion)[nodes]
    best = int(np.argmax(values))
    if not 0 < best < len(nodes) - 1:
        return float(values[best])
    before, after = nodes[best - 1], nodes[best + 1]
    flow, coefficients, n = flow_of(motion.system), coefficients_of(motion.system), motion.system.size
    state = np.concatenate((motion.q[before], motion.v[before]))
    start, stop = float(motion.theta[before]), float(motion.theta[after])

    def negative(theta: float) -> float:
        at = flow.integrate(coefficients, state, start, theta).state
        return -float(function(Motion(motion.system, np.array([theta]), at[None, :n], at[None, n:], ()))[0])

    found = minimize_scalar(negative, bounds=(start, stop), method="bounded", options={"xatol": 1e-6})
    return max(-float(found.fun), float(values[best]))
