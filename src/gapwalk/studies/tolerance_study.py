"""The study of tolerances: where special points lie when parameters vary from part to part, and what matters most."""

from __future__ import annotations

import os
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo

from gapwalk.answers.near_misses import Watch, watches_of
from gapwalk.answers.point_fit import (
    Patterns,
    Solutions,
    Walked,
    anchors_of,
    forms_of,
    names_of,
    pools_of,
    with_predictors,
)
from gapwalk.answers.point_prediction import Regressions
from gapwalk.answers.spread import Spread, Spreads, parts_in
from gapwalk.answers.tolerance import (
    Further,
    HowFound,
    Tolerance,
    ToleranceCheck,
    ToleranceChunk,
    ToleranceWalks,
    Tracking,
    trackable,
)
from gapwalk.answers.tolerance_tracking import Tracker, solve_chunk, track_chunk, walk_chunk, walk_sample
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import AnswerFinding, Found, Work, plain_numbers, values_of
from gapwalk.studies.study_registry import Counted, check_integers
from gapwalk.studies.tables import Start, StartOrState, Surroundings

if TYPE_CHECKING:
    from typing import Self


# Work on tolerances: the nominal branch, walks of some samples, then the special points of all others by chunks.

Array = NDArray[np.float64]

_LEAST, _MOST, _SHARE = 40, 150, 8  # samples that are walked first: fewest and most, and one of so many samples
_ROUND, _UNSEEN = 20, 0.05  # more of them, as long as so many samples have points as no walk has shown
_CORRECTED, _SOLVED = 100, 400  # most samples that are solved for fits: by Newton's method alone, then also by chords
_FEW, _SOME = 5, 20  # samples in a chunk of walks, and of solutions
_CHUNK = 200  # samples in a later chunk

NOMINAL = Part("nominal", Branch)
WALKS = Part("walks", ToleranceWalks, numbered=True)
SOLUTIONS = Part("solutions", Solutions, numbered=True)
PATTERNS = Part("patterns", Solutions, numbered=True)
CHUNK = Part("samples", ToleranceChunk, numbered=True)
TOLERANCE = Part("tolerance", Tolerance)


class ToleranceWork(Work):
    """The nominal branch, walks of the first samples, some more samples, all others, and a check by walks."""

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
        self._branch: Branch | None = None
        self._walks: dict[int, ToleranceWalks] = {}
        self._solutions: dict[int, Solutions] = {}
        self._sets: dict[int, Solutions] = {}
        self._chunks: dict[int, ToleranceChunk] = {}
        self._whole: Tolerance | None = None
        self._key = uuid.uuid4().hex
        self._failures: tuple[str, ...] = ()

    def take(self, known: Parts) -> None:
        """Read the record of a file, or its parts if it is incomplete."""
        self._whole = known.get(TOLERANCE)
        if self._whole is None:
            self._branch, self._walks = known.get(NOMINAL), dict(known.all(WALKS))
            self._solutions, self._sets = dict(known.all(SOLUTIONS)), dict(known.all(PATTERNS))
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
        while pieces := self._left(self._walk_starts, self._walks):
            yield from self._done(workers, partial(walk_chunk, tracking), pieces, self._walks, WALKS)
        corrected, solved = self._limits
        for name, known, until in (("first", 0, corrected), ("second", corrected, solved)):
            tracking = self._learned(tracking, name, known)
            left = [each for each in self._left(self._solve_starts, self._solutions) if each[1][-1] < until]
            pieces = [(*piece, name == "first") for piece in left]
            yield from self._done(workers, partial(solve_chunk, tracking), pieces, self._solutions, SOLUTIONS)
        tracking = self._learned(tracking, "fitted", solved)
        pieces = [(*piece, False) for piece in self._left(self._set_starts, self._sets)]
        yield from self._done(workers, partial(solve_chunk, tracking), pieces, self._sets, PATTERNS)
        patterns = self._patterns(tracking)
        watches = self._watches(tracking, patterns)
        tracking = replace(tracking, key=f"{self._key} last", patterns=patterns, watches=watches)
        pieces = self._left(self._starts, self._chunks)
        yield from self._done(workers, partial(track_chunk, tracking), pieces, self._chunks, CHUNK)
        check = self._checked(workers, tracking)
        self._whole = self._tolerance(complete=True, check=check)
        yield Found.part(TOLERANCE, self._whole)

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self._whole is not None

    @property
    def done(self) -> int:
        """Number of chunks of samples that are done."""
        every = self._walks, self._solutions, self._sets, self._chunks
        return self.total if self.complete else sum(map(len, every))

    @property
    def total(self) -> int:
        """Number of chunks of samples, as far as it is known."""
        every = self._walk_starts, self._solve_starts, self._set_starts, self._starts
        return sum(len(starts) - 1 for starts in every)

    @property
    def record(self) -> Tolerance | None:
        """The tolerances so far; None before the first samples."""
        return self._whole or (self._tolerance(complete=False, check=ToleranceCheck()) if self._walks else None)

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
            np.maximum(self.design.values.std(axis=0), 1e-300),
            asked.walk,
            asked.accuracy,
        )

    @property
    def _walked(self) -> int:
        """Number of samples that are walked first, as far as the walks so far tell.

        They go on while too many samples have points as no walk has shown: about the share of walks that are like no
        other one (Good, The population frequencies of species and the estimation of population parameters, 1953).
        """
        most = min(_MOST, -(-self.asked.samples // _SHARE))
        count = min(_LEAST, most)
        walks = self._ended
        while count < most and sum(len(each.walked) for each in self._walks.values()) >= count:
            every = Counter(tuple(met.key for met in each.met) for each in walks if each.sample < count)
            if sum(number == 1 for number in every.values()) <= _UNSEEN * count:
                break
            count = min(count + _ROUND, most)
        return count

    @property
    def _limits(self) -> tuple[int, int]:
        """Numbers of the first samples that are solved later than by Newton's method alone, and not at all."""
        walked = self._walked
        most = max(walked, self.asked.samples // 2)
        return min(walked + _CORRECTED, most), min(walked + _CORRECTED + _SOLVED, most)

    @property
    def _walk_starts(self) -> list[int]:
        return [*range(0, self._walked, _FEW), self._walked]

    @property
    def _solve_starts(self) -> list[int]:
        corrected, solved = self._limits
        return [*range(self._walked, corrected, _SOME), *range(corrected, solved, _SOME), solved]

    @property
    def _set_starts(self) -> list[int]:
        return [*range(0, self._walked, _SOME), self._walked]

    @property
    def _starts(self) -> list[int]:
        return [*range(self._walked, self.asked.samples, _CHUNK), self.asked.samples]

    def _left(self, starts: list[int], done: Mapping[int, Any]) -> list[tuple[int, NDArray[np.intp], Array]]:
        """Return number, samples and values of the pieces that are not done."""
        return [self._piece(k, np.arange(a, b)) for k, (a, b) in enumerate(pairwise(starts)) if k not in done]

    def _piece(self, number: int, rows: Sequence[int] | NDArray[np.intp]) -> tuple[int, NDArray[np.intp], Array]:
        return number, np.asarray(rows, dtype=np.intp), self.design.values[rows]

    @property
    def _ended(self) -> list[Walked]:
        """The walks that came to their end."""
        walks = [each for _, chunk in sorted(self._walks.items()) for each in chunk.walked]
        return [each for each in walks if each.how == HowFound.WALKED]

    @property
    def _anchors(self) -> list[int]:
        assert self._branch is not None
        return anchors_of(self._ended, len(trackable(self._branch, self.spreads.varied)[0]))

    def _learned(self, tracking: Tracking, name: str, known: int) -> Tracking:
        """Return the tracking with the forms of all points, and what walks and solutions of `known` samples say."""
        walks, tracker, anchors = self._ended, Tracker(replace(tracking, forms=())), self._anchors
        forms = forms_of(walks, anchors, tracking.specials, tracker.mine)
        asked = replace(tracking, key=f"{self._key} {name}", forms=forms)
        chunks = [each for _, each in sorted(self._solutions.items()) if each.rows[-1] < known]
        pools = pools_of(forms, [names_of(each, anchors) for each in walks], walks, chunks)
        rows = np.concatenate([[each.sample for each in walks], *(each.rows for each in chunks)]).astype(np.intp)
        scaled = tracker.nominal[0].origin, tracking.deviations
        made = with_predictors(forms, Tracker(asked).finder.points, pools, self.design.values, rows, scaled)
        return replace(asked, forms=made)

    def _patterns(self, tracking: Tracking) -> Patterns:
        """Compare the forms found in walked samples with what the walks met."""
        anchors, sets = self._anchors, self._sets.values()
        found = {row: own for each in sets for row, own in zip(each.rows.tolist(), each.found, strict=True)}
        return Patterns.of(tracking.forms, [(found[each.sample], names_of(each, anchors)) for each in self._ended])

    def _watches(self, tracking: Tracking, patterns: Patterns) -> tuple[Watch, ...]:
        """Return where walks nearly met further points."""
        anchors, fixed = self._anchors, {tracking.forms[f].name for f in patterns.anchors[1:]}
        found = []
        for each in self._ended:
            passed = np.cumsum([0, *(name in fixed for name in names_of(each, anchors))]).tolist()
            found.append((each.sample, [(passed[miss.place], miss) for miss in each.misses]))
        origin = np.array([self.system[name] for name in tracking.names])
        return watches_of(found, Regressions((self.design.values - origin) / tracking.deviations))

    def _done(
        self, workers: Workers, function: Callable[[Any], Any], pieces: list[Any], done: dict[int, Any], part: Part
    ) -> Generator[Found]:
        """Do pieces of work; each begins with its number."""
        for _, each in workers.each(function, pieces, in_order=False):
            done[each.number] = each
            yield Found.part(part, each, each.number)

    def _checked(self, workers: Workers, tracking: Tracking) -> ToleranceCheck:
        values, _, how, further = self._arrays()
        tracked = np.flatnonzero(np.isin(how, (HowFound.TRACKED, HowFound.PARTLY)))
        chosen = np.sort(np.random.default_rng(self.asked.seed).permutation(tracked)[: self.asked.check]).tolist()
        more = {k: tuple((each.kind, each.value) for each in further if each.sample == k) for k in chosen}
        pieces = [(self.design.values[k], values[k], more[k]) for k in chosen]
        largest, different = 0.0, []
        for index, found in workers.each(partial(walk_sample, tracking), pieces):
            where = f"sample {chosen[index] + 1}"
            if found is None:
                different.append(f"{where}: its branch could not be walked to its end")
                continue
            largest = max(largest, found.largest)
            texts = [f"the walk has {each}" for each in found.missed] + [
                f"no walk has {each}" for each in found.invented
            ]
            if texts:
                different.append(f"{where}: {', '.join(texts)}")
        return ToleranceCheck(len(chosen), largest, tuple(different))

    def _arrays(self) -> tuple[Array, Array, NDArray[np.intp], tuple[Further, ...]]:
        branch = self._branch
        assert branch is not None
        shape = self.asked.samples, len(trackable(branch, self.spreads.varied)[0])
        values, errors, how = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape[0], int(HowFound.LOST))
        further: list[Further] = []
        for walks in self._walks.values():
            for each in walks.walked:
                how[each.sample] = each.how
                for met in each.met:
                    if met.index >= 0:
                        values[each.sample, met.index], errors[each.sample, met.index] = met.value, met.uncertainty
                    else:
                        further.append(Further(each.sample, met.kind, met.value))
        for chunk in self._chunks.values():
            values[chunk.rows], errors[chunk.rows], how[chunk.rows] = chunk.values, chunk.errors, chunk.how
            further += chunk.further
        return values, errors, how, tuple(sorted(further, key=lambda each: (each.sample, each.kind, each.value)))

    def _tolerance(self, *, complete: bool, check: ToleranceCheck) -> Tolerance:
        assert self._branch is not None
        values, errors, how, further = self._arrays()
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
            errors[rows],
        )


@dataclass(frozen=True)
class ToleranceFinding(AnswerFinding[Tolerance]):
    """Finding of a study of tolerances, complete or not."""

    def document_of(self, found: Tolerance, points: bool) -> dict[str, Any]:
        """Return the distributions as JSON values; with all samples if wanted."""
        document: dict[str, Any] = {"parts": {"done": self.done, "total": self.total}}
        tables = found.tables()
        for name in ("points", "indices", *(["samples"] if points else [])):
            heads, *rows = [list(row) for row in tables[name]()]
            document[name] = [dict(zip(map(str, heads), plain_numbers(row), strict=True)) for row in rows]
        if found.band is not None and found.known.any():
            chance = found.chance(*found.band)
            document["band"] = {"from": found.band[0], "to": found.band[1], "jump": chance._asdict()}
        return document


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
        A file to write while the work is done; `gapwalk.open_result` reads it, and a stopped study continues.

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
