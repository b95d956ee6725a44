"""Second determination of the criticality of a fold (the side to which it opens) or of a flip.

A fold is judged by the motions on both sides of it. A flip is judged by doubled motions at growing amplitudes, shot in
more segments than in the walk. Decisive is the smallest amplitude at which their parameter differs from that of the
flip by more than rounding, since the criticality is defined in the limit. No contact may graze up to that amplitude.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.continuation.corrector import Corrector
from gapwalk.errors import NumericalError
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.verification.walk_again import Track

_AMPLITUDES = 1e-6 * 2.0 ** np.arange(12)  # scaled distances of doubled motions from the flip
_NOISE = 1e-13  # error of the scaled parameter of a doubled motion
_ROUNDING = 1e-16  # that error times the amplitude: near the flip a residual hardly determines the parameter
_AGREEING = 2  # number of amplitudes that must agree
_CLEAR = 30.0  # factor on the error above which a difference is significant


def nature_faults(
    track: Track, second: ErrorEstimator, special: SpecialPoint, before: BranchPoint, after: BranchPoint
) -> Iterator[str]:
    """Yield contradictions to the stated criticality of a special point; none if it cannot be determined again.

    Parameters
    ----------
    track
        The branch.
    second
        The same branch with another discretisation.
    special
        The special point.
    before, after
        Motions on both sides of it, with that discretisation.
    """
    if not special.nature:
        return
    try:
        if special.kind is Kind.FOLD:
            found = _fold(second, special, before, after)
        elif special.kind is Kind.FLIP and special.orbit.is_exact:
            found = _flip(track, special, before, after)
        else:
            return
    except NumericalError:
        return
    if found and found not in special.nature:
        yield f"its criticality is stated as {special.nature!r}, but is {found}"


def _fold(second: ErrorEstimator, special: SpecialPoint, before: BranchPoint, after: BranchPoint) -> str:
    here = second.at(special.point).value
    sides = [each.value - here for each in (before, after)]
    width = abs(special.value) + _scale(special)
    if min(map(abs, sides)) < _CLEAR * _NOISE * width or sides[0] * sides[1] < 0.0:
        return ""
    return "lower" if sides[0] < 0.0 else "higher"


def _flip(track: Track, special: SpecialPoint, before: BranchPoint, after: BranchPoint) -> str:
    outside = [abs(_critical(point)) > 1.0 for point in (before, after)]
    if outside[0] == outside[1]:
        return ""
    unstable = (before if outside[0] else after).value - special.value
    leaves = _leaves(track, special)
    if not leaves or not unstable:
        return ""
    return "supercritical" if leaves * unstable > 0.0 else "subcritical"


def _critical(point: BranchPoint) -> complex:
    """Return the multiplier nearest to -1."""
    values = point.orbit.multipliers
    return complex(values[np.argmin(np.abs(values + 1.0))])


def _leaves(track: Track, special: SpecialPoint) -> float:
    """Return the side, as a sign, on which the doubled branch leaves a flip; 0 if it cannot be determined."""
    segments = track.segments + 1
    orbit, size = replace(special.orbit, period=2 * special.orbit.period), 2 * special.orbit.system.size
    equation = ShootingEquation(orbit.system, track.branch.parameter, orbit.period, Shooting(segments))
    known = track.corrector(len(special.point.x)).scales
    scales = np.append(np.tile(known[:size], segments), known[-1])
    start = np.append(equation.unknowns(orbit), special.value) / scales
    evaluation = equation.evaluate(start[:-1] * scales[:-1], special.value)
    across = np.append(np.linalg.svd(evaluation.by_unknowns * scales[:-1])[2][-1], 0.0)
    corrector = Corrector(equation, scales)
    error = _CLEAR * (special.uncertainty / abs(known[-1]) + _NOISE * (1.0 + abs(start[-1])))
    closings = tuple(2 * count for count in special.orbit.closings)
    sides: list[float] = []
    for amplitude in _AMPLITUDES:
        correction = corrector.correct(start + amplitude * across, across)
        if correction is None:
            continue
        shift = float(correction.x[-1] - start[-1])
        if abs(shift) > error + _CLEAR * _ROUNDING / amplitude:
            if corrector.point(correction, across, amplitude).orbit.closings != closings:
                break  # a contact grazes at a smaller amplitude than can be distinguished from the flip
            sides.append(float(np.sign(shift)))
        if len(sides) == _AGREEING:
            break
    return sides[0] if len(sides) == _AGREEING and len(set(sides)) == 1 else 0.0


def _scale(special: SpecialPoint) -> float:
    return abs(special.value / special.point.x[-1]) if special.point.x[-1] else 1.0
