"""Jobs: the queue, and the thread that gives them to the process that computes; they continue without a page."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.exploration import Entry, Exploration, State
from gapwalk.explorer.progress_stream import Progress
from gapwalk.explorer.tasks import Task

_MOST = 50  # waiting jobs


class Jobs:
    """The queue of jobs, and the thread that gives them to the process."""

    def __init__(self, changed: Callable[[], object], engine: Engine | None = None) -> None:
        self._changed = changed
        self._queue: queue.Queue[tuple[Exploration, Entry, Task] | None] = queue.Queue()
        self._guard = threading.Lock()
        self._current: Entry | None = None
        self._engine = engine or Engine()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="gapwalk-jobs", daemon=True)
        self._thread.start()

    def add(self, exploration: Exploration, entry: Entry, task: Task) -> None:
        """Put a job at the end of the queue."""
        if self._queue.qsize() >= _MOST:
            raise ModelError(f"{_MOST} jobs are waiting already; stop some of them, or wait")
        entry.state = State.QUEUED
        self._queue.put((exploration, entry, task))
        self._changed()

    def stop(self, entry: Entry) -> None:
        """Stop a job: a waiting one does not begin, and the results of a running one are kept."""
        with self._guard:
            if entry is self._current:
                self._engine.stop()
            elif entry.state is State.QUEUED:
                entry.change(state=State.STOPPED, message="it was stopped before it began")
        self._changed()

    def pause(self, entry: Entry) -> None:
        """Pause the running job."""
        self._change(entry, State.RUNNING, State.PAUSED, self._engine.pause)

    def resume(self, entry: Entry) -> None:
        """Resume a paused job."""
        self._change(entry, State.PAUSED, State.RUNNING, self._engine.resume)

    def close(self) -> None:
        """Stop all jobs; results so far are stored."""
        self._closing = True
        self._queue.put(None)
        with self._guard:
            if self._current is not None:
                self._engine.stop()
        self._thread.join(10.0)
        self._engine.close()

    def _change(self, entry: Entry, before: State, after: State, act: Callable[[], None]) -> None:
        with self._guard:
            if entry is not self._current or entry.state is not before:
                raise ModelError(f"{entry.title} is {entry.state}, not {before}")
            act()
            entry.change(state=after)
        self._changed()

    def _work(self) -> None:
        while (item := self._queue.get()) is not None:
            exploration, entry, task = item
            with self._guard:
                if self._closing or entry.state is not State.QUEUED:
                    continue
                self._current = entry
                entry.change(state=State.RUNNING)
            self._changed()

            def hear(news: Progress, exploration: Exploration = exploration, entry: Entry = entry) -> None:
                with exploration.guard:
                    entry.live.add(news)
                    entry.change()
                self._changed()

            message = ""
            try:
                state = State.DONE if self._engine.do(task, hear) else State.STOPPED
            except GapwalkError as error:
                state, message = State.FAILED, str(error)
            with self._guard:
                self._current = None
            entry.message = message
            exploration.read(entry)
            entry.change(state=state)
            self._changed()
