"""The study of a response: one branch of periodic orbits over one parameter, from its first orbit on."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Mapping
from contextlib import nullcontext
from itertools import chain
from types import FrameType

import numpy as np

from gapwalk.bifurcation import BranchTracer, BranchTracerState, directions, resumed_tracer, start_branch
from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.walk import End, EndReason, WalkState
from gapwalk.errors import NumericalError, StoreError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.codec import checked
from gapwalk.results.result_file import Parts, lock, reading
from gapwalk.results.versions import versions
from gapwalk.studies.claim import earlier_result
from gapwalk.studies.file import Study
from gapwalk.studies.request import request_file
from gapwalk.studies.result import Result
from gapwalk.studies.walk_file import MOMENT, START, Moment, Report, WalkFile, in_order


def run_response(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Result:
    """Run the study of a response; parameters and errors as in `gapwalk.run`."""
    options = study.walked
    with nullcontext() if output is None else lock(output):
        earlier = earlier_result(output, study, resume=resume, force=force)
        if earlier is not None and report is not None:
            _report_again(earlier.branches[0], report)
        if earlier is not None and earlier.complete:
            return earlier
        if earlier is None or output is None:
            before, known = None, []
            start = find_orbit(study.system, options.period, options.start, method=options.method)
            tracer = _tracer(study, start)
        else:
            before = earlier.versions
            start, known = _read_walk(study, output)
            tracer = _tracer(study, start, _state(known))
            _check_scales(known[0], tracer)
        with request_file(study, output, before) as file:
            if not known:
                known = [Moment((tracer.first,))]
                file.write(START.entry(start), MOMENT.entry(known[0]))
            walk = WalkFile(file, known, report)
            _walk(tracer, walk)
        return _result(study, walk.moments, versions(None if before is None else dict(before)))


def read_response(study: Study, parts: Parts) -> Result:
    """The result of a response from the parts of its file; see `gapwalk.studies.load`."""
    parts.one(START)  # with which a walk would continue
    return _result(study, in_order(parts.all(MOMENT)), {})


def _result(study: Study, moments: list[Moment], written_by: Mapping[str, str]) -> Result:
    points = tuple(chain.from_iterable(moment.points for moment in moments))
    special_points = tuple(chain.from_iterable(moment.special_points for moment in moments))
    ends, options = moments[-1].ends, study.walked
    is_complete = ends is not None and ends[-1].reason.is_final
    if ends is None:
        ends = (_first_end(moments), End(EndReason.STOPPED, points[-1].value))
    branch = checked(Branch(options.parameter, options.period, points, special_points, ends))
    return Result(study, (branch,), is_complete, written_by)


def _read_walk(study: Study, path: str | os.PathLike[str]) -> tuple[Orbit, list[Moment]]:
    """The orbit that was found first, and the walk from there so far."""
    with reading(path) as parts:
        parts.base = study.system
        return parts.one(START), in_order(parts.all(MOMENT))


def _tracer(study: Study, start: Orbit, state: BranchTracerState | None = None) -> BranchTracer:
    options = study.walked
    (direction,) = directions(options.begin, options.end)
    beginning = start_branch(start, options.parameter, options.end, direction, options.method)
    return BranchTracer(beginning, options.walk) if state is None else resumed_tracer(beginning, options.walk, state)


def _state(moments: list[Moment]) -> BranchTracerState | None:
    """Where a walk has come to; None if it has not left its first point."""
    points = [point for moment in moments for point in moment.points]
    progress = moments[-1].progress
    count = 0 if progress is None else progress.count
    if count != len(points) - 1:
        raise StoreError(f"the result has {len(points)} points, but the walk had {count + 1}")
    if progress is None:
        return None
    return BranchTracerState(
        WalkState(points[-2] if count else None, points[-1], progress.step, count), progress.detector
    )


def _check_scales(first: Moment, tracer: BranchTracer) -> None:
    """Refuse to continue points in other variables than those in which the walk would begin today."""
    stored, today = first.points[0].x, tracer.first.x
    if len(stored) == len(today) and not np.allclose(stored, today, rtol=1e-6, atol=1e-9):
        raise StoreError(
            "the result holds the first points of a walk by another gapwalk, whose variables were scaled otherwise, so "
            "it cannot be continued; walk it again into another file (--output), or over this one (--force)"
        )


def _walk(tracer: BranchTracer, walk: WalkFile) -> None:
    """Walk to the end, and keep all points."""
    end, first = None, _first_end(walk.moments)
    value = next(moment.points[-1].value for moment in reversed(walk.moments) if moment.points)
    with _Interrupt() as interrupt:
        try:
            for point, special_points in tracer:
                value = point.value
                walk.add(point, special_points, tracer.state, None if tracer.end is None else (first, tracer.end))
                if interrupt.asked and tracer.end is None:
                    end = End(EndReason.INTERRUPTED, value)
                    break
            end = end or tracer.end
        except NumericalError as error:
            end = End(EndReason.FAILED, value, str(error))
        walk.finish((first, end or End(EndReason.STOPPED, value)))


def _first_end(moments: list[Moment]) -> End:
    """Where the walk begins."""
    return End(EndReason.START, moments[0].points[0].value)


def _report_again(branch: Branch, report: Report) -> None:
    """Report the points of a result that is resumed, each with the special points before it."""
    rest = list(branch.special_points)
    for point in branch.points[1:]:
        before = [special for special in rest if special.point.arclength <= point.arclength]
        del rest[: len(before)]
        report(point, before)


class _Interrupt:
    """Ctrl-C while a branch is walked: the first one is noted, so that it stops between two points.

    A second one is raised at once. Where Ctrl-C has a meaning of its own, or in another thread than the main one,
    nothing is changed.
    """

    def __init__(self) -> None:
        self.asked = False
        self._replaced = False

    def __enter__(self) -> _Interrupt:
        in_main = threading.current_thread() is threading.main_thread()
        if in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._note)
            self._replaced = True
        return self

    def __exit__(self, *_: object) -> None:
        if self._replaced:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
