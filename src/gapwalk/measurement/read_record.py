"""Reading of a measured record from a CSV or MAT file; both are treated as data only, and their sizes are limited.

Numeric vectors are read from MAT files of MATLAB 5 to 7 without SciPy's compiled reader, which crashes on damaged
files. The format is that of "MAT-File Format" (The MathWorks), level 5: a header of 128 bytes, then elements, each with
a tag of type and length. A variable is an element of elements (flags, dimensions, name, numbers), possibly
compressed.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.files import open_file
from gapwalk.measurement.measured_record import MAX_SAMPLES, Record
from gapwalk.model.measured.csv_columns import parse_csv
from gapwalk.model.problems import did_you_mean

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
MAX_BYTES = 100_000_000
"""A larger file is refused."""

_PIECE = 1 << 20
FIELDS = ("time", "acceleration", "speed")


@dataclass(frozen=True)
class MatVariable:
    """A variable of a MAT file; its numbers are read on request."""

    kind: str  #: Its class, as named by MATLAB.
    shape: tuple[int, ...]  #: Its dimensions.
    is_complex: bool  #: True if it has imaginary parts.
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


def read_measurement(
    path: str | os.PathLike[str],
    columns: Mapping[str, str] | None = None,
    *,
    time_scale: float = 1.0,
    scale: float = 1.0,
    speed_scale: float = 1.0,
) -> Record:
    """Read a measured time history.

    Parameters
    ----------
    path
        A CSV file (a line of column names, then numbers, separated by commas, semicolons or tabs; lines that begin with
        ``#`` are comments; where commas do not separate numbers, they may be decimal ones), or a MAT file of MATLAB up
        to version 7 with a vector for each column.
    columns
        Names of the columns in the file, as in ``{"time": "t [s]", "acceleration": "a3"}``; by default ``time``,
        ``acceleration`` and, if there is one, ``speed``.
    time_scale, scale, speed_scale
        Factors that convert time, acceleration and speed to the units of the model. A speed is then in radians per unit
        of the model's time.

    Returns
    -------
    Record
        The record.

    Raises
    ------
    ModelError
        If the file cannot be read, has no such columns, or its numbers are not a valid record; see `Record`.

    Examples
    --------
    >>> columns = np.array([record.time, record.acceleration]).T
    >>> np.savetxt("shaker.csv", columns, delimiter=",", header="t,a", comments="")
    >>> gw.measure.read_measurement("shaker.csv", {"time": "t", "acceleration": "a"}).time.size
    64
    """
    path = Path(path)
    wanted = _wanted(columns or {})
    content = _content(path)
    try:
        table = (_read_mat if path.suffix.lower() == ".mat" else _read_csv)(content, wanted)
        return Record(name=path.name, **table).scaled(time_scale, scale, speed_scale)
    except ModelError as error:
        text = str(error)
        raise ModelError(text if text.startswith(path.name) else f"{path.name}: {text}") from None


def _wanted(columns: Mapping[str, str]) -> dict[str, str]:
    """Return the name of each column in the file; the speed only if it is named."""
    for field in columns:
        if field not in FIELDS:
            raise ModelError(f"a record has no column {field!r}; {did_you_mean(field, FIELDS)}")
    return {field: field for field in FIELDS[:2]} | dict(columns)


def _content(path: Path) -> bytes:
    content = bytearray()
    try:
        with open_file(path) as file:
            while len(content) <= MAX_BYTES and (piece := file.read(_PIECE)):  # read() of all would allocate MAX_BYTES
                content += piece
    except (OSError, ValueError) as error:
        raise ModelError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{path} is larger than {MAX_BYTES // 1_000_000} MB; cut a few tens of periods out of it")
    return bytes(content)


def _read_mat(content: bytes, wanted: Mapping[str, str]) -> dict[str, NDArray[np.float64]]:
    held = mat_variables(content)
    _require(list(held), wanted)
    names = dict(wanted)
    if "speed" not in names and "speed" in held:
        names["speed"] = "speed"
    for field, name in names.items():  # before anything is unpacked
        found = held[name]
        if found.kind not in NUMERIC or found.is_complex or sum(length != 1 for length in found.shape) > 1:
            kind = f"complex {found.kind}" if found.is_complex else found.kind
            raise ModelError(
                f"{name} (for {field}) is of class {kind} and shape {found.shape}; it must be a vector of real numbers"
            )
        if math.prod(found.shape) > MAX_SAMPLES:
            raise ModelError(f"{name} has {math.prod(found.shape):,} samples; give at most {MAX_SAMPLES:,}")
    try:
        return {field: held[name].values() for field, name in names.items()}
    except (ValueError, KeyError, struct.error, zlib.error) as error:
        raise damaged(error) from None


def mat_variables(content: bytes) -> dict[str, MatVariable]:
    """Return the variables of a MAT file by name; raise a ModelError if it is not a MAT file."""
    if content[:19] == b"MATLAB 7.3 MAT-file":
        raise ModelError("it is a MAT file of version 7.3, which cannot be read; save it with save(..., '-v7')")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:_HEADER])
    if order is None:
        raise ModelError("it is not a MAT file of version 5 to 7; save it with save(..., '-v7')")
    try:
        return dict(_variables(content, order))
    except (ValueError, KeyError, struct.error, zlib.error, UnicodeDecodeError) as error:
        raise damaged(error) from None


def _variables(content: bytes, order: str) -> Iterator[tuple[str, MatVariable]]:
    for kind, payload in _elements(content[_HEADER:], order):
        if kind == _MATRIX:
            yield _variable(payload, payload, order, compressed=False)
        elif kind == _COMPRESSED:
            yield _variable(_unpacked(payload, _HEAD)[8:], payload, order, compressed=True)


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
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


def _unpacked(payload: bytes, longest: int) -> bytes:
    """Decompress at most `longest` bytes, whatever length the file claims."""
    return zlib.decompressobj().decompress(payload, longest)


def damaged(error: Exception) -> ModelError:
    """Create the error for a file with inconsistent contents."""
    return ModelError(f"it is a damaged MAT file: {error}")


def _require(known: list[str], wanted: Mapping[str, str]) -> None:
    for field, name in wanted.items():
        if name not in known:
            shown = [head for head in known[:20] if head]
            raise ModelError(
                f"there is no column {name!r} for {field}; {did_you_mean(name, shown, 'columns are')}. "
                f'Name it: columns = {{ {field} = "..." }}'
            )


def _read_csv(content: bytes, wanted: Mapping[str, str]) -> dict[str, NDArray[np.float64]]:
    try:
        text = parse_csv(content, "time,acceleration", MAX_SAMPLES, "cut a few tens of periods out of it")
    except ModelError as error:
        is_text = "UTF-8" not in str(error)
        raise error if is_text else ModelError(f"{error}; a MAT file has the ending .mat") from None
    _require(list(text.heads), wanted)
    places = {field: text.heads.index(name) for field, name in wanted.items()}
    if "speed" not in places and "speed" in text.heads:
        places["speed"] = text.heads.index("speed")
    return text.numbers(places)
