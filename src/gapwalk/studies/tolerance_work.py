"""Work on tolerances: the nominal branch, walks of some samples, then the special points of all others by chunks."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_forms import (
    Form,
    Patterns,
    Solutions,
    Walked,
    anchors_of,
    forms_of,
    names_of,
    pools_of,
    with_predictors,
)
from gapwalk.answers.tolerance import Tolerance, ToleranceCheck
from gapwalk.answers.tolerance_tracking import (
    Further,
    HowFound,
    ToleranceChunk,
    ToleranceWalks,
    Tracker,
    Tracking,
    solve_chunk,
    track_chunk,
    trackable,
    walk_chunk,
    walk_sample,
)
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

_WALKS, _SHARE = 150, 8  # most samples that are walked first, and one of so many samples
_SOLVED = 500  # most samples that are solved for fits, walked ones among them
_FEW, _SOME = 5, 25  # samples in a chunk of walks, and of solutions
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
        self._walked = min(_WALKS, -(-asked.samples // _SHARE))
        solved = min(_SOLVED, max(self._walked, asked.samples // 2))
        self._walk_starts = [*range(0, self._walked, _FEW), self._walked]
        self._solve_starts = [*range(0, solved, _SOME), solved]
        self._set_starts = [*range(0, self._walked, _SOME), self._walked]
        self._starts = [*range(self._walked, asked.samples, _CHUNK), asked.samples]
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
        values = self.design.values
        pieces = [(k, a, values[a:b]) for k, (a, b) in enumerate(pairwise(self._walk_starts))]
        yield from self._done(workers, partial(walk_chunk, tracking), pieces, self._walks, WALKS)
        tracking = self._learned(tracking, "first")
        pieces = [(k, values[a:b]) for k, (a, b) in enumerate(pairwise(self._solve_starts))]
        yield from self._done(workers, partial(solve_chunk, tracking), pieces, self._solutions, SOLUTIONS)
        tracking = self._learned(tracking, "fitted")
        pieces = [(k, values[a:b]) for k, (a, b) in enumerate(pairwise(self._set_starts))]
        yield from self._done(workers, partial(solve_chunk, tracking), pieces, self._sets, PATTERNS)
        tracking = replace(tracking, key=f"{self._key} last", patterns=self._patterns(tracking))
        pieces = [(k, a, values[a:b]) for k, (a, b) in enumerate(pairwise(self._starts))]
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
        return (
            self.total
            if self.complete
            else len(self._walks) + len(self._solutions) + len(self._sets) + len(self._chunks)
        )

    @property
    def total(self) -> int:
        """Number of chunks of samples."""
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
        )

    @property
    def _ended(self) -> list[Walked]:
        """Walks that came to their end."""
        walks = [each for _, every in sorted(self._walks.items()) for each in every.walked]
        return [each for each in walks if each.how == HowFound.WALKED]

    def _learned(self, tracking: Tracking, name: str) -> Tracking:
        """Return the tracking with the forms of all points, and what walks and solutions so far say of them."""
        walks, tracker = self._ended, Tracker(replace(tracking, forms=()))
        anchors = anchors_of(walks, len(tracking.specials))
        forms: tuple[Form, ...] = tracking.forms or forms_of(walks, tracking.specials, tracker.mine)
        asked = replace(tracking, key=f"{self._key} {name}", forms=forms)
        chunks = [(self._solve_starts[number], each) for number, each in sorted(self._solutions.items())]
        if not tracking.forms:
            chunks = []  # they are read from a file: these are still the predictions with which they were found
        pools = pools_of(forms, [names_of(each, anchors) for each in walks], walks, chunks)
        known = [first + k for first, each in chunks for k in range(len(each.found))] or [each.sample for each in walks]
        scaled = tracker.nominal[0].origin, tracking.deviations
        made = with_predictors(forms, Tracker(asked).points, pools, self.design.values, np.array(known), scaled)
        return replace(asked, forms=made)

    def _patterns(self, tracking: Tracking) -> Patterns:
        walks = self._ended
        anchors = anchors_of(walks, len(tracking.specials))
        names = [names_of(each, anchors) for each in walks]
        found = [each for _, every in sorted(self._sets.items()) for each in every.found]
        return Patterns.of(tracking.forms, [(found[each.sample], own) for each, own in zip(walks, names, strict=True)])

    def _done(
        self, workers: Workers, function: Callable[[Any], Any], pieces: list[Any], done: dict[int, Any], part: Part
    ) -> Generator[Found]:
        """Do the pieces that are not done yet; each begins with its number."""
        left = [piece for piece in pieces if piece[0] not in done]
        for _, each in workers.each(function, left, in_order=False):
            done[each.number] = each
            yield Found.part(part, each, each.number)

    def _checked(self, workers: Workers, tracking: Tracking) -> ToleranceCheck:
        values, how, further = self._arrays()
        tracked = np.flatnonzero(how == HowFound.TRACKED)
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

    def _arrays(self) -> tuple[Array, NDArray[np.intp], tuple[Further, ...]]:
        branch = self._branch
        assert branch is not None
        count = len(trackable(branch, self.spreads.varied)[0])
        values, how = np.full((self.asked.samples, count), np.nan), np.full(self.asked.samples, int(HowFound.LOST))
        further: list[Further] = []
        for walks in self._walks.values():
            for each in walks.walked:
                how[each.sample] = each.how
                for met in each.met:
                    if met.index >= 0:
                        values[each.sample, met.index] = met.value
                    else:
                        further.append(Further(each.sample, met.kind, met.value))
        for number, chunk in self._chunks.items():
            rows = slice(self._starts[number], self._starts[number + 1])
            values[rows], how[rows] = chunk.values, chunk.how
            further += chunk.further
        return values, how, tuple(sorted(further, key=lambda each: (each.sample, each.kind, each.value)))

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
