"""Fit named parameters to a record by least squares, with the exact sensitivities of the orbit.

The misfit between orbit and record is minimised along the branch of the first orbit.

Method: docs/numerics/notes/models.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.compare_motions import Agreement, agreement, lines_of, orders_of
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Signal, signal_of
from gapwalk.measurement.measured_record import Record
from gapwalk.model.bounds import Bounded, Counted
from gapwalk.model.laws import never_negative
from gapwalk.model.system import System, pace_text
from gapwalk.model.words import with_error
from gapwalk.notebook import Pictured, Shown
from gapwalk.orbit.find import carry
from gapwalk.orbit.orbit import Orbit, sensitivity, signal_along

# Estimates of fitted parameters: standard errors, and those that the data do not determine.
#
# Method: docs/numerics/notes/models.md

Array = NDArray[np.float64]

_INDEPENDENT = 1e-7  # smallest independent part of a slope, relative to its size, for which a parameter is fitted
_RANK = 1e-7  # singular value, relative to the largest of slopes of equal size, below which a direction is undetermined
_SHARE = 0.05  # component of an undetermined direction above which a parameter counts as undetermined
_BOUND = 1e-4  # distance from a bound, relative to the parameter, below which it counts as at the bound


class Estimate(NamedTuple):
    """One fitted parameter."""

    name: str  #: Its name.
    #: start, value: The first guess, and the fitted value.
    start: float
    value: float
    error: float  #: Standard error; infinite if the data do not determine the parameter, nan if it ended at a bound.

    def __str__(self) -> str:
        if np.isnan(self.error):
            return f"{self.value:.6g} (at its bound)"
        known = np.isfinite(self.error)
        return with_error(self.value, self.error, 6, figures=2) if known else f"{self.value:.6g} (undetermined)"


def estimate_of(estimates: Sequence[Estimate], name: str) -> Estimate:
    """Return the estimate of one parameter."""
    for estimate in estimates:
        if estimate.name == name:
            return estimate
    raise ModelError(f"{name} was not fitted; the fit has {', '.join(each.name for each in estimates)}")


class Evidence(NamedTuple):
    """Words of the data to which parameters are fitted."""

    fails: str  #: Begins a sentence: ``the record does not determine``.
    idle: str  #: Says that a parameter has no effect.
    same: str  #: Says that some parameters together have no effect.


RECORD = Evidence("the record does not determine", "it changes nothing in this signal", "leaves the signal unchanged")


def limits_of(
    system: System, parameters: str | Sequence[str], bounds: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, ...], Array]:
    """Check names of parameters; return them with lowest (of clearances and dampings 0) and highest values (2, k)."""
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    limits: list[tuple[float, float]] = []
    for place, name in enumerate(names):
        value = system[name]  # refuses an unknown name
        if name in names[:place]:
            raise ModelError(f"{name} is listed twice; name it once")
        low, high = bounds.get(name, (-math.inf, math.inf))
        low = max(low, 0.0) if name.rpartition(".")[2] in never_negative() else low
        if not low <= value <= high or not low < high:
            raise ModelError(f"{name} begins at {value:g}, which does not lie between its bounds {low:g} and {high:g}")
        limits.append((low, high))
    for name in bounds:
        if name not in names:
            raise ModelError(f"there are bounds for {name}, which is not fitted")
    return names, np.array(limits, dtype=float).reshape(-1, 2).T


def independent(table: Array, moving: NDArray[np.bool_], least: float = _INDEPENDENT) -> NDArray[np.bool_]:
    """Mark the parameters whose effect is not a combination of the effects of others, shape (k,)."""
    from scipy.linalg import qr  # imported late: it takes long

    free, places = np.zeros(len(moving), dtype=bool), np.flatnonzero(moving)
    if len(places):
        columns = table[:, places]
        parts, order = qr(columns / np.linalg.norm(columns, axis=0), mode="r", pivoting=True)
        own = np.abs(np.diag(parts)) > least
        free[places[order[: len(own)][own]]] = True
    return free


def determined(
    names: Sequence[str],
    first: Array,
    values: Array,
    bounds: tuple[Array, Array],
    table: Array,
    moving: NDArray[np.bool_],
    variance: float,
    evidence: Evidence,
    rank: float = _RANK,
) -> tuple[tuple[Estimate, ...], Array, NDArray[np.bool_], tuple[str, ...]]:
    """Estimate errors of fitted parameters, and find those that the data do not determine.

    Shapes: `first`, `values`, `moving` (k,); `table` (samples, k).
    """
    count = len(names)
    scale = np.maximum(np.abs(values), np.abs(first))
    held = (values - bounds[0] <= _BOUND * scale) | (bounds[1] - values <= _BOUND * scale)
    sizes = np.linalg.norm(table, axis=0)
    idle = ~held & ~moving
    free = np.flatnonzero(~held & ~idle)
    covariance = np.full((count, count), np.nan)
    covariance[idle, idle] = np.inf
    undetermined = [f"{evidence.fails} {names[k]}: {evidence.idle}" for k in np.flatnonzero(idle).tolist()]
    if len(free):
        within, directions = _covariance(table[:, free], variance, rank)
        covariance[np.ix_(free, free)] = within
        undetermined += [
            _sentence([names[k] for k in free.tolist()], direction / sizes[free], evidence) for direction in directions
        ]
    variances = np.diag(covariance)
    errors = np.sqrt(variances)
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(errors, errors)
    estimates = tuple(
        Estimate(*row) for row in zip(names, first.tolist(), values.tolist(), errors.tolist(), strict=True)
    )
    return estimates, correlation, held, tuple(undetermined)


def _covariance(slopes: Array, variance: float, rank: float) -> tuple[Array, Array]:
    """Compute the covariance of the errors, infinite for undetermined parameters, and the undetermined directions.

    Directions are given in units of the parameters in which all slopes have equal size.
    """
    samples, count = slopes.shape
    sizes = np.linalg.norm(slopes, axis=0)
    padding = np.zeros((max(0, count - samples), count))  # with fewer samples than parameters some directions are free
    _, singular, rows = np.linalg.svd(np.concatenate((slopes / sizes, padding)), full_matrices=False)
    seen = singular > rank * singular[0]
    inverse = (rows[seen].T / singular[seen] ** 2) @ rows[seen]
    covariance = variance * inverse / np.outer(sizes, sizes)
    blurred = np.any(np.abs(rows[~seen]) > _SHARE, axis=0)
    covariance[blurred, :] = covariance[:, blurred] = np.nan
    covariance[blurred, blurred] = np.inf
    return covariance, rows[~seen]


def _sentence(names: Sequence[str], direction: Array, evidence: Evidence) -> str:
    """Describe parameters that can be changed together without any effect."""
    weights = np.abs(direction) / np.abs(direction).max()
    parts = [(name, value) for name, value, weight in zip(names, direction, weights, strict=True) if weight > 1e-4]
    ratio = " : ".join(f"{value / parts[0][1]:.3g}" for _, value in parts)
    together = " and ".join(name for name, _ in parts)
    return f"{evidence.fails} {together}: changing them as {ratio} {evidence.same}; fit one fewer of them"


def doubts_of(estimates: Sequence[Estimate]) -> Iterator[str]:
    """Yield sentences on parameters that ended at a bound, or have large errors."""
    for each in estimates:
        if np.isnan(each.error):
            yield f"{each.name} ended at its bound {each.value:.6g}; errors of other parameters hold for this value"
        elif np.isfinite(each.error) and each.error > abs(each.value) and each.name != "phase":
            yield f"{each.name} is poorly determined: its standard error is larger than its value"


# Alignment in phase of a measured record with a computed orbit, and their agreement (paper, figure 8).
#
# Nothing is interpolated: the orbit is evaluated at every instant of the record, whose first sample lies at an unknown
# phase of the excitation. Means are removed, because an accelerometer does not measure them. Derivatives are exact.

_STEPS = 30  # most Gauss-Newton steps of the phase; from the grid three suffice
_STILL = 1e-12  # step of the phase in rad below which the iteration ends
_HIGHEST = 20.0  # highest order of the lines that are compared
_FEWEST = 8  # fewest samples per forcing period
_CANCELLED = 1e-9  # size of a derivative, relative to its terms, that is only rounding
_GRID = 1024  # phases per forcing period that are tried
_ALIKE = 0.8  # correlation below which the two are probably different motions


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(Pictured):
    """A record and a computed orbit, at the phase at which they agree best."""

    #: orbit, record, signal: The orbit, the record, and the signal of the orbit that is compared with the record.
    orbit: Orbit
    record: Record
    signal: Signal
    phase: float  #: Phase of the excitation at the first sample of the record, in radians.
    periods: int  #: Number of periods of the orbit in the record.
    theta: NDArray[np.float64]  #: shape (samples,): Angle of the excitation at the samples that were used.
    #: measured, computed: shape (samples,): The two histories without their means.
    measured: NDArray[np.float64]
    computed: NDArray[np.float64]
    agreement: Agreement  #: Rms error, correlation, and spectral lines; the record is the first of the two.

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why this may not be the measured motion, in sentences."""
        found = []
        if not self.orbit.stable:
            found.append("the computed motion is unstable, so it is probably not the measured one")
        if self.agreement.correlation < _ALIKE:
            found.append(
                f"record and motion hardly correlate ({self.agreement.correlation:.2f}): perhaps another motion of the "
                "system was measured (another start or another period), or the signal or a scale is wrong"
            )
        return tuple(found)

    def __repr__(self) -> str:
        found = self.agreement
        return (
            f"Alignment({self.record.name} as {self.signal.name}: rms error {found.rms:.4g} "
            f"({found.relative:.2%} of the record's), correlation {found.correlation:.6f}, "
            f"phase {self.phase:.6g} rad, {self.periods} periods)"
        )


class Misfit:
    """A record to compare with the orbits of one branch, over as many whole periods of them as it contains."""

    def __init__(self, orbit: Orbit, record: Record, signal: Signal, order: float = 1.0) -> None:
        self.record, self.signal, self.period, self._order = record, signal, orbit.period, order
        motion = orbit.motion(1)
        if struck := [name for name, _ in signal.terms if len(motion.impulses(name)[0])]:
            raise ModelError(
                f"{struck[0]} is infinite where a rigid stop strikes, so it cannot be compared sample by sample; give "
                "the stop a stiffness, or compare a velocity or a position"
            )
        length = PERIOD * orbit.period
        turned = record.angles(orbit.system.frequency, order)
        step = float(turned[-1]) / (len(turned) - 1)
        if PERIOD / step < _FEWEST:
            raise ModelError(
                f"{record.name}: it has {PERIOD / step:.2g} samples per forcing period; at least {_FEWEST} are needed"
            )
        self.periods = int((float(turned[-1]) + 1.001 * step) // length)
        if not self.periods:
            raise ModelError(
                f"{record.name}: it covers {turned[-1] / PERIOD:.3g} forcing periods, but the motion repeats after "
                f"{orbit.period} at {pace_text(orbit.system, 6)}; check the time, its scale and the frequency"
            )
        self._keep = turned < length * self.periods - 1e-6 * step
        measured = record.acceleration[self._keep]
        self.measured = measured - measured.mean()
        if not self.measured.any():
            raise ModelError(f"{record.name}: it is constant, so there is nothing to compare")
        self.orders = orders_of(orbit.period, min(_HIGHEST, 0.4 * PERIOD / step))

    def angles(self, frequency: float) -> NDArray[np.float64]:
        """Return the angles of the excitation relative to the first sample, shape (samples,)."""
        return self.record.angles(frequency, self._order)[self._keep]

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """Derivative of the angles by the frequency, shape (samples,)."""
        time = self.record.time[self._keep]
        return time - time[0] if self.record.speed is None else np.zeros(len(time))

    def computed(self, orbit: Orbit, phase: float) -> NDArray[np.float64]:
        """Return the signal of an orbit at the instants of the record, without its mean, shape (samples,)."""
        values = signal_along(orbit, self.signal, self.angles(orbit.system.frequency) + phase)
        return values - values.mean()

    def residual(self, orbit: Orbit, phase: float) -> NDArray[np.float64]:
        """Return the signal of the orbit minus the record, shape (samples,)."""
        return self.computed(orbit, phase) - self.measured

    def slopes(self, orbit: Orbit, phase: float, names: tuple[str, ...]) -> Slopes:
        """Return the derivatives of the residual by named parameters, and by the phase."""
        along = sensitivity(orbit, names).signal(self.signal, self.angles(orbit.system.frequency) + phase)
        table = np.column_stack((along.by_parameters, along.by_angle))
        structure = orbit.system.structure
        if structure.pace in names:  # then the angles change too
            table[:, names.index(structure.pace)] += structure.frequency * self.times * along.by_angle
        sizes = np.maximum(np.append(along.sizes, 0.0), np.sqrt(np.mean(table**2, axis=0)))
        table -= table.mean(axis=0)
        return Slopes(table, np.sqrt(np.mean(table**2, axis=0)) > _CANCELLED * sizes)

    def best_phase(self, orbit: Orbit) -> float:
        """Find the phase of the record's first sample at which record and orbit correlate best, on a fine grid."""
        count = _GRID * orbit.period
        theta = PERIOD * orbit.period * np.arange(count) / count
        theirs = np.fft.rfft(signal_along(orbit, self.signal, theta)) / count
        ours = lines_of(self.angles(orbit.system.frequency), self.measured, self.orders)
        product = np.zeros(count // 2 + 1, dtype=complex)
        product[1 : len(ours) + 1] = ours.conj() * theirs[1 : len(ours) + 1]
        return float(theta[np.argmax(np.fft.irfft(product, count))])


class Slopes(NamedTuple):
    """Derivatives of the residual."""

    table: NDArray[np.float64]  #: shape (samples, k): Derivatives by each parameter, and by the phase.
    moving: NDArray[np.bool_]  #: shape (k,): True for derivatives larger than rounding.

    def first(self, count: int) -> Slopes:
        """Return the derivatives by the first parameters."""
        return Slopes(self.table[:, :count], self.moving[:count])


def align(
    orbit: Orbit,
    record: Record,
    signal: str | Mapping[str, float] | Signal,
    *,
    phase: float | None = None,
    order: float = 1.0,
) -> Alignment:
    """Align a record in phase with a computed orbit, and evaluate their agreement.

    The orbit is evaluated at the instants of the record, so nothing is resampled. The phase that fits best in the
    least-squares sense is found to rounding, far below one sample.

    Parameters
    ----------
    orbit
        The orbit.
    record
        The measured record, in the units of the model.
    signal
        The measured signal: a name as in `Motion.signal` such as ``"q1''"``, or a weighted sum of several, as in
        ``{"q1''": 1.0, "q3''": -0.5}``.
    phase
        Phase of the excitation at the first sample, in radians, if it is known.
    order
        Excitation periods per turn of the shaft whose speed was measured.

    Returns
    -------
    Alignment
        The measured and the computed history at the best phase, and their agreement.

    Raises
    ------
    ModelError
        If there is no such signal, or the record is too short, too coarse, constant, or not at the speed of the orbit.

    Examples
    --------
    >>> found = gw.measure.align(orbit, record, "x''")
    >>> round(found.agreement.correlation, 6), found.periods
    (1.0, 1)
    """
    misfit = Misfit(orbit, record, signal_of(orbit.system, signal), order)
    return aligned(misfit, orbit, found_phase(misfit, orbit) if phase is None else phase)


def found_phase(misfit: Misfit, orbit: Orbit) -> float:
    """Find the phase of the first sample at which record and orbit agree best."""
    phase = misfit.best_phase(orbit)
    error = np.inf
    for _ in range(_STEPS):
        residual, slope = misfit.residual(orbit, phase), misfit.slopes(orbit, phase, ()).table[:, 0]
        if residual @ residual >= error:  # no further progress because of rounding
            break
        error = residual @ residual
        step = -float(slope @ residual) / float(slope @ slope) if slope.any() else 0.0
        phase += step
        if abs(step) < _STILL:
            break
    return phase % (PERIOD * orbit.period)


def aligned(misfit: Misfit, orbit: Orbit, phase: float) -> Alignment:
    """Build the alignment of an orbit at a given phase."""
    theta, computed = misfit.angles(orbit.system.frequency) + phase, misfit.computed(orbit, phase)
    found = agreement(theta, misfit.measured, computed, misfit.orders, orbit.system.turns)
    return Alignment(
        orbit, misfit.record, misfit.signal, phase, misfit.periods, theta, misfit.measured, computed, found
    )


_SETTLED = 1e-4  # change of the sum of squares, in noise variances, that is small compared with any error bar
_TOLERANCE = 1e-12  # relative tolerance of step and gradient
_ROUNDS = 3  # most minimisations, each with the parameters that have an effect by then
_COLOURED = 0.2  # correlation of neighbouring residuals above which standard errors are too small
_NOISE = 4.0  # that correlation must also exceed this many of its own standard errors
_ROUNDING = 1e-6  # residual, relative to the record, below which its correlation has no meaning
_EDGE = 1e-3  # cosine between residual and slopes above which a minimum was not reached


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Shown):
    """Parameters fitted to a record."""

    estimates: tuple[Estimate, ...]  #: The parameters, each with its standard error.
    #: The estimate of the phase at the record's first sample, in radians; its error is 0 if it was given.
    phase: Estimate
    correlation: NDArray[np.float64]  #: shape (k, k): Correlations of the estimates' errors.
    #: before, after: The alignments of the orbit at the start, and of the fitted one.
    before: Alignment
    after: Alignment
    evaluations: int  #: Number of orbits that were compared with the record.
    notes: tuple[str, ...]  #: Further information, in sentences.
    #: Reasons to distrust the result: parameters that the record does not determine, or a branch that ended.
    failures: tuple[str, ...]

    @property
    def orbit(self) -> Orbit:
        """The fitted orbit; its system has the fitted values."""
        return self.after.orbit

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of one parameter."""
        return estimate_of(self.estimates, name)

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name} = {each}" for each in self.estimates)
        parts = [values, f"rms error {self.before.agreement.rms:.4g} to {self.after.agreement.rms:.4g}", *self.failures]
        return f"Fit({'; '.join(parts)})"


@dataclass(frozen=True, slots=True)
class FitOptions(Bounded):
    """Options of a fit.

    Examples
    --------
    >>> gw.measure.FitOptions(max_evaluations=20).max_evaluations
    20
    """

    max_evaluations: Counted = 200  #: The most orbits that are compared with the record.


class Descent(NamedTuple):
    """The end of a minimisation."""

    values: NDArray[np.float64]  #: shape (k,): The parameters, and the phase if it is fitted too.
    orbit: Orbit  #: The orbit at these values.
    slopes: Slopes  #: Derivatives of the residual at these values.
    #: shape (k,): True for values that were changed; the others cannot be distinguished from them and have their first
    #: values.
    free: NDArray[np.bool_]
    evaluations: int  #: Number of orbits that were compared with the record.
    lost: str  #: A sentence on the values that the branch does not reach; empty if it reached all of them.


def fit(
    orbit: Orbit,
    record: Record,
    parameters: Sequence[str],
    signal: str | Mapping[str, float] | Signal,
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    phase: float | None = None,
    order: float = 1.0,
    options: FitOptions | None = None,
) -> Fit:
    """Fit named parameters of a system to a record, starting from one of its orbits.

    The sum of squares over the record is minimised (trust region, `scipy.optimize.least_squares`), with derivatives
    from the implicit function theorem on the shooting equation. The orbit is continued along its branch from trial to
    trial, so the result is a motion of the same branch. Standard errors assume independent errors of equal size in the
    samples.

    Parameters
    ----------
    orbit
        The initial orbit; its system has the first guess of the parameters.
    record
        The measured record, in the units of the model.
    parameters
        Names of the parameters to fit, such as ``"stage2.impact_damping"``; any parameter of the system.
    signal, order
        As in `align`.
    bounds
        Lowest and highest value of each parameter, by its name. Clearances and damping coefficients are never negative.
    phase
        Phase of the excitation at the first sample, if it is known; otherwise it is fitted too.
    options
        Limits on the work.

    Returns
    -------
    Fit
        The parameters with their standard errors, and the fitted orbit.

    Raises
    ------
    ModelError
        If there is no such parameter or signal, a bound is invalid, or the record is refused, as by `align`.
    ConvergenceError
        If no minimum is found within the allowed number of evaluations.

    Examples
    --------
    >>> found = gw.measure.fit(orbit, record, ["damping.x.x"], "x''")
    >>> [(each.name, round(each.value, 6)) for each in found.estimates]  # the record was computed with 0.1
    [('damping.x.x', 0.1)]
    """
    names, limits = limits_of(orbit.system, parameters, bounds or {})
    if orbit.system.structure.pace in names and record.speed is not None:
        raise ModelError("the frequency is known from the measured speed; do not fit it")
    misfit = Misfit(orbit, record, signal_of(orbit.system, signal), order)
    begun = found_phase(misfit, orbit) if phase is None else phase
    before = aligned(misfit, orbit, begun)
    first = np.array([orbit.system[name] for name in names] + ([begun] if phase is None else []))
    if not len(first):
        raise ModelError("parameters is empty, and the phase is given; name the parameters to fit")
    low, high = np.full(len(first), -np.inf), np.full(len(first), np.inf)
    low[: len(names)], high[: len(names)] = limits
    found = descend(misfit, orbit, names, first, (low, high), phase, (options or FitOptions()).max_evaluations)
    after = aligned(misfit, found.orbit, begun if phase is not None else float(found.values[-1]))
    residual, size = after.computed - after.measured, float(np.linalg.norm(after.measured))
    all_names = (*names, "phase")[: len(first)]
    verdict = judge(all_names, first, found.values, (low, high), residual, found.slopes, size)
    count = len(names)
    return Fit(
        verdict.estimates[:count],
        verdict.estimates[count] if phase is None else Estimate("phase", after.phase, after.phase, 0.0),
        verdict.correlation[:count, :count],
        before,
        after,
        found.evaluations,
        (*verdict.notes, *after.doubts),
        (*verdict.failures, *_edge(found, after, verdict)),
    )


def descend(
    misfit: Misfit,
    orbit: Orbit,
    names: tuple[str, ...],
    first: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    phase: float | None,
    max_evaluations: int,
) -> Descent:
    """Minimise the sum of squares of a misfit; raise a ConvergenceError if that takes too many evaluations."""
    trial = _Trial(misfit, orbit, names, phase)
    values, slopes, evaluations = first, trial.slopes(first), 0
    free = independent(slopes.table, slopes.moving)
    for _ in range(_ROUNDS):
        values, count = _minimise(trial, values, free, bounds, max_evaluations)
        slopes, evaluations = trial.slopes(values), evaluations + count
        now = independent(slopes.table, slopes.moving)
        if np.count_nonzero(now) <= np.count_nonzero(free):
            break
        free = now  # a parameter without effect at the start may have one here, e.g. a gap
    return Descent(values, trial.orbit_at(values), slopes, free, evaluations, trial.lost)


class _Trial:
    """Evaluates trial values; each orbit is continued from the best one so far."""

    def __init__(self, misfit: Misfit, orbit: Orbit, names: tuple[str, ...], phase: float | None) -> None:
        self.misfit, self._names, self._phase = misfit, names, phase
        self._base, self._cost, self.lost = orbit, np.inf, ""

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residual at trial values; infinite if the branch does not reach them, to shorten the step."""
        try:
            orbit = self.orbit_at(x)
            values = self.misfit.residual(orbit, self._phase_at(x))
        except (NumericalError, ModelError) as error:
            self.lost = str(error)
            return np.full(len(self.misfit.measured), np.inf)
        cost = float(values @ values)
        if cost < self._cost:
            self._base, self._cost = orbit, cost
        return values

    def slopes(self, x: NDArray[np.float64]) -> Slopes:
        """Return the derivatives of the residual at values that the branch reaches."""
        return self.misfit.slopes(self.orbit_at(x), self._phase_at(x), self._names).first(len(x))

    def orbit_at(self, x: NDArray[np.float64]) -> Orbit:
        """Return the orbit at trial values."""
        values = dict(zip(self._names, x.tolist(), strict=False))
        return carry(self._base, self._base.system.at(values), self._names)

    def _phase_at(self, x: NDArray[np.float64]) -> float:
        return float(x[-1]) if self._phase is None else self._phase


def _minimise(trial: _Trial, values, free, bounds, max_evaluations: int) -> tuple[NDArray[np.float64], int]:
    """Return the values at the minimum over the free ones, and the number of evaluations."""
    from scipy.optimize import least_squares  # imported late: it takes long

    def whole(part: NDArray[np.float64]) -> NDArray[np.float64]:
        merged = values.copy()
        merged[free] = part
        return merged

    found = least_squares(
        lambda part: trial.residual(whole(part)),
        values[free],
        lambda part: trial.slopes(whole(part)).table[:, free],
        bounds=(bounds[0][free], bounds[1][free]),
        x_scale="jac",
        ftol=_SETTLED / len(trial.misfit.measured),
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=max_evaluations,
    )
    if found.status == 0:
        raise ConvergenceError(
            f"no minimum was found with {found.nfev} orbits; start nearer to it, or allow more orbits (FitOptions)"
        )
    return whole(found.x), found.nfev


def _edge(found: Descent, after: Alignment, verdict: Verdict) -> tuple[str, ...]:
    """Return a message if the fit ended at an end of the branch that is not a minimum."""
    free = found.slopes.table[:, ~verdict.held & found.free]
    residual = after.computed - after.measured
    sizes, size = np.linalg.norm(free, axis=0), np.linalg.norm(residual)
    if not found.lost or not size or not sizes.all():
        return ()
    cosine = float(np.abs(free.T @ residual / (sizes * size)).max(initial=0.0))
    text = f"no minimum: the fit reached the end of the branch of this motion ({found.lost})"
    return (text,) if cosine > _EDGE else ()


class Verdict(NamedTuple):
    """The information of a record about all parameters of a fit."""

    estimates: tuple[Estimate, ...]  #: The estimates of the parameters.
    correlation: NDArray[np.float64]  #: shape (k, k): Correlations of the errors; nan where there are none.
    held: NDArray[np.bool_]  #: shape (k,): True for parameters that ended at a bound.
    #: notes, failures: Notes and failures, in sentences.
    notes: tuple[str, ...]
    failures: tuple[str, ...]


def judge(
    names: Sequence[str],
    first: NDArray[np.float64],
    values: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    residual: NDArray[np.float64],
    slopes: Slopes,
    size: float,
) -> Verdict:
    """Estimate errors of fitted parameters, and find those that the record does not determine.

    Shapes: `first`, `values` (k,); `residual` (samples,).
    """
    variance = float(residual @ residual) / max(1, len(residual) - len(names) - 1)
    estimates, correlation, held, undetermined = determined(
        names, first, values, bounds, slopes.table, slopes.moving, variance, RECORD
    )
    return Verdict(estimates, correlation, held, tuple(_notes(estimates, residual, size)), undetermined)


def _notes(estimates: Sequence[Estimate], residual: NDArray[np.float64], size: float) -> Iterator[str]:
    yield from doubts_of(estimates)
    squares = float(residual @ residual)
    near = float(residual[1:] @ residual[:-1]) / squares if squares > (_ROUNDING * size) ** 2 else 0.0
    if near > max(_COLOURED, _NOISE / np.sqrt(len(residual))):
        yield (
            f"neighbouring residuals correlate ({near:.2f}): they are not only noise, so standard errors are too "
            "small; perhaps the model lacks something, or the record was filtered"
        )
