"""Lyapunov exponents from the exact sensitivities: rates at which neighbouring motions separate, with errors.

The transition matrix of each forcing period is factorised by QR. The exponents are the averages of the logarithms of
the diagonal of R along the motion (Benettin, Galgani, Giorgilli and Strelcyn 1980, Meccanica 15, 9-20 and 21-30).

The errors of the averages allow for the correlation of the values. There are two estimators. For regular motion
(periodic or quasi-periodic) the weighted Birkhoff average converges faster than any power of the length (Das, Saiki,
Sander and Yorke 2017, Nonlinearity 30, 4111-4140). For chaotic motion the plain mean is as good as any other estimator;
its error is estimated from averages over blocks of growing length (Flyvbjerg and Petersen 1989, J. Chem. Phys. 91,
461-466).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.motion import check_state
from gapwalk.late_scipy import lapack
from gapwalk.model.bounds import Bounded, Fraction
from gapwalk.model.coefficients import coefficients_of
from gapwalk.model.system import System
from gapwalk.orbit.sticking import collapses
from gapwalk.pieces import tell_stage

_BLOCKS = 16  # the fewest blocks from which an error is estimated
_PARTS = 4  # parts of the sequence whose weighted averages are compared
_FIRST, _FEWEST = 1024, 256  # forcing periods after which the errors are first estimated; where each takes long
_RESOLVED = -14.0  # logarithm of the stretching over a segment below which rounding errors dominate
_COLLAPSED = 1e-13  # stretching, relative to the largest, that friction or an impact has made 0 but for rounding
_MOST_SEGMENTS = 64
_ROUNDING = 1e-9  # spread of averages per forcing period that is within rounding
_ALIGNING = 8  # the first 1/8 of the periods is omitted: the directions are still aligning


@dataclass(frozen=True, eq=False)
class Lyapunov:
    """Lyapunov exponents of a motion."""

    #: exponents, errors: shape (state_size,): Exponents per unit of time, in descending order, and their standard
    #: errors. An exponent is minus infinity where slip, stick or an impact without rebound makes neighbouring motions
    #: one.
    exponents: NDArray[np.float64]
    errors: NDArray[np.float64]
    #: Number of forcing periods in the averages; 0 for an orbit, whose exponents follow from its multipliers.
    periods: int
    frequency: float  #: Excitation frequency W, which converts them into rates per forcing period.
    regular: bool  #: True if the weighted averages converge as they do for periodic and quasi-periodic motion.
    converged: bool  #: True if the errors reached the required size.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.exponents.ndim != 1 or self.exponents.shape != self.errors.shape or not self.frequency > 0.0:
            raise ValueError("the exponents and their errors have different shapes, or the frequency is not > 0")

    @property
    def per_period(self) -> NDArray[np.float64]:
        """The exponents per forcing period, shape (state_size,)."""
        return self.exponents * (PERIOD / self.frequency)

    @property
    def errors_per_period(self) -> NDArray[np.float64]:
        """The errors per forcing period, shape (state_size,)."""
        return self.errors * (PERIOD / self.frequency)

    @cached_property
    def dimension(self) -> float:
        """Dimension of the attractor's section (Kaplan and Yorke 1979): 0 for an orbit, 1 for a torus, more for chaos.

        Exponents within three errors of zero count as zero.
        """
        values = np.where(np.abs(self.exponents) <= 3.0 * self.errors, 0.0, self.exponents)
        sums = np.cumsum(values)
        if values[0] < 0.0:
            return 0.0
        full = int(np.flatnonzero(sums >= 0.0)[-1]) + 1
        return float(full) if full == len(values) else float(full + sums[full - 1] / abs(values[full]))

    def __repr__(self) -> str:
        values = ", ".join(f"{x:.5g} +- {e:.1g}" for x, e in zip(self.exponents, self.errors, strict=True))
        said = "" if self.converged else ", too few for the errors that were asked for"
        return f"Lyapunov({values}; {self.periods} forcing periods{said})"


class Average(NamedTuple):
    """A mean and its error, for each column of a sequence."""

    #: mean, error: shape (columns,): The better of the two estimates, and its standard error.
    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    #: shape (columns,): Range of the weighted averages of four parts of the sequence: small only for regular motion.
    spread: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LyapunovOptions(Bounded):
    """Options of the averages over time that give the Lyapunov exponents.

    Examples
    --------
    >>> gw.analysis.lyapunov(system, orbit.state, gw.analysis.LyapunovOptions(relative=0.01)).converged
    True
    """

    max_periods: Annotated[int, Ge(256)] = 16_384  #: Largest number of forcing periods.
    #: relative, absolute: The averages end when the standard error of each exponent is below `relative` times the
    #: exponent, or below `absolute` per forcing period.
    relative: Fraction = 0.02
    absolute: Fraction = 1e-6


class _Moving(Protocol):
    """A settled motion: an orbit, an attractor, or what `settle` returns."""

    @property
    def system(self) -> System: ...

    @property
    def state(self) -> NDArray[np.float64]: ...


def lyapunov(
    system: System | _Moving, start: NDArray[np.float64] | None = None, options: LyapunovOptions | None = None
) -> Lyapunov:
    """Compute the Lyapunov exponents of a settled motion.

    Parameters
    ----------
    system
        The motion, as `gapwalk.settle`, `gapwalk.classify` or `gapwalk.find_orbit` returns it; or a system.
    start : shape (state_size,)
        If a system is given: a state of the settled motion at theta = 0.
    options
        Length and accuracy of the averages.

    Returns
    -------
    Lyapunov
        The exponents with their standard errors.

    Raises
    ------
    ModelError
        If the state has the wrong length, or is missing, or is given with a settled motion.
    FlowError
        If the motion diverges.

    Notes
    -----
    Benettin, Galgani, Giorgilli and Strelcyn (1980), Meccanica 15, 9-20. Derivatives at contact events are as
    in Müller (1995), Chaos, Solitons and Fractals 5, 1671-1681.

    Examples
    --------
    >>> gw.analysis.lyapunov(system, orbit.state).exponents.round(6)
    array([-0.05, -0.05])
    """
    if isinstance(system, System) == (start is None):
        raise ModelError(
            "write lyapunov(motion), where motion is what settle, classify or find_orbit returns, or "
            "lyapunov(system, state)"
        )
    if isinstance(system, System):
        assert start is not None
        return lyapunov_run(system, start, options)[0]
    return lyapunov_run(system.system, system.state, options)[0]


def lyapunov_run(
    system: System, state: NDArray[np.float64], options: LyapunovOptions | None = None, sure: float = np.inf
) -> tuple[Lyapunov, NDArray[np.float64]]:
    """Compute the exponents, also until the largest is positive by `sure` errors; return them and the strobes."""
    options = options or LyapunovOptions()
    stretching = _Stretching(system, check_state(system, state))
    length = min(_FEWEST if np.isfinite(sure) else _FIRST, options.max_periods)
    while True:
        stretching.extend(length)
        logs = stretching.logs[length // _ALIGNING :]
        lost = np.isneginf(logs).any(axis=0)
        found = average(np.where(lost, 0.0, logs))
        found.mean[lost] = -np.inf
        order = np.argsort(-found.mean)
        value, error = found.mean[order], found.error[order]
        good = bool(np.all(error <= np.maximum(options.relative * np.abs(value), options.absolute)))
        if good or value[0] > sure * error[0] or length >= options.max_periods:
            return _record(system, Average(*(each[order] for each in found)), len(logs), good), stretching.strobes
        length = min(2 * length, options.max_periods)


class _Stretching:
    """The logarithms of the stretching of an orthonormal frame, one forcing period after the other."""

    def __init__(self, system: System, state: NDArray[np.float64]) -> None:
        self._flow, self._coefficients = flow_of(system, transition=True), coefficients_of(system)
        self._state, self._frame = state, np.eye(len(state))
        self._segments, self._collapses = 1, collapses(system)
        self._logs: list[NDArray[np.float64]] = []
        self._strobes: list[NDArray[np.float64]] = []

    @property
    def logs(self) -> NDArray[np.float64]:
        return np.array(self._logs)

    @property
    def strobes(self) -> NDArray[np.float64]:
        return np.array(self._strobes)

    def extend(self, length: int) -> None:
        """Continue until `length` periods have been evaluated."""
        while len(self._logs) < length:
            state, frame, logs = self._period()
            while self._is_blurred(logs) and self._segments < _MOST_SEGMENTS:
                self._segments *= 2  # fast contraction is lost to rounding: factorise more often
                state, frame, logs = self._period()
            self._state, self._frame = state, frame
            self._logs.append(logs.sum(axis=0))
            self._strobes.append(state)
            tell_stage(len(self._logs) / length)

    def _is_blurred(self, logs: NDArray[np.float64]) -> bool:
        """Return True if a stretching is lost to rounding; one that is nothing but rounding is an exact collapse."""
        return bool(logs.min(where=~np.isneginf(logs), initial=0.0) < _RESOLVED)

    def _period(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return state and frame after one period, and the logarithms of each segment of it, in rows."""
        state, frame, logs = self._state, self._frame, []
        for start, stop in pairwise([PERIOD * k / self._segments for k in range(self._segments + 1)]):
            arc = self._flow.integrate(self._coefficients, state, start, stop)
            assert arc.transition is not None
            factors, scales, _, _ = lapack.dgeqrf(arc.transition @ frame)
            frame, state = lapack.dorgqr(factors, scales)[0], arc.state
            sizes = np.abs(factors.diagonal())
            stretched = np.log(np.maximum(sizes, np.finfo(float).tiny))
            if self._collapses:
                stretched[sizes <= _COLLAPSED * sizes.max()] = -np.inf
            logs.append(stretched)
        return state, frame, np.array(logs)


def average(values: NDArray[np.float64]) -> Average:
    """Compute mean and error of each column of a sequence, shape (length, columns) with a length of at least 16."""
    plain, weighted = block_error(values), birkhoff_spread(values)
    rounding = np.finfo(float).eps * np.abs(values).max(axis=0)
    plain, weighted = np.maximum(plain, rounding), np.maximum(weighted, rounding)
    regular = weighted <= plain
    mean = np.where(regular, birkhoff_mean(values), values.mean(axis=0))
    return Average(mean, np.where(regular, weighted, plain), weighted)


def block_error(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the standard error of the plain mean of each column: the largest value over all block lengths."""
    error = np.zeros(values.shape[1:])
    while len(values) >= _BLOCKS:
        error = np.maximum(error, values.std(axis=0, ddof=1) / np.sqrt(len(values)))
        even = values[: len(values) // 2 * 2]
        values = 0.5 * (even[::2] + even[1::2])
    return error


def birkhoff_spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the range of the weighted averages of four equal parts of the sequence, for each column."""
    length = len(values) // _PARTS
    parts = [birkhoff_mean(values[k * length : (k + 1) * length]) for k in range(_PARTS)]
    return np.ptp(parts, axis=0)


def birkhoff_mean(values: NDArray) -> NDArray:
    """Compute the weighted Birkhoff average over the first axis."""
    return birkhoff_weights(len(values)) @ values


@lru_cache(maxsize=32)
def birkhoff_weights(count: int) -> NDArray[np.float64]:
    """Return `count` weights ``exp(-1 / (t (1 - t)))``, normalised to the sum 1."""
    t = np.arange(1, count + 1) / (count + 1)
    weights = np.exp(-1.0 / (t * (1.0 - t)))
    weights /= weights.sum()
    weights.flags.writeable = False
    return weights


def _record(system: System, found: Average, periods: int, converged: bool) -> Lyapunov:
    rate = system.frequency / PERIOD
    regular = bool(np.all(found.spread <= np.maximum(found.error, _ROUNDING)))
    return Lyapunov(found.mean * rate, found.error * rate, periods, system.frequency, regular, converged)


def of_multipliers(system: System, multipliers: NDArray[np.complex128], period: int) -> Lyapunov:
    """Compute the exponents of an orbit: ``log |mu| / (m T)``."""
    span = PERIOD * period / system.frequency
    with np.errstate(divide="ignore"):  # a multiplier may be 0
        values = np.log(np.abs(multipliers)) / span
    return Lyapunov(np.sort(values)[::-1], np.zeros(len(values)), 0, system.frequency, True, True)
