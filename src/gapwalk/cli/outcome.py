"""The end of a command: its exit code, and errors as sentences or as JSON."""

from __future__ import annotations

import json as json_format
import os
import sys
import traceback
from collections.abc import Callable
from typing import Any

from gapwalk.errors import GapwalkError, NumericalError

DONE, BUG, BAD_INPUT, FAILED, DIFFERENT, BROKEN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 4, 5, 130, 143


def guard(job: Callable[[], int], *, json: bool = False, debug: bool = False) -> int:
    """Run a job and return its exit code; report errors in a sentence, or in JSON."""
    try:
        code = job()
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader has closed the pipe, as in `gapwalk show result.gapwalk | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        if error.filename is not None:
            return _told(error, json=json, debug=debug)
            # Errors of files carry the file name; the others concern the output of the command.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _tell(f"the output of the command cannot be written: {error.strerror or error}", {}, json=False)
        return BAD_INPUT
    except KeyboardInterrupt as error:
        text = f"interrupted: {error}" if str(error) else "interrupted"
        _tell(text, {"type": "KeyboardInterrupt", "message": text}, json=json)
        return INTERRUPTED
    except Exception as error:
        return _told(error, json=json, debug=debug)


def failure_code(error: BaseException) -> int:
    """Return the exit code for an error."""
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED
    if isinstance(error, NumericalError):
        return FAILED
    return BAD_INPUT if isinstance(error, GapwalkError) else BUG


def report_error(error: Exception, *, json: bool = False) -> None:
    """Print an error on stderr, and in JSON on stdout if requested."""
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


def print_json(document: object) -> None:
    """Print the JSON document of a command."""
    print(json_format.dumps(document, allow_nan=False))


def printable(text: str) -> str:
    """Make a text from a file safe for a terminal."""
    return "".join(char if char.isprintable() or char == "\n" else repr(char)[1:-1] for char in text)


def _told(error: Exception, *, json: bool, debug: bool) -> int:
    """Report an error and return its exit code."""
    if debug:
        traceback.print_exc()
    report_error(error, json=json)
    return failure_code(error)


def _tell(text: str, document: dict[str, Any], *, json: bool) -> None:
    print(f"gapwalk: {printable(text)}", file=sys.stderr)
    if json:
        print_json({"error": document})
