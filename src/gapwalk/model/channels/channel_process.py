"""A process of its own in which a library reads a measured file.

Compiled libraries crash on damaged files, or ask for any amount of memory. In this process, with its limits of memory
and time, that ends with an error message; what a library prints or logs is dropped.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import astuple
from threading import Timer
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import FORMATS, ChannelFile, ColumnHead

MEMORY = 900_000_000
"""Bytes that a library may take."""
SECONDS = 300.0
"""Time after which reading a file is given up."""


_GAVE_UP = "its library gave up: the file is damaged, or too large for it"


class ChannelsApart(ChannelFile):
    """A file that is read in a process of its own; it is asked for the numbers of channels."""

    words, endings = "a file read in a process of its own", ()

    def __init__(self, path: str, name: str) -> None:
        self.row, self._name = FORMATS.named(name).row, name
        super().__init__(path)

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        command = [sys.executable, "-P", "-m", __name__, self._name, os.path.abspath(path)]
        places = os.pathsep.join(filter(None, map(str, sys.path)))
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": places}
        )
        self._timer = Timer(SECONDS, self._process.kill)
        self._timer.daemon = True
        self._timer.start()
        try:
            self.heads = [ColumnHead(*each) for each in self._answer()["heads"]]
        except BaseException:
            self.close()
            raise

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            raise ValueError(_GAVE_UP)
        found = json.loads(line)
        if "refused" in found:
            raise ModelError(found["refused"])
        if "failed" in found:
            raise ValueError(found["failed"])
        return found

    def numbers(self, places: Mapping[str, int], most: int) -> dict[str, NDArray[np.float64]]:
        """See `ChannelFile.numbers`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):  # the answer is then none
            self._process.stdin.write(json.dumps([dict(places), most]).encode() + b"\n")
            self._process.stdin.flush()
        told, found = self._answer(), {}
        self.first = told["first"]
        for label, size in zip(places, told["sizes"], strict=True):
            content = self._process.stdout.read(8 * size)
            if len(content) < 8 * size:
                raise ValueError(_GAVE_UP)
            found[label] = np.frombuffer(content, np.float64).copy()
        return found

    def close(self) -> None:
        """See `ChannelFile.close`."""
        self._timer.cancel()
        self._process.kill()
        with suppress(BrokenPipeError):
            self._process.communicate()


def serve(name: str, path: str) -> None:
    """Read a file, and answer requests for numbers from the standard input."""
    if sys.platform == "linux":  # others have no such limit, or do not keep it
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer

    def answer(**found: object) -> None:
        out.write(json.dumps(found).encode() + b"\n")
        out.flush()

    def failed(error: BaseException) -> None:
        if isinstance(error, ModelError):
            return answer(refused=str(error))
        return answer(failed=str(error) or type(error).__name__)

    try:
        file = FORMATS.named(name)(path)
    except Exception as error:  # libraries raise anything on damaged files
        return failed(error)
    answer(heads=[astuple(head) for head in file.heads])
    for line in sys.stdin:
        places, most = json.loads(line)
        try:
            found = file.numbers(places, most)
        except Exception as error:
            failed(error)
            continue
        answer(first=file.first, sizes=[len(column) for column in found.values()])
        for column in found.values():
            out.write(column.tobytes())
        out.flush()
    return None


if __name__ == "__main__":
    serve(*sys.argv[1:])
