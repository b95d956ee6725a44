"""The model file: one pass from its text to a system.

The steps are `gapwalk.model.model_source` (parse, and change values), `gapwalk.model.schema` with the tables in
`gapwalk.model.model_tables` and `gapwalk.model.drivetrain.train_file` (validate), and `check_model`, which builds.
"""

from __future__ import annotations

import copy
import hashlib
import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import NamedFile, endings
from gapwalk.model.drivetrain.train_file import TrainBase, describes_train, train_part, train_problems
from gapwalk.model.element_tables import CURVED, MeasuredCurve, measured_curve, with_curves
from gapwalk.model.loads import LOADS
from gapwalk.model.matrix_file import arranged, read_labelled, split_name
from gapwalk.model.measured.measured_table import path_of, read_named
from gapwalk.model.model_source import Source
from gapwalk.model.model_tables import SystemBase, system_of, system_part
from gapwalk.model.problems import HALF, WITHIN, Path, Problem, did_you_mean, dotted, given, idea_of, inside
from gapwalk.model.schema import MAX_COORDINATES, Names, Part, error_path
from gapwalk.model.system import System
from gapwalk.model.units import has_unit

MATRICES = ("mass", "damping", "stiffness")
"""Keys of a model file that may name a file with a matrix."""
LOAD_FILES = ("file", "over_speed", "pressure")
"""Keys of the tables of loads that may name a file with columns of numbers; ``over_speed`` may be a formula too."""

_TOP = "the top of the file, above the first table in brackets"
_EXPLAINED = 200  # problems of a table with a hint: nobody reads more, and the search for similar names takes time

_ALLOWED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "literal_error": "{expected}",
    "dict_type": "a table, such as {{ q1 = 1.0 }}",
    "model_type": "a table",
    "too_short": "a list of {min_length} or more entries",
    "too_long": "a list of {max_length} or fewer entries",
    "less_than": "< {lt:g}",
    "less_than_equal": "<= {le}",
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
}

P = TypeVar("P", bound=Part)


@dataclass(frozen=True, slots=True)
class Model:
    """The content of a model file without its studies."""

    system: System  #: The system; its frequency is 1 if the file gives none.
    title: str = ""  #: A line for people; may be empty.
    files: str = ""  #: Digest of the files that the model file names; empty if there are none.


def check_model(source: Source) -> tuple[Model | None, list[Problem]]:
    """Validate a model file, and build its system."""
    return checked_model(source)[:2]


def checked_model(source: Source) -> tuple[Model | None, list[Problem], System | None]:
    """Validate a model file, and build its system; if that fails, one that has the names of the file, for its studies.

    That one has placeholders in place of the matrices; a drive train is built without its unknown keys. It is None if
    an element of the system is wrong itself.
    """
    is_train = describes_train(source.data)
    files, unread = read_files(source)
    full, unused = read_parts(source, files, units=is_train and Names.of_train(source.data).units)
    unread += unused
    read: list[Names] = []

    def names(data: Mapping[str, Any] = full.data) -> Names:
        read.append((Names.of_train if is_train else Names.of)(data))
        return read[-1]

    schema: type[TrainBase | SystemBase] = train_part() if is_train else system_part()
    part, problems = validate(schema, full.data, full, context=names)
    # a table without its file may seem to lack more than that
    within = tuple(f"{problem.path.rpartition('.')[0] or problem.path}." for problem in unread)
    problems = unread + [problem for problem in problems if not f"{problem.path}.".startswith(within)]
    if part is not None and not problems:
        try:
            system = part.system(read[-1].elements)
        except ModelError as error:
            problems = [*train_problems(error, source)] if is_train else [_refused(error, source)]
        else:
            return Model(system, part.title, _digest(files)), [], system
    if part is None and is_train:  # what else is wrong with it shows when it is built
        data = _as_meant(full.data, problems)
        part, more = validate(schema, data, full, context=lambda: names(data))
        try:
            return None, problems, part.system(read[-1].elements) if part and not more else None
        except ModelError as error:
            return None, [*problems, *train_problems(error, source)], None
    return None, problems, None if is_train else _with_names(full.data, read[-1])


def _as_meant(data: Mapping[str, Any], problems: Sequence[Problem]) -> dict[str, Any]:
    """Return the content of a file with the keys that are meant in place of unknown ones, or without these."""
    found: Any = copy.deepcopy(dict(data))
    for problem in problems:
        *tables, key = re.findall(r"[^.\[\]]+", problem.path) or [""]
        if problem.message.startswith(("is not a key here", "names no inertia")):
            with suppress(KeyError, IndexError, AttributeError, TypeError, ValueError):  # a name with a point in it
                table = found
                for each in tables:
                    table = table[int(each) if isinstance(table, list) else each]
                value, meant = table.pop(key), re.search(r"did you mean (\w+)\?$", problem.message)
                if meant:
                    table.setdefault(meant[1], value)
    return found


def _refused(error: ModelError, source: Source) -> Problem:
    """Return the problem of a system that is refused as a whole, at the key with which the message begins."""
    key = str(error).split(maxsplit=1)[0]
    return source.problem(refusal(error, key), (key,)) if key in MATRICES else source.problem(refusal(error))


def _with_names(data: Mapping[str, Any], names: Names) -> System | None:
    """Return a system with the names of an invalid file, without its matrices."""
    for key in ("contact", "friction", "force", *LOADS):
        tables = data.get(key, [])
        if not isinstance(tables, list) or len(names.elements.get(key, ())) != len(tables):
            return None
    if len(names.elements.get("state", ())) != len(names.states):
        return None
    coordinates = names.coordinates or []
    with suppress(ModelError):
        return system_of(names.elements, coordinates=coordinates, stiffness=[0.0] * len(coordinates))
    return None


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
        if isinstance(name, str) and (path[-1] != "over_speed" or name.lower().endswith(endings()))
    ]


def _digest(files: Mapping[Path, Any]) -> str:
    """Return a digest of the contents of files by their paths; empty if there are none."""
    digest = hashlib.sha256(" ".join(map(dotted, files)).encode())
    for content in files.values():
        digest.update(content.content if isinstance(content, NamedFile) else content.tobytes())
    return digest.hexdigest() if files else ""


# What pydantic finds, as problems of the file.


def validate(
    model: type[P], data: object, source: Source, at: Path = (), context: Callable[[], object] = lambda: None
) -> tuple[P | None, list[Problem]]:
    """Check a table against its schema, and report all of its problems."""
    try:
        return model.model_validate(data, context=context()), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    unknown = [error_path(error) for error in errors if error["type"] == "extra_forbidden"]
    if unknown:  # pydantic checks a table as a whole only when it finds no unknown key in it
        try:
            model.model_validate(_without(data, unknown), context=context())
        except ValidationError as error:
            seen = {(each["loc"], each["type"]) for each in errors}
            errors += [each for each in error.errors(include_url=False) if (each["loc"], each["type"]) not in seen]
    return None, [_problem(model, error, source, at, number < _EXPLAINED) for number, error in enumerate(errors)]


def refusal(error: ModelError, name: str = "") -> str:
    """Return the message of an error of the model as one line that can follow a path which ends in `name`."""
    return "; ".join(line.removeprefix(f"{name} ") for line in dict.fromkeys(str(error).splitlines()))


def _without(data: Any, paths: list[Path]) -> Any:
    """Return data without the values at some paths, which end in keys of tables."""
    unwanted, around = set(paths), {path[:end] for path in paths for end in range(len(path))}

    def pruned(value: Any, at: Path) -> Any:
        if at not in around:
            return value
        if isinstance(value, Mapping):
            places = ((key, each, (*at, key)) for key, each in value.items())
            return {key: pruned(each, place) for key, each, place in places if place not in unwanted}
        if isinstance(value, list):
            return [pruned(each, (*at, index)) for index, each in enumerate(value)]
        return value

    return pruned(data, ())


def _problem(model: type[Part], error: Any, source: Source, at: Path, explained: bool) -> Problem:
    kind, value = error["type"], error["input"]
    path = error_path(error)
    if kind == "extra_forbidden":
        hint = f"; {_unknown_key(str(path[-1]), value, _owner(model, path), model, at)}" if explained else ""
        message = f"is not a key here{hint}"
        return source.problem(message, (*at, *path))
    owner = _owner(model, path)
    if owner and path and path[-1] in owner.model_fields:  # for a default, pydantic gives the name and not the alias
        path = (*path[:-1], owner.model_fields[str(path[-1])].alias or path[-1])
    if kind == "missing":
        description = _fields(owner).get(str(path[-1]), "") if owner else ""
        message = "is missing" + (f"; {description}" if description else "")
    elif kind == "value_error":
        path = path[:-1] if path[-1:] == ("[key]",) else path  # pydantic's mark of an error of a key
        message, path = _located(error["ctx"]["error"], model, path)
    elif kind == "list_type" and isinstance(value, Mapping):
        name = str(path[-1]) if path else ""
        field = owner.model_fields.get(name) if owner else None
        if field is None or any(_parts_in([field.annotation])):
            message = f"is one table; it must be a list of tables: write [[{name}]] with two brackets"
        else:
            message = f"is a table; it must be a list, as in {name} = [1.0]"
    else:
        allowed = _ALLOWED[kind].format(**error.get("ctx", {})) if kind in _ALLOWED else error["msg"]
        written = reduce(inside, (*at, *path), source.data)  # a quantity has been converted by then
        message = f"is {given(written if has_unit(written) else value)}; it must be {allowed}"
        if kind == "model_type" and owner and " as in " in (hint := _fields(owner).get(str(path[-1]), "")):
            message += f"; {hint}"
        if kind == "greater_than_equal" and path[-1:] == ("clearance",):
            message += f": {HALF if describes_train(source.data) else WITHIN}"
        is_quoted_number = kind in ("float_type", "int_type") and isinstance(value, str) and _is_number(value)
        if is_quoted_number or (kind == "bool_type" and value in ("true", "false")):
            message += ", without quotes"
        elif kind == "float_type" and isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value):
            message += f"; it has a point, not a comma: {value.strip().replace(',', '.')}"
        elif kind == "float_type" and has_unit(value):
            message += " without a unit, in consistent units; only the quantities of drive trains have units"
    return source.problem(message, (*at, *path))


def _located(error: Exception, model: type[Part], path: Path) -> tuple[str, Path]:
    """Return the message of an error and its path, with one more key if the message begins with a key of that table."""
    if not isinstance(error, ModelError):
        return str(error), path
    table = _owner(model, (*path, ""))
    name = str(error).split(maxsplit=1)[0]
    if table and name in _fields(table):
        path = (*path, name)
    return refusal(error, str(path[-1]) if path else ""), path


def _unknown_key(key: str, value: object, owner: type[Part] | None, root: type[Part], at: Path) -> str:
    """Suggest a replacement for an unknown key."""
    if owner and (hint := owner.hint_for(key, value)):
        return hint
    if owner is not root and key in _fields(root):
        if any(_parts_in([root.model_fields[key].annotation])):
            return f"it is a table of its own, [[{key}]]"
        above = f"the {at[0]}, above the first of its tables" if at else _TOP
        return f"{key} belongs to {above}"
    for name, info in root.model_fields.items() if owner is root else ():
        if any(key in _fields(part) for part in _parts_in([info.annotation])):
            return f"it belongs in {name}"
    if idea := idea_of(key):
        return idea
    return did_you_mean(key, list(_fields(owner) if owner else ()), "the keys are")


def _owner(model: type[Part], path: Path) -> type[Part] | None:
    """Return the schema of the table that has the last key of `path`."""
    owner: type[Part] | None = model
    for key in path[:-1]:
        if owner is None or isinstance(key, int):
            continue
        annotations = [info.annotation for name, info in owner.model_fields.items() if key in (name, info.alias)]
        owner = next(_parts_in(annotations), None)
    return owner


def _parts_in(annotations: Any) -> Iterator[type[Part]]:
    for annotation in annotations:
        if inspect.isclass(annotation) and issubclass(annotation, Part):
            yield annotation
        else:
            yield from _parts_in(get_args(annotation))


def _fields(part: type[Part]) -> dict[str, str]:
    """Return the keys of a table with their descriptions."""
    return {info.alias or name: info.description or "" for name, info in part.model_fields.items()}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
