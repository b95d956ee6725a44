"""The coverage of a search as a table."""

from __future__ import annotations

from gapwalk.bifurcation.isolated import SearchResult, unseen_share

COVERAGE = ("value", "starts", "settled", "not_periodic", "ran_away", "newton_starts", "orbits", "new", "unseen_share")
"""The headings of `coverage_rows`."""


def coverage_rows(result: SearchResult) -> list[list[float]]:
    """What was tried at each value of the parameter, what was met there, and what may have been missed.

    `orbits` counts those that were met, `new` those on no branch that was known before. With 95 % confidence, a
    periodic attractor that was never met attracts no more than `unseen_share` of the box of starts.
    """
    return [
        [
            tally.value,
            tally.starts,
            tally.settled,
            len(tally.unsettled),
            tally.ran_away,
            tally.newton_starts,
            len(result.at(tally.value)),
            sum(found.is_new for found in result.at(tally.value)),
            unseen_share(tally.settled),
        ]
        for tally in result.tallies
    ]
