"""A second opinion on the points of a branch: the same orbits posed in another way, or more finely.

By shooting with one segment more, by harmonic balance with half as many harmonics again. What both have in common is
right; by how much they differ is an estimate of the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.equation import OrbitEquation

if TYPE_CHECKING:
    from gapwalk.bifurcation.kinds.search import Zero

SAFETY = 4.0  # times the difference of two computations, of which neither is exact
_NODES = np.array([-1.0, -0.75, -0.45, 0.45, 0.75, 1.0])  # where a branch is looked at beside a crossing, in reaches
_REAL = 1e-6  # imaginary part of a root that is real but for rounding
_AT = 1e-6  # distance of the critical multiplier from +1 or -1 that its own rounding explains
ROUNDING = 2e-14
"""Relative error of a parameter that both computations share: that of the flow, some 1e-15 in each of its steps."""


class SecondOpinion:
    """The branch of a corrector, posed otherwise.

    Parameters
    ----------
    corrector
        Corrects onto the branch.
    """

    def __init__(self, corrector: Corrector) -> None:
        self._equation = cast("OrbitEquation", corrector.equation)
        self._other = self._equation.otherwise()
        self._known = corrector.scales
        known = corrector.scales[:-1]
        velocity = known[min(self._equation.system.size, len(known) - 1)]  # by harmonic balance there is none
        scales = self._other.scales(1.0, velocity / known[0])
        scales *= known[0] / scales[0]  # lengths along the branch are the same in both
        self._corrector = Corrector(self._other, np.append(scales, corrector.scales[-1]))

    def at(self, point: BranchPoint, shift: float = 0.0) -> BranchPoint:
        """The point of the other branch on the plane across a point's tangent, `shift` further along.

        Raises
        ------
        NumericalError
            If there is none.
        """
        scales = self._corrector.scales
        along = self._embedded(point.tangent)
        try:
            start = self._ahead(point, shift)
        except NumericalError:
            start = self._embedded(point.x) + shift * along
        correction = self._corrector.correct(start, along / np.linalg.norm(along))
        if correction is None:
            raise NumericalError(f"no orbit is found at {point.value:.12g} when it is posed otherwise")
        # exactly there: the correction may have been evaluated a step aside
        x = correction.x
        evaluation = self._other.evaluate(x[:-1] * scales[:-1], float(x[-1] * scales[-1]))
        exact = Correction(x, evaluation, 0, 0.0, 0.0)
        return self._corrector.point(exact, along, point.arclength + shift)

    def _ahead(self, point: BranchPoint, shift: float) -> NDArray[np.float64]:
        """The scaled unknowns of the motion that lies `shift` along the tangent at a point, to first order.

        By way of the motion itself: what is posed otherwise has unknowns besides, which change along the branch too.
        """
        orbit, value = point.orbit, float(point.x[-1])
        if shift:
            x = (point.x + shift * point.tangent) * self._known
            orbit = self._equation.orbit(x[:-1], float(x[-1]), self._equation.evaluate(x[:-1], float(x[-1])))
            value += shift * float(point.tangent[-1])
        return np.append(self._other.unknowns(orbit) / self._corrector.scales[:-1], value)

    def crossing(self, point: BranchPoint, reach: float) -> float:
        """The parameter at which the other branch crosses another, near a branch point.

        Close to it no orbit can be held, but the branch and its determinant are smooth: the polynomials through points
        on both sides, up to `reach` away, tell where the determinant is zero.

        Raises
        ------
        NumericalError
            If there are no such points, or the determinant keeps its sign.
        """
        points = [self.at(point, float(share) * reach) for share in _NODES]

        def polynomial(values: list[float]) -> Polynomial:
            return Polynomial.fit(_NODES, values, len(_NODES) - 1, domain=[-1.0, 1.0])

        roots = polynomial([each.determinant for each in points]).roots()
        places = roots[np.abs(roots.imag) < _REAL].real
        places = places[np.abs(places) <= 1.0]
        if not len(places):
            raise NumericalError(f"no branches cross near {point.value:.12g} when the branch is posed otherwise")
        return float(polynomial([each.value for each in points])(places[np.argmin(np.abs(places))]))

    def _embedded(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(self._equation.embed(x[:-1], self._other), x[-1])


class _Seen(NamedTuple):
    """A point, and the test function there."""

    point: BranchPoint
    zero: float


def location_error(zero: Zero, second: SecondOpinion, around: Sequence[BranchPoint]) -> float:
    """Estimated error of the parameter at a special point; infinite where it cannot be told.

    It is compared with points near it on the branch, and with the same point by a second opinion, on the plane across
    the tangent. The largest of the estimates counts.

    Raises
    ------
    NumericalError
        If there is no such point.
    """
    here, other, *near = (_Seen(point, zero.function(point)) for point in (zero.point, second.at(zero.point), *around))
    return max(_location_error(zero, here, other, each) for each in near)


def _location_error(zero: Zero, here: _Seen, other: _Seen, near: _Seen) -> float:
    kind, spread = zero.kind, zero.spread
    point, apart = here.point, near.point.arclength - here.point.arclength
    rate = (near.zero - here.zero) / apart if apart else 0.0
    if not rate or not math.isfinite(rate):
        return math.inf
    off = abs(other.point.value - point.value)  # across the branch
    along = max(abs(here.zero), abs(other.zero), zero.noise) / abs(rate)
    width = abs(point.x[-1] and point.value / point.x[-1])  # the scale of the parameter
    ahead = abs(float(point.tangent[-1])) * along
    if kind.is_turning:
        ahead += 0.5 * abs(rate) * along**2  # the parameter is stationary there: what counts is its curvature
    if kind.target is not None:
        critical = [kind.critical_multiplier(each.point.orbit.multipliers) for each in (here, near, other)]
        blurred = abs(critical[1] - critical[0]) / abs(apart) * (along + spread) + abs(critical[2] - critical[0])
        if abs(critical[0] - kind.target) > SAFETY * blurred + _AT:
            return math.inf  # nothing is critical here
    bracket = abs(float(point.tangent[-1])) * width * spread
    return float(bracket + SAFETY * (off + width * ahead) + ROUNDING * (abs(point.value) + width))
