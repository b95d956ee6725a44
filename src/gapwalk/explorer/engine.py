"""The process beside the server that does the jobs: computing never keeps the page waiting."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from typing import Any

from gapwalk.errors import GapwalkError, WorkError
from gapwalk.explorer.news import Progress
from gapwalk.explorer.process_control import ProcessControl, obey_control
from gapwalk.explorer.task import Task, do
from gapwalk.parallel.processes import undisturbed

_PATIENCE = 5.0  # seconds that a job has to end by itself once it is stopped


class Engine:
    """One process that does one task after the other, and keeps its compiled flows in between.

    It dies with this one, however it dies. A stopped task is interrupted as by Ctrl-C: what it has found is stored.
    """

    def __init__(self) -> None:
        self._context = get_context("spawn")
        self._guard = threading.Lock()
        self._process: Any = None
        self._start()

    def do(self, task: Task, hear: Callable[[Progress], object]) -> bool:
        """Do a task; `hear` is called with what is new. Whether it was done to its end, False after `stop`.

        Raises
        ------
        GapwalkError
            What the task raises; a `WorkError` if the process died.
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
            raise WorkError("the process that did this has died; what it had found is in the result file") from None
        finally:
            self._count += 1  # a late `stop` does not concern the next task

    def stop(self) -> None:
        """Interrupt the task that is being done; a process that does not mind is ended."""
        process = self._process
        self.go_on()
        self._signal(signal.SIGINT)
        timer = threading.Timer(_PATIENCE, self._end_if_busy, (process, self._count))
        timer.daemon = True
        timer.start()

    def pause(self) -> None:
        """Hold the process, until `go_on`."""
        self._control.hold()

    def go_on(self) -> None:
        """Let a process that is held go on."""
        self._control.go_on()

    def close(self) -> None:
        """End the process."""
        self._control.close()
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._line.close()

    def _start(self) -> None:
        held, control = self._context.Pipe(duplex=False)
        self._control = ProcessControl(control)
        self._line, far = self._context.Pipe()
        self._count = 0
        self._process = self._context.Process(target=_work, args=(far, held), name="gapwalk-engine")
        with undisturbed():
            self._process.start()
        far.close()
        held.close()

    def _signal(self, which: signal.Signals) -> None:
        if self._process.is_alive():
            with suppress(ProcessLookupError):
                os.kill(self._process.pid, which)

    def _end_if_busy(self, process: Any, count: int) -> None:
        if process is self._process and count == self._count and process.is_alive():
            process.terminate()


def _work(line: Any, held: Any) -> None:
    """What the process does."""
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
