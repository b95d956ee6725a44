"""Changes to a model file from outside of it: the ``--set name=value`` of the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from contextlib import suppress

from gapwalk.errors import ModelError
from gapwalk.model.problem import ModelFileError, Problem
from gapwalk.model.source import Source
from gapwalk.model.system import System


def parse_change(text: str) -> tuple[str, object]:
    """Split ``name=value``; the value is written as in TOML, but a word needs no quotes, and .5 no zero before it.

    Raises
    ------
    ModelError
        If there is no name or no value.
    """
    name, sign, value = (part.strip() for part in text.partition("="))
    if not name or not sign or not value:
        raise ModelError(f"the change {text!r} is not of the form name=value, as in stage2.clearance=0.5")
    for read in (lambda: tomllib.loads(f"value = {value}"), lambda: {"value": float(value)}):
        with suppress(ValueError, RecursionError):
            content = read()
            if len(content) == 1:  # more of them come from a line break in the value
                return name, content["value"]
    return name, value


def change_source(source: Source, changes: Mapping[str, object]) -> tuple[Source, dict[str, object], list[Problem]]:
    """Put the changes that concern the text of the file into it.

    Returns
    -------
    source : Source
        With the changes of the frequency and of the study.
    rest : dict
        The other changes; they concern parameters of the system.
    problems : list of Problem
        What cannot be changed.
    """
    rest, problems = {}, []
    walked, begins = _walk_of(source, changes)
    for name, value in changes.items():
        path = tuple(name.split("."))
        if name == walked and begins:
            problem = f"{name} cannot be set: the study walks it from study.from on; set study.from instead"
            problems.append(Problem(problem, file=source.name))
        elif (path[0] == "study" and len(path) > 1) or name == "frequency":
            try:
                source = source.with_value(path, value)
            except ModelFileError as error:
                problems.extend(error.problems)
        else:
            rest[name] = value
    return source, rest, problems


def change_system(system: System, changes: Mapping[str, object], file: str) -> tuple[System, list[Problem]]:
    """Change parameters of the system, as far as that is possible."""
    problems, known = [], {}
    for name, value in changes.items():
        try:
            system.structure.place(name)
            known[name] = value
        except ModelError as error:
            problems.append(Problem(str(error), file=file))
    try:
        system = system.at(known)
    except ModelError as error:
        problems += [Problem(line, file=file) for line in dict.fromkeys(str(error).splitlines())]
    return system, problems


def _walk_of(source: Source, changes: Mapping[str, object]) -> tuple[object, bool]:
    """The parameter that the study walks, and whether the study says from where."""
    study = source.data.get("study")
    study = study if isinstance(study, Mapping) else {}
    walked = changes.get("study.parameter", study.get("parameter"))
    return walked, "from" in study or "study.from" in changes
