"""Continuation of an orbit along a parameter: the walk with its special points, returned as a finished branch."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import BranchStart, directions, start_branch, switch
from gapwalk.bifurcation.branch_tracer import BranchTracer, BranchTracerState, Step
from gapwalk.bifurcation.detector import as_one
from gapwalk.bifurcation.kinds.user_event import Event, check_events
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint, Tracing, TracingState, in_one_direction
from gapwalk.continuation.walk import End, EndReason, WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.notebook import shows_progress
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit

Report = Callable[[BranchPoint, list[SpecialPoint]], None]
"""Function called with each new point and the special points before it."""


@shows_progress(lambda count, point, special_points: f"{count} points, at {point.value:.6g}")
def follow(
    start: Orbit | SpecialPoint,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    verify: bool = False,
    events: Sequence[Event] = (),
) -> Branch:
    """Follow a periodic orbit along one named parameter, around folds, and locate every special point.

    Parameters
    ----------
    start
        The orbit to start from, as from `find_orbit`; or a flip or a branch point. Then the branch that begins there is
        followed: the branch of twice the period, or the crossing branch.
    parameter
        Name of the parameter, such as ``"frequency"`` or ``"stage2.clearance"``.
    to
        The value at which to stop; or two values, between which the branch is followed in both directions.
    walk
        Options of the walk.
    method
        Discretisation of the orbits: `Shooting` (the default) or `Balance`.
    report
        Called with each new point and the special points before it.
    verify
        True to verify the branch by independent checks before it is returned; see `gapwalk.verify`.
    events
        User-defined special points: functions of the orbit whose zeros are located; see `Event`.

    Returns
    -------
    Branch
        Its points, its special points, and why it ends.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not contain the start, or a kind of special point at which no branch
        begins.
    NumericalError
        If no branch begins at this special point in the range.
    VerificationError
        If the branch is to be verified, and a check fails.
    Interrupted
        After Ctrl-C; its `found` is the branch so far.

    Notes
    -----
    Pseudo-arclength continuation: Keller (1977); Padmanabhan and Singh (1995), section 3. Step size: den Heijer and
    Rheinboldt (1981), SIAM Journal on Numerical Analysis 18, 925-948.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=0.5
    ... )
    >>> branch = gw.follow(gw.find_orbit(mass), "frequency", 0.8)
    >>> round(branch.points[-1].value, 9)
    0.8
    """
    branch = _tracing(_beginnings(start, parameter, to, method), walk, events).to_end(join, report)
    if verify:
        from gapwalk.verification import confirm

        confirm(branch)
    return branch


def walk(
    start: Orbit | SpecialPoint,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    events: Sequence[Event] = (),
    resume: WalkProgress | None = None,
) -> BranchWalk:
    """Walk a branch point by point, so that you can inspect each point, stop, and resume later.

    Parameters
    ----------
    start, parameter, to, walk, method, events
        As in `follow`.
    resume
        `BranchWalk.state` of a stopped walk from the same start; it can be pickled.

    Returns
    -------
    BranchWalk
        An iterator over the points; `BranchWalk.branch` is the branch so far.

    Raises
    ------
    ModelError
        As in `follow`.

    Examples
    --------
    >>> steps = gw.walk(orbit, "frequency", 1.6)
    >>> first = next(point for point in steps if point.measure("max.x") > 1.0)  # the first impact
    >>> round(first.value, 2), str(steps.special_points[0].kind)
    (0.71, 'grazing')
    """
    return BranchWalk(_beginnings(start, parameter, to, method), walk, events, resume)


WalkProgress = TracingState[Step]
"""Progress of the walk of a branch."""
BranchTracing = Tracing[BranchStart, BranchTracer, Step]
"""Tracing of a branch."""


class BranchWalk(Iterator[BranchPoint]):
    """Walk of a branch, as an iterator over its points; see `walk`."""

    def __init__(
        self,
        beginnings: list[BranchStart],
        options: WalkOptions | None = None,
        events: Sequence[Event] = (),
        resume: WalkProgress | None = None,
        *,
        judges: bool = True,
    ) -> None:
        self._tracing = _tracing(beginnings, options, events, resume, judges=judges)

    def __next__(self) -> BranchPoint:
        return next(self._tracing)[0]

    @property
    def special_points(self) -> tuple[SpecialPoint, ...]:
        """Special points between the last point and the one before it."""
        steps = self._tracing.steps
        return tuple(steps[-1][-1][1]) if steps and steps[-1] else ()

    @property
    def state(self) -> WalkProgress:
        """Progress so far: `walk` with it as `resume` continues as if it had never been stopped."""
        return self._tracing.state

    @property
    def branch(self) -> Branch:
        """Branch so far; raises a ModelError before the first point."""
        if not self._tracing.traces:
            raise ModelError("no point was computed yet; ask for a point first: next(steps)")
        return join(self._tracing)


def _beginnings(
    start: Orbit | SpecialPoint, parameter: str, to: float | tuple[float, float], method: Method | None
) -> list[BranchStart]:
    if not isinstance(start, Orbit | SpecialPoint):
        raise ModelError(
            f"follow starts from an orbit or a special point, not from {reprlib.repr(start)}; find an orbit first: "
            "gw.find_orbit(system)"
        )
    method = chosen(method or (start.orbit if isinstance(start, SpecialPoint) else start).own_method)
    if isinstance(start, SpecialPoint):
        value = start.orbit.system[parameter]
        within = to if isinstance(to, tuple) else (min(value, to), max(value, to))
        beginnings = switch(start, parameter, within, method)
        if not beginnings:
            raise NumericalError("no branch begins at this point between these values; choose a wider range")
        return beginnings
    return [start_branch(start, parameter, to, way, method) for way in directions(start.system[parameter], to)]


def walk_out(beginnings: list[BranchStart], walk: WalkOptions | None = None, report: Report | None = None) -> Branch:
    """Return the whole branch from one beginning, or from two at one point in opposite directions."""
    return _tracing(beginnings, walk).to_end(join, report)


def _tracing(
    beginnings: list[BranchStart],
    options: WalkOptions | None,
    events: Sequence[Event] = (),
    resume: WalkProgress | None = None,
    *,
    judges: bool = True,
) -> BranchTracing:
    check_events(events)

    def tracer(beginning: BranchStart, state: BranchTracerState | None) -> BranchTracer:
        return BranchTracer(beginning, options, state, events, judges=judges)

    return Tracing(beginnings, tracer, resume)


def join(tracing: BranchTracing) -> Branch:
    """Return the branch so far, with one direction of travel, from its traces in one direction or two."""
    tracers, walked = tracing.traces, tracing.steps
    equation, first = tracers[0].beginning.equation, tracers[-1].first
    ends = [_end(tracer, steps) for tracer, steps in zip(tracers, walked, strict=True)]
    if len(tracers) == 1:
        reason = EndReason.BRANCHED if tracers[0].beginning.singular else EndReason.START
        ends = [End(reason, first.value), *ends]
    points, special = in_one_direction(
        walked,
        first,
        _reversed,
        lambda each: replace(each, point=_reversed(each.point), before=each.after, after=each.before),
    )
    return Branch(equation.parameter or "", equation.period, *as_one(points, special), tuple(ends))


def _end(tracer: BranchTracer, steps: Sequence[Step]) -> End:
    """Return the end of one tracer.

    Ctrl-C may come while the special points before a new point of the walk are sought. The branch lacks that point.
    """
    last = steps[-1][0] if steps else tracer.first
    is_whole = tracer.walk.point.arclength == last.arclength
    return tracer.end if tracer.end is not None and is_whole else End(EndReason.STOPPED, last.value)


def _reversed(point: BranchPoint) -> BranchPoint:
    return replace(point, tangent=-point.tangent, determinant=-point.determinant, arclength=-point.arclength, memo={})
