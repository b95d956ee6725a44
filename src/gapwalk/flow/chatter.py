"""Complete chatter: infinitely many impacts on a rigid stop that follow each other ever faster, summed at once.

After an impact the motion leaves the stop at a rate u, falls back, and leaves it at about r u, with the restitution r.
The states after all impacts still to come lie on a smooth curve S(m), of which the n-th is at ``m = r^n`` and the end,
where the motion has come to rest on the stop, at ``m = 0``. Over one flight from any point of this curve the state
changes by D(m), which the flights give, so the curve satisfies

    S(r m) - S(m) = D(m),     with S(1) known

for the angle, the positions, the rates along the stop, and ``u / m``. Term by term, with ``D = sum d_k m^k``, this is
the sum of geometric series, ``S(1) - S(0) = - sum d_k / (1 - r^k)``. The curve and its flights are polynomials through
Chebyshev nodes; the flights follow from the curve by integration, and the curve from the flights, in turn until
nothing changes. All of it accepts complex numbers, so derivatives are taken by a complex step.

Nordmark and Piiroinen (2009), Simulation and stability analysis of impacting systems with complete chattering,
Nonlinear Dynamics 58, 85-106.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

_ALONG, _WITHIN = 12, 10  # nodes along the curve, and within a flight
_FEWEST, _SWEEPS = 6, 30  # least and most repetitions; each adds more digits, the shorter the chatter is
_LOOK, _FAR = 4, 2.0  # repetition after which a chatter that is too long shows it, and by how much
_SETTLED = 1e-13  # change in a repetition, as a share of the motion, after which one more makes the rest rounding
_RESOLVED = 1e-12  # share of the last coefficients of accelerations; their errors enter times the length of the chatter

Array = NDArray[Any]


class Stop(NamedTuple):
    """A stop, with the motion between two impacts on it."""

    #: vector, push: Its deflection vector, and the accelerations by that force which accelerates the deflection by 1.
    vector: Array
    push: Array
    side: int  #: 1 or -1.
    restitution: Any  #: Share of the rate of its deflection that is left after an impact.
    #: Function of the angle: the first and second derivative over time of what is added to its deflection.
    sway: Callable[[Array], tuple[Any, Any]]
    turning: Callable[[Array, Array, Array], Array]  #: Function of angles, positions and velocities: the accelerations.
    pace: Any  #: Time of a radian.


class Chatter(NamedTuple):
    """The chatter after an impact, of one motion or of many (...)."""

    #: shape (..., along, 4n + 2): At the nodes of the curve: angle, positions, rates along the stop, rate away from it
    #: over m, and integrals over the angle, since the impact, of each position and of its square.
    curve: Array
    #: angles, positions, velocities: shape (..., along, within), (..., along, within, n): The flights that begin at the
    #: nodes.
    angles: Array
    positions: Array
    velocities: Array

    def impacts(self, restitution: float, shortest: float) -> tuple[Array, Array]:
        """Return angles of the impacts to come, and rates before them, until the rest of them takes a moment only."""
        curve = np.real(self.curve.reshape(-1, *self.curve.shape[-2:])[0])[:, [0, self.curve.shape[-1] // 2]]
        count = math.ceil(math.log(shortest / float(curve[-1, 0] - curve[0, 0])) / math.log(restitution))
        places = restitution ** np.arange(1.0, max(count, 1) + 1.0)
        angles, rates = (_weights(places) @ curve).T
        return angles, places * rates / restitution

    def after(self, stop: Stop, count: float = math.inf) -> tuple[Array, Array, Array]:
        """Return angle, state and integrals just after a number of impacts, or where the motion has come to rest."""
        place, half = np.asarray(stop.restitution**count if count < math.inf else 0.0), self.curve.shape[-1] // 2
        found = np.squeeze(_weights(place) @ self.curve, -2) if place else self.curve[..., -1, :]
        state = found[..., 1:half].copy()
        state[..., half // 2 :] -= stop.side * place * found[..., half : half + 1] * stop.push
        return found[..., 0], state, found[..., half + 1 :]


def sum_chatter(stop: Stop, theta: Array, q: Array, v: Array) -> Chatter | None:
    """Sum all impacts that follow one on a stop; None if they do not end, or not as smoothly as needed.

    Shapes: `theta`, `q`, `v` (...), (..., n), (..., n).
    """
    n, side = q.shape[-1], stop.side
    sums, own = _sums(complex(stop.restitution)), slice(2 * n + 1, 2 * n + 2)
    away = -side * (v @ stop.vector + stop.sway(theta)[0])[..., None]
    parts = theta[..., None], q, v + side * away * stop.push, away, np.zeros((*q.shape[:-1], 2 * n))
    start = np.concatenate(parts, axis=-1)[..., None, :]
    curve = np.repeat(start, _ALONG, axis=-2)
    turning = np.repeat(stop.turning(theta, q, v)[..., None, :], _ALONG, axis=-2)[..., None, :]
    turning, flight = np.repeat(turning, _WITHIN, axis=-2), 0.0 * curve[..., :1]
    last, angles, positions, velocities = math.inf, curve, curve, curve
    for number in range(_SWEEPS):
        angles = curve[..., :1] + flight / stop.pace * _WITHIN_NODES
        begin = curve[..., n + 1 : 2 * n + 1] - side * _ALONG_NODES[:, None] * curve[..., own] * stop.push
        velocities = begin[..., None, :] + flight[..., None] * (_RUNNING @ turning)
        positions = curve[..., None, 1 : n + 1] + flight[..., None] * (_RUNNING @ velocities)
        turning = stop.turning(angles, positions, velocities)
        pull = side * (turning @ stop.vector + stop.sway(angles)[1])
        late, whole = (pull @ _LATE)[..., None], (pull @ _WHOLE)[..., None]
        if not np.isfinite(late).all() or np.real(late).min() <= 0.0:
            return None
        rates = start[..., own] + sums @ (curve[..., own] * (whole / late - 2.0))  # first, as flights depend on them
        flight = _ALONG_NODES[:, None] * rates / late
        turn = flight / stop.pace
        changes = (
            turn,
            flight * (_WHOLE @ velocities),
            flight * (_WHOLE @ turning - side * whole * stop.push),
            0.0 * turn,
            turn * (_WHOLE @ positions),
            turn * (_WHOLE @ positions**2),
        )
        before, curve = curve, start + sums @ np.concatenate(changes, axis=-1)
        curve[..., own] = rates
        if number == _LOOK and not _is_resolved(turning, _FAR):
            return None
        if last <= _SETTLED:
            break
        if number >= _FEWEST:
            last = _change(curve - before, curve, n)
    if not last <= _SETTLED or not _is_resolved(turning):
        return None
    return Chatter(curve, angles, positions, velocities)


def _weights(places: Array) -> Array:
    """Return the weights of the values at the nodes in those at some places of the curve."""
    return chebyshev.chebvander(2.0 * places - 1.0, _ALONG - 1) @ _SPECTRUM_ALONG


def _is_resolved(turning: Array, times: float = 1.0) -> bool:
    """Return True if the last coefficients of accelerations at the nodes of all flights are as small as needed."""
    by_node = np.real(turning)
    spectra = _SPECTRUM_WITHIN @ by_node, _SPECTRUM_ALONG @ np.swapaxes(by_node, -3, -2)
    return all(np.abs(each[..., -2:, :]).max() <= times * _RESOLVED * np.abs(each).max() for each in spectra)


def _change(change: Array, curve: Array, n: int) -> float:
    """Return the largest change of angle, positions or rates as a share of their sizes; the same of derivatives."""
    count, kinds = 2 * n + 2, (0, 1, n + 1)
    both, moved = (each[..., :count].reshape(-1, _ALONG, count) for each in (curve, change))

    def largest(each: Array) -> Array:
        return np.maximum.reduceat(np.abs(each).max(axis=-2), kinds, axis=-1)

    whole, turns = largest(np.real(both)).max(axis=0), abs(both[0, 0, 0] - both[0, -1, 0])
    sizes = np.maximum((whole[0], max(whole[1], whole[2] * turns), whole[2]), np.finfo(float).tiny)
    found = 0.0
    for own, part in ((np.real(moved), np.real(both)), (np.imag(moved), np.imag(both))):
        most, all_of_it = ((largest(each) / sizes).max(axis=-1) for each in (own, part))
        found = max(found, float((most / np.where(most > 0.0, all_of_it, 1.0)).max()))
    return found if math.isfinite(found) else math.inf


@lru_cache(maxsize=16)
def _sums(restitution: complex) -> Array:
    """Return the matrix by which ``S(m) - S(1)`` at the nodes follows from ``S(r m) - S(m)``."""
    r = restitution if restitution.imag else restitution.real
    nodes = 2.0 * r * _ALONG_NODES - 1.0
    values = [np.ones_like(nodes), nodes]
    while len(values) < _ALONG:
        values.append(2.0 * nodes * values[-1] - values[-2])
    equations = np.stack(values, axis=-1) @ _SPECTRUM_ALONG - np.eye(_ALONG)
    equations[-1] = 0.0
    equations[-1, 0] = 1.0  # at m = 0 nothing changes; S(1) is known instead
    found = np.linalg.inv(equations)
    found[:, -1] = 0.0
    return found


def _places(count: int) -> Array:
    """Return Chebyshev nodes from 1 to 0."""
    return 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / (count - 1))


def _spectrum(nodes: Array) -> Array:
    """Return the matrix that takes values at nodes to coefficients of Chebyshev polynomials of 2 m - 1."""
    return np.linalg.inv(chebyshev.chebvander(2.0 * nodes - 1.0, len(nodes) - 1))


_ALONG_NODES, _WITHIN_NODES = _places(_ALONG), _places(_WITHIN)[::-1]
_SPECTRUM_ALONG, _SPECTRUM_WITHIN = _spectrum(_ALONG_NODES), _spectrum(_WITHIN_NODES)
# integrals within a flight: from its begin to each node, over all of it, and of the integral to each node over all
_RISING = [chebyshev.chebint(row, lbnd=-1, scl=0.5) for row in _SPECTRUM_WITHIN.T]
_RUNNING = np.array([chebyshev.chebval(2.0 * _WITHIN_NODES - 1.0, each) for each in _RISING]).T
_WHOLE = _RUNNING[-1]
_LATE = _WHOLE @ _RUNNING
