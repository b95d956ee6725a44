"""The study of a response: one branch of periodic orbits over one parameter, from its first orbit on.

Points are written in batches, each with the state of the walk after it, so that a killed run resumes from the last one.
Writing each point separately would take longer than computing it.

Where many gaps rattle no curve can be followed. The walk then ends, and the motion is settled by equal steps at values
beyond, until it parts so seldom that an orbit can be followed again: so a response is complete.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from dataclasses import replace as replaced
from itertools import chain
from types import FrameType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from gapwalk.answers.settled_curve import FEW, LARGE, SettledCurve
from gapwalk.bifurcation import BranchTracer, BranchTracerState, directions, start_branch
from gapwalk.bifurcation.band import Band
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.detector import DetectorState
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import End, EndReason, WalkState
from gapwalk.errors import NumericalError, StoreError
from gapwalk.interrupts import end_gently
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit, orbit_near
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.shooting import Shooting
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import checked
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.study_kind import Found, Work

_SECONDS = 0.1  # between two moments that are written
_POINTS = 500  # at most in one of them
_SHORT = 1e-3  # of the range: the mean of some steps, below which a walk is given up where many gaps rattle
_STEPS, _SPECIAL = 10, 1  # these steps, and special points before another within the same length
_LOOK = 2  # further steps ahead of a walk at which it is seen what settles: as far as it may step
_CALM = 4  # steps at which it parts rarely and alike, before it is walked again; more after each attempt
_ENDS = (EndReason.RANGE, EndReason.TABLE, EndReason.TURNED_BACK, EndReason.CLOSED, EndReason.JOINED)


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

    @property
    def most_workers(self) -> int:
        """One: each step of a walk begins where the last one ended."""
        return 1

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
    turn: End | None = None  #: End of a stretch of the walk, beyond which motions are settled.
    bands: tuple[Band, ...] = ()  #: Settled motions; of the first batch, those before its first point.
    orbit: Orbit | None = None  #: First orbit of a further stretch, which begins with these points.


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
        self._ready: BranchTracer | None = None  # at the first point of a stretch
        self._curve: SettledCurve | None = None
        self._method = asked.method.suited_to(system)
        if isinstance(self._method, Shooting):
            self._curve = SettledCurve.of(system, asked.parameter, (asked.begin, asked.end))

    def take(self, known: Parts) -> None:
        """Read the first orbit, and the walk from there so far."""
        self._start, moments = known.get(START), dict(known.all(MOMENT))
        if not moments or list(moments) != list(range(len(moments))):
            raise ValueError("it holds nothing, or a part of the walk is missing")
        self._moments = list(moments.values())
        if self._start is None and self._moments[0].points:
            raise ValueError("its first orbit is missing")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Walk to the end; the first Ctrl-C stops between two points."""
        with _interrupts() as interrupts:
            if not self._moments:
                yield self._first()
            end = None
            while end is None:
                end = yield from self._settle(interrupts) if self._is_settling else self._walk(interrupts)
            if end.reason is EndReason.INTERRUPTED:
                raise KeyboardInterrupt

    def _first(self) -> Found:
        """Begin with an orbit at the first value, or with what settles there if no orbit can be followed from it."""
        asked, curve, bands = self.asked, self._curve, list[Band]()
        if curve is None or asked.start != "settle":
            self._start = find_orbit(self.system, asked.period, asked.start, method=self._method)
        elif (band := curve.at(0)).total:
            self._start, bands = self._orbit_at([band]), [band]
        else:  # a quiet motion that settles slowly: its orbit is found by Newton's method
            bands = [band]
            with suppress(NumericalError):
                self._start = find_orbit(self.system, asked.period, band.state, method=self._method)
        if self._start is None:
            return self._kept(Moment((), bands=tuple(bands)), tuple((band, []) for band in bands))
        self._ready = tracer = self._tracer(self._start, None)
        found = self._kept(Moment((tracer.first,)), ((tracer.first, []),))
        return found._replace(entries=(START.entry(self._start), *found.entries))

    def _orbit_at(self, bands: Sequence[Band], *, again: bool = False) -> Orbit | None:
        """Return the orbit at the last of some settled motions; None if the walk cannot go on from there."""
        curve, asked, band = self._curve, self.asked, bands[-1]
        assert curve is not None
        if not curve.is_simple(bands, asked.period) and (again or band.period != asked.period):
            return None
        return orbit_near(self.system.at({asked.parameter: band.value}), asked.period, band.state, self._method)

    @property
    def _is_settling(self) -> bool:
        """True if the motion is settled from now on."""
        for moment in reversed(self._moments):
            if moment.orbit is not None or (moment.points and moment is self._moments[0]):
                return False
            if moment.bands or moment.turn is not None:
                return True
        return False

    def _settle(self, interrupts: Sequence[int]) -> Generator[Found, None, End | None]:
        """Settle at further steps, until an orbit can be followed again; return the end, if there is one."""
        curve, bands = self._curve, list[Band]()
        assert curve is not None
        stretches = _stretches(self._moments)
        begun = self._moments[0].points or stretches[1:]  # an orbit was followed before
        for moment in self._moments[stretches[-1] + bool(begun) :]:
            bands += moment.bands
        first, calm, value = _first_end(self._moments), _CALM * len(stretches) if begun else 1, self.asked.end
        while True:
            try:
                if bands:
                    new = curve.after(bands)
                else:
                    points = self._points(stretches[-1])
                    place = max(curve.beyond(point.value) for point in points)
                    new = [curve.at(place, points[-1].orbit.state)] if place < len(curve.values) else []
            except NumericalError as error:
                end = End(
                    EndReason.FAILED, bands[-1].value if bands else self._points(stretches[-1])[-1].value, str(error)
                )
                yield self._kept(Moment((), ends=(first, end)))
                return end
            bands += new
            end = End(EndReason.RANGE, value) if not new or new[-1].value == curve.values[-1] else None
            if end is None and interrupts:
                end = End(EndReason.INTERRUPTED, bands[-1].value)
            moment = Moment((), ends=None if end is None else (first, end), bands=tuple(new))
            yield self._kept(moment, tuple((band, []) for band in new))
            if end is not None:
                return end
            orbit = self._orbit_at(bands[-calm:], again=bool(begun)) if len(bands) >= calm else None
            if orbit is not None:
                self._ready = self._tracer(orbit, None)
                first_point = self._ready.first
                yield self._kept(Moment((first_point,), orbit=orbit), ((first_point, []),))
                return None

    def _kept(self, moment: Moment, news: tuple[Any, ...] = ()) -> Found:
        """Keep a batch, and return it as found."""
        self._moments.append(moment)
        return Found((MOMENT.entry(moment, len(self._moments) - 1),), news)

    def _points(self, place: int) -> list[BranchPoint]:
        """Return the points of the stretch that begins with a batch."""
        own = self._moments[place:]
        more = next((number for number, moment in enumerate(own) if number and moment.orbit is not None), len(own))
        return [point for moment in own[:more] for point in moment.points]

    def _walk(self, interrupts: Sequence[int]) -> Generator[Found, None, End | None]:
        """Walk a stretch; return the end of the response, or None where the motion is settled beyond."""
        place = _stretches(self._moments)[-1]
        orbit = self._moments[place].orbit or self._start
        assert orbit is not None
        own = self._moments[place:]
        tracer, self._ready = self._ready or self._tracer(orbit, _state(own)), None
        _check_scales(own[0], tracer)
        end, first, progress = None, _first_end(self._moments), self._moments[-1].progress
        value = next(moment.points[-1].value for moment in reversed(self._moments) if moment.points)
        watch = None if self._curve is None else _Watch(self._curve, self.asked)
        why = next((words for point, special in _steps(own) if watch and (words := watch.words(point, special))), "")
        self._written = time.monotonic()
        try:
            for point, special_points in () if why else _carefully(tracer, watch):
                value, state = point.value, tracer.state
                self._pending.append((point, special_points))
                progress = Progress(state.walk.step, state.walk.count, state.detector)
                why = watch.words(point, special_points) if watch is not None and tracer.end is None else ""
                if why:
                    break
                last = None if tracer.end is None or self._goes_on(tracer.end) else (first, tracer.end)
                yield self._found(progress, last)
                if interrupts and tracer.end is None:
                    end = End(EndReason.INTERRUPTED, value)
                    break
            end = end or tracer.end
        except NumericalError as error:
            end = End(EndReason.FAILED, value, str(error))
        if why:
            end = End(EndReason.SETTLED, value, why)
        elif end is not None and self._goes_on(end):
            end = End(EndReason.SETTLED, value, end.reason_words)
        if end is not None and end.reason is EndReason.SETTLED:
            yield self._flushed(progress, None, tuple(self._pending[-1:]) if why else (), end)
            return None
        end = end or End(EndReason.STOPPED, value)
        yield self._flushed(progress, (first, end), ())
        return end

    def _goes_on(self, end: End) -> bool:
        """Return True if the motion is settled beyond an end of the walk."""
        return self._curve is not None and end.reason not in (*_ENDS, EndReason.INTERRUPTED, EndReason.POINTS)

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield all points, each with the special points before it."""
        whole = self.record
        for branch in (whole, *whole.beyond):
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
        places, branches = _stretches(moments), list[Branch]()
        for number, place in enumerate(places):
            own = moments[place : places[number + 1] if places[number + 1 :] else len(moments)]
            points = tuple(chain.from_iterable(moment.points for moment in own))
            if not points:  # motions that settle before the first orbit
                continue
            special_points = tuple(chain.from_iterable(moment.special_points for moment in own))
            end = next((moment.turn for moment in own if moment.turn is not None), None)
            if (
                place == places[-1]
                and (last := moments[-1].ends)
                and (end is None or last[-1].reason is not EndReason.RANGE)
            ):
                end = last[-1]
            ends = End(EndReason.START, points[0].value), end or End(EndReason.STOPPED, points[-1].value)
            branches.append(checked(Branch(self.asked.parameter, self.asked.period, points, special_points, ends)))
        bands = tuple(chain.from_iterable(moment.bands for moment in moments))
        if not branches:
            ends = moments[-1].ends or (_first_end(moments), End(EndReason.STOPPED, bands[-1].value))
            return Branch(self.asked.parameter, self.asked.period, (), (), ends, bands, base=self.system)
        return replaced(branches[0], bands=bands, beyond=tuple(branches[1:])) if bands else branches[0]

    def _tracer(self, start: Orbit, state: BranchTracerState | None) -> BranchTracer:
        asked = self.asked
        (direction,) = directions(asked.begin, asked.end)
        beginning = start_branch(start, asked.parameter, asked.end, direction, self._method)
        return BranchTracer(beginning, asked.walk, state)

    def _found(self, progress: Progress, ends: tuple[End, ...] | None) -> Found:
        """Return the last point; if it is time to write a batch, with all points since the last one."""
        news = (self._pending[-1],)
        is_due = len(self._pending) >= _POINTS or time.monotonic() - self._written >= _SECONDS
        return self._flushed(progress, ends, news) if is_due else Found((), news)

    def _flushed(
        self, progress: Progress | None, ends: tuple[End, ...] | None, news: tuple[Any, ...], turn: End | None = None
    ) -> Found:
        points = tuple(point for point, _ in self._pending)
        special_points = tuple(special for _, specials in self._pending for special in specials)
        self._pending, self._written = [], time.monotonic()
        return self._kept(Moment(points, special_points, progress, ends, turn), news)


_TRUSTED = 10.0  # steps of a walk over which a straight line is trusted
_OTHERWISE = 1.5  # change of the separations in a period from which motions part otherwise


class _Watch:
    """Watch over a walk where many gaps may rattle: what settles a step ahead, and how far the walk gets."""

    def __init__(self, curve: SettledCurve, asked: BranchOptions) -> None:
        self.curve, self.asked, self.range = curve, asked, abs(asked.end - asked.begin)
        self.place = -1
        self.known: dict[int, Band] = {}
        #: Of each step that was looked at: whether what settles there has a period, or parts nowhere; its separations.
        self.ahead: list[tuple[bool, float]] = []
        self.last: BranchPoint | None = None
        self.lengths: list[float] = []
        self.special: list[float] = []

    @property
    def is_hard(self) -> bool:
        """True if what settles a step ahead has no period, or parts often, or otherwise than a step before."""
        # a motion of another period than the orbit, as beyond a flip, is none of it: the orbit goes on, unstable
        last = self.ahead[-2:]
        totals = [total for _, total in last]
        return bool(last) and (
            not all(repeats for repeats, _ in last)
            or max(totals) * self.asked.period >= FEW
            or max(totals) - min(totals) >= _OTHERWISE
        )

    def words(self, point: BranchPoint, special_points: Sequence[SpecialPoint]) -> str:
        """Return why the walk is given up at a point; empty if it goes on."""
        curve, is_among, before = self.curve, bool(special_points), self.last
        self.last = point
        if curve.system.structure.state_size > LARGE:
            return f"an orbit with its derivatives costs too much for a state of more than {LARGE} numbers"
        self.lengths.append(point.arclength)
        self.special += [point.arclength] * len(special_points)
        if len(self.special) > _SPECIAL and self.special[-1] - self.special[-_SPECIAL - 1] < _STEPS * _SHORT:
            return "contacts graze in quick succession along the branch"
        if len(self.lengths) > _STEPS and point.arclength - self.lengths[-_STEPS - 1] < _STEPS * _SHORT:
            return f"the steps became shorter than {_SHORT:g} of the range"
        base = curve.beyond(point.value)
        place = base + _LOOK
        if not self.is_hard and place > self.place and place < len(curve.values):
            self.ahead.append(self._seen(place, before, point))
            self.place = place
        if self.is_hard and (base > self.place or is_among or sum(point.orbit.closings) >= FEW):
            return "the motion that settles beyond is not periodic, or contacts separate often in a period"
        return ""

    def _seen(self, place: int, before: BranchPoint | None, point: BranchPoint) -> tuple[bool, float]:
        """Return what settles at a step ahead; it is settled unless the orbit is far from touching or parting there."""
        if before is not None and _stays(before, point, self.curve.values[place]):
            return True, 0.0
        band = self.known.get(place)
        if band is None or band.total:  # what begins farther away may lead to another motion
            self.known = self.curve.ahead(place, point.orbit.state)
            band = self.known[place]
        return bool(band.period) or not band.total, band.total


def _stays(before: BranchPoint, point: BranchPoint, value: float) -> bool:
    """Return True if no contact comes near to a change up to a value, along a straight line through two orbits."""
    orbits = before.orbit, point.orbit
    share = (value - point.value) / (point.value - before.value)
    if any(any(orbit.closings) or not orbit.stable for orbit in orbits) or not 0.0 < share < _TRUSTED:
        return False
    then, now = (
        np.array([min(map(abs, each.values), default=1.0) for each in orbit.turning_depths]) for orbit in orbits
    )
    return bool(np.all(np.abs(now - then) * share < 0.5 * now))


def _carefully(tracer: BranchTracer, watch: _Watch | None) -> Iterator[tuple[BranchPoint, list[SpecialPoint]]]:
    """Yield the steps of a walk, short ones where contacts graze ahead: it costs much to explain many in one."""
    while True:
        if watch is not None and watch.is_hard:
            tracer.walk.step = min(tracer.walk.step, 2.0 * _SHORT)
        if (step := next(tracer, None)) is None:
            return
        yield step


def _steps(moments: Sequence[Moment]) -> Iterator[tuple[BranchPoint, list[SpecialPoint]]]:
    """Yield the points of a stretch, each with the special points before it."""
    for moment in moments:
        rest = list(moment.special_points)
        for point in moment.points:
            before = [special for special in rest if special.point.arclength <= point.arclength]
            del rest[: len(before)]
            yield point, before


def _stretches(moments: Sequence[Moment]) -> list[int]:
    """Return the places of the batches with which stretches begin."""
    return [place for place, moment in enumerate(moments) if not place or moment.orbit is not None]


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
    before = moments[0].bands
    return End(EndReason.START, before[0].value if before else moments[0].points[0].value)


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Note the first Ctrl-C while a branch is walked, so that it stops between two points; raise a second one at once.

    If Ctrl-C already has another handler, or in a thread that is not the main one, nothing is changed.
    """
    noted: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        noted.append(number)
        signal.signal(signal.SIGINT, before)

    before = signal.getsignal(signal.SIGINT)
    in_main = threading.current_thread() is threading.main_thread()
    is_ours = in_main and before in (signal.default_int_handler, end_gently)
    try:
        if is_ours:
            signal.signal(signal.SIGINT, note)
        yield noted
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, before)
