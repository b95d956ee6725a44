"""Threshold: the value of a parameter beyond which gaps no longer rattle over a whole range of another one.

The record of the limit with its evidence; `gapwalk.answers.threshold_search` finds it.

Method: docs/howto/studies.md
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

from gapwalk.bifurcation.loci.gradient import Gradient
from gapwalk.bifurcation.loci.locus import Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import range_words, value_words
from gapwalk.notebook import Shown
from gapwalk.summary import Rows, SummaryParts, Tables, remarks, summarizes

_SMOOTH = 1e-6  # error of a limit, relative to the range, above which its locus was not smooth there


@dataclass(frozen=True, slots=True)
class ThresholdOptions:
    """Options of a threshold.

    Examples
    --------
    >>> gw.ask.ThresholdOptions(values=12, starts=6).values
    12
    """

    values: int = 24  #: Values of the other parameter at which motions are tried.
    starts: int = 10  #: Starts at each of them: rest, and states spread over a box.
    #: Number of forcing periods in which motions may become periodic. Those that have not are followed up to 60 times
    #: as long.
    periods: int = 600
    rounds: int = 6  #: The most borders that are followed one after the other.
    seed: int = 0  #: Seed of the starts.

    def __post_init__(self) -> None:
        for name, least in (("values", 4), ("starts", 2), ("periods", 16), ("rounds", 1), ("seed", 0)):
            given = getattr(self, name)
            if isinstance(given, bool) or not isinstance(given, int) or given < least:
                raise ModelError(f"{name} is {given!r}; it must be an integer >= {least}")


class Confirmation(NamedTuple):
    """Motions that were tried, such as those just beyond a threshold.

    Examples
    --------
    >>> tried = threshold.confirmation
    >>> tried.motions, tried.rattling
    (12, 0)
    """

    value: float  #: Value of the parameter; of several, the last one.
    #: motions, starts: Number of motions, and of starts at each pair of values.
    motions: int
    starts: int
    rattling: int  #: Number of those that rattle once they have settled.
    #: restless, lost: Number of those that did not become periodic, and of those that diverge; the others are settled.
    restless: int
    lost: int
    waited: int  #: Largest number of forcing periods of the transients, before the gaps were observed.
    checked: int  #: Number of quiet motions that were confirmed by the exact flow too.
    error: float  #: Error of the batch integrator over a forcing period of settled motions, relative to their size.

    @property
    def settled(self) -> int:
        """Number of motions that became periodic: of these it is known whether they rattle."""
        return self.motions - self.restless - self.lost

    @property
    def words(self) -> str:
        """Description of how the motions were tried."""
        text = f"{self.starts} starts at each place, followed until they repeat, for at most {self.waited} periods"
        if self.restless:
            text += f"; {self.restless} had not settled by then, of which nothing is said"
        if self.lost:
            text += f"; {self.lost} diverged, of which nothing is said"
        if self.error:
            text += f"; error {self.error:.0e} a period"
        return text + (f"; {self.checked} watched by the exact flow too" if self.checked else "")


@dataclass(frozen=True, eq=False, repr=False)
class Threshold(Shown):
    """Value of a parameter beyond which gaps do not rattle over a range of another one.

    Examples
    --------
    >>> round(threshold.value, 6), round(threshold.at, 6), str(threshold.limit.kind)
    (0.099875, 0.997497, 'grazing')
    >>> threshold.confirmation.rattling  # of the motions that were tried just beyond
    0
    """

    system: System  #: The system.
    gaps: tuple[str, ...]  #: Names of the contacts concerned.
    #: parameter, begin, end: The parameter and its range, from the side that rattles to the side that is quiet.
    parameter: str
    begin: float
    end: float
    #: over, low, high: The other parameter, and its range.
    over: str
    low: float
    high: float
    #: The special point at the threshold, of the branch along `parameter`; None if there is no threshold in the range.
    limit: SpecialPoint | None
    at: float  #: Value of the other parameter at the limit.
    uncertainty: float  #: Estimated error of the threshold.
    is_edge: bool  #: True if the limit lies at an end of the other parameter's range, beyond which it would be farther.
    loci: tuple[Locus, ...]  #: Loci that were followed, the decisive one last.
    confirmation: Confirmation | None  #: Motions that were tried just beyond it.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.

    @property
    def value(self) -> float:
        """The threshold; nan if there is none in the range."""
        return math.nan if self.limit is None else self.limit.value

    @property
    def failures(self) -> tuple[str, ...]:
        """Reason why there is no confirmed threshold, as sentences."""
        found = self.confirmation
        if found is None or not found.rattling:
            return ()
        where = "beyond it" if self.limit is not None else "in the range"
        return (f"{found.rattling} of {found.motions} motions rattle {where}, and their border could not be followed",)

    def gradient(self, *names: str) -> Gradient:
        """Return how far other parameters move the threshold; see `SpecialPoint.gradient`.

        At an extremum the slope by the other parameter is zero, so these are the slopes of the limit itself.

        Parameters
        ----------
        *names
            The parameters; by default all that are not zero.
        """
        if self.limit is None:
            raise ModelError("there is no threshold in the range, so it has no gradient")
        return self.limit.gradient(*names)

    @property
    def complete(self) -> bool:
        """True: a threshold has one part."""
        return True

    def tables(self) -> Tables:
        """Return the table of the loci: both parameters at each of their points."""
        return {"loci": self._rows}

    def _rows(self) -> Rows:
        yield ["locus", "kind", self.over, self.parameter]
        for number, locus in enumerate(self.loci, start=1):
            for value, other in locus.values.tolist():
                yield [number, str(locus.kind), other, value]

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        units = self.system.units
        gaps, over = " and ".join(self.gaps), range_words((self.low, self.high), self.over, units)
        verb = "does" if len(self.gaps) == 1 else "do"
        if self.limit is None:
            return f"{gaps}: no threshold of {range_words((self.begin, self.end), self.parameter, units)} over {over}"
        way = "and above" if self.end > self.begin else "and below"
        return (
            f"{gaps} {verb} not rattle over {over} at "
            f"{value_words(self.value, self.parameter, units, 7)} {way} "
            f"(limit: {self.limit.kind.value} at {value_words(self.at, self.over, units, 7)})"
        )

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the answer, its evidence, and what moves it most; with the notes or without."""
        yield self.sentence
        units = self.system.units
        unit = units.parameter(self.parameter) if units else ""
        if self.limit is not None:
            place = ", at the end of the range: beyond it the limit is farther" if self.is_edge else ""
            yield f"error of the limit {self.uncertainty:.0e}{f' {unit}' if unit else ''}{place}"
        if (found := self.confirmation) is not None and not found.rattling:
            share = min(300.0 / max(found.settled, 1), 100.0)
            yield (
                f"confirmed at {value_words(found.value, self.parameter, units, 7)}: none of {found.settled:,} settled "
                f"motions rattles there, so with 95 % confidence fewer than {share:.2g} % of such starts do"
            )
            yield f"({found.words})"
        if self.limit is not None and self.uncertainty > _SMOOTH * abs(self.end - self.begin):
            yield "the limit is a corner of its locus, such as a cusp, so it has no slopes"
        elif self.limit is not None:
            with suppress(NumericalError, ModelError):
                yield f"what moves it most, in percent for one percent more: {self.gradient().words(5)}"
        if notes:
            yield from remarks(self.notes, self.failures)

    def __repr__(self) -> str:
        return f"Threshold({self.sentence})"
