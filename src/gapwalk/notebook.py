"""Display in notebooks: cards of records, and the progress of a long call as a line; elsewhere nothing is shown."""

from __future__ import annotations

import html
import os
import sys
import time
from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from gapwalk.summary import Described

P = ParamSpec("P")
R = TypeVar("R")

_QUIET = 0.5  # seconds: shorter calls show no line
_OFTEN = 0.25  # seconds between two updates of the line
_STYLE = "font-size: 0.9em; opacity: 0.75; font-variant-numeric: tabular-nums"
_OFF = ("0", "no", "off", "false")

_switch = {"on": os.environ.get("GAPWALK_PROGRESS", "").lower() not in _OFF}
_is_inside: ContextVar[bool] = ContextVar("gapwalk_progress", default=False)


class Pictured:
    """A record with a picture."""

    __slots__ = ()

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """Draw the record, and return its axes, the first of several panels; see `gapwalk.plot.draw`."""
        from gapwalk.plot import draw

        return draw(self, *arguments, **options)


class Shown(Described, Pictured):
    """A record with a picture that has a card in notebooks: its summary, and the picture if that is cheap."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the card as HTML; the notebook calls this."""
        from gapwalk.plot.picture import card_of

        return card_of(self)


def show_progress(on: bool = True) -> None:
    """Turn the display of the progress of long calls in notebooks on or off. It is on unless GAPWALK_PROGRESS=off.

    To silence a single call, give it its own `report`, as in ``gw.follow(..., report=lambda *_: None)``.

    Parameters
    ----------
    on
        False to turn it off.

    Examples
    --------
    >>> gw.parallel.show_progress(False)
    """
    _switch["on"] = on


def shows_progress(words: Callable[..., str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function with a `report`: unless one is given, a line in a notebook shows progress until it ends."""

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
    """Return True if this is the kernel of a notebook, which shows HTML."""
    python = sys.modules.get("IPython")
    shell = python.get_ipython() if python is not None else None
    return shell is not None and getattr(shell, "kernel", None) is not None


class Line:
    """The line of one call; it is called with the reported values."""

    def __init__(self, name: str, words: Callable[..., str]) -> None:
        self._name, self._words = name, words
        self._began = time.monotonic()
        self._shown = self._began + _QUIET - _OFTEN
        self._count = 0
        self._place: Any = None

    def __call__(self, *news: Any) -> None:
        """Show the latest progress, unless the line was updated a moment ago."""
        self._count += 1
        now = time.monotonic()
        if now - self._shown < _OFTEN:
            return
        self._shown = now
        self._put(f"{self._name}: {self._words(self._count, *news)}, {now - self._began:.0f} s")

    def close(self) -> None:
        """Remove the line."""
        if self._place is not None:
            self._put("")

    def _put(self, text: str) -> None:
        from IPython.display import HTML, display

        content = HTML(f'<div style="{_STYLE}">{html.escape(text)}</div>' if text else "")
        if self._place is None:
            self._place = display(content, display_id=True)
        else:
            self._place.update(content)
