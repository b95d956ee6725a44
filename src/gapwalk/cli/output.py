"""Output of the commands: text, tables and trees on the console, JSON, errors, and exit codes."""

from __future__ import annotations

import json as json_format
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from gapwalk.errors import GapwalkError, NumericalError
from gapwalk.summary import SummaryParts, printable, render

DONE, BUG, BAD_INPUT, FAILED, DIFFERENT, BROKEN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 4, 5, 130, 143
is_quiet = False
"""Only errors, and JSON, are printed; set by `guard` for each command."""
_WIDTH, _LOGGED = 100, 1000  # of text to a pipe where no terminal and no COLUMNS tells it; of a message to a log


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Let the command end like any other output to a reader that has closed the pipe."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """Create a console that prints text unchanged, without markup; into a pipe as wide as on the terminal beside it."""
    is_known = (sys.stderr if stderr else sys.stdout).isatty()
    is_known |= not stderr and ("COLUMNS" in os.environ or sys.stderr.isatty())
    width = None if is_known else _LOGGED if stderr else _WIDTH
    quiet = is_quiet and not stderr
    return _Screen(stderr=stderr, markup=False, emoji=False, highlight=False, width=width, quiet=quiet)


def show(summary: SummaryParts, screen: Console | None = None) -> None:
    """Print the summary of a record."""
    render(summary, screen or console())


@contextmanager
def saying(text: str) -> Iterator[None]:
    """Show a text on the terminal while something takes time, then remove it."""
    is_shown = sys.stderr.isatty() and not is_quiet
    if is_shown:
        print(f"{text} ...", end="\r", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        if is_shown:
            print("\x1b[2K", end="\r", file=sys.stderr, flush=True)


def show_files(files: Iterable[Path | str], screen: Console | None = None) -> None:
    """Print the names of the files that were written."""
    show([f"written: {', '.join(map(str, files))}"], screen)


def show_title(title: str, screen: Console) -> None:
    """Print the title of a study or a model, if it has one, in bold letters."""
    if title:
        screen.print(printable(title), style="bold", soft_wrap=True)


def guard(job: Callable[[], int], *, json: bool = False, debug: bool = False, quiet: bool = False) -> int:
    """Run a job and return its exit code; report errors in a sentence, or in JSON."""
    global is_quiet  # noqa: PLW0603
    is_quiet = quiet
    try:
        code = job()
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader has closed the pipe, as in `gapwalk show result.gapwalk | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        if error.filename is not None:  # of a file; other errors concern the output of the command
            return report_error(error, json=json, debug=debug)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _tell(f"the output of the command cannot be written: {error.strerror or error}", {}, json=False)
        return BAD_INPUT
    except KeyboardInterrupt as error:
        text = failure_text(error)
        _tell(text, {"type": "KeyboardInterrupt", "message": text}, json=json)
        return INTERRUPTED
    except Exception as error:
        return report_error(error, json=json, debug=debug)


def failure_text(error: BaseException) -> str:
    """Return the words for an error; those for Ctrl-C begin with "interrupted"."""
    if isinstance(error, KeyboardInterrupt):
        return f"interrupted: {error}" if str(error) else "interrupted"
    return str(error)


def failure_code(error: BaseException) -> int:
    """Return the exit code for an error."""
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED
    if isinstance(error, NumericalError):
        return FAILED
    return BAD_INPUT if isinstance(error, GapwalkError) else BUG


def report_error(error: Exception, *, json: bool = False, debug: bool = False) -> int:
    """Print an error on stderr, and in JSON on stdout if requested; return its exit code."""
    if debug:
        traceback.print_exc()
    text = str(error)
    if not isinstance(error, GapwalkError) and type(error).__module__.partition(".")[0] != "cyclopts":
        text = f"this is a bug in gapwalk, please report it: {type(error).__name__}: {text} (see --debug)"
    document: dict[str, Any] = {"type": type(error).__name__, "message": text}
    problems = getattr(error, "problems", None)
    if problems is not None:
        document["problems"] = [
            {"file": each.file, "line": each.line, "path": each.path, "message": each.message} for each in problems
        ]
    _tell(text, document, json=json)
    return failure_code(error)


def print_json(document: object) -> None:
    """Print the JSON document of a command; numbers that are not finite become null."""
    from gapwalk.results.codec import plain  # loads much that help does not need

    print(json_format.dumps(plain(document), allow_nan=False))


def _tell(text: str, document: dict[str, Any], *, json: bool) -> None:
    show([f"gapwalk: {text}"], console(stderr=True))
    if json:
        print_json({"error": document})
