"""The nature of a bifurcation: to which side a fold opens, and whether a flip is super- or subcritical."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gapwalk.bifurcation.switch import switch
from gapwalk.continuation.branch import Kind, SpecialPoint
from gapwalk.continuation.corrector import TRUST
from gapwalk.errors import NumericalError
from gapwalk.orbit.equation import Method

_AMPLITUDES = (1e-4, 6e-4, 3e-3)  # scaled distances from the flip at which the doubled branch is looked at


def with_nature(
    special: SpecialPoint, parameter: str, neighbours: tuple[float, float], method: Method | None = None
) -> SpecialPoint:
    """The special point with its nature told, if it is a fold or a flip.

    Parameters
    ----------
    special
        The special point.
    parameter
        Name of the parameter that is followed.
    neighbours
        Values of the parameter at the points before and after it.
    method
        How orbits are posed.
    """
    if special.kind is Kind.FOLD:
        lower = sum(neighbours) < 2.0 * special.value
        return replace(special, nature=f"opens to {'lower' if lower else 'higher'} values")
    if special.kind is Kind.FLIP:
        nature, judged = _flip_nature(special, parameter, neighbours, method)
        return replace(special, nature=nature, judged=judged)
    return special


def _flip_nature(
    special: SpecialPoint, parameter: str, neighbours: tuple[float, float], method: Method | None
) -> tuple[str, float]:
    """Whether the doubled branch leaves to the side on which the parent has lost stability, and up to what amplitude.

    The sign is read off the doubled branch itself at growing amplitudes, not off a normal form: by a grazing point
    close to the flip it may hold only below a tiny amplitude, and that is told.
    """
    width = abs(special.value) + 1.0
    try:
        departure = switch(special, parameter, (special.value - width, special.value + width), method)[0]
    except NumericalError:
        return "", 0.0
    corrector, first = departure.corrector, departure.first
    sides, corrections = [], []
    for size in _AMPLITUDES:
        # no guess but the tangent: by a grazing point a curve through the nearer points led to other branches
        correction = corrector.correct(first.x + size * first.tangent, first.tangent, TRUST)
        if correction is None:
            break
        sides.append(float(np.sign(correction.x[-1] - first.x[-1])))
        corrections.append(correction)
    if not sides or sides[0] == 0.0:
        return "", 0.0
    holds = next((i for i, side in enumerate(sides) if side != sides[0]), len(sides)) - 1
    judged = corrector.point(corrections[holds], first.tangent, _AMPLITUDES[holds]).orbit
    amplitude = float(np.abs(judged.state - special.orbit.state).max())
    loses_after = special.after.below > special.before.below
    unstable_side = neighbours[1] - special.value if loses_after else neighbours[0] - special.value
    return ("supercritical" if sides[0] * unstable_side > 0.0 else "subcritical"), amplitude
