"""The public names, what they are called with, what they have: `python -m tests.release.names` writes the list."""

import inspect
import json
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import Any

import gapwalk as gw

PROMISED = Path(__file__).with_name("names.json")


def namespaces() -> list[ModuleType]:
    """The modules with public names: gapwalk itself first."""
    return [gw, *(module for name in sorted(gw.__all__) if inspect.ismodule(module := getattr(gw, name)))]


def public_things() -> dict[str, Any]:
    """Each public name with what it stands for; ``train.Shaft`` is one of a namespace."""
    things = {}
    for module in namespaces():
        prefix = "" if module is gw else module.__name__.removeprefix("gapwalk.") + "."
        names = module.__all__ if hasattr(module, "__all__") else _own(module)
        things |= {prefix + name: getattr(module, name) for name in sorted(names)}
    return things


def public_names() -> dict[str, Any]:
    """What a release promises: its version, and each public name."""
    return {"version": gw.__version__, "names": {name: _contents(thing) for name, thing in public_things().items()}}


def _contents(thing: Any) -> dict[str, list[str]]:
    """A function has parameters; a class attributes and methods too; an enumeration names; a value nothing."""
    if inspect.isclass(thing) and issubclass(thing, Enum):
        return {"has": [f"{member.name} = {member.value}" for member in thing]}
    if inspect.isclass(thing) and issubclass(thing, BaseException):  # what it is called with differs by Python
        return {"has": sorted(name for name in vars(thing) if not name.startswith("_"))}
    if inspect.isclass(thing):
        return {"called with": _parameters(thing), "has": _attributes(thing)}
    return {"called with": _parameters(thing)} if inspect.isroutine(thing) else {"has": []}


def _parameters(thing: Any) -> list[str]:
    return [_word(each) for each in inspect.signature(thing).parameters.values()]


def _word(parameter: inspect.Parameter) -> str:
    """A parameter as a call has it: ``method=`` may be left out, ``*method`` goes by its name only."""
    stars = {inspect.Parameter.KEYWORD_ONLY: "*", inspect.Parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    default = "" if parameter.default is inspect.Parameter.empty else "="
    return f"{stars}{parameter.name}{default}"


def _attributes(kind: type) -> list[str]:
    names = {*dir(kind), *getattr(kind, "__dataclass_fields__", {})} - set(dir(str) if issubclass(kind, str) else ())
    return sorted(name for name in names if not name.startswith("_"))


def _own(module: ModuleType) -> list[str]:
    own = {name: thing for name, thing in vars(module).items() if getattr(thing, "__module__", "") == module.__name__}
    return sorted(name for name in own if not name.startswith("_"))


if __name__ == "__main__":
    PROMISED.write_text(json.dumps(public_names(), indent=1) + "\n")
