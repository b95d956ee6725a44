"""Verification of exact orbits, of branches and loci: integrated by another method, and shot again in more segments.

All orbits of some branches are integrated together. Of a locus a sample of the points is verified.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import singledispatch
from itertools import combinations, islice
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import halves_apart
from gapwalk.bifurcation.branch_start import switch as switch_branch
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, Range, scales_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.floquet import is_on_border, multipliers
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.orbit.sticking import collapses, without_kept
from gapwalk.verification.dop853 import Round
from gapwalk.verification.friction_dop853 import FINE, DryRound, carry
from gapwalk.verification.independent_equations import Equations
from gapwalk.verification.verification import Advance, Check, Ledger, Spot
from gapwalk.verification.verify_special_points import Track, special_spot

# Verification of balanced orbits: their lines by quadrature, and an exact motion for comparison.
#
# Here the contact forces are sampled, between breakpoints by Gauss's rule, whereas harmonic balance computes their
# spectrum in closed form. Truncation is not a fault, so an exact motion may differ by as much as truncation explains.

Array = NDArray[np.float64]

_PERIOD = 2.0 * math.pi
_NODES, _WEIGHTS = leggauss(8)
_CELLS = 16  # of the grid per line on which kinks are bracketed
_BISECTIONS = 50
_HALVINGS = 24  # of panels beside a fractional power
_PANELS = 1.0  # panels per line; each breakpoint adds one
_EXACT_POINTS = 60  # number of points of a branch for which an exact motion is sought
_LARGE = 20  # degrees of freedom from which no exact motion is sought: its flow would take too long
_AMPLIFIED = 30.0  # allowed difference, in neglected amounts, of a motion whose multipliers are far from 1
_FINEST = 1e-7  # smallest neglected amount that is assumed
_NEAR = 0.05  # distance of a multiplier from criticality within which nothing is concluded
_BATCH = 2_000_000  # numbers in the wave matrix of one batch of panels


def verify_truncated(ledger: Ledger, track: Track) -> None:
    """Check the orbits of a branch that are not exact."""
    for spot, point, _ in track.spots():
        ledger.enter(Check.RECORD, spot, track.mismatch(point))
        ledger.enter(Check.RESIDUAL, spot, track.doubtful_residual(point))
        if (off := imbalance(point.orbit)) is not None:
            ledger.enter(Check.LINES, spot, off.lines)
            ledger.enter(Check.STAGES, spot, off.astray)
    points, size = track.branch.points, track.branch.system.size
    if size >= _LARGE:
        ledger.note(f"{track.name}: with {size} degrees of freedom no exact motions were compared with it")
        return
    for spot, point, _ in islice(track.spots(), 0, len(points), max(1, math.ceil(len(points) / _EXACT_POINTS))):
        _compare_with_exact(ledger, spot, point)


class Imbalance(NamedTuple):
    """Errors of an orbit that is not exact, in the equations of motion and at its breakpoints."""

    lines: float  #: Residual of its lines in the equations of motion, relative to the largest term of these.
    astray: float  #: Error at the breakpoints; see `gapwalk.verification.dop853.Round`.


@singledispatch
def imbalance(orbit: Orbit) -> Imbalance | None:
    """Return the residual of an orbit's lines in the equations of motion; None for a class that has no lines."""
    return None


@imbalance.register(BalancedOrbit)
def _of_series(orbit: BalancedOrbit) -> Imbalance:
    system, lines = orbit.system, orbit.series.lines
    count, equations = lines.shape[1] - 1, Equations([system])
    rate = 1j * np.arange(count + 1) * system.frequency / orbit.period
    total = np.zeros((system.size, count + 1), dtype=complex)
    largest, astray, length = 0.0, 0.0, float(np.abs(orbit.extremes[:, :2]).max())
    for theta, weights in _panels(orbit, count, _kinks(orbit, equations, count)):
        waves, states = _states(orbit, theta)
        accelerations = (waves @ (lines * rate**2).T).real
        depths, closed = _closed(equations, theta, states)
        rates = equations.rates(theta, states, closed)[:, system.size : 2 * system.size] * system.frequency
        total += (weights[:, None] * (accelerations - rates)).T @ waves.conj()
        largest = max(largest, float(np.abs(accelerations).max()), float(np.abs(rates).max()))
        astray = max(astray, _astray(orbit, theta, depths))
    total *= np.where(np.arange(count + 1), 2.0, 1.0) / (_PERIOD * orbit.period)
    tiny = np.finfo(float).tiny
    return Imbalance(float(np.abs(total).max()) / max(largest, tiny), astray / max(length, tiny))


def _states(orbit: BalancedOrbit, theta: Array) -> tuple[NDArray[np.complex128], Array]:
    """Return the waves of all lines at some angles, and positions, velocities and a zero, shape (angles, 2n + 1)."""
    lines = orbit.series.lines
    k = np.arange(lines.shape[1])
    waves, rate = np.exp(1j * np.outer(theta / orbit.period, k)), 1j * k * orbit.system.frequency / orbit.period
    parts = [(waves @ (lines * rate**power).T).real for power in (0, 1)]
    return waves, np.column_stack((*parts, np.zeros(len(theta))))


def _closed(equations: Equations, theta: Array, states: Array) -> tuple[Array, Array]:
    """Return the depths beyond the breakpoints, and 1 for each stage that acts, otherwise 0."""
    depths = equations.depths(equations.deflections(theta, states[:, : equations.size]))
    return depths, (depths > 0.0).astype(float)


def _kinks(orbit: BalancedOrbit, equations: Equations, count: int) -> Array:
    """Return the angles at which a number jumps or a formula has a kink, and angles that approach the latter."""
    end = _PERIOD * orbit.period
    turns = _PERIOD * np.arange(orbit.period)[:, None]
    known = [(turns + jumps).ravel() for jumps in equations.jumps(0)]
    if equations.guard_count:

        def guards(theta: Array) -> Array:
            _, states = _states(orbit, theta)
            return equations.guards(theta, states, _closed(equations, theta, states)[1])

        grid = np.linspace(0.0, end, _CELLS * (count + 1) + 1)
        above = guards(grid) > 0.0
        cells, modes = np.nonzero(above[1:] != above[:-1])
        low, high, each = grid[cells], grid[cells + 1], np.arange(len(cells))
        for _ in range(_BISECTIONS if len(cells) else 0):
            middle = 0.5 * (low + high)
            is_like_low = (guards(middle)[each, modes] > 0.0) == above[cells, modes]
            low, high = np.where(is_like_low, middle, low), np.where(is_like_low, high, middle)
        # beside a fractional power the rule needs panels that become smaller and smaller
        approach = np.outer(2.0 ** -np.arange(_HALVINGS), [-1.0, 1.0]).ravel() * end / (count + 1)
        known += [low, (low[equations.graded[modes], None] + approach).ravel() % end]
    return np.concatenate(known) if known else np.zeros(0)


def _panels(orbit: BalancedOrbit, count: int, kinks: Array):
    """Yield angles and weights of Gauss's rule on panels that end at breakpoints and kinks, in batches."""
    end = _PERIOD * orbit.period
    knots = np.linspace(0.0, end, math.ceil(_PANELS * count) + 2)
    knots = np.unique(np.concatenate((knots, [event.theta % end for event in orbit.events], kinks)))
    size = max(1, _BATCH // (8 * (count + 1)))
    for first in range(0, len(knots) - 1, size):
        a, b = knots[first : first + size + 1][:-1], knots[first + 1 : first + size + 1]
        half = 0.5 * (b - a)
        yield ((0.5 * (a + b))[:, None] + half[:, None] * _NODES).ravel(), (half[:, None] * _WEIGHTS).ravel()


def _astray(orbit: Orbit, theta: NDArray[np.float64], depths: NDArray[np.float64]) -> float:
    """Return the distance by which a deflection is on the wrong side of a breakpoint, according to its events."""
    worst = 0.0
    for switch in range(depths.shape[1]):
        events = [event for event in orbit.events if event.switch == switch]
        depth = depths[:, switch]
        if events:
            order = np.argsort([event.theta for event in events])
            thetas = np.array([events[index].theta for index in order])
            enters = np.array([events[index].enters for index in order])
            closed = enters[np.searchsorted(thetas, theta, side="right") - 1]
            worst = max(worst, float(np.where(closed, -depth, depth).max()))
        else:
            worst = max(worst, min(float(depth.max()), float(-depth.min())))
    return worst


def _compare_with_exact(ledger: Ledger, spot: Spot, point: BranchPoint) -> None:
    """Find an exact motion near one that is not, and compare their states and stability."""
    orbit = point.orbit
    near = float(np.abs(orbit.free_multipliers - 1.0).min())
    if near < _NEAR:
        return  # near a fold or a branch point
    try:
        exact = find_orbit(orbit.system, orbit.period, orbit.state)
    except NumericalError as error:
        ledger.enter(Check.TRUTH, spot, math.inf, f"no exact motion is found from it: {error}")
        return
    n, size = orbit.system.size, np.full(orbit.system.state_size, np.abs(orbit.extremes[:, :2]).max())
    size[n : 2 * n] = np.abs(orbit.motion().v).max()
    off = float((np.abs(exact.state - orbit.state) / size).max())
    allowed = _AMPLIFIED * max(orbit.truncation, _FINEST) / min(1.0, near)
    ledger.enter(
        Check.TRUTH, spot, off / allowed, f"difference {off:.2g} of the motion, truncation {orbit.truncation:.2g}"
    )
    # the truncation may change the number of multipliers outside of the unit circle if one is near it
    distances = np.abs(np.abs(orbit.free_multipliers) - 1.0)
    if not is_on_border(orbit.free_multipliers) and distances.min() >= max(_NEAR, allowed):
        found = exact.instability.total
        detail = f"{found} unstable multipliers of the exact motion, where {orbit.instability.total} are stored"
        ledger.enter(Check.STABILITY, spot, float(found != orbit.instability.total), detail)


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
        starts = switch_branch(special, diagram.parameter, diagram.within, method)
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
        for name in point.orbit.turned_back:
            ledger.note(
                f"{spot.branch}: {name} slips back and forth, but its torque is that of one direction; write dry "
                "friction as [[friction]], and a square drag as a [[force]] with v*abs(v)"
            )
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


def verify_orbit(ledger: Ledger, orbit: Orbit) -> None:
    """Check one orbit, as the only point of a branch along the frequency, or its first number if it has none."""
    names = orbit.system.structure.names
    parameter = "frequency" if "frequency" in names else names[0]
    value = orbit.system[parameter]
    method = orbit.own_method or orbit.posed_in(orbit.system.state_size)
    equation = method.pose(orbit.system, parameter, orbit.period)
    corrector = Corrector(equation, scales_of(equation, orbit, Range(value, value + (abs(value) or 1.0))))
    x = np.append(equation.unknowns(orbit), value) / corrector.scales
    point = corrector.uncorrected(x, np.eye(len(x))[-1], 0.0)
    ends = (End(EndReason.POINTS, value), End(EndReason.POINTS, value))
    track = Track("the orbit", Branch(parameter, orbit.period, (replace(point, orbit=orbit),), (), ends))
    (verify_orbits(ledger, [track], None) if track.is_exact else verify_truncated(ledger, track))
    ledger.points += 1


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
    """Return the multipliers of a point except those that are critical at a special point of a kind."""
    # The critical ones are on the unit circle, up to the error with which they are known.
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
    """Return the distance of two sets of multipliers: the largest relative difference of their power sums."""
    # Multipliers that are about to collide are as sensitive as square roots. Their power sums, the traces of the powers
    # of the monodromy matrix, are not.
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
                "loci of harmonic balance: the harmonics are verified, but the locus condition holds up to truncation"
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
