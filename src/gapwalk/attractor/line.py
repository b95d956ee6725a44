"""Names of spectral lines: W, 2W, W/3, 5W/3, and what lies between."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction


def line_name(
    order: float | Fraction, periods: Sequence[int] = (1,), within: float = 1e-9, turns: int | None = None
) -> str:
    """The name of a line at a multiple of W, or of an order per turn of a shaft.

    Parameters
    ----------
    order
        The multiple, or the order.
    periods
        Each m in it gives names to the multiples of W/m; the first that fits is taken.
    within
        How near to one of those an order must be.
    turns
        Periods of the excitation in a turn of the shaft, where orders are counted per turn.

    Returns
    -------
    str
        ``"mean"``, ``"W"``, ``"2W"``, ``"W/3"``, ``"5W/3"``; or ``"0.231W"`` if it is none. Per turn
        ``"order 2"``, ``"order 2/3"``, ``"order 0.462"``.
    """
    for period in periods:
        nearest = Fraction(round(float(order) * period / (turns or 1)), period) * (turns or 1)
        if abs(float(order) - nearest) <= within:
            return _fraction_name(nearest) if turns is None or not nearest else f"order {nearest}"
    return f"{float(order):.4g}W" if turns is None else f"order {float(order):.4g}"


def _fraction_name(order: Fraction) -> str:
    if order == 0:
        return "mean"
    top = "W" if order.numerator == 1 else f"{order.numerator}W"
    return top if order.denominator == 1 else f"{top}/{order.denominator}"
