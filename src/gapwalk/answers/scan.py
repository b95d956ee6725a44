"""Scan: which claims hold for which variations of a system, and how likely it is that a hit is luck.

The record of what was found; `gapwalk.studies.scan_study` finds it.

Method: docs/numerics/scan.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gapwalk.answers.scan_claims import AnyClaim, said
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes

# Variations of a system's parameters: one at a time, in pairs, listed by hand, and random neighbours.
#
# The first three are *tried*: each is a reading of a description that may be the right one. Neighbours are for
# comparison: how many of them do as well tells how much a hit among those that are tried is worth.


class VariedHow(IntEnum):
    """How a variation was made."""

    NONE = 0
    """The system itself."""
    ONE = 1
    """One parameter has another value."""
    PAIR = 2
    """Two of these changes together."""
    LISTED = 3
    """Given by the request."""
    NEIGHBOUR = 4
    """All parameters are multiplied by random factors."""


@dataclass(frozen=True, eq=False)
class Variations:
    """Many systems that differ in some parameters.

    Examples
    --------
    >>> found = gw.ask.variations(system, ["stop.clearance"], factors=[0.9, 1.1])
    >>> found.values[:, 0].tolist()
    [1.0, 0.9, 1.1]
    """

    names: tuple[str, ...]  #: The parameters that vary.
    values: NDArray[np.float64]  #: shape (count, names): Their values.
    how: NDArray[np.int_]  #: shape (count,): How each variation was made, as a value of `VariedHow`.
    left_out: tuple[str, ...] = ()  #: Sentences that say why variations are left out.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.values.shape != (len(self.how), len(self.names)):
            raise ValueError(f"values of shape {self.values.shape} are not those of {len(self.how)} variations")

    def __len__(self) -> int:
        return len(self.how)

    @property
    def tried(self) -> NDArray[np.bool_]:
        """True for variations that may be the right ones: all but the system itself and its random neighbours."""
        return (self.how != VariedHow.NONE) & (self.how != VariedHow.NEIGHBOUR)

    @property
    def neighbours(self) -> NDArray[np.bool_]:
        """True for random neighbours."""
        return self.how == VariedHow.NEIGHBOUR

    def of(self, index: int) -> dict[str, float]:
        """Return all values of one variation by name."""
        return dict(zip(self.names, self.values[index].tolist(), strict=True))

    def changes(self, index: int) -> dict[str, float]:
        """Return the values of one variation that differ from those of the system."""
        return {name: value for name, value in self.of(index).items() if value != self.of(0)[name]}

    def words(self, index: int) -> str:
        """Describe one variation."""
        if self.how[index] == VariedHow.NEIGHBOUR:
            return "random neighbour"
        changes = self.changes(index)
        return ", ".join(f"{name} = {value + 0.0:.6g}" for name, value in changes.items()) or "as in the model"


def variations(
    system: System,
    parameters: Sequence[str] = (),
    *,
    factors: Sequence[float] = (),
    pairs: int = 0,
    listed: Sequence[Mapping[str, float]] = (),
    neighbours: int = 0,
    spread: float = 0.1,
    seed: int = 0,
    fixed: frozenset[str] = frozenset(),
) -> Variations:
    """Make variations of a system: first the system itself, then the variations to be tried, then random neighbours.

    Parameters
    ----------
    system
        The system.
    parameters
        The parameters that vary; by default all that are not 0 and not fixed.
    factors
        Factors by which each parameter is multiplied, one parameter at a time; the factor 0 removes what it stands for.
    pairs
        Number of further variations that combine two of these changes, drawn at random.
    listed
        Further variations, each given as values of parameters by name.
    neighbours
        Number of random neighbours: variations in which all parameters are multiplied by random factors near 1.
    spread
        Standard deviation of the logarithm of these random factors.
    seed
        Seed of the random numbers.
    fixed
        Parameters that may not vary.

    Returns
    -------
    Variations
        The variations that are valid systems; `left_out` names the others.

    Raises
    ------
    ModelError
        For an unknown parameter, a parameter that may not vary, or a parameter that is 0 and has factors.

    Examples
    --------
    >>> found = gw.ask.variations(system, ["stop.clearance", "harmonic1.amplitude"], factors=[0.5], neighbours=3)
    >>> [found.words(index) for index in range(2)], int(found.neighbours.sum())
    (['as in the model', 'stop.clearance = 0.5'], 3)
    """
    kept = {system.structure.place(name) for name in fixed}
    every = system.parameters
    if not parameters:
        pace = system.structure.place(system.structure.pace)
        parameters = [
            name
            for name, value in every.items()
            if value != 0.0 and system.structure.place(name) not in kept and system.structure.place(name) != pace
        ]
    names = tuple(dict.fromkeys([*parameters, *(name for each in listed for name in each)]))
    for name in names:
        if system.structure.place(name) in kept:
            raise ModelError(f"{name} has a value in a claim, so it cannot vary; leave it out of the parameters")
    for name in parameters:
        if factors and system[name] == 0.0:
            raise ModelError(f"{name} is 0, and no factor changes that; write it in listed with its values")
    own = np.array([float(system[name]) for name in names])
    where = {name: place for place, name in enumerate(names)}

    def changed(*changes: tuple[str, float]) -> NDArray[np.float64]:
        row = own.copy()
        for name, value in changes:
            row[where[name]] = value
        return row

    random = np.random.default_rng(seed)
    single = [(name, float(factor) * float(system[name])) for name in parameters for factor in factors if factor != 1.0]
    both = [(one, two) for one, two in combinations(single, 2) if one[0] != two[0]]
    chosen = np.sort(random.permutation(len(both))[:pairs]).tolist()
    rows = [(own, VariedHow.NONE)]
    rows += [(changed(one), VariedHow.ONE) for one in single]
    rows += [(changed(*both[index]), VariedHow.PAIR) for index in chosen]
    rows += [(changed(*each.items()), VariedHow.LISTED) for each in listed]
    free = np.isin(names, parameters)
    for _ in range(neighbours):
        factor = np.where(free, np.exp(random.normal(0.0, spread, len(names))), 1.0)
        rows.append((own * factor, VariedHow.NEIGHBOUR))
    return _systems_among(system, names, rows)


def _systems_among(
    system: System, names: tuple[str, ...], rows: Sequence[tuple[NDArray[np.float64], VariedHow]]
) -> Variations:
    """Leave out the variations that no system can have."""
    values, how, left_out = [], [], []
    for row, kind in rows:
        changes = dict(zip(names, row.tolist(), strict=True))
        try:
            system.at(changes)
        except ModelError as error:
            differ = ", ".join(f"{name} = {value:g}" for name, value in changes.items() if value != system[name])
            left_out.append(f"left out: {differ} ({str(error).splitlines()[0]})")
            continue
        values.append(row)
        how.append(int(kind))
    return Variations(names, np.array(values).reshape(len(how), len(names)), np.array(how), tuple(left_out))


HOLDS, FAILS, UNKNOWN = 1, 0, -1
"""Outcome of a claim for one variation."""

_CONFIDENCE = 0.95
_SHOWN = 12  # variations in a summary
_MARKS = {HOLDS: "holds", FAILS: "no", UNKNOWN: "?"}


class Luck(NamedTuple):
    """How likely it is that variations fulfil so many claims by chance."""

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
            return "no random neighbours were tried, so the chance of luck is unknown; write neighbours = 200"
        return (
            f"{self.hits} of {self.neighbours:,} random neighbours fulfil {self.score} claims or more "
            f"({self.share:.2%}, at most {self.upper:.2%} with 95 % confidence): the chance that at least one of "
            f"{self.tried:,} variations does so by luck is {self.chance:.0%} (at most {self.at_most:.0%})"
        )


@dataclass(frozen=True)
class ScanCheck:
    """Comparison of the best variations with the exact flow."""

    checked: int = 0  #: Number of settled motions that were classified again with the exact flow.
    different: tuple[str, ...] = ()  #: One sentence for each of them that then got another kind or period.


@dataclass(frozen=True, eq=False, repr=False)
class Scan(Shown):
    """Which claims hold for which variations of a system."""

    system: System  #: The system.
    claims: tuple[AnyClaim, ...]  #: The claims.
    variations: Variations  #: The variations; the first is the system itself.
    #: shape (variations, claims): 1 where a claim holds, 0 where it does not, -1 where it is unknown.
    holds: NDArray[np.int_]
    #: shape (variations, claims): What was found of a claim: the share of starts that settle on its motion, the number
    #: of its special points, a width, a peak, or a difference.
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
        return f"{own_words}; {score} hold with {self.words(best[0])}{more}"

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
            yield f"  claim {number}: {said(claim)}"
        shown = [0, *(index for index in self.best[:_SHOWN] if self.scores[index] > 0)]
        headings = ["variation", *(f"claim {number}" for number in range(1, len(self.claims) + 1)), ">claims"]
        yield Table(headings, [[self.words(index), *self._marks(index), str(self.scores[index])] for index in shown])
        if len(self.best) and (score := int(self.scores[self.best[0]])):
            yield self.luck(score).words
        if self.check.checked:
            yield (
                f"{self.check.checked} motions of the best variations were classified again by the exact flow, "
                f"{len(self.check.different)} of them differently"
            )
        if notes:
            yield from remarks(self.notes, self.failures)

    def _marks(self, index: int) -> Iterator[str]:
        for claim, holds, amount in zip(self.claims, self.holds[index], self.amounts[index], strict=True):
            found = claim.amount_words(float(amount)) if holds != UNKNOWN else ""
            yield _MARKS[int(holds)] + (f" ({found})" if found else "")

    def __repr__(self) -> str:
        return f"Scan({len(self.variations):,} variations: {self.sentence})"
