"""Writes the types of parameters and of returned values into docstrings, short, and as links where they have a page."""

from __future__ import annotations

import ast
import inspect
import re
import sys
from types import UnionType
from typing import Annotated, Any, ForwardRef, Literal, TypeVar, Union, get_args, get_origin

ARRAYS = ("NDArray", "ndarray")
CALLED = {
    "Report": "callable",
    "PathLike": "path",
    "ArrayLike": "array_like",
    "NoneType": "None",
    "Any": "any",
    "SizeName": "str",
}
_CLASS = re.compile(r"(?<![`.\w])([A-Z]\w+)(?![\w`])")
_ENTRY = re.compile(r"^(?=\S)(?P<names>[^:\n]+?)(?: : (?P<said>.*))?$", re.M)


def short(annotation: Any, scope: Any = None) -> str:
    """Write a type as people say it: ``Sequence[float] or None``, without modules, bounds and aliases."""
    if annotation in (None, inspect.Signature.empty, "None"):
        return ""
    if isinstance(annotation, str | ForwardRef):
        text = getattr(annotation, "__forward_arg__", annotation)
        return _words(ast.parse(text.replace("typing.", ""), mode="eval").body, scope)
    origin, inner = get_origin(annotation), get_args(annotation)
    if annotation is ... or isinstance(annotation, TypeVar):
        return "..." if annotation is ... else "any"
    if origin is Annotated:
        return short(inner[0], scope)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(short(each, scope) or "None" for each in inner))
    if origin is Literal:
        return " or ".join(map(repr, inner))
    name = getattr(origin or annotation, "__name__", str(annotation))
    name = CALLED.get(name, "array" if name in ARRAYS else name)
    bare = not inner or name in ("array", "callable", "path")
    return name if bare else f"{name}[{', '.join(short(each, scope) for each in inner)}]"


def _words(node: ast.expr, scope: Any) -> str:
    if isinstance(node, ast.BinOp):
        parts = [_words(node.left, scope), _words(node.right, scope)]
        return " or ".join(dict.fromkeys(" or ".join(parts).split(" or ")))
    if isinstance(node, ast.Constant):
        return short(node.value, scope) if isinstance(node.value, str) else "..." if node.value is ... else "None"
    if isinstance(node, ast.Attribute):
        return CALLED.get(node.attr, node.attr)
    if isinstance(node, ast.Name):
        known = getattr(scope, node.id, None)
        alias = get_origin(known) in (Union, UnionType, Annotated, Literal)
        return short(known, scope) if alias and node.id not in CALLED else CALLED.get(node.id, node.id)
    if isinstance(node, ast.Subscript):
        name = _words(node.value, scope)
        inner = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if name in ("Annotated", "Final", "ClassVar", "type"):
            return _words(inner[0], scope)
        if name == "Literal":
            return " or ".join(repr(each.value) for each in inner if isinstance(each, ast.Constant))
        if name in ARRAYS:
            return "array"
        if name in ("Optional", "Union"):
            return " or ".join([*(_words(each, scope) for each in inner), *(["None"] if name == "Optional" else [])])
        if name in ("Callable", "path"):
            return name.lower()
        return f"{name}[{', '.join(_words(each, scope) for each in inner)}]"
    if isinstance(node, ast.List):
        return f"[{', '.join(_words(each, scope) for each in node.elts)}]"
    return ast.unparse(node)


def types_of(thing: Any) -> dict[str, str]:
    """Return the types of the parameters of a function or class, and of the fields of a record, by name."""
    found: dict[str, str] = {}
    for base in reversed(thing.__mro__ if inspect.isclass(thing) else ()):
        if base.__module__.startswith("gapwalk"):
            fields = vars(base).get("__annotations__", {}).items()
            found |= {name: short(each, sys.modules[base.__module__]) for name, each in fields}
    try:
        parameters = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):
        parameters = []
    scope = sys.modules[inspect.unwrap(thing).__module__]
    given = {each.name: short(each.annotation, scope) for each in parameters}
    return found | {name: words for name, words in given.items() if words}


def typed(section: str, types: dict[str, str]) -> str:
    """Write the types of names into the headings of a section of parameters or attributes, before shapes."""

    def heading(match: re.Match[str]) -> str:
        names, said = match["names"].strip(), match["said"]
        found = {types.get(name.strip().lstrip("*"), "") for name in names.split(",")} - {""}
        known = found.pop() if len(found) == 1 else ""
        if not known or (said and not said.startswith("shape")):
            return match[0]
        return f"{names} : {known}" + (f", {said}" if said else "")

    return _ENTRY.sub(heading, section)


def linked(section: str, known: frozenset[str]) -> str:
    """Write the types in the headings of a section of returned values as links."""

    def heading(match: re.Match[str]) -> str:
        return _CLASS.sub(lambda word: f"`{word[1]}`" if word[1] in known else word[1], match[0])

    return re.sub(r"^\S.*$", heading, section, flags=re.M)
