"""Files from outside: only ordinary ones are opened, and no more memory is asked for than they can fill."""

from __future__ import annotations

import errno
import math
import os
import zipfile
from typing import IO

import numpy as np


def why_no_file(path: str | os.PathLike[str]) -> str:
    """What is wrong with a name that stands for something else than a file; empty if there is a file, or nothing.

    Who opens a pipe waits for ever, and a device has no end.
    """
    name = os.fspath(path)
    if os.path.isdir(name):
        return "is a folder; name a file in it"
    if os.path.exists(name) and not os.path.isfile(name):
        return "is a pipe or a device, and no file; choose another name"
    return ""


def open_file(path: str | os.PathLike[str]) -> IO[bytes]:
    """Open a file to read its bytes.

    Raises
    ------
    OSError
        If it cannot be opened; also if it is a pipe or a device, which is then not waited for.
    """
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):  # a folder has an error of its own
        raise OSError(errno.EINVAL, "it is a pipe or a device, and no file", os.fspath(path))
    return open(path, "rb")


def check_npz(source: str | os.PathLike[str] | IO[bytes], most: int) -> None:
    """Refuse an archive of arrays (NPZ) that would take more memory than it fills.

    Parameters
    ----------
    source
        The archive: its name, or its bytes as a file.
    most
        Bytes that its content may have.

    Raises
    ------
    ValueError
        If its content is larger, an array is said to have more entries than are there, or holds objects.
    zipfile.BadZipFile, OSError
        If it is no archive, or cannot be read.
    """
    with zipfile.ZipFile(source) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > most:
            raise ValueError(f"it holds more than {most / 1e6:g} MB")
        for entry in entries:
            with archive.open(entry) as content:
                _check_array(content, entry)


def _check_array(content: IO[bytes], entry: zipfile.ZipInfo) -> None:
    version = np.lib.format.read_magic(content)
    heads = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in heads:
        raise ValueError(f"{entry.filename} is stored in an unknown version of the format")
    shape, _, dtype = heads[version](content)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} holds objects; only numbers and texts are read")
    if math.prod(shape) * dtype.itemsize > entry.file_size:
        raise ValueError(f"{entry.filename} is said to have {math.prod(shape):,} entries, but they are not there")
