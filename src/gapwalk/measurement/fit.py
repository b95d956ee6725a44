"""Fit named parameters to a record by least squares, with the exact sensitivities of the orbit.

The misfit between orbit and record is minimised along the branch of the first orbit.

Method: docs/numerics/measurement.md
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import check_count
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.alignment import Alignment, Misfit, Slopes, aligned, found_phase
from gapwalk.measurement.estimates import RECORD, Estimate, determined, doubts_of, independent, limits_of
from gapwalk.measurement.measured_record import Record
from gapwalk.notebook import Shown
from gapwalk.orbit.find import carry
from gapwalk.orbit.orbit import Orbit

_SETTLED = 1e-4  # change of the sum of squares, in noise variances, that is small compared with any error bar
_TOLERANCE = 1e-12  # relative tolerance of step and gradient
_ROUNDS = 3  # most minimisations, each with the parameters that have an effect by then
_COLOURED = 0.2  # correlation of neighbouring residuals above which standard errors are too small
_NOISE = 4.0  # that correlation must also exceed this many of its own standard errors
_ROUNDING = 1e-6  # residual, relative to the record, below which its correlation has no meaning
_EDGE = 1e-3  # cosine between residual and slopes above which a minimum was not reached


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Shown):
    """Parameters fitted to a record.

    Examples
    --------
    >>> found = gw.measure.fit(orbit, record, ["damping.x.x"], "x''")
    >>> round(found.estimates[0].value, 6), round(found.orbit.system.parameters["damping.x.x"], 6)
    (0.1, 0.1)
    """

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
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise ModelError(f"{name} was not fitted; the fit has {', '.join(each.name for each in self.estimates)}")

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name} = {each}" for each in self.estimates)
        parts = [values, f"rms error {self.before.agreement.rms:.4g} to {self.after.agreement.rms:.4g}", *self.failures]
        return f"Fit({'; '.join(parts)})"


@dataclass(frozen=True, slots=True)
class FitOptions:
    """Options of a fit.

    Examples
    --------
    >>> gw.measure.FitOptions(max_evaluations=20).max_evaluations
    20
    """

    max_evaluations: int = 200  #: The most orbits that are compared with the record.

    def __post_init__(self) -> None:
        check_count("max_evaluations", self.max_evaluations)


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
        Lowest and highest value by name. Clearances and damping coefficients are never negative.
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
        If there is no such parameter or signal, a bound is invalid, or the record suits no period of the orbit.
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
