"""Workspace: the only folder in which the explorer reads model files and results, and in which it writes."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gapwalk.attractors.settle import AttractorKind, Settled
from gapwalk.errors import ModelError, StoreError
from gapwalk.model.channels.channel_file import endings as record_endings
from gapwalk.model.model_source import parse_source
from gapwalk.model.system import System
from gapwalk.model.words import pace_words, parameter_symbol, value_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.settle_study import SettleFinding, SettleStudyOptions, rest_words
from gapwalk.studies.study_file import Study, check_study

# Titles of results: what each one is, in one line, such as ``speed 3000 to 800 rpm, stage2.clearance = 0.5``.

_NAMED = 3  # changed values that a title names
_SAME = 1e-12  # relative difference up to which a value counts as that of the file
_PLAIN = "response"  # the kind of study whose titles need not name it


def along_words(system: System, parameter: str, begin: float, end: float) -> str:
    """Write the range of a walk: ``speed 3000 to 800 rpm``."""
    units = system.units
    name = parameter_symbol(parameter, units).partition(" [")[0]
    words = f"{name} {begin:.6g} to {end:.6g}"
    return " ".join(filter(None, (words, units and units.parameter(parameter))))


def walks_of(study: Study) -> list[str]:
    """Return the parameters along which a study runs."""
    others = (getattr(study.options, name, None) for name in ("second", "over"))
    walks = [getattr(study.options, "parameter", None), *(getattr(each, "parameter", None) for each in others)]
    return [name for name in walks if name]


def plan_words(study: Study) -> str:
    """Return the plan of a study, with the units of the parameters along which it runs."""
    units = study.system.units
    notes = [] if units is None else [(name, units.parameter(name)) for name in walks_of(study)]
    note = ", ".join(f"{name} in {unit}" for name, unit in notes if unit)
    return study.options.plan + f" ({note})" * bool(note)


def study_title(study: Study, values: Mapping[str, float]) -> str:
    """Return the title of a study of the file, computed with changed values."""
    options, system = study.options, study.system
    parameter = getattr(options, "parameter", "")
    parts = [
        f"{study.name}:" if study.name not in ("", parameter) else "",
        "" if options.kind == _PLAIN else options.kind,
    ]
    if isinstance(options, RangeStudy):
        parts.append(along_words(system, options.parameter, options.begin, options.end))
    if isinstance(options, SettleStudyOptions):
        parts[1:] = [f"settled at {pace_words(system)}"]
        values = {name: value for name, value in values.items() if name != system.structure.pace}
    title = " ".join(filter(None, parts)) or options.kind
    return title + _listed([value_words(value, name, system.units, 6) for name, value in values.items()])


def changed_words(system: System, base: System | None, others: Collection[str]) -> str:
    """Return the values in which a system differs from that of the file, for the end of a title."""
    if base is None or base.structure != system.structure:
        return ""
    one, two = (np.asarray(each.values, dtype=float) for each in (system, base))
    places = np.flatnonzero(np.abs(one - two) > _SAME * np.maximum(np.abs(one), np.abs(two))).tolist()
    names = [system.structure.names[place] for place in places]
    return _listed([value_words(system[name], name, system.units, 6) for name in names if name not in others])


def _listed(words: list[str]) -> str:
    shown = [f", {each}" for each in words[:_NAMED]]
    return "".join(shown) + (f" and {len(words) - _NAMED} more" if len(words) > _NAMED else "")


def verdict(motion: Orbit | Settled, finding: SettleFinding | None = None) -> str:
    """Describe a motion in a few words: ``torus, rotation number 0.313``."""
    attractor = None if finding is None else finding.attractor
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    if orbit is not None:
        return ", ".join([f"period {orbit.period}, {orbit.instability.words}", *rest_words(orbit)])
    if attractor is None:
        return "not periodic" if not isinstance(motion, Settled) or motion.converged else "not settled"
    words = "kind not known" if attractor.kind is AttractorKind.UNDECIDED else attractor.label
    if attractor.rotation is not None:
        words += f", rotation number {attractor.rotation.number:.6g}"
    if attractor.kind is AttractorKind.CHAOTIC and attractor.lyapunov is not None:
        words += f", largest exponent {attractor.lyapunov.per_period[0]:.3g} per forcing period"
    return words


MODEL, RESULT, RECORDS = ".toml", ".gapwalk", record_endings()
_MOST = 500  # files that are listed, and results of one exploration
_RECORD_BYTES = 100_000


class Workspace:
    """A folder, and the exploration of one file in it.

    An exploration is a folder next to that file, such as ``clutch.explorer`` for ``clutch.toml``. It holds a result
    file for each job, with a record of the request in JSON.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()

    def files(self) -> list[str]:
        """Return the sorted names of the model files and results in the folder, and of those to which links in it lead.

        Links that lead out of the folder are left out.
        """
        return self._named(MODEL, RESULT)

    def records(self) -> list[str]:
        """Return the sorted names of the files of measured data in the folder."""
        return self._named(*RECORDS)

    def _named(self, *endings: str) -> list[str]:
        found = set[str]()
        for each in self.root.iterdir():
            if each.suffix in endings and each.is_file():
                with suppress(ModelError):
                    found.add(self.name(self.path(each.name, endings)))
        return sorted(found)[:_MOST]

    def name(self, path: Path) -> str:
        """Return the one name of a file that `path` has returned, whichever was asked for."""
        return path.relative_to(self.root).as_posix()

    def holds(self, path: Path) -> bool:
        """Return True if a file or folder lies in the workspace, and links on the way to it do not lead out of it."""
        try:
            return path.resolve().is_relative_to(self.root)
        except (OSError, RuntimeError):  # links in a circle
            return False

    def path(self, name: str, endings: tuple[str, ...] = (MODEL, RESULT)) -> Path:
        """Return the file of a name in a request."""
        given = f"{name[:100]!r}"
        if not name or "\0" in name or len(name) > 300 or not _can_be_asked(name):
            raise ModelError(f"{given} is not the name of a file; write that of a file in {self.root.name}")
        path = self.root / name
        path = path.resolve() if self.holds(path) else Path("/")
        inside = path.is_relative_to(self.root)
        if not inside or any(part.startswith(".") for part in path.relative_to(self.root).parts):
            raise ModelError(f"{given} lies outside of the workspace; only files in {self.root.name} can be opened")
        if path.suffix not in endings:
            wanted = (
                "a file of measured data, such as CSV"
                if endings == RECORDS
                else f"a model ({MODEL}) or a result ({RESULT})"
            )
            raise ModelError(f"{given} is not {wanted}")
        if path.exists() and not _is_spelt(path):
            raise ModelError(f"{given} is spelt in another way in {self.root.name}; write it as it is there")
        return path

    def exploration(self, file: Path) -> Path:
        """Return the folder of the exploration of a file; it may not exist yet."""
        return file.with_name(f"{file.name.removesuffix(RESULT).removesuffix(MODEL)}.explorer")

    def claim(self, file: Path, word: str) -> Path:
        """Reserve a new name for the result of a job, which no other job gets, in this process or another."""
        folder = self.exploration(file)
        try:
            folder.mkdir(exist_ok=True)
            if not self.holds(folder):
                raise StoreError(f"{folder.name} leads out of the workspace; remove the link")
            taken = [int(head) for each in folder.iterdir() if (head := each.name.partition("-")[0]).isdigit()]
            for number in range(max(taken, default=0) + 1, _MOST + 1):
                try:
                    # the number alone is reserved, whatever the word
                    os.close(os.open(folder / f"{number:02d}-claim", os.O_CREAT | os.O_EXCL | os.O_WRONLY))
                except FileExistsError:
                    continue
                return folder / f"{number:02d}-{word}{RESULT}"
        except OSError as error:
            raise StoreError(f"nothing can be written into {folder}: {error.strerror}") from None
        raise StoreError(f"{folder.name} holds {_MOST} results; move some of them elsewhere")


def _is_spelt(path: Path) -> bool:
    """Return True if a file is listed under its name: some file systems find it by others too, as in capitals."""
    try:
        return path.name in os.listdir(path.parent)
    except OSError:  # a folder that cannot be listed
        return True


def _can_be_asked(name: str) -> bool:
    """Return True if a page can send the name, which must be UTF-8."""
    return not any("\ud800" <= char <= "\udfff" for char in name)


def write_record(output: Path, record: dict[str, Any]) -> None:
    """Write the record of a request next to its result, whole or not at all."""
    new = output.with_suffix(".json-new")
    try:
        new.write_text(json.dumps(record, indent=1), encoding="utf-8")
        os.replace(new, output.with_suffix(".json"))
    except OSError as error:
        raise StoreError(f"{output.with_suffix('.json')} cannot be written: {error.strerror}") from None


def read_records(folder: Path, workspace: Workspace) -> dict[Path, dict[str, Any]]:
    """Return the records of an exploration by result file, in order; unreadable ones, and links out, are left out."""
    records = {}
    for path in sorted(folder.glob("*.json")) if folder.is_dir() else []:
        try:
            if not workspace.holds(path) or not workspace.holds(path.with_suffix(RESULT)):
                continue
            if not path.is_file() or path.stat().st_size > _RECORD_BYTES:
                continue
            record = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            continue
        if isinstance(record, dict):
            records[path.with_suffix(RESULT)] = record
    return records


def read_record(output: Path) -> dict[str, Any]:
    """Return the record of a request next to its result; raise a StoreError if it cannot be read."""
    path = output.with_suffix(".json")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise StoreError(f"{path} cannot be read: {error}") from None
    if not isinstance(record, dict):
        raise StoreError(f"{path} is not a record of a request")
    return record


def forget(output: Path) -> None:
    """Remove a result file and its record; the record goes first, so that no result is shown that is half gone."""
    for path in (output.with_suffix(".json"), output, *output.parent.glob(f"{output.name}-*")):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise StoreError(f"{path} cannot be removed: {error.strerror}") from None


_HEADER = re.compile(r"\s*\[\[?\s*([\w-]+|\"[^\"]*\")")


def model_file(text: str, name: str, within: str, orbit: Orbit, parameter: str, to: float, measure: str) -> str:
    """Return the text of a model file with a response study that starts at the orbit."""
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
    """Return the values of the orbit's system that differ from those of the model file, without its studies."""
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
    """Return the text with a frequency, if it needs one and has none."""
    if parameter == "frequency" or "frequency" in parse_source(text).data:
        return text
    return f"frequency = {orbit.system.frequency!r}\n{text}"


def _without_studies(text: str) -> str:
    """Return the text without its tables of studies."""
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


def mark_of(study: Study) -> str:
    """Return the mark of the model file of a study: the first letters of its SHA-256, matrices included."""
    # Values that were changed after reading it, and other studies of the same text, have the same mark.
    return hashlib.sha256((study.text + study.matrices).encode("utf-8", "replace")).hexdigest()[:8]


# The list of results on the page: their names, colours, how they are drawn, and which are deleted.

COLOURS = ("blue", "orange", "green", "purple", "red", "grey")
"""Colours of a result, as the page calls them; without one, a line has the colour of its stability."""


class Look(BaseModel):
    """Choices of a user for a result."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(max_length=120)] = ""
    drawn: Literal["full", "pale", "hidden"] = "full"
    colour: Literal["", "blue", "orange", "green", "purple", "red", "grey"] = ""
    deleted: bool = False


def read_look(plain: object) -> Look:
    """Read what was chosen for a result from its record; what cannot be read is as if nothing was chosen."""
    try:
        return Look.model_validate(plain or {})
    except ValidationError:
        return Look()
