"""The model file: one pass from its text to a system.

The steps are `gapwalk.model.model_source` (parse, and change values), `gapwalk.model.schema` with the tables in
`gapwalk.model.model_tables` and `gapwalk.model.drivetrain.train_file` (validate), and `check_model`, which builds.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_file import describes_train, train_part, train_problems
from gapwalk.model.matrix_file import read_matrix
from gapwalk.model.measured.curve_contact import with_curves
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import system_part
from gapwalk.model.problems import Problem, given
from gapwalk.model.schema import MAX_COORDINATES, Names, Part, refusal, validate
from gapwalk.model.system import System

MATRICES = ("mass", "damping", "stiffness")
"""Keys of a model file that may name a file with a matrix."""


@dataclass(frozen=True, slots=True)
class Model:
    """The content of a model file without its studies.

    Parameters
    ----------
    system
        The system; its frequency is 1 if the file gives none.
    title
        A line for people; may be empty.
    matrices
        Digest of the matrices in files of their own; empty if there are none.
    """

    system: System
    title: str = ""
    matrices: str = ""


def check_model(source: Source) -> tuple[Model | None, list[Problem]]:
    """Validate a model file, and build its system.

    Returns
    -------
    model : Model or None
        The model, if the file has no problems.
    problems : list of Problem
        All problems of the file but those of its studies.
    """
    is_train = describes_train(source.data)
    if is_train:
        units = Names.of_train(source.data).units
        data, unread = with_curves(source, lambda name: _path_of(name, source), units=units)
        full = replace(source, data=data)
        part, problems = validate(train_part(), data, full, context=lambda: Names.of_train(data))
        problems = unread + problems
    else:
        full, unread = read_parts(source)
        part, problems = validate(system_part(), full.data, full, context=lambda: Names.of(full.data))
        missing = {problem.path for problem in unread}
        problems = unread + [problem for problem in problems if problem.path not in missing]
    if part is None or problems:
        return None, problems
    try:
        return Model(part.system(), part.title, _digest(source, part)), []
    except ModelError as error:
        return None, [*train_problems(error, source)] if is_train else [source.problem(refusal(error))]


def has_pace(source: Source) -> bool:
    """Return True if a file gives the frequency of the excitation, or the speed of a shaft in its place."""
    return "frequency" in source.data or "speed" in source.data


def in_order(problems: list[Problem]) -> list[Problem]:
    """Sort problems by their lines."""
    return sorted(problems, key=lambda problem: problem.line or 0)


def read_parts(source: Source) -> tuple[Source, list[Problem]]:
    """Replace files of matrices and a number of coordinates in a source by matrices and names.

    ``stiffness = "stiffness.mtx"`` names a file in the folder of the model file; ``coordinates = 100`` is short for
    q1 ... q100.

    Returns
    -------
    source : Source
        The source with matrices and names.
    problems : list of Problem
        Files that cannot be used.
    """
    data, problems = dict(source.data), []
    count = data.get("coordinates")
    if isinstance(count, int) and not isinstance(count, bool):
        if not 1 <= count <= MAX_COORDINATES:
            message = f"is {given(count)}; it must be a list of names, or their number, from 1 to {MAX_COORDINATES}"
            problems.append(source.problem(message, ("coordinates",)))
            count = 0
        data["coordinates"] = [f"q{number}" for number in range(1, count + 1)]
    for key in _named(source):
        try:
            data[key] = read_matrix(_path_of(data[key], source)).tolist()
        except ValueError as error:
            problems.append(source.problem(f"is {given(data.pop(key))}, {error}", (key,)))
    source = replace(source, data=data)
    data, unread = with_curves(source, lambda name: _path_of(name, source), units=False)
    return replace(source, data=data), problems + unread


def matrix_paths(source: Source) -> tuple[str, ...]:
    """List the files of matrices that a source names and is allowed to read."""
    found = []
    for key in _named(source):
        with suppress(ValueError):
            found.append(_path_of(source.data[key], source))
    return tuple(found)


def _named(source: Source) -> list[str]:
    """List the keys of matrices that are in files of their own."""
    return [key for key in MATRICES if isinstance(source.data.get(key), str)]


def _path_of(name: str, source: Source) -> str:
    """Return the path of a matrix file; raise a ValueError if the source is not allowed to read it."""
    path = os.path.join(os.path.dirname(source.name), name)
    if source.within:
        inside = os.path.realpath(source.within)
        if os.path.commonpath((os.path.realpath(path), inside)) != inside:
            raise ValueError(f"which lies outside of the folder {os.path.basename(inside)}; put the file into it")
    return path


def _digest(source: Source, part: Part) -> str:
    if not (named := _named(source)):
        return ""
    digest = hashlib.sha256(" ".join(named).encode())
    for key in named:
        digest.update(np.array(getattr(part, key), dtype=float).tobytes())
    return digest.hexdigest()
