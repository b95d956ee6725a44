"""The live response of the model editor: a quick walk in a process of its own, given up when the text changes.

The walk is by harmonic balance to a hundredth, from the static equilibrium, with long steps and without special points.
It needs no compiled flow, so a changed structure costs no more than a changed number. What harmonic balance does not
describe (rigid stops, some friction) is walked by shooting. Where a number alone has changed, the points of the last
walk are first moved to the new curve: a picture for each step of a slider. Where the walk cannot go on, as among many
grazes or after it has turned back at a fold, settled motions are computed by equal steps to the end of the range.
"""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from gapwalk.answers.settled_curve import SettledCurve
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation import directions, start_branch
from gapwalk.bifurcation.band import Band
from gapwalk.bifurcation.moved_curve import MOVED, marks, moved
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, Walk, WalkOptions
from gapwalk.errors import ConvergenceError, GapwalkError, ModelError, NumericalError
from gapwalk.explorer.diagram_lines import measure_name
from gapwalk.explorer.progress_stream import SECONDS
from gapwalk.model.equilibria import find_equilibria
from gapwalk.model.model_source import parse_source
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_words
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.orbit.orbit_equation import solve
from gapwalk.orbit.shooting import Shooting
from gapwalk.parallel.processes import undisturbed
from gapwalk.studies.options import BranchOptions, RangeStudy
from gapwalk.studies.study_file import Study, check_studies

BALANCE = Balance(error=0.01)
"""Harmonics up to a hundredth of the motion: less than the width of a line on the page."""
SHOOTING = Shooting(tolerance=1e-6)
STEPS = WalkOptions(initial_step=0.01, largest_step=0.02, largest_turn=0.3, max_points=1000)
_KEPT = 0.75  # share of the points wanted of which a moved curve is moved again
_LONGEST = 15.0  # seconds of CPU time that a response may take, half of which are for its walk
_BEHIND = 250  # points that a walk may stay behind the furthest value: more are folds that nobody sees at this width
_LABELS = ("stable", "below", "above", "pair", "neutral")
_SETTLED = len(_LABELS)
_LEVEL = {"min": 0, "max": 2}  # of least, middle and largest height
_ENDS = (EndReason.RANGE, EndReason.TABLE, EndReason.CLOSED)


@dataclass(frozen=True, slots=True)
class Asked:
    """A text whose response is wanted."""

    number: int  #: Number of the request.
    #: text, name, root: The text of the model file, its name, and the folder outside of which no file is read.
    text: str
    name: str = ""
    root: str = ""


@dataclass(slots=True)
class Walked:
    """The last walk, whose points are moved to the curve of a text with other numbers."""

    about: tuple[Any, ...] = ()  #: The parts of the system, what is walked, over which range, and what is shown.
    corrector: Corrector | None = None
    points: tuple[BranchPoint, ...] = ()

    def moved(self, about: tuple[Any, ...], system: System, given: str) -> Iterator[dict[str, Any]]:
        """Yield the moved points of a walk that was about the same, all at once, with what happens between them."""
        if self.corrector is None or self.about != about:
            return
        points = moved(self.corrector, self.points, system)
        if len(points) > _KEPT * min(len(self.points), MOVED):  # the next ones are moved from here
            self.points = tuple(points)
        if len(points) > 1:
            shown = [(each.value, each.measure(given), _LABELS.index(each.instability.label)) for each in points]
            found = dict(zip(("x", "y", "label"), map(list, zip(*shown, strict=True)), strict=True))
            yield {"moved": {**found, "marks": _marks(points, self.corrector, given)}}


def _marks(points: Sequence[BranchPoint], corrector: Corrector, given: str) -> list[tuple[str, float, float]]:
    found = marks(points, float(corrector.scales[-1]))
    return [(each.kind.value, each.value, each.measure(given)) for each in found]


def response(asked: Asked, last: Walked | None = None) -> Iterator[dict[str, Any]]:
    """Walk the response of a text quickly, after its points by those of the last walk, which this one replaces."""
    last = last or Walked()
    study = _shown(check_studies(parse_source(asked.text, asked.name, asked.root)))
    options = study.options
    assert isinstance(options, RangeStudy)
    system = options.first_system(study.system)
    given = shown_measure(system, options)
    titles = {"across": parameter_words(options.parameter, system.units), "up": measure_words(given, system.units)}
    axes = [options.parameter, measure_name(given, system)]
    yield {**titles, "range": [options.begin, options.end], "axes": axes}
    period = options.period if isinstance(options, BranchOptions) else 1
    about = system.structure, options.parameter, options.begin, options.end, given, period
    yield from last.moved(about, system, given)
    until, end, walked = time.process_time() + _LONGEST, "", Walked(about)
    for point in _walk(system, options, period, until - _LONGEST / 2, walked):
        if isinstance(point, str):
            end = point
        elif not isinstance(point, Band):
            yield {"x": point.value, "y": point.measure(given), "label": _LABELS.index(point.instability.label)}
        elif shown := point.shown(system, given):
            yield {"x": point.value, "y": shown[_LEVEL.get(given.partition(".")[0], 1)], "label": _SETTLED}
        if time.process_time() > until:
            end = f"stopped after {_LONGEST:g} s of work; Compute walks all of it"
            break
    last.about, last.corrector, last.points = about, walked.corrector, walked.points
    found = _marks(walked.points, walked.corrector, given) if walked.corrector else []
    yield {"marks": found, "end": end}


def _shown(studies: tuple[Study, ...]) -> Study:
    """Return the study whose range is walked: the first over the pace of the excitation, else over anything."""
    ranges = [each for each in studies if isinstance(each.options, RangeStudy)]
    if not ranges:
        raise ModelError('no study has a range; write one of kind = "response", with parameter, from and to')
    return next((each for each in ranges if _parameter(each) == each.system.structure.pace), ranges[0])


def _parameter(study: Study) -> str:
    assert isinstance(study.options, RangeStudy)
    return study.options.parameter


def _walk(
    system: System, options: RangeStudy, period: int, until: float, walked: Walked
) -> Iterator[BranchPoint | Band | str]:
    """Yield the points of the walk, what settles where it gives up, and why it ended before its range did."""
    try:
        start, method = _first(system, options, period)
    except NumericalError:
        yield from _settled(system, options)
        return
    (direction,) = directions(options.begin, options.end)
    beginning = start_branch(start, options.parameter, options.end, direction, method)
    walk = Walk(beginning.first, beginning.within, beginning.corrector, STEPS)
    furthest, behind = beginning.first, 0
    walked.corrector, walked.points = beginning.corrector, (beginning.first,)
    yield furthest
    for point in walk:
        walked.points += (point,)
        yield point
        is_further = direction * (point.value - furthest.value) > 0.0
        furthest, behind = (point, 0) if is_further else (furthest, behind + 1)
        if behind > _BEHIND or time.process_time() > until:
            break
    words = "the walk was given up" if walk.end is None else walk.end.reason_words
    if walk.end is not None and walk.end.reason in _ENDS:
        yield words * (walk.end.reason is not EndReason.RANGE)
        return
    try:
        yield from _settled(system, options, furthest)
    except GapwalkError:  # what does not settle here either
        yield words


def _settled(system: System, options: RangeStudy, last: BranchPoint | None = None) -> Iterator[Band]:
    """Yield what settles at the steps of the range, those beyond the last point of a walk if there is one."""
    curve = SettledCurve(system, options.parameter, (options.begin, options.end))
    place = 0 if last is None else curve.beyond(last.value)
    bands = [curve.at(place, None if last is None else last.orbit.state)] if place < len(curve.values) else []
    while bands:
        yield from bands
        bands = curve.after(bands) if curve.beyond(bands[-1].value) < len(curve.values) else []


def _first(system: System, options: RangeStudy, period: int) -> tuple[Orbit, Method]:
    """Return the first motion, and the method that has found it; a NumericalError if what settles is not periodic."""
    with suppress(ModelError, NumericalError):
        equation = BALANCE.pose(system, None, period)
        while equation is not None:
            rests = find_equilibria(system).equilibria
            if not rests:  # teeth that do not yield hold nothing in place
                break
            guess = equation.rest(rests[0].position)
            unknowns, evaluation = solve(equation, guess, 0.0)
            orbit = equation.orbit(unknowns, 0.0, evaluation)
            if not equation.inaccuracy(orbit):
                return orbit, BALANCE
            equation = equation.finer()
    curve, start = SettledCurve.of(system, options.parameter, (options.begin, options.end)), "settle"
    if curve is not None:  # where many gaps rattle, to look for an orbit that is not there takes minutes
        band = curve.at(0)
        if band.period != period:
            raise ConvergenceError(f"the motion that settles does not have the period {period}")
        start = band.state
    return find_orbit(system, period, start, method=SHOOTING), SHOOTING


def answers(asked: Asked, walked: Walked | None = None) -> Iterator[dict[str, Any]]:
    """Yield the response for the page: points together, at most four times a second; errors as a sentence."""
    points: dict[str, list[float]] = {"x": [], "y": [], "label": []}
    last = time.monotonic()
    try:
        for each in response(asked, walked):
            if "x" not in each:
                yield {**each, **(points if "end" in each else {})}
                continue
            for name, values in points.items():
                values.append(each[name])
            due = time.monotonic() - last >= SECONDS
            yield points if due else {}
            if due:
                points, last = {"x": [], "y": [], "label": []}, time.monotonic()
    except GapwalkError as error:
        yield {**points, "end": str(error), "failed": True}
    except Exception as error:  # a page cannot show a traceback
        yield {"end": f"this is a bug in gapwalk, please report it: {type(error).__name__}: {error}", "failed": True}


def work(line: Any) -> None:
    """Walk what is asked for, one after the other: the main function of the process."""
    # It looks for a newer request after each point, and ends with its server, whose end of the pipe then closes.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    walked = Walked()
    with suppress(EOFError, OSError):
        while True:
            asked = line.recv()
            while line.poll():
                asked = line.recv()
            for news in answers(asked, walked) if isinstance(asked, Asked) else ():
                if news:
                    line.send((asked.number, news))
                if line.poll():
                    break


class LiveResponses:
    """The process that walks, and the requests of pages; one walk at a time, and none that nobody waits for."""

    def __init__(self) -> None:
        self._context = get_context("spawn")
        self._process: Any = None
        self._line: Any = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._number = 0
        self._waiting: dict[int, asyncio.Queue[dict[str, Any]]] = {}
        self._turn = asyncio.Lock()
        self._guard = threading.Lock()

    def warm(self) -> None:
        """Start the process, so that it has loaded its code when the first text is there."""
        with self._guard:
            if self._process is not None and self._process.is_alive():
                return
            self._line, far = self._context.Pipe()
            self._process = self._context.Process(target=work, args=(far,), name="gapwalk-live", daemon=True)
            with undisturbed():
                self._process.start()
            far.close()
            threading.Thread(target=self._read, args=(self._line,), name="gapwalk-live", daemon=True).start()

    def warm_behind(self) -> None:
        """Do so without waiting for it."""
        threading.Thread(target=self.warm, name="gapwalk-live-start", daemon=True).start()

    async def of(self, text: str, name: str, root: str) -> AsyncIterator[dict[str, Any]]:
        """Yield the response of a text as it grows (see `answers`); the walk is given up when this is closed."""
        async with self._turn:
            await asyncio.to_thread(self.warm)
            self._number += 1
            number, news = self._number, dict[str, Any]()
            queue = self._waiting[number] = asyncio.Queue()
            self._loop = asyncio.get_running_loop()
            try:
                self._send(Asked(number, text, name, root))
                while "end" not in news:
                    news = await queue.get()
                    yield news
            finally:
                del self._waiting[number]
                if "end" not in news:
                    self._send(None)  # nobody waits for the rest

    def close(self) -> None:
        """End the process."""
        with self._guard:
            if self._process is not None:
                self._process.kill()  # it stores nothing
                self._process.join()
                self._line.close()

    def _send(self, asked: Asked | None) -> None:
        with suppress(OSError):  # it has died, and `_read` has said so
            self._line.send(asked)

    def _read(self, line: Any) -> None:
        """Hand out what the process sends, until it ends."""
        try:
            while True:
                number, news = line.recv()
                self._call(number, news)
        except (EOFError, OSError):
            died = "the process that computes the response has died; change the text to try again"
            for number in list(self._waiting):
                self._call(number, {"end": died, "failed": True})

    def _call(self, number: int, news: dict[str, Any]) -> None:
        assert self._loop is not None  # a request has set it
        with suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._hand_out, number, news)

    def _hand_out(self, number: int, news: dict[str, Any]) -> None:
        if number in self._waiting:
            self._waiting[number].put_nowait(news)
