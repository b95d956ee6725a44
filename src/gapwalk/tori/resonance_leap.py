"""Steps of a family of tori past resonances: where the next torus should be, and leaps over windows in which none is.

Near a resonance p/q curves are distorted, and need the more samples the nearer it is; in a window around it there is
no torus at all. So the length of each step is varied a little, such that its rotation number is far from fractions.
Where steps become short, or the samples are no longer enough, a leap is tried from the last good step: to a torus of a
given rotation number, with the parameter free. For numbers that are far from all fractions such tori exist on both
sides of a window, and depend on the number as if there were none.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, ahead
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import Range
from gapwalk.errors import NumericalError
from gapwalk.tori.closed_curve import resampled
from gapwalk.tori.torus_solution import TorusOptions
from gapwalk.tori.torus_start import corrector_of, equation_of, torus_at

FEW = (1.5, 2.0, 3.0, 4.0)
"""Lengths of leaps, over that of a good step, that are tried as soon as steps become short."""
MANY = (*FEW, 6.0, 8.0, 12.0, 16.0)
"""Lengths that are tried before a family ends."""

_REMEMBERED = 32  # steps among which a good one is looked for, before the walk crept into a resonance
_GOOD = 0.5  # change of the rotation number in a good step, as a share of the largest of them
_SHARES = np.linspace(1.0, 0.7, 25)  # of a step, among which the rotation number is chosen
_DENOMINATORS = np.arange(1.0, 61.0)  # of the fractions that it avoids
_AROUND = np.linspace(0.8, 1.25, 31)  # of a leap, among which the rotation number is chosen
_ALONG = 0.5  # change of the rotation number along a tangent, over that along a good step, below which it is distorted
_FAR = 0.5  # distance of a torus from where a leap expects it, over the length of the leap, at which it is another one


class Stride(NamedTuple):
    """An accepted step, with the corrector that made it."""

    corrector: Corrector
    start: BranchPoint
    end: BranchPoint
    length: float

    @property
    def turned(self) -> float:
        """Change of the rotation number."""
        return torus_at(self.end).rotation - torus_at(self.start).rotation


class Strides:
    """The last steps of a walk.

    Parameters
    ----------
    within
        The range.
    options
        Accuracy of the tori.
    """

    def __init__(self, within: Range, options: TorusOptions) -> None:
        self.within, self.options = within, options
        self._last: deque[Stride] = deque(maxlen=_REMEMBERED)

    def add(self, stride: Stride) -> None:
        """Add an accepted step."""
        self._last.append(stride)

    def clear(self) -> None:
        """Forget all steps."""
        self._last.clear()

    @property
    def good(self) -> Stride | None:
        """The last step in which the rotation number changed much, before the walk crept into a resonance."""
        most = max((abs(stride.turned) for stride in self._last), default=0.0)
        return next((each for each in reversed(self._last) if abs(each.turned) >= _GOOD * most), None)

    def leap(self, last: BranchPoint, count: int, lengths: tuple[float, ...]) -> Stride | None:
        """Return a step from the last good one to the other side of a resonance; None if no torus is found there.

        Parameters
        ----------
        last
            The last point; its rotation number must be passed, in the direction of the good step.
        count
            Number of samples of a curve now.
        lengths
            Changes of the rotation number to try, over that of the good step.
        """
        good = self.good
        if good is None or good.turned == 0.0:
            return None
        corrector, point = good.corrector, good.end
        if equation_of(corrector).count < count:
            posed = posed_with(corrector, point, count, self.within)
            if posed is None:
                return None
            corrector, point = posed
        begun, passed = torus_at(point).rotation, torus_at(last).rotation
        for longer in lengths:
            turns = begun + good.turned * longer * _AROUND
            turns = turns[(turns - passed) * good.turned > 0.0]
            if not len(turns):
                continue
            aim = float(turns[int(np.argmin(nearness_to_fractions(turns)))])
            beyond = self._landed(good, corrector, point, aim)
            if beyond is not None and self.options.accepts(torus_at(beyond)) and beyond.value in self.within:
                length = float(np.linalg.norm(beyond.x - point.x))
                # the arclength of the family does not go back to the good step
                start = replace(point, arclength=max(last.arclength, point.arclength))
                return Stride(corrector, start, replace(beyond, arclength=start.arclength + length), good.length)
        return None

    def _landed(self, good: Stride, corrector: Corrector, point: BranchPoint, aim: float) -> BranchPoint | None:
        """Return the torus of a rotation number, from a point along its tangent; None if there is none nearby.

        Next to a resonance the tangent leads along it: then the guess is along the good step.
        """
        scale = float(corrector.scales[-2])
        change = (aim - torus_at(point).rotation) / scale
        along = point.tangent
        if abs(along[-2] * scale) * good.length < _ALONG * abs(good.turned):
            along = _secant(good, corrector)
        guess = point.x + along * (change / along[-2])
        normal = np.zeros(len(guess))
        normal[-2] = 1.0
        found = corrector.correct(guess, normal)
        if found is None or np.linalg.norm(found.x - guess) > _FAR * np.linalg.norm(guess - point.x):
            return None
        try:
            return corrector.point(found, point.tangent, point.arclength)
        except NumericalError:
            return None


def _secant(stride: Stride, corrector: Corrector) -> NDArray[np.float64]:
    """Return the change of all unknowns in a step, as a vector of another corrector."""
    count = equation_of(corrector).count
    ends = []
    for point in (stride.start, stride.end):
        unscaled = point.x * stride.corrector.scales
        curve = unscaled[:-2].reshape(equation_of(stride.corrector).count, -1)
        ends.append(np.append(resampled(curve, count).ravel(), unscaled[-2:]) / corrector.scales)
    return ends[1] - ends[0]


def far_from_fractions(
    step: float,
    earlier: BranchPoint | None,
    previous: BranchPoint | None,
    point: BranchPoint,
    corrector: Corrector,
) -> float:
    """Return a step that is not longer, and not much shorter, whose rotation number is far from fractions.

    Near fractions p/q with a small q curves need more samples, and the sum of ``1 / (q^2 |rho - p/q|)`` is large.

    Parameters
    ----------
    step
        The step.
    earlier, previous, point
        The last points; None if there are none.
    corrector
        The corrector.
    """
    scale = float(corrector.scales[-2])
    turns = np.array([ahead(earlier, previous, point, share * step)[0][-2] for share in _SHARES]) * scale
    return step * float(_SHARES[int(np.argmin(nearness_to_fractions(turns)))])


def nearness_to_fractions(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of ``1 / (q |q rho - p|)`` over small denominators q, for each rotation number."""
    parts = turns[:, None] * _DENOMINATORS
    away = np.maximum(np.abs(parts - np.rint(parts)), np.finfo(float).eps)
    return (1.0 / (_DENOMINATORS * away)).sum(axis=1)


def posed_with(
    corrector: Corrector, point: BranchPoint, count: int, within: Range
) -> tuple[Corrector, BranchPoint] | None:
    """Pose the equation again at a point, with its curve as reference and a number of samples; None if Newton fails."""
    torus = torus_at(point)
    curve = resampled(torus.states, count)
    equation = replace(equation_of(corrector), reference=curve)
    posed = corrector_of(equation, curve, 1e-3 * torus.size, within)
    unscaled, unscaled_point = point.tangent * corrector.scales, point.x * corrector.scales
    along = resampled(unscaled[:-2].reshape(torus.count, -1), count).ravel()
    tangent = np.append(along, unscaled[-2:]) / posed.scales
    tangent /= np.linalg.norm(tangent)
    x = np.append(curve.ravel(), unscaled_point[-2:]) / posed.scales
    found = posed.correct(x, tangent)
    if found is None:
        return None
    try:
        return posed, posed.point(found, tangent, point.arclength)
    except NumericalError:
        return None
