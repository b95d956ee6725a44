"""Differences of two requests: a result file is continued only with the request that began it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from gapwalk.errors import StoreError
from gapwalk.model.system import System

_SHOWN = 3  # differences that are named


def check_same(name: str, now: Any, then: Any, otherwise: str = "choose another name, or remove the file") -> None:
    """Refuse to continue a file with another request."""
    found = list(differences(now, then))
    if found:
        more = f"; and {len(found) - _SHOWN} more differences" if len(found) > _SHOWN else ""
        raise StoreError(
            f"{name} holds the result of something else, so it cannot be continued: {'; '.join(found[:_SHOWN])}{more}; "
            f"{otherwise}"
        )


def differences(now: Any, then: Any, path: str = "") -> Iterator[str]:
    """Yield each difference between two records, in a few words."""
    if isinstance(now, System) and isinstance(then, System):
        yield from _system_differences(now, then)
    elif type(now) is not type(then) and (is_dataclass(now) or is_dataclass(then)):
        yield f"{path or 'its kind'} is {_kind_of(now)}, and was {_kind_of(then)}"
    elif is_dataclass(now):
        for field in (each for each in fields(now) if each.compare):
            # the options of a study, and the system, need no name
            inner = "" if field.name in ("system", "options") else field.name
            joined = ".".join(filter(None, (path, inner)))
            yield from differences(getattr(now, field.name), getattr(then, field.name), joined)
    elif not np.array_equal(now, then) if isinstance(now, np.ndarray) else now != then:
        yield f"{path} is {_said(now)!r}, and was {_said(then)!r}"


def _system_differences(now: System, then: System) -> Iterator[str]:
    if now.structure != then.structure:
        yield "the system is made of other parts"
        return
    for place in np.flatnonzero(now.values != then.values).tolist():
        yield f"{now.structure.names[place]} is {float(now.values[place])!r}, and was {float(then.values[place])!r}"


def _kind_of(value: Any) -> str:
    return getattr(value, "kind", None) or type(value).__name__


def _said(value: Any) -> Any:
    """Return a value with the values of enumerations in place of their members."""
    if isinstance(value, tuple):
        return tuple(map(_said, value))
    return value.value if isinstance(value, Enum) else value
