"""A value over the speed, from a table: a smooth curve through its points, and no value outside of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError

MAX_POINTS = 1000
"""Largest number of points of a table."""

_ROUNDING = 1e-9  # of the range: a speed so close to an end of it, as after a conversion of units, is within


@dataclass(frozen=True)
class SpeedTable:
    """A value over the speed: a cubic through points, which rises and falls only where they do.

    The slopes at the points are those of Fritsch and Butland (1984), as in `scipy.interpolate.PchipInterpolator`. The
    derivative is continuous. A complex speed is evaluated by the piece in which its real part is, so that derivatives
    by complex steps are exact.

    Raises
    ------
    ModelError
        If there are not 2 to 1,000 points with speeds that increase.

    Examples
    --------
    >>> table = gw.loads.SpeedTable((700.0, 2000.0, 6000.0), (30.0, 55.0, 60.0), "gas.csv", "rpm")
    >>> float(table.value(2000.0)), table.covers(6120.0)
    (55.0, False)
    """

    speeds: tuple[float, ...]  #: shape (points,): Increasing.
    values: tuple[float, ...]  #: shape (points,): The value at each.
    name: str = "over the speed"  #: Name of the table in messages.
    unit: str = ""  #: The unit of the speeds in messages; empty for plain numbers.

    def __post_init__(self) -> None:
        speeds, values = _row(self.speeds, "speeds"), _row(self.values, "values")
        problem = _problem(speeds, values)
        if problem:
            raise ModelError(f"the table {self.name}: {problem}")
        object.__setattr__(self, "speeds", speeds)
        object.__setattr__(self, "values", values)

    def covers(self, speed: ArrayLike) -> bool:
        """Return True if all speeds are within the table."""
        x = np.real(np.asarray(speed))
        slack = _ROUNDING * (self.speeds[-1] - self.speeds[0])
        return bool(np.all((x >= self.speeds[0] - slack) & (x <= self.speeds[-1] + slack)))

    def value(self, speed: ArrayLike, *, continued: bool = False) -> Any:
        """Return the value at some speeds, of their shape; real, or complex for derivatives.

        Parameters
        ----------
        speed
            The speeds.
        continued
            True to continue the first and the last piece beyond the table.

        Returns
        -------
        array
            Values, of the shape of the speeds.
        """
        (cubic, quadratic, slope, value), d = self._piece(speed, continued)
        return (value + d * (slope + d * (quadratic + d * cubic)))[()]

    def slope(self, speed: ArrayLike) -> Any:
        """Return the derivative of the value by the speed; errors as of `value`.

        Parameters
        ----------
        speed
            Speeds of any shape, within the table.

        Returns
        -------
        array
            Slopes, of the same shape.
        """
        (cubic, quadratic, slope, _), d = self._piece(speed)
        return (slope + d * (2.0 * quadratic + d * (3.0 * cubic)))[()]

    def _piece(self, speed: ArrayLike, continued: bool = False) -> tuple[NDArray[np.float64], Any]:
        """Return the coefficients of the cubic at each speed, and the distance from its beginning."""
        x = np.asarray(speed)
        if not continued and not self.covers(x):
            low, high = np.min(np.real(x)), np.max(np.real(x))
            wrong = low if low < self.speeds[0] or np.isnan(low) else high
            unit = f" {self.unit}" if self.unit else ""
            raise ModelError(
                f"the table {self.name} covers {self.speeds[0]:g} to {self.speeds[-1]:g}{unit}; it has no value at "
                f"{wrong:.6g}{unit}. Extend the table, or stay within it"
            )
        places, coefficients = self._pieces
        piece = np.clip(np.searchsorted(places, np.real(x), side="right") - 1, 0, len(places) - 2)
        return coefficients[:, piece], x - places[piece]

    @cached_property
    def _pieces(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        from scipy.interpolate import PchipInterpolator  # only where tables are used

        return np.array(self.speeds), PchipInterpolator(self.speeds, self.values).c


def speed_table(speed: ArrayLike, value: ArrayLike, name: str = "over the speed", unit: str = "") -> SpeedTable:
    """Make a table of measured points, in any order.

    Parameters
    ----------
    speed, value : shape (points,)
        The points; each speed occurs once.
    name, unit
        See `SpeedTable`.

    Returns
    -------
    SpeedTable
        The table, by increasing speed.

    Raises
    ------
    ModelError
        As `SpeedTable`.

    Examples
    --------
    >>> float(gw.loads.speed_table([3000.0, 1000.0], [40.0, 30.0], unit="rpm").value(2000.0))
    35.0
    """
    speeds, values = _row(speed, "speeds"), _row(value, "values")
    if len(speeds) != len(values):
        return SpeedTable(speeds, values, name, unit)
    pairs = sorted(zip(speeds, values, strict=True))
    return SpeedTable(tuple(a for a, _ in pairs), tuple(b for _, b in pairs), name, unit)


def _row(numbers: ArrayLike, what: str) -> tuple[float, ...]:
    try:
        row = np.array(numbers, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"the {what} of a table must be a list of numbers") from None
    if row.ndim != 1:
        raise ModelError(f"the {what} of a table must be one row of numbers")
    return tuple(row.tolist())


def _problem(speeds: Sequence[float], values: Sequence[float]) -> str:
    if len(speeds) != len(values):
        return f"there are {len(speeds)} speeds, but {len(values)} values; a point has one of each"
    if not 2 <= len(speeds) <= MAX_POINTS:
        return f"there are {len(speeds)} points; a table has 2 to {MAX_POINTS:,}"
    if not np.isfinite([*speeds, *values]).all() or max(map(abs, (*speeds, *values))) > 1e100:
        return "its numbers must be finite, and below 1e100"
    for low, high in pairwise(speeds):
        if not low < high:
            return f"the speed {high:g} follows {low:g}; speeds must increase, and each must occur once: give a mean"
    if min(np.diff(speeds)) < 1e-9 * (speeds[-1] - speeds[0]):
        return "some speeds are nearly equal; give their mean"
    return ""
