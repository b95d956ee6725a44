"""Loads from measured curves over the angle of a shaft: gas torques, transmission errors, motions of a base."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar, Literal, Self

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Positive, check
from gapwalk.model.loads.load import Line, Load, OverSpeed, check_order
from gapwalk.model.measured.crank_orders import ERROR, OrderTable, displacement_orders, orders_of
from gapwalk.model.measured.measured_table import ColumnHead, NamedFile, WantedColumn, read_heads, read_table
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind, Units, read_quantity

_SHARED = ("growth", "at", "over_speed")  # keys of its table that are its fields
_MEANS = ("deflection", "clearance")  # what varies by the curve itself, by the last part of its name


@dataclass(frozen=True)
class Measured(Load):
    """A curve over the angle of a shaft, as a load or as what something varies by; made by `Measured.of`.

    It is ``scale`` times a mean and some orders, ``sum cosine * cos(k a) + sine * sin(k a)`` with ``a`` the angle of
    the shaft plus `phase`. As a variation it has no mean.

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
        "relative": (bool, False),
        "growth": (int, 0),
        "at": (float, 1.0),
        "over_speed": (OverSpeed, ()),
    }

    #: tuple of (int, float, float): For each order: periods in a period of the curve, cosine, sine.
    series: tuple[tuple[int, float, float], ...]
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
    mean: float = 0.0  #: The mean of the load; 0 for a variation.
    #: growth, at, over_speed: As for `Harmonic`.
    growth: int = 0
    at: float = 1.0
    over_speed: OverSpeed = ()
    left_out: float = 0.0  #: The share of the energy that is in orders which are left out.
    mean_left_out: float = 0.0  #: The mean that a variation leaves out.
    is_angle: bool = False  #: True if the values are angles in rad, which a drive train converts to its own unit.
    source: str = ""  #: Name of the file.
    name: str = ""  #: Prefix of its parameters' names.

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            series = tuple((order, float(cosine), float(sine)) for order, cosine, sine in self.series)
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
        table: OrderTable,
        acts_on: Mapping[str, float] | None = None,
        *,
        relative: bool = False,
        **fields: Any,
    ) -> Self:
        """Make it from the orders of a curve.

        Parameters
        ----------
        table
            The curve: `gapwalk.loads.orders_of` finds it from samples.
        acts_on
            See `Measured`.
        relative
            True to take the curve divided by its mean, less 1: for a measured stiffness.
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
        mean, varies = table.mean, fields.get("varies") or {}
        varied = [varies] if isinstance(varies, str) else list(varies)
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
        means = {"mean_left_out": 0.0 if relative else mean} if varied else {"mean": mean}
        return cls(series, acts_on or {}, turns=table.turns, left_out=table.left_out, **means, **fields)

    @classmethod
    def from_table(cls, given: Mapping[str, Any], *, units: bool) -> Self:
        """See `Load.from_table`."""
        fields = {name: value for name, value in given.items() if name not in cls.table_keys or name in _SHARED}
        own = {name: value for name, value in given.items() if name not in fields}
        table, is_angle = read_curve(own["file"], own, is_load=bool(given.get("acts_on")), units=units)
        relative = own["relative"]
        acts_on = fields.pop("acts_on", None)
        marks = {"is_angle": is_angle and not relative, "source": own["file"].name}
        return cls.of(table, acts_on, relative=relative, **fields, **marks)

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        size = cls.grown(numbers["scale"], frequency, numbers)
        if numbers["mean"]:
            yield Line(0, size * numbers["mean"])
        for multiple, cosine, sine in numbers["series"]:
            ahead = multiple / numbers["turns"] * numbers["phase"]
            c, s = np.cos(ahead), np.sin(ahead)
            yield Line(order * multiple, size * (cosine * c + sine * s), size * (sine * c - cosine * s))

    @property
    def turn_order(self) -> Fraction:
        """See `Load.turn_order`: a half for the curve of a cycle of two turns."""
        return Fraction(self.order, self.turns)

    def in_train(self, units: Units) -> Self:
        """See `Load.in_train`."""
        unit = units.angle if self.is_angle else 1.0
        series = tuple((order, cosine / unit, sine / unit) for order, cosine, sine in self.series)
        moved = replace(self, series=series, mean_left_out=self.mean_left_out / unit, is_angle=False)
        return super(Measured, moved).in_train(units)

    @classmethod
    def notes(cls, constants: Mapping[str, Any]) -> str:
        """Say which orders of the shaft it has, and what is left out; see `Load.notes`."""
        kept = ", ".join(f"{order / constants['turns']:g}" for order, *_ in constants["series"])
        source = f" of {constants['source']}" if constants["source"] else ""
        text = f"orders {kept} per turn{source}, without {100.0 * constants['left_out']:.2g} % of the energy"
        mean = constants["mean_left_out"]
        return f"{text} and without the mean {mean:.4g}" if mean else text


def read_curve(file: NamedFile, keys: Mapping[str, Any], *, is_load: bool, units: bool) -> tuple[OrderTable, bool]:
    """Find the orders of a curve in a CSV file, over an angle or over time."""
    heads = read_heads(file)
    has_angle = any(_is(head, ("angle", "crank")) for head in heads)
    over_time = not has_angle and any(_is(head, ("time", "t")) for head in heads)
    accelerates = not is_load and not keys["relative"] and any(_is(head, ("acceleration", "a")) for head in heads)
    wanted = [_abscissa(heads, over_time=over_time, units=units), _ordinate(keys, is_load, accelerates, units)]
    table = read_table(file, wanted)
    abscissa, values = table[wanted[0].role].values(), table[wanted[1].role].values()
    turns = 2 if keys["per"] == "cycle" else 1
    how = {"orders": keys.get("orders"), "per": keys["per"], "error": keys["error"]}
    speed = keys.get("speed")
    try:
        if over_time:
            period = _number(keys.get("period"), "period", QuantityKind.TIME, "0.04", "s" if units else "")
            abscissa, speed = 2.0 * math.pi * turns * abscissa / period, 2.0 * math.pi * turns / period
        elif accelerates:
            speed = _number(speed, "speed", QuantityKind.FREQUENCY, "1500", "rpm" if units else "")
        if not over_time and float(np.ptp(abscissa)) > 100.0 and table[wanted[0].role].unit is None:
            raise ModelError("its angles seem to be in degrees; name the column angle (deg)")
        if accelerates:
            return displacement_orders(abscissa, acceleration=values, speed=speed, **how), units
        return orders_of(abscissa, values, **how), units and not is_load
    except ModelError as error:
        raise ModelError(f"{file.name}: {error}") from None


def _is(head: ColumnHead, names: Collection[str]) -> bool:
    return head.name.casefold() in names or head.name.casefold().split()[:1] in ([each] for each in names)


def _abscissa(heads: Sequence[ColumnHead], *, over_time: bool, units: bool) -> WantedColumn:
    """Return the column of angles or times; angles may have a unit in any model."""
    if over_time:
        return WantedColumn("time", QuantityKind.TIME if units else None, ("t",))
    has_unit = units or any(head.is_of(QuantityKind.ANGLE) for head in heads)
    return WantedColumn("angle", QuantityKind.ANGLE if has_unit else None, ("crank angle", "crank", "theta"))


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
        others = ("transmission error", "error", "deflection", "clearance", "x")
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
