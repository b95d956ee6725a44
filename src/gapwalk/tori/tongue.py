"""Arnold tongues: the region of two parameters in which motions lock to a fraction, between two loci of folds.

Both ends of a window in which motions lock are folds of the locked orbits, and each is followed in a second parameter.
Towards the tip of a tongue its width falls like the power q/2 - 1 of the distance or faster, so that the loci end close
to it, not on it. Where the locked orbits shrink to the orbit that the tori surround, the tip is the Neimark-Sacker
point whose multipliers turn by the fraction: two equations for two parameters, solved by Newton's method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from fractions import Fraction
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import Strobe
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import BranchWalk, walk
from gapwalk.bifurcation.loci import Locus, LocusEndReason, LocusPoint, follow_locus
from gapwalk.bifurcation.loci.follow_locus import plane_of
from gapwalk.bifurcation.loci.locus_equations import MultiplierEquation
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, powers_of_two
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ConvergenceError, GapwalkError, ModelError, NumericalError
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.method import chosen
from gapwalk.orbit.orbit import Orbit, true_period
from gapwalk.orbit.orbit_equation import Newton, solve
from gapwalk.orbit.shooting import Shooting, ShootingEquation
from gapwalk.summary import Rows, SummaryParts, rows_of, summarizes
from gapwalk.tori.torus import TURN, Torus, relative_size

# Locked motions: where a rotation number is a fraction p/q, periodic motions take the place of a torus.
#
# They are q points on each of its m curves, an orbit of m q forcing periods, half of them stable in general, half not.
# Both kinds meet in folds at the two ends of the window in which the motion is locked.

_STARTS = 4  # phases, within one q-th of a turn, from which orbits are looked for
_NEWTON = Newton(iterations=15, halvings=3)
_LOCKED_NEAR = 0.3  # largest distance of a locked orbit from the torus, as a share of its size
_STEPS = WalkOptions(initial_step=1e-4, largest_step=2e-3, max_points=300)
_FIRST, _LONGEST = 0.01, 0.05  # such steps, over the way along the curve after which the branch closes on itself
_REPEATED = 1e-2  # distance of two folds that are the same, over the width of the window
_TURNED = 1e-4  # radians over which the direction of the curve is taken
_PERIODS = 120  # the longest orbits that are looked for, in forcing periods


@dataclass(frozen=True, eq=False)
class LockedWindow:
    """Range of the parameter in which motions lock to a fraction."""

    ratio: Fraction  #: The fraction p/q.
    #: low, high: Ends of the range: folds of the locked orbits. An end that was not reached is the last value that was.
    low: float
    high: float
    is_whole: bool  #: True if both ends are folds.
    orbit: Orbit  #: A locked orbit, stable if there is a stable one.
    folds: tuple[SpecialPoint, ...] = ()  #: The folds at both ends, the lower one first; empty if they were not found.

    def _check_read(self) -> None:
        """Raise a ValueError if its folds are not its ends."""
        if self.folds and tuple(each.value for each in self.folds) != (self.low, self.high):
            raise ValueError("the folds of a locked window are not its ends")

    @property
    def width(self) -> float:
        """Width of the range."""
        return self.high - self.low

    def distance(self, value: float) -> float:
        """Return the distance of a value of the parameter from the range; 0 inside."""
        return max(self.low - value, value - self.high, 0.0)

    @property
    def words(self) -> str:
        """The range and the period, in words."""
        what = f"period {self.orbit.period}, {self.orbit.instability.words}"
        return f"{what}, over {'' if self.is_whole else 'at least '}{self.width:.2g} from {self.low:.9g}"


def find_window(
    torus: Torus, ratio: Fraction | str, parameter: str, near: float, to: tuple[float, float]
) -> LockedWindow:
    """Find the range of a parameter in which motions lock to a rotation number p/q, from a torus next to it.

    Parameters
    ----------
    torus
        A torus whose rotation number is close to the fraction.
    ratio
        The fraction p/q, as ``"1/3"``.
    parameter
        Name of the parameter.
    near
        Value of the parameter inside the window, such as that at which the rotation number along a family of tori is
        the fraction.
    to
        The range in which the locked orbits are followed.

    Returns
    -------
    LockedWindow
        The window, with its two folds if both ends are in the range.

    Raises
    ------
    ModelError
        If `ratio` is no fraction, its orbits are too long, or `near` lies outside of the range.
    ConvergenceError
        If no locked orbit is found there.

    Examples
    --------
    >>> found = gw.tori.find_window(locking, "1/3", "frequency", 3.0, (2.9, 3.1))
    >>> found.is_whole, found.orbit.period
    (True, 3)
    """
    try:
        fraction = Fraction(ratio)
    except (ValueError, ZeroDivisionError):
        raise ModelError(f"ratio is {ratio!r}; write a fraction, as in ratio='1/3'") from None
    if not min(to) <= near <= max(to):
        raise ModelError(f"near is {near:g}, outside the range from {min(to):g} to {max(to):g}")
    if torus.curves * fraction.denominator > _PERIODS:
        raise ModelError(f"orbits of {fraction} repeat after {torus.curves * fraction.denominator} forcing periods; "
                         f"at most {_PERIODS} are looked for")  # fmt: skip
    window = locked_window(torus, fraction, parameter, near, to)
    if window is None:
        raise ConvergenceError(
            f"no orbits of {torus.curves * fraction.denominator} forcing periods were found near the torus at "
            f"{parameter} = {near:.8g}; give another value of near, where the rotation number is {fraction}"
        )
    return window


def locked_window(
    torus: Torus, ratio: Fraction, parameter: str, value: float, within: tuple[float, float]
) -> LockedWindow | None:
    """Find the orbits to which a motion locks near a torus whose rotation number is nearly a fraction."""
    period = torus.curves * ratio.denominator
    if period > _PERIODS:
        return None
    low, high = min(*within, value), max(*within, value)
    orbit = _orbit(torus, period, ratio.denominator, parameter, value)
    if orbit is None:
        orbit = _orbit_at_phase(torus, period, ratio.denominator, parameter, value, (low, high))
    if orbit is None:
        return None
    value = orbit.system[parameter]
    try:
        branch = _once_round(walk(orbit, parameter, (low, high), walk=_steps(torus, ratio.denominator)))
    except GapwalkError:
        return LockedWindow(ratio, value, value, False, orbit)
    folds = sorted(branch.special(Kind.FOLD), key=lambda each: each.value)
    stable = [point.orbit for point in branch.points if point.stable]
    values = [point.value for point in branch.points]
    chosen = stable[len(stable) // 2] if stable else orbit
    # in a window as narrow as rounding, folds cannot be distinguished
    if len(folds) < 2 or folds[-1].value - folds[0].value <= folds[0].uncertainty + folds[-1].uncertainty:
        return LockedWindow(ratio, min(values), max(values), False, chosen)
    return LockedWindow(ratio, folds[0].value, folds[-1].value, True, chosen, (folds[0], folds[-1]))


def _steps(torus: Torus, parts: int) -> WalkOptions:
    """Return the steps along locked orbits: from one to the next they pass one of so many parts of the curve."""
    part = TURN * relative_size(torus) / parts
    first, longest = min(_STEPS.initial_step, _FIRST * part), min(_STEPS.largest_step, _LONGEST * part)
    return replace(_STEPS, initial_step=first, largest_step=longest)


def _once_round(steps: BranchWalk) -> Branch:
    """Return a branch, walked until its folds repeat: then each orbit has taken the place of the next one on the curve.

    Their places may be too near to each other for the walk to see that the branch has closed.
    """
    folds: list[float] = []
    for _ in steps:
        folds += [each.value for each in steps.special_points if each.kind is Kind.FOLD]
        if len(folds) > 2 and abs(folds[-1] - folds[0]) < _REPEATED * abs(folds[1] - folds[0]):
            break
    return steps.branch


def _orbit(torus: Torus, period: int, parts: int, parameter: str, value: float) -> Orbit | None:
    system = torus.system.at({parameter: value})
    equation = ShootingEquation(system, None, period)
    unit = system.state_scales()
    for share in np.arange(_STARTS) / (_STARTS * parts):
        start = torus.state(TURN * float(share))
        try:
            unknowns, evaluation = solve(equation, start, 0.0, _NEWTON)
        except NumericalError:
            continue
        away = (torus.states - unknowns) / unit
        orbit = equation.orbit(unknowns, 0.0, evaluation)
        if np.abs(away).max(axis=1).min() < _LOCKED_NEAR * torus.size and true_period(orbit) == period:
            return orbit
    return None


def _orbit_at_phase(
    torus: Torus, period: int, parts: int, parameter: str, value: float, within: tuple[float, float]
) -> Orbit | None:
    """Return a locked orbit at a given phase of the torus, and at a value of the parameter that follows from it."""
    # A window may be narrower than the error of `value`, so that no orbit exists there. Its orbits have all phases,
    # each at a value of its own: the state may then move in all directions but along the curve, and the parameter
    # varies.
    system = torus.system.at({parameter: value})
    equation, unit = ShootingEquation(system, parameter, period), system.state_scales()
    corrector = Corrector(equation, powers_of_two(np.append(unit, abs(value) or 1.0)))
    for share in np.arange(_STARTS) / (_STARTS * parts):
        psi = TURN * float(share)
        along = (torus.state(psi + _TURNED) - torus.state(psi - _TURNED)) / corrector.scales[:-1]
        normal = np.append(along / np.linalg.norm(along), 0.0)
        found = corrector.correct(np.append(torus.state(psi), value) / corrector.scales, normal)
        if found is None:
            continue
        unknowns, place = found.x[:-1] * corrector.scales[:-1], float(found.x[-1] * corrector.scales[-1])
        away = np.abs((torus.states - unknowns) / unit).max(axis=1).min()
        if not within[0] <= place <= within[1] or away >= _LOCKED_NEAR * torus.size:
            continue
        orbit = equation.orbit(unknowns, place, found.evaluation)
        if true_period(orbit) == period:
            return orbit
    return None


_LOST = (LocusEndReason.STEP, LocusEndReason.RESONANCE, LocusEndReason.COARSE)  # ends that may be close to a tip
_MEETS = 5e-3  # distance of the ends of both loci within which they meet, as a share of their extents
_NEAR = 0.25  # distance of a tip from these ends: in narrow tongues they are far from it
_SAME = 1e-6  # distance of the tips to which both sides lead
# tolerance of folds: loci are strongly curved next to a tip, and a last Newton step from 1e-10 left residuals of 8e-9
_EXACT = Shooting(tolerance=1e-11)
_NARROW = 1e-8  # width of a window, relative to the parameter, at which its folds are no longer told apart
_PLACES = (0, -1)  # of the ends of a locus among its points
_SHARES = (0.02, 0.9)  # of the way along a side, at which widths are compared
_OPENS = 0.01  # ratio of these widths: that of a tongue that opens like a wedge
_SMALL = 1e-6  # step of differences, and change at which the tip is found, as shares of the extents
_ITERATIONS = 12


class TongueTipKind(StrEnum):
    """Kind of the tip of a tongue."""

    NEIMARK_SACKER = "the locked motions shrink to the orbit that the tori surround, at a Neimark-Sacker point"
    MEETING = "both sides meet"


@dataclass(frozen=True, slots=True)
class TongueTip:
    """Tip of a tongue."""

    _row: ClassVar = "kind values uncertainty"

    kind: TongueTipKind  #: What happens there.
    values: tuple[float, float]  #: Values of both parameters.
    uncertainty: tuple[float, float]  #: Estimated error of each value.

    def __str__(self) -> str:
        return f"{self.kind.value}, at ({self.values[0]:.9g}, {self.values[1]:.9g})"


@dataclass(frozen=True, eq=False)
class Tongue(Shown):
    """Region of two parameters in which motions lock to a fraction."""

    ratio: Fraction  #: The fraction p/q.
    curves: int  #: m, the number of curves of the tori; locked orbits repeat after m q forcing periods.
    #: Loci of the folds at the lower and at the upper end of the window from which the tongue was followed.
    sides: tuple[Locus, Locus]
    tip: TongueTip | None = None  #: The place at which both sides meet; None if they do not within the ranges.
    ends: tuple[str, ...] = ()  #: The other ends of both sides, in sentences.
    #: Those of them at which the numerics gave up although the tongue is wide enough to be resolved.
    failures: tuple[str, ...] = ()

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        periods = {side.period for side in self.sides}
        if periods != {self.curves * self.ratio.denominator}:
            raise ValueError("the sides of a tongue are loci of other periods than the fraction says")

    @property
    def first(self) -> str:
        """Name of the parameter of the window."""
        return self.sides[0].first

    @property
    def second(self) -> str:
        """Name of the second parameter."""
        return self.sides[0].second

    @property
    def period(self) -> int:
        """Forcing periods of the locked orbits."""
        return self.sides[0].period

    @property
    def reach(self) -> tuple[float, float]:
        """Range of the second parameter that both sides reach."""
        values = [side.values[:, 1] for side in self.sides]
        return max(float(each.min()) for each in values), min(float(each.max()) for each in values)

    def edges(self, second: float) -> tuple[float, float]:
        """Return the ends of the window at a value of the second parameter, to the tolerance of the loci."""
        return _edges(self.sides, second)

    def width(self, second: float) -> float:
        """Return the width of the window at a value of the second parameter; see `edges`."""
        low, high = self.edges(second)
        return high - low

    @property
    def complete(self) -> bool:
        """True if both sides were followed to their ends."""
        return all(end.reason is not LocusEndReason.STOPPED for side in self.sides for end in side.ends)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the fraction, the reach, the tip and the ends, in words."""
        low, high = self.reach
        yield (
            f"tongue {self.ratio}, period {self.period}, over {self.first} and {self.second}: "
            f"{self.width(low):.2g} wide at {self.second} = {low:.8g}, {self.width(high):.2g} at {high:.8g}"
        )
        yield f"tip: {self.tip}" if self.tip is not None else "tip: the sides do not meet in these ranges"
        yield from self.ends

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the table of the points of both sides."""
        return {"sides": lambda: rows_of(self.rows())}

    def rows(self) -> list[dict[str, Any]]:
        """Return the points of both sides as rows of a table."""
        return [
            {"ratio": str(self.ratio), "side": name, self.first: float(one), self.second: float(other)}
            for name, side in zip(("lower", "upper"), self.sides, strict=True)
            for one, other in side.values
        ]

    def __repr__(self) -> str:
        tip = "no tip" if self.tip is None else f"tip at ({self.tip.values[0]:.9g}, {self.tip.values[1]:.9g})"
        return f"Tongue({self.ratio}, period {self.period}, {self.first} and {self.second}, {tip})"


def follow_tongue(
    window: LockedWindow,
    first: str,
    second: str,
    to: tuple[tuple[float, float], tuple[float, float]],
    *,
    walk: WalkOptions | None = None,
) -> Tongue:
    """Follow both ends of a window in which motions lock, in a second parameter.

    Parameters
    ----------
    window
        The window, of an event of a family of tori; both of its ends must be folds.
    first, second
        Names of the parameter of the window and of the second one.
    to
        The range of each: ``((low, high), (low, high))``.
    walk
        Options of the walks.

    Returns
    -------
    Tongue
        Both sides, and the tip if they meet.

    Raises
    ------
    ModelError
        If an end of the window is not a fold, for example because the window is narrower than rounding errors; for
        unknown or equal parameters; for ranges that exclude the window.
    ConvergenceError
        If a locus cannot be started.

    Notes
    -----
    Kuznetsov (2004), *Elements of Applied Bifurcation Theory*, section 7.3; Govaerts (2000), *Numerical Methods for
    Bifurcations of Dynamical Equilibria*.

    Examples
    --------
    >>> tongue = gw.tori.follow_tongue(window, "frequency", "harmonic1.amplitude", ((2.9, 3.1), (0.0, 0.5)))
    >>> [round(tongue.width(force) / force, 4) for force in (0.1, 0.3)]
    [0.0748, 0.0742]
    """
    if len(window.folds) != 2:
        raise ModelError(
            f"the window of {window.ratio} has no two folds ({window.words}), so no tongue can be followed from it; "
            "choose an event whose window is_whole"
        )
    lower, upper = sides = tuple(
        follow_locus(fold, first, second, to, walk=walk, method=_EXACT) for fold in window.folds
    )
    curves = window.orbit.period // window.ratio.denominator
    tip = _tip_of((lower, upper), window.ratio, curves, to[1])
    ends, failures = list[str](), list[str]()
    for name, side in zip(("lower", "upper"), sides, strict=True):
        for point, end in zip((side.points[0], side.points[-1]), side.ends, strict=True):
            if tip is not None and end.reason in _LOST and _away(point, tip.values, (lower, upper)) < _NEAR:
                continue
            narrow = end.reason in _LOST and _is_narrow((lower, upper), point)
            words = f"the tongue is too narrow to be resolved, at ({end.values[0]:.8g}, {end.values[1]:.8g})"
            ends.append(f"{name} side: {words if narrow else end}")
            if end.reason.is_failure and not narrow:
                failures.append(f"tongue {window.ratio}, {ends[-1]}")
    return Tongue(window.ratio, curves, (lower, upper), tip, tuple(ends), tuple(failures))


def _extents(sides: tuple[Locus, Locus]) -> NDArray[np.float64]:
    """Return how far both sides reach in each parameter, shape (2,)."""
    values = np.concatenate([side.values for side in sides])
    return np.ptp(values, axis=0) + np.finfo(float).tiny


def _away(point: LocusPoint, values: tuple[float, float] | NDArray[np.float64], sides: tuple[Locus, Locus]) -> float:
    return float(np.abs(np.subtract(point.values, values) / _extents(sides)).max())


def _is_narrow(sides: tuple[Locus, Locus], point: LocusPoint) -> bool:
    """Return True if both sides cannot be told apart at the end of one of them."""
    shared = [(float(side.values[:, 1].min()), float(side.values[:, 1].max())) for side in sides]
    low, high = max(each[0] for each in shared), min(each[1] for each in shared)
    edges = _edges(sides, min(max(point.values[1], low), high))
    return bool(edges[1] - edges[0] < _NARROW * abs(point.values[0]))


def _tip_of(sides: tuple[Locus, Locus], ratio: Fraction, curves: int, within: tuple[float, float]) -> TongueTip | None:
    """Return the place at which both loci end together; None if they do not within the range of the second one."""
    extents, names = _extents(sides), (sides[0].first, sides[0].second)
    found = []  # the Neimark-Sacker points to which the ends of each side lead
    for side in sides:
        points = [side.points[place] for place in _PLACES if side.ends[place].reason in _LOST]
        located = [
            (point, _resonant_point(point.orbit, names, point.values, extents, ratio, curves)) for point in points
        ]
        found.append([each for point, each in located if each is not None and _away(point, each[0], sides) < _NEAR])
    for one, other in product(*found):
        if np.abs((one[0] - other[0]) / extents).max() < _SAME:
            error = np.maximum(one[1], np.abs(one[0] - other[0]))
            return TongueTip(TongueTipKind.NEIMARK_SACKER, _pair(one[0]), _pair(error))
    if min(len(side.points) for side in sides) < 2:
        return None
    places = min(product(_PLACES, _PLACES), key=lambda each: _gap(sides, each, extents))
    are_lost = all(side.ends[place].reason in _LOST for side, place in zip(sides, places, strict=True))
    if _gap(sides, places, extents) > (_MEETS if are_lost else _SAME) or not (
        are_lost or _opens(sides, places, within)
    ):
        return None
    one, other = (np.array(side.points[place].values) for side, place in zip(sides, places, strict=True))
    # the sides end where Newton's method fails, about as far from the tip as their last steps are long
    steps = [
        np.abs(side.values[place] - side.values[1 if place == 0 else -2])
        for side, place in zip(sides, places, strict=True)
    ]
    error = np.abs(one - other) + (np.max(steps, axis=0) if are_lost else 0.0)
    return TongueTip(TongueTipKind.MEETING, _pair(0.5 * (one + other)), _pair(error))


def _opens(sides: tuple[Locus, Locus], places: tuple[int, ...], within: tuple[float, float]) -> bool:
    """Return True if both sides part at once from the edge at which they touch, as they do not in a narrow tongue."""
    # So it is where an oscillator that excites itself is driven by no load any more.
    over = sides[0].values[:, 1]
    begin, end = over[places[0]], over[-1 if places[0] == 0 else 0]
    if min(abs(begin - limit) for limit in within) > _SAME * abs(end - begin):
        return False
    near, far = (_edges(sides, begin + share * (end - begin)) for share in _SHARES)
    return bool(near[1] - near[0] > _OPENS * (far[1] - far[0]))


def _gap(sides: tuple[Locus, Locus], places: tuple[int, ...], extents: NDArray[np.float64]) -> float:
    one, other = (side.points[place].values for side, place in zip(sides, places, strict=True))
    return float(np.abs(np.subtract(one, other) / extents).max())


def _pair(values: NDArray[np.float64]) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _resonant_point(
    locked: Orbit,
    names: tuple[str, str],
    guess: tuple[float, float],
    extents: NDArray[np.float64],
    ratio: Fraction,
    curves: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the parameters at which the multipliers of the orbit of m forcing periods turn by the fraction."""
    strobe, state, strobes = Strobe(locked.system), locked.state, []
    for _ in range(ratio.denominator):
        strobes.append(state)
        state = strobe.arc(state, curves).state
    # the locked orbit surrounds the one of m forcing periods, which is in the middle of its q strobes
    start = np.mean(strobes, axis=0)
    turn = TURN * min(float(ratio % 1), 1.0 - float(ratio % 1))

    def away(values: NDArray[np.float64], start: NDArray[np.float64]) -> tuple[NDArray[np.float64], Orbit]:
        system = locked.system.at(dict(zip(names, values.tolist(), strict=True)))
        orbit = find_orbit(system, curves, start)
        critical = min((each for each in orbit.multipliers if each.imag > 0.0), key=lambda each: abs(abs(each) - 1.0))
        return np.array((math.log(abs(critical)), float(np.angle(critical)) - turn)), orbit

    values = np.array(guess)
    try:
        for _ in range(_ITERATIONS):
            residual, orbit = away(values, start)
            start = orbit.state
            shifts = _SMALL * extents
            columns = [(away(values + shift, start)[0] - residual) for shift in np.diag(shifts)]
            change = np.asarray(np.linalg.solve(np.column_stack(columns) / shifts, -residual), dtype=np.float64)
            values = np.asarray(values + change, dtype=np.float64)
            if np.abs(change / extents).max() < _SMALL**1.5:
                return values, np.abs(change) + _SMALL**1.5 * extents
    except (GapwalkError, NumericalError, np.linalg.LinAlgError, ValueError):  # a ValueError: no complex multiplier
        return None
    return None


def _edges(sides: tuple[Locus, Locus], second: float) -> tuple[float, float]:
    first, last = sorted(_edge(side, second) for side in sides)
    return first, last


def _edge(side: Locus, second: float) -> float:
    """Return the first parameter where a locus passes a value of the second one; nan where it does not."""
    # It is corrected there: in a narrow tongue the difference of two interpolated sides would be that of their errors.
    over = side.values[:, 1]
    steps = np.flatnonzero((over[:-1] - second) * (over[1:] - second) <= 0.0)
    if not len(steps):
        return math.nan
    along = np.array([point.arclength for point in side.points])
    place = int(steps[np.argmin(np.abs(along[steps]))])
    before, after = side.points[place], side.points[place + 1]
    share = (second - over[place]) / ((over[place + 1] - over[place]) or 1.0)
    plane = plane_of(chosen(None), before.orbit, (side.first, side.second))
    widths = np.ptp(side.values, axis=0) + np.finfo(float).tiny
    scales = powers_of_two(np.append(plane.scales(before.orbit), widths))
    corrector = Corrector(MultiplierEquation(plane, Kind.FOLD, scales, plane.tolerance), scales)
    ends = [np.append(point.orbit.state, point.values) for point in (before, after)]
    found = corrector.at_value((ends[0] + share * (ends[1] - ends[0])) / scales, second)
    return math.nan if found is None else float(found.x[-2] * scales[-2])
