"""Verification of a branch: its orbits, the gaps between them, its special points, and what they account for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch, Kind, SpecialPoint
from gapwalk.bifurcation.counts import steps_of, unexplained
from gapwalk.bifurcation.error_estimate import ErrorEstimator
from gapwalk.continuation.branch_point import BranchPoint
from gapwalk.errors import NumericalError
from gapwalk.orbit.floquet import is_on_border
from gapwalk.orbit.orbit import Orbit
from gapwalk.verification.balanced import verify_truncated
from gapwalk.verification.both_sides import look
from gapwalk.verification.dop853 import Round, carry
from gapwalk.verification.gaps import gap
from gapwalk.verification.multipliers import distance, reshoot, spread
from gapwalk.verification.order import verify_ends, verify_order
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_criticality import nature_faults
from gapwalk.verification.walk_again import CROSSING, Track

_EXACT = 1e-12  # error with which a special point can be located again, in widths of the range
_LEAST = 1e-16  # relative error of a parameter below which no number can represent it
_MANY, _MOST = (
    1e4,
    1e-4,
)  # factor on the location error, and share of the parameter, above which no stated error is plausible
_VARIED = 3.0  # allowed difference of multipliers, as a multiple of their variation near the point
_ONE_PLACE = 1e-7  # arclength within which grazing points of two contacts may be one event of a symmetric motion
_INTERPOLATED = 1e-9  # error in widths of the range of a branch point, which is interpolated again


def verify_branches(
    ledger: Ledger,
    branches: Sequence[tuple[str, Branch]],
    advance: Advance | None = None,
    within: tuple[float, float] | None = None,
) -> None:
    """Enter all checks of some branches of one structure, by their names.

    Parameters
    ----------
    ledger
        The ledger in which to enter them.
    branches
        The branches.
    advance
        Called with the progress.
    within
        The range over which they were followed, if known.
    """
    tracks = [(name, Track(branch)) for name, branch in branches]
    _verify_orbits(ledger, [(name, track) for name, track in tracks if track.is_exact], advance)
    for done, (name, track) in enumerate(tracks):
        if advance is not None:
            advance("branches", done, len(tracks))
        if not track.is_exact:
            verify_truncated(ledger, name, track)
        verify_order(ledger, name, track.branch)
        verify_ends(ledger, name, track, within)
        _verify_gaps(ledger, name, track)
        _verify_specials(ledger, name, track)
        ledger.points += len(track.branch.points)
        ledger.special_points += len(track.branch.special_points)


def _spots(name: str, branch: Branch) -> Iterator[tuple[Spot, BranchPoint]]:
    """Yield all points and special points with their places."""
    for number, point in enumerate(branch.points):
        yield Spot(name, f"point {number}", point.value), point
    for number, special in enumerate(branch.special_points):
        yield Spot(name, f"special point {number} ({special.kind.value})", special.value), special.point


def _verify_orbits(ledger: Ledger, tracks: Sequence[tuple[str, Track]], advance: Advance | None) -> None:
    """Check exact orbits by shooting: all branches together, since they are integrated together."""
    every = [(spot, point, track) for name, track in tracks for spot, point in _spots(name, track.branch)]
    orbits = [point.orbit for _, point, _ in every]

    def report(done: int) -> None:
        if advance is not None:
            advance("orbits", done, len(every))

    report(0)
    kinds = {id(each.point): each.kind for _, track in tracks for each in track.branch.special_points}
    for (spot, point, track), around in zip(every, carry(orbits, report), strict=True):
        ledger.enter(Check.RECORD, spot, track.mismatch(point))
        _enter_residual(ledger, spot, track, point)
        beside, kind = track.asides(point), kinds.get(id(point))
        verify_orbit(ledger, spot, point.orbit, around, track.segments, beside, track.aside(point), kind)


def _enter_residual(ledger: Ledger, spot: Spot, track: Track, point: BranchPoint) -> None:
    detail = f"its residual is stored as {point.orbit.residual:.3g}, larger than a walk accepts"
    ledger.enter(Check.RESIDUAL, spot, track.doubtful_residual(point), detail)


def verify_orbit(
    ledger: Ledger,
    spot: Spot,
    orbit: Orbit,
    around: Round,
    segments: int,
    beside: Sequence[NDArray[np.float64]] = (),
    aside: float = 0.0,
    kind: Kind | None = None,
) -> None:
    """Check one orbit by shooting.

    Parameters
    ----------
    ledger, spot
        The ledger and the place at which to enter the checks.
    orbit
        The orbit.
    around
        Its integration over one period.
    segments
        Number of segments with which it was found.
    beside
        Changes of its state that represent the distance to the point at which its multipliers were evaluated.
    aside
        Largest such change of a position.
    kind
        Kind of the special point, if it is one.
    """
    try:
        reshot = reshoot(orbit, segments, around.contraction)
    except NumericalError as error:
        ledger.enter(Check.MULTIPLIERS, spot, math.inf, str(error))
        return
    rough = max(1.0, around.error / Check.CLOSURE.bound)
    if rough > 1.0:
        ledger.note(f"{spot}: the error of the other integrator is {around.error:.1g} of the motion")
    ledger.enter(Check.CLOSURE, spot, around.closure / reshot.growth / rough)
    size = max(float(np.abs(around.extremes).max()), np.finfo(float).tiny)
    # its stages change at a point one Newton step away, which matters more if a motion is small for its branch
    ledger.enter(Check.STAGES, spot, around.astray / reshot.growth / max(rough, aside / size / Check.STAGES.bound))
    extremes = float(np.abs(around.extremes - orbit.extremes[:, :2]).max())
    ledger.enter(Check.EXTREMES, spot, extremes / size / reshot.growth / rough)
    ledger.enter(Check.VOLUME, spot, abs(reshot.contraction - around.contraction) / max(1.0, abs(around.contraction)))
    off = distance(reshot.multipliers, orbit.multipliers)
    if off > Check.MULTIPLIERS.bound and beside:
        off /= max(1.0, _VARIED * spread(orbit, segments, around.contraction, beside) / Check.MULTIPLIERS.bound)
    ledger.enter(Check.MULTIPLIERS, spot, off)
    _verify_stability(ledger, spot, orbit, reshot.multipliers, kind)


def _verify_stability(
    ledger: Ledger, spot: Spot, orbit: Orbit, multipliers: NDArray[np.complex128], kind: Kind | None
) -> None:
    """Check the number of unstable multipliers, unless one is on the unit circle.

    At a special point the critical multipliers are not counted: they are on the circle up to the error with which they
    are known.
    """
    found, stored = (_not_critical(each, kind) for each in (multipliers, orbit.multipliers))
    if is_on_border(found) or is_on_border(stored):
        return
    counts = [int((np.abs(each) > 1.0).sum()) for each in (found, stored)]
    detail = f"{counts[0]} unstable multipliers, where {counts[1]} are stored"
    ledger.enter(Check.STABILITY, spot, float(abs(counts[0] - counts[1])), detail)


def _not_critical(multipliers: NDArray[np.complex128], kind: Kind | None) -> NDArray[np.complex128]:
    """Return the multipliers of a point except those that are critical at a special point of a kind."""
    if kind is None or not len(places := kind.critical(multipliers)):
        return multipliers
    off = np.abs((multipliers if kind.target is not None else np.abs(multipliers)) - (kind.target or 1.0))
    # known are the coefficients of a polynomial: other roots near a root make it less certain
    known = float(off[places].min() * np.prod(np.minimum(np.delete(off, places), 1.0)))
    return np.delete(multipliers, places) if known < Check.MULTIPLIERS.bound else multipliers


def _verify_gaps(ledger: Ledger, name: str, track: Track) -> None:
    """Check the gaps between neighbours, and the changes over them."""
    for number, (a, b, special) in enumerate(steps_of(track.branch)):
        spot = Spot(name, f"points {number} to {number + 1}", a.value)
        knots = [a, *(each.point for each in special), b]
        ledger.enter(Check.GAPS, spot, max(gap(track, *pair) for pair in pairwise(knots)))
        texts = list(unexplained(a, b, special))
        ledger.enter(Check.COUNTS, spot, float(len(texts)), "; ".join(texts))


def _verify_specials(ledger: Ledger, name: str, track: Track) -> None:
    """Check each special point from both sides."""
    opinions = {}
    for number, special in enumerate(track.branch.special_points):
        spot = Spot(name, f"special point {number} ({special.kind.value})", special.value)
        size = len(special.point.x)
        if size not in opinions:
            opinions[size] = ErrorEstimator(track.corrector(size))
        branch = track.branch
        next_to_it = _neighbours(special, branch, branch.points)
        changes = _neighbours(special, branch, (branch.points[0], branch.points[-1]))
        sides = look(opinions[size], special, next_to_it, changes)
        faults = sides.faults
        if not sides.held and special.kind is Kind.BRANCH_POINT and track.regularity(special.point) < CROSSING:
            faults = ()  # branches cross there, so near another special point that no motion can be corrected nearby
        ledger.enter(Check.SIDES, spot, float(len(faults)), "; ".join(faults))
        if sides.before is not None and sides.after is not None:
            texts = list(nature_faults(track, opinions[size], special, sides.before, sides.after))
            ledger.enter(Check.NATURE, spot, float(len(texts)), "; ".join(texts))
        if sides.value is None or special.uncertainty == math.inf:
            ledger.leave_unlocated(spot)
        else:
            _enter_location(ledger, spot, special, sides.value)


def _neighbours(special: SpecialPoint, branch: Branch, points: Sequence[BranchPoint]) -> list[BranchPoint]:
    """Return the neighbours of a special point: points, or other special points that are not at the same place.

    In a symmetric motion both sides of a gap graze at once; there is nothing between the two.
    """
    others = (each for each in branch.special_points if each is not special and not _is_one_place(each, special))
    knots = [*points, *(each.point for each in others)]
    here = special.point.arclength
    before = max((knot for knot in knots if knot.arclength <= here), key=lambda knot: knot.arclength, default=None)
    after = min((knot for knot in knots if knot.arclength > here), key=lambda knot: knot.arclength, default=None)
    return [each for each in (before, after) if each is not None]


def _is_one_place(a: SpecialPoint, b: SpecialPoint) -> bool:
    """Return whether two contacts graze at once."""
    both_graze = a.kind is b.kind is Kind.GRAZING and a.contact != b.contact
    return both_graze and abs(a.point.arclength - b.point.arclength) < _ONE_PLACE


def _enter_location(ledger: Ledger, spot: Spot, special: SpecialPoint, found: float) -> None:
    """Enter the distance of a special point from its second location, in units of its stated error."""
    off = abs(found - special.value)
    width = abs(special.value / special.point.x[-1]) if special.point.x[-1] else 1.0
    stated = special.uncertainty
    error = stated + width * (_INTERPOLATED if special.kind is Kind.BRANCH_POINT else _EXACT)
    detail = f"found again at {found:.12g}, {off:.2g} away; its stated error is {stated:.2g}"
    least, most = _LEAST * max(abs(special.value), width), max(_MANY * off, _MOST * (abs(special.value) + width))
    if not least <= stated <= most:
        detail = f"{detail}, which is {'less than rounding' if stated < least else 'implausibly large'}"
        error = 0.0
    ledger.enter(Check.LOCATION, spot, off / error if error > 0.0 else math.inf, detail)
