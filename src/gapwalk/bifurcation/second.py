"""A second opinion on the points of a branch: the same orbits posed in another way, or more finely.

By shooting with one segment more, by harmonic balance with half as many harmonics again. What both have in common is
right; by how much they differ is an estimate of the error.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.branch import Kind
from gapwalk.continuation.corrector import Correction, Corrector
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.equation import OrbitEquation

_SAFETY = 4.0  # times the difference of two computations, of which neither is exact
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
            start = np.append(self._other.unknowns(point.orbit) / scales[:-1], point.x[-1])
        except NumericalError:
            start = self._embedded(point.x)
        correction = self._corrector.correct(start + shift * along, along / np.linalg.norm(along))
        if correction is None:
            raise NumericalError(f"no orbit is found at {point.value:.12g} when it is posed otherwise")
        # exactly there: the correction may have been evaluated a step aside
        x = correction.x
        evaluation = self._other.evaluate(x[:-1] * scales[:-1], float(x[-1] * scales[-1]))
        exact = Correction(x, evaluation, 0, 0.0, 0.0)
        return self._corrector.point(exact, along, point.arclength + shift)

    def _embedded(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.append(self._equation.embed(x[:-1], self._other), x[-1])


def location_error(
    kind: Kind, point: BranchPoint, second: BranchPoint, zeros: tuple[float, float], rate: float
) -> float:
    """Estimated error of the parameter at a special point.

    Parameters
    ----------
    kind
        What happens there.
    point, second
        The point, and the same by a second opinion, on the plane across the tangent.
    zeros
        The test function at both, where it should be zero.
    rate
        Its rate of change along the branch.
    """
    off = abs(second.value - point.value)  # across the branch
    along = max(map(abs, zeros)) / abs(rate) if rate else 0.0
    width = abs(point.x[-1] and point.value / point.x[-1])  # the scale of the parameter
    ahead = abs(float(point.tangent[-1])) * along
    if kind is Kind.FOLD:
        ahead += 0.5 * abs(rate) * along**2  # the parameter is stationary there: what counts is its curvature
    return float(_SAFETY * (off + width * ahead) + ROUNDING * (abs(point.value) + width))
