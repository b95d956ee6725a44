"""On which line of a TOML text each key and each list item stands (tomllib keeps no places)."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from contextlib import suppress

from gapwalk.model.problems import Path

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'""")
STRING = re.compile(
    r'''"""(?:\\.|[^\\])*?"""(?:"{0,2})|\'\'\'.*?\'\'\'(?:'{0,2})|"(?:[^"\\\n]|\\.)*"|'[^'\n]*\'''', re.DOTALL
)
_PLAIN = re.compile(r"[^,\]}\n#]*")  # numbers, booleans, dates


def key_lines(text: str) -> dict[Path, int]:
    """Find the line of every key, table and list item of a TOML text.

    Parameters
    ----------
    text
        A text that tomllib accepts. For any other, what was found before the first surprise is returned.

    Returns
    -------
    dict
        Line, from 1, by path, for example ``{("contact", 0, "clearance"): 12}``.
    """
    scan = _Scan(text)
    with suppress(ValueError, RecursionError):  # a line is a help, never a reason to fail
        scan.document()
    return scan.lines


class _Scan:
    """One pass over a text; `at` is the place that it has reached."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Path, int] = {}
        self._breaks = [match.start() for match in re.finditer("\n", text)]
        self._items: dict[Path, int] = {}  # last index of each [[array of tables]]

    def document(self) -> None:
        """Read the whole text."""
        table: Path = ()
        self._skip(_BLANK)
        while self.at < len(self.text):
            table = self._header() if self._peek() == "[" else self._pair(table)
            self._skip(_BLANK)

    def _header(self) -> Path:
        line = self._line()
        array = self.text.startswith("[[", self.at)
        self.at += 2 if array else 1
        path: Path = ()
        keys = self._keys()
        for depth, key in enumerate(keys, start=1):
            path = (*path, key)
            self.lines.setdefault(path, line)
            if array and depth == len(keys):
                self._items[path] = self._items.get(path, -1) + 1
            if path in self._items:
                path = (*path, self._items[path])
                self.lines.setdefault(path, line)
        self.at += 2 if array else 1
        return path

    def _pair(self, table: Path) -> Path:
        line, path = self._line(), table
        for key in self._keys():
            path = (*path, key)
            self.lines.setdefault(path, line)
        self._expect("=")
        self._value(path)
        return table

    def _keys(self) -> list[str]:
        keys = []
        while True:
            self._skip(_SPACE)
            match = _KEY.match(self.text, self.at)
            if not match:
                raise ValueError("a key was expected")
            self.at = match.end()
            raw = match.group()
            keys.append(tomllib.loads(f"x = {raw}")["x"] if raw[0] in "\"'" else raw)
            self._skip(_SPACE)
            if self._peek() != ".":
                return keys
            self.at += 1

    def _value(self, path: Path) -> None:
        self._skip(_BLANK)
        first = self._peek()
        if first in "\"'":
            self._skip(STRING)
        elif first == "[":
            self._sequence("]", path)
        elif first == "{":
            self._sequence("}", path)
        else:
            self._skip(_PLAIN)

    def _sequence(self, end: str, path: Path) -> None:
        """Read a list, or an inline table."""
        self.at += 1
        self._skip(_BLANK)
        index = 0
        while self._peek() != end:
            if end == "]":
                self.lines[*path, index] = self._line()
                self._value((*path, index))
            else:
                self._pair(path)
            index += 1
            self._skip(_BLANK)
            if self._peek() != end:
                self._expect(",")
                self._skip(_BLANK)
        self.at += 1

    def _line(self) -> int:
        return bisect_left(self._breaks, self.at) + 1

    def _peek(self) -> str:
        if self.at >= len(self.text):
            raise ValueError("the text ends too early")
        return self.text[self.at]

    def _expect(self, char: str) -> None:
        if self._peek() != char:
            raise ValueError(f"{char} was expected")
        self.at += 1

    def _skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.at)
        if match:
            self.at = match.end()
