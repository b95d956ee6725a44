"""Estimates of fitted parameters: standard errors, and those that the data do not determine.

Method: docs/numerics/measurement.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.laws import never_negative
from gapwalk.model.system import System

Array = NDArray[np.float64]

_INDEPENDENT = 1e-7  # smallest independent part of a slope, relative to its size, for which a parameter is fitted
_RANK = 1e-7  # singular value, relative to the largest of slopes of equal size, below which a direction is undetermined
_SHARE = 0.05  # component of an undetermined direction above which a parameter counts as undetermined
_BOUND = 1e-4  # distance from a bound, relative to the parameter, below which it counts as at the bound


class Estimate(NamedTuple):
    """One fitted parameter.

    Examples
    --------
    >>> fitted = gw.measure.fit_points(branch, [("fold", 1.39, 0.001)], ["stop.clearance"])
    >>> fitted.estimates[0].name, round(fitted.estimates[0].error, 4)
    ('stop.clearance', 0.0049)
    """

    name: str  #: Its name.
    #: start, value: The first guess, and the fitted value.
    start: float
    value: float
    error: float  #: Standard error; infinite if the data do not determine the parameter, nan if it ended at a bound.

    def __str__(self) -> str:
        if np.isnan(self.error):
            return f"{self.value:.6g} (at its bound)"
        return f"{self.value:.6g} ± {self.error:.2g}" if np.isfinite(self.error) else f"{self.value:.6g} (undetermined)"


class Evidence(NamedTuple):
    """Words of the data to which parameters are fitted."""

    fails: str  #: Begins a sentence: ``the record does not determine``.
    idle: str  #: Says that a parameter has no effect.
    same: str  #: Says that some parameters together have no effect.


RECORD = Evidence("the record does not determine", "it changes nothing in this signal", "leaves the signal unchanged")


def limits_of(
    system: System, parameters: str | Sequence[str], bounds: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, ...], Array]:
    """Check names of parameters; return them with their lowest and highest values, shape (2, k).

    Clearances and damping coefficients are never negative.
    """
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
            yield f"{each.name} ended at its bound {each.value:.6g}; the errors of the others hold for this value"
        elif np.isfinite(each.error) and each.error > abs(each.value) and each.name != "phase":
            yield f"{each.name} is poorly determined: its standard error is larger than its value"
