"""How far a long call has come, as a line in a notebook; elsewhere nothing is shown."""

from __future__ import annotations

import html
import os
import sys
import time
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

_QUIET = 0.5  # seconds: a call that takes no longer shows nothing
_OFTEN = 0.25  # seconds between two changes of the line
_STYLE = "font-size: 0.9em; opacity: 0.75; font-variant-numeric: tabular-nums"
_OFF = ("0", "no", "off", "false")

_switch = {"on": os.environ.get("GAPWALK_PROGRESS", "").lower() not in _OFF}
_is_inside: ContextVar[bool] = ContextVar("gapwalk_progress", default=False)


def show_progress(on: bool = True) -> None:
    """Whether long calls show in a notebook how far they have come. They do, unless GAPWALK_PROGRESS=off says no.

    One call that is to show nothing takes a `report` of its own, as in ``gw.follow(..., report=lambda *_: None)``.
    """
    _switch["on"] = on


def shows_progress(words: Callable[..., str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """For a function with a `report`: unless it is given one, it shows a line in a notebook, which vanishes at the end.

    Parameters
    ----------
    words
        How far it has come, from what is reported.
    """

    def decorate(call: Callable[P, R]) -> Callable[P, R]:
        @wraps(call)
        def watched(*arguments: P.args, **options: P.kwargs) -> R:
            if options.get("report") is not None or _is_inside.get() or not _switch["on"] or not is_notebook():
                return call(*arguments, **options)
            line = Line(call.__name__, words)
            options["report"] = line
            token = _is_inside.set(True)
            try:
                return call(*arguments, **options)
            finally:
                _is_inside.reset(token)
                line.close()

        return watched

    return decorate


def is_notebook() -> bool:
    """Whether this is the kernel of a notebook, which shows HTML."""
    python = sys.modules.get("IPython")
    shell = python.get_ipython() if python is not None else None
    return shell is not None and getattr(shell, "kernel", None) is not None


class Line:
    """The line of one call: it is called with what is reported.

    Parameters
    ----------
    name
        Of the function.
    words
        How far it has come, from what is reported.
    """

    def __init__(self, name: str, words: Callable[..., str]) -> None:
        self._name, self._words = name, words
        self._began = time.monotonic()
        self._shown = self._began + _QUIET - _OFTEN
        self._count = 0
        self._place: Any = None

    def __call__(self, *news: Any) -> None:
        """Show what is new, unless something was shown a moment ago."""
        self._count += 1
        now = time.monotonic()
        if now - self._shown < _OFTEN:
            return
        self._shown = now
        self._put(f"{self._name}: {self._words(self._count, *news)}, {now - self._began:.0f} s")

    def close(self) -> None:
        """Let the line vanish."""
        if self._place is not None:
            self._put("")

    def _put(self, text: str) -> None:
        from IPython.display import HTML, display

        content = HTML(f'<div style="{_STYLE}">{html.escape(text)}</div>' if text else "")
        if self._place is None:
            self._place = display(content, display_id=True)
        else:
            self._place.update(content)
