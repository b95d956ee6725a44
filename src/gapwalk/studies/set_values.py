"""Changes of the values of a model: ``set`` in a study, and ``--set name=value`` on the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from gapwalk.errors import ModelError
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import MAX_STUDIES
from gapwalk.model.problems import ModelFileError, Path, Problem, given
from gapwalk.model.system import System
from gapwalk.model.units import PACES


def parse_changes(texts: Iterable[str]) -> dict[str, object]:
    """Return the changes of ``--set`` by their names; see `parse_change`."""
    return dict(parse_change(text) for text in texts)


def parse_change(text: str) -> tuple[str, object]:
    """Split ``name=value``; the value is TOML, except that a word needs no quotes and .5 needs no leading zero."""
    name, sign, value = (part.strip() for part in text.partition("="))
    if not name or not sign or not value:
        raise ModelError(f"the change {text!r} is not of the form name=value, as in stage2.clearance=0.5")
    for read in (lambda: tomllib.loads(f"value = {value}"), lambda: {"value": float(value)}):
        with suppress(ValueError, RecursionError):
            content = read()
            if len(content) == 1:  # more of them come from a line break in the value
                return name, content["value"]
    return name, value


def study_tables(source: Source) -> dict[Path, Mapping[str, object]]:
    """Return the table ``[study]`` of a file, or its tables ``[[study]]``, by path; nothing if there are too many."""
    study = source.data.get("study")
    if isinstance(study, list) and len(study) > MAX_STUDIES:
        return {}
    tables = {("study", i): table for i, table in enumerate(study)} if isinstance(study, list) else {("study",): study}
    return {path: table for path, table in tables.items() if isinstance(table, Mapping)}


def change_source(source: Source, changes: Mapping[str, object]) -> tuple[Source, dict[str, object], list[Problem]]:
    """Apply those changes that concern the text of the file."""
    # ``study.to`` concerns all studies of the file, ``study.light.to`` the one that is named light.
    rest, problems = {}, []
    tables = study_tables(source).values()
    walked = {name for name in changes if tables and all(_walks(table, name, changes) for table in tables)}
    for name, value in changes.items():
        if name in walked:
            problems.append(Problem(f"{name} cannot be set: {_walk_words(tables, name)}", file=source.name))
            continue
        paths = [*_study_paths(source, name)] or ([(name,)] if name in PACES else [])
        try:
            for path in paths:
                source = source.with_value(path, value)
        except ModelFileError as error:
            problems.extend(error.problems)
        if not paths:
            rest[name] = value
    return source, rest, problems


class Change(NamedTuple):
    """Another value of a parameter, and its place in the file."""

    value: object
    path: Path


def study_changes(source: Source, at: Path, system: System | None) -> tuple[dict[str, Change], list[Problem]]:
    """Return the parameters to which the ``set`` of the study at a path gives other values."""
    table = study_tables(source)[at]
    if "set" not in table:
        return {}, []
    values = table["set"]
    if not isinstance(values, Mapping):
        message = f'is {given(values)}; it must be a table, such as {{ "harmonic1.amplitude" = 0.5 }}'
        return {}, [source.problem(message, (*at, "set"))]
    found, problems = {}, []
    for change in leaves_of(values, (*at, "set")):
        name = ".".join(str(key) for key in change.path[len(at) + 1 :])
        try:
            if system:
                system.structure.place(name)
            if name in varied_parameters(table):
                raise ModelError("cannot be set here: it has a value for each member in over")
            if _walks(table, name, {}):
                raise ModelError("cannot be set here: the study walks this parameter, starting at its key from")
            found[name] = change
        except ModelError as error:
            problems.append(source.problem(str(error), change.path))
    return found, problems


def change_system(
    system: System | None,
    source: Source,
    own: Mapping[str, Change],
    changes: Mapping[str, object],
    *,
    guessed: bool = False,
) -> tuple[System | None, list[Problem]]:
    """Change parameters of the system, if it is known: first by the study in the file, then by the command line."""
    if system is None or guessed:  # of placeholders, only the names are checked
        return system, _unknown_names(system, source, changes) if system else []
    values: dict[str, Any] = {name: change.value for name, change in own.items()}
    try:
        _check_units(system, values)
        system.at(values)
    except ModelError as error:
        problems = []
        for line in dict.fromkeys(str(error).splitlines()):  # each is at the value that it begins with, or at the first
            name, _, reason = line.partition(" ")
            path = own[name].path if name in own else next(iter(own.values())).path
            problems.append(source.problem(reason if name in own else f"is refused: {line}", path))
        return system, problems
    problems = _unknown_names(system, source, changes)
    values |= {name: value for name, value in changes.items() if name in system.structure.names}
    try:
        _check_units(system, values)
        system = system.at(values)
    except ModelError as error:
        problems += [Problem(line, file=source.name) for line in dict.fromkeys(str(error).splitlines())]
    return system, problems


def _unknown_names(system: System, source: Source, changes: Mapping[str, object]) -> list[Problem]:
    """Return the changes from outside of a file that name no parameter."""
    problems = []
    for name in changes:
        try:
            system.structure.place(name)
        except ModelError as error:
            problems.append(Problem(str(error), file=source.name))
    return problems


def _check_units(system: System, values: Mapping[str, Any]) -> None:
    """Raise a ModelError for plain numbers and wrong units if the system has units; 0 needs no unit."""
    lines = []
    for name, value in values.items():
        if system.units and system.units.parameter(name) and isinstance(value, int | float | str) and value != 0:
            try:
                system.units.read(name, value)
            except ValueError as error:
                lines.append(f"{name} {error}")
    if lines:
        raise ModelError("\n".join(lines))


def _study_paths(source: Source, name: str) -> Iterator[Path]:
    """Yield the keys of the studies to which the name of a change refers."""
    first, *keys = name.split(".")
    if first != "study" or not keys:
        return
    tables = study_tables(source)
    named = [path for path, table in tables.items() if len(keys) > 1 and table.get("name") == keys[0]]
    if named:
        yield from ((*path, *keys[1:]) for path in named)
    else:
        yield from ((*path, *keys) for path in tables or [("study",)])


def walked_parameters(table: Mapping[str, object]) -> list[str]:
    """Return the parameters that a study walks or varies, if they are given as strings."""
    ranges = (table, table.get("second"), table.get("over"))
    found = [each.get("parameter") for each in ranges if isinstance(each, Mapping)]
    return [*(name for name in found if isinstance(name, str)), *varied_parameters(table)]


def varied_parameters(table: Mapping[str, object]) -> list[str]:
    """Return the parameters that differ from member to member of a family; `over` may be a single range, too."""
    over = table.get("over")
    if not isinstance(over, Mapping) or isinstance(over.get("parameter"), str):
        return []
    leaves = leaves_of(over, ())
    return [".".join(str(key) for key in leaf.path) for leaf in leaves]


def _walk_words(tables: Iterable[Mapping[str, object]], name: str) -> str:
    """Explain that a parameter cannot be set because all studies of a file walk it, and what to set instead."""
    if all(name in varied_parameters(table) for table in tables):
        return "study.over gives it a value for each member; change those in the file"
    key = "study.second.from" if all(_walks_second(table, name) for table in tables) else "study.from"
    if key == "study.second.from" and all(table.get("kind") == "locus" for table in tables):
        key = "study.second.at"
    if all(_over(table) == name for table in tables):
        key = "study.over.from"
    return f"the study walks it from {key} on; set {key} instead"


def _over(table: Mapping[str, object]) -> object:
    """Return the parameter of the range ``over`` of a threshold; None if there is no such range."""
    over = table.get("over")
    return over.get("parameter") if isinstance(over, Mapping) else None


def _walks_second(table: Mapping[str, object], name: str) -> bool:
    """Return True if a study walks a parameter as its second one."""
    return name in walked_parameters(table) and table.get("parameter") != name


def _walks(table: Mapping[str, object], name: str, changes: Mapping[str, object]) -> bool:
    """Return True if a study walks a parameter and gives the value at which it starts."""
    if _walks_second(table, name):
        return True
    parameter = changes.get("study.parameter", table.get("parameter"))
    return parameter == name and ("from" in table or "study.from" in changes)


def leaves_of(table: Mapping[str, object], path: Path) -> Iterator[Change]:
    """Yield all values in a table of tables: ``harmonic1.amplitude`` may be written with or without quotes."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from leaves_of(value, (*path, key))
        else:
            yield Change(value, (*path, key))
