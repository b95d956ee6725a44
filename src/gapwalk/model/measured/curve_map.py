"""A curve over the angle of a shaft *and* over the speed: its file, and its orders between the speeds.

The file has a column for each speed, ``angle (deg), 1000 rpm (N m), 1500 rpm (N m)``; or, in long form, the columns
``angle (deg), speed (rpm), torque (N m)``, with each angle at each speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import ColumnHead, NamedFile
from gapwalk.model.measured.crank_orders import OrderTable
from gapwalk.model.measured.measured_table import (
    Pieces,
    SpeedTable,
    WantedColumn,
    monotone,
    named_errors,
    piece_at,
    read_heads,
    read_table,
)
from gapwalk.model.units import QuantityKind, read_quantity

Array = NDArray[np.float64]
Series = tuple[tuple[int, Any, Any], ...]
"""For each order: periods in a period of the curve, cosine, sine; numbers, or tuples of one for each speed."""


@dataclass(frozen=True)
class CurveMap:
    """A file with a curve over the angle, or with one for each of some speeds."""

    curves: tuple[tuple[Array, Array], ...]  #: For each speed: angles, and values at them, in reference units.
    speeds: tuple[float, ...] = ()  #: In their unit, increasing; none if there is a single curve.
    unit: str = ""  #: The unit of the speeds; empty for plain numbers.
    pace: float = 1.0  #: The frequency W at the speed 1.
    name: str = ""  #: Name of the file.
    has_unit: bool = False  #: True if the angles have a unit.

    @property
    def speed_data(self) -> tuple[Any, ...]:
        """Its speeds as texts, numbers and tuples, for the constants of a load: see `orders_at`; empty without any."""
        return (self.name, self.unit, self.pace, self.speeds) if self.speeds else ()

    def tables(
        self, find: Callable[..., OrderTable], orders: Sequence[float] | None, **how: Any
    ) -> tuple[OrderTable, ...]:
        """Find the orders of each curve: those that are given, or all that one of them needs."""

        def found(kept: Sequence[float] | None) -> list[OrderTable]:
            tables = []
            for number, (angle, values) in enumerate(self.curves):
                at = f" at {self.speeds[number]:g} {self.unit}".rstrip() if self.speeds else ""
                own = {"speed": self.speeds[number] * self.pace} if self.speeds and "speed" in how else {}
                with named_errors(f"{self.name}{at}"):
                    tables.append(find(angle, values, orders=kept, **{**how, **own}))
            return tables

        tables = found(orders)
        kept = sorted({order for table in tables for order in table.orders})
        if orders is None and any(table.orders != tuple(kept) for table in tables):
            tables = found(kept)
        return tuple(tables)


def angle_column(heads: Sequence[ColumnHead], units: bool) -> WantedColumn:
    """Return the column of angles, which may have a unit in any model."""
    has_unit = units or any(head.is_of(QuantityKind.ANGLE) for head in heads)
    return WantedColumn("angle", QuantityKind.ANGLE if has_unit else None, ("crank angle", "crank", "theta"))


def read_map(file: NamedFile, angle: WantedColumn, value: WantedColumn, *, units: bool) -> CurveMap:
    """Read a curve over the angle (or over time), or one for each speed, from a file."""
    found = _read_map(file, angle, value, units=units)
    if angle.role == "angle" and not found.has_unit and float(np.ptp(found.curves[0][0])) > 100.0:
        raise ModelError(f"{file.name}: its angles seem to be in degrees; name the column angle (deg)")
    return found


def _read_map(file: NamedFile, angle: WantedColumn, value: WantedColumn, *, units: bool) -> CurveMap:
    heads = read_heads(file)
    wide = {} if value.name else {head.text: pace for head in heads if (pace := _speed_of(head, units)) is not None}
    if len(wide) < sum(head.text in wide for head in heads):
        raise ModelError(f"{file.name}: a speed has two columns; each occurs once")
    if wide:
        columns = [replace(value, role=text, others=(), name=text, key="") for text in wide]
        table = read_table(file, (angle, *columns))
        x = table[angle.role].values()
        units_of = [unit for _, unit, _ in wide.values()]
        factors = [factor for *_, factor in wide.values()]
        speeds = [number * factor / factors[0] for number, _, factor in wide.values()]
        curves = [(x, table[text].values()) for text in wide]
        return _sorted(file.name, speeds, curves, units_of[0], factors[0], table[angle.role].unit is not None)
    speed = WantedColumn("speed", QuantityKind.FREQUENCY if units else None, ("n", "frequency", "W"))
    names = [each.casefold() for each in (speed.role, *speed.others)]
    has_speed = any(head.is_of(QuantityKind.FREQUENCY) if units else head.name.casefold() in names for head in heads)
    table = read_table(file, (angle, value))
    x, y, has_unit = table[angle.role].values(), table[value.role].values(), table[angle.role].unit is not None
    if has_speed and 2 * len(np.unique(x)) <= len(x):  # a single run with its speed beside it has each angle once
        column = read_table(file, (angle, speed))[speed.role]
        levels = np.unique(column.numbers)
        if len(levels) > 1:
            rows = [np.flatnonzero(column.numbers == level) for level in levels]
            order = [each[np.argsort(x[each], kind="stable")] for each in rows]
            unit, pace = (column.unit.text, column.unit.factor) if column.unit else ("", 1.0)
            return _sorted(file.name, levels.tolist(), [(x[each], y[each]) for each in order], unit, pace, has_unit)
    return CurveMap(((x, y),), name=file.name, has_unit=has_unit)


def _sorted(
    name: str, speeds: Sequence[float], curves: Iterable[tuple[Array, Array]], unit: str, pace: float, has_unit: bool
) -> CurveMap:
    """Make a map with increasing speeds; refuse a single one, or one that occurs twice."""
    pairs = sorted(zip(speeds, curves, strict=True), key=lambda pair: pair[0])
    found = tuple(float(speed) for speed, _ in pairs)
    if len(found) < 2:
        raise ModelError(
            f"{name}: it has the one speed {speeds[0]:g} {unit}".rstrip()
            + "; a map needs two at least. Without a speed in its first line it is a curve for all speeds"
        )
    SpeedTable(found, found, name, unit)  # refuses what is no range of speeds
    return CurveMap(tuple(curve for _, curve in pairs), found, unit, pace, name, has_unit)


def _speed_of(head: ColumnHead, units: bool) -> tuple[float, str, float] | None:
    """Return the speed that is the name of a column, with its unit and the factor of it; None if it is none."""
    try:
        if not units:
            return float(head.name), "", 1.0
        found = read_quantity(head.name, QuantityKind.FREQUENCY)
    except ValueError:
        return None
    return found.number, found.unit, found.factor


# Orders over the speed, from the constants of a load.


def merged(tables: Sequence[tuple[float, Series]]) -> tuple[Any, Series]:
    """Return a mean and a series of tuples, a number for each speed, from the mean and the series at each."""
    if len(tables) == 1:
        return tables[0]
    orders = sorted({order for _, series in tables for order, *_ in series})
    known = [{order: pair for order, *pair in series} for _, series in tables]
    parts = {order: zip(*(each.get(order, (0.0, 0.0)) for each in known), strict=True) for order in orders}
    return tuple(mean for mean, _ in tables), tuple((order, *map(tuple, both)) for order, both in parts.items())


def orders_at(constants: Mapping[str, Any], frequency: Any) -> tuple[Any, Series]:
    """Return the mean and the series of a load at a frequency W: real or complex, or an array.

    Beyond its first and last speed a map is continued, for steps of Newton's method that pass them; systems there are
    refused by their `Structure.pace_limits`.
    """
    mean, parts, speeds = constants["mean"], constants["series"], constants.get("speeds")
    if not speeds:
        return mean, parts
    pieces = _pieces(speeds[-1], mean if isinstance(mean, tuple) else (mean,) * len(speeds[-1]), parts)
    (cubic, quadratic, slope, value), d = piece_at(pieces, np.asarray(frequency) / speeds[2])
    d = d[..., None]
    found = np.moveaxis(value + d * (slope + d * (quadratic + d * cubic)), -1, 0)
    return found[0], tuple(
        (order, cosine, sine) for (order, *_), cosine, sine in zip(parts, found[1::2], found[2::2], strict=True)
    )


def map_points(constants: Mapping[str, Any]) -> tuple[tuple[tuple[float, ...], str], ...]:
    """Return the frequencies W of the map of a load, and its name; none without a map."""
    if not (data := constants.get("speeds")):
        return ()
    name, _, pace, speeds = data
    return ((tuple(speed * pace for speed in speeds), name),)


def scaled_series(constants: Mapping[str, Any], factor: float, pace: float = 1.0) -> dict[str, Any]:
    """Return the mean, the series and the speeds of a load times a factor, with another frequency W at the speed 1."""

    def scaled(number: Any) -> Any:
        return tuple(map(scaled, number)) if isinstance(number, tuple) else number * factor

    series = tuple((order, scaled(cosine), scaled(sine)) for order, cosine, sine in constants["series"])
    speeds = constants.get("speeds") or ()
    moved = (*speeds[:2], speeds[2] * pace, speeds[3]) if speeds else ()
    return {"mean": scaled(constants["mean"]), "series": series, "speeds": moved}


@lru_cache(maxsize=256)
def _pieces(speeds: tuple[float, ...], mean: tuple[float, ...], series: Series) -> Pieces:
    """Return the monotone cubics of the mean and all orders between the speeds."""
    return monotone(speeds, np.array([mean, *(row for _, *both in series for row in both)]).T)
