"""Predictions of special points: polynomials in the parameters, fitted to solutions in other systems, and their error.

The error of a prediction is estimated from solutions that a fit did not know: each solution is compared with the fit to
all others, which follows from one fit and the leverages of the samples (Allen, The relationship between variable
selection and data augmentation and a method for prediction, 1974). A leverage tells how far a sample lies outside of
those that were fitted (Hoaglin and Welsch, The hat matrix in regression and ANOVA, 1978). Here it is a multiple of its
mean over these, which is the number of terms over that of samples: what a polynomial lacks grows from the typical
distance on, however many samples there are. Beyond the farthest sample that judged a fit, its error is not known.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]

_FEATURES = 2.0  # samples needed for each coefficient of a fitted predictor
_DEGREES = (3, 2, 1)  # of fitted predictors
_CLOUD = 5.0  # a bound, as a multiple of the most that solutions showed
_RANK = 1e-10  # share of the largest size below which samples do not tell a coefficient
_ALONE = 1e-9  # share of a residual that is left where one sample alone tells a coefficient


def count_of_terms(parameters: int, degree: int) -> int:
    """Return the number of terms of a polynomial."""
    return comb(parameters + degree, degree)


def degree_for(samples: int, parameters: int) -> int:
    """Return the degree of the polynomials that some samples tell; 0 if they are too few for any."""
    return next((d for d in _DEGREES if samples >= _FEATURES * count_of_terms(parameters, d)), 0)


def polynomial(values: Array, degree: int) -> Array:
    """Return all products of up to `degree` columns, shape (rows, products), beginning with 1."""
    columns = [np.ones(len(values))]
    for order in range(1, degree + 1):
        choices = combinations_with_replacement(range(values.shape[1]), order)
        columns += [np.prod(values[:, list(chosen)], axis=1) for chosen in choices]
    return np.column_stack(columns)


class Terms:
    """Terms of polynomials at some samples, and their leverages, each computed once.

    Shapes: `x` (samples, parameters).
    """

    def __init__(self, x: Array) -> None:
        self.x = x
        self._terms: dict[int, Array] = {}
        self._leverages: dict[int, tuple[Cloud, Array]] = {}

    def of(self, degree: int) -> Array:
        """Return the terms up to a degree, shape (samples, terms)."""
        if degree not in self._terms:
            self._terms[degree] = polynomial(self.x, degree)
        return self._terms[degree]

    def leverages(self, cloud: Cloud) -> Array:
        """Return how far the samples lie outside of those of a fit; infinity beyond all that judged it."""
        if id(cloud) not in self._leverages:
            found = np.square(self.of(cloud.degree) @ cloud.whitening).sum(axis=1)
            self._leverages[id(cloud)] = cloud, np.where(found <= cloud.reach, found, np.inf)
        return self._leverages[id(cloud)][1]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Samples to which polynomials were fitted, reduced to what their leverages need."""

    degree: int  #: Degree of the polynomials.
    whitening: Array  #: shape (terms, terms): Map of the terms whose squared length is the leverage.
    reach: float  #: Largest leverage of a sample of the fit with respect to all others.


class Regression:
    """Least squares of polynomials at some samples; the samples are decomposed once for all that is fitted there.

    Shapes: `x` (samples, parameters).
    """

    def __init__(self, x: Array, degree: int) -> None:
        self.degree, terms = degree, polynomial(x, degree)
        left, upper = np.linalg.qr(terms)
        sizes = np.abs(upper.diagonal())
        self._is_full = len(terms) >= terms.shape[1] and bool(sizes.min() > _RANK * sizes.max())
        if self._is_full:
            self._left, self._whitening = left, np.asarray(solve_triangular(upper, np.eye(len(upper))), dtype=float)
        else:
            left, sizes, right = np.linalg.svd(terms, full_matrices=False)
            kept = sizes > _RANK * sizes[0]
            self._left, self._whitening = left[:, kept], right[kept].T / sizes[kept]

    def fit(self, y: Array) -> Array:
        """Return the coefficients for some quantities, shape (terms, quantities)."""
        return self._whitening @ (self._left.T @ y)

    def left_out(self, y: Array) -> Array:
        """Return how much each sample differs from the fit to all others, shape (samples, quantities)."""
        rest = y - self._left @ (self._left.T @ y)
        return rest / np.maximum(1.0 - self._leverages, _ALONE).reshape(-1, *[1] * (y.ndim - 1))

    def unit_error(self, y: Array) -> float:
        """Return a bound for the error of a fitted quantity at leverage 0; it grows like 1 + leverage.

        Infinite if the samples do not tell all coefficients.
        """
        return _CLOUD * float((np.abs(self.left_out(y)) / (1.0 + self.outside)).max()) if self._is_full else np.inf

    @cached_property
    def cloud(self) -> Cloud:
        """The samples, for the leverages of others."""
        return Cloud(self.degree, self._whitening * np.sqrt(self._typical), float(self.outside.max()))

    @cached_property
    def _leverages(self) -> Array:
        return np.square(self._left).sum(axis=1)

    @property
    def outside(self) -> Array:
        """Leverage of each sample with respect to all others."""
        return self._typical * self._leverages / np.maximum(1.0 - self._leverages, _ALONE)

    @property
    def _typical(self) -> float:
        """Inverse of the mean leverage."""
        return len(self._left) / self._left.shape[1]


class Regressions:
    """Regressions at choices of some samples, each decomposed once.

    Shapes: `x` (samples, parameters).
    """

    def __init__(self, x: Array) -> None:
        self.x = x
        self._known: dict[tuple[bytes, int], Regression] = {}

    def at(self, rows: NDArray[np.intp], degree: int) -> Regression:
        """Return the regression at some samples."""
        key = rows.tobytes(), degree
        if key not in self._known:
            self._known[key] = Regression(self.x[rows], degree)
        return self._known[key]

    def best(self, rows: NDArray[np.intp], most: int = _DEGREES[0]) -> Regression | None:
        """Return the regression of the highest degree that so many samples tell; None if they are too few."""
        degree = min(most, degree_for(len(rows), self.x.shape[1]))
        return self.at(rows, degree) if degree else None


class Guess(NamedTuple):
    """Prediction of a special point in one sample."""

    unknowns: Array  #: Predicted unknowns.
    inverse: Array | None = None  #: Predicted inverse of the derivatives of the equation; None if there is none.
    mismatch: float = np.inf  #: Bound of the share of a step that this inverse leaves in the parameter.
    #: Bound of the ratio of the parameter's part of a step of Newton's method to the square of the step before.
    curvature: float = np.inf


class Predicted(NamedTuple):
    """Predictions of a special point in some samples."""

    unknowns: Array  #: shape (samples, unknowns): Predicted unknowns.
    #: shape (samples,): Bounds of the error of the predicted parameter; infinity beyond the samples that judged the
    #: fit.
    errors: Array
    #: shape (samples, unknowns, unknowns): Predicted inverses of the derivatives of the equation; None if there are
    #: none.
    inverses: Array | None
    #: mismatches, curvatures: shape (samples,): As in `Guess`.
    mismatches: Array
    curvatures: Array

    def at(self, k: int) -> Guess:
        """Return the prediction in one sample."""
        inverse = None if self.inverses is None else self.inverses[k]
        return Guess(self.unknowns[k], inverse, float(self.mismatches[k]), float(self.curvatures[k]))


@dataclass(frozen=True, eq=False)
class DerivativesFit:
    """Polynomials in the parameters that predict the derivatives of the equation of a special point at its solution.

    They are predicted rather than their inverse: where two points meet and vanish, the inverse grows without bound.
    """

    degree: int  #: Degree of the polynomials.
    coefficients: Array  #: shape (terms, unknowns squared): Coefficients of the derivatives.
    cloud: Cloud  #: The samples of the fit.
    #: shape (unknowns,): Weights of the last row of an inverse; with them it gives a length to which mismatch and
    #: curvature are relative.
    weights: Array
    #: mismatch, curvature: These bounds per unit of that length, at leverage 0; see `Guess`.
    mismatch: float
    curvature: float

    @classmethod
    def to(cls, of: Regression, derivatives: Array, curvatures: Array, scales: Array) -> DerivativesFit:
        """Fit polynomials to derivatives, shape (samples, unknowns, unknowns), at solutions; see `Fit.to`."""
        size = len(scales)
        flat = derivatives.reshape(-1, size * size)
        rest = of.left_out(flat).reshape(-1, size, size)
        inverses = _inverses(derivatives - rest)
        weights = np.sqrt(np.square(rest * scales).sum(axis=2).mean(axis=0)) / scales[-1]
        lengths = np.abs(inverses[:, -1]) @ weights
        shares = np.abs((inverses @ rest)[:, -1] * scales / scales[-1]).sum(axis=1) / (1.0 + of.outside)
        seen = ~np.isnan(curvatures)
        return cls(
            of.degree,
            of.fit(flat),
            of.cloud,
            weights,
            _CLOUD * float((shares / lengths).max()),
            _CLOUD * float((curvatures[seen] / lengths[seen]).max()) if seen.any() else np.inf,
        )

    def predicted(self, terms: Terms) -> tuple[Array, Array, Array]:
        """Return inverses, mismatches and curvatures at some samples; see `Predicted`."""
        size = len(self.weights)
        inverses = _inverses((terms.of(self.degree) @ self.coefficients).reshape(-1, size, size))
        lengths = np.abs(inverses[:, -1]) @ self.weights
        leverages = terms.leverages(self.cloud)
        return inverses, self.mismatch * lengths * (1.0 + leverages), self.curvature * lengths


def _inverses(matrices: Array) -> Array:
    """Return the inverses of some matrices; nan where there is none."""
    singular = np.linalg.slogdet(matrices)[0] == 0.0
    found = np.asarray(
        np.linalg.inv(np.where(singular[:, None, None], np.eye(matrices.shape[1]), matrices)), dtype=float
    )
    found[singular] = np.nan
    return found


@dataclass(frozen=True, eq=False)
class Fit:
    """Polynomials in the parameters that predict the unknowns of a special point, and how to correct them."""

    #: origin, widths: Values of the parameters at zero, and their units.
    origin: Array
    widths: Array
    degree: int  #: Degree of the polynomials.
    coefficients: Array  #: shape (terms, unknowns): Coefficients of the unknowns.
    cloud: Cloud | None = None  #: The samples of the fit; None if too few are known to judge its error.
    #: Bound for the error of the predicted parameter at leverage 0; it grows like 1 + leverage.
    unit_error: float = np.inf
    #: Predictor of the derivatives of the equation; None if they are not known.
    derivatives: DerivativesFit | None = None

    @classmethod
    def to(
        cls,
        scaled: tuple[Array, Array],
        regressions: Regressions,
        rows: NDArray[np.intp],
        unknowns: Array,
        scales: Array,
        *,
        slopes: Array | None = None,
        derivatives: Array | None = None,
        curvatures: Array | None = None,
    ) -> Fit | None:
        """Fit polynomials to solutions; None if there are too few of them.

        Shapes: `unknowns` (samples, unknowns); `derivatives` (samples, unknowns, unknowns).
        """
        origin, widths = scaled
        of = regressions.best(rows)
        if of is None:
            if slopes is None or not len(rows):
                return None
            slopes = slopes * widths
            coefficients = np.vstack(((unknowns - regressions.x[rows] @ slopes.T).mean(axis=0), slopes.T))
            return cls(origin, widths, 1, coefficients)
        known = None
        if derivatives is not None and curvatures is not None:
            seen = np.flatnonzero(~np.isnan(derivatives).any(axis=(1, 2)))
            by = regressions.best(rows[seen])
            if by is not None:
                known = DerivativesFit.to(by, derivatives[seen], curvatures[seen], scales)
        error = of.unit_error(unknowns[:, -1])
        return cls(origin, widths, of.degree, of.fit(unknowns), of.cloud, error, known)

    def terms(self, values: Array) -> Terms:
        """Return the terms of polynomials at some samples."""
        return Terms((values - self.origin) / self.widths)

    def predicted(self, terms: Terms) -> Predicted:
        """Return the predictions at some samples."""
        unknowns, beyond = terms.of(self.degree) @ self.coefficients, np.full(len(terms.x), np.inf)
        errors = beyond
        if self.cloud is not None and np.isfinite(self.unit_error):
            errors = self.unit_error * (1.0 + terms.leverages(self.cloud))
        steps = (None, beyond, beyond) if self.derivatives is None else self.derivatives.predicted(terms)
        return Predicted(unknowns, errors, *steps)
