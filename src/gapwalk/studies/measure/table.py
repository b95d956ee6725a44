"""The table ``[measurement]`` of a model file: what a record measures, in which units, and what is to be fitted."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from gapwalk.errors import ModelError
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.measured_record import Record
from gapwalk.measurement.read_record import FIELDS, read_measurement
from gapwalk.model.model_fields import Count, Number, Positive, Text
from gapwalk.model.model_file import check_system, in_order
from gapwalk.model.model_source import Source, read_source
from gapwalk.model.problems import ModelFileError, Problem, did_you_mean, given
from gapwalk.model.schema import Part, validate
from gapwalk.model.system import System
from gapwalk.studies.options import Start
from gapwalk.studies.tables import StartOrState, Surroundings, check_parameter, plain_start

_EXAMPLE = """add [measurement] with signal = "q1''" (what the record measures)"""
_NO_REDUCTION = (
    "is for studies; a record is compared with the full system, so leave it out "
    "(in Python, `gapwalk.reduce` gives a smaller one)"
)


def _not_zero(factor: float) -> float:
    if factor == 0.0:
        raise ValueError("is 0; it is the factor from the record's units to those of the model")
    return factor


class MeasurementPart(Part):
    """What a record measures: ``[measurement]``."""

    signal: Any = Field(description="write what the record measures, as in signal = \"q1''\"")
    columns: dict[Text, Text] = Field(default={})
    time_scale: Positive = 1.0
    scale: Annotated[Number, AfterValidator(_not_zero)] = 1.0
    speed_scale: Positive = 1.0
    order: Positive = 1.0
    period: Count = 1
    start: StartOrState = Start.SETTLE
    fit: list[Text] = Field(default=[])
    bounds: Any = Field(default={})

    @field_validator("signal")
    @classmethod
    def _is_a_signal(cls, signal: object, info: ValidationInfo[Surroundings]) -> object:
        if not isinstance(signal, str | Mapping):
            raise ValueError(f"is {given(signal)}; it must be a text, or a table such as {{ \"q1''\" = 1.0 }}")
        if info.context.system:
            try:
                signal_of(info.context.system, signal)
            except ModelError as error:
                raise ValueError(f"is {given(signal)}, but {error}") from None
        return signal

    @field_validator("columns")
    @classmethod
    def _are_those_of_a_record(cls, columns: dict[str, str]) -> dict[str, str]:
        for field in columns:
            if field not in FIELDS:
                raise ValueError(f"names {given(field)}, which no record has; {did_you_mean(field, FIELDS)}")
        return columns

    @field_validator("fit")
    @classmethod
    def _exist(cls, names: list[str], info: ValidationInfo[Surroundings]) -> list[str]:
        for name in names:
            check_parameter(name, info.context)
        return names

    @field_validator("bounds")
    @classmethod
    def _are_ranges(cls, bounds: object, info: ValidationInfo[Surroundings]) -> dict[str, tuple[float, float]]:
        if not isinstance(bounds, Mapping):
            raise ValueError(f'is {given(bounds)}; it must be a table, such as {{ "stage2.clearance" = [0.5, 2.0] }}')
        found: dict[str, tuple[float, float]] = {}
        for name, value in _leaves(bounds):
            check_parameter(name, info.context)
            numbers = value if isinstance(value, list) else []
            if len(numbers) != 2 or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in numbers):
                raise ValueError(f"gives {name} {given(value)}; it must be a list of two numbers, as in [0.5, 2.0]")
            found[name] = (float(numbers[0]), float(numbers[1]))
        return found


@dataclass(frozen=True)
class MeasuredModel:
    """A model, and what is known of records of it.

    Parameters
    ----------
    system
        The system, with the first guess of what is to be fitted.
    frequency_given
        Whether the file gives the frequency; otherwise it must come from the speed of a record.
    signal
        What of the motion a record measures.
    columns, time_scale, scale, speed_scale
        As in `gapwalk.read_measurement`.
    order
        Periods of the excitation in a turn of the shaft whose speed was measured.
    period, start
        The motion: after how many forcing periods it repeats, and where it is looked for.
    fit, bounds
        Names of parameters to fit, and their lowest and highest values.
    title
        A line for people; may be empty.
    """

    system: System
    frequency_given: bool
    signal: Signal
    columns: Mapping[str, str]
    time_scale: float
    scale: float
    speed_scale: float
    order: float
    period: int
    start: str | tuple[float, ...]
    fit: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]]
    title: str

    def read(self, path: str | os.PathLike[str]) -> Record:
        """Read a record in the units of the model; errors as `gapwalk.read_measurement`."""
        scales = {"time_scale": self.time_scale, "scale": self.scale, "speed_scale": self.speed_scale}
        return read_measurement(path, self.columns, **scales)


def read_measured_model(path: str | os.PathLike[str], changes: Mapping[str, object] | None = None) -> MeasuredModel:
    """Read a model file with its table ``[measurement]``.

    Parameters
    ----------
    path
        A TOML file.
    changes
        Other values than those of the file, by parameter, or by ``measurement.`` and a key of that table.

    Raises
    ------
    ModelFileError
        With everything that is wrong, each problem with its line.
    """
    source, rest = read_source(path), {}
    for name, value in (changes or {}).items():
        if name == "frequency" or name.startswith("measurement."):
            source = source.with_value(tuple(name.split(".")), value)
        else:
            rest[name] = value
    part, problems = check_system(source)
    system = part.system() if part else None
    if system:
        try:
            system = system.at(rest)
        except ModelError as error:
            problems += [Problem(line, file=source.name) for line in str(error).splitlines()]
    table, found = check_measurement(source, system)
    problems += found
    if "measurement" not in source.data:
        problems.append(source.problem(f"is missing; {_EXAMPLE}", ("measurement",)))
    if "reduction" in source.data:
        problems.append(source.problem(_NO_REDUCTION, ("reduction",)))
    if part is None or system is None or table is None or problems:
        raise ModelFileError(in_order(list(dict.fromkeys(problems))))
    return MeasuredModel(
        system,
        "frequency" in source.data,
        signal_of(system, table.signal),
        table.columns,
        table.time_scale,
        table.scale,
        table.speed_scale,
        table.order,
        table.period,
        plain_start(table.start),
        tuple(table.fit),
        table.bounds,
        part.title,
    )


def check_measurement(source: Source, system: System | None) -> tuple[MeasurementPart | None, list[Problem]]:
    """Check the table ``[measurement]`` of a file, if it has one."""
    if "measurement" not in source.data:
        return None, []
    surroundings = Surroundings(system, "frequency" in source.data)
    return validate(MeasurementPart, source.data["measurement"], source, ("measurement",), lambda: surroundings)


def _leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """All values in a table of tables: ``stage2.clearance`` may be written with or without quotes."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
