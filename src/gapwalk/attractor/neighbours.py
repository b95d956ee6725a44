"""Which states are beside one another: the cells of a plane, and random states of a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NEAREST = 4  # as a cell of a plane has


def beside_cells(rows: int, columns: int) -> NDArray[np.intp]:
    """The cells left and right of, below and above each cell of a plane, row by row; shape (cells, 4).

    Where a side has none, it is the cell itself.
    """
    numbers = np.arange(rows * columns).reshape(rows, columns)
    wide = np.pad(numbers, 1, mode="edge")
    sides = (wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1])
    return np.stack([side.ravel() for side in sides], axis=1)


def beside_states(states: NDArray[np.float64]) -> NDArray[np.intp]:
    """The four nearest others of each state, distances in units of the ranges of its components; shape (count, 4)."""
    from scipy.spatial import cKDTree  # imported late: it takes long

    widths = np.ptp(states, axis=0)
    scaled = states / np.where(widths > 0.0, widths, 1.0)
    count = min(_NEAREST, len(states) - 1)
    _, nearest = cKDTree(scaled).query(scaled, k=np.arange(1, count + 2))
    return np.asarray(nearest[:, 1:], dtype=np.intp)


def differs(labels: NDArray[np.int_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which labels differ from that of a neighbour."""
    return (labels[neighbours] != labels[:, None]).any(axis=1)


def about(marked: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which states are marked, or have a neighbour that is."""
    return marked | marked[neighbours].any(axis=1)
