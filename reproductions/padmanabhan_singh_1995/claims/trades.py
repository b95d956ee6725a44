"""What another number gains and costs: all claims that it could change, checked at it and at the printed numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import ALL, Claim, Outcome
from reproductions.padmanabhan_singh_1995.claims.second_reading import CANDIDATES, Candidate
from reproductions.padmanabhan_singh_1995.jobs import Job


@dataclass(frozen=True)
class Trade:
    """What another number gains and costs.

    Attributes
    ----------
    candidate
        The number, or the reading.
    gained, kept, lost, missed
        Names of the claims that hold at it only, at both, at the printed numbers only, and at neither.
    """

    candidate: Candidate
    gained: tuple[str, ...]
    kept: tuple[str, ...]
    lost: tuple[str, ...]
    missed: tuple[str, ...]

    @property
    def words(self) -> str:
        """The number, and what is printed in its place."""
        reading = self.candidate.reading
        return f"{reading.differs} (printed: {reading.number.printed})" if reading.number else reading.differs


def jobs_of(claims: Sequence[Claim]) -> list[Job]:
    """Return the jobs on which claims rest, each once; trades too, if all claims are given."""
    found = {job.key: job for claim in claims for job in claim.jobs}
    if len(claims) == len(ALL):
        known = {claim.name: claim for claim in claims}
        for each in CANDIDATES:
            for name in each.claims:
                found |= {job.key: job for job in known[name].jobs_in(each.reading, each.jobs_of(name))}
    return list(found.values())


def decide(
    claims: Sequence[Claim], results: Mapping[str, gw.Result], failures: Mapping[str, str]
) -> tuple[list[tuple[Claim, Outcome]], tuple[Trade, ...]]:
    """Check claims; if all are given, say what other numbers gain and cost, and which claims their gains cost."""
    checked = [(claim, claim.outcome(results, failures)) for claim in claims]
    if len(claims) != len(ALL):
        return checked, ()
    trades = weigh(checked, results, failures)
    known = {each.candidate.reading: {"costs": each.lost, "at_odds": _at_odds(each, checked)} for each in trades}
    return [
        (claim, replace(outcome, **known.get(outcome.reading, {})) if outcome.reading else outcome)
        for claim, outcome in checked
    ], trades


def _at_odds(trade: Trade, checked: Sequence[tuple[Claim, Outcome]]) -> tuple[str, ...]:
    """Name the claims that need another value of the same number, and do not hold at this one."""
    number = trade.candidate.reading.number
    if number is None:
        return ()
    return tuple(
        claim.name
        for claim, outcome in checked
        if claim.name in trade.missed and set(outcome.changed) & set(number.changed)
    )


def weigh(
    checked: Sequence[tuple[Claim, Outcome]], results: Mapping[str, gw.Result], failures: Mapping[str, str]
) -> tuple[Trade, ...]:
    """Return what each candidate gains and costs; all claims must be given, with what they come to."""
    known = {claim.name: (claim, {each.where: each.holds for each in outcome.evidence}) for claim, outcome in checked}
    trades = []
    for each in CANDIDATES:
        sides: dict[tuple[bool, bool], list[str]] = {}
        for name in each.claims:
            claim, tried = known[name]
            after = tried.get(each.reading.differs)
            if after is None:
                after = claim.holds(each.reading, results, failures, each.jobs_of(name)).holds
            sides.setdefault((tried[""], after), []).append(name)
        order = ((False, True), (True, True), (True, False), (False, False))
        trades.append(Trade(each, *(tuple(sides.get(side, ())) for side in order)))
    return tuple(trades)
