"""Jobs: the queue, and the process that does one task after the other; they continue when the page is closed.

The process computes, so that the server can always answer the page. It is paused and ended through a control pipe. A
process that the system has stopped (SIGSTOP) would not notice the end of the server, and would stay forever. So it is
paused in another way: its main thread waits, while another thread watches the pipe.
"""

from __future__ import annotations

import os
import queue
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from typing import Any

from gapwalk.errors import GapwalkError, ModelError, WorkError
from gapwalk.explorer.exploration import Entry, Exploration, State
from gapwalk.explorer.progress_stream import Progress
from gapwalk.explorer.tasks import Task, do
from gapwalk.parallel.processes import undisturbed


def obey_control(held: Any) -> None:
    """Pause, resume and end as the control pipe says; to be called in the main thread of the process.

    Parameters
    ----------
    held
        The readable end of the pipe.
    """
    free = threading.Event()
    free.set()

    def wait_until_free(number: int, frame: object) -> None:
        free.wait()

    def watch() -> None:
        main = threading.main_thread().ident
        assert main is not None
        try:
            while True:
                if held.recv() == "pause":
                    free.clear()
                    signal.pthread_kill(main, signal.SIGUSR1)
                else:
                    free.set()
        except (EOFError, OSError):
            os._exit(1)

    signal.signal(signal.SIGUSR1, wait_until_free)
    threading.Thread(target=watch, daemon=True).start()


_PATIENCE = 5.0  # seconds that a job has to end by itself once it is stopped


class Engine:
    """One process that does one task after the other, and keeps its compiled equations of motion in between.

    It ends with the server, also when the server is killed. A stopped task is interrupted as by Ctrl-C: what it has
    found is stored.
    """

    def __init__(self) -> None:
        self._context = get_context("spawn")
        self._guard = threading.Lock()
        self._process: Any = None
        self._start()

    def do(self, task: Task, hear: Callable[[Progress], object]) -> bool:
        """Do a task and call `hear` with its progress; return True if it was completed, False after `stop`.

        Raises
        ------
        GapwalkError
            The error of the task; a `WorkError` if the process died.
        """
        with self._guard:
            if not self._process.is_alive():
                self._start()
            self._line.send(task)
        try:
            while True:
                word, content = self._line.recv()
                if word == "news":
                    hear(content)
                elif word == "failed":
                    raise content
                else:
                    return content
        except (EOFError, ConnectionError):
            self._process.join(1.0)
            raise WorkError("the process that computed this has died; what it found is in the result file") from None
        finally:
            self._count += 1  # a late `stop` must not interrupt the next task

    def stop(self) -> None:
        """Interrupt the current task; end the process if it does not react."""
        process = self._process
        self.resume()
        if process.is_alive():
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGINT)
        timer = threading.Timer(_PATIENCE, self._end_if_busy, (process, self._count))
        timer.daemon = True
        timer.start()

    def pause(self) -> None:
        """Pause the process until `resume`."""
        self._say("pause")

    def resume(self) -> None:
        """Resume the process; nothing happens if it is not paused."""
        self._say("resume")

    def close(self) -> None:
        """End the process."""
        self._control.close()
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._line.close()

    def _start(self) -> None:
        held, self._control = self._context.Pipe(duplex=False)
        self._line, far = self._context.Pipe()
        self._count = 0
        self._process = self._context.Process(target=_work, args=(far, held), name="gapwalk-engine")
        with undisturbed():
            self._process.start()
        far.close()
        held.close()

    def _say(self, word: str) -> None:
        with suppress(OSError):  # the process has died
            self._control.send(word)

    def _end_if_busy(self, process: Any, count: int) -> None:
        if process is self._process and count == self._count and process.is_alive():
            process.terminate()


def _work(line: Any, held: Any) -> None:
    """Do tasks, one after the other: the main function of the process."""
    obey_control(held)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    while True:
        try:
            task = line.recv()
        except KeyboardInterrupt:  # the task had ended just before it was stopped
            continue
        except (EOFError, OSError):
            return
        answer = _answer(task, line)
        with suppress(OSError):
            line.send(answer)


def _answer(task: Task, line: Any) -> tuple[str, Any]:
    try:
        return "done", do(task, lambda progress: line.send(("news", progress)))
    except KeyboardInterrupt:
        return "done", False
    except GapwalkError as error:
        return "failed", type(error)(*error.args)
    except Exception as error:  # a page cannot show a traceback
        return "failed", WorkError(f"this is a bug in gapwalk, please report it: {type(error).__name__}: {error}")


_MOST = 50  # waiting jobs


class Jobs:
    """The queue of jobs, and the thread that gives them to the process.

    Parameters
    ----------
    changed
        Function that is called, from any thread, when a result has changed.
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
        """Stop a job: a waiting one does not begin, a running one keeps what it has found."""
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
        """Stop all jobs; what has been found is stored."""
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
