"""Live answers of the model editor, computed in a process of their own, and given up when the text changes.

Of each kind there is first a coarse picture at once, from what the last one has left, and then all of it.
"""

from __future__ import annotations

import _thread
import asyncio
import math
import signal
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from queue import SimpleQueue
from typing import Any

from gapwalk.attractors.basins import BasinShares
from gapwalk.errors import GapwalkError
from gapwalk.explorer.answer_view import share_bars
from gapwalk.explorer.diagram_lines import measure_name
from gapwalk.explorer.progress_stream import SECONDS
from gapwalk.model.model_source import parse_source
from gapwalk.model.system import System
from gapwalk.model.words import measure_words
from gapwalk.parallel.processes import undisturbed
from gapwalk.studies.live_answer import LiveAnswer, Seen
from gapwalk.studies.live_locus import LiveLocus
from gapwalk.studies.live_response import LiveResponse
from gapwalk.studies.live_shares import LiveShares
from gapwalk.studies.study_file import Study, check_studies

KINDS: dict[str, type[LiveAnswer]] = {each.key: each for each in (LiveResponse, LiveLocus, LiveShares)}


@dataclass(frozen=True, slots=True)
class Asked:
    """A text whose live answers are wanted."""

    number: int  #: Number of the request.
    #: text, name, root: The text of the model file, its name, and the folder outside of which no file is read.
    text: str
    name: str = ""
    root: str = ""
    kinds: tuple[str, ...] = (LiveResponse.key,)  #: Kinds of answers.
    at: float | None = None  #: Value of the first parameter for shares.


_GRACE = 2.0  # seconds in which the process must notice that a request is given up; shares of some systems take minutes
_QUIET = 0.4  # seconds without a newer request after which the next kind is computed whole

Known = dict[str, LiveAnswer]
"""The last answer of each kind."""


def answers(asked: Asked, known: Known | None = None) -> Iterator[dict[str, Any]]:
    """Yield the answers for the page: coarse pictures of all, ``coarse``, and each of them whole."""
    known, found = {} if known is None else known, dict[str, System]()
    try:
        studies = check_studies(parse_source(asked.text, asked.name, asked.root))
    except GapwalkError as error:
        yield {"of": LiveResponse.key, "end": str(error), "failed": True}
        return
    for kind in asked.kinds:
        yield from _guarded(kind, _begun(kind, asked, studies, known, found))
    yield {"coarse": True}
    for kind, system in found.items():
        yield from _guarded(kind, _whole(known[kind], system))


def _begun(
    kind: str, asked: Asked, studies: Sequence[Study], known: Known, found: dict[str, System]
) -> Iterator[dict[str, Any]]:
    """Yield the title of an answer, and a coarse picture if the last one can be used."""
    live, system = KINDS[kind].of(studies, asked.at)
    last, known[kind] = known.get(kind), live
    if last is not None and last.about == live.about:
        last.renew(live)
        known[kind] = last
    found[kind] = system
    title = known[kind].title
    if "axes" in title:
        title = {**title, "axes": [title["axes"][0], measure_name(title["axes"][1], system)]}
    yield {"title": title}
    if (seen := known[kind].coarse(system)) is not None:
        yield {"moved": _plain(seen)}


def _whole(live: LiveAnswer, system: System) -> Iterator[dict[str, Any]]:
    """Yield pictures of an answer together, at most four times a second; then why it is not whole."""
    more: dict[str, list[Any]] = {}
    last = time.monotonic()
    for seen in live.rest(system):
        for name, values in ({} if seen is None else _plain(seen)).items():
            more.setdefault(name, []).extend(values)
        due = time.monotonic() - last >= SECONDS
        yield more if due else {}
        if due:
            more, last = {}, time.monotonic()
    yield {**more, "end": live.end}


def _guarded(kind: str, news: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield news of one kind; errors as a sentence."""
    try:
        for each in news:
            yield {"of": kind, **each} if each else {}
    except GapwalkError as error:
        yield {"of": kind, "end": str(error), "failed": True}
    except Exception as error:  # a page cannot show a traceback
        words = f"this is a bug in gapwalk, please report it: {type(error).__name__}: {error}"
        yield {"of": kind, "end": words, "failed": True}


def _plain(seen: Any) -> dict[str, list[Any]]:
    """Return what the page draws as JSON values."""
    if isinstance(seen, BasinShares):
        bars = share_bars(seen)
        coordinate = seen.system.coordinates[0]
        words = measure_words(f"half.{coordinate}", seen.system.units).replace(" (half the peak to peak)", "")
        for bar, attractor in zip(bars, seen.attractors, strict=False):  # which of those of one kind it is
            if attractor.orbit is not None:
                bar["name"] += f", {words} {attractor.orbit.measure(f'half.{coordinate}'):.3g}"
        return {"bars": bars, "starts": [len(seen.labels)]}
    assert isinstance(seen, Seen)
    found = {"x": seen.x, "y": seen.y, "looks": seen.looks, "marks": seen.marks}
    return {name: [_finite(each) for each in values] for name, values in found.items() if values}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


class _Requests:
    """The requests that come while the process computes; a newer one ends what cannot look for it, as Ctrl-C would."""

    def __init__(self, line: Any) -> None:
        self._line, self._all, self._newer = line, SimpleQueue[Any](), threading.Event()
        self.ends_work = False
        signal.signal(signal.SIGINT, self._end)
        threading.Thread(target=self._read, name="gapwalk-live-requests", daemon=True).start()

    def next(self) -> Any:
        """Wait for a request, and return the newest; None once the server has ended, whose end of the pipe closes."""
        found = self._all.get()
        self._newer.clear()
        while not self._all.empty():
            found = self._all.get()
        return found

    def is_newer(self, seconds: float) -> bool:
        """Return True as soon as there is a newer request, False if none comes within a time."""
        return self._newer.wait(seconds)

    def _read(self) -> None:
        asked: Any = 0
        while asked is not None:
            try:
                asked = self._line.recv()
            except (EOFError, OSError):
                asked = None
            self._all.put(asked)
            self._newer.set()
            if self.ends_work:
                _thread.interrupt_main()

    def _end(self, *_: object) -> None:
        if self.ends_work and self._newer.is_set():
            self.ends_work = False
            raise KeyboardInterrupt


def work(line: Any) -> None:
    """Answer what is asked for, one after the other: the main function of the process."""
    known: Known = {}
    requests = _Requests(line)
    with suppress(OSError):
        while (asked := requests.next()) is not None:
            if not isinstance(asked, Asked):
                line.send((asked, None))
                continue
            line.send((asked.number - 1, None))  # those before are left
            with suppress(KeyboardInterrupt):
                try:
                    _answer(line, asked, known, requests)
                finally:
                    requests.ends_work = False
            line.send((asked.number, None))


def _answer(line: Any, asked: Asked, known: Known, requests: _Requests) -> None:
    """Answer a request until there is a newer one: it is looked for after each point, and ends the work on shares."""
    for news in answers(asked, known):
        requests.ends_work = False
        if news:
            line.send((asked.number, news))
        is_next_long = "end" in news and news["of"] != asked.kinds[-1]
        if requests.is_newer(_QUIET if is_next_long else 0.0):
            return
        requests.ends_work = asked.kinds[-1] == LiveShares.key and (is_next_long or "coarse" in news)


class LiveAnswers:
    """The process that computes, and the requests of pages; one at a time, and none that nobody waits for."""

    def __init__(self) -> None:
        self._context = get_context("spawn")
        self._process: Any = None
        self._line: Any = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._number = self._done = 0  # of the last request, and of the last one that the process has left
        self._asked: Asked | None = None
        self._waiting: dict[int, asyncio.Queue[dict[str, Any] | None]] = {}
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

    async def of(
        self, text: str, name: str, root: str, kinds: tuple[str, ...] = (LiveResponse.key,), at: float | None = None
    ) -> AsyncIterator[dict[str, Any]]:
        """Yield the answers to a text as they grow (see `answers`); they are given up when this is closed."""
        async with self._turn:
            await asyncio.to_thread(self.warm)
            self._number += 1
            number, is_done = self._number, False
            queue = self._waiting[number] = asyncio.Queue()
            self._loop = asyncio.get_running_loop()
            try:
                self._asked = Asked(number, text, name, root, kinds, at)
                self._send(self._asked)
                while (news := await queue.get()) is not None:
                    yield news
                is_done = True
            finally:
                del self._waiting[number]
                self._asked = None
                if not is_done:
                    self._send(number)  # nobody waits for the rest
                    threading.Timer(_GRACE, self._give_up, [number]).start()

    def _give_up(self, number: int) -> None:
        """End the process if it is still busy with a request that nobody waits for; a new one answers the next."""
        if self._done < number and self._process is not None:
            self.close()
            self.warm()
            if self._asked is not None:
                self._send(self._asked)

    def close(self) -> None:
        """End the process."""
        with self._guard:
            if self._process is not None:
                process, line, self._process, self._line = self._process, self._line, None, None
                process.kill()  # it stores nothing
                process.join()
                line.close()

    def _send(self, asked: Asked | int) -> None:
        with suppress(OSError, AttributeError):  # it has died, and `_read` has said so; or another one begins
            self._line.send(asked)

    def _read(self, line: Any) -> None:
        """Hand out what the process sends, until it ends."""
        try:
            while True:
                number, news = line.recv()
                if news is None:
                    self._done = number
                self._call(number, news)
        except (EOFError, OSError):
            died = "the process that computes the response has died; change the text to try again"
            for number in list(self._waiting) if line is self._line else ():
                self._call(number, {"of": LiveResponse.key, "end": died, "failed": True})
                self._call(number, None)

    def _call(self, number: int, news: dict[str, Any] | None) -> None:
        assert self._loop is not None  # a request has set it
        with suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._hand_out, number, news)

    def _hand_out(self, number: int, news: dict[str, Any] | None) -> None:
        if number in self._waiting:
            self._waiting[number].put_nowait(news)
