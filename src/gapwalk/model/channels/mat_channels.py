"""Channels of a MAT file of MATLAB up to version 7: its vectors; those of version 7.3 are HDF5.

They are read without SciPy's compiled reader, which crashes on damaged files. The format is that of "MAT-File Format"
(The MathWorks), level 5: a header of 128 bytes, then elements, each with a tag of type and length. A variable is an
element of elements (flags, dimensions, name, numbers), possibly compressed.
"""

from __future__ import annotations

import math
import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile
from gapwalk.model.channels.hdf_channels import HdfChannels

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_HEAD = 4096  # bytes of a compressed variable that must contain its flags, dimensions and name
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single"}
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
_KINDS = {**_CLASSES, **{8 + place: name for place, name in enumerate(_INTEGERS)}}
_COMPLEX = 0x0800

_NUMERIC = ("double", "single", *_INTEGERS)
_PIECE = 1 << 16


class MatChannels(ChannelFile):
    """A MAT file; its content is mapped, and only what is read is taken into memory."""

    words, endings = "a MAT file of MATLAB up to version 7", (".mat",)

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        with open(path, "rb") as file:
            self.file = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._content = memoryview(self.file)
        order = {b"IM": "<", b"MI": ">"}[self.file[126:_HEADER]]
        for name, each in dict(_variables(self._content, order)).items():
            self.add(each.values, name, "", "", math.prod(each.shape), each.problem)

    @classmethod
    def fits(cls, head: bytes) -> bool:
        """See `ChannelFile.fits`."""
        return head[126:_HEADER] in (b"IM", b"MI") and not HdfChannels.fits(head)

    def close(self) -> None:
        """See `ChannelFile.close`."""
        self._readers = []
        with suppress(BufferError):  # a traceback may hold a part of it
            self._content.release()
            self.file.close()


@dataclass(frozen=True)
class _Variable:
    """A variable of a MAT file; its numbers are read on request."""

    kind: str  #: Its class, as named by MATLAB.
    shape: tuple[int, ...]  #: Its dimensions.
    is_complex: bool  #: True if it has imaginary parts.
    order: str
    payload: memoryview
    compressed: bool

    @property
    def problem(self) -> str:
        """Why it is no channel; empty if it is."""
        if self.kind in _NUMERIC and not self.is_complex and sum(length != 1 for length in self.shape) <= 1:
            return ""
        kind = f"complex {self.kind}" if self.is_complex else self.kind
        return f"is of class {kind} and shape {self.shape}, and no vector of real numbers"

    def values(self) -> NDArray[np.float64]:
        """Return its numbers in one row; only for a variable of a numeric class."""
        count = math.prod(self.shape)
        content = self.payload
        if self.compressed:
            content = _unpacked(content, _HEAD + 8 * count * (1 + self.is_complex))[8:]
        kind, data = _first(content, self.order, 4)[3]
        numbers = np.frombuffer(data, self.order + _NUMBERS[kind])
        if len(numbers) != count:
            raise ValueError(f"a variable has {len(numbers)} numbers, but should have {count}")
        return numbers.astype(float)


def _variables(content: memoryview, order: str) -> Iterator[tuple[str, _Variable]]:
    for kind, payload in _elements(content[_HEADER:], order):
        if kind == _MATRIX:
            yield _variable(payload, payload, order, compressed=False)
        elif kind == _COMPRESSED:
            yield _variable(_unpacked(payload, _HEAD)[8:], payload, order, compressed=True)


def _elements(content: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of each element; the last one may be incomplete if only the beginning was unpacked."""
    place = 0
    while place + 8 <= len(content):
        kind, length = struct.unpack(f"{order}II", content[place : place + 8])
        if kind >> 16:  # a small element: its content is in the tag
            length, kind = kind >> 16, kind & 0xFFFF
            if length > 4:
                raise ValueError(f"a small data element states a length of {length} bytes; the largest is 4")
            yield kind, content[place + 4 : place + 4 + length]
            place += 8
            continue
        yield kind, content[place + 8 : place + 8 + length]
        place += 8 + length + (0 if kind == _COMPRESSED else -length % 8)


def _variable(head: memoryview, payload: memoryview, order: str, *, compressed: bool) -> tuple[str, _Variable]:
    (_, flags), (_, sizes), (_, name) = _first(head, order, 3)
    (word,) = struct.unpack(f"{order}I", flags[:4])
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if any(length < 0 for length in shape):
        raise ValueError(f"a variable has the shape {shape}")
    found = _Variable(_KINDS.get(word & 0xFF, "unknown"), shape, bool(word & _COMPLEX), order, payload, compressed)
    return bytes(name).decode("utf-8"), found


def _first(content: memoryview, order: str, count: int) -> list[tuple[int, memoryview]]:
    """Return the first `count` elements."""
    found = list(islice(_elements(content, order), count))
    if len(found) < count:
        raise ValueError("a variable ends early")
    return found


def _unpacked(payload: memoryview, longest: int) -> memoryview:
    """Decompress at most `longest` bytes, whatever length the file claims, piece by piece."""
    unpack, found = zlib.decompressobj(), bytearray()
    for begin in range(0, len(payload), _PIECE):  # what one call does not use is copied
        found += unpack.decompress(payload[begin : begin + _PIECE], longest - len(found))
        if len(found) >= longest or unpack.eof:
            break
    return memoryview(bytes(found))
