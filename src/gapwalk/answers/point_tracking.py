"""Special points of one system, found again in systems near by: predicted, corrected by Newton's method, and checked.

A special point solves the equation of its locus (`gapwalk.bifurcation.loci.locus_equations`). In a system with other
values of its parameters, the implicit function theorem predicts its unknowns (orbit and parameter), and few steps of
Newton's method correct them. A result counts only if its contacts and its other multipliers are those of the original
point. Otherwise the point is followed along the straight path between the two systems, in steps that may shrink: then
it is the same point by continuity, or it is lost.

Where solutions in some hundred systems are known, polynomials fitted to them predict the point and the inverse of its
equation's derivatives (`Fit`). One evaluation of the equation is then often enough, without derivatives of multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.loci.gradient import shifts, shifts_at, wide_planes
from gapwalk.bifurcation.loci.locus_equations import GrazingEquation, LocusEquation
from gapwalk.bifurcation.loci.locus_start import equation_of, plane_of
from gapwalk.bifurcation.loci.orbit_plane import Place, ShotPlane
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.flow import PERIOD
from gapwalk.model.system import System
from gapwalk.orbit.floquet import classify, multipliers
from gapwalk.orbit.shooting import Shooting
from gapwalk.orbit.sticking import transition_of

Array = NDArray[np.float64]

_STEPS = 8  # of Newton's method at one system
_EXACT = 1e-6  # scaled step after which the error is about the square of it, of any point
_SEEN = 1e-5  # scaled step from which on the next one shows the curvature, and not rounding
_ENOUGH = 5e-6  # scaled error of the parameter that may be left where the curvature of the equation is known
_LONGEST, _FITTED = 0.5, 0.05  # scaled steps that leave the neighbourhood of a prediction by the gradient, or closer
_SHRINKS = 0.5  # by which steps must shrink after the second
_PATH, _SHORTEST = 0.25, 1.0 / 16.0  # first and smallest step along the path between two systems
_TOUCH = 0.05  # radians around a grazing angle within which crossings of the breakpoint are the touch itself
_FEATURES = 2.0  # samples needed for each coefficient of a fitted predictor
_DEGREES = (3, 2, 1)  # of fitted predictors
_CLOUD = 3.0  # a bound, as a multiple of what most solutions showed
_CHORDS = 3  # steps with a predicted inverse
_HELD = 5  # one of so many solutions judges a fit to the others
_ASIDE = 0.02  # scaled distance from a prediction beyond which a point is followed along its path
_FAR = 0.1  # the same, from the first prediction by a gradient; from one by a fit, beyond which it is another point


@dataclass(frozen=True, eq=False)
class Corrected:
    """A special point in another system.

    Attributes
    ----------
    unknowns
        Unknowns of its equation; the last one is the parameter of the branch.
    place
        The equations of the orbit before the last step of Newton's method.
    equation
        Equation of the point in that system.
    """

    unknowns: Array
    place: Place
    equation: LocusEquation
    curvature: float = 0.0
    """Largest seen ratio of the parameter's part of a step of Newton's method to the square of the step before."""

    @property
    def value(self) -> float:
        """Value of the parameter of the branch."""
        return float(self.unknowns[-1])


@dataclass(frozen=True, eq=False)
class TrackedPoint:
    """A special point that is found again in systems near by.

    Parameters
    ----------
    special
        The point.
    names
        The parameters by which the systems differ.
    equation
        Equation of its locus, in the plane of the parameter of its branch alone.
    unknowns, scales
        Unknowns of the point and their scales.
    fit
        Predictor of the point from solutions in other systems.
    """

    special: SpecialPoint
    names: tuple[str, ...]
    equation: LocusEquation
    unknowns: Array
    scales: Array
    fit: Fit | None = field(default=None, repr=False)

    @classmethod
    def of(cls, special: SpecialPoint, names: Sequence[str]) -> TrackedPoint:
        """Prepare a special point.

        Raises
        ------
        ModelError
            If its kind has no equation, or its orbits are not found by shooting.
        ConvergenceError
            If it does not satisfy its equation.
        """
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

    def found_at(self, values: Array, guess: Array | None = None) -> Corrected | None:
        """Return the point in the system with other values of the parameters; None if it is lost.

        Parameters
        ----------
        values
            The values, in the order of `names`; the system must allow them.
        guess
            Predicted unknowns; by default the gradient predicts them.
        """
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

    def fitted_at(self, plane: ShotPlane, guess: Array, inverse: Array | None) -> Corrected | None:
        """Return the point near a fitted prediction; None if it is not there.

        Parameters
        ----------
        plane
            The plane of the system (`plane_at`).
        guess, inverse
            Predicted unknowns, and the predicted inverse of the derivatives; see `Fit.predicted`.
        """
        equation = replace(self.equation, plane=plane)
        found = None if inverse is None else self._by_chords(equation, guess, inverse)
        if found is None:
            found = self._corrected(equation, guess, _FAR)
        if found is None or float(np.abs((found.unknowns - guess) / self.scales).max()) > _FAR:
            return None
        return found if self._is_like(found) else None

    def inverse_at(self, found: Corrected) -> Array:
        """Return the inverse of the derivatives at a solution, nan if there is none: shape (unknowns, unknowns)."""
        try:
            return found.equation.inverse(found.unknowns)
        except (NumericalError, np.linalg.LinAlgError):
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

    def _corrected(self, equation: LocusEquation, guess: Array, longest: float) -> Corrected | None:
        """Correct a guess by Newton's method; None if it does not converge near by."""
        unknowns, before, curvature = guess, np.inf, 0.0
        known = np.inf if self.fit is None else self.fit.curvature
        for count in range(_STEPS):
            try:
                residual, jacobian, place = equation.linearised(unknowns)
                step = np.linalg.solve(jacobian * self.scales, -residual)
            except (NumericalError, np.linalg.LinAlgError):
                return None
            length = float(np.abs(step).max())
            if not length <= longest or (count > 1 and length > max(_SHRINKS * before, _EXACT)):
                return None
            if count and before > _SEEN:
                curvature = max(curvature, abs(float(step[-1])) / before**2)
            unknowns, before = unknowns + step * self.scales, length
            if length <= _EXACT or known * length**2 <= _ENOUGH:
                return Corrected(unknowns, place, equation, curvature)
        return None

    def _by_chords(self, equation: LocusEquation, guess: Array, inverse: Array) -> Corrected | None:
        """Correct a guess by steps with a predicted inverse; None if they shrink too slowly."""
        assert self.fit is not None
        unknowns, before = guess, np.inf
        for count in range(_CHORDS):
            try:
                residual, place = equation.residual(unknowns)
            except NumericalError:
                return None
            step = -inverse @ residual
            length = float(np.abs(step / self.scales).max())
            if not length <= _FITTED or (count and length > _SHRINKS * before):
                return None
            unknowns = unknowns + step
            # what the inverse leaves of a step; after the second step it is seen
            rest = self.fit.mismatch + self.fit.curvature * length if not count else length / before
            if rest * length <= _ENOUGH:
                return Corrected(unknowns, place, equation)
            before = length
        return None

    def _is_like(self, found: Corrected) -> bool:
        """Compare contacts and multipliers with those of the point; beside a graze only those of the last iterate."""
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


@dataclass(frozen=True, eq=False)
class Fit:
    """Polynomials in the parameters that predict the unknowns of a special point, and how to correct them.

    Parameters
    ----------
    origin, widths
        Values of the parameters at zero, and their units.
    degree
        Degree of the polynomials.
    coefficients : shape (terms, unknowns)
        Coefficients of the unknowns.
    inverses : shape (terms, unknowns squared), or empty
        Coefficients of the inverse of the equation's derivatives.
    curvature
        Ratio of the parameter's part of a step of Newton's method to the square of the step before, that hardly any
        solution exceeded.
    mismatch
        Share of a step that the predicted inverse leaves in the parameter, that hardly any solution exceeded.
    """

    origin: Array
    widths: Array
    degree: int
    coefficients: Array
    inverses: Array
    curvature: float = np.inf
    mismatch: float = np.inf

    @classmethod
    def to(
        cls,
        scaled: tuple[Array, Array],
        values: Array,
        unknowns: Array,
        scales: Array,
        *,
        slopes: Array | None = None,
        inverses: Array | None = None,
        curvatures: Array | None = None,
    ) -> Fit | None:
        """Fit polynomials to solutions; None if there are too few of them.

        Parameters
        ----------
        scaled
            Values of the parameters at zero, and their units.
        values : shape (samples, parameters)
            Values of the parameters of the solutions.
        unknowns : shape (samples, unknowns)
            The solutions.
        scales
            Scales of the unknowns.
        slopes
            Derivatives of the unknowns by the parameters, which serve where there are few solutions.
        inverses : shape (samples, unknowns, unknowns)
            Inverses of the equation's derivatives at the solutions; nan where they are not known.
        curvatures
            Curvatures seen by Newton's method; nan where they are not known.
        """
        origin, widths = scaled
        x, size = (values - origin) / widths, unknowns.shape[1]
        degree = next((d for d in _DEGREES if len(x) >= _FEATURES * count_of_terms(x.shape[1], d)), 0)
        nothing = np.zeros((0, size * size))
        if not degree:
            if slopes is None or not len(x):
                return None
            slopes = slopes * widths
            coefficients = np.vstack(((unknowns - x @ slopes.T).mean(axis=0), slopes.T))
            return cls(origin, widths, 1, coefficients, nothing)
        coefficients = _least_squares(x, unknowns, degree)
        if inverses is None or curvatures is None:
            return cls(origin, widths, degree, coefficients, nothing)
        seen = ~np.isnan(inverses).any(axis=(1, 2))
        own = next((d for d in _DEGREES if seen.sum() >= _FEATURES * count_of_terms(x.shape[1], d)), 0)
        if not own:
            return cls(origin, widths, degree, coefficients, nothing)
        own = min(own, degree)
        flat, judged = inverses[seen].reshape(-1, size * size), np.arange(seen.sum()) % _HELD == 0
        tried = polynomial(x[seen][judged], own) @ _least_squares(x[seen][~judged], flat[~judged], own)
        rest = tried.reshape(-1, size, size) @ np.linalg.inv(inverses[seen][judged]) - np.eye(size)
        mismatch = np.abs(rest[:, -1] * scales / scales[-1]).sum(axis=1)
        found = _least_squares(x[seen], flat, own)
        padded = np.zeros((coefficients.shape[0], size * size))
        padded[: len(found)] = found
        return cls(
            origin,
            widths,
            degree,
            coefficients,
            padded,
            # without any, the second step shows what an inverse leaves
            np.inf if np.isnan(curvatures).all() else _CLOUD * float(np.nanquantile(curvatures, 0.99)),
            _CLOUD * float(np.quantile(mismatch, 0.99)),
        )

    def predicted(self, values: Array) -> tuple[Array, Array | None]:
        """Return unknowns, shape (samples, unknowns), and inverses, (samples, unknowns, unknowns), at some samples."""
        terms, size = polynomial((values - self.origin) / self.widths, self.degree), self.coefficients.shape[1]
        inverses = (terms @ self.inverses).reshape(-1, size, size) if len(self.inverses) else None
        return terms @ self.coefficients, inverses


def _least_squares(x: Array, y: Array, degree: int) -> Array:
    return np.asarray(np.linalg.lstsq(polynomial(x, degree), y)[0], dtype=float)


def count_of_terms(parameters: int, degree: int) -> int:
    """Return the number of terms of a polynomial."""
    return comb(parameters + degree, degree)


def polynomial(values: Array, degree: int) -> Array:
    """Return all products of up to `degree` columns, shape (rows, products), beginning with 1."""
    columns = [np.ones(len(values))]
    for order in range(1, degree + 1):
        choices = combinations_with_replacement(range(values.shape[1]), order)
        columns += [np.prod(values[:, list(chosen)], axis=1) for chosen in choices]
    return np.column_stack(columns)
