"""What another number gains and costs: all claims that it could change, checked at it and at the printed numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims.claim import Claim
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


def jobs_of_trades(claims: Sequence[Claim]) -> list[Job]:
    """Return the jobs on which the trades rest, if all claims are checked."""
    known = {claim.name: claim for claim in claims}
    return [
        job
        for each in CANDIDATES
        for name in each.claims
        for job in known[name].jobs_in(each.reading, each.jobs_of(name))
    ]


def weigh(claims: Sequence[Claim], results: Mapping[str, gw.Result], failures: Mapping[str, str]) -> tuple[Trade, ...]:
    """Return what each candidate gains and costs.

    Parameters
    ----------
    claims
        All claims.
    results, failures
        The results of jobs, and why others have none, by the keys of the jobs.
    """
    known = {claim.name: claim for claim in claims}
    trades = []
    for each in CANDIDATES:
        sides: dict[tuple[bool, bool], list[str]] = {}
        for name in each.claims:
            claim = known[name]
            before, _ = claim.holds(None, results, failures)
            after, _ = claim.holds(each.reading, results, failures, each.jobs_of(name))
            sides.setdefault((before, after), []).append(name)
        order = ((False, True), (True, True), (True, False), (False, False))
        trades.append(Trade(each, *(tuple(sides.get(side, ())) for side in order)))
    return tuple(trades)
