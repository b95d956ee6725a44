"""Fit named parameters to a record by least squares, with the exact sensitivities of the orbit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.measurement.alignment import Alignment, aligned, found_phase
from gapwalk.measurement.estimate import Estimate, Verdict, judge
from gapwalk.measurement.misfit import Misfit
from gapwalk.measurement.record import Record
from gapwalk.motion.signal import Signal, signal_of
from gapwalk.orbit.carry import carry
from gapwalk.orbit.orbit import Orbit

_NEVER_NEGATIVE = ("clearance", "impact_damping", "viscous_damping")
_TOLERANCE = 1e-12  # of cost, step and gradient
_EDGE = 1e-3  # cosine between residual and slopes above which a minimum was not reached


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Parameters fitted to a record.

    Attributes
    ----------
    estimates
        The parameters, each with its standard error.
    phase
        The same of the phase of the record's first sample, in radians; its error is 0 if it was given.
    correlation : shape (k, k)
        Correlations of the estimates' errors.
    before, after
        The alignments of the orbit at the start, and of the fitted one.
    evaluations
        Orbits that were compared with the record.
    notes
        What else is to be known.
    failures
        Why the result is not to be trusted: parameters that the record does not determine, or a branch that ended.
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
        """The estimate of one parameter."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise ModelError(f"{name} was not fitted; fitted were {', '.join(each.name for each in self.estimates)}")

    def plot(self, title: str | None = None, **options):
        """Draw the record over the fitted motion, and their lines; see `gapwalk.plot.plot_alignment`."""
        return self.after.plot(title, **options)

    def __repr__(self) -> str:
        values = ", ".join(f"{each.name} = {each}" for each in self.estimates)
        parts = [values, f"rms error {self.before.agreement.rms:.4g} to {self.after.agreement.rms:.4g}", *self.failures]
        return f"Fit({'; '.join(parts)})"


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How to fit.

    Parameters
    ----------
    max_evaluations
        Orbits that are compared with the record, at most.
    """

    max_evaluations: int = 200

    def __post_init__(self) -> None:
        if isinstance(self.max_evaluations, bool) or not isinstance(self.max_evaluations, int):
            raise ModelError(f"max_evaluations is {self.max_evaluations!r}; it must be an integer >= 1")
        if self.max_evaluations < 1:
            raise ModelError(f"max_evaluations is {self.max_evaluations}; it must be an integer >= 1")


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

    The sum of squares over the record is minimised (trust region, `scipy.optimize.least_squares`), with derivatives by
    the implicit function theorem on the shooting equation. The orbit is carried along its branch from trial to trial,
    so the result is a motion of the same branch. Standard errors are those of independent errors of equal size in the
    samples.

    Parameters
    ----------
    orbit
        The orbit to begin with; its system has the first guess of the parameters.
    record
        What was measured, in the units of the model.
    parameters
        Names of what is to be fitted, such as ``"stage2.impact_damping"``; any parameter of the system.
    signal, order
        As in `align`.
    bounds
        Lowest and highest value by name. Clearances and damping coefficients are never negative.
    phase
        Phase of the excitation at the first sample, if it is known; otherwise it is fitted too.
    options
        How long to try.

    Raises
    ------
    ModelError
        If there is no such parameter or signal, a bound makes no sense, or the record suits no period of the orbit.
    ConvergenceError
        If no minimum is found within the evaluations that are allowed.
    """
    from scipy.optimize import least_squares  # imported late: it takes long

    names, limits = _checked(orbit, parameters, bounds or {}, record)
    misfit = Misfit(orbit, record, signal_of(orbit.system, signal), order)
    begun = found_phase(misfit, orbit) if phase is None else phase
    before = aligned(misfit, orbit, begun)
    walk = _Walk(misfit, orbit, names, phase)
    first = np.array([orbit.system[name] for name in names] + ([begun] if phase is None else []))
    if not len(first):
        raise ModelError("parameters is empty, and the phase is given; name what is to be fitted")
    low, high = np.full(len(first), -np.inf), np.full(len(first), np.inf)
    low[: len(names)], high[: len(names)] = limits
    found = least_squares(
        walk.residual,
        first,
        walk.slopes,
        bounds=(low, high),
        x_scale="jac",
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=(options or FitOptions()).max_evaluations,
    )
    if found.status == 0:
        raise ConvergenceError(f"no minimum was found with {found.nfev} orbits; begin nearer to it, or allow for more")
    walk.residual(found.x)
    assert walk.orbit is not None
    after = aligned(misfit, walk.orbit, walk.phase(found.x))
    slopes = misfit.slopes(walk.orbit, after.phase, names)[:, : len(first)]
    residual, size = after.computed - after.measured, float(np.linalg.norm(after.measured))
    verdict = judge((*names, "phase")[: len(first)], first, found.x, (low, high), residual, slopes, size)
    lost = _edge(walk, after, slopes, verdict)
    return _fit(names, phase, verdict, before, after, found.nfev, lost)


class _Walk:
    """Trial values of a fit: each orbit is carried from the best one so far."""

    def __init__(self, misfit: Misfit, orbit: Orbit, names: tuple[str, ...], phase: float | None) -> None:
        self.misfit, self.names, self._phase = misfit, names, phase
        self.base, self.orbit, self.lost = orbit, orbit, ""
        self._cost = np.inf

    def phase(self, x: NDArray[np.float64]) -> float:
        """The phase among the unknowns, or the one that was given."""
        return float(x[-1]) if self._phase is None else self._phase

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The residual at trial values; infinite where the branch does not lead, so that the step is shortened."""
        try:
            self.orbit = self._at(x)
            values = self.misfit.residual(self.orbit, self.phase(x))
        except (NumericalError, ModelError) as error:
            self.lost = str(error)
            return np.full(len(self.misfit.measured), np.inf)
        cost = float(values @ values)
        if cost < self._cost:
            self.base, self._cost = self.orbit, cost
        return values

    def slopes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the residual at values that were accepted."""
        return self.misfit.slopes(self._at(x), self.phase(x), self.names)[:, : len(x)]

    def _at(self, x: NDArray[np.float64]) -> Orbit:
        values = dict(zip(self.names, x.tolist(), strict=False))
        return carry(self.base, self.base.system.at(values), self.names)


def _checked(orbit: Orbit, parameters: Sequence[str], bounds: Mapping[str, tuple[float, float]], record: Record):
    """The names, and their lowest and highest values, shape (2, k)."""
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    limits: list[tuple[float, float]] = []
    for place, name in enumerate(names):
        value = orbit.system[name]  # refuses an unknown name
        if name in names[:place]:
            raise ModelError(f"{name} is to be fitted twice; name it once")
        if name == "frequency" and record.speed is not None:
            raise ModelError("the frequency is known from the measured speed; do not fit it")
        low, high = bounds.get(name, (-math.inf, math.inf))
        low = max(low, 0.0) if name.rpartition(".")[2] in _NEVER_NEGATIVE else low
        if not low <= value <= high or not low < high:
            raise ModelError(f"{name} begins at {value:g}, which does not lie between its bounds {low:g} and {high:g}")
        limits.append((low, high))
    for name in bounds:
        if name not in names:
            raise ModelError(f"there are bounds for {name}, which is not fitted")
    return names, np.array(limits, dtype=float).reshape(-1, 2).T


def _edge(walk: _Walk, after: Alignment, slopes: NDArray[np.float64], verdict: Verdict) -> tuple[str, ...]:
    """That the fit ended where the branch does, if it is not a minimum."""
    free = slopes[:, ~verdict.held]
    sizes = np.linalg.norm(free, axis=0)
    residual = after.computed - after.measured
    size = np.linalg.norm(residual)
    if not walk.lost or not size or not sizes.all():
        return ()
    cosine = float(np.abs(free.T @ residual / (sizes * size)).max(initial=0.0))
    return (
        (f"no minimum: the fit came to where the branch of this motion ends ({walk.lost})",) if cosine > _EDGE else ()
    )


def _fit(names, phase, verdict: Verdict, before: Alignment, after: Alignment, evaluations: int, lost) -> Fit:
    count = len(names)
    fixed = Estimate("phase", after.phase, after.phase, 0.0)
    notes = list(verdict.notes)
    if not after.orbit.stable:
        notes.append("the fitted motion is unstable, so it is hardly what was measured")
    return Fit(
        verdict.estimates[:count],
        verdict.estimates[count] if phase is None else fixed,
        verdict.correlation[:count, :count],
        before,
        after,
        evaluations,
        tuple(notes),
        (*verdict.failures, *lost),
    )
