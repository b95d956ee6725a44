"""One response over a range of a parameter, and how its points move when other parameters change.

A point of a response that is not a special point has no place of its own. If it is the extreme of a measure along the
branch, the derivative of that extreme by a parameter is that of the measure at any point nearby, because the measure
does not change along the branch there (envelope theorem). So a point is corrected again at slightly changed values of
each parameter, in the plane across the branch, and the central difference of the measure is the derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.errors import ConvergenceError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

COARSE = WalkOptions(initial_step=0.02, largest_step=0.05)
"""Steps of the responses that are walked at each design."""

_STEP = 1e-4  # change of a parameter for a central difference, as a share of its scale
_INSIDE = 1e-9  # share of the range by which a point at its end may miss it
_NARROW = 1e-3  # share of the bracket to which an extreme along the branch is located


class Place(NamedTuple):
    """Point of a response."""

    point: BranchPoint  #: The point.
    is_fixed: bool  #: True if it stays at its value of the walked parameter, as the ends of a range do.


@dataclass(frozen=True, eq=False)
class LocalResponse:
    """The response of a system over a range, walked from one end to the other when it is first needed."""

    lead: Orbit  #: Orbit at the beginning of the range.
    #: parameter, end: The walked parameter, and the other end of its range.
    parameter: str
    end: float
    names: tuple[str, ...]  #: Parameters that may change.
    scales: tuple[float, ...]  #: Size of a relative change of 1 of each of them.
    walk: WalkOptions = COARSE  #: Options of the walk.

    @cached_property
    def walked(self) -> Branch:
        """The branch as far as it was walked."""
        return follow(self.lead, self.parameter, self.end, walk=self.walk)

    @cached_property
    def branch(self) -> Branch:
        """The branch over the whole range; raises a ConvergenceError if it does not reach the other end."""
        branch, end = self.walked, self.end
        last = branch.ends[-1]
        if last.reason is not EndReason.RANGE or abs(last.value - end) > abs(end - branch.values[0]) * _INSIDE:
            raise ConvergenceError(
                f"the response from {self.parameter} = {branch.values[0]:.6g} does not reach {end:.6g}: "
                f"{last.reason_words}"
            )
        return branch

    @property
    def system(self) -> System:
        """The system at the beginning of the response."""
        return self.lead.system

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the range, the smaller one first."""
        begin = self.system[self.parameter]
        return min(begin, self.end), max(begin, self.end)

    @property
    def forward(self) -> float:
        """1 if the walk begins at the smaller end, -1 otherwise."""
        return 1.0 if self.end > self.system[self.parameter] else -1.0

    def advance(self, point: BranchPoint) -> float:
        """Return the component of the tangent along the walked parameter: negative where the branch runs back."""
        return self.forward * float(point.tangent[-1])

    def lowest(
        self, measure: Callable[[BranchPoint], float], low: float, high: float, most: int = 1
    ) -> list[tuple[Place, float]]:
        """Find the places of a stretch where a measure is lowest."""
        found: list[tuple[Place, float]] = []
        for run in self._runs(low, high):
            values = [measure(place.point) for place in run]
            count = len(run)
            for k, value in enumerate(values):
                if value > min(values[max(k - 1, 0) : k + 2]):
                    continue
                place = run[k]
                if 0 < k < count - 1:
                    place, value = self._refined(run[k - 1].point, place.point, run[k + 1].point, measure, value)
                found.append((place, value))
        return sorted(found, key=lambda each: each[1])[:most]

    def slopes(self, place: Place, measure: Callable[[BranchPoint], float]) -> NDArray[np.float64]:
        """Return the derivatives of a measure by relative changes of the parameters, at a place; shape (k,)."""
        slopes = np.empty(len(self.names))
        for k, (name, scale) in enumerate(zip(self.names, self.scales, strict=True)):
            values = [measure(self._moved(place, name, sign * _STEP * scale)) for sign in (-1.0, 1.0)]
            slopes[k] = (values[1] - values[0]) / (2.0 * _STEP)
        return slopes

    @cached_property
    def _corrector(self) -> Corrector:
        way = 1 if self.forward > 0.0 else -1
        return start_branch(self.lead, self.parameter, self.end, way, self.lead.method()).corrector

    def _moved(self, place: Place, name: str, change: float) -> BranchPoint:
        """Return the point that takes the place of one when a parameter changes."""
        point, scales = place.point, self._corrector.scales
        system = point.orbit.system
        other = system.at({name: system[name] + change})
        equation = point.orbit.method().pose(other, self.parameter, point.orbit.period)
        corrector = Corrector(equation, scales)
        x = np.append(equation.unknowns(point.orbit), point.value) / scales
        corrected = corrector.at_value(x, point.value) if place.is_fixed else corrector.correct(x, point.tangent)
        if corrected is None:
            raise ConvergenceError(f"the motion at {point.value:.6g} has no neighbour with another {name}")
        return corrector.point(corrected, point.tangent, point.arclength)

    def _runs(self, low: float, high: float) -> Iterator[list[Place]]:
        """Yield each run of the branch through a stretch, with points at its ends."""
        within, points = (low, high), self.branch.points
        slack = _INSIDE * (self.ends[1] - self.ends[0])
        run: list[Place] = []
        for k, point in enumerate(points):
            if k:
                for bound in sorted(within, key=lambda value: abs(value - points[k - 1].value)):
                    if (points[k - 1].value - bound) * (point.value - bound) < 0.0:
                        run.append(Place(self._at(points[k - 1], point, bound), is_fixed=True))
                        if not low <= point.value <= high and len(run) > 1:
                            yield run
                            run = []
            if low - slack <= point.value <= high + slack:
                run.append(Place(point, is_fixed=k in (0, len(points) - 1)))
            elif len(run) == 1:
                run = []
        if run:
            yield run

    def _at(self, one: BranchPoint, other: BranchPoint, value: float) -> BranchPoint:
        """Return the point between two at a value of the walked parameter."""
        share = (value - one.value) / (other.value - one.value)
        guess = hermite(one, other, share)
        arclength = one.arclength + share * (other.arclength - one.arclength)
        found = self._corrector.point_at(guess, value, one.tangent, arclength)
        return found or min(one, other, key=lambda point: abs(point.value - value))

    def _refined(
        self,
        before: BranchPoint,
        middle: BranchPoint,
        after: BranchPoint,
        measure: Callable[[BranchPoint], float],
        value: float,
    ) -> tuple[Place, float]:
        """Return the place of the lowest value between two points, and that value."""
        from scipy.optimize import minimize_scalar  # imported late: it takes long

        best = (middle, value)

        def of(arclength: float) -> float:
            nonlocal best
            one, other = (before, middle) if arclength < middle.arclength else (middle, after)
            length = other.arclength - one.arclength
            if length <= 0.0:
                return value
            guess = hermite(one, other, (arclength - one.arclength) / length)
            normal = (other.x - one.x) / np.linalg.norm(other.x - one.x)
            point = self._corrector.point_near(guess, normal, arclength, one.tangent)
            if point is None:
                return value
            found = measure(point)
            if found < best[1]:
                best = (point, found)
            return found

        ends = (before.arclength, after.arclength)
        minimize_scalar(of, bounds=ends, method="bounded", options={"xatol": _NARROW * (ends[1] - ends[0])})
        return Place(best[0], is_fixed=False), best[1]


def band_points(branch: Branch, low: float, high: float) -> list[BranchPoint]:
    """Return the points of a branch in a stretch of its parameter."""
    return [point for point in branch.points if low <= point.value <= high]


def unstable_spans(branch: Branch, low: float, high: float) -> list[tuple[float, float]]:
    """Return the spans of a stretch over which the motions of a branch are unstable."""
    spans: list[tuple[float, float]] = []
    for one, other in pairwise(branch.points):
        a, b = sorted((one.value, other.value))
        a, b = max(a, low), min(b, high)
        if a < b and not (one.stable and other.stable):
            if spans and spans[-1][0] <= b and a <= spans[-1][1]:
                spans[-1] = (min(a, spans[-1][0]), max(b, spans[-1][1]))
            else:
                spans.append((a, b))
    return spans
