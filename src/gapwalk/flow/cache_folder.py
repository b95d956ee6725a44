"""The folders in which machine code is kept: the user's own, or none."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path


def cache_folder(name: str) -> Path:
    """The folder ``gapwalk/NAME`` in ``$XDG_CACHE_HOME`` or ``~/.cache``; a RuntimeError if there is no home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "gapwalk" / name


def is_private(folder: Path) -> bool:
    """Whether a folder is the user's own, and writable for nobody else."""
    about = folder.stat()
    is_mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    return is_mine and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


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
