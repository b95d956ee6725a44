"""How much a TOML text may ask of its parser; judged before it is parsed, as tomllib keeps much of every table.

A key of n parts costs tomllib n^2 / 2 references: one of 50,000 parts, 100 kB of text, takes 8 GB. Each table and each
list costs it about a kilobyte more than what stands in it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from gapwalk.model.problems import Path
from gapwalk.model.toml_lines import STRING

MAX_PARTS = 20
"""Parts of a dotted key; model files use five."""

MAX_NESTS = 100_000
"""Tables and lists in a file; a system of 1,000 coordinates with as many contacts has some 10,000."""

MAX_ENTRIES = 20_000
"""Entries of one table or one list; the longest that make sense are states, of 2,000 numbers."""

_PART = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[A-Za-z0-9_-]++)"""
# texts and comments are passed over; a dotted key is seen from its first point on
_TOKEN = re.compile(
    rf"""(?:{STRING.pattern})|\#[^\n]*+|(?P<key>(?:\.[ \t]*+{_PART}[ \t]*+)++)(?=[=\]])|(?P<nest>[\[{{])""", re.DOTALL
)


def too_much_to_parse(text: str) -> tuple[str, int] | None:
    """What a text has too much of, with the line where that is so; None if it may be parsed."""
    nests = 0
    for token in _TOKEN.finditer(text):
        if token["key"]:
            parts = 1 + token["key"].count(".")
            if parts > MAX_PARTS:
                return f"a key has {parts:,} parts; it may have {MAX_PARTS}", _line(text, token)
            nests += parts - 1
        elif token["nest"]:
            nests += 1
        if nests > MAX_NESTS:
            return f"there are more than {MAX_NESTS:,} tables and lists; a model has fewer", _line(text, token)
    return None


def crowded(data: Mapping[str, Any]) -> Iterator[tuple[Path, str]]:
    """The tables and lists of a document that are longer than any that makes sense, with a message for each."""
    waiting: list[tuple[Path, Any]] = [((), data)]
    while waiting:
        path, value = waiting.pop()
        if len(value) > MAX_ENTRIES:
            what = "" if path else "the file "
            yield path, f"{what}has {len(value):,} entries; a table or a list may have {MAX_ENTRIES:,}"
            continue
        items = value.items() if isinstance(value, Mapping) else enumerate(value)
        waiting += [((*path, key), each) for key, each in items if isinstance(each, list | Mapping)]


def _line(text: str, token: re.Match[str]) -> int:
    return text.count("\n", 0, token.start()) + 1
