"""Special points of one system, found again in systems near by: predicted, corrected by Newton's method, and checked.

A special point solves the equation of its locus (`gapwalk.bifurcation.loci.locus_equations`). In a system with other
values of its parameters, the implicit function theorem predicts its unknowns (orbit and parameter), and few steps of
Newton's method correct them. A result counts only if its contacts and its other multipliers are those of the original
point. Otherwise the point is followed along the straight path between the two systems, in steps that may shrink: then
it is the same point by continuity, or it is lost.

Where solutions in some hundred systems are known, polynomials fitted to them predict the point and the derivatives of
its equation (`gapwalk.answers.point_prediction`). One evaluation of the equation is then often enough,
without derivatives of multipliers.

Where two points of one kind meet and vanish, their equation is singular, and its determinant changes its sign from one
to the other. So the sign tells two such points apart, also where Newton's method comes to the wrong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_prediction import Fit, Guess
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
        self,
        equation: LocusEquation,
        guess: Array,
        longest: float,
        known: float = np.inf,
        enough: float = ENOUGH,
    ) -> Corrected | None:
        """Correct a guess by Newton's method; None if it does not converge near by.

        With a `known` bound of the curvature, an error may be left that is small `enough`. Then the next step needs no
        further derivatives if those of this one leave little enough of it: they change by the curvature times the step.
        """
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
