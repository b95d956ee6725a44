"""Compare a model with a measured record: the table ``[measurement]`` of a model file, alignment and fit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt
from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.answers.point_fit import MeasuredPoint, PointFit, fit_points
from gapwalk.bifurcation.follow import follow
from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_of
from gapwalk.measurement.fit import Alignment, Estimate, Fit, align, fit
from gapwalk.measurement.measured_record import FIELDS, Record, read_measurement
from gapwalk.model.bounds import Counted
from gapwalk.model.model_file import check_model, in_order, validate
from gapwalk.model.model_source import Source, read_source
from gapwalk.model.problems import ModelFileError, Problem, did_you_mean, given
from gapwalk.model.system import System
from gapwalk.model.words import pace_words
from gapwalk.orbit.find import find_orbit
from gapwalk.results.codec import plain, plain_rows
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.set_values import leaves_of
from gapwalk.studies.study_kind import Rows, values_of
from gapwalk.studies.study_schema import Start, StartOrState, Surroundings, check_parameter, given_of, table_schema
from gapwalk.summary import Described, SummaryParts, Table, remarks, summarizes

# Doubts about the measure that a study shows: one that a rigid stop holds at its clearance shows nothing.


# Fit a model to special points measured in slow sweeps: the table ``[measurement]`` with the key ``sweep``.

_SWEEP = 'write the range that was swept, as in sweep = { parameter = "frequency", from = 1.0, to = 0.5 }'
_POINT = (
    """write the points that were measured, as in [[measurement.point]], kind = "fold", value = 0.62, error = 0.001"""
)


def exist(names: tuple[str, ...], info: ValidationInfo[Surroundings]) -> tuple[str, ...]:
    """Refuse names of parameters that the system does not have."""
    for name in names:
        check_parameter(name, info.context)
    return names


def are_ranges(bounds: object, info: ValidationInfo[Surroundings]) -> dict[str, tuple[float, float]]:
    """Return lowest and highest values by parameter, from a table of lists of two numbers."""
    if not isinstance(bounds, Mapping):
        raise ValueError(f'is {given(bounds)}; it must be a table, such as {{ "stage2.clearance" = [0.5, 2.0] }}')
    found: dict[str, tuple[float, float]] = {}
    for value, path in leaves_of(bounds, ()):
        name = ".".join(str(key) for key in path)
        check_parameter(name, info.context)
        numbers = value if isinstance(value, list) else []
        if len(numbers) != 2 or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in numbers):
            raise ValueError(f"gives {name} {given(value)}; it must be a list of two numbers, as in [0.5, 2.0]")
        found[name] = (float(numbers[0]), float(numbers[1]))
    return found


@dataclass(frozen=True, slots=True)
class PointTable:
    """A measured point as a table has it; parameters as `gapwalk.measure.MeasuredPoint`."""

    kind: Annotated[str, Field(description='write what was measured, as in kind = "fold"')]
    value: Annotated[Any, Field(description="write the measured value")]
    error: Annotated[Any, Field(description="write its standard uncertainty")]
    which: Any = ""


def _are_points(points: Sequence[PointTable], info: ValidationInfo[Surroundings]) -> tuple[MeasuredPoint, ...]:
    """Return the measured points, in the unit of the parameter that was swept."""
    sweep, system, found = info.data.get("sweep"), info.context.system, []
    units = None if system is None else system.units
    for number, point in enumerate(points, start=1):
        numbers: list[Any] = [point.value, point.error]
        try:
            if units is not None and sweep is not None and units.parameter(sweep.parameter):
                numbers = [units.read(sweep.parameter, each) for each in numbers]
            elif sweep is None and any(isinstance(each, str) for each in numbers):
                continue  # their unit is unknown while the sweep is wrong itself
            value, blur = numbers
            found.append(MeasuredPoint(point.kind, value, blur, point.which))
        except (ModelError, ValueError) as error:
            raise ValueError(f"is wrong at number {number}: {error}") from None
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class Fitting:
    """The keys of every table ``[measurement]``: the computed motion, and the parameters to fit."""

    #: period, start: The motion: its period in forcing periods, and the start of the search for it.
    period: Counted = 1
    start: StartOrState = Start.SETTLE
    #: fit, bounds: Names of parameters to fit, and their lowest and highest values.
    fit: Annotated[tuple[str, ...], AfterValidator(exist)] = ()
    bounds: Annotated[Any, AfterValidator(are_ranges)] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SweptMeasurement(Fitting):
    """The table ``[measurement]`` for special points that were measured in slow sweeps; other keys as `Fitting`."""

    sweep: Annotated[ParameterRange, Field(description=_SWEEP)]  #: The parameter that was swept, and its range.
    #: The measured points.
    point: Annotated[tuple[PointTable, ...], AfterValidator(_are_points), Field(description=_POINT)] = ()


@dataclass(frozen=True, kw_only=True)
class SweptModel(SweptMeasurement):
    """A model with the special points that were measured on it; other parameters as `SweptMeasurement`."""

    system: System  #: The system, with initial guesses of the parameters to be fitted.
    title: str = ""  #: A line for people; may be empty.


def measure_points(model: SweptModel, points: Sequence[MeasuredPoint] = ()) -> PointFit:
    """Compute the branch of a model, and fit the parameters that it names to measured special points."""
    wanted: Sequence[Any] = points or model.point
    if not wanted:
        raise ModelError(f"no point was measured; {_POINT}; or name a CSV file with the columns kind,value,error")
    if not model.fit:
        raise ModelError('fit is empty; name the parameters to fit, as in fit = ["stage2.clearance"]')
    sweep = model.sweep
    first = find_orbit(model.system.at({sweep.parameter: sweep.begin}), model.period, model.start)
    return fit_points(follow(first, sweep.parameter, sweep.end), wanted, model.fit, bounds=model.bounds)


def document_of(found: PointFit, title: str = "") -> dict[str, Any]:
    """Return a fit to measured points as plain JSON values."""
    document: dict[str, Any] = {"title": title, "parameter": found.parameter}
    document |= {name: plain_rows(table()) for name, table in found.tables().items()}
    return document | {
        "correlation": plain(found.correlation),
        "chi_square": found.chi_square,
        "freedom": found.freedom,
        "evaluations": found.evaluations,
        "notes": list(found.notes),
        "failures": list(found.failures),
    }


_LINES = 12  # spectral lines that the summary lists
_EXAMPLE = """add [measurement] with signal = "q1''" (what the record measures)"""
_NO_TRAIN = (
    "has no sweep; a drive train can be fitted to special points of a sweep only, as in "
    'sweep = { parameter = "speed", from = "800 rpm", to = "1200 rpm" }, not to a record'
)
_NO_REDUCTION = (
    "is for studies; a record is compared with the full system, so leave it out "
    "(in Python, `gapwalk.reduce` gives a smaller one)"
)


def _not_zero(factor: float) -> float:
    if factor == 0.0:
        raise ValueError("is 0; it is the factor from the record's units to those of the model")
    return factor


def _is_a_signal(signal: object, info: ValidationInfo[Surroundings]) -> object:
    if not isinstance(signal, str | Mapping):
        raise ValueError(f"is {given(signal)}; it must be a text, or a table such as {{ \"q1''\" = 1.0 }}")
    if info.context.system:
        try:
            signal_of(info.context.system, signal)
        except ModelError as error:
            raise ValueError(f"is {given(signal)}, but {error}") from None
    return signal


def _are_those_of_a_record(columns: Mapping[str, str]) -> Mapping[str, str]:
    for name in columns:
        if name not in FIELDS:
            raise ValueError(f"names {given(name)}, which no record has; {did_you_mean(name, FIELDS)}")
    return columns


Factor = Annotated[float, Gt(0)]


@dataclass(frozen=True, kw_only=True)
class Measurement(Fitting):
    """The table ``[measurement]``: properties of records measured on the modelled system; other keys as `Fitting`."""

    #: The measured signal of the motion.
    signal: Annotated[
        Any, Field(description="write what the record measures, as in signal = \"q1''\""), AfterValidator(_is_a_signal)
    ]
    #: columns, time_scale, scale, speed_scale: As in `gapwalk.measure.read_measurement`.
    columns: Annotated[Mapping[str, str], AfterValidator(_are_those_of_a_record)] = field(default_factory=dict)
    time_scale: Factor = 1.0
    scale: Annotated[float, AfterValidator(_not_zero)] = 1.0
    speed_scale: Factor = 1.0
    order: Factor = 1.0  #: Periods of the excitation in a turn of the shaft whose speed was measured.


@dataclass(frozen=True, kw_only=True)
class MeasuredModel(Measurement):
    """A model with the properties of its records; other parameters as `Measurement`."""

    system: System  #: The system, with initial guesses of the parameters to be fitted.
    frequency_given: bool  #: True if the file gives the frequency; otherwise it must come from the speed of a record.
    title: str = ""  #: A line for people; may be empty.

    def read(self, path: str | os.PathLike[str]) -> Record:
        """Read a record in the units of the model; errors as `gapwalk.measure.read_measurement`."""
        scales = {"time_scale": self.time_scale, "scale": self.scale, "speed_scale": self.speed_scale}
        return read_measurement(path, self.columns, **scales)


def read_measured_model(
    path: str | os.PathLike[str], changes: Mapping[str, object] | None = None
) -> MeasuredModel | SweptModel:
    """Read a model file with its table ``[measurement]``: for a record, or with ``sweep`` for special points."""
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
    if isinstance(table, SweptMeasurement):
        return SweptModel(**values_of(table), system=system, title=model.title)
    about = {"system": system, "frequency_given": "frequency" in source.data, "title": model.title}
    return MeasuredModel(**values_of(table), **about)


def check_measurement(
    source: Source, system: System | None
) -> tuple[Measurement | SweptMeasurement | None, list[Problem]]:
    """Check the table ``[measurement]`` of a file, if it has one."""
    if "measurement" not in source.data:
        return None, []
    table = source.data["measurement"]
    is_swept = isinstance(table, Mapping) and ("sweep" in table or "point" in table)
    if not is_swept and "inertia" in source.data:
        return None, [source.problem(_NO_TRAIN, ("measurement",))]
    kind = SweptMeasurement if is_swept else Measurement
    context = partial(Surroundings, system, "frequency" in source.data)
    part, problems = validate(table_schema(kind), table, source, ("measurement",), context)
    return part and kind(**given_of(kind, part)), problems


@dataclass(frozen=True, eq=False)
class Measured(Described):
    """A record and the motion that it is compared with."""

    model: MeasuredModel  #: The request.
    alignment: Alignment  #: Record and motion, after a fit if there was one.
    fit: Fit | None  #: The fitted parameters; None if no fit was requested.

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks, in sentences."""
        return self.alignment.doubts if self.fit is None else self.fit.notes

    @property
    def failures(self) -> tuple[str, ...]:
        """Reasons to distrust the result, in sentences."""
        return () if self.fit is None else self.fit.failures

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the agreement of record and motion, the fitted parameters, the highest spectral lines, and notes."""
        aligned, orbit = self.alignment, self.alignment.orbit
        sizes = f"{len(aligned.theta)} samples, {aligned.periods} periods"
        yield f"{aligned.record.name}: {sizes}, as {aligned.signal.name}"
        stability = orbit.instability.words
        yield f"motion of period {orbit.period} at {pace_words(orbit.system)}, {stability}, contacts {orbit.pattern}"
        if self.fit is not None:
            yield f"before the fit: {_agreement_words(self.fit.before)}"
            rows = []
            for each in (*self.fit.estimates, self.fit.phase):
                value, sign, error = str(each).partition(" ± ")
                value, note = (value, error) if sign else (f"{each.value:.6g}", str(each).partition("(")[2].rstrip(")"))
                rows.append([each.name, f"{each.start:.6g}", value, note])
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
        """Return plain JSON values."""
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
        """Return the tables of both histories, their spectral lines, and the fitted parameters."""
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
    """Compare a record with the motion of a model, and fit the parameters that the model names."""
    system, measured = model.system, record.frequency(model.order)
    if measured is not None:
        system = system.at(frequency=measured)
    elif not model.frequency_given:
        raise ModelError("frequency is missing in the model, and the record has no speed; write frequency = ...")
    orbit, signal = find_orbit(system, model.period, model.start), signal_of(model.system, model.signal)
    if not model.fit:
        return Measured(model, align(orbit, record, signal, order=model.order), None)
    found = fit(orbit, record, model.fit, signal, bounds=model.bounds, order=model.order)
    return Measured(model, found.after, found)


def _agreement_words(found: Alignment) -> str:
    agreed = found.agreement
    return (
        f"rms error {agreed.rms:.6g} ({agreed.relative:.2%} of the record's), correlation {agreed.correlation:.6f}, "
        f"phase of the first sample {found.phase:.6g} rad"
    )


def _agreement(found: Alignment) -> dict[str, float]:
    agreed = found.agreement
    return {"rms": agreed.rms, "relative": agreed.relative, "correlation": agreed.correlation, "phase": found.phase}


def _fit_document(found: Fit) -> dict[str, Any]:
    return {
        "parameters": [plain(each._asdict()) for each in (*found.estimates, found.phase)],
        "correlation": plain(found.correlation),
        "evaluations": found.evaluations,
        "before": _agreement(found.before),
    }
