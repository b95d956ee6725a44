"""The schema of a table in a model file: what all of them share, and how pydantic's complaints become problems."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Discriminator, Tag, ValidationError

from gapwalk.errors import ModelError
from gapwalk.model.model_source import Source
from gapwalk.model.problems import Path, Problem, did_you_mean, given
from gapwalk.model.units.quantity import has_unit

_TOP = "the top of the file, above the first table in brackets"
_EXPLAINED = 200  # problems of a table with a hint: nobody reads more, and looking for near names takes time
_TAG = "\0"  # begins the tags of unions, which pydantic puts among the keys of a path

_ALLOWED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "an integer",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "dict_type": "a table, such as {{ q1 = 1.0 }}",
    "model_type": "a table",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "less_than_equal": "<= {le}",
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
}


class Part(BaseModel):
    """A table of a model file. Unknown keys are refused; a field's description says what a missing key is."""

    model_config = ConfigDict(extra="forbid", frozen=True)


P = TypeVar("P", bound=Part)


def tagged(name: str) -> Tag:
    """The tag of one member of a union."""
    return Tag(_TAG + name)


def by_shape(choose: Callable[[Any], str]) -> Discriminator:
    """Tell the members of a union apart by a function that returns the name of a `tagged` one."""
    return Discriminator(lambda value: _TAG + choose(value))


def validate(
    model: type[P], data: object, source: Source, at: Path = (), context: Callable[[], object] = lambda: None
) -> tuple[P | None, list[Problem]]:
    """Check a table against its schema, and report everything that is wrong with it.

    Parameters
    ----------
    model
        The schema.
    data
        The table.
    source, at
        Where it stands: the file, and the path in it.
    context
        Makes what the validators of the schema may look at, once for each pass.

    Returns
    -------
    part : Part or None
        The table, if nothing is wrong.
    problems : list of Problem
        What is wrong otherwise.
    """
    try:
        return model.model_validate(data, context=context()), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    unknown = [_path_of(error) for error in errors if error["type"] == "extra_forbidden"]
    if unknown:  # pydantic checks a table as a whole only when it finds no unknown key in it
        try:
            model.model_validate(_without(data, unknown), context=context())
        except ValidationError as error:
            seen = {(each["loc"], each["type"]) for each in errors}
            errors += [each for each in error.errors(include_url=False) if (each["loc"], each["type"]) not in seen]
    return None, [_problem(model, error, source, at, number < _EXPLAINED) for number, error in enumerate(errors)]


def refusal(error: ModelError, name: str = "") -> str:
    """The message of an error of the model as one line that can follow a path which ends in `name`."""
    return "; ".join(line.removeprefix(f"{name} ") for line in dict.fromkeys(str(error).splitlines()))


def _without(data: Any, paths: list[Path]) -> Any:
    """The data without the values at some paths, which end in keys of tables."""
    unwanted, ways = set(paths), {path[:end] for path in paths for end in range(len(path))}

    def pruned(value: Any, at: Path) -> Any:
        if at not in ways:
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
    path = _path_of(error)
    if kind == "extra_forbidden":
        hint = f"; {_unknown_key(str(path[-1]), _owner(model, path), model, at)}" if explained else ""
        message = f"is no key here{hint}"
        return source.problem(message, (*at, *path))
    owner = _owner(model, path)
    if owner and path and path[-1] in owner.model_fields:  # of a default, pydantic tells the name and not the alias
        path = (*path[:-1], owner.model_fields[str(path[-1])].alias or path[-1])
    if kind == "missing":
        description = _fields(owner).get(str(path[-1]), "") if owner else ""
        message = "is missing" + (f"; {description}" if description else "")
    elif kind == "value_error":
        path = path[:-1] if path[-1:] == ("[key]",) else path  # pydantic's mark of a complaint about a key
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
        message = f"is {given(value)}; it must be {allowed}"
        if kind in ("float_type", "int_type") and isinstance(value, str) and _is_number(value):
            message += ", without quotes"
        elif kind == "float_type" and isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value):
            message += f"; it has a point, not a comma: {value.strip().replace(',', '.')}"
        elif kind == "float_type" and has_unit(value):
            message += " without a unit, in units that fit together; only the quantities of drive trains have units"
    return source.problem(message, (*at, *path))


def _path_of(error: Any) -> Path:
    """The path of an error without the tags of unions; an unknown key is what it is, whatever it looks like."""
    path = error["loc"]
    given = path[-1:] if error["type"] == "extra_forbidden" else ()
    tagged = path[: len(path) - len(given)]
    return (*(key for key in tagged if not (isinstance(key, str) and key.startswith(_TAG))), *given)


def _located(error: Exception, model: type[Part], path: Path) -> tuple[str, Path]:
    """The message of an error and its path, made longer if the message begins with a key of that table."""
    if not isinstance(error, ModelError):
        return str(error), path
    table = _owner(model, (*path, ""))
    name = str(error).split(maxsplit=1)[0]
    if table and name in _fields(table):
        path = (*path, name)
    return refusal(error, str(path[-1]) if path else ""), path


def _unknown_key(key: str, owner: type[Part] | None, root: type[Part], at: Path) -> str:
    """Suggest what to write in place of an unknown key."""
    known = _fields(owner) if owner else {}
    homes = [name for name, info in root.model_fields.items() if key in _keys_below(info.annotation)]
    if owner is not root and key in _fields(root):
        above = f"the {at[0]}, above the first of its tables" if at else _TOP
        hint = f"{key} belongs to {above}"
    elif owner is root and homes:
        hint = f"it belongs in {homes[0]}"
    else:
        hint = did_you_mean(key, list(known), "the keys are")
    return hint


def _keys_below(annotation: Any) -> set[str]:
    return {key for part in _parts_in([annotation]) for key in _fields(part)}


def _owner(model: type[Part], path: Path) -> type[Part] | None:
    """The schema of the table in which the last key of `path` stands."""
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
    """The keys of a table with their descriptions."""
    return {info.alias or name: info.description or "" for name, info in part.model_fields.items()}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
