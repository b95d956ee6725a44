"""The study of tolerances: where special points lie when parameters vary from part to part, and what matters most."""

from __future__ import annotations

import uuid
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo

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
from gapwalk.answers.point_prediction import Regressions, Watch, watches_of
from gapwalk.answers.tolerance import (
    Further,
    HowFound,
    Spread,
    Spreads,
    Tolerance,
    ToleranceCheck,
    ToleranceChunk,
    ToleranceWalks,
    Tracking,
    parts_in,
    trackable,
)
from gapwalk.answers.tolerance_tracking import Tracker, solve_chunk, track_chunk, walk_chunk, walk_sample
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit_equation import MAX_PERIOD
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import plain_rows
from gapwalk.results.result_file import Part
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_kind import Found, Job
from gapwalk.studies.study_schema import Start, StartOrState, Surroundings, key_type

if TYPE_CHECKING:
    from typing import Self


# Work on tolerances: the nominal branch, walks of some samples, then the special points of all others by chunks.

Array = NDArray[np.float64]

_LEAST, _MOST, _SHARE = 40, 150, 8  # samples that are walked first: fewest and most, and one of so many samples
_ROUND, _UNSEEN = 20, 0.05  # more of them, as long as so many samples have points as no walk has shown
_CORRECTED, _SOLVED = 100, 400  # most samples that are solved for fits: by Newton's method alone, then also by chords
_FEW, _SOME, _CHUNK = 1, 10, 25  # samples in a chunk of walks, of solutions, and of the rest: a task may hold several

NOMINAL = Part("nominal", Branch)
WALKS = Part("walks", ToleranceWalks, numbered=True)
SOLUTIONS = Part("solutions", Solutions, numbered=True)
PATTERNS = Part("patterns", Solutions, numbered=True)
CHUNK = Part("samples", ToleranceChunk, numbered=True)


MAX_SAMPLES = 10_000_000
"""Largest number of samples of a study."""
LEAST_ACCURACY, MOST_ACCURACY = 1e-8, 1e-2
"""Smallest and largest error of a value, as a share of it, that can be asked for."""


def read_number(value: object, info: ValidationInfo[Surroundings], parameter: object, *, relative: bool) -> object:
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
        return value if value is None or parameter is None else read_number(value, info, parameter, relative=relative)

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
    return [read_number(each, info, parameter, relative=False) for each in value]


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


SPREADS = (
    Spreads | Sequence[Spread],
    MISSING,
    "Distribution of the parameters that vary: a law for each, or measured parts.",
)
"""Argument of a function: the distribution of the parameters."""

SPREAD_KEYS: Mapping[str, Any] = {
    "spreads": None,
    "spread": (Annotated[list[key_type(SpreadTable)] | None, Field(description="write tables [[study.spread]]")], None),
    "correlation": (list[list[float]] | None, None),
    "parts": (Annotated[Any, BeforeValidator(_parts)], None),
}
"""The keys of the distribution of parameters."""


def with_spreads(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a table with the distribution that its keys give."""
    rest = dict(values)
    laws, matrix, parts = (rest.pop(key, None) for key in ("spread", "correlation", "parts"))
    if not laws and parts is None:
        raise ModelError('spread is missing; write tables [[study.spread]], or parts = "clutches.csv"')
    if parts is not None and (laws or matrix):
        raise ModelError("parts has the spread of all parameters; leave out spread and correlation")
    found = parts or Spreads(
        tuple(Spread(each.parameter, each.law, each.sd, each.low, each.high, each.mean) for each in laws),
        tuple(map(tuple, matrix or ())),
    )
    return {**rest, "spreads": found}


def spreads_of_call(spreads: Spreads | Sequence[Spread]) -> Spreads:
    """Return the distribution of a call."""
    return spreads if isinstance(spreads, Spreads) else Spreads(tuple(spreads))


def check_spreads(spreads: Spreads, system: System, parameter: str, what: str) -> None:
    """Refuse laws of parameters that are none of the system, that have two names, or one with values of its own."""
    varied = spreads.about(system).varied
    places = [system.structure.place(name) for name in varied]
    if system.structure.place(parameter) in places:
        raise ModelError(f"{parameter} is the parameter of {what}; it cannot have a spread as well")
    if len(set(places)) < len(places):
        raise ModelError("spread has two names of one parameter; write one law for each parameter")


@dataclass(frozen=True)
class ToleranceStudy(RangeStudy):
    """Tolerances: where the special points of a response lie when parameters vary from part to part.

    The nominal branch is walked once. In each sample its special points are predicted and corrected by Newton's
    method; where one is lost, the branch of the sample is walked. Some tracked samples are walked for comparison.

    Raises
    ------
    ModelError
        For unknown parameters, or laws that make no sense.
    NumericalError
        If the nominal branch cannot be walked, or has no special points.

    Examples
    --------
    >>> spread, band = gw.ask.Spread("stop.clearance", sd=0.02), (1.35, 1.4)
    >>> found = gw.ask.tolerance(system, "frequency", (1.6, 1.0), [spread], band=band, samples=8, check=1)
    >>> found.chance(1.35, 1.4).value  # a jump lies in the band in all samples
    1.0
    """

    kind: ClassVar[str] = "tolerance"
    stored: ClassVar[tuple[Part, ...]] = (NOMINAL, WALKS, SOLUTIONS, PATTERNS, CHUNK)
    answer: ClassVar[Part | None] = Part("tolerance", Tolerance)
    always_counts: ClassVar[bool] = True
    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to", "spreads")
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {"spreads": SPREADS}
    table_types: ClassVar[Mapping[str, Any]] = {
        "band": (Annotated[list[float] | None, BeforeValidator(_band), Field(min_length=2, max_length=2)], None),
        **SPREAD_KEYS,
    }

    #: Distribution of the parameters: `gapwalk.ask.Spread`, or measured parts. In a table they are tables
    #: ``[[study.spread]]``, with ``correlation`` between them; or ``parts`` names a CSV file of measured parts.
    spreads: Spreads = field(kw_only=True)
    band: tuple[float, float] | None = None  #: A band of the parameter in which no jump should lie.
    start: StartOrState = Start.SETTLE  #: Start of the search for the first orbit of the nominal branch.
    samples: Annotated[int, Ge(2), Le(MAX_SAMPLES)] = 1000  #: Number of samples.
    seed: Natural = 0  #: Seed of their random numbers.
    check: Natural = 16  #: Tracked samples whose branches are walked for comparison.
    #: Number m of forcing periods after which the orbits of the branch repeat.
    period: Annotated[int, Ge(1), Le(MAX_PERIOD)] = 1
    walk: WalkOptions = field(default_factory=WalkOptions)  #: Options of the walks.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)
    #: Largest error of the value of a tracked point, as a share of it.
    accuracy: Annotated[float, Ge(LEAST_ACCURACY), Le(MOST_ACCURACY)] = 1e-5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.band is not None and not self.band[0] < self.band[1]:
            raise ModelError(f"band is from {self.band[0]:g} to {self.band[1]:g}; write the lower end first")

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        rest = with_spreads(values)
        band = rest.pop("band", None)
        return super().of_table({**rest, "band": band and tuple(band)}, system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        names = self.spreads.varied
        return f"tolerance of special points over {self.range_words}: {self.samples:,} samples of {', '.join(names)}"

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call."""
        return cls(**{**values, "spreads": spreads_of_call(values["spreads"])})

    def refuse_invalid(self, system: System) -> None:
        """Refuse laws of parameters that are none of the system, or that have none."""
        super().refuse_invalid(system)
        check_spreads(self.spreads, system.at({self.parameter: self.begin}), self.parameter, "the response")

    def work(self, system: System) -> Job:
        """Return the work on the samples."""
        self.refuse_invalid(system)
        return Job(self.first_system(system), self)

    def _samples(self, job: Job) -> _Samples:
        return job.cached("samples", lambda: _Samples(job))

    def do(self, job: Job) -> Generator[Found]:
        """Walk the nominal branch and the first samples, solve some more, track all others, and check some by walks."""
        return self._samples(job).do()

    def done(self, job: Job) -> int:
        """Return the number of chunks of samples that are done."""
        return sum(len(job.known[part]) for part in self.stored if part.numbered)

    def total(self, job: Job) -> int:
        """Return the number of chunks of samples, as far as it is known."""
        return self._samples(job).chunks

    def so_far(self, job: Job) -> Tolerance | None:
        """Return the tolerances so far; None before the first samples."""
        samples = self._samples(job)
        return samples.tolerance(complete=False, check=ToleranceCheck()) if job.known[WALKS] else None

    def document(self, found: Tolerance, points: bool) -> dict[str, Any]:
        """Return the distributions as JSON values; with all samples if wanted."""
        document: dict[str, Any] = {}
        tables = found.tables()
        for name in ("points", "indices", *(["samples"] if points else [])):
            document[name] = plain_rows(tables[name]())
        if found.band is not None and found.known.any():
            chance = found.chance(*found.band)
            document["band"] = {"from": found.band[0], "to": found.band[1], "jump": chance._asdict()}
        return document


class _Samples:
    """The samples of a job: which are walked, solved and tracked, and what is known of them."""

    def __init__(self, job: Job) -> None:
        self.job, self.system = job, job.system
        self.asked: ToleranceStudy = job.asked
        self.spreads = self.asked.spreads.about(job.system)
        self.design = self.spreads.design(self.asked.samples, self.asked.seed)
        self._key = uuid.uuid4().hex

    @property
    def _walks(self) -> dict[int, ToleranceWalks]:
        return self.job.known[WALKS]

    @property
    def _branch(self) -> Branch | None:
        return self.job.one(NOMINAL)

    def do(self) -> Generator[Found]:
        """Do the remaining work."""
        asked, job = self.asked, self.job
        yield from job.once(NOMINAL, self._nominal)
        tracking = self._tracking(job.one(NOMINAL))
        if not tracking.specials:
            raise NumericalError(
                f"the branch over {asked.range_words} has no special points that can be tracked; choose another range"
            )
        while self._left(self._walk_starts, self._walks):
            yield from job.each(WALKS, partial(walk_chunk, tracking), self._pieces(self._walk_starts))
        corrected, solved = self._limits
        for name, known, until in (("first", 0, corrected), ("second", corrected, solved)):
            tracking = self._learned(tracking, name, known)
            pieces = {
                number: (*piece, name == "first")
                for number, piece in self._pieces(self._solve_starts).items()
                if piece[1][-1] < until
            }
            yield from job.each(SOLUTIONS, partial(solve_chunk, tracking), pieces)
        tracking = self._learned(tracking, "fitted", solved)
        pieces = {number: (*piece, False) for number, piece in self._pieces(self._set_starts).items()}
        yield from job.each(PATTERNS, partial(solve_chunk, tracking), pieces)
        patterns = self._patterns(tracking)
        watches = self._watches(tracking, patterns)
        tracking = replace(tracking, key=f"{self._key} last", patterns=patterns, watches=watches)
        yield from job.each(CHUNK, partial(track_chunk, tracking), self._pieces(self._starts))
        yield job.end(self.tolerance(complete=True, check=self._checked(job.workers, tracking)))

    def _nominal(self) -> Branch:
        """Walk the nominal branch."""
        asked = self.asked
        return follow(find_orbit(self.system, asked.period, asked.start), asked.parameter, asked.end, walk=asked.walk)

    @property
    def chunks(self) -> int:
        """Number of chunks of samples, as far as it is known."""
        every = self._walk_starts, self._solve_starts, self._set_starts, self._starts
        return sum(len(starts) - 1 for starts in every)

    def _tracking(self, branch: Branch) -> Tracking:
        asked = self.asked
        specials, _ = trackable(branch, self.spreads.varied)
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
        """Number of samples that are walked first, as far as the walks so far tell."""
        # They go on while too many samples have points as no walk has shown: about the share of walks that are like no
        # other one (Good, The population frequencies of species and the estimation of population parameters, 1953).
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

    def _left(self, starts: list[int], known: Mapping[int, Any]) -> bool:
        return any(number not in known for number in range(len(starts) - 1))

    def _pieces(self, starts: list[int]) -> dict[int, tuple[int, NDArray[np.intp], Array]]:
        """Return number, samples and values of the pieces, by their number."""
        ranges = enumerate(np.arange(a, b, dtype=np.intp) for a, b in pairwise(starts))
        return {number: (number, rows, self.design.values[rows]) for number, rows in ranges}

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
        chunks = [each for _, each in sorted(self.job.known[SOLUTIONS].items()) if each.rows[-1] < known]
        pools = pools_of(forms, [names_of(each, anchors) for each in walks], walks, chunks)
        rows = np.concatenate([[each.sample for each in walks], *(each.rows for each in chunks)]).astype(np.intp)
        scaled = tracker.nominal[0].origin, tracking.deviations
        made = with_predictors(forms, Tracker(asked).finder.points, pools, self.design.values, rows, scaled)
        return replace(asked, forms=made)

    def _patterns(self, tracking: Tracking) -> Patterns:
        """Compare the forms found in walked samples with what the walks met."""
        anchors, sets = self._anchors, self.job.known[PATTERNS].values()
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
        for chunk in self.job.known[CHUNK].values():
            values[chunk.rows], errors[chunk.rows], how[chunk.rows] = chunk.values, chunk.errors, chunk.how
            further += chunk.further
        return values, errors, how, tuple(sorted(further, key=lambda each: (each.sample, each.kind, each.value)))

    def tolerance(self, *, complete: bool, check: ToleranceCheck) -> Tolerance:
        """Return the tolerances so far."""
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
