"""Channels of a MAT file of MATLAB up to version 7: its vectors; those of version 7.3 are HDF5.

They are read without SciPy's compiled reader, which crashes on damaged files. The format is that of "MAT-File Format"
(The MathWorks), level 5: a header of 128 bytes, then elements, each with a tag of type and length. A variable is an
element of elements (flags, dimensions, name, numbers), possibly compressed.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile
from gapwalk.model.channels.hdf_channels import HdfChannels

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_HEAD = 4096  # bytes of a compressed variable that must contain its flags, dimensions and name
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
_NUMERIC = ("double", "single", *_INTEGERS)
_KINDS = dict(enumerate(("cell", "struct", "object", "char", "sparse", *_NUMERIC), start=1))
_COMPLEX = 0x0800
_PIECE = 1 << 16


class MatChannels(ChannelFile):
    """A MAT file; its content is mapped, and only what is read is taken into memory."""

    words, endings = "a MAT file of MATLAB up to version 7", (".mat",)

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        content = np.memmap(path, np.uint8, "r").data
        order = {b"IM": "<", b"MI": ">"}[bytes(content[126:_HEADER])]
        for kind, payload in _elements(content[_HEADER:], order):
            if kind in (_MATRIX, _COMPRESSED):
                name, count, problem = _described(_unpacked(payload, _HEAD) if kind == _COMPRESSED else payload, order)
                self.add(partial(_values, payload, order, kind, count), name, "", "", count, problem)

    @classmethod
    def fits(cls, head: bytes) -> bool:
        """See `ChannelFile.fits`."""
        return head[126:_HEADER] in (b"IM", b"MI") and not HdfChannels.fits(head)


def _described(head: memoryview, order: str) -> tuple[str, int, str]:
    """Return name and length of a variable, and why it is no channel; empty if it is."""
    (_, flags), (_, sizes), (_, name) = _first(head, order, 3)
    (word,) = struct.unpack(f"{order}I", flags[:4])
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if any(length < 0 for length in shape):
        raise ValueError(f"a variable has the shape {shape}")
    kind, problem = _KINDS.get(word & 0xFF, "unknown"), ""
    if kind not in _NUMERIC or word & _COMPLEX or sum(length != 1 for length in shape) > 1:
        kind = f"complex {kind}" if word & _COMPLEX else kind
        problem = f"is of class {kind} and shape {shape}, and no vector of real numbers"
    return bytes(name).decode("utf-8"), math.prod(shape), problem


def _values(payload: memoryview, order: str, kind: int, count: int) -> NDArray[np.float64]:
    """Return the numbers of a variable of a numeric class in one row."""
    content = _unpacked(payload, _HEAD + 8 * count) if kind == _COMPRESSED else payload
    form, data = _first(content, order, 4)[3]
    numbers = np.frombuffer(data, order + _NUMBERS[form])
    if len(numbers) != count:
        raise ValueError(f"a variable has {len(numbers)} numbers, but should have {count}")
    return numbers.astype(float)


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


def _first(content: memoryview, order: str, count: int) -> list[tuple[int, memoryview]]:
    """Return the first `count` elements."""
    found = list(islice(_elements(content, order), count))
    if len(found) < count:
        raise ValueError("a variable ends early")
    return found


def _unpacked(payload: memoryview, longest: int) -> memoryview:
    """Decompress at most `longest` bytes, whatever length the file claims, piece by piece, without their tag."""
    unpack, found = zlib.decompressobj(), bytearray()
    for begin in range(0, len(payload), _PIECE):  # what one call does not use is copied
        found += unpack.decompress(payload[begin : begin + _PIECE], longest - len(found))
        if len(found) >= longest or unpack.eof:
            break
    return memoryview(bytes(found))[8:]
