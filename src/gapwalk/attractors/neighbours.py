"""Neighbourhoods of states: cells of a plane, and random states of a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NEAREST = 4  # as for a cell of a plane


def beside_cells(rows: int, columns: int) -> NDArray[np.intp]:
    """Return the indices of the left, right, lower and upper neighbours of the cells, row by row; shape (cells, 4).

    At an edge of the plane the missing neighbour is the cell itself.
    """
    numbers = np.arange(rows * columns).reshape(rows, columns)
    wide = np.pad(numbers, 1, mode="edge")
    sides = (wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1])
    return np.stack([side.ravel() for side in sides], axis=1)


def beside_states(states: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the four nearest other states of each state, scaled by the ranges of the components; shape (count, 4)."""
    from scipy.spatial import cKDTree  # imported late: it takes long

    widths = np.ptp(states, axis=0)
    scaled = states / np.where(widths > 0.0, widths, 1.0)
    count = min(_NEAREST, len(states) - 1)
    _, nearest = cKDTree(scaled).query(scaled, k=np.arange(1, count + 2))
    return np.asarray(nearest[:, 1:], dtype=np.intp)


def differs(labels: NDArray[np.int_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the labels that differ from the label of a neighbour."""
    return (labels[neighbours] != labels[:, None]).any(axis=1)


def about(marked: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the states that are marked already or have a marked neighbour."""
    return marked | marked[neighbours].any(axis=1)
