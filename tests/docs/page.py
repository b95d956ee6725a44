"""A page of the documentation as a program: its cells of Python, and its commands with what they print."""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from gapwalk.cli import main

_BLOCK = re.compile(r"^```(?:\{(?P<directive>[\w-]+)\}|(?P<language>\w+))[^\n]*\n(?P<text>.*?)^```$", re.M | re.S)
_FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@dataclass(frozen=True)
class Block:
    """Something on a page that is run: what it is, its text, and its first line on the page."""

    kind: str
    text: str
    line: int


def blocks_of(page: Path, until: str = "") -> Iterator[Block]:
    """The cells and commands of a page, in their order, to its end or to a text."""
    text = page.read_text(encoding="utf-8")
    text = text[: text.index(until)] if until else text
    for match in _BLOCK.finditer(text):
        kind = match["directive"] or match["language"]
        if kind in ("code-cell", "python", "console"):
            yield Block(kind, match["text"], text.count("\n", 0, match.start("text")) + 1)


def run_page(page: Path, until: str = "") -> None:
    """Run a page, to its end or to a text, in the present folder; AssertionError if a command prints something else."""
    names: dict[str, Any] = {}
    for block in blocks_of(page, until):
        if block.kind == "console":
            _run_commands(block, page)
        else:
            code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
            exec(code, names)


def _run_commands(block: Block, page: Path) -> None:
    for part in re.split(r"^\$ ", block.text, flags=re.M)[1:]:
        command, _, wanted = part.partition("\n")
        words = shlex.split(command)
        assert words[0] == "gapwalk", f"{page.name}:{block.line}: {command!r} is no command of gapwalk"
        printed, told = io.StringIO(), io.StringIO()
        wide = patch.dict(os.environ, COLUMNS="1000")  # pages quote tables unfolded
        with wide, contextlib.redirect_stdout(printed), contextlib.redirect_stderr(told):
            code = main(words[1:])  # not as a process of its own: that would load and compile everything once more
        assert code == 0, f"{page.name}:{block.line}: {command}\n{told.getvalue()}"
        if wanted.strip():
            agrees = doctest.OutputChecker().check_output(wanted, printed.getvalue(), _FLAGS)
            assert agrees, f"{page.name}:{block.line}: {command} prints\n{printed.getvalue()}"
