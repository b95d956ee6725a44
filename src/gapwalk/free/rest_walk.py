"""Continuation of equilibria along a parameter, over the corners where a contact closes or opens at rest.

Within one combination of closed contacts the equilibria form a smooth curve, which a walk follows. Where a contact
closes or opens, the curve has a corner: it is located, and a new walk begins there, with the tangent on the other side.

Method: docs/numerics/self-excited.md
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason, Walk
from gapwalk.continuation.walk_scales import Range, check_range, powers_of_two
from gapwalk.continuation.zero_in_step import zero_in_step
from gapwalk.errors import ConvergenceError, Interrupted, ModelError, NumericalError
from gapwalk.flow.motion import switch_names
from gapwalk.free.rest_equation import RestEquation
from gapwalk.free.rest_record import RestEnd, RestEvent, RestEventKind, RestPoint, Rests
from gapwalk.free.small_motions import length_at_rest
from gapwalk.free.undriven import without_excitation
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import Equation

_LENGTHS = 10.0  # change of the positions, in lengths of the system, that weighs as much as all of the range
_ROUNDING = 2e-14  # of a value of the parameter
_NEAR = 1e-5  # depth, in lengths, at which a walk that cannot go on stands at a corner
_BESIDE = 1e-7  # distance from a corner, in lengths, at which the derivatives of one side are taken
_SLIGHT = 2.0**-10  # scaled step of a difference
_ON = 1e-12  # depth at a corner, in lengths
_SETTLED = 25  # steps of Newton's method to a corner
_CERTAIN = 1e-7  # arclength of a step that is not repeated, whatever it leaves unexplained
_LEVEL = 1e-11  # component of the tangent along the parameter that is rounding
_CORNERS = 1000  # corners after which a walk ends


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
    options, walks = walk or WalkOptions(), list[_RestWalk]()
    try:
        for way in ways:
            first = _first(corrector, positions, value, way)
            walks.append(_RestWalk(first, within, corrector, options, length, one_way=len(ways) == 1))
            walks[-1].to_end(report)
    except KeyboardInterrupt:
        if not walks:
            raise
        raise Interrupted(_joined(free, parameter, walks)) from None
    return _joined(free, parameter, walks)


def check_rest(system: System, parameter: str) -> None:
    """Raise a ModelError if equilibria of a system cannot be followed along a parameter."""
    structure = system.structure
    if parameter == structure.pace:
        raise ModelError(
            f"{parameter} is that of the excitation, which equilibria do not have; write another parameter, such as "
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


def _positions(system: System, start: Sequence[float] | NDArray[np.float64] | None) -> NDArray[np.float64]:
    if start is None:
        found = find_equilibria(system).equilibria
        if not found:
            raise ConvergenceError(
                "the system has no equilibrium that was found; give positions near one, start = [...]"
            )
        return found[0].position
    positions = np.asarray(start, dtype=float)
    if positions.shape != (system.size,):
        raise ModelError(f"start has the shape {positions.shape}; write {system.size} positions")
    return positions


def _first(corrector: Corrector, positions: NDArray[np.float64], value: float, way: int) -> BranchPoint:
    correction = corrector.at_value(np.append(positions, value) / corrector.scales, value)
    if correction is None:
        raise ConvergenceError(f"there is no equilibrium near {positions.tolist()}; give positions nearer to one")
    ahead = np.zeros(len(correction.x))
    ahead[-1] = way
    return corrector.point(correction, ahead, 0.0)


def _joined(system: System, parameter: str, walks: Sequence[_RestWalk]) -> Rests:
    """Return the equilibria of one walk, or of two in opposite directions."""
    *back, ahead = walks
    points, events, begins = (
        list(ahead.points),
        list(ahead.events),
        RestEnd("the walk began here", ahead.points[0].value),
    )
    for each in back:
        points = [*reversed(each.points[1:]), *points]
        turned = [
            replace(event, before=event.after, after=event.before, closes=bool(event.contact) and not event.closes)
            for event in each.events
        ]
        events, begins = [*reversed(turned), *events], each.end
    return Rests(system, parameter, tuple(points), tuple(events), (begins, ahead.end))


class _Corner(NamedTuple):
    """A corner: its place in scaled variables, the number of the switch, and whether it closes."""

    x: NDArray[np.float64]
    switch: int
    closes: bool


class _RestWalk:
    """A walk along equilibria in one direction, over corners: its points, and the events between them."""

    def __init__(
        self,
        first: BranchPoint,
        within: Range,
        corrector: Corrector,
        options: WalkOptions,
        length: float,
        one_way: bool,
    ) -> None:
        self.within, self.corrector, self.options, self.length, self.one_way = (
            within,
            corrector,
            options,
            length,
            one_way,
        )
        self.equation = cast(RestEquation, cast(object, corrector.equation))
        self.points, self.events, self._last = [_rest(first)], list[RestEvent](), first
        self._walk = self._begin(first)
        self._gapless = self.equation.system.gapless
        self.end = RestEnd("the walk was stopped before its end", first.value)

    def _begin(self, first: BranchPoint) -> Walk:
        return Walk(first, self.within, self.corrector, self.options, trust=0.0, branched=True)

    def to_end(self, report: Callable[[RestPoint], None] | None) -> None:
        """Walk to the end."""
        while True:
            state = self._walk.state
            point = next(self._walk, None)
            corner = self._corner(point)
            if corner is not None:
                words = self._pass(corner)
                if words:
                    self.end = RestEnd(words, float(corner.x[-1] * self.corrector.scales[-1]))
                    return
                continue
            if point is None:
                break
            if self._is_unclear(point):
                self._walk.go_back(state, point)
                continue
            self._take(point, report)
        end = self._walk.end
        assert end is not None
        is_failure = end.reason in (EndReason.STEP, EndReason.POINTS)
        self.end = RestEnd(end.reason_words, self._walk.point.value, is_failure)

    def _take(self, point: BranchPoint, report: Callable[[RestPoint], None] | None = None) -> None:
        self._events_before(point)
        self.points.append(_rest(point))
        self._last = point
        if report is not None:
            report(self.points[-1])

    # -- events in smooth steps ---------------------------------------------------------------------------------------

    def _is_unclear(self, point: BranchPoint) -> bool:
        """Return True if more eigenvalues crossed the axis in a step than one event explains."""
        if point.arclength - self._last.arclength <= _CERTAIN:
            return False
        changed = abs(_rest(point).unstable - _rest(self._last).unstable)
        crossed = _hopf(self._last) * _hopf(point) < 0.0
        return changed > 2 or (changed == 2 and not crossed)

    def _events_before(self, point: BranchPoint) -> None:
        last = self._last
        slopes = float(last.tangent[-1]), float(point.tangent[-1])
        if slopes[0] * slopes[1] < 0.0 and min(map(abs, slopes)) > _LEVEL:
            self._locate(point, RestEventKind.FOLD, lambda each: float(each.tangent[-1]), turns=True)
        elif last.determinant * point.determinant < 0.0:
            self._locate(point, RestEventKind.CROSSING, lambda each: each.determinant)
        if _hopf(last) * _hopf(point) < 0.0:
            self._locate(point, RestEventKind.HOPF, _hopf)

    def _locate(
        self, after: BranchPoint, kind: RestEventKind, function: Callable[[BranchPoint], float], turns: bool = False
    ) -> None:
        point = zero_in_step(self._last, after, self.corrector, function).point
        left = abs(function(point) / (function(after) - function(self._last)))
        rest, frequency = _rest(point), 0.0
        if kind is RestEventKind.HOPF:
            frequency = rest.pair.imag
            if not abs(rest.pair.real) <= 1e-6 * frequency:
                return  # two real eigenvalues have the sum 0: nothing begins there
        counts = _rest(self._last).unstable, _rest(after).unstable
        error = left * abs(after.value - self._last.value) + _ROUNDING * max(abs(point.value), self.within.width)
        self.events.append(RestEvent(kind, rest, error, *counts, frequency, turns=turns))

    # -- corners ------------------------------------------------------------------------------------------------------

    def _depths(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        physical = x * self.corrector.scales
        return self.equation.depths(physical[:-1], float(physical[-1]))

    def _corner(self, point: BranchPoint | None) -> _Corner | None:
        """Return the first corner between the last point and the next one, or where a walk that cannot go on stands."""
        last = self._depths(self._last.x)
        if point is None:
            end = self._walk.end
            if end is None or end.reason is not EndReason.STEP or not len(last):
                return None
            near = np.where(self._gapless, np.inf, np.abs(last))
            switch = int(np.argmin(near))
            begins = bool(self.events) and self.events[-1].kind is RestEventKind.BORDER and self._walk.count == 0
            if begins or not near[switch] <= _NEAR * self.length:
                return None
            return self._settled(self._last.x, switch, bool(last[switch] <= 0.0))
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
        guess = self._last.x + shares[switch] * (point.x - self._last.x)
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

    def _pass(self, corner: _Corner) -> str:
        """Begin a new walk beyond a corner; return the reason as a sentence if there is no way on."""
        slope = self._depth_slope(corner.x, corner.switch)
        way = 1.0 if corner.closes else -1.0
        off = slope[:-1] / (slope[:-1] @ slope[:-1]) * _BESIDE * self.length
        sides = [np.append(corner.x[:-1] + sign * way * off, corner.x[-1]) for sign in (-1.0, 1.0)]
        before, after = (self._one_sided(corner.x, side) for side in sides)
        if before is None or after is None:
            return "an equilibrium has no finite slope where a contact changes"
        ahead = float(slope @ after.tangent) * way
        if abs(ahead) < _LEVEL * float(np.abs(slope).max()):
            return "the equilibria run along the point at which a contact changes, so that they are not isolated"
        if ahead < 0.0:
            after = replace(after, tangent=-after.tangent, determinant=-after.determinant)
        back = float(slope @ before.tangent) * way
        if back < 0.0:
            before = replace(before, tangent=-before.tangent, determinant=-before.determinant)
        if before.arclength - self._last.arclength > _ROUNDING:
            self._events_before(before)
        turns = float(before.tangent[-1]) * float(after.tangent[-1]) < 0.0
        name, stage, side = switch_names(self.equation.system)[corner.switch]
        contact = f"{name}{' ' * bool(stage)}{stage}{'+' if side > 0 else '-'}"
        size = max(abs(after.value), self.within.width)
        counts = _rest(before).unstable, _rest(after).unstable
        rest = _rest(after)
        error = 10.0 * _ROUNDING * size
        border = RestEvent(RestEventKind.BORDER, rest, error, *counts, 0.0, contact, corner.closes, turns)
        self.events.append(border)
        self.points.append(rest)
        if sum(each.kind is RestEventKind.BORDER for each in self.events) > _CORNERS:
            return f"more than {_CORNERS} contacts changed"
        if not self.within.low <= after.value <= self.within.high:
            return "the end of the range was reached"
        self._last, self._walk = after, self._begin(after)
        return ""

    def _one_sided(self, x: NDArray[np.float64], side: NDArray[np.float64]) -> BranchPoint | None:
        """Return the point at a corner with the derivatives and eigenvalues of one side."""
        try:
            evaluation = self.corrector.evaluate(side)
        except NumericalError:
            return None
        course = self.corrector.tangent(evaluation, self._last.tangent)
        length = self._last.arclength + float(np.linalg.norm(x - self._last.x))
        physical = side * self.corrector.scales
        there = self.equation.orbit(physical[:-1], float(physical[-1]), evaluation)
        value = float(x[-1] * self.corrector.scales[-1])
        point = replace(there, value=value, position=x[:-1] * self.corrector.scales[:-1])
        return BranchPoint(value, cast("object", point), x, *course, length)  # type: ignore[arg-type]


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
