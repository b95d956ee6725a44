"""The jobs of a server: one after the other in the engine, each with a result of its own; they outlive the page."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.exploration import Exploration
from gapwalk.explorer.news import Progress
from gapwalk.explorer.page_result import Entry, State
from gapwalk.explorer.task import Task

_MOST = 50  # jobs that wait


class Jobs:
    """The queue of jobs, and the thread that hands them to the engine.

    Parameters
    ----------
    changed
        Called, from any thread, when an entry has changed.
    """

    def __init__(self, changed: Callable[[], object]) -> None:
        self._changed = changed
        self._queue: queue.Queue[tuple[Exploration, Entry, Task] | None] = queue.Queue()
        self._guard = threading.Lock()
        self._current: Entry | None = None
        self._engine = Engine()
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
        """Stop a job: one that waits is not begun, one that is done keeps what it has found."""
        with self._guard:
            if entry is self._current:
                self._engine.stop()
            elif entry.state is State.QUEUED:
                entry.state, entry.message = State.STOPPED, "it was stopped before it began"
                entry.version += 1
        self._changed()

    def pause(self, entry: Entry) -> None:
        """Hold the job that is being done."""
        self._hold(entry, State.RUNNING, State.PAUSED, self._engine.pause)

    def go_on(self, entry: Entry) -> None:
        """Let a job that is held go on."""
        self._hold(entry, State.PAUSED, State.RUNNING, self._engine.go_on)

    def close(self) -> None:
        """Stop everything; what has been found is stored."""
        self._closing = True
        self._queue.put(None)
        with self._guard:
            if self._current is not None:
                self._engine.stop()
        self._thread.join(10.0)
        self._engine.close()

    def _hold(self, entry: Entry, before: State, after: State, act: Callable[[], None]) -> None:
        with self._guard:
            if entry is not self._current or entry.state is not before:
                raise ModelError(f"{entry.title} is {entry.state}, not {before}")
            act()
            entry.state = after
            entry.version += 1
        self._changed()

    def _work(self) -> None:
        while (item := self._queue.get()) is not None:
            exploration, entry, task = item
            with self._guard:
                if self._closing or entry.state is not State.QUEUED:
                    continue
                self._current, entry.state = entry, State.RUNNING
                entry.version += 1
            self._changed()
            state, message = self._do(exploration, entry, task)
            with self._guard:
                self._current = None
            entry.message = message
            exploration.read(entry)
            entry.state = state
            entry.version += 1
            self._changed()

    def _do(self, exploration: Exploration, entry: Entry, task: Task) -> tuple[State, str]:
        def hear(news: Progress) -> None:
            with exploration.guard:
                entry.hear(news)
            self._changed()

        try:
            complete = self._engine.do(task, hear)
        except GapwalkError as error:
            return State.FAILED, str(error)
        return (State.DONE, "") if complete else (State.STOPPED, "")
