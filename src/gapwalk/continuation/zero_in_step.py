"""Location of a zero of a function between two neighbouring points of a branch, on corrected points."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from gapwalk.bracketed_root import zero_between_signs
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import ConvergenceError, NumericalError

_LOCATED = 1e-11  # accuracy, as a share of the step
_ATTEMPTS = 40  # evaluations


class Zero(NamedTuple):
    """Place of a zero in a step."""

    share: float  #: Share of the step.
    point: BranchPoint  #: The point there.
    #: Change of the parameter in the last iteration; the length of the step where Newton's method failed on the way.
    width: float


def zero_in_step(
    before: BranchPoint, after: BranchPoint, corrector: Corrector, function: Callable[[BranchPoint], float]
) -> Zero:
    """Locate the zero of a function that changes its sign in a step, by Brent's method; else its nearest point."""
    length = after.arclength - before.arclength
    tried: list[tuple[float, float, BranchPoint]] = []

    def height(share: float) -> float:
        if share in (0.0, 1.0):
            point = before if share == 0.0 else after
        else:
            correction = corrector.correct(hermite(before, after, share), before.tangent)
            if correction is None:
                raise ConvergenceError("Newton's method fails inside a step")
            point = corrector.point(correction, before.tangent, before.arclength + share * length)
        tried.append((share, function(point), point))
        return tried[-1][1]

    try:
        zero_between_signs(height, 0.0, 1.0, absolute=_LOCATED, most=_ATTEMPTS)
    except NumericalError:
        share, _, point = min(tried, key=lambda each: abs(each[1]))
        return Zero(share, point, abs(after.value - before.value))
    share, _, point = tried[-1]
    return Zero(share, point, abs(point.value - tried[-2][2].value))
