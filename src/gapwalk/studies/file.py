"""The whole model file: a system and what is to be studied of it."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.model_file import ModelPart, check_system, gives_pace, in_order, matrices_digest
from gapwalk.model.model_source import Source, read_source
from gapwalk.model.problems import ModelFileError, Path, Problem, did_you_mean, given
from gapwalk.model.schema import validate
from gapwalk.model.system import System
from gapwalk.model.units import PACES
from gapwalk.studies.changes import (
    Change,
    change_source,
    change_system,
    study_changes,
    study_tables,
    unknown_names,
    walked_parameters,
)
from gapwalk.studies.kinds import KINDS, all_keys, part_of
from gapwalk.studies.measure.table import check_measurement
from gapwalk.studies.options import BranchOptions, StudyOptions
from gapwalk.studies.reduced.origin import ReducedFrom, reduce_for
from gapwalk.studies.reduced.table import ReductionPart, reduction_part
from gapwalk.studies.request import Request
from gapwalk.studies.sketch import Sketch, sketch_of
from gapwalk.studies.tables import StudyPart, Surroundings


@dataclass(frozen=True)
class Study(Request):
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
    name
        What tells it from the other studies of its file; may be empty.
    reduced
        What the system was reduced from, if the file says so.
    unused
        Names of tables in the file that change nothing, such as ``study.shooting`` where harmonics are balanced.
    matrices
        Digest of the matrices that stand in files beside the model file; empty if none do.
    """

    asks: ClassVar[str] = "study"

    system: System
    options: StudyOptions
    title: str = ""
    text: str = ""
    changes: tuple[tuple[str, object], ...] = ()
    name: str = ""
    reduced: ReducedFrom | None = None
    unused: tuple[str, ...] = field(default=(), compare=False, metadata={"stored": False})
    matrices: str = field(default="", compare=False)

    @property
    def walked(self) -> BranchOptions:
        """The options of a study of branches."""
        assert isinstance(self.options, BranchOptions)
        return self.options


def read_study(
    path: str | os.PathLike[str] | io.StringIO, changes: Mapping[str, object] | None = None, name: str = ""
) -> Study:
    """Read a model file with its study.

    Parameters
    ----------
    path
        A TOML file. ``gapwalk new FILE`` writes one to begin with. Or its text, as ``io.StringIO(text)``.
    changes
        Other values than those of the file, by parameter, or by ``study.`` and a key of the study, for example
        ``{"stage2.clearance": 0.5, "study.to": 0.3}``.
    name
        Which of its studies, if it has several.

    Raises
    ------
    ModelFileError
        With everything that is wrong, each problem with its line.
    ModelError
        If there is no study of that name, or the file has several and no name is given.
    """
    return _one_of(read_studies(path, changes), name, "the text" if isinstance(path, io.StringIO) else os.fspath(path))


def read_studies(
    path: str | os.PathLike[str] | io.StringIO, changes: Mapping[str, object] | None = None
) -> tuple[Study, ...]:
    """Read a model file with all of its studies, in their order; parameters and errors as `read_study`."""
    return check_studies(read_source(path), changes)


def check_study(source: Source, changes: Mapping[str, object] | None = None, name: str = "") -> Study:
    """The study that a source describes; see `read_study`."""
    return _one_of(check_studies(source, changes), name, source.name)


def check_studies(source: Source, changes: Mapping[str, object] | None = None) -> tuple[Study, ...]:
    """The studies that a source describes; see `read_studies`."""
    asked = dict(changes or {})
    source, rest, problems = change_source(source, asked)
    part, found = check_system(source)
    problems += found
    reduction, found = reduction_part(source)
    problems += found
    sketch = Sketch(part.system()) if part else sketch_of(source)
    system = sketch.system if sketch else None
    if reduction and system and system.units:
        message = "reduces equations without units; write the numbers of this file without units"
        problems.append(source.problem(message, ("reduction",)))
    problems += check_measurement(source, system)[1]
    tables = study_tables(source)
    if source.data.get("study") is None:
        example = 'add [study] with kind = "response", parameter, from and to'
        problems.append(source.problem(f"is missing; {example}", ("study",)))
        problems += _changed(sketch, source, {}, rest)[1]
    studies = []
    for at in tables:
        study, found = _check_table(source, at, None if problems else part, sketch, rest, asked, reduction)
        studies.append(study)
        problems += found
    if part is None or problems:
        raise ModelFileError(in_order(list(dict.fromkeys(problems))))
    return tuple(replace(study, matrices=matrices_digest(source, part)) for study in studies if study)


def _check_table(
    source: Source,
    at: Path,
    part: ModelPart | None,
    sketch: Sketch | None,
    changes: Mapping[str, object],
    asked: Mapping[str, object],
    reduction: ReductionPart | None,
) -> tuple[Study | None, list[Problem]]:
    """The study of one table; None if something is wrong with it."""
    own, problems = study_changes(source, at, sketch.system if sketch else None)
    # what is given from outside of the file has the last word
    sketch, found = _changed(sketch, source, {key: own[key] for key in own if key not in asked}, changes)
    problems += found
    system, reduced = sketch.system if sketch else None, None
    if reduction and part and system and not problems:
        reduced, problems = reduce_for(source, at, reduction, system)
        system = reduced.reduction.system if reduced and reduced.reduction else system
        sketch = Sketch(system)
    has_frequency = gives_pace(source) or any(name in own for name in PACES)
    table, found = _validated(source, at, sketch, has_frequency)
    problems += found
    if not has_frequency:
        problems += _frequency_problems(source, at, system)
    if part is None or system is None or table is None or problems:
        return None, problems
    title = table.title or (f"{part.title}: {table.name}" if part.title and table.name else part.title)
    options, changed = table.options(system), tuple(asked.items())
    study = Study(table.system(system), options, title, source.text, changed, table.name or "", reduced, table.unused)
    return study, []


def _changed(
    sketch: Sketch | None, source: Source, own: Mapping[str, Change], changes: Mapping[str, object]
) -> tuple[Sketch | None, list[Problem]]:
    """With other values, as far as they are allowed; where the numbers mean nothing, only names are looked at."""
    if sketch is None:
        return None, []
    if sketch.guessed:
        return sketch, unknown_names(sketch.system, source, changes)
    system, problems = change_system(sketch.system, source, own, changes)
    return Sketch(system), problems


def _validated(
    source: Source, at: Path, sketch: Sketch | None, has_frequency: bool
) -> tuple[StudyPart | None, list[Problem]]:
    tables = study_tables(source)
    kind = tables[at].get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        return None, [source.problem(_kind_problem(tables[at]), (*at, "kind"))]
    places = list(tables)
    earlier = tuple(str(tables[place].get("name", "")) for place in places[: places.index(at)])
    system, guessed = (sketch.system, sketch.guessed) if sketch else (None, False)
    surroundings = Surroundings(system, has_frequency, len(tables) == 1, earlier, all_keys, guessed)
    return validate(part_of(kind), tables[at], source, at, lambda: surroundings)


def _kind_problem(table: Mapping[str, object]) -> str:
    known = ", ".join(given(kind) for kind in KINDS)
    if "kind" not in table:
        return f"is missing; it must be one of {known}"
    kind = table["kind"]
    hint = did_you_mean(kind, KINDS) if isinstance(kind, str) else ""
    return f"is {given(kind)}; it must be one of {known}" + (f"; {hint}" if hint.endswith("?") else "")


def _frequency_problems(source: Source, at: Path, system: System | None) -> Iterator[Problem]:
    """A frequency may be left out only where the study gives one; a misspelt parameter may be meant for it."""
    table = study_tables(source)[at]
    walked = walked_parameters(table)
    kind = table.get("kind")
    if isinstance(kind, str) and kind in KINDS and "parameter" not in part_of(kind).model_fields:
        yield source.problem("is missing; the study walks nothing, so write at which frequency", ("frequency",))
    known = [name for name in walked if system is None or name in system.structure.names]
    if known == walked and walked and not any(name in walked for name in PACES):
        message = f"is missing; the study walks {' and '.join(walked)}, so write at which frequency"
        yield source.problem(message, ("frequency",))


def _one_of(studies: tuple[Study, ...], name: str, file: str) -> Study:
    """The study of a name, or the only one."""
    named = [study for study in studies if study.name == name] if name else list(studies)
    if len(named) == 1:
        return named[0]
    known = [study.name for study in studies if study.name]
    if name and not known:
        raise ModelError(f"{file} has one study, and no name for it; leave the name {name!r} out")
    if name:
        raise ModelError(f"{file} has no study {name!r}; {did_you_mean(name, known)}")
    raise ModelError(f"{file} has {len(studies)} studies, so name the one that is meant: {', '.join(known)}")
