"""The study of a threshold: the value of a parameter beyond which gaps do not rattle over a whole range of another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from gapwalk.answers.gap_states import chosen_gaps
from gapwalk.answers.lane_threshold import LaneThresholdSearch
from gapwalk.answers.threshold import Request, Round, Steps, Threshold, ThresholdOptions, ThresholdSearch, Tried
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Counted
from gapwalk.model.system import System
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.options import ParameterRange, RangeStudy, is_another
from gapwalk.studies.rattle_study import GAPS
from gapwalk.studies.study_kind import INLINE, OPEN, Found, Job

Over = Annotated[
    ParameterRange,
    Field(
        description='write the range that is to be quiet, as in over = { parameter = "speed", from = 700, to = 1100 }'
    ),
    AfterValidator(is_another),
]
ROUND = Part("round", Round, numbered=True)
TRIED = Part("tried", Tried, numbered=True)
_MOST = 1_000_000  # pieces of a round


@dataclass(frozen=True)
class ThresholdStudy(RangeStudy):
    """The value of a parameter beyond which gaps do not rattle over a whole range of another parameter.

    Grazing points and folds at which rattle begins or ceases are followed in both parameters, exactly, to the extremum.
    Then motions from random starts are computed just beyond it. If one rattles, the border of its rattle is followed
    too. The range goes from a value at which a gap rattles somewhere to one at which all are quiet.

    Raises
    ------
    ModelError
        For unknown parameters or contacts, or an empty range.

    Examples
    --------
    >>> quiet = {"frequency": (0.9, 1.1)}
    >>> found = gw.ask.threshold(system, "harmonic1.amplitude", (0.5, 0.05), quiet, values=4, starts=2)
    >>> round(found.value, 6), round(found.at, 6)  # where the linear response just reaches the stop
    (0.099875, 0.997497)
    """

    kind: ClassVar[str] = "threshold"
    stored: ClassVar[tuple[Part, ...]] = (TRIED, ROUND)
    answer: ClassVar[Part | None] = Part("threshold", Threshold)
    arguments: ClassVar[tuple[str, ...]] = ("parameter", "to", "over", "gaps")
    table_types: ClassVar[Mapping[str, Any]] = {"gaps": GAPS}

    over: Over = field(kw_only=True)  #: The other parameter, and the range in which nothing may rattle.
    #: Names of contacts with a gap; one may be written without a list. By default all gaps, or, in a drive train, those
    #: of links that can part.
    gaps: Annotated[tuple[str, ...], OPEN] = ()
    #: Number of motions that are tried; as `gapwalk.ask.ThresholdOptions`. In a table, its keys are among the others.
    options: Annotated[ThresholdOptions, INLINE] = field(default_factory=ThresholdOptions)
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> ThresholdStudy:
        """Return the study of a table; its gaps are the usual ones if the table says nothing else."""
        return super().of_table({**values, "gaps": chosen_gaps(system, values.get("gaps") or ())}, system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> ThresholdStudy:
        """Return the study of a call, if its parameters are two different ones."""
        one, two = values["parameter"], values["over"].parameter
        if system.structure.place(one) == system.structure.place(two):
            raise ModelError(f"both parameters are {one!r}; write two different ones")
        return cls.of_table(values, system)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        verb = "ceases" if len(self.gaps) == 1 else "cease"
        return (
            f"threshold of {self.range_words} at which {', '.join(self.gaps)} {verb} to rattle over {self.over.words}"
        )

    def first_system(self, system: System) -> System:
        """Return the system at the first value of both parameters."""
        return super().first_system(system).at({self.over.parameter: self.over.begin})

    def refuse_invalid(self, system: System) -> None:
        """Refuse a search that is not possible."""
        self._search(system, [])

    def _search(self, system: System, rounds: list[Round]) -> ThresholdSearch:
        gaps, to = chosen_gaps(system, self.gaps), (self.begin, self.end)
        kind = LaneThresholdSearch if prefers_lanes(system) else ThresholdSearch
        search = kind(Request(system, gaps, self.parameter, to, self.over.parameter, self.over.ends, self.options))
        search.rounds = rounds
        return search

    def do(self, job: Job) -> Generator[Found]:
        """Do the rounds of the search; then give the threshold."""
        search = self._search(job.system, job.all(ROUND))
        while not search.is_over:
            numbers = count(_MOST * len(search.rounds))

            def each(compute: Callable[[Any], Tried], pieces: Sequence[Any], numbers: count[int] = numbers) -> Steps:
                own = {number: piece for piece, number in zip(pieces, numbers, strict=False)}
                yield from job.each(TRIED, compute, own)
                return [job.known[TRIED][number] for number in own]

            yield from search.advance(each)
            yield job.keep(ROUND, search.rounds[-1], len(search.rounds) - 1)
        yield job.end(search.found())

    def so_far(self, job: Job) -> Threshold | None:
        """Return where the motions that were tried rattle; None before the first."""
        motions = [motion for tried in job.all(TRIED) for motion in tried.motions]
        return self._search(job.system, job.all(ROUND)).so_far(motions) if motions else None

    def total(self, job: Job) -> int:
        """Return the number of parts, as most searches have."""
        search, tried = self._search(job.system, job.all(ROUND)), Counter(each // _MOST for each in job.known[TRIED])
        rounds, (usual, pieces) = len(search.rounds), search.usual
        left = 0 if search.is_over else max(usual - rounds, 1)
        return self.done(job) + left * (max([pieces, *tried.values()]) + 1) - tried[rounds] + 1

    def document(self, found: Threshold, points: bool) -> dict[str, Any]:
        """Return the threshold as JSON values; with the points of its loci if wanted."""
        limit, confirmed = found.limit, found.confirmation
        document: dict[str, Any] = {
            "answer": found.sentence,
            "parameter": found.parameter,
            "value": plain(found.value),
            "uncertainty": plain(found.uncertainty),
            "over": {"parameter": found.over, "from": found.low, "to": found.high},
            "limit": None if limit is None else {"kind": str(limit.kind), "at": found.at, "contact": limit.contact},
            "between": list(found.between),
            "confirmed": None if confirmed is None else confirmed._asdict(),
        }
        if points:
            document["loci"] = [{"kind": str(locus.kind), "values": locus.values.tolist()} for locus in found.loci]
        return document
