"""A claim: one statement of the paper, and the check that decides whether it holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum

from gapwalk.study.result import Result
from reproductions.padmanabhan_singh_1995.job import BranchJob, Job
from reproductions.padmanabhan_singh_1995.jobs import find_job
from reproductions.padmanabhan_singh_1995.reading import AS_PRINTED, LITERAL, Reading

BOTH = (LITERAL, AS_PRINTED)
"""The readings beside the default one."""


class Verdict(StrEnum):
    """What a check comes to."""

    REPRODUCED = "reproduced"
    OTHER_READING = "reproduced under another reading"
    NOT_REPRODUCED = "not reproduced"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the check of a claim has come to.

    Attributes
    ----------
    verdict
        Whether it holds.
    evidence
        The numbers that were found; for what is not reproduced, what was found instead and where the nearest motion
        is that does it.
    reading
        Under which other reading it holds; empty for the default one.
    """

    verdict: Verdict
    evidence: str
    reading: str = ""

    def __str__(self) -> str:
        return f"{self.verdict.value}{f' ({self.reading})' if self.reading else ''}"


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper.

    Parameters
    ----------
    name
        Begins with the number of its figure, such as ``13-loops``.
    says
        The statement, in our words.
    rests_on
        Keys of the jobs whose results the check needs.
    decide
        The check: takes their results, in this order.
    others
        Other readings of the paper that are checked beside the default one, which has the first word.
    short
        Whether motions of period 1 are enough for it: in other readings longer ones are then left out.
    """

    name: str
    says: str
    rests_on: tuple[str, ...]
    decide: Callable[..., Outcome]
    others: tuple[Reading, ...] = ()
    short: bool = False

    @property
    def figure(self) -> str:
        """The figure that it is about; ``summary`` for one that is about several."""
        return self.name.partition("-")[0]

    @property
    def jobs(self) -> tuple[str, ...]:
        """Keys of all jobs that are needed, in every reading."""
        return tuple(dict.fromkeys(key for reading in (None, *self.others) for key in self._keys(reading)))

    def check(self, results: Mapping[str, Result], failures: Mapping[str, str]) -> Outcome:
        """Whether it holds, from the results of its jobs; `failures` says why one has none."""
        usual = self._check(None, results, failures)
        told, holding = [usual.evidence], ""
        for reading in self.others:
            outcome = self._check(reading, results, failures)
            told.append(f"[{reading.differs}] {outcome.evidence}")
            if outcome.verdict is Verdict.REPRODUCED and not holding:
                holding = reading.differs
        evidence = "; ".join(told)
        if usual.verdict is Verdict.REPRODUCED or not holding:
            return Outcome(usual.verdict, evidence)
        return Outcome(Verdict.OTHER_READING, evidence, holding)

    def _keys(self, reading: Reading | None) -> list[str]:
        if reading is None:
            return list(self.rests_on)
        return [self._key_in(reading, find_job(key)) for key in self.rests_on]

    def _key_in(self, reading: Reading, job: Job) -> str:
        other = job.at(reading)
        if other != job and self.short and isinstance(job, BranchJob) and job.max_period > 1:
            other = job.shortest.at(reading)
        return other.key

    def _check(self, reading: Reading | None, results: Mapping[str, Result], failures: Mapping[str, str]) -> Outcome:
        keys = self._keys(reading)
        missing = [f"{key}: {failures.get(key, 'no result')}" for key in keys if key not in results]
        if missing:
            return Outcome(Verdict.NOT_REPRODUCED, f"could not be computed ({'; '.join(missing)})")
        return self.decide(*(results[key] for key in keys))


def holds(condition: bool, evidence: str) -> Outcome:
    """Reproduced if a condition is true."""
    return Outcome(Verdict.REPRODUCED if condition else Verdict.NOT_REPRODUCED, evidence)
