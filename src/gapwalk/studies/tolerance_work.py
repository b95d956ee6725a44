"""Work on tolerances: the nominal branch, then its special points in all samples, chunk by chunk."""

from __future__ import annotations

import uuid
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_tracking import Fit
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
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.study_kind import AnswerFinding, Found, Work, plain_numbers

if TYPE_CHECKING:
    from gapwalk.studies.tolerance_study import ToleranceStudy

Array = NDArray[np.float64]

_PILOT, _FIRST = 400, 25  # samples that are solved with predictions by gradients, and how many of them in a chunk
_CHUNK = 200  # samples in a later chunk
_DIFFERENT = 1e-5  # share of the range by which a tracked point may differ from a walk


@dataclass(frozen=True, eq=False)
class Recovered:
    """Results of the first samples: their lost points, predictors for the others, and further origins."""

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
