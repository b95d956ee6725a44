"""After how many forcing periods a motion nearly returns: the periods that are worth a try."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BETTER = 0.5  # a longer period counts only if it returns nearer than the shorter ones, by this factor


class Recurrence(NamedTuple):
    """A number of forcing periods, and the distance to which the motion returns after them, relative to its size."""

    period: int
    distance: float


def recurrences(states: NDArray[np.float64], longest: int, near: float) -> list[Recurrence]:
    """Periods up to `longest` after which scaled strobes nearly return, each nearer than those before it.

    Parameters
    ----------
    states : shape (strobes, 2n)
        Strobes of the motion, divided by its size; the last of them count.
    longest
        The longest period; at most half of the strobes are compared.
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
