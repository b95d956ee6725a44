"""Errors of SQLite and of the system about a result file, in words."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

from gapwalk.errors import StoreError
from gapwalk.model.registry import UnknownNameError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk that is full, or of a limit that is reached."""
_LOCKED = ("SQLITE_BUSY", "SQLITE_LOCKED")


@contextmanager
def explained(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert errors of SQLite and of the system into a StoreError."""
    try:
        yield
    except (sqlite3.Error, OSError, UnicodeError) as error:
        raise StoreError(_explain(os.fspath(path), error)) from error


@contextmanager
def undamaged(path: str | os.PathLike[str], where: str = "") -> Iterator[None]:
    """Convert errors while the content of a file is decoded into a StoreError."""
    try:
        yield
    except StoreError:
        raise
    except UnknownNameError as error:
        raise StoreError(
            f"{os.fspath(path)} cannot be read: {error}. Import the module that adds it; if there is none, the file is "
            "damaged"
        ) from error
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise StoreError(f"{os.fspath(path)} is damaged: {where}{error}") from error


def _explain(name: str, error: Exception) -> str:
    code = getattr(error, "sqlite_errorname", "")
    folder = os.path.dirname(os.path.abspath(name))
    if code == "SQLITE_NOTADB":
        hint = f", but a model file; compute a result first: gapwalk run {name}" if name.endswith(".toml") else ""
        return f"{name} is not a result file of gapwalk{hint}"
    if code.startswith("SQLITE_CORRUPT") or isinstance(error, UnicodeError):
        return f"{name} is damaged or cut short ({error})"
    if code.startswith(_LOCKED):
        return f"{name} is being written by another run; wait for its end, or stop it"
    if not os.path.isdir(folder):
        return f"there is no folder {folder}; make it, or choose another place for {os.path.basename(name)}"
    is_gone = code.startswith(("SQLITE_IOERR", "SQLITE_READONLY_DBMOVED")) and not os.path.exists(name)
    if is_gone or isinstance(error, FileNotFoundError):
        return f"{name} has been removed or moved while it was written; what a run finds now would be lost"
    if code.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM")) or isinstance(error, PermissionError):
        if not os.access(folder, os.W_OK) and os.path.exists(f"{name}-wal"):
            return f"{name} cannot be opened in a folder that cannot be written; copy it and {name}-wal to another one"
        if not os.access(folder, os.W_OK):
            return f"{name} cannot be opened: its folder cannot be written; choose another place for the result"
        return f"{name} cannot be opened; look at its permissions ({error})"
    if code == "SQLITE_FULL" or getattr(error, "errno", None) in FULL[:2]:
        return f"{name} cannot be written: the disk is full; all that was reported is in the file"
    if code.startswith("SQLITE_IOERR") or getattr(error, "errno", None) in FULL:
        return (
            f"{name} cannot be read or written ({error}): the disk may be full, a limit reached, or the disk gone; all "
            "that was reported is in the file"
        )
    return f"{name} cannot be read or written: {error}"
