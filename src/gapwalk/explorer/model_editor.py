"""The model editor: checks of a text while it is typed, its numbers for sliders, and the files that it begins with.

The text belongs to the user. It is never written again from its content: a slider replaces the digits of one number,
so comments, order and spelling stay as they are.
"""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import AsyncIterator, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from gapwalk.errors import ModelError, StoreError
from gapwalk.explorer.diagram_lines import quantity_words
from gapwalk.explorer.live_process import KINDS
from gapwalk.explorer.motion_panels import scenes_of
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.workspace_folder import MODEL, Workspace, plan_words
from gapwalk.model.doubts import doubts_of
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import MAX_BYTES, Source, parse_source, read_source, value_spans
from gapwalk.model.problems import ModelFileError, Problem
from gapwalk.model.problems import Path as Place
from gapwalk.model.system import System
from gapwalk.studies.live_response import LiveResponse
from gapwalk.studies.locus_study import LocusStudyOptions
from gapwalk.studies.machine_templates import machine_text, machines, template
from gapwalk.studies.study_file import check_studies

MOST_LETTERS = 50_000
"""Length of the longest text that is edited on the page; requests are small."""

_MATRICES = ("mass", "damping", "stiffness")
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_TEMPLATE = "template"
_UNIT = re.compile(r" \[[^\]]*\]$")
_STAGE = re.compile(r"(.+)\.stage(\d+)\.\w+")


def checked_text(text: str, name: str, root: str) -> dict[str, Any]:
    """Check the text of a model file, and describe it for the page."""
    found: dict[str, Any] = {"problems": [], "numbers": None, "lines": None, "machine": None, "system": False}
    found |= {"title": "", "contents": [], "plans": [], "warnings": [], "locus": False}
    try:
        source = parse_source(_checked_size(text), name, root)
    except ModelFileError as error:
        return {**found, "problems": _told(error.problems)}
    model, _ = check_model(source)
    system = None if model is None else model.system
    found |= {"numbers": list(numbers_of(source, system)), "lines": _lines(source), "system": system is not None}
    if model is not None:
        found |= {"title": model.title, "machine": scenes_of(model.system), "contents": list(model.system.contents)}
        found["warnings"] = doubts_of(model.system)
    try:
        studies = check_studies(source)
    except ModelFileError as error:
        return {**found, "problems": _told(error.problems)}
    found["plans"] = [": ".join(filter(None, (each.name, plan_words(each)))) for each in studies]
    found["locus"] = any(isinstance(each.options, LocusStudyOptions) for each in studies)
    doubts = (doubt for each in studies for doubt in each.doubts)
    found["warnings"] = list(dict.fromkeys((*found["warnings"], *doubts)))
    return found


def numbers_of(source: Source, system: System | None) -> Iterator[dict[str, Any]]:
    """Yield the numbers of a text that are parameters of its system."""
    names = None if system is None else system.parameters
    for path, (begin, end) in value_spans(source.text).items():
        raw = source.text[begin:end]
        quote = raw[:1] if raw[:1] in "\"'" else ""
        match = _NUMBER.match(raw, len(quote))
        if match is None or raw[:3] in ('"""', "'''"):
            continue
        rest = raw[match.end() :].removesuffix(quote)
        if rest if not quote else not re.fullmatch(r" ?[^\d\s][^\"]*|", rest):
            continue  # such as 1_000, or a text that only begins with a number
        name = _parameter_name(path, source.data, names)
        if not name:
            continue
        words = name if system is None else quantity_words([name], system)[0]["words"]
        if unit := rest.strip():  # as it is written, which may be another one than that of results
            words = _in_unit(words, unit)
        yield {
            "name": name,
            "words": words,
            "value": float(match.group()),
            "unit": unit,
            "line": source.line(path),
            "begin": begin + match.start(),
            "end": begin + match.end(),
        }


def _in_unit(words: str, unit: str) -> str:
    """Return the title of a quantity with another unit."""
    return f"{_UNIT.sub('', words)} [{unit}]"


def about(session: Session, name: str) -> dict[str, Any]:
    """Return what `Session.about` does, and of parameters with another unit in the file their title and its size."""
    found, exploration = session.about(name), session.reopen(name)
    system = exploration.studies[0].system
    if system.units is None or exploration.file.suffix != MODEL or found["problem"]:
        return found
    numbers = numbers_of(read_source(exploration.file, str(session.workspace.root)), system)
    written = {each["name"]: each["unit"] for each in numbers}
    for each in found["parameters"]:
        parameter, unit = each["name"], written.get(each["name"])
        if unit and unit != system.units.parameter(parameter):
            size = system.units.read(parameter, f"1 {unit}")
            each |= {"written": _in_unit(each["words"], unit), "size": size}
    return found


def _parameter_name(path: Place, data: Mapping[str, Any], names: Mapping[str, float] | None) -> str:
    """Return the name of the parameter to which a place of a text gives its value; empty if there is none."""
    top, rest = str(path[0]), path[1:]
    name = ""
    if not rest:
        name = top
    elif top == "mean":
        name = f"mean.{rest[0]}"
    elif top in _MATRICES and all(isinstance(each, int) for each in rest):
        coordinates = data.get("coordinates")
        if isinstance(coordinates, list) and max(map(int, rest)) < len(coordinates):
            row, column = int(rest[0]), int(rest[-1])
            name = f"{top}.{coordinates[row]}.{coordinates[column]}"
    elif len(rest) >= 2 and isinstance(rest[0], int) and isinstance(table := data[top][rest[0]], Mapping):
        own = str(table.get("name", f"{top}{rest[0] + 1}"))
        keys = [str(each) for each in rest[1:]]
        if keys[0] == "stage" and len(keys) == 3:
            keys = _stage_keys(own, int(keys[1]), keys[2], names)
        name = ".".join([own, *keys])
    return name if names is None or name in names else ""


def _stage_keys(own: str, number: int, key: str, names: Mapping[str, float] | None) -> list[str]:
    """Return the keys of a number of a stage: a single stage has no number, and a shaft counts its own spring too."""
    counted = {int(match[2]) for name in names or () if (match := _STAGE.fullmatch(name)) and match[1] == own}
    if names is None or not counted:
        return [key] if names is not None else [f"stage{number + 1}", key]
    numbers = sorted(counted)
    return [f"stage{numbers[number]}", key] if number < len(numbers) else ["", key]


def _lines(source: Source) -> dict[str, int]:
    """Return the lines of all named tables, and of the keys at the top."""
    found = {str(key): line for key in source.data if (line := source.line((key,)))}
    for top, tables in source.data.items():
        for number, table in enumerate(tables if isinstance(tables, list) else ()):
            line = source.line((top, number))
            if isinstance(table, Mapping) and isinstance(name := table.get("name"), str) and line:
                found[name] = line
    return found


def _told(problems: tuple[Problem, ...]) -> list[dict[str, Any]]:
    return [
        {"line": each.line, "text": " ".join(filter(None, (each.place or each.path, each.message)))}
        for each in problems
    ]


def _checked_size(text: str) -> str:
    if len(text) > MOST_LETTERS:
        message = f"the text has {len(text):,} letters; texts of more than {MOST_LETTERS:,} need a text editor"
        raise ModelFileError([Problem(message)])
    return text


def starts() -> list[dict[str, Any]]:
    """Return what a new model can begin with: its key, its title, a sentence, and its drawing."""
    words = {"title": "Template", "text": "the two-stage clutch, with a comment on every key"}
    return [{"name": name, **_about(name), **(words if name == _TEMPLATE else {})} for name in (_TEMPLATE, *machines())]


def start_text(name: str) -> str:
    """Return the text of a model to begin with."""
    return template() if name == _TEMPLATE else machine_text(name[:40])


@cache
def _about(name: str) -> dict[str, Any]:
    source = parse_source(start_text(name))
    model, _ = check_model(source)
    assert model is not None
    data, system = source.data, model.system
    count, what = (len(data["inertia"]), "inertias") if "inertia" in data else (len(data["coordinates"]), "coordinates")
    units = "in N m, rad and rpm" if "speed" in data else "non-dimensional"
    text = f"{count} {what if count > 1 else what[:-1]}, {units}"
    return {"title": str(data["title"]), "text": text, "machine": scenes_of(system)}


def text_of(workspace: Workspace, name: str) -> dict[str, str]:
    """Return the text of a model file in the workspace, and its stamp, with which it is saved again."""
    path = _model_path(workspace, name)
    try:
        content = path.read_bytes() if path.stat().st_size <= MAX_BYTES else b"\xff"
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as error:
        raise ModelError(f"{name} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ModelError(f"{name} is not a text in UTF-8; save it as UTF-8 with a text editor first") from None
    return {"text": _checked_size(text), "stamp": _stamp(path)}


def save_text(workspace: Workspace, name: str, text: str, stamp: str) -> dict[str, str]:
    """Write a model file of the workspace, whole or not at all."""
    # Line ends and the mark at the beginning of an existing file stay as they are there.
    path, content = _model_path(workspace, name), _checked_size(text)
    before = _stamp(path)
    if before and not stamp:
        return {"conflict": f"there is a file {name} already; choose another name, or replace it"}
    if before and stamp not in (before, "*"):
        return {"conflict": f"{name} was changed meanwhile by another program; choose another name, or replace it"}
    old = path.read_bytes()[:MAX_BYTES] if before else b""
    if b"\r\n" in old:
        content = content.replace("\n", "\r\n")
    mark = b"\xef\xbb\xbf" if old.startswith(b"\xef\xbb\xbf") else b""
    new = path.with_name(f".{path.name}-new")
    try:
        new.write_bytes(mark + content.encode("utf-8"))
        os.replace(new, path)
    except UnicodeEncodeError:
        raise ModelError("the text contains half of a character, which cannot be saved in a file; delete it") from None
    except OSError as error:
        raise StoreError(f"{name} cannot be written: {error.strerror}") from None
    return {"stamp": _stamp(path)}


def _model_path(workspace: Workspace, name: str) -> Path:
    path = workspace.path(name)
    if path.suffix != MODEL or workspace.name(path) != name or not (path.parent == workspace.root or path.exists()):
        raise ModelError(f"{name[:100]!r} is not the name of a model file; write one such as clutch{MODEL}")
    return path


def _stamp(path: Path) -> str:
    """Return time and size of a file; empty if there is none."""
    try:
        found = path.stat()
    except OSError:
        return ""
    return f"{found.st_mtime_ns}-{found.st_size}"


# Requests of the model editor on the page, by their word; `gapwalk.explorer.web_app` answers them.

WORDS = ("starts", "start", "open", "save")


async def edit(session: Session, word: str, body: dict[str, Any]) -> dict[str, Any]:
    """Answer a request: what to begin with, the text of a beginning or of a file, or a text to save."""
    workspace, name = session.workspace, str(body.get("file", ""))
    if word == "starts":
        session.live.warm_behind()
        return {"starts": await asyncio.to_thread(starts)}
    if word == "start":
        return {"text": start_text(str(body.get("start", "")))}
    if word == "open":
        session.live.warm_behind()
        return await asyncio.to_thread(text_of, workspace, name)
    if word == "save":
        text, stamp = str(body.get("text", "")), str(body.get("stamp", ""))
        found = await asyncio.to_thread(save_text, workspace, name, text, stamp)
        session.events.changed()
        return found
    raise ModelError(f"{word[:40]!r} is not an action on a text; the actions are {', '.join(WORDS)} and check")


async def checks(session: Session, body: dict[str, Any]) -> AsyncIterator[dict[str, Any]]:
    """Yield what `checked_text` finds, and then, of a text without problems, its live answers as they grow."""
    root = str(session.workspace.root)
    name = str(session.workspace.root / (str(body.get("file", "")) or "model.toml"))
    text = str(body.get("text", ""))
    found = await asyncio.to_thread(checked_text, text, name, root)
    yield found
    if not found["problems"]:
        kinds = tuple(each for each in KINDS if each in body.get("live", (LiveResponse.key,)))
        at = body.get("at")
        async for news in session.live.of(text, name, root, kinds, at if isinstance(at, int | float) else None):
            yield news
