"""Branch points: two branches cross, because one of them breaks a symmetry.

They are located by interpolation, since Newton's method is ill-conditioned where branches cross.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.bifurcation.branch_start import BranchStart, posed_for
from gapwalk.bifurcation.error_estimate import ROUNDING, SAFETY, ErrorEstimator
from gapwalk.bifurcation.kinds.defining_functions import offsets_from
from gapwalk.bifurcation.special_point import Kind, SpecialPoint, Symbol
from gapwalk.bifurcation.step_interval import Search, StepInterval, Zero
from gapwalk.continuation.corrector import Corrector, Range, scales_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.method import Method

_AROUND = 5e-3  # arclength within which a second computation searches for the branch point
_REACHES = (1.0, 0.2, 0.04, 0.01)  # shares of it: if a contact grazes nearby, the branch is smooth only in small ones
_SHARP = 1e-10  # error, in scales of the parameter, below which no smaller window is tried
_NODES = 7
_FEWEST = 5
_NEAR = 0.08  # share of the window around the crossing from which no node is taken
_NARROW = 0.2  # length of each window, relative to the one before; the first is the whole step
_WINDOWS = 3  # largest number of windows after the first
_ROUGH = 0.1  # spread of the zero, in windows, below which one window determines the centre of the next
_SURE = 1e-6  # spread of the zero, in windows, above which the neighbourhood is not smooth enough
_TURNS = 1e-5  # component of the tangent of a fold but for the error of the crossing
_ROUGH_BRANCH = "the branch is not smooth where it seems to cross another"


class BranchPointKind(Kind):
    """Kind of point at which two branches cross: the Jacobian bordered by the tangent is singular."""

    turn = 1
    symbol = Symbol("branch point (BP)", "BP", "P", 6.5, "purple")
    target = 1.0
    ways = 2
    moves_through_one = True
    sign_change = "another branch crosses"

    def function(self, point: BranchPoint) -> float:
        """Return the determinant of the bordered Jacobian, scaled."""
        return point.determinant

    def offsets(self, multipliers: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the distances of the multipliers from +1, positive above."""
        return offsets_from(1.0, multipliers)

    def prepare(self, search: Search) -> None:
        """Locate the crossing first, so that the search for other kinds steps over it."""
        search.several(self)
        if search.first.determinant * search.last.determinant < 0.0:
            _crossing(search, search.first, search.last)

    def locate(self, search: Search, a: BranchPoint, b: BranchPoint) -> Zero | None:
        """Locate the crossing by interpolation: Newton's method is ill-conditioned where branches cross."""
        crossing = _crossing(search, a, b)
        return crossing and Zero(self, search.interval.at(crossing.arclength), crossing.spread, self.at)

    def locate_several(self, search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int]) -> Zero | None:
        """Locate the crossing with several branches by interpolation."""
        crossing = _crossing(search, a, b, ranks)
        if crossing is None:
            return None
        zero = search.several_at(self, search.interval.at(crossing.arclength), crossing.spread, ranks)
        # equal parts turn back together: one multiplier is that of the fold, and the others are those of the crossing
        turns = zero and a.tangent[-1] * b.tangent[-1] < 0.0 and abs(float(zero.point.tangent[-1])) < _TURNS
        return replace(zero, kind=Kind.FOLD) if zero and turns else zero

    def error(self, search: Search, zero: Zero, second: ErrorEstimator) -> float:
        """Estimate the error from the bracket, and from the shift of the crossing in a second computation."""
        point, scale = zero.point, float(search.corrector.scales[-1])
        ends = [abs(each.arclength - point.arclength) for each in (search.first, search.last)]
        # where the crossing lies at an end of the step, the branch is taken beyond that end too
        reaches = [share * min(_AROUND, end) for end in sorted(ends) for share in _REACHES]
        off = math.inf
        for number, reach in enumerate(reaches):
            if off < (_SHARP * scale if number < len(_REACHES) else math.inf):
                break
            with suppress(NumericalError):  # the branch is not smooth within that reach
                off = min(off, abs(second.crossing(point, reach, zero.function) - point.value))
        if off == math.inf:
            return math.inf
        bracket = abs(float(point.tangent[-1])) * scale * zero.spread
        return float(bracket + SAFETY * off + ROUNDING * (abs(point.value) + scale))

    def beginnings(self, special: SpecialPoint, parameter: str, within: Range, method: Method) -> list[BranchStart]:
        """Return two beginnings, in both directions of the crossing branch."""
        _, equation = posed_for(special, parameter, special.orbit.period, method)
        corrector = Corrector(equation, scales_of(equation, special.orbit, within))
        start = np.append(equation.unknowns(special.orbit), special.value)
        # both branches lie in the plane of the two smallest singular vectors, and the other is normal to this one
        plane = np.linalg.svd(corrector.jacobian(start / corrector.scales))[2][-2:]
        known = plane @ _rescaled(special.point, start, corrector)
        across = np.array([-known[1], known[0]]) @ plane
        across /= np.linalg.norm(across)
        across *= np.sign(across[np.argmax(np.abs(across))])
        return [BranchStart.uncorrected(corrector, start, way * across, within) for way in (1.0, -1.0)]

    @property
    def no_locus(self) -> str:
        """Reason why branch points have no locus in two parameters."""
        return (
            "a branch point has no locus in two parameters: it exists by a symmetry, and vanishes or persists with it; "
            "follow a fold, a flip, a neimark-sacker or a grazing point, or one of sliding"
        )


def _crossing(search: Search, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int] = (0, 1)) -> Crossing | None:
    """Return the crossing with other branches between two points; None if the branch is not smooth enough.

    Once a crossing is found, points near it are interpolated, because no orbit can be corrected there.
    """
    crossings = search.interval.crossings
    for crossing in crossings:
        if a.arclength < crossing.arclength < b.arclength:
            return crossing
    try:
        crossings.append(locate_crossing(search.interval, a, b, ranks))
    except NumericalError:
        return None
    return crossings[-1]


def _rescaled(point: BranchPoint, start: NDArray[np.float64], corrector: Corrector) -> NDArray[np.float64]:
    """Return the tangent of a point found with other scales, in the scales of the corrector."""
    if len(point.x) != len(start):
        raise ModelError(
            "switch with the method, and the number of segments or harmonics, with which the branch point was found"
        )
    scales = np.divide(start, point.x, out=corrector.scales.copy(), where=point.x != 0.0)
    rescaled = point.tangent * scales / corrector.scales
    return rescaled / np.linalg.norm(rescaled)


@dataclass(frozen=True)
class Crossing:
    """Branch near a point where it crosses another, as polynomials in the arclength from that point."""

    arclength: float  #: Arclength of the crossing.
    radius: float  #: Distance from the crossing within which the polynomials represent the branch.
    spread: float  #: Uncertainty of the arclength.
    curve: tuple[Polynomial, ...]  #: One polynomial for each scaled variable.
    count: int = 1  #: Number of multipliers that pass +1 there.

    def __contains__(self, arclength: object) -> bool:
        return isinstance(arclength, float) and abs(arclength - self.arclength) <= self.radius

    def x(self, arclength: float) -> NDArray[np.float64]:
        """Return the scaled unknowns and parameter at an arclength."""
        return np.array([component(arclength - self.arclength) for component in self.curve])

    def tangent(self, arclength: float) -> NDArray[np.float64]:
        """Return the unit tangent at an arclength."""
        slope = np.array([component(arclength - self.arclength) for component in self._slopes])
        return slope / np.linalg.norm(slope)

    @cached_property
    def _slopes(self) -> tuple[Polynomial, ...]:
        return tuple(component.deriv() for component in self.curve)


def locate_crossing(
    interval: StepInterval, a: BranchPoint, b: BranchPoint, ranks: tuple[int, int] = (0, 1)
) -> Crossing:
    """Locate the zero of the determinant of the bordered Jacobian between `a` and `b`.

    Where several multipliers pass +1 at once, their mean takes its place, which changes its sign in any case.

    Near a crossing the Jacobian is singular along the other branch: a residual of 1e-10 leaves an error of its
    square root or worse. The branch itself is smooth. Newton's method is accurate at points some distance away on both
    sides, and interpolation between them gives the zero of the determinant and the orbits near it.
    """
    window = b.arclength - a.arclength
    count = ranks[1] - ranks[0]
    function = _determinant if count == 1 else partial(Kind.BRANCH_POINT.mean_offset, ranks=ranks)
    ends = abs(function(a)), abs(function(b))
    crossing = _fit_window(interval, a, b, a.arclength + window * ends[0] / sum(ends), window, function)
    for _ in range(_WINDOWS):
        window *= _NARROW
        crossing = _fit_window(interval, a, b, crossing.arclength, window, function)
        if crossing.spread < _SURE * window:
            return replace(crossing, count=count)
    raise NumericalError(_ROUGH_BRANCH)


def _determinant(point: BranchPoint) -> float:
    return point.determinant


def _fit_window(
    interval: StepInterval,
    a: BranchPoint,
    b: BranchPoint,
    middle: float,
    window: float,
    function: Callable[[BranchPoint], float],
) -> Crossing:
    low = min(max(a.arclength, middle - 0.5 * window), b.arclength - window)
    nodes = _nodes(interval, low, window, middle)
    # abscissa of the points along the chord: the branch is smooth in it, but not in the arclength labels
    chord = (b.x - a.x) / (b.arclength - a.arclength)
    along = np.array([float((node.x - a.x) @ chord) for node in nodes]) / float(chord @ chord)
    places = (a.arclength + along - middle) / window
    values = [function(node) for node in nodes]
    zero = _zero(places, values)
    spread = abs(_zero(places[1:-1], values[1:-1]) - zero)
    if not spread < _ROUGH:
        raise NumericalError(_ROUGH_BRANCH)
    away = (places - zero) * window
    curve = tuple(_polynomial(away, [node.x[i] for node in nodes]) for i in range(len(a.x)))
    return Crossing(middle + zero * window, 0.3 * window, spread * window, curve)


def _nodes(interval: StepInterval, low: float, window: float, centre: float) -> list[BranchPoint]:
    """Return exact points of a window, denser towards its ends, none too near to the expected crossing."""
    nodes = []
    shares = 0.5 * (1.0 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1)))
    ends = (interval.points[0].arclength, interval.points[-1].arclength)
    for place in np.clip(low + window * shares, *ends):  # rounding must not lead beyond the ends
        if abs(place - centre) > _NEAR * window:
            try:
                node = interval.at(float(place))
                nodes.append(interval.corrector.exact_point(node.x, node.tangent, node.arclength))
            except NumericalError:  # it happens to lie on the crossing
                continue
    if len(nodes) < _FEWEST:
        raise NumericalError("too few orbits can be found where the branch seems to cross another")
    return nodes


def _zero(places: NDArray[np.float64], values: list[float]) -> float:
    """Return the zero of the interpolating polynomial that is nearest to the middle of the sign change.

    If all places lie on one side of the zero, return the one nearest to 0, where the zero is expected.
    """
    change = next((i for i in range(len(values) - 1) if values[i] * values[i + 1] <= 0.0), None)
    middle = 0.0 if change is None else 0.5 * (places[change] + places[change + 1])
    roots: NDArray[np.complex128] = np.array(_polynomial(places, values).roots(), dtype=np.complex128)
    real = roots[np.abs(roots.imag) < 1e-6].real
    return float(real[np.argmin(np.abs(real - middle))]) if len(real) else float("nan")


def _polynomial(places: NDArray[np.float64], values: list[float]) -> Polynomial:
    low, high = float(places.min()), float(places.max())
    return Polynomial.fit(places, values, len(places) - 1, domain=[low, high])
