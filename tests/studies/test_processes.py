"""Processes that several threads start leave this one as it was."""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from gapwalk.parallel.processes import undisturbed
from gapwalk.parallel.threads import THREAD_VARIABLES


def test_threads_that_start_processes_take_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second one took the first one's stand-in for the main script, and put that back for good."""
    for name in THREAD_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    main, first_is_in, inside = sys.modules["__main__"], threading.Event(), []

    def start(number: int) -> None:
        if number:
            first_is_in.wait(10.0)
        with undisturbed():
            inside.append(number)
            first_is_in.set()
            threading.Event().wait(0.2)  # the time in which the other one comes
            assert inside == [number]
            assert sys.modules["__main__"] is not main
            assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
            inside.remove(number)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(start, (0, 1)))
    assert sys.modules["__main__"] is main
    assert not any(name in os.environ for name in THREAD_VARIABLES)
