"""The model file: one pass from its text to a system.

The steps are `gapwalk.model.model_source` (parse, and change values), `gapwalk.model.schema` with the tables in
`gapwalk.model.model_tables` and `gapwalk.model.drivetrain.train_file` (validate), and `check_model`, which builds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_file import TrainBase, describes_train, train_part, train_problems
from gapwalk.model.element_tables import CURVED, MeasuredCurve, measured_curve, with_curves
from gapwalk.model.loads import LOADS
from gapwalk.model.matrix_file import arranged, read_labelled, split_name
from gapwalk.model.measured.measured_table import NamedFile, path_of, read_named
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import SystemBase, system_part
from gapwalk.model.problems import Path, Problem, dotted, given
from gapwalk.model.schema import MAX_COORDINATES, Names, refusal, validate
from gapwalk.model.system import System

MATRICES = ("mass", "damping", "stiffness")
"""Keys of a model file that may name a file with a matrix."""
LOAD_FILES = ("file", "over_speed")
"""Keys of the tables of loads that may name a file with columns of numbers; ``over_speed`` may be a formula too."""


@dataclass(frozen=True, slots=True)
class Model:
    """The content of a model file without its studies."""

    system: System  #: The system; its frequency is 1 if the file gives none.
    title: str = ""  #: A line for people; may be empty.
    files: str = ""  #: Digest of the files that the model file names; empty if there are none.


def check_model(source: Source) -> tuple[Model | None, list[Problem]]:
    """Validate a model file, and build its system."""
    is_train = describes_train(source.data)
    files, unread = read_files(source)
    full, unused = read_parts(source, files, units=is_train and Names.of_train(source.data).units)
    unread += unused
    names = Names.of_train if is_train else Names.of
    schema: type[TrainBase | SystemBase] = train_part() if is_train else system_part()
    part, problems = validate(schema, full.data, full, context=lambda: names(full.data))
    # a table without its file may seem to lack more than that
    within = tuple(f"{problem.path.rpartition('.')[0] or problem.path}." for problem in unread)
    problems = unread + [problem for problem in problems if not f"{problem.path}.".startswith(within)]
    if part is None or problems:
        return None, problems
    try:
        return Model(part.system(), part.title, _digest(files)), []
    except ModelError as error:
        return None, [*train_problems(error, source)] if is_train else [source.problem(refusal(error))]


def curves_of(source: Source) -> tuple[MeasuredCurve, ...]:
    """Return the measured curves of a model file without problems, with their points."""
    units = describes_train(source.data) and Names.of_train(source.data).units
    files, _ = read_files(source)
    return tuple(
        measured_curve({**source.data[str(path[0])][path[1]], str(path[2]): content}, units=bool(units))
        for path, content in files.items()
        if path[-1] == "curve"
    )


def has_pace(source: Source) -> bool:
    """Return True if a file gives the frequency of the excitation, or the speed of a shaft in its place."""
    return "frequency" in source.data or "speed" in source.data


def in_order(problems: list[Problem]) -> list[Problem]:
    """Sort problems by their lines."""
    return sorted(problems, key=lambda problem: problem.line or 0)


def read_files(source: Source) -> tuple[dict[Path, Any], list[Problem]]:
    """Read the files that a source names."""
    files: dict[Path, Any] = {}
    problems, known = [], {}
    for path, name in _named(source):
        try:
            if path[0] in MATRICES:
                file, matrix = split_name(name)
                files[path] = read_labelled(path_of(file, source), matrix)
            else:  # it may be named several times
                files[path] = known[name] = known.get(name) or read_named(name, source)
        except ValueError as error:
            problems.append(source.problem(f"is {given(name)}, {error}", path))
    return files, problems


def read_parts(source: Source, files: Mapping[Path, Any], *, units: bool) -> tuple[Source, list[Problem]]:
    """Replace the files that a source names, and a number of coordinates, by their contents and by names.

    ``stiffness = "stiffness.mtx"`` and ``file = "gas.csv"`` name files in the folder of the model file. A matrix
    becomes a list of rows, a curve the stages of its contact, any other file a `NamedFile`. ``coordinates = 100`` is
    short for q1 ... q100; where the files of matrices name their rows, these are the coordinates.
    """
    data: Any = dict(source.data)
    problems: list[Problem] = []
    count = data.get("coordinates")
    if isinstance(count, int) and not isinstance(count, bool):
        if not 1 <= count <= MAX_COORDINATES:
            message = f"is {given(count)}; it must be a list of names, or their number, from 1 to {MAX_COORDINATES}"
            problems.append(source.problem(message, ("coordinates",)))
            count = 0
        data["coordinates"] = [f"q{number}" for number in range(1, count + 1)]
    matrices = {str(path[0]): each for path, each in files.items() if path[0] in MATRICES}
    try:
        arrays, names = arranged(matrices, source.data.get("coordinates"))
        data |= {} if names is None else {"coordinates": names}
    except ValueError as error:
        arrays = {key: each.matrix for key, each in matrices.items()}
        problems.append(source.problem(str(error), ("coordinates",)))
    for path, _ in _named(source):
        *around, key = path
        table = data
        for each in around:  # only what changes is copied
            table[each] = list(table[each]) if isinstance(table[each], list) else dict(table[each])
            table = table[each]
        if path in files:
            table[key] = arrays[str(key)].tolist() if path[0] in MATRICES else files[path]
        else:
            del table[key]
    data, unread = with_curves(replace(source, data=data), units=units)
    return replace(source, data=data), problems + unread


def file_paths(source: Source) -> tuple[str, ...]:
    """List the files that a source names and is allowed to read."""
    found = []
    for _, name in _named(source):
        with suppress(ValueError):
            found.append(path_of(split_name(name)[0], source))
    return tuple(dict.fromkeys(found))


def _named(source: Source) -> list[tuple[Path, str]]:
    """List the keys that name files, with the names."""
    found: list[tuple[Path, object]] = []
    if not describes_train(source.data):
        found += [((key,), source.data.get(key)) for key in MATRICES]
    for kind, keys in {**dict.fromkeys(LOADS, LOAD_FILES), **dict.fromkeys(CURVED, ("curve",))}.items():
        tables = source.data.get(kind)
        for number, table in enumerate(tables if isinstance(tables, list) else ()):
            found += [((kind, number, key), table.get(key)) for key in keys if isinstance(table, Mapping)]
    return [
        (path, name)
        for path, name in found
        if isinstance(name, str) and (path[-1] != "over_speed" or name.lower().endswith(".csv"))
    ]


def _digest(files: Mapping[Path, Any]) -> str:
    """Return a digest of the contents of files by their paths; empty if there are none."""
    digest = hashlib.sha256(" ".join(map(dotted, files)).encode())
    for content in files.values():
        digest.update(content.content if isinstance(content, NamedFile) else content.tobytes())
    return digest.hexdigest() if files else ""
