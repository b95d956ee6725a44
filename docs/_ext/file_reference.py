"""Writes the reference of model files and of the command line into docs/reference/generated, from the code.

Keys, types, defaults and bounds come from the schema that reads the files; words from the docstrings of the records
that the tables describe, from the schema, and from ``keys.toml`` for what neither says; examples from the example files
of the repository. ``tests/docs/test_file_reference.py`` fails where a key has no words or no example.
"""

from __future__ import annotations

import inspect
import io
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import annotated_types
from pydantic import WrapValidator
from pydantic.fields import FieldInfo
from rich.console import Console
from sphinx.application import Sphinx

from docs._ext.api_links import extensions_page
from docs._ext.held_types import records_page
from gapwalk.bifurcation.kinds import Kind
from gapwalk.cli.commands import app as commands
from gapwalk.field_docs import field_words
from gapwalk.model.drivetrain.train_file import train_part
from gapwalk.model.laws import LAWS, law_parameters
from gapwalk.model.model_tables import system_part
from gapwalk.model.schema import Part
from gapwalk.model.units import QuantityKind
from gapwalk.picture_parts import described
from gapwalk.plot import picture as pictures
from gapwalk.studies.measurement_fit import Measurement as RecordMeasurement
from gapwalk.studies.measurement_fit import SweptMeasurement
from gapwalk.studies.study_file import ReductionPart
from gapwalk.studies.study_kind import INLINE, kind_of, kinds
from gapwalk.studies.study_schema import study_schema, table_schema

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference" / "generated"
ASIDE = ("study", "measurement", "reduction")  # tables of their own kind, below
NAMED = {int: "integer", float: "number", str: "text", bool: "true, false", Any: "any", NoneType: ""}


@dataclass(frozen=True)
class Key:
    """A key of a table: its row in the reference."""

    table: str
    name: str
    type: str
    unit: str
    default: str
    bound: str
    words: str
    example: str

    @property
    def meaning(self) -> tuple[str, ...]:
        """Return what two keys have in common that are one: all but the table and the example."""
        return self.inside, self.name, self.type, self.default, self.bound, self.words

    @property
    def inside(self) -> str:
        """Return the name of the table within that of a study; empty for the table of the study itself."""
        return self.table.partition(".")[2]

    def row(self, *more: str) -> str:
        """Return its row in Markdown, with further cells."""
        unit = f" in {self.unit}" if self.unit and self.unit != "of the parameter" else ""
        value = f"{self.type}{unit}{', ' if self.bound else ''}{self.bound}"
        shown = "" if self.example == f"`{self.name} = {self.default.strip('`')}`" else self.example
        cells = (f"`{self.name}`", value, self.default, self.words, shown, *more)
        return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


@cache
def _given() -> dict[str, dict[str, list[str]]]:
    """Words (and an example) by table and key; the table ``any`` holds for all of them."""
    return tomllib.loads(Path(__file__).with_name("keys.toml").read_text(encoding="utf-8"))


def _tables_of_words(table: str) -> Iterator[dict[str, list[str]]]:
    for name in (table, table.rpartition(".")[2], "study" if table in kinds() else "", "any"):
        yield _given().get(name, {})


@cache
def _files() -> tuple[dict[str, Any], ...]:
    folders = (ROOT / "examples", ROOT / "docs", ROOT / "tests" / "machines")
    paths = [path for folder in folders for path in folder.rglob("*.toml")]
    return tuple(tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted(paths) if "_ext" not in path.parts)


@cache
def _tables_in_files(table: str) -> list[Mapping[str, Any]]:
    """Find a table such as ``contact.stage`` or ``response.walk`` in the example files, in their order."""
    first, *rest = table.split(".") if table else [""]
    is_kind, tables = first in kinds(), list[Mapping[str, Any]]()
    for file in _files():
        found: list[Any] = [file]
        if is_kind:
            found = [each for each in _listed(file.get("study")) if each.get("kind") == first]
        elif first:
            found = _listed(file.get(first))
        for part in rest:
            found = [inner for each in found if isinstance(each, Mapping) for inner in _listed(each.get(part))]
        tables.extend(each for each in found if isinstance(each, Mapping))
    return tables


def _example_in_files(table: str, key: str) -> Any:
    """Find the first use of a key of a table in an example file."""
    return next((each[key] for each in _tables_in_files(table) if key in each), None)


def _listed(value: Any) -> list[Any]:
    return [] if value is None else value if isinstance(value, list) else [value]


def _toml(value: Any, depth: int = 0) -> str:
    """Write a short value as in a file; an empty text if it is long, or a table of its own."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        inner = [_toml(each, depth + 1) for each in value]
        return f"[{', '.join(inner)}]" if all(inner) and sum(map(len, inner)) < 50 else ""
    if isinstance(value, Mapping):
        inner = [f"{_bare(key)} = {_toml(each, depth + 1)}" for key, each in value.items()]
        return f"{{ {', '.join(inner)} }}" if sum(map(len, inner)) < 70 else ""
    return repr(value)


def _bare(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key) else f'"{key}"'


def _type(hint: Any) -> str:
    """Name the type of a key."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _type(arguments[0])
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(filter(None, (_type(each) for each in arguments))))
    if origin in (list, tuple):
        return f"list of {_type(arguments[0])}" if arguments else "list"
    if origin is dict:
        return "table"
    if origin is Literal:
        return ", ".join(f'`"{each}"`' for each in arguments)
    if isinstance(hint, type) and issubclass(hint, Kind):
        return "kind of special point"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(f'`"{each.value}"`' for each in hint)
    if isinstance(hint, type) and (issubclass(hint, Part) or hint.__name__ == "Start"):
        return "table" if issubclass(hint, Part) else '`"rest"`, `"settle"`'
    return NAMED.get(hint, getattr(hint, "__name__", str(hint)))


def _marks(hint: Any) -> Iterator[Any]:
    """List what annotates a type, inside of it too."""
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        yield from _marks(inner)
        for mark in marks:
            yield from mark.metadata if isinstance(mark, FieldInfo) else (mark,)
    elif get_origin(hint) in (Union, UnionType):
        for each in get_args(hint):
            yield from _marks(each)


def _unit(marks: list[Any]) -> str:
    """Name the kind of quantity that a key has in a file with units, with its usual unit."""
    for mark in marks:
        if isinstance(mark, WrapValidator):
            found = inspect.getclosurevars(mark.func).nonlocals.get("kind")  # pyright: ignore[reportArgumentType]
            if isinstance(found, QuantityKind):
                return found.usual[0] if found.usual else found.words
            if mark.func.__name__ == "_with_unit":
                return "of the parameter"
    return ""


_SIGNS = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}


def _bound(marks: list[Any]) -> str:
    found = []
    for mark in marks:
        for name, sign in _SIGNS.items():
            value = getattr(mark, name, None)
            if value is not None and isinstance(mark, annotated_types.BaseMetadata):
                found.append(f"{sign} {value:,}" if isinstance(value, int) else f"{sign} {value:g}")
        if isinstance(mark, annotated_types.MinLen) and mark.min_length > 0:
            found.append(f"{mark.min_length} or more")
    return ", ".join(dict.fromkeys(found))


def _default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    value = info.default
    if value is None or repr(value) == "PydanticUndefined" or is_dataclass(value):
        return ""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, tuple):
        value = list(value)
    if value == "" or (isinstance(value, list | dict) and not value):
        return ""
    if isinstance(value, list):
        value = [str(each) if isinstance(each, Kind) else each for each in value]
    return f"`{_toml(value)}`" if _toml(value) else "all"


def docstring_words(record: type) -> dict[str, str]:
    """Return the words of each field of a record, and of the records whose fields are written into its table."""
    found = field_words(record)
    for inner in _inlined(record):
        found = docstring_words(inner) | found
    return found


def _inlined(record: type) -> list[type]:
    """List the dataclasses whose fields are written into the table of another one."""
    hints = get_type_hints(record, include_extras=True) if is_dataclass(record) else {}
    return [get_args(hint)[0] for hint in hints.values() if get_origin(hint) is Annotated and INLINE in get_args(hint)]


def _nested(hint: Any) -> type[Part] | None:
    """Return the schema of the tables in a key, if it has tables."""
    if isinstance(hint, type):
        return hint if issubclass(hint, Part) else None
    return next((found for each in get_args(hint) if (found := _nested(each))), None)


def keys_of(schema: type[Part], table: str, words: Mapping[str, str]) -> Iterator[Key]:
    """List the keys of a table and of the tables in it.

    Parameters
    ----------
    schema
        Its schema.
    table
        Its name: ``contact.stage``, or the kind of a study; empty for the top of a file.
    words
        Words of its keys, for which the schema has none.
    """
    inside = []
    law = law_parameters("parameters", "stage_parameters")
    for name, info in schema.model_fields.items():
        key = info.alias or name
        if key in ASIDE and not table:
            continue
        marks = [*_marks(info.annotation), *info.metadata]
        known = next((words[key] for words in _tables_of_words(table) if key in words), [])
        said = words.get(name) or (known[0] if known else "") or (info.description or "")
        if not said and key in law:
            said = law[key].words
        used = _example_in_files(table, key)
        first, _, rest = table.partition(".")
        for other in kinds() if used is None and first in kinds() else ():
            used = _example_in_files(f"{other}.{rest}".rstrip("."), key) if used is None else used
        example = _toml(used) if used is not None else ""
        if len(known) > 1 and (not example or known[0]):
            example = known[1]
        nested = _nested(info.annotation)
        if not example and nested is None:
            example = _default(info).strip("`")
        shown = f"`{key} = {example}`" if example not in ("", "required", "all") else "below" if nested else ""
        unit = _unit(marks)
        if not unit and key in law and law[key].kind is not None:
            unit = law[key].kind.usual[0]
        bound = _bound(marks) or (f">= {law[key].least:g}" if key in law and law[key].least is not None else "")
        said = re.sub(r"\s*In a table[^.]*\.", "", said)
        said = re.sub(r"^(write|name|list|it is) ", "", said).rstrip(".")
        said = said[:1].upper() + said[1:]
        yield Key(table, key, _type(info.annotation), unit, _default(info), bound, said, shown)
        if nested is not None and not any(nested.__name__ == other.__name__ for other, _ in inside):
            inside.append((nested, f"{table}.{key}".lstrip(".")))
    for nested, place in inside:
        record = getattr(nested, "kind", None) or _RECORDS.get(nested.__name__)
        yield from keys_of(nested, place, docstring_words(record) if record else {})


def _records() -> dict[str, type]:
    """Find the dataclasses that tables describe, by the names of their schemas."""
    seen: dict[str, type] = {}

    def look(kind: type) -> None:
        for each in kind.__subclasses__():
            seen[each.__name__] = each
            look(each)

    look(Part)
    found = {}
    for name, schema in seen.items():
        module = inspect.getmodule(schema)
        record = getattr(module, name.removesuffix("Table"), None) if name.endswith("Table") else None
        if isinstance(record, type):
            found[name] = record
    return found


for _kind in kinds():
    study_schema(kind_of(_kind))
_RECORDS = _records()

HEAD, HEAD_RULE = "| key | value | default | what it is | example |", "|---|---|---|---|---|"


@cache
def all_keys() -> dict[str, list[Key]]:
    """Return the keys of model files, by page."""
    pages = {
        "model-file": [*keys_of(system_part(), "", {})],
        "train-file": [*keys_of(train_part(), "", {})],
        "study-file": [
            key
            for kind in kinds()
            for key in keys_of(study_schema(kind_of(kind)), kind, docstring_words(kind_of(kind)))
        ],
        "more-tables": [
            *keys_of(ReductionPart, "reduction", docstring_words(ReductionPart)),
            *keys_of(table_schema(SweptMeasurement), "measurement", docstring_words(SweptMeasurement)),
            *keys_of(table_schema(RecordMeasurement), "measurement", docstring_words(RecordMeasurement)),
        ],
    }
    return {page: list({(key.table, key.name): key for key in keys}.values()) for page, keys in pages.items()}


INTRODUCTIONS = {
    "model-file": (
        "Keys of a model file",
        "Every key of a model file with coordinates and matrices, as the program reads it. Numbers are in consistent "
        "units of your choice. In a [drive train](train-file.md) they may have units, of which the usual one stands "
        "behind the type. `gapwalk new FILE` writes a commented file to start from.",
    ),
    "train-file": (
        "Keys of a drive train",
        "Every key of a model file with inertias, shafts and gears that is not already on the page "
        "[keys of a model file](model-file.md): the tables there belong to a drive train too. Quantities may be texts "
        'with units, such as `"30 N m/deg"`: all of a file, or none. The usual unit stands behind the type.',
    ),
    "study-file": (
        "Keys of a study",
        "Every key of the table `[study]` (or of several, `[[study]]`). Keys that several kinds of studies share come "
        "first, then the keys that one kind has alone. [What can be computed](../../howto/studies.md) says what each "
        "kind is for.",
    ),
    "more-tables": (
        "Keys of reductions and measurements",
        "The tables `[reduction]` of large systems, and `[measurement]` of measured special points.",
    ),
}


def page(name: str, keys: list[Key]) -> str:
    """Write a page of keys in Markdown: a table for each table of a file."""
    title, words = INTRODUCTIONS[name]
    lines = [f"# {title}", "", words, ""]
    if name == "study-file":
        return "\n".join([*lines, *_study_lines(keys)]) + "\n"
    if name in ("model-file", "train-file"):
        model, train = (_by_place(all_keys()[each]) for each in ("model-file", "train-file"))
        same = {place for place, key in train.items() if place in model and key.meaning == model[place].meaning}
        if name == "train-file":
            keys = [key for key in keys if (key.table, key.name) not in same and not _as_in_stage(model, key)]
            lines += ["The tables `[[shaft.stage]]` and `[[gear.stage]]` have the keys of `[[contact.stage]]`.", ""]
        else:
            keys = [
                replace(key, unit=train[key.table, key.name].unit) if (key.table, key.name) in same else key
                for key in keys
            ]
    for table in dict.fromkeys(key.table for key in keys):
        heading = f"[{table}]" if table else "Top of the file"
        lines += [f"## {heading}", "", HEAD, HEAD_RULE, *(key.row() for key in keys if key.table == table), ""]
    if name == "model-file":
        lines += ["## Laws of contacts", "", "| `law =` | what it is | numbers of its own |", "|---|---|---|"]
        for law in LAWS.values():
            numbers = ", ".join(f"`{each.name}` ({each.words.removeprefix('it is ')})" for each in law.parameters)
            lines.append(f"| `{law.name}` | {law.words} | {numbers} |")
    return "\n".join(lines) + "\n"


def _by_place(keys: list[Key]) -> dict[tuple[str, str], Key]:
    return {(key.table, key.name): key for key in keys}


def _as_in_stage(model: Mapping[tuple[str, str], Key], key: Key) -> bool:
    """Return True if a key of the stages of a link is that of the stages of a contact."""
    other = model.get(("contact.stage", key.name)) if key.inside == "stage" else None
    return other is not None and key.meaning == other.meaning


def _study_lines(keys: list[Key]) -> Iterator[str]:
    """Yield the page of the keys of studies: those of several kinds once, and of each kind those that it has alone."""
    users: dict[tuple[str, ...], list[str]] = {}
    first: dict[tuple[str, ...], Key] = {}
    for key in keys:
        first.setdefault(key.meaning, key)
        users.setdefault(key.meaning, []).append(key.table.partition(".")[0])
    shared = [first[each] for each, found in users.items() if len(set(found)) > 1]
    yield "A *kind of special point* is one of " + ", ".join(f'`"{each}"`' for each in Kind.known()) + "."
    yield from ("", "## Keys of several kinds", "")
    yield from (HEAD + " kinds |", HEAD_RULE + "---|")
    yield '| `kind` | text | required | Kind of study | `kind = "response"` | all |'
    for key in shared:
        if not key.inside:
            yield key.row(_listed_kinds(users[key.meaning]))
    for inside in dict.fromkeys(key.inside for key in shared if key.inside):
        rows = [key for key in shared if key.inside == inside]
        found = _listed_kinds({kind for key in rows for kind in users[key.meaning]})
        yield from ("", f"## [study.{inside}]", "", f"A table in studies of these kinds: {found}.", "")
        yield from (HEAD, HEAD_RULE, *(key.row() for key in rows))
    for kind in kinds():
        own = [key for key in keys if key.table.partition(".")[0] == kind]
        common = [key.name for key in own if len(set(users[key.meaning])) > 1 and not key.inside]
        names = ", ".join(f"`{name}`" for name in common)
        yield from ("", f'## kind = "{kind}"', "", f"Keys that other kinds have too: {names}.")
        alone = [key for key in own if len(set(users[key.meaning])) == 1 and key.name != "kind"]
        for inside in dict.fromkeys(key.inside for key in alone):
            place = f"In its table `{inside}`:" if inside else "Keys of its own:"
            yield from ("", place, "", HEAD, HEAD_RULE, *(key.row() for key in alone if key.inside == inside))


def _listed_kinds(found: Iterable[str]) -> str:
    others = [kind for kind in kinds() if kind not in found]
    listed = others if len(others) < len(kinds()) // 2 else [kind for kind in kinds() if kind in found]
    words = ", ".join(f"`{kind}`" for kind in listed)
    return words if listed != others else f"all but {words}" if others else "all"


def command_page() -> str:
    """Write the page of the command line: the help text of each command, exit codes, variables of the environment."""
    lines = ["# Command line", "", "The help texts of all commands, as `gapwalk COMMAND --help` prints them.", ""]
    for name in (name for name in commands if not name.startswith("-")):
        screen = Console(width=86, record=True, file=io.StringIO())
        commands.help_print([name], console=screen)
        lines += [f"## gapwalk {name}", "", "```text", screen.export_text().strip(), "```", ""]
    lines += ["## Exit codes", "", "| code | meaning |", "|---|---|"]
    lines += [f"| {code} | {words} |" for code, words in _given()["exit"]["codes"]]
    lines += ["", "## Variables of the environment", "", "| variable | effect |", "|---|---|"]
    lines += [f"| `{name}` | {words} |" for name, words in _given()["environment"]["variables"]]
    return "\n".join(lines) + "\n"


def pictures_page() -> str:
    """Write the page of the options of pictures, by the type of the record."""
    for home in set(pictures._HOMES.values()):
        import_module(f"gapwalk.plot.{home}")
    options = {name: each.options for name, each in described().items() if each.forms}
    for drawings in (pictures._IN_PANELS, pictures._IN_AXES):
        for kind, drawing in drawings.items():
            found = list(inspect.signature(drawing.draw).parameters.values())[2:]
            options[kind.__name__] = options.get(kind.__name__, []) + found
    lines = [
        "# Options of pictures",
        "",
        "This page lists options of `record.plot(...)` and of `gw.plot.draw(record, ...)` by the type of the record, "
        "with their defaults. [Pictures](../../howto/pictures.md) says how to use them.",
        "",
        "| record | options |",
        "|---|---|",
    ]
    for name, given in sorted(options.items()):
        shown = dict.fromkeys(
            f"`{each.name}`" if each.default is each.empty else f"`{each.name}={each.default!r}`"
            for each in given
            if each.kind is not each.VAR_KEYWORD
        )
        lines.append(f"| `{name}` | {', '.join(shown) or 'none'} |")
    return "\n".join(lines) + "\n"


def write(_: Sphinx | None = None) -> None:
    """Write all pages."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    texts = {f"{name}.md": page(name, keys) for name, keys in all_keys().items()}
    texts |= {"command-line.md": command_page(), "records.rst": records_page(), "pictures.md": pictures_page()}
    texts["extending.md"] = extensions_page()
    for name, text in texts.items():
        path = FOLDER / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # Sphinx reads again what is newer
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    write()
    print(*sorted(str(path.relative_to(ROOT)) for path in FOLDER.glob("*.md")), sep="\n")
