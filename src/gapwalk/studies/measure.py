"""Compare a model with a measured record: the table ``[measurement]`` of a model file, alignment and fit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from gapwalk.errors import ModelError
from gapwalk.flow.signal import Signal, signal_of
from gapwalk.measurement.alignment import Alignment, align
from gapwalk.measurement.fit import Fit, fit
from gapwalk.measurement.measured_record import Record
from gapwalk.measurement.misfit import Estimate
from gapwalk.measurement.read_record import FIELDS, read_measurement
from gapwalk.model.model_file import check_model, in_order
from gapwalk.model.model_source import Source, read_source
from gapwalk.model.problems import ModelFileError, Problem, did_you_mean, given
from gapwalk.model.schema import Count, Number, Part, Positive, Text, validate
from gapwalk.model.system import System
from gapwalk.model.words import pace_words
from gapwalk.orbit.find import find_orbit
from gapwalk.studies.kind import Rows, plain_numbers
from gapwalk.studies.tables import Start, StartOrState, Surroundings, check_parameter
from gapwalk.summary import Table, remarks

_LINES = 12  # spectral lines that the summary lists
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
        As in `gapwalk.measure.read_measurement`.
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
        """Read a record in the units of the model; errors as `gapwalk.measure.read_measurement`."""
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
    model, problems = check_model(source)
    system = model.system if model else None
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
    if model is None or system is None or table is None or problems:
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
        str(table.start) if isinstance(table.start, str) else tuple(table.start),
        tuple(table.fit),
        table.bounds,
        model.title,
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


@dataclass(frozen=True, eq=False)
class Measured:
    """A record beside a motion.

    Attributes
    ----------
    model
        What was asked.
    alignment
        Record and motion, after a fit if there was one.
    fit
        The fitted parameters; None if none was asked for.
    """

    model: MeasuredModel
    alignment: Alignment
    fit: Fit | None

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to say, in sentences."""
        return self.alignment.doubts if self.fit is None else self.fit.notes

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the result is not to be trusted, in sentences."""
        return () if self.fit is None else self.fit.failures

    def summary(self) -> Iterator[str | Table]:
        """Return the agreement of record and motion, the fitted parameters, the highest spectral lines, and notes."""
        aligned, orbit = self.alignment, self.alignment.orbit
        sizes = f"{len(aligned.theta)} samples, {aligned.periods} periods"
        yield f"{aligned.record.name}: {sizes}, as {aligned.signal.name}"
        stability = "stable" if orbit.stable else "unstable"
        yield f"motion of period {orbit.period} at {pace_words(orbit.system)}, {stability}, contacts {orbit.pattern}"
        if self.fit is not None:
            yield f"before the fit: {_agreement_words(self.fit.before)}"
            rows = []
            for each in (*self.fit.estimates, self.fit.phase):
                _, sign, error = str(each).partition("±")
                note = error.strip() if sign else str(each).partition("(")[2].rstrip(")")
                rows.append([each.name, f"{each.start:.6g}", f"{each.value:.6g}", note])
            yield Table(["parameter", ">start", ">fitted", ">standard error"], rows)
        yield f"{'after the fit: ' if self.fit else ''}{_agreement_words(aligned)}"
        highest = sorted(aligned.agreement.lines, key=lambda line: -max(line.first, line.second))[:_LINES]
        lines = [
            [
                f"{line.order:g} Ω" if orbit.system.turns is None else f"order {line.order:g}",
                *(f"{line.first:.6g}", f"{line.second:.6g}", f"{line.difference:+.3g}", f"{line.shift:+.3f} rad"),
            ]
            for line in sorted(highest)
        ]
        yield Table([">line", ">measured", ">computed", ">difference", ">phase shift"], lines)
        yield from remarks(self.notes, ())

    def document(self) -> dict[str, Any]:
        """The same as plain JSON values."""
        found, orbit = self.alignment, self.alignment.orbit
        return {
            "title": self.model.title,
            "record": {"name": found.record.name, "samples": len(found.theta), "periods": found.periods},
            "signal": dict(found.signal.terms),
            "frequency": orbit.system.frequency,
            "orbit": {
                "period": orbit.period,
                "stable": orbit.stable,
                "pattern": orbit.pattern,
                "state": orbit.state.tolist(),
            },
            "agreement": _agreement(found),
            "lines": [line._asdict() | {"difference": line.difference} for line in found.agreement.lines],
            "fit": None if self.fit is None else _fit_document(self.fit),
            "notes": list(self.notes),
            "failures": list(self.failures),
        }

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The two histories, their lines, and the fitted parameters."""
        tables: dict[str, Callable[[], Rows]] = {"history": self._history_rows, "lines": self._line_rows}
        return tables if self.fit is None else {"parameters": self._parameter_rows, **tables}

    def _history_rows(self) -> Iterator[Sequence[object]]:
        found = self.alignment
        yield ["theta", "measured", "computed"]
        yield from np.column_stack((found.theta, found.measured, found.computed)).tolist()

    def _line_rows(self) -> Iterator[Sequence[object]]:
        yield ["order", "measured", "computed", "difference", "shift"]
        for line in self.alignment.agreement.lines:
            yield [line.order, line.first, line.second, line.difference, line.shift]

    def _parameter_rows(self) -> Iterator[Sequence[object]]:
        assert self.fit is not None
        yield list(Estimate._fields)
        yield from (list(each) for each in (*self.fit.estimates, self.fit.phase))


def measure(model: MeasuredModel, record: Record) -> Measured:
    """Put a record beside the motion of a model, and fit the parameters that the model names.

    Raises
    ------
    ModelError
        If the record does not suit the motion, or nobody knows the frequency.
    ConvergenceError
        If there is no such motion, or no fit is found.
    """
    system, measured = model.system, record.frequency(model.order)
    if measured is not None:
        system = system.at(frequency=measured)
    elif not model.frequency_given:
        raise ModelError("frequency is missing in the model, and the record has no speed; write frequency = ...")
    orbit = find_orbit(system, model.period, model.start)
    if not model.fit:
        return Measured(model, align(orbit, record, model.signal, order=model.order), None)
    found = fit(orbit, record, model.fit, model.signal, bounds=model.bounds, order=model.order)
    return Measured(model, found.after, found)


def _agreement_words(found: Alignment) -> str:
    agreed = found.agreement
    return (
        f"rms error {agreed.rms:.6g} ({agreed.relative:.2%} of the record's), correlation {agreed.correlation:.6f}, "
        f"phase of the first sample {found.phase:.6g} rad"
    )


def _agreement(found: Alignment) -> dict[str, float]:
    agreed = found.agreement
    return {
        "rms": agreed.rms,
        "relative": agreed.relative,
        "correlation": agreed.correlation,
        "phase": found.phase,
    }


def _fit_document(found: Fit) -> dict[str, Any]:
    estimates = [plain_numbers(list(each)) for each in (*found.estimates, found.phase)]
    return {
        "parameters": [dict(zip(Estimate._fields, each, strict=True)) for each in estimates],
        "correlation": plain_numbers(found.correlation.tolist()),
        "evaluations": found.evaluations,
        "before": _agreement(found.before),
    }
