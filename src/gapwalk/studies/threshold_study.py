"""The study of a threshold: the value of a parameter beyond which gaps do not rattle over a whole range of another."""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from gapwalk.answers.gap_states import chosen_gaps
from gapwalk.answers.threshold import Request, Round, Threshold, ThresholdOptions, ThresholdSearch
from gapwalk.errors import ModelError
from gapwalk.model.system import System, check_system
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.options import ParameterRange, RangeStudy, is_another
from gapwalk.studies.rattle_study import GAPS
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import AnswerFinding, AnswerWork, Found, plain_numbers
from gapwalk.studies.study_registry import INLINE, OPEN

Over = Annotated[
    ParameterRange,
    Field(
        description='write the range that is to be quiet, as in over = { parameter = "speed", from = 700, to = 1100 }'
    ),
    AfterValidator(is_another),
]


@dataclass(frozen=True)
class ThresholdStudy(RangeStudy):
    """The value of a parameter beyond which gaps do not rattle over a whole range of another parameter."""

    kind: ClassVar[str] = "threshold"
    table_types: ClassVar[Mapping[str, Any]] = {"gaps": GAPS}

    over: Over = field(kw_only=True)  #: The other parameter, and the range in which nothing may rattle.
    #: Names of contacts with a gap; one may be written without a list. By default all gaps, or, in a drive train, those
    #: of links that can part.
    gaps: Annotated[tuple[str, ...], OPEN] = ()
    #: Number of motions that are tried; as `gapwalk.ask.ThresholdOptions`. In a table, its keys are among the others.
    options: Annotated[ThresholdOptions, INLINE] = field(default_factory=ThresholdOptions)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> ThresholdStudy:
        """Return the study of a table; its gaps are the usual ones if the table says nothing else."""
        return super().of_table({**values, "gaps": chosen_gaps(system, values.get("gaps") or ())}, system)

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

    def work(self, system: System) -> ThresholdWork:
        """Return the work on the threshold."""
        return ThresholdWork(system, self)


ROUND = Part("round", Round, numbered=True)
THRESHOLD = Part("threshold", Threshold)


@dataclass(frozen=True)
class ThresholdFinding(AnswerFinding[Threshold]):
    """Finding of the search for a threshold."""

    def document_of(self, found: Threshold, points: bool) -> dict[str, Any]:
        """Return the threshold as JSON values; with the points of its loci if wanted."""
        limit, confirmed = found.limit, found.confirmation
        document: dict[str, Any] = {
            "answer": found.sentence,
            "parameter": found.parameter,
            "value": plain_numbers([found.value])[0],
            "uncertainty": plain_numbers([found.uncertainty])[0],
            "over": {"parameter": found.over, "from": found.low, "to": found.high},
            "limit": None if limit is None else {"kind": str(limit.kind), "at": found.at, "contact": limit.contact},
            "confirmed": None if confirmed is None else confirmed._asdict(),
        }
        if points:
            document["loci"] = [{"kind": str(locus.kind), "values": locus.values.tolist()} for locus in found.loci]
        return document


class ThresholdWork(AnswerWork[Threshold]):
    """The search for one threshold: its rounds, then the threshold."""

    found_as = ThresholdFinding

    def __init__(self, system: System, asked: ThresholdStudy) -> None:
        over = asked.over
        span = min(over.begin, over.end), max(over.begin, over.end)
        gaps = chosen_gaps(system, asked.gaps)
        to = asked.begin, asked.end
        self._search = ThresholdSearch(Request(system, gaps, asked.parameter, to, over.parameter, span, asked.options))

    def take(self, known: Parts) -> None:
        """Read the threshold of a file, or the rounds of the search if it is incomplete."""
        self.whole = known.get(THRESHOLD)
        if self.whole is None:
            self._search.rounds = [each for _, each in known.all(ROUND)]

    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the remaining rounds; then give the threshold."""
        search = self._search
        while not search.is_over:
            latest = search.advance()
            yield Found.part(ROUND, latest, len(search.rounds) - 1)
        self.whole = search.found()
        yield Found.part(THRESHOLD, self.whole)

    @property
    def before(self) -> int:
        """Number of parts that are done, without the record."""
        return len(self._search.rounds)

    @property
    def total(self) -> int:
        """Number of parts: most searches need two rounds."""
        return max(2, len(self._search.rounds) + (not self._search.is_over)) + 1


def threshold(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: str,
    span: tuple[float, float],
    gaps: str | Sequence[str] = (),
    *,
    options: ThresholdOptions | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Threshold:
    """Find the value of a parameter beyond which gaps do not rattle over a whole range of another parameter.

    Grazing points and folds at which rattle begins or ceases are followed in both parameters, exactly, to the extremum.
    Then many motions from random starts are tried just beyond it; the border of one that rattles is followed too.

    Parameters
    ----------
    system
        The system.
    parameter, to
        The parameter and its range, from a value at which a gap rattles somewhere to one at which all are quiet.
    over, span
        The other parameter and its range, in which nothing may rattle: such as the speed.
    gaps
        Names of contacts with a gap; by default all, or, in a drive train, those of links that can part.
    options
        Number of motions that are tried.
    report
        Called with each round of the search, and with the threshold, once it is written to the file.
    output
        A file to write while the work is done; `gapwalk.open_result` reads it, and a stopped search continues.

    Returns
    -------
    threshold : Threshold
        Its `limit` is None if nothing rattles in the range, or something all over it; ``notes`` say which.

    Raises
    ------
    ModelError
        For unknown parameters or contacts, or an empty range.
    Interrupted
        After Ctrl-C.

    Examples
    --------
    >>> options = gw.ask.ThresholdOptions(values=4, starts=2)
    >>> found = gw.ask.threshold(system, "harmonic1.amplitude", (0.5, 0.05), "frequency", (0.9, 1.1), options=options)
    >>> round(found.value, 6), round(found.at, 6)  # where the linear response just reaches the stop
    (0.099875, 0.997497)
    """
    check_system(system, "threshold")
    if to[0] == to[1] or span[0] == span[1]:
        raise ModelError(f"the ranges are {to!r} and {span!r}; the two values of each must differ")
    if system.structure.place(parameter) == system.structure.place(over):
        raise ModelError(f"both parameters are {parameter!r}; write two different ones")
    asked = ThresholdStudy(
        parameter,
        float(to[0]),
        float(to[1]),
        over=ParameterRange(over, float(span[0]), float(span[1])),
        gaps=chosen_gaps(system, gaps),
        options=options or ThresholdOptions(),
    )
    found = call(asked, asked.work(system), asked.first_system(system), report=report, output=output).record
    assert found is not None
    return found
