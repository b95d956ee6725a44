"""What is wrong with a model file: one problem a line, each with the place where it can be mended."""

from __future__ import annotations

import datetime
import difflib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from gapwalk.errors import ModelError

Path = tuple[str | int, ...]
"""The way to a value of a TOML document: its keys, and places in lists from 0."""

_LISTED = 200  # problems in the text of an error; a matrix of strings would fill many screens
_SHOWN = 60  # characters of a value that is given back


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong with a model file.

    Parameters
    ----------
    message
        What was given and what is allowed. After a path it reads on: ``contact[0].clearance is -1; it must ...``.
    path
        Dotted path of the key, for example ``contact[0].clearance``; empty if it concerns the file as a whole.
    line
        Line of the file, from 1; None if the problem has no line (a missing key at the top, say).
    file
        Name of the file as the user gave it.
    """

    message: str
    path: str = ""
    line: int | None = None
    file: str = ""

    def __str__(self) -> str:
        place = self.file
        if self.line:
            place = f"{self.file}:{self.line}" if self.file else f"line {self.line}"
        text = f"{self.path} {self.message}" if self.path else self.message
        return _printable(f"{place}: {text}" if place else text)


class ModelFileError(ModelError):
    """A model file that cannot be used; it lists everything that is wrong with it.

    Parameters
    ----------
    problems
        All that was found, one problem for each thing to mend.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        super().__init__(tuple(problems))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Everything that is wrong, in the order of the file."""
        return self.args[0]

    def __str__(self) -> str:
        lines = [str(problem) for problem in self.problems[:_LISTED]]
        if len(self.problems) > _LISTED:
            lines.append(f"... and {len(self.problems) - _LISTED} more")
        return "\n".join(lines)


def dotted(path: Path) -> str:
    """Write a path as people do: ``contact[0].stage[1].clearance``."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            text += ("." if text else "") + (key if re.fullmatch(r"[\w-]+", key) else json.dumps(key))
    return text


def given(value: object) -> str:
    """Write a value as it may stand in a TOML file, in at most about 60 characters."""
    text = _toml(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def did_you_mean(word: str, known: Sequence[str], what: str = "they are") -> str:
    """Offer the names most like `word`, or all of them if none is like it."""
    near = difflib.get_close_matches(word, known, n=3, cutoff=0.55)
    if near:
        return f"did you mean {' or '.join(near)}?"
    return f"{what} {', '.join(known)}"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value[: 2 * _SHOWN], ensure_ascii=False)
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        items = ("[...]" if isinstance(item, list) else _toml(item) for item in value[:_SHOWN])
        return f"[{', '.join(items)}]"
    if isinstance(value, datetime.date | datetime.time):
        return f"the date or time {value.isoformat()}"
    try:
        return str(value)
    except ValueError:  # an integer of more digits than Python is willing to write
        return "an enormous number"


def _printable(text: str) -> str:
    """Keep one problem on one line, and a terminal safe from what stands in a file."""
    return "".join(char if char.isprintable() else repr(char)[1:-1] for char in text)
