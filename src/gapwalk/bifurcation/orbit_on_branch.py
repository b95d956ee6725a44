"""Membership of orbits on a branch, and the orbits of a branch at one value of its parameter.

Where a branch ends on another one, `meets` and `junction_nearby` find the orbit that the two share.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import singledispatch
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import BranchStart, lift, start_branch
from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.bifurcation.steps_over_corners import smooth_between
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, WalkOptions
from gapwalk.errors import NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import SAME, Orbit, phases

_BULGE = 0.15  # largest overshoot of a segment beyond the values at its ends, as a share of its length
_BESIDE = 0.1  # distance from a segment's cubic, as a share of its length, beyond which an orbit is not on it
_SHARES = np.linspace(0.0, 1.0, 33)
_STEPS = (1e-4, 2e-5, 4e-6)  # first steps along the parent in search of a flip: a smaller one if the last went astray
_LARGEST, _POINTS = 2e-3, 15  # the largest step and the number of points of that search
Knot = tuple[NDArray[np.float64], NDArray[np.float64], float]
"""Point of a curve, the unit tangent there, and its arclength."""


class Curve:
    """Branch as a curve in the space of unknowns and parameter: cubics between its points, with their tangents.

    Folds are among its points, so that the values between a fold and its neighbours are covered. A branch that ends
    where it joins another one is extrapolated to the junction.
    """

    def __init__(self, branch: Branch) -> None:
        self.branch = branch
        points = _knots(branch)
        self._space = space_of(points[0].orbit, branch, points)
        self._scales = self._space.scales
        knots, self._points = [self._space.knot(point) for point in points], list[BranchPoint | None](points)
        if len(knots) > 1:
            beyond = [_end_knot(knots[-2:], branch.ends[-1], self._scales[-1])]
            before = [_end_knot(knots[1::-1], branch.ends[0], self._scales[-1])]
            self._points = [None] * (before != [None]) + self._points + [None] * (beyond != [None])
            knots = [knot for knot in (*before, *knots, *beyond) if knot is not None]
        self._pieces: dict[int, _Piece] = {}
        self._x, self._tangents = np.array([knot[0] for knot in knots]), np.array([knot[1] for knot in knots])
        self._lengths = np.diff([knot[2] for knot in knots])
        self._values = self._x[:, -1]

    def holds(self, orbit: Orbit, tolerance: float = SAME) -> bool:
        """Return True if an orbit lies on the branch; see `lies_on`."""
        # The branch is corrected onto the plane through the orbit and perpendicular to the nearby cubic, not at the
        # parameter value of the orbit: that is well-posed at folds too, where two orbits of the branch are close.
        own, place = self.branch.system, self.branch.system.structure.place(self.branch.parameter)
        if orbit.system.structure != own.structure or np.any(np.delete(orbit.system.values != own.values, place)):
            return False  # the systems may differ in the parameter of the branch only
        value = orbit.system[self.branch.parameter] / self._scales[-1]
        near = self._bracketing(value)
        if not len(near):
            return False
        places = self._space.places(orbit)
        if any(self._has_knot(place, value, tolerance) for place in places):
            return True
        tolerance = max(tolerance, self._space.tolerance(orbit))
        return any(self._passes(orbit, place, value, near, tolerance) for place in places)

    def orbits_at(self, value: float) -> list[Orbit]:
        """Return the orbits of the branch at one value of its parameter, in the order of the walk."""
        # An orbit so close to a fold that Newton's method at a fixed value fails is left out.
        found: list[Orbit] = []
        scaled = value / self._scales[-1]
        for segment in self._bracketing(scaled):
            piece = self._piece(int(segment))
            for share in piece.crossings(scaled):
                orbit = piece.space.orbit_at(piece.cubic(np.array([share]))[0][0], value)
                if orbit is not None and not any(
                    np.abs(orbit.state - other.state).max() / magnitude(other.state, other.system) <= SAME
                    for other in found
                ):
                    found.append(orbit)
        return found

    def _bracketing(self, value: float) -> NDArray[np.intp]:
        """Return segments that may contain the scaled value; each may exceed its ends by a share of its length."""
        margin = _BULGE * self._lengths + 1e-12
        low, high = np.minimum(self._values[:-1], self._values[1:]), np.maximum(self._values[:-1], self._values[1:])
        return np.flatnonzero((low - margin <= value) & (value <= high + margin))

    def _has_knot(self, place: NDArray[np.float64], value: float, tolerance: float) -> bool:
        """Return True if a place at a value is one of the points from which the curve is made."""
        # No correction is made there: where a branch begins on another or joins it, solutions of both are close
        # together, and rounding decides which of them the corrector finds.
        size = len(place)
        off = np.abs(self._x[:, :size] * self._scales[:size] - place).max(axis=1)
        return bool(np.any((off <= tolerance * self._size(place)) & (np.abs(self._values - value) <= tolerance)))

    def _passes(
        self, orbit: Orbit, place: NDArray[np.float64], value: float, segments: NDArray[np.intp], tolerance: float
    ) -> bool:
        """Return True if one of the segments passes through a place at a value."""
        size = len(place)
        for segment in segments:
            piece = self._piece(int(segment))
            goal = piece.space.goal(orbit, place, value) if piece.space is not self._space else None
            target = np.append(place / self._scales[:size] if goal is None else goal[:size], value)
            curve, slopes = piece.cubic(_SHARES)
            away = np.linalg.norm(np.hstack((curve[:, :size], curve[:, -1:])) - target, axis=1)
            nearest = int(np.argmin(away))
            if away[nearest] > (_BESIDE + 0.5 / len(_SHARES)) * piece.length:
                continue
            goal = self._space.goal(orbit, place, value) if goal is None else goal
            normal = slopes[nearest] / np.linalg.norm(slopes[nearest])
            guess = curve[nearest] + ((goal - curve[nearest]) @ normal) * normal
            found = piece.space.correct(orbit, guess, normal)
            if found is None:
                continue
            off = (found - goal) * self._scales
            if abs(found[-1] - value) <= tolerance and np.abs(off[:size]).max() <= tolerance * self._size(place):
                return True
        return False

    def _size(self, place: NDArray[np.float64]) -> float:
        return magnitude(place, self.branch.system)

    def _piece(self, segment: int) -> _Piece:
        """Return a segment as a piece of a smooth curve."""
        if segment not in self._pieces:
            ends, space = slice(segment, segment + 2), self._space
            x, tangents = self._x[ends], self._tangents[ends]
            a, b = self._points[ends]
            if a is not None and b is not None:
                space, a, b = space.smooth_between(a, b)
                if space is not self._space:
                    x, tangents = np.array((a.x, b.x)), np.array((a.tangent, b.tangent))
            self._pieces[segment] = _Piece(space, x, tangents, float(self._lengths[segment]))
        return self._pieces[segment]


class _Piece(NamedTuple):
    """Cubic through two neighbouring knots of a curve, in variables in which the branch is smooth between them."""

    space: StateSpace
    x: NDArray[np.float64]
    tangents: NDArray[np.float64]
    length: float

    def cubic(self, shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points of the cubic at shares of its length, and the slopes there (not of unit length)."""
        return _cubic(self.x, self.tangents, self.length, shares)

    def crossings(self, value: float) -> Iterator[float]:
        """Yield the shares at which the cubic takes a scaled value of the parameter."""
        a, b = self.x[:, -1]
        p, q = self.length * self.tangents[:, -1]
        roots = np.roots([2 * a - 2 * b + p + q, -3 * a + 3 * b - 2 * p - q, p, a - value])
        shares = np.sort(roots[np.abs(roots.imag) < 1e-6].real)
        yield from shares[(shares >= -1e-9) & (shares <= 1.0 + 1e-9)].tolist()


def lies_on(branch: Branch, orbit: Orbit) -> bool:
    """Return True if an orbit lies on a branch, possibly with a start at a later forcing period."""
    # To compare many orbits with one branch, `Curve(branch).holds` is faster.
    return Curve(branch).holds(orbit)


class StateSpace:
    """Scaled variables in which a branch is a curve; the parameter is the last variable.

    Here they are the states at some angles, by shooting the starts of the segments. A method whose unknowns are of
    another kind derives a class, which is registered with `space_of`.

    Attributes
    ----------
    size
        Number of leading variables that determine a motion.
    scales
        Scales of all variables: physical = scale * scaled.
    """

    _is_elsewhere = False  # True if the unknowns are states elsewhere than at the start of the period

    def __init__(self, branch: Branch, points: Sequence[BranchPoint]) -> None:
        self.size, self._period = branch.system.state_size, branch.period
        count = max(len(point.x) for point in points) - 1
        segments = count // self.size
        points = [point for point in points if len(point.x) == count + 1]
        physical = np.abs([np.append(point.orbit.state, point.value) for point in points]).sum(axis=0)
        scaled = np.abs([np.append(point.x[: self.size], point.x[-1]) for point in points]).sum(axis=0)
        scales = np.divide(physical, scaled, out=np.ones_like(physical), where=scaled > 0.0)
        self.scales = np.append(np.tile(scales[:-1], segments), scales[-1])
        method = points[0].orbit.posed_in(count)
        self.corrector = Corrector(method.pose(branch.system, branch.parameter, branch.period), self.scales)

    def smooth_between(self, first: BranchPoint, last: BranchPoint) -> tuple[StateSpace, BranchPoint, BranchPoint]:
        """Return a space in which the branch is smooth between two neighbouring points, and the points in it."""
        corrector, first, last = smooth_between(self.corrector, first, last)
        if corrector is self.corrector:
            return self, first, last
        space = copy(self)
        space.corrector, space._is_elsewhere = corrector, True
        return space, first, last

    def knot(self, point: BranchPoint) -> Knot:
        """Return the knot of a point of the branch, which may have been computed with fewer segments."""
        lifted = point if len(point.x) == len(self.scales) else lift(point, self.corrector)
        if lifted is None:
            raise NumericalError(f"the orbit at {point.value:.12g} is not found in more segments")
        return lifted.x, lifted.tangent, lifted.arclength

    def places(self, orbit: Orbit) -> Sequence[NDArray[np.float64]]:
        """Return the unscaled coordinates of a motion for each phase at which it may begin; shape (size,) each."""
        return list(phases(orbit))

    def goal(self, orbit: Orbit, place: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """Return all variables of an orbit at a place on the branch."""
        if len(self.scales) == self.size + 1 and not self._is_elsewhere:
            return np.append(place / self.scales[:-1], value)
        unknowns = self.corrector.equation.unknowns(orbit.begun_in(place).repeated(self._period // orbit.period))
        return np.append(unknowns / self.scales[:-1], value)

    def correct(self, orbit: Orbit, guess: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray | None:
        """Return the point of the branch in a plane, resolved as finely as an orbit; None if none is found."""
        correction = self.corrector.correct(guess, normal)
        return None if correction is None else correction.x

    def orbit_at(self, guess: NDArray[np.float64], value: float) -> Orbit | None:
        """Return the orbit of the branch at one value of the parameter, from a guess; None if none is found."""
        correction = self.corrector.at_value(guess, value)
        if correction is None:
            return None
        return self.corrector.equation.orbit(correction.x[:-1] * self.scales[:-1], value, correction.evaluation)

    def tolerance(self, orbit: Orbit) -> float:
        """Return the largest distance at which an orbit belongs to the branch, relative to the size of the branch."""
        return 0.0


@singledispatch
def space_of(orbit: Orbit, branch: Branch, points: Sequence[BranchPoint]) -> StateSpace:
    """Return the space in which a branch of these orbits is a curve; by default the space of states."""
    return StateSpace(branch, points)


@space_of.register(BalancedOrbit)
def _of_lines(orbit: BalancedOrbit, branch: Branch, points: Sequence[BranchPoint]) -> StateSpace:
    from gapwalk.bifurcation.fourier_space import LineSpace  # loads numba, which takes time

    return LineSpace(branch, points)


def meets(orbit: Orbit, special: SpecialPoint, parameter: str) -> bool:
    """Return True if an orbit is that of a special point, possibly with another phase or repeated several times."""
    # In harmonic balance a doubled branch meets its parent at the flip of the truncated equation, but the flip of the
    # parent is located by its multipliers. The two differ by the truncation error.
    value, wanted = orbit.system[parameter], special.value
    same = max(SAME, orbit.truncation, special.orbit.truncation)
    if abs(value - wanted) > same * (1.0 + abs(wanted)):
        return False
    off = np.abs(phases(special.orbit) - orbit.state).max(axis=1)
    return bool(off.min() <= same * magnitude(orbit.state, orbit.system))


def junction_nearby(branch: Branch, within: tuple[float, float], method: Method | None = None) -> Orbit | None:
    """Return the orbit of its parent at which a period-doubled branch ends; None if there is none nearby."""
    # A walk may end just before its parent, if a contact grazes so close to the flip that the steps become too small,
    # or if the parent's motion changes its sequence of slip and stick there. The parent's orbit is found from the mean
    # of the two halves, and followed in both directions within the range.
    last = branch.points[-1].orbit
    if last.period % 2:
        return None
    try:
        states = last.strobes(last.period // 2 + 1)
        parent = find_orbit(last.system, last.period // 2, 0.5 * (states[0] + states[-1]), method=method)
        beginnings = [start_branch(parent, branch.parameter, within, way, method) for way in (-1, 1)]
        found = [each for beginning in beginnings if (each := _first_junction(beginning)) is not None]
    except NumericalError:
        return None
    return min(found, key=lambda each: each.point.arclength).orbit if found else None


def _first_junction(beginning: BranchStart) -> SpecialPoint | None:
    """Return the first point along a branch where one of twice the period ends; it may itself end just beyond."""
    for step in _STEPS:
        options = WalkOptions(initial_step=step, largest_step=_LARGEST, max_points=_POINTS)
        tracer = BranchTracer(beginning, options, judges=False)
        junction = next((each for _, special in tracer for each in special if each.doubles), None)
        if junction is not None:
            return junction
        if tracer.end is None or tracer.end.reason is not EndReason.JOINED:
            break
    return None


def _knots(branch: Branch) -> list[BranchPoint]:
    """Return the points of a branch and its folds in the order of their arclength, without duplicates."""
    points = sorted(
        [*branch.points, *(fold.point for fold in branch.special(Kind.FOLD))], key=lambda point: point.arclength
    )
    knots = points[:1]
    for point in points[1:]:
        if point.arclength - knots[-1].arclength > 1e-12:
            knots.append(point)
    return knots


def _end_knot(knots: list[Knot], end: End, scale: float) -> Knot | None:
    """Return the junction beyond the last of two knots at which a branch joins another; None if there is none."""
    (a, p, start), (b, q, stop) = knots
    step, gap = b[-1] - a[-1], end.value / scale - b[-1]
    if end.reason is not EndReason.JOINED or step * gap <= 0.0:
        return None
    share = 1.0 + min(float(gap / step), 1.0)
    points, slopes = _cubic((a, b), np.sign(stop - start) * np.array((p, q)), abs(stop - start), np.array([share]))
    tangent = np.sign(stop - start) * slopes[0] / np.linalg.norm(slopes[0])
    return points[0], tangent, start + share * (stop - start)


def _cubic(x, tangents, length: float, shares: NDArray[np.float64]):
    """Return points and slopes of the cubic through two points and tangents; shares outside 0 ... 1 extrapolate."""
    (a, b), (p, q), t = x, length * np.asarray(tangents), shares[:, None]
    points = (1 + 2 * t) * (1 - t) ** 2 * a + t * (1 - t) ** 2 * p + t * t * (3 - 2 * t) * b + t * t * (t - 1) * q
    slopes = 6 * t * (1 - t) * (b - a) + (1 - t) * (1 - 3 * t) * p + t * (3 * t - 2) * q
    return points, slopes
