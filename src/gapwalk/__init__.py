"""Walks the solution branches of vibrating systems with gaps."""

from __future__ import annotations

from typing import Any

from gapwalk.lazy_names import lazy_names

_public_name, __dir__ = lazy_names(__name__, __file__)


def __getattr__(name: str) -> Any:
    return _version() if name == "__version__" else _public_name(name)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("gapwalk")
    except PackageNotFoundError:  # run from the source tree without installation
        return "0+unknown"
