"""Types that public names return or hold without being public: one page describes their fields, once for all."""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

import gapwalk as gw
from gapwalk.field_docs import field_docs
from gapwalk.summary import Described

# What only the package handles: the pages do not describe it.
HIDDEN = ("Assembly", "BalanceEquation", "BranchStart", "BranchWalk", "Charter", "Corrector", "Course", "Matrices")
HIDDEN += (
    "BatchFlow",
    "ContactRecord",
    "DiagramWork",
    "Drawn",
    "DryModes",
    "Entry",
    "Evaluation",
    "Formula",
    "Kink",
    "Lane",
)
HIDDEN += ("LaneMotion", "Link", "Quantity", "ResponseWork", "Spot", "Tally", "Work")
HIDDEN += ("NamedFile", "PaceLimits", "ShootingEquation", "Structure", "TouchEquation", "Zero")
# What stands behind an answer, whose own summary says it: `help` describes it.
HIDDEN += (
    "Alignment",
    "BackbonePoint",
    "BasinCheck",
    "Basis",
    "Box",
    "BranchCheck",
    "Combination",
    "Confirmation",
    "Connection",
    "Corner",
    "DiagramOptions",
    "Estimate",
    "Fate",
    "FrictionPhase",
    "FullCheck",
    "Further",
    "GapSpan",
    "Luck",
    "Match",
    "OrbitCheck",
    "Origin",
    "Passage",
    "Place",
    "ReducedFrom",
    "RegimeCheck",
    "Sample",
    "ScanCheck",
    "SearchResult",
    "Section",
    "SettledSweep",
    "SpecialCheck",
    "SpeedTable",
    "Stretch",
    "SweepEnd",
    "Table",
    "ToleranceCheck",
)

_LONGEST = 12  # words of a description that the page of records shows whole


def held_types(thing: object) -> list[type]:
    """Return the types with described fields that a public thing returns or holds, and those that they hold."""
    found: list[type] = []
    left = [thing]
    while left:
        for annotation, scope in _annotations(left.pop(0)):
            for kind in _types_in(annotation, scope):
                is_known = kind in found or kind.__name__ in HIDDEN or public_types().intersection(kind.__mro__)
                if not is_known and description(kind):
                    found.append(kind)
                    left.append(kind)
    return found


@cache
def all_held() -> tuple[type, ...]:
    """Return the types that any public name returns or holds, by name."""
    things = (getattr(module, name) for module in public_modules() for name in getattr(module, "__all__", ()))
    found = {kind for thing in things if not inspect.ismodule(thing) for kind in held_types(thing)}
    return tuple(sorted(found, key=lambda kind: (kind.__name__.lower(), kind.__module__)))


def records_page() -> str:
    """Write the page of these types in reStructuredText."""
    title = "Records that functions return"
    lines = [
        title,
        "=" * len(title),
        "",
        "This page describes the types that public names return or hold, and that you never make yourself: their",
        "fields, and the methods that they add. Every record also has ``summary()`` (words), ``tables()`` (CSV),",
        "``to_dict()`` (JSON), and ``plot()`` if it has a picture. Import none of them by name: they may move.",
    ]
    seen: set[str] = set()
    for kind in all_held():
        again = kind.__name__ in seen
        seen.add(kind.__name__)
        lines += ["", f".. py:class:: {kind.__name__}", *(["   :no-index:"] if again else []), ""]
        lines += [f"   {line}".rstrip() for line in description(kind)]
    return "\n".join(lines) + "\n"


def description(kind: type) -> list[str]:
    """Describe a type in reStructuredText: its first sentence, its fields or members, and methods."""
    if issubclass(kind, Enum):
        words = any(" " in str(member.value) for member in kind)  # sentences, which are read where they are printed
        members = (member.name if words else repr(member.value) for member in kind)
        return [f"{first_sentence(kind)} One of {', '.join(f'``{each}``' for each in members)}."]
    entries = [(", ".join(each.names), each.words) for each in field_docs(kind) if each.names[0][0] != "_"]
    entries += [(name, first_sentence(member)) for name, member in _members(kind)]
    if not entries:
        return []
    lines = [first_sentence(kind), ""]
    for names, words in entries:
        lines += [f"``{names}``", f"    {_brief(words)}"]
    return lines


def _brief(words: str) -> str:
    """Return a description whole if it is short, else its first sentence: ``help`` has all of it."""
    first = re.match(r".{25,}?[.;:](?=\s|$)", words)
    return words if first is None or len(words.split()) <= _LONGEST else f"{first[0][:-1]}."


def first_sentence(thing: object) -> str:
    """Return the first paragraph of a docstring in one line."""
    return " ".join(inspect.cleandoc(thing.__doc__ or "").split("\n\n")[0].split())


def _members(kind: type) -> Iterator[tuple[str, object]]:
    """Yield the public properties and methods of a class with their names, as a call shows them."""
    for name, member in vars(kind).items():
        function = getattr(member, "fget", None) or getattr(member, "func", None)
        method = getattr(member, "__func__", member)
        if name.startswith("_") or name in vars(Described):
            continue
        if function is not None:
            yield name, function
        elif inspect.isfunction(method):
            parameters = [each for each in inspect.signature(method).parameters if each not in ("self", "cls")]
            yield f"{name}({', '.join(parameters)})", method


def public_modules() -> list[ModuleType]:
    """Return gapwalk and its namespaces."""
    return [gw, *(module for name in gw.__all__ if inspect.ismodule(module := getattr(gw, name)))]


@cache
def public_types() -> frozenset[type]:
    """Return the types that have pages of their own."""
    things = (getattr(module, name) for module in public_modules() for name in getattr(module, "__all__", ()))
    return frozenset(thing for thing in things if inspect.isclass(thing))


def _annotations(thing: object) -> Iterator[tuple[object, ModuleType]]:
    """Yield what a function returns, or what the fields, properties and methods of a class hold or return."""
    if inspect.isroutine(thing):
        function = inspect.unwrap(thing)
        yield function.__annotations__.get("return"), _module_of(function)
    elif inspect.isclass(thing) and not issubclass(thing, Enum):
        for base in thing.__mro__:
            if not base.__module__.startswith("gapwalk") or base is Described:
                continue
            for field, annotation in vars(base).get("__annotations__", {}).items():
                if not field.startswith("_"):
                    yield annotation, _module_of(base)
            for key, member in vars(base).items():
                function = getattr(member, "fget", None) or getattr(member, "func", None)
                function = inspect.unwrap(function or getattr(member, "__func__", member))
                if not key.startswith("_") and inspect.isfunction(function):
                    yield function.__annotations__.get("return"), _module_of(base)


def _module_of(thing: object) -> ModuleType:
    return sys.modules[thing.__module__]  # type: ignore[attr-defined]


def _types_in(annotation: object, scope: ModuleType) -> Iterator[type]:
    """Yield the classes of gapwalk that an annotation names; it is a text where it is evaluated late."""
    for word in re.findall(r"[A-Za-z_]\w*", str(annotation or "")):
        thing = getattr(scope, word, None) or _imported_late(scope).get(word)
        if inspect.isclass(thing) and thing.__module__.startswith("gapwalk") and not word.startswith("_"):
            yield thing


@cache
def _imported_late(scope: ModuleType) -> dict[str, object]:
    """Return the names that a module imports for type checkers only."""
    tree = ast.parse(Path(str(scope.__file__)).read_text(encoding="utf-8"))
    return {
        alias.name: getattr(import_module(str(statement.module)), alias.name)
        for block in tree.body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for statement in block.body
        if isinstance(statement, ast.ImportFrom) and str(statement.module).startswith("gapwalk")
        for alias in statement.names
    }
