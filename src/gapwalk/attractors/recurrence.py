"""Recurrence of a motion: numbers of forcing periods after which it nearly returns, as candidates for its period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BETTER = 0.5  # a longer period counts only if its distance is smaller than the shorter ones' by this factor


class Recurrence(NamedTuple):
    """A number of forcing periods, and the distance of the motion from its start after them, relative to its size."""

    period: int
    distance: float


def recurrences(states: NDArray[np.float64], longest: int, near: float) -> list[Recurrence]:
    """Find periods up to `longest` after which scaled strobes nearly return, each nearer than those before it.

    Parameters
    ----------
    states : shape (strobes, 2n)
        Strobes of the motion, divided by its size; the last ones are compared.
    longest
        The longest period; at most half the number of strobes is used.
    near
        The distance below which a return counts.
    """
    found: list[Recurrence] = []
    best = np.inf
    for period in range(1, min(longest, len(states) // 2) + 1):
        recent = states[-2 * period :]
        distance = float(np.abs(recent[period:] - recent[:period]).max())
        if distance < near and distance < _BETTER * best:
            found.append(Recurrence(period, distance))
        best = min(best, distance)
    return found
