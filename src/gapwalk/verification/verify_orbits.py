"""Verification of exact orbits, of branches and loci: integrated by another method, and shot again in more segments.

All orbits of some branches are integrated together. Of a locus a sample of the points is verified.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import halves_apart, switch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.floquet import is_on_border, multipliers
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.orbit.sticking import collapses, without_kept
from gapwalk.verification.dop853 import Round
from gapwalk.verification.dry_dop853 import FINE, DryRound, carry
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_balanced import imbalance
from gapwalk.verification.verify_special_points import Track, special_spot

# Verification of a diagram: its branches are distinct and complete, and their ends are where the diagram states them.
#
# The end of a branch must share its orbit with the branch to which it is attached. Each branch that begins at another
# one must be in a complete diagram, and none twice.

_POINTS = 6  # number of points of a branch that is searched for: enough to distinguish it from others
_CLOSE = 1e-2  # difference of the halves of an orbit below which a doubled branch may end before its parent
_TRUNCATED = 30.0  # allowed difference of orbits, in truncation errors, which are not equal on both branches


def verify_distinct(ledger: Ledger, branches: Sequence[tuple[str, Branch]]) -> None:
    """Check that no two of some branches of one system are the same."""
    for (name, one), (other_name, other) in combinations(branches, 2):
        if one.period != other.period:
            continue
        middle, others = (branch.points[len(branch.points) // 2].orbit for branch in (one, other))
        overlap = one.values.min() <= other.values.max() and other.values.min() <= one.values.max()
        same = overlap and lies_on(one, others) and lies_on(other, middle)
        spot = Spot(other_name, "its middle", others.system[other.parameter])
        ledger.enter(Check.TREE, spot, math.inf if same else 0.0, f"it is the branch {name} again" if same else "")


def verify_whole(ledger: Ledger, diagram: Diagram) -> None:
    """Check that a complete diagram lacks no branch, neither in the numbering of names nor at special points."""
    counts: Counter[int] = Counter()
    for member in diagram.members:
        counts[member.period] += 1
        name = f"P{member.period}-{counts[member.period]}"
        detail = f"by its number it should be {name}: a branch of period {member.period} before it is missing"
        detail = "" if member.name == name else detail
        ledger.enter(Check.TREE, Spot(member.name, "its name", math.nan), math.inf if detail else 0.0, detail)
    if diagram.max_period is None:
        ledger.note("whether branches are missing is not verified: the longest requested period is not stored")
        return
    curves = {member.name: Curve(member.branch) for member in diagram.members}
    for member in diagram.members:
        for index, special in enumerate(member.branch.special_points):
            period = member.period * special.kind.times
            failed = any(f"{special.value:.10g}" in text for text in diagram.failures)
            present = len(diagram.attached(member.name, index)) >= special.ways  # also if it has no ways
            if period > diagram.max_period or failed or present:
                continue
            fellows = [curves[each.name] for each in diagram.members if each.period == period]
            missing = _is_missing(diagram, special, fellows)
            detail = f"a branch of period {period} begins there, and is missing" if missing else ""
            ledger.enter(Check.TREE, special_spot(member.name, index, special), math.inf if missing else 0.0, detail)


def _is_missing(diagram: Diagram, special: SpecialPoint, fellows: Sequence[Curve]) -> bool:
    """Return True if a branch that begins at a special point is not one of the present branches."""
    try:
        method = special.orbit.posed_in(len(special.point.x) - 1)
        starts = switch(special, diagram.parameter, diagram.within, method)
        walks = [[point for point, _ in BranchTracer(start, WalkOptions(max_points=_POINTS))] for start in starts]
    except (NumericalError, ModelError):
        return False
    found = [points[len(points) // 2].orbit for points in walks if points]
    return any(not any(curve.holds(orbit) for curve in fellows) for orbit in found)


def verify_tree(ledger: Ledger, diagram: Diagram) -> None:
    """Check where each member of a diagram is attached to others."""
    names = {member.name: member for member in diagram.members}
    for member in diagram.members:
        points = member.branch.points
        for origin, end, number in ((member.begins, points[0], 0), (member.joins, points[-1], len(points) - 1)):
            if origin is not None:
                _verify_end(ledger, Spot(member.name, f"point {number}", end.value), names, origin, member, end)


def _verify_end(
    ledger: Ledger, spot: Spot, names: dict[str, DiagramBranch], origin: Origin, member: DiagramBranch, end: BranchPoint
) -> None:
    parent = names.get(origin.parent)
    if parent is None or origin.special >= len(parent.branch.special_points):
        ledger.enter(Check.TREE, spot, np.inf, f"there is no special point {origin.special} on {origin.parent}")
        return
    special = parent.branch.special_points[origin.special]
    detail = f"from special point {origin.special} of {origin.parent}"
    jumps = special.doubles and not special.ways and origin == member.joins
    times = 2 if jumps else special.kind.times
    if not (special.ways or jumps) or member.period != parent.period * times:
        ledger.enter(Check.TREE, spot, np.inf, f"{detail}, a {special.kind.value} of period {parent.period}")
        return
    # in any phase, relative to its size
    state, states = end.orbit.state, special.orbit.strobes(special.orbit.period)
    apart = float(np.abs(states - state).max(axis=1).min()) / (1.0 + float(np.abs(state).max()))
    slack = 0.0
    # it may end just before its parent, whose orbit is the mean of its halves
    if times == 2 and origin == member.joins:
        halves = float(np.abs(halves_apart(end)).max())
        slack = halves if halves < _CLOSE else 0.0
    neglected = _TRUNCATED * max(special.orbit.truncation, end.orbit.truncation)
    ledger.enter(Check.TREE, spot, max(0.0, apart - slack - neglected), detail)


_CONTRACTION = 6.0  # logarithm of the change of volume in one segment, beyond which digits are lost
_MOST = 24  # largest number of segments
_POWERS = 6
_VARIED = 3.0  # allowed difference of multipliers, as a multiple of their variation near the point
_UNKNOWN = 0.1  # difference of multipliers which their variation explains, but which verifies nothing
_EPS = float(np.finfo(float).eps)
_SAMPLED = 40  # number of points of a locus that are verified


class Reshot(NamedTuple):
    """Result of shooting an orbit again, with more segments."""

    multipliers: NDArray[np.complex128]  #: shape (state_size,): Largest modulus first.
    #: Logarithm of the factor by which volumes of the state space change, from the determinants of the segments.
    contraction: float
    #: Largest factor by which a small change of the state grows over the period, or from one known state of a strongly
    #: unstable orbit to the next; at least 1.
    growth: float
    #: Error of the contraction by rounding: a segment with a soft touch of a force that jumps is almost singular.
    lost: float = 0.0


def verify_orbits(ledger: Ledger, tracks: Sequence[Track], advance: Advance | None) -> None:
    """Check the orbits of some branches."""
    every = [(track, *place) for track in tracks for place in track.spots()]

    def report(done: int) -> None:
        if advance is not None:
            advance("orbits", done, len(every))

    report(0)
    rounds = carry([point.orbit for _, _, point, _ in every], report)
    for (track, spot, point, kind), around in zip(every, rounds, strict=True):
        ledger.enter(Check.RECORD, spot, track.mismatch(point))
        if isinstance(around, DryRound) and around.closure > Check.CLOSURE.bound:
            # errors of the integrator may decide which of two impacts at nearly one instant comes first
            around = min(around, *carry([point.orbit], exact=FINE), key=lambda each: each.closure)
        detail = f"its residual is stored as {point.orbit.residual:.3g}, larger than a walk accepts"
        ledger.enter(Check.RESIDUAL, spot, track.doubtful_residual(point), detail)
        try:
            reshot = _again(point.orbit, track.segments, around)
        except NumericalError as error:
            ledger.enter(Check.MULTIPLIERS, spot, math.inf, str(error))
        else:
            _verify_orbit(ledger, spot, track, point, kind, around, reshot)


def _verify_orbit(
    ledger: Ledger, spot: Spot, track: Track, point: BranchPoint, kind: Kind | None, around: Round, reshot: Reshot
) -> None:
    """Compare one orbit with its integration over one period, and with the result of shooting it again."""
    orbit = point.orbit
    rough = max(1.0, around.error / Check.CLOSURE.bound)
    if rough > 1.0:
        ledger.note(f"{spot}: the error of the other integrator is {around.error:.1g} of the motion")
    ledger.enter(Check.CLOSURE, spot, around.closure / reshot.growth / rough)
    size = around.size
    # its stages change at a point one Newton step away, which matters more if a motion is small for its branch
    slack = max(rough, track.aside(point) / size / Check.STAGES.bound)
    # such a step may have grown more until an event than until the end of the period
    growth = max(reshot.growth, around.growth) if isinstance(around, DryRound) else reshot.growth
    ledger.enter(Check.STAGES, spot, around.astray / growth / slack)
    extremes = float(np.abs(around.extremes - orbit.extremes[:, :2]).max())
    ledger.enter(Check.EXTREMES, spot, extremes / size / reshot.growth / rough)
    if not collapses(orbit.system):  # a volume that vanishes has no logarithm
        off = abs(reshot.contraction - around.contraction) / max(1.0, abs(around.contraction))
        ledger.enter(Check.VOLUME, spot, off / (1.0 + reshot.lost / Check.VOLUME.bound))
    off = _distance(reshot.multipliers, orbit.free_multipliers)
    if off > Check.MULTIPLIERS.bound and isinstance(around, DryRound):
        # beside a graze, errors of the integrator grow as changes of the motion do, and the impact depends on them
        (finer,) = carry([orbit], exact=FINE)
        with suppress(NumericalError):
            reshot = _again(orbit, track.segments, finer)
            off = _distance(reshot.multipliers, orbit.free_multipliers)
    beside: list[NDArray[np.complex128]] = []
    if off > Check.MULTIPLIERS.bound:
        # multipliers belong to a state one Newton step away: the difference may be their variation over such a step
        beside = _beside(track, point, around)
        varied = max((_distance(reshot.multipliers, other) for other in beside), default=0.0)
        if off > _UNKNOWN and off <= _VARIED * varied:
            ledger.note(f"{spot.branch}: beside grazes, multipliers are not verified where rounding decides on them")
        off /= max(1.0, _VARIED * varied / Check.MULTIPLIERS.bound)
    ledger.enter(Check.MULTIPLIERS, spot, off)
    # the number of unstable multipliers is known unless one is on the unit circle
    found, stored = (_not_critical(each, kind) for each in (reshot.multipliers, orbit.free_multipliers))
    if not (is_on_border(found) or is_on_border(stored)):
        counts = [int((np.abs(each) > 1.0).sum()) for each in (found, stored)]
        off = abs(counts[0] - counts[1])
        if off:  # where one crosses the circle or jumps within that step, both numbers are right
            sides = [int((np.abs(each) > 1.0).sum()) for each in beside or _beside(track, point, around)]
            off = min([off, *(abs(count - counts[1]) for count in sides)])
        detail = f"{counts[0]} unstable multipliers, where {counts[1]} are stored"
        ledger.enter(Check.STABILITY, spot, float(off), detail)


def _beside(track: Track, point: BranchPoint, around: Round) -> list[NDArray[np.complex128]]:
    """Return the multipliers of some motions beside a point, on all sides of it, as far as they can be followed."""
    orbit = point.orbit
    near = [orbit.begun_in(orbit.state + aside) for aside in track.asides(point)]
    arounds = carry(near) if isinstance(around, DryRound) else [around] * len(near)
    found = []
    for each, its in zip(near, arounds, strict=True):
        with suppress(NumericalError):
            found.append(_again(each, track.segments, its).multipliers)
    return found


def _not_critical(multipliers: NDArray[np.complex128], kind: Kind | None) -> NDArray[np.complex128]:
    """Return the multipliers of a point except those that are critical at a special point of a kind.

    The critical ones are on the unit circle, up to the error with which they are known.
    """
    if kind is None or not len(places := kind.critical(multipliers)):
        return multipliers
    off = np.abs((multipliers if kind.target is not None else np.abs(multipliers)) - (kind.target or 1.0))
    # known are the coefficients of a polynomial: other roots near a root make it less certain
    known = float(off[places].min() * np.prod(np.minimum(np.delete(off, places), 1.0)))
    return np.delete(multipliers, places) if known < Check.MULTIPLIERS.bound else multipliers


def _again(orbit: Orbit, segments: int, around: Round) -> Reshot:
    """Compute the multipliers of an orbit again: of motions with friction or impacts, by the other integrator."""
    return _carried(orbit, around) if isinstance(around, DryRound) else _reshoot(orbit, segments, around.contraction)


def _carried(orbit: Orbit, around: DryRound) -> Reshot:
    if around.transition is None:
        raise NumericalError("the other integrator cannot follow the orbit over its period")
    units = orbit.system.state_scales()
    growth = float(np.linalg.norm(around.transition * units / units[:, None], 2))
    free = without_kept(multipliers([around.transition]), orbit.kept)
    return Reshot(free, math.nan, max(1.0, growth))


def _reshoot(orbit: Orbit, segments: int, contraction: float) -> Reshot:
    """Shoot an orbit again with more than `segments`; `contraction` is the logarithm of its change of volume."""
    largest = math.log(max(1.0, abs(complex(orbit.multipliers[0]))))
    count = min(_MOST, max(segments + 1, math.ceil((abs(contraction) + largest) / _CONTRACTION)))
    equation = ShootingEquation(orbit.system, None, orbit.period, Shooting(count))
    arcs = equation.evaluate(equation.unknowns(orbit), 0.0).evidence
    logarithms = [np.linalg.slogdet(arc.transition) for arc in arcs]
    total = sum(float(size) if sign > 0.0 else math.nan for sign, size in logarithms)
    units = orbit.system.state_scales()
    parts, growth = len(orbit.restarts) + 1, 1.0
    for part in range(parts):  # those of the segments in which the orbit is known
        around = np.eye(len(units))
        for arc in arcs[part * count // parts : (part + 1) * count // parts]:
            around = arc.transition @ around
        growth = max(growth, float(np.linalg.norm(around * units / units[:, None], 2)))
    found = without_kept(multipliers([arc.transition for arc in arcs]), orbit.kept)
    lost = _EPS * sum(float(np.linalg.cond(arc.transition * units / units[:, None])) for arc in arcs)
    return Reshot(found, total, growth, lost)


def _distance(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    """Return the distance of two sets of multipliers: the largest relative difference of their power sums.

    Multipliers that are about to collide are as sensitive as square roots. Their power sums, the traces of the powers
    of the monodromy matrix, are not.
    """
    size = max(1.0, float(np.abs(a).max()), float(np.abs(b).max()))
    powers = range(1, min(len(a), _POWERS) + 1)
    return max(abs(complex(np.sum((a / size) ** k) - np.sum((b / size) ** k))) for k in powers)


def verify_loci(ledger: Ledger, loci: Sequence[tuple[str, Locus]], advance: Advance | None = None) -> None:
    """Enter the checks of some loci, by their names."""
    for done, (name, locus) in enumerate(loci):
        if advance is not None:
            advance("loci", done, len(loci))
        numbers = sorted({round(place) for place in np.linspace(0, len(locus.points) - 1, _SAMPLED)})
        points = [
            (Spot(name, f"point {number}", locus.points[number].values[0]), locus.points[number].orbit)
            for number in numbers
        ]
        ledger.points += len(points)
        if not locus.points[0].orbit.is_exact:
            for spot, orbit in points:
                if (off := imbalance(orbit)) is not None:
                    ledger.enter(Check.LINES, spot, off.lines)
            ledger.note(
                "for balanced loci the lines are verified, but not the locus condition, which holds up to truncation"
            )
            continue
        for (spot, orbit), around in zip(points, carry([orbit for _, orbit in points]), strict=True):
            try:
                reshot = _again(orbit, 1, around)
            except NumericalError as error:
                ledger.enter(Check.MULTIPLIERS, spot, math.inf, str(error))
                continue
            ledger.enter(Check.CLOSURE, spot, around.closure / reshot.growth)
            ledger.enter(Check.STAGES, spot, around.astray / reshot.growth)
            ledger.enter(Check.MULTIPLIERS, spot, _distance(reshot.multipliers, orbit.free_multipliers))
            ledger.enter(Check.CONDITION, spot, locus.kind.residual(orbit, reshot.multipliers))
