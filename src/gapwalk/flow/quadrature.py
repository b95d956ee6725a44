"""A motion at the nodes of Gauss's rule, for integrals along it that are accurate to rounding.

The motion is analytic between its events: crossings of breakpoints, impacts, beginnings of slip and stick, kinks of
laws and jumps of loads. Intervals of Gauss's rule end at all of them.
"""

from __future__ import annotations

from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD, Restarts, flow_of
from gapwalk.flow.motion import Motion, sample
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System

_ORDER = 12  # nodes in each interval
_WIDEST = PERIOD / 32  # largest width of an interval
_PER_STEP = 0.5  # the same, as a share of the mean Taylor step of the flow
_LOGS = tuple(map(attrgetter, ("contacts", "slips", "holds", "impacts")))
_NARROWEST = 1e-9  # narrower intervals between events are omitted


class Quadrature(NamedTuple):
    """A motion at the nodes of Gauss's rule."""

    motion: Motion  #: The motion; its samples are the nodes, and its events the crossings of breakpoints.
    #: shape (nodes,): Weights of the nodes over time (not theta); their sum is the duration of the motion.
    weights: NDArray[np.float64]


def quadrature(system: System, state: NDArray[np.float64], periods: int, restarts: Restarts = ()) -> Quadrature:
    """Integrate the motion from a state at theta = 0 and sample it at Gauss nodes over some forcing periods.

    At the angles of `restarts` the motion continues from their states.
    """
    end = PERIOD * periods
    flow, coefficients = flow_of(system), coefficients_of(system)
    parts = pairwise([(0.0, state), *restarts, (end, state)])
    arcs = [flow.integrate(coefficients, own, start, stop, sums=False) for (start, own), (stop, _) in parts]
    logs = [[each for arc in arcs for each in log(arc)] for log in _LOGS]
    changes = [each.theta for log in logs[:3] for each in log]
    kinks = flow.kinks(coefficients, state, end)  # and jumps: it is not analytic there either
    widest = min(_WIDEST, _PER_STEP * end / sum(arc.steps for arc in arcs))  # fast vibrations take short steps
    edges = np.unique(np.concatenate(([0.0], changes, kinks, [end])))
    edges = edges[np.concatenate(([True], np.diff(edges) > _NARROWEST))]
    parts = [np.linspace(a, b, 1 + int(np.ceil((b - a) / widest)))[:-1] for a, b in pairwise(edges)]
    starts = np.concatenate(parts)
    widths = np.diff(np.append(starts, end))
    nodes, weights = leggauss(_ORDER)
    thetas = (starts[:, None] + 0.5 * widths[:, None] * (nodes + 1.0)).ravel()
    found = sample(system, state, np.concatenate(([0.0], thetas)), restarts)
    motion = Motion.of(system, thetas, found.states[1:], *logs)
    return Quadrature(motion, (0.5 * widths[:, None] * weights).ravel() / system.frequency)
