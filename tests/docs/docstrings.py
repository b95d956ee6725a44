"""The public names with what their docstrings lack, and the values that their examples share."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from types import ModuleType
from typing import Any

from docs._ext.docstrings import own_text, split, text_of
from docs._ext.printed_examples import lines_for, outside, statements
from tests.computed import once
from tests.release.names import public_things


@dataclass(frozen=True)
class Thing:
    """A public function, class or method, with its name."""

    name: str
    value: Any
    owner: type | None = None

    @property
    def sections(self) -> dict[str, str]:
        """The sections of its docstring, as the reference shows them."""
        return split(text_of(self.value, self.owner))[1]

    @property
    def described(self) -> set[str]:
        """The parameters and attributes that have an entry; of a class also in the classes from which it derives."""
        kinds = self.value.__mro__[:-1] if inspect.isclass(self.value) else ()
        texts = [self.sections, *(split(own_text(kind))[1] for kind in kinds)]
        entries = [
            entry
            for sections in texts
            for section in ("Parameters", "Attributes")
            for entry in re.findall(r"^(\S[^:\n]*)", sections.get(section, ""), re.M)
        ]
        return {name.strip().lstrip("*") for entry in entries for name in entry.split(",")}


def things() -> Iterator[Thing]:
    """Yield all public functions, classes and their methods, each once."""
    seen: set[int] = set()
    for name, value in public_things().items():
        if id(value) in seen or not (inspect.isclass(value) or inspect.isroutine(value)):
            continue
        seen.add(id(value))
        yield Thing(name, value)
        if inspect.isclass(value) and not issubclass(value, Enum | BaseException):
            for member, method in vars(value).items():
                function = getattr(method, "__func__", method)
                if not member.startswith("_") and inspect.isfunction(function):
                    yield Thing(f"{name}.{member}", function, value)


def missing(thing: Thing) -> Iterator[str]:
    """Yield what is missing in the docstring of a public thing; a method needs no more than a sentence."""
    value, sections = thing.value, thing.sections
    if not own_text(value):
        yield "a docstring"
    if thing.owner is not None:
        return
    if ">>> " not in sections.get("Examples", ""):
        yield "Examples"
    if inspect.isclass(value):
        wanted = fields_of(value)
    else:
        signature = inspect.signature(value)
        wanted = [name for name in signature.parameters if name not in ("self", "cls")]
        returns = signature.return_annotation not in (None, "None", inspect.Signature.empty)
        if returns and not {"Returns", "Yields"} & sections.keys():
            yield "Returns"
        if "Raises" not in sections and raises(value):
            yield "Raises"
    for name in wanted:
        if not name.startswith("_") and name not in thing.described:
            yield f"an entry for {name}"


def fields_of(kind: type) -> list[str]:
    """Return the names of the fields of a dataclass or of a named tuple."""
    own = [field.name for field in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []
    return [*own, *getattr(kind, "_fields", ())]


def raises(function: Any) -> bool:
    """Return True if a function itself raises an error, other than to say that it is abstract."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(function))))
    errors = [ast.unparse(node.exc) for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc]
    return any("NotImplementedError" not in error for error in errors)


def shared(name: str) -> Any:
    """Return a value that examples share; modules are imported, since they cannot be stored."""
    code, *_ = next(each for each in statements() if name in each[1])
    return _computed(name) if "import " not in code.partition("\n")[0] else _imported(name, code)


def _imported(name: str, code: str) -> Any:
    names: dict[str, Any] = {}
    exec(code, names)
    return names[name]


@once
def _computed(name: str) -> Any:
    """Compute a value that examples share, by the statements that define it."""
    code, _, uses = next(each for each in statements() if name in each[1])
    names = {**modules(), **{each: shared(each) for each in sorted(uses - modules().keys()) if lines_for({each})}}
    exec(code, names)
    return names[name]


def modules() -> dict[str, ModuleType]:
    """Return the modules that every example has imported."""
    import numpy as np

    import gapwalk as gw

    return {"gw": gw, "np": np}


def namespace(examples: str) -> dict[str, Any]:
    """Return the names with which examples run."""
    return {**modules(), **{name: shared(name) for name in sorted(outside(examples)) if name not in modules()}}
