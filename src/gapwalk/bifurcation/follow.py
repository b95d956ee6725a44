"""Follow an orbit along a parameter: the walk with its special points, as a finished branch."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import replace

from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.bifurcation.departure import Departure, depart, directions
from gapwalk.bifurcation.switch import switch
from gapwalk.bifurcation.trail import Step, Trail
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.point import BranchPoint
from gapwalk.continuation.walk import End, EndReason
from gapwalk.errors import Interrupted, ModelError
from gapwalk.notebook.progress import shows_progress
from gapwalk.orbit.equation import Method, check_method
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

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not hold the start, or a special point that no other branch leaves.
    VerificationError
        If the branch is to be verified, and a check fails.
    Interrupted
        After Ctrl-C; its `found` is the branch as far as it was walked.
    """
    branch = walk_out(_departures(start, parameter, to, method), walk, report)
    if verify:
        from gapwalk.verification import confirm

        confirm(branch)
    return branch


def _departures(
    start: Orbit | SpecialPoint, parameter: str, to: float | tuple[float, float], method: Method | None
) -> list[Departure]:
    check_method(method)
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
    trails: list[Trail] = []
    walked: list[list[Step]] = []
    try:
        for departure in departures:
            walked.append([])
            trails.append(Trail(departure, walk))
            for point, special in trails[-1]:
                walked[-1].append((point, special))
                if report is not None:
                    report(point, special)
            if trails[-1].end is not None and trails[-1].end.reason is EndReason.CLOSED:
                break
    except KeyboardInterrupt:
        if not trails:
            raise
        raise Interrupted(join(trails, walked[: len(trails)])) from None
    return join(trails, walked)


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
