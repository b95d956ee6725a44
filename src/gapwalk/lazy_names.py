"""Public names of a module, declared once in its stub (`.pyi`), and imported when they are first used."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

# A heavy module is imported only by the name that needs it: `gapwalk --help` must not wait for a compiler to load. The
# stub is what editors and type checkers read, so each name is written in one place only.


def lazy_names(module: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a module whose public names are imported by its stub."""
    path = Path(file)
    package = module if path.stem == "__init__" else module.rpartition(".")[0]
    homes = cache(lambda: _homes(path.with_suffix(".pyi")))

    def get(name: str) -> Any:
        if name == "__all__":
            value: Any = sorted(homes())
        elif name.startswith("__") or name not in homes():
            raise AttributeError(f"module {module!r} has no attribute {name!r}{elsewhere(name)}", name=name)
        elif homes()[name] == ".":  # a module of the package
            value = import_module(f".{name}", package)
        else:
            value = getattr(import_module(homes()[name], package), name)
            if hasattr(value, "__dataclass_fields__") or hasattr(value, "_fields"):
                value = _with_field_docs(value)
        setattr(sys.modules[module], name, value)
        return value

    def elsewhere(name: str) -> str:
        """Return a hint if a namespace of the module has the name."""
        for space in () if name.startswith("_") else [each for each, home in homes().items() if home == "."]:
            for stub in (path.parent / f"{space}.pyi", path.parent / space / "__init__.pyi"):
                if stub.exists() and name in _homes(stub):
                    return f"; write {module}.{space}.{name}"
        return ""

    return get, lambda: sorted({*vars(sys.modules[module]), *homes()})


def _with_field_docs(kind: Any) -> Any:
    """Let the docstring of a record describe its fields, as `help` shows it."""
    from gapwalk.field_docs import WholeDoc

    if isinstance(kind, type) and not isinstance(vars(kind).get("__doc__"), WholeDoc):
        kind.__doc__ = WholeDoc(kind.__doc__)  # type: ignore[assignment]
    return kind


def _homes(stub: Path) -> dict[str, str]:
    """Return the module of each name that a stub imports, as the stub has it: `.model.system`."""
    import ast

    return {
        alias.name: "." * statement.level + (statement.module or "")
        for statement in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
