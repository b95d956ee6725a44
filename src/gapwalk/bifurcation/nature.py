"""The nature of a bifurcation: to which side a fold opens, and whether a flip is super- or subcritical."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gapwalk.bifurcation.switch import switch
from gapwalk.continuation.branch import Kind, SpecialPoint
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
    sides, amplitudes = [], []
    for amplitude in _AMPLITUDES:
        correction = corrector.correct(first.x + amplitude * first.tangent, first.tangent)
        if correction is None:
            break
        sides.append(float(np.sign(correction.x[-1] - first.x[-1])))
        orbit = corrector.point(correction, first.tangent, amplitude).orbit
        amplitudes.append(float(np.abs(orbit.state - special.orbit.state).max()))
    if not sides or sides[0] == 0.0:
        return "", 0.0
    holds = next((i for i, side in enumerate(sides) if side != sides[0]), len(sides))
    loses_after = special.after.below > special.before.below
    unstable_side = neighbours[1] - special.value if loses_after else neighbours[0] - special.value
    return ("supercritical" if sides[0] * unstable_side > 0.0 else "subcritical"), amplitudes[holds - 1]
