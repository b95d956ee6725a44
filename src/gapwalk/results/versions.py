"""The versions of what computes a result."""

from __future__ import annotations

import os
import platform
from functools import cache
from hashlib import blake2b
from importlib import import_module
from pathlib import Path

import heyoka
import numpy as np

from gapwalk import __version__
from gapwalk.errors import StoreError


def check_not_newer(path: str | os.PathLike[str], writers: str) -> None:
    """Raise a StoreError if a file states that a newer version of gapwalk than this one has written to it."""
    newest = max(writers.split(", "), key=_numbers)
    if _numbers(newest) > _numbers(__version__):
        raise StoreError(
            f"{os.fspath(path)} was written by gapwalk {newest}, and holds what gapwalk {__version__} does not know: "
            "update gapwalk"
        )


def versions(before: dict[str, str] | None = None) -> dict[str, str]:
    """Return the versions of the software that computes a result, after those of `before` that differ from them."""
    now = {
        "gapwalk": __version__,
        "heyoka": heyoka.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
    for name, version in (before or {}).items():
        if now.get(name, version) not in version.split(", "):
            now[name] = f"{version}, {now[name]}"
        else:
            now[name] = version
    return now


@cache
def sources(modules: tuple[str, ...] = ()) -> str:
    """Return a hash of the code of gapwalk and of some modules; read once, as a process goes on with what it loaded."""
    root = Path(__file__).parents[1]
    named = [(path.relative_to(root).as_posix(), path) for path in sorted(root.rglob("*.py"))]
    named += [(name, Path(file)) for name in modules if (file := getattr(import_module(name), "__file__", None))]
    hashed = blake2b(digest_size=6)
    for name, path in named:
        content = path.read_bytes()
        hashed.update(f"{name} {len(content)} ".encode() + content)
    return hashed.hexdigest()


def _numbers(version: str) -> tuple[int, ...]:
    """Return a version such as 1.10.2 as numbers that can be compared."""
    return tuple(int(part) for part in version.split(".") if part.isdigit())
