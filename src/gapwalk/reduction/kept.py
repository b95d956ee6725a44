"""Which coordinates a reduction keeps: those at which contacts and loads act, and those asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.problem import did_you_mean
from gapwalk.reduction.matrices import Matrices

_FEW = 2  # coordinates at most of a contact or a load that are kept; of more, its static response is


class Kept(NamedTuple):
    """What is kept.

    Attributes
    ----------
    places : shape (kept,)
        Places of the coordinates, in the order of the full system.
    spread : shape (n, spread)
        Forces that act on more than a few coordinates: their static response is kept instead.
    """

    places: NDArray[np.intp]
    spread: NDArray[np.float64]


def kept_of(matrices: Matrices, coordinates: Sequence[str], names: Sequence[str] = ()) -> Kept:
    """What is kept of a system with these coordinates, where those of some `names` are asked for.

    Raises
    ------
    ModelError
        If a name is that of no coordinate.
    """
    if isinstance(names, str):
        raise ModelError(f'keep is {names!r}; it must be a list of coordinates: write keep=["{names}"]')
    for name in names:
        if name not in coordinates:
            raise ModelError(f"keep names {name!r}, which is no coordinate; {did_you_mean(str(name), coordinates)}")
    ports = matrices.ports
    counts = np.count_nonzero(ports, axis=0)
    near = np.flatnonzero(ports[:, counts <= _FEW].any(axis=1)).tolist()
    asked = [coordinates.index(name) for name in names]
    return Kept(np.array(sorted({*near, *asked}), dtype=np.intp), ports[:, counts > _FEW])
