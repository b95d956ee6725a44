"""What an interrupted call has found, for those who keep it or tell of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from gapwalk.errors import Interrupted

P = ParamSpec("P")
R = TypeVar("R")


def found_by(call: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
    """What a call returns; after Ctrl-C, what it had found by then."""
    try:
        return call(*arguments, **options)
    except Interrupted as stop:
        return stop.found
