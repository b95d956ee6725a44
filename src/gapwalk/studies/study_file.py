"""The whole model file: a system, and the studies of it; and the model file that `gapwalk new FILE` writes.

If the system of a file is invalid, one with the same names replaces it where possible, so that studies are checked too.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Annotated, Any

from pydantic import Field, model_validator

from gapwalk.answers.tolerance import spread_doubts
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.model.doubts import doubts_of
from gapwalk.model.drivetrain.nondimensional import NonDimensional, nondimensional
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.drivetrain.train_file import describes_train
from gapwalk.model.drivetrain.train_sheet import train_of_sheet
from gapwalk.model.measured.measured_table import read_named
from gapwalk.model.model_file import Model, check_model, checked_model, has_pace, in_order, refusal, validate
from gapwalk.model.model_source import Source, parse_source, read_source
from gapwalk.model.problems import ModelFileError, Path, Problem, did_you_mean, given
from gapwalk.model.schema import Part, Positive, Text
from gapwalk.model.system import System
from gapwalk.model.units import PACES, Unit, has_unit, read_quantity
from gapwalk.studies.options import BranchOptions, ParameterRange, measure_doubts
from gapwalk.studies.set_values import change_source, change_system, study_changes, study_tables, walked_parameters
from gapwalk.studies.study_kind import StudyKind, kind_of, kinds
from gapwalk.studies.study_schema import DerivedPart, StudyPart, Surroundings, all_keys, study_schema

# The table ``[reduction]`` of a model file, and the record of how the system of a study was reduced.


@dataclass(frozen=True)
class ReducedFrom:
    """Origin of a reduced system."""

    degrees: int  #: Degrees of freedom of the full system.
    kept: tuple[str, ...]  #: The coordinates that are kept.
    modes: int  #: The number of modes.
    #: up_to, error: As in the record of the reduction.
    up_to: float
    error: float
    #: The reduction itself, if the study was read from a model file; it is not stored in a result.
    reduction: Any = field(default=None, compare=False, repr=False, metadata={"stored": False})

    @property
    def words(self) -> str:
        """The reduction in words."""
        return (
            f"reduced from {self.degrees} degrees of freedom to {len(self.kept) + self.modes}: {len(self.kept)} kept, "
            f"{self.modes} modes; contacts deflect within {self.error:.1e} up to frequency {self.up_to:g}"
        )


def reduce_for(source: Source, at: Path, part: ReductionPart, full: System) -> tuple[ReducedFrom | None, list[Problem]]:
    """Reduce the system of a study; every coordinate that the study names is kept."""
    from gapwalk.reduction import reduce  # only now: few studies need it

    table = study_tables(source)[at]
    keep = [*part.keep, *(name for name in full.coordinates if name in set(_words(table)) - set(part.keep))]
    up_to = part.up_to or _highest(table) or full.frequency
    try:
        found = reduce(full, modes=part.modes, error=part.error, up_to=up_to, keep=keep)
    except GapwalkError as error:
        return None, [source.problem(f"cannot be done: {refusal_of(error)}", ("reduction",))]
    problems = [
        source.problem(
            f"walks {name}, whose value in the reduced system contains what the other coordinates give; leave "
            "[reduction] out, or walk a parameter of a contact or of the excitation",
            at,
        )
        for name in walked_parameters(table)
        if name in found.system.structure.names
        and name in full.structure.names
        and abs(found.system[name] - full[name]) > 1e-9 * (abs(full[name]) + 1e-300)
    ]
    origin = ReducedFrom(full.size, found.kept, found.modes, found.up_to, found.error, found)
    return origin, problems


def refusal_of(error: GapwalkError) -> str:
    """Return the message of an error in one line."""
    return refusal(error) if isinstance(error, ModelError) else str(error)


def _words(value: object) -> Iterator[str]:
    """Yield all names in the texts of a table, keys included: ``half.q7``, ``q7'`` and ``mean.q7`` name q7."""
    if isinstance(value, str):
        yield from re.findall(r"\w+", value)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _words(str(key))
            yield from _words(item)
    elif isinstance(value, list):
        for item in value:
            yield from _words(item)


def _highest(table: Mapping[str, Any]) -> float | None:
    """Return the highest frequency to which a study walks, if the table gives it."""
    second = table.get("second")
    ranges = [table, second if isinstance(second, Mapping) else {}]
    values = [each.get(key) for each in ranges if each.get("parameter") == "frequency" for key in ("from", "to")]
    numbers = [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    return max((value for value in numbers if 0.0 < value < float("inf")), default=None)


class ReductionPart(Part):
    """Options of the reduction; the defaults are those of `gapwalk.reduce`."""

    modes: Annotated[int, Field(strict=True, ge=0)] | None = None
    error: Annotated[Positive, Field(ge=1e-8, le=1.0)] | None = None
    up_to: Positive | None = None
    keep: list[Text] = Field(default=[])

    @model_validator(mode="after")
    def _says_one_thing(self) -> ReductionPart:
        if self.modes is not None and self.error is not None:
            raise ValueError("has modes and error; leave one of the two out: the error decides the number of modes")
        return self


def reduction_part(source: Source) -> tuple[ReductionPart | None, list[Problem]]:
    """Return the table of a file, if it has one, and its problems."""
    table = source.data.get("reduction")
    if table is None:
        return None, []
    if not isinstance(table, Mapping):
        message = f"is {given(table)}; it must be a table [reduction], such as {{ error = 0.01 }}"
        return None, [source.problem(message, ("reduction",))]
    return validate(ReductionPart, table, source, ("reduction",))


@dataclass(frozen=True)
class Study:
    """A system, and the options of a study of it.

    Examples
    --------
    >>> study.title, study.options.parameter, study.system.coordinates
    ('A sprung mass with a stop', 'frequency', ('x',))
    """

    system: System  #: The system; a parameter that the study walks has its first value.
    options: StudyKind  #: Options of the study; their type is the kind of study.
    title: str = ""  #: A line for people; may be empty.
    text: str = ""  #: The text of the model file.
    changes: tuple[tuple[str, object], ...] = ()  #: Values that were changed after reading it, by name.
    name: str = ""  #: Name among the studies of its file; may be empty.
    reduced: ReducedFrom | None = None  #: Record of the reduction of the system, if the file requests one.
    #: Names of tables in the file that have no effect, such as ``study.shooting`` where harmonics are balanced.
    unused: tuple[str, ...] = field(default=(), compare=False, metadata={"stored": False})
    #: Digest of the matrices and tables in files of their own; empty if there are none.
    matrices: str = field(default="", compare=False)

    @property
    def walked(self) -> BranchOptions:
        """The options of a study of branches."""
        assert isinstance(self.options, BranchOptions)
        return self.options

    @property
    def doubts(self) -> list[str]:
        """Doubts about the damping of the system and about the measure that is shown, in sentences."""
        spread = spread_doubts(self.system, getattr(self.options, "spreads", None))
        return [*doubts_of(self.system), *measure_doubts(self.system, self.options), *spread]

    @property
    def unused_words(self) -> list[str]:
        """Unused tables of the file with the reason, in words; only studies of branches have such tables."""
        return [f"not used: [{table}], because method is {self.walked.method.name}" for table in self.unused]


def read_study(
    path: str | os.PathLike[str] | io.StringIO, changes: Mapping[str, object] | None = None, name: str = ""
) -> Study:
    """Read a model file with its study.

    Parameters
    ----------
    path
        A TOML file. ``gapwalk new FILE`` writes one to begin with. Or its text, as ``io.StringIO(text)``.
    changes
        Values that replace those of the file, by parameter, or by ``study.`` and a key of the study, for example
        ``{"stage2.clearance": 0.5, "study.to": 0.3}``.
    name
        Name of the study, if the file has several.

    Returns
    -------
    Study
        The system, and the options of the study.

    Raises
    ------
    ModelFileError
        With all problems of the file, each with its line; those of other studies are left out if a name is given.
    ModelError
        If there is no study of that name, or the file has several and no name is given.

    Examples
    --------
    >>> import io
    >>> study = gw.read_study(io.StringIO(file), {"study.to": 1.3})  # or by its name: gw.read_study("stop.toml")
    >>> study.options.end
    1.3
    """
    return check_study(read_source(path), changes, name)


def read_model(path: str | os.PathLike[str] | io.StringIO, changes: Mapping[str, object] | None = None) -> System:
    """Read the system of a model file; studies in it are ignored.

    Parameters
    ----------
    path
        A TOML file, or its text, as ``io.StringIO(text)``.
    changes
        Values that replace those of the file, by parameter, for example ``{"stage2.clearance": 0.5}``.

    Returns
    -------
    System
        The system; its frequency is 1 if the file gives none.

    Raises
    ------
    ModelFileError
        With all problems of the model, each with its line.

    Examples
    --------
    >>> import io
    >>> gw.read_model(io.StringIO(file), {"stop.stiffness": 2.0})["stop.stiffness"]  # or: gw.read_model("stop.toml")
    2.0
    """
    source = read_source(path)
    alone = {name: value for name, value in source.data.items() if name != "study"}
    return check_system(replace(source, data=alone), changes or {})[1]


def check_system(source: Source, changes: Mapping[str, object]) -> tuple[Model, System]:
    """Return the model of a source, and its system with changed values, without its studies."""
    source, rest, problems = change_source(source, changes)
    model, found = check_model(source)
    problems += found
    if model is None or problems:
        raise ModelFileError(in_order(problems))
    system, problems = change_system(model.system, source, {}, rest)
    if problems or system is None:
        raise ModelFileError(problems)
    return model, system


def read_studies(
    path: str | os.PathLike[str] | io.StringIO, changes: Mapping[str, object] | None = None, names: Sequence[str] = ()
) -> tuple[Study, ...]:
    """Read a model file with all of its studies, in their order; parameters and errors as `read_study`.

    Parameters
    ----------
    path, changes
        As in `read_study`.
    names
        Names of the studies to read, by default all. Those that are left out may have errors.

    Returns
    -------
    tuple of Study
        In the order of the file.

    Examples
    --------
    >>> import io
    >>> [each.title for each in gw.studies.read_studies(io.StringIO(file))]
    ['A sprung mass with a stop']
    """
    return check_studies(read_source(path), changes, names)


def check_study(source: Source, changes: Mapping[str, object] | None = None, name: str = "") -> Study:
    """Return the study that a source describes; see `read_study`."""
    studies = check_studies(source, changes, (name,) if name else ())
    if len(studies) == 1:
        return studies[0]
    names = ", ".join(study.name for study in studies)
    raise ModelError(f"{source.name or 'the text'} has {len(studies)} studies, so give the name of one: {names}")


def check_studies(
    source: Source, changes: Mapping[str, object] | None = None, names: Sequence[str] = ()
) -> tuple[Study, ...]:
    """Return the studies that a source describes, or those of some names; see `read_studies`."""
    return check_whole(source, changes, names)[2]


def check_whole(
    source: Source, changes: Mapping[str, object] | None = None, names: Sequence[str] = ()
) -> tuple[Model, System, tuple[Study, ...]]:
    """Return the model of a source, its system with changed values but without its studies, and these studies."""
    _check_names(source, names)
    asked = dict(changes or {})
    source, rest, problems = change_source(source, asked)
    model, found, system = checked_model(source)
    problems += found
    reduction, found = reduction_part(source)
    problems += found
    if reduction and system and system.units:
        message = "reduces equations without units; write the numbers of this file without units"
        problems.append(source.problem(message, ("reduction",)))
    if "measurement" in source.data:
        from gapwalk.studies.measurement_fit import check_measurement  # only now: few models have a record

        problems += check_measurement(source, system)[1]
    tables = study_tables(source)
    if source.data.get("study") is None:
        example = 'add [study] with kind = "response", parameter, from and to'
        problems.append(source.problem(f"is missing; {example}", ("study",)))
        problems += change_system(system, source, {}, rest, guessed=model is None)[1]
    studies, sound = [], None if problems else model
    for at, table in tables.items():
        if names and table.get("name") not in names:
            continue
        study, found = _check_table(source, at, sound, system, rest, asked, reduction, guessed=model is None)
        studies.append(study)
        if system is None and describes_train(source.data):  # without its units no number of a study can be judged
            found = [each for each in found if each.message.startswith(("is not a key", "is missing"))]
        problems += found
    if any(each.message.endswith(f"did you mean {pace}?") for each in problems for pace in PACES):
        # it is there, under another name
        problems = [each for each in problems if (each.path, each.message[:10]) != ("frequency", "is missing")]
    if model is None or problems:
        raise ModelFileError(in_order(list(dict.fromkeys(problems))))
    system = change_system(model.system, source, {}, rest)[0]
    assert system is not None
    return model, system, tuple(study for study in studies if study)


def _check_table(
    source: Source,
    at: Path,
    model: Model | None,
    system: System | None,
    changes: Mapping[str, object],
    asked: Mapping[str, object],
    reduction: ReductionPart | None,
    *,
    guessed: bool,
) -> tuple[Study | None, list[Problem]]:
    """Return the study of one table; None if something is wrong with it."""
    own, problems = study_changes(source, at, system)
    # what is given from outside of the file has the last word
    own = {key: own[key] for key in own if key not in asked}
    system, found = change_system(system, source, own, changes, guessed=guessed)
    problems += found
    system = system and _in_asked_units(system, study_tables(source)[at])
    reduced = None
    if reduction and model and system and not problems:
        reduced, problems = reduce_for(source, at, reduction, system)
        system = reduced.reduction.system if reduced and reduced.reduction else system
    has_frequency = has_pace(source) or any(name in own for name in PACES)
    table, found = _validated(source, at, system, has_frequency, guessed)
    problems += found
    if not has_frequency:
        problems += _frequency_problems(source, at, system)
    if model is None or system is None or table is None or problems:
        return None, problems
    title = table.title or (f"{model.title}: {table.name}" if model.title and table.name else model.title)
    try:
        options = table.options(system)
        system = options.first_system(system)
    except ModelError as error:
        return None, [_refused(source, at, table, error)]
    changed = tuple(asked.items())
    name = table.name or ""
    return Study(system, options, title, source.text, changed, name, reduced, table.unused, model.files), []


def _in_asked_units(system: System, table: Mapping[str, Any]) -> System:
    """Return a system with the parameters of which a study asks in the units in which it asks."""
    assembly, asked = system.structure.assembly, dict[str, Unit]()
    nested = (each for value in table.values() for each in (value if isinstance(value, list) else [value]))
    for each in (table, *(each for each in nested if isinstance(each, Mapping))):
        name, value = str(each.get("parameter")), each.get("from", each.get("mean"))
        kind = system.units.kind(name) if system.units and name not in PACES else None
        if kind and name in system.structure.names and isinstance(value, str) and has_unit(value):
            with suppress(ValueError):  # which is refused where it is read
                found = read_quantity(value, kind)
                asked[name] = Unit(found.unit, found.factor)
    if not (isinstance(assembly, TrainAssembly) and assembly.units and asked):
        return system
    units = replace(assembly.units, asked=(*asked.items(),))
    structure = replace(system.structure, assembly=replace(assembly, units=units))
    sizes = [each.factors(structure.names) for each in (assembly.units, units)]
    return System.from_values(structure, system.values * (sizes[0] / sizes[1]))


def _validated(
    source: Source, at: Path, system: System | None, has_frequency: bool, guessed: bool
) -> tuple[DerivedPart | None, list[Problem]]:
    tables = study_tables(source)
    kind = tables[at].get("kind")
    if not isinstance(kind, str) or kind not in kinds():
        return None, [source.problem(_kind_problem(tables[at]), (*at, "kind"))]
    places = list(tables)
    earlier = tuple(str(tables[place].get("name", "")) for place in places[: places.index(at)])
    read = partial(read_named, source=source)
    context = partial(Surroundings, system, has_frequency, len(tables) == 1, earlier, all_keys, guessed, read)
    return validate(study_schema(kind_of(kind)), tables[at], source, at, context)


def _kind_problem(table: Mapping[str, object]) -> str:
    known = ", ".join(given(kind) for kind in kinds())
    if "kind" not in table:
        return f"is missing; it must be one of {known}"
    kind = table["kind"]
    hint = did_you_mean(kind, kinds()) if isinstance(kind, str) else ""
    return f"is {given(kind)}; it must be one of {known}" + (f"; {hint}" if hint.endswith("?") else "")


def _refused(source: Source, at: Path, table: StudyPart, error: ModelError) -> Problem:
    """Return the refusal of a whole study as a problem at the key with which the message begins."""
    fields = type(table).model_fields.items()
    keys = {name: info.alias or name for name, info in fields}
    name, _, _ = str(error).partition(" ")
    return source.problem(refusal(error, name if name in keys else ""), (*at, keys[name]) if name in keys else at)


def _frequency_problems(source: Source, at: Path, system: System | None) -> Iterator[Problem]:
    """Report a missing frequency if the study does not give one; a misspelt parameter may be meant for it."""
    table = study_tables(source)[at]
    walked = walked_parameters(table)
    kind, pace = table.get("kind"), 'speed = "1500 rpm"' if describes_train(source.data) else "frequency = 1.0"
    named = f"study {given(table['name'])}" if isinstance(table.get("name"), str) else "the study"
    write = f"write it at the top of the file, as in {pace}, or in the study, as in set = {{ {pace} }}"
    known_kind = kind_of(kind) if isinstance(kind, str) and kind in kinds() else None
    if known_kind is not None and known_kind.gives_frequency:
        return
    if known_kind is not None and "parameter" not in study_schema(known_kind).model_fields:
        yield source.problem(f"is missing; {named} walks nothing: {write}", ("frequency",))
    known = [name for name in walked if system is None or name in system.structure.names]
    if known == walked and walked and not any(name in walked for name in PACES):
        message = f"is missing; {named} walks {' and '.join(walked)}: {write}"
        yield source.problem(message, ("frequency",))


def _check_names(source: Source, names: Iterable[str]) -> None:
    """Raise a ModelError for the first name that no study of a source has."""
    known = [name for table in study_tables(source).values() if isinstance(name := table.get("name"), str) and name]
    file = source.name or "the text"
    for name in names:
        if not known:
            raise ModelError(f"{file} has one study, which has no name; leave the name {name!r} out")
        if name not in known:
            raise ModelError(f"{file} has no study {name!r}; {did_you_mean(name, known)}")


def text_of_sheet(path: str | os.PathLike[str]) -> str:
    """Return the text of a model file that is made from a table of a drive train; see `train_of_sheet`."""
    text, places = train_of_sheet(path)
    _, problems = check_model(parse_source(text))
    if problems:
        raise ModelError("\n".join(f"{os.fspath(path)}: {_placed(problem, places)}" for problem in problems))
    return text


def _placed(problem: Problem, places: Mapping[str, str]) -> str:
    """Return a problem of the model file as one of the table from which it was made."""
    inside = [path for path in places if f"{problem.path}.".startswith(f"{path}.")]
    where = places[max(inside, key=len)] if inside else "the whole table"
    return f"{where}: {problem.place or problem.path} {problem.message}"


# A study of a drive train with units in the non-dimensional form of that train.


def without_units(study: Study) -> Study:
    """Return a study in non-dimensional form; its changes state the scaling of its numbers."""
    form = nondimensional(study.system)
    changes = (*study.changes, ("units", f"none: {form.scales.words}"))
    return replace(study, system=form.system, options=_options(study.options, form), changes=changes)


def _options(options: StudyKind, form: NonDimensional) -> StudyKind:
    if options.kind == "basins":
        raise ModelError(
            "basins are found in a plane of states, in the units of the file; leave --units none out for them"
        )
    given = {each.name: getattr(options, each.name) for each in fields(options)}
    changed: dict[str, Any] = {}
    if "parameter" in given:
        name = given["parameter"]
        changed = {"parameter": form.name(name)}
        changed |= {end: form.value(name, given[end]) for end in ("begin", "end")}
        if given.get("near") is not None:
            changed["near"] = form.value(name, given["near"])
        changed["search_values"] = _scaled(given.get("search_values"), name, form)
    second = given.get("second")
    if isinstance(second, ParameterRange):
        name = second.parameter
        ends = (form.value(name, value) for value in (second.begin, second.end))
        changed["second"] = ParameterRange(form.name(name), *ends)
        changed["sections"] = _scaled(given.get("sections"), name, form)
    if isinstance(start := given.get("start"), tuple):
        changed["start"] = tuple(form.state(start).tolist())
    if isinstance(starts := given.get("starts"), tuple):
        changed["starts"] = tuple(tuple(form.state(state).tolist()) for state in starts)
    return replace(options, **{key: value for key, value in changed.items() if key in given})


def _scaled(values: Any, name: str, form: NonDimensional) -> Any:
    """Return values of a parameter in non-dimensional form; a number of values is unchanged."""
    return tuple(form.value(name, value) for value in values) if isinstance(values, tuple) else values
