"""A claim: one statement of the paper, and the check that decides whether it holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.second_reading import EXPLANATIONS, readings_for
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, JOBS, LITERAL, Job, Reading

BOTH = (LITERAL, AS_PRINTED)
"""The readings that are not the default one."""

Check = Callable[..., tuple[bool, str]]
"""Takes results, and returns whether the statement holds, and the numbers that were found.

For what does not hold the evidence says what was found instead, and where the nearest motion is that does it.
"""


class Verdict(StrEnum):
    """What the check of a claim comes to."""

    REPRODUCED = "reproduced"
    OTHER_READING = "reproduced under another reading"
    OTHER_NUMBER = "at one other number"
    EXPLAINED = "explained"
    NOT_REPRODUCED = "not reproduced"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The verdict on a claim.

    Attributes
    ----------
    verdict
        Whether the claim holds.
    evidence
        The numbers that were found, in every reading that was checked.
    reading
        The other reading, or the other number, under which it holds, or what explains it; empty for the default one.
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
        A name that begins with the number of its figure, such as ``13-loops``.
    says
        The statement, in our words.
    rests_on
        Keys of the jobs whose results the check takes, in this order.
    check
        The check.
    others
        Readings that are checked besides the default one, which has the first word.
    elsewhere
        Keys of the jobs that take the place of `rests_on` in other readings and at other numbers; by default the same.
        What else the evidence looks at is left out there.
    short
        Whether motions of period 1 are enough for it: in other readings longer ones are then left out.
    """

    name: str
    says: str
    rests_on: tuple[str, ...]
    check: Check
    others: tuple[Reading, ...] = ()
    short: bool = False
    elsewhere: tuple[str, ...] = ()

    @property
    def figure(self) -> str:
        """The number of its figure; ``summary`` if it is about several."""
        return self.name.partition("-")[0]

    @property
    def jobs(self) -> tuple[Job, ...]:
        """The jobs whose results are needed, in every reading and for its explanation, each once."""
        wanted = [job for reading in (None, *self.others) for job in self.jobs_in(reading)]
        wanted += [job for reading, keys in readings_for(self.name) for job in self.jobs_in(reading, keys)]
        if explanation := EXPLANATIONS.get(self.name):
            wanted += [JOBS[key] for key in explanation.rests_on]
        return tuple({job.key: job for job in wanted}.values())

    def outcome(self, results: Mapping[str, gw.Result], failures: Mapping[str, str]) -> Outcome:
        """Check it in every reading, then at other numbers, then look for an explanation.

        Parameters
        ----------
        results, failures
            The results of jobs, and why others have none, by the keys of the jobs.
        """
        holds, evidence = self.holds(None, results, failures)
        parts, found = [evidence], Outcome(Verdict.REPRODUCED, "") if holds else None
        tries = [(reading, (), Verdict.OTHER_READING) for reading in self.others]
        tries += [(reading, keys, Verdict.OTHER_NUMBER) for reading, keys in readings_for(self.name)]
        for reading, keys, verdict in tries:
            also, evidence = self.holds(reading, results, failures, keys)
            parts.append(f"[{reading.differs}] {evidence}")
            found = found or (Outcome(verdict, "", reading.differs) if also else None)
        explanation = EXPLANATIONS.get(self.name)
        if explanation and all(key in results for key in explanation.rests_on):
            also, evidence = explanation.check(*(results[key] for key in explanation.rests_on))
            parts.append(f"[{explanation.by}] {evidence}")
            found = found or (Outcome(Verdict.EXPLAINED, "", explanation.by) if also else None)
        return replace(found or Outcome(Verdict.NOT_REPRODUCED, ""), evidence="; ".join(parts))

    def holds(
        self,
        reading: Reading | None,
        results: Mapping[str, gw.Result],
        failures: Mapping[str, str],
        keys: tuple[str, ...] = (),
    ) -> tuple[bool, str]:
        """Check it in one reading; other jobs may take the place of those that it rests on.

        Parameters
        ----------
        reading
            The reading; None for the default one.
        results, failures
            As in `outcome`.
        keys
            Keys of the other jobs; by default those that it rests on.
        """
        wanted = [job.key for job in self.jobs_in(reading, keys)]
        missing = [f"{key}: {failures.get(key, 'no result')}" for key in wanted if key not in results]
        if missing:
            return False, f"could not be computed ({'; '.join(missing)})"
        return self.check(*(results[key] for key in wanted))

    def jobs_in(self, reading: Reading | None, keys: tuple[str, ...] = ()) -> list[Job]:
        """Return the jobs whose results are needed in one reading; parameters as in `holds`."""
        if reading is None:
            return [JOBS[key] for key in self.rests_on]
        jobs = [JOBS[key] for key in keys or self.elsewhere or self.rests_on]
        # A job that the reading does not change is shared with the default reading, longer periods and all.
        return [job if (other := job.at(reading)) == job else (other.shortest if self.short else other) for job in jobs]


ALL: list[Claim] = []
"""All claims, in the order in which their modules define them."""


def claim(
    name: str,
    says: str,
    *rests_on: str,
    others: tuple[Reading, ...] = (),
    short: bool = False,
    elsewhere: tuple[str, ...] = (),
) -> Callable[[Check], Check]:
    """Make a check the check of a claim; parameters as those of `Claim`."""

    def register(check: Check) -> Check:
        ALL.append(Claim(name, says, rests_on, check, others, short, elsewhere))
        return check

    return register
