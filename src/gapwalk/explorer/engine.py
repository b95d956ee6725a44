"""The process that does the explorer's tasks, one after the other.

The process computes, so that the server can always answer the page. It is paused and ended through a control pipe. A
process that the system has stopped (SIGSTOP) would not notice the end of the server, and would stay forever. So it is
paused in another way: its main thread waits, while another thread watches the pipe.

It starts before the server has loaded anything: both load their modules side by side.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

from gapwalk.errors import GapwalkError, WorkError
from gapwalk.interrupts import end_gently
from gapwalk.parallel.processes import undisturbed

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self

    from gapwalk.explorer.engine_tasks import Task
    from gapwalk.explorer.progress_stream import Progress


_PAUSE = signal.SIGBREAK if sys.platform == "win32" else signal.SIGUSR1  # the signal that pauses the main thread


def obey_control(held: Any) -> None:
    """Pause, resume, stop and end as the control pipe requests; call it in the main thread of the process."""
    free = threading.Event()
    free.set()

    def wait_until_free(number: int, frame: object) -> None:
        free.wait()

    def watch() -> None:
        main = threading.main_thread().ident
        assert main is not None
        try:
            while True:
                word = held.recv()
                if word == "resume":
                    free.set()
                    continue
                if word == "pause":
                    free.clear()
                number = _PAUSE if word == "pause" else signal.SIGINT
                if sys.platform == "win32":
                    interrupt_main(number)
                else:
                    signal.pthread_kill(main, number)
        except (EOFError, OSError):
            os._exit(1)

    signal.signal(_PAUSE, wait_until_free)
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
        """Do a task and call `hear` with its progress; return True if it was completed, False after `stop`."""
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the process, unless it has been closed already."""
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def stop(self) -> None:
        """Interrupt the current task; end the process if it does not react."""
        process = self._process
        self.resume()
        self._say("stop")
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
    from gapwalk.explorer.engine_tasks import do  # the server does not wait until this is loaded

    obey_control(held)
    signal.signal(signal.SIGINT, end_gently)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    while True:
        try:
            task = line.recv()
        except KeyboardInterrupt:  # the task had ended just before it was stopped
            continue
        except (EOFError, OSError):
            return
        answer = _answer(do, task, line)
        with suppress(OSError):
            line.send(answer)


def _answer(do: Callable[..., bool], task: Task, line: Any) -> tuple[str, Any]:
    try:
        return "done", do(task, lambda progress: line.send(("news", progress)))
    except KeyboardInterrupt:
        return "done", False
    except GapwalkError as error:
        return "failed", type(error)(*error.args)
    except Exception as error:  # a page cannot show a traceback
        return "failed", WorkError(f"this is a bug in gapwalk, please report it: {type(error).__name__}: {error}")
