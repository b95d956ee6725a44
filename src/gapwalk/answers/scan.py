"""Scan: which claims hold for which variations of a system, and how likely it is that a hit is luck.

The record of what was found; `gapwalk.studies.scan_work` finds it.

Method: docs/numerics/scan.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gapwalk.answers.parameter_variations import Variations, VariedHow
from gapwalk.answers.scan_claims import AnyClaim
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes

HOLDS, FAILS, UNKNOWN = 1, 0, -1
"""What a claim comes to for one variation."""

_CONFIDENCE = 0.95
_SHOWN = 12  # variations in a summary
_MARKS = {HOLDS: "holds", FAILS: "no", UNKNOWN: "?"}


class Luck(NamedTuple):
    """How likely it is that variations fulfil so many claims by chance.

    Examples
    --------
    >>> luck = scan.luck(1)
    >>> luck.neighbours, luck.share == luck.hits / luck.neighbours
    (10, True)
    """

    score: int  #: The number of claims.
    #: hits, neighbours: Number of random neighbours that fulfil at least as many, and of all of them.
    hits: int
    neighbours: int
    share: float  #: Their share; nan without neighbours.
    #: What the share of all such neighbours is at most, with 95 % confidence (Clopper and Pearson 1934, one-sided).
    upper: float
    tried: int  #: Number of variations that were tried.
    #: chance, at_most: The chance that at least one of so many variations would do as well if each were no better than
    #: a random neighbour: by the share, and by its upper bound.
    chance: float
    at_most: float

    @property
    def words(self) -> str:
        """The chance of luck in a sentence."""
        if not self.neighbours:
            return "no random neighbours were tried, so nothing is known of luck; write neighbours = 200"
        return (
            f"{self.hits} of {self.neighbours:,} random neighbours fulfil {self.score} claims or more "
            f"({self.share:.2%}, at most {self.upper:.2%} with 95 % confidence): with a chance of {self.chance:.0%} "
            f"(at most {self.at_most:.0%}) at least one of {self.tried:,} variations would by luck alone"
        )


@dataclass(frozen=True)
class ScanCheck:
    """Comparison of the best variations with the exact flow.

    Examples
    --------
    >>> scan.check.checked >= len(scan.check.different)
    True
    """

    checked: int = 0  #: Number of settled motions that were classified again with the exact flow.
    different: tuple[str, ...] = ()  #: One sentence for each of them that then got another kind or period.


@dataclass(frozen=True, eq=False, repr=False)
class Scan(Shown):
    """Which claims hold for which variations of a system.

    Examples
    --------
    >>> scan.words(scan.best[0]), int(scan.scores[scan.best[0]])
    ('harmonic1.amplitude = 0.25', 2)
    """

    system: System  #: The system.
    claims: tuple[AnyClaim, ...]  #: The claims.
    variations: Variations  #: The variations; the first is the system itself.
    #: shape (variations, claims): 1 where a claim holds, 0 where it does not, -1 where it is unknown.
    holds: NDArray[np.int_]
    #: shape (variations, claims): Share of starts that settle on the motion of a claim, or number of its special
    #: points.
    amounts: NDArray[np.float64]
    check: ScanCheck = ScanCheck()  #: Comparison of the best variations with the exact flow.
    error: float = 0.0  #: Error of the batch integrator over a forcing period, relative to the size of the motion.
    complete: bool = True  #: False if the scan was stopped before its end; the remaining entries are unknown.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        shape = len(self.variations), len(self.claims)
        if self.holds.shape != shape or self.amounts.shape != shape:
            raise ValueError(f"verdicts of shape {self.holds.shape} are not those of {shape[0]} variations")

    @property
    def scores(self) -> NDArray[np.int_]:
        """Number of claims that hold, for each variation."""
        return (self.holds == HOLDS).sum(axis=1)

    @property
    def best(self) -> list[int]:
        """Numbers of the variations that were tried, those that fulfil most claims first."""
        tried = np.flatnonzero(self.variations.tried)
        return tried[np.argsort(-self.scores[tried], kind="stable")].tolist()

    def words(self, index: int) -> str:
        """Describe one variation."""
        return self.variations.words(index)

    def luck(self, score: int) -> Luck:
        """Return how likely it is that variations fulfil so many claims by chance."""
        known = self.variations.neighbours & (self.holds != UNKNOWN).any(axis=1)
        count, tried = int(known.sum()), int(self.variations.tried.sum())
        hits = int((self.scores[known] >= score).sum())
        share = hits / count if count else math.nan
        upper = 1.0 if hits == count else float(special.betaincinv(hits + 1, count - hits, _CONFIDENCE))
        return Luck(score, hits, count, share, upper, tried, 1.0 - (1.0 - share) ** tried, 1.0 - (1.0 - upper) ** tried)

    @property
    def sentence(self) -> str:
        """The best variation, in one sentence."""
        own, best = int(self.scores[0]), self.best
        own_words = f"{own} of {len(self.claims)} claims hold in the model"
        if not best or self.scores[best[0]] <= own:
            return f"{own_words}, and no variation fulfils more"
        score = int(self.scores[best[0]])
        equal = sum(self.scores[index] == score for index in best) - 1
        more = f", and with {equal} other variation{'s' if equal > 1 else ''}" if equal else ""
        return f"{own_words}, {score} with {self.words(best[0])}{more}"

    @property
    def failures(self) -> tuple[str, ...]:
        """Sentences on the best variations whose motions are others by the exact flow."""
        return self.check.different

    def tables(self) -> Tables:
        """Return the table of all variations: their values, and what the claims come to."""
        return {"variations": self._rows}

    def _rows(self) -> Rows:
        names = self.variations.names
        numbers = range(1, len(self.claims) + 1)
        yield ["how", *names, "claims", *(f"claim {n}" for n in numbers), *(f"amount {n}" for n in numbers)]
        for index, how in enumerate(self.variations.how.tolist()):
            holds = self.holds[index].tolist()
            values = self.variations.values[index].tolist()
            yield [VariedHow(how).name.lower(), *values, int(self.scores[index]), *holds, *self.amounts[index].tolist()]

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the claims, the best variations, and the chance of luck; with the notes or without."""
        yield self.sentence
        for number, claim in enumerate(self.claims, start=1):
            yield f"  claim {number}: {claim.words}"
        shown = [0, *(index for index in self.best[:_SHOWN] if self.scores[index] > 0)]
        headings = ["variation", *(f"claim {number}" for number in range(1, len(self.claims) + 1)), ">claims"]
        yield Table(headings, [[self.words(index), *self._marks(index), str(self.scores[index])] for index in shown])
        if len(self.best) and (score := int(self.scores[self.best[0]])):
            yield self.luck(score).words
        if self.check.checked:
            yield (
                f"{self.check.checked} motions of the best variations classified again by the exact flow, "
                f"{len(self.check.different)} differently"
            )
        if notes:
            yield from remarks(self.notes, self.failures)

    def _marks(self, index: int) -> Iterator[str]:
        for claim, holds, amount in zip(self.claims, self.holds[index], self.amounts[index], strict=True):
            yield _MARKS[int(holds)] + (f" ({amount:.0%} of starts)" if amount and hasattr(claim, "motion") else "")

    def __repr__(self) -> str:
        return f"Scan({len(self.variations):,} variations: {self.sentence})"


def check_claims(system: System, claims: tuple[AnyClaim, ...]) -> None:
    """Refuse claims about parameters that the system does not have, or values that it cannot have."""
    if not claims:
        raise ModelError('there are no claims; write tables [[study.claim]], as with motion = "period 3"')
    for claim in claims:
        system.at(claim.at)
        for name in claim.varied:
            system.structure.place(name)
