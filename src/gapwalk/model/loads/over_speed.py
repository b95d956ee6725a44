"""Factors that depend on the speed: by a formula, or by a measured table.

The factor of a load is kept as plain data in its constants, so that result files have it: `FactorOverSpeed.data`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from gapwalk.errors import ModelError, OutsideError
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Formula
from gapwalk.model.laws.grammar import formula_of
from gapwalk.model.measured.measured_table import NamedFile, WantedColumn, read_heads, read_table
from gapwalk.model.measured.speed_table import SpeedTable, speed_table
from gapwalk.model.units import QuantityKind, Units

_NAMES = ("W", "speed")


@dataclass(frozen=True)
class FactorOverSpeed:
    """A factor that depends on the frequency of the excitation.

    Raises
    ------
    ModelError
        If the text is no formula, or has other names or kinks.

    Examples
    --------
    >>> float(gw.loads.FactorOverSpeed("1 + 0.1*W").value(2.0))
    1.2
    """

    #: A smooth formula of the angular frequency ``W`` and of the ``speed``, the first parameter of the system in its
    #: own unit; empty if there is a table.
    formula: str = ""
    table: SpeedTable | None = None  #: A table over the speed; None if there is a formula.
    pace: float = 1.0  #: The frequency W at the speed 1; 1 in a system without units.

    def __post_init__(self) -> None:
        if self.table is not None:
            return
        formula = self._read
        if formula.parameters:
            raise ModelError(
                f"over_speed is {self.formula!r}, and {formula.parameters[0]} is unknown in it; its names are W, the "
                "angular frequency, and speed, the first parameter of the system, as in 1 + 0.1*W"
            )
        if formula.mode_count:
            raise ModelError(
                f"over_speed is {self.formula!r}, which has a kink; write a smooth formula, or a table over "
                'the speed: over_speed = "gas.csv"'
            )

    @property
    def words(self) -> str:
        """Description in a few words."""
        return f"times {self._read.text}" if self.table is None else f"times the table {self.table.name}"

    @property
    def limits(self) -> tuple[float, float]:
        """The range of frequencies W in which it has values."""
        if self.table is None:
            return 0.0, math.inf
        return self.table.speeds[0] * self.pace, self.table.speeds[-1] * self.pace

    @property
    def data(self) -> tuple[Any, ...]:
        """Its parts as texts, numbers and tuples; `factor_over_speed` takes them back."""
        if self.table is None:
            return "formula", self.formula, self.pace
        table = self.table
        return "table", table.name, table.unit, self.pace, table.speeds, table.values

    def value(self, frequency: Any) -> Any:
        """Return the factor at a frequency W: real or complex, or an array.

        Beyond its limits a table is continued by its first or last piece, for steps of Newton's method that pass its
        end; `gapwalk.model.coefficients.coefficients_of` refuses such systems.
        """
        speed = frequency / self.pace
        if self.table is not None:
            return self.table.value(speed, continued=True)
        with np.errstate(all="ignore"):
            found = self._read.value({"W": frequency, "speed": speed}, NUMPY_FUNCTIONS, ())
        if not np.all(np.isfinite(found)):
            raise OutsideError(f"over_speed is {self.formula!r}, which has no value at W = {np.real(frequency)}")
        return found

    def in_train(self, units: Units) -> FactorOverSpeed:
        """Return the factor in the units of a drive train: a formula has the speed in the train's own unit."""
        return replace(self, pace=units.frequency if self.table is None else self.pace * float(units.turns or 1))

    @cached_property
    def _read(self) -> Formula:
        return formula_of(self.formula, _NAMES)


OverSpeed = str | SpeedTable | FactorOverSpeed | tuple[Any, ...]
"""A factor over the speed as it is given: a formula, a table, or the data of one; empty for none."""


def read_factor(file: NamedFile, *, units: bool) -> FactorOverSpeed:
    """Read a table over the speed from a CSV file."""
    speed = WantedColumn("speed", QuantityKind.FREQUENCY if units else None, ("frequency", "W", "n"))
    factor = WantedColumn("factor", None, ("amplitude", "value", "scale"))
    if units and any(head.is_of(QuantityKind.TORQUE) for head in read_heads(file)):
        factor = WantedColumn("torque", QuantityKind.TORQUE)
    elif not units:
        factor = replace(factor, others=(*factor.others, "torque", "force", "load"))
    table = read_table(file, (speed, factor))
    column = table["speed"]
    name, pace = (column.unit.text, column.unit.factor) if column.unit else ("", 1.0)
    values = table[factor.role].values()
    return FactorOverSpeed("", speed_table(column.numbers, values, file.name, name), pace)


@lru_cache(maxsize=256)
def factor_over_speed(data: tuple[Any, ...]) -> FactorOverSpeed:
    """Make a factor from its `FactorOverSpeed.data`; raise a ValueError if it is none."""
    match data:
        case ("formula", str(text), float(pace)):
            return FactorOverSpeed(text, None, pace)
        case ("table", str(name), str(unit), float(pace), tuple(speeds), tuple(values)):
            return FactorOverSpeed("", SpeedTable(speeds, values, name, unit), pace)
    raise ValueError("a factor over the speed is a formula or a table")


def over_speed_data(given: object) -> tuple[Any, ...]:
    """Return the data of a factor from a formula, a table, or such data; empty for nothing."""
    if isinstance(given, FactorOverSpeed):
        return given.data
    if isinstance(given, SpeedTable):
        return FactorOverSpeed("", given).data
    if isinstance(given, str):
        return FactorOverSpeed(given).data if given.strip() else ()
    if isinstance(given, Sequence) and not given:
        return ()
    try:
        return factor_over_speed(tuple(given)).data  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise ModelError(
            f'over_speed is {given!r}; write a formula such as "1 + 0.1*W", or a table from gw.loads.read_speed_table'
        ) from None
