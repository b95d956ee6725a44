"""Retained coordinates of a reduction: those of contacts and loads, and those that the user names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.reduction.sparse_matrices import Matrices

_FEW = 2  # most coordinates of a contact or load that are retained; for more, its static response is used instead


class Kept(NamedTuple):
    """The coordinates and forces that are retained.

    Attributes
    ----------
    places : shape (kept,)
        Indices of the coordinates, in the order of the full system.
    spread : shape (n, spread)
        Forces that act on more than a few coordinates: their static response is included instead.
    """

    places: NDArray[np.intp]
    spread: NDArray[np.float64]


def kept_of(matrices: Matrices, coordinates: Sequence[str], names: Sequence[str] = ()) -> Kept:
    """Select what is retained of a system with these coordinates, including those of the given `names`.

    Raises
    ------
    ModelError
        If a name is not that of a coordinate.
    """
    if isinstance(names, str):
        raise ModelError(f'keep is {names!r}; it must be a list of coordinates: write keep=["{names}"]')
    for name in names:
        if name not in coordinates:
            raise ModelError(f"keep names {name!r}, which is not a coordinate; {did_you_mean(str(name), coordinates)}")
    ports = matrices.ports
    counts = np.count_nonzero(ports, axis=0)
    near = np.flatnonzero(ports[:, counts <= _FEW].any(axis=1)).tolist()
    asked = [coordinates.index(name) for name in names]
    return Kept(np.array(sorted({*near, *asked}), dtype=np.intp), ports[:, counts > _FEW])
