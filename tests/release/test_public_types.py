"""Every type that a public function returns, or that a public record holds, is public somewhere."""

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

import pytest

import gapwalk as gw
from tests.release.names import namespaces, public_things

MOST = 85

# Types that public names return and that only functions of the package handle: why.
INTERNAL = {
    "BalanceEquation": "it is an OrbitEquation",
    "BranchStart": "a kind of special point hands it to the walk",
    "Course": "claims of a scan name the walk that they share by it",
    "Charter": "a study of a map does its work with it",
    "NamedFile": "a table of a study reads it; its content goes on",
    "Matrices": "a basis hands them to the reduction",
    "ShootingEquation": "it is an OrbitEquation",
    "Structure": "the parts of a system, which gw.System takes",
    "TouchEquation": "an equation of an orbit hands it to the location of grazing points",
    "Zero": "a kind of special point hands it to the detector",
}


def test_there_are_few_public_names() -> None:
    assert len(gw.__all__) < MOST  # and __version__


def test_every_namespace_says_what_is_in_it() -> None:
    for module in namespaces():
        if module in (gw, gw.errors, gw.paper):
            continue
        listed = set(re.findall(r"`(\w+)`", module.__doc__ or ""))
        assert listed == set(module.__all__), f"the docstring of {module.__name__} lists its names"


def test_every_returned_type_is_public() -> None:
    public = public_things()
    classes = {thing for thing in public.values() if inspect.isclass(thing)}
    missing = {}
    for name, thing in public.items():
        for place, annotation, scope in annotations(thing, name):
            for found in types_in(annotation, scope):
                if not any(base in classes for base in found.__mro__) and found.__name__ not in INTERNAL:
                    missing[f"{found.__module__}.{found.__name__}"] = place
    assert not missing, f"give these a place in gw.records, or where they belong: {missing}"


def annotations(thing: object, name: str) -> Iterator[tuple[str, object, ModuleType]]:
    """Yield what a public function returns, or what the fields, properties and methods of a class hold or return."""
    if inspect.isfunction(thing):
        yield f"{name}()", inspect.unwrap(thing).__annotations__.get("return"), module_of(thing)
    elif inspect.isclass(thing) and not issubclass(thing, Enum):
        for base in thing.__mro__:
            if not base.__module__.startswith("gapwalk"):
                continue
            for field, annotation in vars(base).get("__annotations__", {}).items():
                if not field.startswith("_"):
                    yield f"{name}.{field}", annotation, module_of(base)
            for key, member in vars(base).items():
                function = getattr(member, "fget", None) or getattr(member, "func", None)
                function = inspect.unwrap(function or getattr(member, "__func__", member))
                if not key.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{key}", function.__annotations__.get("return"), module_of(base)


def module_of(thing: object) -> ModuleType:
    return sys.modules[inspect.unwrap(thing).__module__]  # type: ignore[arg-type]


def types_in(annotation: object, scope: ModuleType) -> Iterator[type]:
    """Yield the classes of gapwalk that an annotation names; it is a text where it is evaluated late."""
    for word in re.findall(r"[A-Za-z_]\w*", str(annotation or "")):
        thing = getattr(scope, word, None) or imported_late(scope).get(word)
        if inspect.isclass(thing) and thing.__module__.startswith("gapwalk") and not word.startswith("_"):
            yield thing


@cache
def imported_late(scope: ModuleType) -> dict[str, object]:
    """The names that a module imports for type checkers only."""
    tree = ast.parse(Path(str(scope.__file__)).read_text(encoding="utf-8"))
    return {
        alias.name: getattr(import_module(str(statement.module)), alias.name)
        for block in tree.body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for statement in block.body
        if isinstance(statement, ast.ImportFrom) and str(statement.module).startswith("gapwalk")
        for alias in statement.names
    }


def test_a_name_of_a_namespace_is_said_to_be_there() -> None:
    with pytest.raises(AttributeError, match=r"module 'gapwalk' has no attribute 'Train'; write gapwalk\.train\.Train"):
        gw.Train  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError, match=r"no attribute 'Trains'$"):
        gw.Trains  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
