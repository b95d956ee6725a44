"""Numeric vectors of a MAT file of MATLAB 5 to 7. SciPy's compiled reader is not used: it crashes on damaged files.

The format is that of "MAT-File Format" (The MathWorks), level 5: a header of 128 bytes, then elements, each with a tag
of type and length. A variable is an element of elements (flags, dimensions, name, numbers), possibly compressed.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_HEAD = 4096  # bytes of a compressed variable that must contain its flags, dimensions and name
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single"}
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
_KINDS = {**_CLASSES, **{8 + place: name for place, name in enumerate(_INTEGERS)}}
_COMPLEX = 0x0800

NUMERIC = ("double", "single", *_INTEGERS)
"""Classes of variables that contain numbers."""


@dataclass(frozen=True)
class MatVariable:
    """A variable of a MAT file; its numbers are read on request.

    Attributes
    ----------
    kind
        Its class, as named by MATLAB.
    shape
        Its dimensions.
    is_complex
        True if it has imaginary parts.
    """

    kind: str
    shape: tuple[int, ...]
    is_complex: bool
    order: str
    payload: bytes
    compressed: bool

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


def mat_variables(content: bytes) -> dict[str, MatVariable]:
    """Return the variables of a MAT file by name; raise a ModelError if it is not a MAT file."""
    if content[:19] == b"MATLAB 7.3 MAT-file":
        raise ModelError("it is a MAT file of version 7.3; save it with save(..., '-v7')")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:_HEADER])
    if order is None:
        raise ModelError("it is not a MAT file of version 5 to 7; save it with save(..., '-v7')")
    try:
        return dict(_variables(content, order))
    except (ValueError, KeyError, struct.error, zlib.error, UnicodeDecodeError) as error:
        raise damaged(error) from None


def damaged(error: Exception) -> ModelError:
    """Create the error for a file with inconsistent contents."""
    return ModelError(f"it is a damaged MAT file: {error}")


def _variables(content: bytes, order: str) -> Iterator[tuple[str, MatVariable]]:
    for kind, payload in _elements(content[_HEADER:], order):
        if kind == _MATRIX:
            yield _variable(payload, payload, order, compressed=False)
        elif kind == _COMPRESSED:
            yield _variable(_unpacked(payload, _HEAD)[8:], payload, order, compressed=True)


def _variable(head: bytes, payload: bytes, order: str, *, compressed: bool) -> tuple[str, MatVariable]:
    (_, flags), (_, sizes), (_, name) = _first(head, order, 3)
    (word,) = struct.unpack(f"{order}I", flags[:4])
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if any(length < 0 for length in shape):
        raise ValueError(f"a variable has the shape {shape}")
    found = MatVariable(_KINDS.get(word & 0xFF, "unknown"), shape, bool(word & _COMPLEX), order, payload, compressed)
    return name.decode("utf-8"), found


def _first(content: bytes, order: str, count: int) -> list[tuple[int, bytes]]:
    """Return the first `count` elements."""
    found = list(islice(_elements(content, order), count))
    if len(found) < count:
        raise ValueError("a variable ends early")
    return found


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and content of each element; the last one may be incomplete if only the beginning was unpacked."""
    place = 0
    while place + 8 <= len(content):
        kind, length = struct.unpack(f"{order}II", content[place : place + 8])
        if kind >> 16:  # a small element: its content is in the tag
            length, kind = kind >> 16, kind & 0xFFFF
            if length > 4:
                raise ValueError(f"a small element is {length} bytes long")
            yield kind, content[place + 4 : place + 4 + length]
            place += 8
            continue
        yield kind, content[place + 8 : place + 8 + length]
        place += 8 + length + (0 if kind == _COMPRESSED else -length % 8)


def _unpacked(payload: bytes, longest: int) -> bytes:
    """Decompress at most `longest` bytes, whatever length the file claims."""
    return zlib.decompressobj().decompress(payload, longest)
