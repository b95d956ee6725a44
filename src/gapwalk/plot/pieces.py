"""A branch cut into pieces of one kind of stability each, exactly at its special points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.point import BranchPoint

_BETWEEN = 5  # parts into which the way from one point to the next is divided, so that it looks as smooth as it is
_SAME = 1e-9  # arclength below which two points are one


class Piece(NamedTuple):
    """A stretch of a branch on which stability does not change.

    Attributes
    ----------
    label
        The kind of instability, see `Instability.label`.
    x : shape (points,)
        Parameter. Neighbouring pieces share the point between them.
    y : shape (points,) or (points, curves)
        Measure, or several of them.
    """

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def pieces_of(branch: Branch, measure: str) -> list[Piece]:
    """Cut a branch into pieces, in the order of the walk."""
    return [piece._replace(y=piece.y[:, 0]) for piece in cut(branch, lambda point: np.array([point.measure(measure)]))]


def cut(branch: Branch, curves: Callable[[BranchPoint], NDArray[np.float64]]) -> list[Piece]:
    """Cut a branch into pieces with the curves that a function of its points draws."""
    nodes = [(point.arclength, point, point.instability.label, False) for point in branch.points]
    nodes += [(each.point.arclength, each.point, each.after.label, True) for each in branch.special_points]
    nodes.sort(key=lambda node: node[0])
    s = np.array([arclength for arclength, *_ in nodes])
    values = np.array([(point.value, *curves(point)) for _, point, *_ in nodes])
    # A node begins its piece: a special point has the label of what follows it.
    starts = [i for i in range(len(nodes)) if i == 0 or nodes[i][2] != nodes[i - 1][2]]
    pieces = []
    for start, end in zip(starts, [*starts[1:], len(nodes) - 1], strict=True):
        if end > start or len(nodes) == 1:
            special = [i for i in range(start, end + 1) if nodes[i][3] or i in (start, end)]
            special = special if len(special) > 1 else [start, end]
            line = np.concatenate([_smooth(s[a : b + 1], values[a : b + 1]) for a, b in pairwise(special)])
            pieces.append(Piece(nodes[start][2], line[:, 0], line[:, 1:]))
    return pieces


def _smooth(s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A smooth line through points between two special points; at a special point it may have a corner."""
    apart = (s - s[0] > _SAME) & (s[-1] - s > _SAME) & np.append(True, np.diff(s) > _SAME)
    apart[[0, -1]] = True
    s, values = s[apart], values[apart]
    if len(s) < 3:
        return values
    fine = np.interp(np.linspace(0, len(s) - 1, _BETWEEN * (len(s) - 1) + 1), np.arange(len(s)), s)
    line = Akima1DInterpolator(s, values, method="makima")(fine)
    line[::_BETWEEN] = values  # not just to rounding: pieces meet in one point
    return line


def joined(
    curves: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Curves of one style as one, with nan between them: a thousand lines take matplotlib a hundred times one."""
    breaks = np.cumsum([len(x) for x, _ in curves])
    x, y = (np.insert(np.concatenate(parts), breaks, np.nan) for parts in zip(*curves, strict=True))
    return x, y
