"""Continuation of equilibria along a parameter, over the corners where a contact closes or opens at rest.

Within one combination of closed contacts the equilibria form a smooth curve, which a walk follows. Where a contact
closes or opens, the curve has a corner: it is located, and a new walk begins there, with the tangent on the other side.

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector, Range, Zero, check_range, powers_of_two
from gapwalk.continuation.curve import Curve, CurveEvent, CurveTrace, Happens, crossing, joined, reason_first, turn
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, Tracing, Walk, WalkOptions
from gapwalk.errors import ConvergenceError, FlowError, ModelError, NumericalError
from gapwalk.flow.equations import smallness
from gapwalk.flow.forces import accelerations
from gapwalk.flow.motion import switch_names
from gapwalk.free.free_shooting import companion, length_at_rest, tangents, without_excitation
from gapwalk.model.coefficients import ParameterLine, layout_of
from gapwalk.model.equilibria import balance_of, find_equilibria
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import Equation, Evaluation
from gapwalk.summary import row_of
from gapwalk.verification.verification import Check, Ledger, Spot

# Records of equilibria along a parameter: the points, what happens along them, and why they end.

_REAL_ROUNDING = 1e-9  # real part of an eigenvalue that is rounding, as a share of the largest eigenvalue


@dataclass(frozen=True, eq=False)
class RestPoint:
    """One equilibrium."""

    stuck = ()  # contacts whose friction never slips
    _row: ClassVar = "parameter=value stable unstable growth frequency contacts=pattern"

    value: float  #: Value of the parameter.
    position: NDArray[np.float64]  #: shape (n,): The coordinates.
    #: shape (2n,): Eigenvalues of small motions about it, largest real part first, per unit of time.
    eigenvalues: NDArray[np.complex128]
    pattern: str  #: Which contacts are closed, in words.

    @property
    def unstable(self) -> int:
        """Number of eigenvalues with a positive real part."""
        return int(np.sum(self.eigenvalues.real > _REAL_ROUNDING * np.abs(self.eigenvalues).max()))

    @property
    def stable(self) -> bool:
        """True if no small motion grows."""
        return self.unstable == 0

    @property
    def growth(self) -> float:
        """The largest real part of the eigenvalues, per unit of time."""
        return float(self.eigenvalues[0].real)

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion that grows fastest, or decays most slowly."""
        return abs(float(self.eigenvalues[0].imag))

    @property
    def pair(self) -> complex:
        """The complex eigenvalue nearest to the imaginary axis, above the real axis; nan if all are real."""
        above = self.eigenvalues[self.eigenvalues.imag > _REAL_ROUNDING * np.abs(self.eigenvalues).max()]
        return complex(above[np.argmin(np.abs(above.real))]) if len(above) else complex(math.nan, math.nan)

    def __repr__(self) -> str:
        state = "stable" if self.stable else f"unstable ({self.unstable})"
        return f"RestPoint({self.value:.10g}, {state}{', ' * bool(self.pattern)}{self.pattern})"


@dataclass(frozen=True, eq=False, repr=False)
class RestEvent(CurveEvent):
    """Equilibrium at which something changes."""

    _row: ClassVar = (
        "kind parameter=point.value uncertainty unstable.before=before unstable.after=after frequency contact "
        "closes turns"
    )

    kind: str  #: What changes.
    point: RestPoint  #: The equilibrium.
    uncertainty: float  #: Estimated error of its value of the parameter.
    #: before, after: Numbers of unstable eigenvalues before and after it, in the direction of the walk.
    before: int
    after: int
    frequency: float = 0.0  #: At a Hopf point, the angular frequency of the motions that begin there; otherwise 0.
    contact: str = ""  #: Where a contact changes, its name with the stage and side; otherwise empty.
    closes: bool = False  #: True where that contact closes, in the direction of the walk.
    turns: bool = False  #: True where the parameter turns back.

    @property
    def value(self) -> float:
        """Value of the parameter."""
        return self.point.value

    @property
    def words(self) -> str:
        """The event in words."""
        if self.kind == HOPF.name:
            return f"{self.kind}, frequency {self.frequency:.8g}"
        if self.kind == BORDER:
            what = "closes" if self.closes else "opens"
            return f"{self.contact} {what}{', and the equilibria turn back' * self.turns}"
        return self.kind


@dataclass(frozen=True, eq=False)
class Rests(Curve):
    """Equilibria along one parameter."""

    _end_words = staticmethod(reason_first)
    _words: ClassVar = {
        "what": "{0.words}",
        ">{0.parameter}": "{0.value:.10g}",
        ">±": "{0.uncertainty:.0e}",
        ">unstable": "{0.before} to {0.after}",
    }

    system: System  #: The system without excitation.
    parameter: str  #: Name of the parameter.
    points: tuple[RestPoint, ...]  #: The equilibria in the order of the walk.
    #: Hopf points, folds, crossings, and contacts that close or open, in the order of the walk.
    events: tuple[RestEvent, ...]
    ends: tuple[End, End]  #: Both ends.

    @property
    def hopf_points(self) -> tuple[RestEvent, ...]:
        """The Hopf points, at which periodic motions begin."""
        return tuple(event for event in self.events if event.kind == HOPF.name)

    def coordinate(self, name: str) -> NDArray[np.float64]:
        """Return a coordinate at each point."""
        place = self.system.coordinates.index(name)
        return np.array([point.position[place] for point in self.points])

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the row of each equilibrium in a table, with its coordinates."""
        for point in self.points:
            yield row_of(point) | dict(zip(self.system.coordinates, point.position.tolist(), strict=True))

    @property
    def _range_words(self) -> str:
        first, last = self.points[0].value, self.points[-1].value
        stable = sum(point.stable for point in self.points)
        return (
            f"equilibria over {self.parameter} from {first:.8g} to {last:.8g}: {len(self.points)} points, "
            f"{stable} of them stable"
        )

    def __repr__(self) -> str:
        return f"Rests({self.parameter}, {len(self.points)} equilibria, {len(self.events)} events)"


# Equilibria along a parameter as n equations for n positions, with the eigenvalues of small motions about them.
#
# The accelerations at rest vanish: ``q''(q, 0; a) = 0``. Their derivatives by positions, rates and the parameter are
# taken by a complex step of the same formulas, exact to rounding, for any law. At a breakpoint of a contact the
# derivatives are one-sided.
#
# Method: docs/numerics/notes/tori.md

_STEP = 1e-150  # complex step
_LEAST = 1e-300  # square of a frequency


@dataclass(frozen=True, eq=False)
class RestEquation:
    """Equations of the equilibria of a system without excitation, along a parameter.

    The residual is the acceleration at rest over the square of a frequency of the system, a length.
    """

    system: System  #: The system.
    parameter: str  #: Name of the parameter.
    start: NDArray[np.float64]  #: shape (n,): Positions at which that frequency is taken.
    tolerance: float = 1e-12  #: Largest residual, relative to the positions.

    @cached_property
    def line(self) -> ParameterLine:
        """Systems along the parameter."""
        return ParameterLine(self.system, self.parameter)

    @cached_property
    def _square(self) -> float:
        stiffness = self.matrices(self.start, self.system[self.parameter])[0]
        return max(float(np.abs(stiffness).max()), _LEAST)

    @property
    def frequency(self) -> float:
        """A typical frequency of the system, by which residuals and rates are scaled."""
        return float(np.sqrt(self._square))

    def evaluate(self, unknowns: NDArray[np.float64], value: float) -> Evaluation:
        """Return residual and derivatives at positions and a value of the parameter."""
        layout = layout_of(self.system.structure)
        coefficients, slope = self.line.coefficients(value)
        rest = np.zeros(len(unknowns))
        moved = accelerations(layout, coefficients + 1j * _STEP * slope, 0.0, unknowns + 0j, rest)
        stiffness, damping = self.matrices(unknowns, value)
        by_parameter = -np.imag(moved) / _STEP / self._square
        found = Evaluation(-np.real(moved) / self._square, stiffness / self._square, by_parameter, (stiffness, damping))
        if not all(np.isfinite(each).all() for each in (found.residual, found.by_unknowns, by_parameter)):
            raise FlowError("a force has no finite value or slope at rest")
        return found

    def matrices(self, positions: NDArray[np.float64], value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stiffness and damping for small motions about positions, per unit of mass, each shape (n, n)."""
        coefficients, _ = self.line.coefficients(value)
        return tangents(layout_of(self.system.structure), coefficients, positions, np.zeros(len(positions)))

    def orbit(self, unknowns: NDArray[np.float64], value: float, evaluation: Evaluation) -> RestPoint:
        """Return the equilibrium of a solution, with its eigenvalues."""
        system, depths = self.line.system_at(value), self.depths(unknowns, value)
        closed = tuple(bool(depth > 0.0) for depth in depths)
        return RestPoint(value, unknowns.copy(), eigenvalues(*evaluation.evidence), _pattern(system, closed))

    def depths(self, positions: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        """Return the depth beyond each breakpoint, shape (switches,)."""
        system = self.line.system_at(value)
        vectors = [system.vector(form.vectors[0]) for form in system.structure.contacts]
        return np.array(
            [side * float(vectors[contact] @ positions) - clearance for contact, side, clearance in system.breakpoints]
        )

    def scales(self, length: float) -> NDArray[np.float64]:
        """Return the scales of the positions."""
        return np.full(self.system.size, max(length, smallness(self.system)) * np.sqrt(self.system.size))


def eigenvalues(stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of small motions, largest real part first, shape (2n,)."""
    found = np.linalg.eigvals(companion(stiffness, damping)).astype(complex)
    return found[np.lexsort((-np.imag(found), -np.real(found)))]


def _pattern(system: System, closed: tuple[bool, ...]) -> str:
    """Return which contacts are closed, in words."""
    texts, breakpoints = [], system.breakpoints
    forms = [(place, form) for place, form in enumerate(system.structure.contacts) if form.stages]
    for place, form in forms:
        sides = [
            side for (contact, side, _), shut in zip(breakpoints, closed, strict=True) if contact == place and shut
        ]
        text = {1: "closed+", -1: "closed-", 0: "open"}[sides[0] if sides else 0]
        texts.append(text if len(forms) == 1 else f"{form.name} {text}")
    return ", ".join(texts)


_LENGTHS = 10.0  # change of the positions, in lengths of the system, that weighs as much as all of the range
_ROUNDING = 2e-14  # of a value of the parameter
_NEAR = 1e-5  # depth, in lengths, at which a walk that cannot go on stands at a corner
_BESIDE = 1e-7  # distance from a corner, in lengths, at which the derivatives of one side are taken
_SLIGHT = 2.0**-10  # scaled step of a difference
_ON = 1e-12  # depth at a corner, in lengths
_SETTLED = 25  # steps of Newton's method to a corner
_CERTAIN = 1e-7  # arclength of a step that is not repeated, whatever it leaves unexplained
_LEVEL = 1e-11  # component of the tangent along the parameter that is rounding
_CORNERS = 1000  # corners after which a walk ends, as `EndReason.CONTACTS` says


@shows_progress(lambda count, point: f"{count} equilibria, at {point.value:.6g}")
def follow_rest(
    system: System,
    parameter: str,
    to: float | tuple[float, float],
    *,
    start: Sequence[float] | NDArray[np.float64] | None = None,
    walk: WalkOptions | None = None,
    report: Callable[[RestPoint], None] | None = None,
) -> Rests:
    """Follow an equilibrium along a parameter, with its stability, Hopf points, folds and changes of contacts.

    Parameters
    ----------
    system
        The system; its excitation is left out, its damping and mean loads remain.
    parameter
        Name of the parameter, such as ``"belt.speed"``.
    to
        The value at which to stop; or two values, between which equilibria are followed in both directions.
    start
        Positions near the equilibrium, shape (n,); by default the first one of `find_equilibria`.
    walk
        Options of the steps.
    report
        Called with each equilibrium.

    Returns
    -------
    Rests
        The equilibria, with events and both ends.

    Raises
    ------
    ModelError
        For friction on a base at rest, rigid stops, or the frequency as parameter.
    ConvergenceError
        If there is no equilibrium at the start.
    Interrupted
        After Ctrl-C; its `found` are the equilibria so far.

    Examples
    --------
    >>> import gapwalk as gw
    >>> damper = gw.force("damper", {"x": 1.0}, "mu*(x*x - 1)*v", mu=-0.5)
    >>> found = gw.free.follow_rest(gw.System(["x"], [1.0], contacts=[damper]), "damper.mu", 0.5)
    >>> found.hopf_points[0].frequency
    1.0
    """
    check_system(system, "follow_rest")
    free = without_excitation(system)
    check_rest(free, parameter)
    value = free[parameter]
    within = check_range(value, to).along(parameter, free)
    for bound in (within.low, within.high):
        check_rest(free.at({parameter: bound}), parameter)
    positions = _positions(free, start)
    equation = RestEquation(free, parameter, positions)
    length = max(length_at_rest(free, positions), float(np.abs(positions).max()))
    scales = powers_of_two(np.append(equation.scales(_LENGTHS * length), within.width))
    corrector = Corrector(cast(Equation, cast(object, equation)), scales)
    ways = (1 if to > value else -1,) if isinstance(to, int | float) else (-1, 1)
    ways = tuple(way for way in ways if value != (within.high if way > 0 else within.low))

    def trace(way: int, _: object) -> _RestTrace:
        first = _first(corrector, positions, value, way)
        return _RestTrace(first, within, corrector, walk or WalkOptions(), length)

    def record(tracing: Tracing[int, Any, Any]) -> Rests:
        begin = End(EndReason.START, tracing.traces[-1].first.value)
        return Rests(free, parameter, *joined(tracing, begin, lambda point: point, _turned))

    told = None if report is None else lambda point, _: report(point)
    return Tracing(ways, trace).to_end(record, told)


def check_rest(system: System, parameter: str) -> None:
    """Raise a ModelError if equilibria of a system cannot be followed along a parameter."""
    structure = system.structure
    if parameter == structure.pace:
        raise ModelError(
            f"{parameter} belongs to the excitation, which equilibria do not have; write another parameter, such as "
            '"belt.speed"'
        )
    structure.place(parameter)
    plain, equations = system.equations, system.equations.structure
    for form in equations.contacts:
        if form.law.rebounds:
            raise ModelError(
                f"{form.name} is a rigid stop, against which an equilibrium has a reaction of any size; replace it by "
                "a stiff one"
            )
        if form.law.is_dry and (equations.memories or not plain[f"{form.name}.speed"]):
            raise ModelError(
                f"{form.name} is dry friction on a base at rest, or in series with a spring: its equilibria are a "
                f"continuum. Give the base a speed ({form.name}.speed), at which it slips at rest, or write the "
                "friction as a formula of the rate"
            )


def equilibria_of(system: System) -> list[NDArray[np.float64]]:
    """Return the positions of all equilibria that are found; raise a ConvergenceError if there are none."""
    found = [each.position for each in find_equilibria(system).equilibria]
    if not found:
        raise ConvergenceError("no equilibrium of the system was found; give positions near one, start = [...]")
    return found


def _positions(system: System, start: Sequence[float] | NDArray[np.float64] | None) -> NDArray[np.float64]:
    if start is None:
        return equilibria_of(system)[0]
    positions = np.asarray(start, dtype=float)
    if positions.shape != (system.size,):
        raise ModelError(f"start has the shape {positions.shape}; write {system.size} positions")
    return positions


def _first(corrector: Corrector, positions: NDArray[np.float64], value: float, way: int) -> BranchPoint:
    ahead = np.append(np.zeros(len(positions)), float(way))
    first = corrector.point_at(np.append(positions, value) / corrector.scales, value, ahead)
    if first is None:
        raise ConvergenceError(f"there is no equilibrium near {positions.tolist()}; give positions nearer to one")
    return first


def _turned(event: RestEvent) -> RestEvent:
    closes = bool(event.contact) and not event.closes
    return replace(event, before=event.after, after=event.before, closes=closes)


def _rest(point: BranchPoint) -> RestPoint:
    return cast(RestPoint, cast(object, point.orbit))


def _hopf(point: BranchPoint) -> float:
    """Return the product of the sums of all pairs of eigenvalues, each over their size: zero at a Hopf point."""
    known = point.memo.get("hopf")
    if known is None:
        values = _rest(point).eigenvalues
        size = float(np.abs(values).max()) or 1.0
        rows, columns = np.triu_indices(len(values), 1)
        known = point.memo["hopf"] = float(np.prod((values[rows] + values[columns]) / size).real)
    return known


CROSSING = crossing("other equilibria cross")
FOLD = turn("fold", _LEVEL, hides=CROSSING.name)
# two real eigenvalues may have the sum 0: nothing begins there
HOPF = Happens("Hopf point", _hopf, is_genuine=lambda each: abs(_rest(each).pair.real) <= 1e-6 * _rest(each).pair.imag)
BORDER = "a contact changes"
EVENTS = (HOPF.name, FOLD.name, CROSSING.name, BORDER)
"""All kinds of events, in the order of legends."""


class _Corner(NamedTuple):
    """A corner: its place in scaled variables, the number of the switch, and whether it closes."""

    x: NDArray[np.float64]
    switch: int
    closes: bool


class _RestTrace(CurveTrace):
    """Trace of equilibria in one direction, over corners."""

    kinds = (FOLD, CROSSING, HOPF)

    def __init__(
        self, first: BranchPoint, within: Range, corrector: Corrector, options: WalkOptions, length: float
    ) -> None:
        self._begin = partial(Walk, within=within, corrector=corrector, options=options, trust=0.0, branched=True)
        super().__init__(self._begin(first))
        self.within, self.length, self._corners = within, length, 0
        self.equation = cast(RestEquation, cast(object, corrector.equation))
        self._gapless = self.equation.system.gapless

    def __next__(self) -> tuple[RestPoint, list[RestEvent]]:
        while self.end is None:
            state = self.walk.state
            point = next(self.walk, None)
            corner = self._corner(point)
            if corner is not None:
                step = self._pass(corner)
                if step is not None:
                    return step
            elif point is None:
                self.end = self.end_of_walk()
            elif self._is_unclear(point):
                self.walk.go_back(state, point)
            else:
                return self.taken(point)
        raise StopIteration

    def _is_unclear(self, point: BranchPoint) -> bool:
        """Return True if more eigenvalues crossed the axis in a step than one event explains."""
        if point.arclength - self.last.arclength <= _CERTAIN:
            return False
        changed = abs(_rest(point).unstable - _rest(self.last).unstable)
        crossed = _hopf(self.last) * _hopf(point) < 0.0
        return changed > 2 or (changed == 2 and not crossed)

    def event(self, kind: Happens, zero: Zero, after: BranchPoint) -> RestEvent:
        """Return a fold, a crossing or a Hopf point."""
        point, rest = zero.point, _rest(zero.point)
        left = abs(kind.function(point) / (kind.function(after) - kind.function(self.last)))
        error = left * abs(after.value - self.last.value) + _ROUNDING * max(abs(point.value), self.within.width)
        counts = _rest(self.last).unstable, _rest(after).unstable
        frequency = rest.pair.imag if kind is HOPF else 0.0
        return RestEvent(kind.name, rest, error, *counts, frequency, turns=kind is FOLD)

    # -- corners ------------------------------------------------------------------------------------------------------

    def _depths(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        physical = x * self.corrector.scales
        return self.equation.depths(physical[:-1], float(physical[-1]))

    def _corner(self, point: BranchPoint | None) -> _Corner | None:
        """Return the first corner between the last point and the next one, or where a walk that cannot go on stands."""
        last = self._depths(self.last.x)
        if point is None:
            end = self.walk.end
            if end is None or end.reason is not EndReason.STEP or not len(last):
                return None
            near = np.where(self._gapless, np.inf, np.abs(last))
            switch = int(np.argmin(near))
            begins = self._corners and self.walk.count == 0
            if begins or not near[switch] <= _NEAR * self.length:
                return None
            return self._settled(self.last.x, switch, bool(last[switch] <= 0.0))
        beyond = self._depths(point.x)
        on = _ON * self.length
        crossed = [
            switch
            for switch, (a, b) in enumerate(zip(last, beyond, strict=True))
            if a * b < 0.0 and min(abs(a), abs(b)) > on and not self._gapless[switch]
        ]
        if not crossed:
            return None
        shares = {switch: last[switch] / (last[switch] - beyond[switch]) for switch in crossed}
        switch = min(shares, key=lambda each: shares[each])
        guess = self.last.x + shares[switch] * (point.x - self.last.x)
        return self._settled(guess, switch, bool(last[switch] < 0.0))

    def _settled(self, guess: NDArray[np.float64], switch: int, closes: bool) -> _Corner | None:
        """Return the corner near a guess: an equilibrium at which a depth is zero. The force is continuous there."""
        x = guess
        for _ in range(_SETTLED):
            evaluation = self.corrector.evaluate(x)
            assert evaluation.by_parameter is not None
            rows = np.column_stack((evaluation.by_unknowns, evaluation.by_parameter)) * self.corrector.scales
            matrix = np.vstack((rows, self._depth_slope(x, switch)))
            right = np.append(evaluation.residual, self._depths(x)[switch])
            try:
                step = np.linalg.solve(matrix, -right)
            except np.linalg.LinAlgError:
                return None
            x = x + step
            if np.abs(step).max() < _ROUNDING:
                break
        return _Corner(x, switch, closes) if np.abs(x - guess).max() < 1.0 else None

    def _depth_slope(self, x: NDArray[np.float64], switch: int) -> NDArray[np.float64]:
        """Return the derivatives of a depth by all scaled variables, in most of which it is linear."""
        base, steps = self._depths(x)[switch], _SLIGHT * np.eye(len(x))
        return np.array([self._depths(x + step)[switch] - base for step in steps]) / _SLIGHT

    def _pass(self, corner: _Corner) -> tuple[RestPoint, list[RestEvent]] | None:
        """Begin a new walk beyond a corner, and return the step to it; end, with None, if there is no way on."""
        place = float(corner.x[-1] * self.corrector.scales[-1])
        slope = self._depth_slope(corner.x, corner.switch)
        way = 1.0 if corner.closes else -1.0
        off = slope[:-1] / (slope[:-1] @ slope[:-1]) * _BESIDE * self.length
        sides = [np.append(corner.x[:-1] + sign * way * off, corner.x[-1]) for sign in (-1.0, 1.0)]
        before, after = (self._one_sided(corner.x, side) for side in sides)
        if before is None or after is None:
            self.end = End(EndReason.NO_SLOPE, place)
            return None
        ahead = float(slope @ after.tangent) * way
        if abs(ahead) < _LEVEL * float(np.abs(slope).max()):
            self.end = End(EndReason.NOT_ISOLATED, place)
            return None
        if ahead < 0.0:
            after = replace(after, tangent=-after.tangent, determinant=-after.determinant)
        back = float(slope @ before.tangent) * way
        if back < 0.0:
            before = replace(before, tangent=-before.tangent, determinant=-before.determinant)
        events = list(self.happened(before)) if before.arclength - self.last.arclength > _ROUNDING else []
        turns = float(before.tangent[-1]) * float(after.tangent[-1]) < 0.0
        name, stage, side = switch_names(self.equation.system)[corner.switch]
        contact = f"{name}{' ' * bool(stage)}{stage}{'+' if side > 0 else '-'}"
        counts = _rest(before).unstable, _rest(after).unstable
        error = 10.0 * _ROUNDING * max(abs(after.value), self.within.width)
        events.append(RestEvent(BORDER, _rest(after), error, *counts, 0.0, contact, corner.closes, turns))
        self._corners += 1
        if self._corners > _CORNERS:
            self.end = End(EndReason.CONTACTS, place)
        elif not self.within.low <= after.value <= self.within.high:
            self.end = End(EndReason.RANGE, place)
        else:
            self.last, self.walk = after, self._begin(after)
        return _rest(after), events

    def _one_sided(self, x: NDArray[np.float64], side: NDArray[np.float64]) -> BranchPoint | None:
        """Return the point at a corner with the derivatives and eigenvalues of one side."""
        try:
            evaluation = self.corrector.evaluate(side)
        except NumericalError:
            return None
        course = self.corrector.tangent(evaluation, self.last.tangent)
        length = self.last.arclength + float(np.linalg.norm(x - self.last.x))
        physical = side * self.corrector.scales
        there = self.equation.orbit(physical[:-1], float(physical[-1]), evaluation)
        value = float(x[-1] * self.corrector.scales[-1])
        point = replace(there, value=value, position=x[:-1] * self.corrector.scales[:-1])
        return BranchPoint(value, cast("object", point), x, *course, length)  # type: ignore[arg-type]


# Verification of equilibria: the balance of static forces and the eigenvalues, by other formulas than the walk's.
#
# A walk follows the accelerations of the flow. Here the forces are those of the static search, with the mass matrix,
# and an eigenvalue must make the matrix of small motions singular.

_BREAKPOINT = 1e-9  # share of a clearance within which a deflection is at a breakpoint, where derivatives are one-sided


def verify_rests(ledger: Ledger, name: str, rests: Rests) -> None:
    """Enter the checks of all equilibria of a branch."""
    if any(form.law.is_dry for form in rests.system.equations.structure.contacts):
        ledger.note("equilibria with dry friction on a moving base are not verified: a static search leaves it out")
        return
    for number, point in enumerate(rests.points):
        system = rests.system.at({rests.parameter: point.value}).equations
        if not _is_at_breakpoint(system, point):
            ledger.enter(Check.REST, Spot(name, f"point {number}", point.value), _fault(system, point))
        ledger.points += 1


def _fault(system: System, point: RestPoint) -> float:
    """Return the larger of the relative imbalance of forces and the relative singular value of an eigenvalue."""
    balance, x = balance_of(system), point.position
    force, sizes, stiffness = balance.unbalanced(x)
    damping = system.matrix("damping").copy()
    for each in balance.forces:
        damping += np.outer(each.direction, each.at(x).damping @ each.deflections)
    worst = float(np.abs(force).max() / max(float(sizes.max()), 1e-300)) if np.abs(x).max() > 0.0 else 0.0
    mass = system.matrix("mass")
    for value in (point.eigenvalues[0], point.eigenvalues[-1]):
        matrix = mass * value**2 + damping * value + stiffness
        size = np.abs(mass * value**2).max() + np.abs(damping * value).max() + np.abs(stiffness).max()
        worst = max(worst, float(np.linalg.svd(matrix, compute_uv=False)[-1] / size))
    return worst


def _is_at_breakpoint(system: System, point: RestPoint) -> bool:
    vectors = [system.vector(form.vectors[0]) for form in system.structure.contacts]
    depths = [side * float(vectors[k] @ point.position) - clearance for k, side, clearance in system.breakpoints]
    unit = float(np.abs(point.position).max())
    return any(abs(depth) <= _BREAKPOINT * unit for depth in depths)
