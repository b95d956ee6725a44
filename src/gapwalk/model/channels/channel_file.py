"""A file of measured data as channels with names, units and numbers, and the registry of the formats.

A format is one class in one file: how its files begin, and how the names and the numbers of its channels are read. What
asks for columns of numbers (loads, curves, records, run-ups) knows no format. A file is read by channel, never whole.
"""

from __future__ import annotations

import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.files import content_of, open_file
from gapwalk.model.channels.text_table import parse_csv
from gapwalk.model.registry import Registry
from gapwalk.model.units import QuantityKind, read_unit

MAX_BYTES = 10_000_000
"""Largest size of a text file, which is read whole."""
MAX_ROWS = 100_000
"""Largest number of rows of a table."""
MAX_SAMPLES = 4_000_000
"""Largest number of samples of a channel of a record over time."""

_NO_UNIT = ("", "-", "1")
_HEADS = 20_000  # bytes of a text in which its line of names is
_HEAD = 1024  # bytes by which a format is known
_ENDS = 16_000_000  # bytes at either end of a file by which a change of it is noticed
_LISTED = 20  # channels that a message lists


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file that a model file names, with its content; one that is read by channel has a digest in place of it."""

    name: str  #: Its name, as it stands in the model file.
    content: bytes  #: Its bytes, or a digest of them if there is a path.
    path: str = ""  #: Where it is read by channel; empty if the content is all of it.

    def __repr__(self) -> str:
        return repr(self.name)


@dataclass(frozen=True, slots=True)
class ColumnHead:
    """The name of a column, divided into its name and its unit; without a unit, `unit` is empty."""

    text: str  #: As it is written, such as ``torque (N m)``.
    name: str
    unit: str
    #: Channels of one group were sampled together.
    group: str = ""
    count: int = -1  #: Number of samples; -1 where only reading tells.
    problem: str = ""  #: Why it holds no numbers, such as "holds texts"; empty if it does.
    is_time: bool = False  #: True for the time of its group.

    @classmethod
    def of(cls, text: str) -> ColumnHead:
        """Divide a text at the last bracket that is not within others, as that of ``damping (N m/(rad s))``."""
        opening = {")": "(", "]": "["}.get(text[-1:])
        if opening:
            depth = 0
            for place in range(len(text) - 1, -1, -1):
                depth += (text[place] == text[-1]) - (text[place] == opening)
                if not depth:
                    unit = text[place + 1 : -1].strip()
                    return cls(text, text[:place].strip(), "" if unit in _NO_UNIT else unit)
        return cls(text, text.strip(), "")

    @classmethod
    def channel(
        cls, name: str, unit: str, group: str = "", count: int = -1, problem: str = "", *, time: bool = False
    ) -> ColumnHead:
        """Return the head of a channel; one whose name has the unit, such as ``speed (rpm)``, needs no other."""
        written = cls.of(name)
        unit = "" if unit.strip() in _NO_UNIT else unit.strip()
        if unit and written.unit != unit:
            written = cls(f"{name} ({unit})", name, unit)
        return cls(written.text, written.name, written.unit, group, count, problem, time)

    def is_of(self, kind: QuantityKind) -> bool:
        """Return True if its unit is one of a kind."""
        try:
            return bool(self.unit) and bool(read_unit(spelled(self.unit), kind))
        except ValueError:
            return False


# Spellings of files that nobody can correct; in a model file the unit itself is asked for.
_SPELLED = {
    **dict.fromkeys(("1/min", "min-1", "min^-1", "U/min", "r/min", "rev/min", "RPM", "/min"), "rpm"),
    **dict.fromkeys(("°CA", "°KW", "CAD", "degCA", "grad", "Grad", "degree", "degrees"), "deg"),
    **dict.fromkeys(("seconds", "sec."), "s"),
}


def spelled(unit: str) -> str:
    """Return a unit of a file as it is written in a model file."""
    return _SPELLED.get(unit.strip(), unit)


class ChannelFile(ABC):
    """An open file of measured data; what its library raises is turned into a sentence by `open_channels`."""

    words: ClassVar[str]
    """Words for such a file: ``"a TDMS file of LabVIEW"``."""
    endings: ClassVar[tuple[str, ...]]
    """Endings of its files, with the point."""
    begins: ClassVar[tuple[bytes, ...]] = ()
    """First bytes of its files."""
    row: str = "sample"
    """The word for a number of a channel in messages."""
    first: int = 1
    """Number of the first of them."""
    module: ClassVar[str] = ""
    """The library that reads it, in a process of its own; empty if gapwalk does."""
    file: Any = None
    """An open file."""

    def __init__(self, path: str) -> None:
        self.heads: list[ColumnHead] = []  #: Its channels.
        self._readers: list[Callable[[], NDArray[Any]]] = []
        self.open(path)

    @abstractmethod
    def open(self, path: str) -> None:
        """Open a file, and `add` its channels without reading any numbers."""

    def add(self, read: Callable[[], NDArray[Any]], name: str, unit: str, *more: Any, **time: bool) -> None:
        """Add a channel with the function that reads its numbers, shape (samples,); see `ColumnHead.channel`."""
        self._readers.append(read)
        self.heads.append(ColumnHead.channel(name, unit, *more, **time))

    def read(self, place: int) -> NDArray[np.float64]:
        """Read the numbers of one channel, shape (samples,)."""
        return self.numbers({"": place}, MAX_SAMPLES)[""]

    def close(self) -> None:
        """Close the file."""
        if self.file is not None:
            self.file.close()

    @classmethod
    def fits(cls, head: bytes) -> bool:
        """Return True if a file with these first bytes is of this format."""
        return head.startswith(cls.begins)

    def numbers(self, places: Mapping[str, int], most: int) -> dict[str, NDArray[np.float64]]:
        """Read channels by labels for messages, of one length and `most` numbers; groups meet at the finest times."""
        heads = {label: self.heads[place] for label, place in places.items()}
        for label, head in heads.items():
            if head.problem:
                raise ModelError(f"the channel {label!r} {head.problem}; name a channel of real numbers")
            if head.count > most:
                raise ModelError(f"{label} has {head.count:,} samples; give at most {most:,}: cut a part out of it")
        found = {label: _plain(label, self._readers[place]()) for label, place in places.items()}
        if len({each.group for each in heads.values()}) > 1:
            found = self._together(found, heads)
        lengths = {label: len(column) for label, column in found.items()}
        if len({*lengths.values()}) > 1:
            listed = ", but ".join(f"{label} has {count:,} samples" for label, count in lengths.items())
            raise ModelError(f"{listed}; channels that belong together have equally many: name channels of one group")
        return found

    def _together(
        self, found: dict[str, NDArray[np.float64]], heads: Mapping[str, ColumnHead]
    ) -> dict[str, NDArray[np.float64]]:
        times = {head.group: place for place, head in enumerate(self.heads) if head.is_time}
        if any(head.group not in times for head in heads.values()):
            return found
        groups = dict.fromkeys(each.group for each in heads.values())
        own = {group: _plain("time", self._readers[times[group]]()) for group in groups}
        finest = max(own, key=lambda group: len(own[group]))
        at = own[finest]
        begin, end = max(each[0] for each in own.values()), min(each[-1] for each in own.values())
        kept = (at >= begin) & (at <= end)
        return {
            label: column[kept]
            if heads[label].group == finest
            else np.interp(at[kept], own[heads[label].group], column)
            for label, column in found.items()
        }

    def where(self, row: int) -> str:
        """Say where a row stands in the file, as in ``line 5``."""
        return f"{self.row} {row + self.first}"


def _plain(label: str, numbers: NDArray[Any]) -> NDArray[np.float64]:
    if numbers.dtype.kind not in "fiub" or numbers.ndim != 1:
        raise ModelError(f"the channel {label!r} holds {numbers.dtype} of shape {numbers.shape}; name one of numbers")
    return np.array(numbers, dtype=np.float64)


_HOMES = {
    name: f"gapwalk.model.channels.{name}_channels.{name.capitalize()}Channels"
    for name in ("mat", "hdf", "workbook", "mdf", "tdms", "uff")
}
FORMATS: Registry[type[ChannelFile]] = Registry("format of measured data", "formats of measured data", _HOMES)


class TextChannels(ChannelFile):
    """A CSV file: what no format claims."""

    words, endings, row = "a text file", (".csv", ".txt", ".tsv", ".asc"), "line"

    def __init__(self, content: bytes, example: str) -> None:
        self._text = parse_csv(content, example, MAX_ROWS, "leave out rows")
        self.heads = list(map(ColumnHead.of, self._text.heads))

    def open(self, path: str) -> None:
        """Do nothing: its content is known."""

    def numbers(self, places: Mapping[str, int], most: int) -> dict[str, NDArray[np.float64]]:
        """See `ChannelFile.numbers`."""
        if not self._text.rows:
            raise ModelError("it has a line of names, but no numbers below it")
        return self._text.numbers(places)

    def where(self, row: int) -> str:
        """See `ChannelFile.where`."""
        return f"line {self._text.rows[row][0]}"


def formats() -> list[type[ChannelFile]]:
    """Return all formats but text."""
    return list(map(FORMATS.named, FORMATS.names))


def endings() -> tuple[str, ...]:
    """Return the endings of all files of measured data, CSV first."""
    return (".csv", *(ending for each in formats() for ending in each.endings))


def format_of_file(path: str | os.PathLike[str]) -> type[ChannelFile]:
    """Return the format of a file by its first bytes; raise a ModelError if its ending says another."""
    try:
        with open_file(path) as file:
            head = file.read(_HEAD)
    except (OSError, ValueError) as error:
        raise ModelError(f"it cannot be read: {getattr(error, 'strerror', None) or error}") from None
    found = next((each for each in formats() if each.fits(head)), TextChannels)
    ending = os.path.splitext(os.fspath(path))[1].lower()
    named = next((each for each in (TextChannels, *formats()) if ending in each.endings), found)
    if not head or named is found or ending in found.endings:
        return found
    if found is TextChannels and b"\0" in head:
        version = "; a MAT file of version 4 is written again by save(..., '-v7')" if ending == ".mat" else ""
        raise ModelError(f"its name ends in {ending}, but its first bytes are not those of {named.words}{version}")
    begin = head[:20].decode("utf-8", "replace").split("\n")[0]
    raise ModelError(
        f"its name ends in {ending}, as that of {named.words}, but it begins as {found.words} ({begin!r}); "
        f"give it the ending {found.endings[0]}"
    )


def named_file(name: str, path: str) -> NamedFile:
    """Return a file that a model file names: a text with its content, others with a digest; raise a ValueError."""
    if not os.path.isfile(path) or format_of_file(path) is TextChannels:
        return NamedFile(name, content_of(path, MAX_BYTES, "leave out rows"))
    size, digest = os.path.getsize(path), hashlib.sha256()
    with open_file(path) as file:
        for begin in sorted({0, max(size - _ENDS, 0)}):
            file.seek(begin)
            digest.update(file.read(_ENDS))
    return NamedFile(name, digest.digest() + size.to_bytes(8, "little"), path)


@contextmanager
def open_channels(
    source: str | os.PathLike[str] | NamedFile, example: str, *, names_only: bool = False
) -> Iterator[ChannelFile]:
    """Open a file, of a text for its names alone only the beginning; errors are without the name of the file."""
    content = source.content if isinstance(source, NamedFile) and not source.path else None
    path = source.path if isinstance(source, NamedFile) else os.fspath(source)
    form = TextChannels if content is not None else format_of_file(path)
    if form is TextChannels:
        try:
            if content is None:
                content = _beginning(path) if names_only else content_of(path, MAX_BYTES, "leave out rows")
        except ValueError as error:
            raise ModelError(f"it {error}") from None
        yield TextChannels(content, example)
        return
    held: ChannelFile | None = None
    try:
        held = _opened(path, form)
        if not held.heads:
            raise ModelError(f"it is {form.words} without any channel, so there is nothing to read")
        yield held
    except ModelError:
        raise
    except Exception as error:  # what reads damaged files raises anything
        told = " ".join(str(error).split())[:120] or type(error).__name__
        raise ModelError(f"it is {form.words} that cannot be read ({told}); write it again, or as CSV") from None
    finally:
        if held is not None:
            held.close()


def _opened(path: str, form: type[ChannelFile]) -> ChannelFile:
    if not form.module:
        return form(path)
    if find_spec(form.module) is None:
        raise ModelError(
            f'it is {form.words}, which needs {form.module}; install it: pip install "gapwalk[files]", or write it as '
            "CSV"
        )
    from gapwalk.model.channels.channel_process import ChannelsApart  # it reads formats

    return ChannelsApart(path, next(name for name in FORMATS.names if FORMATS.named(name) is form))


def _beginning(path: str) -> bytes:
    with open_file(path) as file:
        content = file.read(_HEADS)
    return content[: content.rfind(b"\n") + 1] if len(content) == _HEADS else content
