"""The orders of a measured torque, or of a measured motion, over the angle of a shaft: its Fourier series.

Order 1 has one period in a turn of the shaft. A signal that repeats with the cycle of a four-stroke engine, two turns,
has the orders 0.5, 1, 1.5, ...
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Fraction, check
from gapwalk.model.measured.measured_table import finite_row

Array = NDArray[np.float64]

ERROR = 1e-4
"""Default of the largest share of the energy that is left out."""
MAX_LINES = 100
"""Largest number of orders of a table."""
MEAN_SHARE = 0.01
"""Largest mean acceleration of a periodic motion, as a share of its effective value."""

_TURNS = {"turn": 1, "cycle": 2}
_EVEN = 1e-2  # of a step: how far samples may be from even ones, as where angles were rounded in the file
_CLOSED = 0.02  # of a step: an angle so close to the first one, a period later, is that angle
_GAP = 1.5  # of the largest step: the gap at the end that is completed
_MOSTLY, _HOLE = 0.9, 4.0  # share of steps that are equal, and the steps in a hole, from which samples are missing
_JUMP = 0.01  # of the range of the signal: how much a period may begin and end differently
_BLOCK = 64  # harmonics of a polyline that are computed at once
_HIGHEST = 2048  # harmonic of a polyline
_WORK = 50_000_000  # harmonics times samples: some seconds


@dataclass(frozen=True, slots=True)
class OrderLine:
    """A part ``cosine * cos(order * angle) + sine * sin(order * angle)`` of a signal."""

    order: float  #: Periods in a turn of the shaft.
    #: cosine, sine: In the unit of the signal.
    cosine: float
    sine: float

    @property
    def energy(self) -> float:
        """Its mean square."""
        return 0.5 * (self.cosine * self.cosine + self.sine * self.sine)


@dataclass(frozen=True)
class OrderTable:
    """A signal over the angle of a shaft, as a mean and some orders."""

    turns: int  #: Turns of the shaft in a period: 1, or 2 for the cycle of a four-stroke engine.
    mean: float  #: The mean.
    lines: tuple[OrderLine, ...]  #: The orders that are kept, the lowest first.
    #: The share of the energy (the mean square without the mean) that is in the orders which are not kept.
    left_out: float
    samples: int  #: Number of samples in a period.
    #: True if they are evenly spaced: then the orders are those of the trigonometric polynomial through them. Otherwise
    #: they are those of the straight lines between them.
    is_even: bool
    #: The largest order that `error` leaves out below the strongest one, and its amplitude relative to that; else 0.
    low_left: tuple[float, float] = (0.0, 0.0)

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        numbers = [self.mean, self.left_out, *(n for each in self.lines for n in (each.order, each.cosine, each.sine))]
        orders = list(self.orders)
        if self.turns not in _TURNS.values() or not np.isfinite(numbers).all():
            raise ValueError("a table of orders needs finite numbers, and a period of one or two turns")
        if orders != sorted({*orders}) or any(order <= 0.0 or order * self.turns % 1.0 for order in orders):
            raise ValueError("the orders of a table must increase, and repeat a whole number of times in its period")

    @property
    def orders(self) -> tuple[float, ...]:
        """The orders that are kept."""
        return tuple(each.order for each in self.lines)

    @property
    def words(self) -> str:
        """Describe the orders that are kept in one line."""
        kept = ", ".join(f"{order:g}" for order in self.orders) or "none"
        uneven = f"; lines between uneven samples change the highest one by about {100.0 * self.lines_error:.2g} %"
        return (
            f"orders {kept}, which leave out {100.0 * self.left_out:.2g} % of the energy of {self.samples:,} samples"
            + uneven * (not self.is_even)
        )

    @property
    def lines_error(self) -> float:
        """About the share of the highest order of a smooth signal that straight lines between uneven samples lose.

        It is ``(order * step)**2 / 12`` for the mean step, the leading term of the spectrum of a triangle. It is 0 for
        even samples.
        """
        if self.is_even or not self.lines:
            return 0.0
        return (self.lines[-1].order * 2.0 * math.pi * self.turns / self.samples) ** 2 / 12.0

    def value(self, angle: ArrayLike) -> Any:
        """Return the signal at some angles (rad), of their shape."""
        x = np.asarray(angle)
        total = np.full(x.shape, self.mean)
        for each in self.lines:
            total = total + each.cosine * np.cos(each.order * x) + each.sine * np.sin(each.order * x)
        return total[()]


def orders_of(
    angle: ArrayLike,
    torque: ArrayLike,
    *,
    orders: Sequence[float] | None = None,
    per: Literal["turn", "cycle"] = "turn",
    error: float = ERROR,
) -> OrderTable:
    """Find the orders of a torque that was measured over the angle of a shaft.

    Parameters
    ----------
    angle : shape (samples,)
        Angles of the shaft in rad, increasing, over one period. The sample that ends the period may be there or not.
        Two samples with the same angle are a jump.
    torque : shape (samples,)
        In any unit.
    orders
        The orders to keep; by default the fewest that leave out a smaller share of the energy than `error`.
    per
        The period: a ``"turn"``, or a ``"cycle"`` of two turns.
    error
        Largest share of the energy that is left out.

    Returns
    -------
    OrderTable

    Raises
    ------
    ModelError
        If the angles do not cover a period, the torque does not end as it begins (within 1 % of its range), an order
        does not belong to the period or is higher than the samples resolve, or more than 100 orders are needed.

    Notes
    -----
    For even samples (to 1 % of their distance) the discrete Fourier transform is taken; for others the Fourier
    integrals of the straight lines between them, in closed form: with the rises ``r_i`` over the widths ``w_i`` about
    the middles ``m_i``, ``cosine = -2 / (T k) sum r_i sin(k m_i) sinc(k w_i / 2)``, and ``sine`` by the
    same sum with ``-cos`` in place of ``sin``.

    Examples
    --------
    >>> angle = np.linspace(0.0, 4.0 * np.pi, 721)
    >>> table = gw.loads.orders_of(angle, 80.0 + 40.0 * np.cos(2.0 * angle) + 9.0 * np.sin(0.5 * angle), per="cycle")
    >>> [(each.order, round(abs(each.cosine), 9), round(abs(each.sine), 9)) for each in table.lines]
    [(0.5, 0.0, 9.0), (2.0, 40.0, 0.0)]
    """
    turns = turns_in(per)
    check("error", error, Fraction)
    angles, values = one_period(angle, torque, turns)
    scale = float(np.max(np.abs(values)))
    if not scale > 0.0:
        scale = 1.0
    step = 2.0 * math.pi * turns / len(angles)
    is_even = bool(np.max(np.abs(angles - angles[0] - step * np.arange(len(angles)))) <= _EVEN * step)
    find = _of_samples if is_even else _of_polyline
    found, mean, energy = find(
        angles, values / scale, turns, float(error) if orders is None else _highest(orders, turns)
    )
    kept = _fewest(found, energy, error) if orders is None else _chosen(found, orders, turns)
    share = max(energy - sum(each.energy for each in kept), 0.0) / energy if energy else 0.0
    lines = tuple(OrderLine(each.order, scale * each.cosine, scale * each.sine) for each in kept)
    low = _low_left(found, kept) if orders is None else (0.0, 0.0)
    return OrderTable(turns, scale * mean, lines, share, len(angles), is_even, low)


def _low_left(found: Sequence[OrderLine], kept: Sequence[OrderLine]) -> tuple[float, float]:
    """Return the largest order that is left out below the strongest one, and the ratio of their amplitudes."""
    strongest = max(kept, key=lambda each: each.energy, default=None)
    low = [each for each in found if strongest and each.order < strongest.order and each not in kept]
    if strongest is None or not low:
        return 0.0, 0.0
    most = max(low, key=lambda each: each.energy)
    return most.order, math.sqrt(most.energy / strongest.energy)


def turns_in(per: str) -> int:
    """Return the turns in a period."""
    if per not in _TURNS:
        raise ModelError(f'per is {per!r}; it is "turn", or "cycle" for two turns')
    return _TURNS[per]


def displacement_orders(
    angle: ArrayLike,
    *,
    displacement: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    speed: float | None = None,
    orders: Sequence[float] | None = None,
    per: Literal["turn", "cycle"] = "turn",
    error: float = ERROR,
) -> OrderTable:
    """Find the orders of a prescribed motion that was measured over the angle of a shaft.

    Parameters
    ----------
    angle : shape (samples,)
        Angles of the shaft in rad; see `orders_of`. For a signal over time with one period ``T``,
        ``2 * pi * time / T``.
    displacement, acceleration : shape (samples,)
        One of the two.
    speed
        Speed of the shaft at which the acceleration was measured, in rad per unit of its time (over time,
        ``2 * pi / T``).
    orders, per, error
        See `orders_of`. If the acceleration is given, `error` is a share of the energy of the acceleration.

    Returns
    -------
    OrderTable
        The displacement. Each order of an acceleration is divided by ``-(order * speed)**2``, and the mean
        displacement, which cannot follow from an acceleration, is 0.

    Raises
    ------
    ModelError
        As `orders_of`; also if the mean acceleration is more than 1 % of its effective value: no periodic motion has
        one.

    Examples
    --------
    >>> angle = np.linspace(0.0, 2.0 * np.pi, 37)
    >>> table = gw.loads.displacement_orders(angle, acceleration=4.0 * np.cos(2.0 * angle), speed=10.0)
    >>> round(table.lines[0].cosine, 9)  # -4 / (2 * 10)**2
    -0.01
    """
    if (displacement is None) == (acceleration is None):
        raise ModelError("a prescribed motion has a displacement or an acceleration: give one of them")
    if displacement is not None:
        return orders_of(angle, displacement, orders=orders, per=per, error=error)
    if isinstance(speed, bool) or not isinstance(speed, int | float) or not 0.0 < abs(speed) < math.inf:
        raise ModelError(f"speed is {speed!r}; an acceleration needs the speed at which it was measured, as in 157.1")
    table = orders_of(angle, np.asarray(acceleration), orders=orders, per=per, error=error)
    effective = float(np.std(np.asarray(acceleration, dtype=float)))
    if abs(table.mean) > MEAN_SHARE * effective:
        raise ModelError(
            f"the mean acceleration is {table.mean:.4g}, but its effective value {effective:.4g}; in a periodic motion "
            f"the mean vanishes (to {MEAN_SHARE:g} of the effective value). Subtract the offset of the sensor"
        )
    lines = tuple(
        OrderLine(each.order, -each.cosine / (each.order * speed) ** 2, -each.sine / (each.order * speed) ** 2)
        for each in table.lines
    )
    return replace(table, mean=0.0, lines=lines)


def one_period(angle: ArrayLike, values: ArrayLike, turns: int) -> tuple[Array, Array]:
    """Return the samples of one period, without the one that ends it."""
    x, y = finite_row(angle, "angles"), finite_row(values, "values")
    if len(x) != len(y):
        raise ModelError(f"there are {len(x)} angles, but {len(y)} values; a sample has one of each")
    if len(x) < 3:
        raise ModelError(f"there are {len(x)} samples; a period needs 3 at least")
    if np.max(np.abs(x)) > 1e6 or np.max(np.abs(y)) > 1e100:
        raise ModelError("its numbers are too large; angles are in rad, and values below 1e100")
    steps = np.diff(x)
    back = np.flatnonzero(steps < 0.0)
    if len(back):
        at = int(back[0])
        hint = " (if it begins again from 0 after a turn, add a turn)" if steps[at] < -math.pi else ""
        raise ModelError(
            f"the angle does not increase from sample {at + 1} ({_degrees(x[at])}) to sample {at + 2} "
            f"({_degrees(x[at + 1])}); sort the samples by angle{hint}"
        )
    if np.any((steps[1:] == 0.0) & (steps[:-1] == 0.0)):
        at = int(np.flatnonzero((steps[1:] == 0.0) & (steps[:-1] == 0.0))[0])
        raise ModelError(f"there are three samples at {_degrees(x[at])}; two are a jump, so give at most two")
    _check_rows(x, y)
    period = 2.0 * math.pi * turns
    span, largest = float(x[-1] - x[0]), float(np.max(steps))
    near = _CLOSED * min(float(np.median(steps)) or largest, largest)
    gap = period - span
    if gap < -near or gap > _GAP * largest + near:
        raise ModelError(_not_a_period(x, turns, largest))
    if gap <= near:
        jump, width = abs(float(y[-1] - y[0])), float(np.ptp(y))
        if jump > _JUMP * width:
            raise ModelError(
                f"the values do not end as they begin: {y[0]:.6g} at {_degrees(x[0])}, but {y[-1]:.6g} a period later; "
                f"a periodic signal does (within {_JUMP:g} of its range). Take the mean of several periods"
            )
        y[0] = 0.5 * (y[0] + y[-1])
        x, y = x[:-1], y[:-1]
    return x, y


def _check_rows(x: Array, y: Array) -> None:
    """Refuse even samples of which some are missing; a long step between equal values is a line that is meant."""
    steps = np.diff(x)
    usual, at = float(np.median(steps)), int(np.argmax(steps))
    even = np.mean(np.abs(steps - usual) <= _EVEN * usual) >= _MOSTLY
    if even and steps[at] > _HOLE * usual and abs(float(y[at + 1] - y[at])) > _JUMP * float(np.ptp(y)):
        raise ModelError(
            f"samples are missing from {_degrees(x[at])} to {_degrees(x[at + 1])}: the other steps are "
            f"{_degrees(usual)}; give them, or samples on a straight line if it is one"
        )


def _not_a_period(x: Array, turns: int, step: float) -> str:
    span = float(x[-1] - x[0])
    words = {1: "a turn", 2: "a cycle of two turns"}
    other = 3 - turns
    fits = -_CLOSED * step <= 2.0 * math.pi * other - span <= _GAP * step
    hint = f'write per = "{"cycle" if other == 2 else "turn"}"' if fits else "give the samples of one period"
    return (
        f"the angles go from {_degrees(x[0])} to {_degrees(x[-1])}, which is not {words[turns]} ({360 * turns} deg), "
        f"nor one sample less; {hint}"
    )


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g} deg"


def _of_samples(angles: Array, values: Array, turns: int, _: float | int) -> tuple[list[OrderLine], float, float]:
    """Return all orders of even samples, the mean, and the energy of the trigonometric polynomial through them."""
    count = len(values)
    spectrum = np.fft.rfft(values) / count
    harmonics = np.arange(1, (count - 1) // 2 + 1)
    parts = 2.0 * spectrum[harmonics] * np.exp(-1j * harmonics * angles[0] / turns)  # c_k of sum Re(c_k exp(i k angle))
    lines = [
        OrderLine(float(harmonic) / turns, float(part.real), float(-part.imag))
        for harmonic, part in zip(harmonics, parts, strict=True)
    ]
    energy = sum(each.energy for each in lines)
    if count % 2 == 0:  # the highest order, of which the samples know one half
        energy += 0.5 * abs(spectrum[-1]) ** 2
    floor = (1e-14) ** 2  # the values are at most 1
    return lines, float(spectrum[0].real), energy if energy > floor else 0.0


def _of_polyline(angles: Array, values: Array, turns: int, until: float | int) -> tuple[list[OrderLine], float, float]:
    """Return orders of the straight lines between samples, the mean, and the energy of the lines.

    `until` is the share that is left out (a float), or the highest harmonic that is needed (an integer).
    """
    period = 2.0 * math.pi * turns
    nodes, levels = np.append(angles, angles[0] + period), np.append(values, values[0])
    widths, rises = np.diff(nodes), np.diff(levels)
    middles = 0.5 * (nodes[1:] + nodes[:-1]) / turns
    centre = 0.5 * (levels[1:] + levels[:-1])
    mean = float(np.sum(widths * centre) / period)
    energy = float(np.sum(widths * ((centre - mean) ** 2 + rises**2 / 12.0)) / period)
    lines: list[OrderLine] = []
    if energy <= (1e-14) ** 2:
        return lines, mean, 0.0
    wanted = until if isinstance(until, int) else min(_HIGHEST, max(2 * MAX_LINES, _WORK // len(rises)))
    kept = 0.0
    for first in range(1, wanted + 1, _BLOCK):
        for harmonic in range(first, min(first + _BLOCK, wanted + 1)):
            part = rises * np.sinc(harmonic * widths / (2.0 * math.pi * turns)) / (math.pi * harmonic)
            cosine, sine = -np.sum(part * np.sin(harmonic * middles)), np.sum(part * np.cos(harmonic * middles))
            lines.append(OrderLine(harmonic / turns, float(cosine), float(sine)))
            kept += lines[-1].energy
        # a tenth, so that hardly an order which is not computed is larger than one that is kept
        if isinstance(until, float) and energy - kept <= 0.1 * until * energy:
            break
    return lines, mean, energy


def _highest(orders: Sequence[float], turns: int) -> int:
    """Return the highest harmonic among some orders; refuse what is no order."""
    if isinstance(orders, str) or not isinstance(orders, Sequence) or not orders:
        raise ModelError(f"orders is {orders!r}; it is a list such as [0.5, 1, 2]")
    for order in orders:
        if isinstance(order, bool) or not isinstance(order, int | float) or not 0.0 < order <= _HIGHEST / turns:
            raise ModelError(f"the order {order!r} is none; orders are positive numbers up to {_HIGHEST // turns}")
        if order * turns % 1.0:
            allowed = "whole numbers" if turns == 1 else "multiples of 0.5"
            hint = '; with per = "cycle" it may be a multiple of 0.5' if turns == 1 and not order * 2 % 1.0 else ""
            raise ModelError(f"the order {order:g} does not repeat with the period; orders are {allowed}{hint}")
    if len({*orders}) < len(orders):
        raise ModelError(f"an order occurs twice in {list(orders)}")
    if len(orders) > MAX_LINES:
        raise ModelError(f"there are {len(orders)} orders; a table has at most {MAX_LINES}")
    return round(max(orders) * turns)


def _chosen(found: Sequence[OrderLine], orders: Sequence[float], turns: int) -> list[OrderLine]:
    if len(found) < (highest := round(max(orders) * turns)) and found:
        raise ModelError(
            f"the samples resolve orders up to {len(found) / turns:g}; order {highest / turns:g} needs more samples"
        )
    return sorted((each for each in found if each.order in orders), key=lambda each: each.order)


def _fewest(found: Sequence[OrderLine], energy: float, error: float) -> list[OrderLine]:
    """Return the fewest orders that leave out at most a share of the energy."""
    ranked = sorted(found, key=lambda each: -each.energy)  # of equal ones, the lower order first
    kept, left = 0, energy
    while kept < len(ranked) and left > max(error, _SMALLEST) * energy:
        left -= ranked[kept].energy
        kept += 1
    if kept > MAX_LINES or left > max(error, _SMALLEST) * energy:
        reached = (energy - sum(each.energy for each in ranked[:MAX_LINES])) / energy
        digits = 1 - math.floor(math.log10(max(reached, _SMALLEST)))
        written = math.ceil(reached * 10**digits) / 10**digits
        write = f"write error = {written:g}, or " if written < 0.5 else ""
        if kept <= MAX_LINES:
            resolved = f"orders up to {found[-1].order:g}" if found else "no order"
            raise ModelError(
                f"the samples resolve {resolved}, and {reached:.2g} of the energy is beyond, more than {error:g}; "
                f"{write}give more samples"
            )
        raise ModelError(
            f"more than {MAX_LINES} orders are needed so that no more than {error:g} of the energy is left out; "
            f"{write}smooth its jumps or its noise"
        )
    return sorted(ranked[:kept], key=lambda each: each.order)


_SMALLEST = 1e-14  # share of the energy: what rounding leaves
