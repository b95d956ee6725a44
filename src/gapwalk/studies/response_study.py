"""The study of a response: one branch of periodic orbits over one parameter, from its first orbit on.

Points are written in batches, each with the state of the walk after it, so that a killed run resumes from the last one.
Writing each point separately would take longer than computing it.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from types import FrameType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from gapwalk.bifurcation import BranchTracer, BranchTracerState, directions, start_branch
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.detector import DetectorState
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, WalkState
from gapwalk.errors import NumericalError, StoreError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import checked
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.study_kind import Found, Work

_SECONDS = 0.1  # between two moments that are written
_POINTS = 500  # at most in one of them


@dataclass(frozen=True)
class ResponseOptions(BranchOptions):
    """A response curve: the branch of periodic orbits over one parameter; parameters as `BranchOptions`.

    Examples
    --------
    >>> type(study.options).__name__, study.options.plan
    ('ResponseOptions', 'response over frequency from 1.1 to 1.5, period 1, showing half.x')
    """

    kind: ClassVar[str] = "response"
    reports: ClassVar[str] = "points"

    def work(self, system: System) -> ResponseWork:
        """Return the walk along the branch."""
        return ResponseWork(system, self)


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a walk, except for its last two points, which are stored as points."""

    step: float
    count: int
    detector: DetectorState


class Moment(NamedTuple):
    """Points of a walk since the previous batch."""

    #: points, special_points: Its points, and the special points between them and the one before.
    points: tuple[BranchPoint, ...]
    special_points: tuple[SpecialPoint, ...] = ()
    #: State from which the walk can continue; None if it has not left its first point.
    progress: Progress | None = None
    ends: tuple[End, ...] | None = None  #: Place and reason of its beginning and its end; None while it continues.


START = Part("start", Orbit)
MOMENT = Part("moment", Moment, numbered=True)


class ResponseWork(Work):
    """The walk along the branch of a response.

    Each point is reported with the special points before it.
    """

    def __init__(self, system: System, asked: BranchOptions) -> None:
        self.system, self.asked = system, asked
        self._start: Orbit | None = None
        self._moments: list[Moment] = []
        self._pending: list[tuple[BranchPoint, list[SpecialPoint]]] = []
        self._written = 0.0

    def take(self, known: Parts) -> None:
        """Read the first orbit, and the walk from there so far."""
        self._start, moments = known.one(START), dict(known.all(MOMENT))
        if not moments or list(moments) != list(range(len(moments))):
            raise ValueError("it holds nothing, or a part of the walk is missing")
        self._moments = list(moments.values())

    def parts(self, workers: Workers) -> Generator[Found]:
        """Walk to the end; the first Ctrl-C stops between two points."""
        begun: tuple[Found, ...] = ()
        if self._start is None:
            self._start = find_orbit(self.system, self.asked.period, self.asked.start, method=self.asked.method)
            tracer = self._tracer(None)
            self._moments = [Moment((tracer.first,))]
            begun = (Found((START.entry(self._start), MOMENT.entry(self._moments[0], 0)), ((tracer.first, []),)),)
        else:
            tracer = self._tracer(_state(self._moments))
            _check_scales(self._moments[0], tracer)
        end, first, progress = None, _first_end(self._moments), self._moments[-1].progress
        value = next(moment.points[-1].value for moment in reversed(self._moments) if moment.points)
        self._written = time.monotonic()
        with _interrupts() as interrupts:
            yield from begun
            try:
                for point, special_points in tracer:
                    value, state = point.value, tracer.state
                    self._pending.append((point, special_points))
                    progress = Progress(state.walk.step, state.walk.count, state.detector)
                    yield self._found(progress, None if tracer.end is None else (first, tracer.end))
                    if interrupts and tracer.end is None:
                        end = End(EndReason.INTERRUPTED, value)
                        break
                end = end or tracer.end
            except NumericalError as error:
                end = End(EndReason.FAILED, value, str(error))
            yield self._flushed(progress, (first, end or End(EndReason.STOPPED, value)), ())
            if end is not None and end.reason is EndReason.INTERRUPTED:
                raise KeyboardInterrupt

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield all points, each with the special points before it."""
        branch = self.record
        rest = list(branch.special_points)
        for point in branch.points:
            before = [special for special in rest if special.point.arclength <= point.arclength]
            del rest[: len(before)]
            yield point, before

    @property
    def complete(self) -> bool:
        """True if the walk has ended regularly."""
        ends = self._moments[-1].ends if self._moments else None
        return ends is not None and ends[-1].reason.is_final

    @property
    def done(self) -> int:
        """Number of batches of the walk."""
        return len(self._moments)

    @property
    def record(self) -> Branch:
        """The branch so far."""
        pending = (tuple(point for point, _ in self._pending), tuple(chain.from_iterable(s for _, s in self._pending)))
        moments = [*self._moments, *([Moment(*pending)] if self._pending else [])]
        points = tuple(chain.from_iterable(moment.points for moment in moments))
        special_points = tuple(chain.from_iterable(moment.special_points for moment in moments))
        ends = moments[-1].ends or (_first_end(moments), End(EndReason.STOPPED, points[-1].value))
        return checked(Branch(self.asked.parameter, self.asked.period, points, special_points, ends))

    def _tracer(self, state: BranchTracerState | None) -> BranchTracer:
        asked = self.asked
        assert self._start is not None
        (direction,) = directions(asked.begin, asked.end)
        beginning = start_branch(self._start, asked.parameter, asked.end, direction, asked.method)
        return BranchTracer(beginning, asked.walk, state)

    def _found(self, progress: Progress, ends: tuple[End, ...] | None) -> Found:
        """Return the last point; if it is time to write a batch, with all points since the last one."""
        news = (self._pending[-1],)
        is_due = len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS
        return self._flushed(progress, ends, news) if is_due else Found((), news)

    def _flushed(self, progress: Progress | None, ends: tuple[End, ...] | None, news: tuple[Any, ...]) -> Found:
        points = tuple(point for point, _ in self._pending)
        special_points = tuple(special for _, specials in self._pending for special in specials)
        moment = Moment(points, special_points, progress, ends)
        self._moments.append(moment)
        self._pending, self._written = [], time.monotonic()
        return Found((MOMENT.entry(moment, len(self._moments) - 1),), news)


def _state(moments: list[Moment]) -> BranchTracerState | None:
    """Return the state of a walk; None if it has not left its first point."""
    points = [point for moment in moments for point in moment.points]
    progress = moments[-1].progress
    count = 0 if progress is None else progress.count
    if count != len(points) - 1:
        raise StoreError(f"the result has {len(points)} points, but the walk had {count + 1}")
    if progress is None:
        return None
    previous, earlier = points[-2] if count else None, points[-3] if count > 1 else None
    return BranchTracerState(WalkState(previous, points[-1], progress.step, count, earlier), progress.detector)


def _check_scales(first: Moment, tracer: BranchTracer) -> None:
    """Refuse to continue a walk whose variables were scaled differently."""
    stored, today = first.points[0].x, tracer.first.x
    if len(stored) == len(today) and not np.allclose(stored, today, rtol=1e-6, atol=1e-9):
        raise StoreError(
            "the result has the first points of a walk by another gapwalk version with other scales of variables, so "
            "it cannot be continued; walk it again into another file (--output), or over this one (--force)"
        )


def _first_end(moments: list[Moment]) -> End:
    """Return the end at which the walk begins."""
    return End(EndReason.START, moments[0].points[0].value)


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Note the first Ctrl-C while a branch is walked, so that it stops between two points; raise a second one at once.

    If Ctrl-C already has another handler, or in a thread that is not the main one, nothing is changed.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        noted.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)

    in_main = threading.current_thread() is threading.main_thread()
    is_ours = in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    try:
        if is_ours:
            signal.signal(signal.SIGINT, note)
        yield noted
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
