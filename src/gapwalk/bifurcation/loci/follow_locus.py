"""Continuation of a special point in two parameters: its locus, with its points of codimension two.

Method: docs/numerics/loci.md
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gapwalk.bifurcation.branch import SpecialPoint
from gapwalk.bifurcation.loci.locus import Codim2Point, Locus, LocusEnd, LocusEndReason, LocusPoint
from gapwalk.bifurcation.loci.locus_start import LocusStart, Ranges, start_locus
from gapwalk.bifurcation.loci.locus_tracer import LocusStep, LocusTracer
from gapwalk.continuation.tracing import Tracing
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted
from gapwalk.orbit.method import Method

LocusReport = Callable[[LocusPoint, list[Codim2Point]], None]
"""Function called with each new point and the points of codimension two before it."""


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
        Discretisation of the orbits: `Shooting` in one segment (default), or `Balance`, however the point was found.
    report
        Called with each new point and the points of codimension two before it.

    Raises
    ------
    ModelError
        For a branch point, which has no locus; for unknown or equal parameters; for ranges that exclude the start.
    ConvergenceError
        If the start is not a special point of its kind to the tolerance of the method, or needs too many harmonics.
    Interrupted
        After Ctrl-C; its `found` is the locus as far as it was followed.
    """
    steps = trace_locus(start_locus(special, first, second, to, method), walk)
    try:
        for step in steps:
            if report is not None:
                report(*step)
    except KeyboardInterrupt:
        if not steps.traces:
            raise
        raise Interrupted(traced_locus(steps)) from None
    return traced_locus(steps)


LocusTracing = Tracing[LocusStart, LocusTracer, LocusStep]
"""Tracing of a locus."""


def trace_locus(beginnings: list[LocusStart], walk: WalkOptions | None = None) -> LocusTracing:
    """Return an iterator over the steps of a locus, from beginnings in one or both directions."""
    return Tracing(beginnings, lambda beginning, state: LocusTracer(beginning, walk, state))


def traced_locus(steps: LocusTracing) -> Locus:
    """Return the locus as far as it was traced; one direction covers the whole of a closed curve."""
    kept = slice(-1, None) if steps.traces[-1].is_closed else slice(None)
    return join_locus(steps.traces[kept], steps.steps[kept])


def join_locus(tracers: list[LocusTracer], walked: list[list[LocusStep]]) -> Locus:
    """Join one or two tracers and the steps that they yielded into one locus with one direction of travel."""
    beginning, start = tracers[0].beginning, tracers[-1].first
    ends = [
        tracer.end or LocusEnd(LocusEndReason.STOPPED, (steps[-1].point if steps else tracer.first).values)
        for tracer, steps in zip(tracers, walked, strict=True)
    ]
    points: list[LocusPoint] = [start]
    codim2: list[Codim2Point] = []
    if len(tracers) == 2:
        points = [_reversed(step.point) for step in reversed(walked[0])] + [start]
        codim2 = [
            replace(each, point=_reversed(each.point)) for step in reversed(walked[0]) for each in reversed(step.codim2)
        ]
    else:
        ends = ends * 2
    points += [step.point for step in walked[-1]]
    codim2 += [point for step in walked[-1] for point in step.codim2]
    first, second = beginning.plane.names
    return Locus(
        beginning.kind,
        first,
        second,
        beginning.plane.period,
        tuple(points),
        tuple(codim2),
        (ends[0], ends[1]),
        beginning.contact,
    )


def _reversed(point: LocusPoint) -> LocusPoint:
    return replace(point, tangent=-point.tangent, arclength=-point.arclength)
