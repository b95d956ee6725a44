"""Sections of code that Ctrl-C and SIGTERM do not interrupt."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

# LLVM would free its memory twice, pydantic would report the interruption as a wrong schema, and SciPy's numbers of
# Sobol would lose it
_WHOLE = tuple(
    os.path.join(*parts)
    for parts in (("llvmlite", "binding"), ("pydantic", "plugin", "_schema_validator"), ("scipy", "stats", "_qmc"))
)


def end_gently(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt for a signal, but let an import and what cannot be interrupted end first."""
    while frame is not None:
        name = frame.f_code.co_filename
        if name.startswith("<frozen importlib") or any(part in name for part in _WHOLE):
            threading.Timer(0.02, signal.raise_signal, (number,)).start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until the end of the block, so that its writing is never interrupted."""
    # Signals without a handler in Python end the process at once, as usual. Other threads are never interrupted.
    in_main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM) if in_main}
    caught: list[int] = []
    try:
        for number, handler in handlers.items():
            if callable(handler):
                signal.signal(number, lambda number, frame: caught.append(number))
        yield
    finally:
        for number, handler in reversed(handlers.items()):  # SIGTERM first: who catches it here goes no further
            if callable(handler):
                signal.signal(number, handler)
        for number in caught[:1]:
            signal.raise_signal(number)
