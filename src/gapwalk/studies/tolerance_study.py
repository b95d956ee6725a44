"""The study of tolerances: where special points lie when parameters vary from part to part, and what matters most."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo

from gapwalk.answers.point_tracking import Fit
from gapwalk.answers.spread import Spread, Spreads, parts_in
from gapwalk.answers.tolerance import Tolerance, ToleranceCheck
from gapwalk.answers.tolerance_tracking import (
    Further,
    HowFound,
    Origin,
    ToleranceChunk,
    Tracker,
    Tracking,
    fitted,
    track_chunk,
    trackable,
    walk_sample,
)
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.step_size import WalkOptions
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import Finding, Found, Rows, Work, plain_numbers, values_of
from gapwalk.studies.study_registry import Counted, check_integers
from gapwalk.studies.tables import Start, StartOrState, Surroundings
from gapwalk.summary import SummaryParts, summarizes

if TYPE_CHECKING:
    from typing import Self

Array = NDArray[np.float64]

MAX_SAMPLES = 10_000_000
"""Largest number of samples of a study."""
_PILOT, _FIRST = 400, 25  # samples that are solved with predictions by gradients, and how many of them in a chunk
_CHUNK = 200  # samples in a later chunk
_DIFFERENT = 1e-5  # share of the range by which a tracked point may differ from a walk


@dataclass(frozen=True)
class ToleranceOptions:
    """Options of a study of tolerances.

    Parameters
    ----------
    samples
        Number of samples.
    seed
        Seed of their random numbers.
    check
        Tracked samples whose branches are walked for comparison.
    period
        m: the orbits of the branch repeat after m forcing periods.
    walk
        Options of the walks.
    workers
        Number of processes; by default one for each local core. The result does not depend on it.
    """

    samples: int = 1000
    seed: int = 0
    check: int = 16
    period: int = 1
    walk: WalkOptions = field(default_factory=WalkOptions)
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_integers(self, samples=2, seed=0, check=0, period=1)
        if self.samples > MAX_SAMPLES:
            raise ModelError(f"samples is {self.samples:,}; there may be {MAX_SAMPLES:,}")
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
    has_unit = system is not None and system.units is not None and isinstance(parameter, str)
    if has_unit and system.units.parameter(parameter) and (value != 0 or isinstance(value, str)):
        return system.units.read(parameter, value)
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
    """Distribution of one parameter, as a table of a study has it: numbers with units, or in percent.

    Parameters
    ----------
    parameter, law, sd, low, high, mean
        As in `gapwalk.Spread`. In percent, `sd` is that share of the value in the model, and `low`, `high` and `mean`
        are that far from it.
    """

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
    samples, seed, check, period, walk, workers
        Options; as `gapwalk.ToleranceOptions`.
    spreads
        Distribution of the parameters. In a table they are tables ``[[study.spread]]``, with ``correlation`` between
        them; or ``parts`` names a CSV file of measured parts.
    band
        A band of the parameter in which no jump should lie.
    start
        Start of the search for the first orbit of the nominal branch.
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

    spreads: Spreads = field(kw_only=True)
    band: tuple[float, float] | None = None
    start: StartOrState = Start.SETTLE

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


@dataclass(frozen=True, eq=False)
class Recovered:
    """What followed from the first samples: their lost points, predictors for the others, and further origins."""

    samples: tuple[int, ...]
    values: tuple[Array, ...]
    how: tuple[int, ...]
    further: tuple[Further, ...]
    fits: tuple[Fit | None, ...]
    origins: tuple[Origin, ...]


NOMINAL = Part("nominal", Branch)
CHUNK = Part("samples", ToleranceChunk, numbered=True)
RECOVERED = Part("recovered", Recovered)
TOLERANCE = Part("tolerance", Tolerance)


class ToleranceWork(Work):
    """The nominal branch, the first samples, what follows from them, all others, and a check by walks."""

    def __init__(self, system: System, asked: ToleranceStudy) -> None:
        self.system, self.asked = system.at({asked.parameter: asked.begin}), asked
        system.at({asked.parameter: asked.end})
        self.spreads = asked.spreads.about(self.system)
        places = [system.structure.place(name) for name in self.spreads.varied]
        if system.structure.place(asked.parameter) in places:
            raise ModelError(f"{asked.parameter} is the parameter of the response; it cannot have a spread as well")
        if len(set(places)) < len(places):
            raise ModelError("spread has two names of one parameter; write one law for each parameter")
        self.design = self.spreads.design(asked.samples, asked.seed)
        pilot = min(_PILOT, asked.samples)
        self._starts = [*range(0, pilot, _FIRST), *range(pilot, asked.samples, _CHUNK), asked.samples]
        self._pilots = sum(start < pilot for start in self._starts[:-1])
        self._branch: Branch | None = None
        self._chunks: dict[int, ToleranceChunk] = {}
        self._recovered: Recovered | None = None
        self._whole: Tolerance | None = None
        self._key = uuid.uuid4().hex
        self._failures: tuple[str, ...] = ()

    def take(self, known: Parts) -> None:
        """Read the record of a file, or its parts if it is incomplete."""
        self._whole = known.get(TOLERANCE)
        if self._whole is None:
            self._branch, self._recovered = known.get(NOMINAL), known.get(RECOVERED)
            self._chunks = dict(known.all(CHUNK))

    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the remaining work."""
        asked = self.asked
        if self._branch is None:
            first = find_orbit(self.system, asked.period, asked.start)
            self._branch = follow(first, asked.parameter, asked.end, walk=asked.walk)
            yield Found.part(NOMINAL, self._branch)
        tracking = self._tracking(self._branch)
        if not tracking.specials:
            raise NumericalError(
                f"the branch over {asked.range_words} has no special points that can be tracked; choose another range"
            )
        yield from self._track(workers, tracking, range(self._pilots), keeps=True)
        if self._recovered is None:
            self._recovered = self._recover(tracking)
            yield Found.part(RECOVERED, self._recovered)
        tracking = replace(
            tracking, key=f"{self._key} fitted", fits=self._recovered.fits, origins=self._recovered.origins
        )
        yield from self._track(workers, tracking, range(self._pilots, len(self._starts) - 1), keeps=False)
        check = self._checked(workers, tracking)
        self._whole = self._tolerance(complete=True, check=check)
        yield Found.part(TOLERANCE, self._whole)

    def last(self, *, finished: bool) -> list[Entry]:
        """Return nothing: all parts are written when they are done."""
        return []

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self._whole is not None

    @property
    def done(self) -> int:
        """Number of chunks of samples that are done."""
        return self.total if self.complete else len(self._chunks)

    @property
    def total(self) -> int:
        """Number of chunks of samples."""
        return len(self._starts) - 1

    @property
    def record(self) -> Tolerance | None:
        """The tolerances so far; None before the first samples."""
        return self._whole or (self._tolerance(complete=False, check=ToleranceCheck()) if self._chunks else None)

    def finding(self) -> ToleranceFinding:
        """Return the tolerances as the finding of a study."""
        return ToleranceFinding(self.record, self.done, self.total)

    def _tracking(self, branch: Branch) -> Tracking:
        asked = self.asked
        specials, self._failures = trackable(branch, self.spreads.varied)
        return Tracking(
            self._key,
            self.system,
            self.spreads.varied,
            branch.points[0].orbit,
            asked.parameter,
            asked.begin,
            asked.end,
            specials,
            asked.walk,
        )

    def _track(self, workers: Workers, tracking: Tracking, numbers: Iterable[int], *, keeps: bool) -> Generator[Found]:
        left = [number for number in numbers if number not in self._chunks]
        pieces = [(number, self._starts[number], self._of_chunk(number)) for number in left]
        for _, chunk in workers.each(partial(track_chunk, tracking, keeps), pieces, in_order=False):
            self._chunks[chunk.number] = chunk
            yield Found.part(CHUNK, chunk, chunk.number)

    def _of_chunk(self, number: int) -> Array:
        return self.design.values[self._starts[number] : self._starts[number + 1]]

    def _recover(self, tracking: Tracking) -> Recovered:
        """Walk the first samples that lost a point, one after the other: each may be an origin for the next."""
        chunks, tracker = [self._chunks[number] for number in range(self._pilots)], Tracker(tracking)
        samples = self.design.values[: self._starts[self._pilots]]
        fits = fitted(tracker, samples, chunks, np.maximum(self.design.values.std(axis=0), 1e-300))
        values, how = np.concatenate([each.values for each in chunks]), np.concatenate([each.how for each in chunks])
        lost = np.flatnonzero(how == HowFound.LOST).tolist()
        found, ways, further, origins = [], [], [], []
        for k in lost:
            row = values[k].copy()
            way, more, new = tracker.recover(samples[k], row)
            found.append(row)
            ways.append(int(way))
            further += [replace(each, sample=k) for each in more]
            origins += [origin for origin in new if tracker.add(origin)]
        return Recovered(tuple(lost), tuple(found), tuple(ways), tuple(further), fits, tuple(origins))

    def _checked(self, workers: Workers, tracking: Tracking) -> ToleranceCheck:
        values, how, _ = self._arrays()
        tracked = np.flatnonzero(how == HowFound.TRACKED)
        chosen = np.sort(np.random.default_rng(self.asked.seed).permutation(tracked)[: self.asked.check])
        pieces = [(self.design.values[k], values[k]) for k in chosen.tolist()]
        largest, different, more = 0.0, [], 0
        for index, found in workers.each(partial(walk_sample, tracking), pieces):
            where = f"sample {chosen[index] + 1}"
            if found is None:
                different.append(f"{where}: its branch could not be walked to its end")
            elif found[0] > _DIFFERENT * tracking.width:
                different.append(f"{where}: a tracked point is not on its branch (off by {found[0]:.2g})")
            else:
                largest = max(largest, found[0])
            more += bool(found and found[1])
        return ToleranceCheck(len(chosen), largest, tuple(different), more)

    def _arrays(self) -> tuple[Array, NDArray[np.intp], tuple[Further, ...]]:
        branch = self._branch
        assert branch is not None
        count = len(next(iter(self._chunks.values())).values[0])
        values, how = np.full((self.asked.samples, count), np.nan), np.full(self.asked.samples, int(HowFound.LOST))
        further: list[Further] = []
        for number, chunk in sorted(self._chunks.items()):
            rows = slice(self._starts[number], self._starts[number + 1])
            values[rows], how[rows] = chunk.values, chunk.how
            further += chunk.further
        if self._recovered is not None:
            for k, row, way in zip(self._recovered.samples, self._recovered.values, self._recovered.how, strict=True):
                values[k], how[k] = row, way
            further += self._recovered.further
        return values, how, tuple(sorted(further, key=lambda each: each.sample))

    def _tolerance(self, *, complete: bool, check: ToleranceCheck) -> Tolerance:
        assert self._branch is not None
        values, how, further = self._arrays()
        specials, failures = trackable(self._branch, self.spreads.varied)
        rows = np.arange(len(how)) if complete else np.flatnonzero(how != HowFound.LOST)
        notes = [] if complete else [f"stopped when {len(rows):,} of {len(how):,} samples were done"]
        if (end := self._branch.ends[-1]).reason is not EndReason.RANGE:
            notes.append(f"the nominal branch ends at {self.asked.parameter} = {end.value:.6g}: {end.reason_words}")
        if count := int(np.sum(how[rows] == HowFound.REFUSED)):
            notes.append(f"{count} samples are refused: the model does not allow their values")
        if count := int(np.sum(how[rows] == HowFound.FAILED)):
            failures = (*failures, f"in {count} samples a point was lost, and the walk of the branch failed too")
        renumbered = {int(k): number for number, k in enumerate(rows)}
        further = tuple(replace(each, sample=renumbered[each.sample]) for each in further if each.sample in renumbered)
        return Tolerance(
            self._branch,
            self.spreads,
            specials,
            self.design.values[rows],
            self.design.shares[rows],
            values[rows],
            how[rows],
            further,
            self.asked.band,
            check,
            complete,
            tuple(notes),
            failures,
        )


@dataclass(frozen=True)
class ToleranceFinding(Finding):
    """Finding of a study of tolerances, complete or not."""

    found: Tolerance | None
    done_chunks: int
    all_chunks: int

    @property
    def record(self) -> Tolerance | None:
        """The tolerances; None before the first samples."""
        return self.found

    @property
    def stored(self) -> str:
        """Describe how many chunks are stored."""
        return f"{self.done_chunks} of {self.all_chunks} chunks of samples are stored"

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the distribution of each point."""
        return () if self.found is None else self.found.summary()

    def document(self, points: bool) -> dict[str, Any]:
        """Return the distributions as JSON values; with all samples if wanted."""
        found = self.found
        document: dict[str, Any] = {"chunks": {"done": self.done_chunks, "total": self.all_chunks}}
        if found is None:
            return document
        tables = found.tables()
        for name in ("points", "indices", *(["samples"] if points else [])):
            heads, *rows = [list(row) for row in tables[name]()]
            document[name] = [dict(zip(map(str, heads), plain_numbers(row), strict=True)) for row in rows]
        if found.band is not None and found.known.any():
            chance = found.chance(*found.band)
            document["band"] = {"from": found.band[0], "to": found.band[1], "jump": chance._asdict()}
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of the record."""
        return {} if self.found is None else self.found.tables()


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
    >>> laws = gw.analysis.spread_in_percent(system, 2, ["stage2.clearance", "mean.q1"])
    >>> print(gw.tolerance(system, "frequency", (1.9, 0.6), laws, band=(0.60, 0.66)).summary())
    """
    check_system(system, "tolerance")
    options = options or ToleranceOptions()
    joint = spreads if isinstance(spreads, Spreads) else Spreads(tuple(spreads))
    begin = start if isinstance(start, str) else tuple(float(each) for each in start)
    asked = ToleranceStudy(
        parameter,
        *map(float, to),
        **values_of(options),
        spreads=joint,
        band=band,
        start=Start(begin) if isinstance(begin, str) else begin,
    )
    return call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
