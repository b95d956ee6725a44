"""Work on tolerances: the nominal branch, walks of some samples, then the special points of all others by chunks."""

from __future__ import annotations

import uuid
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.near_misses import Watch, watches_of
from gapwalk.answers.point_forms import (
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
from gapwalk.answers.tolerance import Tolerance, ToleranceCheck
from gapwalk.answers.tolerance_records import (
    Further,
    HowFound,
    ToleranceChunk,
    ToleranceWalks,
    Tracking,
    trackable,
)
from gapwalk.answers.tolerance_tracking import Tracker, solve_chunk, track_chunk, walk_chunk, walk_sample
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.study_kind import AnswerFinding, Found, Work, plain_numbers

if TYPE_CHECKING:
    from gapwalk.studies.tolerance_study import ToleranceStudy

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
