"""Writes the example of a docstring as its page prints it: lines that run, and what they print as comments."""

from __future__ import annotations

import ast
import builtins
import doctest
from functools import cache
from pathlib import Path

SYSTEMS = Path(__file__).with_name("example_systems.py")
IMPORTS = {"gw": "import gapwalk as gw", "np": "import numpy as np"}


def names_in(code: str) -> tuple[set[str], set[str]]:
    """Return the names that some code defines, and those that it takes from outside."""
    tree = ast.parse(code)
    inner: set[int] = set()  # names that are bound where they stand: by a function, a comprehension, an error
    defines: set[str] = set()
    for node in ast.walk(tree):
        bound: set[str] = set()
        if isinstance(node, ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp):
            targets = [each.target for each in node.generators]
            bound = {name.id for each in targets for name in ast.walk(each) if isinstance(name, ast.Name)}
        elif isinstance(node, ast.Lambda | ast.FunctionDef):
            bound = {each.arg for each in ast.walk(node.args) if isinstance(each, ast.arg)}
        elif isinstance(node, ast.ExceptHandler) and node.name:
            bound = {node.name}
        elif isinstance(node, ast.alias):
            defines.add((node.asname or node.name).partition(".")[0])
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            defines.add(node.name)
        inner |= {id(name) for name in ast.walk(node) if isinstance(name, ast.Name) and name.id in bound}
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in inner]
    defines |= {name.id for name in names if isinstance(name.ctx, ast.Store)}
    used = {name.id for name in names if isinstance(name.ctx, ast.Load)}
    return defines, used - set(dir(builtins)) - {"__name__"}


@cache
def statements() -> tuple[tuple[str, frozenset[str], frozenset[str]], ...]:
    """Return the statements of the shared systems, each with the names that it defines and those that it uses."""
    text = SYSTEMS.read_text(encoding="utf-8")
    found = [ast.get_source_segment(text, node) or "" for node in ast.parse(text).body[1:]]
    return tuple((code, *map(frozenset, names_in(code))) for code in found)


def lines_for(wanted: set[str]) -> str:
    """Return the statements that define some shared names, with what these need, in their order; empty for none."""
    chosen: set[int] = set()
    left = set(wanted)
    while left:
        name = left.pop()
        place = next((place for place, (_, defines, _) in enumerate(statements()) if name in defines), None)
        if place is not None and place not in chosen:
            chosen.add(place)
            left |= statements()[place][2]
    return "\n".join(statements()[place][0] for place in sorted(chosen))


def code_of(examples: str) -> str:
    """Return the code of the examples of a docstring, without what they print."""
    return "".join(each.source for each in doctest.DocTestParser().get_examples(examples))


def outside(examples: str) -> set[str]:
    """Return the names that examples take from outside: of the imports, and of the shared systems."""
    defines, uses = names_in(code_of(examples))
    return uses - defines


@cache
def printed(examples: str) -> str:
    """Return the whole code of the examples of a docstring: imports, shared systems, code, and outputs as comments."""
    before = lines_for(outside(examples))
    parts = []
    for each in doctest.DocTestParser().parse(examples):
        if isinstance(each, str):
            parts += [f"# {line.strip()}\n" if line.strip() else "" for line in each.splitlines()]
            continue
        if each.source.strip() not in IMPORTS.values():
            parts.append(each.source)
        parts += [f"# {'' if line == '<BLANKLINE>' else line}".rstrip() + "\n" for line in each.want.splitlines()]
    code = "".join(parts)
    used = names_in(f"{before}\n{code_of(examples)}")
    imports = [line for name, line in IMPORTS.items() if name in used[1] or f"{name}." in code]
    kept = [line for line in before.splitlines() if line not in IMPORTS.values()]
    return "\n\n".join(filter(None, ("\n".join(imports), "\n".join(kept).strip(), code.strip()))) + "\n"
