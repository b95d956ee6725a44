"""Follow a special point in two parameters: its locus, with the points of codimension two on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.locus.departure import LocusDeparture, Ranges, depart_locus
from gapwalk.bifurcation.locus.locus import Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.locus.trail import LocusStep, LocusTrail
from gapwalk.continuation.options import WalkOptions
from gapwalk.continuation.tracing import Tracing
from gapwalk.errors import Interrupted
from gapwalk.orbit.equation import Method

LocusReport = Callable[[LocusPoint, list[Codim2Point]], None]
"""Called with each new point and the points of codimension two before it."""


def follow_locus(
    special: SpecialPoint,
    first: str,
    second: str,
    to: Ranges,
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: LocusReport | None = None,
) -> Locus:
    """Follow a fold, flip, Neimark-Sacker or grazing point in two named parameters, in both directions.

    Parameters
    ----------
    special
        The point to start from, from a branch along any parameter.
    first, second
        Names of the parameters, such as ``"frequency"`` and ``"mean.q1"``.
    to
        The range of each: ``((low, high), (low, high))``.
    walk
        Options of the walk.
    method
        How orbits are posed: `Shooting` in one segment (the default), or `Balance`, whatever the point was found with.
    report
        Called with each new point and the points of codimension two before it.

    Raises
    ------
    ModelError
        For a branch point, which has no locus; for unknown or equal parameters; for ranges without the start.
    ConvergenceError
        If the start is no special point of its kind, to the tolerance of the method; or if it takes more harmonics.
    Interrupted
        After Ctrl-C; its `found` is the locus as far as it was walked.
    """
    steps = trace_locus(depart_locus(special, first, second, to, method), walk)
    try:
        for step in steps:
            if report is not None:
                report(*step)
    except KeyboardInterrupt:
        if not steps.traces:
            raise
        raise Interrupted(traced_locus(steps)) from None
    return traced_locus(steps)


LocusTracing = Tracing[LocusDeparture, LocusTrail, LocusStep]
"""A locus as it is traced."""


def trace_locus(departures: list[LocusDeparture], walk: WalkOptions | None = None) -> LocusTracing:
    """A locus as an iterator over its steps, from departures in one or both directions."""
    return Tracing(departures, lambda departure, state: LocusTrail(departure, walk, state))


def traced_locus(steps: LocusTracing) -> Locus:
    """The locus as far as it was traced; one direction shows the whole of a closed curve."""
    kept = slice(-1, None) if steps.traces[-1].is_closed else slice(None)
    return join_locus(steps.traces[kept], steps.steps[kept])


def join_locus(trails: list[LocusTrail], walked: list[list[LocusStep]]) -> Locus:
    """One locus from its one or two trails and the steps that they yielded, in one direction of travel."""
    departure, start = trails[0].departure, trails[-1].first
    ends = [
        trail.end or LocusEnd(LocusEndReason.STOPPED, _last(trail, steps))
        for trail, steps in zip(trails, walked, strict=True)
    ]
    points: list[LocusPoint] = [start]
    codim2: list[Codim2Point] = []
    if len(trails) == 2:
        points = [_reversed(step.point) for step in reversed(walked[0])] + [start]
        codim2 = [_turned(point) for step in reversed(walked[0]) for point in reversed(step.codim2)]
    else:
        ends = ends * 2
    points += [step.point for step in walked[-1]]
    codim2 += [point for step in walked[-1] for point in step.codim2]
    first, second = departure.plane.names
    return Locus(
        departure.kind,
        first,
        second,
        departure.plane.period,
        tuple(points),
        tuple(codim2),
        (ends[0], ends[1]),
        departure.contact,
    )


def _last(trail: LocusTrail, steps: list[LocusStep]) -> tuple[float, float]:
    return steps[-1].point.values if steps else trail.first.values


def _reversed(point: LocusPoint) -> LocusPoint:
    return replace(point, tangent=-point.tangent, arclength=-point.arclength)


def _turned(codim2: Codim2Point) -> Codim2Point:
    return replace(codim2, point=_reversed(codim2.point))
