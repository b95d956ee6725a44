"""The sections of docstrings in the form of numpydoc: those of a method, and what it takes over from an overridden one.

`complete` is called by Sphinx; the tests use the other functions.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import re
from functools import cache
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

from docs._ext.held_types import description, held_types
from gapwalk.field_docs import documented

ORDER = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes", "Examples")
TAKEN_OVER = ("Parameters", "Returns", "Yields", "Raises")
_HEADING = re.compile(rf"^({'|'.join(ORDER)})\n-+$\n?", re.M)
_CELL = re.compile(r"^```\{code-cell\}\n(.*?)^```$", re.M | re.S)
EXAMPLES = Path(__file__).parents[1] / "reference" / "examples.md"


def split(text: str) -> tuple[str, dict[str, str]]:
    """Split a docstring into its beginning and its sections."""
    head, *parts = _HEADING.split(text)
    return head.strip(), dict(zip(parts[::2], (part.strip("\n") for part in parts[1::2]), strict=True))


def join(head: str, sections: dict[str, str]) -> str:
    """Write a docstring from its beginning and its sections."""
    parts = [f"{name}\n{'-' * len(name)}\n{sections[name]}" for name in ORDER if name in sections]
    return "\n\n".join([head, *parts])


def own_text(thing: Any) -> str:
    """Return the docstring of a thing itself; what a dataclass or an enumeration writes on its own is none."""
    return documented(thing) if inspect.isclass(thing) else inspect.cleandoc(getattr(thing, "__doc__", None) or "")


def text_of(thing: Any, owner: type | None = None) -> str:
    """Return the docstring of a thing, with sections that it takes over.

    A method has those of the methods that it overrides, and a class the parameters or attributes of its nearest base
    class that lists any, where they have none of their own.
    """
    head, sections = split(own_text(thing))
    if inspect.isclass(thing) and not sections.keys() & {"Parameters", "Attributes"}:
        above = (split(own_text(base))[1] for base in thing.__mro__[1:-1])
        listed = ({name: each[name] for name in ("Parameters", "Attributes") if name in each} for each in above)
        sections = next(filter(None, listed), {}) | sections
    for base in owner.__mro__[1:] if owner else ():
        above = getattr(vars(base).get(thing.__name__), "__func__", vars(base).get(thing.__name__))
        if inspect.isfunction(above):
            inherited = {name: body for name, body in split(own_text(above))[1].items() if name in TAKEN_OVER}
            sections = inherited | sections
    return join(head, sections)


def names_in(code: str) -> tuple[set[str], set[str]]:
    """Return the names that some code defines, and those that it uses."""
    nodes = list(ast.walk(ast.parse(code)))
    names = [node for node in nodes if isinstance(node, ast.Name)]
    inner = {id(name) for node in nodes if isinstance(node, ast.comprehension) for name in ast.walk(node.target)}
    defines = {name.id for name in names if isinstance(name.ctx, ast.Store) and id(name) not in inner}
    return defines, {name.id for name in names if isinstance(name.ctx, ast.Load)} - set(dir(builtins))


@cache
def cells() -> tuple[str, ...]:
    """Return the cells of the page with the names that examples share."""
    return tuple(_CELL.findall(EXAMPLES.read_text(encoding="utf-8")))


@cache
def cell_of(name: str) -> str | None:
    """Return the cell that defines a shared name; None if there is none."""
    return next((code for code in cells() if name in names_in(code)[0]), None)


def code_of(examples: str) -> str:
    """Return the code of the examples of a docstring, without what they print."""
    return "\n".join(line[4:] for line in examples.splitlines() if line.startswith((">>> ", "... ", "...")))


def shared_by(examples: str) -> list[str]:
    """List the shared names that examples use and do not define."""
    defines, uses = names_in(code_of(examples))
    found = re.findall(r"\w+", code_of(examples))
    return sorted((name for name in uses - defines if cell_of(name)), key=found.index)


def complete(app: Sphinx, what: str, name: str, thing: Any, options: object, lines: list[str]) -> None:
    """Complete a docstring before it is shown: with sections that it takes over, links, and held types."""
    owner = _owner(name) if what == "method" else None
    text = text_of(getattr(thing, "__func__", thing), owner) if owner or what == "class" else ""
    head, sections = split(text or "\n".join(lines))
    if "Examples" in sections and (names := shared_by(sections["Examples"])):
        listed = " and ".join(filter(None, [", ".join(f"``{each}``" for each in names[:-1]), f"``{names[-1]}``"]))
        sections["Examples"] = (
            f"With {listed} of :doc:`the systems of the examples </reference/examples>`:\n\n" + (sections["Examples"])
        )
    held = held_types(thing) if what in ("class", "function") else []
    lines[:] = [*join(head, sections).splitlines(), "", *(line for kind in held for line in description(kind))]


def _owner(name: str) -> type | None:
    """Return the class of a method by its full name."""
    from importlib import import_module

    module = name.rpartition(".")[0]
    parts = []
    while module:
        try:
            found: Any = import_module(module)
        except ModuleNotFoundError:
            module, _, last = module.rpartition(".")
            parts.insert(0, last)
            continue
        for part in parts:
            found = getattr(found, part)
        return found if isinstance(found, type) else None
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect before napoleon, which turns the sections into fields."""
    app.connect("autodoc-process-docstring", complete, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
