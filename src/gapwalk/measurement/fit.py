"""Fit named parameters to a record by least squares, with the exact sensitivities of the orbit.

The misfit between orbit and record is minimised along the branch of the first orbit.

Method: docs/numerics/measurement.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import check_count
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.alignment import Alignment, Misfit, Slopes, aligned, found_phase
from gapwalk.measurement.measured_record import Record
from gapwalk.model.laws import never_negative
from gapwalk.notebook import Shown
from gapwalk.orbit.find import carry
from gapwalk.orbit.orbit import Orbit

_SETTLED = 1e-4  # change of the sum of squares, in noise variances, that is small compared with any error bar
_TOLERANCE = 1e-12  # relative tolerance of step and gradient
_INDEPENDENT = 1e-7  # smallest independent part of a slope, relative to its size, for which a parameter is fitted
_ROUNDS = 3  # most minimisations, each with the parameters that have an effect by then
_RANK = 1e-7  # singular value, relative to the largest of slopes of equal size, below which a direction is undetermined
_SHARE = 0.05  # component of an undetermined direction above which a parameter counts as undetermined
_COLOURED = 0.2  # correlation of neighbouring residuals above which standard errors are too small
_NOISE = 4.0  # that correlation must also exceed this many of its own standard errors
_BOUND = 1e-4  # distance from a bound, relative to the parameter, below which it counts as at the bound
_ROUNDING = 1e-6  # residual, relative to the record, below which its correlation has no meaning
_EDGE = 1e-3  # cosine between residual and slopes above which a minimum was not reached


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Shown):
    """Parameters fitted to a record.

    Attributes
    ----------
    estimates
        The parameters, each with its standard error.
    phase
        The estimate of the phase at the record's first sample, in radians; its error is 0 if it was given.
    correlation : shape (k, k)
        Correlations of the estimates' errors.
    before, after
        The alignments of the orbit at the start, and of the fitted one.
    evaluations
        Number of orbits that were compared with the record.
    notes
        Further information, in sentences.
    failures
        Reasons to distrust the result: parameters that the record does not determine, or a branch that ended.
    """

    estimates: tuple[Estimate, ...]
    phase: Estimate
    correlation: NDArray[np.float64]
    before: Alignment
    after: Alignment
    evaluations: int
    notes: tuple[str, ...]
    failures: tuple[str, ...]

    @property
    def orbit(self) -> Orbit:
        """The fitted orbit; its system has the fitted values."""
        return self.after.orbit

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of one parameter."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise ModelError(f"{name} was not fitted; the fit has {', '.join(each.name for each in self.estimates)}")

    def plot(self, title: str | None = None, **options):
        """Draw the record over the fitted motion, and their spectral lines; see `gapwalk.plot.draw`."""
        return self.after.plot(title, **options)

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name} = {each}" for each in self.estimates)
        parts = [values, f"rms error {self.before.agreement.rms:.4g} to {self.after.agreement.rms:.4g}", *self.failures]
        return f"Fit({'; '.join(parts)})"


@dataclass(frozen=True, slots=True)
class FitOptions:
    """Options of a fit.

    Parameters
    ----------
    max_evaluations
        The most orbits that are compared with the record.
    """

    max_evaluations: int = 200

    def __post_init__(self) -> None:
        check_count("max_evaluations", self.max_evaluations)


class Descent(NamedTuple):
    """The end of a minimisation.

    Attributes
    ----------
    values : shape (k,)
        The parameters, and the phase if it is fitted too.
    orbit
        The orbit at these values.
    slopes
        Derivatives of the residual at these values.
    free : shape (k,)
        True for values that were changed; the others cannot be distinguished from them and have their first values.
    evaluations
        Number of orbits that were compared with the record.
    lost
        A sentence on the values that the branch does not reach; empty if it reached all of them.
    """

    values: NDArray[np.float64]
    orbit: Orbit
    slopes: Slopes
    free: NDArray[np.bool_]
    evaluations: int
    lost: str


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
        Lowest and highest value by name. Clearances and damping coefficients are never negative.
    phase
        Phase of the excitation at the first sample, if it is known; otherwise it is fitted too.
    options
        Limits on the work.

    Raises
    ------
    ModelError
        If there is no such parameter or signal, a bound is invalid, or the record suits no period of the orbit.
    ConvergenceError
        If no minimum is found within the allowed number of evaluations.
    """
    names, limits = _checked(orbit, parameters, bounds or {}, record)
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


def _checked(orbit: Orbit, parameters: Sequence[str], bounds: Mapping[str, tuple[float, float]], record: Record):
    """Check the names; return them with their lowest and highest values, shape (2, k)."""
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    limits: list[tuple[float, float]] = []
    for place, name in enumerate(names):
        value = orbit.system[name]  # refuses an unknown name
        if name in names[:place]:
            raise ModelError(f"{name} is listed twice; name it once")
        if name == orbit.system.structure.pace and record.speed is not None:
            raise ModelError("the frequency is known from the measured speed; do not fit it")
        low, high = bounds.get(name, (-math.inf, math.inf))
        low = max(low, 0.0) if name.rpartition(".")[2] in never_negative() else low
        if not low <= value <= high or not low < high:
            raise ModelError(f"{name} begins at {value:g}, which does not lie between its bounds {low:g} and {high:g}")
        limits.append((low, high))
    for name in bounds:
        if name not in names:
            raise ModelError(f"there are bounds for {name}, which is not fitted")
    return names, np.array(limits, dtype=float).reshape(-1, 2).T


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
    free = _independent(slopes)
    for _ in range(_ROUNDS):
        values, count = _minimise(trial, values, free, bounds, max_evaluations)
        slopes, evaluations = trial.slopes(values), evaluations + count
        now = _independent(slopes)
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


def _independent(slopes: Slopes) -> NDArray[np.bool_]:
    """Mark the parameters whose effect is not a combination of the effects of others, shape (k,)."""
    from scipy.linalg import qr  # imported late, as above

    free, places = np.zeros(len(slopes.moving), dtype=bool), np.flatnonzero(slopes.moving)
    if len(places):
        columns = slopes.table[:, places]
        table, order = qr(columns / np.linalg.norm(columns, axis=0), mode="r", pivoting=True)
        own = np.abs(np.diag(table)) > _INDEPENDENT
        free[places[order[: len(own)][own]]] = True
    return free


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


class Estimate(NamedTuple):
    """One fitted parameter.

    Attributes
    ----------
    name
        Its name.
    start, value
        The first guess, and the fitted value.
    error
        Standard error; infinite if the record does not determine the parameter, nan if it ended at a bound.
    """

    name: str
    start: float
    value: float
    error: float

    def __str__(self) -> str:
        if np.isnan(self.error):
            return f"{self.value:.6g} (at its bound)"
        return f"{self.value:.6g} ± {self.error:.2g}" if np.isfinite(self.error) else f"{self.value:.6g} (undetermined)"


class Verdict(NamedTuple):
    """The information of a record about all parameters of a fit.

    Attributes
    ----------
    estimates
        The estimates of the parameters.
    correlation : shape (k, k)
        Correlations of the errors; nan where there are none.
    held : shape (k,)
        True for parameters that ended at a bound.
    notes, failures
        Notes and failures, in sentences.
    """

    estimates: tuple[Estimate, ...]
    correlation: NDArray[np.float64]
    held: NDArray[np.bool_]
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

    Parameters
    ----------
    names
        Names of the k parameters.
    first, values : shape (k,)
        The first guess, and the fitted values.
    bounds
        Lowest and highest values.
    residual : shape (samples,)
        Residual at the fitted values.
    slopes
        Derivatives of the residual by the parameters.
    size
        Norm of the record.
    """
    count, samples = len(names), len(residual)
    scale = np.maximum(np.abs(values), np.abs(first))
    held = (values - bounds[0] <= _BOUND * scale) | (bounds[1] - values <= _BOUND * scale)
    sizes = np.linalg.norm(slopes.table, axis=0)
    idle = ~held & ~slopes.moving
    free = np.flatnonzero(~held & ~idle)
    covariance = np.full((count, count), np.nan)
    covariance[idle, idle] = np.inf
    undetermined = [
        f"the record does not determine {names[k]}: it changes nothing in this signal"
        for k in np.flatnonzero(idle).tolist()
    ]
    if len(free):
        within, directions = _covariance(slopes.table[:, free], residual, samples - count - 1)
        covariance[np.ix_(free, free)] = within
        undetermined += [
            _sentence([names[k] for k in free.tolist()], direction / sizes[free]) for direction in directions
        ]
    variances = np.diag(covariance)
    errors = np.sqrt(variances)
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(errors, errors)
    estimates = tuple(
        Estimate(*row) for row in zip(names, first.tolist(), values.tolist(), errors.tolist(), strict=True)
    )
    return Verdict(estimates, correlation, held, tuple(_notes(estimates, residual, size)), tuple(undetermined))


def _covariance(slopes: NDArray[np.float64], residual: NDArray[np.float64], freedom: int):
    """Compute the covariance of the errors, infinite for undetermined parameters, and the undetermined directions.

    Directions are given in units of the parameters in which all slopes have equal size.
    """
    sizes = np.linalg.norm(slopes, axis=0)
    _, singular, rows = np.linalg.svd(slopes / sizes, full_matrices=False)
    seen = singular > _RANK * singular[0]
    variance = float(residual @ residual) / max(1, freedom)
    inverse = (rows[seen].T / singular[seen] ** 2) @ rows[seen]
    covariance = variance * inverse / np.outer(sizes, sizes)
    blurred = np.any(np.abs(rows[~seen]) > _SHARE, axis=0)
    covariance[blurred, :] = covariance[:, blurred] = np.nan
    covariance[blurred, blurred] = np.inf
    return covariance, rows[~seen]


def _sentence(names: Sequence[str], direction: NDArray[np.float64]) -> str:
    """Describe parameters that can be changed together without changing the signal."""
    weights = np.abs(direction) / np.abs(direction).max()
    parts = [(name, value) for name, value, weight in zip(names, direction, weights, strict=True) if weight > 1e-4]
    ratio = " : ".join(f"{value / parts[0][1]:.3g}" for _, value in parts)
    together = " and ".join(name for name, _ in parts)
    return (
        f"the record does not determine {together}: changing them as {ratio} leaves the signal unchanged; "
        "fit one fewer of them"
    )


def _notes(estimates: Sequence[Estimate], residual: NDArray[np.float64], size: float) -> Iterator[str]:
    for each in estimates:
        if np.isnan(each.error):
            yield f"{each.name} ended at its bound {each.value:.6g}; the errors of the others hold for this value"
        elif np.isfinite(each.error) and each.error > abs(each.value) and each.name != "phase":
            yield f"{each.name} is poorly determined: its standard error is larger than its value"
    squares = float(residual @ residual)
    near = float(residual[1:] @ residual[:-1]) / squares if squares > (_ROUNDING * size) ** 2 else 0.0
    if near > max(_COLOURED, _NOISE / np.sqrt(len(residual))):
        yield (
            f"neighbouring residuals correlate ({near:.2f}): they are not only noise, so standard errors are too "
            "small; perhaps the model lacks something, or the record was filtered"
        )
