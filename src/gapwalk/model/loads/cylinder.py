"""The torque of a cylinder on its crank: of the gas, from its pressure over the crank angle, and of its moving mass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Positive, check
from gapwalk.model.channels.channel_file import ColumnHead, NamedFile
from gapwalk.model.loads.load import Line, OverSpeed
from gapwalk.model.loads.measured import OfCurve, orders_words, series_lines
from gapwalk.model.measured.crank_orders import ERROR, MAX_LINES, OrderTable, one_period, orders_of
from gapwalk.model.measured.curve_map import CurveMap, Series, angle_column, merged, orders_at, read_map
from gapwalk.model.measured.measured_table import SpeedTable, WantedColumn, named_errors, read_heads
from gapwalk.model.registry import Parameter
from gapwalk.model.units import Quantity, QuantityKind

Array = NDArray[np.float64]

_EXACT = 1e-12  # share of the energy of the inertia torque that is left out: 1e-6 of its amplitude
_SAMPLES = 3600  # in a turn
_FINER = 16  # times as many samples of straight lines between those of an uneven trace: orders to 1e-7 of the largest
_LONGER = 1.02  # times the crank radius: a shorter rod makes a torque of more orders than are kept
_HIGHEST = 5e7  # Pa: no cylinder holds more
_LOWEST = 1e3  # Pa: no cylinder works with less


@dataclass(frozen=True)
class Cylinder(OfCurve):
    """The torque of a piston on its crank, of the gas and of the reciprocating mass; made by `Cylinder.of`.

    The torque of the gas is ``scale`` times the sum of its mean and orders (see `Measured`), which may depend on the
    speed by a map or by `over_speed`. The torque of the mass is exactly ``-reciprocating * x'(a) * x''(a) * speed**2``
    with the path ``x(a)`` of the piston over the crank angle and the speed of the crank. Both are torques at the mean
    speed.

    A rotating mass makes no torque at a steady speed: it belongs to the inertia of the throw, as does the mean inertia
    of the reciprocating mass (about half of it times the square of the crank radius).

    Notes
    -----
    With the crank radius r, the rod l and ``q = sqrt(1 - (r/l)**2 * sin(a)**2)``: ``x = r + l - r*cos(a) - l*q``, so
    ``x' = r*(sin(a) + (r/l)*sin(a)*cos(a)/q)``. The orders of ``x'*x''`` are those of its samples, to 1e-6 of the
    largest; no series in r/l is cut off.

    Examples
    --------
    >>> angle = np.linspace(0.0, 4.0 * np.pi, 721)
    >>> pressure = 1e5 + 5e6 * np.exp(20.0 * np.cos(0.5 * angle - 0.1) - 20.0)
    >>> load = gw.loads.Cylinder.of(angle, pressure, {"q1": 1.0}, bore=0.1, stroke=0.12, rod=0.2, reciprocating=2.0)
    >>> [order for order, *_ in load.inertia][:4], load.turns  # periods in the cycle of two turns
    ([2, 4, 6, 8], 2)
    """

    key, words = "cylinder", "the torque of a cylinder on its crank"
    parameters = (
        Parameter("reciprocating", QuantityKind.MASS, "it is the mass that moves with the piston", 0.0, 0.0),
        Parameter("scale", None, "it is a factor of the torque of the gas", 1.0),
        Parameter("firing", QuantityKind.PHASE, "it is the crank angle at which its trace begins", default=0.0),
    )

    table_keys: ClassVar[Mapping[str, tuple[Any, Any]]] = {
        "pressure": (NamedFile, ...),
        "bore": (QuantityKind.LENGTH, ...),
        "stroke": (QuantityKind.LENGTH, ...),
        "rod": (QuantityKind.LENGTH, ...),
        "per": (Literal["turn", "cycle"], "cycle"),
        "ambient": (QuantityKind.PRESSURE, 0.0),
        "highest": (float | None, None),
        "error": (float, ERROR),
        "column": (str, ""),
        "over_speed": (OverSpeed, ()),
    }

    #: tuple of (int, float, float): The torque of the gas: for each order, its periods in a period of the pressure, its
    #: cosine and its sine amplitude. Of a map, each amplitude is a tuple of one number for each speed.
    series: Series
    inertia: Series  #: The torque of the reciprocating mass, by its size and by the square of the speed, likewise.
    #: The vector along which it acts, by coordinate name.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    order: int = 1  #: Periods of the trace in a period of the excitation, an integer >= 1.
    turns: int = 2  #: Turns of the crank in a period of the trace: 2 for four strokes, 1 for two.
    reciprocating: float = 0.0  #: The mass of the piston, with its pin and the upper part of the rod.
    scale: float = 1.0  #: Factor of the torque of the gas.
    firing: float = 0.0  #: In radians of the crank: the later, the larger.
    mean: Any = 0.0  #: The mean torque of the gas. Of a map it is a tuple, a number for each speed.
    over_speed: OverSpeed = ()  #: A factor of the torque of the gas over the speed, as for `Harmonic`.
    left_out: float = 0.0  #: The share of the energy of the gas torque that is in orders which are left out.
    source: str = ""  #: Name of the file.
    speeds: tuple[Any, ...] = ()  #: Of a map: its name, unit of speeds, frequency W at the speed 1, and speeds.
    name: str = ""  #: Prefix of its parameters' names.

    @classmethod
    def of(
        cls,
        angle: ArrayLike,
        pressure: ArrayLike,
        acts_on: Mapping[str, float],
        *,
        bore: float,
        stroke: float,
        rod: float,
        speeds: Sequence[float] = (),
        **fields: Any,
    ) -> Self:
        """Make a cylinder from the pressure over the crank angle.

        Parameters
        ----------
        angle : shape (samples,)
            Crank angles in rad over one period, from a top dead centre at 0; see `gapwalk.loads.orders_of`.
        pressure : shape (samples,) or (speeds, samples)
            In Pa; for a map one row for each speed.
        acts_on
            The inertia of the throw (the coordinate), with the factor 1.
        bore, stroke, rod
            In m: the diameter of the piston, twice the crank radius, the length of the rod between its centres.
        speeds
            Of a map: the frequencies W of its rows.
        **fields
            Further fields of `Cylinder`; and ``per`` (``"cycle"``, or ``"turn"`` for two strokes), ``ambient`` (the
            pressure under the piston); ``highest`` (the highest order that is kept, of both torques), or ``error`` (as
            of `gapwalk.loads.orders_of`).

        Returns
        -------
        Cylinder

        Raises
        ------
        ModelError
            As `gapwalk.loads.orders_of`; also if the rod is hardly longer than the crank radius, or the pressure is
            highest near the bottom dead centre.

        Examples
        --------
        >>> angle = np.radians(np.arange(0.0, 360.0, 1.0))
        >>> pressure = 1e5 + 2e6 * np.exp(3.0 * np.cos(angle) - 3.0)
        >>> two = gw.loads.Cylinder.of(angle, pressure, {"q1": 1.0}, bore=0.05, stroke=0.05, rod=0.1, per="turn")
        >>> abs(two.mean) < 1e-9  # a trace that is the same before and after the top does no work
        True
        """
        rows = [np.asarray(row, dtype=float) for row in (pressure if speeds else [pressure])]  # pyright: ignore
        if speeds and len(speeds) != len(rows):
            raise ModelError(f"there are {len(speeds)} speeds, but {len(rows)} rows of pressures; a speed has one row")
        found = tuple(map(float, speeds))
        curves = CurveMap(
            tuple((np.asarray(angle, dtype=float), row) for row in rows),
            SpeedTable(found, found).speeds if speeds else (),
            name="the pressure",
        )
        return cls._from(curves, acts_on, bore, stroke, rod, **fields)

    @classmethod
    def _from(
        cls,
        curves: CurveMap,
        acts_on: Mapping[str, float],
        bore: float,
        stroke: float,
        rod: float,
        *,
        per: Literal["turn", "cycle"] = "cycle",
        ambient: float = 0.0,
        highest: float | None = None,
        error: float = ERROR,
        **fields: Any,
    ) -> Self:
        """Make it from pressures over the crank angle, for one or for several speeds."""
        for name, length in (("bore", bore), ("stroke", stroke), ("rod", rod)):
            check(name, length, Positive)
        turns = 2 if per == "cycle" else 1
        orders = None if highest is None else _orders_up_to(highest, turns)
        _check_rod(stroke, rod)
        area = 0.25 * math.pi * bore * bore

        def torque(angle: Array, pressure: Array) -> Array:
            return (pressure - ambient) * area * path_slopes(angle, stroke, rod)[0]

        def gas(angle: Array, pressure: Array, **how: Any) -> OrderTable:
            x, y = one_period(angle, pressure, turns)
            _check_top(x, y)
            if orders_of(x, y, per=per, orders=[1.0]).is_even:
                return orders_of(x, torque(x, y), per=per, **how)
            few = _SAMPLES * turns
            fine: Any = np.arange(_FINER * few) * (2.0 * math.pi / (_FINER * _SAMPLES))
            lines: Any = np.interp(fine, x, y, period=2.0 * math.pi * turns)
            spectrum = np.fft.rfft(torque(fine, lines))[: few // 2 + 1]  # corners have high orders, which would fold
            return orders_of(fine[::_FINER], np.fft.irfft(spectrum / _FINER, few), per=per, **how)

        tables = curves.tables(gas, orders, error=error)
        angle = np.arange(_SAMPLES) * (2.0 * math.pi / _SAMPLES)
        first, second = path_slopes(angle, stroke, rod)
        mass = orders_of(angle, -first * second, error=_EXACT).lines
        mass = [line for line in mass if highest is None or line.order <= highest]
        mean, series = merged([(each.mean, _series(each.lines, turns)) for each in tables])
        return cls(
            series,
            tuple((order, 0.0, sine) for order, _, sine in _series(mass, turns)),
            acts_on,
            turns=turns,
            mean=mean,
            left_out=max(each.left_out for each in tables),
            speeds=curves.speed_data,
            **fields,
        )

    @classmethod
    def from_table(cls, given: Mapping[str, Any], *, units: bool) -> Self:
        """See `Load.from_table`."""
        fields = {name: value for name, value in given.items() if name not in ("pressure", "column")}
        _check_rod(given["stroke"], given["rod"])
        fields |= {name: _plain(fields[name]) for name in ("bore", "stroke", "rod", "ambient")}
        file, heads = given["pressure"], read_heads(given["pressure"])
        pressure = WantedColumn("pressure", QuantityKind.PRESSURE if units else None, ("p",), given["column"], "column")
        curves = read_map(file, angle_column(heads, units), pressure, units=units)
        if units:
            with named_errors(file.name):
                _check_size(curves, float(_plain(given["scale"])), bool(given["over_speed"]), heads)
        return cls._from(curves, source=file.name, **fields)

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        mean, series = orders_at(numbers, frequency)
        if np.any(numbers["mean"]):
            yield Line(0, numbers["scale"] * mean)
        yield from series_lines(order, numbers["scale"], series, -numbers["firing"] / numbers["turns"])

    @classmethod
    def unscaled(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.unscaled`: the torque of the mass, at the speed of the crank."""
        speed = order * numbers["turns"] * frequency
        size = numbers["reciprocating"] * speed * speed
        return series_lines(order, size, numbers["inertia"], -numbers["firing"] / numbers["turns"])

    @classmethod
    def notes(cls, constants: Mapping[str, Any]) -> str:
        """Say which orders of the gas it has, its mean torque, and what is left out; see `Load.notes`."""
        means = np.atleast_1d(constants["mean"])
        mean = f"{means[0]:.4g}" if np.ptp(means) == 0.0 else f"{means.min():.4g} to {means.max():.4g}"
        return f"{orders_words(constants)}; mean torque {mean}"


def path_slopes(angle: ArrayLike, stroke: float, rod: float) -> tuple[Array, Array]:
    """Return the first and the second derivative of the path of a piston by the crank angle, from the top."""
    sine, cosine = np.sin(angle), np.cos(angle)
    radius, share = 0.5 * stroke, 0.5 * stroke / rod
    root = np.sqrt(1.0 - (share * sine) ** 2)
    first = radius * sine * (1.0 + share * cosine / root)
    second = radius * (cosine + share * ((cosine**2 - sine**2) / root + (share * sine * cosine) ** 2 / root**3))
    return first, second


def _orders_up_to(highest: float, turns: int) -> list[float]:
    """Return all orders up to the highest, of which there is one at least."""
    check("highest", highest, Positive)
    count = math.floor(highest * turns + 1e-9)
    if not 1 <= count <= MAX_LINES:
        raise ModelError(f"highest is {highest:g}; it must be an order from {1 / turns:g} to {MAX_LINES / turns:g}")
    return [order / turns for order in range(1, count + 1)]


def _series(lines: Iterable[Any], turns: int) -> Series:
    return tuple((round(line.order * turns), line.cosine, line.sine) for line in lines)


def _plain(value: Any) -> Any:
    """Return a number in SI units of one that may have a unit."""
    return value.number * value.factor if isinstance(value, Quantity) else value


def _check_rod(stroke: Any, rod: Any) -> None:
    """Refuse a rod with which the crank cannot turn, or hardly; the lengths are numbers, or have units."""
    if _plain(rod) < _LONGER * 0.5 * _plain(stroke):
        raise ModelError(
            f"rod is {rod}; it must be longer than the crank radius, half of the stroke {stroke}, by 2 % at least; "
            "write the distance of its two centres, 1.5 to 2.5 strokes"
        )


def _check_top(angle: Array, pressure: Array) -> None:
    """Refuse a pressure that is highest near the bottom dead centre: its angles do not begin at the top."""
    at = float(angle[int(np.argmax(pressure))])
    if np.ptp(pressure) > 0.0 and math.cos(at) < 0.0:
        raise ModelError(
            f"the pressure is highest at {math.degrees(at):.5g} deg, nearer to the bottom than to the top dead centre; "
            "0 and 360 deg of a trace are top dead centres, so shift its angles"
        )


def _check_size(curves: CurveMap, scale: float, is_relative: bool, heads: Sequence[ColumnHead]) -> None:
    """Refuse pressures that are too large or too small for their unit."""
    peak = abs(scale) * max(float(np.max(np.abs(pressure))) for _, pressure in curves.curves)
    if peak > _HIGHEST or (peak < _LOWEST and not is_relative):
        units = sorted({head.unit for head in heads if head.is_of(QuantityKind.PRESSURE)})
        raise ModelError(
            f"its pressure reaches {peak:.4g} Pa, which no cylinder has; its unit {', '.join(units)} may be wrong: "
            "name the column pressure (bar), (MPa) or (Pa)"
        )
