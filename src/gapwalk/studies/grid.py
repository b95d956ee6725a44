"""What maps over a plane share: the number of their cells, and the parameters along their axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gapwalk.errors import ModelError
from gapwalk.model.system import System

Within = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of two axes."""

MAX_CELLS = 10_000_000
"""Of a map over a plane; of each some hundred bytes are kept."""


def check_resolution(given: int | tuple[int, int]) -> tuple[int, int]:
    """The number of columns and rows, or a ModelError that says what to write."""
    both = (given, given) if isinstance(given, int) else tuple(given)
    if len(both) != 2 or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in both):
        raise ModelError(f"resolution is {given!r}; write a number of cells, or (columns, rows)")
    if both[0] * both[1] > MAX_CELLS:
        raise ModelError(f"resolution is {both[0]:,} x {both[1]:,} cells; there may be {MAX_CELLS:,}, as 4000 x 2500")
    return both


def check_parameters(system: System, plane: Mapping[str, Sequence[float]]) -> tuple[tuple[str, str], Within]:
    """The names of two parameters of a plane, the horizontal one first, and their ranges; or a ModelError."""
    if len(plane) != 2:
        raise ModelError(
            f"a plane has two axes, but {len(plane)} ranges were given ({', '.join(plane) or 'none'}); write "
            '{"frequency": (0.2, 1.2), "harmonic1.amplitude": (0, 1)}'
        )
    first, second = plane
    return (first, second), (_range(system, first, plane[first]), _range(system, second, plane[second]))


def _range(system: System, name: str, given: Sequence[float]) -> tuple[float, float]:
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        raise ModelError(f"the range of {name} is {given!r}; write two numbers (low, high)") from None
    for value in (low, high):
        system.at({name: value})
    if not low < high:
        raise ModelError(f"the range of {name} is from {low:g} to {high:g}: it is empty; write (low, high)")
    return low, high
