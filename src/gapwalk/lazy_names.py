"""Public names of a package, declared once in its stub `__init__.pyi`, and imported when they are first used."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

# A heavy module is imported only by the name that needs it: `gapwalk --help` must not wait for a compiler to load. The
# stub is what editors and type checkers read, so the names are written in one place only.


def lazy_names(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package whose public names are imported by its stub.

    Parameters
    ----------
    package
        Name of the package.
    file
        Its ``__init__.py``, with the stub beside it: relative imports of the form ``from .module import name as name``.

    Examples
    --------
    >>> __getattr__, __dir__ = lazy_names(__name__, __file__)
    """
    homes = cache(lambda: _homes(Path(file).with_suffix(".pyi")))

    def get(name: str) -> Any:
        if name == "__all__":
            value: Any = sorted(homes())
        elif name.startswith("__") or name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        elif homes()[name].endswith("."):  # a module of the package
            value = import_module(homes()[name] + name, package)
        else:
            value = getattr(import_module(homes()[name], package), name)
        vars(import_module(package))[name] = value
        return value

    return get, lambda: sorted({*vars(import_module(package)), *homes()})


def _homes(stub: Path) -> dict[str, str]:
    """Return the module of each name that a stub imports, as it is written there: `.model.system`."""
    import ast

    return {
        alias.name: "." * statement.level + (statement.module or "")
        for statement in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
