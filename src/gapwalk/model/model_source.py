"""The source of a model: the text of its TOML file, what stands in it, and on which line."""

from __future__ import annotations

import difflib
import io
import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

from gapwalk.files import open_file
from gapwalk.model.problems import ModelFileError, Path, Problem, dotted, named
from gapwalk.model.toml_lines import key_lines
from gapwalk.model.toml_size import crowded, too_much_to_parse

MAX_BYTES = 10_000_000
"""A longer file is refused: it is hardly a model."""

_BEGIN = "`gapwalk new FILE` writes a model to begin with"

# Slips that TOML's own messages do not explain.
_RESULT = b"SQLite format 3\0"  # how a result file begins
_SLIPS = (
    (r"[=\[,\s][-+]?(\.\d|\d+\.(?!\d))", "a number needs a digit on both sides of its point, as in 0.5"),
    (r"\b(True|TRUE|False|FALSE)\b", "write true or false in small letters"),
    (r"[=\[]\s*[-+]?\d+,\d", "a number has a point, not a comma, as in 0.5"),
    (r"=\s*[A-Za-z]", "a text stands in quotes"),
    (r"=\s*$", "a value must follow on the same line"),
    (r"^\s*[\w.-]+\s*:", "write key = value"),
)


@dataclass(frozen=True)
class Source:
    """The text of a model file with its content.

    Parameters
    ----------
    name
        Name of the file as the user gave it; it begins every message.
    text
        The text as it was read.
    data
        What tomllib makes of it, with the changes of `with_value` in place.
    changed
        Paths whose values no longer come from the text, so have no line.
    within
        The folder outside of which no matrix is read for it; empty if any may be.
    """

    name: str
    text: str
    data: Mapping[str, Any]
    changed: frozenset[Path] = field(default=frozenset())
    within: str = ""

    @cached_property
    def _lines(self) -> dict[Path, int]:
        return key_lines(self.text)

    def line(self, path: Path) -> int | None:
        """The line of a key, or of the nearest table around it that has one."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.changed:
                return None
            if path[:end] in self._lines:
                return self._lines[path[:end]]
        return None

    def problem(self, message: str, path: Path = ()) -> Problem:
        """A problem of this file, with its line."""
        return Problem(message, dotted(path), self.line(path), self.name, named(path, self.data))

    def with_value(self, path: Path, value: object) -> Source:
        """The same source with another value at one path of tables, and of places in lists of tables."""
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
    """Read a TOML file, or a text that is given as one; `within` as of `Source`.

    Raises
    ------
    ModelFileError
        If there is no such file, or it is no TOML text of at most 10 MB in UTF-8.
    """
    if isinstance(path, io.StringIO):
        return parse_source(path.getvalue(), "", within)
    name = os.fspath(path)
    try:
        with open_file(name) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # a ValueError is a NUL in the name
        raise ModelFileError([Problem(_reason(name, error), file=name)]) from None
    if len(content) > MAX_BYTES:
        size = f"is larger than {MAX_BYTES // 1_000_000} MB"
        raise ModelFileError([Problem(f"the file {size}; a model file is a short text", file=name)])
    if content.startswith(_RESULT):
        message = "this is a result, not a model file; `gapwalk show` tells what it holds, and gw.load reads it"
        raise ModelFileError([Problem(message, file=name)])
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        message = f"byte 0x{content[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ModelFileError([Problem(message, line=line, file=name)]) from None
    return parse_source(text, name, within)


def parse_source(text: str, name: str = "", within: str = "") -> Source:
    """Parse a TOML text; `name` begins every message about it, `within` is as of `Source`.

    Raises
    ------
    ModelFileError
        If it is empty, not TOML, or has more in it than a model can have.
    """
    if too_much := too_much_to_parse(text):
        raise ModelFileError([Problem(too_much[0], line=too_much[1], file=name)])
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ModelFileError([Problem("lists or tables are nested too deeply", file=name)]) from None
    except ValueError as error:  # most are TOMLDecodeError; an integer of 5,000 digits is a plain one
        raise ModelFileError([_syntax_problem(str(error), text, name)]) from None
    if not data:
        raise ModelFileError([Problem(f"the file is empty; {_BEGIN}", file=name)])
    source = Source(name, text, data, within=within)
    if problems := [source.problem(message, path) for path, message in crowded(data)]:
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
        near = difflib.get_close_matches(FilePath(name).name.removesuffix(".toml").casefold(), stems, n=3)
        hint = f"did you mean {' or '.join(stems[stem] for stem in near)}?" if near else _BEGIN
        return f"there is no such file; {hint}"
    if isinstance(error, IsADirectoryError):
        return "this is a folder; name a file in it"
    return f"the file cannot be read: {getattr(error, 'strerror', None) or error}"


def _syntax_problem(message: str, text: str, name: str) -> Problem:
    match = re.search(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if not match:
        return Problem(f"not TOML: {message}", file=name)
    reason = message[: match.start()]
    lines = text.split("\n")
    if match[1] is None:
        return Problem(f"not TOML: {reason} at the end of the file", line=len(lines), file=name)
    number, column = int(match[1]), int(match[2])
    shown = lines[number - 1].strip()[:60] if number <= len(lines) else ""
    if twice := re.match(r"Cannot declare \('(\w+)',\) twice", reason):
        key = twice[1]
        own = ", and give each a name" if key == "study" else ""
        message = f"not TOML: [{key}] stands here a second time; where there are several, write [[{key}]] for each{own}"
        return Problem(message, line=number, file=name)
    hint = next((hint for slip, hint in _SLIPS if re.search(slip, shown)), "")
    return Problem(
        f"not TOML: {reason}, column {column}: {shown}" + (f" ({hint})" if hint else ""),
        line=number,
        file=name,
    )
