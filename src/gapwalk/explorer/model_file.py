"""A model file for one orbit: the file that was opened, with a study that walks from that orbit."""

from __future__ import annotations

import re

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.model_source import parse_source
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.file import Study, check_study

_HEADER = re.compile(r"\s*\[\[?\s*([\w-]+|\"[^\"]*\")")


def model_file(text: str, name: str, within: str, orbit: Orbit, parameter: str, to: float, measure: str) -> str:
    """The text of a model file whose study is a response from an orbit.

    Parameters
    ----------
    text
        The text of the file that was opened.
    name
        Its name: matrices may stand in files beside it.
    within
        The folder outside of which none is read.
    orbit
        The orbit.
    parameter, to, measure
        Of the response.

    Raises
    ------
    ModelError
        If the file cannot be written so that it describes the same system: one that was reduced, for example.
    """
    text = _with_frequency(_without_studies(text), orbit, parameter)
    changes = _changes(text, name, within, orbit, parameter)
    study = [
        "[study]",
        'kind = "response"',
        f"parameter = {_quoted(parameter)}",
        f"from = {orbit.system[parameter]!r}",
        f"to = {to!r}",
        f"period = {orbit.period}",
        f"start = {orbit.state.tolist()!r}",
        f"measure = {_quoted(measure)}",
    ]
    if changes:
        study += ["", "[study.set]", *(f"{_quoted(name)} = {value!r}" for name, value in changes.items())]
    found = f"{text.rstrip()}\n\n" + "\n".join(study) + "\n"
    if not np.array_equal(check_study(parse_source(found, name, within)).system.values, orbit.system.values):
        raise ModelError("this system cannot be written as a model file: it has other numbers when it is read back")
    return found


def _changes(text: str, name: str, within: str, orbit: Orbit, parameter: str) -> dict[str, float]:
    """The values of the orbit's system that differ from those of the file without its studies."""
    system = orbit.system
    bare = f'{text}\n[study]\nkind = "response"\nparameter = {_quoted(parameter)}\n'
    bare += f"from = {system[parameter]!r}\nto = {system[parameter] + 1.0!r}\n"
    base: Study = check_study(parse_source(bare, name, within))
    if base.system.structure != system.structure:
        raise ModelError("this system is not that of the model file (it was reduced, for example); export the script")
    names = system.structure.names
    places = np.flatnonzero(base.system.values != system.values).tolist()
    return {names[place]: float(system.values[place]) for place in places if names[place] != parameter}


def _with_frequency(text: str, orbit: Orbit, parameter: str) -> str:
    """A file whose study walks the frequency need not have one."""
    if parameter == "frequency" or "frequency" in parse_source(text).data:
        return text
    return f"frequency = {orbit.system.frequency!r}\n{text}"


def _without_studies(text: str) -> str:
    """The text without its tables of studies."""
    kept, inside = [], False
    for line in text.splitlines():
        header = _HEADER.match(line)
        if header:
            inside = header.group(1).strip('"') == "study"
        if not inside:
            kept.append(line)
    return "\n".join(kept)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
