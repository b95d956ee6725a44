"""A zero of a function of arclength, bracketed with few evaluations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

# A zero is bracketed with few evaluations: each of them is a motion to be computed. The next place is that of the
# polynomial through the inverse function at up to five known places (Brent's method has three; R. P. Brent, Algorithms
# for Minimization without Derivatives, 1973, chapter 4). Where it does not converge, the bracket is halved.

EXACT = 1e-13
"""Arclength to which zeros are located."""
_RELATIVE = 1e-14  # the same as a share of the arclength, for those that are large
_SECANT = 1e-6  # arclength of a secant that tells how far a zero is
_SHARE_LEFT = 0.25  # share of `EXACT`, by the secant, at which a zero is reached
_PLACES = 5  # through which the inverse function is interpolated
_ATTEMPTS = 100  # evaluations; about 45 halve a step of a walk to rounding
_TINY = 1e-11  # length of steps that only rounding keeps from converging
_BEYOND = 4.0  # steps by which the next place lies beyond the zero then
_NARROWER, _AS_HIGH = 0.125, 0.5  # shares of the bracket, and of the values at its ends, by which a jump is seen

_Known = tuple[float, float]  # a place, and the value there


def zero_between(
    function: Callable[[float], float],
    low: float,
    high: float,
    beside: Mapping[float, float] | None = None,
    *,
    jumps: bool = True,
) -> tuple[float, bool]:
    """Return the zero of a function of arclength between two places where its signs differ.

    Brent's method spends its last evaluation on the other side of a zero that it has reached. Here a secant to a place
    nearby tells that it has.
    """
    a, b = (low, function(low)), (high, function(high))
    if not a[1] or not b[1]:
        return (a if not a[1] else b)[0], True
    known, last, before = [a, b, *(beside or {}).items()], b[0] - a[0], b[0] - a[0]
    best, narrow, sizes = min(a, b, key=_size), _NARROWER * (b[0] - a[0]), (_AS_HIGH * _size(a), _AS_HIGH * _size(b))
    for _ in range(_ATTEMPTS):
        width, least = b[0] - a[0], 0.5 * (EXACT + _RELATIVE * abs(best[0]))
        if width <= 2.0 * least:
            return best[0], True
        if not jumps and width < narrow and _size(a) > sizes[0] and _size(b) > sizes[1]:
            return best[0], False
        found = _interpolated(known, best)
        place = found if found is not None and a[0] < found < b[0] else math.inf
        step = place - best[0]
        other = b[0] if best is a else a[0]
        slow = abs(step) > 0.5 * abs(before)
        if abs(step) < least or (slow and abs(last) < _TINY):  # go a little beyond, for the bracket to close in
            step = math.copysign(max(least, slow * _BEYOND * abs(last)), other - best[0])
            place = best[0] + step
        if not a[0] < place < b[0] or (slow and not abs(step) <= _BEYOND * _TINY):
            place = 0.5 * (a[0] + b[0])
            step = last = place - best[0]
        before, last = last, step
        here = place, function(place)
        nearest = min(known, key=lambda each: abs(each[0] - place))
        away = abs(nearest[0] - place)
        if abs(here[1]) * away <= _SHARE_LEFT * EXACT * abs(here[1] - nearest[1]) and away <= _SECANT:
            return place, True
        known.append(here)
        a, b = (a, here) if (here[1] > 0.0) is (b[1] > 0.0) else (here, b)
        best = min(a, b, key=_size)
    return best[0], False


def _size(known: _Known) -> float:
    return abs(known[1])


def _interpolated(known: list[_Known], best: _Known) -> float | None:
    """Return the zero of the polynomial through the inverse function at known places; None if it has no inverse."""
    # The places are those nearest to the best one, as far as the function is monotone over them.
    chosen = [best]
    for each in sorted(known, key=lambda each: abs(each[0] - best[0])):
        if len(chosen) == _PLACES:
            break
        if each is best or each[0] == best[0]:
            continue
        trial = sorted([*chosen, each])
        signs = {after[1] > before[1] for before, after in pairwise(trial)}
        if len(signs) > 1 or len({value for _, value in trial}) < len(trial):
            break
        chosen.append(each)
    if len(chosen) < 2:
        return None
    # Neville's scheme at the value 0
    values, places = [value for _, value in chosen], [place - best[0] for place, _ in chosen]
    for order in range(1, len(chosen)):
        for i in range(len(chosen) - order):
            low, high = values[i], values[i + order]
            places[i] = (high * places[i] - low * places[i + 1]) / (high - low)
    return best[0] + places[0]
