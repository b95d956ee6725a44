"""Checks of files from outside, before memory is allocated."""

from __future__ import annotations

import errno
import math
import os
import zipfile
from tokenize import TokenError
from typing import IO, Any

import numpy as np

_PIECE = 1 << 20


def why_no_file(path: str | os.PathLike[str]) -> str:
    """Say why a name cannot be that of a file; empty if there is a file or nothing of that name."""
    # Opening a pipe would wait forever, and a device has no end.
    name = os.fspath(path)
    if os.path.isdir(name):
        return "is a folder; name a file in it"
    if os.path.exists(name) and not os.path.isfile(name):
        return "is a pipe or a device, and no file; choose another name"
    return ""


def open_file(path: str | os.PathLike[str]) -> IO[bytes]:
    """Open a file to read its bytes."""
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):  # a folder has an error of its own
        raise OSError(errno.EINVAL, "it is a pipe or a device, and no file", os.fspath(path))
    return open(path, "rb")


def content_of(path: str | os.PathLike[str], most: int, advice: str) -> bytes:
    """Return the content of a file of at most `most` bytes; raise a ValueError, whose subject is the file."""
    content = bytearray()
    try:
        with open_file(path) as file:
            while len(content) <= most and (piece := file.read(_PIECE)):  # read() of all would allocate the most
                content += piece
    except (OSError, ValueError) as error:  # a ValueError is a NUL in the name
        raise ValueError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > most:
        raise ValueError(f"is larger than {most // 1_000_000} MB; {advice}")
    return bytes(content)


def check_npz(source: str | os.PathLike[str] | IO[bytes], most: int) -> None:
    """Refuse an archive of arrays (NPZ) whose content is too large, or whose headers claim more than it contains."""
    with zipfile.ZipFile(source) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > most:
            raise ValueError(f"it holds more than {most / 1e6:g} MB")
        for entry in entries:
            with archive.open(entry) as content:
                array_header(content, entry.file_size, entry.filename)


def array_header(content: IO[bytes], size: int, name: str = "it") -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read shape and dtype of an array in NumPy's format (NPY), before its numbers."""
    version = np.lib.format.read_magic(content)
    heads = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in heads:
        raise ValueError(f"{name} is stored in an unknown version of the format")
    try:
        shape, _, dtype = heads[version](content)
    except (SyntaxError, TypeError, TokenError, MemoryError, RecursionError):  # the head is a Python expression
        raise ValueError(f"{name} has a header that cannot be read") from None
    if dtype.hasobject:
        raise ValueError(f"{name} holds objects; only numbers and texts are read")
    if any(length < 0 for length in shape) or math.prod(shape) * dtype.itemsize > size:
        raise ValueError(f"{name} states {math.prod(shape):,} entries, but they are missing")
    return shape, dtype
