"""Special points of piecewise linear systems with 80-bit numbers: exact flights between events at unknown angles.

The sequence of modes is that of the motion that gapwalk found. Each flight is the exponential of a matrix, so the
equations of a special point are smooth: the motion repeats, each event is where it must be, and what defines the point
is zero. Newton's method needs their values in 80 bits, and a Jacobian in 64.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

LONG = np.longdouble
TURN = 2 * LONG("3.14159265358979323846264338327950288")
_TERMS, _SMALL = 22, 0.5
_ROUNDS, _ENDS, _SAME, _NEAR = 12, 1e-17, 1e-15, 1e-3


class Mark(NamedTuple):
    """An event, or a touch: its angle, rows whose products with the extended state are zero there, the mode after it.

    At a touch the rate of the first row is zero too.
    """

    angle: float
    rows: np.ndarray
    mode: Any
    touches: bool = False


def exponential(matrix: np.ndarray) -> np.ndarray:
    """Return the exponential of a matrix by its series, with scaling and squaring."""
    squarings = max(0, int(np.ceil(np.log2(float(np.abs(matrix).sum(axis=1).max()) / _SMALL + 1e-300))))
    small = matrix / LONG(2) ** squarings
    total = term = np.eye(len(matrix), dtype=LONG)
    for order in range(1, _TERMS):
        term = term @ small / LONG(order)
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return total


def located(
    generator: Callable[[Any, np.longdouble], np.ndarray],
    marks: Sequence[Mark],
    turns: int,
    state: np.ndarray,
    pace: float,
    defining: Callable[[np.ndarray], np.longdouble] | None = None,
) -> np.longdouble:
    """Return the frequency of a special point with 80 bits; nan if Newton's method does not end near.

    Parameters
    ----------
    generator
        Matrix of the extended state (positions, velocities, cos W t, sin W t, 1) in a mode at a frequency.
    marks
        Events in order; the last mode is that at the start.
    turns, state, pace
        Period of the motion in those of the load, its state at the start, the frequency found.
    defining
        A function of the monodromy matrix that is zero; None if the marks define the point.
    """
    size = len(state)

    def equations(u: np.ndarray) -> np.ndarray:
        y = np.concatenate((u[:size], [LONG(1), LONG(0), LONG(1)]))
        whole, here, mode, rest = np.eye(size + 3, dtype=LONG), LONG(0), marks[-1].mode if marks else None, []
        ends = [*zip(u[size:-1], marks, strict=True), (TURN * turns, None)]
        for angle, mark in ends:
            matrix = generator(mode, u[-1])
            flight = exponential(matrix * ((angle - here) / u[-1]))
            y, whole, here = flight @ y, flight @ whole, angle
            if mark is not None:
                rest += [*(mark.rows @ y), *([mark.rows[0] @ matrix @ y] if mark.touches else [])]
                mode = mark.mode
        last = [] if defining is None else [defining(whole[:size, :size])]
        return np.array([*(y[:size] - u[:size]), *rest, *last])

    u = np.array([*state, *(mark.angle for mark in marks), pace], dtype=LONG)
    start, step = u.copy(), np.inf
    for _ in range(_ROUNDS):
        value, sizes = equations(u), LONG(1e-9) * np.maximum(1, np.abs(u))
        columns = [(equations(u + way) - value) / size for way, size in zip(np.diag(sizes), sizes, strict=True)]
        # at a branch point one direction, in which the symmetry is lost, is free: it is left as it is
        move = np.linalg.lstsq(np.array(columns).T.astype(float), -value.astype(float), rcond=1e-10)[0]
        u, step = u + move, float(np.abs(move).max())
        if step < _ENDS * max(1.0, float(np.abs(u).max())):
            break
    is_near = float(np.abs(u - start)[:size].max()) < _NEAR
    return u[-1] if step < _SAME and is_near else LONG(np.nan)
