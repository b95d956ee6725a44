"""Ctrl-C at moments at which libraries cannot be left: it comes once they are done."""

import os
import signal
import sys
import time

import pytest

from gapwalk.interrupts import end_gently

LIBRARIES = (
    ("llvmlite", "binding", "ffi.py"),
    ("pydantic", "plugin", "_schema_validator.py"),
    ("scipy", "stats", "_qmc.py"),
)


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_library_that_cannot_be_left_ends_first(library) -> None:
    ended: list[bool] = []
    text = "end(2, sys._getframe()); ended.append(True)"
    code = compile(text, os.path.join("site-packages", *library), "exec")
    before = signal.signal(signal.SIGINT, end_gently)
    try:
        exec(code, {"end": end_gently, "ended": ended, "sys": sys})
        with pytest.raises(KeyboardInterrupt):
            time.sleep(10.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended
