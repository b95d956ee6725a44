"""Step-size control after den Heijer and Rheinboldt (1981, SIAM J. Numer. Anal. 18, 925-948)."""

from __future__ import annotations

import math

from gapwalk.continuation.corrector import Correction
from gapwalk.continuation.walk_options import WalkOptions

_LONGEST, _SHORTEST = 2.0, 0.4  # limits of the ratio of successive steps
_GOAL = 0.6  # share of the largest allowed turn that a step aims at


def next_step(step: float, correction: Correction, turn: float, options: WalkOptions) -> float:
    """Return the step to try after an accepted step, before it is limited to the longest step.

    Two conditions limit it: the corrector should converge in `options.iterations`, and the tangent should not turn
    too far.

    For the first, Newton's errors obey ``e_(j+1) = C e_j^2``, so with ``q = C e_0`` the last of k steps is about
    ``e_0 q^(2^(k-1) - 1)``. This gives q, and from q the initial error from which the wanted number of steps would
    reach the same accuracy: ``q^(2^(k - wanted) - 1)`` times the present one. The error of the tangent predictor
    grows with the square of the step.
    """
    return step * min(_newton_factor(correction, options.iterations), _turn_factor(turn, options.largest_turn))


def shorter_step(step: float) -> float:
    """Return the step to try after a failed step."""
    return step / 3.0


def _newton_factor(correction: Correction, wanted: int) -> float:
    taken = correction.iterations
    if taken < 2 or correction.last <= 0.0 or correction.last >= correction.distance:
        return _LONGEST if taken <= wanted else _SHORTEST
    contraction = (correction.last / correction.distance) ** (1.0 / (2.0 ** (taken - 1) - 1.0))
    growth = contraction ** (2.0 ** (taken - wanted) - 1.0)
    return min(_LONGEST, max(_SHORTEST, math.sqrt(growth)))


def _turn_factor(turn: float, largest: float) -> float:
    return min(_LONGEST, max(_SHORTEST, _GOAL * largest / max(turn, 1e-12)))
