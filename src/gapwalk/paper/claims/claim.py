"""A claim: one statement of the paper, and the check that decides whether it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from gapwalk.study.result import Result


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
    jobs
        Keys of the jobs whose results the check needs.
    decide
        The check: takes their results, in this order.
    """

    name: str
    says: str
    jobs: tuple[str, ...]
    decide: Callable[..., Outcome]

    @property
    def figure(self) -> str:
        """The figure that it is about; ``summary`` for one that is about several."""
        return self.name.partition("-")[0]

    def check(self, results: list[Result]) -> Outcome:
        """Whether it holds, from the results of its jobs."""
        return self.decide(*results)


def holds(condition: bool, evidence: str) -> Outcome:
    """Reproduced if a condition is true."""
    return Outcome(Verdict.REPRODUCED if condition else Verdict.NOT_REPRODUCED, evidence)
