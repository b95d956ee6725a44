"""The files of jobs over many cells: chunk by chunk while they are done, then the whole result; and read back.

All is kept as arrays, bit for bit, and as JSON text; nothing in a file can run.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import StoreError
from gapwalk.study.store.arrays import Arrays, pack_arrays, unpack_arrays
from gapwalk.study.store.chunk_store import open_chunks, read_chunks
from gapwalk.study.store.trust import undamaged


class CellStore:
    """The file of a job that is being done.

    Parameters
    ----------
    path
        The file. If it holds a part of the same job, that is gone on with.
    about
        What is to be done, in plain JSON values.
    count
        Number of chunks; the result stands after them.

    Raises
    ------
    StoreError
        If the file is of another job, is being written by another run, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], about: Mapping[str, Any], count: int) -> None:
        self._store, self._count = open_chunks(path, about), count
        try:
            self.chunks, self.result = parted(path, dict(self._store.known()), count)
        except BaseException:
            self._store.close()
            raise

    def add(self, number: int, arrays: Arrays) -> None:
        """Write a chunk; a StoreError if that cannot be done."""
        self._store.add(number, pack_arrays(arrays))

    def finish(self, arrays: Arrays) -> None:
        """Write the result, unless it is there already."""
        if self.result is None:
            self._store.add(self._count, pack_arrays(arrays))

    def __enter__(self) -> CellStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._store.close()


def read_cells(path: str | os.PathLike[str], kind: str) -> tuple[dict[str, Any], Arrays]:
    """What a job was to do, and its result.

    Raises
    ------
    StoreError
        If there is no such file, it is of another kind, it is not complete, or it is damaged.
    """
    about, chunks = read_chunks(path)
    if about.get("kind") != kind:
        raise StoreError(f"{os.fspath(path)} does not hold {kind}, but a job of the kind {about.get('kind')!r}")
    count = about.get("chunks")
    if not isinstance(count, int):
        raise StoreError(f"{os.fspath(path)} is damaged: it has {count!r} chunks")
    done, result = parted(path, chunks, count)
    if result is None:
        raise StoreError(
            f"{os.fspath(path)} is not complete: {len(done)} of {count} chunks are done; go on with it by "
            f"gapwalk.{kind}(..., output={os.fspath(path)!r}) with the same arguments as before"
        )
    return about, result


def text_array(value: Any) -> NDArray[Any]:
    """A plain JSON value as an array that can be stored."""
    return np.array(json.dumps(value))


def text_value(array: NDArray[Any]) -> Any:
    """The value of such an array; a ValueError if it is none."""
    return json.loads(str(array))


def parted(
    path: str | os.PathLike[str], known: Mapping[int, bytes], count: int
) -> tuple[dict[int, Arrays], Arrays | None]:
    """The chunks by number, and the result if it is there."""
    with undamaged(path):
        unpacked = {number: unpack_arrays(data) for number, data in known.items()}
        result = unpacked.pop(count, None)
        if any(number > count for number in unpacked):
            raise ValueError(f"there are more than {count} chunks")
        return unpacked, result
