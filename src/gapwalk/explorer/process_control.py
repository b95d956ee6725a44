"""The control of the process that does the jobs: it can be held there, and ends with its holder, even while it is held.

A process that the system has stopped (SIGSTOP) would not see that its holder has died, and would stay for ever. So it
is not stopped: its main thread waits, while another one watches the control.
"""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from typing import Any


class ProcessControl:
    """The holder's end.

    Parameters
    ----------
    connection
        The end of a pipe that can be written to.
    """

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    def hold(self) -> None:
        """Hold the process, until `go_on`."""
        self._say("hold")

    def go_on(self) -> None:
        """Let it go on; nothing if it is not held."""
        self._say("go on")

    def close(self) -> None:
        """Let go of the control: the process ends."""
        self._connection.close()

    def _say(self, word: str) -> None:
        with suppress(OSError):  # the process has died
            self._connection.send(word)


def obey_control(held: Any) -> None:
    """Heed the control from now on; to be called in the main thread of the process.

    Parameters
    ----------
    held
        The other end of the pipe.
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
                if held.recv() == "hold":
                    free.clear()
                    signal.pthread_kill(main, signal.SIGUSR1)
                else:
                    free.set()
        except (EOFError, OSError):
            os._exit(1)

    signal.signal(signal.SIGUSR1, wait_until_free)
    threading.Thread(target=watch, daemon=True).start()
