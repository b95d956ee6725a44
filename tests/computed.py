"""What several tests need is computed once in each run of the tests, by whichever of its processes needs it first.

Where one process runs all tests, values are kept in its memory. Where several do, they share a folder that is made for
the run, so that nothing that older code computed is ever used.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable
from enum import Enum
from functools import cache, wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import gapwalk as gw
from gapwalk.bifurcation import Branch, follow
from gapwalk.orbit import find_orbit
from gapwalk.paper import case

T = TypeVar("T")

shared: Path | None = None
"""The folder of the processes of this run; None where there is only one (`tests/conftest.py`)."""


def once(function: Callable[..., T]) -> Callable[..., T]:
    """The function, but called once in a run for each set of its arguments: texts, numbers and members of an enum."""

    @cache
    @wraps(function)
    def value(*arguments: str | float | Enum) -> T:
        if shared is None:
            return function(*arguments)
        if strange := [each for each in arguments if not isinstance(each, str | float | int | Enum)]:
            raise TypeError(f"{strange} do not say in full what is computed; give texts and numbers")
        text = f"{function.__module__}.{function.__qualname__}{arguments!r}"
        path = shared / hashlib.sha256(text.encode()).hexdigest()
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # whoever waits here would only compute the same
            if not path.exists():
                part = path.with_suffix(".part")
                part.write_bytes(pickle.dumps(function(*arguments)))
                os.replace(part, path)
            return pickle.loads(path.read_bytes())

    return value


def file_of(study: gw.Study) -> bytes:
    """The result file of a study that nothing interrupts."""
    with TemporaryDirectory() as folder:
        gw.run(study, path := Path(folder) / "x.gapwalk")
        return path.read_bytes()


def opened(content: bytes) -> gw.Result:
    """Open a result file by its content."""
    with TemporaryDirectory() as folder:
        (path := Path(folder) / "x.gapwalk").write_bytes(content)
        return gw.open_result(path)


@once
def paper_response(figure: str) -> Branch:
    """The frequency response of a figure of the paper, over the whole of its range, downwards."""
    return follow(find_orbit(case(figure), frequency=2.0), "frequency", to=0.15)
