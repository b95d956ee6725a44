"""A claim: one statement of the paper, and the check that decides whether it holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.second_reading import EXPLANATIONS, readings_for
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, JOBS, LITERAL, Job, Reading, changed_numbers, in_words

BOTH = (LITERAL, AS_PRINTED)
"""The readings that are not the default one."""

TOLERANCE = 0.05
"""Relative deviation up to which a number that the paper names is met."""


class Against(NamedTuple):
    """A number that the paper names, beside the one that was found."""

    what: str
    paper: float
    found: float

    @property
    def off(self) -> float:
        """The relative deviation."""
        return abs(self.found / self.paper - 1.0)


class Finding(NamedTuple):
    """Finding of a check: whether the statement holds, and in which numbers.

    For what does not hold the details say what was found instead, and where the nearest motion is that does it.
    """

    holds: bool
    line: str  #: One short line of numbers.
    details: str = ""
    against: tuple[Against, ...] = ()  #: Numbers that the paper names.
    short: str = ""  #: A part that is missing or too faint for a picture, with its number: it then holds in kind.


Check = Callable[..., Finding]
"""Takes results, and returns what it has found."""


class Verdict(StrEnum):
    """The class of a claim; `rule` says in numbers what belongs to it."""

    LETTER = "to the letter"
    KIND = "in kind"
    OTHER_READING = "other reading"
    OTHER_NUMBER = "one number changed"
    OTHER_NUMBERS = "several numbers changed"
    EXPLAINED = "explained"
    NOT_FOUND = "not found"
    LOST = "cannot be tested"
    ELSEWHERE = "elsewhere"

    @property
    def rule(self) -> str:
        """Rule of the class."""
        return _RULES[self]


_RULES = {
    Verdict.LETTER: "The statement holds at the printed numbers, and each number that it names is met within "
    f"{TOLERANCE:.0%}.",
    Verdict.KIND: "At the printed numbers the feature is there, but a number that the statement names differs by more "
    f"than {TOLERANCE:.0%}, two quantities that should agree differ by more than that, a change is smaller, or only "
    "some of the motions that the statement names have the feature; the verdict says which, and by how much.",
    Verdict.OTHER_READING: "It holds if a formula is used as the paper prints it, in place of the form that gapwalk "
    "uses by default; no number is changed.",
    Verdict.OTHER_NUMBER: "It holds if exactly one number of the tables is changed; the verdict says where that "
    "number needs more digits than the tables print. Two entries of one damper, spring or clutch that change by one "
    "factor count as one number; a quantity that the paper itself changes without printing it does not count.",
    Verdict.OTHER_NUMBERS: "It holds if two or more numbers of the tables are changed; the verdict says how many.",
    Verdict.EXPLAINED: "It does not hold, and a check with numbers shows why the paper may have come to it.",
    Verdict.NOT_FOUND: "It does not hold at the printed numbers, in any reading or at any other number that was tried, "
    "and no check explains it.",
    Verdict.LOST: "It needs a curve that was never printed as numbers, or numbers of the tables that cannot be read. "
    "With the digits that can be read it does not hold.",
    Verdict.ELSEWHERE: "What the paper describes exists at other numbers, found by a search. It is no statement of the "
    "paper, and is never counted.",
}


class Tried(NamedTuple):
    """One attempt to find a statement true."""

    where: str  #: Reading, other number or explanation; empty for the printed numbers.
    holds: bool
    line: str
    details: str = ""

    def __str__(self) -> str:
        text = self.line + (f"; {self.details}" if self.details else "")
        return f"[{self.where}] {text}" if self.where else text


@dataclass(frozen=True, slots=True)
class Outcome:
    """The verdict on a claim."""

    verdict: Verdict
    line: str  #: One short line of numbers, of the attempt that decides.
    evidence: tuple[Tried, ...] = ()  #: All attempts; the first is that at the printed numbers.
    by: str = ""  #: The reading, the numbers or the explanation; how far it is off in kind; empty to the letter.
    #: The numbers that were changed, by their symbols: the printed one and the other one.
    changed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    costs: tuple[str, ...] = ()  #: Names of claims that hold as printed, and no longer with the change.
    at_odds: tuple[str, ...] = ()  #: Names of claims that need another value of the same number.
    against: tuple[Against, ...] = ()  #: Numbers that the paper names.
    reading: Reading | None = None  #: The reading, or the other numbers, with which it holds.

    @property
    def kind(self) -> str:
        """The class in words, with the number of changed numbers."""
        several = self.verdict is Verdict.OTHER_NUMBERS
        return f"{len(self.changed)} numbers changed" if several else self.verdict.value

    def __str__(self) -> str:
        return f"{self.kind}{f' ({self.by})' if self.by else ''}"


class Counts(NamedTuple):
    """How many statements of the paper come to each verdict; what is found elsewhere is apart."""

    classes: dict[Verdict, int]
    statements: int
    elsewhere: int


def counts(outcomes: Iterable[Outcome]) -> Counts:
    """Count verdicts; what is found elsewhere is no statement of the paper."""
    found = [outcome.verdict for outcome in outcomes]
    classes = {verdict: found.count(verdict) for verdict in Verdict if verdict is not Verdict.ELSEWHERE}
    return Counts(classes, sum(classes.values()), found.count(Verdict.ELSEWHERE))


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
    apart
        Whether it says where else the described motion is; it is then no statement of the paper.
    lost
        What it rests on that is lost, in a few words; empty for most.
    place
        Where it is checked first, in a few words.
    """

    name: str
    says: str
    rests_on: tuple[str, ...]
    check: Check
    others: tuple[Reading, ...] = ()
    short: bool = False
    elsewhere: tuple[str, ...] = ()
    apart: bool = False
    lost: str = ""
    place: str = "printed numbers"

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
        """Check it in every reading, then at other numbers, then look for an explanation."""
        printed = self.holds(None, results, failures)
        tried = [Tried("", *printed[:3])]
        found = self._as_printed(printed)
        tries: list[tuple[Reading, tuple[str, ...]]] = [(reading, ()) for reading in self.others]
        for reading, keys in (*tries, *readings_for(self.name)):
            also = self.holds(reading, results, failures, keys)
            tried.append(Tried(reading.differs, *also[:3]))
            if also.holds and found is None:
                changed = self._changed(reading, keys)
                by = ", ".join(filter(None, (in_words(changed) if reading.number else reading.differs, also.short)))
                found = Outcome(_class_of(changed), also.line, by=by, changed=changed, reading=reading)
        explanation = EXPLANATIONS.get(self.name)
        if explanation and all(key in results for key in explanation.rests_on):
            also = explanation.check(*(results[key] for key in explanation.rests_on))
            tried.append(Tried(explanation.by, *also[:3]))
            if also.holds and found is None:
                found = Outcome(Verdict.EXPLAINED, also.line, by=explanation.by)
        found = found or Outcome(Verdict.LOST if self.lost else Verdict.NOT_FOUND, printed.line, by=self.lost)
        return replace(found, evidence=tuple(tried), against=printed.against)

    def _as_printed(self, found: Finding) -> Outcome | None:
        """Return the verdict at the printed numbers; None if the statement does not hold there."""
        if not found.holds:
            return None
        if self.apart:
            return Outcome(Verdict.ELSEWHERE, found.line, changed=self._changed(None))
        off = max((each.off for each in found.against), default=0.0)
        if found.short:
            return Outcome(Verdict.KIND, found.line, by=found.short)
        if off > TOLERANCE:
            return Outcome(Verdict.KIND, found.line, by=f"off by {off:.0%}")
        return Outcome(Verdict.LETTER, found.line)

    def _changed(self, reading: Reading | None, keys: tuple[str, ...] = ()) -> dict[str, tuple[float, float]]:
        """Return the numbers that differ from print; what the statement itself varies differs only if it is apart."""
        changed: dict[str, tuple[float, float]] = dict(reading.number.changed) if reading and reading.number else {}
        for job in self.jobs_in(reading, keys) if self.apart else ():
            changed |= changed_numbers(gw.paper.case(job.case), job.study.system)
        return changed

    def holds(
        self,
        reading: Reading | None,
        results: Mapping[str, gw.Result],
        failures: Mapping[str, str],
        keys: tuple[str, ...] = (),
    ) -> Finding:
        """Check it in one reading (None: the default one); other jobs may take the place of those that it rests on."""
        wanted = [job.key for job in self.jobs_in(reading, keys)]
        missing = [f"{key}: {failures.get(key, 'no result')}" for key in wanted if key not in results]
        if missing:
            return Finding(False, f"could not be computed ({'; '.join(missing)})")
        return self.check(*(results[key] for key in wanted))

    def jobs_in(self, reading: Reading | None, keys: tuple[str, ...] = ()) -> list[Job]:
        """Return the jobs whose results are needed in one reading; parameters as in `holds`."""
        if reading is None:
            return [JOBS[key] for key in self.rests_on]
        jobs = [JOBS[key] for key in keys or self.elsewhere or self.rests_on]
        # A job that the reading does not change is shared with the default reading, longer periods and all.
        return [job if (other := job.at(reading)) == job else (other.shortest if self.short else other) for job in jobs]


def _class_of(changed: Mapping[str, tuple[float, float]]) -> Verdict:
    if not changed:
        return Verdict.OTHER_READING
    return Verdict.OTHER_NUMBER if len(changed) == 1 else Verdict.OTHER_NUMBERS


ALL: list[Claim] = []
"""All claims, in the order in which their modules define them."""


def claim(
    name: str,
    says: str,
    *rests_on: str,
    others: tuple[Reading, ...] = (),
    short: bool = False,
    elsewhere: tuple[str, ...] = (),
    apart: bool = False,
    lost: str = "",
    place: str = "printed numbers",
) -> Callable[[Check], Check]:
    """Make a check the check of a claim; parameters as those of `Claim`."""

    def register(check: Check) -> Check:
        ALL.append(Claim(name, says, rests_on, check, others, short, elsewhere, apart, lost, place))
        return check

    return register
