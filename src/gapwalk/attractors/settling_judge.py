"""The judge of settled motions: it decides from strobes whether a motion has settled, and which period it has.

Transients of single motions, sweeps and regime maps ask this one judge. A motion settles on an orbit if its returns
after m forcing periods shrink like a geometric series whose sum is small. Any other motion has settled if its nearest
returns neither shrink nor grow, and its averages no longer change.

Method: docs/numerics/attractors.md
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.lyapunov import birkhoff_mean, birkhoff_spread
from gapwalk.attractors.section import size_of
from gapwalk.model.system import System


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the judge. Distances are relative to the unit of the strobes, such as the size of the motion."""

    #: Distance still to go, below which a motion counts as periodic; the strobes of a settled motion repeat within it.
    #: It is the error of the batch integrator, and below what a figure shows.
    arrived: float = 1e-4
    #: Change over one return, below which that return may give the period. A chaotic motion that passes an unstable
    #: orbit shrinks towards it for a while; it seldom comes so near.
    returned: float = 1e-6
    rounding: float = 1e-11  #: Change over one return, below which only rounding is left; the flow repeats to 1e-13.
    #: Ratio by which all shorter returns must exceed the distance still to go, or else the period may be shorter:
    #: before it arrives, a spiral also returns by chance after longer times.
    clear: float = 1e3
    #: Size of a return, from which it may be that of a torus or of chaos. Smaller returns need no evidence against
    #: their scatter before they count as shrinking.
    large: float = 1e-3
    #: Decrease of the mean logarithm of large returns from one window to the next, from which they shrink.
    decay: float = 0.1
    #: Standard deviation of these logarithms, from which they are those of chaos: these vary by themselves, so the
    #: decrease must exceed two standard errors.
    scatter: float = 0.6
    #: Number of strobes above which a motion without period may have settled; averages are over their later half.
    evidence: int = 192
    #: Distance of return, below which an orbit of that period is searched for by Newton's method.
    promising: float = 0.05
    #: Distance of return, relative to the spread of the strobes, that no torus and no chaos reaches.
    exact: float = 1e-6
    #: A longer period counts only if its distance of return is smaller than those of shorter ones by this factor.
    better: float = 0.5
    #: Numbers of blocks, and the allowed trend over them in standard errors. Few long blocks show the slow decay of a
    #: torus, because its weighted averages are then sharp; but errors from few blocks are themselves uncertain.
    trends: tuple[tuple[int, float], ...] = ((16, 4.5), (8, 6.0), (5, 12.0))
    #: Weight of the remainder after a nearest return: it may change by a hundred times the tolerance.
    small: float = 0.01
    #: Spread of weighted averages, relative to the signal's deviation, above which a motion is chaotic.
    irregular: float = 1e-3


TOLERANCES = Tolerances()
"""The tolerances with which every motion is judged."""

_NOTHING = 1e-20  # square of a difference that is only rounding


class Returns(NamedTuple):
    """The convergence of many motions, from their returns."""

    #: shape (count,): Distance that each motion still has to go to the orbit that it approaches; inf if its returns do
    #: not shrink.
    missing: NDArray[np.float64]
    #: shape (count,): Number of forcing periods after which it repeats there; 0 if that is not certain yet.
    periods: NDArray[np.int_]
    #: shape (count,), bool: True if the nearest returns neither shrink nor grow, and are as large as those of a torus
    #: or of chaos; or if they are exact.
    steady: NDArray[np.bool_]


def judge_returns(track: NDArray[np.float64], longest: int) -> Returns:
    """Judge motions by their returns after up to `longest` forcing periods.

    If returns shrink by a factor g each time, a motion still has to go ``r g / (1 - g)`` after the return r: a slow
    transient near a fold returns just as closely as a fast one, but each time with the same error. The factor is
    that between two windows at the end of the track, each a third of the track long.

    Shapes: `track` (strobes, count, state_size).
    """
    length, count, limits = len(track) - 1, track.shape[1], TOLERANCES
    longest = min(longest, length // 3)
    if not longest:
        return Returns(np.full(count, np.inf), np.zeros(count, dtype=int), np.zeros(count, dtype=bool))
    m = np.arange(1, longest + 1)
    windows = m * np.maximum(1, (length - longest) // 3 // m)  # whole returns: strobes of an orbit differ in size
    means, squares = np.empty((2, longest, 2, count))
    for row, (period, window) in enumerate(zip(m.tolist(), windows.tolist(), strict=True)):
        returns = np.abs(track[-2 * window :] - track[-2 * window - period : -period]).max(axis=2)
        logs = np.log(np.maximum(returns, limits.rounding**2)).reshape(2, window, count)
        means[row], squares[row] = logs.mean(axis=1), (logs * logs).mean(axis=1)
    change, last = means[:, 1] - means[:, 0], np.exp(means[:, 1])
    scatter = np.sqrt(np.maximum(squares - means**2, 0.0).mean(axis=1))
    error = np.where(scatter > limits.scatter, 2.0 * scatter * np.sqrt(2.0 * m / windows)[:, None], 0.0)
    least = np.maximum(limits.decay, error)
    is_large = last >= limits.large
    # returns of tori and of chaos shrink by chance, but they are large
    shrinks = change < np.where(is_large, -least, 0.0)
    fall = np.where(shrinks, change, -1.0)
    ratio = np.exp(fall * (m / windows)[:, None])
    # `last` belongs to the middle of the later window; half a window later is the end of the track
    missing = np.where(shrinks, last * np.exp(0.5 * fall) * ratio / (1.0 - ratio), np.inf)
    missing[last <= limits.rounding] = limits.rounding
    shorter = np.minimum.accumulate(np.vstack((np.full((1, count), np.inf), last[:-1])))
    is_period = (last <= limits.returned) & (missing <= limits.arrived) & (shorter > limits.clear * missing)
    periods = np.where(is_period.any(axis=0), m[is_period.argmax(axis=0)], 0)
    nearest = last.argmin(axis=0), np.arange(count)
    is_steady = is_large & (np.abs(change) <= least) | (last <= limits.rounding)
    return Returns(missing[nearest], periods, is_steady[nearest])


def has_settled(states: NDArray[np.float64], longest: int, tolerance: float) -> bool:
    """Decide whether one motion has settled, from all its strobes since its start.

    Shapes: `states` (strobes, state_size).
    """
    found = judge_returns(states[:, None], longest)
    if found.missing[0] <= tolerance:
        return True
    if len(states) <= TOLERANCES.evidence or not found.steady[0]:
        return False
    return drift_of(states[len(states) // 2 :], longest).is_settled(tolerance)


def period_of(states: NDArray[np.float64], longest: int) -> int:
    """Return the smallest period after which all strobes of a settled motion return, at most `longest`; 0 if none."""
    for m in range(1, longest + 1):
        if np.abs(states[m:] - states[:-m]).max() <= TOLERANCES.arrived:
            return m
    return 0


class Recurrence(NamedTuple):
    """A number of forcing periods, and the distance of the motion from its start after them, relative to its size."""

    period: int
    distance: float


def recurrences(states: NDArray[np.float64], longest: int, near: float) -> list[Recurrence]:
    """Find periods up to `longest` after which scaled strobes nearly return, each nearer than those before it.

    Shapes: `states` (strobes, state_size).
    """
    found: list[Recurrence] = []
    best = np.inf
    for period in range(1, min(longest, len(states) // 2) + 1):
        recent = states[-2 * period :]
        distance = float(np.abs(recent[period:] - recent[:period]).max())
        if distance < near and distance < TOLERANCES.better * best:
            found.append(Recurrence(period, distance))
        best = min(best, distance)
    return found


def exact_returns(system: System, states: NDArray[np.float64]) -> list[Recurrence]:
    """Find periods after which strobes return more closely than on any torus, however small, or in chaos."""
    states = states - states.mean(axis=0)
    return recurrences(states / size_of(system, states), len(states) // 2, TOLERANCES.exact)


class Drift(NamedTuple):
    """The change of the averages of a motion along part of it."""

    #: The largest change, between the halves, of the weighted average of a scaled state or of a product of two.
    change: float
    #: The largest linear trend of averages over blocks, in its standard errors, relative to the allowed one. The errors
    #: come from the residual of the trend, so a slow decay cannot hide by increasing its own error.
    trend: float
    irregular: bool  #: True if weighted averages converge as slowly as those of chaotic motion.
    steady: bool  #: True if the nearest returns neither shrink nor grow; see `Returns`.

    def is_settled(self, tolerance: float) -> bool:
        """Return True if the change is within the tolerance, or, for irregular motion, the trend within its errors."""
        return self.steady and (self.change <= tolerance or (self.irregular and self.trend <= 1.0))

    def text(self, tolerance: float) -> str:
        """Describe a settled motion in words."""
        if self.change > tolerance:
            return f"its averages fluctuate without a trend (at most {self.trend:.2f} of a significant one)"
        return f"its averages change by no more than {self.change:.1e}"


def drift_of(states: NDArray[np.float64], longest: int) -> Drift:
    """Compute the drift along a sequence of scaled strobes, shape (count, state_size) with a count of 64 or more.

    Remainder after the nearest return within `longest` forcing periods (for example the size of a torus about an
    orbit) is scaled and tested separately: it may be small compared with the motion, and yet far from settled.
    """
    scaled, period = states[:, None], recurrences(states, longest, np.inf)[-1].period
    i, j = np.triu_indices(states.shape[1])
    left = (states[period:] - states[:-period]) ** 2
    left = TOLERANCES.small * left / np.maximum(left.mean(axis=0), _NOTHING)
    states = states[period:]
    observed = np.hstack((states, states[:, i] * states[:, j], left))
    half = len(observed) // 2
    change = np.abs(birkhoff_mean(observed[-half:]) - birkhoff_mean(observed[:half]))
    rough = birkhoff_spread(observed[-half:]) > TOLERANCES.irregular * observed.std(axis=0)
    steady = bool(judge_returns(scaled, longest).steady[0])
    return Drift(float(change.max()), _trend(observed), bool(rough.any()), steady)


def _trend(values: NDArray[np.float64]) -> float:
    """Return the largest linear trend of block averages, in its standard errors, relative to the allowed one."""
    largest = 0.0
    for count, allowed in TOLERANCES.trends:
        length = len(values) // count
        blocks = values[-length * count :].reshape(count, length, -1)
        means = np.array([birkhoff_mean(block) for block in blocks])
        place = np.arange(count) - (count - 1) / 2
        slope = place @ means / (place @ place)
        left = means - means.mean(axis=0) - np.outer(place, slope)
        error = np.sqrt((left**2).sum(axis=0) / (count - 2) / (place @ place))
        largest = max(largest, float((np.abs(slope) / (error + np.finfo(float).eps)).max()) / allowed)
    return largest
