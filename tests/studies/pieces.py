"""Pieces of work that take a moment, tell who does them, or end their process."""

import os
import signal
import time
from pathlib import Path


def slow_double(number: int) -> int:
    time.sleep(0.2 if number % 2 == 0 else 0.0)  # the first ones are done last
    return 2 * number


def slow_pid(_: int) -> int:
    """The process that does it."""
    time.sleep(0.1)
    return os.getpid()


def die(_: object = None) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def die_at_three(number: int) -> int:
    time.sleep(0.05)
    if number == 3:
        die()
    return number


def fail_at_three(number: int) -> int:
    if number == 3:
        raise ZeroDivisionError("three")
    time.sleep(0.2 if number < 3 else 0.0)
    return number


def die_once(marks: tuple[str, int]) -> int:
    """Die at the first try, and leave a mark of each try in a folder."""
    folder, number = marks
    mark = Path(folder) / f"{number}-{os.getpid()}"
    mark.touch()
    time.sleep(0.1)
    if number == 2 and len(list(Path(folder).glob("2-*"))) == 1:
        die()
    return number
