"""Fit a model to special points measured in slow sweeps: the table ``[measurement]`` with the key ``sweep``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.answers.measured_points import MeasuredPoint
from gapwalk.answers.point_fit import PointFit, fit_points
from gapwalk.bifurcation.follow import follow
from gapwalk.errors import ModelError
from gapwalk.model.problems import given
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.set_values import leaves_of
from gapwalk.studies.study_kind import plain_numbers
from gapwalk.studies.study_registry import Counted
from gapwalk.studies.tables import Start, StartOrState, Surroundings, check_parameter

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
    for name, table in found.tables().items():
        heads, *rows = [list(row) for row in table()]
        document[name] = [dict(zip(map(str, heads), plain_numbers(row), strict=True)) for row in rows]
    return document | {
        "correlation": plain_numbers(found.correlation.tolist()),
        "chi_square": found.chi_square,
        "freedom": found.freedom,
        "evaluations": found.evaluations,
        "notes": list(found.notes),
        "failures": list(found.failures),
    }
