"""How a command ends: its exit code, and errors as sentences or as JSON."""

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
    """Do a job, and return its exit code; whatever goes wrong is told in a sentence, or in JSON."""
    try:
        code = job()
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader has seen enough, as in `gapwalk show result.gapwalk | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        if error.filename is not None:
            return _told(error, json=json, debug=debug)
        # Errors of files are told by those who open them; what is left is what the command prints.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _tell(f"what the command prints cannot be written: {error.strerror or error}", {}, json=False)
        return BAD_INPUT
    except KeyboardInterrupt as error:
        text = f"interrupted: {error}" if str(error) else "interrupted"
        _tell(text, {"type": "KeyboardInterrupt", "message": text}, json=json)
        return INTERRUPTED
    except Exception as error:
        return _told(error, json=json, debug=debug)


def failure_code(error: BaseException) -> int:
    """The exit code that an error stands for."""
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED
    if isinstance(error, NumericalError):
        return FAILED
    return BAD_INPUT if isinstance(error, GapwalkError) else BUG


def report_error(error: Exception, *, json: bool = False) -> None:
    """Tell an error on stderr, and in JSON on stdout if that is wanted."""
    text = str(error)
    if not isinstance(error, GapwalkError) and type(error).__module__.partition(".")[0] != "cyclopts":
        text = f"this is a bug in gapwalk, please report it: {type(error).__name__}: {text} (--debug shows where)"
    document: dict[str, Any] = {"type": type(error).__name__, "message": text}
    problems = getattr(error, "problems", None)
    if problems is not None:
        document["problems"] = [
            {"file": each.file, "line": each.line, "path": each.path, "message": each.message} for each in problems
        ]
    _tell(text, document, json=json)


def print_json(document: object) -> None:
    """Print the one JSON document of a command."""
    print(json_format.dumps(document, allow_nan=False))


def printable(text: str) -> str:
    """A text from a file, safe for a terminal."""
    return "".join(char if char.isprintable() or char == "\n" else repr(char)[1:-1] for char in text)


def _told(error: Exception, *, json: bool, debug: bool) -> int:
    """Tell an error, and return its exit code."""
    if debug:
        traceback.print_exc()
    report_error(error, json=json)
    return failure_code(error)


def _tell(text: str, document: dict[str, Any], *, json: bool) -> None:
    print(f"gapwalk: {printable(text)}", file=sys.stderr)
    if json:
        print_json({"error": document})
