"""Descriptions of fields: comments behind or above them, from which `help`, pages and tables of keys are made.

A field is described where it stands, ``cells: int  #: Number of cells.``, or in lines above it that begin with ``#:``.
A description may begin with the names of several fields, ``#: low, high: Limits.``, and with a shape,
``#: shape (n,): Deflections.``.
"""

from __future__ import annotations

import inspect
import re
import sys
from functools import cache
from linecache import getlines
from typing import Any, NamedTuple

_FIELD = re.compile(r"(\w+)\s*:")
_SEVERAL = re.compile(r"(\w+(?:, \w+)+): ")
_SHAPE = re.compile(r"((?:\w+, )?shapes? \([^:]*): ")
_ENTRY = re.compile(r"^(\S[^\n]*)\n((?:    [^\n]*\n?|\n)+)", re.M)
_HEADING = re.compile(r"^(Parameters|Attributes)\n-+\n", re.M)
_NEXT = re.compile(r"\n\n(?=\w[\w ]*\n-{3,}\n)")


class FieldDoc(NamedTuple):
    """Description of fields: their names, as a numpydoc entry has them with their shape, and the words."""

    names: tuple[str, ...]
    heading: str
    words: str


@cache
def own_field_docs(kind: type) -> tuple[FieldDoc, ...]:
    """Return the descriptions of the fields that a class itself declares, in their order."""
    lines = _source_lines(kind)
    fields = vars(kind).get("__annotations__", {})
    found, above = [], []
    for line in map(str.strip, lines):
        if line.startswith("#: "):
            above.append(line[3:])
            continue
        field = _FIELD.match(line)
        words = " ".join(above) or line.partition("  #: ")[2]
        above = []
        if field and field[1] in fields and words:
            several = _SEVERAL.match(words)
            names = tuple(several[1].split(", ")) if several else ()
            if names and all(name in fields for name in names):
                words = words.removeprefix(f"{', '.join(names)}: ")
            else:
                names = (field[1],)
            shape = _SHAPE.match(words)
            heading = ", ".join(names) + (f" : {shape[1]}" if shape else "")
            found.append(FieldDoc(names, heading, words[shape.end() :] if shape else words))
    return tuple(found)


def _source_lines(kind: type) -> list[str]:
    """Return the source of a class, by lines; empty for a class of an interactive session."""
    lines = getlines(getattr(sys.modules.get(kind.__module__), "__file__", None) or "")
    heads = [place for place, line in enumerate(lines) if re.match(rf"class {kind.__qualname__}\b", line)]
    if len(heads) == 1:  # `inspect.getsource` parses the whole file, which takes 30 times as long
        after = enumerate(lines[heads[0] + 1 :], start=heads[0] + 1)
        end = next((place for place, line in after if line[:1].strip(" )\n")), len(lines))
        return lines[heads[0] : end]
    try:
        return inspect.getsource(kind).splitlines()
    except (OSError, TypeError):
        return []


def field_docs(kind: type) -> list[FieldDoc]:
    """Return the descriptions of the fields of a record, those of its base classes first."""
    return [each for base in reversed(kind.__mro__) for each in own_field_docs(base)]


def field_words(kind: type) -> dict[str, str]:
    """Return the words of each field of a record; those of its docstring, and of the nearest class, hold."""
    # Where a docstring lists several fields together, such as those that are as in a base class, the words of that
    # hold.
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        found |= {name: each.words for each in own_field_docs(base) for name in each.names}
        for names, words in _entries(inspect.cleandoc(_raw(base))):
            known = found if len(names) > 1 else {}
            found |= {name: words for name in names if name not in known}
    return found


def documented(kind: type) -> str:
    """Return the docstring of a class with a section that describes the fields which it declares itself."""
    text = inspect.cleandoc(_raw(kind))
    own = own_field_docs(kind)
    if not own:
        return text
    entries = "\n".join(f"{each.heading}\n    {each.words}" for each in own)
    heading = _HEADING.search(text)
    if heading:  # what the docstring says there follows
        return f"{text[: heading.end()]}{entries}\n{text[heading.end() :]}"
    name = "Attributes" if hasattr(kind, "to_dict") or hasattr(kind, "_fields") else "Parameters"
    head, *rest = _NEXT.split(text, maxsplit=1)
    return "\n\n".join([head, f"{name}\n{'-' * len(name)}\n{entries}", *rest])


class WholeDoc:
    """The ``__doc__`` of a record with the descriptions of its fields, put together when it is read."""

    def __init__(self, text: str | None) -> None:
        self.text = text or ""

    def __get__(self, instance: Any, kind: type) -> str:
        """Return the docstring of the class for which it was set, and that of a class derived from it as it is."""
        return documented(kind) if vars(kind).get("__doc__") is self else self.text


def _raw(kind: type) -> str:
    """Return the docstring of a class itself as it is written; what a dataclass writes on its own is none."""
    text = vars(kind).get("__doc__")
    text = text.text if isinstance(text, WholeDoc) else text
    return "" if not text or text.startswith(f"{kind.__name__}(") else text


def _entries(text: str) -> list[tuple[list[str], str]]:
    """Return the names and the words of the entries of the sections that describe parameters and attributes."""
    _, *parts = _HEADING.split(text)
    sections = [_NEXT.split("\n\n" + part, maxsplit=1)[0] for part in parts[1::2]]
    return [
        ([name.strip() for name in match[1].partition(":")[0].split(",")], " ".join(match[2].split()))
        for section in sections
        for match in _ENTRY.finditer(section.strip("\n") + "\n")
    ]
