"""The study of a response: one branch of periodic orbits over one parameter, from its first orbit on."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import AbstractContextManager, nullcontext
from types import FrameType

import numpy as np

from gapwalk.bifurcation import Trail, TrailState, depart, directions, resumed_trail
from gapwalk.continuation.walk import End, EndReason, WalkState
from gapwalk.errors import NumericalError, StoreError
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.file import Study
from gapwalk.study.result import Result
from gapwalk.study.store.claim import earlier_result
from gapwalk.study.store.codec import PointCodec
from gapwalk.study.store.database import lock
from gapwalk.study.store.stored import Stored, StoredWalk
from gapwalk.study.store.versions import versions
from gapwalk.study.store.walk_store import Report, Store, WalkFile, create_result


def run_response(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Result:
    """Run the study of a response; parameters and errors as in `gapwalk.run`."""
    with nullcontext() if output is None else lock(output):
        walk, trail, written_by = _set_out(study, output, resume=resume, force=force)
        if report is not None:
            _report_again(walk, report)
        if trail is not None:
            with _store(study, output, walk, written_by, report) as store:
                walk = _walk(trail, walk, store, report)
        return Stored(study, walk, written_by).result()


def _set_out(
    study: Study, output: str | os.PathLike[str] | None, *, resume: bool, force: bool
) -> tuple[StoredWalk, Trail | None, dict[str, str]]:
    """What there is before the walk, the trail to walk (None if it was walked to its end already), and the versions."""
    earlier = None if output is None else earlier_result(output, study, resume=resume, force=force)
    if earlier is not None:
        walk = earlier.found
        assert isinstance(walk, StoredWalk)  # the study is the same
        if walk.is_complete:
            return walk, None, earlier.versions
        trail = _trail(study, walk.start, _state(walk))
        _check_scales(walk, trail)
        return walk, trail, versions(earlier.versions)
    options = study.walked
    start = find_orbit(study.system, options.period, options.start, method=options.method)
    trail = _trail(study, start)
    walk = StoredWalk(start, [trail.first], [], None, None)
    if output is not None:
        create_result(output, study, start, trail.first, versions())
    return walk, trail, versions()


def _store(
    study: Study,
    output: str | os.PathLike[str] | None,
    walk: StoredWalk,
    written_by: dict[str, str],
    report: Report | None,
) -> AbstractContextManager[Store | None]:
    if output is None:
        return nullcontext()
    options = study.walked
    unknowns = len(walk.points[0].x)
    codec = PointCodec(study.system, options.parameter, options.period, unknowns, balanced=options.balanced)
    return Store(output, WalkFile(codec, len(walk.points), len(walk.special_points)), written_by, report)


def _trail(study: Study, start: Orbit, state: TrailState | None = None) -> Trail:
    options = study.walked
    (direction,) = directions(options.begin, options.end)
    departure = depart(start, options.parameter, options.end, direction, options.method)
    return Trail(departure, options.walk) if state is None else resumed_trail(departure, options.walk, state)


def _state(walk: StoredWalk) -> TrailState | None:
    if walk.progress is None and len(walk.points) == 1:
        return None
    if walk.progress is None:
        raise _scaled_otherwise(walk)
    if walk.progress.count != len(walk.points) - 1:
        raise StoreError(f"the result has {len(walk.points)} points, but the walk had {walk.progress.count + 1}")
    previous, point = walk.points[-2:]
    return TrailState(WalkState(previous, point, walk.progress.step, walk.progress.count), walk.progress.detector)


def _check_scales(walk: StoredWalk, trail: Trail) -> None:
    """Refuse to go on with points in other variables than those in which the walk would begin today."""
    stored, first = walk.points[0].x, trail.first.x
    if len(stored) == len(first) and not np.allclose(stored, first, rtol=1e-6, atol=1e-9):
        raise _scaled_otherwise(walk)


def _scaled_otherwise(walk: StoredWalk) -> StoreError:
    return StoreError(
        f"the result holds the first {len(walk.points)} points of a walk by an older gapwalk, whose variables were "
        "scaled otherwise, so it cannot be gone on with; walk it anew into another file (--output), or over this "
        "one (--force)"
    )


def _walk(trail: Trail, walk: StoredWalk, store: Store | None, report: Report | None) -> StoredWalk:
    """Walk to the end, and keep all points in `walk` and in the store; the walk with its ends."""
    end = None
    with _Interrupt() as interrupt:
        try:
            for point, special_points in trail:
                walk.points.append(point)
                walk.special_points.extend(special_points)
                if store is not None:
                    store.add(point, special_points, trail.state, _ends(walk, trail.end))
                elif report is not None:
                    report(point, special_points)
                if interrupt.asked and trail.end is None:
                    end = End(EndReason.INTERRUPTED, point.value)
                    break
            end = end or trail.end
        except NumericalError as error:
            end = End(EndReason.FAILED, walk.points[-1].value, str(error))
        ends = (walk.first_end, end or End(EndReason.STOPPED, walk.points[-1].value))
        if store is not None:
            store.finish(ends)
    return walk._replace(ends=ends)


def _ends(walk: StoredWalk, end: End | None) -> tuple[End, ...] | None:
    return None if end is None else (walk.first_end, end)


def _report_again(walk: StoredWalk, report: Report) -> None:
    """Report the points of a result that is resumed, each with the special points before it."""
    rest = list(walk.special_points)
    for point in walk.points[1:]:
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
