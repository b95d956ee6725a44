"""Distributions of parameters, and samples of them: normal, uniform, triangular, truncated, correlated, or measured.

Samples are independent random draws, so that shares of them have exact confidence intervals. Correlated parameters are
joined by a Gaussian copula: standard normal numbers with the given correlation matrix, each mapped to its own law
(Nelsen, An Introduction to Copulas, section 2.3). Between normal laws this is the usual correlation.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gapwalk.errors import ModelError
from gapwalk.files import content_of
from gapwalk.model.measured.measured_table import parse_csv
from gapwalk.model.system import System

Array = NDArray[np.float64]

MAX_PARTS = 1_000_000
"""Largest number of measured parts in a file."""
MAX_BYTES = 500_000_000
"""Largest size of such a file; a longer one is refused because its last row is cut."""

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
        If the numbers do not fit the law.

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
        """Return the distribution with the value of a system for a missing mean."""
        value = system[self.parameter]
        return self if self.mean is not None or self.law is SpreadLaw.UNIFORM else replace(self, mean=value)

    def quantile(self, share: Array) -> Array:
        """Return the values below which the given shares (0 to 1) of the parts lie; the mean must be known."""
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
                low, high = special.ndtr(-above), special.ndtr(-below)
                return self.mean - self.sd * special.ndtri(high - share * (high - low))
            low, high = special.ndtr(below), special.ndtr(above)
            return self.mean + self.sd * special.ndtri(low + share * (high - low))
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
    independent: bool  #: True if no parameter says anything about another one: then Sobol indices are defined.


@dataclass(frozen=True)
class Spreads:
    """Joint distribution of some parameters: a law for each, or measured parts.

    Raises
    ------
    ModelError
        If the matrix is no correlation matrix of these parameters, or nothing varies.

    Examples
    --------
    >>> laws = [gw.ask.Spread("stop.clearance", mean=1.0, sd=0.02), gw.ask.Spread("stop.stiffness", mean=20.0, sd=0.4)]
    >>> gw.analysis.Spreads(laws, correlation=[[1.0, 0.5], [0.5, 1.0]]).design(4, seed=0).values.shape
    (4, 2)
    """

    laws: tuple[Spread, ...] = ()  #: A distribution for each parameter.
    #: Correlation matrix of the standard normal numbers behind the laws, in the order of `laws`; empty for independent
    #: parameters.
    correlation: tuple[tuple[float, ...], ...] = ()
    #: names, parts: Parameters and their values, part by part, of measured parts; instead of `laws`.
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
        """Return the distribution with the values of a system for missing means; see `Spread.about`."""
        for name in self.varied:
            system.structure.place(name)
        return replace(self, laws=tuple(law.about(system) for law in self.laws))

    def design(self, samples: int, seed: int) -> Drawn:
        """Draw samples, the same for the same seed.

        Of measured parts, rows are drawn at random, each again only once all were drawn.
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
        shares = special.ndtr(normal)
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
                f"correlation has the eigenvalue {least:.3g}; no parameters are correlated so, all must be above 0"
            )


def spread_in_percent(system: System, percent: float, parameters: Sequence[str]) -> tuple[Spread, ...]:
    """Return normal laws about the values of a system, with standard deviations in percent of them.

    Parameters
    ----------
    system
        The system.
    percent
        Standard deviation in percent of the value.
    parameters
        Names of the parameters.

    Returns
    -------
    tuple of Spread
        One law for each parameter.

    Raises
    ------
    ModelError
        For an unknown parameter, or one that is zero.
    """
    return tuple(Spread(name, sd=abs(system[name]) * percent / 100.0, mean=system[name]) for name in parameters)


def measured_parts(path: str | os.PathLike[str]) -> Spreads:
    r"""Read measured parts from a CSV file: a line with names of parameters, then one row for each part.

    The numbers are in the units of the model's parameters. Samples are drawn from the rows, so that whatever
    correlates in them correlates in the samples.

    Parameters
    ----------
    path
        The file; its first line names the parameters.

    Returns
    -------
    Spreads
        Their joint distribution.

    Raises
    ------
    ModelError
        If the file cannot be read, or an entry is no finite number.
    """
    try:
        content = content_of(path, MAX_BYTES, "give fewer parts")
    except ValueError as error:
        raise ModelError(f"{os.fspath(path)} {error}") from None
    return parts_in(content, os.fspath(path))


def parts_in(content: bytes, name: str) -> Spreads:
    """Read measured parts from the content of a CSV file of some name; see `measured_parts`."""
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
