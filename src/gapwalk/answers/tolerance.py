"""Record of tolerances: where the special points of a response lie when its parameters vary from part to part.

Sobol indices are those of polynomials in the parameters, fitted to a part of the samples and judged by the others
(Sudret, Global sensitivity analysis using polynomial chaos expansions, 2008), by `scipy.stats.sobol_indices`. Where
no polynomial explains a point, or parameters are correlated, the first-order index comes from the samples themselves:
the share of the variance that a polynomial of one parameter explains.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_fit import Form, Patterns, Walked
from gapwalk.answers.point_prediction import ENOUGH, TrackedPoint, Watch, polynomial
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import ModelError, NumericalError
from gapwalk.late_scipy import special_functions
from gapwalk.model.channels.text_table import parse_csv
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit
from gapwalk.picture_parts import Cloud, End, Line, NamedCurve, Panel, Parts, Picture, Series, Shade, pictured
from gapwalk.summary import Rows, SummaryParts, Table, TableRows, Tables, remarks, summarizes

# Distributions of parameters, and samples of them: normal, uniform, triangular, truncated, correlated, or measured.
#
# Samples are independent random draws, so that shares of them have exact confidence intervals. Correlated parameters
# are joined by a Gaussian copula: standard normal numbers with the given correlation matrix, each mapped to its own
# law (Nelsen, An Introduction to Copulas, section 2.3). Between normal laws this is the usual correlation.

Array = NDArray[np.float64]

MAX_PARTS = 1_000_000
"""Largest number of measured parts in a file."""

_LEAST = 1e-10  # eigenvalue of a correlation matrix below which it counts as singular
_ROUNDING = 1e-9  # by which a written correlation matrix may differ from a symmetric one


class SpreadLaw(StrEnum):
    """Law of a parameter that varies from part to part."""

    NORMAL = "normal"
    """About `mean` with the standard deviation `sd`; within `low` and `high` if they are given (truncated)."""
    UNIFORM = "uniform"
    """Between `low` and `high`."""
    TRIANGULAR = "triangular"
    """Between `low` and `high`, most often at `mean`."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Distribution of one parameter.

    Raises
    ------
    ModelError
        If the law lacks a number that it needs, or has a number without meaning for it.

    Examples
    --------
    >>> gw.ask.Spread("stop.clearance", sd=0.05).about(system).mean
    1.0
    >>> gw.ask.Spread("stop.clearance", "uniform", low=0.9, high=1.1).quantile(np.array([0.25, 0.5]))
    array([0.95, 1.  ])
    """

    parameter: str  #: Name of the parameter.
    law: SpreadLaw = SpreadLaw.NORMAL  #: Law of its values; a normal law with `low` or `high` is truncated there.
    sd: float | None = None  #: Standard deviation of a normal law before truncation, in the unit of the parameter.
    #: low, high: Ends of the distribution, in the unit of the parameter.
    low: float | None = None
    high: float | None = None
    #: Mean of a normal law before truncation, or peak of a triangular one; by default the value of the system.
    mean: float | None = None

    def __post_init__(self) -> None:
        if self.law not in list(SpreadLaw):
            raise ModelError(f'law is {self.law!r}; write "normal", "uniform" or "triangular"')
        object.__setattr__(self, "law", SpreadLaw(self.law))
        for name in ("sd", "low", "high", "mean"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ModelError(f"{name} of {self.parameter} is {value}; it must be a finite number")
        if self.law is SpreadLaw.NORMAL:
            if self.sd is None or self.sd <= 0.0:
                raise ModelError(
                    f"sd of {self.parameter} is {self.sd}; a normal law needs one above 0, as in sd = 0.05"
                )
        elif self.low is None or self.high is None:
            raise ModelError(f"low and high of {self.parameter} are needed for a {self.law} law")
        elif self.sd is not None:
            raise ModelError(f"sd of {self.parameter} has no meaning for a {self.law} law; write low and high alone")
        if self.law is SpreadLaw.UNIFORM and self.mean is not None:
            raise ModelError(f"mean of {self.parameter} has no meaning for a uniform law; write low and high alone")
        ends = (-math.inf if self.low is None else self.low, math.inf if self.high is None else self.high)
        if not ends[0] < ends[1]:
            raise ModelError(f"low of {self.parameter} is {self.low}, which is not below high, {self.high}")
        if self.law is SpreadLaw.TRIANGULAR and self.mean is not None and not ends[0] <= self.mean <= ends[1]:
            raise ModelError(f"mean of {self.parameter} is {self.mean}, outside {self.low} to {self.high}")

    def about(self, system: System) -> Spread:
        """Return the distribution with a missing mean replaced by the value of the parameter in a system."""
        value = system[self.parameter]
        return self if self.mean is not None or self.law is SpreadLaw.UNIFORM else replace(self, mean=value)

    def quantile(self, share: Array) -> Array:
        """Return the values below which the given shares (0 to 1) of the manufactured parts lie; it needs the mean."""
        if self.law is SpreadLaw.UNIFORM:
            assert self.low is not None
            assert self.high is not None
            return self.low + share * (self.high - self.low)
        assert self.mean is not None
        if self.law is SpreadLaw.NORMAL:
            assert self.sd is not None
            below, above = (
                default if end is None else (end - self.mean) / self.sd
                for end, default in ((self.low, -math.inf), (self.high, math.inf))
            )
            if below > 0.0:  # in the upper tail shares near 1 would lose their digits: take the mirror image
                low, high = special_functions.ndtr(-above), special_functions.ndtr(-below)
                return self.mean - self.sd * special_functions.ndtri(high - share * (high - low))
            low, high = special_functions.ndtr(below), special_functions.ndtr(above)
            return self.mean + self.sd * special_functions.ndtri(low + share * (high - low))
        assert self.low is not None
        assert self.high is not None
        width, left = self.high - self.low, self.mean - self.low
        rising = self.low + np.sqrt(share * width * left)
        falling = self.high - np.sqrt((1.0 - share) * width * (width - left))
        return np.where(share * width < left, rising, falling)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Samples of some parameters."""

    names: tuple[str, ...]  #: The parameters.
    values: Array  #: shape (samples, parameters): The samples.
    #: shape (samples, parameters): Share of all parts below each value, uniform between 0 and 1; for measured parts,
    #: from their ranks.
    shares: Array
    independent: bool  #: True if the parameters are statistically independent: then Sobol indices are defined.


@dataclass(frozen=True)
class Spreads:
    """Joint distribution of some parameters: a law for each, or the values measured on manufactured parts.

    Raises
    ------
    ModelError
        If `correlation` is no correlation matrix of these parameters, or nothing varies.

    Examples
    --------
    >>> laws = [gw.ask.Spread("stop.clearance", mean=1.0, sd=0.02), gw.ask.Spread("stop.stiffness", mean=20.0, sd=0.4)]
    >>> gw.analysis.Spreads(laws, correlation=[[1.0, 0.5], [0.5, 1.0]]).design(4, seed=0).values.shape
    (4, 2)
    """

    laws: tuple[Spread, ...] = ()  #: A distribution for each parameter.
    #: Correlation matrix of the standard normal numbers from which the values are computed, in the order of `laws`;
    #: empty for independent parameters.
    correlation: tuple[tuple[float, ...], ...] = ()
    #: names, parts: Names of parameters, and one row of their values for each measured part; instead of `laws`.
    names: tuple[str, ...] = ()
    parts: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        if bool(self.laws) == bool(self.parts):
            raise ModelError("spread must be laws of parameters, or rows of measured parts: one of them, and not both")
        names = self.varied
        for name in names:
            if names.count(name) > 1:
                raise ModelError(f"spread has {name} twice; write one law for each parameter")
        if any(len(row) != len(names) for row in self.parts) or not np.isfinite(np.array(self.parts)).all():
            raise ModelError(f"parts needs a finite number for each of {', '.join(names)} in every row")
        if self.correlation:
            self._checked()

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameters that vary."""
        return self.names or tuple(law.parameter for law in self.laws)

    def about(self, system: System) -> Spreads:
        """Return the distribution with the values of a system in place of missing means; see `Spread.about`."""
        for name in self.varied:
            system.structure.place(name)
        return replace(self, laws=tuple(law.about(system) for law in self.laws))

    def design(self, samples: int, seed: int) -> Drawn:
        """Draw samples; the same seed gives the same samples.

        Rows of measured parts are drawn at random; no row is drawn a second time before all were drawn once.
        """
        random = np.random.default_rng(seed)
        if self.parts:
            rows = np.array(self.parts)
            turns = -(-samples // len(rows))
            chosen = np.concatenate([random.permutation(len(rows)) for _ in range(turns)])[:samples]
            ranks = np.argsort(np.argsort(rows, axis=0, kind="stable"), axis=0)
            return Drawn(self.names, rows[chosen], (ranks[chosen] + 0.5) / len(rows), False)
        normal = random.standard_normal((samples, len(self.laws)))
        if self.correlation:
            normal = normal @ np.linalg.cholesky(np.array(self.correlation)).T
        shares = special_functions.ndtr(normal)
        values = np.column_stack([law.quantile(shares[:, k]) for k, law in enumerate(self.laws)])
        matrix = np.array(self.correlation) if self.correlation else np.eye(len(self.laws))
        return Drawn(self.varied, values, shares, not np.any(matrix - np.eye(len(matrix))))

    def _checked(self) -> None:
        size = len(self.laws)
        if len(self.correlation) != size or any(len(row) != size for row in self.correlation):
            raise ModelError(f"correlation must have {size} rows of {size} numbers, in the order of {self.varied}")
        matrix = np.array(self.correlation)
        if np.abs(matrix - matrix.T).max() > _ROUNDING or np.abs(matrix.diagonal() - 1.0).max() > _ROUNDING:
            raise ModelError("correlation must be symmetric with 1 on its diagonal")
        least = float(np.linalg.eigvalsh(matrix)[0])
        if least < _LEAST:
            raise ModelError(
                f"correlation has the eigenvalue {least:.3g}; it is no correlation matrix: all must be above 0"
            )


def spread_doubts(system: System, spreads: object) -> Iterator[str]:
    """Yield a sentence for each law of which a part of the values is none that the parameter can have."""
    for law in spreads.about(system).laws if isinstance(spreads, Spreads) else ():
        refused = list[str]()
        for value in law.quantile(np.linspace(0.005, 0.995, 100)).tolist():
            try:
                system.at({law.parameter: value})
            except ModelError as error:
                refused.append(str(error).partition(":")[0])
        if refused:
            yield (
                f"spread of {law.parameter}: about {len(refused)} % of all parts have a value that is not allowed "
                f"({refused[0]}); they do not count: write a smaller sd, or low and high"
            )


def parts_in(content: bytes, name: str) -> Spreads:
    """Read measured parts from the content of a CSV file: a line with names of parameters, then a row for each part."""
    # Samples are drawn from the rows, so that whatever correlates in them correlates in the samples.
    try:
        table = parse_csv(content, "stage2.clearance,mean.q1", MAX_PARTS)
        columns = table.numbers({name: place for place, name in enumerate(table.heads)})
    except ModelError as error:
        raise ModelError(f"parts in {name!r}: {error}") from None
    if len(columns) != len(table.heads):
        raise ModelError(f"parts in {name!r} names a column twice")
    if not table.rows:
        raise ModelError(f"parts in {name!r} has no rows; write one for each measured part")
    return Spreads(names=table.heads, parts=tuple(map(tuple, np.column_stack([*columns.values()]).tolist())))


# Records of how the special points of many samples of a system are found.


class HowFound(IntEnum):
    """How the special points of one sample were found."""

    TRACKED = 0
    """By predictions, corrected by Newton's method where their error is not known to be small."""
    WALKED = 1
    """By walking the branch of the sample."""
    REFUSED = 2
    """Not at all: the model does not allow these values."""
    FAILED = 3
    """Not all: the walk failed."""
    LOST = 4
    """Not yet."""
    PARTLY = 5
    """Tracked, but for a stretch of the branch that was walked."""


@dataclass(frozen=True, eq=False)
class Further:
    """A special point of a sample that has no nominal counterpart."""

    sample: int  #: Number of the sample.
    kind: str  #: Name of its kind.
    value: float  #: Value of the parameter.


@dataclass(frozen=True, eq=False)
class ToleranceWalks:
    """Walked branches of some samples."""

    number: int  #: Number of the chunk.
    walked: tuple[Walked, ...]  #: The samples.


@dataclass(frozen=True, eq=False)
class ToleranceChunk:
    """Special points of some samples."""

    number: int  #: Number of the chunk.
    rows: NDArray[np.intp]  #: Numbers of the samples.
    values: Array  #: shape (samples, points): Value of the parameter at each point; nan where it does not exist.
    errors: Array  #: shape (samples, points): Bounds of their errors.
    how: NDArray[np.intp]  #: shape (samples,): Values of `HowFound`.
    further: tuple[Further, ...] = ()  #: Special points without nominal counterpart.


@dataclass(frozen=True, eq=False)
class Tracking:
    """The nominal special points, and how those of samples are found."""

    key: str  #: Text that no other tracking has: a process prepares the same points only once.
    system: System  #: The nominal system.
    names: tuple[str, ...]  #: The parameters that vary.
    first: Orbit  #: Nominal orbit from which the branch is walked.
    #: parameter, begin, end: The branch.
    parameter: str
    begin: float
    end: float
    specials: tuple[SpecialPoint, ...]  #: The nominal points that are tracked.
    deviations: Array  #: Standard deviations of the parameters.
    walk: WalkOptions  #: Options of the walks.
    accuracy: float = 2.0 * ENOUGH  #: Largest error of a value, as a share of it.
    forms: tuple[Form, ...] = ()  #: Forms of all points; empty for the walks.
    #: Which of the forms found in a sample lie on its branch; None for the first solutions.
    patterns: Patterns | None = None
    watches: tuple[Watch, ...] = ()  #: Where further points may be born.

    @property
    def width(self) -> float:
        """Width of the range."""
        return abs(self.end - self.begin)

    @property
    def labels(self) -> list[tuple[object, ...]]:
        """Properties that a point shares with its counterpart."""
        return [label_of(special) for special in self.specials]

    def at(self, values: Array) -> System:
        """Return the system of a sample at the beginning of its branch; raise a ModelError if it is not allowed."""
        return self.system.at({**dict(zip(self.names, values.tolist(), strict=True)), self.parameter: self.begin})


def label_of(special: SpecialPoint) -> tuple[object, ...]:
    """Return kind, contact, and the side to which a fold opens; of other kinds, if it makes the branch less stable."""
    turns = special.nature if special.kind.is_turning else np.sign(special.after.total - special.before.total)
    return special.kind, special.contact, str(turns)


def trackable(branch: Branch, names: Sequence[str]) -> tuple[tuple[SpecialPoint, ...], tuple[str, ...]]:
    """Return the special points of a branch that can be tracked, and a sentence for each that cannot."""
    points, failures = [], []
    for special in branch.special_points:
        try:
            TrackedPoint.of(special, names)
            points.append(special)
        except (ModelError, NumericalError) as error:
            failures.append(f"the {special.kind} at {special.value:.8g} is not tracked: {error}")
    return tuple(points), tuple(failures)


_CONFIDENCE = 0.95
_EXPLAINED = 0.95  # share of the variance that a polynomial must explain for Sobol indices of it
_TEST = 5  # one of so many samples judges a polynomial that was fitted to the others
_BASE = 4096  # samples of each matrix of the Saltelli design; its evaluations are of a polynomial
_ALONE = 4  # degree of a polynomial of one parameter
_DEGREES = (3, 2, 1)
_FEW = 2.0  # samples for each term of a polynomial
_MOST = 3  # parameters that a line names
_FAINT = 0.01  # index below which a parameter does not matter


class Chance(NamedTuple):
    """Probability with its confidence interval."""

    #: count, samples: Samples in which it happened, and all samples that count.
    count: int  # pyright: ignore[reportIncompatibleMethodOverride] - a probability has no use for tuple.count
    samples: int
    #: value, low, high: Share, and ends of the interval of Clopper and Pearson (1934), which contains the probability
    #: in 95 % of cases.
    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{100.0 * self.value:.3g} % ({100.0 * self.low:.3g} to {100.0 * self.high:.3g} %)"


def chance_of(count: int, samples: int) -> Chance:
    """Return the probability of something that happened `count` times in independent samples."""
    if not 0 <= count <= samples or not samples:
        raise ModelError(f"count is {count} of {samples} samples; write samples > 0, and a count from 0 to samples")
    beyond = 0.5 * (1.0 - _CONFIDENCE)  # on either side of the exact interval (Clopper and Pearson 1934)
    low = float(special_functions.betaincinv(count, samples - count + 1, beyond)) if count else 0.0
    high = float(special_functions.betaincinv(count + 1, samples - count, 1.0 - beyond)) if count < samples else 1.0
    return Chance(count, samples, count / samples, low, high)


@dataclass(frozen=True, eq=False)
class Influences:
    """Sobol indices of one special point."""

    first: Array  #: shape (parameters,): Share of the variance that each parameter causes alone.
    total: Array  #: shape (parameters,): Share that each causes with all its interactions; nan if unknown.
    #: Share of the variance that the polynomial behind the indices does not explain: about their error.
    unexplained: float


@dataclass(frozen=True)
class ToleranceCheck:
    """Comparison of tracked samples with walks of their branches."""

    checked: int = 0  #: Random tracked samples whose branches were walked.
    largest: float = 0.0  #: Largest difference of a tracked point from that of the walk.
    different: tuple[str, ...] = ()  #: A sentence for each sample in which the walk has other points, or failed.


@dataclass(frozen=True, eq=False)
class Tolerance(Shown):
    """Distribution of the special points of a response, when parameters vary from part to part."""

    branch: Branch  #: The nominal branch.
    spreads: Spreads  #: Distribution of the parameters.
    points: tuple[SpecialPoint, ...]  #: The nominal special points.
    samples: Array  #: shape (samples, parameters): Values of the parameters.
    shares: Array  #: shape (samples, parameters): Share of all parts below each of these values.
    #: shape (samples, points): Value of the branch's parameter at each special point; nan where it does not exist.
    values: Array
    how: NDArray[np.intp]  #: shape (samples,): How the points of a sample were found; values of `HowFound`.
    further: tuple[Further, ...] = ()  #: Points of samples that have no nominal counterpart.
    #: A band of the branch's parameter in which no point should lie; None if none was asked for.
    band: tuple[float, float] | None = None
    check: ToleranceCheck = ToleranceCheck()  #: Tracked samples that were walked for comparison.
    complete: bool = True  #: True if all samples were done.
    #: notes, failures: Remarks and failures, in sentences.
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    #: shape (samples, points), or empty: Bounds of the errors of the values.
    errors: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def _check_read(self) -> None:
        """Raise a ValueError if its arrays do not fit together."""
        count, points = len(self.samples), len(self.points)
        if self.samples.shape != self.shares.shape or self.samples.shape != (count, len(self.names)):
            raise ValueError("samples and parameters do not fit together")
        if self.values.shape != (count, points) or self.how.shape != (count,):
            raise ValueError("samples and special points do not fit together")
        if self.errors.size and self.errors.shape != self.values.shape:
            raise ValueError("values and their errors do not fit together")

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that vary."""
        return self.spreads.varied

    @property
    def parameter(self) -> str:
        """Parameter of the branch."""
        return self.branch.parameter

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """True for samples whose points are known: tracked or walked."""
        return np.isin(self.how, (HowFound.TRACKED, HowFound.WALKED, HowFound.PARTLY))

    def quantiles(self, *shares: float) -> Array:
        """Return the values below which a point lies in given shares of the samples that have it: (shares, points)."""
        # A point that exists in no sample has nan.
        found = np.full((len(shares), len(self.points)), np.nan)
        for j, column in enumerate(self._columns):
            if len(column):
                found[:, j] = np.quantile(column, shares)
        return found

    @cached_property
    def exists(self) -> tuple[Chance, ...]:
        """Probability that each point exists."""
        return tuple(chance_of(len(column), int(self.known.sum())) for column in self._columns)

    def chances(self, low: float, high: float) -> tuple[Chance, ...]:
        """Return the probability that each point lies in a band, ends included."""
        inside = [int(np.sum((column >= low) & (column <= high))) for column in self._columns]
        return tuple(chance_of(count, int(self.known.sum())) for count in inside)

    def chance(self, low: float, high: float, kind: str = "fold") -> Chance:
        """Return the probability that any point of a kind lies in a band; by default a fold, at which motions jump."""
        # Further points are counted too. A tracked sample may have one that was not noticed: see `check`.
        columns = [j for j, special in enumerate(self.points) if special.kind.value == kind]
        inside = np.any((self.values[:, columns] >= low) & (self.values[:, columns] <= high), axis=1)
        for each in self.further:
            if each.kind == kind and low <= each.value <= high:
                inside[each.sample] = True
        return chance_of(int(inside[self.known].sum()), int(self.known.sum()))

    @cached_property
    def influences(self) -> tuple[Influences, ...]:
        """Sobol indices of each point."""
        return tuple(self._influences(j) for j in range(len(self.points)))

    @property
    def varies_most(self) -> int | None:
        """Index of the point whose middle 90 % are widest, relative to its median; None if no point has two values."""
        low, median, high = self.quantiles(0.05, 0.5, 0.95)
        widths = [
            float((b - a) / abs(middle)) if len(column) > 1 and middle else -1.0
            for a, middle, b, column in zip(low, median, high, self._columns, strict=True)
        ]
        return int(np.argmax(widths)) if max(widths, default=-1.0) > 0.0 else None

    def words(self, index: int) -> str:
        """Name the parameters that matter most for a point, with their first-order indices."""
        first = self.influences[index].first
        order = [k for k in np.argsort(-np.nan_to_num(first), kind="stable")[:_MOST] if first[k] >= _FAINT]
        return ", ".join(f"{self.names[k]} {first[k]:.2f}" for k in order)

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the distribution of each point, the probability of a jump in the band, and how sure; and the notes."""
        units = self.branch.system.units
        symbol, known = parameter_symbol(self.parameter, units), int(self.known.sum())
        if self.band is not None and known:
            low, high = self.band
            chance = self.chance(low, high)
            yield f"a jump (fold) lies between {symbol} = {low:g} and {high:g} in {chance} of all parts"
        elif (most := self.varies_most) is not None:
            special, (low, high) = self.points[most], self.quantiles(0.05, 0.95)[:, most]
            name = f"{special.kind}{f' of {special.contact}' if special.contact else ''}"
            yield (
                f"the {name} at {symbol} = {special.value:.6g} varies most: in 90 % of the parts that have it, it lies "
                f"between {low:.6g} and {high:.6g}"
            )
        counts = {way: int(np.sum(self.how == way)) for way in HowFound}
        yield (
            f"{len(self.samples):,} samples of {len(self.names)} parameters: {counts[HowFound.TRACKED]:,} tracked, "
            f"{counts[HowFound.PARTLY]:,} tracked and walked in part, {counts[HowFound.WALKED]:,} walked, "
            f"{counts[HowFound.REFUSED]:,} refused, {counts[HowFound.FAILED] + counts[HowFound.LOST]:,} failed"
        )
        if known:
            low, high = self.quantiles(0.05, 0.95)
            rows = [
                [
                    f"{special.kind}{f' {special.contact}' if special.contact else ''}",
                    f"{special.value:.6g}",
                    f"{np.mean(column):.6g}" if len(column) else "",
                    f"{np.std(column, ddof=1):.3g}" if len(column) > 1 else "",
                    f"{low[j]:.6g}" if len(column) else "",
                    f"{high[j]:.6g}" if len(column) else "",
                    f"{100.0 * self.exists[j].value:.4g} %",
                    self.words(j),
                ]
                for j, (special, column) in enumerate(zip(self.points, self._columns, strict=True))
            ]
            heads = (
                "point",
                f">{symbol}",
                ">mean",
                ">sd",
                ">5 %",
                ">95 %",
                ">exists",
                "what matters most (first order)",
            )
            yield Table(heads, rows)
        yield from self._doubts()
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Tables:
        """Return the tables of the points, of their indices, and of all samples."""
        return {
            "points": TableRows(self._point_rows, units=dict.fromkeys(("mean", "sd", "quantile."), self.parameter)),
            "indices": self._index_rows,
            "samples": self._sample_rows,
        }

    def __repr__(self) -> str:
        return (
            f"Tolerance({len(self.points)} special points of {self.parameter}, {len(self.samples):,} samples of "
            f"{', '.join(self.names)})"
        )

    @cached_property
    def _columns(self) -> list[Array]:
        values = self.values[self.known]
        return [column[~np.isnan(column)] for column in values.T]

    def _doubts(self) -> SummaryParts:
        check = self.check
        if check.checked:
            wrong = chance_of(len(check.different), check.checked)
            yield (
                f"{check.checked} tracked samples were walked for comparison: {len(check.different)} differ (at most "
                f"{100.0 * wrong.high:.2g} % of all), the points of the others by {check.largest:.1g} at most"
            )
            yield from (f"  {text}" for text in check.different)
        tracked = int(np.sum(np.isin(self.how, (HowFound.TRACKED, HowFound.PARTLY))))
        if tracked > check.checked:
            yield (
                f"note: the other {tracked - check.checked:,} tracked samples were not walked. Their special points "
                "are those of walked samples; a special point that no walk has met is missing"
            )
        if self.further:
            count = len({each.sample for each in self.further if self.known[each.sample]})
            kinds = sorted({each.kind for each in self.further})
            yield (
                f"note: {100.0 * count / max(1, int(self.known.sum())):.3g} % of the samples have special "
                f"points that the nominal system lacks ({', '.join(kinds)})"
            )
        if np.any(doubtful := [each.unexplained > 1.0 - _EXPLAINED for each in self.influences]):
            names = ", ".join(f"{self.points[j].value:.6g}" for j in np.flatnonzero(doubtful))
            yield f"note: no polynomial fits the points at {names}; their Sobol indices are those of single parameters"

    def _influences(self, index: int) -> Influences:
        column = self.values[:, index]
        kept = ~np.isnan(column) & self.known
        size = len(self.names)
        values = column[kept]
        if len(values) <= 4 * size or float(np.var(values)) == 0.0:
            return Influences(np.full(size, np.nan), np.full(size, np.nan), 1.0)
        low, width = self._scaling
        x = (self.samples[kept] - low) / width
        if self._independent:
            found = self._by_polynomial(x, values)
            if found is not None and found.unexplained <= 1.0 - _EXPLAINED:
                return found
        first = np.array([_explained(x[:, [k]], values, _ALONE) for k in range(size)])
        return Influences(first, np.full(size, np.nan), 1.0)

    def _by_polynomial(self, x: Array, values: Array) -> Influences | None:
        """Return the indices of a polynomial that was fitted to most samples and judged by the rest."""
        from scipy.stats import sobol_indices

        judged = np.arange(len(x)) % _TEST == 0
        scaling = self._scaling
        for degree in _DEGREES:
            terms = polynomial(x, degree)
            if np.sum(~judged) < _FEW * terms.shape[1]:
                continue
            coefficients = np.asarray(np.linalg.lstsq(terms[~judged], values[~judged])[0], dtype=float)
            rest = values[judged] - terms[judged] @ coefficients
            unexplained = float(np.var(rest) / np.var(values))

            def function(
                points: Array, c: Array = coefficients, d: int = degree, s: tuple[Array, Array] = scaling
            ) -> Array:
                return polynomial((points.T - s[0]) / s[1], d) @ c

            laws = self.spreads.about(self.branch.system).laws
            if len(laws) == 1:  # it explains all that is explained; SciPy's indices need two
                return Influences(np.ones(1), np.ones(1), unexplained)
            found = sobol_indices(
                func=function, n=_BASE, dists=[_Law(law) for law in laws], rng=np.random.default_rng(0)
            )
            return Influences(np.ravel(found.first_order), np.ravel(found.total_order), unexplained)
        return None

    @cached_property
    def _independent(self) -> bool:
        """True if no parameter says anything about another one."""
        size = len(self.spreads.laws)
        matrix = np.array(self.spreads.correlation) if self.spreads.correlation else np.eye(size)
        return bool(size) and not np.any(matrix - np.eye(size))

    @cached_property
    def _scaling(self) -> tuple[Array, Array]:
        return self.samples.mean(axis=0), np.maximum(self.samples.std(axis=0), np.finfo(float).tiny)

    def _point_rows(self) -> Rows:
        shares = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
        quantiles = self.quantiles(*shares)
        band = [] if self.band is None else ["in.band", "in.band.low", "in.band.high"]
        heads = [f"quantile.{share:g}" for share in shares]
        yield ["kind", "contact", self.parameter, "mean", "sd", *heads, "exists", "exists.low", "exists.high", *band]
        chances = None if self.band is None else self.chances(*self.band)
        for j, (special, column) in enumerate(zip(self.points, self._columns, strict=True)):
            row = [special.kind.value, special.contact, special.value]
            row += [
                float(np.mean(column)) if len(column) else "",
                float(np.std(column, ddof=1)) if len(column) > 1 else "",
            ]
            row += [*quantiles[:, j].tolist(), *self.exists[j][2:]]
            yield row if chances is None else [*row, *chances[j][2:]]

    def _index_rows(self) -> Rows:
        yield ["kind", self.parameter, "parameter", "first.order", "total.order", "unexplained"]
        for special, found in zip(self.points, self.influences, strict=True):
            for k, name in enumerate(self.names):
                total = float(found.total[k])
                yield [
                    special.kind.value,
                    special.value,
                    name,
                    float(found.first[k]),
                    "" if np.isnan(total) else total,
                    found.unexplained,
                ]

    def _sample_rows(self) -> Rows:
        points = [f"{special.kind.value}.{j + 1}" for j, special in enumerate(self.points)]
        yield [*self.names, *points, "found"]
        for sample, values, how in zip(self.samples.tolist(), self.values.tolist(), self.how.tolist(), strict=True):
            yield [*sample, *("" if np.isnan(value) else value for value in values), HowFound(how).name.lower()]


class _Law:
    """Distribution of a parameter as `scipy.stats.sobol_indices` asks for it."""

    def __init__(self, law: Spread) -> None:
        self.ppf = law.quantile


def _explained(x: Array, values: Array, degree: int) -> float:
    """Return the share of the variance that a polynomial explains, corrected for its number of terms."""
    terms = polynomial(x, degree)
    rest = values - terms @ np.linalg.lstsq(terms, values)[0]
    freedom = len(values) - terms.shape[1]
    return max(0.0, 1.0 - float(rest @ rest) / freedom / float(np.var(values, ddof=1))) if freedom > 0 else np.nan


_SAID = 2  # points that the sentences name
_DOTS = 600  # of the cloud of one point
BINS = 60  # classes of a distribution, at most


@pictured(Tolerance, forms=())
def tolerance_picture(found: Tolerance, measure: str = "") -> Picture:
    """Describe the nominal response with the cloud of each special point, and the distributions below."""
    system = found.branch.system
    named = found.band is None and found.known.any()
    said = [f"{_title(found, k)}: {_words(found, k)[1]}" for k in range(len(found.points) if named else 0)]
    return Picture(
        system,
        (found.parameter, measure or shown_measure(system, found)),
        [NamedCurve(f"P{found.branch.period}-1", found.branch)],
        partial(_parts_of_picture, found),
        sentences=said[:_SAID],
        script="(record.branch,)",
    )


def _title(found: Tolerance, index: int) -> str:
    return f"{found.points[index].kind} {found.points[index].contact}".rstrip()


def _parts_of_picture(found: Tolerance) -> Parts:
    if not found.known.any():
        return Parts()
    over, unit = found.parameter, _unit(found)
    return Parts(
        shades=[Shade(over, *found.band, "goal", "band in which no fold should lie")] if found.band else [],
        lines=[Line(over, value, f"{value:.6g}") for value in found.band or ()],
        clouds=[_cloud(found, index) for index in range(len(found.points))],
        ends=[
            End(f"{each.value:.7g} {unit}".rstrip(), each.kind.value, each, found.words(index))
            for index, each in enumerate(found.points)
        ],
        below=[Panel("distribution", over, list(_distributions(found)))],
        within={over: reach(found)},
    )


def _unit(found: Tolerance) -> str:
    units = found.branch.system.units
    return units.parameter(found.parameter) if units else ""


def reach(found: Tolerance) -> tuple[float, float]:
    """Return the range of a picture: that of the branch, and most of each distribution."""
    values = found.branch.values
    ends = [float(values.min()), float(values.max())]
    some = found.quantiles(0.003, 0.997)
    if not np.isnan(some).all():
        ends = [min(ends[0], float(np.nanmin(some))), max(ends[1], float(np.nanmax(some)))]
    return ends[0], ends[1]


def _words(found: Tolerance, index: int) -> list[str]:
    """Return the quantiles of a point, the probability that it exists or lies in the band, and what matters."""
    column, unit = found._columns[index], _unit(found)
    lines = [f"nominal {found.points[index].value:.7g} {unit}".rstrip()]
    if len(column):
        low, middle, high = np.quantile(column, (0.05, 0.5, 0.95))
        where = f"from {low:.6g} to {high:.6g}, half below {middle:.6g} {unit}".rstrip()
        lines.append(f"in 90 % of the parts that have it {where}")
    lines.append(f"exists in {found.exists[index]} of all parts")
    if found.band is not None:
        lines.append(f"in the band in {found.chances(*found.band)[index]}")
    return [*lines, f"what matters: {words}"] if (words := found.words(index)) else lines


def _cloud(found: Tolerance, index: int) -> Cloud:
    column, special = found._columns[index], found.points[index]
    every = max(1, -(-len(column) // _DOTS))
    quantiles = np.quantile(column, (0.05, 0.5, 0.95)) if len(column) else []
    words, title = _words(found, index), _title(found, index)
    return Cloud(found.parameter, special.kind.value, title, column[::every], quantiles, words, special)


def _distributions(found: Tolerance) -> Iterator[Series]:
    """Yield the distribution of each point, the highest of its classes being 1."""
    seen = set[str]()
    for index, special in enumerate(found.points):
        column = found._columns[index]
        if len(column) < 2 or np.ptp(np.quantile(column, (0.01, 0.99))) == 0.0:
            continue
        low, high = np.quantile(column, (0.01, 0.99))
        wide = 0.5 * (high - low)  # beyond this, single parts lie: they would widen all classes
        ends = max(low - wide, float(column.min())), min(high + wide, float(column.max()))
        heights, edges = np.histogram(column, min(BINS, max(5, int(np.sqrt(len(column))))), ends)
        x, y = np.repeat(edges, 2), np.concatenate(([0.0], np.repeat(heights / heights.max(), 2), [0.0]))
        text = "" if special.kind.value in seen else f"{special.kind}: distribution"
        seen.add(special.kind.value)
        yield Series(x, y, "area", f"kind-{special.kind.value}", text)
