"""Samples of the guards of events within a step of an integration: which of them pass below zero, and where first.

A guard is sampled at some shares of the step. Where it is positive at all of them, it may still dip below zero between
two, as at a touch that is shorter than a tenth of the step. So a smallest sample between two larger ones is looked at
more closely, until a parabola through the three stays well above zero. Where it is near zero, that is done with exact
values, since samples are interpolated.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.verification.dry_equations import Key

FIRES = 1e-11
"""Share of its scale by which a guard is beyond zero once it has changed its sign."""

# dense at both ends: a dip just before the end of a step would otherwise be between two steps, and in neither
_SHARES = np.concatenate(
    ([0.0], 0.5 ** np.arange(28.0, 4.0, -4.0), np.arange(1, 8) / 8.0, 1.0 - 0.5 ** np.array([8.0, 20.0]), [1.0])
)
_CLOSER = 8  # parts of an interval that is looked at more closely
_DEEPEST = 6  # times that it is
_ROUGH = 1e-2  # share of its scale by which an interpolated sample of a guard may be off
_CLEAR = 0.5  # share of its smallest sample above which the parabola is clear of zero

Array = NDArray[np.float64]
Found = TypeVar("Found")
Search = Generator[tuple[Array, Key | None], Any, Found]


def brackets() -> Search[dict[Key, tuple[float, Array]]]:
    """Find the guards that pass below zero in a step, each with a share of the step before that, and all those after.

    It is a generator. It yields increasing shares of the step, from 0 to 1, and None, and is sent the interpolated
    values of each guard; or it yields shares and the key of a guard, and is sent its exact values, which may take long.
    """
    found = {}
    for key, values in (yield _SHARES, None).items():
        shares = _SHARES
        below = np.flatnonzero(values[1:] < -FIRES) + 1
        if not len(below):
            shares, values = yield from _dip(key, shares, values)
            below = np.flatnonzero(values < -FIRES)
        if len(below):
            above = np.flatnonzero(values[: below[0]] > FIRES)
            found[key] = (float(shares[above[-1]]) if len(above) else 0.0, shares[below])
    return found


def _dip(key: Key, shares: Array, values: Array) -> Search[tuple[Array, Array]]:
    """Return samples near a dip of a guard below zero, or no samples."""
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:])) + 1
    for place in inner:
        near, seen = shares[place - 1 : place + 2], values[place - 1 : place + 2]
        known = False
        for _ in range(_DEEPEST):
            is_rough = seen[1] < _ROUGH
            if (known or not is_rough) and _lowest(near, seen) > _CLEAR * seen[1]:
                break
            closer, known = np.linspace(near[0], near[2], _CLOSER + 1), is_rough
            again = (yield closer, key) if is_rough else (yield closer, None)[key]
            if again.min() < -FIRES:
                return closer, again
            middle = int(np.clip(np.argmin(again), 1, _CLOSER - 1))
            near, seen = closer[middle - 1 : middle + 2], again[middle - 1 : middle + 2]
    return shares[:0], values[:0]


def _lowest(shares: Array, values: Array) -> float:
    """Return the lowest value of the parabola through three points, of which the middle one is the lowest."""
    left, right = ((values[k] - values[1]) / (shares[k] - shares[1]) for k in (0, 2))
    bend = (right - left) / (shares[2] - shares[0])
    slope = left + bend * (shares[1] - shares[0])
    return float(values[1] - (0.25 * slope**2 / bend if bend > 0.0 else 0.0))
