"""Links from single backticks in docstrings, and what the pages of classes show of enumerations."""

from __future__ import annotations

import inspect
from enum import Enum
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

import gapwalk as gw


def enumerations() -> list[str]:
    """Return the names of the public enumerations, whose pages show their members without docstrings."""
    modules = [gw, *(module for name in gw.__all__ if inspect.ismodule(module := getattr(gw, name)))]
    names = [(name, getattr(module, name, None)) for module in modules for name in getattr(module, "__all__", ())]
    return [name for name, thing in names if isinstance(thing, type) and issubclass(thing, Enum)]


def link(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Element) -> Any:
    """Link a name to the one public thing that has it, wherever it is: a docstring writes `Orbit` in any module."""
    if node.get("refdomain") != "py":
        return None
    wanted = node["reftarget"].removeprefix("gw.")
    found = [
        (name, entry)
        for name, entry in env.domains.python_domain.objects.items()
        if not entry.aliased and (name in (wanted, f"gapwalk.{wanted}") or name.endswith(f".{wanted}"))
    ]
    found = [each for each in found if each[0] == f"gapwalk.{wanted}"] or found
    if len(found) != 1:
        return None
    name, entry = found[0]
    return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, content, name)


def unlink_names(app: Sphinx, doctree: nodes.document) -> None:
    """Leave the names and shapes in lists of attributes without links: several classes have a `count`.

    Classes, whose names begin with a capital, stay links.
    """
    for node in list(doctree.findall(pending_xref)):
        if node.get("refdomain") == "py" and node.get("refspecific") and not node["reftarget"][:1].isupper():
            node.replace_self(node.children)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect both."""
    app.connect("missing-reference", link)
    app.connect("doctree-read", unlink_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
