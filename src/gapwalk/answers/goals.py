"""Goals of a design: what a response should be, as margins that must not be negative, with their derivatives.

A goal is reached where all its margins are at least zero. How it is reached may be open: folds leave a band at its
lower or its upper end, or vanish in it. Each such way is a smooth problem of its own, and all are tried.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import chosen_gaps, contact_place, gap_state, innermost, kept, kept_side
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.corrector import Corrector, hermite
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Walk, WalkOptions
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.flow.motion import force_of, quadrature, signal_names, signal_place
from gapwalk.model.bounds import Positive, check_fields
from gapwalk.model.equilibria import Equilibrium, find_equilibria
from gapwalk.model.modes import find_modes
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.model.words import between_words
from gapwalk.orbit.method import chosen
from gapwalk.orbit.orbit import Orbit
from gapwalk.pieces import tell_stage

# One response over a range of a parameter, and how its points move when other parameters change.
#
# A point of a response that is not a special point has no place of its own. If it is the extreme of a measure along
# the branch, the derivative of that extreme by a parameter is that of the measure at any point nearby, because the
# measure does not change along the branch there (envelope theorem). So a point is corrected again at slightly changed
# values of each parameter, in the plane across the branch, and the central difference of the measure is the
# derivative.

COARSE = WalkOptions(initial_step=0.02, largest_step=0.05)
"""Steps of the responses that are walked at each design."""

_DIFFERENCE = 1e-4  # change of a parameter for a central difference, as a share of its scale
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
    is_plain: bool = False  #: True if its special points do not matter, and are not sought.

    @cached_property
    def walked(self) -> Branch:
        """The branch as far as it was walked."""
        begin = self.system[self.parameter]

        def told(point: BranchPoint, _: object) -> None:
            tell_stage((point.value - begin) / (self.end - begin))

        if self.is_plain:
            way = 1 if self.forward > 0.0 else -1
            start = start_branch(self.lead, self.parameter, self.end, way, chosen(self.lead.own_method))
            steps, points = Walk(start.first, start.within, start.corrector, self.walk), [start.first]
            for point in steps:
                points.append(point)
                told(point, None)
            if steps.end is not None and steps.end.reason is EndReason.RANGE:
                ends = End(EndReason.START, points[0].value), steps.end
                return Branch(self.parameter, self.lead.period, tuple(points), (), ends)
        return follow(self.lead, self.parameter, self.end, walk=self.walk, report=told)

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
            values = [measure(self._moved(place, name, sign * _DIFFERENCE * scale)) for sign in (-1.0, 1.0)]
            slopes[k] = (values[1] - values[0]) / (2.0 * _DIFFERENCE)
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
            raise ConvergenceError(f"no motion near the one at {point.value:.6g} was found for a changed {name}")
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


MARGIN = 1e-3
"""Safety margin: as a share of the width of a band, of a limit, or of a measure of size 1."""
EXACT = 1e-9
"""Margin that may be missing because of rounding."""
LOWEST = 3
"""Local minima of a measure along a branch that are kept away from zero."""


class Need(NamedTuple):
    """Margin with which a design reaches one part of a goal, such as one fold that must lie outside a band.

    Examples
    --------
    >>> need = gw.ask.Need(margin=0.1, slopes=np.array([0.5]), words="fold at 1.39 below the band")
    >>> need.margin
    0.1
    """

    margin: float  #: Relative to the width of the band, to the limit or to the clearance; negative if missed.
    slopes: NDArray[np.float64]  #: shape (k,): Derivatives of `margin` by relative changes of the parameters.
    words: str  #: Description.


@dataclass(frozen=True)
class Goal(ABC):
    """A goal of a design."""

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways in which a system may reach the goal; each is tried."""
        return ("",)

    def posed(self, system: System, way: str) -> System:
        """Return the system, with the same parameters, on whose response the margins of a way are taken."""
        return system

    @property
    def band(self) -> tuple[float, float] | None:
        """The band of the walked parameter for which it is set; None if there is none."""
        return getattr(self, "within", None)

    @abstractmethod
    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""

    @abstractmethod
    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins at a design, with their derivatives, less the safety margin."""

    @abstractmethod
    def margin(self, response: LocalResponse) -> float:
        """Return how far the goal is reached at a design, in whichever way; negative if it is not."""

    def against(self, branch: Branch) -> list[str]:
        """Return sentences on what an isolated branch has against the goal."""
        return []

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if the goal is none of this system, or leaves the range of the response."""
        low, high = self.band or ends
        if not ends[0] <= low < high <= ends[1]:
            raise ModelError(
                f"a goal is set from {low:g} to {high:g}; it must lie inside the range of the response, "
                f"{ends[0]:g} to {ends[1]:g}"
            )


# The goal that no special point of a kind lies in a band: points leave it at either end, or vanish in it.

_MOVES: dict[str, Callable[[float, float, float], bool]] = {  # True if a point of a band leaves it at its upper end
    "below": lambda value, low, high: value > high,
    "above": lambda value, low, high: value > low,
    "apart": lambda value, low, high: value > 0.5 * (low + high),
}


@dataclass(frozen=True)
class NoPoint(Goal):
    """No special point of one kind, such as a fold, lies within a band of the parameter of the response.

    Examples
    --------
    >>> gw.ask.NoPoint("fold", (1.35, 1.42)).words(system, "frequency")
    'no fold between Ω = 1.35 and 1.42'
    """

    kind: Kind  #: ``fold``, ``flip``, ``neimark-sacker`` or ``grazing``.
    within: tuple[float, float]  #: The band: its lower and its upper end.

    def __post_init__(self) -> None:
        known = [str(each) for each in Kind.known() if not each.no_locus]
        if str(self.kind) not in known:
            raise ModelError(f"a goal has no = {str(self.kind)!r}; {did_you_mean(str(self.kind), known)}")
        object.__setattr__(self, "kind", next(each for each in Kind.known() if str(each) == str(self.kind)))
        low, high = self.within
        if not low < high:
            raise ModelError(f"the band of a goal is from {low:g} to {high:g}; write the smaller value first")

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways in which special points can leave the band, such as ``below``."""
        return (*_MOVES, "vanish") if self.kind in (Kind.FOLD, Kind.FLIP) else tuple(_MOVES)

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        return f"no {self.kind} {between_words(self.within, parameter, system.units)}"

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margin of each special point of the kind; if they are to vanish, margins of the branch.

        Between two folds the branch runs back: the component of its tangent along the parameter is negative. The least
        value of this component is zero if both folds merge in a cusp, and positive beyond the cusp. For two flips, the
        product of (multiplier + 1) over all multipliers changes its sign in the same way.
        """
        points = [each for each in response.branch.special_points if each.kind == self.kind]
        if way != "vanish" and (points or "vanish" not in self.ways(response.system)):
            return _moved_out(response, points, self.within, way, margin)
        # without points, others must not appear: a design beyond the cusp may come back to it, and no further
        measure = response.advance if self.kind is Kind.FOLD else _from_flips
        words = "the branch does not run back" if self.kind is Kind.FOLD else "no multiplier passes -1"
        return [
            Need(value - margin, response.slopes(place, measure), f"{words} near {place.point.value:.6g}")
            for place, value in response.lowest(measure, *self.within, most=LOWEST)
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance of the nearest such point from the band, over the width of the band; at most 1."""
        low, high = self.within
        parts = [
            max(low - each.value, each.value - high) / (high - low)
            for each in response.branch.special_points
            if each.kind == self.kind
        ]
        return min([1.0, *parts])

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence on each special point of the kind that an isolated branch has inside the band."""
        low, high = self.within
        points = [each for each in branch.special_points if each.kind == self.kind]
        return [
            f"an isolated branch has a {each.kind} at {each.value:.8g}, inside the band"
            for each in points
            if low <= each.value <= high
        ]


def _from_flips(point: BranchPoint) -> float:
    return float(np.prod(1.0 + point.orbit.free_multipliers).real)


def _moved_out(
    response: LocalResponse, points: Sequence[SpecialPoint], within: tuple[float, float], way: str, margin: float
) -> list[Need]:
    """Return the margins of special points that are to leave a band on the sides that a way says."""
    low, high = within
    width, needs = high - low, []
    for special in points:
        to_top = _MOVES[way](special.value, low, high)
        slopes = special.gradient(*response.names).slopes * np.array(response.scales)
        side = 1.0 if to_top else -1.0
        part = side * (special.value - (high if to_top else low)) / width
        words = f"{special.kind} at {special.value:.6g} {'above' if to_top else 'below'} the band"
        needs.append(Need(part - margin, side * slopes / width, words))
    return needs


# The goal that the peak of a signal stays below a limit over a band.

_FAR = 0.5  # margin, as a share of a limit, beyond which a peak does not count in one step


@dataclass(frozen=True)
class PeakBelow(Goal):
    """The peak of a signal stays below a limit over a band of the parameter, in unstable motions too.

    Examples
    --------
    >>> gw.ask.PeakBelow("stop", 9.0, (1.2, 1.35)).words(system, "frequency")
    'peak of stop below 9 between Ω = 1.2 and 1.35'
    """

    #: Name of a contact, for its force; of a shaft or gear of a drive train, for its whole torque, including that of
    #: its permanent spring and damper; or of any signal, as in `Orbit.signal`.
    signal: str
    limit: Positive  #: The limit of its magnitude, in the unit of the signal (N m for a torque) or non-dimensional.
    within: tuple[float, float]  #: The band.

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        unit = f" {unit}" if (unit := _unit(system, peak_signal(system, self.signal))) else ""
        return f"peak of {self.signal} below {self.limit:g}{unit} {between_words(self.within, parameter, system.units)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if there is no such signal, the limit is not positive, or the band leaves the range."""
        super().check(system, ends)
        name = peak_signal(system, self.signal)
        rigid = [each for each in system.structure.contacts if each.law.rebounds]
        if rigid and (name.endswith("''") or name in map(force_of, rigid)):
            raise ModelError(
                f"a goal limits the peak of {self.signal}, which is infinite where the rigid stop {rigid[0].name} is "
                f'struck; write a goal without impacts, {{ quiet = "{rigid[0].name}" }}'
            )
        check_fields(self, f" of {self.signal}")

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins at the highest maxima of the signal over the band, and at its lowest minima."""
        return [
            Need(
                value - margin,
                response.slopes(place, partial(self._left, sign=sign)),
                f"peak of {self.signal} {sign * self.limit * (1.0 - value):.6g} at {place.point.value:.6g}",
            )
            for sign in (1, -1)
            for place, value in response.lowest(partial(self._left, sign=sign), *self.within, most=LOWEST)
            if value < _FAR
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance of the peak from the limit, as a share of the limit; negative above it."""
        return min(response.lowest(partial(self._left, sign=sign), *self.within)[0][1] for sign in (1, -1))

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence if the peak is above the limit on an isolated branch inside the band."""
        points = band_points(branch, *self.within)
        peaks = [(-self._left(point, sign=sign), point.value) for point in points for sign in (1, -1)]
        share, value = max(peaks, default=(-1.0, 0.0))
        if share <= 0.0:
            return []
        return [f"the peak of {self.signal} on an isolated branch is {(1.0 + share) * self.limit:.6g} at {value:.6g}"]

    def _left(self, point: BranchPoint, *, sign: int) -> float:
        key = f"peaks of {self.signal}"
        if key not in point.memo:
            point.memo[key] = peaks(point.orbit, self.signal)
        return 1.0 - point.memo[key][sign < 0] / self.limit


def peak_signal(system: System, name: str) -> str:
    """Return the signal of a contact, of a shaft or gear, or of any other name, as `Motion.signal` knows it."""
    known = signal_names(system)
    if f"{name}.torque" in known:
        return f"{name}.torque"
    contacts = {form.name: form for form in system.structure.contacts}
    if name not in known and name in contacts:
        return force_of(contacts[name])
    return known[signal_place(system, name)]


def peaks(orbit: Orbit, signal: str) -> tuple[float, float]:
    """Return the largest value of a signal in an orbit, and the largest of its negative, in the unit of the signal."""
    along = quadrature(orbit.system, orbit.state, orbit.period, orbit.known_states)
    values = along.motion.signal(peak_signal(orbit.system, signal))
    return along.largest(values), along.largest(-values)


def _unit(system: System, signal: str) -> str:
    return system.units.signal(signal)[1] if system.units else ""


# The goal that a gap does not rattle over a band: it stays closed on one side, or open.

_CLOSED = {1: "closed on the positive side", -1: "closed on the negative side"}


@dataclass(frozen=True)
class Quiet(Goal):
    """A gap does not rattle over a band of the parameter: it stays closed on one side, or it stays open.

    Examples
    --------
    >>> gw.ask.Quiet("stop", (0.6, 0.8)).words(system, "frequency")
    'stop quiet between Ω = 0.6 and 0.8'
    """

    gap: str  #: Name of the contact.
    within: tuple[float, float]  #: The band.

    def ways(self, system: System) -> tuple[str, ...]:
        """Return the ways in which the gap can be quiet: open, or closed on one side unless it is a rigid stop."""
        if (side := kept_side(system, self.gap)) is not None:
            return (_CLOSED.get(side, "open"),)
        law = system.structure.contacts[contact_place(system, self.gap)].law
        sides = () if law.rebounds else sorted(innermost(system, self.gap).values(), reverse=True)
        return (*(_CLOSED[side] for side in sides), "open")

    def posed(self, system: System, way: str) -> System:
        """Return a system in which the gap stays closed or open, so that its motions show how far rattle is away."""
        return system if kept_side(system, self.gap) is not None else kept(system, self.gap, _side(way))

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        return f"{self.gap} quiet {between_words(self.within, parameter, system.units)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if there is no such gap, or the band leaves the range of the response."""
        super().check(system, ends)
        chosen_gaps(system, self.gap)

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins at the points of the band at which the gap is nearest to changing its state."""

        def measure(point: BranchPoint) -> float:
            return quiet_depth(point.orbit, self.gap, _side(way))

        return [
            Need(value - margin, response.slopes(place, measure), f"{self.gap} {way} at {place.point.value:.6g}")
            for place, value in response.lowest(measure, *self.within, most=LOWEST)
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the depth by which the gap stays closed or open over the band, relative to its clearance."""
        sides = [0, *innermost(response.system, self.gap).values()]
        return max(
            response.lowest(lambda point, side=side: quiet_depth(point.orbit, self.gap, side), *self.within)[0][1]
            for side in sides
        )

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence if the gap rattles on an isolated branch inside the band."""
        points = [point for point in band_points(branch, *self.within) if gap_state(point.orbit, self.gap).rattles]
        if not points:
            return []
        values = [point.value for point in points]
        return [f"{self.gap} rattles on an isolated branch between {min(values):.6g} and {max(values):.6g}"]


def _side(way: str) -> int:
    """Return the side on which a way keeps a gap closed; 0 for open."""
    return next((side for side, words in _CLOSED.items() if words == way), 0)


def quiet_depth(orbit: Orbit, gap: str, side: int) -> float:
    """Return the depth by which a gap stays closed or open in an orbit, relative to its clearance; negative if not."""
    depths, breakpoints = [], orbit.system.breakpoints
    for switch, own in innermost(orbit.system, gap).items():
        contact, _, clearance = breakpoints[switch]
        turns = [own * value for value in orbit.turns[contact].values]
        size = abs(clearance) or 1.0
        if not side:
            depths.append((clearance - max(turns)) / size)
        elif own == side:
            depths.append((min(turns) - clearance) / size)
    return min(depths)


# The goal that a resonance lies below or above a value of the frequency or speed.

_STATES = ("rest", "closed", "open")
_STEP = 1e-5  # relative change of a parameter for the derivative of a natural frequency


@dataclass(frozen=True)
class Resonance(Goal):
    """A resonance lies below or above a value of the frequency or speed.

    Examples
    --------
    >>> gw.ask.Resonance(1, above=1.1, at="open").value(system)
    1.0
    """

    number: int  #: Number of the natural frequency: 1 for the first that is not zero.
    #: below, above: The limits, in the unit of the frequency or speed; give one or both.
    below: float | None = None
    above: float | None = None
    #: Order of the excitation that excites the resonance: per turn where the first parameter is the speed of a shaft,
    #: otherwise a multiple of the frequency.
    order: Positive = 1.0
    #: State about which the system is linearised: ``"rest"`` is the static equilibrium under the mean load;
    #: ``"closed"`` has the first stage of every contact closed, and ``"open"`` none, as in `gapwalk.find_modes`.
    at: str = "rest"

    def __post_init__(self) -> None:
        if self.below is None and self.above is None:
            raise ModelError("a goal names a resonance, but no limit; write below = ... or above = ...")
        check_fields(self, " of a resonance")
        if self.at not in _STATES:
            raise ModelError(f"at of a resonance is {self.at!r}; {did_you_mean(str(self.at), _STATES)}")

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        unit = f" {system.units.parameter(system.structure.pace)}" if system.units else ""
        limits = (("above", self.above), ("below", self.below))
        parts = [f"{word} {value:g}{unit}" for word, value in limits if value is not None]
        about = "" if self.at == "rest" else f", {self.at},"
        return f"resonance {self.number}{about} with order {self.order:g} {' and '.join(parts)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if the system has no natural frequency of this number."""
        self.value(system)

    def value(self, system: System) -> float:
        """Return the frequency or speed at which the order of the excitation is at the natural frequency."""
        modes = find_modes(system, self._state(system))
        rates = modes.frequencies[modes.numbers > 0]
        if not 1 <= self.number <= len(rates):
            raise ModelError(f"a goal names resonance {self.number}, but the system has {len(rates)} only")
        order = self.order / float(system.turns or 1)
        return float(rates[self.number - 1]) / (order * system.structure.frequency)

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margin from each limit, with its derivatives."""
        system, slopes = response.system, np.empty(len(response.names))
        value = self.value(system)
        for k, (name, scale) in enumerate(zip(response.names, response.scales, strict=True)):
            pair = [self.value(system.at({name: system[name] + sign * _STEP * scale})) for sign in (-1.0, 1.0)]
            slopes[k] = (pair[1] - pair[0]) / (2.0 * _STEP)
        words = f"resonance {self.number} at {value:.6g}"
        return [
            Need(side * (value - limit) / abs(limit) - margin, side * slopes / abs(limit), words)
            for side, limit in ((-1.0, self.below), (1.0, self.above))
            if limit is not None
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance of the resonance from the nearest limit, as a share of that limit."""
        value = self.value(response.system)
        pairs = ((-1.0, self.below), (1.0, self.above))
        return min(side * (value - limit) / abs(limit) for side, limit in pairs if limit is not None)

    def _state(self, system: System) -> Equilibrium | str:
        if self.at != "rest":
            return self.at
        found = find_equilibria(system).equilibria
        if not found or not found[0].stable:
            raise ModelError(
                f"a goal names resonance {self.number} about the static equilibrium, but there is no stable one; write "
                'at = "closed", with the first stage of every contact, or at = "open"'
            )
        return found[0]


AnyGoal = NoPoint | Quiet | PeakBelow | Resonance
"""A goal of any kind."""

__all__ = ["EXACT", "MARGIN", "AnyGoal", "Goal", "Need", "NoPoint", "PeakBelow", "Quiet", "Resonance"]
