"""Links from single backticks in docstrings, what the pages of classes show, and the page of names for extensions."""

from __future__ import annotations

import inspect
from enum import Enum
from functools import cache
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import ObjectEntry
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

import gapwalk as gw
from docs._ext.held_types import public_modules, public_types
from gapwalk.field_docs import field_words
from gapwalk.summary import Described

EXTENSIONS = {
    "studies": "What a kind of study of your own needs, and how results are compared.",
    "parallel": "Local processes, clusters, and the integrator of many motions at once.",
    "special_points": "What a subclass of `gw.Kind` needs. For a single computation, a `gw.Event` is enough.",
    "methods": "What a method of your own needs next to `gw.Shooting` and `gw.Balance`.",
}
"""Namespaces whose names share a page, with what they are for."""


def enumerations() -> list[str]:
    """Return the names of the public enumerations, whose pages show their members without docstrings."""
    return sorted(kind.__name__ for kind in public_types() if issubclass(kind, Enum))


def left_out(kind: type) -> str:
    """Return the members that the page of a class leaves out: fields, which it describes, and those of its bases."""
    above = {name for base in kind.__mro__[1:] if base in {*public_types(), Described} for name in vars(base)}
    own = {name for base in kind.__mro__ if base not in public_types() for name in vars(base)} | vars(kind).keys()
    names = {*field_words(kind), *(above - own if not issubclass(kind, Enum) else ())}
    return ", ".join(sorted(name for name in names | vars(Described).keys() if not name.startswith("_")))


def members_left_out() -> dict[str, str]:
    """Return the members that the pages of public classes leave out, by the full names of the classes."""
    found = {}
    for module in public_modules():
        for name in getattr(module, "__all__", ()):
            if inspect.isclass(thing := getattr(module, name)):
                found[f"{module.__name__}.{name}"] = left_out(thing)
    return found


def extensions_page() -> str:
    """Write the page of the names that extensions need, in Markdown."""
    lines = [
        "# Names for extensions",
        "",
        "This page describes the names that you need to add a kind of study, of special point or of orbit method, "
        "and to spread work over processes. The [design](../../design.md) says what each must provide.",
    ]
    for space, words in EXTENSIONS.items():
        module = getattr(gw, space)
        lines += ["", f"## gw.{space}", "", words, "", "```{eval-rst}", f".. currentmodule:: {module.__name__}"]
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.isclass(thing):
                lines += ["", f".. autoclass:: {name}", "   :members:", "   :member-order: groupwise"]
                lines += [f"   :exclude-members: {left_out(thing)}"]
            else:
                lines += ["", f".. auto{'function' if inspect.isroutine(thing) else 'data'}:: {name}"]
        lines += ["```"]
    return "\n".join(lines) + "\n"


@cache
def _named(env: BuildEnvironment, last: str) -> list[tuple[str, ObjectEntry]]:
    """Return the things whose last name it is, once all pages are read."""
    objects = env.domains.python_domain.objects.items()
    return [(name, entry) for name, entry in objects if not entry.aliased and name.rpartition(".")[2] == last]


def link(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Element) -> Any:
    """Link a name to the one public thing that has it, wherever it is: a docstring writes `Orbit` in any module."""
    if node.get("refdomain") != "py":
        return None
    wanted = node["reftarget"].removeprefix("gw.")
    found = [each for each in _named(env, wanted.rpartition(".")[2]) if f".{each[0]}".endswith(f".{wanted}")]
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
