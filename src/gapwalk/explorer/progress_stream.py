"""Progress of jobs, and the pages that receive it as server-sent events, at most four per second."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from gapwalk.bifurcation.band import Band
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch
from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusPoint
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.parallel.workers import Pace
from gapwalk.studies.bifurcation_map import Map, MapSection

SECONDS = 0.25
"""Time between two reports of progress; more reports would only cost time in the page."""


Step = tuple[BranchPoint | LocusPoint, Sequence[SpecialPoint | Codim2Point]]
"""A point, and the special points before it."""


@dataclass
class Progress:
    """Progress since the last report."""

    #: Points of the branch or the locus in progress, each with the special points before it.
    steps: list[Step] = field(default_factory=list)
    #: kind, second: Kind of the locus in progress, and its second parameter; None and empty for a branch.
    kind: Kind | None = None
    second: str = ""
    #: Finished branches and loci with their names.
    finished: list[tuple[str, Branch | Locus]] = field(default_factory=list)
    #: done, total: Finished parts of work without branches, such as a search, and all parts.
    done: int = 0
    total: int = 0
    #: share, words: Share of that work that is done; what it does, and the best that it has found.
    share: float = 0.0
    words: str = ""

    @property
    def is_drawn(self) -> bool:
        """True if it has branches or loci, which are drawn from it."""
        return bool(self.steps or self.finished)

    def add(self, more: Progress) -> None:
        """Add later progress."""
        self.steps += more.steps
        self.finished += more.finished
        self.kind, self.second = more.kind or self.kind, more.second or self.second
        if more.total:
            self.done, self.total = more.done, more.total
        self.share, self.words = max(self.share, more.share), more.words or self.words


class News:
    """Collector of progress, which reports it from time to time."""

    def __init__(self, report: Callable[[Progress], object], asked: Any = None) -> None:
        self._report, self._progress, self._reported = report, Progress(), 0.0
        self._asked, self._parts, self._pace, self._share = asked, list[Any](), Pace(0, 0), 0.0
        self._guard, self._over, self._watcher = threading.RLock(), threading.Event(), None

    def point(self, point: BranchPoint | LocusPoint | Band, special_points: list[Any]) -> None:
        """Add a new point of the branch or locus in progress, and the special points before it."""
        if not isinstance(point, Band):  # it is shown at the end, as a band
            self._progress.steps.append((point, special_points))
        self._report_if_due()

    def locus(self, kind: Kind, second: str) -> None:
        """Announce that the next points are those of a locus."""
        self._progress.kind, self._progress.second = kind, second

    def member(self, diagram: Diagram, member: DiagramBranch) -> None:
        """Add a new branch of a diagram."""
        self._progress.finished.append((member.name, member.branch))
        self._report_if_due()

    def chart(self, chart: Map, addition: MapSection | Locus) -> None:
        """Add a new section or a new locus of a map."""
        if isinstance(addition, Locus):
            self._progress.finished.append((chart.names[-1], addition))
        else:
            number = len(chart.sections)
            self._progress.finished += [(f"S{number}-{name}", branch) for name, branch in addition.named]
        self._report_if_due()

    def begin(self, pace: Pace, within: Callable[[], float]) -> None:
        """Tell how many parts of work without branches there are, and look at the share of those in progress."""
        self(pace)
        self._watcher = threading.Thread(target=self._watch, args=(within,), daemon=True)
        self._watcher.start()

    def _watch(self, within: Callable[[], float]) -> None:
        while not self._over.wait(_LOOK):
            with self._guard:
                share = replace(self._pace, within=within()).share
                if (
                    share >= self._share + _SHARE or self._progress.total
                ):  # a part may have been done just after a report
                    self._share = self._progress.share = max(self._share, share)
                    self.report()

    def __call__(self, *about: Any) -> None:
        """Add a part of work without branches; the last argument is its pace."""
        with self._guard:
            self._parts += about[:-1]
            self._pace = pace = about[-1]
            self._progress.done, self._progress.total = pace.done, pace.total
            self._share = self._progress.share = max(self._share, pace.share)
            self._progress.words = "" if self._asked is None else self._asked.words_so_far(self._parts, pace.total)
            self._report_if_due()

    def close(self) -> None:
        """Report what is left, for the last time."""
        self._over.set()
        if self._watcher is not None:
            self._watcher.join()
        self.report()

    def report(self) -> None:
        """Report now."""
        with self._guard:
            progress, self._progress, self._reported = self._progress, Progress(), time.monotonic()
            self._report(progress)

    def _report_if_due(self) -> None:
        if time.monotonic() - self._reported >= SECONDS:
            self.report()


_SHARE = 0.01  # growth of a share that is reported
_PAGES = 16  # connected at the same time
_LOOK = 1.0  # seconds between two checks of the files, which other programs may change
_ALIVE = 15.0  # seconds after which something is sent in any case, to notice a closed page


class Events:
    """The connected pages."""

    def __init__(self, state: Callable[[], Any]) -> None:
        self._state = state
        self._loop: asyncio.AbstractEventLoop | None = None
        self._pages: set[asyncio.Event] = set()
        self.closing = False

    def changed(self) -> None:
        """Announce a change; may be called from any thread."""
        loop = self._loop
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._wake)

    def join(self) -> asyncio.Event:
        """Reserve a connection for one more page, at once: pages that connect together do not exceed the limit."""
        if len(self._pages) >= _PAGES:
            raise ModelError(f"{_PAGES} pages are open on this server; close some of them")
        self._loop = asyncio.get_running_loop()
        page = asyncio.Event()
        self._pages.add(page)
        return page

    def leave(self, page: asyncio.Event) -> None:
        """Give back the place of a page."""
        self._pages.discard(page)

    async def listen(self, page: asyncio.Event) -> AsyncIterator[str]:
        """Yield the events for one page until it is closed."""
        sent, sent_at = None, 0.0
        while not self.closing:
            state = json.dumps(await asyncio.to_thread(self._state))
            if state != sent:
                yield f"data: {state}\n\n"
                sent, sent_at = state, time.monotonic()
            elif time.monotonic() - sent_at > _ALIVE:
                yield ": alive\n\n"
                sent_at = time.monotonic()
            await asyncio.sleep(SECONDS)
            with suppress(TimeoutError):
                await asyncio.wait_for(page.wait(), _LOOK)
            page.clear()

    def close(self) -> None:
        """Close the streams of all pages."""
        self.closing = True
        self.changed()

    def _wake(self) -> None:
        for news in self._pages:
            news.set()
