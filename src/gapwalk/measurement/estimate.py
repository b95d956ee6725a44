"""What a record says of parameters: standard errors from the slopes, and which parameters it does not determine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.measurement.misfit import Slopes

_RANK = 1e-7  # singular value, relative to the largest of slopes of equal size, below which nothing is determined
_SHARE = 0.05  # of a parameter in a direction that nothing determines, from which on it is named
_COLOURED = 0.2  # correlation of neighbouring residuals from which standard errors are too small
_NOISE = 4.0  # the same, in its own standard errors
_BOUND = 1e-4  # distance from a bound, relative to the parameter, at which it counts as held there
_ROUNDING = 1e-6  # of a residual, relative to the record: what is left below has no meaning


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
    """What a record says of all parameters of a fit.

    Attributes
    ----------
    estimates
        Parameter by parameter.
    correlation : shape (k, k)
        Correlations of the errors; nan where there are none.
    held : shape (k,)
        Which parameters ended at a bound.
    notes, failures
        In sentences.
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
    """What a record says of parameters.

    Parameters
    ----------
    names
        Of the parameters, k.
    first, values : shape (k,)
        The first guess, and the fitted values.
    bounds
        Lowest and highest values.
    residual : shape (samples,)
        At the fitted values.
    slopes
        Its derivatives by the parameters.
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
    """Covariance of the errors, infinite where nothing determines them, and the directions in which that is so.

    Directions are those of parameters in units in which all slopes are of equal size.
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
    """Which parameters can be changed together without a trace."""
    weights = np.abs(direction) / np.abs(direction).max()
    parts = [(name, value) for name, value, weight in zip(names, direction, weights, strict=True) if weight > 1e-4]
    ratio = " : ".join(f"{value / parts[0][1]:.3g}" for _, value in parts)
    together = " and ".join(name for name, _ in parts)
    return (
        f"the record does not determine {together}: changing them as {ratio} leaves the signal as it is; "
        "fit one less of them"
    )


def _notes(estimates: Sequence[Estimate], residual: NDArray[np.float64], size: float) -> Iterator[str]:
    for each in estimates:
        if np.isnan(each.error):
            yield f"{each.name} ended at its bound {each.value:.6g}; the other errors hold for it there"
        elif np.isfinite(each.error) and each.error > abs(each.value) and each.name != "phase":
            yield f"{each.name} is hardly determined: its standard error is larger than its value"
    squares = float(residual @ residual)
    near = float(residual[1:] @ residual[:-1]) / squares if squares > (_ROUNDING * size) ** 2 else 0.0
    if near > max(_COLOURED, _NOISE / np.sqrt(len(residual))):
        yield (
            f"neighbouring residuals correlate ({near:.2f}): what is left is not only noise, so standard errors are "
            "too small; perhaps the model lacks something, or the record was filtered"
        )
