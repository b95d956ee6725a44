"""Steps of a family of tori past resonances: where the next torus should be, and leaps over windows in which none is.

Near a resonance p/q curves are distorted, and need the more samples the nearer it is; in a window around it there is
no torus at all. So the length of each step is varied a little, such that its rotation number is far from fractions.
Where steps become short, or the samples are no longer enough, the family is continued by leaps: each to a torus of a
given rotation number, with the parameter free. For numbers that are far from all fractions tori exist on both sides of
a window, and depend on the number as if there were none (smooth in the sense of Whitney, as KAM theory has it).
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, ahead, length_of
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.walk_scales import Range
from gapwalk.errors import NumericalError
from gapwalk.tori.closed_curve import resampled
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_ends import has_shrunk
from gapwalk.tori.torus_solution import TorusOptions
from gapwalk.tori.torus_start import corrector_of, equation_of, torus_at

NEXT = (1.3, 0.8, 2.0, 3.0, 0.4)
"""Lengths of leaps, over that of the last one, that are tried while leaps succeed."""
FEW = (1.5, 2.0, 3.0, 4.0)
"""Lengths, over that of a good step, that are tried as soon as steps become short."""
MANY = (*FEW, 6.0, 8.0, 12.0, 16.0)
"""Lengths that are tried before a family ends."""

_REMEMBERED = 32  # steps among which a good one is looked for, before the walk crept into a resonance
_GOOD = 0.5  # change of the rotation number in a good step, as a share of the largest of them
_SHARES = np.linspace(1.0, 0.7, 25)  # of a step, among which the rotation number is chosen
_AROUND = np.linspace(0.8, 1.25, 31)  # of a leap, among which the rotation number is chosen
_DENOMINATORS = np.arange(1.0, 101.0)  # of the fractions that it avoids
_ALONG = 0.5  # change of the rotation number along a tangent, over that along a good step, below which it is distorted
_FARTHER = 3.0  # the longest leap over a resonance that has stopped a walk, over the longest step
_SHRUNK = 0.3  # size of a torus, over that before a leap, below which it may be no torus
_ROUGHER = 10.0  # error of a torus along which a contact grazes, over that before a leap, above which it is too rough
_FAR = 2.0  # distance of a torus from where a leap expects it, over the length of the leap, at which it is another one


class Stride(NamedTuple):
    """An accepted step, with the corrector of its end."""

    corrector: Corrector
    start: BranchPoint
    end: BranchPoint
    length: float

    @property
    def turned(self) -> float:
        """Change of the rotation number."""
        return torus_at(self.end).rotation - torus_at(self.start).rotation

    def along(self, corrector: Corrector) -> NDArray[np.float64]:
        """Return the change of all unknowns, as a vector of another corrector."""
        count = equation_of(corrector).count
        ends = [
            np.append(resampled(torus_at(point).states, count), (torus_at(point).rotation, point.value))
            for point in (self.start, self.end)
        ]
        return (ends[1] - ends[0]) / corrector.scales


class Strides:
    """The last steps of a walk."""

    def __init__(self, within: Range, options: TorusOptions, longest: float) -> None:
        self.within, self.options, self.longest = within, options, longest
        self._last: deque[Stride] = deque(maxlen=_REMEMBERED)

    def add(self, stride: Stride) -> None:
        """Add an accepted step."""
        self._last.append(stride)

    def restart(self, stride: Stride) -> None:
        """Forget all steps but one, which others are compared with."""
        self._last.clear()
        self._last.append(stride)

    @property
    def good(self) -> Stride | None:
        """The last step in which the rotation number changed much, before the walk crept into a resonance."""
        most = max((abs(stride.turned) for stride in self._last), default=0.0)
        return next((each for each in reversed(self._last) if abs(each.turned) >= _GOOD * most), None)

    def leap(self, last: BranchPoint, count: int, lengths: tuple[float, ...]) -> Stride | None:
        """Return a step from the last good one to the other side of a resonance; None if no torus is found there."""
        good = self.good
        if good is None or good.turned == 0.0:
            return None
        posed: tuple[Corrector, BranchPoint] | None = (good.corrector, good.end)
        if equation_of(good.corrector).count < count:
            posed = posed_with(good.corrector, good.end, count, self.within)
        return None if posed is None else self.leap_from(*posed, good, last, lengths)

    def leap_from(
        self, corrector: Corrector, point: BranchPoint, good: Stride, last: BranchPoint, lengths: tuple[float, ...]
    ) -> Stride | None:
        """Return a leap from a point, in the direction of a good step; see `leap`."""
        begun, passed = torus_at(point).rotation, torus_at(last).rotation
        for longer in lengths:
            turns = begun + good.turned * longer * _AROUND
            turns = turns[(turns - passed) * good.turned > 0.0]
            if not len(turns):
                continue
            aim = float(turns[int(np.argmin(nearness_to_fractions(turns)))])
            landed = self._landed(corrector, point, good, aim, self.longest * (1.0 if lengths is NEXT else _FARTHER))
            if landed is not None and landed[1].value not in self.within:
                return None
            if landed is not None:
                # the arclength of the family does not go back to the good step
                start = replace(point, arclength=max(last.arclength, point.arclength))
                leap = Stride(landed[0], start, landed[1], good.length)
                length = float(np.linalg.norm(leap.along(landed[0])))
                return leap._replace(end=replace(landed[1], arclength=start.arclength + length))
        return None

    def _landed(
        self, corrector: Corrector, point: BranchPoint, good: Stride, aim: float, longest: float
    ) -> tuple[Corrector, BranchPoint] | None:
        """Return the torus of a rotation number next to a point, with its corrector; None if there is none.

        It is looked for along the tangent, and along the good step: next to a resonance the tangent leads along it, and
        where a contact grazes it is less certain than the direction between two tori.
        """
        scale = float(corrector.scales[-2])
        change = (aim - torus_at(point).rotation) / scale
        normal = np.zeros(len(point.x))
        normal[-2] = 1.0
        step = good.along(corrector)
        distorted = abs(point.tangent[-2] * scale) * good.length < _ALONG * abs(good.turned)
        for along in (step,) if distorted else (point.tangent, step):
            guess = point.x + along * (change / along[-2])
            length = length_of(guess - point.x)
            found = corrector.correct(guess, normal) if length <= longest else None
            if found is not None and length_of(found.x - guess) <= _FAR * length:
                break
        else:
            return None
        try:
            landed = corrector.point(found, normal * np.sign(good.turned), point.arclength)
        except NumericalError:
            return None
        torus, before = torus_at(landed), torus_at(point)
        if torus.size < _SHRUNK * before.size or has_shrunk(point, landed):
            return None  # the orbit to which the tori shrink solves the equation with any rotation number
        if self._is_fine(torus, before):
            return corrector, landed
        finer = self.options.finer(torus.count)
        if finer is None or not torus.is_resolved:
            return None
        posed = posed_with(corrector, landed, finer, self.within)
        return posed if posed is not None and self._is_fine(torus_at(posed[1]), before) else None

    def _is_fine(self, torus: Torus, before: Torus) -> bool:
        """Return True if a leap may end at a torus: with the most samples, if it is nearly as accurate as required.

        If it is not, it is next to another resonance. Where a contact grazes along tori, their errors are larger; then
        it must not be much less accurate than the one before.
        """
        accuracy = self.options.accuracy
        if torus.grazes:
            return self.options.accepts(torus) and torus.error <= _ROUGHER * max(accuracy, before.error)
        return self.options.accepts(torus) and torus.error**2 <= accuracy * max(accuracy, self.options.tolerated)


def far_from_fractions(
    step: float,
    earlier: BranchPoint | None,
    previous: BranchPoint | None,
    point: BranchPoint,
    corrector: Corrector,
) -> float:
    """Return a step that is not longer, and not much shorter, whose rotation number is far from fractions.

    Near fractions p/q with a small q curves need more samples, and the sum of ``1 / (q^2 |rho - p/q|)`` is large.
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
