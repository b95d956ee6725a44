"""Names of spectral lines: W, 2W, W/3, 5W/3, and names of lines between them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction


def line_name(
    order: float | Fraction, periods: Sequence[int] = (1,), within: float = 1e-9, turns: int | None = None
) -> str:
    """Return the name of a line at a multiple of W, or at an order per turn of a shaft.

    Parameters
    ----------
    order
        The multiple, or the order.
    periods
        Each m in it adds names for the multiples of W/m; the first name that fits is used.
    within
        Largest difference between the order and a named one.
    turns
        Forcing periods per turn of the shaft, if orders are counted per turn.

    Returns
    -------
    str
        ``"mean"``, ``"W"``, ``"2W"``, ``"W/3"``, ``"5W/3"``; or ``"0.231W"`` if no name fits. Per turn
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
