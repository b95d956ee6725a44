"""Ctrl-C at moments at which libraries cannot be left: it comes once they are done."""

import os
import signal
import time

import pytest

from gapwalk.interrupts import end_gently


@pytest.mark.parametrize("library", [("llvmlite", "binding", "ffi.py"), ("pydantic", "plugin", "_schema_validator.py")])
def test_a_library_that_cannot_be_left_ends_first(library) -> None:
    ended: list[bool] = []
    code = compile("end(2, sys._getframe()); ended.append(True)", os.path.join("site-packages", *library), "exec")
    before = signal.signal(signal.SIGINT, end_gently)
    try:
        with pytest.raises(KeyboardInterrupt):
            exec(code, {"end": end_gently, "ended": ended, "sys": __import__("sys")})  # noqa: S102
            time.sleep(10.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended
