"""The source of a model: the text of a TOML file, its content, its lines, and limits of its size."""

from __future__ import annotations

import difflib
import io
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

from gapwalk.files import open_file
from gapwalk.model.problems import ModelFileError, Path, Problem, dotted, named

MAX_BYTES = 10_000_000
"""Largest size of a file; a longer one is hardly a model."""

MAX_PARTS = 20
"""Largest number of parts of a dotted key; model files use five.

A key of n parts costs tomllib n^2 / 2 references: one of 50,000 parts, 100 kB of text, takes 8 GB.
"""

MAX_NESTS = 100_000
"""Largest number of tables and lists in a file, each of which costs tomllib about a kilobyte beyond its content.

A system of 1,000 coordinates with as many contacts has some 10,000.
"""

MAX_ENTRIES = 20_000
"""Largest number of entries of one table or list; the longest useful ones are states, of 2,000 numbers."""

_BEGIN = "`gapwalk new FILE` writes a model to begin with"
_RESULT = b"SQLite format 3\0"  # how a result file begins

# Slips that TOML's own messages do not explain.
_SLIPS = (
    (r"^\[\[[^][]*\](?!\])|^\[[^][]*\]\]", "a table in a list has two brackets on either side, as in [[gear]]"),
    (r"[=\[,\s][-+]?(\.\d|\d+\.(?!\d))", "a number needs a digit on both sides of its point, as in 0.5"),
    (r"\b(True|TRUE|False|FALSE)\b", "write true or false in small letters"),
    (r"[=\[]\s*[-+]?\d+,\d", "a number has a point, not a comma, as in 0.5"),
    (r"=\s*[A-Za-z]", "write a text in quotes"),
    (r"[\[,]\s*[A-Za-z]\w*\s*[\],]", 'write each name in quotes, as in ["x", "y"]'),
    (r"=\s*$", "a value must follow on the same line"),
    (r"^\s*[\w.-]+\s*:", "write key = value"),
)

_ENDING = re.compile(r"\.t\w{0,4}$")  # .toml, or what was meant to be it

_STRING = re.compile(
    r'''"""(?:\\.|[^\\])*?"""(?:"{0,2})|\'\'\'.*?\'\'\'(?:'{0,2})|"(?:[^"\\\n]|\\.)*"|'[^'\n]*\'''', re.DOTALL
)
# Texts, marks and words, which are all that determines the lines of keys.
_WORDS = re.compile(rf"""(?:{_STRING.pattern})|[][{{}}=,.\n]|[^][{{}}=,.\s\#"']+|\#[^\n]*""", re.DOTALL)
_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[A-Za-z0-9_-]++)"""
# Skips texts and comments; matches a dotted key from its first point on.
_TOKEN = re.compile(
    rf"""(?:{_STRING.pattern})|\#[^\n]*+|(?P<key>(?:\.[ \t]*+{_PART}[ \t]*+)++)(?=[=\]])|(?P<nest>[\[{{])""", re.DOTALL
)


@dataclass(frozen=True)
class Source:
    """The text of a model file with its content."""

    name: str  #: Name of the file as the user gave it; it begins every message.
    text: str  #: The text as it was read.
    data: Mapping[str, Any]  #: Content of the text as parsed by tomllib, with the changes of `with_value`.
    #: Paths whose values do not come from the text, so that they have no line.
    changed: frozenset[Path] = field(default=frozenset())
    within: str = ""  #: Folder to which the files of matrices are confined; empty if they may be anywhere.

    @cached_property
    def _lines(self) -> dict[Path, int]:
        return key_lines(self.text)

    def line(self, path: Path) -> int | None:
        """Return the line of a key, or of the nearest table around it that has one."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.changed:
                return None
            if path[:end] in self._lines:
                return self._lines[path[:end]]
        return None

    def problem(self, message: str, path: Path = ()) -> Problem:
        """Make a problem of this file, with its line."""
        return Problem(message, dotted(path), self.line(path), self.name, named(path, self.data))

    def with_value(self, path: Path, value: object) -> Source:
        """Return a source with another value at one path of tables, and of places in lists of tables."""
        data: Any = dict(self.data)
        table: Any = data
        for depth, key in enumerate(path[:-1], start=1):
            inner: Any = table[key] if isinstance(key, int) else table.get(key, {})
            if not isinstance(inner, list if isinstance(path[depth], int) else Mapping):
                raise ModelFileError([self.problem("is no table, so nothing in it can be changed", path[:depth])])
            table[key] = list(inner) if isinstance(inner, list) else dict(inner)
            table = table[key]
        table[path[-1]] = value
        return replace(self, data=data, changed=self.changed | {path})


def read_source(path: str | os.PathLike[str] | io.StringIO, within: str = "") -> Source:
    """Read a TOML file, or its text as ``io.StringIO``; for `within`, see `Source`."""
    if isinstance(path, io.StringIO):
        return parse_source(path.getvalue(), "", within)
    name = os.fspath(path)
    try:
        with open_file(name) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # a ValueError is a NUL in the name
        raise _refusal(_reason(name, error), name) from None
    if len(content) > MAX_BYTES:
        raise _refusal(f"the file is larger than {MAX_BYTES // 1_000_000} MB; a model file is a short text", name)
    if name.endswith((".csv", ".xlsx")):
        raise _refusal(
            f"a table is no model file; gapwalk new train.toml --from {name} makes one of a drive train", name
        )
    if content.startswith(_RESULT):
        message = "this is a result, not a model file; `gapwalk show` prints its content, and gw.open_result reads it"
        raise _refusal(message, name)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"byte 0x{content[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise _refusal(message, name, content.count(b"\n", 0, error.start) + 1) from None
    return parse_source(text, name, within)


def parse_source(text: str, name: str = "", within: str = "") -> Source:
    """Parse a TOML text; for `name` and `within`, see `Source`."""
    _check_size(text, name)
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise _refusal("lists or tables are nested too deeply", name) from None
    except ValueError as error:  # most are TOMLDecodeError; an integer of 5,000 digits is a plain one
        message, line = _syntax_problem(str(error), text)
        raise _refusal(f"not TOML: {message}", name, line) from None
    if not data:
        raise _refusal(f"the file is empty; {_BEGIN}", name)
    source = Source(name, text, data, within=within)
    if problems := list(_long_tables(source)):
        raise ModelFileError(problems)
    return source


def _reason(name: str, error: Exception) -> str:
    if isinstance(error, FileNotFoundError):
        folder = FilePath(name).parent
        try:
            there = [file.name for file in folder.iterdir() if file.suffix == ".toml"]
        except OSError:
            return f"there is no folder {str(folder)!r}"
        stems = {file.removesuffix(".toml").casefold(): file for file in there}  # the ending is common to all
        asked = FilePath(name).name.casefold()
        asked = FilePath(asked).stem if _ENDING.search(asked) else asked
        near = difflib.get_close_matches(asked, stems, n=3)
        hint = f"did you mean {' or '.join(stems[stem] for stem in near)}?" if near else _BEGIN
        return f"there is no such file; {hint}"
    if isinstance(error, IsADirectoryError):
        return "this is a folder; name a file in it"
    return f"the file cannot be read: {getattr(error, 'strerror', None) or error}"


def _refusal(message: str, name: str, line: int | None = None) -> ModelFileError:
    return ModelFileError([Problem(message, line=line, file=name)])


def _syntax_problem(message: str, text: str) -> tuple[str, int | None]:
    """Explain a message of tomllib, and return the line to which it refers."""
    match = re.search(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if not match:
        return message, None
    reason, lines = message[: match.start()], text.split("\n")
    if match[1] is None:
        return f"{reason} at the end of the file", len(lines)
    number = int(match[1])
    line = lines[number - 1].strip() if number <= len(lines) else ""
    shown = line[:60] + "..." * (len(line) > 60)
    if twice := re.match(r"Cannot declare \('(\w+)',\) twice", reason):
        key = twice[1]
        own = ", and give each a name" if key == "study" else ""
        return f"[{key}] is here a second time; if there are several, write [[{key}]] for each{own}", number
    quotes = re.sub(r'\\.|\'[^\']*\'|"""', "", line).count('"')
    if quotes % 2 and "'''" not in line:
        return f'a quotation mark " is missing: {shown}', number
    hint = next((f" ({hint})" for slip, hint in _SLIPS if re.search(slip, shown)), "")
    return f"{reason}, column {match[2]}: {shown}{hint}", number


def _check_size(text: str, name: str) -> None:
    """Refuse a text that would need too much memory; before parsing, as tomllib has no limit."""
    nests, message = 0, ""
    for token in _TOKEN.finditer(text):
        if token["key"]:
            parts = 1 + token["key"].count(".")
            if parts > MAX_PARTS:
                message = f"a key has {parts:,} parts; it may have {MAX_PARTS}"
            nests += parts - 1
        elif token["nest"]:
            nests += 1
        if nests > MAX_NESTS:
            message = message or f"there are more than {MAX_NESTS:,} tables and lists; a model has fewer"
        if message:
            raise _refusal(message, name, text.count("\n", 0, token.start()) + 1)


def _long_tables(source: Source) -> Iterator[Problem]:
    """Find tables and lists with more entries than any model has."""
    waiting: list[tuple[Path, Any]] = [((), source.data)]
    while waiting:
        path, value = waiting.pop()
        if len(value) > MAX_ENTRIES:
            what = "" if path else "the file "
            message = f"{what}has {len(value):,} entries; a table or a list may have {MAX_ENTRIES:,}"
            yield source.problem(message, path)
            continue
        items = value.items() if isinstance(value, Mapping) else enumerate(value)
        waiting += [((*path, key), each) for key, each in items if isinstance(each, list | Mapping)]


def key_lines(text: str) -> dict[Path, int]:
    """Find the line of every key, table and list item of a TOML text; tomllib keeps no lines."""
    scan = _Scan(text)
    with suppress(ValueError, RecursionError):  # a line is a help, never a reason to fail
        scan.document()
    return scan.lines


def value_spans(text: str) -> dict[Path, tuple[int, int]]:
    """Find where in a TOML text each number, text or other single value stands, so that it alone can be replaced."""
    scan = _Scan(text)
    with suppress(ValueError, RecursionError):
        scan.document()
    return scan.spans


class _Scan:
    """One pass over the words of a text, which has reached `word` in `line`; at the end of the text it is empty."""

    def __init__(self, text: str) -> None:
        self.lines: dict[Path, int] = {}
        self.spans: dict[Path, tuple[int, int]] = {}
        self._items: dict[Path, int] = {}  # last index of each [[array of tables]]
        self._words = (match for match in _WORDS.finditer(text) if match.group()[0] != "#")
        self.word, self.line = "", 1
        self._begin = self._passed = 0  # where `word` begins, and where the word before it ended
        self._next()

    def _next(self) -> str:
        """Move on to the next word beyond comments, and return the one before it."""
        passed = self.word
        self.line += passed.count("\n")
        self._passed = self._begin + len(passed)
        found = next(self._words, None)
        self.word, self._begin = (found.group(), found.start()) if found else ("", self._passed)
        return passed

    def _skip_breaks(self) -> None:
        while self.word == "\n":
            self._next()

    def document(self) -> None:
        """Read the entire text."""
        table: Path = ()
        self._skip_breaks()
        while self.word:
            if self.word == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip_breaks()

    def _header(self) -> Path:
        line, path = self.line, ()
        self._next()
        array = self.word == "["
        if array:
            self._next()
        keys = self._keys()
        for depth, key in enumerate(keys, start=1):
            path = (*path, key)
            self.lines.setdefault(path, line)
            if array and depth == len(keys):
                self._items[path] = self._items.get(path, -1) + 1
            if path in self._items:
                path = (*path, self._items[path])
                self.lines.setdefault(path, line)
        for _ in range(1 + array):
            self._next()
        return path

    def _pair(self, table: Path) -> None:
        line, path = self.line, table
        for key in self._keys():
            path = (*path, key)
            self.lines.setdefault(path, line)
        if self._next() != "=":
            raise ValueError("= was expected")
        self._value(path)

    def _keys(self) -> list[str]:
        keys = []
        while True:
            raw = self._next()
            if not raw or raw in "[]{}=,.\n":
                raise ValueError("a key was expected")
            keys.append(tomllib.loads(f"x = {raw}")["x"] if raw[0] in "\"'" else raw)
            if self.word != ".":
                return keys
            self._next()

    def _value(self, path: Path) -> None:
        self._skip_breaks()
        if self.word in ("[", "{"):
            self._sequence("]" if self._next() == "[" else "}", path)
        else:
            begin = self._begin
            while self.word and self.word not in ",]}\n":
                self._next()
            self.spans[path] = (begin, self._passed)

    def _sequence(self, end: str, path: Path) -> None:
        """Read a list, or an inline table, after its beginning."""
        self._skip_breaks()
        index = 0
        while self.word != end:
            if not self.word:
                raise ValueError("the text ends too early")
            if end == "]":
                self.lines[*path, index] = self.line
                self._value((*path, index))
            else:
                self._pair(path)
            index += 1
            self._skip_breaks()
            if self.word == ",":
                self._next()
                self._skip_breaks()
        self._next()
