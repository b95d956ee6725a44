"""The sections of docstrings in the form of numpydoc: those of a method, and what it takes over from an overridden one.

`complete` is called by Sphinx; the tests use the other functions.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from typing import Any

from sphinx.application import Sphinx

from docs._ext.held_types import all_held, public_types
from docs._ext.printed_examples import printed
from docs._ext.type_words import linked, typed, types_of
from gapwalk.field_docs import documented

ORDER = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes", "Examples")
TAKEN_OVER = ("Parameters", "Returns", "Yields", "Raises")
_HEADING = re.compile(rf"^({'|'.join(ORDER)})\n-+$\n?", re.M)


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


def complete(app: Sphinx, what: str, name: str, thing: Any, options: object, lines: list[str]) -> None:
    """Complete a docstring before it is shown: sections that it takes over, types, links, an example that runs."""
    owner = _owner(name) if what == "method" else None
    text = text_of(getattr(thing, "__func__", thing), owner) if owner or what == "class" else ""
    head, sections = split(text or "\n".join(lines))
    above = [each.__name__ for each in thing.__mro__[1:] if each in public_types()] if inspect.isclass(thing) else []
    if above:
        head += f"\n\nIt also has the methods of `{'`, `'.join(above)}`."
    if inspect.isclass(thing) and "kind" in vars(thing) and "StudyKind" in above:
        sections.pop("Parameters", "")
        head += "\n\nIts parameters are the :doc:`keys of studies </reference/generated/study-file>` of this kind."
    if what in ("class", "function"):
        types = types_of(thing)
        for section in {"Parameters", "Attributes"} & sections.keys():
            sections[section] = typed(sections[section], types)
    for section in {"Returns", "Yields"} & sections.keys():
        sections[section] = linked(sections[section], with_pages())
    if "Examples" in sections and what != "method":
        code = printed(sections["Examples"]).splitlines()
        sections["Examples"] = "\n".join([".. code-block:: python", "", *(f"    {line}" for line in code)])
    lines[:] = [*join(head, sections).splitlines(), ""]


@cache
def with_pages() -> frozenset[str]:
    """Return the names of types that are described somewhere: public ones, and those that public names hold."""
    return frozenset(kind.__name__ for kind in {*public_types(), *all_held()})


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
