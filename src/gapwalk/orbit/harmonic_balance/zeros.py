"""Zeros of many functions of the angle at once, by Newton's method within brackets on a grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array, NDArray[np.intp]], tuple[Array, Array]]
"""It has angles, and the number of the bracket or interval of each; it returns values and slopes."""

ASIDE = 1e-6
"""Radians to another angle, for a rough second derivative."""

_ITERATIONS = 60  # bisection alone would need about 50; Newton's method takes 4
_TOLERANCE = 2e-15


def zeros_on(
    function: Function, phi: Array, which: NDArray[np.intp], opens: NDArray[np.bool_]
) -> tuple[list[int], list[float]]:
    """Return the zeros of a function between neighbouring points, each after the number of the point before it.

    Two zeros between two points are found, too, if the slopes there point to an extremum beyond zero.
    """
    value, slope = function(phi, which)
    above, cells = value > 0.0, np.flatnonzero(opens)
    changes = cells[above[cells] != above[cells + 1]]
    same = cells[above[cells] == above[cells + 1]]
    side, width = np.where(above[same], 1.0, -1.0), phi[same + 1] - phi[same]
    dips = (side * slope[same] < 0.0) & (side * slope[same + 1] > 0.0)
    dips &= np.minimum(abs(value[same]), abs(value[same + 1])) < width * np.maximum(
        abs(slope[same]), abs(slope[same + 1])
    )
    same, side = same[dips], side[dips]
    low, high, numbers = phi[changes], phi[changes + 1], changes
    if len(same):
        pieces = which[same]

        def turned(phi: Array, each: NDArray[np.intp]) -> tuple[Array, Array]:
            now = function(phi, pieces[each])[1]
            return now, (function(phi + ASIDE, pieces[each])[1] - now) / ASIDE

        middle = roots(turned, phi[same], phi[same + 1])
        beyond = side * function(middle, pieces)[0] < 0.0
        same, middle = same[beyond], middle[beyond]
        low, high = np.concatenate((low, phi[same], middle)), np.concatenate((high, middle, phi[same + 1]))
        numbers = np.concatenate((changes, same, same))
    found = roots(lambda phi, each: function(phi, which[numbers[each]]), low, high)
    return numbers.tolist(), found.tolist()


def roots(function: Function, low: Array, high: Array) -> Array:
    """Return a zero of a function between each two angles at which its signs differ, all at once.

    By Newton's method, or bisection where that leaves the bracket. The function has angles with the numbers of their
    brackets, and returns its values and its slopes, which may be rough.
    """
    if not len(low):
        return low
    low, high, each = low.copy(), high.copy(), np.arange(len(low))
    rises = function(high, each)[0] > 0.0
    found = 0.5 * (low + high)
    phi = found.copy()
    for _ in range(_ITERATIONS):
        value, slope = function(phi, each)
        above = (value > 0.0) == rises[each]
        high[each[above]], low[each[~above]] = phi[above], phi[~above]
        with np.errstate(all="ignore"):
            following = phi - value / slope
        inside = (following >= low[each]) & (following <= high[each])
        following = np.where(inside, following, 0.5 * (low[each] + high[each]))
        found[each] = following
        going = np.abs(following - phi) > _TOLERANCE
        if not going.any():
            break
        each, phi = each[going], following[going]
    return found
