"""The folder of the user's cache, and files in it that other processes see whole or not at all."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from pathlib import Path


def trusted(folder: Path | None, name: str = "flows") -> Path | None:
    """Return a folder, by default one in the cache, created if necessary; None if it is not the user's own."""
    try:
        folder = cache_folder(name) if folder is None else folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if is_private(folder) else None
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return None


def cache_folder(name: str) -> Path:
    """Return ``gapwalk/NAME`` in ``$XDG_CACHE_HOME`` or ``~/.cache``; raise a RuntimeError if there is no home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "gapwalk" / name


def is_private(folder: Path) -> bool:
    """Return True if a folder is the user's own, and writable for nobody else."""
    if sys.platform == "win32":  # folders of a user are closed to others there, and the bits say nothing
        return True
    about = folder.stat()
    return about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file that another process sees whole or not at all."""
    handle, name = tempfile.mkstemp(dir=file.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise
