"""Processes that several threads start leave this one as it was."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.parallel import processes
from gapwalk.parallel.processes import undisturbed
from gapwalk.parallel.threads import THREAD_VARIABLES
from gapwalk.parallel.workers import Workers
from tests.systems import clutch
from tests.tiers import in_campaign


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


def modules_of(_: object) -> list[str]:
    """The modules of the process that does it, before any piece of work that needs more."""
    return list(sys.modules)


def test_processes_begin_with_what_their_work_needs() -> None:
    """Each loaded it again with its first piece: a second of CPU time."""
    script = (
        "import sys, gapwalk as gw\n"
        "from tests.studies.test_processes import modules_of\n"
        "with gw.parallel.local_workers(1 + 1) as workers:\n"
        "    import gapwalk.studies.regime_study\n"  # a job that comes after the workers
        "    own = {name for name in sys.modules if name.startswith('gapwalk.')} - {'gapwalk.__main__'}\n"
        "    for _, found in workers.each(modules_of, [0, 1]):\n"
        "        print(sorted(own - set(found)), 'numba' in found, 'numba' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[] True False"] * 2


@pytest.mark.parametrize("is_swept", [False, in_campaign(True)])
def test_processes_that_are_spawned_find_the_same(is_swept: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows and macOS, where no server forks them."""
    monkeypatch.setattr(processes, "METHOD", "spawn")

    def found(workers: int | Workers) -> np.ndarray:
        numbers = (clutch(), "frequency", (0.6, 0.7))
        return gw.sweep(*numbers, workers=workers, steps=2, points=14, shortest=16, longest=40).sections

    with gw.parallel.local_workers(2) as pool:
        states = dict(pool.each(end_of_motion, [0.5, 0.6, 0.7]))
        shared = found(pool) if is_swept else None  # by the same two processes
    assert states == {index: end_of_motion(frequency) for index, frequency in enumerate([0.5, 0.6, 0.7])}
    if is_swept:
        np.testing.assert_array_equal(shared, found(1))


def end_of_motion(frequency: float) -> bytes:
    """Where a motion ends, bit for bit."""
    return gw.integrate(clutch(frequency=frequency), np.array([1.2, 0.1, 0.0, 0.0]), periods=2).q[-1].tobytes()
