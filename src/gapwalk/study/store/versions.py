"""The versions of what computes a result."""

from __future__ import annotations

import platform

import heyoka
import numpy as np

from gapwalk import __version__


def versions(before: dict[str, str] | None = None) -> dict[str, str]:
    """Versions of what computes a result; those that differ from the versions `before` are listed after them."""
    now = {
        "gapwalk": __version__,
        "heyoka": heyoka.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
    for name, version in (before or {}).items():
        if now.get(name, version) not in version.split(", "):
            now[name] = f"{version}, {now[name]}"
        else:
            now[name] = version
    return now
