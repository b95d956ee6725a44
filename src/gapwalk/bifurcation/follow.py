"""Follow an orbit along a parameter: the walk with its special points, as a finished branch."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.departure import Departure, depart, directions
from gapwalk.bifurcation.kinds.event import Event, check_events
from gapwalk.bifurcation.switch import switch
from gapwalk.bifurcation.trail import Step, Trail, TrailState, resumed_trail
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.tracing import Tracing, TracingState
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import Interrupted, ModelError
from gapwalk.notebook.progress import shows_progress
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit

Report = Callable[[BranchPoint, list[SpecialPoint]], None]
"""Called with each new point and the special points before it."""


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
    """Follow a periodic orbit along one named parameter, around folds, with every special point on the way.

    Parameters
    ----------
    start
        The orbit to start from, as from `find_orbit`. Or a flip or a branch point: then the branch that leaves there is
        followed, of twice the period or across; see `switch`.
    parameter
        Name of the parameter, such as ``"frequency"`` or ``"stage2.clearance"``.
    to
        The value at which to stop; or two, between which the branch is followed in both directions.
    walk
        Options of the walk.
    method
        How orbits are posed: `Shooting` (the default) or `Balance`.
    report
        Called with each new point and the special points before it.
    verify
        Whether to check the branch by other means before it is returned; see `gapwalk.verify`.
    events
        Special points of your own: functions of the orbit whose zeros are located; see `Event`.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not hold the start, or a special point that no other branch leaves.
    VerificationError
        If the branch is to be verified, and a check fails.
    Interrupted
        After Ctrl-C; its `found` is the branch as far as it was walked.
    """
    steps = BranchWalk(_departures(start, parameter, to, method), walk, events)
    branch = walked_to_end(steps, report)
    if verify:
        from gapwalk.verification import confirm

        confirm(branch)
    return branch


def walk(
    start: Orbit | SpecialPoint,
    parameter: str,
    to: float | tuple[float, float],
    *,
    options: WalkOptions | None = None,
    method: Method | None = None,
    events: Sequence[Event] = (),
    resume: WalkProgress | None = None,
) -> BranchWalk:
    """Walk a branch point by point: look at each, stop when you like, and resume later.

    Parameters
    ----------
    start, parameter, to, method, events
        As in `follow`.
    options
        Options of the walk.
    resume
        `BranchWalk.state` of a walk from the same start that was stopped; it can be pickled.

    Returns
    -------
    BranchWalk
        An iterator over the points; `BranchWalk.branch` is the branch as far as it was walked.

    Raises
    ------
    ModelError
        As `follow`.

    Examples
    --------
    >>> steps = gw.walk(orbit, "frequency", 0.2)
    >>> for point in steps:
    ...     if point.measure("max.q1") > 3.0:
    ...         break
    >>> steps.branch.plot()
    """
    return BranchWalk(_departures(start, parameter, to, method), options, events, resume)


WalkProgress = TracingState[Step]
"""Where the walk of a branch has come to."""


class BranchWalk(Iterator[BranchPoint]):
    """The walk of a branch, as an iterator over its points; see `walk`.

    Parameters
    ----------
    departures
        Where it begins: one departure, or two in opposite directions of one point.
    options
        Options of the walk.
    events
        Special points of the user's own.
    resume
        Where a walk from the same departures had come to.
    """

    def __init__(
        self,
        departures: list[Departure],
        options: WalkOptions | None = None,
        events: Sequence[Event] = (),
        resume: WalkProgress | None = None,
    ) -> None:
        check_events(events)

        def begin(departure: Departure, state: TrailState | None) -> Trail:
            if state is None:
                return Trail(departure, options, events=events)
            return resumed_trail(departure, options, state, events)

        self._tracing: Tracing[Departure, Trail, Step] = Tracing(departures, begin, resume)

    def __next__(self) -> BranchPoint:
        return next(self._tracing)[0]

    @property
    def special_points(self) -> tuple[SpecialPoint, ...]:
        """The special points between the last point and the one before it."""
        steps = self._tracing.steps
        return tuple(steps[-1][-1][1]) if steps and steps[-1] else ()

    @property
    def state(self) -> WalkProgress:
        """Where it has come to: `walk` with it as `resume` continues as if it had never been stopped."""
        return self._tracing.state

    @property
    def branch(self) -> Branch:
        """The branch as far as it was walked; a ModelError before the first point."""
        if not self._tracing.traces:
            raise ModelError("nothing was walked yet; ask for a point first: next(steps)")
        return join(self._tracing.traces, self._tracing.steps)


def _departures(
    start: Orbit | SpecialPoint, parameter: str, to: float | tuple[float, float], method: Method | None
) -> list[Departure]:
    method = chosen(method)
    if not isinstance(start, Orbit | SpecialPoint):
        raise ModelError(
            f"follow begins at an orbit or a special point, not at {reprlib.repr(start)}; find an orbit first: "
            "gw.find_orbit(system)"
        )
    if isinstance(start, SpecialPoint):
        value = start.orbit.system[parameter]
        within = to if isinstance(to, tuple) else (min(value, to), max(value, to))
        return switch(start, parameter, within, method)
    return [depart(start, parameter, to, way, method) for way in directions(start.system[parameter], to)]


def walk_out(departures: list[Departure], walk: WalkOptions | None = None, report: Report | None = None) -> Branch:
    """The whole branch from one departure, or from two in opposite directions of one point."""
    return walked_to_end(BranchWalk(departures, walk), report)


def walked_to_end(steps: BranchWalk, report: Report | None = None) -> Branch:
    """The branch of a walk that is made to its end.

    Raises
    ------
    Interrupted
        After Ctrl-C; its `found` is the branch as far as it was walked.
    """
    try:
        for point in steps:
            if report is not None:
                report(point, list(steps.special_points))
    except KeyboardInterrupt:
        try:
            found = steps.branch
        except ModelError:  # nothing was walked yet
            raise KeyboardInterrupt from None
        raise Interrupted(found) from None
    return steps.branch


def join(trails: list[Trail], walked: list[list[Step]]) -> Branch:
    """One branch from its one or two trails and the steps that they yielded, in one direction of travel."""
    equation = trails[0].departure.equation
    ends = [trail.end or End(EndReason.STOPPED, trail.walk.point.value) for trail in trails]
    first = trails[-1].first  # its tangent leads the way in which the branch is told
    points: list[BranchPoint] = [first]
    special: list[SpecialPoint] = []
    if len(trails) == 2:
        back = [point for point, _ in walked[0]]
        points = [_reversed(point) for point in reversed(back)] + [first]
        special = [_turned(each) for _, found in reversed(walked[0]) for each in reversed(found)]
    points += [point for point, _ in walked[-1]]
    special += [each for _, found in walked[-1] for each in found]
    if len(trails) == 1:
        reason = EndReason.BRANCHED if trails[0].departure.singular else EndReason.START
        ends = [End(reason, first.value), *ends]
    return Branch(equation.parameter or "", equation.period, tuple(points), tuple(special), tuple(ends))


def _reversed(point: BranchPoint) -> BranchPoint:
    return replace(point, tangent=-point.tangent, determinant=-point.determinant, arclength=-point.arclength, memo={})


def _turned(special: SpecialPoint) -> SpecialPoint:
    return replace(special, point=_reversed(special.point), before=special.after, after=special.before)
