"""Predictions of special points: polynomials in the parameters, fitted to solutions in other systems, and their error.

The error of a prediction is estimated from solutions that a fit did not know: each solution is compared with the fit to
all others, which follows from one fit and the leverages of the samples (Allen, The relationship between variable
selection and data augmentation and a method for prediction, 1974). A leverage tells how far a sample lies outside of
those that were fitted (Hoaglin and Welsch, The hat matrix in regression and ANOVA, 1978). Here it is a multiple of its
mean over these, which is the number of terms over that of samples: what a polynomial lacks grows from the typical
distance on, however many samples there are. Beyond the farthest sample that judged a fit, its error is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds.critical_multipliers import bounded_product, pair_factors
from gapwalk.bifurcation.loci.follow_locus import equation_of, plane_of
from gapwalk.bifurcation.loci.gradient import shifts, shifts_at, wide_planes
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation, LocusEquation, Place, ShotPlane
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.late_scipy import linalg
from gapwalk.model.system import System
from gapwalk.orbit.floquet import classify, multipliers
from gapwalk.orbit.orbit import describe_switch
from gapwalk.orbit.shooting import Shooting
from gapwalk.orbit.sticking import transition_of

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
            self._left, self._whitening = (
                left,
                np.asarray(linalg.solve_triangular(upper, np.eye(len(upper))), dtype=float),
            )
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
        """Return a bound for the error of a fitted quantity at leverage 0; it grows like 1 + leverage."""
        # Infinite if the samples do not tell all coefficients.
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
        """Fit polynomials to solutions; None if there are too few of them."""
        # Shapes: `unknowns` (samples, unknowns); `derivatives` (samples, unknowns, unknowns).
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


# Special points of one system, found again in systems near by: predicted, corrected by Newton's method, and checked.
#
# A special point solves the equation of its locus (`gapwalk.bifurcation.loci.locus_equations`). In a system with other
# values of its parameters, the implicit function theorem predicts its unknowns (orbit and parameter), and few steps of
# Newton's method correct them. A result counts only if its contacts and its other multipliers are those of the
# original point. Otherwise the point is followed along the straight path between the two systems, in steps that may
# shrink: then it is the same point by continuity, or it is lost.
#
# Where solutions in some hundred systems are known, polynomials fitted to them predict the point and the derivatives
# of its equation (`gapwalk.answers.point_prediction`). One evaluation of the equation is then often enough, without
# derivatives of multipliers.
#
# Where two points of one kind meet and vanish, their equation is singular, and its determinant changes its sign from
# one to the other. So the sign tells two such points apart, also where Newton's method comes to the wrong one.

_STEPS = 8  # of Newton's method at one system
_EXACT = 1e-6  # scaled step after which the error is about the square of it, of any point
_SEEN = 1e-5  # scaled step from which on the next one shows the curvature, and not rounding
ENOUGH = 5e-6
"""Scaled error of the parameter that may be left where the curvature of the equation is known."""
_LONGEST, _FITTED = 0.5, 0.05  # scaled steps that leave the neighbourhood of a prediction by the gradient, or closer
_SHRINKS = 0.5  # by which steps must shrink after the second
_PATH, _SHORTEST = 0.25, 1.0 / 16.0  # first and smallest step along the path between two systems
_TOUCH = 0.05  # radians around a grazing angle within which crossings of the breakpoint are the touch itself
_CHORDS = 3  # steps with a predicted inverse
_ASIDE = 0.02  # scaled distance from a prediction beyond which a point is followed along its path
_FAR = 0.1  # the same, from the first prediction by a gradient; from one by a fit, beyond which it is another point


@dataclass(frozen=True, eq=False)
class Corrected:
    """A special point in another system."""

    unknowns: Array  #: Unknowns of its equation; the last one is the parameter of the branch.
    place: Place  #: The equations of the orbit before the last step of Newton's method.
    equation: LocusEquation  #: Equation of the point in that system.
    curvature: float = 0.0
    """Largest seen ratio of the parameter's part of a step of Newton's method to the square of the step before."""
    orientation: float = 0.0
    """Sign of the determinant of the equation's derivatives; 0 if it is not known."""

    @property
    def value(self) -> float:
        """Value of the parameter of the branch."""
        return float(self.unknowns[-1])


@dataclass(frozen=True, eq=False)
class TrackedPoint:
    """A special point that is found again in systems near by."""

    special: SpecialPoint  #: The point.
    names: tuple[str, ...]  #: The parameters by which the systems differ.
    equation: LocusEquation  #: Equation of its locus, in the plane of the parameter of its branch alone.
    #: unknowns, scales: Unknowns of the point and their scales.
    unknowns: Array
    scales: Array
    fit: Fit | None = field(default=None, repr=False)  #: Predictor of the point from solutions in other systems.

    @classmethod
    def of(cls, special: SpecialPoint, names: Sequence[str]) -> TrackedPoint:
        """Prepare a special point."""
        if special.kind.no_locus:
            raise ModelError(f"{special.kind.no_locus}: it cannot be tracked")
        way = special.orbit.method().for_loci()
        if not isinstance(way, Shooting):
            raise ModelError(f"special points are tracked by shooting, not by {way.name}; write method=Shooting()")
        system, parameter = special.orbit.system, special.parameter
        plane = replace(plane_of(way, special.orbit, (parameter, names[0])), names=(parameter,))
        equation, unknowns, scales = equation_of(plane, special, [abs(system[parameter]) or 1.0])
        return cls(special, tuple(names), equation, unknowns, scales)

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the unknowns by the parameters, shape (unknowns, parameters)."""
        return shifts(self.special, self.names)

    @property
    def value(self) -> float:
        """Value of the parameter of the branch at the point itself."""
        return self.special.value

    @cached_property
    def origin(self) -> Array:
        """Values of the parameters at the point itself."""
        return np.array([self.special.orbit.system[name] for name in self.names])

    @cached_property
    def _place(self) -> Place:
        return self.equation.place(self.unknowns)

    @cached_property
    def signature(self) -> tuple[object, ...]:
        """Contacts of the orbit, and its unstable multipliers besides the critical ones."""
        return self._signature(Corrected(self.unknowns, self._place, self.equation))

    @cached_property
    def orientation(self) -> float:
        """Sign of the determinant of the equation's derivatives."""
        return _sign(self.equation.linearised(self.unknowns)[1])

    def found_at(self, values: Array, guess: Array | None = None) -> Corrected | None:
        """Return the point in the system with other values of the parameters; None if it is lost."""
        start = self.unknowns + self.slopes @ (values - self.origin) if guess is None else guess
        found = self._corrected(self._posed(values), start, _LONGEST if guess is None else _FITTED)
        if found is not None and self._is_like(found):
            distance = float(np.abs((found.unknowns - start) / self.scales).max())
            if distance <= (_FAR if guess is None else _ASIDE):
                return found
        return self._along(values)

    def solved(self, values: Array, unknowns: Array) -> Corrected:
        """Return a known solution in the system with other values of the parameters."""
        equation = self._posed(values)
        return Corrected(unknowns, equation.place(unknowns), equation)

    def plane_at(self, values: Array) -> ShotPlane:
        """Return the plane of the system with other values of the parameters; all points of a branch can share it."""
        system = self.special.orbit.system
        data = system.values.copy()
        data[self._places] = values
        plane = self.equation.plane
        assert isinstance(plane, ShotPlane)
        return plane.with_system(System.from_values(system.structure, data))

    def fitted_at(self, plane: ShotPlane, guess: Guess, enough: float = ENOUGH) -> Corrected | None:
        """Return the point near a fitted prediction; None if it is not there."""
        equation, found = replace(self.equation, plane=plane), None
        if guess.inverse is not None and guess.mismatch < _SHRINKS and _sign(guess.inverse) == self.orientation:
            found = self._by_chords(equation, guess, enough)
        if found is None:
            found = self._corrected(equation, guess.unknowns, _FAR, guess.curvature, enough)
        if found is None or float(np.abs((found.unknowns - guess.unknowns) / self.scales).max()) > _FAR:
            return None
        return found if self._is_like(found) else None

    def derivatives_at(self, found: Corrected) -> Array:
        """Return the derivatives of the equation at a solution, nan if there are none: shape (unknowns, unknowns)."""
        try:
            return found.equation.derivatives(found.unknowns)[1]
        except NumericalError:
            return np.full((len(found.unknowns),) * 2, np.nan)

    def slopes_at(self, found: Corrected) -> Array:
        """Return the derivatives of the unknowns by the parameters in another system, shape (unknowns, parameters)."""
        system = found.equation.plane.system
        planes = (plane.with_system(system) for plane in self._planes)
        return shifts_at(found.equation, found.unknowns, self.scales, planes)

    @cached_property
    def _planes(self) -> tuple[ShotPlane, ...]:
        planes = wide_planes(self.equation.plane, self.names)
        return tuple(plane for plane in planes if isinstance(plane, ShotPlane))

    def _posed(self, values: Array) -> LocusEquation:
        return replace(self.equation, plane=self.plane_at(values))

    @cached_property
    def _places(self) -> list[int]:
        structure = self.special.orbit.system.structure
        return [structure.place(name) for name in self.names]

    def _corrected(
        self, equation: LocusEquation, guess: Array, longest: float, known: float = np.inf, enough: float = ENOUGH
    ) -> Corrected | None:
        """Correct a guess by Newton's method; None if it does not converge near by."""
        # With a `known` bound of the curvature, an error may be left that is small `enough`. Then the next step needs
        # no further derivatives if those of this one leave little enough of it: they change by the curvature times the
        # step.
        unknowns, before, curvature = guess, np.inf, 0.0
        for count in range(_STEPS):
            try:
                residual, jacobian, place = equation.derivatives(unknowns)
                inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
                step = -(inverse @ residual) / self.scales
            except (NumericalError, np.linalg.LinAlgError):
                return None
            length = float(np.abs(step).max())
            if not length <= longest or (count > 1 and length > max(_SHRINKS * before, _EXACT)):
                return None
            if count and before > _SEEN:
                curvature = max(curvature, abs(float(step[-1])) / before**2)
            unknowns, before = unknowns + step * self.scales, length
            if length <= _EXACT or known * length**2 <= enough:
                return Corrected(unknowns, place, equation, curvature, _sign(jacobian))
            left = 2.0 * known * length
            if left <= _SHRINKS and left * known * length**2 <= enough:
                chord = self._by_chords(equation, Guess(unknowns, inverse, left, known), enough)
                if chord is not None:
                    return chord
        return None

    def _by_chords(self, equation: LocusEquation, guess: Guess, enough: float) -> Corrected | None:
        """Correct a guess by steps with the predicted inverse; None if they do not come near enough."""
        assert guess.inverse is not None
        unknowns = guess.unknowns
        for _ in range(_CHORDS):
            try:
                residual, place = equation.residual(unknowns)
            except NumericalError:
                return None
            step = -guess.inverse @ residual
            length = float(np.abs(step / self.scales).max())
            rest = guess.mismatch + guess.curvature * length
            if not length <= _FITTED or rest > _SHRINKS:
                return None
            unknowns = unknowns + step
            if rest * length <= enough:
                return Corrected(unknowns, place, equation, orientation=_sign(guess.inverse))
        return None

    def _is_like(self, found: Corrected) -> bool:
        """Compare sign, contacts and multipliers with those of the point; beside a graze only of the last iterate."""
        if found.orientation * self.orientation < 0.0:
            return False
        if self._signature(found) == self.signature:
            return True
        try:
            place = found.equation.place(found.unknowns)
        except NumericalError:
            return False
        return self._signature(replace(found, place=place)) == self.signature

    def _along(self, values: Array) -> Corrected | None:
        """Follow the point along the straight path to other values; None if it does not reach them."""
        before, now = (0.0, self.unknowns), (0.0, self.unknowns)
        step, found = _PATH, None
        way = values - self.origin
        while now[0] < 1.0:
            share = min(1.0, now[0] + step)
            if now[0] == 0.0:
                guess = self.unknowns + self.slopes @ (share * way)
            else:
                guess = now[1] + (now[1] - before[1]) * ((share - now[0]) / (now[0] - before[0]))
            found = self._corrected(self._posed(self.origin + share * way), guess, _FITTED)
            if found is not None and np.abs((found.unknowns - guess) / self.scales).max() <= _ASIDE:
                before, now, step = now, (share, found.unknowns), 1.5 * step
            elif step <= _SHORTEST:
                return None
            else:
                step *= 0.5
        return found

    def _signature(self, found: Corrected) -> tuple[object, ...]:
        equation, arc = self.equation, found.place.evidence
        closings: dict[int, int] = {}
        for event in arc.contacts:
            if not event.enters:
                continue
            if isinstance(equation, GrazingEquation) and event.switch == equation.switch:
                period = PERIOD * equation.period
                aside = abs((event.theta - float(found.unknowns[-2]) + 0.5 * period) % period - 0.5 * period)
                if aside < _TOUCH:
                    continue
            closings[event.switch] = closings.get(event.switch, 0) + 1
        values = multipliers([transition_of(arc)])
        kind = self.special.kind
        critical = kind.critical_multiplier(values)
        if not np.isnan(critical):
            keep = np.abs(values - critical) > 0.0
            if abs(critical.imag) > 0.0:
                keep &= np.abs(values - critical.conjugate()) > 0.0
            values = values[keep]
        return tuple(sorted(closings.items())), classify(values)


def _sign(matrix: Array) -> float:
    """Return the sign of the determinant of a matrix."""
    return float(np.linalg.slogdet(matrix)[0])


# Near misses: where a branch nearly has two more special points, which it may have in other systems.
#
# Two special points of one kind are born where an extremum of a test function along the branch passes zero: of the
# distance of a multiplier from +1, from -1 or from the unit circle, or of the depth of a contact beyond a breakpoint.
# Linear fits to the extrema that walks met tell in which other samples an extremum may have passed it.

_SURE = 4.0  # standard errors of a prediction by which an extremum must be away from zero
_TURN = 0.3  # radians by which a turning point may move from point to point of a walk


@dataclass(frozen=True)
class Miss:
    """Extremum of a test function next to zero, along a branch."""

    what: str  #: Kind of the special points that would be born there, and the contact.
    place: int  #: Number of special points of the walk before it.
    size: float  #: Distance of the test function from zero.


@dataclass(frozen=True, eq=False)
class Watch:
    """Linear prediction of a near miss of one stretch of the branch."""

    stretch: int  #: Number of the stretch; see `Patterns`.
    coefficients: Array  #: shape (terms,): Coefficients of the distance from zero.
    whitening: Array  #: shape (terms, terms): Map of the terms whose squared length is the leverage.
    error: float  #: Standard error of a prediction at leverage 0; its square grows like 1 + leverage.

    def is_near(self, terms: Terms) -> NDArray[np.bool_]:
        """Return for each sample True if the extremum may have passed zero."""
        own = terms.of(1)
        errors = self.error * np.sqrt(1.0 + np.square(own @ self.whitening).sum(axis=1))
        return own @ self.coefficients < _SURE * errors


def misses_of(branch: Branch) -> tuple[Miss, ...]:
    """Return the near misses along a walked branch."""
    lengths = np.array([special.point.arclength for special in branch.special_points])
    return tuple(
        Miss(what, int(np.sum(lengths < branch.points[k].arclength)), size)
        for what, k, size in (*_of_multipliers(branch.points), *_of_depths(branch.points))
    )


def watches_of(found: Sequence[tuple[int, Sequence[tuple[int, Miss]]]], regressions: Regressions) -> tuple[Watch, ...]:
    """Return the predictions of near misses that walks met."""
    groups: dict[tuple[str, int], dict[int, float]] = {}
    for sample, misses in found:
        for stretch, miss in misses:
            sizes = groups.setdefault((miss.what, stretch), {})
            sizes[sample] = min(miss.size, sizes.get(sample, np.inf))
    watches = []
    for (_, stretch), sizes in groups.items():
        rows, values = np.array([*sizes], dtype=np.intp), np.array([*sizes.values()])
        of = regressions.best(rows, 1)
        if of is None:
            continue
        error = float(np.sqrt(np.mean(np.square(of.left_out(values)))))
        watch = Watch(stretch, of.fit(values), of.cloud.whitening, error)
        # where not even the mean of the samples is sure, nothing is known
        if float(values.mean()) > _SURE * error:
            watches.append(watch)
    return tuple(watches)


def _of_multipliers(points: Sequence[BranchPoint]) -> Iterator[tuple[str, int, float]]:
    """Yield kind, number of the point and size of each near miss of a multiplier."""
    functions: dict[str, Callable[[NDArray[np.complex128]], NDArray[np.complex128]]] = {
        "fold": lambda values: values - 1.0,
        "flip": lambda values: values + 1.0,
        "neimark-sacker": pair_factors,
    }
    for what, function in functions.items():
        sizes = [bounded_product(function(point.orbit.free_multipliers)) for point in points]
        for k in range(1, len(points) - 1):
            if _is_near(sizes[k - 1], sizes[k], sizes[k + 1]):
                yield what, k, abs(sizes[k])


def _of_depths(points: Sequence[BranchPoint]) -> Iterator[tuple[str, int, float]]:
    """Yield kind and contact, number of the point and size of each near miss of a grazing contact."""
    for k in range(1, len(points) - 1):
        before, here, after = (points[j].orbit for j in (k - 1, k, k + 1))
        full = PERIOD * here.period
        for switch, turns in enumerate(here.turning_depths):
            beside = before.turning_depths[switch], after.turning_depths[switch]
            if not all(each.thetas for each in beside):
                continue
            for theta, depth in zip(turns.thetas, turns.values, strict=True):
                places = [each.nearest(theta, full) for each in beside]
                apart = [
                    abs((each.thetas[place] - theta + 0.5 * full) % full - 0.5 * full)
                    for each, place in zip(beside, places, strict=True)
                ]
                if max(apart) <= _TURN and _is_near(beside[0].values[places[0]], depth, beside[1].values[places[1]]):
                    side = "beyond" if depth > 0.0 else "before"
                    yield f"grazing {describe_switch(here, switch)} {side}", k, abs(depth)


def _is_near(before: float, here: float, after: float) -> bool:
    """Return True if a function has an extremum next to zero that does not reach it."""
    return before * here > 0.0 and here * after > 0.0 and abs(here) < min(abs(before), abs(after))
