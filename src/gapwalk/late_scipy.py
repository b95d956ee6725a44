"""Parts of SciPy, imported when they are first used, because this import takes a fifth of the start of a command."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class _Late:
    """Module that is imported when the first of its functions is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        value = getattr(import_module(self._name), name)
        setattr(self, name, value)
        return value


lapack: Any = _Late("scipy.linalg.lapack")
linalg: Any = _Late("scipy.linalg")
special_functions: Any = _Late("scipy.special")
