"""Error estimate for points of a branch from a second computation with another or finer discretisation.

Shooting uses one segment more, harmonic balance 50 % more harmonics. The difference between the two computations is an
estimate of the error. Where it is rounding, it may be small by chance, or both computations may share the error. So the
effect of the rounding of the residual is added: what remains of it where the branch is ill-conditioned.

Method: docs/numerics/special-points.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, length_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.orbit_equation import OrbitEquation, roundings

if TYPE_CHECKING:
    from gapwalk.bifurcation.step_interval import Zero

SAFETY = 4.0  # factor on the difference of two computations, neither of which is exact
_NODES = np.array([-1.0, -0.75, -0.45, 0.45, 0.75, 1.0])  # places of points near a crossing, as multiples of the reach
_REAL = 1e-6  # imaginary part below which a root counts as real
_SAME = 1e-13  # distance in scaled variables, by rounding only, from a point to its correction
_AT = 1e-6  # distance of the critical multiplier from +1 or -1 that its own rounding explains
_NOTABLE, _FARTHEST = 1e-10, 1e-3  # scaled distances by rounding from and up to which it is asked how far it leads
_FURTHER, _BENDS = 4.0, 2.0  # factor on the distance, and that on the rounding of a residual that it must exceed
ROUNDING = 2e-14
"""Relative error of a parameter that both computations share, from the flow: about 1e-15 in each of its steps."""


class ErrorEstimator:
    """Error estimator that computes the branch of a corrector with another discretisation."""

    def __init__(self, corrector: Corrector) -> None:
        self._equation = cast("OrbitEquation", corrector.equation)
        self._own = corrector
        self._other = self._equation.otherwise()
        self._known = corrector.scales
        known = corrector.scales[:-1]
        velocity = known[min(self._equation.system.size, len(known) - 1)]  # harmonic balance has no velocities
        scales = self._other.scales(1.0, velocity / known[0])
        scales *= known[0] / scales[0]  # so that lengths along the branch are equal in both
        self._corrector = Corrector(self._other, np.append(scales, corrector.scales[-1]))

    @property
    def corrector(self) -> Corrector:
        """Corrector for the branch of the second computation."""
        return self._corrector

    def at(self, point: BranchPoint, shift: float = 0.0) -> BranchPoint:
        """Return the point of the second computation in the plane normal to a point's tangent, `shift` along it."""
        along = self._embedded(point.tangent)
        try:
            start = self._ahead(point, shift)
        except NumericalError:
            start = self._embedded(point.x) + shift * along
        correction = self._corrector.correct(start, along / np.linalg.norm(along))
        if correction is None:
            raise NumericalError(f"no orbit is found at {point.value:.12g} with another discretisation")
        if correction.distance <= _SAME:
            return self._corrector.point(correction, along, point.arclength + shift)
        # evaluated exactly there: the correction may have been evaluated one Newton step away
        return self._corrector.exact_point(correction.x, along, point.arclength + shift)

    def _ahead(self, point: BranchPoint, shift: float) -> NDArray[np.float64]:
        """Return the scaled unknowns of the motion that lies `shift` along the tangent at a point, to first order.

        They are computed from the motion itself, because the other discretisation has additional unknowns, which also
        change along the branch.
        """
        orbit, value = point.orbit, float(point.x[-1])
        if shift:
            x = (point.x + shift * point.tangent) * self._known
            orbit = self._equation.orbit(x[:-1], float(x[-1]), self._equation.evaluate(x[:-1], float(x[-1])))
            value += shift * float(point.tangent[-1])
        return np.append(self._other.unknowns(orbit) / self._corrector.scales[:-1], value)

    def blur(self, point: BranchPoint, rounding: NDArray[np.float64] | None = None) -> _Blur:
        """Return how rounding moves a point of the first computation across its tangent.

        Shapes: `rounding` (samples, N).
        """
        evaluation = self._own.evaluate(point.x) if rounding is None else self._own.evaluated_near(point.x)
        assert evaluation.by_parameter is not None
        if rounding is None:
            x = point.x * self._known
            rounding = roundings(self._equation, x[:-1], float(x[-1]), evaluation, self._known)
        jacobian = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * self._known
        right = np.column_stack((rounding, np.zeros(len(rounding)))).T
        try:
            moved = np.linalg.solve(np.vstack((jacobian, point.tangent)), right).T
        except np.linalg.LinAlgError:
            raise NumericalError(f"the branch is singular at {point.value:.12g}") from None
        farthest = moved[int(np.argmax(np.linalg.norm(moved, axis=1)))]
        most, times = _BENDS * float(np.abs(rounding).max()), 1.0
        # where motions are nearly a continuum, the equation bends: rounding leads farther than its derivatives tell
        while _NOTABLE < times * length_of(farthest) < _FARTHEST:
            ahead = (self._own.evaluate(point.x + way * times * farthest) for way in (-_FURTHER, _FURTHER))
            if min(float(np.abs(each.residual - evaluation.residual).max()) for each in ahead) > most:
                break
            times *= _FURTHER
        ways = (times,) if times == 1.0 else (times, -times)
        asides = [self._own.exact_point(point.x + way * farthest, point.tangent, point.arclength) for way in ways]
        return _Blur(times * float(np.abs(moved[:, -1]).max()), asides, rounding)

    def crossing(self, point: BranchPoint, reach: float, function: Callable[[BranchPoint], float]) -> float:
        """Return the parameter at which the second computation has a crossing, near a branch point.

        Close to the crossing no orbit can be corrected, but the branch and its determinant are smooth. Polynomials
        through points on both sides, up to `reach` away, give the zero of the determinant or another function.
        """
        points = [self.at(point, float(share) * reach) for share in _NODES]

        def polynomial(values: list[float]) -> Polynomial:
            return Polynomial.fit(_NODES, values, len(_NODES) - 1, domain=[-1.0, 1.0])

        roots = polynomial([function(each) for each in points]).roots()
        places = roots[np.abs(roots.imag) < _REAL].real
        places = places[np.abs(places) <= 1.0]
        if not len(places):
            raise NumericalError(f"no branches cross near {point.value:.12g} with another discretisation")
        return float(polynomial([each.value for each in points])(places[np.argmin(np.abs(places))]))

    def _embedded(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(self._equation.embed(x[:-1], self._other), x[-1])


class _Blur(NamedTuple):
    """Effect of rounding on a point of a branch."""

    off: float  #: Largest change of the scaled parameter.
    asides: list[BranchPoint]  #: The point displaced farthest; to both sides, if that is farther than derivatives tell.
    rounding: NDArray[np.float64]  #: shape (samples, N): Samples of the rounding errors of the residual.


class _Seen(NamedTuple):
    """Point, the test function there, and what rounding makes of both."""

    point: BranchPoint  #: The point.
    zero: float  #: The test function.
    off: float = 0.0  #: Change of the scaled parameter across the branch by rounding.
    blur: float = 0.0  #: Change of the test function by rounding.


def location_error(
    zero: Zero, second: ErrorEstimator, around: Sequence[BranchPoint], ends: Sequence[BranchPoint] = ()
) -> float:
    """Estimate the error of the parameter at a special point; infinite if it cannot be estimated.

    The point is compared with points near it on the branch, and with the same point of a second computation, in the
    plane across the tangent. The largest of the estimates counts.

    At a graze the depth may rise on one side of the point and stay almost zero on the other, and rounding may move the
    motions of one side only. So its effect on the points of both sides is counted with the steepest of the rates, and
    so is a second computation that lies on the other side.
    """
    there, blur = second.at(zero.point), second.blur(zero.point)

    def seen(point: BranchPoint, blur: _Blur) -> _Seen:
        value = zero.function(point)
        return _Seen(point, value, blur.off, max(abs(zero.function(each) - value) for each in blur.asides))

    here, other = seen(zero.point, blur), _Seen(there, zero.function(there))
    if not zero.contact:  # both sides are alike
        return max(_location_error(zero, here, other, _Seen(point, zero.function(point))) for point in around)
    near, further = ([seen(point, second.blur(point, blur.rounding)) for point in each] for each in (around, ends))
    sides = [here, *near, *further]
    here = here._replace(off=max(each.off for each in sides), blur=max(each.blur for each in sides))
    steepest = max(near, key=lambda each: abs(_rate(here, each)))
    return max(_location_error(zero, here, other, each, each is not steepest) for each in near)


def _rate(here: _Seen, near: _Seen) -> float:
    """Return the rate of change of the test function along the branch between two points; 0 if they are the same."""
    apart = near.point.arclength - here.point.arclength
    return (near.zero - here.zero) / apart if apart else 0.0


def _location_error(zero: Zero, here: _Seen, other: _Seen, near: _Seen, is_flat: bool = False) -> float:
    kind, spread = zero.kind, zero.spread
    point, apart = here.point, near.point.arclength - here.point.arclength
    rate = _rate(here, near)
    if not rate or not math.isfinite(rate):
        return math.inf
    off = abs(other.point.value - point.value)  # across the branch
    shift, blur = abs(other.zero), here.blur
    if is_flat:
        shift, blur = shift if other.zero * near.zero > 0.0 else 0.0, near.blur
    along = max(abs(here.zero), shift, zero.noise, blur) / abs(rate)
    width = abs(point.x[-1] and point.value / point.x[-1])  # the scale of the parameter
    off += width * here.off
    ahead = abs(float(point.tangent[-1])) * along
    if kind.is_turning:
        ahead += 0.5 * abs(rate) * along**2  # the parameter is stationary there: what counts is its curvature
    if kind.target is not None:
        critical = [kind.critical_multiplier(each.point.orbit.free_multipliers) for each in (here, near, other)]
        blurred = abs(critical[1] - critical[0]) / abs(apart) * (along + spread) + abs(critical[2] - critical[0])
        if abs(critical[0] - kind.target) > SAFETY * blurred + _AT:
            return math.inf  # no multiplier is critical here
    bracket = abs(float(point.tangent[-1])) * width * spread
    return float(bracket + SAFETY * (off + width * ahead) + ROUNDING * (abs(point.value) + width))
