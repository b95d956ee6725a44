"""Transients that are let die away, for as long as it takes: whether one has settled is seen from its returns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, Flow

_GROWTH = 1.25  # of the length of a transient from one look at it to the next
_STEADY = 0.1  # change of the logarithm of the returns up to which they neither shrink nor grow
_WILD = 0.6  # spread of the logarithm of returns from which they are those of chaos
_EVIDENCE = 192  # forcing periods that it takes to see that; a shorter look may mistake a slow decay for chaos
_FINEST = 1e-10  # returns that are as good as exact
_LARGE = 1e-3  # steady returns smaller than that may be those of a very slow approach to a periodic motion


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a transient is followed.

    Parameters
    ----------
    shortest, longest
        Forcing periods at least and at most.
    tolerance
        Distance from the periodic motion that it comes to, at which it has settled; in half-widths of the box of
        states.
    """

    shortest: int = 48
    longest: int = 2000
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("shortest", "longest"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 1 (forcing periods of a transient)")
        if self.longest < self.shortest:
            raise ModelError(f"longest is {self.longest}; it must be at least {self.shortest}, the shortest transient")
        if not 1e-12 <= self.tolerance <= 1e-2:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-12 and 1e-2 (half-widths)")


class Settled(NamedTuple):
    """What has become of a transient.

    Attributes
    ----------
    state : shape (2n,)
        Its last state.
    periods
        Forcing periods that it took.
    is_settled
        False if it was still changing when the patience ended.
    """

    state: NDArray[np.float64]
    periods: int
    is_settled: bool


def let_settle(
    flow: Flow,
    coefficients: NDArray[np.float64],
    state: NDArray[np.float64],
    box: NDArray[np.float64],
    max_period: int,
    patience: Patience,
) -> Settled:
    """Follow the transient from a state until it has settled.

    It has if its returns after m forcing periods, for one m up to `max_period`, shrink towards a motion that is closer
    than the tolerance; or if no returns shrink or grow any more, and it does not repeat: it is then on a torus or
    chaotic. Returns that grow are those of a motion that leaves an unstable one.

    Parameters
    ----------
    flow, coefficients
        What moves.
    state : shape (2n,)
        Where it begins, at theta = 0.
    box : shape (2n,)
        Half-widths of the box of states: the unit of all distances.
    max_period
        Longest period, in forcing periods, for which a return is looked for.
    patience
        How long to follow it.

    Raises
    ------
    FlowError
        If the motion runs away or chatters without end.
    """
    states, length = np.asarray(state, dtype=float)[None, :], max(patience.shortest, 2 * max_period + 8)
    length = min(length, patience.longest)
    while True:
        more = length - (len(states) - 1)
        path, _ = flow.sample(coefficients, states[-1], PERIOD * np.arange(more + 1.0))
        states = np.vstack((states, path[1:]))
        if has_settled(states / box, max_period, patience.tolerance):
            return Settled(states[-1], length, True)
        if length >= patience.longest:
            return Settled(states[-1], length, False)
        length = min(math.ceil(_GROWTH * length), patience.longest)


def has_settled(states: NDArray[np.float64], max_period: int, tolerance: float) -> bool:
    """Whether the returns of a path, of shape (periods + 1, 2n), say that it has settled; see `let_settle`."""
    window = (len(states) - 1 - max_period) // 3  # what is older is not looked at
    if window < 2:
        return False
    last = np.arange(len(states) - 2 * window, len(states))
    returns = np.array([np.abs(states[last] - states[last - m]).max(axis=1) for m in range(1, max_period + 1)])
    m = int(np.argmin(np.median(returns, axis=1))) + 1
    if returns[m - 1, window:].max() <= _FINEST:
        return True
    logs = np.log(np.maximum(returns[m - 1], _FINEST * _FINEST))
    early, late = logs[:window], logs[window:]
    change = float(late.mean() - early.mean())
    spread = math.sqrt(0.5 * (early.var() + late.var()))
    # chaotic returns vary by themselves, and the more, the less their mean says; a decay, though it may swing, does not
    least = max(_STEADY, 2.0 * spread * math.sqrt(2.0 * m / window)) if spread > _WILD else _STEADY
    if change < -least:
        # a geometric series: each return is the one before, m forcing periods ago, times this
        shrinks = math.exp(change * m / window)
        return bool(np.median(returns[m - 1, window:]) * shrinks / (1.0 - shrinks) <= tolerance)
    return bool(change <= least and np.median(returns[m - 1, window:]) >= _LARGE and len(states) > _EVIDENCE)
