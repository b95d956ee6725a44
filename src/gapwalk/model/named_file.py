"""Files that a model file names: where they may be, and how they are read."""

from __future__ import annotations

import os

from gapwalk.files import open_file
from gapwalk.model.measured.measured_table import MAX_BYTES, NamedFile
from gapwalk.model.model_source import Source


def path_of(name: str, source: Source) -> str:
    """Return the path of a file that a model file names; raise a ValueError if the source is not allowed to read it."""
    path = os.path.join(os.path.dirname(source.name), name)
    if source.within:
        inside = os.path.realpath(source.within)
        if os.path.commonpath((os.path.realpath(path), inside)) != inside:
            raise ValueError(f"which lies outside of the folder {os.path.basename(inside)}; put the file into it")
    return path


def read_named(name: str, source: Source) -> NamedFile:
    """Read a file that a model file names."""
    try:
        with open_file(path_of(name, source)) as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ValueError(f"which cannot be read: {error.strerror or error}") from None
    if len(content) > MAX_BYTES:
        raise ValueError(f"which is larger than {MAX_BYTES // 1_000_000} MB; leave out rows")
    return NamedFile(name, content)
