"""The whole model file: a system and what is to be studied of it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

from gapwalk.model.fields import Names
from gapwalk.model.file import check_system, in_order
from gapwalk.model.problem import ModelFileError, Problem, did_you_mean, given
from gapwalk.model.schema import validate
from gapwalk.model.source import Source, read_source
from gapwalk.model.system import System
from gapwalk.study.changes import change_source, change_system
from gapwalk.study.options import StudyOptions
from gapwalk.study.tables import KINDS, StudyPart, Surroundings


@dataclass(frozen=True)
class Study:
    """A system, and what is to be studied of it.

    Parameters
    ----------
    system
        The system; a parameter that the study walks has its first value.
    options
        What is to be done; its type tells the kind of study.
    title
        A line for people; may be empty.
    text
        The text of the model file.
    changes
        What was changed after reading it, by name.
    """

    system: System
    options: StudyOptions
    title: str = ""
    text: str = ""
    changes: tuple[tuple[str, object], ...] = ()


def read_study(path: str | os.PathLike[str], changes: Mapping[str, object] | None = None) -> Study:
    """Read a model file with its study.

    Parameters
    ----------
    path
        A TOML file. ``gapwalk new FILE`` writes one to begin with.
    changes
        Other values than those of the file, by parameter, or by ``study.`` and a key of the study, for example
        ``{"stage2.clearance": 0.5, "study.to": 0.3}``.

    Raises
    ------
    ModelFileError
        With everything that is wrong, each problem with its line.
    """
    return check_study(read_source(path), changes)


def check_study(source: Source, changes: Mapping[str, object] | None = None) -> Study:
    """The study that a source describes; see `read_study`."""
    asked = dict(changes or {})
    source, rest, problems = change_source(source, asked)
    part, found = check_system(source)
    problems += found
    system = part.system() if part else _sketch(source)
    if system:
        system, found = change_system(system, rest, source.name)
        problems += found
    study, found = _check_study_table(source, system)
    problems += found + list(_frequency_problems(source))
    if part is None or system is None or study is None or problems:
        raise ModelFileError(in_order(problems))
    return Study(study.system(system), study.options(system), part.title, source.text, tuple(asked.items()))


def _check_study_table(source: Source, system: System | None) -> tuple[StudyPart | None, list[Problem]]:
    table = source.data.get("study")
    if table is None:
        example = 'add [study] with kind = "response", parameter, from and to'
        return None, [source.problem(f"is missing; {example}", ("study",))]
    if not isinstance(table, Mapping):
        return None, []  # the schema of the file has said so
    kind = table.get("kind")
    schema = KINDS.get(kind) if isinstance(kind, str) else None
    if schema is None:
        return None, [source.problem(_kind_problem(table), ("study", "kind"))]
    surroundings = Surroundings(system, frequency_given="frequency" in source.data)
    return validate(schema, table, source, ("study",), lambda: surroundings)


def _kind_problem(table: Mapping[str, object]) -> str:
    known = ", ".join(given(kind) for kind in KINDS)
    if "kind" not in table:
        return f"is missing; it must be one of {known}"
    kind = table["kind"]
    hint = did_you_mean(kind, list(KINDS)) if isinstance(kind, str) else ""
    return f"is {given(kind)}; it must be one of {known}" + (f"; {hint}" if hint.endswith("?") else "")


def _frequency_problems(source: Source):
    """A frequency may be left out only where the study gives one."""
    study = source.data.get("study")
    walked = study.get("parameter") if isinstance(study, Mapping) else None
    if "frequency" not in source.data and isinstance(walked, str) and walked != "frequency":
        message = f"is missing; the study walks {walked}, so write at which frequency"
        yield source.problem(message, ("frequency",))


def _sketch(source: Source) -> System | None:
    """A system with the parameters of the file, where only their values are wrong: the study can be checked."""
    names = {key: source.data[key] for key in ("coordinates", "contact", "harmonic") if key in source.data}
    coordinates = Names.of(source.data).coordinates or []
    names["stiffness"] = [0.0] * len(coordinates)
    bare = Source(source.name, source.text, names)
    part, _ = check_system(bare)
    return part.system() if part else None
