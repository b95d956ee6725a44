"""The second reading of the paper: statements that hold at one other number, and statements that can be explained.

The printed numbers stay the default. Another number stands beside them with what it gains and what it costs
(`weigh` in ``claims/trades.py``); an explanation is a check with evidence, as a claim is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, CHANGES, LITERAL, Reading

if TYPE_CHECKING:
    from reproductions.padmanabhan_singh_1995.claims.claim import Check


@dataclass(frozen=True)
class Candidate:
    """Another number, or another reading, that is weighed.

    Parameters
    ----------
    reading
        The reading.
    explains
        Names of claims that it was proposed for.
    weighed
        Names of claims that it could gain or cost besides.
    jobs
        Keys of the jobs that take the place of those on which a claim rests, by the name of the claim.
    """

    reading: Reading
    explains: tuple[str, ...] = ()
    weighed: tuple[str, ...] = ()
    jobs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def claims(self) -> tuple[str, ...]:
        """Names of all claims that it could gain or cost."""
        return tuple(dict.fromkeys((*self.explains, *self.weighed)))

    def jobs_of(self, name: str) -> tuple[str, ...]:
        """Return the keys of the other jobs of a claim; none if it rests on its own."""
        return self.jobs.get(name, ())


_ROW_12 = (
    "12-folds",
    "13-flips",
    "14-jump",
    "14-second",
    "20-peak",
    "21-folds",
    "22-flips",
    "22-additional",
)
_OVER_AMPLITUDE = ("27-islands", "27-flip", "28-grow")

CANDIDATES = (
    Candidate(CHANGES["matched"], ("4-beyond", "4-flips"), ("4-folds", "4-beats", "4-peak", "10-shrinks", "10-gone")),
    Candidate(CHANGES["c11-0.025"], ("27-beats", "28-overlap"), ("12-beats", *_ROW_12, *_OVER_AMPLITUDE)),
    Candidate(
        CHANGES["te1-0.37"],
        ("5-harmonics", "6-single", "6-weaker", "7-differ", "7-spectra", "6-broadband"),
        ("5-double",),
    ),
    Candidate(
        CHANGES["te1-0.338"],
        ("5-double",),
        ("5-harmonics", "6-single"),
        {"5-double": ("5-start",), "5-harmonics": ("5-start",)},
    ),
    Candidate(CHANGES["beta-0.1"], ("10-gone",), ("10-shrinks", "4-flips", "4-beyond")),
    Candidate(CHANGES["exchanged"], ("11-second", "11-beats", "11-tori"), ("11-spacing", "11-stable")),
    Candidate(LITERAL, (), ("14-jump", "14-second", "13-flips", "13-natures", "22-flips")),
    Candidate(AS_PRINTED, (), ("12-folds", "12-beats", "13-flips", "13-natures")),
    Candidate(CHANGES["machine"], (), ("12-folds", "12-beats", "13-flips", "14-jump", "14-second")),
    Candidate(CHANGES["k11-0"], ("17-sequence",), (), {"17-sequence": ("17-start", "18-start", "19-start")}),
)
"""All candidates. Those that explain nothing stand here too: they were proposed, and do not hold."""


def readings_for(name: str) -> list[tuple[Reading, tuple[str, ...]]]:
    """Return the other numbers that were proposed for a claim, and the jobs on which it rests there."""
    return [(each.reading, each.jobs_of(name)) for each in CANDIDATES if name in each.explains]


@dataclass(frozen=True)
class Explanation:
    """What explains that a statement does not hold at the printed numbers, with a check of it.

    Parameters
    ----------
    by
        What explains it, in a few words.
    rests_on
        Keys of the jobs whose results the check takes, in this order.
    check
        The check: whether the explanation holds, and its evidence.
    """

    by: str
    rests_on: tuple[str, ...]
    check: Check


EXPLANATIONS: dict[str, Explanation] = {}
"""Explanations by the names of claims; ``claims/explanations.py`` defines them."""


def explains(name: str, by: str, *rests_on: str) -> Callable[[Check], Check]:
    """Make a check the check of an explanation; parameters as those of `Explanation`."""

    def register(check: Check) -> Check:
        EXPLANATIONS[name] = Explanation(by, rests_on, check)
        return check

    return register
