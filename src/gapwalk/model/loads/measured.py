"""Loads from measured curves over the angle of a shaft: gas torques, transmission errors, motions of a base."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from operator import itemgetter
from typing import Any, ClassVar, Literal, Self

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Positive, check
from gapwalk.model.channels.channel_file import MAX_SAMPLES, ColumnHead, NamedFile
from gapwalk.model.loads.load import Line, Load, OverSpeed, check_order
from gapwalk.model.measured.crank_orders import ERROR, OrderTable, displacement_orders, orders_of
from gapwalk.model.measured.curve_map import (
    CurveMap,
    Series,
    angle_column,
    map_points,
    merged,
    orders_at,
    read_map,
    scaled_series,
)
from gapwalk.model.measured.measured_table import SpeedTable, WantedColumn, named_errors, read_heads, read_table
from gapwalk.model.measured.turned_record import turning_orders
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind, Units, read_quantity

_SHARED = ("growth", "at", "over_speed")  # keys of its table that are its fields
_SPEED = ("speed", "rpm", "n", "frequency")  # names of the column of speeds
_DISPLACED = ("displacement", "transmission error", "error", "deflection", "clearance", "x")
_LISTED = 12  # orders that are listed one by one
_LOW = 0.01  # share of the strongest order above which a lower one that is left out is reported
_MEANS = ("deflection", "clearance")  # what varies by the curve itself, by the last part of its name


class OfCurve(Load):
    """A load with the orders of a curve over the angle of a shaft, or of one for each of some speeds."""

    series: Series
    turns: int

    @classmethod
    def tables(cls, constants: Mapping[str, Any]) -> Iterator[tuple[tuple[float, ...], str]]:
        """See `Load.tables`."""
        yield from super().tables(constants)
        yield from map_points(constants)

    @classmethod
    def rescaled(cls, constants: Mapping[str, Any], frequency: float, size: float) -> dict[str, Any]:
        """See `Load.rescaled`."""
        found = super().rescaled(constants, frequency, size)
        return {**found, **scaled_series(found, 1.0 / size, 1.0 / frequency)}

    @property
    def turn_order(self) -> Fraction:
        """See `Load.turn_order`: a half for the curve of a cycle of two turns."""
        return Fraction(self.order, self.turns)

    def in_train(self, units: Units) -> Self:
        """See `Load.in_train`."""
        moved = replace(self, **scaled_series(vars(self), 1.0, float(units.turns or 1)))
        return super(OfCurve, moved).in_train(units)


@dataclass(frozen=True)
class Measured(OfCurve):
    """A curve over the angle of a shaft, as a load or as the variation of other numbers; made by `Measured.of`.

    It is ``scale`` times a mean and some orders, ``sum cosine * cos(k a) + sine * sin(k a)`` with ``a`` the angle of
    the shaft plus `phase`. As a variation it has no mean. For a map over angle and speed, monotone cubics interpolate
    the mean and all orders over the speed.

    Examples
    --------
    >>> angle = np.linspace(0.0, 4.0 * np.pi, 361)
    >>> table = gw.loads.orders_of(angle, 80.0 + 40.0 * np.cos(2.0 * angle) + 9.0 * np.sin(0.5 * angle), per="cycle")
    >>> [order for order, *_ in gw.loads.Measured.of(table, {"q1": 1.0}).series]
    [1, 4]
    """

    key, words, frequencies = "measured", "a measured curve over the angle of a shaft", ("at",)
    parameters = (
        Parameter("scale", None, "it is a factor of the curve", 1.0),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )

    table_keys: ClassVar[Mapping[str, tuple[Any, Any]]] = {
        "file": (NamedFile, ...),
        "per": (Literal["turn", "cycle"], "turn"),
        "orders": (list[float] | None, None),
        "error": (float, ERROR),
        "column": (str, ""),
        "period": (float | str | None, None),
        "speed": (float | str | None, None),
        "speed_column": (str, ""),
        "pulses": (int, 0),
        "relative": (bool, False),
        "growth": (int, 0),
        "at": (float, 1.0),
        "over_speed": (OverSpeed, ()),
    }

    #: tuple of (int, float, float): For each order, its periods in a period of the curve, its cosine and its sine
    #: amplitude. Of a map, each amplitude is a tuple of one number for each speed.
    series: Series
    #: The vector along which it acts, by coordinate name.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Periods of the curve in a period of the excitation, an integer >= 1. The fundamental frequency of a four-stroke
    #: engine is that of its cycle: then a curve over the cycle has the order 1, and one over a turn has the order 2.
    order: int = 1
    turns: int = 1  #: Turns of the shaft in a period of the curve.
    scale: float = 1.0  #: Its factor.
    phase: float = 0.0  #: In radians of the shaft's angle: a curve with the phase 0.1 is ahead by 0.1 rad.
    #: What it varies instead: ``"mesh.deflection"``, or several names with factors.
    varies: Mapping[str, float] = field(default_factory=dict, hash=False)
    mean: Any = 0.0  #: The mean of the load; 0 for a variation. Of a map it is a tuple, a number for each speed.
    #: growth, at, over_speed: As for `Harmonic`.
    growth: int = 0
    at: float = 1.0
    over_speed: OverSpeed = ()
    left_out: float = 0.0  #: The share of the energy that is in orders which are left out.
    #: The largest order left out below the strongest one, and its amplitude relative to that; else 0.
    low_left: tuple[float, float] = (0.0, 0.0)
    mean_left_out: float = 0.0  #: The mean that a variation leaves out.
    is_angle: bool = False  #: True if the values are angles in rad, which a drive train converts to its own unit.
    source: str = ""  #: Name of the file.
    drift: str = ""  #: What was taken off a record of a shaft that turns, in words.
    #: Of a map: its name, the unit of its speeds, the frequency W at a speed of one unit, the speeds. Otherwise empty.
    speeds: tuple[Any, ...] = ()
    name: str = ""  #: Prefix of its parameters' names.

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            series = tuple((order, _plain(cosine), _plain(sine)) for order, cosine, sine in self.series)
        except (TypeError, ValueError):
            raise ModelError(f"series is {self.series!r}; make a measured load with Measured.of(table, ...)") from None
        for order, *numbers in series:
            check_order(order)
            if not np.isfinite(numbers).all():
                raise ModelError("the series of a measured load has a number that is not finite")
        object.__setattr__(self, "series", tuple((int(order), *numbers) for order, *numbers in series))

    @classmethod
    def of(
        cls,
        table: OrderTable | Mapping[float, OrderTable],
        acts_on: Mapping[str, float] | None = None,
        *,
        relative: bool = False,
        **fields: Any,
    ) -> Self:
        """Make a measured load from the orders of a curve.

        Parameters
        ----------
        table
            The orders of the curve, which `gapwalk.loads.orders_of` finds from samples. For a map, one table for each
            frequency W, as in ``{W: table}``.
        acts_on
            See `Measured`.
        relative
            True to divide the curve by its mean and subtract 1, as for a measured stiffness that varies.
        **fields
            Further fields of `Measured`.

        Examples
        --------
        >>> angle = np.linspace(0.0, 4.0 * np.pi, 361)
        >>> torque = 80.0 + 40.0 * np.cos(2.0 * angle) + 9.0 * np.sin(0.5 * angle)
        >>> load = gw.loads.Measured.of(gw.loads.orders_of(angle, torque, per="cycle"), {"q1": 1.0})
        >>> [order for order, *_ in load.series], round(load.mean, 9)
        ([1, 4], 80.0)
        """
        if isinstance(table, Mapping):
            ordered = sorted(table.items())
            speeds = tuple(float(speed) for speed, _ in ordered)
            fields = {"speeds": ("the map", "", 1.0, SpeedTable(speeds, speeds).speeds)} | fields
            tables = [each for _, each in ordered]
        else:
            tables = [table]
        varies = fields.get("varies") or {}
        varied = [varies] if isinstance(varies, str) else list(varies)
        parts = [_part_of(each, varied, relative=relative) for each in tables]
        mean, series = merged(parts)
        means = {"mean": mean}
        if varied:
            of_curves = float(np.mean([each.mean for each in tables]))
            means = {"mean_left_out": 0.0 if relative else of_curves}
        left_out = max(each.left_out for each in tables)
        low = max((each.low_left for each in tables), key=itemgetter(1))
        return cls(series, acts_on or {}, turns=tables[0].turns, left_out=left_out, low_left=low, **means, **fields)

    @classmethod
    def from_table(cls, given: Mapping[str, Any], *, units: bool) -> Self:
        """See `Load.from_table`."""
        fields = {name: value for name, value in given.items() if name not in cls.table_keys or name in _SHARED}
        own = {name: value for name, value in given.items() if name not in fields}
        curves, tables, is_angle, drift = read_curve(own["file"], own, is_load=bool(given.get("acts_on")), units=units)
        relative = own["relative"]
        acts_on = fields.pop("acts_on", None)
        marks = {"is_angle": is_angle and not relative, "source": own["file"].name, "drift": drift}
        found = dict(zip(curves.speeds, tables, strict=True)) if curves.speeds else tables[0]
        if curves.speeds:
            marks["speeds"] = curves.speed_data
        return cls.of(found, acts_on, relative=relative, **fields, **marks)

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        size = cls.grown(numbers["scale"], frequency, numbers)
        mean, series = orders_at(numbers, frequency)
        if np.any(numbers["mean"]):
            yield Line(0, size * mean)
        yield from series_lines(order, size, series, numbers["phase"] / numbers["turns"])

    @classmethod
    def rescaled(cls, constants: Mapping[str, Any], frequency: float, size: float) -> dict[str, Any]:
        """See `Load.rescaled`."""
        found = super().rescaled(constants, frequency, size)
        return {**found, "mean_left_out": constants["mean_left_out"] / size}

    def in_train(self, units: Units) -> Self:
        """See `Load.in_train`."""
        unit = units.angle if self.is_angle else 1.0
        moved = scaled_series(vars(self), 1.0 / unit)
        moved = replace(self, **moved, mean_left_out=self.mean_left_out / unit, is_angle=False)
        return super(Measured, moved).in_train(units)

    @classmethod
    def notes(cls, constants: Mapping[str, Any]) -> str:
        """Say which orders of the shaft it has, and what is left out; see `Load.notes`."""
        text = orders_words(constants)
        text += f" ({constants['drift']})" if constants["drift"] else ""
        mean = constants["mean_left_out"]
        return f"{text} and without the mean {mean:.4g}" if mean else text


def series_lines(order: int, size: Any, series: Series, ahead: Any) -> Iterable[Line]:
    """Give the lines of a curve times a size, ahead by an angle of its period in rad."""
    for multiple, cosine, sine in series:
        c, s = np.cos(multiple * ahead), np.sin(multiple * ahead)
        yield Line(order * multiple, size * (cosine * c + sine * s), size * (sine * c - cosine * s))


def orders_words(constants: Mapping[str, Any]) -> str:
    """Say which orders of the shaft a curve has, from which file, and what is left out."""
    orders = [f"{order / constants['turns']:g}" for order, *_ in constants["series"]]
    kept = f"orders {', '.join(orders)}"
    if len(orders) > _LISTED:
        kept = f"{len(orders)} orders from {orders[0]} to {orders[-1]}"
    source = f" of {constants['source']}" if constants["source"] else ""
    text = f"{kept} per turn{source}, without {100.0 * constants['left_out']:.2g} % of the energy"
    order, share = constants.get("low_left", (0.0, 0.0))
    if share > _LOW:  # of the torque: the motions of low orders are larger
        text += (
            f"; order {order:g}, with {100.0 * share:.2g} % of the strongest, is left out, and low orders may excite "
            "much: a smaller error keeps it"
        )
    if speeds := constants.get("speeds"):
        _, unit, _, found = speeds
        text += f", over {len(found)} speeds from {found[0]:g} to {found[-1]:g} {unit}".rstrip()
    return text


def _plain(number: Any) -> Any:
    return tuple(map(float, number)) if isinstance(number, tuple | list) else float(number)


def _part_of(table: OrderTable, varied: Sequence[str], *, relative: bool) -> tuple[float, Series]:
    """Return the mean and the series of a curve, relative to its mean if wanted; refuse what excites nothing."""
    mean = table.mean
    size = math.sqrt(2.0 * sum(line.energy for line in table.lines))
    if not table.lines and (varied or not mean):
        raise ModelError("the curve is constant, so it excites nothing")
    if relative:
        if not varied:
            raise ModelError("relative is only for what a curve varies; a load has its own size: leave it out")
        if not abs(mean) > size:
            raise ModelError(f"the mean of the curve is {mean:g}, too small to divide by; leave relative out")
    elif varied and abs(mean) > size and not any(name.rpartition(".")[2] in _MEANS for name in varied):
        raise ModelError(
            f"the curve has the mean {mean:g}, but {varied[0]} varies by a fraction: if the curve is the number "
            "itself over the angle, write relative = true; otherwise subtract the mean from the curve"
        )
    part = 1.0 / mean if relative else 1.0
    series = tuple((round(line.order * table.turns), part * line.cosine, part * line.sine) for line in table.lines)
    return 0.0 if varied else mean, series


def read_curve(
    file: NamedFile, keys: Mapping[str, Any], *, is_load: bool, units: bool
) -> tuple[CurveMap, tuple[OrderTable, ...], bool, str]:
    """Find the orders of the curves in a file, over an angle or time; whether they are angles; and the drift."""
    heads = read_heads(file)
    has_angle = any(_is(head, ("angle", "crank")) for head in heads)
    over_time = not has_angle and any(_is(head, ("time", "t")) for head in heads)
    accelerates = not is_load and not keys["relative"] and any(_is(head, ("acceleration", "a")) for head in heads)
    has_speed = any(_is(head, _SPEED) or (units and head.is_of(QuantityKind.FREQUENCY)) for head in heads)
    free = [head for head in heads if not _is(head, ("angle", "crank", "theta", "time", "t"))]
    displaces = any(_is(head, _DISPLACED) or (units and head.is_of(QuantityKind.ANGLE)) for head in free)
    moves = not (is_load or keys["relative"] or accelerates or displaces)
    ordinate = _ordinate(keys, is_load, accelerates, units)
    if keys["pulses"] and not moves:
        raise ModelError(
            f'{file.name}: pulses give the motion of a shaft, as for varies = "flywheel.angle"; with a load, a '
            "displacement or an acceleration leave pulses out, and give the speed"
        )
    if keys["pulses"] or (has_speed and (moves or (over_time and keys.get("period") is None))):
        wanted = None if moves or keys["pulses"] else ordinate
        table, is_angle, drift = _read_turned(file, keys, wanted, accelerates, not has_angle, units, heads)
        return CurveMap((), name=file.name), (table,), is_angle, drift
    curves = read_map(file, _abscissa(heads, over_time=over_time, units=units), ordinate, units=units)
    turns = 2 if keys["per"] == "cycle" else 1
    how: dict[str, Any] = {"per": keys["per"], "error": keys["error"]}
    speed = keys.get("speed")
    with named_errors(file.name):
        if over_time:
            period = _number(keys.get("period"), "period", QuantityKind.TIME, "0.04", "s" if units else "")
            each = 2.0 * math.pi * turns / period
            curves, speed = replace(curves, curves=tuple((each * t, y) for t, y in curves.curves)), each
        elif accelerates and not curves.speeds:
            speed = _number(speed, "speed", QuantityKind.FREQUENCY, "1500", "rpm" if units else "")
    if accelerates:
        how["speed"] = speed

    def find(angle: Any, values: Any, **more: Any) -> OrderTable:
        if accelerates:
            return displacement_orders(angle, acceleration=values, **more)
        return orders_of(angle, values, **more)

    return curves, curves.tables(find, keys.get("orders"), **how), units and not is_load, ""


def _read_turned(
    file: NamedFile,
    keys: Mapping[str, Any],
    ordinate: WantedColumn | None,
    accelerates: bool,
    over_time: bool,
    units: bool,
    heads: Sequence[ColumnHead],
) -> tuple[OrderTable, bool, str]:
    """Find the orders of the motion of a shaft (without an ordinate), or of a signal while it turned."""
    wanted = [_abscissa(heads, over_time=over_time, units=units)]
    if pulses := keys["pulses"]:
        if not over_time:
            raise ModelError(
                f"{file.name}: pulses is {pulses}, but there is an angle; pulses have times, as in time (s)"
            )
        others = [head for head in heads if head.name and not head.is_time and not _is(head, ("time", "t"))]
        if others:
            name = keys["column"] or (others[0].text if len(others) == 1 else "")
            wanted.append(WantedColumn("pulses", None, (), name, "column", any_unit=True))
    else:
        name, key = (keys["column"], "column") if ordinate is None else (keys["speed_column"], "speed_column")
        wanted.append(WantedColumn("speed", QuantityKind.FREQUENCY if units else None, _SPEED, name, key))
        wanted += [] if ordinate is None else [ordinate]
    table = read_table(file, wanted, most=MAX_SAMPLES)
    values = {each.role: table[each.role].values() for each in wanted}
    signal = values.get("pulses" if pulses else "" if ordinate is None else ordinate.role)
    with named_errors(file.name):
        at = keys.get("speed")
        at = None if at is None else _number(at, "speed", QuantityKind.FREQUENCY, "1500", "rpm" if units else "")
        found, drift = turning_orders(
            speed=values.get("speed"),
            signal=signal,
            **{"time" if over_time else "angle": values[wanted[0].role]},
            pulses=pulses,
            at=at,
            accelerates=accelerates,
            where=table.where,
            unit="rpm" if units else "",
            orders=keys.get("orders"),
            per=keys["per"],
            error=keys["error"],
        )
    is_motion = ordinate is None or ordinate.kind in (QuantityKind.ANGLE, QuantityKind.ACCELERATION)
    return found, units and is_motion, drift.words


def _is(head: ColumnHead, names: Collection[str]) -> bool:
    return head.name.casefold() in names or head.name.casefold().split()[:1] in ([each] for each in names)


def _abscissa(heads: Sequence[ColumnHead], *, over_time: bool, units: bool) -> WantedColumn:
    """Return the column of angles or times; angles may have a unit in any model."""
    if over_time:
        return WantedColumn("time", QuantityKind.TIME if units else None, ("t",))
    return angle_column(heads, units)


def _ordinate(keys: Mapping[str, Any], is_load: bool, accelerates: bool, units: bool) -> WantedColumn:
    """Return the column of values."""
    name, key = keys["column"], "column"
    if is_load:
        kind, role, others = QuantityKind.TORQUE, "torque" if units else "force", ("torque", "force", "moment", "load")
    elif keys["relative"]:
        kind, role, others = QuantityKind.STIFFNESS, "stiffness", ("value", "factor")
    elif accelerates:
        kind, role, others = QuantityKind.ACCELERATION, "acceleration", ("a",)
    else:
        kind, role = QuantityKind.ANGLE, "displacement"
        others = _DISPLACED
    return WantedColumn(role, kind if units else None, others, name, key)


def _number(given: object, key: str, kind: QuantityKind, example: str, unit: str) -> float:
    """Read a positive number of a table, with a unit if the model has units."""
    shown = f'"{example} {unit}"' if unit else example
    if given is None:
        raise ModelError(f"{key} is missing: the curve needs it; write {key} = {shown}")
    try:
        number: Any = read_quantity(given, kind) if unit else given
    except ValueError as error:
        raise ModelError(f"{key} {error}") from None
    number = number.number * number.factor if unit else number
    check(key, number, Positive)
    return float(number)
