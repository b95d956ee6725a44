"""Counts work instead of measuring time: it is the same on any machine, under any load."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def counted_calls() -> Iterator[Callable[[], int]]:
    """A function that tells how many functions this thread has called within the block."""
    count = 0

    def see(frame, event, arg) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(see)
    try:
        yield lambda: count
    finally:
        sys.setprofile(before)
