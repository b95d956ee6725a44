"""The study of tolerances: where special points lie when parameters vary from part to part, and what matters most."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo

from gapwalk.answers.spread import Spread, Spreads, parts_in
from gapwalk.answers.tolerance import Tolerance
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.parallel.workers import Workers
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import values_of
from gapwalk.studies.study_registry import Counted, check_integers
from gapwalk.studies.tables import Start, StartOrState, Surroundings
from gapwalk.studies.tolerance_work import ToleranceWork

if TYPE_CHECKING:
    from typing import Self

Array = NDArray[np.float64]

MAX_SAMPLES = 10_000_000
"""Largest number of samples of a study."""
LEAST_ACCURACY, MOST_ACCURACY = 1e-8, 1e-2
"""Smallest and largest error of a value, as a share of it, that can be asked for."""


@dataclass(frozen=True)
class ToleranceOptions:
    """Options of a study of tolerances.

    Examples
    --------
    >>> gw.ask.ToleranceOptions(samples=200, seed=1).samples
    200
    """

    samples: int = 1000  #: Number of samples.
    seed: int = 0  #: Seed of their random numbers.
    check: int = 16  #: Tracked samples whose branches are walked for comparison.
    period: int = 1  #: Number m of forcing periods after which the orbits of the branch repeat.
    walk: WalkOptions = field(default_factory=WalkOptions)  #: Options of the walks.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)
    accuracy: float = 1e-5  #: Largest error of the value of a tracked point, as a share of it.

    def __post_init__(self) -> None:
        check_integers(self, samples=2, seed=0, check=0, period=1)
        if self.samples > MAX_SAMPLES:
            raise ModelError(f"samples is {self.samples:,}; there may be {MAX_SAMPLES:,}")
        if not LEAST_ACCURACY <= self.accuracy <= MOST_ACCURACY:
            raise ModelError(
                f"accuracy is {self.accuracy:g}; it must be between {LEAST_ACCURACY:g} and {MOST_ACCURACY:g}"
            )
        if self.period > MAX_PERIOD:
            raise ModelError(f"period is {self.period}; it may be {MAX_PERIOD}")


def _read(value: object, info: ValidationInfo[Surroundings], parameter: object, *, relative: bool) -> object:
    """Return a number of a table in the unit of the parameter; in percent it refers to the value of the system."""
    system = info.context.system
    if isinstance(value, str) and value.strip().endswith("%"):
        try:
            share = float(value.strip()[:-1]) / 100.0
        except ValueError:
            raise ValueError(f'is {value!r}; write a number of percent, as in "5 %"') from None
        if not isinstance(parameter, str) or system is None:
            return abs(share) or share
        nominal = float(system[parameter])
        if nominal == 0.0:
            raise ValueError(f"is {value!r}, but {parameter} is 0 in the model; write a number with its unit")
        return share * abs(nominal) if relative else nominal + share * abs(nominal)
    units = None if system is None else system.units
    if units is not None and isinstance(parameter, str) and units.parameter(parameter):
        return units.read(parameter, value) if value != 0 or isinstance(value, str) else value
    return value


def _quantity(*, relative: bool) -> BeforeValidator:
    def read(value: object, info: ValidationInfo[Surroundings]) -> object:
        parameter = info.data.get("parameter")
        return value if value is None or parameter is None else _read(value, info, parameter, relative=relative)

    return BeforeValidator(read)


def _known(parameter: object, info: ValidationInfo[Surroundings]) -> object:
    system = info.context.system
    if system and isinstance(parameter, str):
        try:
            system.structure.place(parameter)
        except ModelError as error:
            raise ValueError(f"is {parameter!r}, but {error}") from None
    return parameter


@dataclass(frozen=True, slots=True)
class SpreadTable(Spread):
    """Distribution of one parameter, as a table of a study has it: numbers with units, or in percent."""

    parameter: Annotated[str, BeforeValidator(_known), Field(description='write parameter = "stage2.clearance"')]
    sd: Annotated[float | None, _quantity(relative=True)] = None
    low: Annotated[float | None, _quantity(relative=False)] = None
    high: Annotated[float | None, _quantity(relative=False)] = None
    mean: Annotated[float | None, _quantity(relative=False)] = None


def _band(value: object, info: ValidationInfo[Surroundings]) -> object:
    parameter = info.data.get("parameter")
    if not isinstance(value, list) or not isinstance(parameter, str):
        return value
    return [_read(each, info, parameter, relative=False) for each in value]


def _parts(value: object, info: ValidationInfo[Surroundings]) -> object:
    if value is None:
        return None
    if not isinstance(value, str):
        raise ValueError(f'is {value!r}; write the name of a CSV file, as in parts = "clutches.csv"')
    if info.context.read is None:
        return None
    try:
        file = info.context.read(value)
    except ValueError as error:
        raise ValueError(f"names {value!r}, {error}") from None
    found = parts_in(file.content, file.name)
    if info.context.system:
        for name in found.names:
            info.context.system.structure.place(name)
    return found


@dataclass(frozen=True)
class ToleranceStudy(ToleranceOptions, RangeStudy):
    """Tolerances: where the special points of a response lie when parameters vary from part to part.

    Parameters
    ----------
    parameter, begin, end
        The parameter of the response, and its range.
    samples, seed, check, period, walk, workers, accuracy
        Options; as `gapwalk.ask.ToleranceOptions`.

    Examples
    --------
    >>> spreads = gw.analysis.Spreads([gw.ask.Spread("stop.clearance", sd=0.02)])
    >>> asked = gw.studies.ToleranceStudy(parameter="frequency", begin=1.6, end=1.0, samples=8, spreads=spreads)
    >>> asked.plan
    'tolerance of special points over frequency from 1.6 to 1: 8 samples of stop.clearance'
    """

    kind: ClassVar[str] = "tolerance"
    table_types: ClassVar[Mapping[str, Any]] = {
        "spreads": None,
        "band": (Annotated[list[float] | None, BeforeValidator(_band), Field(min_length=2, max_length=2)], None),
        "spread": (
            Annotated[list[key_type(SpreadTable)] | None, Field(description="write tables [[study.spread]]")],
            None,
        ),
        "correlation": (list[list[float]] | None, None),
        "parts": (Annotated[Any, BeforeValidator(_parts)], None),
    }

    #: Distribution of the parameters. In a table they are tables ``[[study.spread]]``, with ``correlation`` between
    #: them; or ``parts`` names a CSV file of measured parts.
    spreads: Spreads = field(kw_only=True)
    band: tuple[float, float] | None = None  #: A band of the parameter in which no jump should lie.
    start: StartOrState = Start.SETTLE  #: Start of the search for the first orbit of the nominal branch.

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.band is not None and not self.band[0] < self.band[1]:
            raise ModelError(f"band is from {self.band[0]:g} to {self.band[1]:g}; write the lower end first")

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        rest = dict(values)
        laws, matrix, parts = (rest.pop(key, None) for key in ("spread", "correlation", "parts"))
        if not laws and parts is None:
            raise ModelError('spread is missing; write tables [[study.spread]], or parts = "clutches.csv"')
        if parts is not None and (laws or matrix):
            raise ModelError("parts has the spread of all parameters; leave out spread and correlation")
        spreads = parts or Spreads(
            tuple(Spread(each.parameter, each.law, each.sd, each.low, each.high, each.mean) for each in laws),
            tuple(map(tuple, matrix or ())),
        )
        band = rest.pop("band", None)
        return super().of_table({**rest, "spreads": spreads, "band": band and tuple(band)}, system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        names = self.spreads.varied
        return f"tolerance of special points over {self.range_words}: {self.samples:,} samples of {', '.join(names)}"

    def work(self, system: System) -> ToleranceWork:
        """Return the work on the samples."""
        return ToleranceWork(system, self)


@shows_progress(lambda count, part, pace: str(pace))
def tolerance(
    system: System,
    parameter: str,
    to: tuple[float, float],
    spreads: Spreads | Sequence[Spread],
    *,
    band: tuple[float, float] | None = None,
    start: str | Sequence[float] = "settle",
    options: ToleranceOptions | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Tolerance:
    """Find the distribution of the special points of a response when parameters vary from part to part.

    The nominal branch is walked once. In each sample its special points are predicted and corrected by Newton's
    method; where one is lost, the branch of the sample is walked. Some tracked samples are walked for comparison.

    Parameters
    ----------
    system
        The nominal system.
    parameter, to
        Parameter of the response, and the values between which it is walked, from the first to the second.
    spreads
        Distribution of the parameters that vary: a law for each, or measured parts.
    band
        A band of the parameter in which no jump should lie.
    start
        Start of the search for the first orbit, as in `find_orbit`.
    options
        Options of the study.
    workers
        Number of local processes, or workers that were started before; by default as the options say. The result does
        not depend on them.
    report
        Called with each part of the work once it is done and written to the file.
    output
        A file to write while the work is done; `gapwalk.load` reads it, and a stopped study continues.

    Returns
    -------
    Tolerance
        The distribution of each special point.

    Raises
    ------
    ModelError
        For unknown parameters, or laws that make no sense.
    NumericalError
        If the nominal branch cannot be walked, or has no special points.
    Interrupted
        After Ctrl-C; its `found` is the record so far.

    Examples
    --------
    >>> spread = gw.ask.Spread("stop.clearance", sd=0.02)
    >>> options = gw.ask.ToleranceOptions(samples=8, check=1)
    >>> found = gw.ask.tolerance(system, "frequency", (1.6, 1.0), [spread], band=(1.35, 1.4), options=options)
    >>> found.chance(1.35, 1.4).value  # a jump lies in the band in all samples
    1.0
    """
    check_system(system, "tolerance")
    options = options or ToleranceOptions()
    joint = spreads if isinstance(spreads, Spreads) else Spreads(tuple(spreads))
    begin = start if isinstance(start, str) else tuple(float(each) for each in start)
    first, last = map(float, to)
    asked = ToleranceStudy(
        parameter,
        first,
        last,
        **values_of(options),
        spreads=joint,
        band=band,
        start=Start(begin) if isinstance(begin, str) else begin,
    )
    found = call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
    assert found is not None
    return found
