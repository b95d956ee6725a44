"""Commands that pages and help texts show: they are taken apart as the command line does it, and not run."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from cyclopts import CycloptsError

from gapwalk.cli.commands import app

ROOT = Path(__file__).parents[2]
_SHOWN = re.compile(r"^(?: {4}|\$ |  )(gapwalk [a-z-].*)$", re.M)


def commands_in(text: str) -> Iterator[list[str]]:
    """List the commands in the blocks of a text, word by word, without the file that a shell writes."""
    for line in _SHOWN.findall(text):
        words = shlex.split(line, comments=True)
        yield words[: words.index(">")] if ">" in words else words


def parse_command(words: list[str]) -> None:
    """Fail where a command, an option or an example file does not exist."""
    try:
        app.parse_args(words[1:], print_error=False, exit_on_error=False)
    except CycloptsError as error:
        raise AssertionError(f"{' '.join(words)}: {error}") from error
    missing = [word for word in words if word.startswith("examples/") and not (ROOT / word).exists()]
    assert not missing, f"{' '.join(words)}: {missing[0]} does not exist"
