"""Channels of a universal file (UFF): its time histories in data sets 58, read by pyuff.

pyuff reads a file whole. So the sets are found here, piece by piece, and each is given to it alone.
"""

from __future__ import annotations

import re
from functools import partial
from os import SEEK_CUR
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.files import open_file
from gapwalk.model.channels.channel_file import MAX_SAMPLES, ChannelFile

_BEGIN = b"\n    -1"
_MARK = re.compile(rb"\n    -1 *\r?(?:\n|\Z)")
_WIDTH = 6  # of the mark
_LONG, _PIECE = 400, 1 << 22
_TIME = 17  # the kind of an abscissa that is time
_SETS = 1000
_LINES = 13  # of the head of a set
_LONGEST = 60 * MAX_SAMPLES  # bytes of a set of so many samples


class UffChannels(ChannelFile):
    """A universal file; sets with the same abscissa have one time."""

    words, endings = "a universal file (UFF)", (".uff", ".unv", ".uf")
    module = "pyuff"

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        self.file = open_file(path)
        clocks: dict[Any, str] = {}
        for begin, end in _sets(self.file):
            head = self._set(begin, end, header=True)
            even, count = head["abscissa_spacing"] == 1, int(head["num_pts"])
            clock = (head["abscissa_min"], head["abscissa_inc"], count) if even else begin
            problem = "" if head["ord_data_type"] in (2, 4) else "holds complex numbers"
            if head["abscissa_spec_data_type"] not in (0, _TIME):
                problem = f"is not over time, but over {head['abscissa_axis_lab'].strip() or 'another quantity'}"
            label = clocks.setdefault(clock, f"set {len(clocks) + 1}")
            if not problem and not any(each.group == label and each.is_time for each in self.heads):
                self.add(partial(self._numbers, begin, end, "x"), "time", "s", label, count, time=True)
            unit = head["ordinate_axis_units_lab"].strip().replace("NONE", "")
            self.add(partial(self._numbers, begin, end, "data"), _name(head), unit, label, count, problem)

    @classmethod
    def fits(cls, head: bytes) -> bool:
        """See `ChannelFile.fits`."""
        return re.match(rb"\s*?    -1 *\r?\n +\d+", head) is not None

    def _numbers(self, begin: int, end: int, what: str) -> NDArray[Any]:
        found = self._set(begin, end)
        return found[what][: found["num_pts"]]

    def _set(self, begin: int, end: int, *, header: bool = False) -> dict[str, Any]:
        """Give one set to pyuff in a file of its own; of a head only its lines."""
        import pyuff

        if not header and end - begin > _LONGEST:
            raise ModelError(f"its data set has {(end - begin) / 1e6:,.0f} MB; cut a part out of it")
        self.file.seek(begin)
        if header:
            lines = [self.file.readline(_LONG) for _ in range(_LINES + 1)]
            content = b"".join(lines).rstrip(b"\r\n") + b"\n"
        else:
            content = self.file.read(end - begin)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "set.uff"
            path.write_bytes(content + b"    -1\n")
            return pyuff.UFF(str(path)).read_sets(0, header_only=header)


def _sets(file: IO[bytes]) -> list[tuple[int, int]]:
    """Return where the data sets 58 begin and end; the bytes of a binary one are passed over by its length."""
    found: list[tuple[int, int]] = []
    begin = _mark(file, 0)
    while begin is not None and len(found) < _SETS:
        file.seek(begin)
        lines = [file.readline(_LONG) for _ in range(2)]
        if lines[1][:7].strip().lower() == b"58b":
            lines += [file.readline(_LONG) for _ in range(_LINES - 2)]
            file.seek(int(lines[1][31:43]), SEEK_CUR)
        end = _mark(file, file.tell())
        if end is None:
            break
        if lines[1][:6].strip() == b"58":
            found.append((begin, end))
        begin = _mark(file, end + _WIDTH)
    return found


def _mark(file: IO[bytes], begin: int) -> int | None:
    """Return where the next line is that marks the begin or the end of a set, at or after a place."""
    file.seek(begin)
    held = b"\n"
    while piece := file.read(_PIECE):
        held += piece
        place = held.find(_BEGIN)  # far faster than the pattern
        while place >= 0 and not _MARK.match(held, place):
            place = held.find(_BEGIN, place + 1)
        if place >= 0:
            return file.tell() - len(held) + place + 1
        held = held[-_WIDTH - 80 :]
    return None


def _name(head: dict[str, Any]) -> str:
    """Return the name of a set: its first line, or else its node and direction."""
    own = head["id1"].strip()
    if own and own.upper() != "NONE":
        return own
    return f"{head['rsp_node']}:{head['rsp_dir']}"
